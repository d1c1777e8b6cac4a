//! Tie points from a table, and from ISIS control networks as text (PVL) or binary.
//!
//! Both count lines and samples as ISIS does: the middle of the first pixel is 1.

mod binary_network;
pub mod messages;
mod network;

use std::{collections::BTreeMap, fs, path::Path};

use super::{
    file_size::SizedFile,
    label::{LabelError, parse_whole},
};
use areograph_base::{
    error::{Cause, IoError, Locate, Result},
    ties::{KnownGround, TieMeasure, TiePoint},
};
use binary_network::parse_binary_network;
use network::parse_text_network;

/// ISIS counts the middle of the first pixel as 1; here its outer edge is 0.
pub const ISIS_TO_EDGE: f64 = -0.5;

/// Tie points of a file, and complaints about the rejected records.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TieFile {
    /// Points in the order of their first measurement, also those measured once.
    pub ties: Vec<TiePoint<String>>,
    /// Measurements and points that the network marks as ignored.
    pub ignored: usize,
    /// Invalid records.
    pub complaints: Vec<TieComplaint>,
}

/// A skipped record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TieComplaint {
    /// Line of a table, number of the object or group in a network, or number of the point in a binary one, from 1.
    pub record: u64,
    /// The value found and the value expected.
    pub text: String,
}

