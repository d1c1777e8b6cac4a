//! Error sources of a mission, and the roughness of its ground: kinds and sizes.

use serde::Serialize;

use super::random::Random;

/// Errors of a synthetic mission. The drawn values are in `truth.json`.
///
/// All are normally distributed about 0 with the given standard deviation, unless stated otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SceneErrors {
    /// The cause of the along-track misregistration of a site's two images.
    pub misregistration: Misregistration,
    /// Errors of position, against the orbit `gsfc`.
    pub position: PositionErrors,
    /// Errors of the attitude of the bus, hence common to camera and laser, against the C-kernel.
    pub attitude: AttitudeErrors,
    /// Errors of the laser altimeter and of its products.
    pub altimeter: AltimeterErrors,
    /// Errors of the narrow-angle camera against its calibration, the same in all images.
    pub camera: CameraErrors,
    /// The ground around the sites.
    pub relief: Relief,
    /// Noise of the measurements of tie points, lines and samples, as the site files state it.
    pub tie_noise_px: f64,
    /// True noise over the stated one.
    pub tie_noise_factor: f64,
    /// Share of the variance of the true noise that neighbouring tie points of an image have in common, 0 to 1.
    pub tie_noise_common: f64,
}

/// Cause of the along-track misregistration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Misregistration {
    /// Lines were exposed later than stated by the labels, by the residuals of Shan et al. 2005, Table 5, to half a
    /// line and with the opposite sign: constant over all missions.
    Published,
    /// Lines of each image were exposed later by an individual number of lines.
    LineTimes {
        /// Standard deviation, lines.
        sigma_lines: f64,
    },
    /// The attitude was read with a time offset common to all images. A bus that points at nadir turns by
    /// 0.05 degrees a second, 0.3 km on the ground; one that is held inertially does not turn.
    AttitudeClock {
        /// Standard deviation, seconds.
        sigma_s: f64,
    },
    /// The same with this offset, so that missions may share it.
    AttitudeClockOffset {
        /// Offset, seconds.
        offset_s: f64,
    },
}

/// Object of the position error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PositionErrors {
    /// The camera only; the laser follows the orbit.
    Camera {
        /// Standard deviation along each axis of IAU 2000, metres.
        sigma_m: f64,
    },
    /// The bus: camera and laser have the same error.
    Bus {
        /// Standard deviations along radius, track and orbit normal, metres.
        sigma_radial_along_cross_m: [f64; 3],
    },
}

/// Errors of the attitude: rotations about the axes of the bus as `constant + linear x + quadratic x²` with `x` from −1
/// to 1 over the image, plus jitter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AttitudeErrors {
    /// Standard deviations of the constant in roll, pitch and yaw, radians.
    pub constant_sigma_rad: [f64; 3],
    /// Standard deviation of the linear term, radians at the end of the image.
    pub linear_sigma_rad: f64,
    /// Standard deviation of the quadratic term, radians at the end of the image.
    pub quadratic_sigma_rad: f64,
    /// Jitter about the first two axes, roll and pitch.
    pub jitter: Jitter,
    /// Jitter with periods of seconds.
    pub slow_jitter: Jitter,
}

/// Sinusoids of the attitude; amplitudes and periods are uniform in their logarithm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Jitter {
    /// Sinusoids about each axis.
    pub sinusoids: u32,
    /// Smallest and largest amplitude, radians.
    pub amplitude_rad: [f64; 2],
    /// Shortest and longest period, seconds.
    pub period_s: [f64; 2],
}

impl Jitter {
    /// No jitter.
    const NONE: Self = Self {
        sinusoids: 0,
        amplitude_rad: [0.0; 2],
        period_s: [0.0; 2],
    };
}

