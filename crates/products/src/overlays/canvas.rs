//! A picture of greys with marks and numbers in colour, in one byte a pixel.

use areograph_stages::lay_overlays::Mark;

/// Greys of the palette, from black to white.
const GREYS: u8 = 248;
/// Colours after the greys: surroundings of marks, the three marks, numbers, and missing parts of the image.
const COLOURS: [[u8; 3]; 6] = [
    [0, 0, 0],
    [0x56, 0xB4, 0xE9],
    [0xFF, 0x9F, 0x1C],
    [0xF7, 0xF7, 0x3B],
    [0xFF, 0xFF, 0xFF],
    [0x50, 0x3C, 0x5A],
];
const AROUND: u8 = GREYS;
const TEXT: u8 = GREYS + 4;
const NOTHING: u8 = GREYS + 5;
/// Edge of a dot of a digit, pixels.
const DOT: i64 = 2;
/// Rows of three dots of the digits 0 to 9.
const DIGITS: [[u8; 5]; 10] = [
    [0b111, 0b101, 0b101, 0b101, 0b111],
    [0b010, 0b110, 0b010, 0b010, 0b111],
    [0b111, 0b001, 0b111, 0b100, 0b111],
    [0b111, 0b001, 0b111, 0b001, 0b111],
    [0b101, 0b101, 0b111, 0b001, 0b001],
    [0b111, 0b100, 0b111, 0b001, 0b111],
    [0b111, 0b100, 0b111, 0b101, 0b111],
    [0b111, 0b001, 0b010, 0b010, 0b010],
    [0b111, 0b101, 0b111, 0b101, 0b111],
    [0b111, 0b101, 0b111, 0b001, 0b111],
];
/// Columns from one digit to the next.
const ADVANCE: i64 = 4 * DOT;

/// A picture to draw on.
#[derive(Debug)]
pub(super) struct Canvas {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Places in the palette, row by row.
    pub(super) pixels: Vec<u8>,
}

impl Canvas {
    /// A picture of numbers, with the limits `range_dn` shown as black and white; 0 is missing.
    pub(super) fn new(numbers: &[u8], [width, height]: [u32; 2], range_dn: [u8; 2]) -> Self {
        let grey = greys(range_dn);
        Self {
            width,
            height,
            pixels: numbers
                .iter()
                .map(|number| grey[usize::from(*number)])
                .collect(),
        }
    }

    /// Draws a mark at a column and row, 0.5 at the centre of the first pixel. Its middle stays free, so that the mark
    /// does not hide its subject.
    pub(super) fn mark(&mut self, mark: Mark, [column, row]: [f64; 2]) {
        let ink = match mark {
            Mark::Before => GREYS + 1,
            Mark::After => GREYS + 2,
            Mark::Measured => GREYS + 3,
        };
        self.stamp(&shape(mark), [column, row].map(whole), ink);
    }

    /// Writes a number beside a place: to its right, or to its left on request or without room.
    pub(super) fn number(&mut self, number: usize, [column, row]: [f64; 2], to_left: bool) {
        let text = number.to_string();
        let digits = text.bytes().map(|digit| usize::from(digit - b'0'));
        let length = ADVANCE * i64::try_from(text.len()).unwrap_or(i64::MAX);
        let [column, row] = [column, row].map(whole);
        let beside = 4 * DOT;
        let right = column + beside;
        let has_room = right + length <= i64::from(self.width);
        let has_room_left = column - beside >= length;
        let left = if has_room && !(to_left && has_room_left) {
            right
        } else {
            column - beside - length
        };
        let mut dots = Vec::new();
        for (place, digit) in (0..).zip(digits) {
            for (down, bits) in (0..).zip(DIGITS[digit]) {
                for across in (0..3).filter(|across| bits >> (2 - across) & 1 == 1) {
                    for dot in 0..DOT * DOT {
                        let x = place * ADVANCE + across * DOT + dot % DOT;
                        dots.push([x, (down - 2) * DOT + dot / DOT - DOT / 2]);
                    }
                }
            }
        }
        self.stamp(&dots, [left, row], TEXT);
    }

    /// Sets pixels around a place, and black ones around these.
    fn stamp(&mut self, offsets: &[[i64; 2]], [column, row]: [i64; 2], ink: u8) {
        for [across, down] in offsets {
            for step in 0..9 {
                self.set(
                    column + across + step % 3 - 1,
                    row + down + step / 3 - 1,
                    AROUND,
                );
            }
        }
        for [across, down] in offsets {
            self.set(column + across, row + down, ink);
        }
    }

