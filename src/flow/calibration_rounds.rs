//! A calibration from pixels in rounds: tie points, a consistent camera, a terrain model, laser control, and the
//! calibrated camera, with which the next round begins.
//!
//! ```text
//!  survey_lines ─► match_ties/wide ─► align_lines/wide
//!                                          │ lines
//!      ┌───────────────────────────────────┘
//!      ▼
//!  match_ties/round-n ─► align_lines/round-n ─► map_surface/round-n ─► match_laser/round-n ─► calibrate/round-n
//!      ▲                                                                                           │ lines
//!      └─────────────────────────── until convergence: n + 1 ◄─────────────────────────────────────┘
//! ```
//!
//! Every step is a stage with a part for each round: a run that was stopped begins again at the step that it did not
//! complete. A round hands its calibrated support data to the next one as an output. Ground is withheld in rectangles
//! of a lattice that does not depend on the model, so that a shot remains on one side in all rounds.
//!
//! # Source
//! Li et al. 2023, figure 1. The paper ends "until accuracy converges"; `Rounds::is_converged` defines convergence.

use std::path::PathBuf;

use super::driver::{Driver, Flow};
use crate::{
    config::CalibrationConfig,
    error::Result,
    files::HashedFile,
    stage::{InOrder, Output, Stage as _},
    stages::{
        calibrate::{
            AlignLines, CalibrateLines, Calibration, CalibrationRound, LineKeys, OtherOrbits,
            Rounds,
        },
        camera_lines::{CameraLines, LinePixels, LinesRound},
        map_surface::{MapLines, Surface},
        match_laser::{LaserKeys, MatchModel, ModelMatch, ShotKeys, Survey, SurveyLines},
        match_ties::{MatchLines, TiesOfLines},
    },
};

/// The end of the rounds.
pub(super) struct Concluded {
    /// The calibration of the last round.
    pub(super) calibration: Output<Calibration>,
    /// Its measurements; `None` where further rounds may follow that are not known before outputs are.
    pub(super) model: Option<LastRound>,
}

/// The measurements of the last round.
pub(super) struct LastRound {
    /// The terrain model.
    pub(super) surface: Output<Surface>,
    /// The matches of the laser with the models of the first and of the last round.
    pub(super) control: [Output<ModelMatch>; 2],
    /// The tie points.
    pub(super) ties: Output<TiesOfLines>,
}

/// The result of the last round.
pub(super) fn rounds<D: Driver>(flow: &mut D, config: &CalibrationConfig) -> Flow<Concluded> {
    let lines = Lines::surveyed(flow, config)?;
    let mut rounds = Rounds {
        rounds: Vec::new(),
        rounds_max: config.laser.rounds_max,
        cell_m: config.laser.cell_m.unwrap_or_default(),
        laser_sigma_m: config.control.sigma_horizontal_m,
    };
    let (_, mut before) = lines.aligned(flow, LinesRound::Wide, None)?;
    let mut first: Option<Output<ModelMatch>> = None;
    let mut units: Option<(u32, Output<ModelMatch>)> = None;
    for number in 1.. {
        let earlier = units.as_ref().map(|(_, control)| control);
        let round = lines.round(flow, number, &before, earlier)?;
        if round.is_pending() {
            before = round.calibrated;
            break;
        }
        let (units_of, _) = units.get_or_insert_with(|| (number, round.control.clone()));
        rounds.rounds.push(round.figures(number, *units_of)?);
        if rounds.selects_again() {
            units = None;
        }
        let is_last = rounds.is_converged() || number >= rounds.rounds_max;
        let first = first.get_or_insert_with(|| round.control.clone());
        if is_last {
            return Ok(Concluded {
                calibration: round.concluded(rounds)?,
                model: Some(LastRound {
                    control: [first.clone(), round.control],
                    surface: round.surface,
                    ties: round.ties,
                }),
            });
        }
        before = round.calibrated;
    }
    Ok(Concluded {
        calibration: before,
        model: None,
    })
}

/// The lines of the camera and their files.
struct Lines<'a> {
    config: &'a CalibrationConfig,
    isd: Vec<HashedFile>,
    pedr: Vec<HashedFile>,
    other_orbits: Vec<HashedFile>,
    pixels: LinePixels,
    survey: Output<Survey>,
}

/// The outputs of a round.
struct Round {
    ties: Output<TiesOfLines>,
    aligned: Output<Calibration>,
    surface: Output<Surface>,
    control: Output<ModelMatch>,
    calibrated: Output<Calibration>,
}

