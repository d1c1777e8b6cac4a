//! Labels of images of all known cameras: each is read by the rules of its mission.

use std::{
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

use super::{
    hrsc::{self, HrscFile},
    image_label::ImageLabel,
    label::{LABEL_BYTES_MAX, Label, LabelError, parse},
    moc,
};
use areograph_base::{
    error::{IoError, Locate as _, Result},
    instruments::Instrument,
};

/// A file with its label.
#[derive(Debug)]
pub(super) struct Labelled {
    pub(super) path: PathBuf,
    pub(super) file: File,
    /// Its first bytes, at most [`LABEL_BYTES_MAX`].
    pub(super) start: Vec<u8>,
}

impl Labelled {
    /// Opens a file and reads its start.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let mut file = File::open(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        let mut start = Vec::new();
        let read = (&mut file)
            .take(LABEL_BYTES_MAX as u64)
            .read_to_end(&mut start);
        read.map_err(IoError::on("read")).in_file(path)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            start,
        })
    }

    /// The label and the rows of a file of HRSC.
    ///
    /// # Errors
    /// As [`HrscFile::of`].
    pub(super) fn hrsc(&self, label: &Label, cameras: &[Instrument]) -> Result<HrscFile> {
        let read = HrscFile::of(&self.path, &self.file, &self.start, label, cameras);
        read.in_file(&self.path)
    }
}

/// Reads a PDS3 label (attached or detached) or an ISIS label of an image by one of `cameras`; also the line times of a
/// file whose rows contain them.
///
/// # Errors
/// The file cannot be read; no label, or a cut one; an instrument that is not among `cameras`, or none; an image of a
/// different spacecraft or target, or one that is map-projected; a value that is not of its kind, or two values under
/// one keyword; rows that do not belong to the label, or whose times contradict each other.
pub fn read_label(path: &Path, cameras: &[Instrument]) -> Result<ImageLabel> {
    let labelled = Labelled::open(path)?;
    let label = parse(&labelled.start).in_file(path)?;
    if !label.ended {
        return Err(LabelError::NoEnd).in_file(path);
    }
    if hrsc::is_hrsc(&label) {
        let file = labelled.hrsc(&label, cameras)?;
        match file.timeless {
            Some(why) => Err(why).in_file(path),
            None => Ok(file.label),
        }
    } else {
        moc::image_label(&label, cameras).in_file(path)
    }
}

/// The product at the start of a name: `E0202855` of `E02-02855`, `H5270_0000_IR2` of `h5270_0000_ir2.img`; `None` if
/// the name contains no product.
#[must_use]
pub fn product_named(name: &str) -> Option<String> {
    hrsc::product_named(name).or_else(|| moc::product_named(name))
}
