//! The index of a volume of kernels, `dsindex.tab`: a row for every kernel, of fixed length, as its label describes.

use areograph_pds::{
    index_columns::{Column, fields, of_label},
    label,
};

use crate::{error::FetchError, safe::is_path, utc::Utc};

/// A kernel of the archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KernelRow {
    /// Its overall coverage; `None` for text kernels.
    pub span: Option<[Utc; 2]>,
    /// Path below the volume.
    pub path: String,
    /// Type: `SPK`, `CK`, `LSK`, …
    pub kind: String,
    /// Time at which it was made, as the index states it.
    pub created: String,
    /// Line of the index, from 1.
    pub line: usize,
}

impl KernelRow {
    /// Name of its file.
    #[must_use]
    pub fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or(&self.path)
    }
}

/// The columns that are read.
const NEEDED: [&str; 5] = [
    "START_TIME",
    "STOP_TIME",
    "FILE_SPECIFICATION_NAME",
    "KERNEL_TYPE_ID",
    "PRODUCT_ID",
];

/// The kernels of an index.
///
/// # Errors
/// [`FetchError::Index`] for a label without a required column, and for the first row that is cut, cannot be split, has
/// no time where it must have one, or a path that leads out of the volume.
pub fn kernel_rows(table: &[u8], label: &[u8]) -> Result<Vec<KernelRow>, FetchError> {
    let of_label_at = |problem: String| FetchError::Index { line: 1, problem };
    let label = label::parse(label).map_err(|error| of_label_at(format!("label: {error}")))?;
    let columns = of_label(&label);
    for needed in NEEDED {
        if !columns.iter().any(|column| column.name == needed) {
            return Err(of_label_at(format!(
                "the label does not define the column {needed}"
            )));
        }
    }
    let stated = |key: &str| {
        let mut entries = label.entries.iter();
        let entry = entries.find(|entry| entry.key == key)?;
        entry.value.parse::<usize>().ok()
    };
    let row_bytes = stated("ROW_BYTES").or_else(|| stated("RECORD_BYTES"));
    let mut rows = Vec::new();
    for (number, row) in table.split_inclusive(|byte| *byte == b'\n').enumerate() {
        if row.trim_ascii().is_empty() {
            continue;
        }
        let content = without_line_end(row);
        let read = match row_bytes {
            // A copy may have lost the first byte of its line ends.
            Some(expected) if row.len() != expected && content.len() + 2 != expected => {
                Err(format!(
                    "{} bytes; expected {expected}, as the label states",
                    row.len()
                ))
            }
            _ => of_row(row.trim_ascii_end(), &columns, number + 1),
        };
        rows.push(read.map_err(|problem| FetchError::Index {
            line: number + 1,
            problem,
        })?);
    }
    match (rows.len(), stated("ROWS")) {
        (0, _) => Err(of_label_at("the table is empty".to_owned())),
        (found, Some(expected)) if found != expected => Err(FetchError::Index {
            line: found,
            problem: format!(
                "the last of {found} rows; expected {expected} rows, as the label states"
            ),
        }),
        _ => Ok(rows),
    }
}

fn without_line_end(row: &[u8]) -> &[u8] {
    let row = row.strip_suffix(b"\n").unwrap_or(row);
    row.strip_suffix(b"\r").unwrap_or(row)
}