impl<'a> Lines<'a> {
    fn surveyed<D: Driver>(flow: &mut D, config: &'a CalibrationConfig) -> Flow<Self> {
        let cameras = config.cameras.iter();
        let isd: Vec<_> = cameras.clone().map(|camera| camera.isd.clone()).collect();
        let pixels: Vec<_> = cameras.filter_map(|camera| camera.pixels.clone()).collect();
        let other_orbits = OtherOrbits::paths(&config.validation);
        let mut hashed = |paths: &[PathBuf]| flow.hash(SurveyLines::NAME, paths);
        let (isd, pedr) = (hashed(&isd)?, hashed(&config.laser.files)?);
        let (pixels, other_orbits) = (hashed(&pixels)?, hashed(&other_orbits)?);
        let survey = flow.stage(&SurveyLines {
            lines: CameraLines {
                body: config.body,
                lines: &config.cameras,
                given: &isd,
                calibrated: None,
            },
            a_priori: &config.a_priori,
            shots: ShotKeys(&config.laser),
            pedr: InOrder(&pedr),
        })?;
        Ok(Self {
            config,
            isd,
            pedr,
            other_orbits,
            pixels: LinePixels::of(pixels),
            survey,
        })
    }

    /// The lines as given, or as a calibration gives them.
    fn of<'l>(&'l self, calibrated: Option<&'l Output<Calibration>>) -> CameraLines<'l> {
        CameraLines {
            body: self.config.body,
            lines: &self.config.cameras,
            given: &self.isd,
            calibrated,
        }
    }

    /// Tie points of the lines, and the lines that agree at them.
    fn aligned<D: Driver>(
        &self,
        flow: &mut D,
        round: LinesRound,
        before: Option<&Output<Calibration>>,
    ) -> Flow<(Output<TiesOfLines>, Output<Calibration>)> {
        let lines = self.of(before);
        let ties = flow.stage(&MatchLines {
            round,
            lines,
            pixels: &self.pixels,
            survey: &self.survey,
        })?;
        let aligned = flow.stage(&AlignLines {
            round,
            calibration: LineKeys(self.config),
            lines,
            ties: &ties,
        })?;
        Ok((ties, aligned))
    }

    fn round<D: Driver>(
        &self,
        flow: &mut D,
        number: u32,
        before: &Output<Calibration>,
        earlier: Option<&Output<ModelMatch>>,
    ) -> Flow<Round> {
        let (config, survey) = (self.config, &self.survey);
        let round = LinesRound::Number(number);
        let (ties, aligned) = self.aligned(flow, round, Some(before))?;
        let lines = self.of(Some(&aligned));
        let surface = flow.stage(&MapLines {
            round,
            lines,
            pixels: &self.pixels,
            survey,
            cell_m: &config.laser.cell_m.unwrap_or_default(),
        })?;
        let control = flow.stage(&MatchModel {
            round,
            lines,
            survey,
            surface: &surface,
            laser: LaserKeys(&config.laser),
            held_back_every: &config.control.held_back_every,
            pedr: InOrder(&self.pedr),
            earlier,
        })?;
        let calibrated = flow.stage(&CalibrateLines {
            round,
            calibration: LineKeys(config),
            lines: self.of(None),
            ties: &ties,
            control: &control,
            validation: OtherOrbits {
                orbits: &config.validation,
                files: &self.other_orbits,
            },
        })?;
        Ok(Round {
            ties,
            aligned,
            surface,
            control,
            calibrated,
        })
    }
}

impl Round {
    /// Whether a run would make one of the outputs.
    fn is_pending(&self) -> bool {
        let outputs = [
            self.ties.provenance(),
            self.aligned.provenance(),
            self.surface.provenance(),
            self.control.provenance(),
            self.calibrated.provenance(),
        ];
        outputs.iter().any(Option::is_none)
    }

    fn figures(&self, number: u32, units_of: u32) -> Result<CalibrationRound> {
        Ok(CalibrationRound::of(
            number,
            units_of,
            self.aligned.value()?,
            self.surface.value()?.account.filled_share(),
            &self.control.value()?.found,
            self.calibrated.value()?,
        ))
    }

    /// The calibration of the last round, with all rounds and the verdict on them.
    fn concluded(&self, rounds: Rounds) -> Result<Output<Calibration>> {
        let (control, ties) = (self.control.value()?, self.ties.value()?);
        let last = self.calibrated.value()?.clone();
        let concluded = last.in_rounds(rounds, &control.found.verdict, &ties.pairs);
        let label = self.calibrated.label().to_owned();
        let Some(provenance) = self.calibrated.provenance().cloned() else {
            return Ok(Output::pending(label));
        };
        Ok(Output::known(label, concluded, provenance))
    }
}
