//! Rows of a campaign: what its tables hold of every site, image, pair and profile.
//!
//! Values are in metres and radians here, as everywhere inside; tables convert them.

use areograph_base::body::Body;
use areograph_geom::uncertainty::{ResidualMoments, UncertaintyBudget};

/// All rows of a campaign, in the order of its sites.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CampaignRows {
    /// Sites.
    pub sites: Vec<SiteRow>,
    /// Images.
    pub images: Vec<ImageRow>,
    /// Pairs of images that share tie points.
    pub pairs: Vec<PairRow>,
    /// Profiles.
    pub profiles: Vec<ProfileRow>,
}

/// State of the products of a site.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SiteState {
    /// Products of the last run, complete and of this version.
    Published,
    /// The last run failed; products, if any, are of an earlier run and are not used.
    Failed,
    /// No run has finished.
    Absent,
    /// Damaged products, or products of a different version.
    Unusable,
}

impl SiteState {
    /// The state as tables write it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Failed => "failed",
            Self::Absent => "absent",
            Self::Unusable => "unusable",
        }
    }
}

/// A site.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteRow {
    /// Its identifier, which is the name of its folder.
    pub site: String,
    /// Mission phase of its first image; empty where unknown.
    pub phase: String,
    /// State of its products.
    pub state: SiteState,
    /// Verdict in words; empty without usable products.
    pub verdict: &'static str,
    /// Whether its products are usable and its verdict is valid, with or without remarks.
    pub is_valid: bool,
    /// Reasons of the verdict.
    pub reasons: Vec<String>,
    /// Remarks of the verdict.
    pub remarks: Vec<String>,
    /// Why there are no usable products; empty if there are.
    pub failure: String,
    /// The body.
    pub body: Body,
    /// East longitude and areocentric latitude, radians.
    pub place_rad: Option<[f64; 2]>,
    /// Images.
    pub images: u32,
    /// Pairs with common tie points.
    pub pairs: u32,
    /// Profiles.
    pub profiles: u32,
    /// Tie points.
    pub ties: u32,
    /// Footprints.
    pub footprints: u32,
    /// Its kernels.
    pub kernels: KernelSetName,
    /// BLAKE3 of the keys and values of its configuration.
    pub configuration_blake3: String,
    /// Fingerprint of the products.
    pub fingerprint: String,
    /// Version of areograph that wrote the products.
    pub version: String,
}

/// Kernels of a site.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct KernelSetName {
    /// The chosen set, or the names of the SPK files in use.
    pub name: String,
    /// BLAKE3 over roles and hashes of all kernels in use.
    pub blake3: String,
}

/// An image.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ImageRow {
    /// Its site.
    pub site: String,
    /// Verdict of the site; empty without usable products.
    pub verdict: &'static str,
    /// Whether the site is valid.
    pub is_valid: bool,
    /// Whether an earlier site of the campaign has the same image: an image counts once.
    pub is_repeated: bool,
    /// Identifier.
    pub image: String,
    /// Mission phase; empty where unknown.
    pub phase: String,
    /// Orbit of the phase.
    pub orbit: Option<u32>,
    /// UTC of the first line.
    pub utc_start: String,
    /// Name of the camera.
    pub camera: String,
    /// Summing across and along the track; 0 where unknown.
    pub summing: [u32; 2],
    /// Exposure of one detector line, seconds.
    pub exposure_s: Option<f64>,
    /// Emission at the centre, radians.
    pub emission_rad: Option<f64>,
    /// Incidence at the centre, radians.
    pub incidence_rad: Option<f64>,
    /// Angle between boresight and nadir at the camera, radians.
    pub off_nadir_rad: Option<f64>,
    /// East longitude and areocentric latitude of the centre, radians.
    pub place_rad: Option<[f64; 2]>,
    /// Results; `None` without usable products.
    pub oriented: Option<OrientedImageRow>,
}

/// Results of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct OrientedImageRow {
    /// Lines of the header image.
    pub lines: u32,
    /// Samples.
    pub samples: u32,
    /// Distance of successive lines on the ground, metres.
    pub line_spacing_m: Option<f64>,
    /// Width of a pixel on the ground, metres.
    pub pixel_size_m: Option<f64>,
    /// Polynomials of order 1 and 2.
    pub rmse: [PolynomialRmse; 2],
    /// Footprints with a line in the image.
    pub registered: u32,
    /// Footprints that the delivered image shows.
    pub inside: u32,
    /// The profile with the most shots during the exposure; empty without any.
    pub simultaneous: String,
    /// Its shots during the exposure.
    pub simultaneous_shots: u32,
    /// Median distance of its successive footprints, metres.
    pub shot_spacing_m: Option<f64>,
    /// Reasons why the image is invalid.
    pub invalid_because: String,
}

/// Root mean square residuals of an orientation about polynomials (Table 4 of Shan et al. 2005).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PolynomialRmse {
    /// Of X, Y and Z, metres.
    pub position_m: [f64; 3],
    /// Of ω, φ and κ, radians.
    pub angles_rad: [f64; 3],
}

