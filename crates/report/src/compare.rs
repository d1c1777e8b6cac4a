//! The page of a comparison of rival kernel sets.

use super::{
    html::{Cell, Column, Markup, Section, Table, Tone, html, list, page, paragraph, verdict},
    numbers::{signed, whole},
    plots::{Panel, Plot, Series, Style, figure, label, thinned},
};
use areograph_base::{
    constants::SPACECRAFT,
    error::Result,
    time::{Et, Interval},
    units::RADIANS_PER_ARCSECOND,
};
use areograph_stages::compare_kernels::{AttitudeComparison, Comparison, Size};

/// Number of points drawn per set, over all stretches.
const POINTS_MAX: usize = 2_000;
/// Epochs farther apart than this, seconds, and than this number of steps, belong to two stretches.
const GAP_S: f64 = 3_600.0;
const GAP_STEPS: f64 = 2.5;
/// Largest number of stretches drawn.
const PICTURES: usize = 8;
/// Seconds up to which time is given in seconds; beyond in hours.
const SECONDS_MAX: f64 = 7_200.0;
const SECONDS_PER_HOUR: f64 = 3_600.0;
/// Height of one of several panels.
const PANEL_HEIGHT: u32 = 260;

/// Contents of the page.
#[derive(Debug, Clone, Copy)]
pub struct KernelComparison<'a> {
    /// Orbits, metres.
    pub orbit: &'a Comparison,
    /// Attitudes, if there were any to compare.
    pub attitude: Option<&'a AttitudeComparison>,
    /// First and last epoch in UTC.
    pub utc: &'a [String; 2],
    /// Omissions and other remarks for the reader, one sentence each.
    pub remarks: &'a [String],
}

/// A comparison of rival kernel sets as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn comparison_page(comparison: &KernelComparison) -> Result<String> {
    let sections = [
        Section::new("Orbit", orbit(comparison.orbit)?),
        Section::new(
            "Attitude",
            comparison
                .attitude
                .map(attitude)
                .transpose()?
                .unwrap_or_default(),
        ),
    ];
    Ok(page("Kernel sets compared", &lead(comparison), &sections))
}

fn lead(comparison: &KernelComparison) -> Markup {
    let orbit = comparison.orbit;
    let closest = orbit.closest();
    let distance = format!("root mean square distance {:.3} m", closest.size.rms);
    let close: Vec<String> = orbit
        .nearly_as_close()
        .map(|of| format!("{} ({} m)", of.set, label(of.size.rms, 3)))
        .collect();
    let pulled = orbit.decided_by();
    let (tone, headline) = if let [_, _] = &*orbit.deviations {
        // By the rule, two sets are always equally close.
        let headline = format!(
            "Two kernel sets, {} m apart (root mean square): a third set is required to decide which is better.",
            label(orbit.difference(0, 1).rms, 3)
        );
        (Tone::Remarks, headline)
    } else if !close.is_empty() {
        let headline = format!(
            "Not decided: {} ({} m) and {} are nearly equally far from the mean orbit (root mean square).",
            closest.set,
            label(closest.size.rms, 3),
            close.join(" and ")
        );
        (Tone::Remarks, headline)
    } else if orbit.tied.is_empty() {
        let headline = format!(
            "Of {} kernel sets, {} is closest to the mean orbit: {distance}{}.",
            orbit.deviations.len(),
            closest.set,
            pulled.map_or_else(String::new, |far| format!(
                "; this depends on {}, which biases the mean",
                far.set
            ))
        );
        let tone = pulled.map_or(Tone::Good, |_| Tone::Remarks);
        (tone, headline)
    } else {
        let first = std::iter::once(&*closest.set);
        let names: Vec<&str> = first.chain(orbit.tied_sets()).collect();
        let headline = format!(
            "{} are equally close to the mean orbit: {distance}.",
            names.join(" and ")
        );
        (Tone::Remarks, headline)
    };
    let pulls = orbit.pulls_the_mean().map_or_else(String::new, |far| {
        format!(
            "{} lies {} m (root mean square) from the mean, farther than all others, and biases this mean. ",
            far.set,
            label(far.size.rms, 3)
        )
    });
    let words = format!(
        "{pulls}{} epochs from {} to {} UTC, equally spaced over the time that all sets cover. Geometric positions of {} \
         relative to Mars, each set minus the mean of all sets, in the axes of the mean orbit. The criterion is that \
         of Shan et al. 2005: the least root mean square distance.",
        whole(orbit.epochs.len()),
        comparison.utc[0],
        comparison.utc[1],
        SPACECRAFT.name,
    );
    let body = html! { p { (words) (elsewhere(orbit)) } (list(comparison.remarks)) };
    verdict(tone, &headline, &body)
}

