//! When kernels hold position and attitude, gaps inside a file included.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{
    daf,
    error::SpiceFault,
    kernels::KernelRole,
    select::Wanted,
    session::{CLOCKS, Session},
};
use crate::{
    constants::{NAIF_MARS, NAIF_MGS, NAIF_MGS_BUS},
    error::{Place, Result},
    time::{Et, Interval, Intervals, PointingBias},
};

/// What the kernels of a session hold.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// When the position of MGS relative to Mars is known.
    pub spk: Intervals,
    /// When the attitude of the bus is known with its rates; time as the C-kernels count it.
    pub ck: Intervals,
    /// For each kernel that holds MGS: its index in the set, and its own intervals.
    pub per_kernel: Vec<(usize, Intervals)>,
    #[serde(skip)]
    seams: Vec<Et>,
}

impl Coverage {
    /// Ends of ephemeris segments, in order: the motion may jump there.
    pub(super) fn seams(&self) -> &[Et] {
        &self.seams
    }
}

/// Positions of one body relative to each centre that some segment uses.
type ByCentre = BTreeMap<i32, Vec<Interval>>;

impl Session {
    /// Coverage of all loaded kernels, at the level of intervals.
    ///
    /// # Errors
    /// [`SpiceFault::Spice`] when a C-kernel cannot be read; [`SpiceFault::MissingText`] without clock.
    pub fn coverage(&self) -> Result<&Coverage> {
        if let Some(coverage) = self.coverage.get() {
            return Ok(coverage);
        }
        let coverage = self.read_coverage()?;
        Ok(self.coverage.get_or_init(|| coverage))
    }

    fn read_coverage(&self) -> Result<Coverage> {
        let mut coverage = Coverage::default();
        let (mut of_mgs, mut of_mars) = (ByCentre::new(), ByCentre::new());
        let mut attitude = Vec::new();
        for (index, kernel) in self.kernels.kernels().iter().enumerate() {
            let mut held = Vec::new();
            match kernel.role {
                KernelRole::Spk => {
                    for segment in daf::segments(&kernel.path)? {
                        let [target, centre, ..] = segment.integers;
                        let interval = interval_of([segment.start, segment.stop]);
                        let by_centre = match target {
                            NAIF_MGS => &mut of_mgs,
                            NAIF_MARS => &mut of_mars,
                            _ => continue,
                        };
                        by_centre.entry(centre).or_default().push(interval);
                        coverage.seams.extend([interval.start, interval.stop]);
                        if target == NAIF_MGS {
                            held.push(interval);
                        }
                    }
                }
                KernelRole::Ck => {
                    let windows = self
                        .cspice
                        .ck_coverage(&kernel.path, NAIF_MGS_BUS)
                        .map_err(|fault| self.explain(fault, &CLOCKS))
                        .in_file(&kernel.path)?;
                    held.extend(windows.into_iter().map(interval_of));
                    attitude.extend_from_slice(&held);
                }
                _ => {}
            }
            if !held.is_empty() {
                let intervals = Intervals::union_of(held);
                coverage.per_kernel.push((index, intervals));
            }
        }
        coverage.spk = relative_to_mars(&of_mgs, &of_mars);
        coverage.ck = Intervals::union_of(attitude);
        coverage
            .seams
            .sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
        Ok(coverage)
    }

