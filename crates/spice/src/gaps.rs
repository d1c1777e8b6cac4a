//! Checks of required coverage, and the gaps in it.

use super::{coverage::RequiredCoverage, error::SpiceError, role::KernelRole, session::Session};
use areograph_base::{
    error::Result,
    time::{Et, Interval, Intervals, PointingBias},
};

impl Session {
    /// For each kernel that holds the spacecraft: its index in the set, and the required instants for which CSPICE
    /// reads it, because no later kernel of its role covers them.
    ///
    /// * `tolerance_s` – largest distance from its intervals at which a C-kernel may be read, seconds
    ///
    /// # Errors
    /// As [`Self::coverage`].
    pub fn coverage_in_use(
        &self,
        required: &RequiredCoverage,
        tolerance_s: f64,
    ) -> Result<Vec<(usize, Intervals)>> {
        let (mut positions, mut attitudes) =
            (required.positions.clone(), required.attitudes.clone());
        let mut in_use = Vec::new();
        for (index, held) in self.coverage()?.per_kernel.iter().rev() {
            let (open, reach_s) = match self.kernels().kernels()[*index].role {
                KernelRole::Ck => (&mut attitudes, tolerance_s),
                _ => (&mut positions, 0.0),
            };
            in_use.push((*index, held.intersection(open)));
            let reached = held.as_slice().iter().map(|part| part.padded(reach_s));
            *open = open.without(&Intervals::union_of(reached));
        }
        in_use.reverse();
        Ok(in_use)
    }

    /// Checks that the position of the spacecraft is known throughout `required`.
    ///
    /// # Errors
    /// [`SpiceError::CoverageGap`] with the first gap and the kernels beside it.
    pub fn require_position(&self, required: Interval) -> Result<()> {
        let held = &self.coverage()?.spk;
        self.require(required, held, "position", KernelRole::Spk)
    }

    /// Checks that the attitude is known for every exposure in `exposures`.
    ///
    /// The instants are those in the time of the C-kernels, with `padding_s` seconds more at both ends; an instant
    /// within `tolerance_s` of a C-kernel's interval is covered, as in [`Session::attitude`].
    ///
    /// # Errors
    /// [`SpiceError::CoverageGap`] with the first gap and the kernels beside it.
    pub fn require_attitude(
        &self,
        exposures: Interval,
        bias: PointingBias,
        padding_s: f64,
        tolerance_s: f64,
    ) -> Result<()> {
        let required = exposures.shifted(bias.seconds()).padded(padding_s);
        let intervals = self.coverage()?.ck.as_slice().iter();
        let held = Intervals::union_of(intervals.map(|interval| interval.padded(tolerance_s)));
        self.require(required, &held, "attitude", KernelRole::Ck)
    }

    fn require(
        &self,
        required: Interval,
        held: &Intervals,
        what: &'static str,
        role: KernelRole,
    ) -> Result<()> {
        if held.cover(required) {
            return Ok(());
        }
        // An instant has no extent, hence no gap of any extent.
        let gap = held.gaps_in(required).first().copied().unwrap_or(required);
        let gap_utc = format!("UTC {} .. {}", self.utc(gap.start), self.utc(gap.stop));
        let neighbours = self.neighbours(gap, role)?;
        Err(SpiceError::CoverageGap {
            what,
            of: self.whom(role),
            gap,
            gap_utc,
            required,
            neighbours,
        }
        .into())
    }

    /// The spacecraft, with its number unless it is the usual one: files of several may be present.
    pub(super) fn whom(&self, role: KernelRole) -> String {
        let of = self.spacecraft();
        match role {
            _ if of.has_laser() => of.name.clone(),
            KernelRole::Ck => format!("{} ({}, {})", of.name, of.bus, of.bus_frame),
            _ => format!("{} ({})", of.name, of.naif),
        }
    }

    /// The kernels that end before a gap and begin after it.
    fn neighbours(&self, gap: Interval, role: KernelRole) -> Result<String> {
        let kernels = self.kernels().kernels();
        let mut before: Option<(Et, usize)> = None;
        let mut after: Option<(Et, usize)> = None;
        let mut inside = None;
        for (index, intervals) in &self.coverage()?.per_kernel {
            if kernels[*index].role != role {
                continue;
            }
            for interval in intervals.as_slice() {
                if interval.stop <= gap.start && before.is_none_or(|(stop, _)| interval.stop > stop)
                {
                    before = Some((interval.stop, *index));
                } else if interval.start >= gap.stop
                    && after.is_none_or(|(start, _)| interval.start < start)
                {
                    after = Some((interval.start, *index));
                } else if interval.start < gap.stop && interval.stop > gap.start {
                    inside = Some(*index);
                }
            }
        }
        let name = |index: usize| kernels[index].file_name();
        let mut sentences = Vec::new();
        if let Some(index) = inside {
            sentences.push(format!(
                "{} contains {} at this time, but no kernel links the centre of that segment to Mars",
                name(index),
                self.spacecraft().name
            ));
        }
        if let Some((stop, index)) = before {
            sentences.push(format!("{} ends at UTC {}", name(index), self.utc(stop)));
        }
        if let Some((start, index)) = after {
            sentences.push(format!("{} begins at UTC {}", name(index), self.utc(start)));
        }
        if role == KernelRole::Ck {
            let without = self.coverage()?.without_rates.iter();
            sentences.extend(without.map(|index| {
                format!(
                    "{} contains attitude without angular rates, which areograph does not read",
                    name(*index)
                )
            }));
        }
        if sentences.is_empty() {
            sentences.push("no loaded kernel contains this interval".to_owned());
        }
        Ok(sentences.join(", "))
    }

    /// UTC for messages; without leap seconds the text states so.
    fn utc(&self, et: Et) -> String {
        self.et_to_utc(et)
            .unwrap_or_else(|_| "unknown (no leap seconds)".to_owned())
    }
}
