//! Exterior orientation as polynomials in the image line, of first and second order, and the choice of the form in use.
//!
//! The departure of the orbit from a second-order polynomial grows with the third power of time: an image of several
//! minutes exceeds every limit. Unless the configuration requires a form, such an image is interpolated between its
//! samples.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::orientation::{InterpolationCheck, Nodes, Orientation, OrientationSample};
use areograph_base::{
    error::{Cause, Result},
    units::RADIANS_PER_ARCSECOND,
};
use areograph_config::OrientationConfig;
use areograph_geom::{
    attitude::{OmegaPhiKappa, matrix_of_rotation_vector, rotation_vector, unwrap_angles},
    ellipsoid::ray_meets_ellipsoid,
    polynomial::{Fit, Polynomial, root_mean_square},
    pushbroom::{
        CameraModel, EulerPolynomial, ExteriorOrientation as _, RotationVectorPolynomial,
        SampledOrientation, VectorPolynomial,
    },
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
    /// Second-order model.
    pub second_order: EulerModel,
    /// Second-order model whose rotation has no gimbal lock.
    pub rotation_vector: RotationVectorModel,
    /// Smallest |cos φ| over the samples.
    pub cos_phi_min: f64,
    /// Whether ω and κ are badly determined (|cos φ| below 0.1): use `rotation_vector` then.
    pub near_gimbal_lock: bool,
    /// The form in use.
    pub model: CameraModel,
    /// Its distances from the orientation.
    pub misfit: Misfit,
    /// Reason why polynomials are not in use although the configuration does not exclude them.
    pub remark: Option<String>,
    /// Reasons why the form in use breaks the limits of the configuration; empty when it is valid.
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

/// Rotation without angles; the position polynomials are shared with [`EulerModel`].
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
#[cause(Input: "increase orientation.intervals, and check that the image has more than a few lines")]
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
        /// Round of the orientation.
        pub round: Round,
        /// Its samples.
        pub samples: &'a Output<Orientation>,
        /// Limits.
        pub orientation: &'a OrientationConfig,
        /// The form that the configuration requires.
        pub registration_model: &'a Option<CameraModel>,
    }
}

impl Stage for FitSensorModel<'_> {
    const NAME: &'static str = "fit_sensor_model";
    const METHOD: u32 = 4;
    type Output = SensorModel;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part_of(self.image)
    }

    fn run(&self, _stop: &AtomicBool) -> Result<SensorModel> {
        fit_sensor_model(
            self.samples.value()?,
            self.orientation,
            *self.registration_model,
        )
    }
}

