//! The page of a comparison of rival kernel sets.

use super::{
    html::{Cell, Column, Section, Table, Tone, list, page, paragraph, verdict},
    plots::{Panel, Plot, Series, Style, figure, thinned},
};
use crate::{
    error::Result,
    stages::compare_kernels::{AttitudeComparison, Comparison, Size},
    time::Et,
    units::RADIANS_PER_ARCSECOND,
};

/// Points of a series that are drawn.
const POINTS_MAX: usize = 1_500;
/// Seconds up to which time is told in seconds; beyond in hours.
const SECONDS_MAX: f64 = 7_200.0;
const SECONDS_PER_HOUR: f64 = 3_600.0;
/// Height of one of several panels.
const PANEL_HEIGHT: u32 = 260;

/// What the page tells of.
#[derive(Debug, Clone, Copy)]
pub struct KernelComparison<'a> {
    /// Orbits, metres.
    pub orbit: &'a Comparison,
    /// Attitudes, unless there was nothing to compare.
    pub attitude: Option<&'a AttitudeComparison>,
    /// First and last epoch in UTC.
    pub utc: &'a [String; 2],
    /// What was left out and what else a reader must weigh, one sentence each.
    pub remarks: &'a [String],
}

/// A comparison of rival kernel sets as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a fault of areograph.
pub fn comparison_page(comparison: &KernelComparison) -> Result<String> {
    let sections = [
        Section::new("Orbit", orbit(comparison.orbit)?),
        Section::new(
            "Attitude",
            comparison
                .attitude
                .map_or_else(|| Ok(String::new()), attitude)?,
        ),
    ];
    Ok(page("Kernel sets compared", &lead(comparison), &sections))
}

fn lead(comparison: &KernelComparison) -> String {
    let orbit = comparison.orbit;
    let closest = orbit.closest();
    let distance = format!("root mean square distance {:.3} m", closest.size.rms);
    let (tone, headline) = if orbit.tied.is_empty() {
        let headline = format!(
            "Of {} kernel sets {} is closest to the mean orbit: {distance}.",
            orbit.deviations.len(),
            closest.set
        );
        (Tone::Good, headline)
    } else {
        let first = std::iter::once(&*closest.set);
        let names: Vec<&str> = first.chain(orbit.tied_sets()).collect();
        let headline = format!(
            "{} are equally close to the mean orbit: {distance}.",
            names.join(" and ")
        );
        (Tone::Remarks, headline)
    };
    let words = format!(
        "{} epochs from {} to {} UTC, equally spaced over the time that all sets hold. Positions of MGS from \
         Mars, geometric; each set minus the mean of all, along the axes of the mean orbit. Closest is the least \
         root mean square distance, the rule by which Shan et al. 2005 chose the orbit of the navigation team.",
        orbit.epochs.len(),
        comparison.utc[0],
        comparison.utc[1]
    );
    verdict(
        tone,
        &headline,
        &(paragraph(&words) + &list(comparison.remarks)),
    )
}

fn orbit(orbit: &Comparison) -> Result<String> {
    let columns = &[
        Column::Text("set"),
        Column::Number("radial, m"),
        Column::Number("along track, m"),
        Column::Number("cross track, m"),
        Column::Number("rms distance, m"),
        Column::Number("largest, m"),
    ];
    let labels = ["radial, m", "along track, m", "cross track, m"];
    let title = "Orbits minus their mean";
    Ok([
        tables(orbit, columns, 1.0),
        figure(&plot(title, orbit, labels, 1.0, Vec::new()))?,
    ]
    .concat())
}

fn attitude(attitude: &AttitudeComparison) -> Result<String> {
    let columns = &[
        Column::Text("set"),
        Column::Number("about radial, ″"),
        Column::Number("about along track, ″"),
        Column::Number("about cross track, ″"),
        Column::Number("rms angle, ″"),
        Column::Number("largest, ″"),
    ];
    let labels = [
        "about radial, ″",
        "about along track, ″",
        "about cross track, ″",
    ];
    let turns = &attitude.turns;
    let ground = turns.deviations.iter().zip(&attitude.ground_m);
    let ground = ground.map(|(deviation, ground_m)| (&*deviation.set, ground_m.iter().copied()));
    let origin = turns.epochs.first().copied();
    let ground = series(&attitude.on_ground, origin, last(turns), ground);
    let words = paragraph(
        "Turns from the mean attitude to that of each set, read with the pointing bias. On the ground: the angle \
         between its boresight and that of the mean attitude, times the distance along it to the ellipsoid.",
    );
    let ground = Panel {
        height: PANEL_HEIGHT,
        ..Panel::of("on the ground, m", ground)
    };
    let title = "Attitudes against their mean";
    Ok([
        words,
        tables(turns, columns, RADIANS_PER_ARCSECOND),
        figure(&plot(
            title,
            turns,
            labels,
            RADIANS_PER_ARCSECOND,
            vec![ground],
        ))?,
    ]
    .concat())
}

/// Deviations of the sets, then differences of each two, in units of `unit`.
fn tables(comparison: &Comparison, columns: &'static [Column], unit: f64) -> String {
    let caption = "Set minus mean of all: mean ± standard deviation";
    let mut deviations = Table::new(caption, columns);
    for deviation in &comparison.deviations {
        deviations.row(true, cells(&deviation.set, &deviation.size, unit));
    }
    let caption = "Set minus set: mean ± standard deviation";
    let mut differences = Table::new(caption, columns);
    for (first, second) in comparison.pairs() {
        let [minus, of] = [first, second].map(|index| &comparison.deviations[index].set);
        let size = comparison.difference(first, second);
        differences.row(true, cells(&format!("{of} − {minus}"), &size, unit));
    }
    deviations.finish() + &differences.finish()
}

