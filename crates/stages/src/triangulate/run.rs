//! A net from its tables to its result.

use super::{
    error::{Names, NetError},
    lay::{Bricks, Laid, bricks_of, lay, one_brick, without_blunders},
    place::{Placed, place},
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
    let (laid, placed) = lay_and_place(config, data, &names)?;
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

/// Lays the bricks and places them on the map; bricks that are not connected become one.
fn lay_and_place(
    config: &NetConfig,
    data: &NetData,
    names: &Names,
) -> Result<(Laid, Placed), NetError> {
    let refused = |error: PlaneError| names.of(error, "picture");
    let kept = without_blunders(config, data).map_err(refused)?;
    let laid_out = |bricks: &Bricks| {
        let laid = lay(config, &kept, names, bricks)?;
        let placed = place(config, data, &laid).map_err(refused)?;
        Ok((laid, placed))
    };
    let (bricks, moved) = bricks_of(config, data, &kept.net);
    let (mut laid, placed, remarks) = match laid_out(&bricks) {
        Err(NetError::Underconnected { .. }) if bricks.len() > 1 => {
            let (laid, placed) = laid_out(&one_brick(data))?;
            let remark = "the pictures are not connected in bricks and were tied as one brick";
            (laid, placed, vec![remark.to_owned()])
        }
        outcome => outcome.map(|(laid, placed)| (laid, placed, moved))?,
    };
    laid.remarks.extend(remarks);
    Ok((laid, placed))
}
