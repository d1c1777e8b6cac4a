//! Line times of an image by its keys: of one period, or piece by piece.

use super::{
    StartFrom,
    agreement::{CLOSE_S, Disagreement, piece_follows, pieces_agree},
    error::ImageError,
};
use areograph_base::{
    error::{Error, Result},
    image::{IMAGE_DURATION_END_S, IMAGE_LINES_MIN, ImageFields, line_period_agrees},
    line_times::LineTimes,
    time::Et,
    units::SECONDS_PER_MS,
};
use areograph_config::{ExposurePiece, ImageConfig, line_times_of};
use areograph_pds::RowTimes;

/// Times of rows and UTC of the start that differ by more than this get a remark, seconds: labels round the latter to a
/// millisecond, and in three it is 0.5 ms from the first row.
const ROWS_CLOSE_S: f64 = 0.002;

/// The keys that determine the line times of an image.
pub(super) struct Pieces<'a> {
    pub(super) image: &'a ImageConfig,
    pub(super) fields: &'a ImageFields,
    pub(super) lines: u32,
    pub(super) downtrack_summing: u32,
}

impl Pieces<'_> {
    /// Line times by the first source that is given: the pieces of the configuration, the `rows` of a file, a start
    /// with a line period. Also the exposure of a detector line in seconds, and the source of the start.
    ///
    /// Where rows hold the times and the label no clock (`in_rows`), a label without rows is not sufficient.
    pub(super) fn line_times(
        &self,
        rows: Option<&RowTimes>,
        in_rows: bool,
        stated: Option<(Et, StartFrom)>,
        remarks: &mut Vec<Disagreement>,
    ) -> Result<(LineTimes, f64, StartFrom)> {
        let (times, exposure_s, from) = if let Some(exposures) = &self.image.exposures {
            let (times, exposure_s) = self.listed(exposures, stated, remarks)?;
            (times, exposure_s, StartFrom::Exposures)
        } else if let Some(rows) = rows {
            let (times, exposure_s) = self.of_rows(rows, stated, remarks)?;
            (times, exposure_s, StartFrom::Lines)
        } else if in_rows && !is_even(self.fields) {
            return Err(ImageError::NoLineTimes(self.image.id.clone()).into());
        } else {
            let (start, from) = stated.ok_or_else(|| ImageError::Missing {
                image: self.image.id.clone(),
                key: if in_rows { "utc_start" } else { "sclk_start" },
            })?;
            let (times, exposure_s) = self.even(start)?;
            (times, exposure_s, from)
        };
        Ok((times, exposure_s, from))
    }

    /// Lines of one period, and the exposure of a detector line in seconds.
    fn even(&self, start: Et) -> Result<(LineTimes, f64)> {
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
    /// A start that is stated beside them must agree with theirs.
    fn listed(
        &self,
        exposures: &[ExposurePiece],
        stated: Option<(Et, StartFrom)>,
        remarks: &mut Vec<Disagreement>,
    ) -> Result<(LineTimes, f64)> {
        let times = line_times_of(exposures, self.lines)?;
        self.require_duration(times.duration_s(), times.mean_period_s())?;
        if let Some(stated) = stated {
            remarks.extend(pieces_agree(
                &self.image.id,
                times.start(),
                stated,
                CLOSE_S,
            )?);
        }
        let pieces: Vec<_> = times.pieces().collect();
        for [piece, next] in pieces.array_windows() {
            remarks.extend(piece_follows(piece, next).map(Disagreement::from));
        }
        let exposure_s = self.first_exposure_s(&times);
        Ok((times, exposure_s))
    }

    /// Lines by the rows of the label's file, and the exposure of a detector line of the first one in seconds.
    ///
    /// A start that is stated beside them must agree with theirs.
    fn of_rows(
        &self,
        rows: &RowTimes,
        stated: Option<(Et, StartFrom)>,
        remarks: &mut Vec<Disagreement>,
    ) -> Result<(LineTimes, f64)> {
        if rows.lines != self.lines {
            return Err(Error::from(ImageError::LinesOfFile {
                image: self.image.id.clone(),
                stated: self.lines,
                found: rows.lines,
            }));
        }
        let times = LineTimes::of_pieces(rows.lines, &rows.pieces)?;
        self.require_duration(times.duration_s(), times.mean_period_s())?;
        remarks.extend(rows.remarks.iter().cloned().map(Disagreement::from));
        if let Some(stated) = stated {
            remarks.extend(pieces_agree(
                &self.image.id,
                times.start(),
                stated,
                ROWS_CLOSE_S,
            )?);
        }
        let exposure_s = self.first_exposure_s(&times);
        Ok((times, exposure_s))
    }

    fn first_exposure_s(&self, times: &LineTimes) -> f64 {
        let first = times.pieces().next();
        first.map_or(0.0, |piece| piece.period_s) / f64::from(self.downtrack_summing)
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

/// Whether one line period holds for all lines.
const fn is_even(fields: &ImageFields) -> bool {
    fields.line_period_s.is_some() || fields.exposure_s.is_some()
}

/// Line times in the label's file, unless the configuration states others, which take precedence.
pub(super) fn rows_of<'a>(
    image: &ImageConfig,
    rows: Option<&'a RowTimes>,
    notes: &mut Vec<String>,
) -> Option<&'a RowTimes> {
    let key = match &image.exposures {
        Some(_) => Some("exposures"),
        None if is_even(&image.fields) => Some("exposure_ms or line_period_ms"),
        None => None,
    };
    if let (Some(key), Some(_)) = (key, rows) {
        notes.push(format!(
            "{key} of the configuration replaces the line times of the file"
        ));
    }
    rows.filter(|_| key.is_none())
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
