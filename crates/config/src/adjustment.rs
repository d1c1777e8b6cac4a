//! `[adjustment]`.

use serde::Deserialize;

use areograph_base::{
    constants::Spacecraft,
    footprints::{AdjustmentModel, FootprintImageCoordinates},
    units::{RADIANS_PER_ARCSECOND, SECONDS_PER_MS},
};
use areograph_geom::{readings::Cause, robust::RobustWeight, statistics::BAARDA_LIMIT};

use super::{
    boresight::{BORESIGHT_FILE, BoresightStatements},
    declare::{Declare as _, Keys, Many, declare_table, group, key, tables},
    forms::{
        Number, Several, above_to, from_to, identifier, several, words, words_of, yes_or_no,
        zero_or,
    },
    readings::{DECISION_FILE, ReadingsDecision},
    relief::ReliefForPlan,
    unknowns::{PositionUnknowns, RotationUnknowns},
};

/// Standard deviations of observations. Values below a micrometre or a millionth of a pixel are unrealistic, and all
/// others would be lost in rounding.
pub(super) const SIGMA: Number = from_to(1e-6, 1e6);
/// Standard deviations of unknowns; 0 removes the unknown.
const SIGMA_OR_NONE: Number = zero_or(1e-6, 1e6);
/// Standard deviations of orientation unknowns: 0 holds fixed, infinity leaves free.
const SIGMA_OR_FREE: Number = zero_or(1e-6, f64::INFINITY);
/// Standard deviations along and across the track.
const SIGMAS: Several<Number, 2> = several(SIGMA, "2 numbers");
/// Standard deviations of three quantities, each with three powers of time.
const SIGMAS_OF_POWERS: Several<Number, 9> = several(SIGMA_OR_FREE, "9 numbers");

/// Standard deviations of the three powers of time.
const SIGMAS_OF_TIME: Several<Number, 3> = several(SIGMA_OR_FREE, "3 numbers");

