//! Intersection and combined adjustment of a real network: ISIS's LROC pair with its ties and LOLA ranges.
//!
//! The adjusted orientation is the one sampled from the support data, nothing fitted to it. Ties count the
//! pixels of the real images, so that the support data must agree with them; the places of the shots
//! do not (`real_registration.rs`), and come from the orientation under adjustment here.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]
#![allow(
    clippy::print_stderr,
    reason = "the numbers are worth seeing: cargo test --test real real_adjustment -- --nocapture"
)]

use crate::common;
use areograph_testing::lunar_pair;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    body::Body,
    config::AdjustmentConfig,
    footprints::{AdjustmentModel, FootprintImageCoordinates},
    frames::Position,
    geom::{
        ellipsoid::height_m as height_above_m,
        intersection::{IntersectionLimits, Unintersected},
        oriented_camera::OrientedCamera,
        pushbroom::{CorrectedOrientation, ExteriorOrientation, SampledOrientation},
        statistics::Summary,
        surface::{LaserSurface, SurfaceOptions, SurfaceShot},
    },
    pds::ties::read_ties,
    stages::{
        adjust::{
            AdjustImage, Adjusted, LaserShot, LaserShots, PointKind, ShotRange, adjust,
            orientation_sigmas,
        },
        intersect::{IntersectOptions, IntersectedTies, TieRejection, intersect_ties},
    },
    ties::TiePoint,
    units::RADIANS_PER_DEGREE,
};
use lunar_pair::{FOLDER, Image, LidarPoint, SERIALS, images, lidar_points};
use nalgebra::Vector3;

/// Radius of the Moon in the support data, metres.
const MOON_RADIUS_M: f64 = 1_737_400.0;
/// Distance of the ground, metres: turns 100 m of position into the angle that moves the ground as far.
const RANGE_M: f64 = 56_000.0;
/// Unknowns of an image's orientation.
const UNKNOWNS: usize = 18;

/// The network with its images.
struct Site {
    images: [Image; 2],
    points: Vec<LidarPoint>,
    ties: Vec<TiePoint>,
    /// The file of the ties.
    network: PathBuf,
}

/// What is known of the orientation of the two images beforehand.
type Priors = [[f64; UNKNOWNS]; 2];

/// ISIS's own test: one constant for each coordinate and angle, 1000 m and 2°.
///
/// The ties alone, which is what ISIS compares with, are too little for these: the two images can roll against
/// each other, which lifts or lowers all ties by kilometres, and the iteration finds no rest. Footprints
/// with places in both images hold them.
fn priors_of_isis() -> Priors {
    let all = orientation_sigmas(1000.0, 2.0 * RADIANS_PER_DEGREE);
    // Of the powers 0, 1 and 2 only the first is unknown.
    [std::array::from_fn(|index| if index % 3 == 0 { all[index] } else { 0.0 }); 2]
}

/// Yoon & Shan 2004: 100 m for the nadir image, 200 m for the other, angles likewise at the ground.
fn priors_of_the_paper() -> Priors {
    [100.0, 200.0].map(|position_m| orientation_sigmas(position_m, position_m / RANGE_M))
}

/// As in ISIS: 1.4 px for ties, 30 px for the places of footprints, and the 10 m of `lidarData.json` for ranges and
/// coordinates.
fn options(footprint_image_coordinates: FootprintImageCoordinates) -> AdjustmentConfig {
    AdjustmentConfig {
        model: AdjustmentModel::Published,
        tie_sigma_px: [1.4; 2],
        footprint_image_coordinates: Some(footprint_image_coordinates),
        footprint_sigma_px: [30.0; 2],
        ground_sigma_m: 10.0,
        range_sigma_m: 10.0,
        blunder_limit: None,
        ..AdjustmentConfig::default()
    }
}

