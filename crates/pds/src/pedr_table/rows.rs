//! Conversion of records to lines, with the program's arithmetic: the order of operations determines the last digit.

use std::{
    f64::consts::PI,
    io::{self, Write},
};

use super::{Preferences, Variant, columns::Row};
use crate::pedr::{Complaint, FieldGuard, File, Record};

/// Rules of selection and correction of shots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rules {
    /// Rules of `pedr2tab`, errors included.
    Program,
    /// Rules of areograph: every shot is checked individually, nothing is carried over from another frame or file,
    /// invalid records are left out.
    PerShot,
}

/// Threshold gains by channel, millivolts; single precision as in the program.
const GAINS_MV: [f32; 4] = [2.29, 1.32, 0.763, 0.440];
/// Shots of a frame.
const SHOTS_OF_FRAME: u8 = 20;
/// Text that is gathered before it is written, bytes.
const TEXT: usize = 1 << 16;

/// Corrections of the shots of a frame; the program keeps them from frame to frame.
#[derive(Debug, Clone, Copy, Default)]
struct Corrections {
    latitude_deg_per_m: f64,
    longitude_deg_per_m: f64,
    crossover_m: f64,
    crossover_change_m: f64,
}

/// A table, or one table after the other, of some files.
#[derive(Debug)]
pub struct Table {
    preferences: Preferences,
    variant: Variant,
    rules: Rules,
    /// Whether crossover residuals are read: not after the first file without them.
    crossover: bool,
    /// Orbit model from which on parallax is used: 3 for all files after an old one.
    gate: i16,
    corrections: Corrections,
    /// Crossover residual of the last frame in the window, centimetres.
    last_cm: i32,
    /// Lines written.
    pub shots: u64,
}

impl Table {
    /// A table without lines.
    #[must_use]
    pub fn new(preferences: Preferences, variant: Variant, rules: Rules) -> Self {
        Self {
            crossover: preferences.crossover,
            preferences,
            variant,
            rules,
            gate: 2,
            corrections: Corrections::default(),
            last_cm: 0,
            shots: 0,
        }
    }

    /// The preferences.
    #[must_use]
    pub const fn preferences(&self) -> &Preferences {
        &self.preferences
    }

