//! Line times of an image by its keys: of one period, or piece by piece.

use super::{
    StartFrom,
    agreement::{piece_follows, pieces_agree},
    error::ImageError,
};
use crate::{
    config::{ExposurePiece, ImageConfig, line_times_of},
    error::{Error, Result},
    image::{IMAGE_DURATION_END_S, IMAGE_LINES_MIN, ImageFields, line_period_agrees},
    line_times::LineTimes,
    time::Et,
    units::SECONDS_PER_MS,
};

/// What is known of the lines of an image.
pub(super) struct Pieces<'a> {
    pub(super) image: &'a ImageConfig,
    pub(super) fields: &'a ImageFields,
    pub(super) lines: u32,
    pub(super) downtrack_summing: u32,
}

impl Pieces<'_> {
    /// Lines of one period, and the exposure of a detector line in seconds.
    pub(super) fn even(&self, start: Et) -> Result<(LineTimes, f64)> {
        let (line_period_s, exposure_s) =
            line_period(self.image, self.fields, self.downtrack_summing)?.ok_or_else(|| {
                ImageError::Missing {
                    image: self.image.id.clone(),
                    key: "exposure_ms",
                }
            })?;
        self.require_duration(f64::from(self.lines) * line_period_s, line_period_s)?;
        let times = LineTimes::even(start, self.lines, line_period_s)?;
        Ok((times, exposure_s))
    }

    /// Lines in the pieces that the configuration lists, and the exposure of a detector line of the first one in seconds.
    ///
    /// A start that is told beside them must agree with theirs.
    pub(super) fn listed(
        &self,
        exposures: &[ExposurePiece],
        told: Option<(Et, StartFrom)>,
        remarks: &mut Vec<String>,
    ) -> Result<(LineTimes, f64)> {
        let times = line_times_of(exposures, self.lines)?;
        self.require_duration(times.duration_s(), times.mean_period_s())?;
        if let Some((start, from)) = told {
            remarks.extend(pieces_agree(&self.image.id, times.start(), start, from)?);
        }
        let pieces: Vec<_> = times.pieces().collect();
        for [piece, next] in pieces.array_windows() {
            remarks.extend(piece_follows(piece, next));
        }
        let period_s = pieces.first().map_or(0.0, |piece| piece.period_s);
        Ok((times, period_s / f64::from(self.downtrack_summing)))
    }

    fn require_duration(&self, duration_s: f64, line_period_s: f64) -> Result<()> {
        let lines = self.lines;
        // Written so that NaN is refused.
        if lines >= IMAGE_LINES_MIN && line_period_s > 0.0 && duration_s < IMAGE_DURATION_END_S {
            return Ok(());
        }
        Err(Error::from(ImageError::Duration {
            image: self.image.id.clone(),
            lines,
            line_period_s,
        }))
    }
}

/// Line period and exposure in seconds; `None` when neither is given.
///
/// Source: exposure × downtrack summing, ISIS and ALE (`mgs_drivers.py`); the "exposure time" of
/// Shan et al. 2005, Table 2 is the period already summed.
fn line_period(
    image: &ImageConfig,
    fields: &ImageFields,
    summing: u32,
) -> std::result::Result<Option<(f64, f64)>, ImageError> {
    let summed = |exposure_s: f64| exposure_s * f64::from(summing);
    match (fields.line_period_s, fields.exposure_s) {
        (Some(period_s), Some(exposure_s)) => {
            let computed_s = summed(exposure_s);
            if !line_period_agrees(period_s, exposure_s, summing) {
                return Err(ImageError::Period {
                    image: image.id.clone(),
                    stated_ms: period_s / SECONDS_PER_MS,
                    exposure_ms: exposure_s / SECONDS_PER_MS,
                    summing,
                    computed_ms: computed_s / SECONDS_PER_MS,
                });
            }
            Ok(Some((period_s, exposure_s)))
        }
        (Some(period_s), None) => Ok(Some((period_s, period_s / f64::from(summing.max(1))))),
        (None, Some(exposure_s)) => Ok(Some((summed(exposure_s), exposure_s))),
        (None, None) => Ok(None),
    }
}
