//! Images whose cameras a calibration determined: `[calibration]` of a site.

use super::driver::{Driver, Flow};
use crate::{
    config::SiteConfig,
    error::{Cause, Result},
    files::HashedFile,
    pds::SizedFile,
    stage::{Output, Stage as _},
    stages::tag_times::{ImageTimes, TagTimes},
    store::published::read_published,
};

/// A calibration that no image uses.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "calibration.from applies to no image of the site; expected an image with a label, of a calibrated line"
)]
#[cause(Configuration: "remove calibration.from; for images with support data, use `areograph calibrate apply`")]
struct UnusedCalibration;

/// The calibrated support data of all lines, in a folder whose products are those of its manifest; none without a
/// calibration.
pub(super) fn files<D: Driver>(flow: &mut D, config: &SiteConfig) -> Flow<Vec<HashedFile>> {
    let Some(from) = &config.calibration.from else {
        return Ok(Vec::new());
    };
    flow.attempt(TagTimes::NAME, |_| read_published(from).map(drop))?;
    let cameras = config.calibration.cameras();
    flow.hash_sized(TagTimes::NAME, SizedFile::SupportData, &cameras)
}

/// Requires an image with a calibrated camera, if the site names a calibration and all images are known.
pub(super) fn require_one<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    images: &[Output<ImageTimes>],
) -> Flow<()> {
    if config.calibration.from.is_some() && images.iter().all(|image| image.provenance().is_some())
    {
        flow.attempt(TagTimes::NAME, |_| is_used(images))?;
    }
    Ok(())
}

fn is_used(images: &[Output<ImageTimes>]) -> Result<()> {
    for image in images {
        let times = image.value()?;
        if times.support.is_none() && times.instrument.calibration.is_some() {
            return Ok(());
        }
    }
    Err(UnusedCalibration.into())
}
