//! The page of calibrations of one camera in several orbits.

use super::{
    html::{
        Cell, Column, Markup, Section, Table, Tone, counted, html, list, page, paragraph, verdict,
    },
    numbers::signed,
    plots::{Panel, Plot, Series as Drawn, figure, label},
    timeline::calendar,
};
use areograph_base::{error::Result, time::Et, units::SECONDS_PER_DAY};
use areograph_geom::calibration::{
    Agreement, Drift, Estimate, Lines, LookParameter, ONE_SIGMAS, OrbitChange, RELEVANT_PX, Series,
    TOGETHER_SIGMAS, parameters,
};

/// Largest number of parameters that are drawn.
const DRAWN: usize = 4;
/// Characters of a date without its time.
const DATE: usize = 10;

/// An orbit of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesOrbit {
    /// Its calibration.
    pub calibration: String,
    /// Middle of its images, ET seconds.
    pub et_s: f64,
}

/// Calibrations of several orbits, compared with the calibration in use.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSeries {
    /// The orbits; the first is that of the calibration in use.
    pub orbits: Vec<SeriesOrbit>,
    /// Names of the lines.
    pub lines: Vec<String>,
    /// Tangent of a pixel.
    pub pixel: f64,
    /// The result.
    pub series: Series,
    /// Calibrations that are not used, each with the reason.
    pub not_used: Vec<(String, &'static str)>,
}

impl CalibrationSeries {
    /// A year of 365.25 days, seconds.
    pub const YEAR_S: f64 = 365.25 * SECONDS_PER_DAY;

    /// Whether the camera needs a new calibration: its last orbit, or the drift until then, departs from the calibration in use.
    #[must_use]
    pub fn recalibrate(&self) -> bool {
        let last = self.series.orbits[self.last()].agreement;
        last == Agreement::Recalibrate || self.drifted().next().is_some()
    }

    /// The last orbit in time.
    fn last(&self) -> usize {
        let orbits = 0..self.orbits.len();
        orbits
            .max_by(|a, b| self.orbits[*a].et_s.total_cmp(&self.orbits[*b].et_s))
            .unwrap_or_default()
    }

    /// Drifts that have reached the limit before the last orbit, with the index of their parameter.
    fn drifted(&self) -> impl Iterator<Item = (usize, &Drift)> {
        let limit = RELEVANT_PX * self.pixel;
        let drifts = self.series.drifts.iter().enumerate();
        drifts.filter(move |(_, drift)| {
            drift.relevant_after_s.is_some() && drift.until_last.value.abs() > limit
        })
    }

    /// The result in one sentence.
    #[must_use]
    pub fn headline(&self) -> String {
        let others = self.orbits.len() - 1;
        let count = |agreement| {
            let orbits = self.series.orbits[1..].iter();
            orbits.filter(|of| of.agreement == agreement).count()
        };
        let advice = if self.recalibrate() {
            "recalibrate"
        } else if count(Agreement::Agrees) == others {
            "the calibration applies to all of them"
        } else if count(Agreement::Recalibrate) == 0 {
            "significant changes are smaller than the limit"
        } else {
            "it does not apply to some of them, and applies to the last one"
        };
        format!(
            "{} and {}: {advice}.",
            self.orbits[0].calibration,
            counted(others, "other orbit"),
        )
    }

    /// The findings behind it, one sentence each.
    #[must_use]
    pub fn findings(&self) -> Vec<String> {
        let names = parameters(self.lines.len());
        let mut findings = Vec::new();
        for (orbit, change) in self.orbits.iter().zip(&self.series.orbits).skip(1) {
            if change.agreement == Agreement::Agrees {
                continue;
            }
            let (index, largest) = self.largest(change);
            let size = match change.agreement {
                Agreement::Recalibrate => {
                    format!("{}, more than {RELEVANT_PX} px", self.px(largest))
                }
                _ if largest.sigmas().abs() > ONE_SIGMAS => {
                    format!("{}, at most {RELEVANT_PX} px", self.px(largest))
                }
                _ => format!(
                    "all parameters together differ by {} standard deviations; the largest change is {}",
                    label(change.together_sigmas, 1),
                    self.px(largest)
                ),
            };
            findings.push(format!(
                "{} ({}): {}: {size}",
                orbit.calibration,
                date(orbit.et_s),
                self.name(names[index])
            ));
        }
        for (index, drift) in self.series.drifts.iter().enumerate() {
            let Some(after_s) = drift.relevant_after_s else {
                continue;
            };
            findings.push(format!(
                "drift of {}: {} per year; reaches {RELEVANT_PX} px on {}",
                self.name(names[index]),
                self.px(per_year(drift.rate)),
                date(self.orbits[0].et_s + after_s)
            ));
        }
        findings
    }

