//! Effect of the adjustment on the image planes: footprints, and figure 6 of Shan et al. 2005 for tie points.

use std::collections::BTreeMap;

use super::html::{Markup, counted, html};
use super::many;
use super::numbers::whole;
use super::plots::{
    Arrow, Arrows, Extent, GREY, INK, Mark, Panel, Plot, Series, Style, figure, label,
    magnification, thinned,
};
use areograph_base::error::Result;
use areograph_geom::statistics::Summary;
use areograph_products::{GeometricProducts, ImageProducts, SiteProducts};
use areograph_stages::{intersect::IntersectedTies, register::RegisteredPoints};

/// Largest number of dots of one series.
const DOTS_MAX: usize = 300;
/// Largest number of vectors of all images together; each is drawn once and listed once, about 400 bytes.
const ARROWS_ALL: usize = 4_000;
/// Largest number of vectors of one panel, and of one of a site of many images.
const ARROWS_MAX: usize = 250;
const ARROWS_OF_MANY: usize = 80;
/// Widths of the image on either side of it within which footprints are compared.
const WIDTHS_BESIDE: f64 = 0.5;
/// Lines shown to either side: multiple of the movement of footprints, and minimum.
const MOVES_BESIDE: f64 = 12.0;
const LINES_BESIDE_MIN: f64 = 200.0;
/// With fewer footprints there is no picture: shots of some altimeters are a thousand lines apart.
const NEAR_MIN: usize = 3;
/// Share of the image's lines, and of its samples, that the longest vector takes.
const LONGEST: f64 = 0.1;
/// Colours of before and after.
const BEFORE: usize = 1;
const AFTER: usize = 0;

/// Footprints and residual vectors of every image.
///
/// # Errors
/// A plot that cannot be drawn.
pub(super) fn figures(site: &SiteProducts, geometric: &GeometricProducts) -> Result<Markup> {
    let mut plots = Vec::new();
    let shown = many::shown(site);
    let panels = 2 * shown.len().max(1);
    let most = if many::are_many(site) {
        ARROWS_OF_MANY
    } else {
        ARROWS_MAX
    };
    let limit = (ARROWS_ALL / panels).clamp(20, most);
    let adjusted = geometric
        .adjustment
        .map_or(&[][..], |adjustment| adjustment.images);
    for (index, image) in shown {
        let after = adjusted.get(index);
        plots.extend(after.and_then(|after| footprints(image, after)));
        plots.extend(vectors(image, index, geometric, limit));
    }
    Ok(html! { (many::some_of_all(site)) div.plots { @for plot in plots { (figure(&plot)?) } } })
}

/// Footprints around the middle one with the orientation from the kernels and with the adjusted one, so close that
/// the difference is visible.
fn footprints(before: &ImageProducts, after: &ImageProducts) -> Option<Plot> {
    let samples = f64::from(before.times.samples);
    let beside = -WIDTHS_BESIDE * samples..=(1.0 + WIDTHS_BESIDE) * samples;
    let all = moves(&before.registration.points, &after.registration.points);
    let all: Vec<Arrow> = all
        .into_iter()
        .filter(|moved| beside.contains(&moved.from.1))
        .collect();
    let median = |of: fn(&Arrow) -> f64| {
        let values: Vec<f64> = all.iter().map(of).collect();
        Summary::of(&values).median
    };
    let (lines, across) = (median(|moved| moved.by.0), median(|moved| moved.by.1));
    let half = (MOVES_BESIDE * lines.abs()).max(LINES_BESIDE_MIN);
    let middle = median(|moved| moved.from.0);
    let near = middle - half..=middle + half;
    let shown: Vec<Arrow> = all
        .iter()
        .copied()
        .filter(|moved| near.contains(&moved.from.0))
        .collect();
    let shown = thinned(&shown, DOTS_MAX);
    if shown.len() < NEAR_MIN {
        return None;
    }
    let dots = |label: &str, colour: usize, at: fn(&Arrow) -> (f64, f64)| Series {
        label: label.to_owned(),
        style: Style::Dots,
        colour,
        points: shown.iter().map(at).collect(),
    };
    let series = vec![
        dots("before", BEFORE, |moved| moved.from),
        dots("after", AFTER, |moved| {
            (moved.from.0 + moved.by.0, moved.from.1 + moved.by.1)
        }),
    ];
    let ends = shown.iter().map(|moved| moved.from.0 + moved.by.0);
    let x = Extent::of(shown.iter().map(|moved| moved.from.0).chain(ends));
    let mut panel = Panel::of("sample", series);
    panel.arrows.push(Arrows {
        label: "moved".to_owned(),
        colour: GREY,
        magnification: 1.0,
        each: shown,
    });
    let words = format!(
        "Footprints near the middle; flight to the right. Median shift of all {} within the image's lines, inside the \
         image or beside it: {} lines, {} samples.",
        whole(all.len()),
        label(lines, 2),
        label(across, 2)
    );
    Some(Plot {
        x,
        ..Plot::of(
            format!("Footprints on {} before and after", before.times.id),
            words,
            "line",
            vec![panel],
        )
    })
}

