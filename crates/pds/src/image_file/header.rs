//! The header of a fragment.

use super::{
    coding::{Coding, Predictor, Transform},
    walk::HEADER,
};

/// Contents of a header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) bytes: [u8; HEADER],
}

/// A sound header of the image, and its location.
#[derive(Debug, Clone, Copy)]
pub(super) struct Witness {
    pub(super) number: u16,
    pub(super) at: u64,
    pub(super) header: Header,
}

impl Header {
    pub(super) const fn new(bytes: [u8; HEADER]) -> Self {
        Self { bytes }
    }

    pub(super) const fn two(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]])
    }

    pub(super) const fn number(&self) -> u16 {
        self.two(2)
    }

    /// Number of the image.
    pub(super) const fn image(&self) -> u16 {
        self.two(0)
    }

    /// Start of the image: ticks, and seconds least significant byte first.
    pub(super) const fn clock(&self) -> [u8; 5] {
        let [
            _,
            _,
            _,
            _,
            _,
            _,
            _,
            _,
            ticks,
            first,
            second,
            third,
            fourth,
            ..,
        ] = self.bytes;
        [ticks, first, second, third, fourth]
    }

    /// First detector pixel.
    pub(super) fn first_detector(&self) -> u32 {
        u32::from(self.bytes[42]) * 16
    }

    /// Exposure of a detector line in units of the camera.
    pub(super) const fn line_clock(&self) -> u16 {
        self.two(55)
    }

    /// Lines of the complete image.
    pub(super) fn total_lines(&self) -> u32 {
        u32::from(self.two(40)) * 16
    }

    /// Changes of gain and offset within the image.
    pub(super) const fn gain_changes(&self) -> u16 {
        self.two(38)
    }

    /// Samples of a line.
    pub(super) fn width(&self) -> u32 {
        u32::from(self.bytes[43]) * 16
    }

    pub(super) const fn data_bytes(&self) -> u32 {
        u32::from_le_bytes([
            self.bytes[58],
            self.bytes[59],
            self.bytes[60],
            self.bytes[61],
        ])
    }

    /// Coding; `None` for a predictor combined with a transform, or an undefined transform.
    pub(super) const fn coding(&self) -> Option<Coding> {
        let (kind, table) = (self.bytes[44], self.bytes[45]);
        let predictor = match kind & 3 {
            0 => None,
            1 => Some(Predictor::X),
            2 => Some(Predictor::Y),
            _ => Some(Predictor::Xy),
        };
        let transform = match kind >> 2 & 3 {
            0 => None,
            1 => Some(Transform::Walsh),
            2 => Some(Transform::Cosine),
            _ => return None,
        };
        match (predictor, transform) {
            (None, None) => Some(Coding::Raw),
            (Some(predictor), None) if table & 15 < 8 => Some(Coding::Predictive {
                predictor,
                table: table & 15,
            }),
            (None, Some(transform)) => Some(Coding::Transform {
                transform,
                groups: (table >> 5) + 1,
                spacing: self.two(48),
            }),
            _ => None,
        }
    }

    pub(super) fn is_possible(&self) -> bool {
        self.width() > 0
            && self.total_lines() > 0
            && self.data_bytes() > 0
            && self.coding().is_some()
    }

    /// Whether identifier, clock, size and coding, which all fragments of an image share, agree.
    pub(super) fn is_of_image(&self, first: &Self) -> bool {
        [0..2, 8..13, 40..50]
            .into_iter()
            .all(|range| self.bytes[range.clone()] == first.bytes[range])
            && self.data_bytes() > 0
    }
}
