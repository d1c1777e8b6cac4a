//! Similarity of heights of every unit over the shifts, as small pictures at one scale.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use png::{BitDepth, ColorType, Encoder, EncodingError};

use super::super::{
    html::{Markup, PreEscaped, counted, folded, html, paragraph},
    map::{keys::ColourBar, relief},
    numbers::signed,
    plots::{drawn, label},
};
use areograph_base::error::Result;
use areograph_products::error::ProductError;
use areograph_stages::match_laser::{LaserMatch, SimilaritySurface, UnitMatch, UnitResult};

/// Edge of a picture, its corner, and the size of the drawing with its axes, units of the drawing.
const EDGE: f64 = 140.0;
const LEFT: f64 = 30.0;
const TOP: f64 = 6.0;
const SIZE: [f64; 2] = [LEFT + EDGE + 9.0, TOP + EDGE + 18.0];
/// Width and height of the bar of colours with its words, in units of its drawing.
const BAR: [u32; 2] = [600, 130];
/// Number of colours: more would not be visible, and would make pages larger.
const COLOURS: u8 = 51;
/// Marks, distinct from any colour: white on black.
const MARKS: &str = "<g id=\"similarity-none\"><path d=\"M-6 0H6M0-6V6\" stroke=\"#000\" stroke-width=\"4\"/>\
     <path d=\"M-5 0H5M0-5V5\" stroke=\"#fff\" stroke-width=\"2\"/></g>\n\
     <g id=\"similarity-best\"><circle r=\"6\" fill=\"none\" stroke=\"#000\" stroke-width=\"4\"/>\
     <circle r=\"6\" fill=\"none\" stroke=\"#fff\" stroke-width=\"2\"/></g>\n";

/// The pictures of all units with a surface; empty without any. Those of the examples are shown, and the others folded.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub(crate) fn pictures(of: &LaserMatch) -> Result<Markup> {
    let shown = of.units.iter().filter_map(Shown::of);
    let shown: Vec<Shown> = shown.collect();
    let Some(first) = shown.first() else {
        return Ok(Markup::default());
    };
    let examples: Vec<usize> = of.examples().iter().map(|unit| unit.unit).collect();
    let (shown_first, others): (Vec<&Shown>, Vec<&Shown>) =
        (shown.iter()).partition(|shown| examples.contains(&shown.unit.unit));
    let (kept, refused): (Vec<&Shown>, Vec<&Shown>) =
        others.into_iter().partition(|shown| shown.unit.is_kept());
    Ok(html! {
        (words(of, first.surface))
        (definitions(first.surface))
        (bar()?)
        (figure("Units of the elevation curves", &shown_first)?)
        (folded(
            &counted(kept.len() + refused.len(), "other unit"),
            &html! { (figure("Other kept units", &kept)?) (figure("Rejected units", &refused)?) },
        ))
    })
}

/// A unit that was searched.
struct Shown<'a> {
    unit: &'a UnitResult,
    found: &'a UnitMatch,
    surface: &'a SimilaritySurface,
}

impl<'a> Shown<'a> {
    fn of(unit: &'a UnitResult) -> Option<Self> {
        Some(Self {
            unit,
            found: unit.found.as_ref()?,
            surface: unit.similarity.as_ref()?,
        })
    }

    fn name(&self) -> String {
        let kept = if self.unit.is_kept() {
            "kept"
        } else {
            "not kept"
        };
        format!("Unit {}, {kept}", self.unit.unit)
    }

    /// The picture with its name above it, and below it the result, and why it is not kept.
    fn html(&self) -> Result<Markup> {
        let png = png(self.surface).map_err(ProductError::refused("draw similarities"))?;
        let [east, north] = self.found.shift_cells;
        let [x, y] = place(self.surface, self.found.shift_cells);
        let (name, score) = (self.name(), label(self.found.score, 3));
        let (right, up) = (signed(east, 1), signed(north, 1));
        let [width, height] = SIZE;
        let picture = format!(
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{name}: similarity over the shifts, \
             best {score} at {right} cells east, {up} cells north\"><image x=\"{LEFT}\" y=\"{TOP}\" width=\"{EDGE}\" \
             height=\"{EDGE}\" href=\"data:image/png;base64,{}\"/><use href=\"#similarity-axes\"/>\
             <use href=\"#similarity-best\" x=\"{x:.1}\" y=\"{y:.1}\"/></svg>",
            STANDARD.encode(png)
        );
        Ok(html! {
            div {
                p { b { (name) } }
                (PreEscaped(picture))
                p { (score) " at " (right) ", " (up) }
                (paragraph(&self.unit.refused_because))
            }
        })
    }
}

