//! The tables of Shan et al. 2005 over the images, profiles and pairs of a campaign.

use crate::{
    html::{Cell, Column, Markup, Table, html},
    numbers::whole,
    plots::label,
};
use areograph_geom::statistics::Summary;
use areograph_stages::pool_sites::{CampaignSummary, MisregistrationPooled, RangesPooled};

pub(super) fn pooled(summary: &CampaignSummary) -> Markup {
    html! {
        (images(summary))
        (ranges(summary))
        (polynomials(summary))
        (residuals(summary))
        (misregistration(summary))
    }
}

fn images(summary: &CampaignSummary) -> Markup {
    let of = &summary.images;
    let mut table = Table::new(
        "Images (Table 2 of Shan et al. 2005)",
        &[
            Column::Text("quantity"),
            Column::Number("images"),
            Column::Number("least"),
            Column::Number("median"),
            Column::Number("mean"),
            Column::Number("largest"),
        ],
    );
    let quantities: [(&str, &Summary, usize); 6] = [
        ("emission, degrees", &of.emission_deg, 2),
        ("exposure, ms", &of.exposure_ms, 4),
        ("line spacing (GSD of images), m", &of.line_spacing_m, 2),
        ("pixel width, m", &of.pixel_size_m, 2),
        ("shot spacing (GSD of shots), m", &of.shot_spacing_m, 1),
        ("footprints in the image", &of.footprints_inside, 0),
    ];
    for (name, of, decimals) in quantities {
        if of.n > 0 {
            let numbers = [of.min, of.median, of.mean, of.max];
            let cells = numbers.map(|value| Cell::from(label(value, decimals)));
            let head = [Cell::from(name), whole(of.n).into()];
            table.row(true, head.into_iter().chain(cells));
        }
    }
    table.finish()
}

fn ranges(summary: &CampaignSummary) -> Markup {
    let mut table = Table::new(
        "Range − distance (Table 3 of Shan et al. 2005)",
        &[
            Column::Text("shots"),
            Column::Number("profiles"),
            Column::Number("n"),
            Column::Number("mean, m"),
            Column::Number("standard deviation, m"),
            Column::Number("within profiles, m"),
            Column::Number("between means of profiles, m"),
            Column::Number("largest mean, m"),
        ],
    );
    let rows: [(&str, &Option<RangesPooled>); 2] = [
        ("all", &summary.ranges),
        ("in simultaneous images", &summary.ranges_in_images),
    ];
    for (name, of) in rows {
        if let Some(of) = of {
            let largest = [of.means_m.min, of.means_m.max];
            let largest = largest
                .into_iter()
                .max_by(|a, b| a.abs().total_cmp(&b.abs()));
            table.row(
                true,
                [
                    name.into(),
                    whole(of.profiles).into(),
                    whole(of.shots).into(),
                    label(of.mean_m, 3).into(),
                    label(of.deviation_m, 3).into(),
                    label(of.within_profiles_m, 3).into(),
                    label(of.means_m.standard_deviation, 3).into(),
                    label(largest.unwrap_or_default(), 3).into(),
                ],
            );
        }
    }
    table.finish()
}

fn polynomials(summary: &CampaignSummary) -> Markup {
    let mut table = Table::new(
        "RMSE of the orientation about polynomials, root mean square of the images (Table 4 of Shan et al. 2005)",
        &[
            Column::Text("order"),
            Column::Number("images"),
            Column::Number("X, m"),
            Column::Number("Y, m"),
            Column::Number("Z, m"),
            Column::Number("ω, arcsec"),
            Column::Number("φ, arcsec"),
            Column::Number("κ, arcsec"),
        ],
    );
    for of in &summary.polynomials {
        let head = [Cell::from(of.order.to_string()), whole(of.images).into()];
        let position = of.position_m.map(|value| Cell::from(label(value, 4)));
        let angles = of.angles_arcsec.map(|value| Cell::from(label(value, 3)));
        table.row(true, head.into_iter().chain(position).chain(angles));
    }
    table.finish()
}

fn residuals(summary: &CampaignSummary) -> Markup {
    let mut table = Table::new(
        "Reprojection residuals of tie points (Table 5 of Shan et al. 2005)",
        &[
            Column::Text("adjustment"),
            Column::Text("image of the pair"),
            Column::Number("pairs"),
            Column::Number("tie points"),
            Column::Number("mean along, lines"),
            Column::Number("√(M² + σ²) along, lines"),
            Column::Number("mean across, px"),
            Column::Number("√(M² + σ²) across, px"),
        ],
    );
    for (state, of) in [("before", &summary.before), ("after", &summary.after)] {
        let Some(of) = &of.residuals else {
            continue;
        };
        for (image, residuals) in ["first", "second"].iter().zip(&of.images) {
            table.row(
                true,
                [
                    state.into(),
                    (*image).into(),
                    whole(of.pairs).into(),
                    whole(of.ties).into(),
                    label(residuals.mean_along_lines, 2).into(),
                    label(residuals.size_along_lines, 2).into(),
                    label(residuals.mean_across_px, 2).into(),
                    label(residuals.size_across_px, 2).into(),
                ],
            );
        }
    }
    table.finish()
}

fn misregistration(summary: &CampaignSummary) -> Markup {
    let mut table = Table::new(
        "Misregistration of footprints, root mean square of the pairs",
        &[
            Column::Text("adjustment"),
            Column::Number("pairs"),
            Column::Number("footprints"),
            Column::Number("along, lines"),
            Column::Number("along, m"),
            Column::Number("along, shot spacings"),
            Column::Number("across, px"),
            Column::Number("across, m"),
        ],
    );
    let rows: [(&str, &Option<MisregistrationPooled>); 2] = [
        ("before", &summary.before.misregistration),
        ("after", &summary.after.misregistration),
    ];
    for (state, of) in rows {
        if let Some(of) = of {
            let spacings = of.along_rms_spacings;
            table.row(
                true,
                [
                    state.into(),
                    whole(of.pairs).into(),
                    whole(of.footprints).into(),
                    label(of.along_rms_lines, 2).into(),
                    label(of.along_rms_m, 1).into(),
                    spacings
                        .map_or_else(|| "–".to_owned(), |of| label(of, 3))
                        .into(),
                    label(of.across_rms_px, 2).into(),
                    label(of.across_rms_m, 1).into(),
                ],
            );
        }
    }
    table.finish()
}
