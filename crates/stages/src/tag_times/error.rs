//! Errors of image times.

use areograph_base::{
    error::Cause,
    image::{IMAGE_DURATION_END_S, IMAGE_LINES_MIN},
};

/// An image whose times cannot be determined.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(super) enum ImageError {
    #[error("image {image}: {key} is neither in the label nor in the configuration")]
    #[cause(Configuration: "add `{key}` to the image's table, or name its label")]
    Missing { image: String, key: &'static str },
    #[error(
        "image {0}: the label states no line times, because the image file contains them beside each line; expected line times"
    )]
    #[cause(
        "give the archive file, with label and rows in one file, as images.label, or the pieces of the line times as \
         images.exposures"
    )]
    NoLineTimes(String),
    #[error(
        "image {image}: lines_header is {stated}, but the file of its label has {found} lines; expected agreement"
    )]
    #[cause(
        "omit lines_header, or give the label without rows, and images.exposures for the lines"
    )]
    LinesOfFile {
        image: String,
        stated: u32,
        found: u32,
    },
    #[error(
        "image {image}: line period {stated_ms} ms is stated, but exposure {exposure_ms} ms × summing {summing} gives \
         {computed_ms} ms; expected agreement within the rounding of 0.0001 ms"
    )]
    #[cause("give the exposure of one detector line, or the period of summed lines, not a mixture")]
    Period {
        image: String,
        stated_ms: f64,
        exposure_ms: f64,
        summing: u32,
        computed_ms: f64,
    },
    #[error(
        "image {image}: {delivered} lines delivered, {header} in the header; expected at most the number in the header"
    )]
    #[cause(
        "lines_header counts the lines that the camera exposed, lines_delivered the lines in the file"
    )]
    Lines {
        image: String,
        delivered: u32,
        header: u32,
    },
    #[error(
        "image {image}: {lines} lines of {line_period_s} s; expected at least {IMAGE_LINES_MIN} lines, a \
         positive period and less than {IMAGE_DURATION_END_S} s in all"
    )]
    #[cause("check lines_header, the exposure (milliseconds) and the summing")]
    Duration {
        image: String,
        lines: u32,
        line_period_s: f64,
    },
}
