//! Heights of tie points above the MOLA surface, and statements of their accuracy.

mod boresight;
mod parts;
mod profile;
mod readings;
mod relief;

use super::{
    html::{Cell, Column, Markup, Table, counted, folded, html, paragraph},
    misregistration::BeforeAfter,
    numbers::whole,
    plots::{figure, label},
    section::Section,
    source::traced,
};
use areograph_base::{error::Result, footprints::AdjustmentModel, verdict::CheckKind};
use areograph_products::{AdjustmentProducts, GeometricProducts, SiteProducts};
use areograph_stages::{
    check_heights::{HeightCheck, SurfaceFigures},
    compare_pairs::PairComparison,
};

pub(super) const SECTION: Section = Section {
    title: "Accuracy, and agreement with {altimeter}",
    anchor: "accuracy",
    checks: &[
        CheckKind::HeightAfter,
        CheckKind::HeightBefore,
        CheckKind::HeightOutliers,
        CheckKind::ProfilesApart,
        CheckKind::HeightSigma,
        CheckKind::Boresight,
    ],
    appears: |site| site.geometric.is_some(),
    write: |site| {
        let geometric = site.geometric.as_ref();
        let written = geometric.map(|geometric| write(site, geometric));
        Ok(written.transpose()?.unwrap_or_default())
    },
};

fn write(site: &SiteProducts, geometric: &GeometricProducts) -> Result<Markup> {
    let adjustment = geometric.adjustment.as_ref();
    let altimeter = site.config.terms().altimeter;
    Ok(html! {
        @if let Some(adjustment) = adjustment { (statements(site, geometric, adjustment)) }
        @if let Ok(surface) = &geometric.heights.surface {
            h3 { "Heights against the " (altimeter) " surface" }
            (compared(geometric, altimeter))
            (apart(geometric.heights))
            div.plots { (figure(&profile::plot(site, geometric))?) }
            (folded("The surface, and heights of footprints from images", &html! {
                (surface_in_words(surface))
                (footprints(geometric, altimeter))
            }))
        }
    })
}

/// Reason why absolute accuracies are withheld.
pub(super) const WITHHELD_BECAUSE: &str =
    "the a priori accuracy of orbit and attitude is that of another spacecraft";

/// The three statements of accuracy, and their basis.
fn statements(
    site: &SiteProducts,
    geometric: &GeometricProducts,
    adjustment: &AdjustmentProducts,
) -> Markup {
    let mut table = Table::new(
        "Accuracy of the tie points",
        &[
            Column::Text("accuracy"),
            Column::Text("before the adjustment"),
            Column::Text("after it"),
            Column::Text("meaning"),
        ],
    );
    let altimeter = site.config.terms().altimeter;
    let nothing = || "–".to_owned();
    let pairs = BeforeAfter::all(geometric);
    let worst = BeforeAfter::worst(&pairs);
    let parallax =
        |pair: &PairComparison| format!("{} m", label(pair.along_track_parallax_m.abs(), 1));
    let [along, _] = adjustment.adjusted.summary.tie_components;
    let after = worst.and_then(|pair| pair.after).map(parallax);
    let is_withheld = site.accuracy_withheld().is_some();
    let [height, place] = if is_withheld {
        [0, 1].map(|_| format!("withheld: {WITHHELD_BECAUSE}"))
    } else {
        absolute(geometric, adjustment)
    };
    let statements = [
        [
            "internal agreement".to_owned(),
            worst.map_or_else(nothing, |pair| parallax(pair.before)),
            after.map_or_else(nothing, |after| {
                format!("{after}; residuals {} σ", label(along, 2))
            }),
            "agreement of the images along the track; not a measure of the accuracy of height or position"
                .to_owned(),
        ],
        [
            format!("agreement with {altimeter}, height"),
            agreement(geometric.heights),
            agreement(adjustment.heights),
            agreement_says(adjustment, altimeter),
        ],
        [
            "absolute, height".to_owned(),
            format!("a priori, from {}", known_beforehand(geometric)),
            height,
            "standard deviation of the common offset, and of individual tie points".to_owned(),
        ],
        [
            "absolute, position".to_owned(),
            "same as after".to_owned(),
            place,
            place_says(geometric, adjustment),
        ],
    ];
    for cells in statements {
        table.row(true, cells.map(Cell::from));
    }
    let relief = if is_withheld && adjustment.adjusted.heights.is_some() {
        html! { p { "The accuracy of the position from relief is withheld: " (WITHHELD_BECAUSE) "." } }
    } else {
        relief::relief(adjustment.adjusted, known_beforehand(geometric))
    };
    let heights = adjustment.adjusted.heights.as_ref();
    html! {
        (table.finish())
        @if let Some(heights) = heights.filter(|_| !is_withheld) {
            (parts::parts(heights, site.config.terms()))
        }
        (relief)
        (boresight::boresight(adjustment.adjusted))
        (readings::two_readings(adjustment.adjusted, is_withheld))
    }
}