/// Errors of the laser altimeter and of its products.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AltimeterErrors {
    /// Standard deviation of a profile's shift to the east and to the north, metres, without the shift by the attitude.
    /// Off nadir the height of the profile follows, as for a beam that is rotated at constant range.
    pub plan_sigma_m: f64,
    /// Share of the bus's attitude error that the coordinates of files contain, because they were computed from the same
    /// attitude: drawn evenly from 0 to these for every profile at nadir, and off nadir.
    pub attitude_share_max: [f64; 2],
    /// Chance that a profile lies 0.5 to 2 km elsewhere.
    pub misplaced_chance: f64,
    /// Standard deviation of a profile's radial shift, metres.
    pub radial_sigma_m: f64,
    /// Standard deviation of a single range, metres.
    pub shot_noise_m: f64,
    /// Ranges are multiples of this, metres; 0 where they are exact.
    pub range_step_m: f64,
    /// Diameter of the spot over which a range is averaged, metres.
    pub spot_m: f64,
    /// Standard deviation of each of the two angles between the laser and +Z of the bus, radians: constant over the
    /// mission.
    pub boresight_sigma_rad: f64,
    /// These angles towards X and Y of the bus instead of random ones, so that missions may share them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub boresight_rad: Option<[f64; 2]>,
    /// Whether files contain the instrument's echo data: channel 4, energies, pulse widths, thresholds.
    #[serde(skip)]
    pub tells_echoes: bool,
}

/// Smallest and largest shift of a misplaced profile in plan, metres.
pub(super) const MISPLACED_M: [f64; 2] = [500.0, 2_000.0];

/// Errors of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CameraErrors {
    /// Standard deviation of the bend of the detector line: its ends lie so many pixels before its middle, along the track.
    pub bend_sigma_px: f64,
    /// Standard deviation of the focal length, as a share of it.
    pub focal_length_sigma: f64,
}

impl CameraErrors {
    /// No errors.
    const NONE: Self = Self {
        bend_sigma_px: 0.0,
        focal_length_sigma: 0.0,
    };
}

/// The ground around the sites.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Relief {
    /// Hills of 4 km and more, and craters of 1 to 4 km.
    Gentle,
    /// Self-affine roughness down to 25 m, and craters from 100 m.
    SelfAffine(Roughness),
}

/// Roughness of self-affine ground: heights `d` apart differ by `ν (d / 300 m)^H` (root mean square), H = 0.7 except for
/// varied ground.
///
/// The sizes span MOLA's results for plains and highlands, the exponent is the usual one of Mars at these lengths: both
/// are choices, not the relief of the real sites.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Roughness {
    /// ν = 5 m.
    Plains,
    /// ν = 10 m.
    Medium,
    /// ν = 25 m.
    Rough,
    /// Other ground around every site: H drawn from 0.4 to 0.95, ν from 3 m to 6 m (H = 0.4) or 23 m (H = 0.95), and ν
    /// changes by factors of one half to two over some 15 km.
    Varied,
}

impl Roughness {
    /// ν, metres: difference of heights 300 m apart (root mean square); `None` for varied ground.
    #[must_use]
    pub const fn height_difference_at_300_m(self) -> Option<f64> {
        match self {
            Self::Plains => Some(5.0),
            Self::Medium => Some(10.0),
            Self::Rough => Some(25.0),
            Self::Varied => None,
        }
    }
}

impl SceneErrors {
    /// Errors of the worked example: exact shots over gentle ground, attitudes without error, line times that reproduce
    /// Shan et al. 2005, Table 5, and cameras displaced by 20 m along each axis.
    #[must_use]
    pub const fn demo() -> Self {
        Self {
            misregistration: Misregistration::Published,
            position: PositionErrors::Camera { sigma_m: 20.0 },
            attitude: AttitudeErrors {
                constant_sigma_rad: [0.0; 3],
                linear_sigma_rad: 0.0,
                quadratic_sigma_rad: 0.0,
                jitter: Jitter::NONE,
                slow_jitter: Jitter::NONE,
            },
            altimeter: AltimeterErrors {
                plan_sigma_m: 0.0,
                attitude_share_max: [0.0; 2],
                misplaced_chance: 0.0,
                radial_sigma_m: 0.0,
                shot_noise_m: 0.0,
                range_step_m: 0.0,
                spot_m: 0.0,
                boresight_sigma_rad: 0.0,
                boresight_rad: None,
                tells_echoes: false,
            },
            camera: CameraErrors::NONE,
            relief: Relief::Gentle,
            tie_noise_px: 1.0,
            tie_noise_factor: 1.0,
            tie_noise_common: 0.0,
        }
    }

