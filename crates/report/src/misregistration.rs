//! Tie points, and disagreement of footprints and tie points between images: before and after the adjustment.

mod pair;

use std::collections::BTreeMap;

use super::{
    html::{Cell, Column, Markup, Table, counted, folded, html, paragraph},
    moved,
    numbers::whole,
    plots::label,
    section::Section,
    source::traced,
};
use areograph_base::{error::Result, units::RADIANS_PER_DEGREE, verdict::CheckKind};
use areograph_geom::intersection::Unintersected;
use areograph_products::{GeometricProducts, SiteProducts};
use areograph_stages::{
    adjust::{PointKind, RejectionReason},
    compare_pairs::{FootprintsByTies, ProfileByTies},
    intersect::TieRejection,
};

/// Number of pairs with a sentence each; tables have all.
const PAIRS_SHOWN: usize = 6;

pub(super) use pair::{BeforeAfter, PAIRS_TABLED, by_footprints};

pub(super) const SECTION: Section = Section {
    title: "Tie points and misregistration",
    anchor: "tie-points-and-misregistration",
    checks: &[CheckKind::ParallaxAfter, CheckKind::ParallaxBefore],
    appears: |site| site.geometric.is_some(),
    write: |site| {
        let geometric = site.geometric.as_ref();
        let written = geometric.map(|geometric| write(site, geometric));
        Ok(written.transpose()?.unwrap_or_default())
    },
};

fn write(site: &SiteProducts, geometric: &GeometricProducts) -> Result<Markup> {
    let pairs = BeforeAfter::all(geometric);
    let sentences = pairs.iter().take(PAIRS_SHOWN).map(BeforeAfter::sentence);
    let sentences: Vec<String> = sentences.collect();
    let pairs = BeforeAfter::tabled(pairs);
    Ok(html! {
        @for sentence in sentences { p { (sentence) } }
        @if pairs.is_empty() { p { "No two images share tie points that could be intersected." } }
        (read(geometric))
        @if !pairs.is_empty() {
            (folded("Tables of the pairs", &html! {
                (BeforeAfter::some_of_all(geometric))
                (geometry(&pairs))
                (reprojection(&pairs))
                (footprints(&pairs))
            }))
        }
        @if geometric.adjustment.is_some() {
            h3 { "Before and after on the image planes" }
        } @else {
            h3 { "On the image planes" }
        }
        (moved::figures(site, geometric)?)
    })
}

/// Number of tie points, and of those without information.
fn read(geometric: &GeometricProducts) -> Markup {
    let ties = geometric.ties;
    let points = &geometric.intersected.points;
    let elsewhere: u64 = ties.elsewhere.values().sum();
    let outliers = points.iter().filter(|point| point.outlier).count();
    let adjusted = geometric.adjustment;
    let adjusted = adjusted.map(|adjustment| adjustment.intersected.points.len().to_string());
    let counts = [
        (
            elsewhere,
            "measurements are in images that the site does not contain.",
        ),
        (ties.ignored, "measurements are marked to be ignored."),
        (ties.complaint_count, "records could not be read."),
    ];
    html! {
        p {
            (traced(&counted(ties.points.len(), "tie point"), "adjustment.json#/ties/points")) " read, "
            (traced(&ties.multi_image().to_string(), "adjustment.json#/ties/multi_image")) " in two or more images; "
            (traced(&points.len().to_string(), "adjustment.json#/before/intersected"))
            " intersect with the orientation from the kernels"
            @if let Some(number) = adjusted {
                ", " (traced(&number, "adjustment.json#/after/intersected")) " with the adjusted orientation."
            } @else {
                "; the adjustment failed."
            }
            @for (count, what) in counts { @if count > 0 { " " (count) " " (what) } }
            @if outliers > 0 {
                " " (traced(&counted(outliers, "reprojection outlier"), "adjustment.json#/before/outliers"))
                ", excluded from the pair statistics."
            }
        }
        (rejected(geometric))
    }
}

