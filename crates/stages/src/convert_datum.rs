//! Conversion of footprints and the file's own spacecraft positions from the file's datum to the frame of the products.

use std::sync::atomic::AtomicBool;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::search_footprints::SearchResult;
use areograph_base::{
    altimetry::{BiasScope, GroundRadius, MolaClock, TagSign},
    body::{Body, Datum},
    column::Column,
    error::Result,
    footprints::{AsRead, Footprint, Footprints, SourceFile},
    frames::BodyFixed,
    time::Et,
    units::{RADIANS_PER_DEGREE, wrap_pi},
};
use areograph_geom::{
    body_rotation::DatumConversion,
    ellipsoid::{Spherical, spherical_to_xyz_m},
    statistics::Summary,
};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

/// Footprints in IAU 2000, and the conversion of each file's coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Converted {
    /// The footprints.
    pub footprints: Footprints<BodyFixed>,
    /// The conversion of each file, in the order of [`Footprints::files`].
    pub files: Vec<FileConversion>,
    /// One sentence per file and one on radii, for log, manifest and report.
    pub notes: Vec<String>,
}

/// The conversion of the shots of one file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FileConversion {
    /// Shots of the file in the windows.
    pub shots: u32,
    /// Their shift on the ground, metres; all 0 for a file that was not converted.
    pub shift_m: Summary,
    /// Change of east longitude, degrees.
    pub longitude_shift_deg: Summary,
}

stage_inputs! {
    /// Footprints as read, and whether the clock correction turns Mars.
    pub struct ConvertDatum<'a> {
        /// Results of the search.
        pub found: &'a Output<SearchResult>,
        /// The clock of MOLA.
        pub altimeter_clock: &'a MolaClock,
        /// The radius of the ground.
        pub ground: &'a GroundRadius,
    }
}

impl Stage for ConvertDatum<'_> {
    const NAME: &'static str = "convert_datum";
    const METHOD: u32 = 6;
    const CHECKED: bool = true;
    type Output = Converted;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Converted> {
        let mut footprints = self.found.value()?.footprints.clone();
        footprints.ground = *self.ground;
        let choice = footprints.ground_choice();
        let mut converted = convert_datum(footprints, self.altimeter_clock);
        let note = |of: GroundRadius| format!("ground radii are used {}", of.words());
        converted.notes.extend(choice.map(note));
        Ok(converted)
    }
}

/// Rotates every shot out of its file's datum and into IAU 2000, through J2000.
///
/// Both rotations hold at the shot's tag, unless the clock correction is configured to reach the rotation (`scope`
/// `rotation` or `both`): then Mars is taken into IAU 2000 at the corrected time, which moves longitudes by 4.752e-4°
/// for 117 ms. Radii are unchanged. In the first case, files that are already in IAU 2000 are not altered, bit for
/// bit.
///
/// # Source
/// Shan et al. 2005, p. 99 (conversion through J2000 after T. Duxbury); constants in
/// [`areograph_base::constants`].
#[must_use]
pub fn convert_datum(footprints: Footprints<AsRead>, clock: &MolaClock) -> Converted {
    let turn_s = if clock.moves_rotation() {
        clock.correction_s()
    } else {
        0.0
    };
    let turns = turn_s.abs() > 0.0;
    let notes = footprints
        .files
        .iter()
        .map(|file| {
            note(
                footprints.body,
                &file.name,
                file.datum,
                turns.then_some(turn_s),
            )
        })
        .collect();
    let mut shifts = vec![(Column::new(), Column::new()); footprints.files.len()];
    let footprints = turned(footprints, clock, Shift::of, |file, shift| {
        let (shift_m, turn_deg) = &mut shifts[file];
        shift_m.push(shift.ground_m);
        turn_deg.push(shift.turn_rad / RADIANS_PER_DEGREE);
    });
    let conversion = |(shift_m, turn_deg): &(Column<f64>, Column<f64>)| FileConversion {
        shots: u32::try_from(shift_m.len()).unwrap_or(u32::MAX),
        shift_m: Summary::over(|| shift_m.iter()),
        longitude_shift_deg: Summary::over(|| turn_deg.iter()),
    };
    Converted {
        files: shifts.iter().map(conversion).collect(),
        footprints,
        notes,
    }
}

/// Rows that are converted at once.
const ROWS_AT_ONCE: usize = 1 << 16;

/// Longitude and latitude of footprint and spacecraft, radians.
type Places = [(f64, f64); 2];

/// The shift of a footprint by a conversion.
#[derive(Debug, Clone, Copy, Default)]
struct Shift {
    /// Distance on the ground, metres.
    ground_m: f64,
    /// Change of east longitude, radians.
    turn_rad: f64,
}

