//! Tie points as Parquet: every measurement with its ground point and its residuals, before and after the
//! adjustment; and the footprints that took part in it.

use std::collections::BTreeMap;

use super::{
    GeometricProducts, SiteProducts, Writer,
    coordinates::degrees,
    parquet,
    table::{Column, Table, Values},
};
use crate::{
    error::Result,
    geom::ellipsoid::Spherical,
    stages::{
        adjust::{CorrectedPoint, ImageResidual, PointKind, RangeResidual},
        intersect::{IntersectedPoint, IntersectedTies, MeasureResidual},
    },
};

/// Writes the tables of a site with tie points.
pub(super) fn write(
    written: &mut Writer,
    site: &SiteProducts,
    geometric: &GeometricProducts,
) -> Result<()> {
    let table = Table::new(tie_columns(&measurements(site, geometric)))?;
    written.add("ties.parquet", |path| {
        parquet::write(path, &table, Vec::new())
    })?;
    let table = Table::new(shot_columns(&shots(geometric)))?;
    written.add("adjusted_footprints.parquet", |path| {
        parquet::write(path, &table, Vec::new())
    })
}

/// All that is known of one measurement.
struct Measurement<'a> {
    id: &'a str,
    image: &'a str,
    line: f64,
    sample: f64,
    /// Empty for a tie point that took part in the adjustment, else why not.
    left_out: String,
    before: Option<(&'a IntersectedPoint, &'a MeasureResidual)>,
    after: Option<(&'a IntersectedPoint, &'a MeasureResidual)>,
    adjusted: Option<(&'a CorrectedPoint, &'a ImageResidual)>,
}

/// Intersected points by the indices of their tie points.
fn by_tie(ties: &IntersectedTies) -> BTreeMap<usize, &IntersectedPoint> {
    ties.points.iter().map(|point| (point.tie, point)).collect()
}

fn measurements<'a>(
    site: &SiteProducts<'a>,
    geometric: &GeometricProducts<'a>,
) -> Vec<Measurement<'a>> {
    let adjusted = geometric.adjusted;
    let ties = (0_usize..).zip(&adjusted.points);
    let ties = ties.filter(|(_, point)| point.kind == PointKind::Tie);
    let points: BTreeMap<usize, (usize, &CorrectedPoint)> = ties
        .map(|(index, point)| (point.index, (index, point)))
        .collect();
    let views: BTreeMap<(usize, usize), &ImageResidual> = adjusted
        .views
        .iter()
        .map(|view| ((view.point, view.image), view))
        .collect();
    let before = by_tie(geometric.intersected);
    let after = by_tie(geometric.adjusted_intersected);
    let reasons = reasons(geometric);
    let mut found = Vec::new();
    for (index, tie) in geometric.ties.points.iter().enumerate() {
        let (before, after) = (before.get(&index), after.get(&index));
        let point = points.get(&index);
        for measure in &tie.measures {
            let seen = |point: Option<&&'a IntersectedPoint>| {
                let own = |residual: &&MeasureResidual| residual.image == measure.image;
                let point = *point?;
                Some((point, point.measures.iter().find(own)?))
            };
            let view = point.and_then(|(index, point)| {
                let view = views.get(&(*index, measure.image)).copied()?;
                Some((*point, view))
            });
            let left_out = if view.is_some() {
                String::new()
            } else {
                reasons.get(&index).cloned().unwrap_or_default()
            };
            found.push(Measurement {
                id: &tie.id,
                image: &site.images[measure.image].times.id,
                line: measure.line,
                sample: measure.sample,
                left_out,
                before: seen(before),
                after: seen(after),
                adjusted: view,
            });
        }
    }
    found
}

/// Why tie points were left out; what the intersection says of a point comes first.
fn reasons(geometric: &GeometricProducts) -> BTreeMap<usize, String> {
    let adjusted = geometric.adjusted.left_out.iter();
    let ties = adjusted.filter(|point| point.kind == PointKind::Tie);
    let rejected = geometric.intersected.rejected.iter();
    let rejected = rejected.map(|tie| (tie.tie, tie.reason.to_string()));
    let ties = ties.map(|point| (point.index, point.reason.to_string()));
    let mut reasons = BTreeMap::new();
    for (tie, reason) in rejected.chain(ties) {
        reasons.entry(tie).or_insert(reason);
    }
    reasons
}

