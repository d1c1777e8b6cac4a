//! Coverage of position and attitude by kernels, gaps inside a file included, and required coverage.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    daf,
    ffi::Cspice,
    kernels::KernelSet,
    needs::{clocks, explain},
    role::KernelRole,
};
use areograph_base::{
    constants::{NAIF_MARS, Spacecraft},
    error::{Locate, Result},
    time::{Et, Interval, Intervals},
};

/// Positions of one body relative to each centre that some segment uses.
type ByCentre = BTreeMap<i32, Vec<Interval>>;

/// Coverage of one spacecraft in the kernels of a session.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Intervals of known position of the spacecraft relative to Mars.
    pub spk: Intervals,
    /// Intervals of known attitude of the bus with its rates, in the time of the C-kernels.
    pub ck: Intervals,
    /// For each kernel that holds the spacecraft: its index in the set, and its own intervals.
    pub per_kernel: Vec<(usize, Intervals)>,
    /// Indices of C-kernels with attitudes of the bus without rates, which are not read.
    #[serde(skip)]
    pub without_rates: Vec<usize>,
    #[serde(skip)]
    seams: Vec<Et>,
}

impl Coverage {
    /// The coverage of `spacecraft` by `set`, which `cspice` has loaded.
    ///
    /// # Errors
    /// [`super::SpiceError::Spice`] when a C-kernel cannot be read; [`super::SpiceError::MissingText`] without a clock.
    pub(super) fn of(
        set: &KernelSet,
        cspice: &Cspice,
        spacecraft: &'static Spacecraft,
    ) -> Result<Self> {
        let mut coverage = Self::default();
        let (mut of_spacecraft, mut of_mars) = (ByCentre::new(), ByCentre::new());
        let mut attitude = Vec::new();
        for (index, kernel) in set.kernels().iter().enumerate() {
            let mut held = Vec::new();
            match kernel.role {
                KernelRole::Spk => {
                    for segment in daf::segments(&kernel.path)? {
                        let [target, centre, ..] = segment.integers;
                        let interval = interval_of([segment.start, segment.stop]);
                        let by_centre = match target {
                            target if target == spacecraft.naif => &mut of_spacecraft,
                            NAIF_MARS => &mut of_mars,
                            _ => continue,
                        };
                        by_centre.entry(centre).or_default().push(interval);
                        coverage.seams.extend([interval.start, interval.stop]);
                        if target == spacecraft.naif {
                            held.push(interval);
                        }
                    }
                }
                KernelRole::Ck => {
                    let windows = cspice
                        .ck_coverage(&kernel.path, spacecraft.bus)
                        .map_err(|error| explain(set, error, &clocks(spacecraft)))
                        .in_file(&kernel.path)?;
                    held.extend(windows.into_iter().map(interval_of));
                    attitude.extend_from_slice(&held);
                    let mut segments = daf::segments(&kernel.path)?.into_iter();
                    if segments.any(|segment| is_without_rates(&segment, spacecraft.bus)) {
                        coverage.without_rates.push(index);
                    }
                }
                _ => {}
            }
            if !held.is_empty() {
                let intervals = Intervals::union_of(held);
                coverage.per_kernel.push((index, intervals));
            }
        }
        coverage.spk = relative_to_mars(&of_spacecraft, &of_mars);
        coverage.ck = Intervals::union_of(attitude);
        coverage
            .seams
            .sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
        Ok(coverage)
    }

    /// Ends of ephemeris segments, in order: the motion may be discontinuous there.
    pub(super) fn seams(&self) -> &[Et] {
        &self.seams
    }
}

/// Required coverage of the spacecraft of the laser, and of others.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RequiredCoverage {
    /// Instants that ephemerides must cover.
    pub positions: Intervals,
    /// Instants that attitudes must cover, in the time of the C-kernels: exposures with the pointing bias.
    pub attitudes: Intervals,
    /// Required coverage of other spacecraft, by their identifiers.
    pub others: BTreeMap<String, RequiredCoverage>,
}

impl RequiredCoverage {
    /// Required coverage of positions and attitudes for any spacecraft.
    #[must_use]
    pub fn of_all(&self) -> [Intervals; 2] {
        let all = || std::iter::once(self).chain(self.others.values());
        let union = |of: fn(&Self) -> &Intervals| {
            Intervals::union_of(all().flat_map(|one| of(one).as_slice()).copied())
        };
        [union(|one| &one.positions), union(|one| &one.attitudes)]
    }
}

fn is_without_rates(segment: &daf::Segment, bus: i32) -> bool {
    let [object, _, _, rates, ..] = segment.integers;
    object == bus && rates == 0
}

pub(super) fn interval_of([start, stop]: [f64; 2]) -> Interval {
    Interval::new(Et::from_seconds(start), Et::from_seconds(stop))
}

/// Coverage of the spacecraft relative to Mars: directly, or through a centre relative to which both are known.
fn relative_to_mars(of_spacecraft: &ByCentre, of_mars: &ByCentre) -> Intervals {
    let mut known = Vec::new();
    for (centre, intervals) in of_spacecraft {
        let held = Intervals::union_of(intervals.iter().copied());
        let linked = if *centre == NAIF_MARS {
            held
        } else {
            let mars = of_mars.get(centre).into_iter().flatten().copied();
            held.intersection(&Intervals::union_of(mars))
        };
        known.extend_from_slice(linked.as_slice());
    }
    Intervals::union_of(known)
}
