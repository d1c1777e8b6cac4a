//! `[ties]`, `[intersection]`, `[adjustment]`.

use toml::Spanned;

use crate::{
    footprints::FootprintImageCoordinates,
    geom::{intersection::Weighting, robust::RobustWeight},
    units::{RADIANS_PER_ARCSECOND, RADIANS_PER_DEGREE, SECONDS_PER_MS},
};

use super::{
    super::{
        adjustment::{AdjustmentConfig, IntersectionConfig, OrientationPrior, TiesConfig},
        problems::Review,
        raw::{Entry, RawAdjustment, RawIntersection, RawOrientationPrior, RawTies},
        site::ImageConfig,
    },
    globs::found_files,
    no_repeats,
    values::Accept,
};

/// Standard deviations of observations: none is better than a micrometre or a millionth of a pixel, and smaller
/// ones would drown all others in rounding.
const SIGMA: Accept = Accept::FromTo(1e-6, 1e6);
/// Standard deviations of unknowns that 0 takes out.
const SIGMA_OR_NONE: Accept = Accept::ZeroOr(1e-6, 1e6);
/// Standard deviations of orientation unknowns: 0 holds fixed, infinity leaves free.
const SIGMA_OR_FREE: Accept = Accept::ZeroOr(1e-6, f64::INFINITY);

pub(super) fn ties(
    raw: Option<Spanned<RawTies>>,
    images: &[ImageConfig],
    review: &mut Review<'_>,
) -> TiesConfig {
    let Some(table) = raw else {
        return TiesConfig::default();
    };
    let span = table.span();
    let Some(globs) = table.into_inner().files else {
        review.missing(
            Some(span),
            "ties.files",
            "paths or globs of tie point files (or no table ties at all)",
        );
        return TiesConfig::default();
    };
    if images.len() < 2 {
        review.refuse(
            span,
            "ties",
            "at least two images that tie points can join".to_owned(),
        );
    }
    TiesConfig {
        files: found_files("ties.files", &globs, review),
    }
}

pub(super) fn intersection(raw: &RawIntersection, review: &mut Review<'_>) -> IntersectionConfig {
    let default = IntersectionConfig::default();
    let weightings = [("focal", false), ("line", true)];
    let by_line = review
        .word(
            "intersection.weighting",
            raw.weighting.as_ref(),
            &weightings,
        )
        .unwrap_or(false);
    let sigma_px = review.number("intersection.sigma_px", &raw.sigma_px, SIGMA, 1.0);
    let along_lines = review.number("intersection.sigma_lines", &raw.sigma_lines, SIGMA, 1.0);
    if let (false, Some(written)) = (by_line, &raw.sigma_lines) {
        review.warn(
            written.span(),
            "intersection.sigma_lines is never used: intersection.weighting is not \"line\""
                .to_owned(),
        );
    }
    IntersectionConfig {
        weighting: if by_line {
            Weighting::Line {
                along_lines,
                across_px: sigma_px,
            }
        } else {
            Weighting::Focal { sigma_px }
        },
        convergence_min_rad: RADIANS_PER_DEGREE
            * review.number(
                "intersection.convergence_min_deg",
                &raw.convergence_min_deg,
                Accept::AboveTo(0.0, 90.0),
                default.convergence_min_rad / RADIANS_PER_DEGREE,
            ),
    }
}

pub(super) fn adjustment(
    raw: &RawAdjustment,
    images: &[ImageConfig],
    review: &mut Review<'_>,
) -> AdjustmentConfig {
    let default = AdjustmentConfig::default();
    let number = |review: &mut Review<'_>, key: &str, raw: &Entry<f64>, accept, default| {
        review.number(&format!("adjustment.{key}"), raw, accept, default)
    };
    AdjustmentConfig {
        tie_sigma_px: sigmas(
            "adjustment.tie_sigma_px",
            raw.tie_sigma_px.as_ref(),
            SIGMA,
            review,
        )
        .unwrap_or(default.tie_sigma_px),
        mola_image: review
            .word(
                "adjustment.mola_image",
                raw.mola_image.as_ref(),
                &FootprintImageCoordinates::WORDS,
            )
            .unwrap_or(default.mola_image),
        mola_sigma_px: sigmas(
            "adjustment.mola_sigma_px",
            raw.mola_sigma_px.as_ref(),
            SIGMA,
            review,
        )
        .unwrap_or(default.mola_sigma_px),
        mola_margin_px: number(
            review,
            "mola_margin_px",
            &raw.mola_margin_px,
            Accept::FromTo(0.0, 1e4),
            default.mola_margin_px,
        ),
        ground_sigma_m: number(
            review,
            "ground_sigma_m",
            &raw.ground_sigma_m,
            SIGMA,
            default.ground_sigma_m,
        ),
        range_sigma_m: number(
            review,
            "range_sigma_m",
            &raw.range_sigma_m,
            SIGMA,
            default.range_sigma_m,
        ),
        range_bias_sigma_m: number(
            review,
            "range_bias_sigma_m",
            &raw.range_bias_sigma_m,
            SIGMA_OR_NONE,
            default.range_bias_sigma_m,
        ),
        time_bias_sigma_s: SECONDS_PER_MS
            * number(
                review,
                "time_bias_sigma_ms",
                &raw.time_bias_sigma_ms,
                SIGMA_OR_NONE,
                default.time_bias_sigma_s / SECONDS_PER_MS,
            ),
        nadir_sigma_m: number(
            review,
            "nadir_sigma_m",
            &raw.nadir_sigma_m,
            SIGMA_OR_FREE,
            default.nadir_sigma_m,
        ),
        off_nadir_sigma_m: number(
            review,
            "off_nadir_sigma_m",
            &raw.off_nadir_sigma_m,
            SIGMA_OR_FREE,
            default.off_nadir_sigma_m,
        ),
        robust: robust(raw, review),
        blunder_limit: blunder_limit(raw, default.blunder_limit, review),
        images: priors(raw, images, review),
    }
}

