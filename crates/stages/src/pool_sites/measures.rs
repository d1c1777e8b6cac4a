//! Values of rows that no output of a site states directly.

use std::collections::{BTreeSet, HashSet};

use super::rows::{
    Measured, PairHeights, PairMisregistration, PairState, PolynomialRmse, RangeStatistics,
};
use crate::{
    check_heights::{HeightCheck, TieHeight},
    check_ranges::RangeCheck,
    compare_pairs::{FootprintsByTies, PairComparison, ProfileByTies},
    fit_sensor_model::EulerModel,
    group_profiles::Profile,
    orientation::{Orientation, OrientationSample},
    read_ties::Ties,
    register::ImageRegistration,
    tag_times::ImageTimes,
};
use areograph_base::{footprints::Footprints, frames::BodyFixed};
use areograph_geom::{ellipsoid::spherical_to_xyz_m, statistics::Summary};
use nalgebra::Vector3;

/// Geometry of an image, from its orientation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ImageGeometry {
    /// Emission at the point under the boresight in the middle of the image, radians.
    pub emission_rad: Option<f64>,
    /// Angle there between boresight and the direction to the centre of the body, radians.
    pub off_nadir_rad: Option<f64>,
    /// East longitude and areocentric latitude of this point, radians.
    pub place_rad: Option<[f64; 2]>,
    /// Mean distance of successive lines on the ground along the boresight, metres.
    pub line_spacing_m: Option<f64>,
    /// Width of a pixel at the distance of this point, metres.
    pub pixel_size_m: Option<f64>,
}

impl ImageGeometry {
    /// The geometry of the image with these times and samples.
    #[must_use]
    pub fn of(times: &ImageTimes, orientation: &Orientation) -> Self {
        let samples = &orientation.samples;
        let Some(middle) = samples.get(samples.len() / 2) else {
            return Self::default();
        };
        let boresight = middle.camera_to_mars.matrix() * Vector3::z();
        let down = -middle.position.xyz_m.normalize();
        let ground = middle.boresight;
        let pixel_m = |range_m: f64| range_m / times.detector().focal_length_px;
        Self {
            emission_rad: ground.map(|of| of.emission_rad),
            off_nadir_rad: Some(boresight.dot(&down).clamp(-1.0, 1.0).acos()),
            place_rad: ground.map(|of| [of.longitude_rad, of.latitude_rad]),
            line_spacing_m: line_spacing_m(samples),
            pixel_size_m: ground.map(|of| pixel_m(of.range_m)),
        }
    }
}

/// Length of the path of the boresight on the ground over its lines, metres.
fn line_spacing_m(samples: &[OrientationSample]) -> Option<f64> {
    let ground_m = |sample: &OrientationSample| {
        let look = sample.camera_to_mars.matrix() * Vector3::z();
        Some(sample.position.xyz_m + look * sample.boresight.as_ref()?.range_m)
    };
    let mut length_m = 0.0;
    for two in samples.windows(2) {
        length_m += (ground_m(&two[1])? - ground_m(&two[0])?).norm();
    }
    let lines = samples.last()?.line_offset - samples.first()?.line_offset;
    (lines > 0.0).then(|| length_m / lines)
}

impl PolynomialRmse {
    /// Of a model.
    #[must_use]
    pub fn of(model: &EulerModel) -> Self {
        Self {
            position_m: [0, 1, 2].map(|axis| model.position_m[axis].rmse),
            angles_rad: [0, 1, 2].map(|axis| model.angles_rad[axis].rmse),
        }
    }
}

/// Median distance of successive footprints of a profile, metres; `None` for fewer than two.
#[must_use]
pub fn shot_spacing_m(footprints: &Footprints<BodyFixed>, profile: &Profile) -> Option<f64> {
    let ground_m = |row: &u32| {
        let row = *row as usize;
        spherical_to_xyz_m(
            footprints.longitude_rad.at(row),
            footprints.latitude_rad.at(row),
            footprints.ground_radius_m(row),
        )
    };
    let successive = profile.rows.windows(2);
    let lengths_m: Vec<f64> = successive
        .map(|pair| (ground_m(&pair[1]) - ground_m(&pair[0])).norm())
        .collect();
    (!lengths_m.is_empty()).then(|| Summary::of(&lengths_m).median)
}

impl RangeStatistics {
    /// Of a summary.
    #[must_use]
    pub const fn of(summary: &Summary) -> Self {
        Self {
            n: summary.n,
            mean_m: summary.mean,
            deviation_m: summary.standard_deviation,
        }
    }

