//! Polygons of a GeoJSON file (RFC 7946): areocentric latitude and east longitude of Mars, degrees.

use std::{fs::File, io::Read as _, path::Path};

use serde::Deserialize;

use areograph_base::units::{RADIANS_PER_DEGREE, longitude_step_rad};

/// Longest file, bytes.
const BYTES_MAX: u64 = 16 << 20;
/// Most vertices of all rings.
const VERTICES_MAX: usize = 100_000;

/// Polygons, rings, vertices (longitude, latitude): radians.
pub(super) type Polygons = Vec<Vec<Vec<[f64; 2]>>>;

#[derive(Debug, thiserror::Error)]
pub(super) enum GeoJsonError {
    #[error("cannot read: {0}")]
    Io(#[from] std::io::Error),
    #[error("is longer than {} MiB", BYTES_MAX >> 20)]
    TooLong,
    #[error("{0}; expected Polygon, MultiPolygon, Feature or FeatureCollection")]
    Shape(#[from] serde_json::Error),
    #[error("contains no polygon")]
    Empty,
    #[error("has more than {VERTICES_MAX} vertices")]
    TooManyVertices,
    #[error("polygon {polygon} ring {ring} {error}")]
    Ring {
        polygon: usize,
        ring: usize,
        error: RingError,
    },
}

#[derive(Debug, thiserror::Error)]
pub(super) enum RingError {
    #[error("has {0} positions; expected at least 4 for a closed ring")]
    Short(usize),
    #[error("is not closed: its last position must repeat its first")]
    Open,
    #[error("position {0} has fewer than two numbers; expected [longitude, latitude]")]
    Position(usize),
    #[error("position {0}: longitude is {1}; expected -180 to 360")]
    Longitude(usize, f64),
    #[error("position {0}: latitude is {1}; expected -90 to 90")]
    Latitude(usize, f64),
    #[error("crosses itself: the edges after positions {0} and {1} meet")]
    Crossed(usize, usize),
    #[error("spans {0} degrees of longitude; expected less than 360")]
    Wide(f64),
    #[error(
        "position {0}: longitude changes from {1} to {2} in one edge; expected at most 180 degrees. Insert positions. \
         A ring across 180 degrees may instead have longitudes from -180 to 180 if it is narrower than 90 degrees, and a \
         ring across 0 degrees may have negative longitudes"
    )]
    WideEdge(usize, f64, f64),
}

#[derive(Deserialize)]
#[serde(tag = "type")]
enum Object {
    FeatureCollection { features: Vec<Object> },
    Feature { geometry: Option<Box<Object>> },
    Polygon { coordinates: Rings },
    MultiPolygon { coordinates: Vec<Rings> },
}

type Rings = Vec<Vec<Vec<f64>>>;

/// The polygons of the file, radians.
pub(super) fn read(path: &Path) -> Result<Polygons, GeoJsonError> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(BYTES_MAX + 1)
        .read_to_end(&mut bytes)?;
    if bytes.len() as u64 > BYTES_MAX {
        return Err(GeoJsonError::TooLong);
    }
    parse(&bytes)
}

/// The polygons of a GeoJSON text, radians; some writers put a byte order mark before it.
fn parse(bytes: &[u8]) -> Result<Polygons, GeoJsonError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut found = Vec::new();
    collect(serde_json::from_slice(bytes)?, &mut found);
    if found.is_empty() {
        return Err(GeoJsonError::Empty);
    }
    if found.iter().flatten().map(Vec::len).sum::<usize>() > VERTICES_MAX {
        return Err(GeoJsonError::TooManyVertices);
    }
    let place = |polygon, ring| {
        move |error| GeoJsonError::Ring {
            polygon,
            ring,
            error,
        }
    };
    (1..)
        .zip(&found)
        .map(|(polygon, rings)| {
            if rings.is_empty() {
                return Err(place(polygon, 1)(RingError::Short(0)));
            }
            (1..)
                .zip(rings)
                .map(|(number, positions)| ring(positions).map_err(place(polygon, number)))
                .collect()
        })
        .collect()
}

fn collect(object: Object, found: &mut Vec<Rings>) {
    match object {
        Object::FeatureCollection { features } => {
            for feature in features {
                collect(feature, found);
            }
        }
        Object::Feature { geometry } => {
            if let Some(geometry) = geometry {
                collect(*geometry, found);
            }
        }
        Object::Polygon { coordinates } => found.push(coordinates),
        Object::MultiPolygon { coordinates } => found.extend(coordinates),
    }
}

