//! Every pair of images: its geometry, the disagreement of footprints and tie points in it, and the resulting
//! uncertainty of ground points.

mod along_track;
mod budget;
mod footprint_heights;

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use super::{
    convert_datum::Converted,
    group_profiles::Profile,
    intersect::{IntersectedPoint, IntersectedTies, MeasureResidual},
    read_ties::Ties,
    register::ImageRegistration,
    site_image::SiteImages,
};
use crate::oriented::OrientedImage;
use areograph_base::{
    body::BodyModel, error::Result, footprints::Footprints, frames::BodyFixed, ties::TiePoint,
};
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    misregistration::{ImageToImage, Pair},
    oriented_camera::OrientedCamera,
    pushbroom::ExteriorOrientation,
    readings::AlongTrack,
    statistics::Summary,
    uncertainty::{PairResiduals, ResidualMoments, UncertaintyBudget, uncertainty_budget},
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

use along_track::along_track;
use budget::{apart, budget_input, mean, moments_of};
pub use footprint_heights::FootprintHeight;
use footprint_heights::footprint_heights;

/// A pair of images with tie points in both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairComparison {
    /// Identifiers, in the order of the site.
    pub images: [String; 2],
    /// Intersected tie points that both images see.
    pub ties: u32,
    /// Median angle between the rays of a tie point, radians.
    pub convergence_rad: f64,
    /// Ratio of the height of the cameras to their base, median.
    pub height_over_base: f64,
    /// Distance of successive lines on the ground, metres, median over the tie points.
    pub line_spacing_m: [f64; 2],
    /// Width of a pixel at the range of the ground, metres, median over the tie points.
    pub pixel_size_m: [f64; 2],
    /// Reprojection residuals of the tie points in each image.
    pub residuals: [ResidualMoments; 2],
    /// Along-track parallax of the tie points, metres, mean, from their reprojection residuals in both images.
    pub along_track_parallax_m: f64,
    /// The displacement with its sign, and its dependence on errors of times and attitudes; `None` where the images were not
    /// flown in one direction, or are not apart across the track.
    pub along_track: Option<AlongTrack>,
    /// Footprints against tie points; `None` where tie points determine no transformation.
    pub footprints: Option<FootprintsByTies>,
    /// Median distance of successive footprints, metres; `None` without any.
    pub mola_spacing_m: Option<f64>,
    /// The budget of Shan et al. 2005, or the reason why there is none.
    pub budget: std::result::Result<UncertaintyBudget, String>,
}

/// Footprints of both images under the transformation that tie points determine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FootprintsByTies {
    /// Order of the transformation from the first image to the second.
    pub order: u8,
    /// Tie points that determine it.
    pub ties: u32,
    /// Tie points rejected as outliers.
    pub ties_rejected: u32,
    /// Residuals of the tie points in lines.
    pub tie_lines: Summary,
    /// Residuals of the tie points in samples.
    pub tie_samples: Summary,
    /// Along-track misregistration of the footprints, metres: the size of `along_m`, averaged over the footprints of
    /// all profiles. `None` without any.
    pub apart_m: Option<f64>,
    /// Its standard deviation from the scatter of the tie points, metres; the error is common to all profiles.
    pub apart_sigma_m: Option<f64>,
    /// Profiles with footprints that both images show.
    pub profiles: Vec<ProfileByTies>,
    /// Footprints within the lines of both images that one of them does not show; they are not counted.
    pub outside: u32,
}

/// One profile of a pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProfileByTies {
    /// Identifier of the profile.
    pub profile: String,
    /// Transformed minus projected line in the second image.
    pub lines: Summary,
    /// Transformed minus projected sample in the second image.
    pub samples: Summary,
    /// The mean of `lines` on the ground, metres.
    pub along_m: f64,
    /// Its standard deviation from the scatter of the tie points, metres.
    pub along_sigma_m: f64,
    /// `along_m` in units of the distance of successive footprints of the profile; `None` for a single one.
    pub along_spacings: Option<f64>,
    /// Footprints beyond the tie points.
    pub beyond_ties: u32,
    /// Heights of the others by the rays that the transformation through tie points assigns to them.
    pub heights: Vec<FootprintHeight>,
    /// These heights above the altimeter's, metres.
    pub above_m: Summary,
}

