//! BRICK, EXTEND and SCALE: a figure of all pictures, without blunders, and which controls agree with it.

use std::collections::BTreeMap;

use super::{
    error::{Names, NetError},
    read::NetData,
};
use areograph_config::{Blunders, NetConfig};
use areograph_geom::plane::{
    Block, Blunder, Figure, Net, Place, PlaneError, Scaled, brick, bricks_as_pictures, clean,
    extend, grow_bricks, same_hand, scale, settle_bricks,
};

/// Bricks on the map.
pub(super) struct Laid {
    pub(super) names: Vec<String>,
    pub(super) figures: Vec<Figure>,
    pub(super) blunders: Vec<Vec<Blunder>>,
    /// Of every measurement, whether it was left out.
    pub(super) removed: Vec<bool>,
    /// The net of the others, and their indices in the whole one.
    pub(super) net: Net,
    pub(super) alive: Vec<usize>,
    pub(super) block: Block,
    pub(super) scaled: Scaled,
    pub(super) remarks: Vec<String>,
}

/// Bricks of pictures. Pictures that hang on one point in their brick are tied in another, with a remark where a table names
/// the bricks.
pub(super) fn bricks_of(config: &NetConfig, data: &NetData) -> (Bricks, Vec<String>) {
    let named = data.bricks.iter().any(|brick| !brick.is_empty());
    let mut bricks = if named {
        by_name(data)
    } else {
        by_growth(data, config.triangulation.brick_pictures as usize)
    };
    let moved = settle(data, &mut bricks);
    (bricks, if named { moved } else { Vec::new() })
}

/// All pictures in one brick.
pub(super) fn one_brick(data: &NetData) -> Bricks {
    vec![("1".to_owned(), (0..data.net.pictures).collect())]
}

/// Moves pictures that hang on one point in their brick, and states each.
fn settle(data: &NetData, bricks: &mut Bricks) -> Vec<String> {
    let (names, mut pictures): (Vec<String>, Vec<Vec<usize>>) = bricks.drain(..).unzip();
    let moved = settle_bricks(&data.net, &mut pictures);
    let words = moved.iter().map(|of| {
        format!(
            "picture {} shares fewer than two points with the rest of brick {} and was tied in brick {}",
            data.pictures[of.picture], names[of.from], names[of.to]
        )
    });
    let words = words.collect();
    *bricks = names.into_iter().zip(pictures).collect();
    words
}

/// Bricks with their names.
pub(super) type Bricks = Vec<(String, Vec<usize>)>;

fn by_name(data: &NetData) -> Bricks {
    let mut bricks: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (picture, brick) in data.bricks.iter().enumerate() {
        bricks.entry(brick).or_default().push(picture);
    }
    let named = |name: &str| {
        if name.is_empty() {
            "(none)".to_owned()
        } else {
            name.to_owned()
        }
    };
    bricks
        .into_iter()
        .map(|(name, pictures)| (named(name), pictures))
        .collect()
}

fn by_growth(data: &NetData, size: usize) -> Bricks {
    let of = grow_bricks(&data.net, size);
    let count = of.iter().max().map_or(0, |last| last + 1);
    let mut bricks: Bricks = (1..=count)
        .map(|number| (number.to_string(), Vec::new()))
        .collect();
    for (picture, brick) in of.iter().enumerate() {
        bricks[*brick].1.push(picture);
    }
    bricks
}

/// Lays the bricks.
pub(super) fn lay(
    config: &NetConfig,
    data: &NetData,
    names: &Names,
    bricks: &Bricks,
) -> Result<Laid, NetError> {
    let mut removed = vec![false; data.net.measurements.len()];
    let (mut figures, mut blunders) = (Vec::new(), Vec::new());
    for (_, pictures) in bricks {
        let refused = |error| names.of(error, "picture");
        if config.triangulation.blunders == Blunders::Remove {
            let cleaned = clean(&data.net, pictures).map_err(refused)?;
            for index in cleaned.removed {
                removed[index] = true;
            }
            figures.push(cleaned.figure);
            blunders.push(cleaned.blunders);
        } else {
            figures.push(brick(&data.net, pictures).map_err(refused)?);
            blunders.push(Vec::new());
        }
    }
    let brick_names: Vec<String> = bricks.iter().map(|(name, _)| name.clone()).collect();
    let of_bricks = Names {
        pictures: &brick_names,
        points: names.points,
    };
    if config.triangulation.blunders == Blunders::Remove && figures.len() > 1 {
        clean_seams(&data.net, &mut figures, &mut removed)
            .map_err(|error| of_bricks.of(error, "brick"))?;
    }
    let alive: Vec<usize> = (0..removed.len())
        .filter(|index| !removed[*index])
        .collect();
    let net = Net {
        measurements: alive
            .iter()
            .map(|index| data.net.measurements[*index])
            .collect(),
        ..data.net.clone()
    };
    let block = extend(&net, &figures).map_err(|error| of_bricks.of(error, "brick"))?;
    let shown = shown_controls(&net, &block.places);
    let (figure, given): (Vec<Place>, Vec<Place>) = shown
        .iter()
        .map(|(_, computed, given)| (*computed, *given))
        .unzip();
    let pairs: Vec<(Place, Place)> = figure.iter().copied().zip(given.iter().copied()).collect();
    if same_hand(&pairs) == Some(false) {
        return Err(NetError::MirroredFigure);
    }
    let scaled = scale(&figure, &given, config.controls.limit)
        .ok_or(NetError::TooFewControls { found: given.len() })?;
    Ok(Laid {
        names: brick_names,
        figures,
        blunders,
        removed,
        net,
        alive,
        block,
        scaled,
        remarks: Vec::new(),
    })
}

/// Leaves out a brick's measurements of a point that is a blunder among the bricks: the only measurement of a point in
/// a brick shows nowhere else.
fn clean_seams(net: &Net, figures: &mut [Figure], removed: &mut [bool]) -> Result<(), PlaneError> {
    let of_bricks = bricks_as_pictures(net, figures);
    let all: Vec<usize> = (0..figures.len()).collect();
    for index in clean(&of_bricks, &all)?.removed {
        let seam = &of_bricks.measurements[index];
        let figure = &mut figures[seam.picture];
        figure.places.retain(|(point, _)| *point != seam.point);
        for (index, measured) in net.measurements.iter().enumerate() {
            if measured.point == seam.point && figure.pictures.contains(&measured.picture) {
                removed[index] = true;
            }
        }
    }
    Ok(())
}

/// Controls that have a place in the figure: index, place there, place as given.
pub(super) fn shown_controls(net: &Net, places: &[Option<Place>]) -> Vec<(usize, Place, Place)> {
    let controls = net.controls.iter().enumerate();
    controls
        .filter_map(|(index, control)| Some((index, places[control.point]?, control.at)))
        .collect()
}
