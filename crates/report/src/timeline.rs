//! Coverage of every kernel against the required coverage of the site: gaps over time.

use chrono::{DateTime, TimeDelta};
use plotters::{prelude::*, style::text_anchor::HPos};

use super::{
    html::{Column, Markup, Table, folded_unless, html},
    plots::{COLOURS, Canvas, Drawn, INK, Key, MARK, WIDTH, draw_text, drawn, figure_html, quoted},
    section::Section,
};
use areograph_base::{
    error::Result,
    time::{Et, Interval, Intervals},
    verdict::CheckKind,
};
use areograph_products::SiteProducts;
use areograph_stages::describe_kernels::KernelLine;

/// Required instants closer together than this share a picture, seconds.
const APART_S: f64 = 600.0;
/// Largest number of pictures; the data beside them hold all.
const PICTURES: usize = 8;
/// Height of a row: a name over a bar.
const ROW: u32 = 62;
const BAR_TOP: i32 = 34;
const BAR_BOTTOM: i32 = 54;
/// Colour of coverage.
const HELD: usize = 2;
/// Colour of required coverage.
const ASKED: usize = 0;

pub(super) const SECTION: Section = Section {
    title: "Kernel coverage",
    anchor: "kernel-coverage",
    checks: &[
        CheckKind::Attitude,
        CheckKind::BeamAlong,
        CheckKind::BeamAcross,
    ],
    appears: |site| !stretches(site).is_empty(),
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let stretches = stretches(site);
    let body = html! {
        div.plots { @for stretch in stretches.iter().take(PICTURES) { (picture(site, *stretch)?) } }
        @if stretches.len() > PICTURES {
            p { "The first " (PICTURES) " of " (stretches.len()) " stretches are drawn." }
        }
        (table(site))
    };
    let missing_s: f64 = stretches
        .iter()
        .map(|stretch| missing_s(site, *stretch))
        .sum();
    let words = if missing_s > 0.0 {
        format!("Of the requested time, margins included, {missing_s:.3} s are not covered.")
    } else {
        "Everything requested is covered.".to_owned()
    };
    let kernels = folded_unless(missing_s > 0.0, "Coverage of every kernel", &body);
    Ok(html! { p { (words) } (kernels) })
}

/// Required time that is not covered.
fn missing_s(site: &SiteProducts, stretch: Interval) -> f64 {
    let rows = rows(site, stretch);
    let gaps: Vec<Interval> = rows.iter().filter(|row| row.sum).flat_map(gaps).collect();
    total_s(&gaps)
}

/// Required intervals, merged where close together, with a margin at both sides.
fn stretches(site: &SiteProducts) -> Vec<Interval> {
    let asked = site.required.of_all();
    let wide = asked
        .iter()
        .flat_map(Intervals::as_slice)
        .map(|interval| interval.padded(0.5 * APART_S));
    let merged = Intervals::union_of(wide);
    let stretches = merged.as_slice().iter().map(|interval| {
        let exact = interval.padded(-0.5 * APART_S);
        exact.padded((0.25 * exact.duration_s()).max(5.0))
    });
    stretches.collect()
}

/// A row of a picture.
struct Row {
    name: String,
    held: Intervals,
    asked: Intervals,
    /// Whether gaps in required coverage matter: only for the sum of a kind of kernels.
    sum: bool,
}

