//! Orientations of a synthetic and a real image after corrections that are known.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common::adjusted as fixture;

use areograph::{
    error::Kind,
    geom::{
        attitude::{matrix_of_rotation_vector, rotation_vector},
        lagrange::lagrange,
        light_time::LightTime,
    },
    spice::Session,
    stages::{
        reorient::{LineCorrection, reorient},
        sample_orientation::{CameraTables, Orientation},
    },
};
use fixture::{Image, angle_rad, apart, kernel_camera};
use nalgebra::{Matrix3, Vector3};

/// One focal-plane pixel as an angle, radians.
const PIXEL_RAD: f64 = 0.013_124_057_852_294_9 / 3_500.0;

fn nothing(_: f64) -> LineCorrection {
    moved(Vector3::zeros())
}

fn moved(position_m: Vector3<f64>) -> LineCorrection {
    LineCorrection {
        position_m,
        rotation_rad: Vector3::zeros(),
    }
}

/// Tens of metres and of arcseconds, with slopes and bends.
fn curved(x: f64) -> LineCorrection {
    let t = x / 5_000.0;
    LineCorrection {
        position_m: Vector3::new(80.0 - 30.0 * t, -45.0 + 20.0 * t * t, 12.0 + 9.0 * t),
        rotation_rad: 1e-4 * Vector3::new(1.5 + 0.5 * t, -2.0 + 0.8 * t * t, 3.0 - t),
    }
}

/// Images by every convention for light time.
fn images(test: &str) -> Vec<Image> {
    let of = |(_, light_time)| {
        let scene = ["E02-02016", "E04-01275"].map(|id| Image::of_scene_with(id, light_time));
        scene.into_iter().chain(Image::real_with(test, light_time))
    };
    LightTime::WORDS.into_iter().flat_map(of).collect()
}

fn camera_of_tables(tables: &CameraTables, row: usize) -> (Vector3<f64>, Matrix3<f64>) {
    let to_mars = tables.inertial_to_mars[row].matrix();
    let to_bus = tables.inertial_to_bus[row].matrix();
    let to_camera = tables.bus_to_camera.matrix() * to_bus;
    (
        to_mars * tables.position_m[row],
        to_mars * to_camera.transpose(),
    )
}

#[test]
fn no_correction_changes_nothing() {
    for image in images("orientation without a correction") {
        let original = &image.orientation;
        let same = reorient(original, &image.times, 0.0, nothing).unwrap();
        let (distance_m, turn_rad) = apart(&same, original);
        // Rounding of 4e6 m through two rotations and eight nodes; of a matrix made a quaternion.
        assert!(
            distance_m < 1e-7 && turn_rad < 1e-14,
            "{distance_m:.1e} m {turn_rad:.1e} rad"
        );
        assert_eq!(same.tables.et_s, original.tables.et_s);
        for row in 0..same.tables.et_s.len() {
            let ours = camera_of_tables(&same.tables, row);
            let theirs = camera_of_tables(&original.tables, row);
            // Epochs of nodes are rounded to 7e-9 s: 3e-5 m and 7e-12 rad, a little more between them.
            assert!((ours.0 - theirs.0).norm() < 1e-4);
            assert!(angle_rad(&ours.1, &theirs.1) < 3e-11);
            let velocity =
                [&same, original].map(|orientation| orientation.tables.velocity_m_s[row]);
            assert!((velocity[0] - velocity[1]).norm() < 1e-6); // epochs rounded as above, 3 m/s²
        }
        let corners = [&same, original].map(|orientation| orientation.outline.clone().unwrap());
        for (ours, theirs) in corners[0].iter().zip(&corners[1]) {
            // 1e-10 rad are 0.3 mm on the ground.
            assert!((ours.longitude_rad - theirs.longitude_rad).abs() < 1e-10);
            assert!((ours.latitude_rad - theirs.latitude_rad).abs() < 1e-10);
        }
        let added_px =
            same.tables.interpolation.error_max_px - original.tables.interpolation.error_max_px;
        // Positions rounded to 3e-5 m, seen from 3.7e5 m.
        assert!(added_px.abs() < 1e-4, "{added_px:.1e} px");
    }
}

