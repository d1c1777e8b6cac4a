//! One printed statement of a paper, what areograph makes of it, and the verdict that follows.

use std::fmt::Write as _;

/// A paper and its statements.
pub(crate) struct Paper {
    /// Authors and year.
    pub(crate) name: &'static str,
    /// What it is about, and where it stands.
    pub(crate) citation: &'static str,
    /// Letters before the numbers of its rows.
    pub(crate) prefix: &'static str,
    /// How many rows it has; numbers run from 1 without a gap.
    pub(crate) count: usize,
    /// The rows in their order, in lists.
    pub(crate) rows: &'static [&'static [Row]],
}

/// What a paper prints in one place.
pub(crate) struct Row {
    /// Identifier: the paper's prefix and a number.
    pub(crate) id: &'static str,
    /// What stands beside the print.
    pub(crate) kind: Kind,
    /// Section or table of the paper.
    pub(crate) place: &'static str,
    /// What is printed there.
    pub(crate) what: &'static str,
    /// What comes of it.
    pub(crate) account: Account,
    /// Remarks for the reader: interpretation of a number, reason for a difference, missing data.
    pub(crate) note: &'static str,
}

/// Words for a number that requires data of the papers.
pub(crate) const NEEDS_DATA: &str = "needs data";

/// What a published value is compared with, and hence the significance of an agreement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Independent data.
    Evidence,
    /// The paper's own numbers.
    Arithmetic,
    /// Generally known values.
    Constants,
    /// areograph itself.
    ClosedLoop,
}

impl Kind {
    /// Every kind, the strongest first.
    pub(crate) const ALL: [Self; 4] = [
        Self::Evidence,
        Self::Arithmetic,
        Self::Constants,
        Self::ClosedLoop,
    ];

    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Evidence => "evidence",
            Self::Arithmetic => "arithmetic",
            Self::Constants => "constants",
            Self::ClosedLoop => "closed loop",
        }
    }

    pub(crate) const fn meaning(self) -> &'static str {
        match self {
            Self::Evidence => {
                "the published value is compared with independent data: real shots, or results of code without access \
                 to the published value, on orbits from first principles"
            }
            Self::Arithmetic => {
                "a formula applied to the paper's own numbers, which tests the paper"
            }
            Self::Constants => {
                "values of instruments and of Mars that are known independently, and values prescribed by the method"
            }
            Self::ClosedLoop => {
                "areograph against itself or its own synthetic mission, which was built with the paper's values"
            }
        }
    }

    /// The word for agreement.
    pub(crate) const fn agrees(self) -> &'static str {
        match self {
            Self::Evidence => "met",
            Self::Arithmetic => "reproduced",
            Self::Constants => "consistent",
            Self::ClosedLoop => "recovered",
        }
    }

    const fn agrees_in_part(self) -> &'static str {
        match self {
            Self::Evidence => "met in part",
            Self::Arithmetic => "reproduced in part",
            Self::Constants => "consistent in part",
            Self::ClosedLoop => "recovered in part",
        }
    }
}

/// What becomes of a row.
pub(crate) enum Account {
    /// Ours lies within the tolerance of what is printed.
    Agrees {
        /// What ours is computed from.
        from: &'static str,
        /// Printed and ours.
        ours: fn() -> Vec<Comparison>,
    },
    /// The same for a part of the row; the rest departs, or requires data or code that are not available.
    InPart {
        /// What ours is computed from.
        from: &'static str,
        /// Printed and ours.
        ours: fn() -> Vec<Comparison>,
    },
    /// Not met, or contradictory in print, for a reason that the note gives.
    Explained {
        /// What ours is computed from.
        from: &'static str,
        /// Printed and ours; at least one departs.
        ours: fn() -> Vec<Comparison>,
    },
    /// A given of the method.
    Input {
        /// Where ours is taken from.
        from: &'static str,
        /// Printed and ours.
        ours: fn() -> Vec<Comparison>,
        /// File and function of the test that it is used: `tests/commands/mission.rs::orientation_comes_back`.
        test: &'static str,
    },
    /// Needs data that nobody here has.
    Data {
        /// As the paper has it.
        printed: &'static str,
    },
    /// The paper quotes somebody else.
    Cited {
        /// As the paper has it.
        printed: &'static str,
    },
    /// What would compute it does not exist yet.
    NotYetComputed {
        /// As the paper has it.
        printed: &'static str,
    },
}

/// What a reader takes from a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    Agrees,
    InPart,
    Explained,
    NeedsData,
    Quoted,
    NotYetComputed,
}

impl Verdict {
    /// Columns of the counts: agreement, agreement in part, explained, and rows without a number of ours.
    pub(crate) const fn column(self) -> usize {
        match self {
            Self::Agrees => 0,
            Self::InPart => 1,
            Self::Explained => 2,
            Self::NeedsData | Self::Quoted | Self::NotYetComputed => 3,
        }
    }

