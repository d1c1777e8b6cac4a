//! From the site to its network, to the adjusted network, and back.

use std::collections::BTreeSet;

use super::{
    adjusted::{self, Adjusted},
    blunders,
    common_bus::add_spots,
    error::{AdjustError, CONTRADICTION},
    input::{AdjustImage, LaserShots},
    network::{self, Assembled, Named},
    point_errors::point_errors,
    points::{PointKind, RejectedPoint, RejectionReason},
    split, summary, words,
};
use crate::intersect::IntersectedTies;
use areograph_base::{error::Result, ties::TiePoint, watch::Watch};
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    bundle::{Adjustment, BundleOptions, Residual, Unknown},
    pushbroom::ExteriorOrientation,
};

/// Adjusts images, shots and tie points together.
///
/// Tie points start from their intersection; those without one are rejected and listed. Where the along-track
/// disagreement `disagreement_m` of the images is large, the result holds both readings of it. `watch` counts
/// solutions: their number until no blunder is left is not known in advance.
///
/// # Errors
/// No tie point with a ground point, identifiers that do not match, a singular network, initial values that contradict
/// the rest.
pub fn adjust<'a, M: ExteriorOrientation>(
    images: &[AdjustImage<M>],
    shots: &LaserShots,
    ties: &[TiePoint],
    starts: &IntersectedTies,
    disagreement_m: f64,
    config: &AdjustmentConfig,
    watch: impl Into<Watch<'a>>,
) -> Result<Adjusted> {
    let watch = watch.into();
    if starts.points.is_empty() {
        let first = starts.rejected.first();
        return Err(AdjustError::NoTies {
            ties: ties.len(),
            first: first.map_or_else(
                || "no tie points are given".to_owned(),
                |tie| format!("{}: {}", tie.id, tie.reason),
            ),
        }
        .into());
    }
    let mut assembled = network::assemble(images, shots, ties, starts, config)?;
    if config.common_bus {
        assembled.no_spots = add_spots(&mut assembled, images, shots, config)?.err();
    }
    let bundle_options = BundleOptions {
        robust: config.robust,
        ..BundleOptions::default()
    };
    let adjustment =
        blunders::solve_without_blunders(&mut assembled, &bundle_options, config, watch)
            .map_err(|error| words::in_words(error, images, &assembled, config))?;
    // Blunders have lost their measurements and are listed already.
    let listed: BTreeSet<usize> = assembled.rejected.iter().map(|tie| tie.index).collect();
    let dropped = adjustment
        .points
        .iter()
        .enumerate()
        .filter_map(|(point, outcome)| {
            let Named { index, name } = &assembled.points[point];
            let known = point >= assembled.shots && listed.contains(index);
            (outcome.is_err() && !known).then(|| RejectedPoint {
                kind: assembled.kind(point),
                index: *index,
                id: name.clone(),
                reason: RejectionReason::Undetermined,
            })
        });
    let dropped: Vec<RejectedPoint> = dropped.collect();
    assembled.rejected.extend(dropped);
    contradictions(images, &assembled, &adjustment)?;
    let errors = point_errors(&assembled, &adjustment, shots);
    let summary = summary::summarise(images, &assembled, &adjustment, &errors, config)?;
    let factor = summary.variance_factor;
    let other = split::needs_both_readings(disagreement_m, config).then(|| {
        split::other_reading(
            images,
            &assembled,
            &adjustment,
            factor,
            &bundle_options,
            config,
        )
        .map_err(|error| words::in_words(error, images, &assembled, config).to_string())
    });
    Ok(adjusted::collect(
        images,
        assembled,
        adjustment,
        (summary, &errors),
        &shots.profiles,
        other,
    ))
}

fn contradictions<M>(
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
    adjustment: &Adjustment,
) -> std::result::Result<(), AdjustError> {
    let refuse = |what: String, standardised: f64| {
        if standardised > CONTRADICTION {
            Err(AdjustError::Contradiction { what, standardised })
        } else {
            Ok(())
        }
    };
    let size = |residual: &Residual| (residual.value / residual.sigma).abs();
    for (image, adjusted) in adjustment.images.iter().enumerate() {
        for (coefficient, prior) in adjusted.priors.iter().enumerate() {
            if let Some(prior) = prior {
                let unknown = Unknown::Orientation { image, coefficient };
                refuse(words::unknown_in_words(unknown, images, &[]), size(prior))?;
            }
        }
    }
    for (index, outcome) in adjustment.points.iter().enumerate() {
        let (point, kind) = (&assembled.points[index], assembled.kind(index));
        for prior in outcome.iter().filter_map(|point| point.priors).flatten() {
            let owner = match kind {
                PointKind::Shot => "the footprint of shot",
                PointKind::Tie => "the given position of tie point",
            };
            refuse(format!("{owner} {}", point.name), size(&prior))?;
        }
    }
    Ok(())
}
