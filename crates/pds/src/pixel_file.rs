//! Pixel files: images as archived, of MOC and HRSC, and their substitutes: ISIS cubes, TIFF and PNG of one greyscale
//! band.
//!
//! All of them are read strip by strip, in 8 bits. Other number types are scaled between their minimum and maximum.

mod cube;
mod pictures;
mod prefixed;
mod pyramid;
mod rows;

use std::path::{Path, PathBuf};

pub use self::pyramid::Pyramid;
use self::{
    cube::Cube,
    pictures::Picture,
    rows::{Rows, Scale},
};
use super::{
    hrsc::{Raster, is_hrsc},
    image_file::{Complaint, ImageFile, LineState, Strip, Strips},
    image_label::{ImageLabel, projection},
    label::{Label, LabelError, parse},
    moc::image_label,
    read_label::Labelled,
};
use areograph_base::{
    error::{Cause, IoError, Locate as _, Result},
    instruments::Instrument,
};

/// An open pixel file.
#[derive(Debug)]
pub enum PixelFile {
    /// An archived image.
    Archive(Box<ImageFile>),
    /// Anything else.
    Other(Box<OtherFile>),
}

/// A cube, a picture, or an image with uncompressed rows.
#[derive(Debug)]
pub struct OtherFile {
    path: PathBuf,
    kind: OtherKind,
    /// Lines and samples.
    size: [u32; 2],
    label: Option<ImageLabel>,
    is_projected: bool,
}

#[derive(Debug)]
enum OtherKind {
    Cube(Cube),
    Picture(Picture),
    Prefixed(Raster),
}

/// A file whose pixels cannot be read.
#[derive(Debug, thiserror::Error, Cause)]
#[non_exhaustive]
#[cause(Input)]
pub enum PixelFileError {
    /// A value of a label.
    #[error("{key} is {value:?}; expected {expected}")]
    #[cause("give an ISIS cube with one band and with the pixels in the same file")]
    Value {
        /// The keyword.
        key: &'static str,
        /// Its value.
        value: String,
        /// Expected value.
        expected: &'static str,
    },
    /// A cube whose pixels end before their last line.
    #[error("the file has {found} bytes; expected {expected}, as its label states")]
    #[cause("fetch or regenerate the cube: it is truncated")]
    Short {
        /// Bytes of the file.
        found: u64,
        /// Bytes by the label.
        expected: u64,
    },
    /// A picture that its library rejects, or of a different kind.
    #[error("{format}: {reason}")]
    #[cause(
        "give a complete greyscale picture of one band with 8, 16 or 32 bits per pixel; a TIFF must be uncompressed, \
         or use LZW or deflate compression"
    )]
    Picture {
        /// Its format.
        format: &'static str,
        /// The fault.
        reason: String,
    },
}

impl PixelFile {
    /// Opens a file by its content: a cube, a TIFF, a PNG, or an archived image by one of `cameras`.
    ///
    /// # Errors
    /// The file cannot be read; errors of [`ImageFile::open`], of [`read_label`](super::read_label()), and
    /// [`PixelFileError`].
    pub fn open(path: &Path, cameras: &[Instrument]) -> Result<Self> {
        let labelled = Labelled::open(path)?;
        let start = &labelled.start;
        if let Some(picture) = Picture::recognise(start) {
            let size = picture.rows(path).in_file(path)?.size();
            return Ok(Self::Other(Box::new(OtherFile {
                path: path.to_owned(),
                kind: OtherKind::Picture(picture),
                size,
                label: None,
                is_projected: false,
            })));
        }
        let label = parse(start).in_file(path)?;
        if is_hrsc(&label) && !is_cube(&label) {
            return Self::prefixed(&labelled, &label, cameras);
        }
        if !is_cube(&label) {
            return Ok(Self::Archive(Box::new(ImageFile::open(path, cameras)?)));
        }
        let cube = Cube::of(&label, path).in_file(path)?;
        Ok(Self::Other(Box::new(OtherFile {
            path: path.to_owned(),
            size: cube.size(),
            kind: OtherKind::Cube(cube),
            is_projected: projection(&label).is_some(),
            // The camera of a cube may be unknown.
            label: image_label(&label, cameras).ok(),
        })))
    }