impl Site {
    fn read(test: &str) -> Option<Self> {
        let folder = common::real_data(FOLDER, test)?;
        let root = folder.ancestors().nth(2)?;
        let network = root.join("isis_lidar/LidarNetwork/network.pvl");
        let images = images(root);
        let ties = ties(&network, &images);
        let points = lidar_points(&network.with_file_name("lidarData.json"));
        Some(Self {
            images,
            points,
            ties,
            network,
        })
    }

    fn oriented_camera(&self) -> Vec<OrientedCamera<SampledOrientation>> {
        let named = SERIALS.iter().zip(&self.images);
        named
            .map(|(serial, image)| OrientedCamera {
                id: (*serial).to_owned(),
                orientation: image.orientation.clone(),
                detector: image.detector,
                line_times: common::line_times(image.lines, image.period_s),
            })
            .collect()
    }

    fn intersect(&self, ties: &[TiePoint]) -> IntersectedTies {
        let mut options = IntersectOptions::default();
        options.limits = IntersectionLimits {
            equatorial_radius_m: MOON_RADIUS_M,
            polar_radius_m: MOON_RADIUS_M,
            ..options.limits
        };
        intersect_ties(&self.oriented_camera(), ties, &options).unwrap()
    }

    fn shots(&self, with_ranges: bool) -> LaserShots {
        let shot = |(row, point): (u32, &LidarPoint)| LaserShot {
            profile: 0,
            row,
            ground: Position::new(point.ground_m),
            range: with_ranges.then(|| ShotRange {
                to_laser_m: Vector3::zeros(),
                image: 0,
                x_lines: self.images[0].x_lines(point.et_s),
                range_m: point.range_m,
            }),
            also: Vec::new(),
        };
        LaserShots {
            profiles: vec!["LOLA".to_owned()],
            profile_sigmas_m: vec![Vector3::zeros()],
            shots: (0..).zip(&self.points).map(shot).collect(),
            surface: None,
        }
    }

    fn adjust(&self, priors: &Priors, options: &AdjustmentConfig, with_ranges: bool) -> Adjusted {
        self.adjust_with(priors, options, with_ranges, None)
    }

    fn adjust_with(
        &self,
        priors: &Priors,
        options: &AdjustmentConfig,
        with_ranges: bool,
        surface: Option<LaserSurface>,
    ) -> Adjusted {
        let images = self
            .oriented_camera()
            .into_iter()
            .zip(&self.images)
            .zip(priors);
        let images: Vec<_> = images
            .map(|((oriented_camera, image), sigmas)| AdjustImage {
                oriented_camera,
                line_period_s: image.period_s,
                sigmas: *sigmas,
                time_bias_sigma_s: 0.0,
                turn_rad_s: Vector3::zeros(),
                expected_m: Vector3::zeros(),
                line_delay: None,
                pass: None,
                laser_axes: None,
            })
            .collect();
        let starts = self.intersect(&self.ties);
        let shots = LaserShots {
            surface,
            ..self.shots(with_ranges)
        };
        let run_on = AtomicBool::new(false);
        adjust(&images, &shots, &self.ties, &starts, 0.0, options, &run_on).unwrap()
    }

    /// Distance of each adjusted footprint from the adjusted camera at the instant of the shot, minus its range,
    /// metres.
    fn misclosures_m(&self, adjusted: &Adjusted) -> Vec<f64> {
        let orientation = CorrectedOrientation {
            base: &self.images[0].orientation,
            correction: adjusted.correction(0),
        };
        let adjusted_m = |row: usize| {
            let mut shots = adjusted.points.iter();
            let shot = shots.find(|shot| shot.kind == PointKind::Shot && shot.index == row);
            shot.unwrap().ground.xyz_m
        };
        let points = self.points.iter().enumerate();
        points
            .map(|(row, point)| self.misclosure_m(&orientation, point, &adjusted_m(row)))
            .collect()
    }

