//! The camera of support data: its focal plane, rotated about the boresight so that the detector line is parallel to an
//! axis.
//!
//! Pixels of the detector follow from focal-plane millimetres by `line = L0 + L1 x + L2 y + centre`, samples alike
//! (`focal2pixel_lines`, `focal2pixel_samples`, `detector_center`). The line of a scanner is detector line 0. A sensor may
//! count x along its line, as HRSC's does; areograph's cameras have their line along Y, at one distance from the boresight.

use nalgebra::{Matrix2, Matrix3, Vector2};

use super::{
    APPLIED, CALIBRATED_BY, VALID,
    document::{IsdError, Object},
};
use areograph_base::{
    constants::{SPACECRAFT, Spacecraft},
    instruments::{
        Calibrated, DetectorLine, DistortionModel, Instrument, LabelNames, Mounting, NaifNames,
        Optics, PointingTime, Sense, SummingLimits,
    },
};
use areograph_geom::{
    attitude::OmegaPhiKappa, body_rotation::frame_rotation_3, pushbroom::Distortion,
};

/// Focal lengths, millimetres, and largest number of pixels per millimetre of the focal plane.
const FOCAL_LENGTH_MM: [f64; 2] = [0.1, 1e6];
const PIXELS_PER_MM_MAX: f64 = 1e5;
/// Detector coordinates.
const DETECTOR_PX: [f64; 2] = [-1e6, 1e6];
/// Relative tolerance of the pixel pitch, which support data state with 12 digits.
const PITCH_TOLERANCE: f64 = 1e-9;
/// A distortion that distinguishes x from y requires a line along one of them: sine of the angle between.
const ALONG_AXIS: f64 = 1e-3;

/// Samples of an image on the detector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Samples {
    pub(super) crosstrack_summing: u32,
    pub(super) downtrack_summing: u32,
    pub(super) first_detector: u32,
    pub(super) samples: u32,
}

/// The line of detector pixels in the focal plane of the sensor, millimetres.
struct FocalLine {
    /// Outer edge of the first pixel.
    edge_mm: Vector2<f64>,
    /// From pixel to pixel.
    step_mm: Vector2<f64>,
}

impl FocalLine {
    fn of(document: &Object<'_>) -> Result<Self, IsdError> {
        let [l0, l1, l2] = document.numbers("focal2pixel_lines")?;
        let [s0, s1, s2] = document.numbers("focal2pixel_samples")?;
        let per_mm = Matrix2::new(l1, l2, s1, s2);
        let inverse = per_mm.try_inverse().filter(|inverse| {
            let pixel_mm = inverse.column(1).norm();
            pixel_mm.is_finite() && pixel_mm > 1.0 / PIXELS_PER_MM_MAX
        });
        let inverse = inverse.ok_or_else(|| {
            let expected = "coefficients linearly independent of focal2pixel_lines, with at most 100000 pixels per \
             millimetre";
            document.refused("focal2pixel_samples", expected)
        })?;
        let centre = document.object("detector_center")?;
        let centre_px = Vector2::new(
            centre.number("line", DETECTOR_PX)?,
            centre.number("sample", DETECTOR_PX)?,
        );
        let first_line = document.number("starting_detector_line", DETECTOR_PX)?;
        let edge_px = Vector2::new(first_line, 0.0) - centre_px - Vector2::new(l0, s0);
        Ok(Self {
            edge_mm: inverse * edge_px,
            step_mm: inverse.column(1).into_owned(),
        })
    }
}

/// The line along Y of the camera frame.
struct PlacedLine {
    /// About the boresight, from the sensor's axes to the camera's.
    turn_rad: f64,
    pitch_mm: f64,
    boresight_px: f64,
    along_track_px: f64,
    samples_along: Sense,
}

impl PlacedLine {
    /// The smaller of the two rotations of a line into the Y axis.
    fn of(line: &FocalLine) -> Self {
        let pitch_mm = line.step_mm.norm();
        let (samples_along, up_mm) = if line.step_mm.y < 0.0 {
            (Sense::MinusY, -line.step_mm)
        } else {
            (Sense::PlusY, line.step_mm)
        };
        let turn_rad = (-up_mm.x).atan2(up_mm.y);
        let edge_mm = frame_rotation_3(turn_rad).fixed_view::<2, 2>(0, 0) * line.edge_mm;
        Self {
            turn_rad,
            pitch_mm,
            boresight_px: -samples_along.sign() * edge_mm.y / pitch_mm,
            along_track_px: edge_mm.x / pitch_mm,
            samples_along,
        }
    }
}

/// The camera, and the turn from the sensor's axes to its own.
pub(super) fn camera(
    document: &Object<'_>,
    image: Samples,
    sensor_mounting: &Matrix3<f64>,
) -> Result<(Instrument, Matrix3<f64>), IsdError> {
    let line = PlacedLine::of(&FocalLine::of(document)?);
    let turn = frame_rotation_3(line.turn_rad);
    let sensor = document.text("name_sensor")?;
    let instrument = Instrument {
        id: identifier(sensor),
        name: sensor.to_owned(),
        spacecraft: spacecraft(document.text("name_platform")?),
        label: LabelNames {
            instrument: sensor.to_owned(),
            filter: None,
            serial: Some(identifier(sensor)),
        },
        naif: naif_names(document, frame_name(sensor, line.turn_rad))?,
        mounting: mounting(&(turn * sensor_mounting)),
        optics: Optics {
            focal_length_mm: document
                .object("focal_length_model")?
                .number("focal_length", FOCAL_LENGTH_MM)?,
            pixel_pitch_mm: line.pitch_mm,
        },
        detector: DetectorLine {
            pixels: image.first_detector + image.samples * image.crosstrack_summing,
            boresight_px: line.boresight_px,
            along_track_px: line.along_track_px,
            samples_along: line.samples_along,
        },
        distortion: distortion(document, line.turn_rad)?,
        summing: SummingLimits {
            max: image.crosstrack_summing.max(image.downtrack_summing),
            variable_codes: Vec::new(),
        },
        pointing: PointingTime {
            ck_bias_s: 0.0,
            source: "support data: attitudes refer to their epochs".to_owned(),
        },
        calibration: calibration(document)?,
    };
    match Distortion::check(&instrument) {
        Ok(()) => Ok((instrument, turn)),
        Err(_) if repeats_pitch(&instrument) => Err(IsdError::PitchAsDistortion {
            pitch_mm: instrument.optics.pixel_pitch_mm.to_string(),
        }),
        Err(folded) => Err(document.refused(
            "optical_distortion",
            format!("coefficients that keep the samples in order; with these, {folded}"),
        )),
    }
}

