//! Heights of tie points against the MOLA surface, before and after the adjustment, as Parquet.

use std::collections::BTreeMap;

use super::{
    GeometricProducts,
    coordinates::degrees,
    light_time, parquet,
    product::{Content, Declaration, Role, Write},
    table::{Column, Table, Unit, column, meanings},
};
use crate::{
    geom::ellipsoid::Spherical,
    stages::{adjust::PointKind, check_heights::TieHeight},
};

pub(super) static TABLE: Declaration = Declaration {
    path: "height_check.parquet",
    what: "heights of tie points against the ground between MOLA's shots, before and after the adjustment",
    readers: "scripts",
    rows: "tie points",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Ties(|path, of, geometric| {
        let table = Table::new(columns(), rows(geometric));
        parquet::write(path, table, light_time::metadata(of.site))
    }),
    uses: &[],
};

/// A tie point that is compared before or after the adjustment.
struct Compared<'a> {
    id: &'a str,
    /// Why the adjustment rejected it; empty when it did not.
    rejected: String,
    before: Option<&'a TieHeight>,
    after: Option<&'a TieHeight>,
}

impl Compared<'_> {
    /// The better known of both.
    fn latest(&self) -> Option<&TieHeight> {
        self.after.or(self.before)
    }

    fn place(&self) -> Option<Spherical> {
        Some(Spherical::from_xyz_m(&self.latest()?.ground.xyz_m))
    }
}

fn rows<'a>(geometric: &GeometricProducts<'a>) -> Vec<Compared<'a>> {
    let by_tie = |ties: &'a [TieHeight]| -> BTreeMap<usize, &'a TieHeight> {
        ties.iter().map(|height| (height.tie, height)).collect()
    };
    let adjusted = geometric.adjustment.as_ref();
    let (before, after) = (
        by_tie(&geometric.heights.ties),
        by_tie(adjusted.map_or(&[], |of| &of.heights.ties)),
    );
    let rejected = adjusted.map_or(&[][..], |of| &of.adjusted.rejected).iter();
    let rejected = rejected.filter(|point| point.kind == PointKind::Tie);
    let rejected: BTreeMap<usize, String> = rejected
        .map(|point| (point.index, point.reason.to_string()))
        .collect();
    let ties = geometric.ties.points.iter().enumerate();
    ties.map(|(index, tie)| Compared {
        id: &tie.id,
        rejected: rejected.get(&index).cloned().unwrap_or_default(),
        before: before.get(&index).copied(),
        after: after.get(&index).copied(),
    })
    .filter(|row| row.latest().is_some())
    .collect()
}

fn columns<'a>() -> Vec<Column<Compared<'a>>> {
    vec![
        column(
            "tie",
            Unit::None,
            "identifier of the tie point",
            |row: &Compared| row.id.to_owned(),
        ),
        column(
            "rejected",
            Unit::None,
            "why the adjustment rejected the tie point; empty when it did not",
            |row: &Compared| row.rejected.clone(),
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, degrees: of the adjusted point, or of the intersected one where there is none",
            |row: &Compared| Some(degrees(row.place()?.longitude_rad)),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude likewise, degrees",
            |row: &Compared| Some(degrees(row.place()?.latitude.0)),
        ),
        column(
            "nearest_shot_m",
            Unit::Metre,
            "distance of the nearest shot in plan, metres",
            |row: &Compared| Some(row.latest()?.nearest_shot_m),
        ),
        column(
            "surface_sigma_m",
            Unit::Metre,
            "standard deviation of the MOLA surface there, metres",
            |row: &Compared| Some(row.latest()?.surface_sigma_m),
        ),
        column(
            "height_m",
            Unit::Metre,
            "height of the intersected point above the ellipsoid of IAU 2000 along the radius, metres",
            |row: &Compared| Some(row.before?.height_m),
        ),
        column(
            "above_surface_m",
            Unit::Metre,
            "the same above the MOLA surface, metres",
            |row: &Compared| Some(row.before?.above_m()),
        ),
        column(
            "adjusted_height_m",
            Unit::Metre,
            "height of the adjusted point above the ellipsoid, metres",
            |row: &Compared| Some(row.after?.height_m),
        ),
        column(
            "adjusted_above_surface_m",
            Unit::Metre,
            "the same above the MOLA surface, metres",
            |row: &Compared| Some(row.after?.above_m()),
        ),
    ]
}