    fn misclosure_m(
        &self,
        orientation: &impl ExteriorOrientation,
        point: &LidarPoint,
        ground_m: &Vector3<f64>,
    ) -> f64 {
        let x_lines = self.images[0].x_lines(point.et_s);
        (orientation.pose(x_lines).position_m - ground_m).norm() - point.range_m
    }
}

/// The ties of a network as a camera without distortion has them.
fn ties(path: &Path, images: &[Image; 2]) -> Vec<TiePoint> {
    let index_of = |name: &str| SERIALS.iter().position(|known| *known == name);
    let ties = read_ties(path).unwrap().ties.into_iter();
    let mut ties: Vec<TiePoint> = ties
        .map(|tie| tie.in_images(index_of, |name| panic!("{name}")))
        .collect();
    for measure in ties.iter_mut().flat_map(|tie| &mut tie.measures) {
        measure.sample = images[measure.image].ideal_sample(measure.sample);
    }
    ties
}

fn summary(values: impl IntoIterator<Item = f64>) -> Summary {
    Summary::of(&values.into_iter().collect::<Vec<_>>())
}

fn height_m(ground_m: &Vector3<f64>) -> f64 {
    ground_m.norm() - MOON_RADIUS_M
}

/// Heights of the tie points minus that of the nearest footprint, where one lies within 200 m.
fn heights_above_shots_m(site: &Site, ties: impl Iterator<Item = Vector3<f64>>) -> Summary {
    let above = ties.filter_map(|tie_m| {
        let direction = tie_m.normalize();
        let apart_m =
            |point: &LidarPoint| MOON_RADIUS_M * direction.angle(&point.ground_m.normalize());
        let nearest = site
            .points
            .iter()
            .min_by(|a, b| apart_m(a).total_cmp(&apart_m(b)))?;
        (apart_m(nearest) < 200.0).then(|| height_m(&tie_m) - height_m(&nearest.ground_m))
    });
    summary(above)
}

/// The same after an adjustment.
fn adjusted_heights_m(site: &Site, adjusted: &Adjusted) -> Summary {
    let ties = adjusted.points.iter();
    let ties = ties.filter(|point| point.kind == PointKind::Tie);
    heights_above_shots_m(site, ties.map(|point| point.ground.xyz_m))
}

fn row(name: &str, values: &Summary) {
    eprintln!(
        "  {name}: {} of mean {:.4}, standard deviation {:.4}, {:.4} to {:.4}",
        values.n, values.mean, values.standard_deviation, values.min, values.max
    );
}

fn report(title: &str, site: &Site, adjusted: &Adjusted) {
    let all = &adjusted.summary;
    eprintln!(
        "{title}: {} steps, {} degrees of freedom, sigma0 {:.4}, {} pairs of unknowns correlated above 0.95",
        all.steps,
        all.degrees_of_freedom,
        all.sigma0,
        all.correlated.len()
    );
    row(
        "distance - range, m",
        &summary(site.misclosures_m(adjusted)),
    );
    for kind in &all.types {
        eprintln!(
            "  {:?}: {} of redundancy {:.2}, variance component {:.4}",
            kind.kind, kind.observations, kind.redundancy, kind.variance_component
        );
    }
    for image in &all.images {
        row("tie residuals along, px", &image.tie_residuals_px[0]);
        row("tie residuals across, px", &image.tie_residuals_px[1]);
        row("footprint corrections, lines", &image.mola_corrections[0]);
        row("footprint corrections, px", &image.mola_corrections[1]);
    }
    for (name, ground) in [("footprint", &all.shots), ("tie", &all.ties)] {
        for (axis, letter) in ["X", "Y", "Z"].iter().enumerate() {
            row(
                &format!("{name} corrections {letter}, m"),
                &ground.corrections_m[axis],
            );
            row(
                &format!("{name} standard deviations {letter}, m"),
                &ground.sigmas_m[axis],
            );
        }
    }
    row(
        "ties above footprints, m",
        &adjusted_heights_m(site, adjusted),
    );
    for image in &adjusted.images {
        eprintln!(
            "  {} corrections, m and rad: {:.6?}\n  standard deviations: {:.6?}",
            image.id, image.correction, image.sigmas
        );
    }
}

