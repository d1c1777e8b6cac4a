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
    geom::plane::{PlaneError, check, find_mirrored},
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
    check_sizes(data, &placed)?;
    Ok(Report {
        config,
        data,
        laid: &laid,
        placed: &placed,
    }
    .write())
}

fn check_sizes(data: &NetData, placed: &Placed) -> Result<(), NetError> {
    for (picture, (way, stated)) in placed
        .pictures
        .iter()
        .zip(&data.metres_per_unit)
        .enumerate()
    {
        let (Some(expected_m), found_m) = (*stated, way.scale()) else {
            continue;
        };
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
