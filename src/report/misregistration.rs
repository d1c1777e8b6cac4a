//! Tie points, and how far footprints and tie points disagree between images: before and after the adjustment.

use std::collections::BTreeMap;

use super::{
    html::{Cell, Column, Table, counted, heading, paragraph},
    moved,
    numbers::whole,
    plots::label,
    section::Section,
};
use crate::{
    error::Result,
    geom::intersection::Unintersected,
    products::{GeometricProducts, SiteProducts},
    stages::{
        adjust::{PointKind, RejectionReason},
        compare_pairs::{FootprintsByTies, PairComparison, ProfileByTies},
        intersect::TieRejection,
    },
    units::RADIANS_PER_DEGREE,
};

/// Pairs that have a sentence of their own; tables have all.
const PAIRS_TOLD: usize = 6;

pub(super) const SECTION: Section = Section {
    title: "Tie points and misregistration",
    anchor: "tie-points-and-misregistration",
    appears: |site| site.geometric.is_some(),
    write: |site| {
        let geometric = site.geometric.iter();
        geometric.map(|geometric| write(site, geometric)).collect()
    },
};

fn write(site: &SiteProducts, geometric: &GeometricProducts) -> Result<String> {
    let pairs = BeforeAfter::all(geometric);
    let told = pairs.iter().take(PAIRS_TOLD);
    let mut html: String = told.map(|pair| paragraph(&pair.sentence())).collect();
    if pairs.is_empty() {
        html += &paragraph("No two images share tie points that could be intersected.");
    }
    html += &read(geometric);
    if !pairs.is_empty() {
        html += &geometry(&pairs);
        html += &reprojection(&pairs);
        html += &footprints(&pairs);
    }
    html += &heading(match geometric.adjustment {
        Some(_) => "Before and after on the image planes",
        None => "On the image planes",
    });
    html += &moved::figures(site, geometric)?;
    Ok(html)
}

/// A pair of images before the adjustment and, where tie points still join it, after.
pub(super) struct BeforeAfter<'a> {
    pub(super) before: &'a PairComparison,
    pub(super) after: Option<&'a PairComparison>,
    /// Whether there is an adjustment.
    adjusted: bool,
}

impl<'a> BeforeAfter<'a> {
    pub(super) fn all(geometric: &GeometricProducts<'a>) -> Vec<Self> {
        let adjusted = geometric.adjustment.map_or(&[][..], |of| of.pairs);
        let of = |before: &'a PairComparison| Self {
            before,
            after: adjusted.iter().find(|pair| pair.images == before.images),
            adjusted: geometric.adjustment.is_some(),
        };
        geometric.pairs.iter().map(of).collect()
    }

    /// The pair whose images place their tie points farthest apart along the flight before the adjustment.
    pub(super) fn worst(pairs: &[Self]) -> Option<&Self> {
        let size = |pair: &&Self| pair.before.along_track_parallax_m.abs();
        pairs.iter().max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// Both images by name.
    pub(super) fn name(&self) -> String {
        self.before.images.join(" and ")
    }

    /// Each state with its name.
    pub(super) fn states(&self) -> impl Iterator<Item = (&'static str, &'a PairComparison)> {
        let after = self.after.map(|pair| ("after", pair));
        [("before", self.before)].into_iter().chain(after)
    }

    /// How far apart the two images place the same thing, before and after.
    pub(super) fn sentence(&self) -> String {
        let (before, after) = (
            self.apart(self.before),
            self.after.map(|after| self.apart(after)),
        );
        let what = if self.by_footprints() {
            "a footprint falls"
        } else {
            "a tie point falls"
        };
        if !self.adjusted {
            return format!(
                "{}: {what} {} apart in the two images along the flight.",
                self.name(),
                before.in_words()
            );
        }
        let after = after.map_or_else(
            || "after it no tie point joins them".to_owned(),
            |after| format!("after it {}", after.in_words()),
        );
        format!(
            "{}: before the adjustment {what} {} apart in the two images along the flight; {after}.",
            self.name(),
            before.in_words()
        )
    }

    /// Whether footprints tell how far apart the images are, before and after alike; otherwise tie points do.
    fn by_footprints(&self) -> bool {
        self.states()
            .all(|(_, pair)| footprints_apart_m(pair).is_some())
    }

    /// How far apart the images of `pair`, one of the states, place the same thing.
    fn apart(&self, pair: &PairComparison) -> Apart {
        let by_footprints_m = footprints_apart_m(pair).filter(|_| self.by_footprints());
        let metres = by_footprints_m.unwrap_or(pair.along_track_parallax_m);
        Apart {
            metres,
            spacings: pair.mola_spacing_m.map(|spacing_m| metres / spacing_m),
        }
    }
}

