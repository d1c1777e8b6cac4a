//! Plots on paper: panels with their axes, marks, series, arrows and bars.

use plotters::prelude::*;

use super::{
    Frame, GRID, INK, LETTERS, MARK, Panel, PanelPicture, Plot, Series, Style, WIDTH,
    arrows::draw_arrows,
    canvas::{Canvas, Chart, Drawn, image, label},
};

/// Height of the axis below the lowest panel, with its labels.
pub(super) const FOOT: u32 = 96;
/// Room between panels, for the labels at their corners.
const GUTTER: u32 = 16;
/// Margin above and beside a panel.
const MARGIN: u32 = 14;
/// Labels of the lowest axis, about.
const X_LABELS: usize = 6;
/// Width of the axes at the left side.
const SIDE: u32 = 176;
/// Width of the bars at the right side.
const BARS: u32 = 150;
/// Labels with this many decimals do not fit beside the name of their axis.
const DECIMALS_MANY: usize = 5;
/// Number of bars over the range of a panel.
const BAR_COUNT: usize = 24;

/// Draws a plot; pictures of its panels are appended to `pictures`, as the drawing library places them.
pub(super) fn plot<'a>(plot: &Plot, area: &Canvas<'a>, pictures: &mut String) -> Drawn<'a> {
    let last = plot.drawn().count().saturating_sub(1);
    let mut rest = area.clone();
    for (place, panel) in plot.drawn().enumerate() {
        let lowest = place == last;
        let height = panel.height + if lowest { FOOT } else { 0 };
        let (own, below) = rest.split_vertically(height);
        draw_panel(plot, panel, lowest, &own, pictures)?;
        rest = below;
    }
    Ok(())
}

fn draw_panel<'a>(
    plot: &Plot,
    panel: &Panel,
    lowest: bool,
    area: &Canvas<'a>,
    pictures: &mut String,
) -> Drawn<'a> {
    let foot = if lowest { FOOT } else { 0 };
    let histograms = plot.drawn().any(|panel| panel.histogram);
    let width = if histograms { WIDTH - BARS } else { WIDTH };
    let (left, right) = area.split_horizontally(width);
    let mut chart = ChartBuilder::on(&left)
        .margin_top(MARGIN)
        .margin_right(MARGIN)
        .margin_bottom(if lowest { 0 } else { GUTTER })
        .x_label_area_size(foot)
        .y_label_area_size(SIDE)
        .build_cartesian_2d(plot.x.range(), panel.y.range())?;
    let y_labels = if panel.height < 300 { 5 } else { 8 };
    let x_decimals = plot.x.decimals(X_LABELS);
    let (y_label, y_scale, y_decimals) = scaled(panel.y_label, panel.y.decimals(y_labels));
    chart
        .configure_mesh()
        .x_desc(if lowest { plot.x_label } else { "" })
        .y_desc(y_label)
        .x_labels(X_LABELS)
        .y_labels(y_labels)
        .max_light_lines(0)
        .bold_line_style(if panel.picture.is_some() {
            TRANSPARENT.stroke_width(0)
        } else {
            GRID.stroke_width(2)
        })
        .axis_style(INK.stroke_width(2))
        .label_style(("sans-serif", LETTERS).into_font().color(&INK))
        .axis_desc_style(("sans-serif", LETTERS).into_font().color(&INK))
        .x_label_formatter(&move |x| label(*x, x_decimals))
        .y_label_formatter(&move |y| {
            if panel.log {
                power(*y)
            } else {
                label(*y * y_scale, y_decimals)
            }
        })
        .draw()?;
    if let Some(PanelPicture { png, x, y }) = &panel.picture {
        let corner = |x: f64, y: f64| {
            let (column, row) = chart.backend_coord(&(x, y));
            [column, row].map(f64::from)
        };
        let ([left, top], [right, bottom]) = (corner(x.low, y.high), corner(x.high, y.low));
        *pictures += &image([left, top, right - left, bottom - top], png);
    }
    draw_marks(plot, panel, &mut chart)?;
    for series in &panel.series {
        draw_series(&plot.frame(panel), series, &mut chart)?;
    }
    for arrows in &panel.arrows {
        draw_arrows(plot, panel, arrows, &mut chart)?;
    }
    if panel.histogram {
        draw_histogram(panel, foot, &right)?;
    }
    Ok(())
}

/// The name of an axis, the factor of its labels, and their decimals: many zeros go into the unit.
fn scaled(name: &str, decimals: usize) -> (String, f64, usize) {
    let (power, written) = match decimals {
        0..DECIMALS_MANY => return (name.to_owned(), 1.0, decimals),
        DECIMALS_MANY..=6 => (6, "10⁻⁶"),
        _ => (9, "10⁻⁹"),
    };
    let name = name.rsplit_once(", ").map_or_else(
        || format!("{name}, {written}"),
        |(what, unit)| format!("{what}, {written} {unit}"),
    );
    (
        name,
        10_f64.powi(power),
        decimals.saturating_sub(power as usize),
    )
}