    /// Plausible errors of the real mission, drawn anew for every seed, of the sizes that areograph assumes.
    ///
    /// # Source
    /// * line times 30 lines: half of the 225 to 271 m by which the images of a pair disagree (Shan et al. 2005, Table 5);
    /// * orbit 5.2, 24.8 and 8.6 m along radius, track and normal: differences of overlapping arcs, Lemoine et al.,
    ///   AAS 99-328;
    /// * attitude 0.4 mrad: between the 0.26 mrad of 100 m, which the crossovers of MOLA leave in the horizontal, and the
    ///   0.5 mrad of the 200 m that Yoon & Shan 2004 take for images off nadir. Along the track 0.4 mrad, 150 m,
    ///   is what two images that disagree by 225 to 271 m allow for line times and pitch together, which no tie
    ///   point separates: 30 lines are 100 to 165 m of it, 0.15 mrad remain for pitch. Drift and bend 1e-5 rad,
    ///   2 arcseconds: residuals of C-kernels to a parabola (Shan et al. 2005, Table 4) reach 5;
    /// * jitter of 1 to 5 µrad and 0.1 to 2 s: a choice, below those 5 arcseconds (24 µrad);
    /// * MOLA profiles 70 m east and north, 1 m in radius: 100 m in the horizontal and 1 m radially (Neumann et al. 2001, as
    ///   Shan et al. 2005 cite them);
    /// * shot noise 1 m: roughness within a spot on plains (Garvin et al. 1999; Neumann et al. 2003), which also
    ///   give the 75 m of the spot; ranges in steps of 0.375 m, 2.5 ns of the clock (Shan et al. 2005, Table 1);
    /// * boresight of the laser 0.1 mrad on each axis: a choice, 38 m on the ground. No alignment angles are published;
    ///   corrections by crossovers in 1999 (Lemoine et al., AAS 99-328) were 0.05 and 0.15 mrad, if published in
    ///   degrees.
    #[must_use]
    pub const fn realistic(roughness: Roughness) -> Self {
        Self {
            misregistration: Misregistration::LineTimes { sigma_lines: 30.0 },
            position: PositionErrors::Bus {
                sigma_radial_along_cross_m: [5.2, 24.8, 8.6],
            },
            attitude: AttitudeErrors {
                constant_sigma_rad: [4e-4, 1.5e-4, 4e-4],
                linear_sigma_rad: 1e-5,
                quadratic_sigma_rad: 1e-5,
                jitter: Jitter {
                    sinusoids: 3,
                    amplitude_rad: [1e-6, 5e-6],
                    period_s: [0.1, 2.0],
                },
                slow_jitter: Jitter::NONE,
            },
            altimeter: AltimeterErrors {
                plan_sigma_m: 70.0,
                attitude_share_max: [0.0; 2],
                misplaced_chance: 0.0,
                radial_sigma_m: 1.0,
                shot_noise_m: 1.0,
                range_step_m: 0.375,
                spot_m: 75.0,
                boresight_sigma_rad: 1e-4,
                boresight_rad: None,
                tells_echoes: true,
            },
            camera: CameraErrors::NONE,
            relief: Relief::SelfAffine(roughness),
            tie_noise_px: 1.0,
            tie_noise_factor: 1.0,
            tie_noise_common: 0.0,
        }
    }