/// Makes sure of ISIS's condition: each distance is closer to its range with the ranges than without.
fn assert_every_range_is_closer(site: &Site, without: &Adjusted, with: &Adjusted) {
    let [before_m, after_m] = [without, with].map(|adjusted| site.misclosures_m(adjusted));
    assert_eq!(with.ranges.len(), 52);
    for (((point, before_m), after_m), range) in site
        .points
        .iter()
        .zip(before_m)
        .zip(after_m)
        .zip(&with.ranges)
    {
        eprintln!("  {}: {before_m:.4} m, {after_m:.4} m", point.id);
        assert!(after_m.abs() < before_m.abs(), "{}", point.id);
        // Metres: rounding of 1.8e6 m. Residuals are observed minus computed.
        assert!((range.residual_m.value + after_m).abs() < 1e-6);
    }
}

/// How far the second image's lines are from where the network's authors expected them: the mean of measured
/// minus expected line, from the file itself.
fn lines_off_in_the_network(path: &Path) -> f64 {
    let text = fs::read_to_string(path).unwrap();
    let sum_of = |key: &str| -> f64 {
        let entries = text.lines().filter_map(|line| line.split_once('='));
        let values = entries.filter(|(name, _)| name.trim() == key);
        values
            .map(|(_, value)| value.trim().parse::<f64>().unwrap())
            .sum()
    };
    // In the first image both are the same.
    (sum_of("Line") - sum_of("AprioriLine")) / 311.0
}

#[test]
fn the_ties_of_the_network_meet_within_a_line() {
    let Some(site) = Site::read("real intersection") else {
        return;
    };
    let found = site.intersect(&site.ties);
    assert_eq!((found.points.len(), found.rejected.len()), (311, 0));
    let points = &found.points;
    let angles_deg = summary(
        points
            .iter()
            .map(|point| point.convergence_rad.to_degrees()),
    );
    let heights_m = summary(points.iter().map(|point| height_m(&point.ground.xyz_m)));
    let shots = site.points.iter();
    let shots_m = summary(shots.map(|point| height_m(&point.ground_m)));
    let above_m = heights_above_shots_m(&site, points.iter().map(|point| point.ground.xyz_m));
    let outliers = points.iter().filter(|point| point.outlier).count();
    eprintln!("sigma0 {:.4} px, {outliers} outliers", found.sigma0);
    row("convergence, degrees", &angles_deg);
    row("heights of ties, m", &heights_m);
    row("heights of footprints, m", &shots_m);
    row("ties above footprints, m", &above_m);
    for image in &found.images {
        row("focal residuals along, px", &image.focal.along);
        row("focal residuals across, px", &image.focal.across);
        row("reprojection residuals, lines", &image.reprojection.along);
        row("reprojection residuals, px", &image.reprojection.across);
    }

    assert!((found.sigma0 - 0.827).abs() < 0.005, "{}", found.sigma0); // pixels: attitudes as arcs or cubics
    assert!(angles_deg.min > 14.8 && angles_deg.max < 15.4); // degrees: 13.3° and 1.6° off nadir on two sides
    let lines = [0, 1].map(|image: usize| found.images[image].reprojection.along);
    assert!((lines[0].mean - 0.526).abs() < 0.005 && (lines[1].mean + 0.556).abs() < 0.005); // lines, as above
    for image in &found.images {
        // Heights take up what is wrong across the track.
        assert!(image.reprojection.across.min > -0.02 && image.reprojection.across.max < 0.02);
    }
    // Lines: 311 measurements that scatter by 0.4 about a mean that the slopes of the terrain move a little.
    let expected = lines_off_in_the_network(&site.network);
    assert!(
        (lines[1].mean - lines[0].mean - expected).abs() < 0.05,
        "{expected}"
    );
    assert!(above_m.n >= 10 && above_m.median.abs() < 5.0, "{above_m:?}"); // metres: slopes over 200 m
}

