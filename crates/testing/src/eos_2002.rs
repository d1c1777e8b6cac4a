//! Orientation and points of the Eos pair as Shan, Lee & Yoon 2002 publish them.

use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::pushbroom::{EulerPolynomial, VectorPolynomial};
use nalgebra::Vector3;

/// Orientation of an image at its first and last line: kilometres, degrees.
pub struct Ends {
    pub start_km: [f64; 3],
    pub end_km: [f64; 3],
    pub start_deg: [f64; 3],
    pub end_deg: [f64; 3],
    pub lines: f64,
    pub line_period_s: f64,
}

/// "Right": E02-02855, with the corrected start Y.
pub const RIGHT: Ends = Ends {
    start_km: [2_743.679, -2_435.358, -895.114],
    end_km: [2_749.133, -2_450.626, -836.828],
    start_deg: [11.370_1, -75.964_8, -126.576],
    end_deg: [12.181_0, -76.869_2, -125.672_8],
    lines: 9_856.0,
    line_period_s: 1.807_8e-3,
};
/// The start Y of "right" as published.
const MISPRINTED_Y_KM: f64 = -2_453.358;
/// "Left": E04-01275.
pub const LEFT: Ends = Ends {
    start_km: [2_638.162, -2_549.221, -891.875],
    end_km: [2_640.863, -2_557.746, -860.101],
    start_deg: [-8.629_6, -75.946_7, -124.566_6],
    end_deg: [-8.639_2, -75.945_2, -124.534_5],
    lines: 8_064.0,
    line_period_s: 1.205_2e-3,
};
/// Focal length over the pixel of three detectors.
pub const FOCAL_LENGTH_PX: f64 = 3_500.0 / 0.039;
/// Table 2: MOLA points, kilometres.
pub const POINTS_KM: [[f64; 3]; 10] = [
    [2_469.471, -2_191.971, -792.691],
    [2_469.504, -2_192.054, -792.363],
    [2_469.540, -2_192.134, -792.035],
    [2_469.596, -2_192.310, -791.380],
    [2_469.625, -2_192.397, -791.052],
    [2_469.659, -2_192.479, -790.724],
    [2_469.701, -2_192.552, -790.395],
    [2_469.764, -2_192.720, -789.740],
    [2_469.845, -2_192.987, -788.758],
    [2_469.876, -2_193.071, -788.430],
];

impl Ends {
    /// Orientation of first order through both ends.
    pub fn model(&self) -> EulerPolynomial {
        let through = |start: [f64; 3], end: [f64; 3], scale: f64| {
            let (start, end) = (Vector3::from(start) * scale, Vector3::from(end) * scale);
            VectorPolynomial {
                coefficients: [
                    (start + end) / 2.0,
                    (end - start) / self.lines,
                    Vector3::zeros(),
                ],
            }
        };
        EulerPolynomial {
            path_m: through(self.start_km, self.end_km, 1e3),
            angles_rad: through(self.start_deg, self.end_deg, RADIANS_PER_DEGREE),
        }
    }

    /// The pair with the start Y as published.
    pub fn misprinted(&self) -> Self {
        let [x, _, z] = self.start_km;
        Self {
            start_km: [x, MISPRINTED_Y_KM, z],
            ..*self
        }
    }
}