    /// The parameter with the largest significant change above the limit, or else with the most standard deviations.
    fn largest(&self, change: &OrbitChange) -> (usize, Estimate) {
        let limit = RELEVANT_PX * self.pixel;
        let rank = |of: &Estimate| {
            let is_relevant = of.sigmas().abs() > ONE_SIGMAS && of.value.abs() > limit;
            (is_relevant, of.sigmas().abs())
        };
        let all = change.changes.iter().copied().enumerate();
        let largest = all.max_by(|(_, a), (_, b)| {
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        largest.unwrap_or((
            0,
            Estimate {
                value: 0.0,
                sigma: 1.0,
            },
        ))
    }

    fn px(&self, of: Estimate) -> String {
        format!(
            "{} ± {} px",
            signed(of.value / self.pixel, 3),
            label(of.sigma / self.pixel, 3)
        )
    }

    fn name(&self, (lines, parameter): (Lines, LookParameter)) -> String {
        match lines {
            Lines::Common => format!("common {}", parameter.word()),
            Lines::Relative(line) => format!(
                "{} of {} relative to {}",
                parameter.word(),
                self.lines[line],
                self.lines[0]
            ),
        }
    }
}

fn per_year(rate: Estimate) -> Estimate {
    Estimate {
        value: rate.value * CalibrationSeries::YEAR_S,
        sigma: rate.sigma * CalibrationSeries::YEAR_S,
    }
}

fn date(et_s: f64) -> String {
    let calendar = calendar(Et::from_seconds(et_s));
    calendar.chars().take(DATE).collect()
}

/// A series as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn calibration_series_page(of: &CalibrationSeries) -> Result<String> {
    let all_agree = (of.series.orbits.iter()).all(|of| of.agreement == Agreement::Agrees);
    let tone = Tone::of(!of.recalibrate(), !all_agree).0;
    let scatter = of.series.scatter.map_or_else(
        || "Fewer than five orbits do not show whether the standard deviations of the calibrations are too small.".to_owned(),
        |scatter| {
            format!(
                "Standard deviations from measurement are multiplied by {}, the observed over the expected scatter of the \
                 calibrations about a drift (at least 1).",
                label(scatter, 2)
            )
        },
    );
    let words = format!(
        "A change is significant above {ONE_SIGMAS} standard deviations, or if all changes together exceed \
         {TOGETHER_SIGMAS} standard deviations of a normal distribution; a significant change of more than {RELEVANT_PX} px requires a new \
         calibration. {scatter}"
    );
    let not_used = of.not_used.iter();
    let not_used: Vec<String> = not_used
        .map(|(what, reason)| format!("Not used: {what}: {reason}."))
        .collect();
    let body = html! { (list(&of.findings())) p { (words) } (list(&not_used)) };
    let lead = verdict(tone, &of.headline(), &body);
    let mut sections = vec![
        Section::new("Orbits", orbits(of)),
        Section::new("Parameters", figures(of)?),
    ];
    if !of.series.drifts.is_empty() {
        sections.push(Section::new("Drift", drifts(of)));
    }
    Ok(page("Calibrations of several orbits", &lead, &sections))
}

fn orbits(of: &CalibrationSeries) -> Markup {
    let names = parameters(of.lines.len());
    let mut table = Table::new(
        "Change from the calibration in use: parameter with the largest change, and all parameters together",
        &[
            Column::Text("calibration"),
            Column::Text("date"),
            Column::Text("parameter"),
            Column::Number("change, px"),
            Column::Number("σ, px"),
            Column::Number("all together, σ"),
            Column::Text("decision"),
        ],
    );
    for (index, (orbit, change)) in of.orbits.iter().zip(&of.series.orbits).enumerate() {
        let mut cells: Vec<Cell> = vec![(&orbit.calibration).into(), date(orbit.et_s).into()];
        if index == 0 {
            cells.extend(["", "", "", "", "in use"].map(Cell::from));
        } else {
            let (largest, estimate) = of.largest(change);
            let decision = match change.agreement {
                Agreement::Agrees => "agrees",
                Agreement::Changed => "changed, parameter uncertain",
                Agreement::Recalibrate => "recalibrate",
            };
            cells.extend([
                of.name(names[largest]).into(),
                signed(estimate.value / of.pixel, 3).into(),
                label(estimate.sigma / of.pixel, 3).into(),
                signed(change.together_sigmas, 1).into(),
                decision.into(),
            ]);
        }
        table.row(change.agreement != Agreement::Recalibrate, cells);
    }
    let words = paragraph(
        "A calibration contains the mean error of its orbit. Its a priori standard deviations are part of the standard deviations here: \
         common parts of all lines are known only to the accuracy of the orbits, differences between lines far better.",
    );
    html! { (words) (table.finish()) }
}

/// The parameters with the smallest standard deviations of their changes, over time.
fn figures(of: &CalibrationSeries) -> Result<Markup> {
    let names = parameters(of.lines.len());
    let sigma = |index: usize| {
        let changes = of.series.orbits[1..].iter();
        changes
            .map(|of| of.changes[index].sigma)
            .fold(0.0, f64::max)
    };
    // Bends are determined by their a priori values, and show little of a change.
    let tied = |index: &usize| {
        let (lines, parameter) = names[*index];
        lines != Lines::Common
            && !matches!(
                parameter,
                LookParameter::BendAcross | LookParameter::BendAlong
            )
    };
    let mut shown: Vec<usize> = (0..names.len()).filter(tied).collect();
    shown.sort_by(|a, b| sigma(*a).total_cmp(&sigma(*b)));
    let mut plots = Vec::new();
    for index in shown.into_iter().take(DRAWN) {
        plots.push(figure(&over_time(of, index, &of.name(names[index])))?);
    }
    let words = paragraph(
        "Roll and pitch are changes of the look direction in the middle of the image, yaw and scale at its edge, in pixels. Shown are the \
         differences between lines with the smallest standard deviations; `areograph calibrate series --json` states all parameters.",
    );
    Ok(html! { (words) div.plots { @for plot in &plots { (plot) } } })
}

fn over_time(of: &CalibrationSeries, index: usize, name: &str) -> Plot {
    let year = |et_s: f64| (et_s - of.orbits[0].et_s) / CalibrationSeries::YEAR_S;
    let changes: Vec<(f64, Estimate)> = (of.orbits.iter().zip(&of.series.orbits))
        .map(|(orbit, change)| (year(orbit.et_s), change.changes[index]))
        .collect();
    let dots = changes.iter().map(|(x, of_x)| (*x, of_x.value / of.pixel));
    let mut series = vec![Drawn::dots(
        "change from the calibration in use",
        0,
        dots.collect(),
    )];
    for (x, change) in &changes[1..] {
        let ends = [-1.0, 1.0].map(|sense| (*x, (change.value + sense * change.sigma) / of.pixel));
        series.push(Drawn::line("± σ", 0, ends.to_vec()));
    }
    if let Some(drift) = of.series.drifts.get(index) {
        let xs = changes.iter().map(|(x, _)| *x);
        let ends = [
            xs.clone().fold(f64::INFINITY, f64::min),
            xs.fold(f64::NEG_INFINITY, f64::max),
        ];
        let rate = drift.rate.value * CalibrationSeries::YEAR_S / of.pixel;
        series.push(Drawn::line(
            "drift",
            1,
            ends.map(|x| (x, rate * x)).to_vec(),
        ));
    }
    let mut panel = Panel::of("change, px", series);
    panel.limits = vec![-RELEVANT_PX, RELEVANT_PX];
    panel.y = panel.y.with([-RELEVANT_PX, RELEVANT_PX].into_iter());
    let mut title = name.to_owned();
    if let Some(first) = title.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    Plot::of(
        title,
        format!("{name}, with standard deviations. Level lines: ±{RELEVANT_PX} px."),
        "years after the calibration in use",
        vec![panel],
    )
}

fn drifts(of: &CalibrationSeries) -> Markup {
    let names = parameters(of.lines.len());
    let mut table = Table::new(
        "Drift of all parameters",
        &[
            Column::Text("parameter"),
            Column::Number("drift, px per year"),
            Column::Number("σ, px per year"),
            Column::Text("reaches the limit on"),
        ],
    );
    for (index, drift) in of.series.drifts.iter().enumerate() {
        let rate = per_year(drift.rate);
        let reached = drift
            .relevant_after_s
            .map_or_else(String::new, |after_s| date(of.orbits[0].et_s + after_s));
        table.row(
            true,
            [
                Cell::from(of.name(names[index])),
                signed(rate.value / of.pixel, 3).into(),
                label(rate.sigma / of.pixel, 3).into(),
                reached.into(),
            ],
        );
    }
    let words = paragraph(
        "Weighted regression on time. A date is stated for a drift of more than 4.5 standard deviations.",
    );
    html! { (words) (table.finish()) }
}