/// How far apart along the flight two images place the same thing.
struct Apart {
    /// Metres on the ground, without sign.
    metres: f64,
    /// The same in distances of successive footprints.
    spacings: Option<f64>,
}

impl Apart {
    fn in_words(&self) -> String {
        let metres = label(self.metres, usize::from(self.metres < 10.0));
        self.spacings.map_or_else(
            || format!("{metres} m"),
            |spacings| {
                let decimals = if spacings < 0.1 { 3 } else { 2 };
                format!("{} MOLA spacings ({metres} m)", label(spacings, decimals))
            },
        )
    }
}

/// Mean size over all footprints that both images of `pair` show, metres; `None` where there are none.
fn footprints_apart_m(pair: &PairComparison) -> Option<f64> {
    let profiles = pair.footprints.iter().flat_map(|found| &found.profiles);
    let (mut shots, mut metres) = (0.0, 0.0);
    for profile in profiles {
        shots += f64::from(profile.lines.n);
        metres += f64::from(profile.lines.n) * profile.along_m.abs();
    }
    (shots > 0.0).then(|| metres / shots)
}

/// How many tie points there are, and which say nothing.
fn read(geometric: &GeometricProducts) -> String {
    let ties = geometric.ties;
    let points = &geometric.intersected.points;
    let elsewhere: u64 = ties.elsewhere.values().sum();
    let outliers = points.iter().filter(|point| point.outlier).count();
    let adjusted = geometric.adjustment.map_or_else(
        || "; the adjustment failed".to_owned(),
        |of| format!(", {} with the adjusted one", of.intersected.points.len()),
    );
    let mut words = format!(
        "{} read, {} of them measured in at least two images; {} have a ground point with the orientation of the \
         kernels{adjusted}.",
        counted(ties.points.len(), "tie point"),
        ties.multi_image(),
        points.len(),
    );
    for (count, what) in [
        (
            elsewhere,
            "measurements are in images that the site does not have.",
        ),
        (
            ties.ignored,
            "measurements or points are marked to be ignored.",
        ),
        (ties.complaint_count, "records could not be read."),
    ] {
        if count > 0 {
            words += &format!(" {count} {what}");
        }
    }
    if outliers > 0 {
        words += &format!(
            " {outliers} are outliers by their reprojection residuals and do not count in the statistics of pairs."
        );
    }
    paragraph(&words) + &rejected(geometric)
}

/// Tie points by the reason that they were left out for.
fn rejected(geometric: &GeometricProducts) -> String {
    let mut reasons: BTreeMap<(&str, &str), u64> = BTreeMap::new();
    for tie in &geometric.intersected.rejected {
        *reasons
            .entry(("intersection", rejection(tie.reason)))
            .or_insert(0) += 1;
    }
    let ties = geometric.adjustment.iter();
    let ties = ties.flat_map(|of| &of.adjusted.rejected);
    for tie in ties.filter(|left| left.kind == PointKind::Tie) {
        let reason = match tie.reason {
            // The intersection has said why.
            RejectionReason::NotIntersected => continue,
            RejectionReason::Undetermined => "not determined",
            RejectionReason::Blunder { .. } => "blunder: its standardised residual is too large",
            RejectionReason::Height { .. } => {
                "blunder: no ground explains its height above the MOLA surface"
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

/// A reason without the numbers of a single tie point.
const fn rejection(reason: TieRejection) -> &'static str {
    match reason {
        TieRejection::Rays(rays) => match rays {
            Unintersected::FewRays { .. } => "measured in one image only",
            Unintersected::NearParallel { .. } => "rays too close to parallel",
            Unintersected::IllConditioned => "rays do not determine the point",
            Unintersected::BehindCamera { .. } => "rays meet behind a camera",
            Unintersected::Height { .. } => "rays meet far from the ellipsoid",
            Unintersected::NotConverged => "the iteration did not converge",
        },
        TieRejection::Unseen => "an image does not see the intersected point",
        TieRejection::Duplicate => "identifier used before",
        TieRejection::TwiceInImage => "measured twice in one image",
        TieRejection::OutsideImage => "measured outside its image",
        TieRejection::NotFinite => "measurement not a finite number",
    }
}

fn geometry(pairs: &[BeforeAfter]) -> String {
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
            let numbers = [
                (found.convergence_rad / RADIANS_PER_DEGREE, 2),
                (found.height_over_base, 2),
                (found.line_spacing_m[0], 3),
                (found.line_spacing_m[1], 3),
                (found.along_track_parallax_m, 2),
            ];
            let mut cells: Vec<Cell> =
                vec![pair.name().into(), state.into(), whole(found.ties).into()];
            cells.extend(numbers.map(|(value, decimals)| label(value, decimals).into()));
            table.row(true, cells);
        }
    }
    table.finish()
}

fn reprojection(pairs: &[BeforeAfter]) -> String {
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
            let mut cells: Vec<Cell> =
                vec![pair.name().into(), state.into(), whole(found.ties).into()];
            for of in &found.residuals {
                let moments = [of.mean_x, of.deviation_x, of.mean_y, of.deviation_y];
                cells.extend(moments.map(|value| label(value, 2).into()));
            }
            table.row(true, cells);
        }
    }
    let words = "Measured minus projected: M mean, σ standard deviation; x along track, y across it and against the samples; 1 and \
                 2 as in the pair's name.";
    table.finish() + &paragraph(words)
}