/// The caption.
fn words(of: &LaserMatch, surface: &SimilaritySurface) -> Markup {
    let pixels = match surface.step_cells {
        1 => String::new(),
        step => format!(" A pixel shows the best of {step} by {step} shifts."),
    };
    paragraph(&format!(
        "Similarity of model and laser heights at every shift ({}), in cells; east is to the right, north is up. \
         A reliable match has one sharp peak. Shots on parallel passes produce a ridge, along which the shift is not \
         determined. The best of several equally high peaks is best by chance only.{pixels} Shifts without a \
         colour have model heights for too few shots.",
        of.similarity.word()
    ))
}

/// Place of a shift (cells east and north) in a picture, units of the drawing.
fn place(surface: &SimilaritySurface, [east, north]: [f64; 2]) -> [f64; 2] {
    let cells = f64::from(surface.side() * surface.step_cells);
    [
        LEFT + (0.5 + east / cells) * EDGE,
        TOP + (0.5 - north / cells) * EDGE,
    ]
}

/// Common parts of all pictures: axes and marks. All searches of a match have the same range.
fn definitions(surface: &SimilaritySurface) -> Markup {
    let reach = f64::from(surface.reach * surface.step_cells);
    let [middle_x, middle_y] = place(surface, [0.0; 2]);
    let bottom = TOP + EDGE;
    let labels = [-reach, 0.0, reach].map(|cells| {
        let [x, y] = place(surface, [cells, cells]);
        let text = label(cells, 0);
        format!(
            "<path d=\"M{x:.1} {bottom}v3M{LEFT} {y:.1}h-3\" />\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{text}</text>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
            bottom + 14.0,
            LEFT - 5.0,
            y + 4.0
        )
    });
    PreEscaped(format!(
        "<svg class=\"hidden\" aria-hidden=\"true\"><defs>\n{MARKS}<g id=\"similarity-axes\">\
         <rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{EDGE}\" height=\"{EDGE}\" fill=\"none\"/>{}\
         <use href=\"#similarity-none\" x=\"{middle_x}\" y=\"{middle_y}\"/></g>\n</defs></svg>\n",
        labels.concat()
    ))
}

/// The colours of all pictures, and the meaning of marks.
fn bar() -> Result<Markup> {
    let [width, height] = BAR;
    let svg = drawn(height, |area| {
        let bar = ColourBar {
            ends: (20, width as i32 - 20),
            top: 46,
            words: "similarity, 0 and below to 1",
            numbers: [0.0, 1.0],
            colour: |similarity| relief::colour(SimilaritySurface::share_of(similarity)),
        };
        bar.draw(&[0.0, 0.2, 0.4, 0.6, 0.8, 1.0], area)
    })?;
    let (_, drawing) = svg.split_once('>').unwrap_or_default();
    let key = |mark: &str| {
        let href = format!("#similarity-{mark}");
        html! { svg viewBox="-9 -9 18 18" aria-hidden="true" { use href=(href); } }
    };
    Ok(html! {
        div.shifts {
            (PreEscaped(format!(
                "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"Colours of similarity, from \
                 dark for 0 and below to light for 1\">{drawing}"
            )))
            ul.keys { li { (key("none")) "no shift" } li { (key("best")) "the best shift" } }
        }
    })
}

fn figure(title: &str, shown: &[&Shown]) -> Result<Markup> {
    if shown.is_empty() {
        return Ok(Markup::default());
    }
    let caption = format!(
        "Similarity over the shifts of {}; best similarity and its shift in cells, east and north.",
        counted(shown.len(), "unit")
    );
    Ok(html! {
        figure.shifts {
            p.title { (title) }
            div.thumbs { @for shown in shown { (shown.html()?) } }
            figcaption { (caption) }
        }
    })
}

/// A surface as a picture; the first entry of its palette is transparent.
fn png(surface: &SimilaritySurface) -> std::result::Result<Vec<u8>, EncodingError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, surface.side(), surface.side());
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    let last = f64::from(COLOURS - 1);
    let colours = (0..COLOURS).map(|colour| relief::colour(f64::from(colour) / last));
    let palette = std::iter::once([0; 3]).chain(colours);
    encoder.set_palette(palette.flatten().collect::<Vec<u8>>());
    encoder.set_trns(vec![0]);
    let pixels = surface.levels.iter().map(|level| {
        let share = SimilaritySurface::share(*level);
        share.map_or(0, |share| 1 + (share * last).round() as u8)
    });
    let pixels: Vec<u8> = pixels.collect();
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(file)
}
