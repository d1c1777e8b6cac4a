//! Values of a JSON document, with messages that name their keys.

use std::fmt;

use serde_json::Value;

use areograph_base::error::Cause;

/// Maximum number of characters of a value in a message.
const SHOWN: usize = 60;

/// Invalid support data.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[cause(Input: "regenerate the support data with the program that wrote them (ALE's isd_generate), or configure the \
    image by label and kernels")]
pub(crate) enum IsdError {
    #[error("not image support data: {0}; expected a JSON document of one object")]
    NotJson(String),
    #[error("{bytes} bytes; expected image support data of at most {max} bytes")]
    TooLarge { bytes: u64, max: u64 },
    #[error("{key} is missing; expected {expected}")]
    Missing { key: String, expected: String },
    #[error("{key} is {value}; expected {expected}")]
    Value {
        key: String,
        value: String,
        expected: String,
    },
    #[error(
        "optical_distortion.radial.coefficients repeats the pixel pitch, {pitch_mm} mm; expected coefficients of a distortion"
    )]
    #[cause(
        "configure the image by label and kernels. For MOC, ALE repeats the pixel pitch as distortion, states the \
         period of a detector line instead of that of an image line, and begins the attitudes 1.15 s after the first \
         line. areograph writes a camera model in ALE's light-time convention to exchange/centre"
    )]
    PitchAsDistortion { pitch_mm: String },
}

/// An object of a JSON document, and its location.
#[derive(Debug, Clone)]
pub(super) struct Object<'a> {
    value: &'a Value,
    path: String,
}

/// A value, and its location.
struct Found<'a> {
    value: &'a Value,
    key: String,
}

impl Found<'_> {
    fn refused(&self, expected: impl fmt::Display) -> IsdError {
        let value = self.value.to_string();
        let mut shown: String = value.chars().take(SHOWN).collect();
        if shown.len() < value.len() {
            shown += " …";
        }
        IsdError::Value {
            key: self.key.clone(),
            value: shown,
            expected: expected.to_string(),
        }
    }

    fn finite(&self) -> Result<f64, IsdError> {
        let number = self.value.as_f64().filter(|number| number.is_finite());
        number.ok_or_else(|| self.refused("a finite number"))
    }

    /// A whole number, which some writers give a decimal point.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a number without fraction, far below 2^63"
    )]
    fn code(&self) -> Result<i64, IsdError> {
        let written = self.value.as_f64();
        let whole = written.filter(|code| code.fract().abs() <= 0.0 && code.abs() < 1e15);
        whole
            .map(|code| code as i64)
            .ok_or_else(|| self.refused("a whole number"))
    }

    fn entries(&self, expected: &str) -> Result<Vec<Found<'_>>, IsdError> {
        let list = self
            .value
            .as_array()
            .ok_or_else(|| self.refused(expected))?;
        let entries = list.iter().enumerate().map(|(index, value)| Found {
            value,
            key: format!("{}[{index}]", self.key),
        });
        Ok(entries.collect())
    }

    fn row<const N: usize>(&self) -> Result<[f64; N], IsdError> {
        let expected = format!("{N} finite numbers");
        let entries = self.entries(&expected)?;
        let numbers = entries.iter().map(Found::finite);
        let numbers: Vec<f64> = numbers.collect::<Result<_, _>>()?;
        numbers.try_into().map_err(|_| self.refused(expected))
    }
}

impl<'a> Object<'a> {
    /// The document itself.
    pub(super) fn document(value: &'a Value) -> Result<Self, IsdError> {
        if !value.is_object() {
            return Err(IsdError::NotJson("it holds no object".to_owned()));
        }
        Ok(Self {
            value,
            path: String::new(),
        })
    }

