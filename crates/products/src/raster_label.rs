//! Cells of a raster that stand for a name.

use super::geotiff::Number;

/// A number that stands for a name, from 1 on; 0 without one. Overviews have the most frequent one, not a mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Label(pub u8);

impl Number for Label {
    const LAYOUT: [usize; 2] = u8::LAYOUT;
    const NO_DATA: &'static str = u8::NO_DATA;
    const NONE: Self = Self(u8::NONE);

    fn is_none(self) -> bool {
        self == Self::NONE
    }

    fn mean(numbers: impl Iterator<Item = Self> + Clone) -> Self {
        let count = |of: Self| numbers.clone().filter(|other| *other == of).count();
        // Of equally frequent ones the smallest.
        let key = |of: &Self| (count(*of), u8::MAX - of.0);
        numbers.clone().max_by_key(key).unwrap_or(Self::NONE)
    }

    const PREDICTOR: usize = 1;

    fn predicted(row: &[Self]) -> Vec<u8> {
        row.iter().map(|of| of.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overviews_of_labels_have_the_most_frequent_one() {
        let of = |labels: &[u8]| Label::mean(labels.iter().copied().map(Label)).0;
        assert_eq!([of(&[1, 3, 3]), of(&[3, 1]), of(&[7])], [3, 1, 7]);
    }
}
