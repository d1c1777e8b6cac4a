//! Exterior orientation as polynomials in the image line, of first and second order.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::orientation::{InterpolationCheck, Orientation, OrientationSample};
use areograph_base::{
    error::{Cause, Result},
    units::RADIANS_PER_ARCSECOND,
};
use areograph_config::OrientationConfig;
use areograph_geom::{
    attitude::{OmegaPhiKappa, matrix_of_rotation_vector, rotation_vector, unwrap_angles},
    ellipsoid::ray_meets_ellipsoid,
    polynomial::{Fit, Polynomial, root_mean_square},
    pushbroom::{EulerPolynomial, RotationVectorPolynomial, VectorPolynomial},
    statistics::largest,
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

/// Below this |cos φ| the angles ω and κ are badly determined, and the rotation-vector form should be used.
const GIMBAL_LOCK_COS_PHI: f64 = 0.1;

/// Polynomial sensor models of one image, abscissa in lines from the middle of the header image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SensorModel {
    /// Image identifier.
    pub image: String,
    /// First-order model.
    pub first_order: EulerModel,
    /// Second-order model, the one to use.
    pub second_order: EulerModel,
    /// Second-order model whose rotation has no gimbal lock.
    pub rotation_vector: RotationVectorModel,
    /// Smallest |cos φ| over the samples.
    pub cos_phi_min: f64,
    /// Whether ω and κ are badly determined (|cos φ| below 0.1): use `rotation_vector` then.
    pub near_gimbal_lock: bool,
    /// Why the model breaks the limits of the configuration; empty when it is valid.
    pub invalid_because: Vec<String>,
}

/// Six polynomials: position of the perspective centre and pointing angles.
///
/// # Source
/// Shan et al. 2005, eq. 1 and 2: `X = a0 + a1 x + a2 x²` and so on for Y, Z, ω, φ, κ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EulerModel {
    /// Position X, Y, Z in IAU 2000, metres.
    pub position_m: [Fit; 3],
    /// ω, φ, κ, radians, continuous over the image.
    pub angles_rad: [Fit; 3],
    /// Shift of the boresight on the ellipsoid by the residuals of the angles at each sample, metres; `None` when a
    /// boresight misses the ground.
    pub pointing_ground_m: Option<Vec<f64>>,
}

/// Rotation without angles; the position polynomials are those of [`EulerModel`].
///
/// `M(x) = exp([r(x)]×) · M_ref`, `M` from Mars-fixed to camera components.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RotationVectorModel {
    /// `M_ref`: the rotation of the sample nearest the middle of the image.
    pub reference: Matrix3<f64>,
    /// Components of `r(x)`, radians, second order.
    pub vector_rad: [Fit; 3],
}

impl SensorModel {
    /// The second-order model without gimbal lock, as a function of the line.
    #[must_use]
    pub fn rotation_vector_orientation(&self) -> RotationVectorPolynomial {
        RotationVectorPolynomial {
            path_m: of_fits(&self.second_order.position_m),
            vector_rad: of_fits(&self.rotation_vector.vector_rad),
            reference: self.rotation_vector.reference,
        }
    }
}

fn of_fits([x, y, z]: &[Fit; 3]) -> VectorPolynomial {
    VectorPolynomial::of([&x.polynomial, &y.polynomial, &z.polynomial])
}

impl EulerModel {
    /// The model as a function of the line.
    #[must_use]
    pub fn orientation(&self) -> EulerPolynomial {
        EulerPolynomial {
            path_m: of_fits(&self.position_m),
            angles_rad: of_fits(&self.angles_rad),
        }
    }

    /// Norm of the three position RMSE, metres.
    #[must_use]
    pub fn position_rmse_m(&self) -> f64 {
        Vector3::from_iterator(self.position_m.iter().map(|fit| fit.rmse)).norm()
    }

    /// Root mean square over the samples of the residuals of the angles on the ground, metres.
    #[must_use]
    pub fn pointing_ground_rmse_m(&self) -> Option<f64> {
        self.pointing_ground_m.as_deref().map(root_mean_square)
    }
}