/// Pairs with fewer tie points are not compared.
const TIES_MIN: usize = 2;

stage_inputs! {
    /// The images with one orientation, tie points and their ground points, and the footprints.
    pub struct ComparePairs<'a> {
        /// Round of the orientation.
        pub round: Round,
        /// The images.
        pub images: SiteImages<'a>,
        /// Tie points.
        pub ties: &'a Output<Ties>,
        /// Their ground points.
        pub intersected: &'a Output<IntersectedTies>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
    }
}

impl Stage for ComparePairs<'_> {
    const NAME: &'static str = "compare_pairs";
    const METHOD: u32 = 8;
    type Output = Vec<PairComparison>;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, _stop: &AtomicBool) -> Result<Vec<PairComparison>> {
        let oriented = self.images.oriented()?;
        let images: Vec<_> = oriented
            .iter()
            .map(OrientedImage::oriented_camera)
            .collect();
        let registrations = self.images.0.iter().map(|image| image.registration.value());
        Ok(compare_pairs(
            &images,
            &registrations.collect::<Result<Vec<_>>>()?,
            &self.ties.value()?.points,
            self.intersected.value()?,
            &self.converted.value()?.footprints,
            self.profiles.value()?,
        ))
    }
}

/// Compares all pairs of `images` that share tie points and have different positions.
///
/// `registrations` go with `images`. Blunders among the tie points are excluded.
///
/// # Source
/// Shan et al. 2005, p. 104 and eq. 5 to 9; visual comparison is replaced by a transformation through tie points.
#[must_use]
pub fn compare_pairs<M: ExteriorOrientation>(
    images: &[OrientedCamera<M>],
    registrations: &[&ImageRegistration],
    ties: &[TiePoint],
    intersected: &IntersectedTies,
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
) -> Vec<PairComparison> {
    let spacings: Vec<Option<f64>> = profiles
        .iter()
        .map(|profile| shot_spacing_m(footprints, profile))
        .collect();
    let mut pairs = Vec::new();
    for first in 0..images.len() {
        for second in first + 1..images.len() {
            let pair = [first, second];
            let shared = Shared::of(pair, intersected);
            if shared.points.len() < TIES_MIN {
                continue;
            }
            let line_spacing_m = shared.line_spacing_m(images);
            let by_ties = footprints_by_ties(
                pair.map(|index| (&images[index], registrations[index])),
                pair,
                ties,
                footprints,
                (profiles, &spacings),
                line_spacing_m[1],
            );
            let mola_spacing_m = median(spacings.iter().flatten().copied());
            let body = footprints.body.model();
            let compared = shared.compare(images, body, line_spacing_m, by_ties, mola_spacing_m);
            // Two images of one exposure have no base, and nothing to compare.
            if compared.height_over_base.is_finite() {
                pairs.push(compared);
            }
        }
    }
    pairs
}

/// The points of a pair, each with its measurements in the two images.
struct Shared<'a> {
    pair: [usize; 2],
    points: Vec<(&'a IntersectedPoint, [MeasureResidual; 2])>,
}

impl<'a> Shared<'a> {
    fn of(pair: [usize; 2], intersected: &'a IntersectedTies) -> Self {
        let good = intersected.points.iter().filter(|point| !point.outlier);
        let points = good.filter_map(|point| {
            let measure = |image| point.measures.iter().find(|m| m.image == image).copied();
            Some((point, [measure(pair[0])?, measure(pair[1])?]))
        });
        Self {
            pair,
            points: points.collect(),
        }
    }

    /// Median over the points.
    fn each(&self, of: impl Fn(&IntersectedPoint, &[MeasureResidual; 2]) -> f64) -> f64 {
        let values = self
            .points
            .iter()
            .map(|(point, measures)| of(point, measures));
        median(values).unwrap_or_default()
    }

