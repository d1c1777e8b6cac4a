//! Encoder of images as archived: label, fragments, checksums; used by the synthetic mission.

use std::fmt::Write as _;

use super::{
    bits::BitWriter,
    codes::RESIDUALS,
    coding::{Coding, Predictor, Transform},
    encode_transform::encode_blocks,
    fragment::FULL,
    predictive::{BLOCK_LINES, MARK},
    transform::EDGE,
    walk::HEADER,
};
use areograph_base::units::SECONDS_PER_MS;

/// Bytes of a record, and of the label.
const RECORD: usize = 2048;

/// An image to be written.
#[derive(Debug, Clone)]
pub struct NewImage<'a> {
    /// Product, for example `M01/00115`.
    pub product_id: &'a str,
    /// Instrument and filter as labels have them.
    pub instrument: [&'a str; 2],
    /// Spacecraft clock at the start of the first line: seconds and 1/256 s.
    pub clock: (u32, u8),
    /// UTC of the start of the first and the end of the last line.
    pub utc: [&'a str; 2],
    /// Exposure of one detector line, seconds.
    pub exposure_s: f64,
    /// Lines and pixels that were summed on board.
    pub summing: u8,
    /// First detector pixel, a multiple of 16.
    pub first_detector: u16,
    /// Samples of a line, a multiple of 16.
    pub samples: u32,
    /// Line by line.
    pub pixels: &'a [u8],
    /// Coding of the pixels.
    pub coding: Coding,
}

/// An image that cannot be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// A size that headers cannot represent.
    #[error(
        "{pixels} pixels in lines of {samples} samples; expected whole lines, with multiples of 16 samples and of 16 lines, \
         at most 4080 samples and 65535 × 16 lines"
    )]
    Size {
        /// Samples of a line.
        samples: u32,
        /// Pixels in all.
        pixels: usize,
    },
    /// A coding that is supported for reading only.
    #[error(
        "coding {0:?} is supported for reading only; expected raw, prediction with a table from 0 to 6, or cosine \
         transform"
    )]
    Coding(Coding),
}

/// The bytes of a `.imq` file.
pub type Encoded = Vec<u8>;

/// Writes an image into the bytes of a file.
///
/// # Errors
/// A size or a coding that cannot be written.
pub fn encode(image: &NewImage<'_>) -> Result<Encoded, EncodeError> {
    let (samples, pixels) = (image.samples, image.pixels.len());
    let size = EncodeError::Size { samples, pixels };
    let width = samples as usize;
    if width == 0 || !width.is_multiple_of(EDGE) || width > 4080 || pixels == 0 {
        return Err(size);
    }
    let lines_16 = pixels / (width * EDGE);
    if pixels != lines_16 * width * EDGE {
        return Err(size);
    }
    let Ok(lines_16) = u16::try_from(lines_16) else {
        return Err(size);
    };
    let fragments = match image.coding {
        Coding::Raw => cut(image.pixels, width),
        Coding::Predictive { predictor, table } if table < 7 => {
            cut(&predicted(image.pixels, width, predictor, table), width)
        }
        Coding::Transform {
            transform: Transform::Cosine,
            groups,
            spacing,
        } if (1..=8).contains(&groups) && spacing > 0 => {
            let rows = (FULL_BYTES / (width * EDGE)).max(1) * EDGE;
            let strips = image.pixels.chunks(rows * width).enumerate();
            let encoded = strips.map(|(number, strip)| Piece {
                first_line: number * rows,
                lines: strip.len() / width,
                data: encode_blocks(strip, width, groups, spacing),
            });
            encoded.collect()
        }
        other => return Err(EncodeError::Coding(other)),
    };
    let mut body = Vec::new();
    let last = fragments.len() - 1;
    for (number, piece) in fragments.iter().enumerate() {
        let from = body.len();
        body.extend(header(image, lines_16, number, piece, number == last));
        body.extend_from_slice(&piece.data);
        let sum: u64 = body[from..].iter().map(|byte| u64::from(*byte)).sum();
        // The checksum byte completes the end-around-carry sum to 255.
        body.push(255 - ((sum + 254) % 255 + 1).to_le_bytes()[0]);
    }
    body.resize(body.len().next_multiple_of(RECORD), 0);
    let mut file = label(image, &body);
    file.resize(RECORD, b' ');
    file.extend(body);
    Ok(file)
}

