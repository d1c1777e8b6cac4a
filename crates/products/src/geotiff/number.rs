//! Kinds of numbers in a file.

/// A kind of number in a file.
pub trait Number: Copy + 'static {
    /// Bits, and format of the sample: 1 without a sign, 3 with decimals.
    const LAYOUT: [usize; 2];
    /// Cells without a number, as readers of the file find them.
    const NO_DATA: &'static str;
    /// A cell without a number.
    const NONE: Self;

    /// Whether the cell has no number.
    fn is_none(self) -> bool;

    /// The mean of numbers, of which there is at least one.
    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self;

    /// Number of the predictor, which precedes compression (TIFF 6.0, section 14, and Adobe's TIFF technical note 3).
    const PREDICTOR: usize;

    /// The bytes of a row of a tile after the predictor.
    fn predicted(row: &[Self]) -> Vec<u8>;
}

/// Numbers in metres; NaN without a number.
impl Number for f32 {
    const LAYOUT: [usize; 2] = [32, 3];
    const NO_DATA: &'static str = "-32768";
    const NONE: Self = Self::NAN;

    fn is_none(self) -> bool {
        self.is_nan()
    }

    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self {
        let count: Self = numbers.clone().map(|_| 1.0).sum();
        numbers.sum::<Self>() / count
    }

    const PREDICTOR: usize = 3;

    /// The most significant bytes of all numbers first, each as its difference from the one before it.
    fn predicted(row: &[Self]) -> Vec<u8> {
        let number = |of: &Self| if of.is_nan() { -32_768.0 } else { *of };
        let numbers: Vec<[u8; 4]> = row.iter().map(|of| number(of).to_be_bytes()).collect();
        let planes = (0..4).flat_map(|plane| numbers.iter().map(move |bytes| bytes[plane]));
        differences(planes)
    }
}

/// Brightness from 1 on; 0 without one.
impl Number for u8 {
    const LAYOUT: [usize; 2] = [8, 1];
    const NO_DATA: &'static str = "0";
    const NONE: Self = 0;

    fn is_none(self) -> bool {
        self == 0
    }

    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self {
        let count: u32 = numbers.clone().map(|_| 1).sum();
        let sum: u32 = numbers.map(u32::from).sum();
        Self::try_from((sum + count / 2) / count).unwrap_or(Self::MAX)
    }

    const PREDICTOR: usize = 2;

    fn predicted(row: &[Self]) -> Vec<u8> {
        differences(row.iter().copied())
    }
}

/// Every byte minus the one before it.
fn differences(bytes: impl Iterator<Item = u8>) -> Vec<u8> {
    let mut before = 0_u8;
    let difference = bytes.map(|byte| byte.wrapping_sub(std::mem::replace(&mut before, byte)));
    difference.collect()
}

/// Bits of a set; 0 for an empty one. A larger cell has the bits of all its cells.
impl Number for u32 {
    const LAYOUT: [usize; 2] = [32, 1];
    const NO_DATA: &'static str = "0";
    const NONE: Self = 0;

    fn is_none(self) -> bool {
        self == 0
    }

    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self {
        numbers.fold(0, std::ops::BitOr::bitor)
    }

    const PREDICTOR: usize = 1;

    fn predicted(row: &[Self]) -> Vec<u8> {
        row.iter().flat_map(|of| of.to_le_bytes()).collect()
    }
}
