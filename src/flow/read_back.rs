//! Adjusted kernels as SPICE reads them, before they receive their final names.

use std::path::Path;

use super::outputs::Site;
use crate::{
    config::SiteConfig,
    error::{Locate, Result},
    products::KernelReaders,
    spice::{KernelSet, Session},
    stage::Round,
    stages::{site_image::SiteImage, tabulate_kernels::require_same},
};

/// Samples every adjusted image through the original kernels and each of its own pairs in `staging`.
///
/// # Errors
/// [`Kind::Bug`](crate::error::Kind::Bug) for orientations that differ when read back.
pub(super) fn read_back(
    config: &SiteConfig,
    site: &Site,
    kernels: &KernelSet,
    staging: &Path,
) -> Result<()> {
    for image in SiteImage::all(&site.book, Round::Adjusted)? {
        let (times, orientation) = (image.times.value()?, image.orientation.value()?);
        if times.support.is_some() {
            continue;
        }
        let reasons = [
            &orientation.invalid_because,
            &image.model.value()?.invalid_because,
        ];
        let is_valid = reasons.iter().all(|reasons| reasons.is_empty());
        for readers in KernelReaders::ALL {
            if !readers.have(is_valid) {
                continue;
            }
            let own = readers.paths(&times.id);
            let session = kernels.followed_by(&own.clone().map(|name| staging.join(name)))?;
            let same = require_same(
                &Session::open(&session)?,
                times,
                orientation,
                readers.reading(
                    orientation.light_time.convention,
                    &times.instrument,
                    &config.pointing,
                ),
                &config.kernels,
            );
            let [position, _] = own;
            same.in_file(position)?;
        }
    }
    Ok(())
}
