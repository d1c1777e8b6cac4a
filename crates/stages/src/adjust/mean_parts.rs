//! Uncertainty of the mean of the tie points, by its causes.

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use areograph_base::schema::none_negative;

/// Standard deviations of the mean of the tie points due to each cause, in east, north and height, metres. The causes are
/// independent: the squares of all add up to those of `mean_sigma_m`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeanSigmaParts {
    /// Shift in plan that all profiles of the altimeter have in common, if relief is used. Other sites have the same error. It is not
    /// modelled for profiles with laser spots (`adjustment.common_bus`).
    #[schemars(transform = none_negative)]
    pub frame_m: [f64; 3],
    /// Boresight of the laser (`adjustment.common_bus`). Other sites have the same error.
    #[schemars(transform = none_negative)]
    pub boresight_m: [f64; 3],
    /// Shifts of the profiles, of each by itself. Sites with the same profiles share this error.
    #[schemars(transform = none_negative)]
    pub profiles_m: [f64; 3],
    /// A priori orbit, attitude and line times of the images of this site. An offset of the attitude clock
    /// (`adjustment.attitude_clock`) is part of it, and common to the sites of a mission phase.
    #[schemars(transform = none_negative)]
    pub orientations_m: [f64; 3],
    /// Horizontal positions of images and profiles on slopes, where relief does not determine them.
    #[schemars(transform = none_negative)]
    pub slopes_m: [f64; 3],
    /// Ground between the shots.
    #[schemars(transform = none_negative)]
    pub ground_m: [f64; 3],
    /// All other observations: tie points with jitter of the attitude, laser spots, ranges, and given coordinates.
    #[schemars(transform = none_negative)]
    pub observations_m: [f64; 3],
    /// Shift of the mean by tie points beyond the limit of the test, some of which may be in error.
    #[schemars(transform = none_negative)]
    pub beyond_limit_m: [f64; 3],
}

/// A cause with its standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanSigmaPart {
    /// Name of the member of [`MeanSigmaParts`].
    pub name: &'static str,
    /// The cause, with terms of the site in braces.
    pub words: &'static str,
    /// The sites that have the same error.
    pub shared_by: &'static str,
    /// Whether these are all sites.
    pub of_all_sites: bool,
    /// Standard deviations in east, north and height, metres.
    pub sigma_m: [f64; 3],
}

const ALL_SITES: &str = "all sites";
const SAME_PROFILES: &str = "sites with the same profiles";
const THIS_SITE: &str = "this site";

impl MeanSigmaParts {
    /// The causes, those common to all sites first.
    #[must_use]
    pub fn all(&self) -> [MeanSigmaPart; 8] {
        let part = |name, words, shared_by: &'static str, sigma_m| MeanSigmaPart {
            name,
            words,
            shared_by,
            of_all_sites: shared_by == ALL_SITES,
            sigma_m,
        };
        [
            part(
                "frame_m",
                "shift common to all {altimeter} profiles",
                ALL_SITES,
                self.frame_m,
            ),
            part(
                "boresight_m",
                "boresight of the laser",
                ALL_SITES,
                self.boresight_m,
            ),
            part(
                "profiles_m",
                "shifts of single profiles",
                SAME_PROFILES,
                self.profiles_m,
            ),
            part(
                "orientations_m",
                "a priori orbit, attitude and line times",
                THIS_SITE,
                self.orientations_m,
            ),
            part(
                "slopes_m",
                "horizontal position on slopes",
                THIS_SITE,
                self.slopes_m,
            ),
            part("ground_m", "ground between shots", THIS_SITE, self.ground_m),
            part(
                "observations_m",
                "tie points and other observations",
                THIS_SITE,
                self.observations_m,
            ),
            part(
                "beyond_limit_m",
                "tie points beyond the limit",
                THIS_SITE,
                self.beyond_limit_m,
            ),
        ]
    }

    /// Standard deviations by all causes together, metres.
    #[must_use]
    pub fn total_m(&self) -> [f64; 3] {
        let squares = |axis: usize| {
            self.all()
                .into_iter()
                .map(move |of| of.sigma_m[axis].powi(2))
        };
        [0, 1, 2].map(|axis| squares(axis).sum::<f64>().sqrt())
    }

    /// From the cofactors of the mean and their parts.
    ///
    /// * `to_local` – rotation from Mars-fixed axes to east, north and up
    /// * `moved_m` – shift of the mean height by points beyond the limit, metres
    pub(super) fn of(
        mean_m2: &Matrix3<f64>,
        parts: &areograph_geom::bundle::MeanParts,
        to_local: &Matrix3<f64>,
        variance_factor: f64,
        moved_m: f64,
    ) -> Self {
        let root = |part_m2: &Matrix3<f64>| -> [f64; 3] {
            let local_m2 = to_local * part_m2 * to_local.transpose() * variance_factor;
            // Rounding may leave a part that is zero a little below it.
            [0, 1, 2].map(|axis| local_m2[(axis, axis)].max(0.0).sqrt())
        };
        let stated_m2 = parts.frame_m2
            + parts.boresight_m2
            + parts.profiles_m2
            + parts.orientations_m2
            + parts.slopes_m2
            + parts.ground_m2;
        Self {
            frame_m: root(&parts.frame_m2),
            boresight_m: root(&parts.boresight_m2),
            profiles_m: root(&parts.profiles_m2),
            orientations_m: root(&parts.orientations_m2),
            slopes_m: root(&parts.slopes_m2),
            ground_m: root(&parts.ground_m2),
            observations_m: root(&(mean_m2 - stated_m2)),
            beyond_limit_m: [0.0, 0.0, moved_m.abs()],
        }
    }
}
