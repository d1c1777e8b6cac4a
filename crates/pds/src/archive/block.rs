//! Index entry of a block of successive records of a file: its extent in place and time.

use serde::{Deserialize, Serialize};

use super::Query;
use crate::pedr::Record;
use areograph_base::{body::Datum, units::RADIANS_PER_MICRODEGREE};
use areograph_geom::window::Extent;

/// Records of a block: 0.1 MB, 13° of latitude.
pub(super) const BLOCK_RECORDS: usize = 128;
/// Microdegrees of a turn, and of the latitude of a pole.
const TURN: i64 = 360_000_000;
const POLE: i32 = 90_000_000;

/// Extent of the mid-points of some records, microdegrees, in the coordinates of their file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Block {
    /// Western edge, and the width from there eastwards; a full turn is all longitudes.
    west: u32,
    width: u32,
    south: i32,
    north: i32,
    /// Largest distance of a shot from its mid-point.
    reach: u32,
    /// First and last time tag, ET seconds.
    first_s: f64,
    last_s: f64,
    /// Whether a record has an impossible place or reach: the block is then near every window.
    is_everywhere: bool,
}

impl Block {
    /// The extent of these records, of which there is at least one.
    pub(super) fn of<'a>(records: impl IntoIterator<Item = &'a Record>) -> Self {
        let mut block = Self {
            west: 0,
            width: 0,
            south: i32::MAX,
            north: i32::MIN,
            reach: 0,
            first_s: f64::INFINITY,
            last_s: f64::NEG_INFINITY,
            is_everywhere: false,
        };
        let longitudes = longitudes(records.into_iter().inspect(|record| block.include(record)));
        let western = longitudes.iter().copied().min().unwrap_or(i64::MAX);
        let eastern = longitudes.iter().copied().max().unwrap_or(i64::MIN);
        let width = eastern.saturating_sub(western).clamp(0, TURN);
        block.west = u32::try_from(western.rem_euclid(TURN)).unwrap_or(0);
        block.width = u32::try_from(width).unwrap_or(u32::MAX);
        block
    }

    /// Width and height of a block that can be divided.
    pub(super) fn size(&self) -> Option<[i64; 2]> {
        let is_one =
            !self.is_everywhere && i64::from(self.width) < TURN && self.south <= self.north;
        let height = i64::from(self.north) - i64::from(self.south);
        is_one.then_some([i64::from(self.width), height])
    }

    /// First and last time tag, ET seconds.
    pub(super) const fn tags_s(&self) -> [f64; 2] {
        [self.first_s, self.last_s]
    }

    /// Southern edge.
    pub(super) const fn south(&self) -> i32 {
        self.south
    }

    /// Largest latitude, without sign.
    pub(super) fn latitude_max(&self) -> u32 {
        self.south.unsigned_abs().max(self.north.unsigned_abs())
    }

    /// The part of its extent with these distances of its edges from the western and southern edge.
    pub(super) fn part(&self, [first, last, lowest, highest]: [i64; 4]) -> Self {
        let west = (i64::from(self.west) + first).rem_euclid(TURN);
        let latitude = |north: i64| {
            let latitude = i64::from(self.south) + north;
            i32::try_from(latitude).unwrap_or(POLE).min(self.north)
        };
        Self {
            west: u32::try_from(west).unwrap_or(0),
            width: u32::try_from(last - first).unwrap_or(u32::MAX),
            south: latitude(lowest),
            north: latitude(highest),
            ..*self
        }
    }

    fn include(&mut self, record: &Record) {
        let latitude = record.ground_latitude_microdegrees.get();
        self.south = self.south.min(latitude);
        self.north = self.north.max(latitude);
        self.is_everywhere |= latitude.saturating_abs() > POLE;
        let reach = (record.mid_point().reach_rad / RADIANS_PER_MICRODEGREE).ceil() + 1.0;
        if reach < f64::from(POLE) {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "1 to 90 million"
            )]
            let reach = reach as u32;
            self.reach = self.reach.max(reach);
        } else {
            self.is_everywhere = true;
        }
        let time_s = record.time_s.get();
        // A time that is not finite matches any interval.
        let [first_s, last_s] = if time_s.is_finite() {
            [time_s; 2]
        } else {
            [f64::NEG_INFINITY, f64::INFINITY]
        };
        self.first_s = self.first_s.min(first_s);
        self.last_s = self.last_s.max(last_s);
    }

    /// Whether a record of the block may contain a requested shot; see [`Query::may_matter`].
    pub(super) fn may_matter(&self, query: &Query<'_>, datum: Datum) -> bool {
        let radians = |microdegrees: i32| f64::from(microdegrees) * RADIANS_PER_MICRODEGREE;
        let whole = |microdegrees: u32| f64::from(microdegrees) * RADIANS_PER_MICRODEGREE;
        let extent = Extent {
            west_rad: whole(self.west),
            width_rad: whole(self.width),
            south_rad: radians(self.south),
            north_rad: radians(self.north),
            reach_rad: whole(self.reach) + Query::margin_rad(datum),
        };
        query.may_have_time(self.first_s, self.last_s)
            && (self.is_everywhere || query.windows.meets(&extent))
    }
}

