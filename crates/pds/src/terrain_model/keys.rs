//! The keys of a `GeoTIFF` that place its cells on a sphere.

use std::collections::BTreeMap;

use super::TerrainModelError;
use areograph_base::units::RADIANS_PER_DEGREE;

/// Numbers of keys (`GeoTIFF` 1.1, annex).
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const ANGULAR_UNITS: u16 = 2054;
const SEMI_MAJOR: u16 = 2057;
const SEMI_MINOR: u16 = 2058;
const INVERSE_FLATTENING: u16 = 2059;
const MERIDIAN: u16 = 2061;
const TRANSFORM: u16 = 3075;
const LINEAR_UNITS: u16 = 3076;
const PARALLEL: u16 = 3078;
const ORIGIN_LONGITUDE: u16 = 3080;
const ORIGIN_LATITUDE: u16 = 3081;
const FALSE_EASTING: u16 = 3082;
const FALSE_NORTHING: u16 = 3083;
const CENTRE_LONGITUDE: u16 = 3088;
const CENTRE_LATITUDE: u16 = 3089;
const VERTICAL: u16 = 4096;

/// Values of keys.
const PROJECTED: f64 = 1.0;
const GEOGRAPHIC: f64 = 2.0;
const POINT: f64 = 2.0;
const EQUIRECTANGULAR: f64 = 17.0;
const METRE: f64 = 9001.0;
const DEGREE: f64 = 9102.0;
/// Tag of the floating-point parameters.
const DOUBLES: u16 = 34736;
/// Code of a parameter that the file defines itself.
const USER_DEFINED: f64 = 32_767.0;
/// Largest difference of the half-axes of a sphere, metres.
const SPHERE_M: f64 = 0.5;

/// The numbers of keys; texts are left out.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct GeoKeys(BTreeMap<u16, f64>);

/// Conversion of map coordinates to longitude and latitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Map {
    /// Radians per unit of x and y.
    pub(super) rad_per_unit: [f64; 2],
    /// Coordinates of the origin and its place.
    origin: [f64; 2],
    origin_rad: [f64; 2],
}

impl Map {
    pub(super) fn place_rad(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            self.origin_rad[axis] + (at[axis] - self.origin[axis]) * self.rad_per_unit[axis]
        })
    }
}

impl GeoKeys {
    /// The keys of a directory whose floating-point parameters are `doubles`.
    pub(super) fn of(
        directory: &[u16],
        doubles: &[f64],
    ) -> std::result::Result<Self, TerrainModelError> {
        let entries = directory.get(4..).unwrap_or_default();
        let mut keys = BTreeMap::new();
        for entry in entries.as_chunks::<4>().0 {
            let [key, place, count, value] = *entry;
            let number = match (place, count) {
                (0, _) => Some(f64::from(value)),
                (DOUBLES, 1) => Some(*doubles.get(usize::from(value)).ok_or_else(|| {
                    refused(
                        "GeoKeyDirectory",
                        format!("key {key} refers to number {value} of {}", doubles.len()),
                        "an existing number",
                    )
                })?),
                _ => None,
            };
            keys.extend(number.map(|number| (key, number)));
        }
        Ok(Self(keys))
    }

    fn get(&self, key: u16) -> Option<f64> {
        self.0.get(&key).copied()
    }

    fn one_of(&self, keys: &[u16]) -> f64 {
        keys.iter().find_map(|key| self.get(*key)).unwrap_or(0.0)
    }

    /// Whether coordinates refer to the middle of a cell.
    pub(super) fn is_point(&self) -> bool {
        self.get(RASTER_TYPE)
            .is_some_and(|value| is_code(value, POINT))
    }

    /// Whether the file states a vertical system: its heights are not counted from the sphere.
    pub(super) fn is_vertical(&self) -> bool {
        self.get(VERTICAL).is_some()
    }

    /// Radius of the sphere, where the file states it.
    pub(super) fn radius_m(&self) -> std::result::Result<Option<f64>, TerrainModelError> {
        let Some(major_m) = self.get(SEMI_MAJOR) else {
            return Ok(None);
        };
        let minor_m = match self.get(INVERSE_FLATTENING) {
            Some(inverse) if inverse > 0.0 => major_m * (1.0 - inverse.recip()),
            _ => self.get(SEMI_MINOR).unwrap_or(major_m),
        };
        // Written so that NaN is rejected too.
        if !((major_m - minor_m).abs() <= SPHERE_M) {
            return Err(refused(
                "GeogSemiMajorAxis and GeogSemiMinorAxis",
                format!("{major_m} and {minor_m} m"),
                "a sphere: latitudes are areocentric, and heights refer to the sphere",
            ));
        }
        Ok(Some(major_m))
    }

    /// Conversion of coordinates to places; `radius_m` is the radius of the map.
    pub(super) fn map(&self, radius_m: f64) -> std::result::Result<Map, TerrainModelError> {
        if self.one_of(&[MERIDIAN]).abs() > 0.0 {
            let found = format!("{} degrees", self.one_of(&[MERIDIAN]));
            return Err(refused("GeogPrimeMeridianLong", found, "0"));
        }
        match self.get(MODEL_TYPE) {
            Some(model) if is_code(model, GEOGRAPHIC) => self.geographic(),
            Some(model) if is_code(model, PROJECTED) => self.equirectangular(radius_m),
            other => Err(refused(
                "GTModelType",
                other.map_or_else(|| "missing".to_owned(), |value| value.to_string()),
                "1 (projected) or 2 (geographic)",
            )),
        }
    }

