//! The network of a site: identifiers become indices, places become focal coordinates.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::{
    AdjustFault, AdjustImage, LaserShot, LeftOut, LeftOutReason, PointKind, image_index, pair,
};
use crate::{
    config::AdjustmentConfig,
    error::Result,
    footprints::FootprintImageCoordinates,
    geom::{
        bundle::{BundleImage, BundlePoint, Network, Range, View},
        pushbroom::{ExteriorOrientation, Projector},
    },
    stages::intersect::IntersectedTies,
    ties::{TiePoint, image_indices},
};

/// A network with the names of its parts.
pub(super) struct Assembled<M> {
    pub(super) network: Network<M>,
    /// Identifiers of the points: shots, then tie points.
    pub(super) points: Vec<String>,
    pub(super) shots: usize,
    pub(super) profiles: Vec<String>,
    pub(super) left_out: Vec<LeftOut>,
    /// Where the initial orientations put the footprints.
    pub(super) mola: Vec<View>,
}

pub(super) fn assemble<'a, M: ExteriorOrientation>(
    images: &'a [AdjustImage<M>],
    shots: &[LaserShot],
    ties: &[TiePoint],
    starts: &IntersectedTies,
    config: &AdjustmentConfig,
) -> Result<Assembled<&'a M>> {
    let mut assembled = Assembled {
        network: Network {
            images: images.iter().map(bundle_image).collect(),
            ..Network::default()
        },
        points: Vec::with_capacity(shots.len() + ties.len()),
        shots: shots.len(),
        profiles: Vec::new(),
        left_out: Vec::new(),
        mola: Vec::new(),
    };
    assembled.add_shots(images, shots, config)?;
    assembled.mola = footprints_in_images(images, shots, config)?;
    if config.footprint_image_coordinates == FootprintImageCoordinates::Weighted {
        assembled.network.views.extend(&assembled.mola);
    }
    assembled.add_ties(images, ties, starts, config)?;
    Ok(assembled)
}

fn bundle_image<M>(image: &AdjustImage<M>) -> BundleImage<&M> {
    BundleImage {
        base: &image.stereo.orientation,
        half_lines: 0.5 * image.stereo.lines,
        line_period_s: image.line_period_s,
        focal_length_px: image.stereo.detector.focal_length_px,
        distortion: image.stereo.detector.distortion,
        sigmas: image.sigmas,
        time_bias_sigma_s: image.time_bias_sigma_s,
    }
}

/// Finds lines for points in the whole of an image.
pub(super) fn projector<'a, M, O: ExteriorOrientation>(
    image: &AdjustImage<M>,
    orientation: &'a O,
) -> std::result::Result<Projector<'a, O>, AdjustFault> {
    let projector = Projector::new(orientation, image.stereo.lines);
    let projector = projector.map_err(|unseen| AdjustFault::Blind {
        image: image.stereo.id.clone(),
        unseen,
    })?;
    Ok(projector.through(image.stereo.detector.distortion))
}

/// Where the initial orientations put the footprints, in and around each image.
fn footprints_in_images<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    shots: &[LaserShot],
    config: &AdjustmentConfig,
) -> std::result::Result<Vec<View>, AdjustFault> {
    let mut views = Vec::new();
    for (index, image) in images.iter().enumerate() {
        let projector = projector(image, &image.stereo.orientation)?;
        let detector = &image.stereo.detector;
        let samples = -config.footprint_margin_px..=detector.samples + config.footprint_margin_px;
        for (point, shot) in shots.iter().enumerate() {
            // What a camera does not see is not in its image.
            let Ok(seen) = projector.project(&Vector3::from(shot.ground_m)) else {
                continue;
            };
            let Ok(focal) = detector.focal_px(&seen.camera_m) else {
                continue;
            };
            let inside = seen.x.abs() <= 0.5 * image.stereo.lines
                && samples.contains(&detector.sample(focal.y));
            if inside {
                views.push(View {
                    point,
                    image: index,
                    x_lines: seen.x,
                    y_px: focal.y,
                    sigma_px: pair(config.footprint_sigma_px),
                });
            }
        }
    }
    Ok(views)
}

impl<M> Assembled<M> {
    /// Whether the point at this index is a shot or a tie point.
    pub(super) fn kind(&self, point: usize) -> PointKind {
        if point < self.shots {
            PointKind::Shot
        } else {
            PointKind::Tie
        }
    }
}

impl<'a, M: ExteriorOrientation> Assembled<&'a M> {
    fn add_shots(
        &mut self,
        images: &'a [AdjustImage<M>],
        shots: &[LaserShot],
        config: &AdjustmentConfig,
    ) -> std::result::Result<(), AdjustFault> {
        let image_index = image_index(images);
        let mut used = BTreeSet::new();
        let mut profiles = BTreeMap::new();
        for (point, shot) in shots.iter().enumerate() {
            if !used.insert(shot.id.as_str()) {
                return Err(AdjustFault::DuplicateShot(shot.id.clone()));
            }
            self.points.push(shot.id.clone());
            self.network.points.push(BundlePoint {
                ground_m: shot.ground_m.into(),
                sigma_m: Some(Vector3::repeat(config.ground_sigma_m)),
            });
            let Some(range) = &shot.range else { continue };
            let Some(image) = image_index.get(range.image.as_str()) else {
                return Err(AdjustFault::UnknownImage {
                    shot: shot.id.clone(),
                    image: range.image.clone(),
                    known: image_index.keys().copied().collect::<Vec<_>>().join(", "),
                });
            };
            let profile = *profiles.entry(range.profile.as_str()).or_insert_with(|| {
                self.profiles.push(range.profile.clone());
                self.network
                    .range_bias_sigmas_m
                    .push(config.range_bias_sigma_m);
                self.profiles.len() - 1
            });
            self.network.ranges.push(Range {
                point,
                image: *image,
                x_lines: range.x_lines,
                range_m: range.range_m,
                sigma_m: config.range_sigma_m,
                profile,
            });
        }
        Ok(())
    }

    fn add_ties(
        &mut self,
        images: &'a [AdjustImage<M>],
        ties: &[TiePoint],
        starts: &IntersectedTies,
        config: &AdjustmentConfig,
    ) -> Result<()> {
        let ids: Vec<&str> = images
            .iter()
            .map(|image| image.stereo.id.as_str())
            .collect();
        let indices = image_indices(&ids, ties)?;
        // Of tie points with the same identifier the first was intersected.
        let mut starts: BTreeMap<&str, &[f64; 3]> = starts
            .points
            .iter()
            .map(|point| (point.id.as_str(), &point.ground_m))
            .collect();
        for (tie, indices) in ties.iter().zip(indices) {
            let Some(ground_m) = starts.remove(tie.id.as_str()) else {
                self.left_out.push(LeftOut {
                    kind: PointKind::Tie,
                    id: tie.id.clone(),
                    reason: LeftOutReason::NotIntersected,
                });
                continue;
            };
            let point = self.points.len();
            self.points.push(tie.id.clone());
            self.network.points.push(BundlePoint {
                ground_m: Vector3::from(*ground_m),
                sigma_m: None,
            });
            for (measure, image) in tie.measures.iter().zip(indices) {
                let stereo = &images[image].stereo;
                let (x_lines, focal_px) = stereo.focal_place(measure.line, measure.sample);
                let mut sigma_px = pair(config.tie_sigma_px);
                sigma_px.y *= stereo.detector.focal_px_per_sample(focal_px.y);
                self.network.views.push(View {
                    point,
                    image,
                    x_lines,
                    y_px: focal_px.y,
                    sigma_px,
                });
            }
        }
        Ok(())
    }
}
