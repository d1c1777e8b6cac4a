//! `[range_check]`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    declare::{Keys, declare_table, key},
    forms::{above_to, from_to, whole_from_to},
};

/// Maximum number of steps of the bias scan; it limits the duration of a run.
pub const SCAN_STEPS_MAX: u32 = 10_000;

declare_table! {
    /// Limits that decide whether a profile is valid.
    pub struct RangeCheckConfig: Deserialize, JsonSchema {
        /// Largest |mean| of range minus distance. The default is a choice of areograph: Shan et al. 2005 state no
        /// limit, and the profiles in their Table 3 reach 2 m at nadir and 25.4 m off nadir. Off nadir, `orbit_max_m`
        /// times the sine of the off-nadir angle is added to this limit.
        mean_max_m: f64 = key(above_to(0.0, 1e6)).or(10.0),
        /// Distance from the median, in robust standard deviations, beyond which a shot is an outlier. The default is a
        /// choice of areograph; Shan et al. 2005 mention single shots that deviate by about 5 standard deviations.
        outlier_sigma: f64 = key(above_to(0.0, 1000.0)).or(5.0),
        /// Largest share of outliers. The default is a choice of areograph.
        outlier_share_max: f64 = key(from_to(0.0, 1.0)).or(0.05),
        /// Smallest number of shots in a profile that is judged. Windows clip profiles; shorter profiles are excluded,
        /// with a remark. A site without a sufficiently long profile is invalid where ranges can be tested. The default
        /// is one PEDR frame; the profiles of Shan et al. 2005 have 71 to 174 shots.
        shots_min: u32 = key(whole_from_to(2, 1_000_000)).or(20),
        /// Largest |mean| of range minus distance to the spacecraft position in the PEDR file: a test of decoding,
        /// independent of kernels. Footprint and spacecraft position are from one orbit solution, so that range and
        /// distance agree to about a metre.
        decoding_max_m: f64 = key(above_to(0.0, 1e6)).or(2.0),
        /// Largest mean distance between the spacecraft positions in the file and from the kernels: a test of orbit,
        /// clock and datum. The default is twice the distance between the orbits of three producers (Shan et al. 2005);
        /// a clock error of 117 ms corresponds to 400 m, and IAU 1994 mistaken for IAU 1991 to 2 km.
        orbit_max_m: f64 = key(above_to(0.0, 1e6)).or(100.0),
        /// Half width of the clock bias scan, which tries biases on both sides of 0. The default is about four times
        /// the MOLA bias of 0.117 s.
        scan_half_width_s: f64 = key(above_to(0.0, 10.0)).or(0.5),
        /// Step of the clock bias scan: at most the half width, and at least 1/10000 of the full width.
        scan_step_s: f64 = key(above_to(0.0, 10.0)).or(0.01),
    }
    check step_fits
}

fn step_fits(checked: &RangeCheckConfig, keys: &mut Keys<'_, '_>) {
    let (step, half_width) = (checked.scan_step_s, checked.scan_half_width_s);
    let (shortest, longest) = (2.0 * half_width / f64::from(SCAN_STEPS_MAX), half_width);
    if !(shortest <= step && step <= longest) {
        // Whichever of the two was written is the one to change.
        let written = ["scan_step_s", "scan_half_width_s"]
            .into_iter()
            .find(|key| keys.span_of(key).is_some());
        let expected =
            format!("a step from {shortest} to {longest} s within a half width of {half_width} s");
        keys.refuse(written.unwrap_or("scan_step_s"), expected);
    }
}