impl Shift {
    /// The shift of this shot to its converted longitude and latitude.
    fn of(shot: &Footprint, (longitude_rad, latitude_rad): (f64, f64)) -> Self {
        let here = spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, shot.radius_m);
        let there = spherical_to_xyz_m(longitude_rad, latitude_rad, shot.radius_m);
        Self {
            ground_m: (there - here).norm(),
            turn_rad: wrap_pi(longitude_rad - shot.longitude_rad),
        }
    }
}

/// The footprints, with every shot converted from its file's datum.
///
/// `record` is called for each shot with its file and what `measure` returns for the shot and its new longitude and
/// latitude, radians; with the default value for a shot that is not converted.
fn turned<M: Default + Send>(
    footprints: Footprints<AsRead>,
    clock: &MolaClock,
    measure: impl Fn(&Footprint, (f64, f64)) -> M + Sync,
    mut record: impl FnMut(usize, M),
) -> Footprints<BodyFixed> {
    let datums = footprints.files.iter();
    let datums: Vec<DatumTurn> = datums
        .map(|file| DatumTurn::new(file.datum, clock))
        .collect();
    let mut converted = footprints.declare::<BodyFixed>();
    let [
        mut longitude_rad,
        mut latitude_rad,
        mut spacecraft_longitude_rad,
        mut spacecraft_latitude_rad,
    ] = [const { Column::<f64>::new() }; 4];
    let rows = converted.len();
    for start in (0..rows).step_by(ROWS_AT_ONCE) {
        let rows = start..rows.min(start + ROWS_AT_ONCE);
        let moved = rows.clone().into_par_iter().map(|row| {
            let datum = &datums[usize::from(converted.file.at(row))];
            // A row is not gathered from its columns in vain.
            let shot = (!datum.is_none()).then(|| converted.row(row))?;
            let moved = datum.moved(&shot)?;
            Some((moved, measure(&shot, moved[0])))
        });
        let moved: Vec<Option<(Places, M)>> = moved.collect();
        for (row, moved) in rows.zip(moved) {
            let ([ground, spacecraft], measured) = moved.unwrap_or_else(|| {
                let ground = (
                    converted.longitude_rad.at(row),
                    converted.latitude_rad.at(row),
                );
                let spacecraft = (
                    converted.spacecraft_longitude_rad.at(row),
                    converted.spacecraft_latitude_rad.at(row),
                );
                ([ground, spacecraft], M::default())
            });
            longitude_rad.push(ground.0);
            latitude_rad.push(ground.1);
            spacecraft_longitude_rad.push(spacecraft.0);
            spacecraft_latitude_rad.push(spacecraft.1);
            record(usize::from(converted.file.at(row)), measured);
        }
    }
    converted.longitude_rad = longitude_rad;
    converted.latitude_rad = latitude_rad;
    converted.spacecraft_longitude_rad = spacecraft_longitude_rad;
    converted.spacecraft_latitude_rad = spacecraft_latitude_rad;
    converted
}

/// The conversion of the coordinates of a file into IAU 2000.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DatumTurn {
    body: Body,
    datum: Datum,
    turn_s: f64,
}

impl DatumTurn {
    /// For a file in `datum`, as [`convert_datum`] describes it.
    #[must_use]
    pub fn new(datum: Datum, clock: &MolaClock) -> Self {
        let turn_s = if clock.moves_rotation() {
            clock.correction_s()
        } else {
            0.0
        };
        Self {
            body: datum.body(),
            datum,
            turn_s,
        }
    }

    /// For a file in `datum` whose shots are turned at their time tags.
    #[must_use]
    pub fn at_tags(datum: Datum) -> Self {
        Self {
            body: datum.body(),
            datum,
            turn_s: 0.0,
        }
    }

    /// Whether coordinates stay as they are.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.datum == self.body.datum() && self.turn_s.abs() <= 0.0
    }

    /// The shot in IAU 2000.
    #[must_use]
    pub fn applied(&self, shot: Footprint) -> Footprint {
        let Some([ground, spacecraft]) = self.moved(&shot) else {
            return shot;
        };
        Footprint {
            longitude_rad: ground.0,
            latitude_rad: ground.1,
            spacecraft_longitude_rad: spacecraft.0,
            spacecraft_latitude_rad: spacecraft.1,
            ..shot
        }
    }

    /// Longitude and latitude of footprint and spacecraft in IAU 2000; `None` where they need no conversion.
    fn moved(&self, shot: &Footprint) -> Option<Places> {
        if self.is_none() {
            return None;
        }
        let out_at = Et::from_seconds(shot.et_tag_s);
        let conversion =
            DatumConversion::of(self.body, self.datum, out_at, out_at.plus(self.turn_s));
        let move_direction = |longitude_rad, latitude_rad| {
            let direction = spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0);
            let there = Spherical::from_xyz_m(&conversion.apply(&direction).xyz_m);
            (there.longitude_rad, there.latitude.0)
        };
        Some([
            move_direction(shot.longitude_rad, shot.latitude_rad),
            move_direction(shot.spacecraft_longitude_rad, shot.spacecraft_latitude_rad),
        ])
    }
}

