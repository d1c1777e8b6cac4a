//! The terrain model of a site: statistics, comparison with MOLA, and pictures.

use maud::{Markup, html};

use super::{
    contour_interval::contour_interval_m,
    joint::tables,
    products::{ABOVE_SPHERE, SIGMAS, reference_file},
    relief::{CONTOURS, HILLSHADE, SLOPES},
};
use crate::{
    error::Result,
    geom::statistics::Summary,
    products::SiteProducts,
    report::{
        Section,
        parts::{Cell, Column, Table, folded_unless, label, link, paragraph, signed, whole},
        terrain_pictures,
    },
    stages::map_surface::{SHOTS_MIN, ShotComparison, Surface, SurfaceAccount},
    ties::reasons,
    units::RADIANS_PER_DEGREE,
    verdict::CheckKind,
};

/// More profiles than this are folded.
const PROFILES_SHOWN: usize = 6;

pub(super) const SECTION: Section = Section {
    title: "Terrain model",
    anchor: "terrain-model",
    checks: &[
        CheckKind::SurfaceFilled,
        CheckKind::SurfaceHeight,
        CheckKind::SurfaceSpread,
    ],
    appears: |site| site.has::<Surface>(),
    write: |site| {
        let surface = site.find::<Surface>()?;
        let written = surface.map(|of| write(site, &of.account));
        Ok(written.transpose()?.unwrap_or_default())
    },
};

fn write(site: &SiteProducts, account: &SurfaceAccount) -> Result<Markup> {
    let table = made(site, account);
    if account.is_refused {
        let words = "Too few cells matched to be significant; no model was produced.";
        return Ok(html! { p { (words) } (table) });
    }
    let pictures = terrain_pictures(account, &site.config.terms())?;
    let file = |name: &str| link(&format!("../{name}"), name);
    Ok(html! {
        p {
            @if let Some((surface, of)) = reference_file(site) {
                "Heights above the " (surface) ", as in the figures: " (file(of.path)) ". "
            }
            "Heights above the sphere of the body's maps, for programs that expect this reference: "
            (file(ABOVE_SPHERE.path)) ". Standard deviations: " (file(SIGMAS.path))
            ". Shading: " (file(HILLSHADE.path)) ". Slopes: " (file(SLOPES.path))
            ". Contours every " (label(contour_interval_m(account), 2)) " m: " (file(CONTOURS.path)) "."
        }
        (table)
        @if let Some(joint) = &account.joint { (tables(site, joint, site.config.terms().altimeter)) }
        (compared(account, site.config.terms().altimeter))
        div.plots { (pictures) }
    })
}

/// Making of the model, and outcomes of its cells.
fn made(site: &SiteProducts, account: &SurfaceAccount) -> Markup {
    let mut table = Table::new(
        "Terrain model from pairs of images",
        &[
            Column::Text("images"),
            Column::Number("cell (m)"),
            Column::Number("compared (m)"),
            Column::Number("cells of common ground"),
            Column::Number("with a height"),
            Column::Number("σ of a cell (m)"),
            Column::Number("by jitter"),
            Column::Number("by smoothing"),
            Column::Number("σ, common (m)"),
            Column::Number("convergence (°)"),
            Column::Number("correlation"),
        ],
    );
    let [first, second] = account.images.map(|image| &site.images[image].times.id);
    let images = account.joint.as_ref().map_or_else(
        || format!("{first}, {second}"),
        |joint| {
            format!(
                "{} pairs",
                joint.pairs.iter().filter(|of| of.bit.is_some()).count()
            )
        },
    );
    let common = account.common_sigma_m.map_or_else(
        || Cell::from("not known"),
        |sigma_m| Cell::from(label(sigma_m, 1)).traced("/heights/common_sigma_m"),
    );
    let of =
        |value: f64, decimals: usize, place: &str| Cell::from(label(value, decimals)).traced(place);
    table.row_of(
        "surface.json#",
        !account.is_refused,
        [
            images.into(),
            of(account.cell_m, 1, "/cells/cell_m"),
            of(account.compared_m, 0, "/matching/compared_m"),
            Cell::from(whole(account.cells)).traced("/cells/common"),
            Cell::from(whole(account.filled)).traced("/cells/filled"),
            of(account.sigma_m, 2, "/heights/sigma_m"),
            of(account.jitter_m, 2, "/heights/jitter_m"),
            of(account.smoothing_m, 2, "/heights/smoothing_m"),
            common,
            of(
                account.convergence_rad / RADIANS_PER_DEGREE,
                1,
                "/matching/convergence_deg",
            ),
            of(account.correlation, 2, "/matching/correlation"),
        ],
    );
    let reasons = reasons(&account.unfilled);
    html! {
        (table.finish())
        @if !reasons.is_empty() { p { "Cells without a height: " (reasons) "." } }
        p {
            "σ of a cell is the standard deviation of one height relative to the others. It contains the residuals of the match, \
             jitter of the images (the scatter of their shifts across the parallax, which heights do not affect), and relief \
             inside the compared square. Errors that all heights share are stated separately (σ, common, from the adjustment). \
             Neighbouring heights within the compared square are correlated."
        }
    }
}

