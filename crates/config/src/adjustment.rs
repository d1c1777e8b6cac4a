//! `[adjustment]`.

use serde::Deserialize;

use areograph_base::{
    footprints::{AdjustmentModel, FootprintImageCoordinates},
    units::{RADIANS_PER_ARCSECOND, SECONDS_PER_MS},
};
use areograph_geom::{robust::RobustWeight, statistics::BAARDA_LIMIT};

use super::{
    declare::{Declare as _, Keys, Many, declare_table, group, key, tables},
    forms::{
        Number, Several, above_to, from_to, identifier, several, words, words_of, yes_or_no,
        zero_or,
    },
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
    /// Combined adjustment of images, laser shots and tie points. Standard deviations are those of Yoon & Shan 2004 where
    /// the paper gives one.
    pub struct AdjustmentConfig: Deserialize {
        /// Control of the adjustment. In the published model, image coordinates of footprints are computed from the
        /// orientations under adjustment and hold them fixed; it is provided for comparison. Along the track it is the
        /// paper's model. Across the track it differs: residuals refer to the line that sees the point, where the paper
        /// uses the measured line. The mean corrections of MOLA across the track, 2.7 to 3.3 px in the paper, are then
        /// 0, and the unit-weight standard deviation is about half of the published one.
        model: AdjustmentModel = key(words_of(
            AdjustmentModel::WORDS,
            [
                "the MOLA surface controls the heights of tie points, the a priori orbit and attitude control the \
                orientations",
                "image coordinates of footprints as observations, one standard deviation per image (Yoon & Shan 2004)",
            ],
        )).or(AdjustmentModel::MolaSurface),
        /// Standard deviations of tie points, along and across the track, in the focal plane (the paper); standard
        /// deviations in a tie point file take precedence.
        tie_sigma_px: [f64; 2] = key(SIGMAS).or([1.0, 1.0]),
        /// Standard deviations of X, Y and Z of every image for the powers 0, 1, 2 of t, which is 0 in the middle of
        /// the image and 1 at its end; inf leaves free, 0 holds fixed. Orbits of three families differ by up to 50 m
        /// (Shan et al. 2005), and errors vary with the revolution.
        position_sigma_m: [f64; 3] = key(SIGMAS_OF_TIME).or([25.0, 0.2, 0.0]),
        /// Standard deviations of the rotations about the camera's axes for the same powers of t: 0.4 mrad, 150 m on
        /// the ground, as required by the distances between images of a pair; drifts have the size of the attitude
        /// residuals.
        rotation_sigma_rad as "rotation_sigma_arcsec": [f64; 3] = key(SIGMAS_OF_TIME)
            .or([82.5, 2.0, 2.0])
            .map(|sigmas| sigmas.map(|sigma| sigma * RADIANS_PER_ARCSECOND)),
        /// Powers of t that are unknowns of the position of every image, as jigsaw's spsolve; higher powers are not
        /// estimated, regardless of their standard deviation.
        position_unknowns: PositionUnknowns = key(words_of(
            PositionUnknowns::WORDS,
            ["", "a constant", "and a linear term in t", "and a quadratic term"],
        )).or(PositionUnknowns::Acceleration),
        /// Powers of t that are unknowns of the rotations of every image, as jigsaw's camsolve.
        rotation_unknowns: RotationUnknowns = key(words_of(
            RotationUnknowns::WORDS,
            ["", "constants", "and linear terms in t", "and quadratic terms"],
        )).or(RotationUnknowns::Acceleration),
        /// Standard deviation of a delay of all lines of an image, which `rotation_sigma_arcsec` allows for together
        /// with pitch: tie points cannot separate the two, so the delay is not an unknown. The stated standard
        /// deviation of a camera's position along its track contains it. 45 ms are half the disagreement of the images
        /// of a pair (Shan et al. 2005, Table 5); 0 assumes exact line times. With `time_bias_sigma_ms`,
        /// `attitude_clock` or `boresight_line_time_sigma_ms` these apply instead.
        line_time_sigma_s as "line_time_sigma_ms": f64 = key(SIGMA_OR_NONE)
            .or(45.0)
            .map(|milliseconds| milliseconds * SECONDS_PER_MS),
        /// Whether the along-track disagreement of the images of a pair is attributed to one time offset of the
        /// attitudes, the same for all images: it rotates nadir-following images, but not inertially held ones.
        /// Otherwise all images are equally likely to be in error. Tie points cannot distinguish the two, so this is
        /// a decision and not an estimate; where a pair disagrees by more than 100 m, the report and adjustment.json
        /// give both.
        attitude_clock: bool = key(yes_or_no(
            "all images are equally likely to be in error",
            "nadir-following images are in error, by one offset",
        )).or(false),
        /// Standard deviation of that offset.
        attitude_clock_sigma_s: f64 = key(SIGMA).or(1.0),
        /// Upper limit of the standard deviation of the constant rotations of every image with this offset: 0.1 mrad.
        /// A clock offset explains nothing if the attitude may err by as much without it.
        attitude_clock_rotation_sigma_rad as "attitude_clock_rotation_sigma_arcsec": f64 = key(SIGMA)
            .or(20.6)
            .map(|sigma| sigma * RADIANS_PER_ARCSECOND),
        /// Whether the a priori position of an image exposed during a profile is taken from the PEDR file, not from the
        /// kernels: camera and altimeter then share one orbit. The range check reports the distance between the two.
        orbit_of_pedr: bool = key(yes_or_no(
            "the orbit of the kernels",
            "the orbit of the kernels, moved by the mean distance over the profile",
        )).or(false),
        /// Whether heights of tie points on slopes of the MOLA surface also determine the images in plan. Useful
        /// where the report states that relief determines the position to less than half of the a priori standard
        /// deviation: ground rougher than 25 m over 300 m for measurements of a pixel, 7 m for 0.3 pixels.
        relief_for_plan: bool = key(yes_or_no(
            "a slope only increases the uncertainty of heights",
            "each profile may be offset in plan, and tie points move to where their heights fit",
        )).or(false),
        /// Whether the position of the laser in a simultaneous image is an observation: camera and laser share one
        /// bus, so that the mounting determines it, regardless of the attitude. It requires profiles simultaneous
        /// with the images, whose position is known to `laser_surface.profile_plan_sigma_m`; each profile may then be
        /// offset in plan, and the boresight of the laser may differ from its file and the frame kernels.
        common_bus: bool = key(yes_or_no(
            "footprints do not constrain the attitude",
            "the mounting gives the position of a footprint in the simultaneous image",
        )).or(false),
        /// Standard deviation of the two boresight angles of the laser, the same for all images: 0.1 mrad. No
        /// alignment with its standard deviation is published; the narrow-angle camera was aligned in flight with the
        /// altimeter (Kirk et al. 2001).
        boresight_sigma_rad as "boresight_sigma_arcsec": f64 = key(SIGMA_OR_NONE)
            .or(20.6)
            .map(|sigma| sigma * RADIANS_PER_ARCSECOND),
        /// Standard deviation of the delay of the line times of each image relative to the shots. Along the track the
        /// delay cannot be separated from the boresight of the laser: without this key the along-track observation is
        /// not used, since `rotation_sigma_arcsec` already allows for line times and pitch together; 0 assumes exact
        /// line times.
        boresight_line_time_sigma_s as "boresight_line_time_sigma_ms": Option<f64> = key(SIGMA_OR_NONE)
            .unused("0.0")
            .map(|milliseconds| milliseconds.map(|milliseconds| milliseconds * SECONDS_PER_MS)),
        /// Use of the image coordinates of footprints: "off" unless the model is the published one, where it is
        /// "weighted". They are computed from the orientation under adjustment and are not independent measurements.
        footprint_image_coordinates: Option<FootprintImageCoordinates> = key(words_of(
            FootprintImageCoordinates::WORDS,
            [
                "observations",
                "nothing",
                "projections with the adjusted orientation, without weight, freedom or covariance",
            ],
        )).unused(r#""off""#).was("mola_image"),
        /// Their standard deviations, along and across the track, in the focal plane: one MOLA spacing (325 m
        /// at 4.4 m a pixel), and 4; the paper gives none.
        footprint_sigma_px: [f64; 2] = key(SIGMAS).or([74.0, 4.0]).was("mola_sigma_px"),
        /// Distance outside an image within which a footprint still counts as seen by it.
        footprint_margin_px: f64 = key(from_to(0.0, 1e4)).or(200.0).was("mola_margin_px"),
        /// Standard deviation of footprint coordinates (the paper).
        ground_sigma_m: f64 = key(SIGMA).or(10.0),
        /// Standard deviation of ranges (the paper; the instrument: 7 m at 400 km).
        range_sigma_m: f64 = key(SIGMA).or(10.0),
        /// Range bias of each profile as an unknown with this standard deviation; 0 for no such unknown. Biases
        /// up to 25 m occur off nadir (Table 3 of Shan et al. 2005). The default is 30, and no
        /// such unknown in the published model.
        range_bias_sigma_m: Option<f64> = key(SIGMA_OR_NONE).unused("30.0"),
        /// Time bias of each image as an unknown with this standard deviation; 0 for no such unknown.
        time_bias_sigma_s as "time_bias_sigma_ms": f64 =
            key(SIGMA_OR_NONE).or(0.0).map(|milliseconds| milliseconds * SECONDS_PER_MS),
        /// Published model: standard deviation of the position unknowns of images that look to nadir (within 5
        /// degrees); inf leaves free, 0 holds fixed. Rotations get the equivalent on the ground (the paper).
        position_sigma_nadir_m: Option<f64> = key(SIGMA_OR_FREE).unused("100.0").was("nadir_sigma_m"),
        /// Published model: standard deviation of the position unknowns of all other images (the paper).
        position_sigma_off_nadir_m: Option<f64> =
            key(SIGMA_OR_FREE).unused("200.0").was("off_nadir_sigma_m"),
        /// Weights of image coordinates that fall with their residual.
        robust: Option<RobustWeight> = group::<RobustKeys>().map(RobustKeys::weight),
        /// Standardised residual above which a tie point is a blunder and rejected; 0 keeps all. One good observation
        /// in a thousand exceeds the default.
        blunder_limit: Option<f64> = key(from_to(0.0, 1000.0))
            .or(BAARDA_LIMIT)
            .map(|limit| (limit > 0.0).then_some(limit)),
        /// Height above or below the MOLA surface, in standard deviations, beyond which a tie point is rejected as a blunder
        /// unless a neighbour deviates to the same side; 0 keeps all. Not used in the published model.
        height_blunder_limit: Option<f64> = key(from_to(0.0, 1000.0))
            .or(5.0)
            .map(|limit| (limit > 0.0).then_some(limit)),
        /// Images whose unknowns have their own standard deviations.
        images: Vec<OrientationPrior> = tables(Many::ANY),
    }
    check keys_of_the_model
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
            "attitude_clock_sigma_s",
            "attitude_clock_rotation_sigma_arcsec",
            "common_bus",
            "boresight_sigma_arcsec",
            "boresight_line_time_sigma_ms",
            "height_blunder_limit",
        ],
    };
    let reason = format!("adjustment.model is {:?}", checked.model.word());
    for key in others {
        keys.unused(key, &reason);
    }
}

