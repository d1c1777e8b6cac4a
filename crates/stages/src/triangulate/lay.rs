//! BRICK, EXTEND and SCALE: a figure of all pictures, without blunders, and which controls agree with it.

use std::collections::BTreeMap;

use super::{
    error::{Names, NetError},
    read::NetData,
};
use areograph_config::{Blunders, Method, NetConfig};
use areograph_geom::plane::{
    Block, Figure, Net, Place, PlaneError, Scaled, brick, extend, find_blunders, grow_bricks,
    same_hand, scale, settle_bricks,
};

/// Bricks on the map.
pub(super) struct Laid {
    pub(super) names: Vec<String>,
    pub(super) figures: Vec<Figure>,
    /// Whether each measurement was left out.
    pub(super) removed: Vec<bool>,
    /// The net of the others, and their indices in the complete net.
    pub(super) net: Net,
    pub(super) alive: Vec<usize>,
    pub(super) block: Block,
    pub(super) scaled: Scaled,
    pub(super) remarks: Vec<String>,
}

/// A net without its blunders.
#[derive(Clone)]
pub(super) struct Kept {
    pub(super) net: Net,
    /// Indices of its measurements in the complete net.
    alive: Vec<usize>,
    /// Whether each measurement was left out.
    removed: Vec<bool>,
}

/// Leaves out the blunders of a net, where this is configured.
pub(super) fn without_blunders(config: &NetConfig, data: &NetData) -> Result<Kept, PlaneError> {
    let mut removed = vec![false; data.net.measurements.len()];
    if config.triangulation.blunders == Blunders::Remove {
        for index in find_blunders(&data.net)? {
            removed[index] = true;
        }
    }
    let (net, alive) = data.net.kept(|index| !removed[index]);
    Ok(Kept {
        net,
        alive,
        removed,
    })
}

/// Bricks of pictures: one for the method that has none. Pictures that hang on one point in their brick are tied in a
/// different one, with a remark where a table names the bricks.
pub(super) fn bricks_of(config: &NetConfig, data: &NetData, net: &Net) -> (Bricks, Vec<String>) {
    if config.triangulation.method == Method::OneShot {
        return (one_brick(data), Vec::new());
    }
    let named = data.bricks.iter().any(|brick| !brick.is_empty());
    let mut bricks = if named {
        by_name(data)
    } else {
        by_growth(net, config.triangulation.brick_pictures as usize)
    };
    let moved = settle(data, net, &mut bricks);
    (bricks, if named { moved } else { Vec::new() })
}

/// All pictures in one brick.
pub(super) fn one_brick(data: &NetData) -> Bricks {
    vec![("1".to_owned(), (0..data.net.pictures).collect())]
}

/// Moves pictures that hang on one point in their brick, and states each.
fn settle(data: &NetData, net: &Net, bricks: &mut Bricks) -> Vec<String> {
    let (names, mut pictures): (Vec<String>, Vec<Vec<usize>>) = bricks.drain(..).unzip();
    let moved = settle_bricks(net, &mut pictures);
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

fn by_growth(net: &Net, size: usize) -> Bricks {
    let of = grow_bricks(net, size);
    let count = of.iter().max().map_or(0, |last| last + 1);
    let mut bricks: Bricks = (1..=count)
        .map(|number| (number.to_string(), Vec::new()))
        .collect();
    for (picture, brick) in of.iter().enumerate() {
        bricks[*brick].1.push(picture);
    }
    bricks
}

/// Lays the bricks of a net without its blunders.
pub(super) fn lay(
    config: &NetConfig,
    kept: &Kept,
    names: &Names,
    bricks: &Bricks,
) -> Result<Laid, NetError> {
    let Kept {
        net,
        alive,
        removed,
    } = kept.clone();
    let figures = bricks.iter().map(|(_, pictures)| brick(&net, pictures));
    let mut figures: Vec<Figure> = figures
        .collect::<Result<_, _>>()
        .map_err(|error| names.of(error, "picture"))?;
    // The deviations of a brick are reported beside the deviations of the complete net.
    for (index, _) in figures.iter_mut().flat_map(|of| &mut of.deviations) {
        *index = alive[*index];
    }
    let brick_names: Vec<String> = bricks.iter().map(|(name, _)| name.clone()).collect();
    let of_bricks = Names {
        pictures: &brick_names,
        points: names.points,
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
        removed,
        net,
        alive,
        block,
        scaled,
        remarks: Vec::new(),
    })
}

/// Controls that have a place in the figure: index, place there, place as given.
pub(super) fn shown_controls(net: &Net, places: &[Option<Place>]) -> Vec<(usize, Place, Place)> {
    let controls = net.controls.iter().enumerate();
    controls
        .filter_map(|(index, control)| Some((index, places[control.point]?, control.at)))
        .collect()
}
