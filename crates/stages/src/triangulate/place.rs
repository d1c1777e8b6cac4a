//! The figure on the map, by SCALE, MORTAR or in one shot, LOCAL, and the adjustment that gives standard deviations.

use std::collections::BTreeMap;

use super::{
    lay::{Laid, shown_controls},
    read::NetData,
    spread::rms,
};
use areograph_config::{Method, NetConfig};
use areograph_geom::plane::{
    Net, Place, PlaneError, Similarity, Solution, fit_weighted, local, mortar, solve,
};

/// Weight of a control without a standard deviation.
const HELD: f64 = 1e8;

/// Every picture on the map, with its precision.
pub(super) struct Placed {
    pub(super) pictures: Vec<Similarity>,
    /// From each brick's figure to the map.
    pub(super) bricks: Vec<Similarity>,
    /// The net with its weights and the controls that were kept, adjusted as one for the standard deviations.
    pub(super) weighted: Net,
    pub(super) solution: Solution,
    pub(super) tie_sigma_m: Option<f64>,
    /// Root mean square of the seams after LOCAL, X and Y, metres.
    pub(super) local_rms_m: Option<[f64; 2]>,
    pub(super) seams: Vec<Place>,
}

pub(super) fn place(config: &NetConfig, data: &NetData, laid: &Laid) -> Result<Placed, PlaneError> {
    let way = &config.triangulation;
    let to_map = laid.scaled.similarity;
    let unit_m: Vec<f64> = laid
        .block
        .bricks
        .iter()
        .map(|brick| to_map.after(brick).scale())
        .collect();
    let tie_sigma_m = way.tie_sigma_m.or_else(|| estimated_sigma_m(laid, &unit_m));
    let weighted = weighted(config, data, laid, tie_sigma_m);
    let solution = solve(&weighted)?;
    let (block, to_map) = if way.method == Method::Mortar {
        let block = mortar(&weighted, &laid.figures)?;
        let again = on_controls(&weighted, &block.places);
        (block, again)
    } else {
        (laid.block.clone(), to_map)
    };
    let mapped = |pictures: Vec<Similarity>| -> Vec<Similarity> {
        pictures
            .iter()
            .map(|picture| to_map.after(picture))
            .collect()
    };
    let bricks: Vec<Similarity> = block
        .bricks
        .iter()
        .map(|brick| to_map.after(brick))
        .collect();
    let mut pictures = mapped(block.pictures(&laid.net, &laid.figures));
    let seams = seams_of(laid, &pictures);
    let mut local_rms_m = None;
    if way.local && laid.figures.len() > 1 {
        pictures = mapped(local(&laid.net, &laid.figures, &block)?);
        local_rms_m = Some(rms(&seams_of(laid, &pictures)));
    }
    if way.method == Method::OneShot {
        let again = on_controls(&weighted, &solution.places);
        let adjusted = solution.pictures.iter();
        pictures = adjusted.map(|picture| again.after(picture)).collect();
    }
    Ok(Placed {
        pictures,
        bricks,
        weighted,
        solution,
        tie_sigma_m,
        local_rms_m,
        seams,
    })
}

/// SCALE of an adjusted figure on its controls, by their weights.
///
/// Residuals of ties are measured on the map and shrink with it. An adjustment on controls of low weight therefore
/// makes the figure too small, with many ties by more than the standard deviation of its size. Place and direction are
/// not affected.
fn on_controls(weighted: &Net, places: &[Option<Place>]) -> Similarity {
    let shown = shown_controls(weighted, places);
    let (figure, given): (Vec<Place>, Vec<Place>) = shown
        .iter()
        .map(|(_, computed, given)| (*computed, *given))
        .unzip();
    let weight = |at: usize| weighted.controls[shown[at].0].weight;
    fit_weighted(&figure, &given, weight).unwrap_or(Similarity::IDENTITY)
}

/// Standard deviation of a coordinate of an image from the residuals of the bricks; `None` without redundancy.
fn estimated_sigma_m(laid: &Laid, unit_m: &[f64]) -> Option<f64> {
    let (mut squares, mut redundancy) = (0.0, 0);
    for (figure, unit_m) in laid.figures.iter().zip(unit_m) {
        let deviations = figure.deviations.iter();
        squares += deviations.map(|(_, of)| of.norm_sqr()).sum::<f64>() * unit_m.powi(2);
        redundancy += figure.redundancy.total();
    }
    (redundancy > 0).then(|| (squares / redundancy as f64).sqrt())
}

/// The net without blunders and rejected controls, the other controls with their weights.
fn weighted(config: &NetConfig, data: &NetData, laid: &Laid, tie_sigma_m: Option<f64>) -> Net {
    let shown = shown_controls(&laid.net, &laid.block.places);
    let kept = shown
        .iter()
        .zip(&laid.scaled.kept)
        .filter(|(_, kept)| **kept);
    let controls = kept.map(|((index, ..), _)| {
        let weight = control_sigma_m(config, data, laid, *index)
            .zip(tie_sigma_m)
            .filter(|(of_control, _)| *of_control > 0.0)
            .map_or(HELD, |(of_control, of_tie)| (of_tie / of_control).powi(2));
        let mut control = laid.net.controls[*index];
        // Exact ties would leave controls without influence.
        control.weight = weight.clamp(1.0 / HELD, HELD);
        control
    });
    Net {
        controls: controls.collect(),
        ..laid.net.clone()
    }
}

/// Standard deviation of a control: its own, the configured one, or the estimate of SCALE.
pub(super) fn control_sigma_m(
    config: &NetConfig,
    data: &NetData,
    laid: &Laid,
    control: usize,
) -> Option<f64> {
    let stated = data.control_sigma_m[control].or(config.controls.sigma_m);
    stated.or(laid.scaled.sigma)
}

/// Deviation of each brick's image of a point on several bricks from the mean over the bricks, metres on the map.
fn seams_of(laid: &Laid, pictures: &[Similarity]) -> Vec<Place> {
    let mut brick_of = vec![0; laid.net.pictures];
    for (brick, figure) in laid.figures.iter().enumerate() {
        for picture in &figure.pictures {
            brick_of[*picture] = brick;
        }
    }
    let mut images: BTreeMap<(usize, usize), (Place, f64)> = BTreeMap::new();
    for measured in &laid.net.measurements {
        let image = pictures[measured.picture].map(measured.at);
        let (sum, count) = images
            .entry((measured.point, brick_of[measured.picture]))
            .or_insert((Place::new(0.0, 0.0), 0.0));
        *sum += image;
        *count += 1.0;
    }
    let means: Vec<(usize, Place)> = images
        .into_iter()
        .map(|((point, _), (sum, count))| (point, sum / count))
        .collect();
    let mut seams = Vec::new();
    for of_point in means.chunk_by(|(one, _), (two, _)| one == two) {
        let mean = of_point.iter().map(|(_, place)| place).sum::<Place>() / of_point.len() as f64;
        if of_point.len() > 1 {
            seams.extend(of_point.iter().map(|(_, place)| place - mean));
        }
    }
    seams
}