/// Data bytes of a full fragment.
const FULL_BYTES: usize = 245_760;
const _: () = assert!(FULL_BYTES as u64 == FULL);

/// The data of a fragment.
struct Piece {
    first_line: usize,
    lines: usize,
    data: Vec<u8>,
}

/// Cuts a stream into full fragments, with the nominal lines that their headers state.
fn cut(stream: &[u8], width: usize) -> Vec<Piece> {
    let pieces = stream.chunks(FULL_BYTES).enumerate();
    let cut = pieces.map(|(number, data)| Piece {
        first_line: number * FULL_BYTES / width,
        lines: data.len() / width,
        data: data.to_vec(),
    });
    cut.collect()
}

/// The stream of the predictive coder.
fn predicted(pixels: &[u8], width: usize, predictor: Predictor, table: u8) -> Vec<u8> {
    let code = &RESIDUALS[usize::from(table)];
    let words: Vec<(u32, u32)> = (0..=u8::MAX)
        .map(|residual| {
            let plain = i16::from(residual);
            let signed = i16::from(i8::from_le_bytes([residual]));
            code.word(if table == 0 { plain } else { signed })
                .unwrap_or_default()
        })
        .collect();
    let mut out = BitWriter::default();
    let mut above: &[u8] = &[];
    for (number, line) in pixels.chunks(width).enumerate() {
        if number.is_multiple_of(BLOCK_LINES as usize) {
            mark(&mut out);
            out.bytes().extend_from_slice(line);
        } else {
            let (mut left, mut left_above) = (0_u8, 0_u8);
            for (pixel, above) in line.iter().zip(above) {
                let predicted = match predictor {
                    Predictor::X => left,
                    Predictor::Y => *above,
                    Predictor::Xy => above.wrapping_add(left.wrapping_sub(left_above)),
                };
                let (bits, length) = words[usize::from(pixel.wrapping_sub(predicted))];
                out.push(bits, length);
                (left, left_above) = (*pixel, *above);
            }
        }
        above = line;
    }
    mark(&mut out);
    out.finish()
}

/// Writes the mark before an uncompressed line, and at the end, at an even byte.
fn mark(out: &mut BitWriter) {
    out.align();
    let bytes = out.bytes();
    if bytes.len() % 2 == 1 {
        bytes.push(0);
    }
    bytes.extend_from_slice(&MARK);
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "header fields wrap, as on board"
)]
fn header(
    image: &NewImage<'_>,
    lines_16: u16,
    number: usize,
    piece: &Piece,
    is_last: bool,
) -> [u8; HEADER] {
    let mut bytes = [0; HEADER];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    let product: String = image.product_id.chars().rev().take(5).collect();
    let product: String = product.chars().rev().collect();
    put(
        0,
        &(product.parse::<u32>().unwrap_or_default() as u16).to_le_bytes(),
    );
    put(2, &(number as u16).to_le_bytes());
    put(4, &((piece.first_line / EDGE) as u16).to_le_bytes());
    put(6, &((piece.lines / EDGE) as u16).to_le_bytes());
    put(8, &[image.clock.1]);
    put(9, &image.clock.0.to_le_bytes());
    put(13, &[u8::from(number == 0) | u8::from(is_last) << 1]);
    put(36, &[0x6A, 32]);
    put(40, &lines_16.to_le_bytes());
    put(
        42,
        &[
            (image.first_detector / 16) as u8,
            (image.samples / 16) as u8,
        ],
    );
    let (kind, table, spacing) = match image.coding {
        Coding::Raw => (0, 0, 0),
        Coding::Predictive { predictor, table } => (predictor as u8 + 1, table, 0),
        Coding::Transform {
            transform,
            groups,
            spacing,
        } => ((transform as u8 + 1) << 2, (groups - 1) << 5, spacing),
    };
    put(44, &[kind, table]);
    put(48, &spacing.to_le_bytes());
    let clock_units = (image.exposure_s / SECONDS_PER_MS * 1e4).round();
    put(55, &(clock_units as u16).to_le_bytes());
    put(58, &(piece.data.len() as u32).to_le_bytes());
    bytes
}