fn ring(positions: &[Vec<f64>]) -> Result<Vec<[f64; 2]>, RingError> {
    if positions.len() < 4 {
        return Err(RingError::Short(positions.len()));
    }
    if positions.first() != positions.last() {
        return Err(RingError::Open);
    }
    let (mut west, mut east) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut vertices = Vec::with_capacity(positions.len());
    for (number, position) in (1..).zip(positions) {
        let [longitude, latitude, ..] = position[..] else {
            return Err(RingError::Position(number));
        };
        if !(-180.0..=360.0).contains(&longitude) {
            return Err(RingError::Longitude(number, longitude));
        }
        if !(-90.0..=90.0).contains(&latitude) {
            return Err(RingError::Latitude(number, latitude));
        }
        west = west.min(longitude);
        east = east.max(longitude);
        vertices.push([
            longitude * RADIANS_PER_DEGREE,
            latitude * RADIANS_PER_DEGREE,
        ]);
    }
    if east - west >= 360.0 {
        return Err(RingError::Wide(east - west));
    }
    if let Some((number, from, to)) = ambiguous_edge(positions) {
        return Err(RingError::WideEdge(number, from, to));
    }
    match crossing(&vertices) {
        Some((one, other)) => Err(RingError::Crossed(one, other)),
        None => Ok(vertices),
    }
}

/// A ring that crosses the antimeridian is assumed to be narrower than this, degrees: as written, a ring with such an
/// edge would be wider than three quarters of Mars. The same holds for the last edge of a ring around a pole.
const CROSSING_MAX_DEG: f64 = 90.0;

/// The first edge of more than half a turn as written whose direction is ambiguous: the position at its end, counted
/// from 1, and the longitudes of its ends, degrees.
fn ambiguous_edge(positions: &[Vec<f64>]) -> Option<(usize, f64, f64)> {
    let (mut path, mut west, mut east) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut wide, mut longest) = (None, 0.0_f64);
    for (number, pair) in (2..).zip(positions.windows(2)) {
        let written = pair[1][0] - pair[0][0];
        let step = longitude_step_rad(written * RADIANS_PER_DEGREE) / RADIANS_PER_DEGREE;
        // Less than a degree: the other way round is 360 degrees longer.
        if (step - written).abs() > 1.0 {
            wide = wide.or(Some((number, pair[0][0], pair[1][0])));
            longest = longest.max(step.abs());
        }
        path += step;
        (west, east) = (west.min(path), east.max(path));
    }
    let is_round_pole = path.abs() > 180.0 && longest <= CROSSING_MAX_DEG + 1e-9;
    let is_within_180 = positions.iter().all(|position| position[0] <= 180.0);
    let is_crossing = path.abs() < 180.0 && is_within_180 && east - west < CROSSING_MAX_DEG;
    wide.filter(|_| !is_round_pole && !is_crossing)
}

/// Positions, counted from 1, at which two edges of a closed ring begin that cross each other.
///
/// Edges that only touch or lie along each other do not change the enclosed area.
fn crossing(vertices: &[[f64; 2]]) -> Option<(usize, usize)> {
    let mut longitude = vertices[0][0];
    let mut path = vec![vertices[0]];
    for pair in vertices.windows(2) {
        longitude += longitude_step_rad(pair[1][0] - pair[0][0]);
        path.push([longitude, pair[1][1]]);
    }
    let ends = |edge: usize| (path[edge], path[edge + 1]);
    let west = |edge: usize| path[edge][0].min(path[edge + 1][0]);
    let east = |edge: usize| path[edge][0].max(path[edge + 1][0]);
    let mut edges: Vec<usize> = (0..path.len() - 1).collect();
    edges.sort_by(|a, b| west(*a).total_cmp(&west(*b)));
    // From west to east, only edges whose longitudes overlap are compared.
    for (place, one) in edges.iter().enumerate() {
        let rivals = edges[place + 1..].iter();
        for other in rivals.take_while(|other| west(**other) <= east(*one)) {
            if cross(ends(*one), ends(*other)) {
                return Some((one.min(other) + 1, one.max(other) + 1));
            }
        }
    }
    None
}

type Edge = ([f64; 2], [f64; 2]);

