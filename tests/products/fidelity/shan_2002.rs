//! Shan, Lee & Yoon 2002: orientation and points of the Eos pair.

use areograph::{
    body::MARS_IAU2000,
    geom::pushbroom::{EulerPolynomial, ExteriorOrientation, Projector},
    units::RADIANS_PER_DEGREE,
};
use nalgebra::Vector3;

use super::{
    eos_2002::{Ends, FOCAL_LENGTH_PX, LEFT, POINTS_KM, RIGHT},
    real_shots,
    row::{Account, Comparison, Kind, Paper, Row, derived, number},
    scene::GROUND_RADIUS_M,
    table_2::TABLE_2,
};

pub(crate) static PAPER: Paper = Paper {
    name: "Shan, Lee & Yoon 2002",
    citation: "Registration of the Eos pair; Int. Arch. Photogramm. Remote Sens. 34(4).",
    prefix: "S02",
    count: 9,
    rows: &[&ROWS],
};

/// Lines from the middle and places in the line of the points of Table 2, by an independent computation with the same
/// formula.
const POINTS_IN_IMAGE: [[&str; 2]; 10] = [
    ["-2681.91", "194.94"],
    ["-2620.17", "195.89"],
    ["-2558.45", "197.83"],
    ["-2435.05", "196.37"],
    ["-2373.27", "195.99"],
    ["-2311.54", "197.26"],
    ["-2249.74", "201.40"],
    ["-2126.44", "202.43"],
    ["-1941.40", "199.23"],
    ["-1879.67", "199.68"],
];
/// Numbers of the points in their profile, by their distances.
const NUMBERS: [f64; 10] = [0.0, 1.0, 2.0, 4.0, 5.0, 6.0, 7.0, 9.0, 12.0, 13.0];

/// What the printed table has of an image.
trait Look {
    fn look_deg(&self, share: f64) -> f64;
    fn emission_deg(&self, share: f64) -> f64;
    fn speed_km_s(&self) -> f64;
}

impl Look for Ends {
    /// Angle of the boresight from the centre of Mars at a share of the image, degrees.
    fn look_deg(&self, share: f64) -> f64 {
        let pose = self.model().pose(share * self.lines);
        let boresight = pose.mars_to_camera.row(2).transpose();
        boresight.angle(&-pose.position_m) / RADIANS_PER_DEGREE
    }

    fn emission_deg(&self, share: f64) -> f64 {
        let radius_m = self.model().pose(share * self.lines).position_m.norm();
        let sin = radius_m / GROUND_RADIUS_M * (self.look_deg(share) * RADIANS_PER_DEGREE).sin();
        sin.asin() / RADIANS_PER_DEGREE
    }

    fn speed_km_s(&self) -> f64 {
        let way_km = (Vector3::from(self.end_km) - Vector3::from(self.start_km)).norm();
        way_km / (self.lines * self.line_period_s)
    }
}

/// Geometry of the pair.
pub(crate) struct BaseAndHeight {
    /// Distance of the two orbits across the track, metres.
    pub(crate) base_m: f64,
    /// Height of the camera above the first point, metres.
    pub(crate) altitude_m: f64,
}

/// Base and height of the pair in the middle of its images.
pub(crate) fn base_and_height() -> BaseAndHeight {
    let [right, left] = [RIGHT, LEFT].map(|ends| ends.model());
    let (pose, motion) = right.pose_and_rate(0.0);
    let along = motion.advance_m.normalize();
    let apart_m = left.pose(0.0).position_m - pose.position_m;
    BaseAndHeight {
        base_m: (apart_m - along * apart_m.dot(&along)).norm(),
        altitude_m: pose.position_m.norm() - Vector3::from(POINTS_KM[4]).norm() * 1e3,
    }
}

fn right() -> Vec<Comparison> {
    let as_printed = RIGHT.misprinted().start_km;
    let radius = |place_km: [f64; 3]| Vector3::from(place_km).norm();
    let end = format!("{:.2}", radius(RIGHT.end_km));
    vec![
        derived(
            "orbit radius at the start with Y as published, compared with that at the end, km",
            end.clone(),
            radius(as_printed),
            2,
        )
        .departs(5.0),
        derived("with Y −2435.358, km", end, radius(RIGHT.start_km), 2).within(1.0),
        derived(
            "emission at the start, 2005, °",
            TABLE_2[0].emission_deg,
            RIGHT.emission_deg(-0.5),
            3,
        )
        .within(0.05),
        derived(
            "emission at the end, 2005, °",
            TABLE_2[0].emission_deg,
            RIGHT.emission_deg(0.5),
            3,
        )
        .within(0.05),
        derived(
            "look at the start, °",
            "not published",
            RIGHT.look_deg(-0.5),
            3,
        )
        .between(0.12, 0.13),
        derived(
            "look at the end, °",
            "not published",
            RIGHT.look_deg(0.5),
            3,
        )
        .between(0.111, 0.121),
    ]
}

