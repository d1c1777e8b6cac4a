//! Intersection of the rays of one ground point from two or more images of known orientation.

use nalgebra::{Matrix3, Vector2, Vector3};
#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::collinearity::{BehindCamera, by_camera_point, project};
use areograph_base::body::Body;

/// Maximum number of Newton steps.
const STEPS_MAX: u32 = 20;
/// A step below this ends the iteration, metres.
const STEP_M: f64 = 1e-4;
/// Largest condition number of the normal matrix with unit diagonal.
const CONDITION_MAX: f64 = 1e12;

/// Unit in which the measurement error is the same for all images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Standard deviation of both focal-plane coordinates.
    Focal {
        /// Pixels.
        #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
        sigma_px: f64,
    },
    /// Standard deviations along the track in lines and across the track in pixels.
    Line {
        /// Lines.
        #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
        along_lines: f64,
        /// Pixels.
        #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
        across_px: f64,
    },
}

/// One measurement: the orientation of the measured line and the position in that line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Perspective centre of the line, Mars-fixed, metres.
    pub position_m: Vector3<f64>,
    /// Rotation from Mars-fixed to camera components.
    pub mars_to_camera: Matrix3<f64>,
    /// Focal length in pixels of the image.
    pub focal_length_px: f64,
    /// Measured position in the focal plane along and across the track, pixels of the image; along the track it is 0
    /// except for distortion.
    pub focal_px: Vector2<f64>,
    /// Standard deviation along the track, in focal-plane pixels of the image.
    pub along_sigma_px: f64,
    /// Standard deviation across the track, pixels.
    pub across_sigma_px: f64,
}

impl Ray {
    /// Unit vector from the perspective centre towards the measured point, Mars-fixed.
    #[must_use]
    pub fn direction(&self) -> Vector3<f64> {
        let camera = (-self.focal_px / self.focal_length_px).push(1.0);
        self.mars_to_camera.tr_mul(&camera).normalize()
    }

    fn camera_point_m(&self, ground_m: &Vector3<f64>) -> Vector3<f64> {
        self.mars_to_camera * (ground_m - self.position_m)
    }
}

/// Limits beyond which intersections are rejected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IntersectionLimits {
    /// Smallest angle between the two rays that differ most, radians.
    pub convergence_min_rad: f64,
    /// Equatorial radius of the body, metres.
    pub equatorial_radius_m: f64,
    /// Polar radius of the body, metres.
    pub polar_radius_m: f64,
    /// Largest height above or below the ellipsoid, metres.
    pub height_max_m: f64,
}

impl Default for IntersectionLimits {
    /// Limits on Mars.
    fn default() -> Self {
        Self::on(Body::Mars)
    }
}

impl IntersectionLimits {
    /// Half a degree, and 30 km about the ellipsoid of `body`.
    #[must_use]
    pub fn on(body: Body) -> Self {
        let model = body.model();
        Self {
            convergence_min_rad: 0.5_f64.to_radians(),
            equatorial_radius_m: model.equatorial_radius_m,
            polar_radius_m: model.polar_radius_m,
            height_max_m: 30_000.0,
        }
    }

    /// Height of `ground_m` above the ellipsoid along the radius, metres.
    fn height_m(&self, ground_m: &Vector3<f64>) -> f64 {
        let unit = ground_m.normalize();
        let equatorial = unit.xy().norm() / self.equatorial_radius_m;
        let polar = unit.z / self.polar_radius_m;
        ground_m.norm() - 1.0 / equatorial.hypot(polar)
    }
}

/// Reasons why a point was not intersected; counted, never a value in a product.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum Unintersected {
    /// Fewer than two rays.
    #[error("number of rays: {rays}; expected at least two")]
    FewRays {
        /// Number of rays.
        rays: usize,
    },
    /// The rays are too close to parallel, as the rays of an image with itself.
    #[error("rays intersect at an angle of at most {angle_deg:.3} degrees")]
    NearParallel {
        /// Largest angle between two rays, degrees.
        angle_deg: f64,
    },
    /// The normal matrix does not determine three coordinates.
    #[error("the rays do not determine the point")]
    IllConditioned,
    /// The rays meet behind a camera.
    #[error("the rays intersect behind a camera, at {depth_m:.0} m along its boresight")]
    BehindCamera {
        /// Distance along the boresight, metres.
        depth_m: f64,
    },
    /// The rays meet far from the surface.
    #[error("the rays intersect {height_m:.0} m above the ellipsoid")]
    Height {
        /// Height above the ellipsoid, metres.
        height_m: f64,
    },
    /// The iteration did not converge, or the numbers are not finite.
    #[error("the iteration did not converge")]
    NotConverged,
}

