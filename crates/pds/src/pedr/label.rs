//! Name and label of a PEDR file, and the datum that follows from them.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{LABEL_BYTES, LABEL_RECORDS, RECORD_BYTES};
use crate::label::{Label, LabelError, parse};
use areograph_base::{altimetry::DatumChoice, body::Datum, error::Cause};

/// The parts of a name `AP#####v.B`, in upper or lower case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileName {
    /// Orbit of the name; 10000 more than the project's orbit in the mapping phase.
    pub orbit: u32,
    /// Version letter in upper case.
    pub version: char,
}

impl FileName {
    /// The parts of the file name of `path`; `None` when it has a different form.
    #[must_use]
    pub fn parse(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.to_ascii_uppercase();
        let rest = name.strip_prefix("AP")?.strip_suffix(".B")?;
        let (orbit, version) = rest.split_at_checked(5)?;
        let mut letters = version.chars();
        match (letters.next(), letters.next()) {
            (Some(version), None)
                if version.is_ascii_uppercase() && orbit.bytes().all(|b| b.is_ascii_digit()) =>
            {
                let orbit = orbit.parse().ok()?;
                Some(Self { orbit, version })
            }
            _ => None,
        }
    }

    /// Whether the file belongs to the mapping phase.
    #[must_use]
    pub const fn is_mapping(self) -> bool {
        self.orbit >= 10_000
    }
}

/// Contents of the attached label; any may be missing.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PedrLabel {
    /// Version of the software that made the file.
    pub software_version: Option<f64>,
    /// Product.
    pub product_id: Option<String>,
    /// Data set.
    pub data_set_id: Option<String>,
    /// The datum named in the label, if it names only one.
    pub datum: Option<Datum>,
    /// Records of the file including the label records; the archive often writes `UNK`.
    pub file_records: Option<u64>,
    /// Records of the label, as the label states.
    pub label_records: Option<usize>,
    /// Record format in the label: `RECORD_TYPE` and `RECORD_BYTES`.
    record_form: [Option<String>; 2],
    /// Whether it begins with the marker of the archive's files.
    has_marker: bool,
}

/// Start of every PEDR.
const MARKER: &[u8] = b"CCSD3ZF0";
/// Start of the data set identifier of every PEDR.
const DATA_SET: &str = "MGS-M-MOLA-3-PEDR-L1A";

impl PedrLabel {
    /// The label at the start of a file's bytes.
    ///
    /// # Errors
    /// No assignment within the label's ten records.
    pub fn parse(bytes: &[u8]) -> Result<Self, LabelError> {
        let bytes = &bytes[..bytes.len().min(LABEL_BYTES)];
        let label = parse(bytes)?;
        let text = |key: &str| label.find(key).map(|entry| entry.value.clone());
        Ok(Self {
            software_version: software_version(bytes, &label),
            product_id: text("PRODUCT_ID"),
            data_set_id: text("DATA_SET_ID"),
            datum: named_datum(&label),
            file_records: text("FILE_RECORDS").and_then(|records| records.parse().ok()),
            label_records: text("LABEL_RECORDS").and_then(|records| records.parse().ok()),
            record_form: [text("RECORD_TYPE"), text("RECORD_BYTES")],
            has_marker: bytes.starts_with(MARKER),
        })
    }

    /// Whether the file begins with the marker of the archive's files.
    #[must_use]
    pub const fn has_marker(&self) -> bool {
        self.has_marker
    }

    /// Deviations from the label of a PEDR, one sentence each; none for an empty label.
    pub(super) fn departures(&self) -> Vec<String> {
        if *self == Self::default() {
            return Vec::new();
        }
        let marker = || {
            let expected = String::from_utf8_lossy(MARKER);
            format!("the label does not begin with {expected}, unlike the labels of archive files")
        };
        let mut found: Vec<String> = (!self.has_marker).then(marker).into_iter().collect();
        let label_records = self.label_records.map(|records| records.to_string());
        let [record_type, record_bytes] = &self.record_form;
        let expected_bytes = RECORD_BYTES.to_string();
        for (key, said, expected) in [
            ("RECORD_TYPE", record_type, "FIXED_LENGTH"),
            ("RECORD_BYTES", record_bytes, &expected_bytes),
            ("LABEL_RECORDS", &label_records, &LABEL_RECORDS.to_string()),
        ] {
            match said {
                Some(said) if said == expected => {}
                Some(said) => {
                    found.push(format!("{key} of the label is {said}; expected {expected}"));
                }
                None => found.push(format!("the label has no {key}; expected {expected}")),
            }
        }
        let data_set = self.data_set_id.as_deref().unwrap_or("not given");
        if !data_set.starts_with(DATA_SET) {
            found.push(format!(
                "DATA_SET_ID of the label is {data_set}; expected {DATA_SET}-..., as in every PEDR"
            ));
        }
        found
    }
}

