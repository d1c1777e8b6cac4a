//! Pictures of one band, 8 or 16 bits, written line by line: PNG, and TIFF with tiles and overviews.

mod georeference;
mod png_lines;
mod tiff_tiles;

use std::{fs::File, io::BufReader, path::Path};

use tiff::{decoder::Decoder, tags::Tag};

use self::{png_lines::PngLines, tiff_tiles::TiffTiles};
use areograph_base::error::{Cause, IoError, Kind, Locate as _, Result};
use areograph_pds::control_table::ImageControl;
use areograph_store::files::{Mark, MarkAt, StagedFile};

/// Format of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// PNG, lines compressed.
    Png,
    /// TIFF in tiles of 256 × 256 pixels without compression, with overviews of half, a quarter … of the size.
    Tiff,
}

/// Name of the first note of every picture, by which areograph recognises it.
const SOFTWARE: &str = "Software";

impl PictureFormat {
    /// Mark by which an earlier picture is recognised.
    const fn mark(self) -> Mark {
        Mark {
            what: "a picture that this command wrote",
            at: match self {
                Self::Png => MarkAt::Head("Software\0areograph ", 4096),
                Self::Tiff => MarkAt::Content(is_own_tiff),
            },
        }
    }
}

fn is_own_tiff(path: &Path) -> bool {
    let decoder = File::open(path).map(|file| Decoder::new(BufReader::new(file)));
    let Ok(Ok(mut decoder)) = decoder else {
        return false;
    };
    let description = decoder.get_tag_ascii_string(Tag::ImageDescription);
    description.is_ok_and(|text| text.starts_with("Software: areograph "))
}

/// Size and contents of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureHead {
    /// Samples of a line.
    pub width: u32,
    /// Lines.
    pub height: u32,
    /// Whether a pixel has 16 bits instead of 8.
    pub is_deep: bool,
    /// Descriptions, one `name: text` each; the program is described by itself.
    pub notes: Vec<(&'static str, String)>,
    /// Ground control points, which only a TIFF holds.
    pub control: Option<ImageControl>,
}

impl PictureHead {
    const fn bytes_of_pixel(&self) -> usize {
        if self.is_deep { 2 } else { 1 }
    }
}

/// A picture that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("the {format} cannot be written: {reason}")]
struct PictureError {
    format: &'static str,
    reason: String,
    is_io: bool,
}

impl Cause for PictureError {
    fn kind(&self) -> Kind {
        if self.is_io { Kind::Io } else { Kind::Bug }
    }

    fn advice(&self) -> String {
        "check the disk, then run again".to_owned()
    }
}

/// A picture too large for its format.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{width} × {height} pixels make a TIFF of {bytes} bytes; expected at most 4294967295")]
#[cause(Input: "write a PNG; if the image is smaller than stated, `areograph image info` lists the errors of its \
                label")]
struct TooLarge {
    width: u32,
    height: u32,
    bytes: u64,
}

impl From<png::EncodingError> for PictureError {
    fn from(error: png::EncodingError) -> Self {
        Self {
            format: "PNG",
            is_io: matches!(error, png::EncodingError::IoError(_)),
            reason: error.to_string(),
        }
    }
}

impl From<tiff::TiffError> for PictureError {
    fn from(error: tiff::TiffError) -> Self {
        Self {
            format: "TIFF",
            is_io: matches!(error, tiff::TiffError::IoError(_)),
            reason: error.to_string(),
        }
    }
}

/// A picture being written; it gets its final name when complete.
#[derive(Debug)]
pub struct PictureFile {
    file: StagedFile,
    head: PictureHead,
    writer: Writer,
}

#[derive(Debug)]
enum Writer {
    Png(Box<PngLines>),
    Tiff(TiffTiles),
}

impl PictureFile {
    /// Creates a picture beside `path`.
    ///
    /// # Errors
    /// The folder cannot be written; an existing file that is not such a picture; a TIFF of more than 4 GiB.
    pub fn create(path: &Path, format: PictureFormat, mut head: PictureHead) -> Result<Self> {
        let software = format!("areograph {}", env!("CARGO_PKG_VERSION"));
        head.notes.insert(0, (SOFTWARE, software));
        if format == PictureFormat::Tiff {
            let (width, height, bytes) = (head.width, head.height, tiff_tiles::bytes_of(&head));
            if u32::try_from(bytes).is_err() {
                let too_large = TooLarge {
                    width,
                    height,
                    bytes,
                };
                return Err(too_large).in_file(path);
            }
        }
        let file = StagedFile::replacing(path, format.mark())?;
        let handle = file.writer()?;
        let writer = match format {
            PictureFormat::Png => {
                Writer::Png(Box::new(PngLines::new(handle, &head).in_file(path)?))
            }
            PictureFormat::Tiff => {
                let tiles = TiffTiles::new(handle);
                Writer::Tiff(tiles.map_err(IoError::on("create a file")).in_file(path)?)
            }
        };
        Ok(Self { file, head, writer })
    }

    /// Adds complete lines.
    ///
    /// # Errors
    /// The system's error on writing.
    pub fn write(&mut self, pixels: &[u16]) -> Result<()> {
        let bytes: Vec<u8> = match (&self.writer, self.head.is_deep) {
            (_, false) => pixels.iter().map(|pixel| pixel.to_le_bytes()[0]).collect(),
            (Writer::Png(_), true) => pixels
                .iter()
                .flat_map(|pixel| pixel.to_be_bytes())
                .collect(),
            (Writer::Tiff(_), true) => pixels
                .iter()
                .flat_map(|pixel| pixel.to_le_bytes())
                .collect(),
        };
        let written = match &mut self.writer {
            Writer::Png(lines) => lines.write(&bytes),
            Writer::Tiff(tiles) => tiles.write(&bytes),
        };
        written
            .map_err(IoError::on("write"))
            .in_file(self.file.path())
    }

    /// Ends the picture and gives it its name.
    ///
    /// # Errors
    /// The system's error on writing, flushing or renaming; fewer lines than declared.
    pub fn finish(self) -> Result<()> {
        let path = self.file.path();
        match self.writer {
            Writer::Png(lines) => lines.finish().in_file(path)?,
            Writer::Tiff(tiles) => tiles.finish(&self.head).in_file(path)?,
        }
        self.file.finish()
    }
}