#[test]
fn the_limits_of_mars_refuse_every_tie_on_the_moon() {
    let Some(site) = Site::read("real intersection with the limits of Mars") else {
        return;
    };
    let found = intersect_ties(
        &site.oriented_camera(),
        &site.ties,
        &IntersectOptions::default(),
    )
    .unwrap();
    assert!(found.points.is_empty());
    assert_eq!(found.rejected.len(), 311);
    // Metres: the radii differ by 1650 km.
    assert!(found.rejected.iter().all(|tie| matches!(
        tie.reason,
        TieRejection::Rays(Unintersected::Height { height_m }) if height_m < -1.6e6
    )));
}

#[test]
fn the_places_of_the_shots_contradict_the_ties() {
    let Some(site) = Site::read("real intersection of shifted ties") else {
        return;
    };
    // The shifts of `real_registration.rs`: had the network's shots been placed with an adjusted
    // orientation, ties would meet better with them, not worse.
    let mut shifted = site.ties.clone();
    for measure in shifted.iter_mut().flat_map(|tie| &mut tie.measures) {
        let second = measure.image == 1;
        measure.line += if second { 18.615 } else { 13.223 };
        measure.sample += if second { 2.533 } else { 2.796 };
    }
    let found = site.intersect(&shifted);
    // The shift takes one of 311 out of its image.
    assert_eq!(found.points.len(), 310);
    assert!((found.sigma0 - 3.08).abs() < 0.01, "{}", found.sigma0); // pixels: half the last digit, and arcs
}

#[test]
fn every_distance_comes_closer_to_its_range_with_the_priors_of_isis() {
    let Some(site) = Site::read("real adjustment") else {
        return;
    };
    for point in &site.points {
        assert_eq!(point.simultaneous, [SERIALS[0]]);
        let [north, east, up] = point.ground_sigma_m;
        for sigma_m in [point.range_sigma_m, north, east, up] {
            assert!((sigma_m - 10.0).abs() < 0.05, "{sigma_m}"); // metres: radii of 1735 or 1737 km
        }
    }
    let orientation = &site.images[0].orientation;
    let points = site.points.iter();
    let initial_m =
        summary(points.map(|point| site.misclosure_m(orientation, point, &point.ground_m)));
    row("initial distance - range, m", &initial_m);
    // Metres: the numbers of `real_ranges.rs`, which interpolates the trajectory itself.
    assert!((initial_m.mean - 0.450).abs() < 0.002 && initial_m.standard_deviation < 0.0015);
    let (priors, options) = (
        priors_of_isis(),
        options(FootprintImageCoordinates::Weighted),
    );
    let [without, with] = [false, true].map(|ranges| site.adjust(&priors, &options, ranges));
    report("ISIS's priors without ranges", &site, &without);
    report("ISIS's priors with ranges", &site, &with);
    assert_every_range_is_closer(&site, &without, &with);
    // 311 ties of redundancy 1, 208 coordinates of footprints; 52 ranges.
    let freedom = [&without, &with].map(|adjusted| adjusted.summary.degrees_of_freedom);
    assert_eq!(freedom, [519, 571]);
    // Metres: without ranges, 1000 m and 2° leave the height of the camera to what the ties push. In the focal
    // plane of the measured line they pushed it by more than 20 m: from afar, a line is fewer pixels.
    assert!(site.misclosures_m(&without).iter().all(|m| *m > 5.0));
    assert!(site.misclosures_m(&with).iter().all(|m| m.abs() < 0.05));
    for adjusted in [&without, &with] {
        assert!(adjusted.rejected.is_empty());
        let Summary { n, .. } = adjusted.summary.ties.corrections_m[0];
        assert_eq!(n, 311);
        for sigmas_m in adjusted.summary.shots.sigmas_m {
            // No observation enlarges a variance.
            assert!(sigmas_m.max <= 10.0 * adjusted.summary.variance_factor.sqrt());
        }
        for image in &adjusted.summary.images {
            // Pixels: what is left are the errors of matching.
            assert!(image.tie_residuals_px[0].mean.abs() < 0.001);
            assert!(image.tie_residuals_px[0].standard_deviation < 0.16);
        }
        // Metres: the ties stay on the ground that the laser saw.
        assert!(adjusted_heights_m(&site, adjusted).median.abs() < 5.0);
    }
}