/// The version by the rule of `pedr2tab`: four characters that begin 25 after the `S` of
/// `SOFTWARE_NAME =` in the first record; failing that, the last number of the keyword's value.
fn software_version(bytes: &[u8], label: &Label) -> Option<f64> {
    let plausible = |text: &str| {
        let version: f64 = text.trim().parse().ok()?;
        (version.is_finite() && version >= 0.0).then_some(version)
    };
    let first = String::from_utf8_lossy(&bytes[..bytes.len().min(RECORD_BYTES)]);
    let by_column = first
        .find("SOFTWARE_NAME =")
        .and_then(|at| first.get(at + 25..at + 29))
        .and_then(plausible);
    by_column.or_else(|| {
        let value = &label.find("SOFTWARE_NAME")?.value;
        value.split_whitespace().rev().find_map(plausible)
    })
}

/// The datum in the entries about coordinates, or else anywhere in the label.
fn named_datum(label: &Label) -> Option<Datum> {
    let only = |required: &str| {
        let mut named: Vec<Datum> = label
            .entries
            .iter()
            .filter(|entry| entry.key.contains(required))
            .flat_map(|entry| datums_in(&entry.value))
            .collect();
        named.dedup();
        match named[..] {
            [datum] => Some(datum),
            _ => None,
        }
    };
    only("COORDINATE").or_else(|| only(""))
}

/// The datums named in a text, written as `IAU1991`, `IAU 1991`, `IAU_1991` or similar.
fn datums_in(text: &str) -> Vec<Datum> {
    let letters: String = text.chars().filter(char::is_ascii_alphanumeric).collect();
    let letters = letters.to_ascii_uppercase();
    [Datum::Iau1991, Datum::Iau1994, Datum::Iau2000]
        .into_iter()
        .filter(|datum| letters.contains(&datum.to_string().to_ascii_uppercase()))
        .collect()
}

/// The datum of a file is unknown, or its sources contradict each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum DatumError {
    /// Neither name nor label state it.
    #[error(
        "the datum is unknown: the file name has no version letter A to L, and the label states no datum"
    )]
    #[cause(
        "set pedr.datum in the configuration (iau1991, iau1994 or iau2000), or restore the archive's file name"
    )]
    Undecided,
    /// Two sources disagree.
    #[error("{first} implies {first_datum}, but {second} implies {second_datum}")]
    #[cause(
        "check whether the file was renamed or converted; version L is iau2000, earlier versions are iau1991"
    )]
    Contradiction {
        /// One source.
        first: DatumSource,
        /// Datum of that source.
        first_datum: Datum,
        /// The other source.
        second: DatumSource,
        /// Datum of that source.
        second_datum: Datum,
    },
}

/// Source of a datum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DatumSource {
    /// The version letter of the file name.
    Letter(char),
    /// The file's label.
    Label,
    /// The configuration.
    Configuration,
}

impl std::fmt::Display for DatumSource {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Letter(letter) => write!(formatter, "version letter {letter}"),
            Self::Label => formatter.write_str("the label"),
            Self::Configuration => formatter.write_str("pedr.datum in the configuration"),
        }
    }
}

