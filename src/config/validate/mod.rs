//! From raw to valid: every value checked, units converted, paths resolved, defaults filled in.
//!
//! Each function returns a value even after a problem, so that all problems are found in one pass;
//! the values are used only when there was none.

mod adjustment;
mod globs;
mod images;
mod kernels;
mod pedr;
mod values;
mod windows;

use std::{collections::BTreeSet, path::Path};

use toml::Spanned;

use crate::{
    altimetry::{BiasScope, MolaClock, TagSign},
    geom::pushbroom::CameraModel,
    instruments::PointingTime,
    time::PointingBias,
    units::RADIANS_PER_ARCSECOND,
};

use super::{
    instruments::{built_in_altimeter, usual_instrument},
    problems::Review,
    raw::{RawMolaClock, RawOrientation, RawPointing, RawRangeCheck, RawRegistration, RawSite},
    shape::Written,
    site::{
        ImageConfig, OrientationConfig, PointingConfig, RangeCheckConfig, RegistrationConfig,
        SCAN_STEPS_MAX, SiteConfig,
    },
};
use values::Accept;

/// The valid form of `raw`; to be used only when `review` has found no problem.
pub(super) fn validate(
    raw: RawSite,
    file: &Path,
    written: Written,
    review: &mut Review<'_>,
) -> SiteConfig {
    let searched = raw.pedr.is_some();
    let imaged = raw
        .images
        .as_ref()
        .is_some_and(|images| !images.get_ref().is_empty());
    match (searched, imaged, &raw.images) {
        (false, false, _) => review.missing(
            None,
            "pedr",
            "a table pedr, tables [[images]], or both: a site without either has nothing to do",
        ),
        (false, true, Some(images)) => review.warn(
            images.span(),
            "images without a table pedr: orientation only, no footprints and no range check"
                .to_owned(),
        ),
        _ => {}
    }
    let images = images::images(raw.images, review);
    SiteConfig {
        site: review.identifier("site", &raw.site, None, false),
        description: raw.description.unwrap_or_default(),
        file: file.to_owned(),
        blake3: written.blake3,
        keys: written.keys,
        kernels: kernels::kernels(raw.kernels, review),
        pointing: pointing(&inner(raw.pointing), &images, review),
        mola_clock: mola_clock(&inner(raw.mola_clock), review),
        pedr: pedr::pedr(raw.pedr, review),
        windows: windows::windows(raw.windows, searched, review),
        range_check: range_check(&inner(raw.range_check), review),
        orientation: orientation(&inner(raw.orientation), review),
        registration: registration(&inner(raw.registration), review),
        ties: adjustment::ties(raw.ties, &images, review),
        intersection: adjustment::intersection(&inner(raw.intersection), review),
        adjustment: adjustment::adjustment(&inner(raw.adjustment), &images, review),
        images,
    }
}

/// The table, or one without keys.
fn inner<T: Default>(raw: Option<Spanned<T>>) -> T {
    raw.map(Spanned::into_inner).unwrap_or_default()
}

fn pointing(raw: &RawPointing, images: &[ImageConfig], review: &mut Review<'_>) -> PointingConfig {
    let named: Vec<&PointingTime> = images
        .iter()
        .filter_map(|image| Some(&image.instrument.as_ref()?.pointing))
        .collect();
    let usual = named.first().copied();
    let usual = usual.unwrap_or(&usual_instrument().pointing);
    let differs = |own: &&PointingTime| own.ck_bias_s.total_cmp(&usual.ck_bias_s).is_ne();
    if raw.ck_bias_s.is_none() && named.iter().any(differs) {
        let expected = "one bias for all images, as their instruments have different ones";
        review.missing(None, "pointing.ck_bias_s", expected);
    }
    let ck_bias_s = review.number(
        "pointing.ck_bias_s",
        &raw.ck_bias_s,
        Accept::FromTo(-10.0, 10.0),
        usual.ck_bias_s,
    );
    PointingConfig {
        ck_bias: PointingBias::from_seconds(ck_bias_s),
        source: review.text("pointing.source", &raw.source, &usual.source),
    }
}

fn mola_clock(raw: &RawMolaClock, review: &mut Review<'_>) -> MolaClock {
    let signs = [("late", TagSign::Late), ("early", TagSign::Early)];
    let scopes = [
        ("spk_lookup", BiasScope::SpkLookup),
        ("rotation", BiasScope::Rotation),
        ("both", BiasScope::Both),
        ("none", BiasScope::None),
    ];
    let scope = review.word("mola_clock.scope", raw.scope.as_ref(), &scopes);
    if scope == Some(BiasScope::None) {
        for (key, span) in [
            ("bias_s", raw.bias_s.as_ref().map(Spanned::span)),
            ("sign", raw.sign.as_ref().map(Spanned::span)),
        ] {
            if let Some(span) = span {
                review.warn(
                    span,
                    format!("mola_clock.{key} is never used: mola_clock.scope is \"none\""),
                );
            }
        }
    }
    let altimeter = built_in_altimeter();
    MolaClock {
        bias_s: review.number(
            "mola_clock.bias_s",
            &raw.bias_s,
            Accept::FromTo(0.0, 10.0),
            altimeter.clock_bias_s,
        ),
        sign: review
            .word("mola_clock.sign", raw.sign.as_ref(), &signs)
            .unwrap_or(TagSign::Late),
        scope: scope.unwrap_or(BiasScope::SpkLookup),
        source: review.text("mola_clock.source", &raw.source, &altimeter.clock_source),
    }
}