    fn find(&self, key: &str, expected: impl fmt::Display) -> Result<Found<'a>, IsdError> {
        let path = match &*self.path {
            "" => key.to_owned(),
            path => format!("{path}.{key}"),
        };
        match self.value.get(key) {
            Some(value) if !value.is_null() => Ok(Found { value, key: path }),
            _ => Err(IsdError::Missing {
                key: path,
                expected: expected.to_string(),
            }),
        }
    }

    /// The error that `key` differs from the expected value.
    pub(super) fn refused(&self, key: &str, expected: impl fmt::Display) -> IsdError {
        match self.find(key, &expected) {
            Ok(found) => found.refused(expected),
            Err(missing) => missing,
        }
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.value.get(key).is_some_and(|value| !value.is_null())
    }

    pub(super) fn object(&self, key: &str) -> Result<Self, IsdError> {
        let found = self.find(key, "an object")?;
        if !found.value.is_object() {
            return Err(found.refused("an object"));
        }
        Ok(Self {
            value: found.value,
            path: found.key,
        })
    }

    pub(super) fn keys(&self) -> Vec<&'a str> {
        let object = self.value.as_object();
        object.map_or_else(Vec::new, |object| {
            object.keys().map(String::as_str).collect()
        })
    }

    pub(super) fn text(&self, key: &str) -> Result<&'a str, IsdError> {
        let found = self.find(key, "a text")?;
        let text = found.value.as_str().filter(|text| !text.trim().is_empty());
        text.ok_or_else(|| found.refused("a text"))
    }

    /// A number between two limits, inclusive.
    pub(super) fn number(&self, key: &str, [low, high]: [f64; 2]) -> Result<f64, IsdError> {
        let expected = format!("a number from {low} to {high}");
        let found = self.find(key, &expected)?;
        let number = found.finite()?;
        if (low..=high).contains(&number) {
            Ok(number)
        } else {
            Err(found.refused(expected))
        }
    }

    /// A whole number between two limits, inclusive.
    pub(super) fn whole(&self, key: &str, [low, high]: [u32; 2]) -> Result<u32, IsdError> {
        let expected = format!("a whole number from {low} to {high}");
        let found = self.find(key, &expected)?;
        let whole = found
            .value
            .as_u64()
            .and_then(|whole| u32::try_from(whole).ok());
        let whole = whole.filter(|whole| (low..=high).contains(whole));
        whole.ok_or_else(|| found.refused(expected))
    }

    /// A code of NAIF.
    pub(super) fn code(&self, key: &str) -> Result<i64, IsdError> {
        self.find(key, "a whole number")?.code()
    }

    /// A value of any kind.
    pub(super) fn any(&self, key: &str) -> Result<&'a Value, IsdError> {
        Ok(self.find(key, "a value")?.value)
    }

    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], IsdError> {
        self.find(key, format!("{N} finite numbers"))?.row()
    }

    /// A list of numbers, at most `max`.
    pub(super) fn list(&self, key: &str, max: usize) -> Result<Vec<f64>, IsdError> {
        let expected = format!("1 to {max} finite numbers");
        let found = self.find(key, &expected)?;
        let entries = found.entries(&expected)?;
        if !(1..=max).contains(&entries.len()) {
            return Err(found.refused(expected));
        }
        entries.iter().map(Found::finite).collect()
    }

    /// Codes of NAIF.
    pub(super) fn codes(&self, key: &str) -> Result<Vec<i64>, IsdError> {
        let found = self.find(key, "whole numbers")?;
        let entries = found.entries("whole numbers")?;
        entries.iter().map(Found::code).collect()
    }

    /// Rows of `N` numbers, one or more.
    pub(super) fn rows<const N: usize>(&self, key: &str) -> Result<Vec<[f64; N]>, IsdError> {
        let expected = format!("one or more rows of {N} finite numbers");
        let found = self.find(key, &expected)?;
        let entries = found.entries(&expected)?;
        if entries.is_empty() {
            return Err(found.refused(expected));
        }
        entries.iter().map(Found::row).collect()
    }

    /// Epochs, increasing, two or more.
    pub(super) fn epochs(&self, key: &str) -> Result<Vec<f64>, IsdError> {
        const EXPECTED: &str = "two or more increasing epochs in ET seconds";
        let found = self.find(key, EXPECTED)?;
        let entries = found.entries(EXPECTED)?;
        let epochs: Vec<f64> = entries
            .iter()
            .map(Found::finite)
            .collect::<Result<_, _>>()?;
        if epochs.len() < 2 {
            return Err(found.refused(EXPECTED));
        }
        let back = epochs.windows(2).position(|pair| pair[1] <= pair[0]);
        match back {
            Some(index) => Err(entries[index + 1].refused(format!(
                "an epoch after {}, the epoch of the preceding row",
                epochs[index]
            ))),
            None => Ok(epochs),
        }
    }
}
