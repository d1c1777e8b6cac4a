//! Plots: panels over one axis, drawn as inline SVG, described in words and given as CSV.

mod arrows;
mod canvas;
#[cfg(test)]
mod colour_difference;
mod draw;
mod figure;
mod frame;
mod palette;

pub(super) use arrows::{Arrow, Arrows, magnification};
pub use canvas::label;
pub(super) use canvas::{Canvas, Drawn, draw_text, drawn, image, place_behind};
pub(super) use figure::{Key, figure_html, with_files};
pub(super) use frame::Frame;
pub(super) use palette::{COLOURS, GREY, GRID, INK, MARK, SOFT};

use std::fmt::Write as _;

use plotters::{
    coord::{ranged1d::Ranged as _, types::RangedCoordf64},
    style::RGBColor,
};

use super::html::{Markup, html};
use areograph_base::error::Result;

/// Width of a plot in its own units; pages show about half as many pixels, so that lines stay fine.
pub(super) const WIDTH: u32 = 1040;
/// Size of letters in the same units.
pub(super) const LETTERS: u32 = 34;
/// Values below this are zero with rounding errors.
const ROUNDING: f64 = 1e-9;
/// The shortest axis: labels have at most nine decimals.
const SHORTEST: f64 = 1e-7;

/// Style of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    Dots,
    Line,
    /// Crosses in the colour of marks, for outliers.
    Crosses,
    /// Upright bars, thin, each from one point to the next.
    Bars,
}

/// Points of one kind.
#[derive(Debug)]
pub(super) struct Series {
    /// Entry of the legend, and name in the CSV.
    pub(super) label: String,
    pub(super) style: Style,
    /// Index into the colours, cyclic.
    pub(super) colour: usize,
    pub(super) points: Vec<(f64, f64)>,
}

impl Series {
    pub(super) fn line(label: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Self {
        Self {
            label: label.into(),
            style: Style::Line,
            colour,
            points,
        }
    }

    pub(super) fn dots(label: &str, colour: usize, points: Vec<(f64, f64)>) -> Self {
        Self {
            label: label.to_owned(),
            style: Style::Dots,
            colour,
            points,
        }
    }

    fn rgb(&self) -> RGBColor {
        match self.style {
            Style::Crosses => MARK,
            _ => COLOURS[self.colour % COLOURS.len()],
        }
    }
}

/// An upright line at `x`, with a band of `half_width` to either side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    pub(super) x: f64,
    pub(super) half_width: f64,
    pub(super) colour: RGBColor,
}

/// One panel; points outside its range are drawn at the edge, and counted in the caption.
#[derive(Debug)]
pub(super) struct Panel {
    pub(super) y_label: &'static str,
    pub(super) y: Extent,
    pub(super) height: u32,
    pub(super) series: Vec<Series>,
    /// Vectors, over the series.
    pub(super) arrows: Vec<Arrows>,
    pub(super) marks: Vec<Mark>,
    /// Level lines that values should not cross; drawn where they are inside the range.
    pub(super) limits: Vec<f64>,
    /// Whether the dots are counted in bars at the right side.
    pub(super) histogram: bool,
    /// Panels smaller than this everywhere are stated in the caption instead.
    pub(super) least: f64,
    /// Whether the points hold logarithms to base 10 of the values; axis and data have the values.
    pub(super) log: bool,
    /// A picture behind everything else.
    pub(super) picture: Option<PanelPicture>,
}

/// A picture and the ranges of the axes of a panel that it covers, from its outer edges.
#[derive(Debug)]
pub(super) struct PanelPicture {
    pub(super) png: Vec<u8>,
    pub(super) x: Extent,
    pub(super) y: Extent,
}

impl Panel {
    /// A panel of `series` as high as usual, whose range holds all their points.
    pub(super) fn of(y_label: &'static str, series: Vec<Series>) -> Self {
        let values = series.iter().flat_map(|series| &series.points);
        Self {
            y_label,
            y: Extent::of(values.map(|point| point.1)),
            height: 420,
            series,
            arrows: Vec::new(),
            marks: Vec::new(),
            limits: Vec::new(),
            histogram: false,
            least: ROUNDING,
            log: false,
            picture: None,
        }
    }
}

/// Panels over one axis.
#[derive(Debug)]
pub(super) struct Plot {
    /// Heading, unique on its page.
    pub(super) title: String,
    /// Description, for sighted and blind readers.
    pub(super) caption: String,
    pub(super) x_label: &'static str,
    pub(super) x: Extent,
    pub(super) panels: Vec<Panel>,
}

