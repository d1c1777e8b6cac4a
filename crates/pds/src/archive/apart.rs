//! Groups of files that no shot is in twice, so that each group can be searched alone.

use super::{SAME_SHOT_S, Source};

/// Largest time from a shot to its frame's mid-point, seconds: 9.5 shots with a clock error of one per cent. Files whose
/// frames succeed each other in 2 s share no shot.
const SHOT_MARGIN_S: f64 = 0.96;

/// Groups of files, at most `groups_max` of about the same number of records: files that may contain the same shot are
/// in one group, so that its search finds every shot that two files contain. Groups, and the files in each, are in
/// order of time. Files without an index may contain any time.
#[must_use]
pub fn apart(mut sources: Vec<Source>, groups_max: usize) -> Vec<Vec<Source>> {
    let first_s = |source: &Source| source.tags_s()[0];
    sources.sort_by(|a, b| first_s(a).total_cmp(&first_s(b)));
    let tags_s: Vec<[f64; 2]> = sources.iter().map(Source::tags_s).collect();
    let records: Vec<usize> = sources.iter().map(Source::records).collect();
    let mut sources = sources.into_iter();
    lengths(&tags_s, &records, groups_max)
        .into_iter()
        .map(|length| {
            let mut group: Vec<Source> = sources.by_ref().take(length).collect();
            group.sort_by(|a, b| a.first_s().total_cmp(&b.first_s()));
            group
        })
        .collect()
}

/// Numbers of files of the groups.
///
/// * `tags_s` – first and last tag of each file, ET seconds, in order of the first
fn lengths(tags_s: &[[f64; 2]], records: &[usize], groups_max: usize) -> Vec<usize> {
    let enough = records.iter().sum::<usize>().div_ceil(groups_max.max(1));
    let (mut lengths, mut length, mut held) = (Vec::new(), 0, 0);
    let mut last_s = f64::NEG_INFINITY;
    for (&[first, last], records) in tags_s.iter().zip(records) {
        let is_apart = first - last_s - 2.0 * SHOT_MARGIN_S > SAME_SHOT_S;
        if is_apart && held >= enough {
            lengths.push(length);
            (length, held) = (0, 0);
        }
        (length, held) = (length + 1, held + records);
        last_s = last_s.max(last);
    }
    lengths.extend((length > 0).then_some(length));
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_may_share_a_shot_stay_together() {
        const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        let apart = [[0.0, 10.0], [20.0, 30.0], [40.0, 50.0], [60.0, 70.0]];
        for (tags_s, groups_max, expected) in [
            (&apart[..], 4, vec![1, 1, 1, 1]),
            (&apart, 2, vec![2, 2]),
            (&apart, 3, vec![2, 2]),
            (&apart, 1, vec![4]),
            (&apart, 9, vec![1, 1, 1, 1]),
            (&[[0.0, 10.0], [11.9, 30.0], [40.0, 50.0]], 9, vec![2, 1]),
            (&[[0.0, 10.0], [12.0, 30.0], [40.0, 50.0]], 9, vec![1, 1, 1]),
            // A long file spans those after it.
            (&[[0.0, 45.0], [20.0, 30.0], [40.0, 50.0]], 9, vec![3]),
            (&[ANY, [20.0, 30.0], [40.0, 50.0]], 9, vec![3]),
            (&[], 9, vec![]),
        ] {
            let records = vec![100; tags_s.len()];
            assert_eq!(
                lengths(tags_s, &records, groups_max),
                expected,
                "{tags_s:?}"
            );
        }
        // Groups of about the same number of records.
        assert_eq!(lengths(&apart, &[300, 100, 100, 100], 2), [1, 3]);
    }
}
