//! Rounds of a calibration from pixels: the numbers of each, the criterion of convergence, and the verdict.

use std::collections::BTreeMap;

use super::result::{Calibration, CalibrationRound, PixelsAndMetres, PointKind, Rounds};
use crate::{
    judge::{Check, CheckKind, CheckOutcome::Fail, Verdict},
    match_laser::{LaserMatch, UnitResult},
};
use areograph_base::ties::MatchedPair;
use areograph_geom::statistics::Summary;

/// Rounds end when half of the units are shifted by less than this, cells, apart from errors of the laser, and residuals of control change by
/// less than this share.
const SHIFT_CELLS: f64 = 0.5;
/// Median length of a vector of two coordinates with a standard deviation of one: √(2 ln 2).
const MEDIAN_LENGTH: f64 = 1.177;
const CONTROL_SHARE: f64 = 0.02;
/// After a round with a larger shift, cells, the shots of units are selected anew: the model that follows lies so far from the former one that
/// other shots are on it.
const SELECT_CELLS: f64 = 5.0;

impl CalibrationRound {
    /// The numbers of round `round`.
    ///
    /// * `units_of` – round in which the shots of its units were selected
    /// * `tied` – the calibration by tie points only, with whose cameras the terrain model was made
    /// * `filled` – share of that model with heights
    /// * `control` – the match of the laser with it
    /// * `done` – the calibration by tie points and control
    #[must_use]
    pub fn of(
        round: u32,
        units_of: u32,
        tied: &Calibration,
        filled: f64,
        control: &LaserMatch,
        done: &Calibration,
    ) -> Self {
        let figures = |of: &Calibration| of.steps.last().map(|step| step.figures.clone());
        let worst_px = |of: &Calibration| figures(of).and_then(|of| of.ties.worst_px());
        let rms = |kind: PointKind| {
            let last = figures(done);
            let cameras = last
                .as_ref()
                .and_then(|of| of.of(kind))
                .map(|of| &*of.cameras);
            let rms = |of: fn(&PixelsAndMetres) -> Option<f64>| {
                let all: Vec<f64> = cameras.unwrap_or_default().iter().filter_map(of).collect();
                let square: f64 = all.iter().map(|of| of * of).sum();
                (!all.is_empty()).then(|| (square / all.len() as f64).sqrt())
            };
            PixelsAndMetres {
                plane_px: rms(|of| of.plane_px),
                plane_m: rms(|of| of.plane_m),
            }
        };
        let units = |judges: bool| {
            let of_side = || control.units.iter().filter(|unit| unit.judges == judges);
            let kept = of_side().filter(|unit| unit.is_kept()).count();
            [kept as u64, (of_side().count() - kept) as u64]
        };
        Self {
            round,
            units_of,
            ties: figures(done).map_or(0, |of| of.ties.points),
            model_tie_px: worst_px(tied),
            tie_px: worst_px(done),
            filled,
            units: units(false),
            judging: units(true),
            shift_cells: shift_cells(&control.units),
            bias_m: control.bias_m,
            control: rms(PointKind::Control),
            held_back: rms(PointKind::HeldBack),
            unit_px: unit_px(control, done),
            held_back_scatter: done.held_back.as_ref().map(|held_back| held_back.scatter),
            angles_rad: done
                .cameras
                .iter()
                .map(|of| of.angles_rad.map(|of| of.value))
                .collect(),
            drift_m_per_line: done
                .drift_m_per_line
                .map(|drift_m_per_line| drift_m_per_line.value),
        }
    }
}

/// Residuals of the control points that were used, by their units.
fn unit_px(control: &LaserMatch, done: &Calibration) -> BTreeMap<usize, f64> {
    let points = control.points.iter();
    let of_name: BTreeMap<&str, usize> = points.map(|point| (&*point.name, point.unit)).collect();
    let mut squares: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    let used = done.images.iter();
    for image in used.filter(|image| image.kind == PointKind::Control && !image.left_out) {
        if let Some((unit, [across, along])) = of_name.get(&*image.point).zip(image.after_px) {
            let of_unit = squares.entry(*unit).or_default();
            of_unit.push(across * across + along * along);
        }
    }
    let mean = |of: Vec<f64>| (of.iter().sum::<f64>() / of.len() as f64).sqrt();
    squares
        .into_iter()
        .map(|(unit, of)| (unit, mean(of)))
        .collect()
}