    /// An image whose rows have prefixes.
    fn prefixed(labelled: &Labelled, label: &Label, cameras: &[Instrument]) -> Result<Self> {
        let path = &labelled.path;
        if !label.ended {
            return Err(LabelError::NoEnd).in_file(path);
        }
        let image = labelled.hrsc(label, cameras)?;
        let raster = image.rows().in_file(path)?;
        Ok(Self::Other(Box::new(OtherFile {
            path: path.clone(),
            kind: OtherKind::Prefixed(raster),
            size: [raster.lines, raster.samples],
            label: Some(image.label),
            is_projected: false,
        })))
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Archive(image) => image.path(),
            Self::Other(other) => &other.path,
        }
    }

    /// Lines.
    #[must_use]
    pub fn lines(&self) -> u32 {
        match self {
            Self::Archive(image) => image.layout().lines,
            Self::Other(other) => other.size[0],
        }
    }

    /// Samples of a line.
    #[must_use]
    pub fn samples(&self) -> u32 {
        match self {
            Self::Archive(image) => image.layout().samples,
            Self::Other(other) => other.size[1],
        }
    }

    /// Times, size and camera from the label; `None` for a picture.
    #[must_use]
    pub fn label(&self) -> Option<&ImageLabel> {
        match self {
            Self::Archive(image) => Some(image.label()),
            Self::Other(other) => other.label.as_ref(),
        }
    }

    /// Whether the pixels are map-projected.
    #[must_use]
    pub fn is_projected(&self) -> bool {
        match self {
            Self::Archive(_) => false,
            Self::Other(other) => other.is_projected,
        }
    }

    /// The archived image, if it is one.
    #[must_use]
    pub fn archive(&self) -> Option<&ImageFile> {
        match self {
            Self::Archive(image) => Some(image),
            Self::Other(_) => None,
        }
    }

    /// The kind of pixels of a file that is not an archived image.
    #[must_use]
    pub fn other_kind(&self) -> Option<String> {
        match self {
            Self::Archive(_) => None,
            Self::Other(other) => Some(match &other.kind {
                OtherKind::Cube(cube) => cube.to_string(),
                OtherKind::Picture(picture) => picture.to_string(),
                OtherKind::Prefixed(raster) => prefixed::description(raster),
            }),
        }
    }

    /// The image from its first line on, in strips.
    ///
    /// # Errors
    /// The file cannot be read; pictures that their libraries reject.
    pub fn strips(&self) -> Result<PixelStrips> {
        let source = match self {
            Self::Archive(image) => Source::Archive(Box::new(image.strips()?)),
            Self::Other(other) => {
                let scale = other.scale()?;
                Source::Rows {
                    rows: other.rows()?,
                    scale,
                    line: 0,
                }
            }
        };
        Ok(PixelStrips {
            path: self.path().to_owned(),
            source,
        })
    }
}

/// The lines of a TIFF as numbers, from the first one on.
///
/// # Errors
/// The file cannot be read; a picture that is not of one greyscale band, or that its library rejects.
pub(super) fn tiff_rows(path: &Path) -> Result<Box<dyn Rows>> {
    Picture::Tiff.rows(path)
}

/// Whether the label describes pixels of an ISIS cube.
pub(super) fn is_cube(label: &Label) -> bool {
    label.entries.iter().any(|entry| entry.group == "CORE")
}

impl OtherFile {
    fn rows(&self) -> Result<Box<dyn Rows>> {
        match &self.kind {
            OtherKind::Cube(cube) => cube.rows(&self.path),
            OtherKind::Picture(picture) => picture.rows(&self.path),
            OtherKind::Prefixed(raster) => prefixed::rows(raster, &self.path),
        }
        .in_file(&self.path)
    }

    /// Conversion of numbers to bytes: unchanged if they are bytes.
    fn scale(&self) -> Result<Scale> {
        let mut rows = self.rows()?;
        if rows.is_bytes() {
            return Ok(Scale::Bytes);
        }
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
        while let Some(numbers) = rows.next_rows().in_file(&self.path)? {
            for number in numbers.into_iter().filter(|number| number.is_finite()) {
                ends = [ends[0].min(number), ends[1].max(number)];
            }
        }
        Ok(Scale::Between(ends))
    }
}

/// Reads an image from its first line to its last.
#[derive(Debug)]
pub struct PixelStrips {
    path: PathBuf,
    source: Source,
}

#[derive(Debug)]
enum Source {
    Archive(Box<Strips>),
    Rows {
        rows: Box<dyn Rows>,
        scale: Scale,
        line: u32,
    },
}

impl PixelStrips {
    /// The next lines; `None` after the last one.
    ///
    /// # Errors
    /// The file cannot be read; a picture that its library rejects.
    pub fn next_strip(&mut self) -> Result<Option<Strip>> {
        match &mut self.source {
            Source::Archive(strips) => {
                let strip = strips.next_strip().map_err(IoError::on("read"));
                strip.in_file(&self.path)
            }
            Source::Rows { rows, scale, line } => {
                let [_, samples] = rows.size();
                let Some(numbers) = rows.next_rows().in_file(&self.path)? else {
                    return Ok(None);
                };
                let strip = strip(&numbers, *scale, *line, samples);
                *line += u32::try_from(strip.states.len()).unwrap_or_default();
                Ok(Some(strip))
            }
        }
    }

    /// Faults found while decoding so far, and their total number.
    #[must_use]
    pub fn complaints(&self) -> (&[Complaint], u64) {
        match &self.source {
            Source::Archive(strips) => (strips.complaints().kept(), strips.complaints().count()),
            Source::Rows { .. } => (&[], 0),
        }
    }

    /// The numbers that become 1 and 255, for a file whose numbers are not bytes.
    #[must_use]
    pub const fn range(&self) -> Option<[f64; 2]> {
        match self.source {
            Source::Rows {
                scale: Scale::Between(ends),
                ..
            } => Some(ends),
            _ => None,
        }
    }
}

/// Numbers as bytes; a line without valid numbers is missing.
fn strip(numbers: &[f64], scale: Scale, first_line: u32, samples: u32) -> Strip {
    let state = |line: &[f64]| {
        if line.iter().any(|number| number.is_finite()) {
            LineState::Good
        } else {
            LineState::Missing
        }
    };
    Strip {
        first_line,
        samples,
        pixels: numbers.iter().map(|number| scale.byte(*number)).collect(),
        states: numbers.chunks_exact(samples as usize).map(state).collect(),
    }
}

#[cfg(test)]
mod tests;
