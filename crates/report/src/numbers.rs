//! Format of numbers on pages: one minus sign, grouped thousands, no sign on zero.

use areograph_base::minus::MINUS;

/// Separator of thousands: narrow and non-breaking.
const APART: char = '\u{202f}';
/// Number of digits from which thousands are grouped, as in the SI brochure.
const DIGITS_WHOLE: usize = 5;

/// A number with a given number of decimals; values that round to zero have no sign.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let zero = !text.contains(|digit| matches!(digit, '1'..='9'));
    let sign = if value < 0.0 && !zero {
        MINUS.to_string()
    } else {
        String::new()
    };
    sign + &spaced(&text)
}

/// A number with a sign on positive values too.
#[must_use]
pub fn signed(value: f64, decimals: usize) -> String {
    let text = number(value, decimals);
    let zero = !text.contains(|digit| matches!(digit, '1'..='9'));
    if value > 0.0 && !zero {
        format!("+{text}")
    } else {
        text
    }
}

/// A count.
pub fn whole(count: impl TryInto<u64>) -> String {
    spaced(&count.try_into().unwrap_or(u64::MAX).to_string())
}

/// Digits without a sign, those before the point in groups of three.
fn spaced(text: &str) -> String {
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    if whole.len() < DIGITS_WHOLE || !whole.bytes().all(|digit| digit.is_ascii_digit()) {
        return text.to_owned();
    }
    let mut spaced = String::with_capacity(text.len() + whole.len());
    for (place, digit) in whole.chars().enumerate() {
        if place > 0 && (whole.len() - place).is_multiple_of(3) {
            spaced.push(APART);
        }
        spaced.push(digit);
    }
    spaced + rest
}

/// Name of an axis of heights; names of panels are known when the program is built.
pub(super) const fn above_words(has_areoid: bool) -> &'static str {
    if has_areoid {
        "above the areoid, m"
    } else {
        "above the ellipsoid, m"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign_and_minus_is_a_minus() {
        assert_eq!(number(-0.004, 2), "0.00");
        assert_eq!(number(-0.006, 2), "−0.01");
        assert_eq!(number(-20.0, 0), "−20");
        assert_eq!(signed(0.0004, 3), "0.000");
        assert_eq!(signed(0.117, 3), "+0.117");
        assert_eq!(signed(-1.15, 2), "−1.15");
    }

    #[test]
    fn thousands_are_apart_from_five_digits_on() {
        assert_eq!(whole(1_485_063_u64), "1\u{202f}485\u{202f}063");
        assert_eq!(whole(9999_usize), "9999");
        assert_eq!(number(-12_345.678, 1), "−12\u{202f}345.7");
        assert_eq!(number(f64::NAN, 1), "NaN");
    }
}
