//! Changes of binary files: C-kernels, orbits, frames of PEDR files.

use areograph::pds::pedr::{LABEL_BYTES, RECORD_BYTES, Record};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::{
    common::{
        case::Case,
        daf::{segment_words, set_word, summaries, word},
        json,
        mission::mission,
        number,
    },
    text::Number,
};

const ATTITUDE: &str = "kernels/mgs_sc_scene.bc";
/// Ticks of a second of the clock, and those at the start of its partition (`mgs_clock.tsc`).
const TICKS: f64 = 256.0;
const PARTITION_TICKS: f64 = 1.361_113_344e11;

/// A quaternion, scalar first, followed by a rotation.
pub(super) fn turned([w, x, y, z]: [f64; 4], axis: [f64; 3], mrad: f64) -> [f64; 4] {
    let turn = UnitQuaternion::new(Vector3::from(axis).normalize() * mrad / 1e3);
    let turned = turn * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    [turned.w, turned.i, turned.j, turned.k]
}

/// A segment of a binary kernel: its first word, the number of its packets, and first and last instant.
struct Segment {
    first: usize,
    packets: usize,
    bounds: [f64; 2],
}

/// Segments whose last word is the number of packets.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small whole number"
)]
fn segments(bytes: &[u8]) -> Vec<Segment> {
    let words = segment_words(bytes).into_iter().zip(summaries(bytes));
    let segment = |((first, last), summary): ((usize, usize), usize)| Segment {
        first,
        packets: word(bytes, last) as usize,
        bounds: [0, 8].map(|at| {
            let bytes = bytes[summary + at..summary + at + 8].try_into().unwrap();
            f64::from_le_bytes(bytes)
        }),
    };
    words.map(segment).collect()
}

/// Changes packets of `N` words of the segments that hold an instant, or of all; the change is given the number of the packet
/// as a share of its segment, from -1 to 1.
fn change_packets<const N: usize>(
    case: &Case,
    kernel: &str,
    instant: Option<f64>,
    change: impl Fn(&mut [f64; N], f64),
) {
    let mut bytes = case.read(kernel);
    let mut changed = 0;
    for segment in segments(&bytes) {
        let [first, last] = segment.bounds;
        if instant.is_some_and(|instant| !(first..=last).contains(&instant)) {
            continue;
        }
        for packet in 0..segment.packets {
            let at = segment.first + N * packet;
            let mut values: [f64; N] = std::array::from_fn(|part| word(&bytes, at + part));
            let share = 2.0 * packet as f64 / (segment.packets - 1) as f64 - 1.0;
            change(&mut values, share);
            for (part, value) in values.into_iter().enumerate() {
                set_word(&mut bytes, at + part, value);
            }
            changed += 1;
        }
    }
    assert!(
        changed > 0 && bytes != case.read(kernel),
        "{kernel} is not changed"
    );
    case.write(kernel, bytes);
}

/// What is done to attitudes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Attitude {
    /// Those of the day of an image; of all by default.
    #[serde(default)]
    image: Option<String>,
    #[serde(default)]
    what: What,
    /// Axis of the bus.
    #[serde(default)]
    axis: [f64; 3],
    #[serde(default)]
    mrad: f64,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum What {
    /// Turned about an axis of the bus.
    #[default]
    Turned,
    /// Turned about an axis of the inertial frame.
    TurnedInertially,
    /// Turned about an axis of the bus by an angle that grows over the segment, from minus to plus.
    Drifting,
    /// The rotation from the bus in place of that to it.
    Inverse,
    /// The scalar part of each quaternion last.
    ScalarLast,
    /// Angular rates with the other sign.
    RatesReversed,
    /// Angular rates of zero.
    WithoutRates,
}

