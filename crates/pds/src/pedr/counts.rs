//! Statistics of the shots of a file, and the agreement of its ranges with its own positions.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Complaint, FieldGuard, File, SHOTS};
use areograph_base::altimetry::NO_ATTITUDE;
use areograph_geom::statistics::Summary;

/// Counts of a file. Those by class, channel, flag and model include valid returned shots only.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Counts {
    /// Records.
    pub records: u64,
    /// Records without a fault of the whole frame.
    pub good_records: u64,
    /// Shots of good records.
    pub shots: u64,
    /// Shots of good records without a return.
    pub without_return: u64,
    /// Returned shots of good records whose values contradict each other.
    pub spoiled_shots: u64,
    /// Good records by orbit number.
    pub records_by_orbit: BTreeMap<u32, u64>,
    /// Shots by classification: 1 ground, 0 cloud or noise.
    pub shots_by_class: BTreeMap<i16, u64>,
    /// Shots by trigger channel.
    pub shots_by_channel: BTreeMap<u8, u64>,
    /// Shots by attitude flag: 0 known, 2 partly, 3 unknown.
    pub shots_by_attitude_flag: BTreeMap<u16, u64>,
    /// Shots by orbit model: 0 JPL, 1 or more the MOLA team's.
    pub shots_by_orbit_model: BTreeMap<u16, u64>,
    /// Mid-points of the first and the last good record, ET seconds.
    pub span_s: Option<[f64; 2]>,
    /// Measured range minus the distance from the file's own spacecraft to the footprint, metres: ground returns with
    /// known attitude.
    pub ground_range_minus_distance_m: Summary,
    /// Measured range minus this distance of all other returns with known attitude.
    pub other_range_minus_distance_m: Summary,
}

impl File {
    /// Counts the shots of the file, and reports all faults in order of records.
    #[must_use]
    pub fn count(&self) -> (Counts, Vec<Complaint>) {
        /// Records checked at a time.
        const STEP: usize = 4_096;
        let guard = FieldGuard::new(self.label().software_version);
        let mut complaints = self.label_complaints().to_vec();
        let mut counts = Counts::default();
        let (mut ground_m, mut other_m) = (Vec::new(), Vec::new());
        for start in (0..self.records().len()).step_by(STEP) {
            for (row, frame) in self.frames(start..start + STEP, guard) {
                counts.records += 1;
                let frame = match frame {
                    Ok(frame) => frame,
                    Err(error) => {
                        complaints.push(self.record_complaint(row, &error));
                        continue;
                    }
                };
                counts.good_records += 1;
                counts.shots += SHOTS as u64;
                let record = frame.record();
                *counts
                    .records_by_orbit
                    .entry(record.orbit.get())
                    .or_default() += 1;
                let time_s = record.time_s.get();
                let first_s = counts.span_s.map_or(time_s, |[first_s, _]| first_s);
                counts.span_s = Some([first_s, time_s]);
                let spoiled = frame.spoiled_shots();
                complaints.extend(
                    spoiled
                        .error()
                        .map(|error| self.record_complaint(row, error)),
                );
                for shot in (1..).take(SHOTS).filter_map(|shot| frame.shot(shot)) {
                    if shot.range_m <= 0.0 {
                        counts.without_return += 1;
                        continue;
                    }
                    if spoiled.contains(shot.shot) {
                        counts.spoiled_shots += 1;
                        continue;
                    }
                    *counts.shots_by_class.entry(shot.class).or_default() += 1;
                    *counts.shots_by_channel.entry(shot.channel).or_default() += 1;
                    *counts
                        .shots_by_attitude_flag
                        .entry(shot.attitude_flag)
                        .or_default() += 1;
                    *counts
                        .shots_by_orbit_model
                        .entry(shot.orbit_quality)
                        .or_default() += 1;
                    if shot.attitude_flag < NO_ATTITUDE {
                        let column = if shot.class == 1 {
                            &mut ground_m
                        } else {
                            &mut other_m
                        };
                        column.extend(frame.range_minus_distance_m(shot.shot));
                    }
                }
            }
        }
        complaints.extend(self.trailing_complaint());
        counts.ground_range_minus_distance_m = Summary::of(&ground_m);
        counts.other_range_minus_distance_m = Summary::of(&other_m);
        (counts, complaints)
    }
}