fn left() -> Vec<Comparison> {
    vec![
        derived(
            "emission, 2005, °",
            TABLE_2[1].emission_deg,
            LEFT.emission_deg(0.0),
            2,
        )
        .departs(1.0),
        derived("look, °", "not published", LEFT.look_deg(0.0), 2).between(19.71, 19.73),
        derived(
            "speed with 8064 lines, 2005, km/s",
            "3.4",
            LEFT.speed_km_s(),
            3,
        )
        .between(3.393, 3.399),
    ]
}

fn geometry() -> Vec<Comparison> {
    let found = base_and_height();
    vec![
        derived(
            "base across the track, km",
            "not published",
            found.base_m / 1e3,
            2,
        )
        .between(153.7, 153.9),
        derived("altitude, km", "not published", found.altitude_m / 1e3, 2).between(380.4, 380.7),
        derived(
            "H/B; 2.5 in 2005",
            "2.5",
            found.altitude_m / found.base_m,
            3,
        )
        .within(0.03),
    ]
}

/// Line from the middle and place in the line of a point.
fn image_of(model: &EulerPolynomial, place_km: [f64; 3]) -> [f64; 2] {
    let projector = Projector::new(model, RIGHT.lines).unwrap();
    let seen = projector.project(&(Vector3::from(place_km) * 1e3)).unwrap();
    [seen.x, -FOCAL_LENGTH_PX * seen.camera_m.y / seen.camera_m.z]
}

fn points() -> Vec<Comparison> {
    let model = RIGHT.model();
    let seen = POINTS_KM.map(|place_km| image_of(&model, place_km));
    let mut all = Vec::new();
    let points = POINTS_KM.iter().zip(seen).zip(POINTS_IN_IMAGE);
    for (([x, y, z], [line, pixel]), [expected_line, expected_pixel]) in points {
        let of = format!("({x:.3}, {y:.3}, {z:.3}) km: line from the middle");
        all.push(derived(of, expected_line, line, 2).within(0.05));
        all.push(derived("its y, px", expected_pixel, pixel, 2).within(0.05));
    }
    let way_m = (Vector3::from(POINTS_KM[9]) - Vector3::from(POINTS_KM[0])).norm() * 1e3;
    let spacing_m = way_m / (seen[9][0] - seen[0][0]);
    all.push(derived("line spacing, 2005, m", TABLE_2[0].pixel_m, spacing_m, 3).within(0.05));
    let half = [
        0.5 * RIGHT.lines,
        0.5 * TABLE_2[0].file_samples.parse::<f64>().unwrap(),
    ];
    let inside = seen
        .iter()
        .filter(|at| at.iter().zip(half).all(|(at, half)| at.abs() <= half));
    all.push(number("points inside the image", "10", inside.count() as f64, 0).exact());
    let [_, pixel] = image_of(&RIGHT.misprinted().model(), POINTS_KM[0]);
    let of = "y of the first point with the misprinted Y, px";
    all.push(derived(of, "in the image", pixel, 0).shown());
    all
}

fn areoid() -> Vec<Comparison> {
    let ellipsoid_km = MARS_IAU2000.equatorial_radius_m / 1e3;
    let areoid_km = real_shots::areoid_at_the_equator_m() / 1e3;
    vec![
        number("radius of the ellipsoid, km", "3396", ellipsoid_km, 2).departs(0.1),
        number("areoid at 0° N, 0.8° E, km", "3396", areoid_km, 2).departs(0.1),
    ]
}

fn spacing() -> Vec<Comparison> {
    let points = POINTS_KM.map(|place_km| Vector3::from(place_km) * 1e3);
    let each: Vec<f64> = points
        .windows(2)
        .zip(NUMBERS.windows(2))
        .map(|(pair, numbers)| (pair[1] - pair[0]).norm() / (numbers[1] - numbers[0]))
        .collect();
    let least = each.iter().copied().fold(f64::INFINITY, f64::min);
    let most = each.iter().copied().fold(0.0, f64::max);
    vec![
        number("smallest, m", "340", least, 1).within(1.0),
        number("largest, m", "340", most, 1).within(1.0),
    ]
}