    /// For each kernel that holds MGS: its index in the set, and the wanted instants for which CSPICE reads
    /// it, because no later kernel of its role holds them.
    ///
    /// * `tolerance_s` – how far outside its intervals a C-kernel may be asked, seconds
    ///
    /// # Errors
    /// As [`Self::coverage`].
    pub fn coverage_in_use(
        &self,
        wanted: &Wanted,
        tolerance_s: f64,
    ) -> Result<Vec<(usize, Intervals)>> {
        let (mut positions, mut attitudes) = (wanted.positions.clone(), wanted.attitudes.clone());
        let mut in_use = Vec::new();
        for (index, held) in self.coverage()?.per_kernel.iter().rev() {
            let (open, reach_s) = match self.kernels.kernels()[*index].role {
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

    /// Makes sure that the position of MGS is known throughout `wanted`.
    ///
    /// # Errors
    /// [`SpiceFault::CoverageGap`] with the first gap and the kernels beside it.
    pub fn require_position(&self, wanted: Interval) -> Result<()> {
        let held = &self.coverage()?.spk;
        self.require(wanted, held, "position", KernelRole::Spk)
    }

    /// Makes sure that the attitude is known for every exposure in `exposures`.
    ///
    /// What is looked for are the instants as the C-kernels count them, with `padding_s` seconds more
    /// at both ends; an instant within `tolerance_s` of a C-kernel's interval is known, as it is to
    /// [`Session::attitude`].
    ///
    /// # Errors
    /// [`SpiceFault::CoverageGap`] with the first gap and the kernels beside it.
    pub fn require_attitude(
        &self,
        exposures: Interval,
        bias: PointingBias,
        padding_s: f64,
        tolerance_s: f64,
    ) -> Result<()> {
        let wanted = exposures.shifted(bias.seconds()).padded(padding_s);
        let intervals = self.coverage()?.ck.as_slice().iter();
        let held = Intervals::union_of(intervals.map(|interval| interval.padded(tolerance_s)));
        self.require(wanted, &held, "attitude", KernelRole::Ck)
    }

    fn require(
        &self,
        wanted: Interval,
        held: &Intervals,
        what: &'static str,
        role: KernelRole,
    ) -> Result<()> {
        if held.cover(wanted) {
            return Ok(());
        }
        // An instant without length has no gap of any length either.
        let gap = held.gaps_in(wanted).first().copied().unwrap_or(wanted);
        let gap_utc = format!("UTC {} .. {}", self.utc(gap.start), self.utc(gap.stop));
        let neighbours = self.neighbours(gap, role)?;
        Err(SpiceFault::CoverageGap {
            what,
            gap,
            gap_utc,
            wanted,
            neighbours,
        }
        .into())
    }

    /// Which kernels end before a gap and begin after it.
    fn neighbours(&self, gap: Interval, role: KernelRole) -> Result<String> {
        let kernels = self.kernels.kernels();
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
                "{} holds MGS then, but no kernel links its centre to Mars",
                name(index)
            ));
        }
        if let Some((stop, index)) = before {
            sentences.push(format!("{} ends at UTC {}", name(index), self.utc(stop)));
        }
        if let Some((start, index)) = after {
            sentences.push(format!("{} begins at UTC {}", name(index), self.utc(start)));
        }
        if sentences.is_empty() {
            sentences.push("no kernel with it is loaded".to_owned());
        }
        Ok(sentences.join(", "))
    }

    /// UTC for messages; without leap seconds it says so.
    fn utc(&self, et: Et) -> String {
        self.et_to_utc(et)
            .unwrap_or_else(|_| "unknown (no leap seconds)".to_owned())
    }
}

pub(super) fn interval_of([start, stop]: [f64; 2]) -> Interval {
    Interval::new(Et::from_seconds(start), Et::from_seconds(stop))
}

/// When MGS relative to Mars follows: directly, or through a centre that both are known from.
fn relative_to_mars(of_mgs: &ByCentre, of_mars: &ByCentre) -> Intervals {
    let mut known = Vec::new();
    for (centre, intervals) in of_mgs {
        let mgs = Intervals::union_of(intervals.iter().copied());
        let linked = if *centre == NAIF_MARS {
            mgs
        } else {
            let mars = of_mars.get(centre).into_iter().flatten().copied();
            mgs.intersection(&Intervals::union_of(mars))
        };
        known.extend_from_slice(linked.as_slice());
    }
    Intervals::union_of(known)
}