/// Median length of the shifts of kept units that calibrate.
fn shift_cells(units: &[UnitResult]) -> f64 {
    let kept = units.iter().filter(|unit| unit.is_kept() && !unit.judges);
    let lengths = kept.filter_map(|unit| {
        let [east, north] = unit.found?.shift_cells;
        Some(east.hypot(north))
    });
    let lengths: Vec<f64> = lengths.collect();
    if lengths.is_empty() {
        return f64::INFINITY;
    }
    Summary::of(&lengths).median
}

impl Rounds {
    /// Share by which the residuals of control changed in the last round, root mean square over units that the last two
    /// rounds used: units near the limits of a match vary from round to round. Infinite in the first, and where the shots of units were
    /// selected anew.
    fn control_share(&self) -> f64 {
        let [.., before, last] = &self.rounds[..] else {
            return f64::INFINITY;
        };
        if before.units_of != last.units_of {
            return f64::INFINITY;
        }
        let both = || {
            let units = last.unit_px.iter();
            units.filter_map(|(unit, px)| Some([*before.unit_px.get(unit)?, *px]))
        };
        let square = |at: usize| both().map(|px| px[at] * px[at]).sum::<f64>();
        let share = ((square(1) / square(0)).sqrt() - 1.0).abs();
        // NaN without a unit in common.
        if share.is_finite() {
            share
        } else {
            f64::INFINITY
        }
    }

    /// Limit of the median shift of units, cells: the errors of the laser shift units as well.
    #[must_use]
    pub fn shift_limit_cells(&self) -> f64 {
        SHIFT_CELLS.hypot(MEDIAN_LENGTH * self.laser_sigma_m / self.cell_m)
    }

    /// Median shift of units in the last round, cells.
    fn shift_cells(&self) -> f64 {
        self.rounds
            .last()
            .map_or(f64::INFINITY, |round| round.shift_cells)
    }

    /// Whether the next round selects the shots of units anew.
    #[must_use]
    pub fn selects_again(&self) -> bool {
        self.shift_cells() > SELECT_CELLS
    }

    /// Whether another round would change nothing significant.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.shift_cells() < self.shift_limit_cells() && self.control_share() < CONTROL_SHARE
    }
}

impl Calibration {
    /// The result of the last round, with the verdict on the rounds and on the last match with the laser.
    #[must_use]
    pub fn in_rounds(self, rounds: Rounds, last: &Verdict, pairs: &[MatchedPair]) -> Self {
        let Verdict {
            mut reasons,
            mut remarks,
            mut checks,
            ..
        } = self.verdict;
        let count = rounds.rounds.len();
        if !rounds.is_converged() {
            let change = match rounds.control_share() {
                share if share.is_finite() => format!("{:.1} %", 100.0 * share),
                _ => "an unknown share".to_owned(),
            };
            reasons.push(format!(
                "no convergence in {count} rounds: in the last round, units were shifted by {:.2} cells (median), and \
                 residuals of control changed by {change}; expected less than {:.2} cells and {:.0} %",
                rounds.shift_cells(),
                rounds.shift_limit_cells(),
                100.0 * CONTROL_SHARE
            ));
        }
        for reason in &last.reasons {
            reasons.push(format!("laser control of round {count}: {reason}"));
        }
        for remark in &last.remarks {
            remarks.push(format!("laser control of round {count}: {remark}"));
        }
        let refused = pairs.iter().filter(|pair| pair.is_refused).count();
        if refused > 0 {
            remarks.push(format!(
                "pairs of lines with too few tie points to be significant: {refused} of {}",
                pairs.len()
            ));
        }
        checks.extend(last.checks.iter().cloned());
        checks.push(Check::new(
            CheckKind::RoundShift,
            "",
            rounds.shift_cells(),
            rounds.shift_limit_cells(),
            Fail,
        ));
        checks.push(Check::of_share(
            CheckKind::RoundControl,
            "",
            rounds.control_share(),
            CONTROL_SHARE,
            Fail,
        ));
        Self {
            verdict: Verdict::of(reasons, remarks, checks),
            rounds: Some(rounds),
            ..self
        }
    }
}