impl RotationVectorModel {
    /// Largest RMSE of the three components, radians.
    #[must_use]
    pub fn rmse_rad(&self) -> f64 {
        largest(self.vector_rad.iter().map(|fit| fit.rmse)).unwrap_or_default()
    }

    /// Rotation from Mars-fixed to camera components at `x` lines from the middle.
    #[must_use]
    pub fn mars_to_camera(&self, x: f64) -> Matrix3<f64> {
        let vector =
            Vector3::from_iterator(self.vector_rad.iter().map(|fit| fit.polynomial.value(x)));
        matrix_of_rotation_vector(&vector) * self.reference
    }
}

/// Samples that do not determine the polynomials.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "image {image}: {samples} orientation samples do not determine a polynomial of order {order}"
)]
#[cause(Input: "raise orientation.intervals, and check that the image has more than a few lines")]
struct Undetermined {
    image: String,
    samples: usize,
    order: usize,
}

stage_inputs! {
    /// The samples of one image, and the limits.
    pub struct FitSensorModel<'a> {
        /// Identifier of the image.
        pub image: &'a str,
        /// Which orientation.
        pub round: Round,
        /// Its samples.
        pub samples: &'a Output<Orientation>,
        /// Limits.
        pub orientation: &'a OrientationConfig,
    }
}

impl Stage for FitSensorModel<'_> {
    const NAME: &'static str = "fit_sensor_model";
    const METHOD: u32 = 3;
    type Output = SensorModel;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part_of(self.image)
    }

    fn run(&self, _stop: &AtomicBool) -> Result<SensorModel> {
        fit_sensor_model(self.samples.value()?, self.orientation)
    }
}

/// Fits the models of one image.
///
/// # Errors
/// Fewer samples than coefficients, or samples that are not finite.
/// # Source
/// Shan et al. 2005, Table 4 (RMSE over the 31 samples, divided by 31).
pub fn fit_sensor_model(
    orientation: &Orientation,
    limits: &OrientationConfig,
) -> Result<SensorModel> {
    let first_order = euler_model(orientation, 1)?;
    let second_order = euler_model(orientation, 2)?;
    let rotation_vector = rotation_vector_model(orientation)?;
    let cos_phi_min = orientation
        .samples
        .iter()
        .map(|sample| sample.angles.phi_rad.cos().abs())
        .fold(1.0, f64::min);
    Ok(SensorModel {
        image: orientation.image.clone(),
        invalid_because: broken_limits(orientation, &second_order, &rotation_vector, limits),
        first_order,
        second_order,
        rotation_vector,
        cos_phi_min,
        near_gimbal_lock: cos_phi_min < GIMBAL_LOCK_COS_PHI,
    })
}

fn fit(orientation: &Orientation, values: &[f64], order: usize) -> Result<Fit> {
    let x: Vec<f64> = orientation.samples.iter().map(|s| s.line_offset).collect();
    Ok(
        Polynomial::fit(&x, values, order).ok_or_else(|| Undetermined {
            image: orientation.image.clone(),
            samples: x.len(),
            order,
        })?,
    )
}

fn three(mut fit_component: impl FnMut(usize) -> Result<Fit>) -> Result<[Fit; 3]> {
    Ok([fit_component(0)?, fit_component(1)?, fit_component(2)?])
}

fn euler_model(orientation: &Orientation, order: usize) -> Result<EulerModel> {
    let position_m = three(|axis| {
        let values: Vec<f64> = orientation
            .samples
            .iter()
            .map(|sample| sample.position.xyz_m[axis])
            .collect();
        fit(orientation, &values, order)
    })?;
    let pick: [fn(&OmegaPhiKappa) -> f64; 3] = [|a| a.omega_rad, |a| a.phi_rad, |a| a.kappa_rad];
    let angles_rad = three(|angle| {
        let mut values: Vec<f64> = orientation
            .samples
            .iter()
            .map(|sample| pick[angle](&sample.angles))
            .collect();
        unwrap_angles(&mut values);
        fit(orientation, &values, order)
    })?;
    Ok(EulerModel {
        position_m,
        pointing_ground_m: pointing_ground_m(orientation, &angles_rad),
        angles_rad,
    })
}