/// Stretches in which another set is closer than the one that is closest overall.
fn elsewhere(orbit: &Comparison) -> String {
    let stretches = stretches(&orbit.epochs);
    // Two sets are equally close to their mean everywhere.
    if stretches.len() < 2 || orbit.deviations.len() < 3 {
        return String::new();
    }
    let others = stretches.iter().enumerate().filter_map(|(index, stretch)| {
        let (of, [least_m, own_m]) = orbit.closer_within(*stretch)?;
        Some(format!(
            " In stretch {} of {}, {} is closer (root mean square distance {} m; {}: {} m).",
            index + 1,
            stretches.len(),
            of.set,
            label(least_m, 3),
            orbit.closest().set,
            label(own_m, 3)
        ))
    });
    others.collect()
}

fn orbit(orbit: &Comparison) -> Result<Markup> {
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
    Ok(html! { (tables(orbit, columns, 1.0)) (figures(title, orbit, labels, 1.0, None)?) })
}

fn attitude(attitude: &AttitudeComparison) -> Result<Markup> {
    let columns = &[
        Column::Text("set"),
        Column::Number("about radial, ″"),
        Column::Number("about along track, ″"),
        Column::Number("about cross track, ″"),
        Column::Number("rms angle, ″"),
        Column::Number("largest, ″"),
    ];
    let labels = ["radial, ″", "along, ″", "cross, ″"];
    let turns = &attitude.turns;
    let words = paragraph(
        "Rotations from the mean attitude to the attitude of each set, read with the pointing bias. On the ground: the \
         angle between the boresights of the set and of the mean attitude, times the distance along the boresight to \
         the ellipsoid.",
    );
    let title = "Attitudes against their mean";
    Ok(html! {
        (words)
        (tables(turns, columns, RADIANS_PER_ARCSECOND))
        (figures(title, turns, labels, RADIANS_PER_ARCSECOND, Some(attitude))?)
    })
}

/// Deviations of the sets, then differences of each two, in units of `unit`.
fn tables(comparison: &Comparison, columns: &'static [Column], unit: f64) -> Markup {
    let caption = "Set minus mean of all sets: mean ± standard deviation";
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
    html! { (deviations.finish()) (differences.finish()) }
}

fn cells(name: &str, size: &Size, unit: f64) -> Vec<Cell> {
    let mut cells: Vec<Cell> = vec![name.into()];
    cells.extend(size.components.map(|one| {
        let (mean, spread) = (one.mean / unit, one.standard_deviation / unit);
        Cell::from(format!("{} ± {}", signed(mean, 3), label(spread, 3)))
    }));
    cells.extend([size.rms, size.max].map(|value| Cell::from(label(value / unit, 3))));
    cells
}

/// Stretches of time that are compared without long gaps between their epochs.
fn stretches(epochs: &[Et]) -> Vec<Interval> {
    let steps_s = epochs.windows(2).map(|two| two[1].since(two[0]));
    let gap_s = GAP_S.max(GAP_STEPS * steps_s.fold(f64::INFINITY, f64::min));
    let mut found: Vec<Interval> = Vec::new();
    for et in epochs {
        match found.last_mut() {
            Some(last) if et.since(last.stop) <= gap_s => last.stop = *et,
            _ => found.push(Interval::new(*et, *et)),
        }
    }
    found
}

