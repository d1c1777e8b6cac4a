//! Heights of tie points and of footprints that both images of a pair show against MOLA, before and after the
//! adjustment, as Parquet.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    GeometricProducts,
    coordinates::degrees,
    light_time, parquet,
    product::{Content, Declaration, Role, Write},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::frames::{BodyFixed, Position};
use areograph_geom::ellipsoid::Spherical;
use areograph_stages::{
    adjust::PointKind,
    check_heights::TieHeight,
    compare_pairs::{FootprintHeight, PairComparison},
};

pub(super) static TABLE: Declaration = Declaration {
    path: "height_check.parquet",
    what: "heights of tie points above the {altimeter} surface, and heights of footprints that both images of a pair show, \
           before and after the adjustment",
    readers: "scripts",
    rows: "tie points and footprints",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Ties(|path, of, geometric| {
        let table = Table::new(columns(), rows(geometric)).in_terms(&of.site.config.terms());
        parquet::write(path, &table, light_time::metadata(of.site))
    }),
    uses: &[],
};

/// Heights of one point by the images and by the altimeter.
#[derive(Clone, Copy)]
struct Heights {
    ground: Position<BodyFixed>,
    height_m: f64,
    above_m: f64,
    surface_sigma_m: Option<f64>,
    nearest_shot_m: f64,
}

impl From<&TieHeight> for Heights {
    fn from(tie: &TieHeight) -> Self {
        Self {
            ground: tie.ground,
            height_m: tie.height_m,
            above_m: tie.above_m(),
            surface_sigma_m: Some(tie.surface_sigma_m),
            nearest_shot_m: tie.nearest_shot_m,
        }
    }
}

impl From<&FootprintHeight> for Heights {
    fn from(footprint: &FootprintHeight) -> Self {
        Self {
            ground: footprint.ground,
            height_m: footprint.height_m,
            above_m: footprint.above_m(),
            surface_sigma_m: None,
            nearest_shot_m: 0.0,
        }
    }
}

/// A point that is compared before or after the adjustment.
struct Compared {
    kind: &'static str,
    id: String,
    /// Reason for rejection by the adjustment; empty if it was accepted.
    rejected: String,
    before: Option<Heights>,
    after: Option<Heights>,
}

impl Compared {
    /// The better determined of both.
    fn latest(&self) -> Option<Heights> {
        self.after.or(self.before)
    }

    fn place(&self) -> Option<Spherical> {
        Some(Spherical::from_xyz_m(&self.latest()?.ground.xyz_m))
    }
}

fn rows(geometric: &GeometricProducts) -> Vec<Compared> {
    let mut rows = ties(geometric);
    rows.extend(footprints(geometric));
    rows
}

/// Footprints by pair, profile and row.
fn footprints(geometric: &GeometricProducts) -> Vec<Compared> {
    let all = |pairs: &[PairComparison]| {
        let mut heights = BTreeMap::new();
        for (index, pair) in pairs.iter().enumerate() {
            let profiles = pair
                .footprints
                .iter()
                .flat_map(|footprints| &footprints.profiles);
            for profile in profiles {
                for footprint in &profile.heights {
                    let id = format!("{}:{}", profile.profile, footprint.row);
                    heights.insert((index, id), Heights::from(footprint));
                }
            }
        }
        heights
    };
    let before = all(geometric.pairs);
    let after = geometric
        .adjustment
        .as_ref()
        .map(|adjustment| all(adjustment.pairs));
    let after = after.unwrap_or_default();
    let both: BTreeSet<_> = before.keys().chain(after.keys()).collect();
    both.into_iter()
        .map(|key| Compared {
            kind: "footprint",
            id: key.1.clone(),
            rejected: String::new(),
            before: before.get(key).copied(),
            after: after.get(key).copied(),
        })
        .collect()
}

fn ties(geometric: &GeometricProducts) -> Vec<Compared> {
    let by_tie = |ties: &[TieHeight]| -> BTreeMap<usize, Heights> {
        ties.iter()
            .map(|height| (height.tie, Heights::from(height)))
            .collect()
    };
    let adjusted = geometric.adjustment.as_ref();
    let (before, after) = (
        by_tie(&geometric.heights.ties),
        by_tie(adjusted.map_or(&[], |adjusted| &adjusted.heights.ties)),
    );
    let rejected = adjusted
        .map_or(&[][..], |adjusted| &adjusted.adjusted.rejected)
        .iter();
    let rejected = rejected.filter(|point| point.kind == PointKind::Tie);
    let rejected: BTreeMap<usize, String> = rejected
        .map(|point| (point.index, point.reason.to_string()))
        .collect();
    let ties = geometric.ties.points.iter().enumerate();
    ties.map(|(index, tie)| Compared {
        kind: "tie",
        id: tie.id.clone(),
        rejected: rejected.get(&index).cloned().unwrap_or_default(),
        before: before.get(&index).copied(),
        after: after.get(&index).copied(),
    })
    .filter(|row| row.latest().is_some())
    .collect()
}

fn columns() -> Vec<Column<Compared>> {
    vec![
        column(
            "kind",
            Unit::None,
            "tie (a tie point) or footprint (a footprint that both images of a pair show according to the tie points)",
            |row: &Compared| row.kind.to_owned(),
        ),
        column(
            "tie",
            Unit::None,
            "identifier of the tie point, or profile and row of the footprint",
            |row: &Compared| row.id.clone(),
        ),
        column(
            "rejected",
            Unit::None,
            "reason why the adjustment rejected the tie point; empty otherwise",
            |row: &Compared| row.rejected.clone(),
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the point after the adjustment or, without an adjustment, of the intersected point, \
             degrees",
            |row: &Compared| Some(degrees(row.place()?.longitude_rad)),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the point after the adjustment or, without an adjustment, of the intersected \
             point, degrees",
            |row: &Compared| Some(degrees(row.place()?.latitude.0)),
        ),
        column(
            "nearest_shot_m",
            Unit::Metre,
            "horizontal distance to the nearest shot, metres; 0 for footprints",
            |row: &Compared| Some(row.latest()?.nearest_shot_m),
        ),
        column(
            "surface_sigma_m",
            Unit::Metre,
            "standard deviation of the {altimeter} surface at the tie point, metres; missing for footprints",
            |row: &Compared| row.latest()?.surface_sigma_m,
        ),
        column(
            "height_m",
            Unit::Metre,
            "height of the point that is intersected with the orientation from the kernels, above the ellipsoid of \
             {frame} along the radius, metres",
            |row: &Compared| Some(row.before?.height_m),
        ),
        column(
            "above_surface_m",
            Unit::Metre,
            "height of the point that is intersected with the orientation from the kernels, above the {altimeter} \
             surface (tie point) or above the footprint, metres",
            |row: &Compared| Some(row.before?.above_m),
        ),
        column(
            "adjusted_height_m",
            Unit::Metre,
            "height of the adjusted tie point, or of the footprint intersected with the adjusted orientation, above \
             the ellipsoid of {frame} along the radius, metres",
            |row: &Compared| Some(row.after?.height_m),
        ),
        column(
            "adjusted_above_surface_m",
            Unit::Metre,
            "height of the adjusted tie point above the {altimeter} surface, or of the footprint intersected with the \
             adjusted orientation above the footprint of the laser, metres",
            |row: &Compared| Some(row.after?.above_m),
        ),
    ]
}