/// A file without tie points.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[cause(Input)]
enum TieError {
    #[error("binary control network of version {0}; expected version 2 or 5")]
    #[cause("convert it with ISIS: cnetbin2pvl from=control.net to=control.pvl")]
    BinaryVersion(u64),
    #[error("{key} in the label of the binary control network is {value}; expected a number")]
    #[cause("transfer the file again in binary mode, or rewrite it with ISIS")]
    BinaryLabel { key: &'static str, value: String },
    #[error(
        "the file has {bytes} bytes; expected the {what} of a binary control network up to byte {end}"
    )]
    #[cause(like = BinaryLabel)]
    BinaryShort {
        what: &'static str,
        end: u64,
        bytes: u64,
    },
    #[error("the header of the binary control network cannot be read: {0}")]
    #[cause(like = BinaryLabel)]
    BinaryHeader(String),
    #[error(
        "the sizes of the points in the binary control network do not add up to PointsBytes in its label"
    )]
    #[cause(like = BinaryLabel)]
    BinarySizes,
    #[error("no ControlNetwork object found")]
    #[cause("give an ISIS control network, or a CSV table")]
    NoNetwork,
    #[error("column {0} is missing; expected point_id, serial_number, sample and line")]
    #[cause(
        "give a comma-separated table with a header line; lines and samples count from 1 at the middle of the first \
         pixel"
    )]
    Column(&'static str),
    #[error("column {0} is missing; expected both line_sigma_px and sample_sigma_px, or neither")]
    #[cause(like = Column)]
    Sigma(&'static str),
    #[error("the table cannot be read: {0}")]
    #[cause(like = Column)]
    Table(String),
    #[error("no record of the file can be read ({0} in all); record {1}: {2}")]
    #[cause(like = Column)]
    Unreadable(usize, u64, String),
    #[error("no point of the control network can be read ({0} errors); entry {1}: {2}")]
    #[cause("rewrite the network with ISIS")]
    UnreadableNetwork(usize, u64, String),
    #[error(transparent)]
    #[cause(like = NoNetwork)]
    Label(#[from] LabelError),
}

/// Reads tie points; a file whose name ends in `.csv` is a table, any other a control network.
///
/// # Errors
/// The file cannot be read; no network; missing columns; no readable record.
pub fn read_ties(path: &Path) -> Result<TieFile> {
    SizedFile::Ties.require(path)?;
    let bytes = fs::read(path).map_err(IoError::on("read")).in_file(path)?;
    let table = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let ties = if table {
        parse_table(&bytes)
    } else {
        parse_network(&bytes)
    };
    ties.and_then(|file| readable(file, table)).in_file(path)
}

/// A control network of either form.
fn parse_network(bytes: &[u8]) -> std::result::Result<TieFile, TieError> {
    let label = parse_whole(bytes)?;
    let is_in = |name: &str| label.entries.iter().any(|entry| entry.group == name);
    // The label of the binary form states where its bytes start.
    if is_in("PROTOBUFFER") || is_in("CORE") {
        parse_binary_network(&label, bytes)
    } else if is_in("CONTROLNETWORK") {
        Ok(parse_text_network(&label))
    } else {
        Err(TieError::NoNetwork)
    }
}

/// Rejects a file without a valid record.
fn readable(file: TieFile, is_table: bool) -> std::result::Result<TieFile, TieError> {
    let Some(first) = file.complaints.first().filter(|_| file.ties.is_empty()) else {
        return Ok(file);
    };
    let (records, text) = (file.complaints.len(), first.text.clone());
    Err(if is_table {
        TieError::Unreadable(records, first.record, text)
    } else {
        TieError::UnreadableNetwork(records, first.record, text)
    })
}

/// Formats tie points as a table that [`read_ties`] reads; coordinates to a ten-thousandth of a pixel. It has columns
/// for standard deviations where a measurement has them.
#[must_use]
pub fn ties_table(ties: &[TiePoint<String>]) -> String {
    let mut table = csv::Writer::from_writer(Vec::new());
    let mut measures = ties.iter().flat_map(|tie| &tie.measures);
    let has_sigmas = measures.any(|measure| measure.sigma_px.is_some());
    let sigma_columns = SIGMA_COLUMNS.iter().filter(|_| has_sigmas);
    // Writing into memory cannot fail.
    let _infallible = table.write_record(COLUMNS.iter().chain(sigma_columns));
    for tie in ties {
        for measure in &tie.measures {
            let [sample, line] =
                [measure.sample, measure.line].map(|edge| format!("{:.4}", edge - ISIS_TO_EDGE));
            let mut record = vec![tie.id.clone(), measure.image.clone(), sample, line];
            if has_sigmas {
                let sigmas = measure
                    .sigma_px
                    .map(|sigmas| sigmas.map(|sigma| format!("{sigma:.5}")));
                record.extend(sigmas.unwrap_or_default());
            }
            let _infallible = table.write_record(&record);
        }
    }
    let bytes = table.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Required columns of a table; others are ignored.
const COLUMNS: [&str; 4] = ["point_id", "serial_number", "sample", "line"];
/// Optional columns of a table: standard deviations of a measurement; an empty field is missing.
const SIGMA_COLUMNS: [&str; 2] = ["line_sigma_px", "sample_sigma_px"];

/// Positions of the columns of a table.
struct Places {
    required: [usize; 4],
    sigmas: [Option<usize>; 2],
}

impl Places {
    fn of(header: &csv::StringRecord) -> std::result::Result<Self, TieError> {
        let position = |column| header.iter().position(|name| name == column);
        let mut required = [0; 4];
        for (place, column) in required.iter_mut().zip(COLUMNS) {
            *place = position(column).ok_or(TieError::Column(column))?;
        }
        let sigmas = SIGMA_COLUMNS.map(position);
        if let [Some(_), None] | [None, Some(_)] = sigmas {
            let missing = usize::from(sigmas[0].is_some());
            return Err(TieError::Sigma(SIGMA_COLUMNS[missing]));
        }
        Ok(Self { required, sigmas })
    }
}

/// Standard deviations of line and sample from a file; both, or `None` where both are missing.
///
/// # Errors
/// The values found instead of two positive numbers.
fn sigmas(written: [Option<&str>; 2]) -> std::result::Result<Option<[f64; 2]>, String> {
    if written == [None, None] {
        return Ok(None);
    }
    let positive = |text: Option<&str>| finite(text?).filter(|sigma| *sigma > 0.0);
    if let [Some(line), Some(sample)] = written.map(positive) {
        return Ok(Some([line, sample]));
    }
    let [line, sample] = written.map(|text| text.unwrap_or("missing"));
    Err(format!(
        "standard deviations {line} (line) and {sample} (sample): expected two numbers above 0, or no values"
    ))
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Gathers measurements into points by their identifiers.
#[derive(Default)]
struct Gathered {
    file: TieFile,
    index: BTreeMap<String, usize>,
}

impl Gathered {
    /// The point with this identifier, created if necessary.
    fn point(&mut self, id: String) -> &mut TiePoint<String> {
        let ties = &mut self.file.ties;
        let at = *self.index.entry(id).or_insert_with_key(|id| {
            ties.push(TiePoint {
                id: id.clone(),
                known: None,
                measures: Vec::new(),
            });
            ties.len() - 1
        });
        &mut ties[at]
    }

    /// Adds a measurement in ISIS coordinates.
    fn add(&mut self, id: String, known: Option<KnownGround>, measure: TieMeasure<String>) {
        let point = self.point(id);
        point.known = point.known.or(known);
        point.measures.push(TieMeasure {
            line: measure.line + ISIS_TO_EDGE,
            sample: measure.sample + ISIS_TO_EDGE,
            ..measure
        });
    }

    fn complain(&mut self, record: u64, text: String) {
        self.file.complaints.push(TieComplaint { record, text });
    }
}

fn parse_table(bytes: &[u8]) -> std::result::Result<TieFile, TieError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let unreadable = |error: csv::Error| TieError::Table(error.to_string());
    let header = reader.headers().map_err(unreadable)?.clone();
    let places = Places::of(&header)?;
    let mut gathered = Gathered::default();
    for record in reader.into_records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                let line = error.position().map_or(0, csv::Position::line);
                gathered.complain(line, unreadable_record(&error));
                continue;
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        match measurement(&places, &record) {
            Ok((id, measure)) => gathered.add(id, None, measure),
            Err(text) => gathered.complain(line, text),
        }
    }
    Ok(gathered.file)
}

/// The measurement of a record with the identifier of its point, or the fault.
fn measurement(
    places: &Places,
    record: &csv::StringRecord,
) -> std::result::Result<(String, TieMeasure<String>), String> {
    let [id, image, sample, line] = places.required.map(|at| record.get(at).unwrap_or_default());
    let numbers = finite(line).zip(finite(sample));
    let Some((line, sample)) = numbers.filter(|_| !id.is_empty() && !image.is_empty()) else {
        return Err(format!(
            "point_id {id:?}, serial_number {image:?}, sample {sample:?}, line {line:?}: expected two names and two \
             numbers"
        ));
    };
    let written = places
        .sigmas
        .map(|at| record.get(at?).filter(|text| !text.is_empty()));
    let measure = TieMeasure {
        image: image.to_owned(),
        line,
        sample,
        sigma_px: sigmas(written)?,
    };
    Ok((id.to_owned(), measure))
}

/// The fault of an unreadable record, without its location, which is reported with it.
fn unreadable_record(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!("{len} fields; expected {expected_len}, as in the header"),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A measurement without standard deviations.
    pub(in crate::ties) fn measure(image: &str, line: f64, sample: f64) -> TieMeasure<String> {
        TieMeasure {
            image: image.to_owned(),
            line,
            sample,
            sigma_px: None,
        }
    }

    #[test]
    fn a_table_is_read_and_bad_rows_are_told() {
        let table = "point_id,serial_number,type,sample,line\n1,A,0,2.5,1\n2,A,0,x,1\n1, B,3,7,8\n3,A\n4,A,0,NaN,1\n";
        let file = parse_table(table.as_bytes()).unwrap();
        assert_eq!(file.ties.len(), 1);
        assert_eq!(
            file.ties[0].measures,
            [measure("A", 0.5, 2.0), measure("B", 7.5, 6.5)]
        );
        let rows: Vec<u64> = file
            .complaints
            .iter()
            .map(|complaint| complaint.record)
            .collect();
        assert_eq!(rows, [3, 5, 6]);
        assert_eq!(
            parse_table(b"point_id,line\n"),
            Err(TieError::Column("serial_number"))
        );
    }

    #[test]
    fn standard_deviations_of_measurements_are_read_where_a_table_has_them() {
        let table = "point_id,serial_number,sample,line,line_sigma_px,sample_sigma_px\n\
            1,A,2.5,1,0.3,0.2\n1,B,7,8,,\n2,A,1,1,0.3,\n2,B,1,1,0,0.2\n";
        let file = parse_table(table.as_bytes()).unwrap();
        let sigmas: Vec<_> = file.ties[0]
            .measures
            .iter()
            .map(|measure| measure.sigma_px)
            .collect();
        assert_eq!(sigmas, [Some([0.3, 0.2]), None]);
        assert_eq!(file.ties.len(), 1);
        let texts: Vec<&str> = file
            .complaints
            .iter()
            .map(|complaint| &*complaint.text)
            .collect();
        let expected = "expected two numbers above 0, or no values";
        assert_eq!(
            texts,
            [("0.3", "missing"), ("0", "0.2")].map(|(line, sample)| format!(
                "standard deviations {line} (line) and {sample} (sample): {expected}"
            ))
        );
        assert_eq!(
            parse_table(b"point_id,serial_number,sample,line,sample_sigma_px\n"),
            Err(TieError::Sigma("line_sigma_px"))
        );
    }

    #[test]
    fn a_file_without_a_readable_record_says_what_these_lack() {
        let refused = |rows: &str| {
            let table = format!("point_id,serial_number,sample,line\n{rows}");
            readable(parse_table(table.as_bytes()).unwrap(), true)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            refused("1,A,,2\n1,B,3,x\n"),
            "no record of the file can be read (2 in all); record 2: point_id \"1\", serial_number \"A\", sample \"\", line \
             \"2\": expected two names and two numbers"
        );
        assert_eq!(
            refused("1,A,1\n"),
            "no record of the file can be read (1 in all); record 2: 3 fields; expected 4, as in the header"
        );
        assert!(refused(",A,1,2\n").contains("point_id \"\""));
        assert!(
            readable(
                parse_table(b"point_id,serial_number,sample,line\n").unwrap(),
                true
            )
            .is_ok()
        );
    }

    #[test]
    fn a_table_that_is_written_is_read_again() {
        let ties = [("1", 0.5), ("two, or 2", 7.25)].map(|(id, line)| TiePoint {
            id: id.to_owned(),
            known: None,
            measures: vec![measure("A", line, 3.0), measure("B", 9.0, line)],
        });
        let file = parse_table(ties_table(&ties).as_bytes()).unwrap();
        assert_eq!(file.ties, ties);
        let mut with_sigmas = ties;
        with_sigmas[1].measures[0].sigma_px = Some([0.05, 0.125]);
        let file = parse_table(ties_table(&with_sigmas).as_bytes()).unwrap();
        assert_eq!(file.ties, with_sigmas);
        assert_eq!((file.ignored, file.complaints.len()), (0, 0));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = parse_network(&bytes);
            let _ = parse_table(&bytes);
        }
    }
}