impl Attitude {
    pub(super) fn make(&self, case: &Case) {
        let instant = self.image.as_ref().map(|image| {
            let label = String::from_utf8(case.read(&format!("labels/{image}.lbl"))).unwrap();
            let (_, count) = label
                .split_once("SPACECRAFT_CLOCK_START_COUNT = \"")
                .unwrap();
            let seconds: f64 = count.split(':').next().unwrap().parse().unwrap();
            seconds * TICKS - PARTITION_TICKS
        });
        change_packets(case, ATTITUDE, instant, |record: &mut [f64; 7], share| {
            let [w, x, y, z, rates @ ..] = *record;
            let (mut attitude, mut rates) = ([w, x, y, z], rates);
            match self.what {
                What::Turned => attitude = turned(attitude, self.axis, self.mrad),
                What::Drifting => attitude = turned(attitude, self.axis, self.mrad * share),
                What::TurnedInertially => {
                    // Conjugates exchange the sides.
                    let [w, x, y, z] = turned([w, -x, -y, -z], self.axis, -self.mrad);
                    attitude = [w, -x, -y, -z];
                }
                What::Inverse => attitude = [w, -x, -y, -z],
                What::ScalarLast => attitude = [x, y, z, w],
                What::RatesReversed => rates = rates.map(|rate| -rate),
                What::WithoutRates => rates = [0.0; 3],
            }
            record[..4].copy_from_slice(&attitude);
            record[4..].copy_from_slice(&rates);
        });
    }
}

/// What is done to states of an orbit.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Orbit {
    #[serde(default = "nav")]
    kernel: String,
    /// Those of the day of an image; of all by default.
    #[serde(default)]
    image: Option<String>,
    /// Moved along the velocity, along the position and along their vector product, metres.
    #[serde(default)]
    along_up_cross_m: [f64; 3],
    /// Moved in the frame of the kernel, metres.
    #[serde(default)]
    xyz_m: [f64; 3],
    /// Positions and velocities are multiplied.
    #[serde(default)]
    position: Option<f64>,
    #[serde(default)]
    velocity: Option<f64>,
    /// Turned about the third axis of the kernel's frame.
    #[serde(default)]
    turn_mrad: f64,
}

fn nav() -> String {
    "kernels/mgs_nav_scene.bsp".to_owned()
}

impl Orbit {
    pub(super) fn make(&self, case: &Case) {
        let instant = self.image.as_ref().map(|image| {
            let truth = json(&mission().join("truth.json"));
            let images = truth["images"].as_array().unwrap().iter();
            let image = images.clone().find(|of| of["id"] == image.as_str());
            number(&image.unwrap()["start_et_s"])
        });
        let turn = UnitQuaternion::new(Vector3::z() * self.turn_mrad / 1e3);
        change_packets(case, &self.kernel, instant, |state: &mut [f64; 6], _| {
            let [x, y, z, u, v, w] = *state;
            let (place, velocity) = (Vector3::new(x, y, z), Vector3::new(u, v, w));
            let [up, along] = [place.normalize(), velocity.normalize()];
            let [along_m, up_m, cross_m] = self.along_up_cross_m;
            let moved_m = along * along_m
                + up * up_m
                + up.cross(&along) * cross_m
                + Vector3::from(self.xyz_m);
            let place = turn * (place * self.position.unwrap_or(1.0) + moved_m / 1e3);
            let velocity = turn * velocity * self.velocity.unwrap_or(1.0);
            state[..3].copy_from_slice(place.as_slice());
            state[3..].copy_from_slice(velocity.as_slice());
        });
    }
}

/// What is done to the frames of a PEDR file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Shots {
    /// All files of the pair by default.
    #[serde(default = "both")]
    files: Vec<String>,
    fields: Vec<Field>,
    number: Number,
    /// One in so many frames.
    #[serde(default)]
    one_in: Option<usize>,
}

