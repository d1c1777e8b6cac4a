//! The steps of a calibration: tie points only; with control the angles, then the look angles, then all parameters with the
//! orbit.

use nalgebra::DMatrix;

use super::{
    demands::{belong_together, enough},
    error::CalibrateError,
    geometry::{CameraImage, Laboratory, Orbit},
    given::GivenPoints,
    ground::{off_ground, untested},
    judge::{Evidence, Known, judge},
    measure::figures,
    outcome::{self, Outcome},
    read::{OrbitPoint, PointSource, points_of},
    result::{Calibration, CalibrationStep, PointKind, TieGround},
    tables::Complaints,
    validate::{Calibrated, validate},
};
use areograph_base::error::{Locate as _, Result};
use areograph_config::{CalibrationConfig, CalibrationMode};
use areograph_geom::{
    calibration::{
        CalibrationError, CalibrationState, Freedom, GroundPoint, Layout, Parameter, Start, solve,
        tie_sight,
    },
    statistics::{Summary, median, outliers},
};
use areograph_pds::isd::SupportSource;

/// A point is left out when its residual exceeds the median of its kind by this many robust standard deviations: of a
/// million good points not one does.
const LEFT_OUT: f64 = 8.0;
/// Maximum rounds of leaving out points.
const ROUNDS: usize = 3;

/// Kinds of point in the step of tie points, and in the steps with control.
const TIES: &[PointKind] = &[PointKind::Tie];
const ALL: &[PointKind] = &[PointKind::Tie, PointKind::Control];

/// A calibration in progress.
struct Work<'a> {
    config: &'a CalibrationConfig,
    laboratory: &'a Laboratory,
    pixels: Vec<f64>,
    points: Vec<OrbitPoint>,
    steps: Vec<CalibrationStep>,
    state: CalibrationState,
    covariance: DMatrix<f64>,
    /// The test of tie points against the ground; `None` where it is not possible.
    tie_ground: Option<TieGround>,
    /// Heights of tie points that were left out above or below the ground, metres.
    off_m: Vec<f64>,
}

/// Calibrates the lines of a camera by the tables of its configuration.
pub(super) fn calibrate(config: &CalibrationConfig) -> Result<Calibration> {
    let tables = PointSource::Tables {
        ties: &config.ties.files,
        control: &config.control.files,
        held_back_every: Some(config.control.held_back_every),
    };
    let cameras = config.cameras.iter();
    let support = cameras.map(|camera| SupportSource::File(&camera.isd));
    let support: Vec<SupportSource<'_>> = support.collect();
    let is_controlled = !config.control.files.is_empty();
    calibrate_by(config, &support, &tables, is_controlled)
}

