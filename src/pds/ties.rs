//! Tie points from a table, and from ISIS control networks as text (PVL).
//!
//! Both count lines and samples as ISIS does: the middle of the first pixel is 1. Ground coordinates of
//! a network are not read: here they come from intersection.

use std::{collections::BTreeMap, fs, path::Path};

use super::label::{Entry, LabelError, parse_whole};
use crate::{
    error::{Cause, IoError, Kind, Locate, Result},
    ties::{TieMeasure, TiePoint},
};

/// Where ISIS has the middle of the first pixel, we have its outer edge at 0.
pub const ISIS_TO_EDGE: f64 = -0.5;

/// Tie points of a file, and what was not taken.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TieFile {
    /// Points in the order of their first measurement, also those measured once.
    pub ties: Vec<TiePoint<String>>,
    /// Measurements and points that the network itself says to ignore.
    pub ignored: usize,
    /// Records that are not what they should be.
    pub complaints: Vec<TieComplaint>,
}

/// A skipped record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TieComplaint {
    /// Line of a table, or number of the object or group in a network, both from 1.
    pub record: u64,
    /// What was found, and what was expected.
    pub text: String,
}

/// A file that holds no tie points.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
enum TieError {
    #[error("this is a binary control network; expected its text form (PVL)")]
    Binary,
    #[error("no ControlNetwork object found")]
    NoNetwork,
    #[error("column {0} is missing; expected point_id, serial_number, sample and line")]
    Column(&'static str),
    #[error("the table cannot be read: {0}")]
    Table(String),
    #[error("not one of its records can be read ({records} in all); record {record}: {text}")]
    Unreadable {
        records: usize,
        record: u64,
        text: String,
    },
    #[error(transparent)]
    Label(#[from] LabelError),
}

impl Cause for TieError {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        match self {
            Self::Binary => "convert it with ISIS: cnetbin2pvl from=control.net to=control.pvl",
            Self::NoNetwork | Self::Label(_) => "give an ISIS control network in PVL, or a CSV table",
            Self::Column(_) | Self::Table(_) | Self::Unreadable { .. } => {
                "give a comma-separated table with a header line; lines and samples count from 1 at the middle of the first pixel"
            }
        }
        .to_owned()
    }
}

/// Reads tie points; a file whose name ends in `.csv` is a table, any other a control network.
///
/// # Errors
/// The system's refusal to read; a binary network; no network; columns that are missing; records of which none
/// can be read.
pub fn read_ties(path: &Path) -> Result<TieFile> {
    let bytes = fs::read(path).map_err(IoError::on("read")).in_file(path)?;
    let table = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let ties = if table {
        parse_table(&bytes)
    } else {
        parse_network(&bytes)
    };
    ties.and_then(readable).in_file(path)
}

/// A file of which nothing was taken says why.
fn readable(file: TieFile) -> std::result::Result<TieFile, TieError> {
    match file.complaints.first() {
        Some(first) if file.ties.is_empty() => Err(TieError::Unreadable {
            records: file.complaints.len(),
            record: first.record,
            text: first.text.clone(),
        }),
        _ => Ok(file),
    }
}

/// The table of some tie points, as [`read_ties`] reads it; places to a ten-thousandth of a pixel.
#[must_use]
pub fn ties_table(ties: &[TiePoint<String>]) -> String {
    let mut table = csv::Writer::from_writer(Vec::new());
    // Writing into memory cannot fail.
    let _infallible = table.write_record(COLUMNS);
    for tie in ties {
        for measure in &tie.measures {
            let [sample, line] =
                [measure.sample, measure.line].map(|edge| format!("{:.4}", edge - ISIS_TO_EDGE));
            let _infallible = table.write_record([&*tie.id, &*measure.image, &*sample, &*line]);
        }
    }
    let bytes = table.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Columns of a table; others are left alone.
const COLUMNS: [&str; 4] = ["point_id", "serial_number", "sample", "line"];

/// Where a table has its columns.
fn places(header: &csv::StringRecord) -> std::result::Result<[usize; 4], TieError> {
    let mut places = [0; 4];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        let mut names = header.iter();
        *place = names
            .position(|name| name == column)
            .ok_or(TieError::Column(column))?;
    }
    Ok(places)
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
    fn add(&mut self, id: String, image: String, line: f64, sample: f64) {
        let ties = &mut self.file.ties;
        let at = *self.index.entry(id).or_insert_with_key(|id| {
            ties.push(TiePoint {
                id: id.clone(),
                measures: Vec::new(),
            });
            ties.len() - 1
        });
        ties[at].measures.push(TieMeasure {
            image,
            line: line + ISIS_TO_EDGE,
            sample: sample + ISIS_TO_EDGE,
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
    let places = places(&header)?;
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
        let [id, image, sample, along] = places.map(|at| record.get(at).unwrap_or_default());
        if let (false, Some(sample), Some(along)) = (
            id.is_empty() || image.is_empty(),
            finite(sample),
            finite(along),
        ) {
            gathered.add(id.to_owned(), image.to_owned(), along, sample);
        } else {
            let text = format!(
                "point_id {id:?}, serial_number {image:?}, sample {sample:?}, line {along:?}: expected two names and two \
                 numbers"
            );
            gathered.complain(line, text);
        }
    }
    Ok(gathered.file)
}

/// Why a record is none, without the place that is told with it.
fn unreadable_record(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!("{len} fields; expected {expected_len}, as in the header"),
        _ => error.to_string(),
    }
}

fn parse_network(bytes: &[u8]) -> std::result::Result<TieFile, TieError> {
    let label = parse_whole(bytes)?;
    let is_in = |name: &str| label.entries.iter().any(|entry| entry.group == name);
    if !is_in("CONTROLNETWORK") {
        // The label of the binary form describes where its bytes start.
        return Err(if is_in("PROTOBUFFER") || is_in("CORE") {
            TieError::Binary
        } else {
            TieError::NoNetwork
        });
    }
    let mut gathered = Gathered::default();
    let mut point = BlockEntries::default();
    for block in label.entries.chunk_by(|a, b| a.block == b.block) {
        let block = BlockEntries(block);
        match block.0[0].group.as_str() {
            "CONTROLPOINT" => {
                point = block;
                gathered.file.ignored += usize::from(block.ignored());
                if point.value("POINTID").is_none() {
                    gathered.complain(block.number(), "a point without PointId".to_owned());
                }
            }
            "CONTROLMEASURE" => add_measure(&mut gathered, &point, &block),
            _ => {}
        }
    }
    Ok(gathered.file)
}

/// The entries of one object or group.
#[derive(Clone, Copy, Default)]
struct BlockEntries<'a>(&'a [Entry]);

impl<'a> BlockEntries<'a> {
    fn value(&self, key: &str) -> Option<&'a str> {
        let entry = self.0.iter().find(|entry| entry.key == key);
        entry.map(|entry| entry.value.as_str())
    }

