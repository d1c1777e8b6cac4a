//! Every shot of PEDR files, one after the other, with its position in IAU 2000: the reference for searches.

use std::path::PathBuf;

use areograph_base::{footprints::Footprint, time::Et};
use areograph_geom::{
    body_rotation::convert_datum,
    ellipsoid::{Spherical, spherical_to_xyz_m},
};
use areograph_pds::pedr::{FieldGuard, File};

/// A shot as in its file, with file and record.
pub struct TrueShot {
    /// The shot; `file` and `record` give its origin.
    pub shot: Footprint,
    /// East longitude and areocentric latitude in IAU 2000, radians.
    pub place_rad: [f64; 2],
}

/// Every shot with a return of files without bad records, in file order.
pub fn every_shot(paths: &[PathBuf]) -> Vec<TrueShot> {
    let mut shots = Vec::new();
    for (index, path) in (0..).zip(paths) {
        let file = File::open(path).expect("a readable file");
        let datum = file.label().datum.expect("a label with its datum");
        for (row, frame) in file.frames(0..file.records().len(), FieldGuard::new(Some(7.25))) {
            let frame = frame.expect("a good frame");
            for shot in (1..=20).filter_map(|shot| frame.shot(shot)) {
                if shot.range_m <= 0.0 {
                    continue;
                }
                let at = Et::from_seconds(shot.et_tag_s);
                let direction = spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, 1.0);
                let direction =
                    convert_datum(areograph_base::body::Body::Mars, direction, datum, at, at);
                let there = Spherical::from_xyz_m(&direction.xyz_m);
                shots.push(TrueShot {
                    shot: Footprint {
                        file: index,
                        record: file.record_number(row),
                        ..shot
                    },
                    place_rad: [there.longitude_rad, there.latitude.0],
                });
            }
        }
    }
    shots
}