/// Ties above the footprints of `judging`, metres: by the ground between them, where it is known to `SURFACE_KNOWN_M`.
fn above_lola_m(judging: &LaserSurface, ties: impl Iterator<Item = Vector3<f64>>) -> Summary {
    let ties: Vec<Vector3<f64>> = ties.collect();
    let found = judging.predict(&ties);
    let known = ties
        .iter()
        .enumerate()
        .filter(|(index, _)| found.sigma_m(*index) < SURFACE_KNOWN_M);
    summary(
        known.map(|(index, tie_m)| {
            height_above_m(Body::Moon.model(), tie_m).0 - found.heights_m[index]
        }),
    )
}

/// Ties count where the ground between footprints is known to this, metres.
const SURFACE_KNOWN_M: f64 = 25.0;

/// A surface of some of the footprints.
fn lola(site: &Site, taken: impl Fn(usize) -> bool) -> LaserSurface {
    let points = site
        .points
        .iter()
        .enumerate()
        .filter(|(index, _)| taken(*index));
    let shots: Vec<SurfaceShot> = points
        .map(|(_, point)| SurfaceShot {
            ground_m: point.ground_m,
            profile: 0,
            attitude_known: true,
            off_nadir_rad: 0.0,
        })
        .collect();
    // Lines of half a metre, of which the network was off by some tens.
    let options = SurfaceOptions {
        plan_sigma_m: 10.0,
        body: Body::Moon,
        ..SurfaceOptions::default()
    };
    LaserSurface::new(&shots, &[], &options).unwrap()
}

#[test]
fn heights_follow_lola_where_its_surface_controls_them() {
    let Some(site) = Site::read("real heights against LOLA") else {
        return;
    };
    // Every second footprint controls, the others judge.
    let [controlling, judging] = [0, 1].map(|half| lola(&site, |index| index % 2 == half));
    let before = site.intersect(&site.ties);
    let before = above_lola_m(
        &judging,
        before.points.iter().map(|point| point.ground.xyz_m),
    );
    row("ties above LOLA before, m", &before);
    let options = AdjustmentConfig {
        model: AdjustmentModel::MolaSurface,
        tie_sigma_px: [0.5; 2],
        blunder_limit: None,
        height_blunder_limit: None,
        ..options(FootprintImageCoordinates::Off)
    };
    let powers = |constant: f64, linear: f64| [constant, linear, 0.0];
    let (position_m, rotation_rad) = (powers(25.0, 0.2), powers(4e-4, 1e-5));
    let sigmas = std::array::from_fn(|index| {
        let of_power = if index < 9 { position_m } else { rotation_rad };
        of_power[index % 3]
    });
    let adjusted = [None, Some(controlling)].map(|surface| {
        let adjusted = site.adjust_with(&[sigmas; 2], &options, true, surface);
        let ties = adjusted
            .points
            .iter()
            .filter(|point| point.kind == PointKind::Tie);
        let above = above_lola_m(&judging, ties.map(|point| point.ground.xyz_m));
        let ties = adjusted
            .points
            .iter()
            .filter(|point| point.kind == PointKind::Tie);
        let sigmas_m = summary(ties.map(|point| {
            let up = point.ground.xyz_m.normalize();
            up.dot(&(point.covariance_m2 * up)).sqrt()
        }));
        let with = adjusted.heights.map(|heights| heights.mean_sigma_m[2]);
        row(
            &format!("ties above LOLA after, m (mean ±{with:?})"),
            &above,
        );
        row("standard deviations of single heights, m", &sigmas_m);
        (above, sigmas_m.median, with)
    });
    let [
        (without, without_sigma_m, _),
        (with, with_sigma_m, mean_sigma_m),
    ] = adjusted;
    // Most ties lie where LOLA's ground is not known so well.
    assert!(with.n >= 15, "{}", with.n);
    // Metres: the network's own orientations, and the same with a surface of which these ties know nothing.
    assert!(with.median.abs() < before.median.abs() && with.median.abs() < without.median.abs());
    // Without the surface heights are where the network's own orientations leave them, and stated as what these priors
    // allow: nothing of LOLA is known then.
    assert!(without.median.abs() < 3.0 * without_sigma_m && without_sigma_m > 100.0);
    assert!(with_sigma_m < 10.0, "{with_sigma_m}");
    // The halves share the errors of the footprints' coordinates; a mean of each errs by as much as the other.
    let expected_m = mean_sigma_m.unwrap() * 2.0_f64.sqrt();
    assert!(
        with.median.abs() < 3.0 * expected_m,
        "{} {expected_m}",
        with.median
    );
}

