//! The window of tables of shots: the box around them.

use std::path::PathBuf;

use super::Refused;
use crate::{
    body::Body,
    error::Result,
    pds::shot_table::{TableColumns, read_shot_table},
};

/// Edges are multiples of this, degrees.
const STEP_DEG: f64 = 0.01;

/// West, east, south and north edge of the box around the shots of tables of the Orbital Data Explorer, degrees, outwards to 0.01.
///
/// # Errors
/// A table cannot be read; no table has a shot.
pub(super) fn box_around_deg(tables: &[PathBuf]) -> Result<[f64; 4]> {
    let (mut longitudes_deg, mut latitudes_deg) = (Vec::new(), [f64::INFINITY, f64::NEG_INFINITY]);
    for table in tables {
        read_shot_table(table, &TableColumns::OdePedr, Body::Mars, None, |row| {
            // A malformed row is reported when the site is run.
            if let Ok(row) = row {
                longitudes_deg.push(row.longitude_rad.to_degrees().rem_euclid(360.0));
                let latitude_deg = row.latitude_rad.to_degrees();
                latitudes_deg = [
                    latitudes_deg[0].min(latitude_deg),
                    latitudes_deg[1].max(latitude_deg),
                ];
            }
            Ok(())
        })?;
    }
    if longitudes_deg.is_empty() {
        return Err(Refused::Missing("a shot in the tables").into());
    }
    let [west, east] = around_deg(&mut longitudes_deg);
    let [south, north] = latitudes_deg;
    let outwards =
        |edge: f64, to: fn(f64) -> f64| (to(edge / STEP_DEG) * STEP_DEG * 1e3).round() / 1e3;
    let edges_deg = [
        outwards(west, f64::floor),
        outwards(east, f64::ceil),
        outwards(south, f64::floor).max(-90.0),
        outwards(north, f64::ceil).min(90.0),
    ];
    Ok(if edges_deg[1] - edges_deg[0] < 360.0 {
        edges_deg
    } else {
        [0.0, 360.0, edges_deg[2], edges_deg[3]]
    })
}

/// West and east end of the shortest arc of longitude that contains all; the east end is the larger one.
fn around_deg(longitudes_deg: &mut [f64]) -> [f64; 2] {
    longitudes_deg.sort_by(f64::total_cmp);
    let (first, last) = (longitudes_deg[0], longitudes_deg[longitudes_deg.len() - 1]);
    let mut widest_deg = first + 360.0 - last;
    let mut ends_deg = [first, last];
    for pair in longitudes_deg.windows(2) {
        if pair[1] - pair[0] > widest_deg {
            widest_deg = pair[1] - pair[0];
            ends_deg = [pair[1] - 360.0, pair[0]];
        }
    }
    ends_deg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longitudes_are_enclosed_the_shorter_way() {
        for (longitudes_deg, expected) in [
            (&mut [175.2, 174.1, 174.9][..], "[174.1, 175.2]"),
            (&mut [359.5, 0.25, 359.75][..], "[-0.5, 0.25]"),
            (&mut [12.0][..], "[12.0, 12.0]"),
        ] {
            assert_eq!(format!("{:?}", around_deg(longitudes_deg)), expected);
        }
    }
}
