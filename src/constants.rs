//! Constants of the mission, each with its source and sign.

/// NAIF id of the Mars Global Surveyor spacecraft and of its clock.
pub const NAIF_MGS: i32 = -94;
/// NAIF id of the spacecraft bus frame `MGS_SPACECRAFT` and of its attitude kernels.
pub const NAIF_MGS_BUS: i32 = -94_000;
/// NAIF id of the frame `IAU_MARS`.
pub const NAIF_IAU_MARS: i32 = 10_014;
/// NAIF id of the centre of Mars.
pub const NAIF_MARS: i32 = 499;
/// NAIF id of the Sun.
pub const NAIF_SUN: i32 = 10;

/// Rotation and shape of Mars in one IAU report.
///
/// `ra = ra0 + ra1·T`, `dec = dec0 + dec1·T`, `W = w0 + w1·d`, with `T` in Julian centuries of
/// 36 525 days and `d` in days of TDB past J2000; body-fixed from J2000 is
/// `[W]₃ [90° − dec]₁ [90° + ra]₃`, each a rotation of the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarsModel {
    /// Name as configuration and products write it.
    pub name: &'static str,
    /// Right ascension of the pole at J2000, degrees.
    pub pole_ra_deg: f64,
    /// Its rate, degrees per Julian century.
    pub pole_ra_deg_per_century: f64,
    /// Declination of the pole at J2000, degrees.
    pub pole_dec_deg: f64,
    /// Its rate, degrees per Julian century.
    pub pole_dec_deg_per_century: f64,
    /// Prime meridian at J2000, degrees.
    pub meridian_deg: f64,
    /// Rotation rate, degrees per day.
    pub meridian_deg_per_day: f64,
    /// Equatorial radius, metres.
    pub equatorial_radius_m: f64,
    /// Polar radius, metres.
    pub polar_radius_m: f64,
}

/// Mars in the 1991 IAU report, the likely "IAU 1991" of MOLA products before version L.
///
/// Source: NAIF's test planetary constants; W₀ = 176.868° also in the "old values" of `mars_iau2000_v0.tpc`.
pub const MARS_IAU1991: MarsModel = MarsModel {
    name: "iau1991",
    pole_ra_deg: 317.681,
    pole_ra_deg_per_century: -0.108,
    pole_dec_deg: 52.886,
    pole_dec_deg_per_century: -0.061,
    meridian_deg: 176.868,
    meridian_deg_per_day: 350.891_983_0,
    equatorial_radius_m: 3_397_000.0,
    polar_radius_m: 3_375_000.0,
};

/// Mars in the 1994 IAU report: `pck00005`, and the `pck00006` that Shan et al. 2005 calls IAU 1991.
///
/// Source: the 1994 values quoted in NAIF's `pck00008.tpc`.
pub const MARS_IAU1994: MarsModel = MarsModel {
    name: "iau1994",
    meridian_deg: 176.901,
    ..MARS_IAU1991
};

/// Mars in the 2000 IAU report, the frame of every areograph product.
///
/// Source: `mars_iau2000_v0.tpc`, `pck00008.tpc` to `pck00010.tpc`.
pub const MARS_IAU2000: MarsModel = MarsModel {
    name: "iau2000",
    pole_ra_deg: 317.681_43,
    pole_ra_deg_per_century: -0.106_1,
    pole_dec_deg: 52.886_50,
    pole_dec_deg_per_century: -0.060_9,
    meridian_deg: 176.630,
    meridian_deg_per_day: 350.891_982_26,
    equatorial_radius_m: 3_396_190.0,
    polar_radius_m: 3_376_200.0,
};
