//! Laser footprints as columns, from the PEDR reader to the Parquet writer.
//!
//! ```
//! use areograph_base::footprints::{AsRead, Footprints};
//!
//! let footprints = Footprints::<AsRead>::new(Vec::new());
//! assert!(footprints.is_empty());
//! assert!(footprints.topography_m().is_empty());
//! ```
//!
//! Footprints with the coordinates of their files are a separate type, and not accepted as footprints in the
//! frame of the products:
//!
//! ```compile_fail,E0308
//! use areograph_base::{
//!     footprints::{AsRead, Footprints},
//!     frames::BodyFixed,
//! };
//!
//! fn mean_radius_m(footprints: &Footprints<BodyFixed>) -> f64 {
//!     footprints.radius_m.iter().sum::<f64>() / footprints.len() as f64
//! }
//!
//! mean_radius_m(&Footprints::<AsRead>::new(Vec::new()));
//! ```

use std::marker::PhantomData;

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    altimetry::GroundRadius,
    body::{Body, Datum},
    column::Column,
};

/// State of footprint coordinates as in their files; each file states its datum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AsRead;

/// A PEDR file or table of shots that footprints came from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourceFile {
    /// File name without folders: the location of a file does not affect the results.
    pub name: String,
    /// Version letter of the file name in upper case, `None` when the name has none.
    pub version: Option<char>,
    /// Datum of the file's longitudes and latitudes.
    pub datum: Datum,
    /// BLAKE3 of the file's bytes, hexadecimal.
    pub blake3: String,
    /// Whether it is a table of shots, which need not state the spacecraft. PEDR files do.
    pub is_table: bool,
}

/// Control of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum AdjustmentModel {
    /// Heights of tie points from the MOLA surface; orientations from the a priori orbit and attitude.
    MolaSurface,
    /// As published: image coordinates of footprints constrain the orientations, and one standard deviation per image
    /// applies to all unknowns (Yoon & Shan 2004).
    Published,
}

impl AdjustmentModel {
    /// Every model, with its name in the configuration.
    pub const WORDS: [(&'static str, Self); 2] = [
        ("mola_surface", Self::MolaSurface),
        ("published", Self::Published),
    ];

    /// Its name in the configuration.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::MolaSurface => "mola_surface",
            Self::Published => "published",
        }
    }
}

/// Use of the image coordinates of footprints in an adjustment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum FootprintImageCoordinates {
    /// Observations with their own standard deviations, as in Yoon & Shan 2004.
    Weighted,
    /// Nothing.
    Off,
    /// Projections with the adjusted orientation instead of observations: a coordinate that follows the orientation
    /// has no residual, no weight, no degree of freedom and no covariance.
    Reproject,
}

impl FootprintImageCoordinates {
    /// Every mode, with its name in the configuration.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("weighted", Self::Weighted),
        ("off", Self::Off),
        ("reproject", Self::Reproject),
    ];
}