fn tie_columns(rows: &[Measurement]) -> Vec<Column> {
    let mut columns = measured_columns(rows);
    columns.extend(intersected_columns(rows));
    columns.extend(adjusted_columns(rows));
    columns
}

/// A column of what is not known of every measurement.
fn known(
    rows: &[Measurement],
    name: &'static str,
    description: &'static str,
    of: fn(&Measurement) -> Option<f64>,
) -> Column {
    let values = rows.iter().map(of).collect();
    Column::new(name, description, Values::OptionalF64(values))
}

fn measured_columns(rows: &[Measurement]) -> Vec<Column> {
    let text = |name, description, of: for<'a> fn(&Measurement<'a>) -> &'a str| {
        let values = rows.iter().map(|row| of(row).to_owned()).collect();
        Column::new(name, description, Values::Text(values))
    };
    let number = |name, description, of: fn(&Measurement) -> f64| {
        Column::new(
            name,
            description,
            Values::F64(rows.iter().map(of).collect()),
        )
    };
    vec![
        text("tie", "identifier of the tie point", |row| row.id),
        text("image", "image identifier", |row| row.image),
        number(
            "line",
            "measured line, 0 at the start of the first line of the header image, 0.5 at its centre",
            |row| row.line,
        ),
        number(
            "sample",
            "measured sample, 0 at the outer edge of the first pixel, 0.5 at its centre",
            |row| row.sample,
        ),
        Column::new(
            "left_out",
            "why the tie point took no part in the adjustment; empty when it did",
            Values::Text(rows.iter().map(|row| row.left_out.clone()).collect()),
        ),
    ]
}

fn intersected_columns(rows: &[Measurement]) -> Vec<Column> {
    let known = |name, description, of| known(rows, name, description, of);
    vec![
        known(
            "x_m",
            "intersected point with the orientation of the kernels, IAU 2000, metres",
            |row| Some(row.before?.0.ground.xyz_m[0]),
        ),
        known("y_m", "likewise", |row| Some(row.before?.0.ground.xyz_m[1])),
        known("z_m", "likewise", |row| Some(row.before?.0.ground.xyz_m[2])),
        known(
            "convergence_deg",
            "angle between the two rays that differ most, degrees",
            |row| Some(degrees(row.before?.0.convergence_rad)),
        ),
        known(
            "focal_along_px",
            "what the intersection leaves in the focal plane along the track, image pixels",
            |row| Some(row.before?.1.focal_along_px),
        ),
        known("focal_across_px", "the same across the track", |row| {
            Some(row.before?.1.focal_across_px)
        }),
        known(
            "reprojection_lines",
            "measured minus projected line of the intersected point (Table 5 of Shan et al. 2005)",
            |row| Some(row.before?.1.reprojection_lines),
        ),
        known(
            "reprojection_px",
            "measured minus projected focal coordinate across the track, image pixels",
            |row| Some(row.before?.1.reprojection_px),
        ),
    ]
}

fn adjusted_columns(rows: &[Measurement]) -> Vec<Column> {
    let known = |name, description, of| known(rows, name, description, of);
    vec![
        known("adjusted_x_m", "adjusted point, IAU 2000, metres", |row| {
            Some(row.adjusted?.0.ground.xyz_m[0])
        }),
        known("adjusted_y_m", "likewise", |row| {
            Some(row.adjusted?.0.ground.xyz_m[1])
        }),
        known("adjusted_z_m", "likewise", |row| {
            Some(row.adjusted?.0.ground.xyz_m[2])
        }),
        known(
            "adjusted_longitude_deg",
            "east longitude of the adjusted point, degrees",
            |row| Some(degrees(spherical(row.adjusted?.0).longitude_rad)),
        ),
        known(
            "adjusted_latitude_deg",
            "areocentric latitude of the adjusted point, degrees",
            |row| Some(degrees(spherical(row.adjusted?.0).latitude.0)),
        ),
        known(
            "adjusted_radius_m",
            "distance of the adjusted point from the centre of Mars, metres",
            |row| Some(spherical(row.adjusted?.0).radius_m),
        ),
        known(
            "sigma_x_m",
            "standard deviation of adjusted_x_m, metres: formal, and too small for the absolute position",
            |row| Some(sigma_m(row.adjusted?.0, 0)),
        ),
        known("sigma_y_m", "likewise", |row| {
            Some(sigma_m(row.adjusted?.0, 1))
        }),
        known("sigma_z_m", "likewise", |row| {
            Some(sigma_m(row.adjusted?.0, 2))
        }),
        known(
            "residual_along_px",
            "observed minus adjusted along the track, focal plane, image pixels",
            |row| Some(row.adjusted?.1.along_px.value),
        ),
        known("residual_across_px", "the same across the track", |row| {
            Some(row.adjusted?.1.across_px.value)
        }),
        known(
            "redundancy_along",
            "share of an error of the measurement along the track that shows in its residual, 0 to 1",
            |row| Some(row.adjusted?.1.along_px.redundancy),
        ),
        known("redundancy_across", "the same across the track", |row| {
            Some(row.adjusted?.1.across_px.redundancy)
        }),
        known(
            "standardised_along",
            "residual along the track over its own standard deviation; missing where nothing controls it",
            |row| row.adjusted?.1.along_px.standardised,
        ),
        known("standardised_across", "the same across the track", |row| {
            row.adjusted?.1.across_px.standardised
        }),
        known(
            "adjusted_reprojection_lines",
            "as reprojection_lines, with the adjusted orientation",
            |row| Some(row.after?.1.reprojection_lines),
        ),
        known(
            "adjusted_reprojection_px",
            "as reprojection_px, with the adjusted orientation",
            |row| Some(row.after?.1.reprojection_px),
        ),
    ]
}

