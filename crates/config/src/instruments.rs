//! Instrument files of the program, and instrument files that a site names.

use std::{path::Path, sync::LazyLock};

use toml::Value;

use super::{
    data_file::{self, DataTable},
    declare::{Form, Found, ValueKind},
    problems::{Problems, Review},
};
use areograph_base::{
    constants::{SPACECRAFT, Spacecraft},
    instruments::{
        Altimeter, COEFFICIENTS_MAX, DetectorLine, DistortionModel, Instrument, LabelNames,
        Mounting, NaifNames, Optics, PointingTime, Sense, SummingLimits,
    },
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::pushbroom::Distortion;

/// Files below `config` with their text, built into the program.
macro_rules! built_in {
    ($($file:literal),+ $(,)?) => {
        [$((concat!("config/", $file), include_str!(concat!("../../../config/", $file)))),+]
    };
}

/// Files of the built-in cameras; the first is the default, and cameras on its spacecraft precede all others.
const INSTRUMENTS: &[(&str, &str)] = &built_in![
    "instruments/moc_na.toml",
    "instruments/moc_wa_red.toml",
    "instruments/moc_wa_blue.toml",
    "instruments/hrsc_nd.toml",
    "instruments/hrsc_s1.toml",
    "instruments/hrsc_s2.toml",
    "instruments/hrsc_p1.toml",
    "instruments/hrsc_p2.toml",
    "instruments/hrsc_ir.toml",
    "instruments/hrsc_gr.toml",
    "instruments/hrsc_bl.toml",
    "instruments/hrsc_re.toml",
];
/// Files of the built-in altimeters; the first is the default.
const ALTIMETERS: &[(&str, &str)] = &built_in!["altimeters/mola.toml", "altimeters/lola.toml"];
/// Numbers of NAIF for spacecraft, instruments and frames.
const NAIF_IDS: [i32; 2] = [-999_999_999, -1];

static CAMERAS: LazyLock<Vec<Instrument>> = LazyLock::new(|| all_of(INSTRUMENTS, instrument));
static LASERS: LazyLock<Vec<Altimeter>> = LazyLock::new(|| all_of(ALTIMETERS, altimeter));

fn all_of<T>(files: &[(&str, &str)], read: fn(&str, &Path) -> Result<T, Problems>) -> Vec<T> {
    let files = files.iter();
    let all: Result<Vec<T>, Problems> = files
        .map(|(file, text)| read(text, Path::new(file)))
        .collect();
    of_the_program(all)
}

/// The content of a built-in file.
#[expect(
    clippy::panic,
    reason = "a program built with an invalid file; a test reads all built-in files"
)]
fn of_the_program<T>(read: Result<T, Problems>) -> T {
    read.unwrap_or_else(|problems| panic!("built with an invalid file: {problems}"))
}

/// The cameras on the spacecraft of the laser, whose archive the program searches.
#[must_use]
pub fn built_in_instruments() -> &'static [Instrument] {
    let own = CAMERAS.partition_point(|camera| camera.spacecraft.has_laser());
    &CAMERAS[..own]
}

/// All built-in cameras, including those on other spacecraft.
#[must_use]
pub fn all_instruments() -> &'static [Instrument] {
    &CAMERAS
}

/// The default camera of images, used if neither configuration nor label names one.
#[must_use]
pub fn usual_instrument() -> &'static Instrument {
    &CAMERAS[0]
}

/// The built-in altimeters.
#[must_use]
pub fn built_in_altimeters() -> &'static [Altimeter] {
    &LASERS
}

/// The default altimeter of sites.
#[must_use]
pub fn usual_altimeter() -> &'static Altimeter {
    &LASERS[0]
}

/// A value that is an identifier, or the path of a file like the built-in ones.
pub(super) struct DataFile<T: 'static> {
    /// The kind of file, with its article.
    what: &'static str,
    /// The built-in ones.
    known: fn() -> &'static [T],
    /// The identifier of one.
    id: fn(&T) -> &str,
    /// Reader of the text of a file.
    read: fn(&str, &Path) -> Result<T, Problems>,
}

/// The camera of an image: a built-in one, or an instrument file.
pub(super) const CAMERA: DataFile<Instrument> = DataFile {
    what: "an instrument file",
    known: all_instruments,
    id: |camera| &camera.id,
    read: instrument,
};

