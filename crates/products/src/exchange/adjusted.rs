//! Adjusted shots and tie points in the forms of ISIS and Ames Stereo Pipeline.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::{
    gcp::{ControlMeasure, ControlPoint, write_gcp},
    lidar_data::{LidarPoint, ProfileShift, write_lidar_data},
    points::{GroundEstimate, ImageMeasure, SharedSigmas},
};
use crate::{
    AdjustmentProducts, ImageProducts, SiteProducts,
    product::{Content, Declaration, Program, Role, Use, Write},
};
use areograph_base::{
    frames::{BodyFixed, Position},
    time::Et,
};
use areograph_stages::{
    adjust::{CorrectedPoint, recorded_m2},
    mola_surface::MolaShots,
    read_ties::Ties,
};

pub(crate) static LIDAR: Declaration = Declaration {
    path: "exchange/lidar.json",
    what: "shots with ranges for ISIS: a priori and adjusted points, with image coordinates by the adjusted \
           orientation",
    readers: "ISIS",
    rows: "shots",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, _, adjustment| {
        let images = of.site.images.iter();
        let names: Vec<String> = images.map(|image| isis_name(of.site, image)).collect();
        let shots = lidar_points(of.site, adjustment, &names);
        let shared = profile_shifts(of.site, adjustment);
        let some = !shots.is_empty();
        some.then(|| write_lidar_data(path, &shared, &shots))
            .transpose()
    }),
    uses: &[Use {
        program: Program::Isis,
        lines: "jigsaw fromlist=cubes.lis cnet=ties.net onet=out.net lidardata=lidar.json olidarfile=out \\\n  \
                spsolve=position",
    }],
};

pub(crate) static CONTROL: Declaration = Declaration {
    path: "exchange/adjusted.gcp",
    what: "adjusted tie points as ground control points; the images are named <image>.cub",
    readers: "Ames Stereo Pipeline",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        let images = of.site.images.iter();
        let files: Vec<String> = images
            .map(|image| format!("{}.cub", image.times.id))
            .collect();
        let points = control_points(of.site, geometric.ties, adjustment, &files);
        let some = !points.is_empty();
        let shared = shared_sigmas(adjustment);
        some.then(|| write_gcp(path, of.site.config.body, shared.as_ref(), &points))
            .transpose()
    }),
    uses: &[Use {
        program: Program::StereoPipeline,
        lines: "# Standard deviations are along x, y, z; do not add --use-lon-lat-height-gcp-error:\n\
                bundle_adjust --datum {asp_datum} IMAGES CAMERAS adjusted.gcp -o run/out",
    }],
};

/// The serial number that ISIS has for an image: as configured, else as ISIS composes it.
pub(super) fn isis_name(site: &SiteProducts, image: &ImageProducts) -> String {
    let id = &image.times.id;
    let configured = site.config.images.iter().find(|image| image.id == *id);
    let configured = configured.and_then(|image| image.serial_number.clone());
    configured
        .or_else(|| image.times.isis_serial_number())
        .unwrap_or_else(|| id.clone())
}

fn estimate(position: Position<BodyFixed>, covariance_m2: Matrix3<f64>) -> GroundEstimate {
    GroundEstimate {
        position,
        covariance_m2,
    }
}

pub(super) fn adjusted(point: &CorrectedPoint) -> GroundEstimate {
    estimate(point.ground, point.covariance_m2)
}

/// The error that all tie points share.
pub(super) fn shared_sigmas(adjustment: &AdjustmentProducts) -> Option<SharedSigmas> {
    let heights = adjustment.adjusted.heights.as_ref()?;
    let parts = heights.mean_sigma_parts.all();
    let of_all_sites_m2 = |axis: usize| {
        let elsewhere = parts.iter().filter(|of| of.of_all_sites);
        elsewhere.map(|of| of.sigma_m[axis].powi(2)).sum::<f64>()
    };
    Some(SharedSigmas {
        sigma_m: heights.mean_sigma_m,
        of_all_sites_m: [0, 1, 2].map(|axis| of_all_sites_m2(axis).sqrt()),
    })
}

/// A priori knowledge of the shift of each profile with a range, in order.
fn profile_shifts<'a>(
    site: &'a SiteProducts<'a>,
    adjustment: &AdjustmentProducts,
) -> Vec<ProfileShift<'a>> {
    let result = adjustment.adjusted;
    let of_ranges = result.ranges.iter().filter_map(|range| {
        let shared = result.points[range.point].shared?;
        Some((range.profile, shared.sigma_m))
    });
    let by_profile: BTreeMap<usize, [f64; 3]> = of_ranges.collect();
    let apriori =
        MolaShots::profile_sigmas_m(site.footprints, site.profiles, &site.config.laser_surface);
    let shift = |(profile, adjusted_sigma_m): (usize, [f64; 3])| ProfileShift {
        profile: &site.profiles[profile].id,
        apriori_sigma_m: apriori[profile].into(),
        adjusted_sigma_m,
    };
    by_profile.into_iter().map(shift).collect()
}

