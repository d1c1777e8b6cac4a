//! The kernel that a non-finite number comes from, searched for only when one was read.

use std::path::PathBuf;

use super::{coverage::interval_of, daf, ffi::Cspice, kernels::KernelSet, role::KernelRole};
use areograph_base::time::{Et, Interval};

/// A part of a kernel.
pub(super) struct Origin {
    /// The file.
    pub(super) path: PathBuf,
    /// The segment of an SPK, the interval of a CK.
    pub(super) part: Interval,
}

/// The segment whose state at `et` is not finite: the first in CSPICE's order, later kernels before earlier ones.
pub(super) fn of_state(set: &KernelSet, cspice: &Cspice, et: Et) -> Option<Origin> {
    let spks = set.kernels().iter().rev();
    for kernel in spks.filter(|kernel| kernel.role == KernelRole::Spk) {
        for segment in daf::segments(&kernel.path).ok()?.iter().rev() {
            let part = interval_of([segment.start, segment.stop]);
            let [target, centre, ..] = segment.integers;
            if !part.contains(et) {
                continue;
            }
            let state = cspice.geometric_state(target, et.seconds(), centre).ok();
            if state.is_some_and(|state| !all_finite(&state)) {
                let path = kernel.path.clone();
                return Some(Origin { path, part });
            }
        }
    }
    None
}

/// The ephemeris that CSPICE reads for the spacecraft `naif` at `et`.
pub(super) fn of_spacecraft(set: &KernelSet, naif: i32, et: Et) -> Option<PathBuf> {
    let holds = |segment: &daf::Segment| {
        let part = interval_of([segment.start, segment.stop]);
        segment.integers[0] == naif && part.contains(et)
    };
    let mut spks = set.kernels().iter().rev();
    let found = spks.find(|kernel| {
        let segments = (kernel.role == KernelRole::Spk).then(|| daf::segments(&kernel.path));
        segments.is_some_and(|segments| segments.is_ok_and(|segments| segments.iter().any(holds)))
    });
    found.map(|kernel| kernel.path.clone())
}

/// The interval of attitude of `bus` that CSPICE reads at `kernel_time`, or within `reach_s` seconds of it.
pub(super) fn of_attitude(
    set: &KernelSet,
    cspice: &Cspice,
    bus: i32,
    kernel_time: Et,
    reach_s: f64,
) -> Option<Origin> {
    let cks = set.kernels().iter().rev();
    for kernel in cks.filter(|kernel| kernel.role == KernelRole::Ck) {
        let intervals = cspice.ck_coverage(&kernel.path, bus).ok()?;
        let mut parts = intervals.into_iter().map(interval_of);
        if let Some(part) = parts.find(|part| part.padded(reach_s).contains(kernel_time)) {
            let path = kernel.path.clone();
            return Some(Origin { path, part });
        }
    }
    None
}

/// Whether every one of `values` is a number.
pub(super) fn all_finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}