/// Movement of each footprint that is within an image's lines before and after.
fn moves(before: &RegisteredPoints, after: &RegisteredPoints) -> Vec<Arrow> {
    let places = |points: &RegisteredPoints| -> BTreeMap<(u32, u32), (f64, f64)> {
        let own = (0..points.len()).filter(|index| !points.extrapolated.at(*index));
        own.map(|index| {
            let shot = (points.profile.at(index), points.row.at(index));
            (shot, (points.line.at(index), points.sample.at(index)))
        })
        .collect()
    };
    let after = places(after);
    let moved = places(before).into_iter().filter_map(|(shot, from)| {
        let to = after.get(&shot)?;
        let by = (to.0 - from.0, to.1 - from.1);
        Some(Arrow { from, by })
    });
    moved.collect()
}

/// Figure 6: reprojection residuals at the measurements of the tie points; omitted for an image without any.
fn vectors(
    image: &ImageProducts,
    index: usize,
    geometric: &GeometricProducts,
    limit: usize,
) -> Option<Plot> {
    let samples = f64::from(image.times.samples);
    let lines = f64::from(image.times.line_times.lines());
    let ends = [0.0, f64::from(image.times.lines_delivered)].map(|x| Mark {
        x,
        half_width: 0.0,
        colour: INK,
    });
    let y = Extent {
        low: -LONGEST * samples,
        high: samples + LONGEST * samples,
    };
    let mut panels = Vec::new();
    let mut words = "Tie points, measured minus projected; flight to the right.".to_owned();
    let after = geometric
        .adjustment
        .map(|adjustment| adjustment.intersected);
    for (state, title, colour, ties) in [
        ("before", "Before", BEFORE, Some(geometric.intersected)),
        ("after", "After", AFTER, after),
    ] {
        let Some(ties) = ties else { continue };
        let (all, outliers) = residuals(image, index, ties);
        if all.is_empty() {
            continue;
        }
        let each = thinned(&all, limit);
        let room = (LONGEST * lines, LONGEST * samples);
        let arrows = Arrows {
            label: state.to_owned(),
            colour,
            magnification: magnification(&each, room),
            each,
        };
        words += &format!(
            " {title}: {} vectors, × {}, mean {}",
            whole(all.len()),
            arrows.times(),
            mean_in_words(&all),
        );
        if all.len() > limit {
            words += &format!(", 1 in {} drawn", all.len().div_ceil(limit));
        }
        if outliers > 0 {
            words += &format!(", without {}", counted(outliers, "outlier"));
        }
        words.push('.');
        panels.push(Panel {
            y,
            height: 330,
            limits: vec![0.0, samples],
            marks: ends.to_vec(),
            arrows: vec![arrows],
            ..Panel::of("sample", Vec::new())
        });
    }
    (!panels.is_empty()).then(|| Plot {
        x: Extent {
            low: -LONGEST * lines,
            high: lines + LONGEST * lines,
        },
        ..Plot::of(
            format!("Residual vectors on {}", image.times.id),
            words,
            "line",
            panels,
        )
    })
}

/// Residual vectors of good points in lines and samples, and the number of outliers.
fn residuals(image: &ImageProducts, index: usize, ties: &IntersectedTies) -> (Vec<Arrow>, usize) {
    let times = image.times;
    let detector = times.detector();
    let mut outliers = 0;
    let mut arrows = Vec::new();
    for point in &ties.points {
        for measure in point.measures.iter().filter(|own| own.image == index) {
            if point.outlier {
                outliers += 1;
                continue;
            }
            let sample = detector.sample(measure.y_px);
            let projected = detector.sample(measure.y_px - measure.reprojection_px);
            arrows.push(Arrow {
                from: (times.line_times.line_of_offset(measure.x_lines), sample),
                by: (measure.reprojection_lines, sample - projected),
            });
        }
    }
    (arrows, outliers)
}

fn mean_in_words(arrows: &[Arrow]) -> String {
    let count = arrows.len().max(1) as f64;
    let mean = |of: fn(&Arrow) -> f64| label(arrows.iter().map(of).sum::<f64>() / count, 2);
    let (lines, samples) = (mean(|arrow| arrow.by.0), mean(|arrow| arrow.by.1));
    format!("{lines} lines, {samples} samples")
}
