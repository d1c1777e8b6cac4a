//! Tie points as Parquet: every measurement with its ground point and its residuals, before and after the
//! adjustment.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::{
    GeometricProducts, SiteProducts,
    coordinates::degrees,
    light_time, parquet,
    product::{Content, Declaration, Role, Write},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_geom::ellipsoid::{Spherical, local_axes};
use areograph_stages::{
    adjust::{CorrectedPoint, ImageResidual, PointKind},
    intersect::{IntersectedPoint, IntersectedTies, MeasureResidual},
};

pub(super) static TABLE: Declaration = Declaration {
    path: "ties.parquet",
    what: "every measurement of a tie point with its ground point and residuals, before and after the adjustment",
    readers: "scripts",
    rows: "measurements",
    role: Role::Data,
    content: Content::Table(|| meanings(&tie_columns())),
    write: Write::Ties(|path, of, geometric| {
        let table = Table::new(tie_columns(), measurements(of.site, geometric))
            .in_terms(&of.site.config.terms());
        parquet::write(path, &table, light_time::metadata(of.site))
    }),
    uses: &[],
};

/// One measurement with its results.
struct Measurement<'a> {
    id: &'a str,
    image: &'a str,
    line: f64,
    sample: f64,
    sigma_px: Option<[f64; 2]>,
    /// Empty for a tie point used in the adjustment, else the reason why not.
    rejected: String,
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
    let adjusted = geometric.adjustment.map(|adjustment| adjustment.adjusted);
    let points = adjusted.map_or(&[][..], |adjusted| &adjusted.points);
    let ties = (0_usize..).zip(points);
    let ties = ties.filter(|(_, point)| point.kind == PointKind::Tie);
    let points: BTreeMap<usize, (usize, &CorrectedPoint)> = ties
        .map(|(index, point)| (point.index, (index, point)))
        .collect();
    let views: BTreeMap<(usize, usize), &ImageResidual> = adjusted
        .iter()
        .flat_map(|adjusted| &adjusted.views)
        .map(|view| ((view.point, view.image), view))
        .collect();
    let before = by_tie(geometric.intersected);
    let after = geometric
        .adjustment
        .map(|adjustment| by_tie(adjustment.intersected));
    let after = after.unwrap_or_default();
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
            let rejected = if view.is_some() {
                String::new()
            } else {
                reasons.get(&index).cloned().unwrap_or_default()
            };
            found.push(Measurement {
                id: &tie.id,
                image: &site.images[measure.image].times.id,
                line: measure.line,
                sample: measure.sample,
                sigma_px: measure.sigma_px,
                rejected,
                before: seen(before),
                after: seen(after),
                adjusted: view,
            });
        }
    }
    found
}

/// Reasons for rejecting tie points; the intersection's reason comes first.
fn reasons(geometric: &GeometricProducts) -> BTreeMap<usize, String> {
    let adjusted = geometric.adjustment.iter();
    let ties = adjusted.flat_map(|adjustment| &adjustment.adjusted.rejected);
    let ties = ties.filter(|point| point.kind == PointKind::Tie);
    let rejected = geometric.intersected.rejected.iter();
    let rejected = rejected.map(|tie| (tie.tie, tie.reason.to_string()));
    let ties = ties.map(|point| (point.index, point.reason.to_string()));
    let mut reasons = BTreeMap::new();
    for (tie, reason) in rejected.chain(ties) {
        reasons.entry(tie).or_insert(reason);
    }
    reasons
}

fn tie_columns<'a>() -> Vec<Column<Measurement<'a>>> {
    let mut columns = measured_columns();
    columns.extend(intersected_columns());
    columns.extend(adjusted_point_columns());
    columns.extend(adjusted_sigma_columns());
    columns.extend(residual_columns());
    columns
}

fn measured_columns<'a>() -> Vec<Column<Measurement<'a>>> {
    vec![
        column(
            "tie",
            Unit::None,
            "identifier of the tie point",
            |row: &Measurement| row.id.to_owned(),
        ),
        column(
            "image",
            Unit::None,
            "image identifier",
            |row: &Measurement| row.image.to_owned(),
        ),
        column(
            "line",
            Unit::Line,
            "measured line, 0 at the outer edge of the first line of the header image, 0.5 at its centre",
            |row: &Measurement| row.line,
        ),
        column(
            "sample",
            Unit::Pixel,
            "measured sample, 0 at the outer edge of the first sample, 0.5 at its centre",
            |row: &Measurement| row.sample,
        ),
        column(
            "sigma_line",
            Unit::Line,
            "standard deviation of the measured line, if the tie-point file states it",
            |row: &Measurement| Some(row.sigma_px?[0]),
        ),
        column(
            "sigma_sample",
            Unit::Pixel,
            "standard deviation of the measured sample, if the tie-point file states it",
            |row: &Measurement| Some(row.sigma_px?[1]),
        ),
        column(
            "rejected",
            Unit::None,
            "reason why the adjustment did not use the tie point; empty if it did, or if the adjustment failed",
            |row: &Measurement| row.rejected.clone(),
        ),
    ]
}

