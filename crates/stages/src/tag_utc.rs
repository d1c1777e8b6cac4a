//! UTC of every shot, for the products for GIS and catalogues.

use std::sync::atomic::AtomicBool;

use super::convert_datum::Converted;
use areograph_base::{
    error::{Result, Stopped},
    time::Et,
};
use areograph_spice::KernelView;
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

/// Digits of a second in the UTC of shots: programs read the time from it, and MGS flies 3 m in a millisecond.
const SHOT_UTC_DECIMALS: u8 = 6;

stage_inputs! {
    /// Footprints with their corrected times, and the leap seconds.
    pub struct TagUtc<'a> {
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Text kernels.
        pub kernels: &'a KernelView,
    }
}

/// One string per footprint: ISO 8601 without a zone letter.
impl Stage for TagUtc<'_> {
    const NAME: &'static str = "tag_utc";
    const METHOD: u32 = 2;
    type Output = Vec<String>;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<Vec<String>> {
        let session = self.kernels.session()?;
        let instants = self.converted.value()?.footprints.et_s.iter();
        if let Some(last_s) = instants.clone().copied().reduce(f64::max) {
            session.require_published_utc(Et::from_seconds(last_s))?;
        }
        let utc = instants.map(|et_s| {
            Stopped::check(stop)?;
            session.et_to_utc_with(Et::from_seconds(*et_s), SHOT_UTC_DECIMALS)
        });
        utc.collect()
    }
}
