//! A calibration from pixels in rounds: tie points, a consistent camera, a terrain model, laser control, and the
//! calibrated camera, with which the next round begins.
//!
//! A round calls plain functions of four stages: `match_ties::match_lines`, `calibrate` by ties only,
//! `map_surface::map_lines`, `match_laser::match_model`, and `calibrate` by ties and control. It hands calibrated
//! support data to the next round, as a user would. Every calibration by control begins at the given support data, so
//! that no error accumulates. Ground is withheld in rectangles of a lattice that does not depend on the model, so that a
//! shot remains on one side in all rounds.
//!
//! # Source
//! Li et al. 2023, figure 1. The paper ends "until accuracy converges"; `Rounds::is_converged` defines convergence.

mod refused;

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use nalgebra::Vector3;

use self::refused::{FewUnits, pixels_of};
use crate::{
    config::CalibrationConfig,
    error::{IoError, Locate as _, Result},
    geom::ellipsoid::spherical_to_xyz_m,
    pds::pixel_file::Pyramid,
    stage::{Called, Input, Inputs, Stage, called},
    stages::{
        calibrate::{
            Calibrate, Calibration, CalibrationFiles, CalibrationKeys, CalibrationRound,
            GivenPoints, PointKind, Rounds, calibrate_given,
        },
        convert_datum::ConvertDatum,
        line_camera::LineCamera,
        map_surface::{LinesToMap, MapSurface, Surface, map_lines},
        match_laser::{
            HeldBackGround, LaserMatch, MatchLaser, MatchOptions, MatchedPoint, ModelRequest,
            UnitShots, match_model, shots_within,
        },
        match_ties::{LinesToMatch, MatchTies, TiesOfLines, match_lines},
    },
    store::atomic,
    units::wrap_pi,
};

/// Shots that provide heights of the ground before a terrain model exists: kilometres apart, as relief requires.
const SHOTS: usize = 256;
/// Search range, standard deviations.
const SIGMAS: f64 = 3.0;
/// Search range once the lines agree, pixels: errors of heights between tie points exceed errors of the cameras.
const LATER_PX: f64 = 20.0;
/// Tie points that provide the height of the ground, and the common error of their heights, pixels.
const PLACES: usize = 400;
const OFF_PX: f64 = 3.0;

/// A calibration from pixels.
pub(super) struct CalibrationLoop<'a> {
    pub(super) calibration: CalibrationKeys<'a>,
    pub(super) files: CalibrationFiles<'a>,
}

impl Stage for CalibrationLoop<'_> {
    const NAME: &'static str = "calibration_loop";
    const METHOD: u32 = 5;
    const CALLS: &'static [Called] = &[
        called::<MatchTies<'_>>(),
        called::<MapSurface<'_>>(),
        called::<MatchLaser<'_>>(),
        called::<Calibrate<'_>>(),
        // Called by the matching with the laser.
        called::<ConvertDatum<'_>>(),
    ];
    type Output = Calibration;

    fn inputs(&self) -> Inputs {
        let mut inputs = Inputs::new(Self::METHOD);
        inputs.calls(Self::CALLS);
        self.calibration.add_to("calibration", &mut inputs);
        self.files.add_to("files", &mut inputs);
        inputs
    }

    fn run(&self, stop: &AtomicBool) -> Result<Calibration> {
        let config = self.calibration.0;
        let work = tempfile::tempdir().map_err(IoError::on("make a temporary folder"))?;
        let mut lines = Lines::open(config, work.path())?;
        let mut rounds = Rounds {
            rounds: Vec::new(),
            rounds_max: config.laser.rounds_max,
            cell_m: config.laser.cell_m.unwrap_or_default(),
        };
        let mut round = 1;
        loop {
            let in_stage = |stage: &str| format!("round {round}/{stage}");
            let done = lines.round(round, &in_stage, stop)?;
            rounds.rounds.push(done.told);
            tracing::info!(stage = Self::NAME, round, "done");
            if rounds.is_converged() || round >= rounds.rounds_max {
                let (laser, pairs) = (&done.control.verdict, &done.ties.pairs);
                return Ok(done.calibration.in_rounds(rounds, laser, pairs));
            }
            lines.take(&done.calibration)?;
            round += 1;
        }
    }
}

/// Result of a round.
struct Round {
    ties: TiesOfLines,
    control: LaserMatch,
    calibration: Calibration,
    told: CalibrationRound,
}

