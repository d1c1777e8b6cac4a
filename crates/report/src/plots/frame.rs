//! Parts of a plot inside and outside its axes.

use super::{Extent, Panel, Plot, Style};

/// A rectangle in the units of two axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) x: Extent,
    pub(crate) y: Extent,
}

impl Frame {
    pub(crate) fn contains(&self, (x, y): (f64, f64)) -> bool {
        self.x.contains(x) && self.y.contains(y)
    }

    /// The place inside that is nearest to a point.
    pub(super) fn hold(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.clamp(x), self.y.clamp(y))
    }

    /// The part of a segment inside, by its parameters along it (Liang and Barsky 1984).
    pub(crate) fn clip(&self, from: (f64, f64), to: (f64, f64)) -> Option<[(f64, f64); 2]> {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for (step, room) in [
            (-dx, from.0 - self.x.low),
            (dx, self.x.high - from.0),
            (-dy, from.1 - self.y.low),
            (dy, self.y.high - from.1),
        ] {
            if step < 0.0 {
                enter = enter.max(room / step);
            } else if step > 0.0 {
                leave = leave.min(room / step);
            } else if room < 0.0 {
                return None;
            }
        }
        let at = |share: f64| (from.0 + share * dx, from.1 + share * dy);
        // An end inside is unchanged, to the last digit.
        let end = if leave < 1.0 { at(leave) } else { to };
        (enter < leave).then(|| [at(enter), end])
    }

    /// The pieces of a line inside.
    pub(super) fn pieces(&self, line: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
        for pair in line.windows(2) {
            let Some([from, to]) = self.clip(pair[0], pair[1]) else {
                continue;
            };
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&from) => piece.push(to),
                _ => pieces.push(vec![from, to]),
            }
        }
        pieces
    }
}

impl Plot {
    /// The panels that are drawn, from the top.
    pub(super) fn drawn(&self) -> impl Iterator<Item = &Panel> {
        self.panels.iter().filter(|panel| panel.idle().is_none())
    }

    /// The caption, with the data that are not visible as they are.
    pub(super) fn description(&self) -> String {
        let mut words = self.caption.clone();
        let idle: Vec<String> = self
            .panels
            .iter()
            .filter_map(|panel| Some(format!("{} ({})", panel.y_label, panel.idle()?)))
            .collect();
        if !idle.is_empty() {
            words += &format!(" Not drawn: {}.", idle.join("; "));
        }
        let beyond = |of: fn(&Panel, &Frame) -> usize| -> usize {
            self.drawn()
                .map(|panel| of(panel, &self.frame(panel)))
                .sum()
        };
        words += &match beyond(points_beyond) {
            0 => String::new(),
            1 => " 1 point lies beyond the axes and is drawn at their edge.".to_owned(),
            count => format!(" {count} points lie beyond the axes and are drawn at their edge."),
        };
        words
            + &match beyond(arrows_beyond) {
                0 => String::new(),
                1 => " 1 arrow is cut at the edge.".to_owned(),
                count => format!(" {count} arrows are cut at the edge."),
            }
    }

    pub(super) const fn frame(&self, panel: &Panel) -> Frame {
        Frame {
            x: self.x,
            y: panel.y,
        }
    }
}

impl Panel {
    /// Reason why there is nothing to draw.
    fn idle(&self) -> Option<String> {
        let mut values = self.series.iter().flat_map(|series| &series.points);
        let has_picture = self.picture.is_some();
        if self.log
            || has_picture
            || !self.arrows.is_empty()
            || self.limits.iter().any(|at| self.y.contains(*at))
        {
            return None;
        }
        if self.series.iter().all(|series| series.points.is_empty()) {
            return Some("no values".to_owned());
        }
        values.all(|point| point.1.abs() < self.least).then(|| {
            if self.least > super::ROUNDING {
                format!("below {} throughout", self.least)
            } else {
                "zero throughout".to_owned()
            }
        })
    }
}