impl Plot {
    /// One panel of `series`, whose axis holds all their points.
    pub(super) fn of(
        title: String,
        caption: String,
        x_label: &'static str,
        panels: Vec<Panel>,
    ) -> Self {
        let series = panels.iter().flat_map(|panel| &panel.series);
        let x = Extent::of(
            series
                .flat_map(|series| &series.points)
                .map(|point| point.0),
        );
        Self {
            title,
            caption,
            x_label,
            x,
            panels,
        }
    }

    /// The points of every panel, one line each; vectors have two columns more.
    fn csv(&self) -> String {
        let mut csv = format!("quantity,series,{},value", quoted(self.x_label));
        if self.panels.iter().any(|panel| !panel.arrows.is_empty()) {
            csv += &format!(",by {},by value", self.x_label);
        }
        csv.push('\n');
        for panel in &self.panels {
            for series in &panel.series {
                let name = format!("{},{}", quoted(panel.y_label), quoted(&series.label));
                for (x, y) in &series.points {
                    let y = if panel.log { 10_f64.powf(*y) } else { *y };
                    // Writing to a string cannot fail.
                    let _ = writeln!(csv, "{name},{},{}", rounded(*x), rounded(y));
                }
            }
            arrows::append_csv(panel, &mut csv);
        }
        csv
    }

    /// Entries of the legend: every label once.
    fn keys(&self) -> Vec<Key> {
        let mut keys: Vec<Key> = Vec::new();
        for panel in self.drawn() {
            let series = panel
                .series
                .iter()
                .filter(|series| !series.label.is_empty());
            let of_series = series.map(|series| match series.style {
                Style::Crosses => Key::mark(&series.label),
                _ => Key::colour(&series.label, series.colour),
            });
            let of_arrows = panel.arrows.iter().map(Arrows::key);
            for key in of_series.chain(of_arrows) {
                if !keys.contains(&key) {
                    keys.push(key);
                }
            }
        }
        keys
    }
}

/// `value` to eight digits, more than a plot can show.
fn rounded(value: f64) -> f64 {
    format!("{value:.7e}").parse().unwrap_or(value)
}

/// A field of a CSV file.
pub(super) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// The plot as a figure; in words only if there is nothing to draw.
///
/// # Errors
/// A plot that the library rejects, which is a bug in areograph.
pub(super) fn figure(plot: &Plot) -> Result<Markup> {
    if plot.drawn().next().is_none() {
        return Ok(html! { p { (plot.title) ": " (plot.description()) } });
    }
    let height = plot.drawn().map(|panel| panel.height).sum::<u32>() + draw::FOOT;
    let mut pictures = String::new();
    let mut svg = drawn(height, |area| draw::plot(plot, area, &mut pictures))?;
    place_behind(&mut svg, &pictures);
    Ok(figure_html(
        &plot.title,
        &svg,
        &plot.keys(),
        &plot.description(),
        &plot.csv(),
    ))
}

/// Smallest and largest value of an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub(super) low: f64,
    pub(super) high: f64,
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
        let (length, size) = (high - low, high.abs().max(low.abs()));
        // Values that agree still get an axis with room for labels.
        let margin = if length > SHORTEST.max(1e-9 * size) {
            0.05 * length
        } else if size > SHORTEST {
            (0.5 * size).min(1e-3).max(1e-9 * size)
        } else {
            1.0
        };
        Self {
            low: low - margin,
            high: high + margin,
        }
    }

    /// The extent, widened to include `values`, with a margin.
    pub(super) fn with(self, values: impl Iterator<Item = f64>) -> Self {
        let beyond: Vec<f64> = values.filter(|value| !self.contains(*value)).collect();
        if beyond.is_empty() {
            return self;
        }
        Self::of(beyond.into_iter().chain([self.low, self.high]))
    }

    fn clamp(self, value: f64) -> f64 {
        value.clamp(self.low, self.high)
    }

    pub(super) fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    fn range(self) -> std::ops::Range<f64> {
        self.low..self.high
    }

    /// Decimals that write the labels of an axis with about `labels` of them in full.
    pub(super) fn decimals(self, labels: usize) -> usize {
        let places = RangedCoordf64::from(self.range()).key_points(labels);
        let step = (self.high - self.low) / labels as f64;
        let is_whole = |decimals: &usize| {
            let unit = 10_f64.powi(-(*decimals as i32));
            let off = |place: &f64| (place / unit - (place / unit).round()).abs() * unit;
            // Part of a label beyond the precision of a double.
            places.iter().all(|place| off(place) < 1e-3 * step)
        };
        (0..9).find(is_whole).unwrap_or(9)
    }
}