    fn set(&mut self, column: i64, row: i64, value: u8) {
        let (Ok(column), Ok(row)) = (u32::try_from(column), u32::try_from(row)) else {
            return;
        };
        if column < self.width && row < self.height {
            self.pixels[row as usize * self.width as usize + column as usize] = value;
        }
    }

    /// Red, green and blue of every place in the palette.
    pub(super) fn palette() -> Vec<u8> {
        let grey = |place: u8| {
            [u8::try_from(u32::from(place) * 255 / u32::from(GREYS - 1)).unwrap_or(u8::MAX); 3]
        };
        (0..GREYS).map(grey).chain(COLOURS).flatten().collect()
    }
}

/// The grey of every number.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the greys just before"
)]
fn greys([black, white]: [u8; 2]) -> [u8; 256] {
    let span = f64::from(white.saturating_sub(black).max(1));
    let last = f64::from(GREYS - 1);
    std::array::from_fn(|number| {
        let share = (number as f64 - f64::from(black)) / span;
        match number {
            0 => NOTHING,
            _ => (share * last).round().clamp(0.0, last) as u8,
        }
    })
}

/// The pixel that contains a place.
#[allow(
    clippy::cast_possible_truncation,
    reason = "casts of floats saturate, and what lies outside is not drawn"
)]
fn whole(place: f64) -> i64 {
    place.floor().clamp(-1e9, 1e9) as i64
}

/// Pixels of a mark from its middle: a circle, an upright cross, a diagonal one.
fn shape(mark: Mark) -> Vec<[i64; 2]> {
    let square = || (-6..=6).flat_map(|down| (-6..=6).map(move |across| [across, down]));
    let is_part = |[across, down]: &[i64; 2]| {
        let squared = across * across + down * down;
        match mark {
            // Within half a pixel of a radius of 5.
            Mark::Before => (21..=30).contains(&squared),
            Mark::After => across * down == 0 && squared >= 4,
            Mark::Measured => across.abs() == down.abs() && (4..=32).contains(&squared),
        }
    };
    square().filter(is_part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean place of the pixels of a colour, columns and rows.
    fn middle(canvas: &Canvas, ink: u8) -> [f64; 2] {
        let width = canvas.width as usize;
        let found = canvas
            .pixels
            .iter()
            .enumerate()
            .filter(|(_, pixel)| **pixel == ink);
        let places: Vec<[f64; 2]> = found
            .map(|(place, _)| [(place % width) as f64 + 0.5, (place / width) as f64 + 0.5])
            .collect();
        [0, 1].map(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / places.len() as f64)
    }

    #[test]
    fn marks_are_where_they_belong_and_leave_their_middle_free() {
        for (mark, ink) in [
            (Mark::Before, 249),
            (Mark::After, 250),
            (Mark::Measured, 251),
        ] {
            let mut canvas = Canvas::new(&[100; 1600], [40, 40], [50, 150]);
            canvas.mark(mark, [20.3, 11.8]);
            // Means of whole and half numbers.
            let [column, row] = middle(&canvas, ink);
            let off = (column - 20.5).hypot(row - 11.5);
            assert!(off < 1e-9, "{mark:?}: {column} {row}");
            let untouched = canvas.pixels[11 * 40 + 20];
            assert_eq!(untouched, 124, "{mark:?}");
            // Beyond the edge only a part of it is drawn.
            canvas.mark(mark, [-3.0, 39.9]);
            canvas.mark(mark, [f64::NAN, 1e300]);
        }
    }

    #[test]
    fn numbers_stand_beside_their_place_inside_the_picture() {
        let mut canvas = Canvas::new(&[100; 4000], [100, 40], [50, 150]);
        canvas.number(10, [20.0, 20.0], true);
        let [column, row] = middle(&canvas, TEXT);
        assert!(
            (28.0..44.0).contains(&column) && (19.0..21.5).contains(&row),
            "{column} {row}"
        );
        let mut canvas = Canvas::new(&[100; 4000], [100, 40], [50, 150]);
        canvas.number(10, [90.0, 20.0], false);
        assert!(middle(&canvas, TEXT)[0] < 82.0);
        let mut canvas = Canvas::new(&[100; 4000], [100, 40], [50, 150]);
        canvas.number(10, [50.0, 20.0], true);
        assert!(middle(&canvas, TEXT)[0] < 42.0);
    }

    #[test]
    fn greys_span_what_is_asked_and_nothing_is_not_black() {
        let canvas = Canvas::new(&[0, 1, 50, 100, 150, 255], [6, 1], [50, 150]);
        assert_eq!(canvas.pixels, [NOTHING, 0, 0, 124, 247, 247]);
        assert_eq!(Canvas::palette().len(), 3 * 254);
    }
}
