//! The VICAR label between the PDS label and the rows, a sequence of `KEY=value`: its sizes must match the rows.

use super::{error::HrscError, raster::Raster};
use crate::label::Label;

/// Checks that the VICAR label at `^IMAGE_HEADER`, if the file has one, describes the same rows.
///
/// # Errors
/// The first of its sizes that contradicts them.
pub(super) fn agrees(label: &Label, start: &[u8], raster: &Raster) -> Result<(), HrscError> {
    let number = |key: &str| -> Option<usize> { label.find(key)?.value.parse().ok() };
    let place = || {
        let record = number("^IMAGE_HEADER")?.checked_sub(1)?;
        record.checked_mul(number("RECORD_BYTES")?)
    };
    let text = place().and_then(|place| start.get(place..));
    let Some(text) = text.filter(|text| text.starts_with(b"LBLSIZE=")) else {
        return Ok(());
    };
    let length = value(text, "LBLSIZE").and_then(|length| usize::try_from(length).ok());
    let text = length.and_then(|length| text.get(..length)).unwrap_or(text);
    let sizes = [
        ("NL", u64::from(raster.lines)),
        ("NS", u64::from(raster.samples)),
        ("NBB", raster.prefix_bytes()),
        ("RECSIZE", raster.row_bytes()),
    ];
    for (key, expected) in sizes {
        if let Some(vicar) = value(text, key).filter(|vicar| *vicar != expected) {
            return Err(HrscError::Vicar {
                key,
                vicar,
                expected,
            });
        }
    }
    Ok(())
}

/// The first whole number under a keyword.
fn value(text: &[u8], key: &str) -> Option<u64> {
    let words = text.split(|byte| byte.is_ascii_whitespace() || *byte == 0);
    let values = words.filter_map(|word| {
        let word = std::str::from_utf8(word).ok()?;
        let (own, value) = word.split_once('=')?;
        (own == key).then(|| value.parse().ok())
    });
    values.flatten().next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_number_under_a_keyword_is_its_value() {
        let text = b"LBLSIZE=7932            FORMAT='HALF'  TYPE='IMAGE'  NL=15088  NS=1288  NBB=68  X='NL=3'  NL=7";
        assert_eq!(value(text, "NL"), Some(15_088));
        assert_eq!(value(text, "NBB"), Some(68));
        assert_eq!(value(text, "RECSIZE"), None);
    }
}