/// The lines of the camera after the last round.
struct Lines<'a> {
    config: &'a CalibrationConfig,
    pixels: Vec<Pyramid>,
    /// Their support data, and the path to which the support data of a round are written.
    isd: Vec<PathBuf>,
    folder: &'a Path,
    /// Ground points seen by the lines, before laser control exists; body-fixed, metres.
    ground_m: Vec<Vector3<f64>>,
    /// The two lines with the largest convergence.
    pair: [usize; 2],
    /// Shots that form units, from the first round, so that rounds can be compared.
    units: Option<UnitShots>,
}

impl<'a> Lines<'a> {
    fn open(config: &'a CalibrationConfig, folder: &'a Path) -> Result<Self> {
        let isd: Vec<PathBuf> = config.cameras.iter().map(|of| of.isd.clone()).collect();
        let cameras = cameras(config, &isd)?;
        let pixels = config.cameras.iter().zip(&cameras);
        let pixels = pixels.map(|(camera, line)| pixels_of(camera, line));
        Ok(Self {
            pixels: pixels.collect::<Result<_>>()?,
            pair: widest(&cameras),
            ground_m: Vec::new(),
            units: None,
            config,
            isd,
            folder,
        })
    }

    /// Ties, a consistent camera, a terrain model, laser control, a calibration.
    fn round(
        &mut self,
        round: u32,
        stage: &dyn Fn(&str) -> String,
        stop: &AtomicBool,
    ) -> Result<Round> {
        let config = self.config;
        if round == 1 {
            // Such a wide search finds few points, but they suffice for a narrow one.
            let given = cameras(config, &self.isd)?;
            let reach_m = self.first_reach_m(&given);
            self.ground_m = self.shots(&given, stop).in_stage(&stage("match_laser"))?;
            let ties = self.ties(&given, reach_m, stop);
            let tied = self.tied(&ties.in_stage(&stage("match_ties"))?);
            self.take(&tied.in_stage(&stage("calibrate"))?)?;
        }
        let before = cameras(config, &self.isd)?;
        let reach_m = LATER_PX * before[self.pair[0]].pixel_m(config.body.map().radius_m);
        let ties = self.ties(&before, reach_m, stop);
        let ties = ties.in_stage(&stage("match_ties"))?;
        let tied = self.tied(&ties).in_stage(&stage("calibrate"))?;
        self.take(&tied)?;
        let consistent = cameras(config, &self.isd)?;
        let surface = self
            .surface(&consistent, stop)
            .in_stage(&stage("map_surface"))?;
        let control = self
            .control(&consistent, &surface, stop)
            .in_stage(&stage("match_laser"))?;
        if let Some(few) = FewUnits::of(&control) {
            return Err(few).in_stage(&stage("match_laser"));
        }
        let (held_back, used): (Vec<MatchedPoint>, Vec<MatchedPoint>) = control
            .points
            .iter()
            .cloned()
            .partition(|point| point.judges);
        let given = GivenPoints {
            control: used,
            held_back,
            ties: ties.points.clone(),
        };
        let calibration = calibrate_given(config, &given).in_stage(&stage("calibrate"))?;
        let account = &surface.account;
        let filled = f64::from(account.filled) / f64::from(account.cells.max(1));
        Ok(Round {
            told: CalibrationRound::of(round, &tied, filled, &control, &calibration),
            ties,
            control,
            calibration,
        })
    }

    /// Tie points, matched with these cameras.
    fn ties(&self, lines: &[LineCamera], reach_m: f64, stop: &AtomicBool) -> Result<TiesOfLines> {
        let lines = LinesToMatch {
            body: self.config.body,
            cameras: lines,
            pixels: &self.pixels,
            ground_m: &self.ground_m,
            reach_m,
        };
        match_lines(&lines, stop)
    }

    /// A calibration of the present cameras by ties only.
    fn tied(&self, ties: &TiesOfLines) -> Result<Calibration> {
        let mut config = self.config.clone();
        for (camera, isd) in config.cameras.iter_mut().zip(&self.isd) {
            camera.isd.clone_from(isd);
        }
        config.validation.clear();
        let given = GivenPoints {
            ties: ties.points.clone(),
            ..GivenPoints::default()
        };
        calibrate_given(&config, &given)
    }

    /// Continues with the cameras of a calibration, and with the ground as they see it.
    fn take(&mut self, calibration: &Calibration) -> Result<()> {
        let places = calibration.points.iter();
        let places = places.filter(|point| point.kind == PointKind::Tie && !point.left_out);
        let places: Vec<[f64; 3]> = places.filter_map(|point| point.place).collect();
        let every = places.len().div_ceil(PLACES).max(1);
        self.ground_m = (places.iter().step_by(every))
            .map(|[longitude_rad, latitude_rad, radius_m]| {
                spherical_to_xyz_m(*longitude_rad, *latitude_rad, *radius_m)
            })
            .collect();
        for (at, camera) in calibration.cameras.iter().enumerate() {
            let path = self.folder.join(format!("{}.json", camera.camera));
            atomic::write(&path, camera.isd.as_bytes())?;
            self.isd[at] = path;
        }
        Ok(())
    }