#[test]
fn a_change_of_position_moves_samples_tables_and_outline_alike() {
    let image = Image::of_scene("E02-02016");
    let change_m = Vector3::new(120.0, -70.0, 35.0);
    let adjusted = reorient(&image.orientation, &image.times, 0.0, |_| moved(change_m)).unwrap();
    let (distance_m, turn_rad) = apart(&adjusted, &image.orientation);
    assert!((distance_m - change_m.norm()).abs() < 1e-6 && turn_rad < 1e-14); // rounding
    for row in 0..adjusted.tables.et_s.len() {
        let (before, after) = (
            camera_of_tables(&image.orientation.tables, row),
            camera_of_tables(&adjusted.tables, row),
        );
        assert!((after.0 - before.0 - change_m).norm() < 1e-4); // as without a correction
        assert!(angle_rad(&after.1, &before.1) < 3e-11);
    }
    let outlines = [&image.orientation, &adjusted].map(|o| o.outline.clone().unwrap());
    let north_m = 3.39e6 * (outlines[1][0].latitude_rad - outlines[0][0].latitude_rad);
    // The site lies at 4.5° N: the change along Z is one to the north, but for 0.08 of the radial part.
    assert!((north_m - change_m.z).abs() < 15.0, "{north_m} m");
    for (sample, before) in adjusted.samples.iter().zip(&image.orientation.samples) {
        let (ground, ground_before) = (sample.boresight.unwrap(), before.boresight.unwrap());
        assert!((ground.latitude_rad - ground_before.latitude_rad).abs() > 1e-7);
    }
}

#[test]
fn a_shift_of_lines_and_a_curved_correction_are_those_of_the_kernels() {
    for image in images("orientation after a shift") {
        let shift_lines = -26.4;
        let adjusted = reorient(&image.orientation, &image.times, shift_lines, curved).unwrap();
        let session = Session::open(&image.set).unwrap();
        let limit_rad = adjusted.tables.interpolation.error_max_px
            * PIXEL_RAD
            * f64::from(image.times.downtrack_summing);
        for sample in &adjusted.samples {
            let et = sample
                .et
                .plus(shift_lines * image.times.line_times.mean_period_s());
            let (position_m, camera_to_mars) = kernel_camera(&session, &image, et);
            let correction = curved(sample.line_offset);
            let expected_m = position_m + correction.position_m;
            let distance_m = (sample.position.xyz_m - expected_m).norm();
            // Tags, shifted instants and nodes are rounded to 7e-9 s, 3e-5 m each at this speed.
            assert!(distance_m < 5e-4, "{distance_m:.1e} m");
            let mars_to_camera =
                matrix_of_rotation_vector(&correction.rotation_rad) * camera_to_mars.transpose();
            let found = *sample.camera_to_mars.matrix();
            let turn_rad = angle_rad(&found, &mars_to_camera.transpose());
            // What the tables say of themselves, and rounding.
            assert!(
                turn_rad < limit_rad + 1e-11,
                "{turn_rad:.1e} rad, {limit_rad:.1e}"
            );
        }
        assert!(adjusted.tables.interpolation.error_max_px < 0.02);
        let (first, last) = (
            adjusted.tables.et_s[0],
            adjusted.tables.et_s[adjusted.tables.et_s.len() - 1],
        );
        let exposed = image.times.exposures();
        assert!(first <= exposed.start.seconds() && exposed.stop.seconds() <= last);
        // Nodes that would lie beyond the original tables are gone.
        assert!(adjusted.tables.et_s.len() < image.orientation.tables.et_s.len());
    }
}

/// How far apart the ground that tables and samples see lies, focal-plane pixels, over all samples.
fn tables_against_samples_px(orientation: &Orientation, tables: &CameraTables) -> f64 {
    let last = tables.et_s.len() - 1;
    let step_s = (tables.et_s[last] - tables.et_s[0]) / last as f64;
    let cameras: Vec<_> = (0..=last)
        .map(|row| camera_of_tables(tables, row))
        .collect();
    let positions: Vec<Vector3<f64>> = cameras.iter().map(|camera| camera.0).collect();
    let reference = cameras[0].1;
    let vectors: Vec<Vector3<f64>> = cameras
        .iter()
        .map(|camera| rotation_vector(&(camera.1 * reference.transpose())))
        .collect();
    let mut worst_px = 0.0_f64;
    for sample in &orientation.samples {
        let at = (sample.et.seconds() - tables.et_s[0]) / step_s;
        let position_m = lagrange(&positions, at);
        let camera_to_mars = matrix_of_rotation_vector(&lagrange(&vectors, at)) * reference;
        let expected = *sample.camera_to_mars.matrix();
        let range_m = sample.boresight.unwrap().range_m;
        let ground_m = sample.position.xyz_m + expected * Vector3::z() * range_m;
        let seen = camera_to_mars.transpose() * (ground_m - position_m);
        worst_px = worst_px.max((seen.x / seen.z).hypot(seen.y / seen.z) / PIXEL_RAD);
    }
    worst_px
}