fn points_beyond(panel: &Panel, frame: &Frame) -> usize {
    let marks = panel
        .series
        .iter()
        .filter(|series| matches!(series.style, Style::Dots | Style::Crosses));
    let points = marks.flat_map(|series| &series.points);
    points.filter(|point| !frame.contains(**point)).count()
}

fn arrows_beyond(panel: &Panel, frame: &Frame) -> usize {
    let ends = panel.arrows.iter().flat_map(|arrows| {
        let each = arrows.each.iter();
        each.map(|arrow| [arrow.from, arrows.tip(arrow)])
    });
    let cut = |ends: &[(f64, f64); 2]| ends.iter().any(|end| !frame.contains(*end));
    ends.filter(cut).count()
}

#[cfg(test)]
mod tests {
    use super::{
        super::{Arrow, Arrows, Series},
        *,
    };

    const FRAME: Frame = Frame {
        x: Extent {
            low: 0.0,
            high: 10.0,
        },
        y: Extent {
            low: 0.0,
            high: 10.0,
        },
    };

    #[test]
    fn segments_end_at_the_edge() {
        assert_eq!(
            FRAME.clip((-10.0, 5.0), (20.0, 5.0)),
            Some([(0.0, 5.0), (10.0, 5.0)])
        );
        assert_eq!(FRAME.clip((-1.0, 5.0), (-1.0, 7.0)), None);
        assert_eq!(FRAME.clip((-5.0, 12.0), (5.0, 22.0)), None);
    }

    #[test]
    fn a_line_that_leaves_and_returns_has_two_pieces() {
        let line = [(0.0, 5.0), (4.0, 9.0), (6.0, 11.0), (8.0, 9.0), (9.0, 5.0)];
        let pieces = FRAME.pieces(&line);
        assert_eq!(
            pieces,
            [
                vec![(0.0, 5.0), (4.0, 9.0), (5.0, 10.0)],
                vec![(7.0, 10.0), (8.0, 9.0), (9.0, 5.0)]
            ]
        );
    }

    fn plot(panels: Vec<Panel>) -> Plot {
        let mut plot = Plot::of("T".to_owned(), "Words.".to_owned(), "s", panels);
        plot.x = FRAME.x;
        plot
    }

    #[test]
    fn what_lies_beyond_the_axes_is_counted() {
        let points = vec![(1.0, 1.0), (2.0, 30.0), (-3.0, 4.0), (5.0, -0.1)];
        let mut panel = Panel::of("m", vec![Series::dots("d", 0, points)]);
        panel.y = FRAME.y;
        panel.arrows.push(Arrows {
            label: "a".to_owned(),
            colour: 1,
            magnification: 10.0,
            each: [0.5, 2.0]
                .map(|by| Arrow {
                    from: (1.0, 1.0),
                    by: (by, 0.0),
                })
                .to_vec(),
        });
        assert_eq!(
            plot(vec![panel]).description(),
            "Words. 3 points lie beyond the axes and are drawn at their edge. 1 arrow is cut at the edge."
        );
    }

    #[test]
    fn what_is_zero_throughout_is_said_and_not_drawn() {
        let line = |value: f64| vec![Series::line("l", 0, vec![(0.0, 0.0), (1.0, value)])];
        let panels = vec![
            Panel::of("position, m", line(2.0)),
            Panel::of("angle, °", line(0.0)),
            Panel {
                least: 5e-4,
                ..Panel::of("ground, m", line(-3e-4))
            },
            Panel::of("nothing, m", Vec::new()),
            // Far below a thousandth, and yet distinct values.
            Panel::of("strain", line(1e-6)),
        ];
        let plot = plot(panels);
        assert_eq!(
            plot.description(),
            "Words. Not drawn: angle, ° (zero throughout); ground, m (below 0.0005 throughout); nothing, m (no values)."
        );
        let drawn: Vec<&str> = plot.drawn().map(|panel| panel.y_label).collect();
        assert_eq!(drawn, ["position, m", "strain"]);
    }
}
