//! Verdict on a terrain model: by the share of the ground that it covers, and by the altimeter.

use crate::{
    config::{LimitsConfig, SiteConfig},
    error::Result,
    minus::signed,
    stage::Round,
    stages::{
        judge::Findings,
        map_surface::{SHOTS_MIN, Surface, SurfaceAccount},
    },
    store::book::Book,
    verdict::{
        Check, CheckKind,
        CheckOutcome::{Fail, Warning},
    },
};

/// A mean height within this many of its standard deviations is no contradiction.
const HEIGHT_SIGMAS: f64 = 3.0;

/// Largest accepted distance of the median of the shots from a model, metres: where only profiles off nadir or of unknown
/// attitude test it, also as much as their attitude explains.
fn height_max_m(limits: &LimitsConfig, surface: &SurfaceAccount) -> f64 {
    let at_nadir_m = match surface.common_sigma_m {
        Some(common_m) => limits.height_after_max_m.max(HEIGHT_SIGMAS * common_m),
        // No adjustment has brought the images closer to the shots.
        None => limits.height_before_max_m,
    };
    at_nadir_m.hypot(HEIGHT_SIGMAS * surface.shots.attitude_sigma_m)
}

const fn has_shots(surface: &SurfaceAccount) -> bool {
    surface.shots.above_m.n >= SHOTS_MIN
}

/// The findings on the terrain model of a site, if it has one.
pub(super) fn findings(config: &SiteConfig, book: &Book) -> Result<Findings> {
    let surface = book.find::<Surface>(Round::Initial)?;
    Ok(surface.map_or_else(Findings::default, |surface| {
        let (limits, surface) = (&config.limits, &surface.account);
        let altimeter = config.terms().altimeter;
        Findings {
            reasons: invalid_because(limits, surface, altimeter),
            remarks: remark(surface, altimeter).into_iter().collect(),
            checks: checks(limits, surface, altimeter),
        }
    }))
}

fn checks(limits: &LimitsConfig, surface: &SurfaceAccount, altimeter: &str) -> Vec<Check> {
    let share = if surface.is_refused {
        0.0
    } else {
        surface.filled_share()
    };
    let least = limits.surface_filled_min;
    let mut filled = Check::of_share(CheckKind::SurfaceFilled, "", share, least, Fail);
    if surface.is_refused {
        filled.outcome = Fail;
        return vec![filled];
    }
    let of_shots = if has_shots(surface) {
        let takes_part = format!("{altimeter} takes part");
        let subject = if surface.shots_take_part {
            &*takes_part
        } else {
            ""
        };
        let shots = &surface.shots;
        let height_max_m = height_max_m(limits, surface);
        let spread_max = limits.surface_spread_max_sigma;
        [
            (
                CheckKind::SurfaceHeight,
                subject,
                shots.above_m.median,
                height_max_m,
            ),
            (
                CheckKind::SurfaceSpread,
                "",
                shots.spread_sigmas,
                spread_max,
            ),
        ]
        .map(|(kind, subject, value, limit)| Check::new(kind, subject, value, limit, Fail))
        .into()
    } else {
        vec![Check::without_number(
            CheckKind::SurfaceHeight,
            "too few shots on the model",
            Warning,
        )]
    };
    std::iter::once(filled).chain(of_shots).collect()
}

/// Reasons why a terrain model makes its site invalid, one sentence each.
fn invalid_because(
    limits: &LimitsConfig,
    surface: &SurfaceAccount,
    altimeter: &str,
) -> Vec<String> {
    let (filled, searched) = (surface.filled, surface.searched());
    if surface.is_refused {
        return vec![format!(
            "terrain model: {filled} of {searched} searched cells matched, too few to be significant, so that the \
             model is withheld; check that the pixels belong to these images, and check the image orientation"
        )];
    }
    let mut reasons = Vec::new();
    // Written so that NaN counts, here and below.
    if !(surface.filled_share() >= limits.surface_filled_min) {
        reasons.push(format!(
            "terrain model: {filled} of {} cells that both images show have a height; expected at least {:.0} %",
            surface.cells,
            100.0 * limits.surface_filled_min
        ));
    }
    if !has_shots(surface) {
        return reasons;
    }
    let shots = &surface.shots;
    let height_max_m = height_max_m(limits, surface);
    if !(shots.above_m.median.abs() <= height_max_m) {
        reasons.push(format!(
            "terrain model: {altimeter} minus model is {} m (median of {} shots); expected within ±{height_max_m:.1} m",
            signed(shots.above_m.median, 1),
            shots.above_m.n
        ));
    }
    let spread_max = limits.surface_spread_max_sigma;
    if !(shots.spread_sigmas <= spread_max) {
        reasons.push(format!(
            "terrain model: shots of {altimeter} scatter about the model by {:.1} standard deviations (NMAD); expected at \
             most {spread_max:.1}",
            shots.spread_sigmas
        ));
    }
    reasons
}

/// Remark on a terrain model.
fn remark(surface: &SurfaceAccount, altimeter: &str) -> Option<String> {
    let shots = &surface.shots;
    if surface.is_refused {
        return None;
    }
    if !has_shots(surface) {
        let n = shots.above_m.n;
        return Some(format!(
            "terrain model: {n} shots of {altimeter} lie on the model, too few to validate its heights"
        ));
    }
    (shots.attitude_sigma_m > 0.0).then(|| {
        format!(
            "terrain model: fewer than {SHOTS_MIN} shots at nadir lie on the model; the other profiles test its heights only \
             to ±{:.0} m, because attitude errors shift these profiles",
            shots.attitude_sigma_m
        )
    })
}
