//! UTC of every shot, for the products for GIS and catalogues.

use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::convert_datum::Converted;
use areograph_base::{
    column::Column,
    error::{Result, Stopped},
    time::Et,
    utc::Utc,
};
use areograph_spice::{KernelView, UtcClock};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

stage_inputs! {
    /// Footprints with their corrected times, and the leap seconds.
    pub struct TagUtc<'a> {
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Text kernels.
        pub kernels: &'a KernelView,
    }
}

/// UTC of the corrected times, in the order of the footprints.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ShotTimes(pub Column<Utc>);

impl Stage for TagUtc<'_> {
    const NAME: &'static str = "tag_utc";
    const METHOD: u32 = 4;
    type Output = ShotTimes;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<ShotTimes> {
        let session = self.kernels.session()?;
        let instants = self.converted.value()?.footprints.et_s.iter();
        if let Some(last_s) = instants.clone().reduce(f64::max) {
            session.require_published_utc(Et::from_seconds(last_s))?;
        }
        let mut clock = UtcClock::new(session);
        let utc = instants.map(|et_s| {
            Stopped::check(stop)?;
            clock.utc(Et::from_seconds(et_s))
        });
        Ok(ShotTimes(utc.collect::<Result<_>>()?))
    }
}
