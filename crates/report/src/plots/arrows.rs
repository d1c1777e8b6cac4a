//! Vectors on a plot, such as residuals at their measurements, magnified.

use std::fmt::Write as _;

use plotters::{
    element::{EmptyElement, PathElement},
    style::Color,
};

use super::{
    COLOURS, Key, Panel, Plot,
    canvas::{Chart, Drawn},
    quoted, rounded,
};

/// Length of an arrow's barbs, and the shortest arrow that has any, in the plot's own units.
const BARB: f64 = 9.0;

/// Vectors of one kind.
#[derive(Debug)]
pub(crate) struct Arrows {
    /// Name in the CSV and, with the magnification, in the legend.
    pub(crate) label: String,
    /// Index into the colours, cyclic.
    pub(crate) colour: usize,
    /// Magnification of their length against the axes.
    pub(crate) magnification: f64,
    pub(crate) each: Vec<Arrow>,
}

/// A vector in the units of the axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrow {
    pub(crate) from: (f64, f64),
    pub(crate) by: (f64, f64),
}

impl Arrows {
    /// Entry of the legend: the label with the magnification.
    pub(super) fn key(&self) -> Key {
        let times = self.times();
        if times == "1" {
            return Key::colour(&self.label, self.colour);
        }
        Key::colour(&format!("{}, × {times}", self.label), self.colour)
    }

    /// The magnification in digits.
    pub(crate) fn times(&self) -> String {
        self.magnification.to_string()
    }

    /// End of an arrow as drawn.
    pub(crate) fn tip(&self, arrow: &Arrow) -> (f64, f64) {
        (
            arrow.from.0 + self.magnification * arrow.by.0,
            arrow.from.1 + self.magnification * arrow.by.1,
        )
    }
}

/// The magnification of 1, 2 or 5 times a power of ten at which none of `arrows` is longer than `room` in
/// either axis; 1 where no arrow has a length.
pub(crate) fn magnification(arrows: &[Arrow], room: (f64, f64)) -> f64 {
    let share = |arrow: &Arrow| (arrow.by.0.abs() / room.0).max(arrow.by.1.abs() / room.1);
    let longest = arrows.iter().map(share).fold(0.0, f64::max);
    if longest <= 0.0 || !longest.is_finite() {
        return 1.0;
    }
    let power = 10_f64.powi((-longest.log10()).floor() as i32);
    let steps = [5.0, 2.0, 1.0].map(|step| step * power);
    let fits = steps.into_iter().find(|step| step * longest <= 1.0);
    fits.unwrap_or(power)
}

pub(super) fn draw_arrows<'a>(
    plot: &Plot,
    panel: &Panel,
    arrows: &Arrows,
    chart: &mut Chart<'a, '_>,
) -> Drawn<'a> {
    let style = COLOURS[arrows.colour % COLOURS.len()].stroke_width(2);
    let frame = plot.frame(panel);
    let drawn = arrows.each.iter().filter_map(|arrow| {
        let tip = arrows.tip(arrow);
        let [from, end] = frame.clip(arrow.from, tip)?;
        let [start, stop] = [from, end].map(|place| chart.backend_coord(&place));
        let by = (stop.0 - start.0, stop.1 - start.1);
        // A cut arrow has no tip.
        let line = if frame.contains(tip) {
            outline(by)
        } else {
            vec![(0, 0), by]
        };
        Some((from, line))
    });
    let drawn: Vec<_> = drawn.collect();
    chart.draw_series(
        drawn
            .into_iter()
            .map(|(from, line)| EmptyElement::at(from) + PathElement::new(line, style)),
    )?;
    Ok(())
}

/// Shaft and barbs of an arrow that ends at `tip`, in one stroke.
fn outline(tip: (i32, i32)) -> Vec<(i32, i32)> {
    let (x, y) = (f64::from(tip.0), f64::from(tip.1));
    let length = x.hypot(y);
    if length < BARB {
        return vec![(0, 0), tip];
    }
    let (back_x, back_y) = (-BARB * x / length, -BARB * y / length);
    let barb = |side: f64| {
        let end = (x + back_x - side * back_y, y + back_y + side * back_x);
        (end.0.round() as i32, end.1.round() as i32)
    };
    vec![(0, 0), tip, barb(0.5), tip, barb(-0.5)]
}

/// Appends the vectors of `panel` to `csv`, unmagnified.
pub(super) fn append_csv(panel: &Panel, csv: &mut String) {
    for arrows in &panel.arrows {
        let name = format!("{},{}", quoted(panel.y_label), quoted(&arrows.label));
        for Arrow { from, by } in &arrows.each {
            let numbers = [from.0, from.1, by.0, by.1].map(|value| rounded(value).to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(csv, "{name},{}", numbers.join(","));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrow(x: f64, y: f64) -> Arrow {
        Arrow {
            from: (1.0, 2.0),
            by: (x, y),
        }
    }

    #[test]
    fn magnified_arrows_fill_their_room_but_do_not_leave_it() {
        for (longest, expected) in [(33.0, 20.0), (0.6, 1_000.0), (700.0, 1.0), (900.0, 0.5)] {
            let arrows = [arrow(-longest, 0.0), arrow(0.1 * longest, 0.0)];
            let found = magnification(&arrows, (850.0, 100.0));
            assert!((found / expected - 1.0).abs() < 1e-12, "{longest}: {found}"); // rounding
        }
        assert!((magnification(&[], (1.0, 1.0)) - 1.0).abs() < f64::EPSILON);
        assert!((magnification(&[arrow(0.0, 0.0)], (1.0, 1.0)) - 1.0).abs() < f64::EPSILON);
    }

    #[test]
    fn barbs_point_back_on_both_sides() {
        let points = outline((100, 0));
        assert_eq!(points, [(0, 0), (100, 0), (91, -5), (100, 0), (91, 5)]);
        assert_eq!(outline((3, 4)).len(), 2);
    }

    #[test]
    fn the_data_of_a_vector_are_not_magnified() {
        let mut panel = Panel::of("sample", Vec::new());
        panel.arrows.push(Arrows {
            label: "before".to_owned(),
            colour: 0,
            magnification: 20.0,
            each: vec![arrow(-33.5, 3.25)],
        });
        let mut csv = String::new();
        append_csv(&panel, &mut csv);
        assert_eq!(csv, "sample,before,1,2,-33.5,3.25\n");
    }
}