/// Converts shots of a searched archive: rotated at their time tags, without a clock correction.
///
/// * `files` – the files that the column `file` indexes
#[must_use]
pub fn convert_at_tags(
    mut footprints: Footprints<AsRead>,
    files: &[SourceFile],
) -> Footprints<BodyFixed> {
    footprints.files = files.to_vec();
    let at_tags = MolaClock {
        bias_s: 0.0,
        sign: TagSign::Late,
        scope: BiasScope::None,
        source: String::new(),
    };
    turned(footprints, &at_tags, |_, _| (), |_, ()| ())
}

fn note(body: Body, name: &str, datum: Datum, turn_s: Option<f64>) -> String {
    let frame = &body.names().short_frame;
    match turn_s {
        None if datum == body.datum() => format!("{name}: already in {frame}, not converted"),
        None => format!("{name}: converted from {datum} to {frame} at each shot's time tag"),
        Some(turn_s) => {
            format!(
                "{name}: converted from {datum} at the time tag to {frame} at the time tag {turn_s:+.3} s"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::{
        altimetry::{BiasScope, TagSign},
        footprints::SourceFile,
    };

    fn footprints(datum: Datum) -> Footprints<AsRead> {
        let mut footprints = Footprints::new(vec![SourceFile {
            name: "ap18933k.b".to_owned(),
            version: Some('K'),
            datum,
            blake3: String::new(),
            is_table: false,
        }]);
        footprints.push(&Footprint {
            et_tag_s: -11_224_002.177_246_002,
            et_s: -11_224_002.177_246_002,
            orbit: 8933,
            file: 0,
            record: 11,
            shot: 1,
            longitude_rad: 318.0 * RADIANS_PER_DEGREE,
            latitude_rad: -13.4 * RADIANS_PER_DEGREE,
            radius_m: 3_394_000.0,
            radius_crossover_m: 3_394_000.0,
            areoid_radius_m: 3_396_000.0,
            range_m: 380_000.0,
            spacecraft_longitude_rad: 318.0 * RADIANS_PER_DEGREE,
            spacecraft_latitude_rad: -13.4 * RADIANS_PER_DEGREE,
            spacecraft_radius_m: 3_774_000.0,
            off_nadir_rad: 0.0,
            channel: 1,
            class: 1,
            attitude_flag: 0,
            orbit_quality: 3,
            windows: 1,
        });
        footprints
    }

    fn clock(scope: BiasScope) -> MolaClock {
        MolaClock {
            bias_s: 0.117,
            sign: TagSign::Late,
            scope,
            source: String::new(),
        }
    }

    #[test]
    fn eos_chasma_moves_as_cspice_says() {
        let converted =
            convert_datum(footprints(Datum::Iau1991), &clock(BiasScope::SpkLookup)).footprints;
        // CSPICE N0067 with a PCK of the 1991 and one of the 2000 constants; 1e-9 rad is 3 mm.
        assert!(
            (converted.longitude_rad.at(0) - 318.237_630_071_608_63 * RADIANS_PER_DEGREE).abs()
                < 1e-9
        );
        assert!(
            (converted.latitude_rad.at(0) + 13.400_493_296_569_078 * RADIANS_PER_DEGREE).abs()
                < 1e-9
        );
        assert!(
            (converted.spacecraft_longitude_rad.at(0) - converted.longitude_rad.at(0)).abs()
                < 1e-15
        );
    }

    #[test]
    fn iau_2000_is_left_alone_bit_for_bit() {
        let before = footprints(Datum::Iau2000);
        let after = convert_datum(before.clone(), &clock(BiasScope::SpkLookup));
        assert_eq!(after.footprints, before.declare());
        assert_eq!(
            after.notes,
            ["ap18933k.b: already in IAU 2000, not converted"]
        );
    }

    #[test]
    fn the_rotation_scope_turns_mars_by_the_bias() {
        let after = convert_datum(footprints(Datum::Iau2000), &clock(BiasScope::Both));
        let turned_rad = wrap_pi(after.footprints.longitude_rad.at(0) - 318.0 * RADIANS_PER_DEGREE);
        // 350.89198 deg/day x 0.117 s = 4.7517e-4 deg; entering at an earlier time, longitudes grow.
        assert!(
            (turned_rad / RADIANS_PER_DEGREE - 4.7517e-4).abs() < 1e-8,
            "{turned_rad}"
        );
    }
}
