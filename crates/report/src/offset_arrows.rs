//! Offsets on the ground as arrows on a map: of orthoimages against each other.

use super::{
    diff::sheet,
    html::Markup,
    plots::{Arrow, Arrows, Panel, Plot, figure, magnification, thinned},
};
use areograph_base::{error::Result, units::METRES_PER_KM};

/// Share of the map's width that the longest arrow takes.
const LONGEST: f64 = 0.1;
/// Largest number of arrows of one kind.
const DRAWN: usize = 100;

/// Offsets of one kind.
#[derive(Debug)]
pub struct Offsets<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// Index into the colours.
    pub colour: usize,
    /// Place and offset, each towards east and north, metres.
    pub each: Vec<[[f64; 2]; 2]>,
}

/// A map of offsets, those of each kind magnified by themselves.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn offset_arrows(title: String, words: &str, kinds: &[Offsets<'_>]) -> Result<Markup> {
    let km = |of_m: [f64; 2]| (of_m[0] / METRES_PER_KM, of_m[1] / METRES_PER_KM);
    let all: Vec<Vec<Arrow>> = kinds
        .iter()
        .map(|kind| {
            let each = kind.each.iter().map(|[from_m, by_m]| Arrow {
                from: km(*from_m),
                by: km(*by_m),
            });
            each.collect()
        })
        .collect();
    let places = all.iter().flatten().map(|arrow| arrow.from);
    let (x, ..) = sheet(places.clone());
    let room = LONGEST * (x.high - x.low);
    let arrows = kinds.iter().zip(&all).map(|(kind, all)| Arrows {
        label: kind.label.to_owned(),
        colour: kind.colour,
        magnification: magnification(all, (room, room)),
        each: thinned(all, DRAWN),
    });
    let arrows: Vec<Arrows> = arrows.collect();
    // With room for the arrows themselves.
    let tips = arrows
        .iter()
        .flat_map(|of| of.each.iter().map(|arrow| of.tip(arrow)));
    let (x, y, height) = sheet(places.chain(tips));
    let of_kinds: Vec<String> = arrows
        .iter()
        .map(|of| format!("{} × {}", of.label, of.times()))
        .collect();
    let panel = Panel {
        y,
        height,
        arrows,
        ..Panel::of("north, km", Vec::new())
    };
    let words = format!(
        "{words} Magnified: {}. Thinned for display.",
        of_kinds.join(", ")
    );
    figure(&Plot {
        x,
        ..Plot::of(title, words, "east, km", vec![panel])
    })
}