declare_table! {
    /// Combined adjustment of images, laser shots and tie points. Defaults that cite Yoon & Shan 2004 are
    /// the standard deviations of that paper.
    pub struct AdjustmentConfig: Deserialize {
        /// Control of the adjustment. The published model (Yoon & Shan 2004) is provided for comparison: image
        /// coordinates of footprints, computed from the orientations under adjustment, hold these orientations fixed.
        /// Along the track, the model agrees with the paper. Across the track, residuals refer to the line that sees
        /// the point, whereas the paper uses the measured line. The mean across-track corrections of footprints, 2.7 to
        /// 3.3 px in the paper, are therefore 0, and the standard deviation of unit weight is about half of the
        /// published value.
        model: AdjustmentModel = key(words_of(
            AdjustmentModel::WORDS,
            [
                "the MOLA surface controls the heights of tie points, and the a priori orbit and attitude control \
                the orientations",
                "image coordinates of footprints are observations, with one standard deviation per image (Yoon & Shan 2004)",
            ],
        )).or(AdjustmentModel::MolaSurface),
        /// Standard deviations of tie point measurements, along and across the track, in the focal plane (Yoon & Shan
        /// 2004); standard deviations in a tie point file take precedence.
        tie_sigma_px: [f64; 2] = key(SIGMAS).or([1.0, 1.0]),
        /// Standard deviations of X, Y and Z of every image for the powers 0, 1 and 2 of t; t is 0 in the middle of the
        /// image and 1 at its end. An unknown is free with inf and fixed with 0. Without this key, each image has the
        /// values of its spacecraft (`config/spacecraft`), here those of Mars Global Surveyor: the orbits of three
        /// producers differ by up to 50 m (Shan et al. 2005), and orbit errors vary from revolution to revolution. For
        /// Mars Express, the values are 1000, 100 and 0 m (Li et al. 2023); recent orbits are more accurate.
        position_sigma_m: Option<[f64; 3]> = key(SIGMAS_OF_TIME).unused("[25.0, 0.2, 0.0]"),
        /// Standard deviations of the rotations about the camera axes for the powers 0, 1 and 2 of t, as in
        /// `position_sigma_m`. For Mars Global Surveyor, the constant term (0.4 mrad, or 150 m on the ground)
        /// corresponds to the along-track distances between the images of a pair, and the drift terms correspond to the
        /// residuals of the attitude. For Mars Express, the constant term is 90 arc seconds (Li et al. 2023).
        rotation_sigma_rad as "rotation_sigma_arcsec": Option<[f64; 3]> = key(SIGMAS_OF_TIME)
            .unused("[82.5, 2.0, 2.0]")
            .map(|sigmas| sigmas.map(|sigmas| sigmas.map(|sigma| sigma * RADIANS_PER_ARCSECOND))),
        /// Position unknowns of every image, as powers of t (spsolve in jigsaw); higher powers are not estimated,
        /// regardless of their standard deviations.
        position_unknowns: PositionUnknowns = key(words_of(
            PositionUnknowns::WORDS,
            ["", "a constant", "a constant and a linear term in t", "a constant, a linear and a quadratic term in t"],
        )).or(PositionUnknowns::Acceleration),
        /// Rotation unknowns of every image, as powers of t (camsolve in jigsaw).
        rotation_unknowns: RotationUnknowns = key(words_of(
            RotationUnknowns::WORDS,
            ["", "constants", "constants and linear terms in t", "constants, linear and quadratic terms in t"],
        )).or(RotationUnknowns::Acceleration),
        /// Standard deviation of a common delay of all lines of an image. Tie points cannot separate this delay from
        /// pitch: the delay is not an unknown, and `rotation_sigma_arcsec` accounts for both. The stated standard
        /// deviations of camera positions along the track include the delay. The default, 45 ms, corresponds to half
        /// the along-track disagreement between the images of a pair (Shan et al. 2005, Table 5); 0 assumes exact line
        /// times. If `time_bias_sigma_ms`, `attitude_clock` or `boresight_line_time_sigma_ms` is used, it replaces this
        /// key.
        line_time_sigma_s as "line_time_sigma_ms": f64 = key(SIGMA_OR_NONE)
            .or(45.0)
            .map(|milliseconds| milliseconds * SECONDS_PER_MS),
        /// Whether the along-track disagreement between the images of a pair is attributed to one time offset of the
        /// attitudes of all images. This offset rotates nadir-following images, but not inertially held images.
        /// Otherwise, all images are equally likely to be in error. Tie points of one pair cannot distinguish the two
        /// causes: this key is a decision, not an estimate; see `readings`. Where the images of a pair disagree by
        /// more than 100 m, the report and adjustment.json give both results.
        attitude_clock: bool = key(yes_or_no(
            "all images are equally likely to be in error",
            "nadir-following images are in error by one common offset",
        )).or(false),
        /// File with the result that `areograph compare-readings --toml` printed for many pairs of images. This result
        /// decides `attitude_clock`: "yes" if the pairs support one offset, otherwise "no".
        readings: Option<ReadingsDecision> = key(DECISION_FILE).unused(r#""readings.toml""#),
        /// Standard deviation of the time offset of the attitudes (`attitude_clock`).
        attitude_clock_sigma_s: f64 = key(SIGMA).or(1.0),
        /// Upper limit of the standard deviations of constant image rotations with `attitude_clock`. The default
        /// corresponds to 0.1 mrad. A clock offset explains nothing if the rotations alone can absorb the disagreement.
        attitude_clock_rotation_sigma_rad as "attitude_clock_rotation_sigma_arcsec": f64 = key(SIGMA)
            .or(20.6)
            .map(|sigma| sigma * RADIANS_PER_ARCSECOND),
        /// Whether the a priori position of an image exposed during a profile is taken from the PEDR file, not from the
        /// kernels: camera and altimeter then share one orbit. The range check reports the distance between the two
        /// orbits.
        orbit_of_pedr: bool = key(yes_or_no(
            "the orbit from the kernels",
            "the orbit from the kernels, shifted by its mean difference from the PEDR orbit over the profile",
        )).or(false),
        /// Whether heights of tie points on slopes of the MOLA surface also determine the plan positions of the images. Each
        /// profile may then be offset in plan by `laser_surface.profile_plan_sigma_m`, less what its crossovers show. Relief
        /// is precise on rough ground, with precise tie points, and with many profiles near them. "auto" adjusts without and with
        /// relief, and uses relief where the stated standard deviations of the mean position decrease by at least a quarter
        /// on one axis.
        relief_for_plan: ReliefForPlan = key(words_of(
            ReliefForPlan::WORDS,
            [
                "relief is used where it makes the position more precise",
                "each profile may be offset in plan, and tie points shift until their heights fit",
                "slopes only increase the uncertainty of heights",
            ],
        )).or(ReliefForPlan::Auto),
        /// Whether the position of a laser spot in a simultaneous image is an observation: the mounting of camera and
        /// laser on one bus determines this position, regardless of the attitude. The option requires profiles that are
        /// simultaneous with the images and whose positions are known to `laser_surface.profile_plan_sigma_m`. Each
        /// profile may then be offset in plan, and the laser boresight may differ from the altimeter file and the frame
        /// kernels.
        common_bus: bool = key(yes_or_no(
            "footprints do not constrain the attitude",
            "the mounting determines the position of a footprint in the simultaneous image",
        )).or(false),
        /// Standard deviation of the two boresight angles of the laser, which apply to all images. The default
        /// corresponds to 0.1 mrad. No alignment has been published with a standard deviation; the narrow-angle camera
        /// was aligned with the altimeter in flight (Kirk et al. 2001).
        boresight_sigma_rad as "boresight_sigma_arcsec": f64 = key(SIGMA_OR_NONE)
            .or(20.6)
            .map(|sigma| sigma * RADIANS_PER_ARCSECOND),
        /// File that `areograph estimate-boresight --toml` printed: statements of sites about the two boresight angles. Those of
        /// sites without a common image or orbit with this site replace `boresight_sigma_arcsec`.
        boresight: Option<BoresightStatements> = key(BORESIGHT_FILE).unused(r#""boresight.toml""#),
        /// Standard deviation of the delay of the line times of each image relative to the shots. Along the track, the
        /// delay cannot be separated from the laser boresight. Without this key, the along-track observation is not
        /// used, because `rotation_sigma_arcsec` already accounts for line times and pitch together; 0 assumes exact
        /// line times.
        boresight_line_time_sigma_s as "boresight_line_time_sigma_ms": Option<f64> = key(SIGMA_OR_NONE)
            .unused("0.0")
            .map(|milliseconds| milliseconds.map(|milliseconds| milliseconds * SECONDS_PER_MS)),
        /// Use of the image coordinates of footprints, by default "weighted" in the published model and "off"
        /// otherwise. These coordinates are computed from the orientation under adjustment and are not independent
        /// measurements.
        footprint_image_coordinates: Option<FootprintImageCoordinates> = key(words_of(
            FootprintImageCoordinates::WORDS,
            [
                "observations",
                "not used",
                "projected with the adjusted orientation, without weight, degrees of freedom or covariance",
            ],
        )).unused(r#""off""#).was("mola_image"),
        /// Standard deviations of the image coordinates of footprints, along and across the track, in the focal plane.
        /// The defaults are one MOLA shot spacing along the track (325 m at 4.4 m per pixel) and 4 px across it; Yoon &
        /// Shan 2004 state none.
        footprint_sigma_px: [f64; 2] = key(SIGMAS).or([74.0, 4.0]).was("mola_sigma_px"),
        /// Margin around an image within which a footprint is still counted as inside the image.
        footprint_margin_px: f64 = key(from_to(0.0, 1e4)).or(200.0).was("mola_margin_px"),
        /// Standard deviation of footprint coordinates (Yoon & Shan 2004).
        ground_sigma_m: f64 = key(SIGMA).or(10.0),
        /// Standard deviation of ranges (Yoon & Shan 2004, where the uncertainty of the instrument is 7 m at 400 km).
        range_sigma_m: f64 = key(SIGMA).or(10.0),
        /// Standard deviation of the range bias of each profile, an unknown of the adjustment; 0 omits this unknown.
        /// Biases of up to 25 m occur off nadir (Shan et al. 2005, Table 3). The default is 30 m, or 0 in the published
        /// model.
        range_bias_sigma_m: Option<f64> = key(SIGMA_OR_NONE).unused("30.0"),
        /// Standard deviation of the time bias of each image, an unknown of the adjustment; 0 omits this unknown.
        time_bias_sigma_s as "time_bias_sigma_ms": f64 =
            key(SIGMA_OR_NONE).or(0.0).map(|milliseconds| milliseconds * SECONDS_PER_MS),
        /// Published model: standard deviation of the position unknowns of images within 5 degrees of nadir. An unknown
        /// is free with inf and fixed with 0. Rotations have the equivalent standard deviation on the ground (Yoon &
        /// Shan 2004).
        position_sigma_nadir_m: Option<f64> = key(SIGMA_OR_FREE).unused("100.0").was("nadir_sigma_m"),
        /// Published model: standard deviation of the position unknowns of images more than 5 degrees off nadir (Yoon &
        /// Shan 2004).
        position_sigma_off_nadir_m: Option<f64> =
            key(SIGMA_OR_FREE).unused("200.0").was("off_nadir_sigma_m"),
        /// Robust weights of image coordinates, which decrease with increasing residuals.
        robust: Option<RobustWeight> = group::<RobustKeys>().map(RobustKeys::weight),
        /// Standardised residual above which a tie point is rejected as a blunder; 0 keeps all tie points. One valid
        /// observation in a thousand exceeds the default.
        blunder_limit: Option<f64> = key(from_to(0.0, 1000.0))
            .or(BAARDA_LIMIT)
            .map(|limit| (limit > 0.0).then_some(limit)),
        /// Height above or below the MOLA surface, in standard deviations, beyond which a tie point is rejected as a
        /// blunder unless a neighbour deviates in the same direction; 0 keeps all tie points. Not used in the published
        /// model.
        height_blunder_limit: Option<f64> = key(from_to(0.0, 1000.0))
            .or(5.0)
            .map(|limit| (limit > 0.0).then_some(limit)),
        /// Images whose unknowns have their own standard deviations.
        images: Vec<OrientationPrior> = tables(Many::ANY),
    }
    settle clock_by_readings
    check keys_of_the_model
}

/// The decision of many pairs replaces the decision of the user.
fn clock_by_readings(mut adjustment: AdjustmentConfig, _keys: &Keys<'_, '_>) -> AdjustmentConfig {
    let is_used = adjustment.model == AdjustmentModel::MolaSurface;
    if let Some(readings) = adjustment.readings.as_ref().filter(|_| is_used) {
        adjustment.attitude_clock = readings.supported == Some(Cause::AttitudeClock);
    }
    adjustment
}

/// Keys of one model are not used by the other.
fn keys_of_the_model(checked: &AdjustmentConfig, keys: &mut Keys<'_, '_>) {
    let others: &[&str] = match checked.model {
        AdjustmentModel::MolaSurface => &["position_sigma_nadir_m", "position_sigma_off_nadir_m"],
        AdjustmentModel::Published => &[
            "position_sigma_m",
            "rotation_sigma_arcsec",
            "line_time_sigma_ms",
            "orbit_of_pedr",
            "relief_for_plan",
            "attitude_clock",
            "readings",
            "attitude_clock_sigma_s",
            "attitude_clock_rotation_sigma_arcsec",
            "common_bus",
            "boresight",
            "boresight_sigma_arcsec",
            "boresight_line_time_sigma_ms",
            "height_blunder_limit",
        ],
    };
    let reason = format!("adjustment.model is {:?}", checked.model.word());
    for key in others {
        keys.unused(key, &reason);
    }
    if checked.readings.is_some() && checked.model == AdjustmentModel::MolaSurface {
        keys.unused("attitude_clock", "adjustment.readings decides");
    }
    if checked.boresight.is_some() && checked.model == AdjustmentModel::MolaSurface {
        if checked.common_bus {
            keys.unused("boresight_sigma_arcsec", "adjustment.boresight replaces it");
        } else {
            keys.unused("boresight", "adjustment.common_bus is \"no\"");
        }
    }
}

impl AdjustmentConfig {
    /// Standard deviations of positions of images from this spacecraft, for the powers 0, 1 and 2 of time, metres.
    #[must_use]
    pub fn position_sigma_m(&self, spacecraft: &Spacecraft) -> [f64; 3] {
        let usual = &spacecraft.a_priori;
        self.position_sigma_m.unwrap_or(usual.position_sigma_m)
    }

    /// Standard deviations of rotations of images from this spacecraft, for the powers 0, 1 and 2 of time, radians.
    #[must_use]
    pub fn rotation_sigma_rad(&self, spacecraft: &Spacecraft) -> [f64; 3] {
        let usual = &spacecraft.a_priori;
        self.rotation_sigma_rad
            .unwrap_or_else(|| usual.rotation_sigma_rad())
    }

    /// Use of the image coordinates of footprints.
    #[must_use]
    pub fn footprints_in_images(&self) -> FootprintImageCoordinates {
        self.footprint_image_coordinates
            .unwrap_or(match self.model {
                AdjustmentModel::MolaSurface => FootprintImageCoordinates::Off,
                AdjustmentModel::Published => FootprintImageCoordinates::Weighted,
            })
    }

    /// Standard deviation of the range bias of a profile, metres; 0 for no such unknown.
    #[must_use]
    pub fn range_bias_m(&self) -> f64 {
        self.range_bias_sigma_m.unwrap_or(match self.model {
            AdjustmentModel::MolaSurface => 30.0,
            AdjustmentModel::Published => 0.0,
        })
    }

    /// Standard deviations of position unknowns of nadir images and of others in the published model, metres.
    #[must_use]
    pub fn published_sigmas_m(&self) -> [f64; 2] {
        [
            self.position_sigma_nadir_m.unwrap_or(100.0),
            self.position_sigma_off_nadir_m.unwrap_or(200.0),
        ]
    }
}

declare_table! {
    /// Robust estimation.
    struct RobustKeys {
        /// Robust weights of image coordinates, which decrease with increasing residuals.
        robust: Option<RobustWeight> = key(words([
            ("none", None, ""),
            ("huber", Some(RobustWeight::Huber { limit: RobustWeight::HUBER_LIMIT }), ""),
            ("cauchy", Some(RobustWeight::Cauchy { limit: RobustWeight::CAUCHY_LIMIT }), ""),
        ])).or(None),
        /// Normalised residual above which the weight decreases (huber, default 1.345), or at which the weight is one
        /// half (cauchy, default 2.385).
        robust_limit: Option<f64> = key(above_to(0.0, 1000.0)).unused("1.345"),
    }
    check limit_is_used
}

fn limit_is_used(written: &RobustKeys, keys: &mut Keys<'_, '_>) {
    if written.robust.is_none() {
        keys.unused("robust_limit", "adjustment.robust is \"none\"");
    }
}

impl RobustKeys {
    fn weight(self) -> Option<RobustWeight> {
        match (self.robust?, self.robust_limit) {
            (usual, None) => Some(usual),
            (RobustWeight::Huber { .. }, Some(limit)) => Some(RobustWeight::Huber { limit }),
            (RobustWeight::Cauchy { .. }, Some(limit)) => Some(RobustWeight::Cauchy { limit }),
        }
    }
}

declare_table! {
    /// Images whose unknowns have individual standard deviations: X, Y and Z, or rotations about the camera's x, y and
    /// z axes, each for the powers 0, 1 and 2 of t; t is 0 in the middle of the image and 1 at its end.
    pub struct OrientationPrior: Deserialize {
        /// Identifier of the image.
        id: String = key(identifier()).required().unused(r#""E02-02855""#),
        /// Standard deviations of X, Y and Z for each power of t. An unknown is free with inf and fixed with 0.
        position_m: Option<[f64; 9]> = key(SIGMAS_OF_POWERS)
            .unused("[100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0]"),
        /// Standard deviations of the rotations about the camera's x, y and z axes for each power of t. An unknown is
        /// free with inf and fixed with 0.
        rotation_rad as "rotation_arcsec": Option<[f64; 9]> = key(SIGMAS_OF_POWERS)
            .unused("[54.0, 54.0, 54.0, 54.0, 54.0, 54.0, 54.0, 54.0, 54.0]")
            .map(|sigmas| sigmas.map(|sigmas| sigmas.map(|sigma| sigma * RADIANS_PER_ARCSECOND))),
        /// Position unknowns of the image, as powers of t; the default is the key in `[adjustment]`.
        position_unknowns: Option<PositionUnknowns> =
            key(words_of(PositionUnknowns::WORDS, [""; 4])).unused(r#""acceleration""#),
        /// Rotation unknowns of the image, as powers of t; the default is the key in `[adjustment]`.
        rotation_unknowns: Option<RotationUnknowns> =
            key(words_of(RotationUnknowns::WORDS, [""; 4])).unused(r#""acceleration""#),
    }
}