    /// Writes the headings, if requested.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_headings(&self, out: &mut dyn Write) -> io::Result<()> {
        if !self.preferences.headings {
            return Ok(());
        }
        let headings = self.variant.headings(self.preferences.groups);
        out.write_all(headings.as_bytes())
    }

    /// Writes the lines of a file; returns the records left out as invalid, none by the program's rules.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, file: &File, out: &mut dyn Write) -> io::Result<Vec<Complaint>> {
        match self.rules {
            Rules::Program => self.write_by_program(file, out).map(|()| Vec::new()),
            Rules::PerShot => self.write_per_shot(file, out),
        }
    }

    fn write_by_program(&mut self, file: &File, out: &mut dyn Write) -> io::Result<()> {
        if let Some(version) = file.label().software_version {
            self.crossover &= version >= 7.125;
            if version <= 7.0 {
                self.gate = 3;
            }
        }
        let Some(first) = file.records().first() else {
            return Ok(());
        };
        if model(first) >= self.gate {
            // The first frame is preceded by the mirrored second one; without a second frame there are no lines.
            let Some(second) = file.records().get(1) else {
                return Ok(());
            };
            let [first_cm, second_cm] =
                [first, second].map(|record| record.crossover_residual_cm.get());
            self.last_cm = first_cm.wrapping_sub(second_cm.wrapping_sub(first_cm));
        }
        let mut text = String::new();
        for record in file.records() {
            let latitude_deg = 1e-6 * f64::from(record.ground_latitude_microdegrees.get());
            let longitude_deg = 1e-6 * f64::from(record.ground_longitude_microdegrees.get());
            let within = |value: f64, [least, most]: [f64; 2]| (least..=most).contains(&value);
            if !within(latitude_deg, self.preferences.latitude_deg)
                || !within(longitude_deg, self.preferences.longitude_deg)
            {
                continue;
            }
            if model(record) >= self.gate {
                self.correct_by_program(record);
            }
            for shot in 0..SHOTS_OF_FRAME {
                if self.is_wanted(record, usize::from(shot)) {
                    let row = self.row(record, shot, &self.corrections);
                    self.line(&mut text, &row);
                }
            }
            flush(&mut text, TEXT, out)?;
        }
        flush(&mut text, 0, out)
    }

    /// Updates the corrections from a frame that passed the gate; another frame leaves them unchanged.
    fn correct_by_program(&mut self, record: &Record) {
        let corrections = &mut self.corrections;
        corrections.latitude_deg_per_m =
            1e-9 * f64::from(record.parallax_latitude_nanodegrees_per_m.get());
        corrections.longitude_deg_per_m =
            1e-9 * f64::from(record.parallax_longitude_nanodegrees_per_m.get());
        if self.crossover {
            let residual_cm = record.crossover_residual_cm.get();
            corrections.crossover_m = 1e-2 * f64::from(residual_cm);
            corrections.crossover_change_m =
                1e-2 * f64::from(residual_cm.wrapping_sub(self.last_cm));
            self.last_cm = residual_cm;
        }
    }

    fn write_per_shot(&mut self, file: &File, out: &mut dyn Write) -> io::Result<Vec<Complaint>> {
        /// Records checked at a time.
        const STEP: usize = 4_096;
        let guard = FieldGuard::new(file.label().software_version);
        let mut complaints = file.label_complaints().to_vec();
        let mut text = String::new();
        for start in (0..file.records().len()).step_by(STEP) {
            for (row, frame) in file.frames(start..start + STEP, guard) {
                let frame = match frame {
                    Ok(frame) => frame,
                    Err(error) => {
                        complaints.push(file.record_complaint(row, &error));
                        continue;
                    }
                };
                let record = frame.record();
                let spoiled = frame.spoiled_shots();
                complaints.extend(
                    spoiled
                        .error()
                        .map(|error| file.record_complaint(row, error)),
                );
                let mut corrections = Corrections::default();
                if guard.parallax_holds(record) {
                    corrections.latitude_deg_per_m =
                        1e-9 * f64::from(record.parallax_latitude_nanodegrees_per_m.get());
                    corrections.longitude_deg_per_m =
                        1e-9 * f64::from(record.parallax_longitude_nanodegrees_per_m.get());
                }
                if self.preferences.crossover {
                    corrections.crossover_m = guard.crossover_m(record).unwrap_or(0.0);
                    corrections.crossover_change_m = frame.crossover_change_m();
                }
                for shot in (0..SHOTS_OF_FRAME).filter(|shot| !spoiled.contains(shot + 1)) {
                    if !self.is_wanted(record, usize::from(shot)) {
                        continue;
                    }
                    let row = self.row(record, shot, &corrections);
                    if self.preferences.holds(&row) {
                        self.line(&mut text, &row);
                    }
                }
                flush(&mut text, TEXT, out)?;
            }
        }
        complaints.extend(file.trailing_complaint());
        flush(&mut text, 0, out)?;
        Ok(complaints)
    }

    /// Whether shot `shot`, counted from 0, has a return and a requested class.
    fn is_wanted(&self, record: &Record, shot: usize) -> bool {
        let class = record.class[shot].get();
        record.returned(shot)
            && (self.preferences.all_classes || class == i16::from(self.preferences.ground))
    }

    fn line(&mut self, text: &mut String, row: &Row) {
        self.variant.line(text, self.preferences.groups, row);
        self.shots += 1;
    }

    /// The values of shot `shot`, counted from 0.
    fn row(&self, record: &Record, shot: u8, corrections: &Corrections) -> Row {
        let number = f64::from(shot) + 1.0;
        let x = (number - 10.5) / 20.0;
        let index = usize::from(shot);
        let raw_m = 0.01 * f64::from(record.shot_radius_cm[index].get());
        let higher_m = raw_m - 1e-2 * f64::from(record.mid_radius_cm.get());
        let radius_m = raw_m - corrections.crossover_m - x * corrections.crossover_change_m;
        let [ground_longitude, ground_latitude] = [
            (
                record.ground_longitude_microdegrees,
                record.ground_longitude_change_microdegrees,
            ),
            (
                record.ground_latitude_microdegrees,
                record.ground_latitude_change_microdegrees,
            ),
        ]
        .map(|(mid, change)| self.linear(1e-6, mid.get(), x, change.get()));
        let latitude_deg = ground_latitude + corrections.latitude_deg_per_m * higher_m;
        let areoid_radius_m = self.areoid_m(record, x);
        let mut row = Row {
            longitude_deg: one_turn(ground_longitude + corrections.longitude_deg_per_m * higher_m),
            latitude_deg,
            topography_m: radius_m - areoid_radius_m,
            range_m: 0.01 * f64::from(record.range_cm[index].get()),
            radius_m,
            channel: i64::from(record.channel[index].cast_signed()),
            flag: i64::from(record.attitude_flag.get().cast_signed())
                + if record.class[index].get() == 0 { 4 } else { 0 },
            spacecraft_longitude_deg: one_turn(self.linear(
                1e-6,
                record.spacecraft_longitude_microdegrees.get(),
                x,
                record.spacecraft_longitude_change_microdegrees.get(),
            )),
            spacecraft_latitude_deg: self.linear(
                1e-6,
                record.spacecraft_latitude_microdegrees.get(),
                x,
                record.spacecraft_latitude_change_microdegrees.get(),
            ),
            spacecraft_radius_m: self.spacecraft_radius_m(record, x),
            off_nadir_deg: 1e-6 * f64::from(record.off_nadir_microdegrees.get()),
            et_s: self.time_s(record, number),
            areoid_radius_m,
            orbit: i64::from(record.orbit.get().cast_signed()),
            orbit_model: i64::from(model(record)),
            packet: i64::from(record.packet.get() & 0x3FFF),
            shot: i64::from(shot)
                + 1
                + 20 * (i64::from(record.frame_index.get().cast_signed()) - 1),
            ..Row::default()
        };
        if self.preferences.areographic {
            let (to_degrees, to_radians) = (180.0 / PI, PI / 180.0);
            let tangent = (to_radians * latitude_deg).tan();
            row.areographic_latitude_deg =
                to_degrees * (self.preferences.axes_squared * tangent).atan();
        }
        illumination(record, &mut row);
        self.pulses(record, index, &mut row);
        row
    }

    /// `mid + x · change`, in the order of the variant.
    fn linear(&self, unit: f64, mid: i32, x: f64, change: i32) -> f64 {
        let (mid, change) = (f64::from(mid), f64::from(change));
        match self.variant {
            Variant::Team => unit * mid + unit * x * change,
            Variant::Usgs => unit * mid + x * (unit * change),
        }
    }

    fn areoid_m(&self, record: &Record, x: f64) -> f64 {
        let mid_cm = record.areoid_radius_cm.get().cast_signed();
        self.linear(0.01, mid_cm, x, record.areoid_radius_change_cm.get())
    }

    fn spacecraft_radius_m(&self, record: &Record, x: f64) -> f64 {
        let mid_cm = f64::from(record.spacecraft_radius_cm.get().cast_signed());
        let change_cm = f64::from(record.spacecraft_radius_change_cm.get());
        match self.variant {
            Variant::Team => 1e-2 * (mid_cm + x * change_cm),
            Variant::Usgs => 1e-2 * mid_cm + x * (1e-2 * change_cm),
        }
    }

    fn time_s(&self, record: &Record, number: f64) -> f64 {
        let mid_s = match self.variant {
            Variant::Team => record.time_s.get(),
            Variant::Usgs => {
                f64::from(record.time_whole_s.get())
                    + 1e-6 * f64::from(record.time_fraction_us.get())
            }
        };
        let frequency_ghz = 1e-9 * f64::from(record.clock_frequency_hz.get().cast_signed());
        mid_s + (0.01 / frequency_ghz) * (number - 10.5)
    }

    fn pulses(&self, record: &Record, shot: usize, row: &mut Row) {
        // Products with constants of single precision are of single precision.
        let single = |unit: f32, counts: i16| f64::from(unit * f32::from(counts));
        row.range_correction_m = 0.01 * f64::from(record.range_correction_cm[shot].get());
        row.pulse_width = single(0.1, record.pulse_width[shot].get());
        row.optical_width = single(0.1, record.optical_width[shot].get());
        row.transmit_energy = single(0.01, record.transmit_energy[shot].get());
        row.received_energy = f64::from(record.received_energy[shot].get());
        row.reflectivity =
            f64::from(0.001 * f32::from(record.reflectivity_millipercent[shot].get()));
        // The program reads beyond its tables for an invalid channel; here such a shot has none of these values.
        let half = shot / 10;
        let channel = usize::from(record.channel[shot]).checked_sub(1);
        if let Some((channel, gain_mv)) = channel.and_then(|at| Some((at, GAINS_MV.get(at)?))) {
            row.threshold_mv = single(*gain_mv, record.threshold_counts[half][channel].get());
            row.background = i64::from(record.background_counts[half][channel].get());
        }
        let width = record.pulse_width_counts[shot];
        row.width_counts = match self.rules {
            Rules::Program => i64::from(width.cast_signed()),
            Rules::PerShot => i64::from(width),
        };
        row.energy_counts = i64::from(record.received_energy_counts[shot]);
    }
}