    fn line_spacing_m<M: ExteriorOrientation>(&self, images: &[OrientedCamera<M>]) -> [f64; 2] {
        [0, 1].map(|at| {
            let image = &images[self.pair[at]];
            self.each(|point, measures| {
                image.line_spacing_m(measures[at].x_lines, &point.ground.xyz_m)
            })
        })
    }

    fn compare<M: ExteriorOrientation>(
        &self,
        images: &[OrientedCamera<M>],
        body: &BodyModel,
        line_spacing_m: [f64; 2],
        footprints: Option<FootprintsByTies>,
        mola_spacing_m: Option<f64>,
    ) -> PairComparison {
        let pair = self.pair.map(|index| &images[index]);
        let position_m = |measures: &[MeasureResidual; 2], at: usize| {
            pair[at].orientation.pose(measures[at].x_lines).position_m
        };
        let residuals = [0, 1].map(|at| self.moments(at));
        let height_over_base = self.each(|point, measures| {
            let [a_m, b_m] = [0, 1].map(|at| position_m(measures, at));
            let height_m = 0.5 * (a_m.norm() + b_m.norm()) - point.ground.xyz_m.norm();
            height_m / (b_m - a_m).norm()
        });
        let pixel_size_m = [0, 1].map(|at| {
            let focal_length_px = pair[at].detector.focal_length_px;
            self.each(|point, measures| {
                let away_m = position_m(measures, at) - point.ground.xyz_m;
                away_m.norm() / focal_length_px
            })
        });
        let apart = apart(&self.points, line_spacing_m, pixel_size_m);
        let apart_m =
            residuals[0].mean_x * line_spacing_m[0] - residuals[1].mean_x * line_spacing_m[1];
        let scatter_m = apart.deviation_x * mean(line_spacing_m);
        let apart_sigma_m = scatter_m / (self.points.len() as f64).sqrt();
        let budget = budget_input(
            PairResiduals {
                images: residuals,
                apart,
            },
            footprints.as_ref(),
            line_spacing_m,
            height_over_base,
        );
        let middle = &self.points[self.points.len() / 2];
        PairComparison {
            along_track: along_track(pair, body, middle, line_spacing_m, [apart_m, apart_sigma_m]),
            images: pair.map(|image| image.id.clone()),
            ties: u32::try_from(self.points.len()).unwrap_or(u32::MAX),
            convergence_rad: self.each(|point, _| point.convergence_rad),
            height_over_base,
            line_spacing_m,
            pixel_size_m,
            residuals,
            along_track_parallax_m: apart_m.abs(),
            footprints,
            mola_spacing_m,
            budget: uncertainty_budget(&budget).map_err(|error| error.to_string()),
        }
    }

    fn moments(&self, at: usize) -> ResidualMoments {
        let of = |pick: fn(&MeasureResidual) -> f64| {
            let values: Vec<f64> = self.points.iter().map(|(_, m)| pick(&m[at])).collect();
            Summary::of(&values)
        };
        moments_of(&of(|m| m.reprojection_lines), &of(|m| m.reprojection_px))
    }
}

