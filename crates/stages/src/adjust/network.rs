//! The network of a site: identifiers become indices, places become focal coordinates.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Vector2, Vector3};

use super::{
    attitude_clock::by_attitude_clock,
    boresight_prior::BoresightPrior,
    common_pass::common_passes,
    error::AdjustError,
    input::{AdjustImage, LaserShots},
    line_times::delay_sigma_s,
    points::{PointKind, RejectedPoint, RejectionReason},
};
use crate::intersect::IntersectedTies;
use areograph_base::{
    error::Result,
    footprints::FootprintImageCoordinates,
    frames::{BodyFixed, Position},
    ties::{KnownGround, TiePoint, require_images},
};
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    bundle::{BundlePoint, HeightControl, Jitter, KnownCoordinates, Network, Range, View},
    pushbroom::{ExteriorOrientation, Projector},
};

/// Jitter of the attitude where heights determine the position: a choice, one sixth of the largest residuals of attitudes to a parabola
/// over an image, 24 µrad (Shan et al. 2005, Table 4). Without it, standard deviations are too small on plains (decision 0029).
const JITTER: Jitter = Jitter {
    sigma_rad: 4e-6,
    time_s: 1.0,
};

/// A point or a profile of the network by its index at the site, and by its name for messages.
pub(super) struct Named {
    pub(super) index: usize,
    pub(super) name: String,
}

/// A network with the names of its parts.
pub(super) struct Assembled<M> {
    pub(super) network: Network<M>,
    /// Shots, by the rows of their footprints, then tie points.
    pub(super) points: Vec<Named>,
    pub(super) shots: usize,
    /// Profiles with a range.
    pub(super) profiles: Vec<Named>,
    pub(super) rejected: Vec<RejectedPoint>,
    /// Image coordinates of the footprints from the initial orientations.
    pub(super) mola: Vec<View>,
    /// Standard deviation of a delay of all lines of an image: as configured, and as far as it is no unknown, seconds.
    pub(super) plausible_delay_s: f64,
    pub(super) unseen_delay_s: f64,
    /// Scatter of tie points that was added to their standard deviations, pixels.
    pub(super) tie_scatter_px: f64,
    /// Reason why the laser's position in images is not an observation although it was requested.
    pub(super) no_spots: Option<String>,
    /// A priori boresight of the laser, where its position in images is an observation.
    pub(super) boresight: Option<BoresightPrior>,
}

pub(super) fn assemble<'a, M: ExteriorOrientation>(
    images: &'a [AdjustImage<M>],
    shots: &LaserShots,
    ties: &[TiePoint],
    starts: &IntersectedTies,
    config: &AdjustmentConfig,
) -> Result<Assembled<&'a M>> {
    let mut assembled = Assembled {
        network: Network {
            images: images.iter().map(AdjustImage::bundle_image).collect(),
            expected_m: images.iter().map(|image| image.expected_m).collect(),
            ..Network::default()
        },
        points: Vec::with_capacity(shots.shots.len() + ties.len()),
        shots: shots.shots.len(),
        profiles: Vec::new(),
        rejected: Vec::new(),
        mola: Vec::new(),
        plausible_delay_s: config.line_time_sigma_s,
        unseen_delay_s: delay_sigma_s(config),
        tie_scatter_px: 0.0,
        no_spots: None,
        boresight: None,
    };
    assembled.add_shots(shots, config)?;
    assembled.mola = footprints_in_images(images, shots, config)?;
    if config.footprints_in_images() == FootprintImageCoordinates::Weighted {
        assembled.network.views.extend(&assembled.mola);
    }
    assembled.add_ties(images, ties, starts, config)?;
    let delay_s = assembled.unseen_delay_s;
    assembled.network.passes = common_passes(&assembled.network.images, images, delay_s);
    if config.attitude_clock {
        by_attitude_clock(&mut assembled.network, images, config);
    }
    if let Some(surface) = &shots.surface {
        let ties = assembled.shots..assembled.points.len();
        assembled.network.heights = Some(HeightControl {
            surface: surface.clone(),
            jitter: Some(JITTER),
            common_noise: None,
            compared: ties.collect(),
            observed: Vec::new(),
        });
    }
    Ok(assembled)
}

/// Finds lines for points throughout an image.
pub(super) fn projector<'a, M, O: ExteriorOrientation>(
    image: &AdjustImage<M>,
    orientation: &'a O,
) -> std::result::Result<Projector<'a, O>, AdjustError> {
    let projector = Projector::new(orientation, image.oriented_camera.lines());
    let projector = projector.map_err(|unseen| AdjustError::Blind {
        image: image.oriented_camera.id.clone(),
        unseen,
    })?;
    Ok(projector.through(image.oriented_camera.detector.distortion))
}

/// Image coordinates of the footprints from the initial orientations, in and around each image.
fn footprints_in_images<M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    shots: &LaserShots,
    config: &AdjustmentConfig,
) -> std::result::Result<Vec<View>, AdjustError> {
    let mut views = Vec::new();
    for (index, image) in images.iter().enumerate() {
        let projector = projector(image, &image.oriented_camera.orientation)?;
        let detector = &image.oriented_camera.detector;
        let samples = -config.footprint_margin_px..=detector.samples + config.footprint_margin_px;
        for (point, shot) in shots.shots.iter().enumerate() {
            // Points that the camera does not see are skipped.
            let Ok(seen) = projector.project(&shot.ground.xyz_m) else {
                continue;
            };
            let Ok(focal) = detector.focal_px(&seen.camera_m) else {
                continue;
            };
            let inside = seen.x.abs() <= 0.5 * image.oriented_camera.lines()
                && samples.contains(&detector.sample(focal.y));
            if inside {
                views.push(View {
                    point,
                    image: index,
                    x_lines: seen.x,
                    y_px: focal.y,
                    sigma_px: Vector2::from(config.footprint_sigma_px),
                });
            }
        }
    }
    Ok(views)
}

