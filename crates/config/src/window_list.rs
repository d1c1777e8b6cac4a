//! Windows of a search: boxes and polygons from the command line, and files of many.

use std::path::Path;

use areograph_base::{
    error::{Cause, Error, IoError, Locate as _},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::window::WindowShape;
use areograph_store::files::file_name;

use super::{
    declare::{Keys, Many, declare_table, tables},
    document::{read, read_table},
    geojson,
    problems::Review,
    windows::{WindowConfig, wrapped_longitudes},
};

/// Most windows of a file.
const MANY: Many = Many {
    count: Some((1, 10_000)),
    purpose: "",
    further: &[],
};

declare_table! {
    /// Windows to search, as in a site file.
    pub(super) struct WindowList {
        /// Windows on the ground, 1 to 10,000.
        windows: Vec<WindowConfig> = tables(MANY),
    }
    check require_windows
}

fn require_windows(list: &WindowList, keys: &mut Keys<'_, '_>) {
    if list.windows.is_empty() && keys.span_of("windows").is_none() {
        keys.missing(
            "windows",
            "[[windows]] with longitude_deg and latitude_deg, or polygon",
        );
    }
}

/// Errors of a window on the command line.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum WindowError {
    #[error("the box has {what}; expected {expected}")]
    #[cause("write west,east,south,north in degrees, such as 137.0,138.0,-5.5,-4.0")]
    Box {
        what: String,
        expected: &'static str,
    },
    #[error("{0}")]
    #[cause(
        "correct the file; expected GeoJSON polygons in east longitude and areocentric latitude"
    )]
    Polygon(String),
    #[error(
        "window {0} is the outline of an image; expected longitude_deg and latitude_deg, or polygon"
    )]
    #[cause("write a box or polygon: only a run computes the outline of an image")]
    Image(String),
}

/// The windows in the file `path`.
///
/// # Errors
/// [`Problems`](super::Problems) with everything that is wrong, or [`IoError`].
pub fn load_windows(path: &Path) -> Result<Vec<WindowConfig>, Error> {
    let text = read(path)?;
    let mut review = Review::new(path, &text);
    let read = read_table::<WindowList>(&text, &mut review);
    let ((list, _), _) = review.finish(read)?;
    require_outlines(&list.windows).in_file(path)?;
    Ok(list.windows)
}

/// Makes sure that the outlines of windows are known without a run.
///
/// # Errors
/// A window that is the outline of an image.
pub fn require_outlines(windows: &[WindowConfig]) -> Result<(), Error> {
    let is_of_image = |window: &&WindowConfig| matches!(window.shape, WindowShape::Image { .. });
    match windows.iter().find(is_of_image) {
        Some(window) => Err(WindowError::Image(window.id.clone()).into()),
        None => Ok(()),
    }
}

/// The window of a box: west, east, south and north edge, degrees, as in a site file.
///
/// # Errors
/// Edges beyond the globe or in the wrong order.
pub fn window_of_box(id: &str, edges_deg: [f64; 4]) -> Result<WindowConfig, Error> {
    let [west, east, south, north] = edges_deg;
    let refuse = |what: String, expected| Err(WindowError::Box { what, expected }.into());
    if ![west, east]
        .iter()
        .all(|edge| (-360.0..=360.0).contains(edge))
    {
        return refuse(format!("longitudes {west} and {east}"), "-360 to 360");
    }
    if !(-90.0 <= south && south < north && north <= 90.0) {
        let expected = "-90 to 90, south below north";
        return refuse(format!("latitudes {south} and {north}"), expected);
    }
    let Some([west, east]) = wrapped_longitudes([west, east]) else {
        let expected = "an east edge more than 0 and at most 360 degrees east of the west edge";
        return refuse(format!("longitudes {west} and {east}"), expected);
    };
    let [west_rad, east_rad, south_rad, north_rad] =
        [west, east, south, north].map(|edge| edge * RADIANS_PER_DEGREE);
    Ok(WindowConfig {
        id: id.to_owned(),
        shape: WindowShape::Box {
            west_rad,
            east_rad,
            south_rad,
            north_rad,
        },
    })
}

/// The window of the polygons in a GeoJSON file; its identifier is the file's name.
///
/// # Errors
/// The file cannot be read; it contains no polygons.
pub fn window_of_polygon(path: &Path) -> Result<WindowConfig, Error> {
    path.metadata().map_err(IoError::on("open")).in_file(path)?;
    let polygons = geojson::read(path)
        .map_err(|error| WindowError::Polygon(error.to_string()))
        .in_file(path)?;
    Ok(WindowConfig {
        id: file_name(path),
        shape: WindowShape::Polygons { polygons },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_those_of_a_site_file_and_others_are_refused() {
        let text =
            "[[windows]]\nid = \"a\"\nlongitude_deg = [-42.0, 10.0]\nlatitude_deg = [-5.5, -4.0]\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("many.toml");
        std::io::Write::write_all(&mut std::fs::File::create(&path).unwrap(), text.as_bytes())
            .unwrap();
        let window = window_of_box("a", [-42.0, 10.0, -5.5, -4.0]).unwrap();
        assert_eq!(load_windows(&path).unwrap(), [window]);
        for (edges, expected) in [
            (
                [-361.0, 0.0, 0.0, 1.0],
                "longitudes -361 and 0; expected -360 to 360",
            ),
            (
                [0.0, 1.0, 2.0, 1.0],
                "latitudes 2 and 1; expected -90 to 90",
            ),
            ([0.0, 1.0, f64::NAN, 1.0], "latitudes NaN and 1"),
            (
                [5.0, 5.0, 0.0, 1.0],
                "an east edge more than 0 and at most 360 degrees east of the west edge",
            ),
        ] {
            let failure = window_of_box("a", edges).unwrap_err();
            assert!(failure.to_string().contains(expected), "{failure}");
        }
        std::fs::File::create(&path).unwrap();
        let failure = load_windows(&path).unwrap_err().to_string();
        assert!(failure.contains("windows"), "{failure}");
    }
}
