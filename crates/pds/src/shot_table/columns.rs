//! Assignment of the columns of a table to quantities and units.

use csv::StringRecord;

use super::{ShotTableError, Utc};
use areograph_base::{
    body::BodyModel,
    time::Et,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use areograph_geom::ellipsoid::{on_ellipsoid_m, spherical_to_xyz_m};

/// Longitudes of either convention, and latitudes, degrees.
pub(super) const LONGITUDE_DEG: [f64; 2] = [-360.0, 720.0];
pub(super) const LATITUDE_DEG: [f64; 2] = [-90.0, 90.0];

/// The column of each quantity: its name in the first row, or its number, from 1.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ShotColumns {
    /// Time of the shot, UTC.
    pub utc: Option<String>,
    /// Time of the shot, TDB seconds past J2000.
    pub et_s: Option<String>,
    /// East longitude of the footprint, degrees.
    pub longitude_deg: Option<String>,
    /// Areocentric latitude of the footprint, degrees.
    pub latitude_deg: Option<String>,
    /// Distance of the footprint from the centre of the body, kilometres.
    pub radius_km: Option<String>,
    /// The same, metres.
    pub radius_m: Option<String>,
    /// Or its height above the ellipsoid of the body along the radius, metres.
    pub height_m: Option<String>,
    /// One-way range from the spacecraft, kilometres.
    pub range_km: Option<String>,
    /// The same, metres.
    pub range_m: Option<String>,
    /// East longitude of the spacecraft, degrees.
    pub spacecraft_longitude_deg: Option<String>,
    /// Areocentric latitude of the spacecraft, degrees.
    pub spacecraft_latitude_deg: Option<String>,
    /// Distance of the spacecraft from the centre of the body, kilometres.
    pub spacecraft_radius_km: Option<String>,
    /// The same, metres.
    pub spacecraft_radius_m: Option<String>,
    /// Number of the orbit; 0 without a column.
    pub orbit: Option<String>,
}

/// A column of numbers.
#[derive(Debug, Clone)]
pub(super) struct Field {
    /// Its key in the configuration, which ends in the unit.
    pub(super) key: &'static str,
    /// Its position in a row, from 0.
    pub(super) at: usize,
    /// Factor that converts its numbers to metres or radians.
    pub(super) scale: f64,
    /// Minimum and maximum of its numbers, as written.
    pub(super) limits: Option<[f64; 2]>,
}

/// The columns of a table.
#[derive(Debug, Clone)]
pub(super) struct Fields {
    pub(super) time: Time,
    pub(super) longitude: Field,
    pub(super) latitude: Field,
    pub(super) radius: Radius,
    pub(super) range: Field,
    pub(super) spacecraft_longitude: Field,
    pub(super) spacecraft_latitude: Field,
    pub(super) spacecraft_radius: Field,
    orbit: Option<Field>,
}

/// Form of the time in a table.
#[derive(Debug, Clone)]
pub(super) enum Time {
    Utc(Field),
    Et(Field),
}

/// Form of the radial coordinate.
#[derive(Debug, Clone)]
pub(super) enum Radius {
    FromCentre(Field),
    AboveEllipsoid(Field),
}

/// Resolves names and numbers of columns to positions in a row.
struct Finder<'a> {
    header: &'a StringRecord,
    names: bool,
}

impl Finder<'_> {
    fn find(
        &mut self,
        key: &'static str,
        written: Option<&String>,
        scale: f64,
        limits: Option<[f64; 2]>,
    ) -> std::result::Result<Option<Field>, ShotTableError> {
        let Some(written) = written else {
            return Ok(None);
        };
        let number = written.parse::<usize>().ok();
        let at = if let Some(at) = number.and_then(|number| number.checked_sub(1)) {
            at
        } else {
            self.names = true;
            let place = self.header.iter().position(|name| name == written);
            place.ok_or_else(|| ShotTableError::Column {
                key,
                name: written.clone(),
                found: self.header.iter().map(str::to_owned).collect(),
            })?
        };
        Ok(Some(Field {
            key,
            at,
            scale,
            limits,
        }))
    }
}

