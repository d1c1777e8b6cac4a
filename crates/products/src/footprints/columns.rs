//! The columns of a shot.

use std::fmt::Write as _;

use super::{
    super::{
        coordinates::degrees,
        geoparquet::well_known_binary,
        table::{Column, Unit, column, text_column},
    },
    Shot,
};
use areograph_geom::range_residuals::states_spacecraft;

/// The columns of a shot, in order.
pub(in super::super) fn columns<'a>() -> Vec<Column<Shot<'a>>> {
    let mut columns = identity();
    columns.extend(quality());
    columns.extend(ground());
    columns.extend(heights());
    columns.extend(spacecraft());
    columns.push(column(
        "geometry",
        Unit::None,
        "point, longitude (-180..180) and {latitude} latitude in degrees, well-known binary",
        |shot: &Shot| well_known_binary(shot.point_deg()),
    ));
    columns
}

/// Time of a shot and its place in the file.
fn identity<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "et_tag_s",
            Unit::Second,
            "time tag of the shot in the file, TDB seconds past J2000",
            |shot: &Shot| shot.get(|footprints| &footprints.et_tag_s),
        ),
        column(
            "et_s",
            Unit::Second,
            "time of the shot after the {altimeter} clock correction, TDB seconds past J2000",
            |shot: &Shot| shot.get(|footprints| &footprints.et_s),
        )
        .in_gis()
        .in_dbase("et_s", 20, 6),
        column("utc", Unit::None, "et_s as UTC, ISO 8601", Shot::utc)
            .in_gis()
            .in_dbase("utc", 0, 0),
        column(
            "orbit",
            Unit::None,
            "orbit number of the frame",
            |shot: &Shot| shot.get(|footprints| &footprints.orbit),
        )
        .in_gis()
        .in_dbase("orbit", 10, 0),
        text_column(
            "source_file",
            "name of the {shot_file}",
            |shot: &Shot, out| out.write_str(shot.file_name()),
        )
        .in_gis()
        .in_dbase("file", 0, 0),
        column("record", Unit::None, "{record}", |shot: &Shot| {
            shot.get(|footprints| &footprints.record)
        })
        .in_gis()
        .in_dbase("record", 10, 0),
        column(
            "shot",
            Unit::None,
            "number of the shot in its frame, 1 to 20",
            |shot: &Shot| u32::from(shot.get(|footprints| &footprints.shot)),
        )
        .between(1, 20)
        .in_gis()
        .in_dbase("shot", 3, 0),
    ]
}

/// Quality flags of a shot in its file, and the windows that hold it.
fn quality<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column("channel", Unit::None, "trigger channel", |shot: &Shot| {
            u32::from(shot.get(|footprints| &footprints.channel))
        }),
        column(
            // Not `class`: a reserved word in Python.
            "return_class",
            Unit::None,
            "class of the return: 1 ground, 0 cloud or noise",
            |shot: &Shot| i32::from(shot.get(|footprints| &footprints.class)),
        ),
        column(
            "attitude_flag",
            Unit::None,
            "knowledge of the attitude: 0 known, 2 known for part of the frame, 3 unknown",
            |shot: &Shot| u32::from(shot.get(|footprints| &footprints.attitude_flag)),
        ),
        column(
            "orbit_quality",
            Unit::None,
            "source of the orbit: 0 for JPL, otherwise the number of the gravity model",
            |shot: &Shot| u32::from(shot.get(|footprints| &footprints.orbit_quality)),
        ),
        text_column(
            "windows",
            "identifiers of the windows that contain the shot: a list in Parquet, separated by semicolons in text",
            |shot: &Shot, out| shot.names.write_windows(shot.row, out),
        )
        .listed()
        .last_in_gis(),
    ]
}

/// Position of the footprint.
fn ground<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, 0..360 degrees, {frame}",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.longitude_rad)),
        )
        .in_dbase("lon_deg", 14, 9),
        column(
            "latitude_deg",
            Unit::Degree,
            "{latitude} latitude, degrees, {frame}",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.latitude_rad)),
        )
        .in_dbase("lat_deg", 14, 9),
        column(
            "latitude_areographic_deg",
            Unit::Degree,
            "{latitude_of_maps} latitude on the ellipsoid of {frame}, degrees; convention of older maps",
            Shot::areographic_deg,
        ),
    ]
}

/// Its height.
fn heights<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "radius_m",
            Unit::Metre,
            "planetary radius before the crossover correction, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_m),
        )
        .in_gis()
        .in_dbase("radius_m", 12, 3),
        column(
            "radius_crossover_m",
            Unit::Metre,
            "planetary radius after the crossover correction, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.radius_crossover_m),
        )
        .in_gis()
        .in_dbase("radius_x_m", 12, 3),
        column(
            "areoid_radius_m",
            Unit::Metre,
            "radius of the {areoid}, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.areoid_radius_m),
        ),
        column(
            "topography_m",
            Unit::Metre,
            "planetary radius after the crossover correction minus the radius of the {areoid}, metres",
            Shot::topography_m,
        )
        .in_gis()
        .in_dbase("topo_m", 12, 3),
        column(
            "x_m",
            Unit::Metre,
            "{frame} body-fixed X of the ground point, with the radius that all stages use, metres",
            |shot: &Shot| shot.xyz_m[0],
        ),
        column(
            "y_m",
            Unit::Metre,
            "{frame} body-fixed Y of the ground point, with the radius that all stages use, metres",
            |shot: &Shot| shot.xyz_m[1],
        ),
        column(
            "z_m",
            Unit::Metre,
            "{frame} body-fixed Z of the ground point, with the radius that all stages use, metres",
            |shot: &Shot| shot.xyz_m[2],
        ),
    ]
}

fn spacecraft<'a>() -> Vec<Column<Shot<'a>>> {
    vec![
        column(
            "range_m",
            Unit::Metre,
            "one-way range to the spacecraft's centre of mass, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.range_m),
        )
        .in_gis()
        .in_dbase("range_m", 12, 3),
        column(
            "spacecraft_longitude_deg",
            Unit::Degree,
            "east longitude of the spacecraft from the orbit in the file, degrees, {frame}",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.spacecraft_longitude_rad)),
        ),
        column(
            "spacecraft_latitude_deg",
            Unit::Degree,
            "{latitude} latitude of the spacecraft from the orbit in the file, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.spacecraft_latitude_rad)),
        ),
        column(
            "spacecraft_radius_m",
            Unit::Metre,
            "distance of the spacecraft from the centre of {body}, from the orbit in the file, metres",
            |shot: &Shot| shot.get(|footprints| &footprints.spacecraft_radius_m),
        ),
        column(
            "off_nadir_deg",
            Unit::Degree,
            "off-nadir angle of the laser, degrees",
            |shot: &Shot| degrees(shot.get(|footprints| &footprints.off_nadir_rad)),
        ),
        column(
            "nadir_by_range",
            Unit::None,
            "whether the file states no spacecraft position, which is then set on the radius through the footprint at \
             the distance range_m",
            |shot: &Shot| !states_spacecraft(shot.footprints, shot.row),
        ),
    ]
}
