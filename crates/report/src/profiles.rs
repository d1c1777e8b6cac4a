//! The surface between shots, tested on the site's own shots: withheld profiles, crossovers, profiles left out.

use super::{
    html::{Cell, Column, Markup, Table, html, paragraph},
    numbers::whole,
    plots::{Extent, GREY, Panel, Plot, Series, Style, figure, label, thinned},
    section::Section,
};
use areograph_base::{error::Result, units::METRES_PER_KM, verdict::CheckKind};
use areograph_geom::surface::{WithheldScore, tails};
use areograph_products::SiteProducts;
use areograph_stages::check_profiles::{ProfileCheck, WithheldStretch};

/// Stretches drawn.
const SHOWN: usize = 400;

pub(super) const SECTION: Section = Section {
    title: "Test of the surface between shots",
    anchor: "surface-tested",
    checks: &[CheckKind::WithheldStretches],
    appears: |site| {
        let check = site.profile_check;
        check.score.is_some() || !check.crossovers.is_empty() || !check.left_out.is_empty()
    },
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let check = site.profile_check;
    Ok(html! {
        p {
            "Every stretch of a profile is withheld in turn and predicted from the other profiles, in the same way as the ground \
             under tie points."
        }
        @if let Some(score) = &check.score {
            (table(score))
            (figure(&plot(&check.stretches))?)
        } @else {
            p {
                "No stretch of a profile can be predicted from other profiles: the surface is not tested."
            }
        }
        (crossovers(check))
        (left_out(check))
    })
}

/// Stated and found shares.
fn table(score: &WithheldScore) -> Markup {
    let mut table = Table::new(
        "Withheld stretches: shares inside the stated intervals",
        &[
            Column::Number("stretches"),
            Column::Number("inside 68.27 %"),
            Column::Number("inside 95 %"),
            Column::Number("inside 99.7 %"),
            Column::Number("error, RMS (m)"),
            Column::Number("mean ln σ"),
            Column::Number("log-likelihood"),
        ],
    );
    let inside = |at: usize| Cell::from(label(score.inside[at], 3)).traced(format!("/inside/{at}"));
    table.row_of(
        "profiles.json#/withheld/score",
        true,
        [
            Cell::from(whole(score.stretches)).traced("/stretches"),
            inside(0),
            inside(1),
            inside(2),
            Cell::from(label(score.rms_m, 1)).traced("/rms_m"),
            Cell::from(label(score.log_sigma, 2)).traced("/log_sigma"),
            Cell::from(label(score.log_likelihood, 2)).traced("/log_likelihood"),
        ],
    );
    table.finish()
}

/// Errors by the distance of the nearest other shot, within their stated intervals.
fn plot(stretches: &[WithheldStretch]) -> Plot {
    let errors: Vec<(f64, f64)> = stretches
        .iter()
        .map(|stretch| {
            let sigmas = stretch.above_m / stretch.sigma_m;
            (stretch.nearest_shot_m / METRES_PER_KM, sigmas)
        })
        .collect();
    let errors = thinned(&errors, SHOWN);
    let farthest_km = errors.iter().map(|error| error.0).fold(0.0, f64::max);
    let level = |probability: f64, name: &str, colour: usize| {
        let sigmas = tails::half_width(probability);
        [sigmas, -sigmas].map(|at| Series::line(name, colour, vec![(0.0, at), (farthest_km, at)]))
    };
    let mut series = vec![Series {
        style: Style::Dots,
        ..Series::line("withheld stretches", 0, errors)
    }];
    series.extend(level(0.95, "95 %", GREY));
    series.extend(level(0.997, "99.7 %", 1));
    let panel = Panel::of("error, stated σ", series);
    Plot {
        x: Extent {
            low: 0.0,
            high: farthest_km.max(0.1),
        },
        ..Plot::of(
            "Withheld stretches above the surface".to_owned(),
            "Mean of measured minus predicted heights of each stretch, divided by its stated σ, against the distance \
             to the nearest shot of another profile. Lines: stated intervals of 95 and 99.7 %."
                .to_owned(),
            "distance to the nearest shot, km",
            vec![panel],
        )
    }
}

fn crossovers(check: &ProfileCheck) -> Markup {
    let differences = &check.differences_m;
    if differences.n == 0 {
        return paragraph(
            "No profiles cross: the radial error that the shots of a profile share is taken from the configuration.",
        );
    }
    let mut table = Table::new(
        "Crossovers of profiles",
        &[
            Column::Number("crossovers"),
            Column::Number("height differences, NMAD (m)"),
            Column::Number("radial error of a profile, σ (m)"),
        ],
    );
    table.row_of(
        "profiles.json#",
        true,
        [
            Cell::from(whole(differences.n)).traced("/differences_m/n"),
            Cell::from(label(differences.nmad, 2)).traced("/differences_m/nmad"),
            Cell::from(label(check.profile_sigma_m, 2)).traced("/profile_sigma_m"),
        ],
    );
    table.finish()
}

fn left_out(check: &ProfileCheck) -> Markup {
    if check.left_out.is_empty() {
        return Markup::default();
    }
    let mut table = Table::new(
        "Profiles left out",
        &[
            Column::Text("profile"),
            Column::Number("crossovers"),
            Column::Text("profiles that it crosses"),
            Column::Number("above them (m)"),
            Column::Number("σ (m)"),
            Column::Number("misfit"),
            Column::Text("reason"),
        ],
    );
    for (index, profile) in check.left_out.iter().enumerate() {
        table.row_of(
            &format!("profiles.json#/left_out/{index}"),
            false,
            [
                (&profile.profile).into(),
                Cell::from(whole(profile.crossovers)).traced("/crossovers"),
                profile.others.join(", ").into(),
                Cell::from(label(profile.above_m, 1)).traced("/above_m"),
                Cell::from(label(profile.sigma_m, 1)).traced("/sigma_m"),
                Cell::from(label(profile.misfit, 1)).traced("/misfit"),
                if profile.misplaced {
                    "misplaced"
                } else {
                    "above or below"
                }
                .into(),
            ],
        );
    }
    table.finish()
}