/// Every *n*-th point, so that at most `limit` remain; the first always does.
pub(super) fn thinned<T: Copy>(points: &[T], limit: usize) -> Vec<T> {
    let step = points.len().div_ceil(limit.max(1)).max(1);
    points.iter().step_by(step).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_lies_on_the_axes_of_its_panel() {
        let corners = vec![(10.0, 2.0), (90.0, 7.0)];
        let picture = || PanelPicture {
            png: Vec::new(),
            x: Extent {
                low: 10.0,
                high: 90.0,
            },
            y: Extent {
                low: 2.0,
                high: 7.0,
            },
        };
        let panel = |histogram| Panel {
            picture: Some(picture()),
            histogram,
            ..Panel::of("y", vec![Series::dots("corners", 0, corners.clone())])
        };
        // The lowest panel has the axis, and a histogram takes room at the side.
        for histogram in [false, true] {
            let panels = vec![panel(false), panel(histogram)];
            let plot = Plot::of("t".to_owned(), String::new(), "x", panels);
            let svg = figure(&plot).unwrap().0;
            let numbers = |element: &str, keys: &[&str]| -> Vec<f64> {
                let value = |key: &&str| element.split(&format!(" {key}=\"")).nth(1).unwrap();
                let number = |key| value(key).split('"').next().unwrap().parse().unwrap();
                keys.iter().map(number).collect()
            };
            let images = svg.split("<image").skip(1);
            let images: Vec<_> = images
                .map(|of| numbers(of, &["x", "y", "width", "height"]))
                .collect();
            let dots = svg.split("<circle").skip(1);
            let dots: Vec<_> = dots.map(|of| numbers(of, &["cx", "cy"])).collect();
            assert_eq!((images.len(), dots.len()), (2, 4));
            for (image, dots) in images.iter().zip(dots.chunks(2)) {
                let [left, top, width, height] = image[..] else {
                    panic!("{image:?}");
                };
                assert_eq!(dots[0], [left, top + height]);
                assert_eq!(dots[1], [left + width, top]);
            }
        }
        // A picture is drawn without any dot.
        let empty = Panel {
            picture: Some(picture()),
            ..Panel::of("y", Vec::new())
        };
        let plot = Plot::of("t".to_owned(), String::new(), "x", vec![empty]);
        assert!(figure(&plot).unwrap().0.contains("<image"));
    }

    #[test]
    fn thinning_keeps_the_limit_and_the_first() {
        let points: Vec<u32> = (0..1001).collect();
        assert_eq!(thinned(&points, 500).len(), 334); // every third
        assert_eq!(thinned(&points, 2000).len(), 1001);
        assert_eq!(thinned(&points, 1), [0]);
        assert!(thinned::<u32>(&[], 10).is_empty());
    }

    #[test]
    fn axes_have_room_whatever_the_values() {
        for values in [
            vec![],
            vec![0.0],
            vec![3.4e6],
            vec![1e-12, 2e-12],
            vec![2e-5],
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

    #[test]
    fn axes_fit_what_is_small() {
        let extent = Extent::of([0.0, 2e-5].into_iter());
        let length = extent.high - extent.low;
        assert!((length / 2.2e-5 - 1.0).abs() < 1e-9, "{length}"); // rounding
        assert_eq!(extent.decimals(6), 6);
        // A single value on an axis without zero.
        let extent = Extent::of(std::iter::once(2e-5));
        assert!(extent.low > 0.0 && extent.high < 1e-4);
    }

    #[test]
    fn every_point_is_in_the_data_once() {
        let series = Series::line("a, \"b\"", 0, vec![(1.0, 0.25), (2.0, -0.5)]);
        let panel = Panel::of("range − distance, m", vec![series]);
        let plot = Plot::of("T".to_owned(), String::new(), "seconds", vec![panel]);
        assert_eq!(
            plot.csv(),
            "quantity,series,seconds,value\n\
             \"range − distance, m\",\"a, \"\"b\"\"\",1,0.25\n\
             \"range − distance, m\",\"a, \"\"b\"\"\",2,-0.5\n"
        );
        assert_eq!(plot.keys().len(), 1);
    }
}