fn cells(name: &str, size: &Size, unit: f64) -> Vec<Cell> {
    let mut cells: Vec<Cell> = vec![name.into()];
    cells.extend(size.components.map(|one| {
        let (mean, spread) = (one.mean / unit, one.standard_deviation / unit);
        Cell::from(format!("{mean:+.3} ± {spread:.3}"))
    }));
    cells.extend([size.rms, size.max].map(|value| Cell::from(format!("{:.3}", value / unit))));
    cells
}

/// Components of every set over time, then `more` panels.
fn plot(
    title: &str,
    comparison: &Comparison,
    labels: [&'static str; 3],
    unit: f64,
    more: Vec<Panel>,
) -> Plot {
    let origin = comparison.epochs.first().copied();
    let panels = labels.into_iter().enumerate().map(|(axis, label)| {
        let sets = comparison.deviations.iter().map(|deviation| {
            let vectors = deviation.radial_along_cross.iter();
            (&*deviation.set, vectors.map(move |v| v[axis] / unit))
        });
        Panel {
            height: PANEL_HEIGHT,
            ..Panel::of(
                label,
                series(&comparison.epochs, origin, last(comparison), sets),
            )
        }
    });
    let x_label = if scale_s(origin, last(comparison)) > 1.0 {
        "hours after the first epoch"
    } else {
        "seconds after the first epoch"
    };
    let thinned = match comparison.epochs.len().div_ceil(POINTS_MAX) {
        0 | 1 => String::new(),
        step => format!(
            " Drawn, and in the data below, is one of {step} epochs; `areograph kernels compare --json` gives all."
        ),
    };
    let caption = format!("Each set minus the mean of all.{thinned}");
    Plot::of(
        title.to_owned(),
        caption,
        x_label,
        panels.chain(more).collect(),
    )
}

fn last(comparison: &Comparison) -> Option<Et> {
    comparison.epochs.last().copied()
}

/// Seconds of a unit of the time axis.
fn scale_s(first: Option<Et>, last: Option<Et>) -> f64 {
    let span = first
        .zip(last)
        .map_or(0.0, |(first, last)| last.since(first));
    if span > SECONDS_MAX {
        SECONDS_PER_HOUR
    } else {
        1.0
    }
}

/// Dots of every set over time after `origin`: time may have gaps, which a line would hide.
fn series<'a, V: Iterator<Item = f64>>(
    epochs: &[Et],
    origin: Option<Et>,
    last: Option<Et>,
    sets: impl Iterator<Item = (&'a str, V)>,
) -> Vec<Series> {
    let scale_s = scale_s(origin, last);
    let after = |et: &Et| origin.map_or(0.0, |origin| et.since(origin) / scale_s);
    sets.enumerate()
        .map(|(colour, (set, values))| {
            let points: Vec<(f64, f64)> = epochs.iter().map(after).zip(values).collect();
            Series {
                label: set.to_owned(),
                style: Style::Dots,
                colour,
                points: thinned(&points, POINTS_MAX),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{frames::Position, spice::State, stages::compare_kernels::compare_orbits};
    use nalgebra::Vector3;

    fn comparison(sets: &[(&str, f64)]) -> Comparison {
        let epochs: Vec<Et> = (0..2_000).map(|s| Et::from_seconds(f64::from(s))).collect();
        let orbits: Vec<(String, Vec<State>)> = sets
            .iter()
            .map(|(set, cross_m)| {
                let state = State {
                    position: Position::new(Vector3::new(3.78e6, 0.0, *cross_m)),
                    velocity_m_s: Vector3::new(0.0, 3.4e3, 0.0),
                };
                ((*set).to_owned(), vec![state; epochs.len()])
            })
            .collect();
        compare_orbits(&epochs, &orbits)
    }

    fn page_of(orbit: &Comparison, remarks: &[String]) -> String {
        comparison_page(&KernelComparison {
            orbit,
            attitude: None,
            utc: &["a".to_owned(), "b".to_owned()],
            remarks,
        })
        .unwrap()
    }

    #[test]
    fn the_verdict_comes_first_and_text_stays_text() {
        let found = comparison(&[("<nav>", 1.0), ("gsfc", 0.0), ("ipng", 8.0)]);
        let page = page_of(&found, &["<i>left out</i>".to_owned()]);
        assert!(page.contains("Of 3 kernel sets &lt;nav&gt; is closest to the mean orbit"));
        assert!(page.contains("2.000 m")); // 1 − (1 + 0 + 8) / 3
        assert!(page.contains("one of 2 epochs"));
        assert!(!page.contains("<nav>") && !page.contains("<i>left"));
        assert!(!page.contains("id=\"attitude\""));
        assert!(page.contains("gsfc − &lt;nav&gt;") && page.contains("ipng − gsfc"));
    }

    #[test]
    fn equally_close_sets_are_both_named() {
        let page = page_of(&comparison(&[("nav", 1.0), ("gsfc", 0.0)]), &[]);
        assert!(page.contains("nav and gsfc are equally close to the mean orbit"));
    }
}
