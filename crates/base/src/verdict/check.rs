//! One check of a site: the value, the limit and the outcome.

use std::{borrow::Cow, fmt};

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kind::CheckKind;
use crate::terms::Terms;

/// Maximum number of decimals.
const DECIMALS_MAX: usize = 9;
/// Limits are written with three significant digits.
const LIMIT_ACCURACY: f64 = 5e-4;

/// Outcome of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum CheckOutcome {
    /// Beyond a limit: the site is invalid.
    Fail,
    /// A remark for the reader.
    Warning,
    /// Within the limit.
    Pass,
}

/// A check of a site; if several profiles, images or pairs are checked, the one that uses the largest share of the
/// limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct Check {
    /// The checked quantity.
    pub kind: CheckKind,
    /// Name of the quantity in the terms of the site.
    #[serde(default)]
    pub what: String,
    /// The outcome.
    pub outcome: CheckOutcome,
    /// The profile, image or pair; empty for the whole site.
    pub subject: String,
    /// Value in `unit`; absent if not finite.
    #[serde(default, skip_serializing_if = "crate::stored::is_left_out")]
    pub value: Option<f64>,
    /// Largest permitted magnitude; for checks with a lower limit, the smallest permitted value.
    #[serde(default, skip_serializing_if = "crate::stored::is_left_out")]
    pub limit: Option<f64>,
    /// Unit of `value` and `limit`.
    pub unit: String,
}

impl Check {
    /// A check of `value` against `limit` with the outcome `broken` if it is exceeded. A value that is not finite
    /// exceeds every limit.
    #[must_use]
    pub fn new(
        kind: CheckKind,
        subject: impl Into<String>,
        value: f64,
        limit: f64,
        broken: CheckOutcome,
    ) -> Self {
        let kept = if kind.at_least() {
            value >= limit
        } else {
            value.abs() <= limit
        };
        Self {
            kind,
            what: Terms::MARS.fill(kind.words()).into_owned(),
            outcome: if kept { CheckOutcome::Pass } else { broken },
            subject: subject.into(),
            value: Some(value).filter(|value| value.is_finite()),
            limit: Some(limit).filter(|limit| limit.is_finite()),
            unit: kind.unit().to_owned(),
        }
    }

    /// A check of shares, which pages show in percent. They are compared unrounded: 29 % are not 28.999 999 999 999
    /// 996.
    #[must_use]
    pub fn of_share(
        kind: CheckKind,
        subject: impl Into<String>,
        share: f64,
        limit: f64,
        broken: CheckOutcome,
    ) -> Self {
        let check = Self::new(kind, subject, share, limit, broken);
        Self {
            value: check.value.map(|share| 100.0 * share),
            limit: check.limit.map(|share| 100.0 * share),
            ..check
        }
    }

    /// A check without a number.
    #[must_use]
    pub fn without_number(
        kind: CheckKind,
        subject: impl Into<String>,
        outcome: CheckOutcome,
    ) -> Self {
        Self {
            kind,
            what: Terms::MARS.fill(kind.words()).into_owned(),
            outcome,
            subject: subject.into(),
            value: None,
            limit: None,
            unit: kind.unit().to_owned(),
        }
    }

    /// Names the check in the terms of a site.
    pub fn name_in(&mut self, terms: &Terms<'_>) {
        self.what = terms.fill(self.kind.words()).into_owned();
    }