fn footprints(pairs: &[BeforeAfter]) -> String {
    let mut table = Table::new(
        "Footprints between the images, by tie points; positive along track",
        &[
            Column::Text("profile"),
            Column::Text("pair"),
            Column::Number("footprints"),
            Column::Number("lines, before"),
            Column::Number("after"),
            Column::Number("metres, before"),
            Column::Number("after"),
            Column::Number("MOLA spacings, before"),
            Column::Number("after"),
            Column::Number("samples, before"),
            Column::Number("after"),
        ],
    );
    let mut notes = String::new();
    for pair in pairs {
        let Some(found) = &pair.before.footprints else {
            notes += &paragraph(&format!(
                "{}: tie points do not determine a transformation between the images.",
                pair.name()
            ));
            continue;
        };
        let after = pair.after.and_then(|after| after.footprints.as_ref());
        for profile in &found.profiles {
            let after = after.and_then(|after| {
                let mut profiles = after.profiles.iter();
                profiles.find(|other| other.profile == profile.profile)
            });
            table.row(true, profile_cells(&pair.name(), profile, after));
        }
        notes += &paragraph(&format!(
            "{}: from the first image to the second by a polynomial of order {} through {} tie points ({} rejected); standard \
             deviation {} lines, {} samples.",
            pair.name(),
            found.order,
            found.ties,
            found.ties_rejected,
            label(found.tie_lines.standard_deviation, 2),
            label(found.tie_samples.standard_deviation, 2)
        ));
        notes += &paragraph(&not_counted(found));
        if let Some(spacing_m) = pair.before.mola_spacing_m {
            notes += &paragraph(&format!("One MOLA spacing: {} m.", label(spacing_m, 1)));
        }
    }
    notes += &paragraph("Samples also contain the parallax of relief.");
    table.finish() + &notes
}

/// Which footprints are not in the table.
fn not_counted(found: &FootprintsByTies) -> String {
    let none = if found.profiles.is_empty() {
        "No footprint is shown by both images: the tie points alone tell how far apart they are. "
    } else {
        ""
    };
    format!(
        "{none}Footprints count where both images show them, between the first and last line of the tie points ({} outside).",
        whole(found.outside)
    )
}

fn profile_cells(pair: &str, before: &ProfileByTies, after: Option<&ProfileByTies>) -> Vec<Cell> {
    let dash = || Cell::from("–");
    let mut cells = vec![
        (&before.profile).into(),
        pair.into(),
        whole(before.lines.n).into(),
    ];
    let quantities: [fn(&ProfileByTies) -> Option<String>; 4] = [
        |of| Some(label(of.lines.mean, 2)),
        |of| Some(label(of.along_m, 1)),
        |of| Some(label(of.along_spacings?, 3)),
        |of| Some(label(of.samples.mean, 2)),
    ];
    for quantity in quantities {
        cells.push(quantity(before).map_or_else(dash, Cell::from));
        cells.push(after.and_then(quantity).map_or_else(dash, Cell::from));
    }
    cells
}
