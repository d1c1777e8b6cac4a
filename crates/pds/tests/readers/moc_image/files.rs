//! Files made for tests.

use std::path::{Path, PathBuf};

/// A `.img` file: a label padded to `start` bytes, then pixels of up to 20 lines.
pub(crate) fn write_raster(
    folder: &Path,
    pointer: &str,
    start: usize,
    samples: usize,
    pixels: &[u8],
) -> PathBuf {
    let mut bytes = format!(
        "PDS_VERSION_ID = PDS3\r\nRECORD_BYTES = 600\r\n^IMAGE = {pointer}\r\nINSTRUMENT_ID = \"MOC-NA\"\r\n\
         OBJECT = IMAGE\r\nLINES = 20\r\nLINE_SAMPLES = {samples}\r\nSAMPLE_BITS = 8\r\nEND_OBJECT = IMAGE\r\nEND\r\n"
    )
    .into_bytes();
    bytes.resize(start, b' ');
    bytes.extend_from_slice(pixels);
    let path = folder.join("raster.img");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A `.imq` file of 16 lines in one fragment: bytes 44 and 45 of its header, the quantiser's step, its data.
pub(crate) fn write_fragment(
    folder: &Path,
    width: u8,
    coding: [u8; 2],
    spacing: u16,
    data: &[u8],
) -> PathBuf {
    let mut header = [0_u8; 62];
    header[0] = 7;
    header[9..13].copy_from_slice(&610_472_061_u32.to_le_bytes());
    header[13] = 3;
    header[6] = 1;
    header[40] = 1;
    header[43] = width / 16;
    header[44..46].copy_from_slice(&coding);
    header[48..50].copy_from_slice(&spacing.to_le_bytes());
    header[58..62].copy_from_slice(&u32::try_from(data.len()).unwrap().to_le_bytes());
    let mut bytes = format!(
        "PDS_VERSION_ID = PDS3\r\nRECORD_BYTES = 2048\r\n^IMAGE = 2\r\nINSTRUMENT_ID = \"MOC-NA\"\r\n\
         SPACECRAFT_CLOCK_START_COUNT = \"610472061:0\"\r\nOBJECT = IMAGE\r\nENCODING_TYPE = \"MOC\"\r\nLINES = 16\r\n\
         LINE_SAMPLES = {width}\r\nEND_OBJECT = IMAGE\r\nEND\r\n"
    )
    .into_bytes();
    bytes.resize(2048, b' ');
    bytes.extend_from_slice(&header);
    bytes.extend_from_slice(data);
    let mut sum: u32 = bytes[2048..].iter().map(|byte| u32::from(*byte)).sum();
    while sum > 255 {
        sum = (sum & 255) + (sum >> 8);
    }
    bytes.push(255 - u8::try_from(sum).unwrap());
    bytes.resize(4096, 0);
    let path = folder.join("fragment.imq");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// The bytes of hexadecimal digits.
pub(crate) fn hexadecimal(digits: &str) -> Vec<u8> {
    let digits: Vec<u8> = digits.bytes().filter(u8::is_ascii_hexdigit).collect();
    let pairs = digits
        .chunks(2)
        .map(|pair| std::str::from_utf8(pair).unwrap());
    pairs
        .map(|pair| u8::from_str_radix(pair, 16).unwrap())
        .collect()
}