fn range_check(raw: &RawRangeCheck, review: &mut Review<'_>) -> RangeCheckConfig {
    let metres = Accept::AboveTo(0.0, 1e6);
    let seconds = Accept::AboveTo(0.0, 10.0);
    let checked = RangeCheckConfig {
        mean_max_m: review.number("range_check.mean_max_m", &raw.mean_max_m, metres, 10.0),
        outlier_sigma: review.number(
            "range_check.outlier_sigma",
            &raw.outlier_sigma,
            Accept::AboveTo(0.0, 1000.0),
            5.0,
        ),
        outlier_share_max: review.number(
            "range_check.outlier_share_max",
            &raw.outlier_share_max,
            Accept::FromTo(0.0, 1.0),
            0.05,
        ),
        shots_min: review
            .whole(
                "range_check.shots_min",
                raw.shots_min.as_ref(),
                2,
                1_000_000,
            )
            .unwrap_or(20),
        decoding_max_m: review.number(
            "range_check.decoding_max_m",
            &raw.decoding_max_m,
            metres,
            2.0,
        ),
        scan_half_width_s: review.number(
            "range_check.scan_half_width_s",
            &raw.scan_half_width_s,
            seconds,
            0.5,
        ),
        scan_step_s: review.number("range_check.scan_step_s", &raw.scan_step_s, seconds, 0.01),
    };
    let (step, half_width) = (checked.scan_step_s, checked.scan_half_width_s);
    let (shortest, longest) = (2.0 * half_width / f64::from(SCAN_STEPS_MAX), half_width);
    if !(shortest <= step && step <= longest) {
        // Whichever of the two was written is the one to mend.
        for (key, written) in [
            ("range_check.scan_step_s", &raw.scan_step_s),
            ("range_check.scan_half_width_s", &raw.scan_half_width_s),
        ] {
            if let Some(written) = written {
                let expected = format!(
                    "a step from {shortest} to {longest} s within a half width of {half_width} s"
                );
                review.refuse(written.span(), key, expected);
                break;
            }
        }
    }
    checked
}

fn orientation(raw: &RawOrientation, review: &mut Review<'_>) -> OrientationConfig {
    OrientationConfig {
        intervals: review
            // A second-order polynomial through four epochs is the least that leaves residuals.
            .whole("orientation.intervals", raw.intervals.as_ref(), 3, 10_000)
            .unwrap_or(30),
        position_rmse_max_m: review.number(
            "orientation.position_rmse_max_m",
            &raw.position_rmse_max_m,
            Accept::AboveTo(0.0, 1e6),
            5.0,
        ),
        pointing_rmse_max_rad: RADIANS_PER_ARCSECOND
            * review.number(
                "orientation.pointing_rmse_max_arcsec",
                &raw.pointing_rmse_max_arcsec,
                Accept::AboveTo(0.0, 3600.0),
                10.0,
            ),
    }
}

fn registration(raw: &RawRegistration, review: &mut Review<'_>) -> RegistrationConfig {
    RegistrationConfig {
        model: review
            .word(
                "registration.model",
                raw.model.as_ref(),
                &CameraModel::WORDS,
            )
            .unwrap_or(CameraModel::RotationVector),
        tolerance_lines: review.number(
            "registration.tolerance_lines",
            &raw.tolerance_lines,
            // Below, steps drown in the rounding of coordinates: 1e-9 m of 4e6 m, lines of metres.
            Accept::FromTo(1e-6, 100.0),
            0.1,
        ),
        steps_max: review
            .whole("registration.steps_max", raw.steps_max.as_ref(), 1, 10_000)
            .unwrap_or(100),
    }
}

/// Identifiers name folders and columns: none may come twice, whatever their capitals.
fn no_repeats<'a>(
    key: &str,
    ids: impl Iterator<Item = Option<&'a Spanned<String>>>,
    review: &mut Review<'_>,
) {
    let mut seen = BTreeSet::new();
    for id in ids.flatten() {
        if !seen.insert(id.get_ref().to_ascii_lowercase()) {
            review.refuse(id.span(), key, "an identifier that no other entry has");
        }
    }
}