fn footprints_by_ties<M: ExteriorOrientation>(
    images: [(&OrientedCamera<M>, &ImageRegistration); 2],
    pair: [usize; 2],
    ties: &[TiePoint],
    footprints: &Footprints<BodyFixed>,
    (profiles, spacings): (&[Profile], &[Option<f64>]),
    line_spacing_m: f64,
) -> Option<FootprintsByTies> {
    let pairs: Vec<Pair> = ties.iter().filter_map(|tie| tie_pair(tie, pair)).collect();
    let fit = ImageToImage::through(&pairs)?;
    let places = images.map(|(_, registration)| places(registration));
    let mut compared = Vec::new();
    let mut outside = 0;
    for ((index, profile), spacing_m) in (0_u32..).zip(profiles).zip(spacings) {
        let in_both = profile.rows.iter().filter_map(|row| {
            let shot = (index, *row);
            Some((*row, [places[0].get(&shot)?, places[1].get(&shot)?]))
        });
        let (shown, not_shown): (Vec<(u32, [&Place; 2])>, Vec<_>) =
            in_both.partition(|(_, both)| both.iter().all(|place| place.inside));
        outside += not_shown.len();
        let pairs: Vec<Pair> = shown
            .iter()
            .map(|(_, [first, second])| Pair {
                first: first.at,
                second: second.at,
            })
            .collect();
        let found = fit.misregistration(&pairs);
        if found.lines.n == 0 {
            continue;
        }
        let along_m = found.lines.mean * line_spacing_m;
        let rows: Vec<_> = shown.iter().map(|(row, both)| (*row, both[0].at)).collect();
        let cameras = images.map(|(camera, _)| camera);
        let heights = footprint_heights(cameras, &fit, &rows, footprints);
        let above_m: Vec<f64> = heights.iter().map(FootprintHeight::above_m).collect();
        compared.push(ProfileByTies {
            profile: profile.id.clone(),
            lines: found.lines,
            samples: found.samples,
            along_m,
            along_sigma_m: found.lines_sigma * line_spacing_m,
            along_spacings: spacing_m.map(|spacing_m| along_m / spacing_m),
            beyond_ties: u32::try_from(found.beyond_ties).unwrap_or(u32::MAX),
            heights,
            above_m: Summary::of(&above_m),
        });
    }
    let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    Some(FootprintsByTies {
        order: fit.order(),
        ties: count(fit.ties),
        ties_rejected: count(fit.ties_rejected),
        tie_lines: fit.tie_lines,
        tie_samples: fit.tie_samples,
        apart_m: over_footprints(&compared, |of| of.along_m.abs()),
        apart_sigma_m: over_footprints(&compared, |of| of.along_sigma_m),
        profiles: compared,
        outside: count(outside),
    })
}

/// Mean of a value of each profile, weighted by its footprints; `None` without any.
fn over_footprints(profiles: &[ProfileByTies], of: fn(&ProfileByTies) -> f64) -> Option<f64> {
    let (mut footprints, mut sum) = (0.0, 0.0);
    for profile in profiles {
        footprints += f64::from(profile.lines.n);
        sum += f64::from(profile.lines.n) * of(profile);
    }
    (footprints > 0.0).then(|| sum / footprints)
}

/// Line and sample of a tie point in both images.
fn tie_pair(tie: &TiePoint, pair: [usize; 2]) -> Option<Pair> {
    let place = |image: usize| {
        let measure = tie.measures.iter().find(|measure| measure.image == image)?;
        Some([measure.line, measure.sample])
    };
    Some(Pair {
        first: place(pair[0])?,
        second: place(pair[1])?,
    })
}

/// A footprint within the lines of an image.
struct Place {
    /// Line and sample.
    at: [f64; 2],
    /// Whether the delivered image shows it.
    inside: bool,
}

/// Footprints within the image's lines, by profile and row.
fn places(registration: &ImageRegistration) -> BTreeMap<(u32, u32), Place> {
    let points = &registration.points;
    (0..points.len())
        .filter(|index| !points.extrapolated.at(*index))
        .map(|index| {
            let shot = (points.profile.at(index), points.row.at(index));
            let place = Place {
                at: [points.line.at(index), points.sample.at(index)],
                inside: points.inside.at(index),
            };
            (shot, place)
        })
        .collect()
}

/// Median distance of successive footprints of a profile, metres.
fn shot_spacing_m(footprints: &Footprints<BodyFixed>, profile: &Profile) -> Option<f64> {
    let ground_m = |row: &u32| {
        let row = *row as usize;
        spherical_to_xyz_m(
            footprints.longitude_rad.at(row),
            footprints.latitude_rad.at(row),
            footprints.ground_radius_m(row),
        )
    };
    let successive = profile.rows.windows(2);
    median(successive.map(|pair| (ground_m(&pair[1]) - ground_m(&pair[0])).norm()))
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| Summary::of(&values).median)
}
