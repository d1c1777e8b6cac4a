//! Messages of binary ISIS control networks (Protocol Buffers).
//!
//! A file begins with a label of [`LABEL_BYTES`] bytes, which states the version and where header and points are. In version
//! 2 the header states the size of every point; in version 5 each point follows its size, four bytes, least significant
//! first. Fields that areograph neither reads nor writes are omitted here; readers skip them.
//!
//! Source: `ControlNetFileHeaderV0002.proto`, `ControlNetFileHeaderV0005.proto`, `ControlPointFileEntryV0002.proto` and
//! `ControlNetVersioner.cpp` of ISIS.

/// Size of the label, and the place of the header after it.
pub const LABEL_BYTES: usize = 65_536;
/// Version that ISIS writes today.
pub const VERSION: u32 = 5;

/// Types of points: free (image to image), constrained and fixed (image to ground), and the names of old networks.
pub mod point_type {
    /// Obsolete word for free.
    pub const TIE: i32 = 0;
    /// Obsolete word for fixed.
    pub const GROUND: i32 = 1;
    /// The ground coordinates are unknown.
    pub const FREE: i32 = 2;
    /// The ground coordinates are known with a covariance.
    pub const CONSTRAINED: i32 = 3;
    /// The ground coordinates are known.
    pub const FIXED: i32 = 4;
}

/// Sources of a priori coordinates.
pub mod apriori_source {
    /// Stated by a user.
    pub const USER: i32 = 1;
    /// Intersected from the measures.
    pub const AVERAGE_OF_MEASURES: i32 = 2;
}

/// Type of a measure that was registered to parts of a pixel.
pub const REGISTERED_SUB_PIXEL: i32 = 3;

/// Header of a version 2 network.
#[derive(Clone, PartialEq, prost::Message)]
pub struct HeaderV2 {
    /// Size of every point, bytes.
    #[prost(int32, repeated, packed = "true", tag = "7")]
    pub point_sizes: Vec<i32>,
}

/// Header of a version 5 network.
#[derive(Clone, PartialEq, prost::Message)]
pub struct HeaderV5 {
    /// Identifier.
    #[prost(string, required, tag = "1")]
    pub network_id: String,
    /// Name of the body.
    #[prost(string, required, tag = "2")]
    pub target_name: String,
    /// UTC, ISO 8601.
    #[prost(string, optional, tag = "3")]
    pub created: Option<String>,
    /// UTC, ISO 8601.
    #[prost(string, optional, tag = "4")]
    pub last_modified: Option<String>,
    /// Description.
    #[prost(string, optional, tag = "5")]
    pub description: Option<String>,
    /// Name of the user or program.
    #[prost(string, optional, tag = "6")]
    pub user_name: Option<String>,
}

/// A point of a network; coordinates are body-fixed, metres, covariances the upper triangles of their matrices, m².
#[derive(Clone, PartialEq, prost::Message)]
pub struct PointEntry {
    /// Identifier; ISIS writes Latin-1 and reads UTF-8.
    #[prost(bytes = "vec", required, tag = "1")]
    pub id: Vec<u8>,
    /// One of [`point_type`].
    #[prost(int32, required, tag = "2")]
    pub point_type: i32,
    /// Whether it takes no part in an adjustment.
    #[prost(bool, optional, tag = "6")]
    pub ignore: Option<bool>,
    /// Whether an adjustment rejected it; `jigsaw` clears this flag before the next adjustment.
    #[prost(bool, optional, tag = "7")]
    pub jigsaw_rejected: Option<bool>,
    /// Source of the a priori coordinates, one of [`apriori_source`].
    #[prost(int32, optional, tag = "9")]
    pub apriori_source: Option<i32>,
    /// Source of the a priori radius, one of [`apriori_source`].
    #[prost(int32, optional, tag = "11")]
    pub apriori_radius_source: Option<i32>,
    /// Whether the latitude is constrained.
    #[prost(bool, optional, tag = "13")]
    pub latitude_constrained: Option<bool>,
    /// Whether the longitude is constrained.
    #[prost(bool, optional, tag = "14")]
    pub longitude_constrained: Option<bool>,
    /// Whether the radius is constrained.
    #[prost(bool, optional, tag = "15")]
    pub radius_constrained: Option<bool>,
    /// A priori X.
    #[prost(double, optional, tag = "16")]
    pub apriori_x_m: Option<f64>,
    /// A priori Y.
    #[prost(double, optional, tag = "17")]
    pub apriori_y_m: Option<f64>,
    /// A priori Z.
    #[prost(double, optional, tag = "18")]
    pub apriori_z_m: Option<f64>,
    /// A priori covariance.
    #[prost(double, repeated, packed = "true", tag = "19")]
    pub apriori_covariance_m2: Vec<f64>,
    /// Adjusted X.
    #[prost(double, optional, tag = "20")]
    pub adjusted_x_m: Option<f64>,
    /// Adjusted Y.
    #[prost(double, optional, tag = "21")]
    pub adjusted_y_m: Option<f64>,
    /// Adjusted Z.
    #[prost(double, optional, tag = "22")]
    pub adjusted_z_m: Option<f64>,
    /// Covariance of the adjusted coordinates.
    #[prost(double, repeated, packed = "true", tag = "23")]
    pub adjusted_covariance_m2: Vec<f64>,
    /// Its measures.
    #[prost(message, repeated, tag = "25")]
    pub measures: Vec<MeasureEntry>,
}

/// A measure of a point; lines and samples have the middle of the first pixel at 1.
#[derive(Clone, PartialEq, prost::Message)]
pub struct MeasureEntry {
    /// Serial number of the image, as the identifier.
    #[prost(bytes = "vec", required, tag = "1")]
    pub serial_number: Vec<u8>,
    /// Type, such as [`REGISTERED_SUB_PIXEL`].
    #[prost(int32, required, tag = "2")]
    pub measure_type: i32,
    /// Sample.
    #[prost(double, optional, tag = "3")]
    pub sample: Option<f64>,
    /// Line.
    #[prost(double, optional, tag = "4")]
    pub line: Option<f64>,
    /// Measured minus adjusted sample, pixels.
    #[prost(double, optional, tag = "5")]
    pub sample_residual_px: Option<f64>,
    /// Measured minus adjusted line, pixels.
    #[prost(double, optional, tag = "6")]
    pub line_residual_px: Option<f64>,
    /// Whether it takes no part in an adjustment.
    #[prost(bool, optional, tag = "10")]
    pub ignore: Option<bool>,
    /// Whether an adjustment rejected it.
    #[prost(bool, optional, tag = "11")]
    pub jigsaw_rejected: Option<bool>,
    /// Standard deviation of the sample, pixels.
    #[prost(double, optional, tag = "15")]
    pub sample_sigma_px: Option<f64>,
    /// Standard deviation of the line, pixels.
    #[prost(double, optional, tag = "16")]
    pub line_sigma_px: Option<f64>,
}