/// Whether each edge has its ends on either side of the other.
fn cross(one: Edge, other: Edge) -> bool {
    let side = |(from, to): Edge, point: [f64; 2]| {
        (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0])
    };
    let parted = |edge: Edge, (a, b): Edge| side(edge, a) * side(edge, b) < 0.0;
    parted(one, other) && parted(other, one)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn message(text: &str) -> String {
        parse(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn every_wrapping_of_a_polygon_is_taken() {
        let polygon = r#"{"type":"Polygon","coordinates":[[[0,0],[90,0,5],[90,45],[0,0]]]}"#;
        let feature =
            format!(r#"{{"type":"Feature","properties":{{"n":1}},"geometry":{polygon}}}"#);
        let collection =
            format!(r#"{{"type":"FeatureCollection","features":[{feature},{feature}]}}"#);
        assert_eq!(
            parse(polygon.as_bytes()).unwrap(),
            parse(feature.as_bytes()).unwrap()
        );
        let both = parse(collection.as_bytes()).unwrap();
        assert_eq!(both.len(), 2);
        let quarter = std::f64::consts::FRAC_PI_2;
        let [longitude, latitude] = both[0][0][2];
        // One ulp of π/2, nanometres on the ground.
        assert!((longitude - quarter).abs() < 1e-15 && (latitude - quarter / 2.0).abs() < 1e-15);
    }

    #[test]
    fn every_fault_names_polygon_ring_and_position() {
        let polygon = |ring: &str| format!(r#"{{"type":"Polygon","coordinates":[{ring}]}}"#);
        for (ring, expected) in [
            (
                "",
                "polygon 1 ring 1 has 0 positions; expected at least 4 for a closed ring",
            ),
            (
                "[[0,0],[1,0],[0,0]]",
                "polygon 1 ring 1 has 3 positions; expected at least 4 for a closed ring",
            ),
            (
                "[[0,0],[1,0],[1,1],[0,1]]",
                "polygon 1 ring 1 is not closed: its last position must repeat its first",
            ),
            (
                "[[0,0],[1],[1,1],[0,0]]",
                "polygon 1 ring 1 position 2 has fewer than two numbers; expected [longitude, latitude]",
            ),
            (
                "[[0,0],[361,0],[1,1],[0,0]]",
                "polygon 1 ring 1 position 2: longitude is 361; expected -180 to 360",
            ),
            (
                "[[0,0],[1,0],[1,91],[0,0]]",
                "polygon 1 ring 1 position 3: latitude is 91; expected -90 to 90",
            ),
            (
                "[[0,0],[10,10],[10,0],[0,10],[0,0]]",
                "polygon 1 ring 1 crosses itself: the edges after positions 1 and 3 meet",
            ),
            (
                "[[175,0],[-175,10],[-175,0],[175,10],[175,0]]",
                "polygon 1 ring 1 crosses itself: the edges after positions 1 and 3 meet",
            ),
            (
                "[[0,-5],[200,-5],[200,5],[0,5],[0,-5]]",
                "polygon 1 ring 1 position 2: longitude changes from 0 to 200 in one edge; expected at most \
                 180 degrees. Insert positions. A ring across 180 degrees may instead have longitudes from -180 to 180 \
                 if it is narrower than 90 degrees, and a ring across 0 degrees may have negative longitudes",
            ),
            (
                "[[-180,0],[180,0],[1,1],[-180,0]]",
                "polygon 1 ring 1 spans 360 degrees of longitude; expected less than 360",
            ),
        ] {
            assert_eq!(message(&polygon(ring)), expected);
        }
        assert_eq!(
            message(r#"{"type":"FeatureCollection","features":[]}"#),
            "contains no polygon"
        );
        assert!(
            message(r#"{"type":"Point","coordinates":[0,0]}"#).contains("unknown variant `Point`")
        );
        assert!(
            message(&r#"{"type":"Feature","geometry":"#.repeat(100_000))
                .contains("recursion limit")
        );
        let many = vec!["[0,0]"; VERTICES_MAX + 1].join(",");
        assert_eq!(
            message(&polygon(&format!("[{many}]"))),
            "has more than 100000 vertices"
        );
    }

    #[test]
    fn edges_that_may_be_meant_either_way_round_are_refused() {
        for (ring, position) in [
            ("[[-100,-5],[100,-5],[100,5],[-100,5],[-100,-5]]", 2),
            ("[[0,-5],[300,-5],[300,5],[0,5],[0,-5]]", 2),
            ("[[350,-5],[10,-5],[10,5],[350,5],[350,-5]]", 2),
            ("[[-60,0],[0,10],[130,0],[-60,0]]", 4),
            ("[[0,0],[120,10],[240,0],[0,0]]", 4),
        ] {
            let told = message(&format!(r#"{{"type":"Polygon","coordinates":[{ring}]}}"#));
            let expected = format!("polygon 1 ring 1 position {position}: longitude changes from");
            assert!(told.starts_with(&expected), "{ring}: {told}");
        }
    }

    #[test]
    fn a_byte_order_mark_and_rings_that_only_touch_themselves_are_taken() {
        let polygon = |ring: &str| format!(r#"{{"type":"Polygon","coordinates":[{ring}]}}"#);
        let square = polygon("[[0,0],[1,0],[1,1],[0,1],[0,0]]");
        assert_eq!(
            parse(format!("\u{feff}{square}").as_bytes()).unwrap(),
            parse(square.as_bytes()).unwrap()
        );
        for ring in [
            // Across 180 degrees either way round; wide with positions between; round a pole in either counting.
            "[[170,-5],[-170,-5],[-170,5],[170,5],[170,-5]]",
            "[[170,-5],[170,5],[-170,5],[-170,-5],[170,-5]]",
            "[[0,-5],[100,-5],[200,-5],[200,5],[100,5],[0,5],[0,-5]]",
            "[[170,-5],[190,-5],[190,5],[170,5],[170,-5]]",
            "[[0,80],[90,80],[180,80],[270,80],[0,80]]",
            "[[-150,80],[-30,80],[150,80],[-150,80]]",
            // Two triangles that share a corner; a spike; a cap with edges along a meridian and the pole.
            "[[0,0],[1,1],[2,0],[2,2],[1,1],[0,2],[0,0]]",
            "[[0,0],[1,0],[1,5],[1,0],[1,1],[0,1],[0,0]]",
            "[[-170,-60],[0,-65],[170,-60],[170,-90],[-170,-90],[-170,-60]]",
        ] {
            assert!(parse(polygon(ring).as_bytes()).is_ok(), "{ring}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse(&bytes);
        }
    }
}
