//! Extents of the parts of a block near a pole, where the extent of a block is wide.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{
    Query,
    block::{Block, longitudes},
};
use crate::pedr::Record;
use areograph_base::body::Datum;

/// Records of a part.
const PART_RECORDS: usize = 32;
/// Latitude from which blocks are divided, microdegrees.
const DIVIDED_FROM: u32 = 60_000_000;
/// Steps of an edge across the extent of the block.
const STEPS: i64 = 255;

/// Edges of the parts of a block, in steps of its extent, rounded outwards: western, eastern, southern, northern. Without
/// parts, the block is not divided.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Parts(Vec<[u8; 4]>);

impl Parts {
    /// The parts of a block of these records.
    pub(super) fn of(block: &Block, records: &[&Record]) -> Self {
        let Some([width, height]) = block.size() else {
            return Self::default();
        };
        if block.latitude_max() < DIVIDED_FROM {
            return Self::default();
        }
        let longitudes = longitudes(records.iter().copied());
        let west = longitudes.iter().copied().min().unwrap_or(0);
        let south = i64::from(block.south());
        let parts = records
            .chunks(PART_RECORDS)
            .zip(longitudes.chunks(PART_RECORDS));
        let edges = |(records, longitudes): (&[&Record], &[i64])| {
            let north =
                |record: &&Record| i64::from(record.ground_latitude_microdegrees.get()) - south;
            let [first, last] = outwards(longitudes.iter().map(|east| east - west), width);
            let [lowest, highest] = outwards(records.iter().map(north), height);
            [first, last, lowest, highest]
        };
        Self(parts.map(edges).collect())
    }

    /// The rows of parts that may contain requested shots, of the rows of the block.
    pub(super) fn near(
        &self,
        block: &Block,
        rows: Range<usize>,
        query: &Query<'_>,
        datum: Datum,
    ) -> Vec<Range<usize>> {
        let Some(size) = block.size().filter(|_| !self.0.is_empty()) else {
            return vec![rows];
        };
        let end = rows.end;
        let starts = rows.step_by(PART_RECORDS).zip(&self.0);
        let near = starts.filter(|(_, edges)| {
            let part = block.part(inwards(**edges, size));
            part.may_matter(query, datum)
        });
        near.map(|(start, _)| start..end.min(start + PART_RECORDS))
            .collect()
    }
}

/// First and last step that contain all distances, microdegrees, from the edge of an extent of this size.
fn outwards(distances: impl Iterator<Item = i64>, size: i64) -> [u8; 2] {
    let size = size.max(1);
    let (mut first, mut last) = (STEPS, 0);
    for distance in distances {
        first = first.min((distance * STEPS).div_euclid(size));
        last = last.max((distance * STEPS + size - 1).div_euclid(size));
    }
    [first, last].map(|step| u8::try_from(step.clamp(0, STEPS)).unwrap_or(0))
}

/// Distances of the edges from the western and southern edge of an extent of this size, microdegrees.
fn inwards([first, last, lowest, highest]: [u8; 4], [width, height]: [i64; 2]) -> [i64; 4] {
    let down = |step: u8, size: i64| i64::from(step) * size / STEPS;
    let up = |step: u8, size: i64| (i64::from(step) * size + STEPS - 1) / STEPS;
    [
        down(first, width),
        up(last, width),
        down(lowest, height),
        up(highest, height),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{archive::Judged, pedr::RECORD_BYTES};
    use areograph_base::{altimetry::ShotFilter, units::RADIANS_PER_DEGREE};
    use areograph_geom::window::{Region, WindowShape};
    use proptest::prelude::*;

    fn filter() -> ShotFilter {
        ShotFilter {
            classes: Vec::new(),
            channels: Vec::new(),
            attitude_flags: Vec::new(),
            off_nadir_max_rad: 0.0,
            solar_longitude_rad: ShotFilter::ALL_SEASONS,
        }
    }

    fn window(west: f64, south: f64, width: f64) -> Region {
        Region::new(&WindowShape::Box {
            west_rad: west * RADIANS_PER_DEGREE,
            east_rad: (west + width).rem_euclid(360.0) * RADIANS_PER_DEGREE,
            south_rad: south * RADIANS_PER_DEGREE,
            north_rad: (south + width).min(90.0) * RADIANS_PER_DEGREE,
        })
    }

    /// A track of this many records from a place, microdegrees, with these steps.
    fn track(count: i32, [east, north]: [i32; 2], steps: [i32; 2]) -> Vec<Record> {
        let at = |number: i32| {
            let mut record = Record::from_bytes(&[0; RECORD_BYTES]);
            let east = (east + number * steps[0]).rem_euclid(360_000_000);
            record.ground_longitude_microdegrees.set(east);
            let north = (north + number * steps[1]).clamp(-90_000_000, 90_000_000);
            record.ground_latitude_microdegrees.set(north);
            record.ground_longitude_change_microdegrees.set(steps[0]);
            record.ground_latitude_change_microdegrees.set(steps[1]);
            record
        };
        (0..count).map(at).collect()
    }

    proptest! {
        #[test]
        fn every_record_that_matters_is_in_a_part_that_is_near(
            count in 1..129,
            east in 0..360_000_000,
            north in prop_oneof![55_000_000..90_000_000, -90_000_000..-55_000_000],
            steps in [-2_500_000..2_500_000, -100_000..100_000],
            [west, south] in [0.0..360.0, -89.0..89.0_f64],
            width in 0.1..40.0_f64,
            datum in prop_oneof![Just(Datum::Iau2000), Just(Datum::Iau1991)],
        ) {
            let records = track(count, [east, north], steps);
            let records: Vec<&Record> = records.iter().collect();
            let block = Block::of(records.iter().copied());
            let filter = filter();
            let query = Query::new(vec![window(west, south, width)], &filter, Judged::Near);
            let near = Parts::of(&block, &records).near(&block, 0..records.len(), &query, datum);
            for (row, record) in records.iter().enumerate() {
                let is_near = near.iter().any(|rows| rows.contains(&row));
                prop_assert!(is_near || !query.may_matter(record, datum), "row {row} of {near:?}");
            }
        }
    }

    #[test]
    fn parts_of_a_polar_block_are_narrow() {
        let records = track(128, [350_000_000, 70_000_000], [500_000, 100_000]);
        let records: Vec<&Record> = records.iter().collect();
        let block = Block::of(records.iter().copied());
        let filter = filter();
        let query = Query::new(vec![window(11.0, 74.0, 1.0)], &filter, Judged::Near);
        let parts = Parts::of(&block, &records);
        let near = parts.near(&block, 1_000..1_128, &query, Datum::Iau2000);
        assert_eq!((near.len(), &near[0]), (1, &(1_032..1_064)));
        let south = track(128, [350_000_000, 40_000_000], [500_000, 100_000]);
        let south: Vec<&Record> = south.iter().collect();
        let block = Block::of(south.iter().copied());
        assert_eq!(Parts::of(&block, &south), Parts::default());
    }
}