fn intersected_columns<'a>() -> Vec<Column<Measurement<'a>>> {
    vec![
        column(
            "x_m",
            Unit::Metre,
            "X of the point intersected with the orientation from the kernels, {frame}, metres",
            |row: &Measurement| Some(row.before?.0.ground.xyz_m[0]),
        ),
        column(
            "y_m",
            Unit::Metre,
            "Y of the point intersected with the orientation from the kernels, {frame}, metres",
            |row: &Measurement| Some(row.before?.0.ground.xyz_m[1]),
        ),
        column(
            "z_m",
            Unit::Metre,
            "Z of the point intersected with the orientation from the kernels, {frame}, metres",
            |row: &Measurement| Some(row.before?.0.ground.xyz_m[2]),
        ),
        column(
            "convergence_deg",
            Unit::Degree,
            "convergence: largest angle between two rays of the tie point, degrees",
            |row: &Measurement| Some(degrees(row.before?.0.convergence_rad)),
        ),
        column(
            "focal_along_px",
            Unit::Pixel,
            "residual of the intersection in the focal plane along the track, image pixels",
            |row: &Measurement| Some(row.before?.1.focal_along_px),
        ),
        column(
            "focal_across_px",
            Unit::Pixel,
            "residual of the intersection in the focal plane across the track, image pixels",
            |row: &Measurement| Some(row.before?.1.focal_across_px),
        ),
        column(
            "reprojection_lines",
            Unit::Line,
            "measured minus projected line of the intersected point (Table 5 of Shan et al. 2005)",
            |row: &Measurement| Some(row.before?.1.reprojection_lines),
        ),
        column(
            "reprojection_px",
            Unit::Pixel,
            "measured minus projected focal-plane coordinate of the intersected point across the track, image pixels",
            |row: &Measurement| Some(row.before?.1.reprojection_px),
        ),
    ]
}

fn adjusted_point_columns<'a>() -> Vec<Column<Measurement<'a>>> {
    vec![
        column(
            "adjusted_x_m",
            Unit::Metre,
            "X of the adjusted point, {frame}, metres",
            |row: &Measurement| Some(row.adjusted?.0.ground.xyz_m[0]),
        ),
        column(
            "adjusted_y_m",
            Unit::Metre,
            "Y of the adjusted point, {frame}, metres",
            |row: &Measurement| Some(row.adjusted?.0.ground.xyz_m[1]),
        ),
        column(
            "adjusted_z_m",
            Unit::Metre,
            "Z of the adjusted point, {frame}, metres",
            |row: &Measurement| Some(row.adjusted?.0.ground.xyz_m[2]),
        ),
        column(
            "adjusted_longitude_deg",
            Unit::Degree,
            "east longitude of the adjusted point, degrees",
            |row: &Measurement| Some(degrees(spherical(row.adjusted?.0).longitude_rad)),
        ),
        column(
            "adjusted_latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the adjusted point, degrees",
            |row: &Measurement| Some(degrees(spherical(row.adjusted?.0).latitude.0)),
        ),
        column(
            "adjusted_radius_m",
            Unit::Metre,
            "distance of the adjusted point from the centre of {body}, metres",
            |row: &Measurement| Some(spherical(row.adjusted?.0).radius_m),
        ),
    ]
}

