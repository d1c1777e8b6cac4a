//! The page of causes of the along-track disagreement, compared over many pairs.

use super::{
    html::{Cell, Column, Markup, Section, Table, Tone, html, list, page, paragraph, verdict},
    numbers::signed,
    plots::{Panel, Plot, Series, figure, label},
};
use areograph_base::{
    error::Result,
    units::{RADIANS_PER_ARCSECOND, SECONDS_PER_MS},
};
use areograph_geom::readings::{
    Cause, CausesCompared, DECISIVE_ODDS, PairDisagreement, ReadingSigmas,
};

/// A pair of a site.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadPair {
    /// The site.
    pub site: String,
    /// The disagreement of its images.
    pub disagreement: PairDisagreement,
}

/// Causes of the along-track disagreement, compared over the pairs of several sites.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// The pairs, in the order of their sites, each once.
    pub pairs: Vec<ReadPair>,
    /// Pairs and sites that are not used, each with the reason.
    pub not_used: Vec<(String, &'static str)>,
    /// A priori standard deviations.
    pub sigmas: ReadingSigmas,
    /// The result.
    pub compared: CausesCompared,
}

impl Readings {
    /// The result in one sentence.
    #[must_use]
    pub fn headline(&self) -> String {
        let (of, decides) = match self.pairs.len() {
            1 => ("One pair of images".to_owned(), "does not decide"),
            count => (format!("{count} pairs of images"), "do not decide"),
        };
        match self.compared.supported() {
            Some(Cause::AttitudeClock) => {
                format!("{of}: one offset of the attitude clock, {}.", self.clock())
            }
            Some(Cause::SingleImages) => format!(
                "{of}: independent errors of single images; one offset of the attitude clock does not explain them."
            ),
            None => format!(
                "{of} {decides} between errors of single images and one offset of the attitude clock."
            ),
        }
    }

    /// The odds of the causes, and what a decision requires, one sentence each.
    #[must_use]
    pub fn odds(&self) -> Vec<String> {
        let of = |cause: &str, log_odds: f64, others: &str| {
            let comparison = if log_odds >= 0.0 { "more" } else { "less" };
            format!(
                "{cause} is {comparison} probable than {others}, by a factor of {}.",
                odds(log_odds.abs())
            )
        };
        let mut sentences = vec![
            of(
                "One offset of the attitude clock",
                self.compared.log_odds_of_clock(),
                "errors of single images alone",
            ),
            of(
                "The hypothesis of large errors of single images",
                self.compared.log_odds_of_images(),
                "that of small ones, with or without an offset",
            ),
        ];
        if self.compared.are_both() {
            sentences.push("Both causes together are more probable than either alone.".to_owned());
        }
        sentences.push(format!(
            "A decision requires odds of at least {DECISIVE_ODDS} to 1; both causes together must not be more \
             probable than either alone."
        ));
        sentences
    }

    fn clock(&self) -> String {
        let CausesCompared {
            clock_s,
            clock_sigma_s,
            ..
        } = self.compared;
        format!("{} ± {} s", signed(clock_s, 2), label(clock_sigma_s, 2))
    }
}

/// Odds with two digits, or a power of 10 where these would be many.
fn odds(logarithm: f64) -> String {
    let odds = logarithm.exp();
    if odds < 1e4 {
        label(odds, usize::from(odds < 10.0))
    } else {
        format!(
            "10^{}",
            label((logarithm / std::f64::consts::LN_10).floor(), 0)
        )
    }
}

/// A comparison of causes as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn readings_page(readings: &Readings) -> Result<String> {
    let tone = match readings.compared.supported() {
        Some(_) => Tone::Good,
        None => Tone::Remarks,
    };
    let sigmas = &readings.sigmas;
    let words = format!(
        "A priori standard deviations: {} ms of line time for large errors of single images, {}\u{2033} of rotation \
         for small ones (and 1/√2 and √2 times these values, equally likely), and {} s for the clock offset. Offset \
         of the attitude clock, if it is the cause: {}.",
        label(sigmas.line_time_s / SECONDS_PER_MS, 1),
        label(sigmas.rotation_rad / RADIANS_PER_ARCSECOND, 1),
        label(sigmas.clock_s, 2),
        readings.clock(),
    );
    let not_used = readings.not_used.iter();
    let not_used: Vec<String> = not_used
        .map(|(what, reason)| format!("Not used: {what}: {reason}."))
        .collect();
    let odds = readings.odds().join(" ");
    let body = html! { p { (odds) " " (words) } (list(&not_used)) };
    let lead = verdict(tone, &readings.headline(), &body);
    let sections = [Section::new("Pairs", pairs(readings)?)];
    Ok(page("Cause of along-track disagreements", &lead, &sections))
}

fn pairs(readings: &Readings) -> Result<Markup> {
    let columns = &[
        Column::Text("site"),
        Column::Text("images"),
        Column::Number("apart, m"),
        Column::Number("σ, m"),
        Column::Number("change with the clock, m/s"),
        Column::Number("residual after the clock offset, m"),
    ];
    let mut table = Table::new(
        "Displacement along the track, first minus second image",
        columns,
    );
    let pairs = readings.pairs.iter().zip(&readings.compared.left_m);
    for (pair, left_m) in pairs {
        let (images, of) = (&pair.disagreement.images, &pair.disagreement.along_track);
        let cells: Vec<Cell> = vec![
            pair.site.as_str().into(),
            images.join(", ").into(),
            signed(of.apart_m, 1).into(),
            label(of.sigma_m, 1).into(),
            signed(of.clock_m_s, 0).into(),
            signed(*left_m, 1).into(),
        ];
        table.row(true, cells);
    }
    let dots = readings.pairs.iter();
    let dots = dots.map(|pair| {
        let of = &pair.disagreement.along_track;
        (of.clock_m_s, of.apart_m)
    });
    let dots: Vec<(f64, f64)> = dots.collect();
    let ends = dots.iter().map(|dot| dot.0);
    let (least, most) = ends.fold((0.0_f64, 0.0_f64), |(least, most), x| {
        (least.min(x), most.max(x))
    });
    let expected = [least, most].map(|x| (x, x * readings.compared.clock_s));
    let panel = Panel::of(
        "apart, m",
        vec![
            Series::line("by the estimated offset", 1, expected.to_vec()),
            Series::dots("pairs", 0, dots),
        ],
    );
    let caption = "Displacement between the images of each pair against the change of this displacement with the \
                   attitude clock. One offset places the pairs on a line through 0; independent errors of single \
                   images scatter the pairs about 0.";
    let plot = Plot::of(
        "Displacement and attitude clock".to_owned(),
        caption.to_owned(),
        "change with the attitude clock, m/s",
        vec![panel],
    );
    let words = paragraph(
        "Tie-point positions of the first image minus those of the second, with the orientation from the kernels. \
         Images that follow nadir are displaced by an offset of the attitude clock; inertially held images are not.",
    );
    Ok(html! { (words) (table.finish()) (figure(&plot)?) })
}
