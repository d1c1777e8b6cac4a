//! Range residuals of the shots of profiles, as columns.

use serde::{Deserialize, Serialize};

use areograph_geom::range_residuals::RangeResiduals;

/// Residuals as columns, one entry per shot of a profile, metres.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ShotResiduals {
    /// Index of the profile.
    #[serde(with = "areograph_base::packed")]
    pub profile: Vec<u32>,
    /// Row of the footprint.
    #[serde(with = "areograph_base::packed")]
    pub row: Vec<u32>,
    /// Range − |SPK spacecraft − raw footprint|.
    #[serde(with = "areograph_base::packed")]
    pub range_minus_distance_m: Vec<f64>,
    /// Range − |SPK spacecraft − crossover-corrected footprint|.
    #[serde(with = "areograph_base::packed")]
    pub range_minus_distance_crossover_m: Vec<f64>,
    /// Range − |PEDR spacecraft − raw footprint|; NaN, as below, for shots of tables without a spacecraft.
    #[serde(with = "areograph_base::packed")]
    pub decoding_m: Vec<f64>,
    /// PEDR spacecraft − SPK spacecraft, away from Mars.
    #[serde(with = "areograph_base::packed")]
    pub spacecraft_radial_m: Vec<f64>,
    /// PEDR spacecraft − SPK spacecraft, along the flight.
    #[serde(with = "areograph_base::packed")]
    pub spacecraft_along_m: Vec<f64>,
    /// PEDR spacecraft − SPK spacecraft, along the orbit's angular momentum.
    #[serde(with = "areograph_base::packed")]
    pub spacecraft_cross_m: Vec<f64>,
    /// Whether range − distance is an outlier of its profile.
    #[serde(with = "areograph_base::packed")]
    pub outlier: Vec<bool>,
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
    pub(super) fn append(&mut self, other: Self) {
        let Self {
            profile,
            row,
            range_minus_distance_m,
            range_minus_distance_crossover_m,
            decoding_m,
            spacecraft_radial_m,
            spacecraft_along_m,
            spacecraft_cross_m,
            outlier,
        } = other;
        self.profile.extend(profile);
        self.row.extend(row);
        self.range_minus_distance_m.extend(range_minus_distance_m);
        self.range_minus_distance_crossover_m
            .extend(range_minus_distance_crossover_m);
        self.decoding_m.extend(decoding_m);
        self.spacecraft_radial_m.extend(spacecraft_radial_m);
        self.spacecraft_along_m.extend(spacecraft_along_m);
        self.spacecraft_cross_m.extend(spacecraft_cross_m);
        self.outlier.extend(outlier);
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
