//! The cause of along-track disagreements, as many pairs support it: the file that `areograph compare-readings --toml` prints.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{data_file, printed_file::PrintedFile, problems::Problems};
use areograph_geom::readings::{Cause, DECISIVE_ODDS};

/// The comparison of two causes over many pairs of images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReadingsDecision {
    /// Pairs of images.
    pub pairs: i32,
    /// The supported cause; `None` where the pairs do not decide.
    pub supported: Option<Cause>,
    /// Natural logarithm of the odds of one offset of the attitude clock, and of errors of single images, against other
    /// hypotheses.
    pub log_odds: [f64; 2],
    /// The offset, seconds.
    pub attitude_clock_s: f64,
    /// Its standard deviation, seconds.
    pub attitude_clock_sigma_s: f64,
}

/// Words of the file for a result.
const WORDS: [(&str, Option<Cause>); 3] = [
    ("attitude_clock", Some(Cause::AttitudeClock)),
    ("single_images", Some(Cause::SingleImages)),
    ("undecided", None),
];

impl ReadingsDecision {
    /// Word of the supported cause in files.
    #[must_use]
    pub fn word(&self) -> &'static str {
        let known = WORDS.iter().find(|(_, cause)| *cause == self.supported);
        known.map_or("undecided", |(word, _)| word)
    }

    /// Natural logarithm of the odds of the supported cause, or of the attitude clock.
    #[must_use]
    pub const fn log_odds_of_supported(&self) -> f64 {
        let [of_clock, of_images] = self.log_odds;
        match self.supported {
            Some(Cause::SingleImages) => of_images,
            _ => of_clock,
        }
    }

    /// The file with this content.
    #[must_use]
    pub fn to_toml(&self) -> String {
        format!(
            "# Printed by `areograph compare-readings --toml`, for adjustment.readings of site files.\n\
             supported = \"{}\"\npairs = {}\nlog_odds_of_clock = {:?}\nlog_odds_of_images = {:?}\nattitude_clock_s = {:?}\nattitude_clock_sigma_s = {:?}\n",
            self.word(),
            self.pairs,
            self.log_odds[0],
            self.log_odds[1],
            self.attitude_clock_s,
            self.attitude_clock_sigma_s
        )
    }

    /// Reads the file `text`.
    fn parse(text: &str, file: &Path) -> Result<Self, Problems> {
        data_file::read(text, file, |top, review| {
            let word = top.word(review, "supported", &WORDS);
            let decision = Self {
                pairs: top.whole(review, "pairs", [1, i32::MAX]),
                supported: word.flatten(),
                log_odds: ["log_odds_of_clock", "log_odds_of_images"]
                    .map(|key| top.number(review, key, [-1e9, 1e9])),
                attitude_clock_s: top.number(review, "attitude_clock_s", [-1e6, 1e6]),
                attitude_clock_sigma_s: top.number(review, "attitude_clock_sigma_s", [0.0, 1e6]),
            };
            let is_decisive = decision.log_odds_of_supported() >= DECISIVE_ODDS.ln();
            // Decisive odds may remain undecided, where both causes together are more probable.
            if decision.supported.is_some() && !is_decisive {
                review.problem(
                    None,
                    format!(
                        "supported is \"{}\", which contradicts the odds; expected the file as printed",
                        decision.word()
                    ),
                );
            }
            decision
        })
    }
}

/// The path of such a file.
pub(super) const DECISION_FILE: PrintedFile<ReadingsDecision> = PrintedFile {
    expected: "the path of a file with the output of `areograph compare-readings --toml`",
    usual: "readings.toml",
    parse: ReadingsDecision::parse,
};

#[cfg(test)]
mod tests {
    use super::*;

    const DECISION: ReadingsDecision = ReadingsDecision {
        pairs: 10,
        supported: Some(Cause::AttitudeClock),
        log_odds: [17.25, -20.5],
        attitude_clock_s: -0.7125,
        attitude_clock_sigma_s: 0.05,
    };

    #[test]
    fn a_printed_file_is_read_as_it_was() {
        let text = DECISION.to_toml();
        assert!(text.contains("supported = \"attitude_clock\""), "{text}");
        assert_eq!(
            ReadingsDecision::parse(&text, Path::new("r.toml")),
            Ok(DECISION)
        );
    }

    #[test]
    fn an_altered_file_is_refused() {
        for (from, to, expected) in [
            (
                "attitude_clock\"",
                "single_images\"",
                "supported is \"single_images\", which contradicts the odds",
            ),
            ("17.25", "1.25", "which contradicts the odds"),
            ("pairs = 10", "pairs = 0", "pairs is 0"),
            ("supported", "suported", "suported is an unknown key"),
            (
                "log_odds_of_clock = 17.25\n",
                "",
                "log_odds_of_clock is missing",
            ),
        ] {
            let text = DECISION.to_toml().replace(from, to);
            let refused = ReadingsDecision::parse(&text, Path::new("r.toml")).unwrap_err();
            assert!(refused.to_string().contains(expected), "{refused}");
        }
    }
}
