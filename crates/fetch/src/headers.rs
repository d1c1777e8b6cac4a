//! Headers of answers.

use std::time::{Duration, SystemTime};

/// First and last byte, and the length of the complete file, of `bytes 5-8/10`; the length of `bytes 5-9/*` is unknown.
pub(crate) fn range_of(text: &str) -> Option<([u64; 2], Option<u64>)> {
    let (range, length) = text.strip_prefix("bytes ")?.split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let length = match length.trim() {
        "*" => None,
        length => Some(length.parse().ok()?),
    };
    Some((
        [first.trim().parse().ok()?, last.trim().parse().ok()?],
        length,
    ))
}

/// First byte and length of the complete file of `bytes 5-9/10`; the length of `bytes 5-9/*` is unknown.
pub(crate) fn rest_of(text: &str) -> Option<(u64, Option<u64>)> {
    let ([first, last], length) = range_of(text)?;
    // A range that ends before the file is one that was not asked for.
    length
        .is_none_or(|length| last.checked_add(1) == Some(length))
        .then_some((first, length))
}

/// The wait of `Retry-After`: seconds, or a date.
pub(crate) fn wait_of(text: &str, now: SystemTime) -> Option<Duration> {
    let text = text.trim();
    if let Ok(seconds) = text.parse() {
        return Some(Duration::from_secs(seconds));
    }
    let until = chrono::DateTime::parse_from_rfc2822(text).ok()?;
    SystemTime::from(until).duration_since(now).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_waits_are_read() {
        assert_eq!(rest_of("bytes 5-9/10"), Some((5, Some(10))));
        assert_eq!(rest_of("bytes 5-9/*"), Some((5, None)));
        for bad in ["bytes 5-8/10", "bytes */10", "5-9/10", "bytes 5-9/x"] {
            assert_eq!(rest_of(bad), None, "{bad}");
        }
        assert_eq!(range_of("bytes 5-8/10"), Some(([5, 8], Some(10))));
        assert_eq!(range_of("bytes 5-8/*"), Some(([5, 8], None)));
        assert_eq!(range_of("bytes */10"), None);
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(784_111_777 - 5);
        assert_eq!(wait_of("120", now), Some(Duration::from_mins(2)));
        assert_eq!(
            wait_of("Sun, 06 Nov 1994 08:49:37 GMT", now),
            Some(Duration::from_secs(5))
        );
        assert_eq!(wait_of("Sun, 06 Nov 1994 08:49:30 GMT", now), None);
        assert_eq!(wait_of("soon", now), None);
    }
}