/// Fits the models of one image, and chooses the form in use: the `required` one, or else the rotation vector where it
/// keeps the limits and the samples where it does not.
///
/// # Errors
/// Fewer samples than coefficients, or samples that are not finite.
/// # Source
/// Shan et al. 2005, Table 4 (RMSE over the 31 samples, divided by 31).
pub fn fit_sensor_model(
    orientation: &Orientation,
    limits: &OrientationConfig,
    required: Option<CameraModel>,
) -> Result<SensorModel> {
    let first_order = euler_model(orientation, 1)?;
    let second_order = euler_model(orientation, 2)?;
    let rotation_vector = rotation_vector_model(orientation)?;
    let cos_phi_min = orientation
        .samples
        .iter()
        .map(|sample| sample.angles.phi_rad.cos().abs())
        .fold(1.0, f64::min);
    let polynomials = Misfit {
        position_rmse_m: second_order.position_rmse_m(),
        // The rotation is judged by its vector form, which means the same at every latitude.
        pointing_rmse_rad: rotation_vector.rmse_rad(),
    };
    let broken = polynomials.broken_limits("second-order", limits);
    let (model, remark) = match required {
        Some(model) => (model, None),
        None if broken.is_empty() => (CameraModel::RotationVector, None),
        None => (
            CameraModel::Samples,
            Some(format!(
                "{}: the orientation of this image is interpolated between its samples",
                broken.join("; ")
            )),
        ),
    };
    let (misfit, broken, advice) = match model {
        CameraModel::FirstOrder | CameraModel::SecondOrder | CameraModel::RotationVector => {
            (polynomials, broken, advice(orientation))
        }
        CameraModel::Samples => {
            let misfit = Misfit::between_samples(orientation);
            let broken = misfit.broken_limits("between samples,", limits);
            (misfit, broken, "; raise orientation.intervals".to_owned())
        }
    };
    let broken = broken.into_iter().map(|reason| reason + &advice);
    let invalid_because = broken.chain(of_tables(orientation)).collect();
    Ok(SensorModel {
        image: orientation.image.clone(),
        model,
        misfit,
        remark,
        invalid_because,
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

/// Distance on the ellipsoid between the boresight of each sample and the boresight of the polynomials from the same
/// position.
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

/// Distances of a form of the orientation from the orientation itself: of polynomials of second order at the samples, of
/// the interpolation between samples halfway between them. NaN without a reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Misfit {
    /// Norm of the position RMSE of x, y and z, metres.
    pub position_rmse_m: f64,
    /// Largest pointing RMSE of the three components, radians.
    pub pointing_rmse_rad: f64,
}

impl Misfit {
    /// The interpolation between samples against the interpolation of the tables, whose nodes are as dense as the
    /// kernels require.
    fn between_samples(orientation: &Orientation) -> Self {
        let unknown = Self {
            position_rmse_m: f64::NAN,
            pointing_rmse_rad: f64::NAN,
        };
        let poses: Vec<_> = orientation
            .samples
            .iter()
            .map(|sample| (sample.et.seconds(), sample.pose()))
            .collect();
        let Ok(sampled) = SampledOrientation::new(&poses) else {
            return unknown;
        };
        if orientation.tables.et_s.len() < 2 {
            return unknown;
        }
        let tables = Nodes::new(&orientation.tables);
        let (mut apart_m, mut apart_rad) = (Vec::new(), [const { Vec::new() }; 3]);
        for pair in orientation.samples.windows(2) {
            let middle = pair[0].et.plus(0.5 * pair[1].et.since(pair[0].et));
            let (camera, pose) = (tables.camera(middle), sampled.pose(middle.seconds()));
            apart_m.push((pose.position_m - camera.position.xyz_m).norm());
            let turn_rad = rotation_vector(&(pose.mars_to_camera * camera.to_mars.matrix()));
            for (axis, component_rad) in apart_rad.iter_mut().zip(turn_rad.iter()) {
                axis.push(*component_rad);
            }
        }
        let pointing = apart_rad.iter().map(|axis| root_mean_square(axis));
        Self {
            position_rmse_m: root_mean_square(&apart_m),
            pointing_rmse_rad: largest(pointing).unwrap_or(f64::NAN),
        }
    }

    fn broken_limits(&self, what: &str, limits: &OrientationConfig) -> Vec<String> {
        let mut broken = Vec::new();
        // Written so that NaN breaks a limit.
        if !(self.position_rmse_m <= limits.position_rmse_max_m) {
            broken.push(format!(
                "{what} position RMSE {:.4} m; limit {} m",
                self.position_rmse_m, limits.position_rmse_max_m
            ));
        }
        if !(self.pointing_rmse_rad <= limits.pointing_rmse_max_rad) {
            broken.push(format!(
                "{what} pointing RMSE {:.3} arcsec; limit {} arcsec",
                self.pointing_rmse_rad / RADIANS_PER_ARCSECOND,
                four_digits(limits.pointing_rmse_max_rad / RADIANS_PER_ARCSECOND)
            ));
        }
        broken
    }
}

/// Advice on polynomials that do not fit; empty for an image short enough for them.
fn advice(orientation: &Orientation) -> String {
    let ends = [orientation.samples.first(), orientation.samples.last()];
    let exposed_s = match ends {
        [Some(first), Some(last)] => last.et.since(first.et),
        _ => 0.0,
    };
    if exposed_s > LONG_S {
        format!(
            "; over {exposed_s:.0} s an orbit departs from any second-order polynomial: remove registration.model, or \
             set it to \"samples\", which follows the orbit"
        )
    } else {
        String::new()
    }
}

/// The reason if camera tables are too coarse.
fn of_tables(orientation: &Orientation) -> Option<String> {
    let interpolation = &orientation.tables.interpolation;
    (!interpolation.keeps_limit()).then(|| {
        format!(
            "interpolation errors of camera tables reach {:.4} pixels even with one node per line; limit {} pixels",
            interpolation.error_max_px,
            InterpolationCheck::LIMIT_PX
        )
    })
}