impl From<BehindCamera> for Unintersected {
    fn from(error: BehindCamera) -> Self {
        Self::BehindCamera {
            depth_m: error.depth_m,
        }
    }
}

/// A ground point from its rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Intersection {
    /// The point, Mars-fixed, metres.
    pub ground_m: Vector3<f64>,
    /// `(JᵀWJ)⁻¹`, m²: the covariance when the standard deviations of the rays are true.
    pub cofactor_m2: Matrix3<f64>,
    /// Measured minus computed focal coordinates (along, across) of each sight, pixels.
    pub residuals_px: Vec<Vector2<f64>>,
    /// Weighted sum of squared residuals, `vᵀWv`.
    pub weighted_squares: f64,
    /// Angle between the two rays that differ most, radians.
    pub convergence_rad: f64,
    /// Number of steps.
    pub steps: u32,
}

impl Intersection {
    /// Surplus of coordinates over unknowns, `2k − 3`.
    #[must_use]
    pub fn redundancy(&self) -> usize {
        2 * self.residuals_px.len() - 3
    }
}

/// Intersects two or more rays by least squares.
///
/// # Errors
/// The reason why the rays give no point.
/// # Source
/// Shan et al. 2005, ground point determination: exterior orientation held fixed, focal coordinates
/// observed, X, Y, Z unknown; the start is the point nearest to all rays.
pub fn intersect(rays: &[Ray], limits: &IntersectionLimits) -> Result<Intersection, Unintersected> {
    if rays.len() < 2 {
        return Err(Unintersected::FewRays { rays: rays.len() });
    }
    let convergence_rad = convergence_rad(rays);
    // Written so that NaN is rejected.
    if !(convergence_rad >= limits.convergence_min_rad) {
        return Err(Unintersected::NearParallel {
            angle_deg: convergence_rad.to_degrees(),
        });
    }
    let mut ground_m = nearest_to_rays(rays).ok_or(Unintersected::IllConditioned)?;
    for steps in 1..=STEPS_MAX {
        let (normal, right) = normal_equations(rays, &ground_m)?;
        let cofactor_m2 = well_conditioned_inverse(&normal).ok_or(Unintersected::IllConditioned)?;
        let step_m = cofactor_m2 * right;
        ground_m += step_m;
        if step_m.norm() < STEP_M {
            let residuals_px = residuals_px(rays, &ground_m)?;
            let height_m = limits.height_m(&ground_m);
            if !(height_m.abs() <= limits.height_max_m) {
                return Err(Unintersected::Height { height_m });
            }
            return Ok(Intersection {
                ground_m,
                cofactor_m2,
                weighted_squares: weighted_squares(rays, &residuals_px),
                residuals_px,
                convergence_rad,
                steps,
            });
        }
    }
    Err(Unintersected::NotConverged)
}

fn convergence_rad(rays: &[Ray]) -> f64 {
    let directions: Vec<Vector3<f64>> = rays.iter().map(Ray::direction).collect();
    let mut largest: f64 = 0.0;
    for (index, first) in directions.iter().enumerate() {
        for second in &directions[index + 1..] {
            // The cross product keeps small angles exact where the cosine does not.
            largest = largest.max(first.cross(second).norm().atan2(first.dot(second)));
        }
    }
    largest
}

/// The point with the least sum of squared distances to the rays; for two, midway between them.
fn nearest_to_rays(rays: &[Ray]) -> Option<Vector3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for sight in rays {
        let direction = sight.direction();
        let across = Matrix3::identity() - direction * direction.transpose();
        normal += across;
        right += across * sight.position_m;
    }
    Some(normal.cholesky()?.solve(&right))
}

fn residuals_px(rays: &[Ray], ground_m: &Vector3<f64>) -> Result<Vec<Vector2<f64>>, BehindCamera> {
    rays.iter()
        .map(|sight| {
            let focal = project(&sight.camera_point_m(ground_m), sight.focal_length_px)?;
            Ok(sight.focal_px - focal)
        })
        .collect()
}

fn weighted_squares(rays: &[Ray], residuals_px: &[Vector2<f64>]) -> f64 {
    rays.iter()
        .zip(residuals_px)
        .map(|(sight, v)| {
            (v.x / sight.along_sigma_px).powi(2) + (v.y / sight.across_sigma_px).powi(2)
        })
        .sum()
}

