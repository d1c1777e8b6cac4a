//! Plots as inline SVG, their legends as HTML below them.

use plotters::{
    coord::{Shift, types::RangedCoordf64},
    prelude::*,
};

use super::html::escape;
use crate::{error::Result, products::fault::ProductFault};

/// Width of a plot in its own units; browsers scale it to the page.
const WIDTH: u32 = 760;
/// Colours that stay apart for most colour-blind readers (Okabe and Ito 2008, without yellow).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];
/// Index of the grey among the colours.
pub(super) const GREY: usize = 6;
/// Colour of marks and outliers.
const MARK: RGBColor = RGBColor(179, 38, 30);

/// How a series is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) enum Style {
    Dots,
    Line,
    /// Crosses in the colour of marks, for outliers.
    Crosses,
}

/// Points of one kind.
#[derive(Debug)]
pub(super) struct Series {
    /// Entry of the legend; none when empty.
    pub(super) label: String,
    pub(super) style: Style,
    /// Index into the colours, taken round.
    pub(super) colour: usize,
    pub(super) points: Vec<(f64, f64)>,
}

/// A plot with its axes; points outside the ranges are drawn at the edge.
#[derive(Debug)]
pub(super) struct Plot {
    pub(super) x_label: &'static str,
    pub(super) y_label: &'static str,
    pub(super) x: Extent,
    pub(super) y: Extent,
    /// Whether x is a longitude that may run past 360.
    pub(super) x_turns: bool,
    pub(super) height: u32,
    pub(super) series: Vec<Series>,
    /// Upright lines at these x, in the colour of marks.
    pub(super) marks: Vec<f64>,
    /// Text below the legend.
    pub(super) caption: String,
}

/// Smallest and largest value of an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    low: f64,
    high: f64,
}

impl Extent {
    /// All of `values` with a margin, never empty.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return Self {
                low: 0.0,
                high: 1.0,
            };
        }
        // Values that agree to a thousandth (of a metre, degree, second) still get an axis with room for labels.
        let margin = (0.05 * (high - low))
            .max(1e-9 * high.abs().max(low.abs()))
            .max(1e-3);
        Self {
            low: low - margin,
            high: high + margin,
        }
    }

    fn clamp(self, value: f64) -> f64 {
        value.clamp(self.low, self.high)
    }

    fn range(self) -> std::ops::Range<f64> {
        self.low..self.high
    }

    /// Decimals that tell the labels of about eight steps apart.
    fn decimals(self) -> usize {
        let step = (self.high - self.low) / 8.0;
        (0..9_u8)
            .find(|decimals| 10_f64.powi(-i32::from(*decimals)) <= step)
            .map_or(9, usize::from)
    }
}

/// Every so many points, so that at most `limit` remain; the first always does.
pub(super) fn thinned<T: Copy>(points: &[T], limit: usize) -> Vec<T> {
    let step = points.len().div_ceil(limit.max(1)).max(1);
    points.iter().step_by(step).copied().collect()
}

/// The plot with legend and caption.
pub(super) fn figure(plot: &Plot) -> Result<String> {
    let mut svg = String::new();
    draw(
        plot,
        &SVGBackend::with_string(&mut svg, (WIDTH, plot.height)).into_drawing_area(),
    )
    .map_err(ProductFault::refused("draw a plot"))?;
    let keys: Vec<String> = plot
        .series
        .iter()
        .filter(|series| !series.label.is_empty())
        .map(|series| {
            let RGBColor(red, green, blue) = colour(series);
            format!(
                "<span class=\"key\"><i style=\"background:#{red:02x}{green:02x}{blue:02x}\"></i>{}</span>",
                escape(&series.label)
            )
        })
        .collect();
    Ok(format!(
        "<figure>\n{svg}<figcaption>{} {}</figcaption>\n</figure>\n",
        keys.concat(),
        escape(&plot.caption)
    ))
}

fn colour(series: &Series) -> RGBColor {
    match series.style {
        Style::Crosses => MARK,
        _ => COLOURS[series.colour % COLOURS.len()],
    }
}

/// A number of an axis; what rounds to zero has no sign.
fn label(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if !digits.contains(|digit| matches!(digit, '1'..='9')) => digits.to_owned(),
        _ => text,
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<'a> =
    std::result::Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw<'a>(plot: &Plot, area: &Area<'a>) -> Drawn<'a> {
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(46)
        .y_label_area_size(78)
        .build_cartesian_2d(plot.x.range(), plot.y.range())?;
    let (x_decimals, y_decimals) = (plot.x.decimals(), plot.y.decimals());
    let turns = plot.x_turns;
    chart
        .configure_mesh()
        .x_desc(plot.x_label)
        .y_desc(plot.y_label)
        .x_labels(9)
        .y_labels(7)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(232, 232, 232))
        .label_style(("sans-serif", 14))
        .x_label_formatter(&move |x| {
            let x = if turns { x.rem_euclid(360.0) } else { *x };
            label(x, x_decimals)
        })
        .y_label_formatter(&move |y| label(*y, y_decimals))
        .draw()?;
    for mark in &plot.marks {
        let (bottom, top) = (plot.y.low, plot.y.high);
        chart.draw_series(LineSeries::new(
            [(*mark, bottom), (*mark, top)],
            MARK.stroke_width(2),
        ))?;
    }
    for series in &plot.series {
        draw_series(plot, series, &mut chart)?;
    }
    area.present()
}

type Chart<'a, 'b> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn draw_series<'a>(plot: &Plot, series: &Series, chart: &mut Chart<'a, '_>) -> Drawn<'a> {
    let colour = colour(series);
    let points = series
        .points
        .iter()
        .map(|(x, y)| (plot.x.clamp(*x), plot.y.clamp(*y)));
    match series.style {
        Style::Dots => {
            chart.draw_series(points.map(|point| Circle::new(point, 2, colour.filled())))?;
        }
        Style::Line => {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        }
        Style::Crosses => {
            chart.draw_series(points.map(|point| Cross::new(point, 4, colour.stroke_width(2))))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_limit_and_the_first() {
        let points: Vec<u32> = (0..1001).collect();
        assert_eq!(thinned(&points, 500).len(), 334); // every third
        assert_eq!(thinned(&points, 2000).len(), 1001);
        assert_eq!(thinned(&points, 1), [0]);
        assert!(thinned::<u32>(&[], 10).is_empty());
    }

    #[test]
    fn zero_has_no_sign() {
        assert_eq!(label(-0.004, 2), "0.00");
        assert_eq!(label(-0.006, 2), "-0.01");
        assert_eq!(label(-20.0, 0), "-20");
    }

    #[test]
    fn axes_have_room_whatever_the_values() {
        for values in [
            vec![],
            vec![0.0],
            vec![3.4e6],
            vec![-1.0, 2.0],
            vec![f64::NAN, 1.0],
        ] {
            let extent = Extent::of(values.iter().copied());
            assert!(extent.high > extent.low, "{values:?}");
            assert!(
                values
                    .iter()
                    .all(|v| v.is_nan() || (extent.low < *v && *v < extent.high))
            );
        }
    }
}