    fn geographic(&self) -> std::result::Result<Map, TerrainModelError> {
        self.is(ANGULAR_UNITS, DEGREE, "GeogAngularUnits", "9102, degrees")?;
        Ok(Map {
            rad_per_unit: [RADIANS_PER_DEGREE; 2],
            origin: [0.0; 2],
            origin_rad: [0.0; 2],
        })
    }

    fn equirectangular(&self, radius_m: f64) -> std::result::Result<Map, TerrainModelError> {
        if !self
            .get(TRANSFORM)
            .is_some_and(|value| is_code(value, EQUIRECTANGULAR))
        {
            let found = self.get(TRANSFORM);
            return Err(refused(
                "ProjCoordTrans",
                found.map_or_else(|| "missing".to_owned(), |value| value.to_string()),
                "17, equirectangular",
            ));
        }
        self.is(LINEAR_UNITS, METRE, "ProjLinearUnits", "9001, metres")?;
        let parallel_rad = self.one_of(&[PARALLEL]) * RADIANS_PER_DEGREE;
        let across = parallel_rad.cos();
        if !(across > 1e-3) {
            let found = format!("{} degrees", self.one_of(&[PARALLEL]));
            return Err(refused(
                "ProjStdParallel1",
                found,
                "a latitude away from the poles",
            ));
        }
        Ok(Map {
            rad_per_unit: [1.0 / (radius_m * across), radius_m.recip()],
            origin: [
                self.one_of(&[FALSE_EASTING]),
                self.one_of(&[FALSE_NORTHING]),
            ],
            origin_rad: [
                self.one_of(&[CENTRE_LONGITUDE, ORIGIN_LONGITUDE]) * RADIANS_PER_DEGREE,
                self.one_of(&[CENTRE_LATITUDE, ORIGIN_LATITUDE]) * RADIANS_PER_DEGREE,
            ],
        })
    }

    /// Checks a unit, where the file names one.
    fn is(
        &self,
        key: u16,
        value: f64,
        what: &'static str,
        expected: &'static str,
    ) -> std::result::Result<(), TerrainModelError> {
        match self.get(key) {
            Some(found) if !is_code(found, value) && !is_code(found, USER_DEFINED) => {
                Err(refused(what, found.to_string(), expected))
            }
            _ => Ok(()),
        }
    }
}

/// Whether a key has a code, a whole number.
fn is_code(found: f64, code: f64) -> bool {
    (found - code).abs() < 0.5
}

fn refused(what: &'static str, found: String, expected: &'static str) -> TerrainModelError {
    TerrainModelError::Georeference {
        what,
        found,
        expected,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a circle of a sphere of Mars about the meridian of 180 degrees, as GDAL writes it.
    const DIRECTORY: [u16; 32] = [
        1, 1, 0, 7, 1024, 0, 1, 1, 1025, 0, 1, 1, 2057, 34736, 1, 0, 2058, 34736, 1, 0, 3075, 0, 1,
        17, 3078, 34736, 1, 1, 3088, 34736, 1, 2,
    ];
    const DOUBLES: [f64; 3] = [3_396_190.0, 60.0, 180.0];

    #[test]
    fn metres_of_an_equirectangular_map_are_longitudes_and_latitudes() {
        let keys = GeoKeys::of(&DIRECTORY, &DOUBLES).unwrap_or_default();
        assert_eq!(keys.radius_m(), Ok(Some(3_396_190.0)));
        assert!(!keys.is_point());
        let map = keys.map(3_396_190.0);
        let place = map.map(|map| map.place_rad([3_396_190.0 * 0.05, -3_396_190.0 * 0.2]));
        let expected = [std::f64::consts::PI + 0.1, -0.2];
        // A parallel of 60 degrees is half as long as the equator; rounding, radians.
        assert!(
            place.is_ok_and(|place| (place[0] - expected[0]).hypot(place[1] - expected[1]) < 1e-12)
        );
    }

    #[test]
    fn a_vertical_system_is_noticed() {
        let with = [DIRECTORY.as_slice(), &[4096, 0, 1, 32_767]].concat();
        let keys = GeoKeys::of(&with, &DOUBLES).unwrap_or_default();
        assert!(keys.is_vertical());
        let keys = GeoKeys::of(&DIRECTORY, &DOUBLES).unwrap_or_default();
        assert!(!keys.is_vertical());
    }

    #[test]
    fn other_maps_and_ellipsoids_are_refused() {
        let with = |at: usize, value: u16| {
            let mut directory = DIRECTORY;
            directory[at] = value;
            GeoKeys::of(&directory, &DOUBLES)
        };
        // Mercator; a model in three dimensions; an undefined number.
        assert!(with(23, 7).is_ok_and(|keys| keys.map(3e6).is_err()));
        assert!(with(7, 3).is_ok_and(|keys| keys.map(3e6).is_err()));
        assert!(with(15, 9).is_err());
        let flattened = with(19, 1);
        assert!(flattened.is_ok_and(|keys| keys.radius_m().is_err()));
    }
}