/// Tie points by the reason for their rejection.
fn rejected(geometric: &GeometricProducts) -> Markup {
    let mut reasons: BTreeMap<(&str, &str), u64> = BTreeMap::new();
    for tie in &geometric.intersected.rejected {
        *reasons
            .entry(("intersection", rejection(tie.reason)))
            .or_insert(0) += 1;
    }
    let ties = geometric.adjustment.iter();
    let ties = ties.flat_map(|adjustment| &adjustment.adjusted.rejected);
    for tie in ties.filter(|left| left.kind == PointKind::Tie) {
        let reason = match tie.reason {
            // The intersection has given the reason.
            RejectionReason::NotIntersected => continue,
            RejectionReason::Undetermined => "not determined",
            RejectionReason::Blunder { .. } => "blunder: standardised residual too large",
            RejectionReason::Height { .. } => {
                "blunder: relief does not explain the height above the laser surface"
            }
        };
        *reasons.entry(("adjustment", reason)).or_insert(0) += 1;
    }
    if reasons.is_empty() {
        return paragraph("No tie point was rejected.");
    }
    let columns = &[
        Column::Text("rejected by"),
        Column::Number("tie points"),
        Column::Text("reason"),
    ];
    let mut table = Table::new("Rejected tie points", columns);
    for ((of, reason), count) in reasons {
        table.row(true, [of.into(), whole(count).into(), reason.into()]);
    }
    table.finish()
}

/// A reason without the values of a single tie point.
const fn rejection(reason: TieRejection) -> &'static str {
    match reason {
        TieRejection::Rays(rays) => match rays {
            Unintersected::FewRays { .. } => "measured in one image only",
            Unintersected::NearParallel { .. } => "rays too close to parallel",
            Unintersected::IllConditioned => "rays do not determine the point",
            Unintersected::BehindCamera { .. } => "rays intersect behind a camera",
            Unintersected::Height { .. } => "rays intersect far from the ellipsoid",
            Unintersected::NotConverged => "the iteration did not converge",
        },
        TieRejection::Unseen => "an image does not show the intersected point",
        TieRejection::Duplicate => "duplicate identifier",
        TieRejection::TwiceInImage => "measured twice in one image",
        TieRejection::OutsideImage => "measured outside its image",
        TieRejection::NotFinite => "measurement is not a finite number",
    }
}

fn geometry(pairs: &[BeforeAfter]) -> Markup {
    let mut table = Table::new(
        "Pairs of images",
        &[
            Column::Text("pair"),
            Column::Text("adjustment"),
            Column::Number("tie points"),
            Column::Number("convergence, degrees"),
            Column::Number("H/B"),
            Column::Number("line spacing 1, m"),
            Column::Number("line spacing 2, m"),
            Column::Number("along-track parallax of tie points, m"),
        ],
    );
    for pair in pairs {
        for (state, found) in pair.states() {
            let degrees = format!("/convergence_rad*{}", RADIANS_PER_DEGREE.recip());
            let numbers = [
                (found.convergence_rad / RADIANS_PER_DEGREE, 2, &*degrees),
                (found.height_over_base, 2, "/height_over_base"),
                (found.line_spacing_m[0], 3, "/line_spacing_m/0"),
                (found.line_spacing_m[1], 3, "/line_spacing_m/1"),
                (found.along_track_parallax_m, 2, "/along_track_parallax_m"),
            ];
            let mut cells = pair.head(state, found);
            cells.extend(
                numbers.map(|(value, decimals, place)| {
                    Cell::from(label(value, decimals)).traced(place)
                }),
            );
            table.row_of(&pair.place(state), true, cells);
        }
    }
    table.finish()
}

fn reprojection(pairs: &[BeforeAfter]) -> Markup {
    let mut table = Table::new(
        "Reprojection residuals of tie points (Table 5 of Shan et al. 2005), x in lines, y in pixels",
        &[
            Column::Text("pair"),
            Column::Text("adjustment"),
            Column::Number("tie points"),
            Column::Number("M x1"),
            Column::Number("σ x1"),
            Column::Number("M y1"),
            Column::Number("σ y1"),
            Column::Number("M x2"),
            Column::Number("σ x2"),
            Column::Number("M y2"),
            Column::Number("σ y2"),
        ],
    );
    for pair in pairs {
        for (state, found) in pair.states() {
            let mut cells = pair.head(state, found);
            for (image, of) in found.residuals.iter().enumerate() {
                let moments = [
                    (of.mean_x, "mean_x"),
                    (of.deviation_x, "deviation_x"),
                    (of.mean_y, "mean_y"),
                    (of.deviation_y, "deviation_y"),
                ];
                cells.extend(moments.map(|(value, name)| {
                    Cell::from(label(value, 2)).traced(format!("/residuals/{image}/{name}"))
                }));
            }
            table.row_of(&pair.place(state), true, cells);
        }
    }
    let words = "Measured minus projected: M mean, σ standard deviation; x along track, y across (opposite to the samples).";
    html! { (table.finish()) p { (words) } }
}

