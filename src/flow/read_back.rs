//! Adjusted kernels as SPICE reads them, before they receive their final names.

use std::path::Path;

use super::outputs::Site;
use crate::{
    config::SiteConfig,
    error::{Locate, Result},
    products::{attitude_kernel, position_kernel},
    spice::{KernelSet, Session},
    stage::Round,
    stages::{site_image::SiteImage, tabulate_kernels::require_same},
};

/// Samples every adjusted image through the original kernels and its own pair in `staging`.
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
        let position = position_kernel(&times.id);
        let own = [&position, &attitude_kernel(&times.id)].map(|name| staging.join(name));
        let session = Session::open(&kernels.followed_by(&own)?)?;
        let same = require_same(
            &session,
            times,
            orientation,
            &config.kernels,
            &config.pointing,
        );
        same.in_file(position)?;
    }
    Ok(())
}
