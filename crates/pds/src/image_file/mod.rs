//! Images of the Mars Orbiter Camera as archived: `.imq` files with the fragments that the spacecraft sent, coded by
//! prediction or by a transform of blocks, and `.img` files with one byte a pixel.
//!
//! An image is read strip by strip; damaged or missing data are marked by line, with a complaint that names fragment
//! and byte. Memory is bounded by a strip, whatever sizes a file states.
//!
//! Fragments are found first, without decoding (`fragment.rs`), and form one stream of which a window is in memory
//! (`stream.rs`). A header is trusted only as far as its data extend. In a damaged predictive image a first pass
//! locates missing lines (`placed.rs`); lines that cannot be placed are marked. The tables of the coders are text files
//! beside the code. Rows of HRSC (`hrsc`: label, prefixes, line times), cubes, TIFF and PNG pass through the same
//! strips (`pixel_file`), at most 16 million numbers at a time.

mod bits;
mod codes;
mod coding;
mod complaint;
mod contradiction;
mod encode;
mod encode_transform;
mod fragment;
mod header;
mod opened;
mod placed;
mod predictive;
mod radiometry;
mod statistics;
mod stream;
mod strip;
mod strips;
mod transform;
mod walk;

pub use self::{
    coding::{Coding, Predictor, Transform},
    complaint::{Complaint, Complaints, Fault},
    encode::{EncodeError, Encoded, NewImage, encode},
    fragment::Layout,
    opened::{ImageFile, ImageFileError},
    radiometry::{OddEven, Radiometry},
    statistics::{PixelStatistics, Statistics},
    strip::{LineState, Strip},
    strips::Strips,
};
