//! Scan of some rows of a file: records near a window, and their shots in it.

use std::ops::Range;

use super::{Found, Judged, Query, ShotRejection, Source};
use crate::pedr::{Frame, SHOTS, Stretch};
use areograph_base::{
    body::{Body, Datum},
    footprints::Footprint,
    time::Et,
};
use areograph_geom::{
    body_rotation::convert_datum,
    ellipsoid::{Spherical, spherical_to_xyz_m},
};

/// A file and the query that is applied to it.
pub(super) struct Scan<'a> {
    pub(super) source: &'a Source,
    /// Index of the file within the search.
    pub(super) index: u16,
    pub(super) query: &'a Query<'a>,
}

/// Windows near a frame and around a shot; the buffers are allocated once per stretch.
#[derive(Default)]
struct Windows {
    near: Vec<u32>,
    around: Vec<u32>,
}

impl Scan<'_> {
    /// Searches some rows of the stretch.
    pub(super) fn rows(&self, stretch: &Stretch, rows: Range<usize>, found: &mut Found) {
        let mut windows = Windows::default();
        let datum = self.source.datum();
        let complaints_known = self.source.complaints_known(self.query);
        let judges_all = self.query.judged == Judged::All && !complaints_known;
        let matters: Vec<bool> = stretch
            .records(rows.clone())
            .map(|(_, record)| self.query.may_matter(record, datum))
            .collect();
        let first = rows.start;
        for run in runs(&matters, judges_all) {
            let rows = first + run.start..first + run.end;
            for (row, frame) in stretch.frames(rows, self.source.guard()) {
                match frame {
                    Ok(frame) if matters[row - first] => {
                        self.frame(stretch, row, &frame, &mut windows, found);
                    }
                    Err(error) if !complaints_known => {
                        found.complain(stretch.complaint(row, &error));
                    }
                    Ok(_) | Err(_) => {}
                }
            }
        }
    }

    fn frame(
        &self,
        stretch: &Stretch,
        row: usize,
        frame: &Frame<'_>,
        windows: &mut Windows,
        found: &mut Found,
    ) {
        let (longitude_rad, latitude_rad) = frame.mid_point();
        let margin_rad = frame.reach_rad() + Query::margin_rad(self.source.datum());
        let grid = &self.query.windows;
        grid.within(longitude_rad, latitude_rad, margin_rad, &mut windows.near);
        if windows.near.is_empty() {
            return;
        }
        let spoiled = frame.spoiled_shots();
        if let Some(error) = spoiled.error() {
            found.complain(stretch.complaint(row, error));
        }
        for shot in (1..).take(SHOTS).filter_map(|shot| frame.shot(shot)) {
            found.shots_read += 1;
            let et_s = shot.et_tag_s + self.query.correction_s;
            if (self.query.time).is_some_and(|time| !time.contains(Et::from_seconds(et_s))) {
                continue;
            }
            let (longitude_rad, latitude_rad) = self.iau2000(&shot);
            windows.around.clear();
            let near = windows.near.iter().copied();
            let around = near.filter(|window| grid.holds(*window, longitude_rad, latitude_rad));
            windows.around.extend(around);
            if windows.around.is_empty() {
                continue;
            }
            if let Some(reason) = ShotRejection::of(&shot, &spoiled, self.query.filter) {
                *found.rejected.entry(reason).or_default() += 1;
                continue;
            }
            let shot = Footprint {
                et_s,
                file: self.index,
                record: stretch.record_number(row),
                ..shot
            };
            found.push(&shot, &windows.around);
        }
    }

    /// East longitude and areocentric latitude in IAU 2000, radians.
    fn iau2000(&self, shot: &Footprint) -> (f64, f64) {
        let datum = self.source.datum();
        if datum == Datum::Iau2000 {
            return (shot.longitude_rad, shot.latitude_rad);
        }
        let at = Et::from_seconds(shot.et_tag_s);
        let direction = spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, 1.0);
        let direction = convert_datum(Body::Mars, direction, datum, at, at);
        let spherical = Spherical::from_xyz_m(&direction.xyz_m);
        (spherical.longitude_rad, spherical.latitude.0)
    }
}

/// Runs of successive rows, counted from the first, that are to be checked.
fn runs(matters: &[bool], judges_all: bool) -> Vec<Range<usize>> {
    let mut start = 0;
    let mut runs = Vec::new();
    for run in matters.chunk_by(|before, after| judges_all || before == after) {
        if judges_all || run[0] {
            runs.push(start..start + run.len());
        }
        start += run.len();
    }
    runs
}