#[test]
fn tables_see_what_the_samples_see() {
    for image in images("tables against samples") {
        let apart_px = tables_against_samples_px(&image.orientation, &image.orientation.tables);
        assert!(apart_px < 0.01, "{apart_px} px");
        for shift_lines in [0.0, 18.25] {
            let adjusted = reorient(&image.orientation, &image.times, shift_lines, curved).unwrap();
            assert_eq!(adjusted.light_time, image.orientation.light_time);
            let apart_px = tables_against_samples_px(&adjusted, &adjusted.tables);
            println!(
                "{} {:?}: {apart_px:.1e} px",
                image.times.id, image.light_time
            );
            assert!(apart_px < 0.01, "{apart_px} px");
        }
    }
}

/// How far velocities and rates are from the differences of what they stand beside, m/s and rad/s, at most.
fn apart_from_differences(tables: &CameraTables) -> (f64, f64) {
    let mut worst = (0.0_f64, 0.0_f64);
    for row in 8..tables.et_s.len() - 8 {
        let [before, after] = [row - 8, row + 8].map(|row| tables.position_m[row]);
        let velocity = (after - before) / (tables.et_s[row + 8] - tables.et_s[row - 8]);
        let apart_m_s = (velocity - tables.velocity_m_s[row]).norm();
        let [before, bus, after] =
            [row - 1, row, row + 1].map(|row| tables.inertial_to_bus[row].matrix());
        // The frame turns by ω: components of what stands still turn back.
        let in_bus = -rotation_vector(&(after * before.transpose()))
            / (tables.et_s[row + 1] - tables.et_s[row - 1]);
        let rate = bus.transpose() * in_bus;
        let apart_rad_s = (rate - tables.bus_angular_velocity_rad_s[row]).norm();
        worst = (worst.0.max(apart_m_s), worst.1.max(apart_rad_s));
    }
    worst
}

#[test]
fn velocities_and_rates_are_the_derivatives_of_what_they_stand_beside() {
    let image = Image::of_scene("E02-02016");
    let adjusted = reorient(&image.orientation, &image.times, 12.5, curved).unwrap();
    let kernels = apart_from_differences(&image.orientation.tables);
    assert!(kernels.0 < 2e-3 && kernels.1 < 5e-8, "{kernels:?}"); // those of the kernels themselves
    let ours = apart_from_differences(&adjusted.tables);
    // The correction alone adds 4 m/s and 7e-6 rad/s. Positions are rounded to 3e-5 m in steps of 0.2 s;
    // the first order in θ leaves 1e-3 of those rates.
    assert!(ours.0 < kernels.0 + 5e-4, "{ours:?} m/s, rad/s");
    assert!(ours.1 < kernels.1 + 1e-8, "{ours:?} m/s, rad/s");
}

#[test]
fn what_the_tables_do_not_reach_and_what_is_no_number_is_refused() {
    let image = Image::of_scene("E02-02016");
    let (orientation, times) = (&image.orientation, &image.times);
    for shift_lines in [900.0, -900.0, f64::NAN] {
        let failure = reorient(orientation, times, shift_lines, nothing).unwrap_err();
        assert_eq!(failure.kind(), Kind::Input);
        let text = failure.to_string();
        assert!(
            text.contains("expected times within the camera tables"),
            "{text}"
        );
    }
    let broken = |x: f64| moved(Vector3::new(0.0, if x > 0.0 { f64::NAN } else { 0.0 }, 0.0));
    let failure = reorient(orientation, times, 0.0, broken).unwrap_err();
    assert_eq!(failure.kind(), Kind::Bug);
    assert!(failure.to_string().contains("correction NaN at line"));
    let mut few = orientation.clone();
    few.samples.truncate(2);
    let failure = reorient(&few, times, 0.0, nothing).unwrap_err();
    assert!(
        failure
            .to_string()
            .contains("2 orientation samples; expected at least 3")
    );
    few.tables.et_s.truncate(1);
    let failure = reorient(&few, times, 0.0, nothing).unwrap_err();
    assert!(failure.to_string().contains("camera tables with 1 nodes"));
}
