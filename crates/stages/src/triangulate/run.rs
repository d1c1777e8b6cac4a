//! A net from its tables to its result.

use super::{
    error::{Names, NetError},
    lay::lay_with_fallback,
    place::place,
    read::NetData,
    result::Triangulation,
    scales::check_sizes,
    write::Report,
};
use areograph_config::NetConfig;
use areograph_geom::plane::{PlaneError, check, find_mirrored};

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
    let sizes = check_sizes(config, data, &placed)?;
    Ok(Report {
        config,
        data,
        laid: &laid,
        placed: &placed,
        sizes: &sizes,
    }
    .write())
}