    /// As the page says it of a row of this kind.
    pub(crate) const fn words(self, kind: Kind) -> &'static str {
        match self {
            Self::Agrees => kind.agrees(),
            Self::InPart => kind.agrees_in_part(),
            Self::Explained => "explained",
            Self::NeedsData => NEEDS_DATA,
            Self::Quoted => "quoted",
            Self::NotYetComputed => "not yet computed",
        }
    }
}

impl Account {
    /// What ours is computed from, and the test that it is used.
    pub(crate) fn inputs(&self) -> String {
        match self {
            Self::Agrees { from, .. }
            | Self::InPart { from, .. }
            | Self::Explained { from, .. } => (*from).to_owned(),
            Self::Input { from, test, .. } => format!("{from}; tested by {test}"),
            Self::Data { .. } | Self::Cited { .. } | Self::NotYetComputed { .. } => String::new(),
        }
    }

    /// Printed and ours.
    pub(crate) fn comparisons(&self) -> Vec<Comparison> {
        match self {
            Self::Agrees { ours, .. }
            | Self::InPart { ours, .. }
            | Self::Explained { ours, .. }
            | Self::Input { ours, .. } => ours(),
            Self::Data { printed } | Self::Cited { printed } | Self::NotYetComputed { printed } => {
                vec![Comparison {
                    of: String::new(),
                    printed: (*printed).to_owned(),
                    is_derived: false,
                    ours: String::new(),
                    tolerance: String::new(),
                    agreement: Agreement::Shown,
                }]
            }
        }
    }
}

/// How ours stands to what is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Agreement {
    /// Within the tolerance.
    Within,
    /// Ours departs from the print, as the row says.
    Departs,
    /// Side by side, without a claim.
    Shown,
    /// The row claims something that is not so.
    Broken,
}

/// A printed number or word, and ours.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// Which of the row's numbers; may be empty where there is but one.
    pub(crate) of: String,
    pub(crate) printed: String,
    /// Whether the paper does not print this number: it follows from prints, is of another paper, or is absent.
    pub(crate) is_derived: bool,
    pub(crate) ours: String,
    pub(crate) tolerance: String,
    pub(crate) agreement: Agreement,
}

/// A number whose claim is still to be made.
pub(crate) struct Number {
    of: String,
    printed: String,
    is_derived: bool,
    ours: f64,
    decimals: usize,
}

/// Printed `printed`, ours `ours`, shown with `decimals`.
pub(crate) fn number(
    of: impl Into<String>,
    printed: impl Into<String>,
    ours: f64,
    decimals: usize,
) -> Number {
    Number {
        of: of.into(),
        printed: printed.into(),
        is_derived: false,
        ours,
        decimals,
    }
}

/// The same where `value` follows from prints, or is printed in another paper.
pub(crate) fn derived(
    of: impl Into<String>,
    value: impl Into<String>,
    ours: f64,
    decimals: usize,
) -> Number {
    Number {
        is_derived: true,
        ..number(of, value, ours, decimals)
    }
}

/// `ours` without a minus before zeros.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(zeros) if zeros.chars().all(|digit| "0.".contains(digit)) => zeros.to_owned(),
        _ => text,
    }
}

impl Number {
    /// What the paper prints; NaN, which agrees with nothing, where it prints no number.
    fn value(&self) -> f64 {
        self.printed.replace('−', "-").parse().unwrap_or(f64::NAN)
    }

    fn finish(self, tolerance: String, agreement: Agreement) -> Comparison {
        Comparison {
            ours: fixed(self.ours, self.decimals),
            printed: self.printed,
            is_derived: self.is_derived,
            of: self.of,
            tolerance,
            agreement,
        }
    }

    fn claim(self, tolerance: String, holds: bool) -> Comparison {
        let agreement = if holds {
            Agreement::Within
        } else {
            Agreement::Broken
        };
        self.finish(tolerance, agreement)
    }

    /// Not farther than `tolerance` from the print.
    pub(crate) fn within(self, tolerance: f64) -> Comparison {
        let holds = (self.ours - self.value()).abs() <= tolerance;
        self.claim(format!("±{tolerance}"), holds)
    }

    /// Not farther than `share` of the print.
    pub(crate) fn share(self, share: f64) -> Comparison {
        let holds = (self.ours / self.value() - 1.0).abs() <= share;
        let percent = fixed(100.0 * share, 1);
        self.claim(format!("±{} %", percent.trim_end_matches(".0")), holds)
    }

    /// The print up to rounding of the computer.
    pub(crate) fn exact(self) -> Comparison {
        let holds = (self.ours - self.value()).abs() <= 1e-9 * self.value().abs();
        self.claim("exact".to_owned(), holds)
    }

