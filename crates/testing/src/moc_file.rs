//! Images of the camera that tests and benchmarks write, and the cost of reading them.

use std::fs;

use areograph_pds::image_file::{Coding, NewImage};

/// A narrow-angle image of an arbitrary day.
pub fn new_image(samples: u32, summing: u8, pixels: &[u8], coding: Coding) -> NewImage<'_> {
    NewImage {
        product_id: "M01/00123",
        instrument: ["MOC-NA", ""],
        clock: (610_472_061, 131),
        utc: ["1999-05-06T15:33:58.13", "1999-05-06T15:34:05.16"],
        exposure_s: 0.000_482_1,
        summing,
        first_detector: 0,
        samples,
        pixels,
        coding,
    }
}

/// A number that the system reports for processes or threads, preceded by `key`.
fn told(path: &str, key: &str) -> u64 {
    let status = fs::read_to_string(path).unwrap();
    let line = status.lines().find(|line| line.starts_with(key)).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// Peak memory of this process, bytes.
pub fn peak_memory() -> u64 {
    told("/proc/self/status", "VmHWM:") << 10
}

/// Bytes that this thread has read so far.
pub fn bytes_read() -> u64 {
    told("/proc/thread-self/io", "rchar:")
}