fn label(image: &NewImage<'_>, body: &[u8]) -> Vec<u8> {
    let width = image.samples as usize;
    let encoding = match image.coding {
        Coding::Raw => "MOC-NONE".to_owned(),
        Coding::Predictive { predictor, table } => format!(
            "MOC-PRED-{}-{table}",
            match predictor {
                Predictor::X => "X",
                Predictor::Y => "Y",
                Predictor::Xy => "XY",
            }
        ),
        Coding::Transform { .. } => "MOC-DCT-1".to_owned(),
    };
    let sum = body.iter().fold(0_u32, |sum, byte| {
        sum.wrapping_add_signed(i32::from(i8::from_le_bytes([*byte])))
    });
    let [instrument, filter] = image.instrument;
    let quoted = |text: &str| format!("\"{text}\"");
    let file_name = format!("{}.IMQ", image.product_id.replace(['/', '-'], ""));
    let clock = format!("{}:{}", image.clock.0, image.clock.1);
    let mut text = String::new();
    let mut line = |key: &str, value: &str| {
        let _ = write!(text, "{key} = {value}\r\n");
    };
    line("PDS_VERSION_ID", "PDS3");
    line("FILE_NAME", &quoted(&file_name));
    line("RECORD_TYPE", "FIXED_LENGTH");
    line("RECORD_BYTES", &RECORD.to_string());
    line("FILE_RECORDS", &(1 + body.len() / RECORD).to_string());
    line("LABEL_RECORDS", "1");
    line("^IMAGE", "2");
    line("SPACECRAFT_NAME", "MARS_GLOBAL_SURVEYOR");
    line("MISSION_PHASE_NAME", &quoted("MAPPING"));
    line("TARGET_NAME", "MARS");
    line("INSTRUMENT_ID", &quoted(instrument));
    if !filter.is_empty() {
        line("FILTER_NAME", &quoted(filter));
    }
    line("DATA_SET_ID", &quoted("MGS-M-MOC-NA/WA-2-SDP-L0-V1.0"));
    line("PRODUCT_ID", &quoted(image.product_id));
    line("START_TIME", image.utc[0]);
    line("IMAGE_TIME", image.utc[0]);
    line("STOP_TIME", image.utc[1]);
    line("SPACECRAFT_CLOCK_START_COUNT", &quoted(&clock));
    line("SPACECRAFT_CLOCK_STOP_COUNT", &quoted("N/A"));
    line("GAIN_MODE_ID", &quoted("6A"));
    line("OFFSET_MODE_ID", &quoted("32"));
    let exposure_ms = image.exposure_s / SECONDS_PER_MS;
    line(
        "LINE_EXPOSURE_DURATION",
        &format!("{exposure_ms:.6} <MILLISECONDS>"),
    );
    line("DOWNTRACK_SUMMING", &image.summing.to_string());
    line("CROSSTRACK_SUMMING", &image.summing.to_string());
    line("EDIT_MODE_ID", &quoted(&image.first_detector.to_string()));
    line(
        "RATIONALE_DESC",
        &quoted("Synthetic image of a synthetic mission"),
    );
    line("DATA_QUALITY_DESC", &quoted("OK"));
    line("OBJECT", "IMAGE");
    line("ENCODING_TYPE", &quoted(&encoding));
    line("LINES", &(image.pixels.len() / width).to_string());
    line("LINE_SAMPLES", &width.to_string());
    line("LINE_PREFIX_BYTES", "0");
    line("LINE_SUFFIX_BYTES", "0");
    line("SAMPLE_TYPE", "UNSIGNED_INTEGER");
    line("SAMPLE_BITS", "8");
    line("SAMPLE_BIT_MASK", "2#11111111#");
    line("CHECKSUM", &format!("16#{sum:08X}#"));
    line("END_OBJECT", "IMAGE");
    text.push_str("END\r\n");
    text.into_bytes()
}
