//! PNG, compressed line by line.

use std::{
    fs::File,
    io::{self, BufWriter, Write as _},
};

use png::{BitDepth, ColorType, Encoder, StreamWriter};

use super::{PictureError, PictureHead};

pub(super) struct PngLines {
    stream: StreamWriter<'static, BufWriter<File>>,
}

impl std::fmt::Debug for PngLines {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("PngLines")
    }
}

impl PngLines {
    pub(super) fn new(file: File, head: &PictureHead) -> Result<Self, PictureError> {
        let mut encoder = Encoder::new(BufWriter::new(file), head.width, head.height);
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(if head.is_deep {
            BitDepth::Sixteen
        } else {
            BitDepth::Eight
        });
        for (name, text) in &head.notes {
            encoder.add_text_chunk((*name).to_owned(), text.clone())?;
        }
        let stream = encoder.write_header()?.into_stream_writer()?;
        Ok(Self { stream })
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    pub(super) fn finish(self) -> Result<(), PictureError> {
        Ok(self.stream.finish()?)
    }
}
