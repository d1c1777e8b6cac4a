//! Bytes and JSON to disk and back.

use std::{
    fs::{self, File},
    io::{BufWriter, Read as _, Write as _},
    path::Path,
};

use serde::Serialize;
use serde_json::Value;

use super::error::ProductError;
use areograph_base::error::{IoError, Locate, Result};

/// Bytes that are written at once.
const BUFFER_BYTES: usize = 1 << 17;

/// Creates `path`, its folder made where missing, to be written piece by piece and [`finish`]ed.
pub(super) fn create(path: &Path) -> Result<BufWriter<File>> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)
            .map_err(IoError::on("make the folder"))
            .in_file(folder)?;
    }
    let file = File::create(path)
        .map_err(IoError::on("create"))
        .in_file(path)?;
    Ok(BufWriter::with_capacity(BUFFER_BYTES, file))
}

/// Writes the rest of the buffer. All products are flushed to the disk together, before they receive their names.
pub(super) fn finish(path: &Path, mut file: BufWriter<File>) -> Result<()> {
    file.flush().map_err(IoError::on("write")).in_file(path)
}

/// Writes `bytes` to `path`, its folder made where missing.
///
/// # Errors
/// Errors of the disk.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = create(path)?;
    file.write_all(bytes)
        .map_err(IoError::on("write"))
        .in_file(path)?;
    finish(path, file)
}

/// Opens `path` for reading.
pub(super) fn open(path: &Path) -> Result<File> {
    File::open(path).map_err(IoError::on("open")).in_file(path)
}

/// Writes `text` and checks that the file holds it.
pub(super) fn write_text(path: &Path, text: &str) -> Result<()> {
    write_checked(path, text.as_bytes())
}

/// Writes bytes and reads them back.
///
/// # Errors
/// Errors of the disk; bytes that are read back differently.
pub(super) fn write_checked(path: &Path, bytes: &[u8]) -> Result<()> {
    write_bytes(path, bytes)?;
    if read_bytes(path)? == bytes {
        return Ok(());
    }
    Err(ProductError::ReadBack {
        what: format!("{} bytes", bytes.len()),
    })
    .in_file(path)
}

/// All bytes of `path`.
///
/// # Errors
/// Errors of the disk.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?
        .read_to_end(&mut bytes)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    Ok(bytes)
}

/// Writes `document` as indented JSON and reads it back.
///
/// # Errors
/// Numbers that are not finite; errors of the disk; a document that is read back differently.
pub fn write_json(path: &Path, document: &impl Serialize) -> Result<()> {
    let written = to_value(document).in_file(path)?;
    let text = serde_json::to_string_pretty(document)
        .map_err(ProductError::refused("encode JSON"))
        .in_file(path)?;
    write_bytes(path, (text + "\n").as_bytes())?;
    let found: Value = serde_json::from_slice(&read_bytes(path)?)
        .map_err(ProductError::unreadable)
        .in_file(path)?;
    if found == written {
        return Ok(());
    }
    Err(ProductError::ReadBack {
        what: "the document".to_owned(),
    })
    .in_file(path)
}

/// `document` as a JSON value.
///
/// # Errors
/// Numbers that are not finite, which JSON would turn into null: products have no nulls, unknown
/// values are omitted.
pub(super) fn to_value(document: &impl Serialize) -> std::result::Result<Value, ProductError> {
    let value = serde_json::to_value(document).map_err(ProductError::refused("encode JSON"))?;
    find_null(&value).map_or(Ok(value), |what| Err(ProductError::NotFinite { what }))
}

/// JSON pointer to the first null.
fn find_null(value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(String::new()),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .find_map(|(index, item)| Some(format!("/{index}{}", find_null(item)?))),
        Value::Object(members) => members
            .iter()
            .find_map(|(key, member)| Some(format!("/{key}{}", find_null(member)?))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::error::Kind;

    #[test]
    fn numbers_that_json_cannot_hold_are_named_and_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.json");
        let failure = write_json(&path, &serde_json::json!({"a": [1.0, f64::NAN]})).unwrap_err();
        assert_eq!(failure.kind(), Kind::Bug);
        assert_eq!(failure.cause.to_string(), "/a/1 is not a finite number");
        assert!(!path.exists());
    }

    #[test]
    fn every_digit_of_a_number_survives_json() {
        let folder = tempfile::tempdir().unwrap();
        let numbers: Vec<f64> = (1..2000)
            .map(|k| f64::from(k).sqrt().exp() * 1e-9)
            .collect();
        write_json(&folder.path().join("numbers.json"), &numbers).unwrap();
    }
}
