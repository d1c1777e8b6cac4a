//! Fortran's edit descriptors `Iw` and `Fw.d`, as compilers on IEEE machines write them.

/// Appends an integer right-justified in `width`; stars when it does not fit.
pub(super) fn integer(line: &mut String, value: i64, width: usize) {
    justify(line, &value.to_string(), width);
}

/// Appends a number with `decimals` decimals in `width`: the exact value rounded, halves to even, zeros with their
/// sign. The zero before the point is left out where there is no room for it; stars when the rest does not fit.
pub(super) fn fixed(line: &mut String, value: f64, width: usize, decimals: usize) {
    if !value.is_finite() {
        return justify(line, not_finite(value, width), width);
    }
    let mut text = format!("{value:.decimals$}");
    if decimals == 0 {
        text.push('.');
    }
    if text.len() > width && decimals > 0 {
        text = match text.strip_prefix("-0.") {
            Some(rest) => format!("-.{rest}"),
            None => text.strip_prefix('0').unwrap_or(&text).to_owned(),
        };
    }
    justify(line, &text, width);
}

const fn not_finite(value: f64, width: usize) -> &'static str {
    match (value.is_nan(), value > 0.0, width) {
        (true, ..) => "NaN",
        (_, true, ..8) => "Inf",
        (_, true, _) => "Infinity",
        (_, false, ..9) => "-Inf",
        (_, false, _) => "-Infinity",
    }
}

fn justify(line: &mut String, text: &str, width: usize) {
    if text.len() > width {
        line.extend(std::iter::repeat_n('*', width));
    } else {
        line.extend(std::iter::repeat_n(' ', width - text.len()));
        line.push_str(text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines that gfortran 12.2 wrote for these values with (f7.0,f8.2,f5.1,f4.3,f3.2,f2.1,f1.0).
    #[test]
    fn numbers_are_printed_as_fortran_prints_them() {
        let printed = [
            (0.5, "     0.    0.50  0.5.500.50.5*"),
            (1.5, "     2.    1.50  1.5**********"),
            (2.5, "     2.    2.50  2.5**********"),
            (-0.5, "    -0.   -0.50 -0.5**********"),
            (-0.001, "    -0.   -0.00 -0.0**********"),
            (0.125, "     0.    0.12  0.1.125.12.1*"),
            (-0.125, "    -0.   -0.12 -0.1**********"),
            (0.375, "     0.    0.38  0.4.375.38.4*"),
            (99_999.5, "100000.99999.50***************"),
            (1e10, "******************************"),
            (-0.4, "    -0.   -0.40 -0.4**********"),
            (f64::NAN, "    NaN     NaN  NaN NaNNaN***"),
        ];
        for (value, expected) in printed {
            let mut line = String::new();
            for (width, decimals) in [(7, 0), (8, 2), (5, 1), (4, 3), (3, 2), (2, 1), (1, 0)] {
                fixed(&mut line, value, width, decimals);
            }
            assert_eq!(line, expected, "{value}");
        }
        let mut line = String::new();
        for (value, width, decimals) in [
            (f64::INFINITY, 7, 0),
            (f64::INFINITY, 16, 5),
            (f64::INFINITY, 2, 0),
            (f64::NEG_INFINITY, 16, 5),
            (f64::NEG_INFINITY, 3, 0),
            (f64::INFINITY, 9, 2),
            (f64::NEG_INFINITY, 8, 2),
        ] {
            fixed(&mut line, value, width, decimals);
        }
        assert_eq!(
            line,
            "    Inf        Infinity**       -Infinity*** Infinity    -Inf"
        );
    }

    #[test]
    fn integers_that_do_not_fit_are_stars() {
        let mut line = String::new();
        for (value, width) in [(12, 2), (-1, 2), (-12, 3), (-12, 2)] {
            integer(&mut line, value, width);
        }
        assert_eq!(line, "12-1-12**");
    }
}