fn robust(raw: &RawAdjustment, review: &mut Review<'_>) -> Option<RobustWeight> {
    let words = [
        ("none", None),
        (
            "huber",
            Some(RobustWeight::Huber {
                limit: RobustWeight::HUBER_LIMIT,
            }),
        ),
        (
            "cauchy",
            Some(RobustWeight::Cauchy {
                limit: RobustWeight::CAUCHY_LIMIT,
            }),
        ),
    ];
    let function = review
        .word("adjustment.robust", raw.robust.as_ref(), &words)
        .flatten();
    let limit = review.optional_number(
        "adjustment.robust_limit",
        raw.robust_limit.as_ref(),
        Accept::AboveTo(0.0, 1000.0),
    );
    if let (None, Some(written)) = (function, &raw.robust_limit) {
        review.warn(
            written.span(),
            "adjustment.robust_limit is never used: adjustment.robust is \"none\"".to_owned(),
        );
    }
    function.map(|weight| match (weight, limit) {
        (usual, None) => usual,
        (RobustWeight::Huber { .. }, Some(limit)) => RobustWeight::Huber { limit },
        (RobustWeight::Cauchy { .. }, Some(limit)) => RobustWeight::Cauchy { limit },
    })
}

/// The limit of the test; 0 switches it off.
fn blunder_limit(
    raw: &RawAdjustment,
    default: Option<f64>,
    review: &mut Review<'_>,
) -> Option<f64> {
    let accept = Accept::FromTo(0.0, 1000.0);
    let key = "adjustment.blunder_limit";
    match &raw.blunder_limit {
        None => default,
        Some(written) => review
            .optional_number(key, Some(written), accept)
            .filter(|limit| *limit > 0.0),
    }
}

fn priors(
    raw: &RawAdjustment,
    images: &[ImageConfig],
    review: &mut Review<'_>,
) -> Vec<OrientationPrior> {
    let key = "adjustment.images.id";
    let entries = raw.images.as_ref().map(Spanned::get_ref);
    let entries = entries.map(Vec::as_slice).unwrap_or_default();
    let ids = entries.iter().map(|entry| entry.get_ref().id.as_ref());
    no_repeats(key, ids, review);
    let mut prior = |entry: &Spanned<RawOrientationPrior>| {
        let keys = entry.get_ref();
        let id = review.identifier(key, &keys.id, Some(entry.span()), true);
        if let Some(written) = &keys.id
            && !images.iter().any(|image| image.id == id)
        {
            let known: Vec<&str> = images.iter().map(|image| image.id.as_str()).collect();
            let expected = format!("one of the site's images: {}", known.join(", "));
            review.refuse(written.span(), key, expected);
        }
        let position_m = sigmas(
            "adjustment.images.position_m",
            keys.position_m.as_ref(),
            SIGMA_OR_FREE,
            review,
        );
        let rotation_arcsec: Option<[f64; 9]> = sigmas(
            "adjustment.images.rotation_arcsec",
            keys.rotation_arcsec.as_ref(),
            SIGMA_OR_FREE,
            review,
        );
        OrientationPrior {
            id,
            position_m,
            rotation_rad: rotation_arcsec
                .map(|sigmas| sigmas.map(|sigma| sigma * RADIANS_PER_ARCSECOND)),
        }
    };
    entries.iter().map(&mut prior).collect()
}

/// `N` standard deviations; nothing when absent or refused.
fn sigmas<const N: usize>(
    key: &str,
    raw: Option<&Spanned<Vec<Spanned<f64>>>>,
    accept: Accept,
    review: &mut Review<'_>,
) -> Option<[f64; N]> {
    let raw = raw?;
    let values: Vec<f64> = raw
        .get_ref()
        .iter()
        .filter_map(|value| review.optional_number(key, Some(value), accept))
        .collect();
    if raw.get_ref().len() != N {
        review.refuse(raw.span(), key, format!("{N} numbers"));
    }
    values.try_into().ok()
}