/// Rows of one stretch: position and attitude in total, then every kernel that covers some of it.
fn rows(site: &SiteProducts, stretch: Interval) -> Vec<Row> {
    let mut rows = Vec::new();
    let [positions, attitudes] = site.required.of_all();
    for (role, name, asked) in [
        ("SPK", "position, all kernels", &positions),
        ("CK", "attitude, all kernels", &attitudes),
    ] {
        let within = Intervals::union_of([stretch]);
        let asked = asked.intersection(&within);
        if asked.as_slice().is_empty() {
            continue;
        }
        let of_role = || {
            site.kernels
                .iter()
                .filter(move |kernel| kernel.role == role)
        };
        let all = Intervals::union_of(of_role().flat_map(held).copied());
        rows.push(Row {
            name: name.to_owned(),
            held: all.intersection(&within),
            asked: asked.clone(),
            sum: true,
        });
        for kernel in of_role() {
            let held = Intervals::union_of(held(kernel).iter().copied()).intersection(&within);
            if !held.as_slice().is_empty() {
                rows.push(Row {
                    name: kernel.name.clone(),
                    held,
                    asked: asked.clone(),
                    sum: false,
                });
            }
        }
    }
    rows
}

fn held(kernel: &KernelLine) -> &[Interval] {
    kernel.held.as_ref().map_or(&[], Intervals::as_slice)
}

fn picture(site: &SiteProducts, stretch: Interval) -> Result<Markup> {
    let rows = rows(site, stretch);
    let height = u32::try_from(rows.len()).unwrap_or(u32::MAX) * ROW + 50;
    let svg = drawn(height, |area| draw(&rows, stretch, area))?;
    let gaps: Vec<Interval> = rows.iter().filter(|row| row.sum).flat_map(gaps).collect();
    let mut words = format!(
        "{:.1} s from {} (ET {:.3} s).",
        stretch.duration_s(),
        calendar(stretch.start),
        stretch.start.seconds()
    );
    words += &match gaps.as_slice() {
        [] => " Everything requested is covered.".to_owned(),
        [first, ..] => format!(
            " Of the requested time, margins included, {:.3} s are not covered, the first {:.3} s at \
             {first}.",
            total_s(&gaps),
            first.duration_s()
        ),
    };
    let keys = [
        Key::colour("covered", HELD),
        Key::colour("requested, with margin", ASKED),
        Key::mark("requested but not covered"),
    ];
    let title = format!("Kernels at {}", calendar(stretch.start));
    Ok(figure_html(&title, &svg, &keys, &words, &csv(&rows)))
}

/// Length of all intervals, seconds.
fn total_s(intervals: &[Interval]) -> f64 {
    intervals
        .iter()
        .fold(0.0, |sum, interval| sum + interval.duration_s())
}

fn gaps(row: &Row) -> Vec<Interval> {
    let asked = row.asked.as_slice().iter();
    asked.flat_map(|asked| row.held.gaps_in(*asked)).collect()
}

fn draw<'a>(rows: &[Row], stretch: Interval, area: &Canvas<'a>) -> Drawn<'a> {
    let width = f64::from(WIDTH);
    let at = |instant: Et| {
        let share = instant.since(stretch.start) / stretch.duration_s();
        (share * width).round().clamp(0.0, width) as i32
    };
    let mut top = 0;
    for row in rows {
        let bar = |interval: &Interval, from: i32, to: i32, colour: RGBColor| {
            // A required interval may be shorter than a pixel and must still be visible.
            let (left, right) = (at(interval.start), at(interval.stop));
            let right = right.max(left + 3);
            Rectangle::new([(left, top + from), (right, top + to)], colour.filled())
        };
        draw_text(area, &row.name, (4, top + 14), HPos::Left)?;
        for interval in row.held.as_slice() {
            area.draw(&bar(interval, BAR_TOP, BAR_BOTTOM, COLOURS[HELD]))?;
        }
        for interval in row.asked.as_slice() {
            area.draw(&bar(
                interval,
                BAR_BOTTOM - 8,
                BAR_BOTTOM + 4,
                COLOURS[ASKED],
            ))?;
        }
        for interval in gaps(row).iter().filter(|_| row.sum) {
            area.draw(&bar(interval, BAR_TOP - 4, BAR_BOTTOM + 4, MARK))?;
        }
        top += i32::try_from(ROW).unwrap_or(i32::MAX);
    }
    let right = i32::try_from(WIDTH).unwrap_or(i32::MAX) - 4;
    area.draw(&PathElement::new(
        vec![(0, top + 4), (right, top + 4)],
        INK.stroke_width(2),
    ))?;
    draw_text(area, "0 s", (4, top + 28), HPos::Left)?;
    let end = format!("{:.1} s", stretch.duration_s());
    draw_text(area, &end, (right, top + 28), HPos::Right)
}

