//! `[products]`.

use serde::{Deserialize, Serialize};

use super::{
    declare::{declare_table, key},
    forms::{list_or_none, words_of},
};

/// Format of footprints in addition to Parquet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShotFormat {
    /// CSV with a PDS4 label.
    Csv,
    /// Two-dimensional points as GeoJSON.
    Geojson,
    /// GeoPackage.
    Gpkg,
    /// Shapefile with its companion files.
    Shp,
    /// LOLA's reduced data records.
    Lola,
    /// Points of the Orbital Data Explorer.
    Ode,
}

impl ShotFormat {
    /// Its names in site files and commands.
    pub const WORDS: [(&'static str, Self); 6] = [
        ("csv", Self::Csv),
        ("geojson", Self::Geojson),
        ("gpkg", Self::Gpkg),
        ("shp", Self::Shp),
        ("lola", Self::Lola),
        ("ode", Self::Ode),
    ];

    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        let word = Self::WORDS.iter().find(|(_, format)| *format == self);
        word.map_or("", |(word, _)| word)
    }
}

declare_table! {
    /// Optional products.
    pub struct ProductsConfig: Deserialize {
        /// Footprint formats in addition to `footprints.parquet`, which every site has; each format requires additional
        /// time and disk space. `areograph export` writes the same files from the products at any time.
        formats: Vec<ShotFormat> = key(list_or_none(words_of(
            ShotFormat::WORDS,
            [
                "footprints.csv and its PDS4 label",
                "footprints.geojson",
                "GeoPackage",
                "shapefile",
                "table for lrolola2isis and pc_align",
                "table for pc_align",
            ],
        )).each_once("each format once")).or(Vec::new()).unused(r#"["csv", "gpkg"]"#),
    }
}
