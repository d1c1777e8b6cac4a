//! Scale and shape of the controls: tested by the stated scales of pictures, and by the shape of the figure.

use super::{
    error::NetError,
    lay::{Laid, shown_controls},
    place::Placed,
    read::NetData,
    result::PictureResult,
};
use crate::judge::{Check, CheckKind, CheckOutcome::Fail};
use areograph_config::NetConfig;
use areograph_geom::plane::{Place, Stretch, stretch};

/// Factor by which a picture may differ from its stated scale at all: beyond it, the units differ.
const SIZE_FACTOR: f64 = 2.0;
/// Relative difference that a stated scale may have: it follows from the distance of the spacecraft, known to a
/// hundredth at the worst, and the focal length, known to a thousandth.
const SCALE_MAX: f64 = 0.02;
/// This limit in standard deviations of the adjusted scale, where it is larger: with few and coarse controls.
const SCALE_SIGMAS: f64 = 3.0;
/// Stretch that two maps of one net may have.
const STRETCH_MAX: f64 = 0.01;
/// Probability that errors of the controls feign a stretch.
const CHANCE_MAX: f64 = 1e-3;
/// Number of pictures that a reason names.
const NAMED_MAX: usize = 3;

/// The scale of a picture against its table.
pub(super) struct SizeCheck {
    picture: usize,
    /// Adjusted over stated size of a unit on the ground.
    ratio: f64,
}

/// A unit on the ground is shorter than on the map by the map's scale at the middle of the picture's points.
pub(super) fn check_sizes(
    config: &NetConfig,
    data: &NetData,
    placed: &Placed,
) -> Result<Vec<SizeCheck>, NetError> {
    let map = &config.map.map;
    let mut sums = vec![(Place::new(0.0, 0.0), 0.0); data.net.pictures];
    for measured in &data.net.measurements {
        let (sum, count) = &mut sums[measured.picture];
        *sum += measured.at;
        *count += 1.0;
    }
    let mut checks = Vec::new();
    for (picture, (way, (sum, count))) in placed.pictures.iter().zip(sums).enumerate() {
        let Some(expected_m) = data.metres_per_unit[picture] else {
            continue;
        };
        let middle = way.map(sum / count);
        let found_m = way.scale() / map.scale((middle.re, middle.im));
        if !(found_m / expected_m < SIZE_FACTOR && expected_m / found_m < SIZE_FACTOR) {
            return Err(NetError::WrongUnits {
                picture: data.pictures[picture].clone(),
                found_m,
                expected_m,
            });
        }
        checks.push(SizeCheck {
            picture,
            ratio: found_m / expected_m,
        });
    }
    Ok(checks)
}

/// A picture whose scale is stated.
struct PictureScale {
    picture: String,
    /// Adjusted over stated.
    ratio: f64,
    /// Permitted relative difference.
    limit: f64,
}

impl PictureScale {
    fn is_beyond(&self) -> bool {
        // Written so that NaN counts.
        !((self.ratio - 1.0).abs() <= self.limit)
    }

    /// Share of the limit that is used.
    fn used(&self) -> f64 {
        (self.ratio - 1.0).abs() / self.limit
    }
}

/// Tests of scale and shape.
pub(super) struct Scales {
    pictures: Vec<PictureScale>,
    /// Pictures whose scale is not stated.
    unstated: usize,
    stretch: Option<Stretch>,
}

impl Scales {
    /// * `limit` – standard deviations beyond which a control has a gross error
    pub(super) fn of(
        sizes: &[SizeCheck],
        pictures: &[PictureResult],
        laid: &Laid,
        limit: f64,
    ) -> Self {
        let scales = sizes.iter().map(|size| {
            let picture = &pictures[size.picture];
            let sigma = picture.sigma_scale.unwrap_or(0.0);
            PictureScale {
                picture: picture.picture.clone(),
                ratio: size.ratio,
                limit: SCALE_MAX.max(SCALE_SIGMAS * sigma),
            }
        });
        let shown = shown_controls(&laid.net, &laid.block.places);
        let (figure, given): (Vec<Place>, Vec<Place>) = shown
            .iter()
            .map(|(_, figure, given)| (*figure, *given))
            .unzip();
        Self {
            pictures: scales.collect(),
            unstated: pictures.len() - sizes.len(),
            stretch: stretch(&figure, &given, &laid.scaled.kept, limit),
        }
    }