fn both() -> Vec<String> {
    ["pedr/ap19019k.b", "pedr/ap19117l.b"]
        .map(str::to_owned)
        .to_vec()
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Field {
    Ranges,
    ShotRadii,
    MidRadius,
    GroundLatitude,
    GroundLongitude,
    GroundLatitudeChange,
    GroundLongitudeChange,
    SpacecraftRadius,
    SpacecraftLatitude,
    SpacecraftLongitude,
    Crossover,
    Time,
    Areoid,
    Channels,
    Classes,
    OffNadir,
}

/// The nearest whole number.
#[allow(clippy::cast_possible_truncation, reason = "fields of a frame")]
fn whole(value: f64) -> i32 {
    assert!(value.abs() < f64::from(i32::MAX), "{value}");
    value.round() as i32
}

fn unsigned(value: f64) -> u32 {
    u32::try_from(whole(value)).unwrap()
}

impl Field {
    fn change(self, record: &mut Record, number: Number) {
        let of = |value: i32| whole(number.of(f64::from(value)));
        match self {
            Self::Ranges => {
                for range in record.range_cm.iter_mut().filter(|range| range.get() > 0) {
                    range.set(of(range.get()));
                }
                record.mid_range_cm.set(of(record.mid_range_cm.get()));
            }
            Self::ShotRadii => {
                for radius in &mut record.shot_radius_cm {
                    radius.set(of(radius.get()));
                }
            }
            Self::MidRadius => record.mid_radius_cm.set(of(record.mid_radius_cm.get())),
            Self::GroundLatitude => {
                let field = &mut record.ground_latitude_microdegrees;
                field.set(of(field.get()));
            }
            Self::GroundLongitude => {
                let field = &mut record.ground_longitude_microdegrees;
                field.set(of(field.get()));
            }
            Self::GroundLatitudeChange => {
                let field = &mut record.ground_latitude_change_microdegrees;
                field.set(of(field.get()));
            }
            Self::GroundLongitudeChange => {
                let field = &mut record.ground_longitude_change_microdegrees;
                field.set(of(field.get()));
            }
            Self::SpacecraftRadius => {
                let field = &mut record.spacecraft_radius_cm;
                field.set(unsigned(number.of(f64::from(field.get()))));
            }
            Self::SpacecraftLatitude => {
                let field = &mut record.spacecraft_latitude_microdegrees;
                field.set(of(field.get()));
            }
            Self::SpacecraftLongitude => {
                let field = &mut record.spacecraft_longitude_microdegrees;
                field.set(of(field.get()));
            }
            Self::Crossover => {
                let field = &mut record.crossover_residual_cm;
                field.set(of(field.get()));
            }
            Self::Time => {
                let seconds = number.of(record.time_s.get());
                record.time_s.set(seconds);
                let seconds = seconds.floor();
                record.time_whole_s.set(whole(seconds));
                let fraction = (record.time_s.get() - seconds) * 1e6;
                record.time_fraction_us.set(whole(fraction));
            }
            Self::Areoid => {
                let field = &mut record.areoid_radius_cm;
                field.set(unsigned(number.of(f64::from(field.get()))));
            }
            Self::Channels => {
                for channel in &mut record.channel {
                    *channel = u8::try_from(of(i32::from(*channel))).unwrap();
                }
            }
            Self::Classes => {
                for class in &mut record.class {
                    class.set(i16::try_from(of(i32::from(class.get()))).unwrap());
                }
            }
            Self::OffNadir => {
                let field = &mut record.off_nadir_microdegrees;
                field.set(of(field.get()));
            }
        }
    }
}

impl Shots {
    pub(super) fn make(&self, case: &Case) {
        for file in &self.files {
            let sound = case.read(file);
            let mut bytes = sound.clone();
            let frames = bytes[LABEL_BYTES..].chunks_exact_mut(RECORD_BYTES);
            for frame in frames.step_by(self.one_in.unwrap_or(1)) {
                let mut record = Record::from_bytes((&*frame).try_into().unwrap());
                for field in &self.fields {
                    field.change(&mut record, self.number);
                }
                frame.copy_from_slice(&record.to_bytes());
            }
            assert!(bytes != sound, "{file} is not changed");
            case.write(file, bytes);
        }
    }
}