fn place_says(geometric: &GeometricProducts, adjustment: &AdjustmentProducts) -> String {
    let (known, by) = (known_beforehand(geometric), place_by(geometric, adjustment));
    if known == by {
        format!("a priori, from {known}; not measured by images")
    } else {
        format!("from {by}; not measured by images")
    }
}

/// All sources of a site's position.
pub(super) fn place_by(geometric: &GeometricProducts, adjustment: &AdjustmentProducts) -> String {
    let adjusted = adjustment.adjusted;
    let by_relief = adjusted.relief.as_ref().is_some_and(|relief| relief.used);
    let by_laser = matches!(adjusted.boresight, Some(Ok(_)));
    let also = [
        (by_relief, "relief"),
        (by_laser, "the laser mounting"),
        (
            adjusted.attitude_clock_s.is_some(),
            "one attitude clock offset",
        ),
    ];
    let also: Vec<&str> = also
        .into_iter()
        .filter_map(|(used, what)| used.then_some(what))
        .collect();
    match also.as_slice() {
        [] => known_beforehand(geometric).to_owned(),
        also => format!("{}; {}", known_beforehand(geometric), also.join(", ")),
    }
}

/// A priori sources of a site's position.
pub(super) fn known_beforehand(geometric: &GeometricProducts) -> &'static str {
    if geometric.ties.points.iter().any(|tie| tie.known.is_some()) {
        "orbit, attitude and given ground points"
    } else {
        "orbit and attitude"
    }
}

fn agreement(check: &HeightCheck) -> String {
    match &check.surface {
        Ok(_) => format!(
            "{} m median, {} m spread (1.48 MAD), {} tie points",
            label(check.above_m.median, 1),
            label(check.above_m.nmad, 1),
            check.above_m.n
        ),
        Err(reason) => format!("not known: {reason}"),
    }
}

fn agreement_says(adjustment: &AdjustmentProducts, altimeter: &str) -> String {
    if adjustment.adjusted.heights.is_some() {
        "before: an independent test; after: fit of the adjustment to its control".to_owned()
    } else {
        format!("an independent test: the {altimeter} surface did not control heights")
    }
}

/// Statements of height and position after the adjustment.
pub(super) fn absolute(
    geometric: &GeometricProducts,
    adjustment: &AdjustmentProducts,
) -> [String; 2] {
    let summary = &adjustment.adjusted.summary;
    let Some(heights) = &adjustment.adjusted.heights else {
        let statements = if summary.model == AdjustmentModel::Published {
            [
                "not determined: the published model does not control heights",
                "not determined",
            ]
        } else {
            [
                "a priori: no surface controls heights",
                "a priori; ties.parquet contains the standard deviations of single tie points",
            ]
        };
        return statements.map(str::to_owned);
    };
    let single = single_sigmas_m(adjustment);
    let [east_m, north_m, up_m] = heights.mean_sigma_m;
    let half = half_apart_m(geometric).map_or_else(String::new, |half_m| {
        let half = format!(
            "half of the images' along-track disagreement, {} m",
            label(half_m, 0)
        );
        if is_open(geometric, adjustment) {
            format!("; open: {half}, because neither image is known to be correct")
        } else {
            format!("; {half}, is within these standard deviations")
        }
    });
    [
        format!(
            "mean ±{} m, single tie points ±{} to ±{} m",
            label(up_m, 1),
            label(single[0], 0),
            label(single[1], 0)
        ),
        format!(
            "±{} m east, ±{} m north{half}",
            label(east_m, 0),
            label(north_m, 0)
        ),
    ]
}

/// Half of the largest along-track disagreement of a pair before the adjustment, metres.
fn half_apart_m(geometric: &GeometricProducts) -> Option<f64> {
    let pairs = BeforeAfter::all(geometric);
    let worst = BeforeAfter::worst(&pairs)?;
    Some(0.5 * worst.before.along_track_parallax_m.abs())
}

/// Whether the stated position is more certain than the images allow: it holds only if errors of both images are as
/// likely, and half of their difference is no less open.
pub(super) fn is_open(geometric: &GeometricProducts, adjustment: &AdjustmentProducts) -> bool {
    let heights = adjustment.adjusted.heights.as_ref();
    let stated = heights.map(|heights| heights.mean_sigma_m[0].max(heights.mean_sigma_m[1]));
    stated
        .zip(half_apart_m(geometric))
        .is_some_and(|(stated_m, half_m)| half_m > stated_m)
}

/// Least and largest standard deviation of the height of a tie point, metres.
fn single_sigmas_m(adjustment: &AdjustmentProducts) -> [f64; 2] {
    let ties = adjustment.adjusted_ties();
    let sigmas_m = ties.map(|point| {
        let up = point.ground.xyz_m.normalize();
        up.dot(&(point.covariance_m2 * up)).sqrt()
    });
    sigmas_m.fold([f64::INFINITY, 0.0], |[least, most], sigma_m| {
        [least.min(sigma_m), most.max(sigma_m)]
    })
}