fn footprints(pairs: &[BeforeAfter]) -> Markup {
    let mut table = Table::new(
        "Misregistration of footprints according to tie points; lines are positive along track; samples include \
         relief parallax",
        &[
            Column::Text("profile"),
            Column::Text("pair"),
            Column::Number("footprints"),
            Column::Number("lines, before"),
            Column::Number("after"),
            Column::Number("metres, before"),
            Column::Number("after"),
            Column::Number("σ, m, before"),
            Column::Number("after"),
            Column::Number("shot spacings, before"),
            Column::Number("after"),
            Column::Number("samples, before"),
            Column::Number("after"),
        ],
    );
    let mut notes = Vec::new();
    for pair in pairs {
        let Some(found) = &pair.before.footprints else {
            notes.push(format!(
                "{}: tie points do not determine a transformation between the images.",
                pair.name()
            ));
            continue;
        };
        let after = pair.after.and_then(|after| after.footprints.as_ref());
        for (index, profile) in found.profiles.iter().enumerate() {
            let after = after.and_then(|after| {
                let same = |other: &ProfileByTies| other.profile == profile.profile;
                let index = after.profiles.iter().position(same)?;
                Some((index, &after.profiles[index]))
            });
            let cells = profile_cells(pair, (index, profile), after);
            table.row(true, cells);
        }
        let spacing = pair.before.mola_spacing_m;
        let spacing = spacing.map(|metres| format!(" One shot spacing: {} m.", label(metres, 1)));
        notes.push(format!(
            "{}: polynomial of order {} through {} tie points ({} rejected), σ {} lines and {} samples. {}{}",
            pair.name(),
            found.order,
            found.ties,
            found.ties_rejected,
            label(found.tie_lines.standard_deviation, 2),
            label(found.tie_samples.standard_deviation, 2),
            not_counted(found),
            spacing.unwrap_or_default()
        ));
    }
    html! { (table.finish()) @for note in notes { p { (note) } } }
}

/// Footprints omitted from the table.
fn not_counted(found: &FootprintsByTies) -> String {
    let none = if found.profiles.is_empty() {
        "No footprint is in both images. "
    } else {
        ""
    };
    format!(
        "{none}{} omitted: outside an image or the tie-point area.",
        counted(found.outside as usize, "footprint")
    )
}

/// Place of a number of a profile in the products, and its format on a page.
type Quantity = (&'static str, fn(&ProfileByTies) -> Option<String>);

/// A profile by its place among the profiles of the pair, before and after.
fn profile_cells(
    pair: &BeforeAfter,
    before: (usize, &ProfileByTies),
    after: Option<(usize, &ProfileByTies)>,
) -> Vec<Cell> {
    let mut cells = vec![
        (&before.1.profile).into(),
        pair.name().into(),
        pair.traced("before", before.0, "lines/n", whole(before.1.lines.n)),
    ];
    let quantities: [Quantity; 5] = [
        ("lines/mean", |of| Some(label(of.lines.mean, 2))),
        ("along_m", |of| Some(label(of.along_m, 1))),
        ("along_sigma_m", |of| Some(label(of.along_sigma_m, 1))),
        ("along_spacings", |of| Some(label(of.along_spacings?, 3))),
        ("samples/mean", |of| Some(label(of.samples.mean, 2))),
    ];
    for (name, quantity) in quantities {
        for (state, of) in [("before", Some(before)), ("after", after)] {
            let cell = of.map(|(index, of)| {
                let text = quantity(of).unwrap_or_else(|| "–".to_owned());
                pair.traced(state, index, name, text)
            });
            cells.push(cell.unwrap_or_else(|| "–".into()));
        }
    }
    cells
}