impl Fields {
    /// The columns by a table's first row, and whether that contains their names.
    pub(super) fn of(
        columns: &ShotColumns,
        header: &StringRecord,
    ) -> std::result::Result<(Self, bool), ShotTableError> {
        let mut finder = Finder {
            header,
            names: false,
        };
        let mut find = |key, written: &Option<String>, scale, limits| {
            finder.find(key, written.as_ref(), scale, limits)
        };
        let km = METRES_PER_KM;
        let degree = RADIANS_PER_DEGREE;
        let utc = find("utc", &columns.utc, 1.0, None)?;
        let et = find("et_s", &columns.et_s, 1.0, None)?;
        let angle = |limits| (degree, Some(limits));
        let (scale, limits) = angle(LONGITUDE_DEG);
        let longitude = find("longitude_deg", &columns.longitude_deg, scale, limits)?;
        let key = "spacecraft_longitude_deg";
        let spacecraft_longitude = find(key, &columns.spacecraft_longitude_deg, scale, limits)?;
        let (scale, limits) = angle(LATITUDE_DEG);
        let latitude = find("latitude_deg", &columns.latitude_deg, scale, limits)?;
        let key = "spacecraft_latitude_deg";
        let spacecraft_latitude = find(key, &columns.spacecraft_latitude_deg, scale, limits)?;
        let height = find("height_m", &columns.height_m, 1.0, None)?;
        let radius = find("radius_km", &columns.radius_km, km, None)?;
        let radius = match radius {
            None => find("radius_m", &columns.radius_m, 1.0, None)?,
            found => found,
        };
        let range = match find("range_km", &columns.range_km, km, None)? {
            None => find("range_m", &columns.range_m, 1.0, None)?,
            found => found,
        };
        let spacecraft_radius = find(
            "spacecraft_radius_km",
            &columns.spacecraft_radius_km,
            km,
            None,
        )?;
        let spacecraft_radius = match spacecraft_radius {
            None => find(
                "spacecraft_radius_m",
                &columns.spacecraft_radius_m,
                1.0,
                None,
            )?,
            found => found,
        };
        let orbit = find(
            "orbit",
            &columns.orbit,
            1.0,
            Some([0.0, f64::from(u32::MAX)]),
        )?;
        let needed = |key, field: Option<Field>| field.ok_or_else(|| missing(key, header));
        let fields = Self {
            time: match (utc, et) {
                (_, Some(et)) => Time::Et(et),
                (utc, None) => Time::Utc(needed("utc", utc)?),
            },
            longitude: needed("longitude_deg", longitude)?,
            latitude: needed("latitude_deg", latitude)?,
            radius: match (radius, height) {
                (Some(radius), _) => Radius::FromCentre(radius),
                (None, height) => Radius::AboveEllipsoid(needed("radius_km", height)?),
            },
            range: needed("range_km", range)?,
            spacecraft_longitude: needed("spacecraft_longitude_deg", spacecraft_longitude)?,
            spacecraft_latitude: needed("spacecraft_latitude_deg", spacecraft_latitude)?,
            spacecraft_radius: needed("spacecraft_radius_km", spacecraft_radius)?,
            orbit,
        };
        Ok((fields, finder.names))
    }

    /// The orbit of a row, 0 where the table has none.
    pub(super) fn orbit(&self, record: &StringRecord) -> std::result::Result<u32, String> {
        let Some(field) = &self.orbit else {
            return Ok(0);
        };
        field.whole(record)
    }
}

/// A column that the configuration does not name; its checks exclude this.
fn missing(key: &'static str, header: &StringRecord) -> ShotTableError {
    ShotTableError::Column {
        key,
        name: String::new(),
        found: header.iter().map(str::to_owned).collect(),
    }
}

/// Whether a first row has no number in the columns of numbers.
pub(super) fn is_header(fields: &Fields, record: &StringRecord) -> bool {
    let asked = [&fields.longitude, &fields.latitude, &fields.range];
    asked.iter().all(|field| {
        record
            .get(field.at)
            .is_some_and(|text| text.parse::<f64>().is_err())
    })
}