fn normal_equations(
    rays: &[Ray],
    ground_m: &Vector3<f64>,
) -> Result<(Matrix3<f64>, Vector3<f64>), BehindCamera> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for sight in rays {
        let camera_point_m = sight.camera_point_m(ground_m);
        let focal = project(&camera_point_m, sight.focal_length_px)?;
        let mut rows =
            by_camera_point(&camera_point_m, sight.focal_length_px) * sight.mars_to_camera;
        let mut misclosure = sight.focal_px - focal;
        for (row, sigma) in [sight.along_sigma_px, sight.across_sigma_px]
            .into_iter()
            .enumerate()
        {
            rows.row_mut(row).scale_mut(1.0 / sigma);
            misclosure[row] /= sigma;
        }
        normal += rows.transpose() * rows;
        right += rows.tr_mul(&misclosure);
    }
    Ok((normal, right))
}

fn well_conditioned_inverse(normal: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let scale = Matrix3::from_diagonal(&normal.diagonal().map(|value| 1.0 / value.sqrt()));
    let scaled = scale * normal * scale;
    let eigenvalues = scaled.symmetric_eigenvalues();
    // Written so that NaN is rejected.
    if !(eigenvalues.max() <= CONDITION_MAX * eigenvalues.min()) {
        return None;
    }
    Some(scale * scaled.cholesky()?.inverse() * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    const FOCAL_LENGTH_PX: f64 = 3500.0 / 0.026;

    /// A camera at `position_m` that looks straight at `target_m`, the point `across_px` off its axis.
    fn ray(position_m: Vector3<f64>, target_m: &Vector3<f64>, across_px: f64) -> Ray {
        let camera_to_mars =
            Rotation3::face_towards(&(target_m - position_m), &Vector3::new(0.3, 0.2, 1.0));
        Ray {
            position_m,
            mars_to_camera: camera_to_mars.transpose().into_inner(),
            focal_length_px: FOCAL_LENGTH_PX,
            focal_px: Vector2::new(0.0, across_px),
            along_sigma_px: 1.0,
            across_sigma_px: 1.0,
        }
    }

    fn surface() -> Vector3<f64> {
        Vector3::new(3_390_000.0, 0.0, 0.0)
    }

    #[test]
    fn exact_rays_of_three_cameras_give_the_point() {
        let target = surface();
        let rays = [-150e3, 20e3, 100e3]
            .map(|east_m| ray(target + Vector3::new(380e3, east_m, 10e3), &target, 0.0));
        let point = intersect(&rays, &IntersectionLimits::default()).unwrap();
        assert!((point.ground_m - target).norm() < 1e-6); // metres: rounding of 3.4e6 m
        assert!(point.residuals_px.iter().all(|v| v.norm() < 1e-6));
        assert_eq!(point.redundancy(), 3);
        let angle = (250_f64 / 380.0).atan();
        assert!((point.convergence_rad - angle).abs() < 0.1); // roughly the base over the height
    }

    #[test]
    fn what_gives_no_point_says_why() {
        let target = surface();
        let limits = IntersectionLimits::default();
        let above = ray(target + Vector3::new(380e3, 0.0, 0.0), &target, 0.0);
        let aside = ray(target + Vector3::new(380e3, 150e3, 0.0), &target, 0.0);
        assert!(matches!(
            intersect(&[above], &limits),
            Err(Unintersected::FewRays { rays: 1 })
        ));
        assert!(matches!(
            intersect(&[above, above], &limits),
            Err(Unintersected::NearParallel { .. })
        ));
        // Mirrored through both cameras the rays meet above them.
        let backwards = |sight: Ray| Ray {
            mars_to_camera: Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0))
                * sight.mars_to_camera,
            ..sight
        };
        assert!(matches!(
            intersect(&[backwards(above), backwards(aside)], &limits),
            Err(Unintersected::BehindCamera { .. })
        ));
        let deep = surface() * 0.98;
        let rays =
            [0.0, 150e3].map(|east_m| ray(target + Vector3::new(380e3, east_m, 0.0), &deep, 0.0));
        assert!(matches!(
            intersect(&rays, &limits),
            Err(Unintersected::Height { height_m }) if (height_m + 74e3).abs() < 1e3
        ));
        let broken = Ray {
            focal_px: Vector2::new(0.0, f64::NAN),
            ..aside
        };
        assert!(intersect(&[above, broken], &limits).is_err());
    }
}
