//! PEDR files of one polar orbit, with shots of every kind.

use std::{ops::Range, path::Path};

use areograph_base::{body::Datum, units::wrap_pi};
use areograph_geom::ellipsoid::spherical_to_xyz_m;
use areograph_pds::pedr::{FrameValues, LabelInfo, PedrWriter, Record};

pub const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// A little less than one polar revolution and a half.
pub const FRAMES: u32 = 5_000;

/// Ground longitude and latitude, radians, `time_s` after the start: a circular polar orbit over rotating Mars.
fn ground(time_s: f64) -> [f64; 2] {
    let along_rad = 0.9 + time_s * 8.9e-4;
    let inclination_rad = 92.9 * DEGREE;
    let latitude_rad = (inclination_rad.sin() * along_rad.sin()).asin();
    let node_rad = (inclination_rad.cos() * along_rad.sin()).atan2(along_rad.cos());
    [wrap_pi(node_rad - 7.088e-5 * time_s), latitude_rad]
}

/// An areoid with the flattening of Mars.
fn areoid_radius_m(latitude_rad: f64) -> f64 {
    3.396e6 - 2e4 * latitude_rad.sin().powi(2)
}

fn frame(number: u32) -> FrameValues {
    let time_s = 2.0 * f64::from(number);
    let [before, mid, after] = [time_s - 1.0, time_s, time_s + 1.0].map(ground);
    let mut values = FrameValues {
        time_s: -20_000_000.0 + time_s,
        orbit: 9_019 + number / 3_530,
        clock_frequency_hz: 1e8,
        ground_longitude_rad: mid[0],
        ground_longitude_change_rad: wrap_pi(after[0] - before[0]),
        ground_latitude_rad: mid[1],
        ground_latitude_change_rad: after[1] - before[1],
        spacecraft_radius_m: 3.78e6,
        parallax_latitude_rad_per_m: 8e-9,
        parallax_longitude_rad_per_m: -2e-9,
        mid_radius_m: 3.39e6,
        areoid_radius_m: areoid_radius_m(mid[1]),
        areoid_radius_change_m: areoid_radius_m(after[1]) - areoid_radius_m(before[1]),
        shot_radius_m: std::array::from_fn(|shot| {
            3.38e6 + 1e3 * ((number as usize + shot * 7) % 31) as f64
        }),
        range_m: [3.9e5; 20],
        class: [1; 20],
        channel: [1; 20],
        frame_index: 1,
        orbit_quality: 3,
        off_nadir_rad: if number % 100 < 10 { 0.1 } else { 0.001 },
        attitude_flag: if number.is_multiple_of(11) { 3 } else { 0 },
        ..FrameValues::default()
    };
    look_along_the_parallax(&mut values);
    for shot in 0..20 {
        match (number as usize + shot) % 17 {
            0 => values.range_m[shot] = 0.0,
            1 => values.class[shot] = 0,
            2 => values.channel[shot] = 4,
            _ => {}
        }
    }
    values
}

/// Places the spacecraft on the beam that the parallax implies, and sets the corresponding ranges.
fn look_along_the_parallax(values: &mut FrameValues) {
    let height_m = values.spacecraft_radius_m - values.mid_radius_m;
    values.spacecraft_longitude_rad =
        values.ground_longitude_rad + height_m * values.parallax_longitude_rad_per_m;
    values.spacecraft_latitude_rad =
        values.ground_latitude_rad + height_m * values.parallax_latitude_rad_per_m;
    values.spacecraft_longitude_change_rad = values.ground_longitude_change_rad;
    values.spacecraft_latitude_change_rad = values.ground_latitude_change_rad;
    for shot in 0..20 {
        let x = (shot as f64 - 9.5) / 20.0;
        let longitude_rad = values.ground_longitude_rad + x * values.ground_longitude_change_rad;
        let latitude_rad = values.ground_latitude_rad + x * values.ground_latitude_change_rad;
        let relief_m = values.shot_radius_m[shot] - values.mid_radius_m;
        let ground_m = spherical_to_xyz_m(
            longitude_rad + relief_m * values.parallax_longitude_rad_per_m,
            latitude_rad + relief_m * values.parallax_latitude_rad_per_m,
            values.shot_radius_m[shot],
        );
        let spacecraft_m = spherical_to_xyz_m(
            longitude_rad + height_m * values.parallax_longitude_rad_per_m,
            latitude_rad + height_m * values.parallax_latitude_rad_per_m,
            values.spacecraft_radius_m,
        );
        values.range_m[shot] = (spacecraft_m - ground_m).norm();
    }
}

/// Half of the frames, from number `first` on.
pub fn write(path: &Path, datum: Datum, first: u32, spoil: impl Fn(u32, &mut Record)) {
    write_frames(path, datum, first..first + FRAMES / 2, spoil);
}

pub fn write_frames(
    path: &Path,
    datum: Datum,
    numbers: Range<u32>,
    spoil: impl Fn(u32, &mut Record),
) {
    let product_id = path
        .file_name()
        .and_then(|name| name.to_str())
        .unwrap_or_default();
    let label = LabelInfo {
        product_id: product_id.to_owned(),
        software_version: 7.25,
        datum,
        note: "synthetic".to_owned(),
    };
    let mut writer = PedrWriter::create(path, &label).expect("a writable folder");
    for number in numbers {
        let mut record = Record::from_frame(&frame(number)).expect("values within their fields");
        spoil(number, &mut record);
        writer.write_record(&record).expect("room on the disk");
    }
    writer.finish().expect("room on the disk");
}
