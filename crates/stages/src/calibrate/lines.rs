//! Calibration in the rounds of pixels: by tie points only, then with laser control.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use super::{Calibrate, Calibration, given::GivenPoints, result::PointKind, run::calibrate_given};
use crate::{
    camera_lines::{CameraLines, LinesRound},
    match_laser::{MatchedPoint, ModelMatch},
    match_ties::TiesOfLines,
};
use areograph_base::error::Result;
use areograph_config::{CalibrationConfig, ValidationConfig};
use areograph_geom::ellipsoid::spherical_to_xyz_m;
use areograph_store::{
    files::HashedFile,
    stage::{Called, InOrder, Input, Inputs, Output, Stage, called},
    stage_inputs,
};
use nalgebra::Vector3;

/// Tie points that provide the height of the ground.
const PLACES: usize = 400;

/// The keys by which points are weighted and a calibration is solved.
#[derive(Debug, Clone, Copy)]
pub struct LineKeys<'a>(pub &'a CalibrationConfig);

impl Input for LineKeys<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        inputs.setting("ties", &self.0.ties);
        inputs.setting("control", &self.0.control);
        inputs.setting("a_priori", &self.0.a_priori);
        inputs.setting("solution", &self.0.solution);
    }
}

/// Other orbits, with their files in order.
#[derive(Debug, Clone, Copy)]
pub struct OtherOrbits<'a> {
    /// The orbits.
    pub orbits: &'a [ValidationConfig],
    /// Their files.
    pub files: &'a [HashedFile],
}

impl OtherOrbits<'_> {
    /// Every file that these orbits name, in order.
    #[must_use]
    pub fn paths(orbits: &[ValidationConfig]) -> Vec<PathBuf> {
        let kinds = orbits.iter().flat_map(files_of);
        kinds.flatten().cloned().collect()
    }
}

impl Input for OtherOrbits<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        inputs.setting(field, self.orbits);
        // Number of files of each key: hashes do not identify the key.
        let counts = self.orbits.iter().flat_map(files_of).map(Vec::len);
        inputs.setting("files", &counts.collect::<Vec<usize>>());
        InOrder(self.files).add_to("file", inputs);
    }
}

fn files_of(orbit: &ValidationConfig) -> [&Vec<PathBuf>; 3] {
    [&orbit.isd, &orbit.ties, &orbit.control]
}

stage_inputs! {
    /// The present lines, and tie points between them.
    pub struct AlignLines<'a> {
        /// The round.
        pub round: LinesRound,
        /// The configuration.
        pub calibration: LineKeys<'a>,
        /// The lines with which the tie points were matched.
        pub lines: CameraLines<'a>,
        /// The tie points.
        pub ties: &'a Output<TiesOfLines>,
    }
}

impl Stage for AlignLines<'_> {
    const NAME: &'static str = "align_lines";
    const METHOD: u32 = 5;
    const CALLS: &'static [Called] = &[called::<Calibrate<'_>>()];
    type Output = Calibration;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, _stop: &AtomicBool) -> Result<Calibration> {
        let config = CalibrationConfig {
            validation: Vec::new(),
            ..self.calibration.0.clone()
        };
        let given = GivenPoints {
            ties: self.ties.value()?.points.clone(),
            ..GivenPoints::default()
        };
        calibrate_given(&config, &self.lines.support()?, &given)
    }
}

stage_inputs! {
    /// The given lines, tie points and laser control. Every calibration by control begins at the given support data, so
    /// that no error accumulates.
    pub struct CalibrateLines<'a> {
        /// The round.
        pub round: LinesRound,
        /// The configuration.
        pub calibration: LineKeys<'a>,
        /// The lines by their given support data.
        pub lines: CameraLines<'a>,
        /// Tie points.
        pub ties: &'a Output<TiesOfLines>,
        /// Laser control.
        pub control: &'a Output<ModelMatch>,
        /// Other orbits.
        pub validation: OtherOrbits<'a>,
    }
}

impl Stage for CalibrateLines<'_> {
    const NAME: &'static str = "calibrate";
    const METHOD: u32 = 4;
    const CALLS: &'static [Called] = &[called::<Calibrate<'_>>()];
    type Output = Calibration;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, _stop: &AtomicBool) -> Result<Calibration> {
        let points = self.control.value()?.found.points.iter().cloned();
        let (held_back, control): (Vec<MatchedPoint>, Vec<MatchedPoint>) =
            points.partition(|point| point.judges);
        let given = GivenPoints {
            ties: self.ties.value()?.points.clone(),
            control,
            held_back,
        };
        calibrate_given(self.calibration.0, &self.lines.support()?, &given)
    }
}

impl Calibration {
    /// Tie points as the calibrated lines see them, of many evenly selected ones; body-fixed, metres.
    #[must_use]
    pub fn ground_m(&self) -> Vec<Vector3<f64>> {
        let places = self.points.iter();
        let places = places.filter(|point| point.kind == PointKind::Tie && !point.left_out);
        let places: Vec<[f64; 3]> = places.filter_map(|point| point.place).collect();
        let every = places.len().div_ceil(PLACES).max(1);
        let places = places.iter().step_by(every);
        places
            .map(|[longitude_rad, latitude_rad, radius_m]| {
                spherical_to_xyz_m(*longitude_rad, *latitude_rad, *radius_m)
            })
            .collect()
    }
}