impl Field {
    pub(super) fn text<'a>(
        &self,
        record: &'a StringRecord,
    ) -> std::result::Result<&'a str, String> {
        record.get(self.at).ok_or_else(|| {
            format!(
                "the row has {} columns; expected {} in column {}",
                record.len(),
                self.key,
                self.at + 1
            )
        })
    }

    pub(super) fn refused(&self, text: &str, expected: &str) -> String {
        format!(
            "{} (column {}) is \"{text}\"; expected {expected}",
            self.key,
            self.at + 1
        )
    }

    /// The whole number of a row, not negative.
    pub(super) fn whole<N: TryFrom<u32>>(
        &self,
        record: &StringRecord,
    ) -> std::result::Result<N, String> {
        let text = self.text(record)?;
        let [_, most] = self.limits.unwrap_or([0.0, f64::MAX]);
        let whole = text.parse::<u32>().ok();
        let whole = whole.filter(|whole| f64::from(*whole) <= most);
        whole
            .and_then(|whole| N::try_from(whole).ok())
            .ok_or_else(|| {
                let expected = if most < 1e9 {
                    format!("a whole number from 0 to {most}")
                } else {
                    "a whole number, not negative".to_owned()
                };
                self.refused(text, &expected)
            })
    }

    /// The instant of a row that is written in UTC.
    pub(super) fn instant(
        &self,
        record: &StringRecord,
        utc: Utc<'_>,
    ) -> std::result::Result<Et, String> {
        let text = self.text(record)?;
        utc(text).map_err(|failure| {
            let expected = format!("UTC such as 2010-01-27T06:19:47.013 ({})", failure.cause);
            self.refused(text, &expected)
        })
    }

    /// The number of a row in metres or radians.
    pub(super) fn number(&self, record: &StringRecord) -> std::result::Result<f64, String> {
        let limits = self.limits.unwrap_or([f64::MIN, f64::MAX]);
        self.written_within(record, limits)
    }

    /// The number of a row within these limits, metres or radians.
    pub(super) fn within(
        &self,
        record: &StringRecord,
        limits: [f64; 2],
    ) -> std::result::Result<f64, String> {
        self.written_within(record, limits.map(|limit| limit / self.scale))
    }

    /// The number of a row within these limits, as written.
    fn written_within(
        &self,
        record: &StringRecord,
        [least, most]: [f64; 2],
    ) -> std::result::Result<f64, String> {
        let text = self.text(record)?;
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        let Some(number) = number else {
            return Err(self.refused(text, "a number"));
        };
        if (least..=most).contains(&number) {
            return Ok(number * self.scale);
        }
        // The smallest positive number stands for limits above 0.
        let expected = if least > 0.0 && least < 1e-300 {
            format!("a number above 0, at most {most}")
        } else {
            format!("a number from {least} to {most}")
        };
        Err(self.refused(text, &expected))
    }
}

impl Time {
    /// The instant of a row, ET seconds.
    pub(super) fn et_s(
        &self,
        record: &StringRecord,
        limits_s: [f64; 2],
        utc: Option<Utc<'_>>,
    ) -> std::result::Result<f64, String> {
        match (self, utc) {
            (Self::Et(field), _) => field.within(record, limits_s),
            (Self::Utc(field), Some(utc)) => Ok(field.instant(record, utc)?.seconds()),
            (Self::Utc(field), None) => Err(field.refused(
                field.text(record)?,
                "leap seconds, which times in UTC require",
            )),
        }
    }
}

impl Radius {
    /// Distance of the footprint of a row from the centre of the body, metres.
    pub(super) fn radius_m(
        &self,
        record: &StringRecord,
        model: &BodyModel,
        latitude_rad: f64,
        limits_m: [f64; 2],
    ) -> std::result::Result<f64, String> {
        match self {
            Self::FromCentre(field) => field.within(record, limits_m),
            Self::AboveEllipsoid(field) => {
                let direction = spherical_to_xyz_m(0.0, latitude_rad, 1.0);
                let below_m = on_ellipsoid_m(model, &direction).norm();
                let height_m = field.within(record, limits_m.map(|limit_m| limit_m - below_m))?;
                Ok(below_m + height_m)
            }
        }
    }
}