impl AdjustmentConfig {
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
        /// Weights of image coordinates that fall with their residual.
        robust: Option<RobustWeight> = key(words([
            ("none", None, ""),
            ("huber", Some(RobustWeight::Huber { limit: RobustWeight::HUBER_LIMIT }), ""),
            ("cauchy", Some(RobustWeight::Cauchy { limit: RobustWeight::CAUCHY_LIMIT }), ""),
        ])).or(None),
        /// Normalised residual from which (huber, default 1.345) or at which half (cauchy, default 2.385) the
        /// weight falls.
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
    /// Images whose unknowns have their own standard deviations; of each image X, Y, Z, or rotations about the
    /// camera's x, y, z, each with the powers 0, 1, 2 of t, which is 0 in the middle of the image and 1 at its
    /// end.
    pub struct OrientationPrior: Deserialize {
        /// Identifier of the image.
        id: String = key(identifier()).required().unused(r#""E02-02855""#),
        /// X, Y, Z; inf leaves free, 0 holds fixed.
        position_m: Option<[f64; 9]> = key(SIGMAS_OF_POWERS)
            .unused("[100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0, 100.0]"),
        /// Rotations about the camera's x, y and z; inf leaves free, 0 holds fixed.
        rotation_rad as "rotation_arcsec": Option<[f64; 9]> = key(SIGMAS_OF_POWERS)
            .unused("[54.0, 54.0, 54.0, 54.0, 54.0, 54.0, 54.0, 54.0, 54.0]")
            .map(|sigmas| sigmas.map(|sigmas| sigmas.map(|sigma| sigma * RADIANS_PER_ARCSECOND))),
        /// Unknown powers of t of the image's position; without this key, those of `[adjustment]`.
        position_unknowns: Option<PositionUnknowns> =
            key(words_of(PositionUnknowns::WORDS, [""; 4])).unused(r#""acceleration""#),
        /// Unknown powers of t of the image's rotations; without this key, those of `[adjustment]`.
        rotation_unknowns: Option<RotationUnknowns> =
            key(words_of(RotationUnknowns::WORDS, [""; 4])).unused(r#""acceleration""#),
    }
}