    /// Of the shots of a profile that an image shows; no shots where the points of the image are not known.
    #[must_use]
    pub fn in_image(ranges: &RangeCheck, profile: usize, image: &ImageRegistration) -> Self {
        let points = &image.points;
        let shown: HashSet<u32> = (0..points.len())
            .filter(|at| points.profile.at(*at) as usize == profile && points.inside.at(*at))
            .map(|at| points.row.at(at))
            .collect();
        let shots = &ranges.shots;
        let residuals: Vec<f64> = (0..shots.len())
            .filter(|at| shots.profile.at(*at) as usize == profile)
            .filter(|at| shown.contains(&shots.row.at(*at)))
            .map(|at| shots.range_minus_distance_m.at(at))
            .filter(|residual_m| residual_m.is_finite())
            .collect();
        Self::of(&Summary::of(&residuals))
    }
}

impl PairMisregistration {
    /// Means over the footprints of all profiles; `None` without footprints in both images.
    #[must_use]
    pub fn of(pair: &PairComparison) -> Option<Self> {
        let found = pair.footprints.as_ref()?;
        let footprints: u32 = found.profiles.iter().map(|of| of.lines.n).sum();
        let mean = |of: &dyn Fn(&ProfileByTies) -> f64| {
            let sum = found.profiles.iter();
            let sum: f64 = sum
                .map(|profile| f64::from(profile.lines.n) * of(profile))
                .sum();
            sum / f64::from(footprints)
        };
        if footprints == 0 {
            return None;
        }
        let [_, pixel_m] = pair.pixel_size_m;
        let along_sigma_m = mean(&|of| of.along_sigma_m);
        let across_px = mean(&|of| of.samples.mean);
        let along_m = mean(&|of| of.along_m);
        Some(Self {
            footprints,
            along_lines: mean(&|of| of.lines.mean),
            along_m: Measured {
                value: along_m,
                sigma: Some(along_sigma_m),
            },
            across_px,
            across_m: Measured {
                value: across_px * pixel_m,
                sigma: across_sigma_m(found, along_sigma_m, [pair.line_spacing_m[1], pixel_m]),
            },
            along_spacings: pair.mola_spacing_m.map(|spacing_m| along_m / spacing_m),
        })
    }
}

/// Both coordinates are transformed through the same tie points: their standard deviations are in the ratio of the scatters.
fn across_sigma_m(
    found: &FootprintsByTies,
    along_sigma_m: f64,
    [line_m, pixel_m]: [f64; 2],
) -> Option<f64> {
    let along_m = found.tie_lines.standard_deviation * line_m;
    let across_m = found.tie_samples.standard_deviation * pixel_m;
    (along_m > 0.0).then(|| along_sigma_m * across_m / along_m)
}

impl PairHeights {
    /// Heights of the tie points that both images of a pair have; `None` without a surface or without heights.
    ///
    /// * `images` – indices of the images
    #[must_use]
    pub fn of(heights: &HeightCheck, ties: &Ties, images: [usize; 2]) -> Option<Self> {
        heights.surface.as_ref().ok()?;
        let has_both = |tie: usize| {
            let measures = ties
                .points
                .get(tie)
                .into_iter()
                .flat_map(|tie| &tie.measures);
            let of: BTreeSet<usize> = measures.map(|measure| measure.image).collect();
            images.iter().all(|image| of.contains(image))
        };
        let above_m = heights.ties.iter().filter(|height| has_both(height.tie));
        let above_m: Vec<f64> = above_m.map(TieHeight::above_m).collect();
        let n = above_m.len() as f64;
        (n > 0.0).then(|| Self {
            n: u32::try_from(above_m.len()).unwrap_or(u32::MAX),
            mean_m: above_m.iter().sum::<f64>() / n,
            rms_m: (above_m.iter().map(|of| of.powi(2)).sum::<f64>() / n).sqrt(),
            mean_sigma_m: heights.mean_sigma_m,
        })
    }
}

impl PairState {
    /// A pair with one orientation, and the heights of its tie points.
    #[must_use]
    pub fn of(pair: &PairComparison, heights: Option<PairHeights>) -> Self {
        Self {
            ties: pair.ties,
            ties_along_m: pair.along_track.map(|of| Measured {
                value: of.apart_m,
                sigma: Some(of.sigma_m),
            }),
            along_track_parallax_m: pair.along_track_parallax_m,
            residuals: pair.residuals,
            misregistration: PairMisregistration::of(pair),
            heights,
        }
    }
}