fn adjusted_sigma_columns<'a>() -> Vec<Column<Measurement<'a>>> {
    vec![
        column(
            "sigma_x_m",
            Unit::Metre,
            "standard deviation of adjusted_x_m, metres; with the published model, it states only the agreement of \
             the images",
            |row: &Measurement| Some(sigma_m(row.adjusted?.0, 0)),
        ),
        column(
            "sigma_y_m",
            Unit::Metre,
            "standard deviation of adjusted_y_m, metres; with the published model, it states only the agreement of \
             the images",
            |row: &Measurement| Some(sigma_m(row.adjusted?.0, 1)),
        ),
        column(
            "sigma_z_m",
            Unit::Metre,
            "standard deviation of adjusted_z_m, metres; with the published model, it states only the agreement of \
             the images",
            |row: &Measurement| Some(sigma_m(row.adjusted?.0, 2)),
        ),
        column(
            "sigma_east_m",
            Unit::Metre,
            "standard deviation of the adjusted point in east, metres; with the published model, it states only the \
             agreement of the images",
            |row: &Measurement| Some(row.adjusted?.0.local_sigmas_m()[0]),
        ),
        column(
            "sigma_north_m",
            Unit::Metre,
            "standard deviation of the adjusted point in north, metres; with the published model, it states only the \
             agreement of the images",
            |row: &Measurement| Some(row.adjusted?.0.local_sigmas_m()[1]),
        ),
        column(
            "sigma_up_m",
            Unit::Metre,
            "standard deviation of the height of the adjusted point, metres; with the published model, it states only \
             the agreement of the images",
            |row: &Measurement| Some(row.adjusted?.0.local_sigmas_m()[2]),
        ),
        column(
            "relative_sigma_east_m",
            Unit::Metre,
            "standard deviation in east without the error that all tie points share, for differences from their mean, metres; \
             the shared error (adjustment/heights/mean_sigma_m of adjustment.json) does not average out",
            |row: &Measurement| Some(row.adjusted?.0.relative_sigmas_m()?[0]),
        ),
        column(
            "relative_sigma_north_m",
            Unit::Metre,
            "standard deviation in north without the error that all tie points share, metres; see relative_sigma_east_m",
            |row: &Measurement| Some(row.adjusted?.0.relative_sigmas_m()?[1]),
        ),
        column(
            "relative_sigma_up_m",
            Unit::Metre,
            "standard deviation of the height without the error that all tie points share, metres; see relative_sigma_east_m",
            |row: &Measurement| Some(row.adjusted?.0.relative_sigmas_m()?[2]),
        ),
        column(
            "correlation_east_north",
            Unit::None,
            "correlation of the east and north errors of the adjusted point, -1 to 1",
            |row: &Measurement| Some(local_correlation(row.adjusted?.0, 0, 1)),
        ),
        column(
            "correlation_east_up",
            Unit::None,
            "correlation of the east and height errors of the adjusted point, -1 to 1",
            |row: &Measurement| Some(local_correlation(row.adjusted?.0, 0, 2)),
        ),
        column(
            "correlation_north_up",
            Unit::None,
            "correlation of the north and height errors of the adjusted point, -1 to 1",
            |row: &Measurement| Some(local_correlation(row.adjusted?.0, 1, 2)),
        ),
    ]
}

fn residual_columns<'a>() -> Vec<Column<Measurement<'a>>> {
    vec![
        column(
            "residual_along_px",
            Unit::Pixel,
            "residual along the track in the focal plane, observed minus adjusted, image pixels",
            |row: &Measurement| Some(row.adjusted?.1.along_px.value),
        ),
        column(
            "residual_across_px",
            Unit::Pixel,
            "residual across the track in the focal plane, observed minus adjusted, image pixels",
            |row: &Measurement| Some(row.adjusted?.1.across_px.value),
        ),
        column(
            "redundancy_along",
            Unit::None,
            "redundancy number: share of a measurement error along the track that appears in the residual, 0 to 1",
            |row: &Measurement| Some(row.adjusted?.1.along_px.redundancy),
        ),
        column(
            "redundancy_across",
            Unit::None,
            "redundancy number: share of a measurement error across the track that appears in the residual, 0 to 1",
            |row: &Measurement| Some(row.adjusted?.1.across_px.redundancy),
        ),
        column(
            "standardised_along",
            Unit::None,
            "standardised residual along the track; missing for an uncontrolled measurement",
            |row: &Measurement| row.adjusted?.1.along_px.standardised,
        ),
        column(
            "standardised_across",
            Unit::None,
            "standardised residual across the track; missing for an uncontrolled measurement",
            |row: &Measurement| row.adjusted?.1.across_px.standardised,
        ),
        column(
            "adjusted_reprojection_lines",
            Unit::Line,
            "measured minus projected line of the point intersected with the adjusted orientation",
            |row: &Measurement| Some(row.after?.1.reprojection_lines),
        ),
        column(
            "adjusted_reprojection_px",
            Unit::Pixel,
            "measured minus projected focal-plane coordinate across the track of the point intersected with the \
             adjusted orientation, image pixels",
            |row: &Measurement| Some(row.after?.1.reprojection_px),
        ),
    ]
}

fn spherical(point: &CorrectedPoint) -> Spherical {
    Spherical::from_xyz_m(&point.ground.xyz_m)
}

/// Covariance of errors in east, north and height, m².
fn local_covariance_m2(point: &CorrectedPoint) -> Matrix3<f64> {
    let to_local = local_axes(&point.ground.xyz_m);
    to_local * point.covariance_m2 * to_local.transpose()
}

/// Correlation of errors along two of these axes.
fn local_correlation(point: &CorrectedPoint, axis: usize, other: usize) -> f64 {
    let local_m2 = local_covariance_m2(point);
    local_m2[(axis, other)] / (local_m2[(axis, axis)] * local_m2[(other, other)]).sqrt()
}

fn sigma_m(point: &CorrectedPoint, axis: usize) -> f64 {
    point.covariance_m2[(axis, axis)].sqrt()
}