    fn ignored(&self) -> bool {
        self.value("IGNORE")
            .is_some_and(|value| value.eq_ignore_ascii_case("true"))
    }

    fn number(&self) -> u64 {
        self.0.first().map_or(0, |entry| entry.block as u64)
    }

    fn finite(&self, key: &str) -> Option<f64> {
        finite(self.value(key)?)
    }
}

fn add_measure(gathered: &mut Gathered, point: &BlockEntries<'_>, measure: &BlockEntries<'_>) {
    if point.ignored() || measure.ignored() {
        gathered.file.ignored += usize::from(measure.ignored());
        return;
    }
    let Some(id) = point.value("POINTID") else {
        return;
    };
    let place = (
        measure.value("SERIALNUMBER"),
        measure.finite("LINE"),
        measure.finite("SAMPLE"),
    );
    if let (Some(image), Some(line), Some(sample)) = place {
        gathered.add(id.to_owned(), image.to_owned(), line, sample);
    } else {
        let found = |key| measure.value(key).unwrap_or("missing");
        let text = format!(
            "point {id}: SerialNumber {}, Line {}, Sample {}: expected a name and two numbers",
            found("SERIALNUMBER"),
            found("LINE"),
            found("SAMPLE")
        );
        gathered.complain(measure.number(), text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NETWORK: &str = "Object = ControlNetwork\n NetworkId = n\n \
        Object = ControlPoint\n PointId = p1\n \
        Group = ControlMeasure\n SerialNumber = A\n Line = 1.0\n Sample = 2.5\n End_Group\n \
        Group = ControlMeasure\n Sample = 7.0\n Line = 8.0\n SerialNumber = B\n End_Group\n End_Object\n \
        Object = ControlPoint\n PointId = p2\n \
        Group = ControlMeasure\n SerialNumber = A\n Line = x\n Sample = 1\n End_Group\n \
        Group = ControlMeasure\n SerialNumber = B\n Line = 3\n Sample = 1\n Ignore = True\n End_Group\n \
        Group = ControlMeasure\n SerialNumber = C\n Line = 4\n Sample = 5\n End_Group\n End_Object\n \
        Object = ControlPoint\n PointId = p3\n Ignore = True\n \
        Group = ControlMeasure\n SerialNumber = A\n Line = 1\n Sample = 1\n End_Group\n End_Object\n\
        End_Object\nEnd\n";

    fn measure(image: &str, line: f64, sample: f64) -> TieMeasure<String> {
        TieMeasure {
            image: image.to_owned(),
            line,
            sample,
        }
    }

    #[test]
    fn a_network_is_read_and_what_is_left_out_is_told() {
        let file = parse_network(NETWORK.as_bytes()).unwrap();
        assert_eq!(file.ties.len(), 2);
        assert_eq!(file.ties[0].id, "p1");
        assert_eq!(
            file.ties[0].measures,
            [measure("A", 0.5, 2.0), measure("B", 7.5, 6.5)]
        );
        assert_eq!(file.ties[1].measures, [measure("C", 3.5, 4.5)]);
        assert_eq!(file.ignored, 2);
        assert_eq!(file.complaints.len(), 1);
        assert!(
            file.complaints[0]
                .text
                .contains("point p2: SerialNumber A, Line x")
        );
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
    fn a_file_without_a_readable_record_says_what_these_lack() {
        let refused = |rows: &str| {
            let table = format!("point_id,serial_number,sample,line\n{rows}");
            readable(parse_table(table.as_bytes()).unwrap())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            refused("1,A,,2\n1,B,3,x\n"),
            "not one of its records can be read (2 in all); record 2: point_id \"1\", serial_number \"A\", sample \"\", line \
             \"2\": expected two names and two numbers"
        );
        assert_eq!(
            refused("1,A,1\n"),
            "not one of its records can be read (1 in all); record 2: 3 fields; expected 4, as in the header"
        );
        assert!(refused(",A,1,2\n").contains("point_id \"\""));
        assert!(readable(parse_table(b"point_id,serial_number,sample,line\n").unwrap()).is_ok());
    }

    #[test]
    fn a_table_that_is_written_is_read_again() {
        let ties = [("1", 0.5), ("two, or 2", 7.25)].map(|(id, line)| TiePoint {
            id: id.to_owned(),
            measures: vec![measure("A", line, 3.0), measure("B", 9.0, line)],
        });
        let file = parse_table(ties_table(&ties).as_bytes()).unwrap();
        assert_eq!(file.ties, ties);
        assert_eq!((file.ignored, file.complaints.len()), (0, 0));
    }

    #[test]
    fn what_is_no_network_is_refused() {
        let binary = b"Object = ProtoBuffer\n Object = Core\n HeaderStartByte = 65536\n End_Object\nEnd_Object\nEnd\n\0\x01";
        assert_eq!(parse_network(binary), Err(TieError::Binary));
        assert_eq!(parse_network(b"A = 1\n"), Err(TieError::NoNetwork));
        assert!(matches!(parse_network(b"\x00"), Err(TieError::Label(_))));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = parse_network(&bytes);
            let _ = parse_table(&bytes);
        }
    }
}