fn spherical(point: &CorrectedPoint) -> Spherical {
    Spherical::from_xyz_m(&point.ground.xyz_m)
}

fn sigma_m(point: &CorrectedPoint, axis: usize) -> f64 {
    point.covariance_m2[(axis, axis)].sqrt()
}

/// A footprint that took part, with its range.
type Shot<'a> = (&'a CorrectedPoint, Option<&'a RangeResidual>);

fn shots<'a>(geometric: &GeometricProducts<'a>) -> Vec<Shot<'a>> {
    let adjusted = geometric.adjusted;
    let ranges: BTreeMap<usize, &RangeResidual> = adjusted
        .ranges
        .iter()
        .map(|range| (range.point, range))
        .collect();
    let points = adjusted.points.iter().enumerate();
    points
        .filter(|(_, point)| point.kind == PointKind::Shot)
        .map(|(index, point)| (point, ranges.get(&index).copied()))
        .collect()
}

fn shot_columns(rows: &[Shot]) -> Vec<Column> {
    let number = |name, description, of: &dyn Fn(&CorrectedPoint) -> f64| {
        let values = rows.iter().map(|(point, _)| of(point)).collect();
        Column::new(name, description, Values::F64(values))
    };
    let range = |name, description, of: fn(&RangeResidual) -> Option<f64>| {
        let values = rows.iter().map(|(_, range)| range.and_then(of)).collect();
        Column::new(name, description, Values::OptionalF64(values))
    };
    let ids = rows.iter().map(|(point, _)| point.id.clone()).collect();
    let mut columns = vec![Column::new(
        "footprint",
        "profile and, after the last colon, row of the footprint in footprints.parquet, counted from 0",
        Values::Text(ids),
    )];
    for (axis, [initial, adjusted, sigma]) in [
        ["x_m", "adjusted_x_m", "sigma_x_m"],
        ["y_m", "adjusted_y_m", "sigma_y_m"],
        ["z_m", "adjusted_z_m", "sigma_z_m"],
    ]
    .into_iter()
    .enumerate()
    {
        columns.push(number(initial, "footprint, IAU 2000, metres", &|point| {
            point.initial.xyz_m[axis]
        }));
        columns.push(number(
            adjusted,
            "adjusted footprint, IAU 2000, metres",
            &|point| point.ground.xyz_m[axis],
        ));
        columns.push(number(
            sigma,
            "standard deviation of the adjusted coordinate, metres",
            &|point| sigma_m(point, axis),
        ));
    }
    columns.extend([
        range(
            "range_m",
            "measured range, metres; missing when no image was exposed meanwhile",
            |range| Some(range.range_m),
        ),
        range(
            "range_residual_m",
            "measured minus adjusted range, metres",
            |range| Some(range.residual_m.value),
        ),
        range(
            "range_redundancy",
            "share of an error of the range that shows in its residual, 0 to 1",
            |range| Some(range.residual_m.redundancy),
        ),
        range(
            "range_standardised",
            "residual over its own standard deviation; missing where nothing controls it",
            |range| range.residual_m.standardised,
        ),
    ]);
    columns
}