    fn beyond(&self) -> Vec<&PictureScale> {
        self.pictures
            .iter()
            .filter(|picture| picture.is_beyond())
            .collect()
    }

    pub(super) fn reasons(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        let beyond = self.beyond();
        if 2 * beyond.len() > self.pictures.len() {
            let mut ratios: Vec<f64> = beyond.iter().map(|of| of.ratio).collect();
            ratios.sort_by(f64::total_cmp);
            let limit = beyond.iter().map(|of| of.limit).fold(0.0, f64::max);
            reasons.push(format!(
                "the controls contradict metres_per_unit of {} of {} pictures: a unit is {:.4} times as large as \
                 stated (median); expected 1 within {:.1} %; check the unit of the controls (kilometres, miles), the \
                 table [map] and metres_per_unit",
                beyond.len(),
                self.pictures.len(),
                ratios[ratios.len() / 2],
                100.0 * limit
            ));
        } else {
            for of in beyond.iter().take(NAMED_MAX) {
                reasons.push(format!(
                    "a unit of picture {} is {:.4} times as large as its metres_per_unit states; expected 1 within {:.1} %; check \
                     metres_per_unit and the measurements of this picture",
                    of.picture,
                    of.ratio,
                    100.0 * of.limit
                ));
            }
            if beyond.len() > NAMED_MAX {
                let more = beyond.len() - NAMED_MAX;
                reasons.push(format!(
                    "{more} other pictures also contradict their metres_per_unit"
                ));
            }
        }
        reasons.extend(self.stretched());
        reasons
    }

    /// Limit of the stretch, where it is tested.
    pub(super) fn stretch_max(&self) -> Option<f64> {
        let by_chance = |of: &Stretch| STRETCH_MAX.max(of.by_chance(CHANCE_MAX));
        self.stretch.as_ref().map(by_chance)
    }

    fn stretched(&self) -> Option<String> {
        let (of, limit) = self.stretch.as_ref().zip(self.stretch_max())?;
        // Written so that NaN counts.
        (!(of.ratio <= limit)).then(|| {
            format!(
                "the controls are stretched by {:.1} % relative to the pictures, most in the direction {:.0}° north of \
                 east; expected at most {:.1} %; check that both coordinates of the controls have the same unit and \
                 refer to the map in the table [map]",
                100.0 * of.ratio,
                of.direction_rad.to_degrees(),
                100.0 * limit
            )
        })
    }

    /// Remarks on properties that are not tested.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.pictures.is_empty() {
            remarks.push(
                "no picture has metres_per_unit: the scale of the controls is not tested"
                    .to_owned(),
            );
        } else if self.unstated > 0 {
            remarks.push(format!(
                "pictures without metres_per_unit, whose scale is not tested: {}",
                self.unstated
            ));
        }
        if self.stretch.is_none() {
            remarks.push(
                "too few controls, or controls nearly on a line: the stretch of the controls is not tested"
                    .to_owned(),
            );
        }
        remarks
    }

    pub(super) fn checks(&self) -> Vec<Check> {
        let worst = self.pictures.iter();
        let worst = worst.max_by(|one, other| one.used().total_cmp(&other.used()));
        let scale = worst.map(|worst| {
            let off = (worst.ratio - 1.0).abs();
            Check::of_share(
                CheckKind::PictureScale,
                &*worst.picture,
                off,
                worst.limit,
                Fail,
            )
        });
        let stretch = self.stretch.as_ref().zip(self.stretch_max());
        let stretch = stretch.map(|(stretch, limit)| {
            Check::of_share(CheckKind::ControlStretch, "", stretch.ratio, limit, Fail)
        });
        scale.into_iter().chain(stretch).collect()
    }
}