fn of_row(row: &[u8], columns: &[Column], line: usize) -> Result<KernelRow, String> {
    let fields = fields(row, columns)?;
    let text = |key: &str| fields.get(key).map(|text| text.trim()).unwrap_or_default();
    let (label, name) = (text("FILE_SPECIFICATION_NAME"), text("PRODUCT_ID"));
    // The index names the label of a kernel, which is beside it.
    let path = match label.rsplit_once('/') {
        Some((folder, _)) => format!("{folder}/{name}"),
        None => name.to_owned(),
    };
    if !is_path(&path) {
        return Err(format!("{path:?} is not a path below the volume"));
    }
    let kind = text("KERNEL_TYPE_ID").to_ascii_uppercase();
    let span = match (text("START_TIME"), text("STOP_TIME")) {
        ("N/A", "N/A") => None,
        (start, stop) => {
            let span = Utc::parse(start).zip(Utc::parse(stop));
            let span = span.filter(|(start, stop)| start <= stop);
            let problem = || {
                format!("times are {start:?} and {stop:?}; expected two instants in order, or N/A")
            };
            Some(
                span.map(|(start, stop)| [start, stop])
                    .ok_or_else(problem)?,
            )
        }
    };
    if span.is_none() && ["SPK", "CK"].contains(&&*kind) {
        return Err(format!(
            "the index row of type {kind} has no START_TIME and STOP_TIME"
        ));
    }
    Ok(KernelRow {
        span,
        path,
        kind,
        created: text("PRODUCT_CREATION_TIME").to_owned(),
        line,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABEL: &str = "ROW_BYTES = 106\nROWS = 2\n\
        OBJECT = COLUMN\nNAME = START_TIME\nSTART_BYTE = 1\nBYTES = 23\nEND_OBJECT = COLUMN\n\
        OBJECT = COLUMN\nNAME = STOP_TIME\nSTART_BYTE = 25\nBYTES = 23\nEND_OBJECT = COLUMN\n\
        OBJECT = COLUMN\nNAME = FILE_SPECIFICATION_NAME\nSTART_BYTE = 50\nBYTES = 25\nEND_OBJECT = COLUMN\n\
        OBJECT = COLUMN\nNAME = KERNEL_TYPE_ID\nSTART_BYTE = 78\nBYTES = 4\nEND_OBJECT = COLUMN\n\
        OBJECT = COLUMN\nNAME = PRODUCT_ID\nSTART_BYTE = 85\nBYTES = 19\nEND_OBJECT = COLUMN\nEND\n";

    fn row(start: &str, stop: &str, label: &str, kind: &str, name: &str) -> String {
        format!("{start:23},{stop:23},\"{label:25}\",\"{kind:4}\",\"{name:19}\"\r\n")
    }

    fn good() -> String {
        let covered = ["1999-08-01T00:00:00.000", "1999-09-01T00:00:00.000"];
        row(covered[0], covered[1], "data/ck/a.lbl", "CK", "a.bc")
            + &row("\"N/A\"", "\"N/A\"", "data/lsk/n.lbl", "LSK", "n.tls")
    }

    #[test]
    fn rows_have_coverage_and_the_path_of_the_kernel() {
        let rows = kernel_rows(good().as_bytes(), LABEL.as_bytes()).unwrap();
        assert_eq!(
            (&*rows[0].path, &*rows[0].kind, rows[0].name()),
            ("data/ck/a.bc", "CK", "a.bc")
        );
        assert_eq!(
            rows[0].span.unwrap()[1].to_string(),
            "1999-09-01T00:00:00.000"
        );
        assert_eq!((rows[1].span, rows[1].line), (None, 2));
    }

    #[test]
    fn malformed_rows_are_refused_with_their_line() {
        let refused = |table: String, label: &str, expected: &str| {
            let told = kernel_rows(table.as_bytes(), label.as_bytes())
                .unwrap_err()
                .to_string();
            assert!(told.contains(expected), "{told}");
        };
        let first = row("1999-08-01", "1999-09-01", "../../etc/x.lbl", "CK", "a.bc");
        refused(
            first,
            LABEL,
            "line 1: \"../../etc/a.bc\" is not a path below the volume",
        );
        refused(
            row("1999-09-01", "1999-08-01", "data/a.lbl", "CK", "a.bc"),
            LABEL,
            "expected two instants in order",
        );
        refused(
            row("\"N/A\"", "\"N/A\"", "data/a.lbl", "SPK", "a.bsp"),
            LABEL,
            "the index row of type SPK has no START_TIME",
        );
        refused(
            good()[..150].to_owned(),
            LABEL,
            "line 2: 44 bytes; expected 106",
        );
        refused(
            good()[..106].to_owned(),
            LABEL,
            "the last of 1 rows; expected 2",
        );
        refused(String::new(), LABEL, "the table is empty");
        // Line ends of another system are no damage.
        let copied = good().replace('\r', "");
        assert_eq!(
            kernel_rows(copied.as_bytes(), LABEL.as_bytes())
                .unwrap()
                .len(),
            2
        );
        refused(
            good(),
            &LABEL.replace("PRODUCT_ID", "PRODUCT"),
            "does not define the column PRODUCT_ID",
        );
    }
}
