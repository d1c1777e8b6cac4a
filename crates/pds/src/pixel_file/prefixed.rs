//! Rows of samples with a prefix each, as in HRSC files.

use std::{fs::File, path::Path};

use super::rows::Rows;
use crate::hrsc::{Number, Raster};
use areograph_base::error::{IoError, Result};

/// Lines read at a time.
const LINES_AT_ONCE: u32 = 64;

/// Description of the number type for users.
pub(super) fn description(raster: &Raster) -> String {
    let number = match raster.number {
        Number::Byte => "8 bits",
        Number::Signed => "16 bits with a sign",
        Number::Unsigned => "16 bits",
    };
    let order = match (raster.number, raster.is_lsb) {
        (Number::Byte, _) => "",
        (_, true) => ", least significant byte first",
        (_, false) => ", most significant byte first",
    };
    format!("rows with prefixes, {number}{order}")
}

/// The lines from the first one on; a sample of 0 is missing, and a line with only zeros was not transmitted.
///
/// # Errors
/// The file cannot be read.
pub(super) fn rows(raster: &Raster, path: &Path) -> Result<Box<dyn Rows>> {
    let file = File::open(path).map_err(IoError::on("open"))?;
    let (raster, line) = (*raster, 0);
    Ok(Box::new(PrefixedRows { raster, file, line }))
}

#[derive(Debug)]
struct PrefixedRows {
    raster: Raster,
    file: File,
    line: u32,
}

impl Rows for PrefixedRows {
    fn size(&self) -> [u32; 2] {
        [self.raster.lines, self.raster.samples]
    }

    fn is_bytes(&self) -> bool {
        self.raster.number == Number::Byte
    }

    fn next_rows(&mut self) -> Result<Option<Vec<f64>>> {
        let lines = LINES_AT_ONCE.min(self.raster.lines - self.line);
        if lines == 0 {
            return Ok(None);
        }
        let samples = self.raster.samples_of(&self.file, self.line, lines);
        let mut samples = samples.map_err(IoError::on("read"))?;
        self.line += lines;
        for sample in &mut samples {
            if sample.abs() < 0.5 {
                *sample = f64::NAN;
            }
        }
        Ok(Some(samples))
    }
}
