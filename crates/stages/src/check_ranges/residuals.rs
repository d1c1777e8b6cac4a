//! Range residuals of the shots of profiles, as columns.

use serde::{Deserialize, Serialize};

use areograph_base::column::Column;
use areograph_geom::range_residuals::RangeResiduals;

/// Residuals as columns, one entry per shot of a profile, metres.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ShotResiduals {
    /// Index of the profile.
    pub profile: Column<u32>,
    /// Row of the footprint.
    pub row: Column<u32>,
    /// Range − |SPK spacecraft − raw footprint|.
    pub range_minus_distance_m: Column<f64>,
    /// Range − |SPK spacecraft − crossover-corrected footprint|.
    pub range_minus_distance_crossover_m: Column<f64>,
    /// Range − |PEDR spacecraft − raw footprint|; NaN, as below, for shots of tables without a spacecraft.
    pub decoding_m: Column<f64>,
    /// PEDR spacecraft − SPK spacecraft, away from Mars.
    pub spacecraft_radial_m: Column<f64>,
    /// PEDR spacecraft − SPK spacecraft, along the flight.
    pub spacecraft_along_m: Column<f64>,
    /// PEDR spacecraft − SPK spacecraft, along the orbit's angular momentum.
    pub spacecraft_cross_m: Column<f64>,
    /// Whether range − distance is an outlier of its profile.
    pub outlier: Column<bool>,
}

impl ShotResiduals {
    /// Number of shots whose residuals are known.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.row.len()
    }

    /// Whether no shot has residuals.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.row.is_empty()
    }

    /// Appends the shots of another profile.
    pub(super) fn append(&mut self, mut other: Self) {
        self.profile.append(&mut other.profile);
        self.row.append(&mut other.row);
        self.range_minus_distance_m
            .append(&mut other.range_minus_distance_m);
        self.range_minus_distance_crossover_m
            .append(&mut other.range_minus_distance_crossover_m);
        self.decoding_m.append(&mut other.decoding_m);
        self.spacecraft_radial_m
            .append(&mut other.spacecraft_radial_m);
        self.spacecraft_along_m
            .append(&mut other.spacecraft_along_m);
        self.spacecraft_cross_m
            .append(&mut other.spacecraft_cross_m);
        self.outlier.append(&mut other.outlier);
    }

    pub(super) fn push(&mut self, profile: u32, row: u32, residuals: &RangeResiduals) {
        self.profile.push(profile);
        self.row.push(row);
        self.range_minus_distance_m
            .push(residuals.range_minus_distance_m);
        self.range_minus_distance_crossover_m
            .push(residuals.range_minus_distance_crossover_m);
        self.decoding_m.push(residuals.decoding_m);
        self.spacecraft_radial_m.push(residuals.spacecraft_m.x);
        self.spacecraft_along_m.push(residuals.spacecraft_m.y);
        self.spacecraft_cross_m.push(residuals.spacecraft_m.z);
    }
}