fn csv(rows: &[Row]) -> String {
    let mut csv = "kernel,what,start_et_s,stop_et_s\n".to_owned();
    for row in rows {
        for (what, intervals) in [("held", &row.held), ("asked", &row.asked)] {
            for interval in intervals.as_slice() {
                let (start, stop) = (interval.start.seconds(), interval.stop.seconds());
                csv += &format!("{},{what},{start},{stop}\n", quoted(&row.name));
            }
        }
    }
    csv
}

fn table(site: &SiteProducts) -> Markup {
    let names = site.spacecraft_of_kernels().into_iter();
    let names: Vec<&str> = names.map(|spacecraft| &*spacecraft.name).collect();
    let [positions, attitudes] = site.required.of_all();
    let mut table = Table::new(
        &format!("Kernels with data of {}", names.join(" and ")),
        &[
            Column::Text("kernel"),
            Column::Text("role"),
            Column::Text("from (TDB)"),
            Column::Text("to (TDB)"),
            Column::Number("intervals"),
            Column::Number("coverage of span, %"),
            Column::Number("requested duration, s"),
        ],
    );
    for kernel in site
        .kernels
        .iter()
        .filter(|kernel| !held(kernel).is_empty())
    {
        let intervals = held(kernel);
        let span = Interval::new(intervals[0].start, intervals[intervals.len() - 1].stop);
        let held_s = total_s(intervals);
        let asked = match &*kernel.role {
            "CK" => &attitudes,
            _ => &positions,
        };
        let used = Intervals::union_of(intervals.iter().copied()).intersection(asked);
        let used_s = total_s(used.as_slice());
        table.row(
            true,
            [
                (&kernel.name).into(),
                (&kernel.role).into(),
                calendar(span.start).into(),
                calendar(span.stop).into(),
                intervals.len().to_string().into(),
                held_share(held_s, span).into(),
                format!("{used_s:.1}").into(),
            ],
        );
    }
    table.finish()
}

/// Share of a kernel's span that it covers, per cent; a kernel of one instant has no span.
fn held_share(held_s: f64, span: Interval) -> String {
    if span.duration_s() > 0.0 {
        format!("{:.2}", 100.0 * held_s / span.duration_s())
    } else {
        "–".to_owned()
    }
}

/// Calendar form of ephemeris time (TDB, about a minute ahead of UTC in these years).
pub(super) fn calendar(et: Et) -> String {
    let j2000 = DateTime::from_timestamp(946_728_000, 0).unwrap_or_default();
    let since = TimeDelta::try_milliseconds((et.seconds() * 1e3).round() as i64);
    since
        .and_then(|since| j2000.checked_add_signed(since))
        .map_or_else(
            || et.to_string(),
            |date| date.format("%Y-%m-%d %H:%M:%S TDB").to_string(),
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ephemeris_time_has_a_calendar() {
        assert_eq!(calendar(Et::from_seconds(0.0)), "2000-01-01 12:00:00 TDB");
        let early = Et::from_seconds(-86_400.0 * 365.0);
        assert_eq!(calendar(early), "1999-01-01 12:00:00 TDB");
    }

    #[test]
    fn gaps_in_the_sum_are_found() {
        let interval =
            |start: f64, stop: f64| Interval::new(Et::from_seconds(start), Et::from_seconds(stop));
        let row = Row {
            name: String::new(),
            held: Intervals::union_of([interval(0.0, 4.0), interval(6.0, 9.0)]),
            asked: Intervals::union_of([interval(3.0, 7.0)]),
            sum: true,
        };
        assert_eq!(gaps(&row), [interval(4.0, 6.0)]);
    }
}
