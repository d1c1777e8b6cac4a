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
/// Standard deviation of the median of many coordinates over that of their mean: √(π/2).
const MEDIAN_SCATTER: f64 = 1.253;
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
            common_shift_cells: common_shift_cells(&control.units),
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

/// Length of the median shift of kept units that calibrate, cells: what they have in common.
fn common_shift_cells(units: &[UnitResult]) -> f64 {
    let kept = units.iter().filter(|unit| unit.is_kept() && !unit.judges);
    let shifts: Vec<[f64; 2]> = kept
        .filter_map(|unit| Some(unit.found?.shift_cells))
        .collect();
    if shifts.is_empty() {
        return f64::INFINITY;
    }
    let median = |axis: usize| {
        let of: Vec<f64> = shifts.iter().map(|shift| shift[axis]).collect();
        Summary::of(&of).median
    };
    median(0).hypot(median(1))
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

    /// Limit of the shift that units have in common, cells: errors of the laser differ between units.
    #[must_use]
    pub fn common_limit_cells(&self) -> f64 {
        let units = self.rounds.last().map_or(1, |round| round.units[0].max(1));
        let laser_cells = self.laser_sigma_m / self.cell_m / (units as f64).sqrt();
        SHIFT_CELLS.hypot(2.0 * MEDIAN_SCATTER * laser_cells)
    }

    /// Length of the median shift of units in the last round, cells.
    fn common_shift_cells(&self) -> f64 {
        self.rounds
            .last()
            .map_or(f64::INFINITY, |round| round.common_shift_cells)
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
        self.shift_cells() > SELECT_CELLS.max(2.0 * self.shift_limit_cells())
    }

    /// Whether another round would change nothing significant.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.shift_cells() < self.shift_limit_cells()
            && self.common_shift_cells() < self.common_limit_cells()
            && self.control_share() < CONTROL_SHARE
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
                _ => "an unknown share (rounds with different units cannot be compared)".to_owned(),
            };
            reasons.push(format!(
                "no convergence in {count} rounds: in the last round, units were shifted by {:.2} cells (median), together by {:.2} \
                 cells, and residuals of control changed by {change}; expected less than {:.2} cells, {:.2} cells and {:.0} %",
                rounds.shift_cells(),
                rounds.common_shift_cells(),
                rounds.shift_limit_cells(),
                rounds.common_limit_cells(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn round(
        number: u32,
        units_of: u32,
        [shift, common]: [f64; 2],
        unit_px: f64,
    ) -> CalibrationRound {
        CalibrationRound {
            round: number,
            units_of,
            ties: 0,
            model_tie_px: None,
            tie_px: None,
            filled: 1.0,
            units: [50, 0],
            judging: [0; 2],
            shift_cells: shift,
            common_shift_cells: common,
            bias_m: None,
            control: PixelsAndMetres::default(),
            held_back: PixelsAndMetres::default(),
            unit_px: BTreeMap::from([(1, unit_px)]),
            held_back_scatter: None,
            angles_rad: Vec::new(),
            drift_m_per_line: [0.0; 3],
        }
    }

    fn rounds(laser_sigma_m: f64, last: CalibrationRound) -> Rounds {
        Rounds {
            rounds: vec![round(1, 1, [0.9, 0.1], 1.0), last],
            rounds_max: 10,
            cell_m: 100.0,
            laser_sigma_m,
        }
    }

    #[test]
    fn units_may_scatter_as_the_laser_does_and_not_lie_off_together() {
        let last = |shifts| round(2, 1, shifts, 1.01);
        // 70 m are 0.96 cells for half of the units, and with 50 units 0.56 cells for all together.
        assert!(rounds(70.0, last([0.9, 0.2])).is_converged());
        assert!(!rounds(70.0, last([0.9, 0.8])).is_converged());
        assert!(!rounds(70.0, last([1.2, 0.2])).is_converged());
        // An exact laser permits half a cell.
        assert!(!rounds(1.0, last([0.9, 0.2])).is_converged());
        assert!(rounds(1.0, last([0.4, 0.2])).is_converged());
    }

    #[test]
    fn rounds_with_other_units_are_not_compared() {
        let again = rounds(70.0, round(2, 2, [0.9, 0.2], 1.0));
        assert!(!again.is_converged());
        let far = rounds(70.0, round(2, 1, [5.5, 5.5], 1.0));
        assert!(far.selects_again());
        // With cells of 10 m, errors of the laser alone are more than five cells.
        let fine = Rounds {
            cell_m: 10.0,
            ..rounds(70.0, round(2, 1, [8.0, 0.2], 1.0))
        };
        assert!(!fine.selects_again());
    }
}