/// Standard deviation of coordinates that are held fixed, metres: far below the resolution of measurements, well above
/// rounding.
const FIXED_M: f64 = 1e-3;

/// Accuracy of the known coordinates of a tie point.
fn known_coordinates(
    id: &str,
    known: &KnownGround,
) -> std::result::Result<KnownCoordinates, AdjustError> {
    let Some(covariance_m2) = &known.covariance_m2 else {
        return Ok(KnownCoordinates::of_sigmas(Vector3::repeat(FIXED_M)));
    };
    KnownCoordinates::of_covariance(covariance_m2).map_err(|least_m2| AdjustError::Value {
        what: format!("the smallest eigenvalue of the covariance matrix of tie point {id}, m²,"),
        value: least_m2,
        expected: "a positive number",
    })
}

/// Maximum number of tie points with an observed height: surface errors at neighbours are alike, so more points add no
/// information.
const CONTROLLED_MAX: usize = 400;

/// At most `most` of the entries, evenly spread.
fn evenly(entries: &[usize], most: usize) -> Vec<usize> {
    let count = entries.len().min(most);
    (0..count)
        .map(|index| entries[index * entries.len() / count])
        .collect()
}

impl<M> Assembled<M> {
    /// Adds heights as observations.
    pub(super) fn observe_heights(&mut self) {
        let measured: BTreeSet<usize> = self.network.views.iter().map(|view| view.point).collect();
        let places_m = |point: &usize| self.network.points[*point].ground_m;
        let Some(control) = &mut self.network.heights else {
            return;
        };
        control.compared.retain(|point| measured.contains(point));
        let mut points = control.compared.clone();
        // Sorted by position, so that the selection does not depend on the order in files.
        let by_place = |one: &usize, other: &usize| {
            let (one, other) = (places_m(one), places_m(other));
            let axes = [2, 1, 0].map(|axis| one[axis].total_cmp(&other[axis]));
            axes.into_iter()
                .fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        };
        points.sort_by(by_place);
        control.observed = evenly(&points, CONTROLLED_MAX);
    }

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
        shots: &LaserShots,
        config: &AdjustmentConfig,
    ) -> std::result::Result<(), AdjustError> {
        let mut used = BTreeSet::new();
        let mut profiles = BTreeMap::new();
        for (point, shot) in shots.shots.iter().enumerate() {
            let name = shots.name(shot);
            if !used.insert((shot.profile, shot.row)) {
                return Err(AdjustError::DuplicateShot(name));
            }
            let index = shot.row as usize;
            self.points.push(Named { index, name });
            self.network.points.push(BundlePoint {
                ground_m: shot.ground.xyz_m,
                known: Some(KnownCoordinates::of_sigmas(Vector3::repeat(
                    config.ground_sigma_m,
                ))),
            });
            let Some(range) = &shot.range else { continue };
            let profile = *profiles.entry(shot.profile).or_insert_with_key(|index| {
                self.profiles.push(Named {
                    index: *index,
                    name: shots.profiles[*index].clone(),
                });
                self.network.range_bias_sigmas_m.push(config.range_bias_m());
                self.profiles.len() - 1
            });
            self.network.ranges.push(Range {
                point,
                image: range.image,
                x_lines: range.x_lines,
                to_laser_m: range.to_laser_m,
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
        require_images(ties, images.len())?;
        let starts: BTreeMap<usize, &Position<BodyFixed>> = starts
            .points
            .iter()
            .map(|point| (point.tie, &point.ground))
            .collect();
        for (index, tie) in ties.iter().enumerate() {
            let known = tie.known.as_ref();
            let start = known
                .map(|known| &known.ground)
                .or_else(|| starts.get(&index).copied());
            let Some(ground) = start else {
                self.rejected.push(RejectedPoint {
                    kind: PointKind::Tie,
                    index,
                    id: tie.id.clone(),
                    reason: RejectionReason::NotIntersected,
                });
                continue;
            };
            let point = self.points.len();
            self.points.push(Named {
                index,
                name: tie.id.clone(),
            });
            self.network.points.push(BundlePoint {
                ground_m: ground.xyz_m,
                known: known
                    .map(|known| known_coordinates(&tie.id, known))
                    .transpose()?,
            });
            for measure in &tie.measures {
                let image = measure.image;
                let oriented_camera = &images[image].oriented_camera;
                let (x_lines, focal_px) =
                    oriented_camera.focal_plane_coordinates(measure.line, measure.sample);
                let per_sample = oriented_camera.detector.focal_px_per_sample(focal_px.y);
                let [along_px, across_px] = match measure.sigma_px {
                    None => config.tie_sigma_px,
                    Some([lines, samples]) => {
                        let per_line = oriented_camera.focal_px_per_line(x_lines, &ground.xyz_m);
                        [lines * per_line, samples]
                    }
                };
                let sigma_px = Vector2::new(along_px, across_px * per_sample);
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