/// The datum of a file's longitudes and latitudes, from its version letter, its label and the configuration.
///
/// Version L is IAU 2000, earlier letters IAU 1991; a label or a configured datum may instead state IAU 1994, which is
/// also referred to as "IAU 1991". All sources must agree.
///
/// # Errors
/// No source states a datum, or two contradict each other.
pub fn decide_datum(
    choice: DatumChoice,
    version: Option<char>,
    label: Option<Datum>,
) -> Result<Datum, DatumError> {
    let stated = match choice {
        DatumChoice::Stated(datum) => Some((DatumSource::Configuration, datum)),
        DatumChoice::Auto => None,
    };
    let label = label.map(|datum| (DatumSource::Label, datum));
    let letter = version.and_then(|letter| {
        let datum = match letter {
            'L' => Datum::Iau2000,
            'A'..'L' => Datum::Iau1991,
            _ => return None,
        };
        Some((DatumSource::Letter(letter), datum))
    });
    let said: Vec<_> = [letter, label, stated].into_iter().flatten().collect();
    for (index, (first, first_datum)) in said.iter().enumerate() {
        for (second, second_datum) in &said[index + 1..] {
            let refined = matches!(first, DatumSource::Letter(_))
                && (*first_datum, *second_datum) == (Datum::Iau1991, Datum::Iau1994);
            if first_datum != second_datum && !refined {
                return Err(DatumError::Contradiction {
                    first: *first,
                    first_datum: *first_datum,
                    second: *second,
                    second_datum: *second_datum,
                });
            }
        }
    }
    // Later sources are more specific.
    said.last()
        .map(|(_, datum)| *datum)
        .ok_or(DatumError::Undecided)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Datum::{Iau1991, Iau1994, Iau2000};

    #[test]
    fn names_give_orbit_and_letter_in_either_case() {
        let parse = |name: &str| FileName::parse(Path::new(name)).map(|n| (n.orbit, n.version));
        assert_eq!(parse("AP19019L.B"), Some((19_019, 'L')));
        assert_eq!(parse("archive/ap00029k.b"), Some((29, 'K')));
        for other in [
            "AP19019.B",
            "AP1901L.B",
            "AP19019LL.B",
            "AP19019L.TAB",
            "AP190é9L.B",
            "x",
            "",
        ] {
            assert_eq!(parse(other), None, "{other}");
        }
    }

    #[test]
    fn letter_label_and_configuration_must_agree() {
        let auto = DatumChoice::Auto;
        let stated = DatumChoice::Stated;
        let cases = [
            (auto, Some('L'), None, Ok(Iau2000)),
            (auto, Some('K'), None, Ok(Iau1991)),
            (auto, Some('K'), Some(Iau1994), Ok(Iau1994)),
            (auto, None, Some(Iau2000), Ok(Iau2000)),
            (stated(Iau1994), Some('J'), None, Ok(Iau1994)),
            (stated(Iau1991), None, None, Ok(Iau1991)),
            (
                auto,
                None,
                None,
                Err(
                    "the datum is unknown: the file name has no version letter A to L, and the label states no datum",
                ),
            ),
            (
                auto,
                Some('M'),
                None,
                Err(
                    "the datum is unknown: the file name has no version letter A to L, and the label states no datum",
                ),
            ),
            (
                auto,
                Some('L'),
                Some(Iau1991),
                Err("version letter L implies iau2000, but the label implies iau1991"),
            ),
            (
                stated(Iau1991),
                Some('L'),
                None,
                Err(
                    "version letter L implies iau2000, but pedr.datum in the configuration implies iau1991",
                ),
            ),
            (
                stated(Iau2000),
                Some('A'),
                None,
                Err(
                    "version letter A implies iau1991, but pedr.datum in the configuration implies iau2000",
                ),
            ),
            (
                stated(Iau1994),
                None,
                Some(Iau1991),
                Err(
                    "the label implies iau1991, but pedr.datum in the configuration implies iau1994",
                ),
            ),
        ];
        for (choice, letter, label, expected) in cases {
            let found = decide_datum(choice, letter, label).map_err(|error| error.to_string());
            assert_eq!(
                found,
                expected.map_err(str::to_owned),
                "{choice:?} {letter:?} {label:?}"
            );
        }
    }

    #[test]
    fn the_label_gives_version_datum_and_records() {
        let text = "CCSD3ZF0\r\nSOFTWARE_NAME = \"MOLAPROC7.15\"\r\nFILE_RECORDS = 12\r\n\
            NOTE = \"from IAU1991 into IAU 2000\"\r\nCOORDINATE_SYSTEM = \"Iau-2000 areocentric\"\r\nEND\r\n";
        let label = PedrLabel::parse(text.as_bytes()).unwrap();
        assert!((label.software_version.unwrap() - 7.15).abs() < 1e-12);
        assert_eq!((label.datum, label.file_records), (Some(Iau2000), Some(12)));
        let both = PedrLabel::parse(b"NOTE = \"IAU1991, IAU2000\"\nFILE_RECORDS = UNK\n").unwrap();
        assert_eq!((both.datum, both.file_records), (None, None));
        let other = PedrLabel::parse(b"SOFTWARE_NAME = \"PEDR maker 6.5 beta\"\n").unwrap();
        assert!((other.software_version.unwrap() - 6.5).abs() < 1e-12);
    }
}