impl Preferences {
    /// Whether the window contains a shot, for limits in any turn.
    fn holds(&self, row: &Row) -> bool {
        let within = |value: f64, [least, most]: [f64; 2]| (least..=most).contains(&value);
        let [west_deg, mut east_deg] = self.longitude_deg;
        // West above east: the window continues across the end of the turn.
        if west_deg > east_deg {
            east_deg = west_deg + (east_deg - west_deg).rem_euclid(360.0);
        }
        let turns = [-360.0, 0.0, 360.0].map(|turn| row.longitude_deg + turn);
        within(row.latitude_deg, self.latitude_deg)
            && turns
                .into_iter()
                .any(|longitude_deg| within(longitude_deg, [west_deg, east_deg]))
    }
}

/// Angles of the Sun and the range gate.
fn illumination(record: &Record, row: &mut Row) {
    let degrees = |angle: u16| f64::from(angle.cast_signed()) * 0.0180 / PI;
    row.local_hour = 12.0 + f64::from(record.local_time.get()) * 0.0012 / PI;
    row.phase_deg = degrees(record.phase_angle.get());
    row.incidence_deg = degrees(record.solar_incidence.get());
    row.emission_deg = degrees(record.emission_angle.get());
    row.range_window_m = 1e-2 * f64::from(record.range_window_cm.get());
    row.range_delay_m = 1e-2 * f64::from(record.range_delay_cm.get());
}

fn model(record: &Record) -> i16 {
    record.orbit_quality.get().cast_signed()
}

/// A longitude brought by one turn into 0 to 360 degrees.
fn one_turn(longitude_deg: f64) -> f64 {
    let east = if longitude_deg < 0.0 {
        longitude_deg + 360.0
    } else {
        longitude_deg
    };
    if east >= 360.0 { east - 360.0 } else { east }
}

/// Writes the text when it is longer than `length`.
fn flush(text: &mut String, length: usize, out: &mut dyn Write) -> io::Result<()> {
    if text.len() > length {
        out.write_all(text.as_bytes())?;
        text.clear();
    }
    Ok(())
}
