//! `[[shots]]`: tables of laser shots, of any altimeter.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::json;

use areograph_base::body::Datum;

use super::{
    declare::{Keys, Many, declare_table, key, table},
    forms::{text, words},
    paths::{Globs, SHOT_TABLE_ENDINGS},
};

/// Tables of shots of a site.
pub(super) const SHOTS: Many = Many::ANY;

/// A table whose columns are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShotLayout {
    /// LOLA's reduced data records, one row per shot.
    LolaRdr,
    /// `footprints.csv` of a site.
    Areograph,
    /// MOLA shots of the Orbital Data Explorer, without the position of the spacecraft.
    OdePedr,
}

declare_table! {
    /// Tables of laser shots (CSV), in place of `[pedr]`: shots of other altimeters, or of MOLA from other sources.
    /// Each row is a shot; rows outside all windows are excluded, and malformed rows are reported with file and line.
    /// Duplicate rows are counted once.
    pub struct ShotTableConfig: Deserialize {
        /// Paths, folders or globs of tables, as in `[pedr]`.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(SHOT_TABLE_ENDINGS))
            .required_as("paths or globs of tables of shots")
            .unused(r#"["../lola/*.csv"]"#),
        /// Known layout of columns, in place of a table `columns`.
        layout: Option<ShotLayout> = key(words([
            ("lola_rdr", ShotLayout::LolaRdr, "LOLA reduced data records from the Orbital Data Explorer, 29 columns"),
            ("areograph", ShotLayout::Areograph, "footprints.csv of another site (products.formats, or areograph export)"),
            ("ode_pedr", ShotLayout::OdePedr, "MOLA shots from the PEDR query of the Orbital Data Explorer, \
                ten columns, without the position of the spacecraft"),
        ])).unused(r#""lola_rdr""#),
        /// Datum of longitudes and latitudes; the default is the datum of the products.
        datum: Option<Datum> = key(words([
            ("iau1991", Datum::Iau1991, ""),
            ("iau1994", Datum::Iau1994, ""),
            ("iau2000", Datum::Iau2000, "the datum of the products at Mars"),
            ("moon_me", Datum::MoonMe, "mean Earth/polar axis frame, the datum of the products at the Moon"),
        ])).unused(r#""moon_me""#),
        /// Assignment of columns.
        columns: ShotColumns = table(),
    }
    check has_columns
}

declare_table! {
    /// Assignment of columns, by name in the first row or by number from 1. The names of the keys state the units.
    pub struct ShotColumns: Deserialize {
        /// Time of the shot, UTC such as 2010-01-27T06:19:47.013. Or `et_s`.
        utc: Option<String> = key(text()).unused(r#""1""#),
        /// Time of the shot, TDB seconds past J2000.
        et_s: Option<String> = key(text()).unused(r#""16""#),
        /// East longitude of the footprint.
        longitude_deg: Option<String> = key(text()).unused(r#""2""#),
        /// Planetocentric latitude of the footprint.
        latitude_deg: Option<String> = key(text()).unused(r#""3""#),
        /// Distance of the footprint from the centre of the body. Or `radius_m`, or `height_m`.
        radius_km: Option<String> = key(text()).unused(r#""4""#),
        /// Distance of the footprint from the centre of the body, metres.
        radius_m: Option<String> = key(text()).unused(r#""planet_rad""#),
        /// Alternatively, height of the footprint above the ellipsoid of the products, along the radius; at the Moon,
        /// above the radius of 1737.4 km.
        height_m: Option<String> = key(text()).unused(r#""height""#),
        /// One-way range from the spacecraft. Or `range_m`.
        range_km: Option<String> = key(text()).unused(r#""5""#),
        /// One-way range from the spacecraft, metres.
        range_m: Option<String> = key(text()).unused(r#""range""#),
        /// East longitude of the spacecraft in the table's own orbit solution.
        spacecraft_longitude_deg: Option<String> = key(text()).unused(r#""19""#),
        /// Planetocentric latitude of the spacecraft.
        spacecraft_latitude_deg: Option<String> = key(text()).unused(r#""20""#),
        /// Distance of the spacecraft from the centre of the body. Or `spacecraft_radius_m`.
        spacecraft_radius_km: Option<String> = key(text()).unused(r#""21""#),
        /// Distance of the spacecraft from the centre of the body, metres.
        spacecraft_radius_m: Option<String> = key(text()).unused(r#""sc_rad""#),
        /// Orbit number. Without this key, all shots have the orbit number 0, and only pauses separate profiles.
        orbit: Option<String> = key(text()).unused(r#""orbit""#),
    }
}

impl ShotLayout {
    /// Assignment of its columns.
    ///
    /// # Source
    /// LOLA RDR software interface specification; the header of the Orbital Data Explorer's tables
    /// (`Coordinated_Universal_Time, Pt_Longitude, Pt_Latitude, Pt_Radius, Pt_Range, …, Terrestrial_Dyn_Time, …,
    /// SC_Longitude, SC_Latitude, SC_Radius, …`).
    fn columns(self) -> ShotColumns {
        let column = |number: u32| Some(number.to_string());
        let named = |name: &str| Some(name.to_owned());
        match self {
            Self::LolaRdr => ShotColumns {
                et_s: column(16),
                longitude_deg: column(2),
                latitude_deg: column(3),
                radius_km: column(4),
                range_km: column(5),
                spacecraft_longitude_deg: column(19),
                spacecraft_latitude_deg: column(20),
                spacecraft_radius_km: column(21),
                ..ShotColumns::default()
            },
            Self::Areograph => ShotColumns {
                et_s: named("et_tag_s"),
                longitude_deg: named("longitude_deg"),
                latitude_deg: named("latitude_deg"),
                radius_m: named("radius_m"),
                range_m: named("range_m"),
                spacecraft_longitude_deg: named("spacecraft_longitude_deg"),
                spacecraft_latitude_deg: named("spacecraft_latitude_deg"),
                spacecraft_radius_m: named("spacecraft_radius_m"),
                orbit: named("orbit"),
                ..ShotColumns::default()
            },
            // The reader knows its columns by the heading.
            Self::OdePedr => ShotColumns::default(),
        }
    }
}

impl ShotTableConfig {
    /// Assignment of columns, by the layout or as written.
    #[must_use]
    pub fn columns(&self) -> ShotColumns {
        self.layout
            .map_or_else(|| self.columns.clone(), ShotLayout::columns)
    }
}

/// Alternative keys of every required quantity: exactly one of each.
const NEEDS: [&[&str]; 8] = [
    &["utc", "et_s"],
    &["longitude_deg"],
    &["latitude_deg"],
    &["radius_km", "radius_m", "height_m"],
    &["range_km", "range_m"],
    &["spacecraft_longitude_deg"],
    &["spacecraft_latitude_deg"],
    &["spacecraft_radius_km", "spacecraft_radius_m"],
];

fn has_columns(_: &ShotTableConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| {
        let needs = NEEDS.map(|ways| {
            let ways: Vec<_> = ways.iter().map(|way| json!({"required": [way]})).collect();
            json!({"oneOf": ways})
        });
        json!({"oneOf": [
            {"required": ["layout"], "not": {"required": ["columns"]}},
            {"required": ["columns"], "properties": {"columns": {"allOf": needs}}},
        ]})
    });
    let (layout, columns) = (keys.span_of("layout"), keys.span_of("columns"));
    match (layout, columns) {
        (Some(_), Some(_)) => {
            keys.refuse("layout", "a layout or a table [shots.columns], not both");
            return;
        }
        (Some(_), None) => return,
        (None, None) => {
            keys.missing(
                "layout",
                "a layout, or a table [shots.columns] with the column of each quantity",
            );
            return;
        }
        (None, Some(_)) => {}
    }
    for ways in NEEDS {
        let written: Vec<&&str> = ways
            .iter()
            .filter(|way| keys.writes("columns", way))
            .collect();
        match written[..] {
            [_] => {}
            [] => keys.problem(format!(
                "shots.columns.{} is missing; expected the name or the number of the column",
                ways.join(" or ")
            )),
            [_, second, ..] => {
                keys.refuse_below(
                    "columns",
                    second,
                    format!("only one of {}", ways.join(", ")),
                );
            }
        }
    }
}