/// A figure for every stretch: the components of every set and, of attitudes, metres on the ground.
fn figures(
    title: &str,
    comparison: &Comparison,
    labels: [&'static str; 3],
    unit: f64,
    ground: Option<&AttitudeComparison>,
) -> Result<Markup> {
    let stretches = stretches(&comparison.epochs);
    let drawn = stretches.len().min(PICTURES);
    let mut plots = Vec::new();
    for (index, stretch) in stretches.iter().take(PICTURES).enumerate() {
        let over = Over::new(*stretch, POINTS_MAX / drawn);
        let mut panels: Vec<Panel> = labels
            .into_iter()
            .enumerate()
            .map(|(axis, label)| {
                let sets = comparison.deviations.iter().map(|deviation| {
                    let vectors = deviation.radial_along_cross.iter();
                    (&*deviation.set, vectors.map(move |v| v[axis] / unit))
                });
                over.panel(label, &comparison.epochs, sets)
            })
            .collect();
        panels.extend(ground.map(|attitude| {
            let ground_m = attitude
                .ground_m
                .iter()
                .map(|ground_m| ground_m.iter().copied());
            let names = comparison
                .deviations
                .iter()
                .map(|deviation| &*deviation.set);
            over.panel("on the ground, m", &attitude.on_ground, names.zip(ground_m))
        }));
        let title = match stretches.len() {
            1 => title.to_owned(),
            count => format!("{title}, stretch {} of {count}", index + 1),
        };
        let begins_h = stretch.start.since(stretches[0].start) / SECONDS_PER_HOUR;
        let caption = format!(
            "Each set minus the mean of all sets; the stretch begins {begins_h:.3} h after the first epoch. \
             `areograph kernels compare --json` reports every epoch."
        );
        plots.push(figure(&Plot::of(title, caption, over.x_label(), panels))?);
    }
    Ok(html! {
        div.plots { @for plot in plots { (plot) } }
        @if stretches.len() > drawn {
            p { "The first " (drawn) " of " (stretches.len()) " stretches are drawn." }
        }
    })
}

/// Layout of one stretch.
struct Over {
    stretch: Interval,
    points_max: usize,
    /// Seconds of a unit of the time axis.
    scale_s: f64,
}

impl Over {
    fn new(stretch: Interval, points_max: usize) -> Self {
        let long = stretch.duration_s() > SECONDS_MAX;
        Self {
            stretch,
            points_max,
            scale_s: if long { SECONDS_PER_HOUR } else { 1.0 },
        }
    }

    fn x_label(&self) -> &'static str {
        if self.scale_s > 1.0 {
            "hours after the start of the stretch"
        } else {
            "seconds after the start of the stretch"
        }
    }

    /// Dots of every set: lines would hide gaps in time.
    fn panel<'a, V: Iterator<Item = f64>>(
        &self,
        label: &'static str,
        epochs: &[Et],
        sets: impl Iterator<Item = (&'a str, V)>,
    ) -> Panel {
        let series = sets.enumerate().map(|(colour, (set, values))| {
            let inside = epochs.iter().zip(values);
            let inside = inside.filter(|(et, _)| self.stretch.contains(**et));
            let after = |et: &Et| et.since(self.stretch.start) / self.scale_s;
            let points: Vec<(f64, f64)> = inside.map(|(et, value)| (after(et), value)).collect();
            Series {
                label: set.to_owned(),
                style: Style::Dots,
                colour,
                points: thinned(&points, self.points_max),
            }
        });
        Panel {
            height: PANEL_HEIGHT,
            ..Panel::of(label, series.collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::frames::Position;
    use areograph_spice::State;
    use areograph_stages::compare_kernels::compare_orbits;
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
        assert!(page.contains("Of 3 kernel sets, &lt;nav&gt; is closest to the mean orbit"));
        assert!(page.contains("2.000 m")); // 1 − (1 + 0 + 8) / 3
        assert!(page.contains("this depends on ipng") && page.contains("verdict remarks"));
        assert!(page.contains("id=\"orbits-minus-their-mean\""));
        assert!(!page.contains("<nav>") && !page.contains("<i>left"));
        assert!(!page.contains("id=\"attitude\""));
        assert!(page.contains("gsfc − &lt;nav&gt;") && page.contains("ipng − gsfc"));
    }

    #[test]
    fn long_gaps_part_stretches_and_wide_steps_do_not() {
        let ends = |seconds: &[f64]| -> Vec<[f64; 2]> {
            let epochs: Vec<Et> = seconds.iter().copied().map(Et::from_seconds).collect();
            let stretches = stretches(&epochs);
            let ends = stretches
                .iter()
                .map(|one| [one.start.seconds(), one.stop.seconds()]);
            ends.collect()
        };
        assert_eq!(
            ends(&[0.0, 1.0, 2.0, 5e3, 5_001.0]),
            [[0.0, 2.0], [5e3, 5_001.0]]
        );
        assert_eq!(ends(&[0.0, 1e4, 2e4, 4e4]), [[0.0, 4e4]]);
        assert_eq!(ends(&[7.0]), [[7.0, 7.0]]);
    }

    #[test]
    fn of_two_sets_none_is_called_closer() {
        let page = page_of(&comparison(&[("nav", 1.0), ("gsfc", 0.0)]), &[]);
        assert!(page.contains("Two kernel sets, 1.000 m apart"));
        assert!(page.contains("verdict remarks") && !page.contains("close to the mean"));
    }
}