/// Longitudes of the mid-points of successive records, each the shorter way from the preceding one.
pub(super) fn longitudes<'a>(records: impl IntoIterator<Item = &'a Record>) -> Vec<i64> {
    let mut before = None;
    let records = records.into_iter().map(|record| {
        let next = i64::from(record.ground_longitude_microdegrees.get());
        let next = before.map_or(next, |before: i64| {
            before + (next - before + TURN / 2).rem_euclid(TURN) - TURN / 2
        });
        before = Some(next);
        next
    });
    records.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{archive::Judged, pedr::RECORD_BYTES};
    use areograph_base::{
        altimetry::ShotFilter,
        time::{Et, Interval},
    };
    use areograph_geom::window::{Region, WindowShape};
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn filter() -> ShotFilter {
        ShotFilter {
            classes: Vec::new(),
            channels: Vec::new(),
            attitude_flags: Vec::new(),
            off_nadir_max_rad: 0.0,
            solar_longitude_rad: ShotFilter::ALL_SEASONS,
        }
    }

    /// A record of any bytes, most of them with a possible place, reach and time.
    fn record() -> impl Strategy<Value = Record> {
        let place = (
            -360_000_000..360_000_000,
            -90_000_000..=90_000_000,
            -200_000..200_000,
        );
        let bytes = proptest::collection::vec(any::<u8>(), RECORD_BYTES);
        (bytes, place, -1e4..1e4_f64, 0..10).prop_map(|(bytes, place, time_s, damage)| {
            let bytes: [u8; RECORD_BYTES] = bytes.try_into().unwrap();
            let mut record = Record::from_bytes(&bytes);
            if damage > 0 {
                record.ground_longitude_microdegrees.set(place.0);
                record.ground_latitude_microdegrees.set(place.1);
                record.ground_longitude_change_microdegrees.set(place.2);
                record.ground_latitude_change_microdegrees.set(50_000);
                record.parallax_longitude_nanodegrees_per_m.set(100);
                record.parallax_latitude_nanodegrees_per_m.set(-100);
                record.time_s.set(time_s);
            }
            record
        })
    }

    proptest! {
        #[test]
        fn a_block_matters_when_one_of_its_records_does(
            records in proptest::collection::vec(record(), 1..128),
            [west, width] in [0.0..2.0 * PI, 0.001..PI],
            [south, height] in [-0.5 * PI..0.5 * PI, 0.0..0.3_f64],
            time in proptest::option::of((-1e4..1e4_f64, 0.0..1e3_f64)),
            datum in prop_oneof![Just(Datum::Iau2000), Just(Datum::Iau1991)],
        ) {
            let region = Region::new(&WindowShape::Box {
                west_rad: west,
                east_rad: (west + width).rem_euclid(2.0 * PI),
                south_rad: south,
                north_rad: (south + height).min(0.5 * PI),
            });
            let filter = filter();
            let time = time.map(|(start, length)| {
                Interval::new(Et::from_seconds(start), Et::from_seconds(start + length))
            });
            let query = Query::new(vec![region], &filter, Judged::Near).within(time);
            let block = Block::of(&records);
            let matters = |record: &Record| query.may_matter(record, datum);
            if records.iter().any(matters) {
                prop_assert!(block.may_matter(&query, datum));
            }
        }
    }

    #[test]
    fn a_block_across_zero_is_narrow() {
        let at = |longitude: i32| {
            let mut record = Record::from_bytes(&[0; RECORD_BYTES]);
            record.ground_longitude_microdegrees.set(longitude);
            record
        };
        let block = Block::of(&[at(359_000_000), at(1_000_000), at(358_000_000)]);
        assert_eq!((block.west, block.width), (358_000_000, 3_000_000));
        let round: Vec<Record> = (0..8).map(|step| at(step * 50_000_000)).collect();
        assert_eq!(Block::of(&round).width, 350_000_000);
    }
}