macro_rules! columns {
    ($($(#[$doc:meta])* $column:ident: $kind:ty,)*) => {
        /// One shot, for building columns and for messages.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Footprint { $($(#[$doc])* pub $column: $kind,)* }

        /// Footprints of a site, one entry per shot in every column, ordered by file, record and shot.
        ///
        /// `D` is the state of the coordinates: [`AsRead`] or a frame such as
        /// [`BodyFixed`](crate::frames::BodyFixed). Only `stages::convert_datum` changes it, so converting twice does
        /// not compile.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct Footprints<D> {
            /// The files to which `file` refers by index.
            pub files: Vec<SourceFile>,
            /// The body of the footprints.
            pub body: Body,
            /// Which radius represents the ground.
            pub ground: GroundRadius,
            $($(#[$doc])* pub $column: Column<$kind>,)*
            datum: PhantomData<D>,
        }

        impl<D> Footprints<D> {
            /// No footprints on Mars yet, from these files.
            #[must_use]
            pub const fn new(files: Vec<SourceFile>) -> Self {
                Self::on(Body::Mars, files)
            }

            /// No footprints on `body` yet, from these files.
            #[must_use]
            pub const fn on(body: Body, files: Vec<SourceFile>) -> Self {
                Self { files, body, ground: GroundRadius::Corrected, $($column: Column::new(),)* datum: PhantomData }
            }

            /// Appends one shot.
            pub fn push(&mut self, footprint: &Footprint) {
                $(self.$column.push(footprint.$column);)*
            }

            /// Appends all shots of `other`, which must refer to the same files.
            pub fn append(&mut self, mut other: Self) {
                $(self.$column.append(&mut other.$column);)*
            }

            /// Removes and returns the shots from row `row` on, counted from 0.
            ///
            /// # Panics
            /// If there are fewer rows.
            #[must_use]
            pub fn split_off(&mut self, row: usize) -> Self {
                Self {
                    files: self.files.clone(),
                    body: self.body,
                    ground: self.ground,
                    $($column: self.$column.split_off(row),)*
                    datum: PhantomData,
                }
            }

            /// The shot in row `row`, counted from 0.
            ///
            /// # Panics
            /// If the row does not exist.
            #[must_use]
            pub fn row(&self, row: usize) -> Footprint {
                Footprint { $($column: self.$column.at(row),)* }
            }

            /// The columns, with coordinates declared to belong to `E`.
            ///
            /// For the stage that converts the coordinates, and for the reader of its product.
            #[must_use]
            pub fn declare<E>(self) -> Footprints<E> {
                Footprints { files: self.files, body: self.body, ground: self.ground, $($column: self.$column,)* datum: PhantomData }
            }
        }
    };
}

columns! {
    /// Time tag of the shot in the file, ET seconds.
    et_tag_s: f64,
    /// Time of the shot after the MOLA clock correction, ET seconds.
    et_s: f64,
    /// Orbit number of the frame.
    orbit: u32,
    /// Index into `files`.
    file: u16,
    /// Record of the file, counted from 1 with the label records.
    record: u32,
    /// Shot in the frame, 1 to 20.
    shot: u8,
    /// East longitude, radians, `0..2π`, parallax corrected.
    longitude_rad: f64,
    /// Areocentric latitude, radians, parallax corrected.
    latitude_rad: f64,
    /// Planetary radius before the crossover correction, metres.
    radius_m: f64,
    /// Planetary radius after the crossover correction, metres.
    radius_crossover_m: f64,
    /// Areoid radius, metres.
    areoid_radius_m: f64,
    /// One-way range to the spacecraft's centre of mass, metres.
    range_m: f64,
    /// East longitude of the spacecraft in the file's own orbit solution, radians.
    spacecraft_longitude_rad: f64,
    /// Areocentric latitude of the spacecraft in the file's own orbit solution, radians.
    spacecraft_latitude_rad: f64,
    /// Distance of the spacecraft from the centre of Mars in the file's own orbit solution, metres.
    spacecraft_radius_m: f64,
    /// Off-nadir angle of the laser, radians.
    off_nadir_rad: f64,
    /// Trigger channel, 1 to 4 (other values are kept as found).
    channel: u8,
    /// Classification: 1 ground, 0 cloud or noise.
    class: i16,
    /// 0 attitude known, 2 known for part of the frame, 3 unknown (footprint assumes nadir).
    attitude_flag: u16,
    /// 0 orbit from JPL, 1 or more: MOLA team's gravity model number.
    orbit_quality: u16,
    /// Bit `i` set: the shot lies in window `i` of the site.
    windows: u64,
}

impl<D> Footprints<D> {
    /// Height of every shot above the areoid, after the crossover correction, metres.
    #[must_use]
    pub fn topography_m(&self) -> Vec<f64> {
        (0..self.len())
            .map(|row| self.topography_of_m(row))
            .collect()
    }

    /// Height of the shot in row `row` above the areoid, after the crossover correction, metres.
    ///
    /// # Panics
    /// If the row does not exist.
    #[must_use]
    pub fn topography_of_m(&self, row: usize) -> f64 {
        self.radius_crossover_m.at(row) - self.areoid_radius_m.at(row)
    }

    /// The windows that contain at least one of these rows, as bits in the order of the site's windows.
    ///
    /// # Panics
    /// If a row does not exist.
    #[must_use]
    pub fn windows_of(&self, rows: &[u32]) -> u64 {
        let masks = rows.iter().map(|row| self.windows.at(*row as usize));
        masks.fold(0, |all, mask| all | mask)
    }

    /// Radius of the ground by the shot in row `row`, metres: the one that all stages use.
    ///
    /// # Panics
    /// If the row does not exist.
    #[must_use]
    pub fn ground_radius_m(&self, row: usize) -> f64 {
        match self.ground {
            GroundRadius::Corrected => self.radius_crossover_m.at(row),
            GroundRadius::Raw => self.radius_m.at(row),
        }
    }

    /// Which of two radii represents the ground; `None` without a PEDR file, since tables of shots have one radius.
    #[must_use]
    pub fn ground_choice(&self) -> Option<GroundRadius> {
        let has_both = self.files.iter().any(|file| !file.is_table);
        has_both.then_some(self.ground)
    }

    /// Number of shots.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.et_tag_s.len()
    }

    /// Whether there are no shots.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.et_tag_s.is_empty()
    }
}
