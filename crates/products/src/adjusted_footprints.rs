//! The footprints used in the adjustment, as Parquet.

use std::collections::BTreeMap;

use super::{
    coordinates::degrees,
    light_time, parquet,
    product::{Content, Declaration, Role, Write},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_geom::ellipsoid::Spherical;
use areograph_stages::adjust::{Adjusted, CorrectedPoint, PointKind, RangeResidual};

pub(super) static TABLE: Declaration = Declaration {
    path: "adjusted_footprints.parquet",
    what: "footprints used in the adjustment: coordinates, standard deviations and ranges",
    readers: "scripts",
    rows: "footprints",
    role: Role::Data,
    content: Content::Table(|| meanings(&shot_columns())),
    write: Write::Adjustment(|path, of, _, adjustment| {
        let table = Table::new(shot_columns(), shots(adjustment.adjusted))
            .in_terms(&of.site.config.terms());
        parquet::write(path, &table, light_time::metadata(of.site)).map(Some)
    }),
    uses: &[],
};

/// A footprint used in the adjustment, with its range.
type Shot<'a> = (&'a CorrectedPoint, Option<&'a RangeResidual>);

fn shots(adjusted: &Adjusted) -> Vec<Shot<'_>> {
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

fn shot_columns<'a>() -> Vec<Column<Shot<'a>>> {
    fn range<'a>(
        name: &'static str,
        unit: Unit,
        description: &'static str,
        of: fn(&RangeResidual) -> Option<f64>,
    ) -> Column<Shot<'a>> {
        column(name, unit, description, move |shot: &Shot| {
            shot.1.and_then(of)
        })
    }
    let mut columns = vec![column(
        "footprint",
        Unit::None,
        "profile and, after the last colon, row of the footprint in footprints.parquet, counted from 0",
        |shot: &Shot| shot.0.id.clone(),
    )];
    columns.extend(places());
    for (axis, [initial, adjusted, sigma]) in [
        ["x_m", "adjusted_x_m", "sigma_x_m"],
        ["y_m", "adjusted_y_m", "sigma_y_m"],
        ["z_m", "adjusted_z_m", "sigma_z_m"],
    ]
    .into_iter()
    .enumerate()
    {
        columns.push(column(
            initial,
            Unit::Metre,
            "X, Y or Z of the footprint before the adjustment, {frame}, metres",
            move |shot: &Shot| shot.0.initial.xyz_m[axis],
        ));
        columns.push(column(
            adjusted,
            Unit::Metre,
            "X, Y or Z of the adjusted footprint, {frame}, metres",
            move |shot: &Shot| shot.0.ground.xyz_m[axis],
        ));
        columns.push(column(
            sigma,
            Unit::Metre,
            "standard deviation of the adjusted coordinate, including the uncertainty of the profile's shift, metres",
            move |shot: &Shot| sigma_m(shot.0, axis),
        ));
    }
    columns.extend(local_columns());
    columns.extend([
        range(
            "range_m",
            Unit::Metre,
            "measured range, metres; missing if no image was exposed at the time of the shot",
            |range| Some(range.range_m),
        ),
        range(
            "range_residual_m",
            Unit::Metre,
            "measured minus adjusted range, metres",
            |range| Some(range.residual_m.value),
        ),
        range(
            "range_redundancy",
            Unit::None,
            "redundancy number: share of a range error that appears in the residual, 0 to 1",
            |range| Some(range.residual_m.redundancy),
        ),
        range(
            "range_standardised",
            Unit::None,
            "range residual divided by its standard deviation; missing if the range is uncontrolled",
            |range| range.residual_m.standardised,
        ),
    ]);
    columns
}

/// Longitudes and latitudes before and after the adjustment.
fn places<'a>() -> [Column<Shot<'a>>; 4] {
    let before = |shot: &Shot| Spherical::from_xyz_m(&shot.0.initial.xyz_m);
    let after = |shot: &Shot| Spherical::from_xyz_m(&shot.0.ground.xyz_m);
    [
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the footprint before the adjustment, 0..360 degrees, {frame}",
            move |shot: &Shot| degrees(before(shot).longitude_rad),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the footprint before the adjustment, degrees, {frame}",
            move |shot: &Shot| degrees(before(shot).latitude.0),
        ),
        column(
            "adjusted_longitude_deg",
            Unit::Degree,
            "east longitude of the adjusted footprint, 0..360 degrees, {frame}",
            move |shot: &Shot| degrees(after(shot).longitude_rad),
        ),
        column(
            "adjusted_latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the adjusted footprint, degrees, {frame}",
            move |shot: &Shot| degrees(after(shot).latitude.0),
        ),
    ]
}

/// Standard deviations in east, north and height: of a footprint, of what its profile shares, and of the rest.
fn local_columns<'a>() -> Vec<Column<Shot<'a>>> {
    type Sigmas = fn(&CorrectedPoint) -> Option<[f64; 3]>;
    let kinds: [([&'static str; 3], &'static str, Sigmas); 3] = [
        (
            ["sigma_east_m", "sigma_north_m", "sigma_up_m"],
            "standard deviation in east, north or height, including the uncertainty of the profile's shift, metres",
            |point| Some(point.local_sigmas_m()),
        ),
        (
            [
                "shared_sigma_east_m",
                "shared_sigma_north_m",
                "shared_sigma_up_m",
            ],
            "standard deviation of the shift that all footprints of the profile share, metres; this shift does not average out",
            |point| Some(point.shared?.sigma_m),
        ),
        (
            [
                "relative_sigma_east_m",
                "relative_sigma_north_m",
                "relative_sigma_up_m",
            ],
            "standard deviation without the uncertainty of the profile's shift, for differences between footprints of \
             one profile, metres",
            CorrectedPoint::relative_sigmas_m,
        ),
    ];
    let of_kind = |(names, meaning, of): ([&'static str; 3], &'static str, Sigmas)| {
        let axes = names.into_iter().enumerate();
        axes.map(move |(axis, name)| {
            column(name, Unit::Metre, meaning, move |shot: &Shot| {
                Some(of(shot.0)?[axis])
            })
        })
    };
    kinds.into_iter().flat_map(of_kind).collect()
}

fn sigma_m(point: &CorrectedPoint, axis: usize) -> f64 {
    point.covariance_m2[(axis, axis)].sqrt()
}