/// Shots with a range and their coordinates in the adjusted images: others have no separate observation equation in
/// ISIS.
fn lidar_points<'a>(
    site: &SiteProducts<'a>,
    adjustment: &AdjustmentProducts<'a>,
    names: &'a [String],
) -> Vec<LidarPoint<'a>> {
    let config = &site.config.adjustment;
    let result = adjustment.adjusted;
    let shifts =
        MolaShots::profile_sigmas_m(site.footprints, site.profiles, &site.config.laser_surface);
    let places: Vec<BTreeMap<usize, [f64; 2]>> = adjustment.images.iter().map(places).collect();
    let shots = result.ranges.iter().filter_map(|range| {
        let point = &result.points[range.point];
        let image = &result.images[range.image];
        let time_bias_s = image.time_bias_s.map_or(0.0, |(bias_s, _)| bias_s);
        let measures = names.iter().zip(&places).filter_map(|(image, places)| {
            let [line, sample] = *places.get(&point.index)?;
            Some(ImageMeasure {
                image,
                line,
                sample,
            })
        });
        let measures: Vec<ImageMeasure> = measures.collect();
        if measures.is_empty() {
            return None;
        }
        Some(LidarPoint {
            id: &point.id,
            // A time bias of the image is folded into its adjusted kernels.
            et: Et::from_seconds(site.footprints.et_s.at(point.index) - time_bias_s),
            range_m: range.range_m,
            range_sigma_m: config.range_sigma_m,
            apriori: estimate(
                point.initial,
                recorded_m2(
                    &point.initial.xyz_m,
                    config.ground_sigma_m,
                    shifts[range.profile].into(),
                ),
            ),
            adjusted: Some(adjusted(point)),
            simultaneous_images: vec![&names[range.image]],
            measures,
        })
    });
    shots.collect()
}

/// Line and sample of the footprints in the delivered image, by their rows.
fn places(image: &ImageProducts) -> BTreeMap<usize, [f64; 2]> {
    let points = &image.registration.points;
    (0..points.len())
        .filter(|index| points.inside.at(*index))
        .map(|index| {
            (
                points.row.at(index) as usize,
                [points.line.at(index), points.sample.at(index)],
            )
        })
        .collect()
}

/// Adjusted tie points with their measurements.
fn control_points<'a>(
    site: &SiteProducts<'a>,
    ties: &'a Ties,
    adjustment: &'a AdjustmentProducts<'a>,
    files: &'a [String],
) -> Vec<ControlPoint<'a>> {
    let usual_px = tie_sigmas_px(site, adjustment);
    let points = adjustment.adjusted_ties().filter_map(|point| {
        let tie = ties.points.get(point.index)?;
        let measures = tie.measures.iter().filter_map(|measure| {
            let file = files.get(measure.image)?;
            let [line_px, sample_px] = measure.sigma_px.unwrap_or(usual_px[measure.image]);
            Some(ControlMeasure {
                measure: ImageMeasure {
                    image: file,
                    line: measure.line,
                    sample: measure.sample,
                },
                sigma_px: [sample_px, line_px],
            })
        });
        Some(ControlPoint {
            id: &point.id,
            ground: adjusted(point),
            relative_sigma_m: point.shared.map(|shared| {
                // Rounding may leave the variance of a difference a little below 0.
                let variances_m2 = shared.relative_m2.diagonal();
                variances_m2.map(|of_m2| of_m2.max(0.0).sqrt()).into()
            }),
            measures: measures.collect(),
        })
    });
    points.collect()
}

/// Standard deviations of line and sample of measurements whose file does not state them, for each image, lines and
/// pixels.
pub(super) fn tie_sigmas_px(site: &SiteProducts, adjustment: &AdjustmentProducts) -> Vec<[f64; 2]> {
    let [along_px, across_px] = site.config.adjustment.tie_sigma_px;
    let images = 0..adjustment.images.len();
    images
        .map(|image| [along_px / focal_px_per_line(adjustment, image), across_px])
        .collect()
}

/// Length of a line in focal-plane pixels, from the pairs of the image.
fn focal_px_per_line(adjustment: &AdjustmentProducts, image: usize) -> f64 {
    let id = &adjustment.images[image].times.id;
    let mut pairs = adjustment.pairs.iter().filter_map(|pair| {
        let at = pair.images.iter().position(|image| image == id)?;
        Some(pair.line_spacing_m[at] / pair.pixel_size_m[at])
    });
    pairs.next().unwrap_or(1.0)
}
