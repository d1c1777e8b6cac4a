//! A net from its tables to its result.

use super::{
    error::{Names, NetError},
    lay::lay_with_fallback,
    place::{Placed, place},
    read::NetData,
    result::Triangulation,
    write::Report,
};
use crate::{
    config::NetConfig,
    geom::plane::{Place, PlaneError, check, find_mirrored},
};

/// Factor by which a picture may differ from its stated size.
const SIZE_FACTOR: f64 = 2.0;

/// Triangulates a net.
pub(super) fn triangulate(config: &NetConfig, data: &NetData) -> Result<Triangulation, NetError> {
    let names = Names {
        pictures: &data.pictures,
        points: &data.points,
    };
    let refused = |error: PlaneError| names.of(error, "picture");
    find_mirrored(&data.net).map_err(refused)?;
    check(&data.net).map_err(refused)?;
    let laid = lay_with_fallback(config, data, &names)?;
    let placed = place(config, data, &laid).map_err(refused)?;
    check_sizes(config, data, &placed)?;
    Ok(Report {
        config,
        data,
        laid: &laid,
        placed: &placed,
    }
    .write())
}

/// A unit on the ground is shorter than on the map by the map's scale at the middle of the picture's points.
fn check_sizes(config: &NetConfig, data: &NetData, placed: &Placed) -> Result<(), NetError> {
    let map = &config.map.map;
    let mut sums = vec![(Place::new(0.0, 0.0), 0.0); data.net.pictures];
    for measured in &data.net.measurements {
        let (sum, count) = &mut sums[measured.picture];
        *sum += measured.at;
        *count += 1.0;
    }
    for (picture, (way, (sum, count))) in placed.pictures.iter().zip(sums).enumerate() {
        let Some(expected_m) = data.metres_per_unit[picture] else {
            continue;
        };
        let middle = way.map(sum / count);
        let found_m = way.scale() / map.scale((middle.re, middle.im));
        if !(found_m / expected_m < SIZE_FACTOR && expected_m / found_m < SIZE_FACTOR) {
            return Err(NetError::WrongUnits {
                picture: data.pictures[picture].clone(),
                found_m,
                expected_m,
            });
        }
    }
    Ok(())
}