#[test]
fn only_weighted_footprints_hold_the_ties_to_the_ground() {
    let Some(site) = Site::read("real adjustment in three modes") else {
        return;
    };
    let priors = priors_of_the_paper();
    let [weighted, off, reproject] = FootprintImageCoordinates::WORDS.map(|(word, mode)| {
        let adjusted = [false, true].map(|ranges| site.adjust(&priors, &options(mode), ranges));
        report(&format!("{word} without ranges"), &site, &adjusted[0]);
        report(&format!("{word} with ranges"), &site, &adjusted[1]);
        assert_every_range_is_closer(&site, &adjusted[0], &adjusted[1]);
        adjusted
    });
    let freedom = |[without, with]: &[Adjusted; 2]| {
        [without, with].map(|adjusted| adjusted.summary.degrees_of_freedom)
    };
    assert_eq!(freedom(&weighted), [519, 571]);
    assert_eq!(freedom(&off), [311, 363]);
    // Places that follow the orientation change nothing; they are only shown.
    for (off, reproject) in off.iter().zip(&reproject) {
        assert_eq!(off.images, reproject.images);
        assert_eq!(off.points, reproject.points);
        let shown = |adjusted: &Adjusted| {
            let images = adjusted.summary.images.iter();
            images.map(|image| image.mola_corrections[0].n).sum::<u32>()
        };
        assert_eq!((shown(off), shown(reproject)), (0, 104));
    }
    // Metres. Ranges alone do not reach the ties: they hold the first camera's distance to the footprints, and no tie
    // sees a footprint. The ties lie anywhere within their standard deviations of more than a hundred metres. (In the
    // focal plane of the measured line they sank, to where a line is fewer pixels.)
    for (adjusted, held) in [(&weighted, true), (&off, false)] {
        for adjusted in adjusted {
            let above_m = adjusted_heights_m(&site, adjusted).median;
            let sigma_m = adjusted.summary.ties.sigmas_m[2].mean;
            if held {
                // A priori standard deviations of 30 px for footprints; what is left of them is a sixth of a pixel.
                assert!(above_m.abs() < 5.0 && sigma_m < 50.0, "{above_m} {sigma_m}");
            } else {
                assert!(
                    above_m.abs() < sigma_m && sigma_m > 100.0,
                    "{above_m} {sigma_m}"
                );
            }
        }
    }
}
