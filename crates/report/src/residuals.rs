//! Distribution of tie point residuals, in their own standard deviations, against the normal distribution.

use super::{
    html::{Column, Markup, Table},
    many,
    numbers::whole,
    plots::{Extent, GREY, Panel, Plot, Series, figure, label},
};
use areograph_base::{error::Result, units::RADIANS_PER_ARCSECOND};
use areograph_geom::statistics::BAARDA_LIMIT;
use areograph_products::SiteProducts;
use areograph_stages::adjust::{Adjusted, ImageResidual, PointKind, ScalarResidual};

/// Number of points of a curve.
const POINTS: usize = 240;
/// Range of the axis to both sides, standard deviations.
const SHOWN: f64 = 5.0;

/// One row per image: its tie points, their residuals, and the correction at its middle.
pub(super) fn images(site: &SiteProducts, adjusted: &Adjusted) -> Markup {
    let mut table = Table::new(
        "Images, one row each",
        &[
            Column::Text("image"),
            Column::Number("tie points"),
            Column::Number("RMS along, px"),
            Column::Number("RMS across, px"),
            Column::Number("largest standardised residual"),
            Column::Number("shift, m"),
            Column::Number("rotation, ″"),
        ],
    );
    for (index, _) in many::shown(site) {
        let Some(image) = adjusted.images.get(index) else {
            continue;
        };
        let ties = || {
            let views = adjusted.views.iter();
            views.filter(|view| view.kind == PointKind::Tie && view.image == index)
        };
        let count = ties().count();
        let rms = |of: fn(&ImageResidual) -> ScalarResidual| {
            let squares: f64 = ties().map(|view| of(view).value.powi(2)).sum();
            (squares / count.max(1) as f64).sqrt()
        };
        let standardised = ties().flat_map(|view| [view.along_px, view.across_px]);
        let standardised = standardised.filter_map(|residual| residual.standardised);
        let largest = standardised.map(f64::abs).fold(0.0, f64::max);
        // Coefficients of power 0 of the position, then of the rotation.
        let size = |first: usize| {
            let constants = [0, 3, 6].map(|at| image.correction[first + at]);
            constants
                .iter()
                .map(|value| value.powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let of_ties = |value: f64, decimals: usize| match count {
            0 => "–".to_owned(),
            _ => label(value, decimals),
        };
        table.row(
            true,
            [
                (&image.id).into(),
                whole(count).into(),
                of_ties(rms(|view| view.along_px), 2).into(),
                of_ties(rms(|view| view.across_px), 2).into(),
                of_ties(largest, 1).into(),
                label(size(0), 1).into(),
                label(size(9) / RADIANS_PER_ARCSECOND, 1).into(),
            ],
        );
    }
    table.finish()
}

/// The distribution along and across the track; empty without residuals that another observation controls.
///
/// # Errors
/// A plot that cannot be drawn.
pub(super) fn distribution(adjusted: &Adjusted) -> Result<Markup> {
    let along = standardised(adjusted, |view| view.along_px);
    let across = standardised(adjusted, |view| view.across_px);
    if along.is_empty() && across.is_empty() {
        return Ok(Markup::default());
    }
    let series = vec![
        Series::line("along the track", 0, curve(&along)),
        Series::line("across the track", 1, curve(&across)),
        Series::line("normal distribution", GREY, normal()),
    ];
    let beyond = |values: &[f64]| {
        values
            .iter()
            .filter(|value| value.abs() > BAARDA_LIMIT)
            .count()
    };
    let words = format!(
        "Share of tie-point residuals below each value; each residual is divided by its own σ. Beyond ±{}: {} of {} \
         along track, {} of {} across.",
        label(BAARDA_LIMIT, 2),
        whole(beyond(&along)),
        whole(along.len()),
        whole(beyond(&across)),
        whole(across.len())
    );
    let panel = Panel {
        y: Extent {
            low: 0.0,
            high: 100.0,
        },
        ..Panel::of("share, %", series)
    };
    figure(&Plot {
        x: Extent {
            low: -SHOWN,
            high: SHOWN,
        },
        ..Plot::of(
            "Distribution of tie-point residuals".to_owned(),
            words,
            "standardised residual",
            vec![panel],
        )
    })
}

fn standardised(adjusted: &Adjusted, of: fn(&ImageResidual) -> ScalarResidual) -> Vec<f64> {
    let ties = adjusted
        .views
        .iter()
        .filter(|view| view.kind == PointKind::Tie);
    let mut values: Vec<f64> = ties.filter_map(|view| of(view).standardised).collect();
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// The empirical distribution of sorted values, thinned for a plot.
fn curve(sorted: &[f64]) -> Vec<(f64, f64)> {
    let step = sorted.len().div_ceil(POINTS).max(1);
    let last = sorted.len().saturating_sub(1);
    let places = (0..sorted.len()).filter(|place| place % step == 0 || *place == last);
    let share = |place: usize| 100.0 * (place as f64 + 0.5) / sorted.len() as f64;
    places.map(|place| (sorted[place], share(place))).collect()
}

/// The normal distribution, by Simpson's rule on its density.
fn normal() -> Vec<(f64, f64)> {
    let density = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    let step = 2.0 * SHOWN / 100.0;
    let mut share = 0.0;
    (0..=100)
        .map(|place| {
            let x = -SHOWN + f64::from(place) * step;
            if place > 0 {
                let ends = density(x - step) + density(x);
                share += step / 6.0 * (ends + 4.0 * density(x - 0.5 * step));
            }
            (x, 100.0 * share)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_has_its_known_shares() {
        let curve = normal();
        let at = |x: f64| {
            let near = curve.iter().find(|point| (point.0 - x).abs() < 1e-9);
            near.unwrap().1
        };
        // Per cent; the tail below −5 σ is 3e-5 %.
        assert!((at(0.0) - 50.0).abs() < 1e-4);
        assert!((at(1.0) - 84.134_475).abs() < 1e-4);
        assert!((at(-2.0) - 2.275_013).abs() < 1e-4);
    }

    #[test]
    fn the_empirical_distribution_rises_to_all() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        let curve = curve(&values);
        assert!(curve.len() <= POINTS + 1);
        assert_eq!(curve.last(), Some(&(999.0, 99.95)));
        assert!(curve.windows(2).all(|pair| pair[0].1 < pair[1].1));
    }
}