    /// Where the paper gives a range, or says "about".
    pub(crate) fn between(self, low: f64, high: f64) -> Comparison {
        let holds = (low..=high).contains(&self.ours);
        self.claim(format!("{low} to {high}"), holds)
    }

    /// Not above `most`, where the paper says "below" or "at most".
    pub(crate) fn at_most(self, most: f64) -> Comparison {
        let holds = self.ours <= most;
        self.claim(format!("at most {most}"), holds)
    }

    /// Not below `least`.
    pub(crate) fn at_least(self, least: f64) -> Comparison {
        let holds = self.ours >= least;
        self.claim(format!("at least {least}"), holds)
    }

    fn departing(self, holds: bool) -> Comparison {
        let agreement = if holds {
            Agreement::Departs
        } else {
            Agreement::Broken
        };
        self.finish("departs".to_owned(), agreement)
    }

    /// Ours departs from the print by more than `least`.
    pub(crate) fn departs(self, least: f64) -> Comparison {
        let holds = (self.ours - self.value()).abs() > least;
        self.departing(holds)
    }

    /// Ours, an upper limit, is above the print by more than `least`.
    pub(crate) fn exceeds(self, least: f64) -> Comparison {
        let holds = self.ours - self.value() > least;
        self.departing(holds)
    }

    /// Side by side, without a claim.
    pub(crate) fn shown(self) -> Comparison {
        self.finish(String::new(), Agreement::Shown)
    }
}

/// Words of the paper and of areograph, which must be the same.
pub(crate) fn words(of: &str, printed: &str, ours: &str) -> Comparison {
    Comparison {
        of: of.to_owned(),
        printed: printed.to_owned(),
        is_derived: false,
        ours: ours.to_owned(),
        tolerance: "same".to_owned(),
        agreement: if printed == ours {
            Agreement::Within
        } else {
            Agreement::Broken
        },
    }
}

/// What is printed and cannot be computed beside numbers that can.
pub(crate) fn beyond_reach(of: impl Into<String>, printed: impl Into<String>) -> Comparison {
    Comparison {
        of: of.into(),
        printed: printed.into(),
        is_derived: false,
        ours: NEEDS_DATA.to_owned(),
        tolerance: String::new(),
        agreement: Agreement::Shown,
    }
}

/// A row with its numbers.
pub(crate) struct Outcome {
    pub(crate) row: &'static Row,
    pub(crate) comparisons: Vec<Comparison>,
}

impl Outcome {
    pub(crate) fn of(row: &'static Row) -> Self {
        Self {
            row,
            comparisons: row.account.comparisons(),
        }
    }

    fn has(&self, agreement: Agreement) -> bool {
        let mut all = self.comparisons.iter();
        all.any(|comparison| comparison.agreement == agreement)
    }

    pub(crate) fn verdict(&self) -> Verdict {
        match self.row.account {
            Account::Input { .. } if self.has(Agreement::Departs) => Verdict::InPart,
            Account::Agrees { .. } | Account::Input { .. } => Verdict::Agrees,
            Account::InPart { .. } => Verdict::InPart,
            Account::Explained { .. } => Verdict::Explained,
            Account::Data { .. } => Verdict::NeedsData,
            Account::Cited { .. } => Verdict::Quoted,
            Account::NotYetComputed { .. } => Verdict::NotYetComputed,
        }
    }

    /// As the page says it.
    pub(crate) fn words(&self) -> &'static str {
        self.verdict().words(self.row.kind)
    }

    /// Why the row does not come out as declared; empty where it does.
    pub(crate) fn complaint(&self) -> String {
        let mut complaint = String::new();
        for comparison in &self.comparisons {
            if comparison.agreement == Agreement::Broken {
                let Comparison {
                    of,
                    printed,
                    ours,
                    tolerance,
                    ..
                } = comparison;
                writeln!(
                    complaint,
                    "{} {of}: printed {printed}, ours {ours}, claimed {tolerance}",
                    self.row.id
                )
                .unwrap();
            }
        }
        let (within, departs) = (self.has(Agreement::Within), self.has(Agreement::Departs));
        let claims = match self.row.account {
            Account::Agrees { .. } => within && !departs,
            // What the program uses otherwise is explained in the note.
            Account::Input { .. } => within && (!departs || !self.row.note.is_empty()),
            // Something must be left out: by departing, or for want of data, as the note says.
            Account::InPart { .. } => within && (departs || self.has(Agreement::Shown)),
            Account::Explained { .. } => departs && !self.row.note.is_empty(),
            Account::Data { .. } | Account::Cited { .. } | Account::NotYetComputed { .. } => true,
        };
        if !claims {
            writeln!(
                complaint,
                "{}: its numbers do not make it \"{}\"",
                self.row.id,
                self.words()
            )
            .unwrap();
        }
        complaint
    }
}