    /// Shots over the ground that the lines see.
    fn shots(&self, lines: &[LineCamera], stop: &AtomicBool) -> Result<Vec<Vector3<f64>>> {
        let radius_m = self.config.body.map().radius_m;
        let mut edges = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        let mut middle_rad = None;
        for [longitude_rad, north] in lines.iter().flat_map(|line| line.corners_rad(radius_m)) {
            let middle = *middle_rad.get_or_insert(longitude_rad);
            let east = middle + wrap_pi(longitude_rad - middle);
            edges = [
                edges[0].min(east),
                edges[1].min(north),
                edges[2].max(east),
                edges[3].max(north),
            ];
        }
        shots_within(
            edges,
            &self.config.laser.files,
            self.config.laser.crossover,
            &self.config.laser.filter,
            SHOTS,
            stop,
        )
    }

    /// A priori uncertainty of the position at which a line sees a ground point, metres on the ground.
    fn first_reach_m(&self, lines: &[LineCamera]) -> f64 {
        let (line, radius_m) = (&lines[self.pair[0]], self.config.body.map().radius_m);
        let known = &self.config.a_priori;
        // Errors that lines share act through the height: the convergence turns a height error into a horizontal one.
        let apart = convergence_rad(lines, self.pair).tan();
        let pointing_m = std::f64::consts::SQRT_2 * known.angle_rad * line.height_m(radius_m);
        SIGMAS * pointing_m.hypot(apart * known.orbit_bias_m)
    }

    /// The terrain model of the pair with the largest convergence, about the ground points of the ties.
    fn surface(&self, lines: &[LineCamera], stop: &AtomicBool) -> Result<Surface> {
        let [one, other] = self.pair;
        map_lines(
            &LinesToMap {
                body: self.config.body,
                pair: [one, other].map(|at| (&lines[at], &self.pixels[at])),
                ground_m: &self.ground_m,
                off_m: OFF_PX * lines[one].pixel_m(self.config.body.map().radius_m),
                cell_m: self.config.laser.cell_m.unwrap_or_default(),
            },
            stop,
        )
    }

    /// Laser control that is found in a terrain model.
    fn control(
        &mut self,
        lines: &[LineCamera],
        surface: &Surface,
        stop: &AtomicBool,
    ) -> Result<LaserMatch> {
        let laser = &self.config.laser;
        let options = MatchOptions {
            segment_points: laser.segment_points as usize,
            least_variance_m2: laser.least_variance_m2,
            similarity: None,
            search_cells: laser.search_cells,
            least_score: laser.least_score,
            least_contrast: 1.0,
            limit_m: laser.limit_m,
            seed: u64::from(laser.seed),
            ground: laser.crossover,
            filter: laser.filter.clone(),
        };
        let request = ModelRequest {
            model: &surface.model.heights,
            pedr: &laser.files,
            images: lines,
            options: &options,
            held_back: HeldBackGround {
                every: self.config.control.held_back_every,
                seed: u64::from(laser.seed),
            },
        };
        let (mut control, units) = match_model(&request, self.units.as_ref(), stop)?;
        self.units.get_or_insert(units);
        // Measurements of the other lines are removed: these lines are not part of the model.
        for point in &mut control.points {
            for (camera, seen) in point.in_images.iter_mut().enumerate() {
                *seen = seen.filter(|_| self.pair.contains(&camera));
            }
        }
        Ok(control)
    }
}

fn cameras(config: &CalibrationConfig, isd: &[PathBuf]) -> Result<Vec<LineCamera>> {
    let cameras = config.cameras.iter().zip(isd);
    cameras
        .map(|(camera, isd)| LineCamera::read(isd, &camera.id, config.body))
        .collect()
}

/// Angle between the viewing directions of two lines in the middle of the image.
fn convergence_rad(lines: &[LineCamera], pair: [usize; 2]) -> f64 {
    let [one, other] = pair.map(|at| lines[at].looks());
    one.angle(&other)
}

/// The two lines with the largest convergence.
fn widest(lines: &[LineCamera]) -> [usize; 2] {
    let all =
        (0..lines.len()).flat_map(|one| (one + 1..lines.len()).map(move |other| [one, other]));
    let widest = all.max_by(|a, b| {
        let [a, b] = [a, b].map(|pair| convergence_rad(lines, *pair));
        a.total_cmp(&b)
    });
    widest.unwrap_or([0, 1])
}
