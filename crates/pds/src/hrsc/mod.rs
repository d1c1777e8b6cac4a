//! Images of the High Resolution Stereo Camera on Mars Express as archived at level 2: a PDS3 label, usually followed
//! by a VICAR label, and rows of samples, each with a prefix that contains the time of its line.
//!
//! # Source
//! Labels and files of data set MEX-M-HRSC-3-RDR; `hrsc2isis` of ISIS for the prefixes.

mod error;
mod label;
mod prefixes;
mod product;
mod raster;
mod times;
mod vicar;

use std::{fs::File, path::Path};

pub(super) use self::{
    error::HrscError,
    label::is_hrsc,
    product::product_named,
    raster::{Number, Raster},
};
use super::{
    image_label::{ImageLabel, RowTimes},
    label::Label,
};
use areograph_base::{
    error::{IoError, Result},
    instruments::Instrument,
};
use areograph_store::files::file_name;

/// A file with the label of an image.
#[derive(Debug)]
pub(super) struct HrscFile {
    /// The fields of the label and the times of the rows.
    pub(super) label: ImageLabel,
    /// The rows; `None` for a detached label.
    pub(super) raster: Option<Raster>,
    /// The reason for which the rows have no times; their samples can be used nevertheless.
    pub(super) timeless: Option<HrscError>,
}

impl HrscFile {
    /// The image whose `label` is at the `start` of a file.
    ///
    /// # Errors
    /// The file cannot be read; a label of another image or camera; rows that do not match the label.
    pub(super) fn of(
        path: &Path,
        file: &File,
        start: &[u8],
        label: &Label,
        cameras: &[Instrument],
    ) -> Result<Self> {
        let mut image = label::image_label(label, cameras)?;
        product::of_one_product(label, &file_name(path))?;
        let bytes = file.metadata().map_err(IoError::on("read"))?.len();
        let (raster, mut timeless) = (Raster::of(label, bytes)?, None);
        if let Some(raster) = &raster {
            vicar::agrees(label, start, raster)?;
            raster.confirm_byte_order(label, file)?;
            let prefixes = prefixes::read(raster, file).map_err(IoError::on("read"))?;
            let times = times::row_times(&prefixes).unwrap_or_else(|why| {
                let remarks = vec![why.to_string()];
                timeless = Some(why);
                RowTimes {
                    lines: raster.lines,
                    pieces: Vec::new(),
                    remarks,
                }
            });
            image.lines = Some(times);
        }
        Ok(Self {
            label: image,
            raster,
            timeless,
        })
    }

    /// The rows.
    ///
    /// # Errors
    /// A detached label.
    pub(super) fn rows(&self) -> Result<Raster> {
        Ok(self.raster.ok_or(HrscError::NoRows)?)
    }
}