/// The altimeter of a site: a built-in one, or an altimeter file.
pub(super) const ALTIMETER: DataFile<Altimeter> = DataFile {
    what: "an altimeter file",
    known: built_in_altimeters,
    id: |altimeter| &altimeter.id,
    read: altimeter,
};

impl<T: Clone> Form for DataFile<T> {
    type Value = T;

    fn kind(&self) -> ValueKind {
        ValueKind::Text { empty: false }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<T> {
        let known = (self.known)();
        let Some(written) = found.value.get_ref().as_str() else {
            found.refuse(review, self.kind());
            return None;
        };
        if let Some(one) = known.iter().find(|one| (self.id)(one) == written) {
            return Some(one.clone());
        }
        let path = review.resolve(written);
        if !path.is_file() {
            let ids: Vec<&str> = known.iter().map(self.id).collect();
            let expected = format!("{}, or the path of {}", ids.join(", "), self.what);
            found.refuse(review, expected);
            return None;
        }
        data_file::named(&path, found, review, self.read)
    }

    fn written(&self, value: &T) -> Value {
        Value::from((self.id)(value))
    }
}

/// The camera that the instrument file `text` describes.
///
/// # Errors
/// Everything that is wrong with it, each with its place.
pub fn instrument(text: &str, file: &Path) -> Result<Instrument, Problems> {
    data_file::read(text, file, |top, review| {
        let instrument = camera(top, review);
        if !review.has_problems()
            && let Err(folded) = Distortion::check(&instrument)
        {
            review.problem(None, format!("distortion: {folded}"));
        }
        instrument
    })
}

fn camera(top: &mut DataTable<'_>, review: &mut Review<'_>) -> Instrument {
    let all = Spacecraft::all().iter();
    let choices: Vec<(&str, &'static Spacecraft)> = all.map(|one| (&*one.id, one)).collect();
    let spacecraft = top.optional_word(review, "spacecraft", &choices);
    let spacecraft = spacecraft.unwrap_or(&SPACECRAFT);
    Instrument {
        id: top.text(review, "id"),
        name: top.text(review, "name"),
        spacecraft,
        label: top.table(review, "label", |table, _, review| LabelNames {
            instrument: table.text(review, "instrument"),
            filter: table.optional_text(review, "filter"),
            serial: table.optional_text(review, "serial"),
        }),
        naif: top.table(review, "naif", |table, _, review| {
            naif(table, spacecraft, review)
        }),
        mounting: top.table(review, "mounting", mounting),
        optics: top.table(review, "optics", |table, _, review| Optics {
            focal_length_mm: table.number(review, "focal_length_mm", [0.1, 1e6]),
            pixel_pitch_mm: table.number(review, "pixel_pitch_mm", [1e-4, 1.0]),
        }),
        detector: top.table(review, "detector", detector),
        distortion: top.table(review, "distortion", distortion),
        summing: top.table(review, "summing", |table, _, review| SummingLimits {
            max: table.whole(review, "max", [1, 1_000]).unsigned_abs(),
            variable_codes: table.optional_counts(review, "variable_codes", 1_000),
        }),
        pointing: top.table(review, "pointing", |table, source, review| PointingTime {
            ck_bias_s: ck_bias_s(table, spacecraft, review),
            source,
        }),
        calibration: None,
    }
}

/// Names and numbers of NAIF; the bus belongs to the spacecraft.
fn naif(
    table: &mut DataTable<'_>,
    spacecraft: &'static Spacecraft,
    review: &mut Review<'_>,
) -> NaifNames {
    let instrument = table.whole(review, "instrument", NAIF_IDS);
    let frame_id = table.optional_whole(review, "frame_id", NAIF_IDS);
    let turn_deg = table.optional_number(review, "turn_deg", [-360.0, 360.0]);
    let names = NaifNames {
        instrument,
        frame: table.text(review, "frame"),
        frame_id: frame_id.unwrap_or(instrument),
        turn_rad: turn_deg.unwrap_or(0.0) * RADIANS_PER_DEGREE,
        bus: table.whole(review, "bus", NAIF_IDS),
        bus_frame: table.text(review, "bus_frame"),
        kernel: table.text(review, "kernel"),
    };
    let of_spacecraft = names.bus == spacecraft.bus && names.bus_frame == spacecraft.bus_frame;
    if !of_spacecraft && !review.has_problems() {
        let text = format!(
            "naif.bus is {} and naif.bus_frame is {}; expected {} and {} for {} (key spacecraft)",
            names.bus, names.bus_frame, spacecraft.bus, spacecraft.bus_frame, spacecraft.full_name
        );
        review.problem(None, text);
    }
    names
}

/// The time correction of the attitude, which applies to the kernels of one spacecraft.
fn ck_bias_s(
    table: &mut DataTable<'_>,
    spacecraft: &'static Spacecraft,
    review: &mut Review<'_>,
) -> f64 {
    let bias_s = table.number(review, "ck_bias_s", [-10.0, 10.0]);
    let max_s = spacecraft.ck_bias_max_s;
    if bias_s.abs() > max_s {
        let expected = if max_s > 0.0 {
            format!("-{max_s} to {max_s}")
        } else {
            "0: the attitude kernels need no time correction".to_owned()
        };
        let text = format!(
            "pointing.ck_bias_s is {bias_s} for a camera on {}; expected {expected}",
            spacecraft.full_name
        );
        review.problem(None, text);
    }
    bias_s
}

fn mounting(table: &mut DataTable<'_>, _source: String, review: &mut Review<'_>) -> Mounting {
    let [roll_rad, pitch_rad, yaw_rad] = ["roll_deg", "pitch_deg", "yaw_deg"]
        .map(|key| table.number(review, key, [-360.0, 360.0]) * RADIANS_PER_DEGREE);
    Mounting {
        roll_rad,
        pitch_rad,
        yaw_rad,
    }
}

fn detector(table: &mut DataTable<'_>, _source: String, review: &mut Review<'_>) -> DetectorLine {
    let senses = [("+y", Sense::PlusY), ("-y", Sense::MinusY)];
    DetectorLine {
        pixels: table.whole(review, "pixels", [1, 1_000_000]).unsigned_abs(),
        boresight_px: table.number(review, "boresight_px", [-1e6, 1e6]),
        along_track_px: table.number(review, "along_track_px", [-1e6, 1e6]),
        samples_along: table
            .word(review, "samples_along", &senses)
            .unwrap_or(Sense::PlusY),
    }
}

/// The forms of distortion.
#[derive(Clone, Copy)]
enum Model {
    None,
    Radial,
    Angle,
}

fn distortion(
    table: &mut DataTable<'_>,
    _source: String,
    review: &mut Review<'_>,
) -> DistortionModel {
    let models = [
        ("none", Model::None),
        ("radial_polynomial", Model::Radial),
        ("angle_polynomial", Model::Angle),
    ];
    match table.word(review, "model", &models) {
        None | Some(Model::None) => DistortionModel::None,
        Some(Model::Radial) => DistortionModel::RadialPolynomial {
            coefficients: table.numbers(review, "coefficients", COEFFICIENTS_MAX),
        },
        Some(Model::Angle) => DistortionModel::AnglePolynomial {
            coefficients_rad: table
                .numbers(review, "coefficients_deg", COEFFICIENTS_MAX)
                .into_iter()
                .map(|degrees| degrees * RADIANS_PER_DEGREE)
                .collect(),
            scale: table.number(review, "scale", [0.5, 2.0]),
        },
    }
}

/// The altimeter that the file `text` describes.
///
/// # Errors
/// Everything that is wrong with it, each with its place.
pub fn altimeter(text: &str, file: &Path) -> Result<Altimeter, Problems> {
    data_file::read(text, file, |top, review| {
        let [id, name, full_name] = ["id", "name", "full_name"].map(|key| top.text(review, key));
        let (clock_bias_s, clock_source) = top.table(review, "clock", |table, source, review| {
            (table.number(review, "bias_s", [0.0, 10.0]), source)
        });
        let beam = top.has("beam").then(|| {
            top.table(review, "beam", |table, source, review| {
                (table.direction(review, "bus"), source)
            })
        });
        let (beam_in_bus, beam_source) = beam.unzip();
        Altimeter {
            id,
            name,
            full_name,
            clock_bias_s,
            clock_source,
            beam_in_bus,
            beam_source,
        }
    })
}
