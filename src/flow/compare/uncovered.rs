//! Time that is not compared because a set does not cover it.

use crate::time::Interval;

/// Intervals that are listed for a set; the others are counted.
const SPANS_NAMED: usize = 5;

/// Time that a set does not cover, and that is therefore not compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncovered {
    /// The set.
    pub set: String,
    /// `position` or `attitude`.
    pub what: &'static str,
    /// The interval.
    pub interval: Interval,
    /// The interval in UTC.
    pub utc: [String; 2],
}

/// For each set the time that it does not cover: total, and the first intervals.
pub(super) fn lines(uncovered: &[Uncovered]) -> Vec<String> {
    let same = |a: &Uncovered, b: &Uncovered| a.set == b.set && a.what == b.what;
    let of_one_set = uncovered.chunk_by(same);
    let lines = of_one_set.map(|spans| {
        let (set, what) = (&spans[0].set, spans[0].what);
        let total_s: f64 = spans.iter().map(|one| one.interval.duration_s()).sum();
        let mut told: Vec<String> = spans
            .iter()
            .take(SPANS_NAMED)
            .map(|span| {
                let seconds = span.interval.duration_s();
                format!("{} .. {} UTC ({seconds:.3} s)", span.utc[0], span.utc[1])
            })
            .collect();
        if spans.len() > SPANS_NAMED {
            let more = spans.len() - SPANS_NAMED;
            told.push(format!(
                "and {more} more, all in `areograph kernels compare --json`"
            ));
        }
        let told = told.join(", ");
        format!("omitted from the comparison: {set} has no {what} for {total_s:.3} s: {told}")
    });
    lines.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Et;

    #[test]
    fn many_spans_of_a_set_are_one_line() {
        let span = |set: &str, start_s: u32| Uncovered {
            set: set.to_owned(),
            what: "position",
            interval: Interval::new(
                Et::from_seconds(f64::from(start_s)),
                Et::from_seconds(f64::from(start_s) + 0.5),
            ),
            utc: [format!("from {start_s}"), format!("to {start_s}")],
        };
        let mut uncovered: Vec<Uncovered> = (0..40).map(|start_s| span("nav", start_s)).collect();
        uncovered.push(span("ipng", 3));
        let told = lines(&uncovered);
        assert_eq!(told.len(), 2);
        assert!(
            told[0].starts_with("omitted from the comparison: nav has no position for 20.000 s: from 0 .. to 0 UTC (0.500 s), ")
                && told[0].contains("from 4 ..")
                && !told[0].contains("from 5 ..")
                && told[0].contains(", and 35 more, "),
            "{}",
            told[0]
        );
        assert!(
            told[1].ends_with("ipng has no position for 0.500 s: from 3 .. to 3 UTC (0.500 s)")
        );
    }
}
