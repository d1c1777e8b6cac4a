//! Shots and residuals of some records of a file.

use std::{collections::BTreeMap, ops::Range};

use super::{
    ArchiveRules,
    spacecraft::{FrameSpacecraft, StateGrid},
};
use crate::{convert_datum::DatumTurn, spacecraft_grid::state};
use areograph_base::{footprints::Footprint, time::Et};
use areograph_geom::range_residuals::{NearbyShot, RangeResiduals};
use areograph_pds::{
    archive::ShotRejection,
    pedr::{Complaint, FieldGuard, Frame, SHOTS, SpoiledShots, Stretch},
};
use areograph_spice::Trajectory;

/// Every *n*-th shot is kept in full, for the scan of clock biases and for the map.
const SAMPLE_STEP: usize = 48;

/// A shot in IAU 2000, and its residuals where the kernels have a position.
type Shot = (Footprint, Option<RangeResiduals>);

/// A shot and its residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedShot {
    /// Time tag, ET seconds.
    pub et_tag_s: f64,
    /// Corrected time, ET seconds.
    pub et_s: f64,
    /// Orbit number.
    pub orbit: u32,
    /// Record of the file, counted from 1 with the label.
    pub record: u32,
    /// Shot in the frame, 1 to 20.
    pub shot: u8,
    /// Off-nadir angle, radians.
    pub off_nadir_rad: f64,
    /// East longitude and areocentric latitude, IAU 2000, radians.
    pub place_rad: [f64; 2],
    /// Residuals; `None` where the kernels have no position.
    pub residuals: Option<RangeResiduals>,
}

/// Results of some records.
#[derive(Default)]
pub(super) struct Task {
    pub(super) shots: Vec<CheckedShot>,
    /// Some of the shots in full, with their places among `shots`.
    pub(super) samples: Vec<(usize, Footprint)>,
    pub(super) not_covered: u64,
    pub(super) rejected: BTreeMap<ShotRejection, u64>,
    pub(super) complaints: Vec<Complaint>,
}

/// Records in memory, and how they are judged.
pub(super) struct Rows<'a> {
    pub(super) stretch: &'a Stretch,
    pub(super) trajectory: &'a Trajectory,
    pub(super) rules: ArchiveRules<'a>,
    pub(super) turn: DatumTurn,
    pub(super) guard: FieldGuard,
}

impl Rows<'_> {
    /// Checks the shots of some rows.
    pub(super) fn check(&self, rows: Range<usize>) -> Task {
        let mut task = Task {
            shots: Vec::with_capacity(SHOTS * rows.len()),
            ..Task::default()
        };
        let mut grid = StateGrid::new(self.trajectory);
        for (row, frame) in self.stretch.frames(rows, self.guard) {
            match frame {
                Ok(frame) => self.frame(row, &frame, &mut grid, &mut task),
                Err(error) => task.complaints.push(self.stretch.complaint(row, &error)),
            }
        }
        task
    }

    fn frame(&self, row: usize, frame: &Frame<'_>, grid: &mut StateGrid<'_>, task: &mut Task) {
        let record = self.stretch.record_number(row);
        let clock = self.rules.clock;
        let middle = clock.spacecraft_time(frame.record().time_s.get());
        let spacecraft = FrameSpacecraft::around(middle, grid);
        let mut shots = [None; SHOTS];
        let mut nearby = None;
        for (slot, number) in shots.iter_mut().zip(1..) {
            *slot = frame.shot(number).map(|shot| {
                let shot = self.turn.applied(Footprint {
                    et_s: shot.et_tag_s + clock.correction_s(),
                    record,
                    ..shot
                });
                let at: Et = clock.spacecraft_time(shot.et_tag_s);
                let spacecraft = match &spacecraft {
                    Some(spacecraft) => Some(spacecraft.at(at.since(middle))),
                    None => state(at, self.trajectory),
                };
                // A frame is 6 km long: 2e-3 rad, except close to the poles.
                let nearby = nearby.get_or_insert_with(|| NearbyShot::new(&shot));
                let residuals = spacecraft.map(|craft| nearby.residuals(&shot, &craft));
                (shot, residuals)
            });
        }
        let spoiled = self.spoiled(frame, &shots);
        if let Some(error) = spoiled.error() {
            task.complaints.push(self.stretch.complaint(row, error));
        }
        for (shot, residuals) in shots.into_iter().flatten() {
            if let Some(reason) = ShotRejection::of(&shot, &spoiled, Some(self.rules.filter)) {
                *task.rejected.entry(reason).or_default() += 1;
                continue;
            }
            task.not_covered += u64::from(residuals.is_none());
            if task.shots.len().is_multiple_of(SAMPLE_STEP) {
                task.samples.push((task.shots.len(), shot));
            }
            task.shots.push(CheckedShot {
                et_tag_s: shot.et_tag_s,
                et_s: shot.et_s,
                orbit: shot.orbit,
                record,
                shot: shot.shot,
                off_nadir_rad: shot.off_nadir_rad,
                place_rad: [shot.longitude_rad, shot.latitude_rad],
                residuals,
            });
        }
    }

    /// The shots with contradictory values. Where coordinates are not converted, the residuals already hold the
    /// distance to the file's own spacecraft.
    fn spoiled(&self, frame: &Frame<'_>, shots: &[Option<Shot>; SHOTS]) -> SpoiledShots {
        let is_known = shots
            .iter()
            .flatten()
            .all(|(_, residuals)| residuals.is_some());
        if !self.turn.is_none() || !is_known {
            return frame.spoiled_shots();
        }
        frame.spoiled_by(|number| {
            let (shot, residuals) = shots.get(usize::from(number).checked_sub(1)?)?.as_ref()?;
            residuals
                .filter(|_| shot.range_m > 0.0)
                .map(|residuals| residuals.decoding_m)
        })
    }
}