/// Shots against the model.
fn compared(account: &SurfaceAccount, altimeter: &str) -> Markup {
    let ShotComparison {
        above_m,
        attitude_sigma_m,
        sigma_m,
        spread_sigmas,
        profiles,
        ..
    } = &account.shots;
    if profiles.is_empty() {
        return paragraph(&format!(
            "No footprint of {altimeter} lies on the model, so its heights have no independent test."
        ));
    }
    let mut single = shots_table(&format!(
        "{altimeter} minus the terrain model by profile, metres"
    ));
    for (index, profile) in profiles.iter().enumerate() {
        let id = &profile.profile;
        let name = if profile.attitude_sigma_m > 0.0 {
            format!("{id} (attitude: ±{:.0} m)", profile.attitude_sigma_m)
        } else {
            id.clone()
        };
        single.row_of(
            &format!("surface.json#/mola_minus_surface/profiles/{index}/above_m"),
            true,
            summary_row(&name, &profile.above_m),
        );
    }
    let single = folded_unless(
        profiles.len() <= PROFILES_SHOWN,
        "Single profiles",
        &single.finish(),
    );
    let mut all = shots_table(&format!("{altimeter} minus the terrain model, metres"));
    let name = if *attitude_sigma_m > 0.0 {
        "all profiles"
    } else {
        "all at nadir"
    };
    all.row_of(
        "surface.json#/mola_minus_surface/all",
        true,
        summary_row(name, above_m),
    );
    let words = if account.shots_take_part {
        format!(
            "{altimeter} controlled heights in the adjustment: the mean shows the agreement with this control; the scatter \
             about the mean is an independent test."
        )
    } else {
        format!("{altimeter} did not control the heights: the comparison is an independent test.")
    };
    let spread = format!(
        "Expected spread about the median: {} m (σ of height, shot, profile, and position on slopes); found: {} times the expected (NMAD).",
        label(*sigma_m, 1),
        label(*spread_sigmas, 2)
    );
    let attitude = if *attitude_sigma_m > 0.0 {
        format!(
            " Fewer than {SHOTS_MIN} shots at nadir lie on the model. Attitude errors shift the heights of the other profiles by up to \
             {} m (σ).",
            label(*attitude_sigma_m, 0)
        )
    } else {
        String::new()
    };
    html! { (all.finish()) p { (words) " " (spread) (attitude) } (single) }
}

fn shots_table(caption: &str) -> Table {
    Table::new(
        caption,
        &[
            Column::Text("profile"),
            Column::Number("shots"),
            Column::Number("mean"),
            Column::Number("standard deviation"),
            Column::Number("median"),
            Column::Number("1.48 MAD"),
        ],
    )
}

fn summary_row(name: &str, of: &Summary) -> [Cell; 6] {
    [
        name.into(),
        Cell::from(whole(of.n)).traced("/n"),
        Cell::from(signed(of.mean, 1)).traced("/mean"),
        Cell::from(label(of.standard_deviation, 1)).traced("/standard_deviation"),
        Cell::from(signed(of.median, 1)).traced("/median"),
        Cell::from(label(of.nmad, 1)).traced("/nmad"),
    ]
}