/// The value of a logarithm, to a digit between the powers of ten.
fn power(logarithm: f64) -> String {
    let decimals = (1.0 - logarithm.floor()).clamp(0.0, 9.0) as usize;
    let text = label(10_f64.powf(logarithm), decimals);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Upright marks with their bands, and level limits.
fn draw_marks<'a>(plot: &Plot, panel: &Panel, chart: &mut Chart<'a, '_>) -> Drawn<'a> {
    for mark in panel.marks.iter().filter(|mark| plot.x.contains(mark.x)) {
        let sides = [mark.x - mark.half_width, mark.x + mark.half_width].map(|x| plot.x.clamp(x));
        chart.draw_series([Rectangle::new(
            [(sides[0], panel.y.low), (sides[1], panel.y.high)],
            mark.colour.mix(0.15).filled(),
        )])?;
        let line = [(mark.x, panel.y.low), (mark.x, panel.y.high)];
        chart.draw_series(LineSeries::new(line, mark.colour.stroke_width(3)))?;
    }
    for limit in panel
        .limits
        .iter()
        .filter(|limit| panel.y.contains(**limit))
    {
        let line = [(plot.x.low, *limit), (plot.x.high, *limit)];
        chart.draw_series(DashedLineSeries::new(line, 14, 10, MARK.stroke_width(3)))?;
    }
    Ok(())
}

fn draw_series<'a>(frame: &Frame, series: &Series, chart: &mut Chart<'a, '_>) -> Drawn<'a> {
    let colour = series.rgb();
    let points = series.points.iter().map(|point| frame.hold(*point));
    match series.style {
        Style::Dots => {
            chart.draw_series(points.map(|point| Circle::new(point, 4, colour.filled())))?;
        }
        Style::Line => {
            for piece in frame.pieces(&series.points) {
                chart.draw_series(LineSeries::new(piece, colour.stroke_width(3)))?;
            }
        }
        Style::Bars => {
            let points: Vec<(f64, f64)> = points.collect();
            let bars = points.chunks_exact(2).map(<[(f64, f64)]>::to_vec);
            chart.draw_series(
                bars.map(|bar| PathElement::new(bar, colour.mix(0.5).stroke_width(3))),
            )?;
        }
        Style::Crosses => {
            chart.draw_series(points.map(|point| Cross::new(point, 8, colour.stroke_width(4))))?;
        }
    }
    Ok(())
}

/// Histogram of the dots' heights, as bars to the right.
fn draw_histogram<'a>(panel: &Panel, foot: u32, area: &Canvas<'a>) -> Drawn<'a> {
    let counts = histogram(panel);
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let mut chart = ChartBuilder::on(area)
        .margin_top(MARGIN)
        .margin_right(8)
        .margin_bottom(if foot > 0 { 0 } else { GUTTER })
        .x_label_area_size(foot)
        .build_cartesian_2d(0.0..f64::from(most), panel.y.range())?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(2)
        .y_labels(0)
        .x_desc("shots")
        .axis_style(INK.stroke_width(2))
        .label_style(("sans-serif", LETTERS).into_font().color(&INK))
        .x_label_formatter(&|count| label(*count, 0))
        .draw()?;
    let step = (panel.y.high - panel.y.low) / BAR_COUNT as f64;
    let bars = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    chart.draw_series(bars.map(|(bar, count)| {
        let low = panel.y.low + bar as f64 * step;
        Rectangle::new(
            [
                (0.0, low + 0.1 * step),
                (f64::from(*count), low + 0.9 * step),
            ],
            super::COLOURS[super::GREY].mix(0.6).filled(),
        )
    }))?;
    Ok(())
}

/// Numbers of dots of a panel in equal steps of its range, without points beyond it.
fn histogram(panel: &Panel) -> Vec<u32> {
    let mut counts = vec![0_u32; BAR_COUNT];
    let dots = panel
        .series
        .iter()
        .filter(|series| series.style == Style::Dots);
    for (_, value) in dots.flat_map(|series| &series.points) {
        let share = (value - panel.y.low) / (panel.y.high - panel.y.low);
        if (0.0..1.0).contains(&share) {
            counts[(share * BAR_COUNT as f64) as usize] += 1;
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::{super::Extent, *};

    #[test]
    fn logarithmic_axes_have_values() {
        let names = [-3.0, -0.5, 0.0, 1.5, 4.0].map(power);
        assert_eq!(names, ["0.001", "0.32", "1", "32", "10\u{202f}000"]);
    }

    #[test]
    fn many_zeros_go_into_the_unit() {
        let of = |decimals| scaled("camera moved, m", decimals);
        assert_eq!(of(4), ("camera moved, m".to_owned(), 1.0, 4));
        assert_eq!(of(6), ("camera moved, 10⁻⁶ m".to_owned(), 1e6, 0));
        assert_eq!(of(8).2, 0);
        assert_eq!(scaled("strain", 5).0, "strain, 10⁻⁶");
    }

    #[test]
    fn every_dot_inside_the_range_is_counted() {
        let points = (0..100).map(|k| (0.0, f64::from(k))).collect();
        let dots = Series {
            label: String::new(),
            style: Style::Dots,
            colour: 0,
            points,
        };
        let outlier = Series {
            label: String::new(),
            style: Style::Crosses,
            colour: 0,
            points: vec![(0.0, 50.0)],
        };
        let mut panel = Panel::of("m", vec![dots, outlier]);
        assert_eq!(histogram(&panel).iter().sum::<u32>(), 100);
        panel.y = Extent {
            low: 0.0,
            high: 50.0,
        };
        assert_eq!(histogram(&panel).iter().sum::<u32>(), 50);
    }
}