/// A pair of images.
#[derive(Debug, Clone, PartialEq)]
pub struct PairRow {
    /// Its site.
    pub site: String,
    /// Verdict of the site.
    pub verdict: &'static str,
    /// Whether the site is valid.
    pub is_valid: bool,
    /// Whether an earlier site of the campaign has the same pair: a pair counts once.
    pub is_repeated: bool,
    /// Identifiers in the order of the site.
    pub images: [String; 2],
    /// Mission phases; empty where unknown.
    pub phases: [String; 2],
    /// UTC of the first line of each.
    pub utc_start: [String; 2],
    /// Emission of each, radians.
    pub emission_rad: [Option<f64>; 2],
    /// Latitude of the centre of the first image, radians.
    pub latitude_rad: Option<f64>,
    /// Summing across the track of each; 0 where unknown.
    pub summing: [u32; 2],
    /// Median angle between the rays of a tie point, radians.
    pub convergence_rad: f64,
    /// Flying height over base.
    pub height_over_base: f64,
    /// Mean line spacing of both images, metres: the pixel of the budget.
    pub pixel_size_m: f64,
    /// Median distance of successive footprints, metres.
    pub shot_spacing_m: Option<f64>,
    /// Displacement along the track per second of an offset of the attitude clock, metres per second; `None` where the
    /// pair shows none.
    pub clock_m_s: Option<f64>,
    /// With the orientation from the kernels.
    pub before: PairState,
    /// With the adjusted orientation.
    pub after: Option<PairState>,
    /// The budget of eq. 5 to 9 before the adjustment, or the reason why there is none.
    pub budget: Result<UncertaintyBudget, String>,
    /// Kernels of the site.
    pub kernels: KernelSetName,
}

/// A pair with one orientation.
#[derive(Debug, Clone, PartialEq)]
pub struct PairState {
    /// Intersected tie points of both images.
    pub ties: u32,
    /// Displacement of the tie points along the flight, first minus second image, metres; `None` where the pair shows
    /// none.
    pub ties_along_m: Option<Measured>,
    /// Its size, metres.
    pub along_track_parallax_m: f64,
    /// Reprojection residuals of each image (Table 5 of Shan et al. 2005), lines and pixels.
    pub residuals: [ResidualMoments; 2],
    /// Misregistration of the footprints.
    pub misregistration: Option<PairMisregistration>,
    /// Heights of the tie points of the pair above the laser surface.
    pub heights: Option<PairHeights>,
}

/// A value with its standard deviation, in one unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The value.
    pub value: f64,
    /// Its standard deviation; `None` where unknown.
    pub sigma: Option<f64>,
}

/// Misregistration of the footprints of a pair: their position in the second image, transferred from the first by tie
/// points, minus their projected position; means over the footprints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairMisregistration {
    /// Footprints.
    pub footprints: u32,
    /// Along the track, lines of the second image.
    pub along_lines: f64,
    /// Along the track, metres.
    pub along_m: Measured,
    /// Across the track, pixels of the second image.
    pub across_px: f64,
    /// Across the track, metres.
    pub across_m: Measured,
    /// Along the track in distances of successive footprints, the MOLA GSD of Shan et al. 2005.
    pub along_spacings: Option<f64>,
}

/// Heights of tie points above the laser surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairHeights {
    /// Tie points.
    pub n: u32,
    /// Mean, metres.
    pub mean_m: f64,
    /// Root mean square, metres.
    pub rms_m: f64,
    /// Standard deviation of the mean of all tie points of the site due to the surface, metres.
    pub mean_sigma_m: f64,
}

/// A profile.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileRow {
    /// Its site.
    pub site: String,
    /// Verdict of the site.
    pub verdict: &'static str,
    /// Whether the site is valid.
    pub is_valid: bool,
    /// Whether another site with a common image has the profile of the same orbit: one counts.
    pub is_repeated: bool,
    /// Mission phase of the simultaneous image, or else of the first image of the site; empty where unknown.
    pub phase: String,
    /// Identifier.
    pub profile: String,
    /// Orbit number in the PEDR file.
    pub orbit: u32,
    /// The image with the most shots of the profile during its exposure; empty without any.
    pub image: String,
    /// Median angle of the beam off nadir, radians.
    pub off_nadir_rad: f64,
    /// Range minus distance of all shots.
    pub ranges: RangeStatistics,
    /// Its mean without outliers, metres.
    pub mean_without_outliers_m: f64,
    /// Outliers.
    pub outliers: u32,
    /// Range minus distance of the shots that the simultaneous image shows; no shots without such an image.
    pub in_image: RangeStatistics,
    /// Mean difference of spacecraft positions, PEDR file minus kernels: radial, along and cross, metres.
    pub spacecraft_m: [f64; 3],
    /// Whether the profile has enough shots to be judged.
    pub is_judged: bool,
    /// Why its ranges are invalid; empty if they are not.
    pub invalid_because: String,
    /// Why the laser surface does not use the profile; empty if it does.
    pub rejected_because: String,
    /// Kernels of the site.
    pub kernels: KernelSetName,
}

/// Number, mean and standard deviation of range minus distance, metres (Table 3 of Shan et al. 2005).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RangeStatistics {
    /// Shots.
    pub n: u32,
    /// Mean.
    pub mean_m: f64,
    /// Standard deviation with divisor n − 1.
    pub deviation_m: f64,
}