static ROWS: [Row; 9] = [
    Row {
        id: "S02-01",
        kind: Kind::Arithmetic,
        place: "Table 1",
        what: "orientation of the right image, start and end: X 2743.679, 2749.133; Y −2453.358, −2450.626; Z \
               −895.114, −836.828 km; ω 11.3701, 12.1810; φ −75.9648, −76.8692; κ −126.576, −125.6728 °",
        account: Account::Explained {
            from: "the table; angle between boresight and nadir with R = [κ]₃ [φ]₂ [ω]₁; emission angle of Table 2 in 2005",
            ours: right,
        },
        note: "The Y of the start is misprinted; the correct value is −2435.358. With any other order or sense of the \
               angles, the camera does not look down; the textbook matrix of these angles is the transpose.",
    },
    Row {
        id: "S02-02",
        kind: Kind::Arithmetic,
        place: "Table 1",
        what: "orientation of the left image, start and end: X 2638.162, 2640.863; Y −2549.221, −2557.746; Z \
               −891.875, −860.101 km; ω −8.6296, −8.6392; φ −75.9467, −75.9452; κ −124.5666, −124.5345 °",
        account: Account::Explained {
            from: "the table",
            ours: left,
        },
        note: "The emission angle is 17.97° in the paper of 2005, but 22.0° according to these angles, which also \
               place the points of Table 2 far outside the image. These angles cannot serve as a reference for \
               pointing.",
    },
    Row {
        id: "S02-03",
        kind: Kind::Arithmetic,
        place: "Table 1",
        what: "base and height",
        account: Account::Agrees {
            from: "the table, across the flight of the right image",
            ours: geometry,
        },
        note: "The values follow from the table; the paper of 2005 publishes them (S05-60).",
    },
    Row {
        id: "S02-04",
        kind: Kind::Arithmetic,
        place: "Table 2",
        what: "ten MOLA points in E02-02855",
        account: Account::Agrees {
            from: "orientation of first order through Table 1 with the corrected Y, 9856 lines, 3500 mm, 39 µm",
            ours: points,
        },
        note: "Image coordinates are not published: the values in the column of unpublished numbers are from an \
               independent computation with the same formula, which tests the code and not the paper. The paper states \
               only that the points lie in the image.",
    },
    Row {
        id: "S02-05",
        kind: Kind::Arithmetic,
        place: "Table 2",
        what: "spacing of points",
        account: Account::Agrees {
            from: "the ten points; gaps of two and three",
            ours: spacing,
        },
        note: "Successive rows are not always consecutive shots.",
    },
    Row {
        id: "S02-06",
        kind: Kind::Evidence,
        place: "results",
        what: "misregistration",
        account: Account::Data {
            printed: "about 1–2 footprints",
        },
        note: "The paper compared the images visually; S05-47 is the closed loop.",
    },
    Row {
        id: "S02-07",
        kind: Kind::Constants,
        place: "eq. 4",
        what: "elevation: radius minus areoid, 3396 km",
        account: Account::Explained {
            from: "equatorial radius of Mars, IAU 2000; radius minus topography of real shots at the equator",
            ours: areoid,
        },
        note: "3396 km is the mean equatorial radius of the areoid, not of the ellipsoid; at a single longitude, the \
               areoid departs from its mean by some hundred metres. areograph subtracts the areoid radius that PEDR \
               files state for each shot. The paper uses radii with all corrections, including crossover residuals. \
               Its text converts areocentric latitudes to Cartesian coordinates as if they were areographic; areograph \
               does not.",
    },
    Row {
        id: "S02-08",
        kind: Kind::Constants,
        place: "introduction",
        what: "MGS and MOC",
        account: Account::Cited {
            printed: "altitude about 400 km; narrow angle 1–5 m, wide angle 230–500 m",
        },
        note: "The paper's own table gives 380.6 km.",
    },
    Row {
        id: "S02-09",
        kind: Kind::Constants,
        place: "introduction",
        what: "results of others",
        account: Account::Cited {
            printed: "10.01 µm or 200 m; 740 m; MOLA 30–40 m, 5–30 m, 13 m; grids of 1° × 1° (1999), 1 km, 1/64°, 1/256°; two \
                      orders of magnitude better than before; offsets of 10–20 km, 1.8 km, 4–5 km; 3,000 and 4,000 images",
        },
        note: "",
    },
];