    /// Errors of a mission that shares few assumptions with the default values of areograph: the size of each is drawn for
    /// every seed over the range of its sources, evenly in the logarithm, and errors are added that the adjustment does not
    /// model.
    ///
    /// # Source
    /// In addition to the sources of [`realistic`](Self::realistic):
    /// * attitude 0.26 to 0.5 mrad, the two values there; pitch in proportion. Line times 20 to 40 lines;
    /// * orbit a fifth to three fifths of the differences of the first months: the nadir profiles of Shan et al. 2005, Table 3,
    ///   agree with it to 2 m in radius;
    /// * boresight 0.05 to 0.15 mrad, the two corrections there;
    /// * profiles 50 to 100 m in plan and 0.5 to 1.5 m in radius; shots 0.5 to 2 m (real crossovers: 0.6 to 0.9 m on smooth
    ///   ground);
    /// * coordinates of files contain a part of the attitude error of the bus, because they are computed from telemetry of the
    ///   same attitude: up to 0.4 of it at nadir, where crossovers correct it, and up to all of it off nadir, where they do
    ///   not. Five passes off nadir in real tables differ by 7 to 153 m from others, by 206 m (0.5 mrad) times the tangent of the
    ///   angle.
    ///
    /// Choices: half to twice the drift and jitter; slow jitter of 2 to 10 µrad and 2 to 10 s, below the 24 µrad of residuals to
    /// a parabola (Shan et al. 2005, Table 4); one profile of 40 lies 0.5 to 2 km elsewhere; detector line bent by 0.15 to 0.6
    /// pixels, focal length known to 0.025 to 0.1 %; tie points with 0.7 to 1.4 times the stated noise, up to two thirds of
    /// its variance common to neighbours.
    #[must_use]
    pub fn with_drawn_sizes(self, seed: u64) -> Self {
        let mut random = Random::new(seed, "sizes of errors");
        let mut within = |least: f64, most: f64| random.between_log(least, most);
        let misregistration = match self.misregistration {
            Misregistration::Published => Misregistration::Published,
            Misregistration::LineTimes { sigma_lines } => Misregistration::LineTimes {
                sigma_lines: sigma_lines * within(20.0, 40.0) / 30.0,
            },
            Misregistration::AttitudeClock { sigma_s } => Misregistration::AttitudeClock {
                sigma_s: sigma_s * within(0.7, 1.4),
            },
            Misregistration::AttitudeClockOffset { offset_s } => {
                // As many numbers as above: the other sizes do not depend on the cause.
                within(0.7, 1.4);
                Misregistration::AttitudeClockOffset { offset_s }
            }
        };
        let orbit = within(0.2, 0.6);
        let position = match self.position {
            PositionErrors::Camera { sigma_m } => PositionErrors::Camera {
                sigma_m: orbit * sigma_m,
            },
            PositionErrors::Bus {
                sigma_radial_along_cross_m,
            } => PositionErrors::Bus {
                sigma_radial_along_cross_m: sigma_radial_along_cross_m.map(|of_m| orbit * of_m),
            },
        };
        let turn = within(0.26, 0.5) / 0.4;
        let (jitter, slow) = (within(0.5, 2.0), within(0.5, 2.0));
        let attitude = AttitudeErrors {
            constant_sigma_rad: self.attitude.constant_sigma_rad.map(|of_rad| turn * of_rad),
            linear_sigma_rad: self.attitude.linear_sigma_rad * within(0.5, 2.0),
            quadratic_sigma_rad: self.attitude.quadratic_sigma_rad * within(0.5, 2.0),
            jitter: Jitter {
                amplitude_rad: self.attitude.jitter.amplitude_rad.map(|of| jitter * of),
                ..self.attitude.jitter
            },
            slow_jitter: Jitter {
                sinusoids: 1,
                amplitude_rad: [2e-6, 5e-6].map(|of| slow * of),
                period_s: [2.0, 10.0],
            },
        };
        let altimeter = AltimeterErrors {
            plan_sigma_m: within(50.0, 100.0),
            attitude_share_max: [0.4, 1.0],
            misplaced_chance: 1.0 / 40.0,
            radial_sigma_m: within(0.5, 1.5),
            shot_noise_m: within(0.5, 2.0),
            boresight_sigma_rad: within(5e-5, 1.5e-4),
            ..self.altimeter
        };
        let camera = CameraErrors {
            bend_sigma_px: within(0.15, 0.6),
            focal_length_sigma: within(2.5e-4, 1e-3),
        };
        Self {
            misregistration,
            position,
            attitude,
            altimeter,
            camera,
            tie_noise_factor: within(0.7, 1.4),
            tie_noise_common: random.between(0.0, 2.0 / 3.0),
            ..self
        }
    }

    /// These errors, with a common attitude clock offset as the cause of misregistration: `offset_s`, or one that is drawn.
    ///
    /// # Source
    /// 0.73 s: the time in which nadir-pointing buses rotate by the 225 to 271 m of Shan et al. 2005, Table 5, if the
    /// off-nadir image is correct. This is an inference from that table, which does not state it. Other attitude errors
    /// are then at most 0.1 mrad, 38 m on the ground: a clock that explains the misregistration of pairs leaves no
    /// more.
    #[must_use]
    pub const fn with_attitude_clock(self, offset_s: Option<f64>) -> Self {
        Self {
            misregistration: match offset_s {
                Some(offset_s) => Misregistration::AttitudeClockOffset { offset_s },
                None => Misregistration::AttitudeClock { sigma_s: 0.73 },
            },
            attitude: AttitudeErrors {
                constant_sigma_rad: [1e-4; 3],
                ..self.attitude
            },
            ..self
        }
    }
}