    /// Name of the check; manifests of earlier versions contain only its kind.
    #[must_use]
    pub fn words(&self) -> Cow<'_, str> {
        if self.what.is_empty() {
            Terms::MARS.fill(self.kind.words())
        } else {
            Cow::Borrowed(&self.what)
        }
    }

    /// Decimals of value and limit: enough for the limit, and enough to distinguish a value beyond it.
    #[must_use]
    pub fn decimals(&self) -> [usize; 2] {
        if self.unit.is_empty() {
            return [0, 0];
        }
        let value = self.value.map_or(0.0, f64::abs);
        let least = self.kind.least_decimals(value < 1.0);
        let Some(limit) = self.limit else {
            return [least, least];
        };
        let written = |number: f64, decimals: usize| format!("{number:.decimals$}").parse::<f64>();
        let tells = |decimals: &usize| {
            let text = written(limit, *decimals);
            text.is_ok_and(|text| (text - limit).abs() <= LIMIT_ACCURACY * limit.abs())
        };
        let of_limit = (0..DECIMALS_MAX).find(tells).unwrap_or(DECIMALS_MAX);
        let shown = written(limit, of_limit);
        let is_apart = |decimals: &usize| value <= limit || written(value, *decimals) != shown;
        let of_value = (least..DECIMALS_MAX).find(is_apart).unwrap_or(least);
        [of_value, of_limit]
    }

    /// Share of the limit that is used; infinite if it is not defined.
    fn used(&self) -> f64 {
        let (Some(value), Some(limit)) = (self.value, self.limit) else {
            return f64::INFINITY;
        };
        if self.kind.at_least() {
            limit / value.max(f64::MIN_POSITIVE)
        } else if value.abs() > 0.0 {
            value.abs() / limit
        } else {
            0.0
        }
    }

    /// The worst of several checks of one kind; `None` without checks.
    #[must_use]
    pub fn worst(checks: impl Iterator<Item = Self>) -> Option<Self> {
        // The first of equal ones: `max_by` would take the last.
        checks.reduce(|worst, check| {
            let worse = check.outcome.cmp(&worst.outcome).reverse();
            if worse.then(check.used().total_cmp(&worst.used())).is_gt() {
                check
            } else {
                worst
            }
        })
    }
}

impl fmt::Display for Check {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (words, subject) = (self.words(), &*self.subject);
        let (Some(value), Some(limit)) = (self.value, self.limit) else {
            let what = match (subject, self.limit.is_some()) {
                ("", true) => "not finite",
                ("", false) => "no",
                _ => subject,
            };
            return write!(formatter, "{words}: {what}");
        };
        formatter.write_str(&words)?;
        if !subject.is_empty() {
            write!(formatter, ", {subject}")?;
        }
        let [of_value, of_limit] = self.decimals();
        // A value that rounds to zero has no sign.
        let is_zero = value.abs() < 0.5 * 0.1_f64.powi(i32::try_from(of_value).unwrap_or(0));
        let (sign, bound) = match (self.kind.at_least(), self.kind.is_signed()) {
            (true, _) => ("", "at least "),
            (false, true) if is_zero => ("", "within ±"),
            (false, true) if value < 0.0 => ("−", "within ±"),
            (false, true) => ("+", "within ±"),
            (false, false) => ("", "at most "),
        };
        let value = value.abs();
        let blank = if self.unit.is_empty() { "" } else { " " };
        let unit = &self.unit;
        write!(
            formatter,
            ": {sign}{value:.of_value$}{blank}{unit}; {bound}{limit:.of_limit$}{blank}{unit}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(subject: &str, value: f64) -> Check {
        Check::new(
            CheckKind::RangeMean,
            subject,
            value,
            10.0,
            CheckOutcome::Fail,
        )
    }

    #[test]
    fn what_is_no_number_breaks_every_limit() {
        assert_eq!(mean("a", -10.0).outcome, CheckOutcome::Pass);
        assert_eq!(mean("a", -10.1).outcome, CheckOutcome::Fail);
        let check = mean("a", f64::NAN);
        assert_eq!((check.outcome, check.value), (CheckOutcome::Fail, None));
        let shots = |n| Check::new(CheckKind::Shots, "", n, 20.0, CheckOutcome::Fail).outcome;
        assert_eq!(
            (shots(20.0), shots(19.0)),
            (CheckOutcome::Pass, CheckOutcome::Fail)
        );
    }

    #[test]
    fn the_worst_is_kept_and_of_equals_the_first() {
        let of = |values: &[(&str, f64)]| {
            let checks = values.iter().map(|(subject, value)| mean(subject, *value));
            Check::worst(checks).unwrap().subject
        };
        assert_eq!(of(&[("a", 1.0), ("b", -9.0), ("c", 9.0)]), "b");
        assert_eq!(of(&[("a", 11.0), ("b", f64::NAN), ("c", 12.0)]), "b");
        assert!(Check::worst(std::iter::empty()).is_none());
    }
}