/// Whether the coefficients of the distortion are the pixel pitch, as ALE has them for MOC.
fn repeats_pitch(camera: &Instrument) -> bool {
    let DistortionModel::RadialPolynomial { coefficients } = &camera.distortion else {
        return false;
    };
    let pitch_mm = camera.optics.pixel_pitch_mm;
    let mut stated = coefficients.iter().filter(|k| k.abs() > 0.0);
    stated.all(|k| (k - pitch_mm).abs() <= PITCH_TOLERANCE * pitch_mm)
}

/// NAIF codes of the camera and of the bus, from the chain of frames between J2000 and the camera.
fn naif_names(document: &Object<'_>, frame: String) -> Result<NaifNames, IsdError> {
    let platform = document.text("name_platform")?;
    let pointing = document.object("instrument_pointing")?;
    let first = |key: &str| -> Result<i32, IsdError> {
        let code = pointing.codes(key)?.first().copied();
        Ok(code
            .and_then(|code| i32::try_from(code).ok())
            .unwrap_or_default())
    };
    let bus = first("time_dependent_frames")?;
    let instrument = if pointing.has("constant_frames") {
        first("constant_frames")?
    } else {
        bus
    };
    Ok(NaifNames {
        instrument,
        frame,
        frame_id: instrument,
        turn_rad: 0.0,
        bus,
        bus_frame: format!("frame {bus} of {platform}"),
        kernel: String::new(),
    })
}

/// The spacecraft with this name; for an unknown one only its support data are used, and products are filed under the
/// default one.
fn spacecraft(platform: &str) -> &'static Spacecraft {
    Spacecraft::of_label_name(platform).unwrap_or(&SPACECRAFT)
}

/// Angles of a rotation `[yaw]₃ [pitch]₂ [roll]₁`.
fn mounting(bus_to_camera: &Matrix3<f64>) -> Mounting {
    let angles = OmegaPhiKappa::from_camera_to_mars(bus_to_camera);
    Mounting {
        roll_rad: angles.omega_rad,
        pitch_rad: angles.phi_rad,
        yaw_rad: angles.kappa_rad,
    }
}

fn frame_name(sensor: &str, turned_rad: f64) -> String {
    if turned_rad.abs() < 1e-12 {
        sensor.to_owned()
    } else {
        format!(
            "{sensor} rotated by {:.4} degrees about the boresight",
            turned_rad.to_degrees()
        )
    }
}

/// A name in lower case, digits and underscores.
fn identifier(name: &str) -> String {
    let words = name.split(|letter: char| !letter.is_ascii_alphanumeric());
    let words: Vec<String> = words
        .filter(|word| !word.is_empty())
        .map(str::to_ascii_lowercase)
        .collect();
    words.join("_")
}

/// The distortion model, by its name in usgscsm.
fn distortion(document: &Object<'_>, turned_rad: f64) -> Result<DistortionModel, IsdError> {
    const KEY: &str = "optical_distortion";
    const KNOWN: &str = "one of the supported distortions radial, transverse and lrolrocnac";
    let table = document.object(KEY)?;
    let [name] = table.keys()[..] else {
        return Err(document.refused(KEY, KNOWN));
    };
    match name {
        "radial" => {
            let coefficients = table.object(name)?.list("coefficients", 3)?;
            let none = coefficients.iter().all(|k| k.abs() <= 0.0);
            Ok(if none {
                DistortionModel::None
            } else {
                DistortionModel::RadialPolynomial { coefficients }
            })
        }
        "lrolrocnac" | "transverse" if turned_rad.sin().abs() > ALONG_AXIS => {
            let expected = format!("samples along y, to which the distortion {name} applies");
            Err(document.refused("focal2pixel_samples", expected))
        }
        "transverse" => {
            let polynomials = table.object(name)?;
            Ok(DistortionModel::Transverse {
                coefficients: [polynomials.numbers("x")?, polynomials.numbers("y")?],
            })
        }
        "lrolrocnac" => {
            let [coefficient_per_mm2] = table.object(name)?.numbers("coefficients")?;
            Ok(DistortionModel::AcrossQuotient {
                coefficient_per_mm2,
            })
        }
        _ => Err(document.refused(KEY, KNOWN)),
    }
}

/// The calibration whose result the support data are.
fn calibration(document: &Object<'_>) -> Result<Option<Calibrated>, IsdError> {
    if !document.has(CALIBRATED_BY) {
        return Ok(None);
    }
    let origin = document.object(CALIBRATED_BY)?;
    Ok(Some(Calibrated {
        calibration: origin.text("calibration")?.to_owned(),
        camera: origin.text("camera")?.to_owned(),
        valid: origin.has("verdict") && origin.text("verdict")? == VALID,
        is_of_other_orbit: origin.has(APPLIED) && origin.any(APPLIED)?.as_bool() == Some(true),
    }))
}