fn surface_in_words(surface: &SurfaceFigures) -> Markup {
    let of = |text: &str, name: &str| {
        traced(
            text,
            &format!("adjustment.json#/before/heights/surface/{name}"),
        )
    };
    html! {
        p {
            "Surface kriged from " (of(&whole(surface.shots), "shots")) " shots of "
            (of(&counted(surface.profiles, "profile"), "profiles"))
            "; roughness " (of(&label(surface.roughness_m, 1), "roughness_m")) " m RMS over 300 m, slope "
            (of(&label(surface.slope, 3), "slope"))
            " per axis. Errors of the surface at neighbouring tie points are correlated, so averaging hardly reduces \
             them."
        }
    }
}

fn compared(geometric: &GeometricProducts, altimeter: &str) -> Markup {
    let mut table = Table::new(
        &format!("Heights of tie points above the {altimeter} surface, metres"),
        &[
            Column::Text("adjustment"),
            Column::Number("tie points"),
            Column::Number("within 1 km of a shot"),
            Column::Number("median"),
            Column::Number("1.48 MAD"),
            Column::Number("mean"),
            Column::Number("standard deviation"),
            Column::Number("σ of the mean, surface only"),
        ],
    );
    let after = geometric
        .adjustment
        .iter()
        .map(|adjustment| ("after", adjustment.heights));
    for (state, check) in [("before", geometric.heights)].into_iter().chain(after) {
        let of = |value: f64, name: &str| {
            Cell::from(label(value, 1)).traced(format!("/above_surface_m/{name}"))
        };
        let place = match geometric.adjustment {
            Some(_) => format!("adjustment.json#/{state}/heights"),
            None => String::new(),
        };
        table.row_of(
            &place,
            true,
            [
                state.into(),
                Cell::from(whole(check.above_m.n)).traced("/above_surface_m/n"),
                Cell::from(whole(check.near_shots)).traced("/near_shots"),
                of(check.above_m.median, "median"),
                of(check.above_m.nmad, "nmad"),
                of(check.above_m.mean, "mean"),
                of(check.above_m.standard_deviation, "standard_deviation"),
                Cell::from(label(check.mean_sigma_m, 1)).traced("/mean_sigma_m"),
            ],
        );
    }
    table.finish()
}

/// Heights of footprints that both images of a pair show.
fn footprints(geometric: &GeometricProducts, altimeter: &str) -> Markup {
    let mut table = Table::new(
        &format!("Heights of footprints from the images that show them, above {altimeter}, metres"),
        &[
            Column::Text("adjustment"),
            Column::Text("pair"),
            Column::Text("profile"),
            Column::Number("footprints"),
            Column::Number("median"),
            Column::Number("1.48 MAD"),
        ],
    );
    let after = geometric
        .adjustment
        .iter()
        .map(|adjustment| ("after", adjustment.pairs));
    let mut rows = 0;
    let tabled = BeforeAfter::images_tabled(geometric);
    for (state, pairs) in [("before", geometric.pairs)].into_iter().chain(after) {
        let pairs = pairs.iter().enumerate();
        for (index, pair) in pairs.filter(|(_, pair)| tabled.contains(&pair.images)) {
            let profiles = pair
                .footprints
                .iter()
                .flat_map(|footprints| &footprints.profiles);
            for (at, profile) in profiles.enumerate() {
                let above_m = &profile.above_m;
                rows += 1;
                let place = format!(
                    "adjustment.json#/{state}/pairs/{index}/footprints/profiles/{at}/above_mola_m"
                );
                let place = geometric.adjustment.map_or_else(String::new, |_| place);
                table.row_of(
                    &place,
                    true,
                    [
                        state.into(),
                        pair.images.join(" and ").into(),
                        profile.profile.clone().into(),
                        Cell::from(above_m.n.to_string()).traced("/n"),
                        Cell::from(label(above_m.median, 1)).traced("/median"),
                        Cell::from(label(above_m.nmad, 1)).traced("/nmad"),
                    ],
                );
            }
        }
    }
    if rows == 0 {
        return Markup::default();
    }
    let words = "Relief between tie points affects single heights; relief of one sign along a profile also affects \
                 the median.";
    html! { (BeforeAfter::some_of_all(geometric)) (table.finish()) p { (words) } }
}

fn apart(check: &HeightCheck) -> Markup {
    let Some(apart) = &check.apart else {
        return paragraph("A single profile provides no independent test of the surface.");
    };
    let [first, second] = &apart.profiles;
    let (upper, lower) = if apart.mean_m < 0.0 {
        (second, first)
    } else {
        (first, second)
    };
    let mean_m = label(apart.mean_m.abs(), 1);
    html! {
        p {
            "At the tie points, the surface interpolated from " (upper) " alone lies on average "
            (traced(&mean_m, "|adjustment.json#/before/heights/profiles_apart/mean_m"))
            " m above the surface from " (lower) " alone (expected σ "
            (traced(&label(apart.sigma_m, 1), "adjustment.json#/before/heights/profiles_apart/sigma_m")) " m)."
        }
    }
}