/// Distance on the ellipsoid between the boresight of each sample and that of the polynomials from the same position.
fn pointing_ground_m(orientation: &Orientation, angles_rad: &[Fit; 3]) -> Option<Vec<f64>> {
    let distance_m = |sample: &OrientationSample| {
        let [omega_rad, phi_rad, kappa_rad] =
            [0, 1, 2].map(|angle| angles_rad[angle].polynomial.value(sample.line_offset));
        let model = OmegaPhiKappa {
            omega_rad,
            phi_rad,
            kappa_rad,
        };
        let ground = |camera_to_mars: &Matrix3<f64>| {
            let boresight = camera_to_mars * Vector3::z();
            ray_meets_ellipsoid(orientation.body.model(), &sample.position, &boresight)
        };
        let sampled = ground(sample.camera_to_mars.matrix())?;
        Some(ground(&model.camera_to_mars())?.distance_m(&sampled))
    };
    orientation.samples.iter().map(distance_m).collect()
}

fn rotation_vector_model(orientation: &Orientation) -> Result<RotationVectorModel> {
    let mars_to_camera: Vec<Matrix3<f64>> = orientation
        .samples
        .iter()
        .map(|sample| sample.pose().mars_to_camera)
        .collect();
    let reference = mars_to_camera[mars_to_camera.len() / 2];
    let vectors: Vec<Vector3<f64>> = mars_to_camera
        .iter()
        .map(|matrix| rotation_vector(&(matrix * reference.transpose())))
        .collect();
    let vector_rad = three(|axis| {
        let values: Vec<f64> = vectors.iter().map(|vector| vector[axis]).collect();
        fit(orientation, &values, 2)
    })?;
    Ok(RotationVectorModel {
        reference,
        vector_rad,
    })
}

/// Longer images break the usual limit by the shape of the orbit only, seconds: its error grows with the third power of
/// the time, to 5 m in 74 s.
const LONG_S: f64 = 60.0;

/// A limit as it was written, without the rounding of its conversion, to four digits.
fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// The rotation is judged by its vector form, which means the same at every latitude.
fn broken_limits(
    orientation: &Orientation,
    model: &EulerModel,
    rotation: &RotationVectorModel,
    limits: &OrientationConfig,
) -> Vec<String> {
    let mut broken = Vec::new();
    let position_rmse_m = model.position_rmse_m();
    // Written so that NaN breaks a limit.
    if !(position_rmse_m <= limits.position_rmse_max_m) {
        let ends = [orientation.samples.first(), orientation.samples.last()];
        let exposed_s = match ends {
            [Some(first), Some(last)] => last.et.since(first.et),
            _ => 0.0,
        };
        let advice = if exposed_s > LONG_S {
            format!(
                "; over {exposed_s:.0} s an orbit departs from any polynomial of second order: set \
                 registration.model = \"samples\", which follows it, and orientation.position_rmse_max_m above this"
            )
        } else {
            String::new()
        };
        broken.push(format!(
            "second-order position RMSE {position_rmse_m:.4} m; limit {} m{advice}",
            limits.position_rmse_max_m
        ));
    }
    let pointing_rmse_rad = rotation.rmse_rad();
    if !(pointing_rmse_rad <= limits.pointing_rmse_max_rad) {
        broken.push(format!(
            "second-order pointing RMSE {:.3} arcsec; limit {} arcsec",
            pointing_rmse_rad / RADIANS_PER_ARCSECOND,
            four_digits(limits.pointing_rmse_max_rad / RADIANS_PER_ARCSECOND)
        ));
    }
    let interpolation = &orientation.tables.interpolation;
    if !interpolation.keeps_limit() {
        broken.push(format!(
            "camera tables interpolate with errors up to {:.4} pixels even with a node per line; limit {} pixels",
            interpolation.error_max_px,
            InterpolationCheck::LIMIT_PX
        ));
    }
    broken
}