/// Calibrates the lines of a camera, given by their support data, by given points; without control by tie points only.
///
/// # Errors
/// Support data that cannot be read or do not belong together; points that do not fit them, or too few points; the same
/// faults of other orbits.
pub(super) fn calibrate_given(
    config: &CalibrationConfig,
    support: &[SupportSource<'_>],
    given: &GivenPoints,
) -> Result<Calibration> {
    let is_controlled = !(given.control.is_empty() && given.held_back.is_empty());
    calibrate_by(config, support, &PointSource::Given(given), is_controlled)
}

fn calibrate_by(
    config: &CalibrationConfig,
    support: &[SupportSource<'_>],
    source: &PointSource<'_>,
    is_controlled: bool,
) -> Result<Calibration> {
    let names = config.cameras.iter().map(|camera| camera.id.clone());
    let names: Vec<String> = names.collect();
    let images = support.iter().zip(&names);
    let images = images.map(|(of, name)| CameraImage::read(*of, name, config.body));
    let images = images.collect::<Result<Vec<_>>>()?;
    belong_together(&images, &names)?;
    let orbit = Orbit::of(images, config.body, None)?;
    let laboratory = orbit.laboratory(&names, config.solution.order as usize)?;
    let mut complaints = Complaints::default();
    let points = points_of(config, &names, &orbit, &laboratory, source, &mut complaints)?;
    enough(&points, &names, is_controlled)?;
    let state = laboratory.state.clone();
    let parameters = state.layout().len();
    let mut work = Work {
        config,
        laboratory: &laboratory,
        pixels: orbit.images.iter().map(CameraImage::pixel).collect(),
        points,
        steps: Vec::new(),
        state,
        covariance: DMatrix::zeros(parameters, parameters),
        tie_ground: None,
        off_m: Vec::new(),
    };
    work.tell("before", "nothing", 0);
    let sight =
        tie_sight(&work.of(TIES), &work.state).map_err(|why| work.failed("ties", TIES, &why))?;
    work.ties()?;
    if work.points.iter().any(|point| point.is(PointKind::Control)) {
        work.with_control(&names, &mut complaints)?;
    }
    let calibrated = Calibrated {
        names: &names,
        orbit: &orbit,
        laboratory: &laboratory,
        state: &work.state,
        covariance: &work.covariance,
    };
    let (mut validation, mut validation_noise) = (Vec::new(), Vec::new());
    for of in &config.validation {
        let (result, allowed) = validate(config, of, &calibrated, &mut complaints)
            .in_stage(&format!("calibrate/{}", of.id))?;
        validation.push(result);
        validation_noise.push(allowed);
    }
    let outcome = Outcome {
        support,
        names: &names,
        orbit: &orbit,
        laboratory: &laboratory,
        points: &work.points,
        pixels: &work.pixels,
        state: &work.state,
        covariance: &work.covariance,
    };
    let cameras = outcome.cameras()?;
    let used = outcome.scatter(PointKind::Control)?;
    let held_back = outcome.held_back()?;
    let verdict = judge(&Evidence {
        mode: config.solution.mode,
        steps: &work.steps,
        used,
        held_back: held_back.as_ref(),
        cameras: &cameras,
        sight: &sight,
        validation: &validation,
        validation_noise: &validation_noise,
        left_out: left_out(&work.points),
        untested: untested_words(&work),
        known: known(config, &orbit),
        tie_sigma_px: tie_sigma_px(&work.points),
        of_frames: (orbit.images.iter().zip(&names))
            .filter_map(|(image, name)| image.frame_remark(config.body, name))
            .collect(),
        complaints: complaints.count,
    });
    Ok(Calibration {
        drift_m_per_line: outcome::drift(
            &work.state,
            &work.covariance,
            &orbit,
            config.a_priori.orbit_bias_m,
        ),
        looks: outcome.looks(&config.a_priori)?,
        tie_sight: sight,
        tie_ground: work.tie_ground,
        points: outcome.points(),
        images: outcome.images(),
        cameras,
        used,
        held_back,
        rounds: None,
        validation,
        verdict,
        steps: work.steps,
        complaints: complaints.texts,
        complaint_count: complaints.count,
    })
}

/// Numbers of all points and of those that were left out, ties before control.
fn left_out(points: &[OrbitPoint]) -> [[usize; 2]; 2] {
    [true, false].map(|tie| {
        let of = points
            .iter()
            .filter(|point| (point.kind == PointKind::Tie) == tie);
        [
            of.clone().count(),
            of.filter(|point| point.left_out).count(),
        ]
    })
}

/// Median standard deviation of the measurements of tie points, pixels.
fn tie_sigma_px(points: &[OrbitPoint]) -> f64 {
    let ties = points.iter().filter(|point| point.kind == PointKind::Tie);
    let measured = ties.flat_map(|point| &point.measured);
    let mut sigmas_px: Vec<f64> = measured.flat_map(|measured| measured.sigma_px).collect();
    // Without ties there are no residuals either.
    if sigmas_px.is_empty() {
        return f64::INFINITY;
    }
    median(&mut sigmas_px)
}

/// Errors that no point tests, in words.
fn untested_words(work: &Work<'_>) -> Vec<String> {
    if !work.points.iter().any(|point| point.is(PointKind::Control)) {
        // A reason states that there is no control.
        return Vec::new();
    }
    let ground = work.tie_ground.is_none().then(|| untested(&work.points));
    let orbit = work.config.validation.is_empty().then(|| {
        "no other orbit ([[validation]]): an error common to all laser points, such as a different reference sphere, \
         is not tested"
            .to_owned()
    });
    ground.into_iter().chain(orbit).collect()
}

fn known(config: &CalibrationConfig, orbit: &Orbit) -> Known {
    let [lines, _] = orbit.images[0].size();
    let position_m = orbit.pose(0, 0.5 * lines).position_m;
    let height_m = (position_m.norm() - orbit.radius_m).max(1.0);
    let beforehand = &config.a_priori;
    let ground_m = (beforehand.angle_rad * height_m).hypot(beforehand.orbit_bias_m);
    Known {
        // Across and along.
        image_px: std::f64::consts::SQRT_2 * ground_m / height_m / orbit.images[0].pixel(),
        ground_m,
    }
}

impl Work<'_> {
    fn all<'a>(&'a self, kinds: &'a [PointKind]) -> impl Iterator<Item = &'a OrbitPoint> {
        let points = self.points.iter();
        points.filter(|point| kinds.iter().any(|kind| point.is(*kind)))
    }

    fn of(&self, kinds: &[PointKind]) -> Vec<GroundPoint> {
        self.all(kinds).map(|of| of.point.clone()).collect()
    }

    /// Reason why a step with these points failed, with the name of the point.
    fn failed(
        &self,
        step: &'static str,
        kinds: &[PointKind],
        why: &CalibrationError,
    ) -> CalibrateError {
        let problem = match why {
            CalibrationError::Point { point, why } => {
                let name = self.all(kinds).nth(*point).map(|of| of.name.as_str());
                format!("point {}: {why}", name.unwrap_or_default())
            }
            CalibrationError::NotConverged | CalibrationError::Singular => why.to_string(),
        };
        CalibrateError::Adjustment { step, problem }
    }

    /// Records the figures after a step.
    fn tell(&mut self, step: &str, free: &str, steps: u32) {
        self.steps.push(CalibrationStep {
            step: step.to_owned(),
            free: free.to_owned(),
            steps,
            figures: figures(&self.points, &self.state, &self.pixels),
        });
    }

    /// A priori standard deviations, with `angle_rad` for an angle.
    fn sigma(&self, angle_rad: f64) -> impl Fn(Parameter) -> f64 {
        let known = &self.config.a_priori;
        move |parameter| match parameter {
            Parameter::Angle { .. } => angle_rad,
            Parameter::Across { camera, power } | Parameter::Along { camera, power } => {
                let at_edge_px = if power < 2 {
                    known.look_px
                } else {
                    known.bend_px
                };
                at_edge_px * self.pixels[camera]
            }
            Parameter::Drift { .. } => known.orbit_drift_m_per_line,
        }
    }

    /// An adjustment of some of the parameters.
    fn adjust(
        &mut self,
        step: &'static str,
        kinds: &[PointKind],
        freedom: &Freedom,
    ) -> std::result::Result<u32, CalibrateError> {
        let start = Start {
            known: &self.laboratory.state,
            from: &self.state,
        };
        let solved =
            solve(&self.of(kinds), start, freedom).map_err(|why| self.failed(step, kinds, &why))?;
        self.state = solved.state;
        self.covariance = solved.covariance;
        Ok(solved.steps)
    }

    /// The step of tie points.
    fn ties(&mut self) -> std::result::Result<(), CalibrateError> {
        let layout = self.state.layout();
        let known = &self.config.a_priori;
        let (freedom, free) = match self.config.solution.mode {
            CalibrationMode::Differential => (
                Freedom::differential(layout, self.sigma(known.control_angle_rad)),
                "differences in roll and scale between the cameras",
            ),
            CalibrationMode::AsPublished => (
                Freedom::each(layout, self.sigma(known.angle_rad), is_angle),
                "all offset angles, with a priori standard deviations",
            ),
        };
        let steps = self.adjust("ties", TIES, &freedom)?;
        self.tell("ties", free, steps);
        Ok(())
    }

    /// Ties and control: the angles, the look angles, then all parameters; points that do not fit are left out.
    fn with_control(
        &mut self,
        names: &[String],
        complaints: &mut Complaints,
    ) -> std::result::Result<(), CalibrateError> {
        let layout = self.state.layout();
        let angle_rad = self.config.a_priori.control_angle_rad;
        let each = |work: &Self, layout: Layout, frees: fn(Parameter) -> bool| {
            Freedom::each(layout, work.sigma(angle_rad), frees)
        };
        let freedom = each(self, layout, is_angle);
        let steps = self.adjust("external", ALL, &freedom)?;
        self.tell("external", "all offset angles", steps);
        let freedom = each(self, layout, is_look);
        let steps = self.adjust("internal", ALL, &freedom)?;
        self.tell("internal", "the look angles", steps);
        let freedom = each(self, layout, |_| true);
        let mut steps = self.adjust("joint", ALL, &freedom)?;
        for _ in 0..ROUNDS {
            if !self.leave_out(complaints) {
                break;
            }
            enough(&self.points, names, true)?;
            steps = self.adjust("joint", ALL, &freedom)?;
        }
        self.tell(
            "joint",
            "offset angles, look angles and drift of the orbit together, with a priori standard deviations",
            steps,
        );
        Ok(())
    }

    /// Leaves out points with residuals far above others of their kind; returns whether there were any.
    fn leave_out(&mut self, complaints: &mut Complaints) -> bool {
        let mut any = false;
        for kind in [PointKind::Tie, PointKind::Control] {
            let missed: Vec<(usize, f64)> = (self.points.iter().enumerate())
                .filter(|(_, of)| of.is(kind))
                .map(|(index, of)| (index, missed(&of.point, &self.state)))
                .collect();
            let all: Vec<f64> = missed.iter().map(|of| of.1).collect();
            for ((index, missed), far) in missed.into_iter().zip(outliers(&all, LEFT_OUT)) {
                if far {
                    let of = &mut self.points[index];
                    of.left_out = true;
                    any = true;
                    complaints.tell(format!(
                        "{}: residual of {missed:.1} standard deviations, far above those of other points; rejected",
                        of.name
                    ));
                }
            }
        }
        self.leave_out_off_ground(complaints) || any
    }

    /// Leaves out ties whose heights contradict the ground between laser points.
    fn leave_out_off_ground(&mut self, complaints: &mut Complaints) -> bool {
        let Some(tested) = off_ground(&self.points, &self.state, &self.covariance) else {
            self.tie_ground = None;
            return false;
        };
        self.tie_ground = (tested.summary.tested > 0).then_some(tested.summary);
        for of in &tested.off {
            let point = &mut self.points[of.index];
            point.left_out = true;
            complaints.tell(format!(
                "{}: height {:+.0} m relative to the ground between laser points, {:.1} standard deviations, due to a \
                 measurement error along the flight; rejected",
                point.name,
                of.above_m,
                of.sigmas.abs()
            ));
            self.off_m.push(of.above_m.abs());
        }
        if !self.off_m.is_empty() {
            let usual_m = Summary::of(&self.off_m).median;
            for (index, shown_m) in tested.shown_m {
                self.points[index].may_be_off = shown_m > usual_m;
            }
        }
        !tested.off.is_empty()
    }
}

fn is_angle(of: Parameter) -> bool {
    matches!(of, Parameter::Angle { .. })
}

fn is_look(of: Parameter) -> bool {
    matches!(of, Parameter::Across { .. } | Parameter::Along { .. })
}

/// The largest residual of a point over its standard deviation; infinite for one without a place.
fn missed(point: &GroundPoint, state: &CalibrationState) -> f64 {
    let Ok(place_m) = point.place(state) else {
        return f64::INFINITY;
    };
    let Ok(residuals) = point.residuals(state, &place_m) else {
        return f64::INFINITY;
    };
    let seen = point.sights.iter().zip(residuals).map(|(sight, residual)| {
        let [across, along] = sight.sigma;
        (residual.x / across).abs().max((residual.y / along).abs())
    });
    let known = point.known.map_or(0.0, |known| {
        (known.whitening * (known.place_m - place_m)).amax()
    });
    seen.fold(known, f64::max)
}
