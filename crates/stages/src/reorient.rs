//! An orientation after a correction: samples, camera tables and line times corrected together.
//!
//! From these and the original kernels, `stages/tabulate_kernels` computes the states and attitudes of an SPK and a CK
//! per image. Loaded last, they give the same orientation through the same pipeline, and a second pair gives it to ISIS and
//! ALE; the flow reads them back before they get their final names.

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Vector3};

use super::{
    adjust::Adjusted,
    orientation::{
        Camera, CameraTables, GroundPoint, InterpolationCheck, Nodes, Orientation,
        OrientationSample,
    },
    tag_times::ImageTimes,
};
use areograph_base::{
    error::{Cause, Result},
    frames::{Position, Rotation},
    time::{Et, Interval},
};
use areograph_geom::{
    attitude::matrix_of_rotation_vector,
    body_rotation::body_rotation,
    lagrange::lagrange,
    pushbroom::{ExteriorOrientation, Pose, SampledOrientation, SamplesError},
};
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

/// Nodes by which a table may be exceeded: the rounding of epochs.
const NODE_TOLERANCE: f64 = 1e-6;

/// The correction that an adjustment adds to the orientation of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineCorrection {
    /// Added to the perspective centre, IAU 2000, metres.
    pub position_m: Vector3<f64>,
    /// Rotation vector `θ` in camera components, radians: `M = exp([θ]×) M₀` with `M` from Mars to the camera.
    pub rotation_rad: Vector3<f64>,
}

/// An orientation that cannot be corrected.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Bug: "report this with the site's configuration and the log")]
enum ReorientError {
    #[error(
        "image {image}: a shift by {shift_lines:.3} lines requires the orientation over {required}; expected times \
         within the camera tables, {known}"
    )]
    #[cause(Input: "check the image's start time, or give its time bias a smaller standard deviation")]
    Shift {
        image: String,
        shift_lines: f64,
        required: Interval,
        known: Interval,
    },
    #[error(
        "image {image}: correction {value} at line {line_offset:.1} from the middle; expected a finite number"
    )]
    NotFinite {
        image: String,
        line_offset: f64,
        value: f64,
    },
    #[error("image {image}: camera tables with {nodes} nodes; expected at least 2")]
    NoTables { image: String, nodes: usize },
    #[error("image {image}: {source}")]
    Samples { image: String, source: SamplesError },
}

stage_inputs! {
    /// The orientation of one image, and the adjustment that corrects it.
    pub struct Reorient<'a> {
        /// The round of the adjustment.
        pub round: Round,
        /// Identifier of the image.
        pub image: &'a str,
        /// Its index among the images of the adjustment.
        pub index: &'a usize,
        /// Its line times.
        pub times: &'a Output<ImageTimes>,
        /// Its orientation from the kernels.
        pub orientation: &'a Output<Orientation>,
        /// The adjustment.
        pub adjusted: &'a Output<Adjusted>,
    }
}

impl Stage for Reorient<'_> {
    const NAME: &'static str = "reorient";
    const METHOD: u32 = 5;
    type Output = Orientation;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.of_adjustment().part_of(self.image)
    }

    fn run(&self, _stop: &AtomicBool) -> Result<Orientation> {
        let correction = self.adjusted.value()?.correction(*self.index);
        let (orientation, times) = (self.orientation.value()?, self.times.value()?);
        reorient(orientation, times, correction.time_shift_lines, |x| {
            LineCorrection {
                position_m: correction.shift_m(x),
                rotation_rad: correction.turn_rad(x),
            }
        })
    }
}

/// The orientation of `image` after a correction.
///
/// * `orientation` – as sampled from the kernels
/// * `time_shift_lines` – `s`, the number of lines by which a line was exposed later than its tag
/// * `correction` – the correction at a line offset `x`, lines from the middle of the header image
///
/// The line with the tag `x` gets the camera of `x + s`: `C(x) = C₀(x + s) + Δ(x)` and `M(x) = exp([θ(x)]×) M₀(x + s)`,
/// all relative to Mars, as [`CorrectedOrientation`](areograph_geom::pushbroom::CorrectedOrientation) has it. Samples
/// keep their epochs. Tables keep their nodes, except those that the shift moves beyond the known span. Positions are
/// corrected in the same way in every convention for light time: light time and aberration remain the values for the
/// kernels' positions, which a correction of 100 m would change by 1 mm for `surface` and 1 cm for `centre`.
///
/// # Errors
/// [`Kind::Input`](areograph_base::error::Kind::Input) for a shift beyond the camera tables; [`Kind::Bug`](areograph_base::error::Kind::Bug) for a correction that is not finite.
/// # Accuracy
/// Without a shift, the samples agree with the kernels to rounding. With one they are read from the
/// tables; [`CameraTables::interpolation`] then bounds the error of both steps together.
/// # Source
/// Shan et al. 2005 for the orientation; the time shift is not from a publication, see `geom::bundle`.
pub fn reorient(
    orientation: &Orientation,
    image: &ImageTimes,
    time_shift_lines: f64,
    correction: impl Fn(f64) -> LineCorrection,
) -> Result<Orientation> {
    let tables = &orientation.tables;
    let corrected = Corrected {
        image,
        nodes: nodes(orientation)?,
        residual: residual(orientation)?,
        shift_lines: time_shift_lines,
        correction,
    };
    corrected.require_known(tables)?;
    let epochs: Vec<Et> = orientation.samples.iter().map(|s| s.et).collect();
    let camera = |et| corrected.camera(et);
    let mut samples = OrientationSample::at_epochs(image, &epochs, camera)?;
    for (sample, before) in samples.iter_mut().zip(&orientation.samples) {
        sample.to_spacecraft_m = before.to_spacecraft_m;
    }
    Ok(Orientation {
        body: image.body,
        image: orientation.image.clone(),
        samples,
        outline: GroundPoint::outline(image, camera)?,
        tables: corrected.tables(tables)?,
        light_time: orientation.light_time.clone(),
        centre: None,
        notes: orientation.notes.clone(),
        invalid_because: orientation.invalid_because.clone(),
    })
}

fn nodes(orientation: &Orientation) -> Result<Nodes> {
    let nodes = orientation.tables.et_s.len();
    if nodes < 2 {
        let image = orientation.image.clone();
        return Err(ReorientError::NoTables { image, nodes }.into());
    }
    Ok(Nodes::new(&orientation.tables))
}

/// Samples relative to the interpolated tables, over ET: the interpolation error.
fn residual(orientation: &Orientation) -> Result<SampledOrientation> {
    let nodes = nodes(orientation)?;
    let relative = |sample: &OrientationSample| {
        let camera = nodes.camera(sample.et);
        let Pose {
            position_m,
            mars_to_camera,
        } = sample.pose();
        let pose = Pose {
            position_m: position_m - camera.position.xyz_m,
            mars_to_camera: mars_to_camera * camera.to_mars.matrix(),
        };
        (sample.et.seconds(), pose)
    };
    let samples: Vec<(f64, Pose)> = orientation.samples.iter().map(relative).collect();
    let image = orientation.image.clone();
    SampledOrientation::new(&samples)
        .map_err(|source| ReorientError::Samples { image, source }.into())
}

/// The camera after the correction, by the tags of its lines.
struct Corrected<'a, F> {
    image: &'a ImageTimes,
    nodes: Nodes,
    residual: SampledOrientation,
    shift_lines: f64,
    correction: F,
}

impl<F: Fn(f64) -> LineCorrection> Corrected<'_, F> {
    fn shift_s(&self) -> f64 {
        self.shift_lines * self.image.line_times.mean_period_s()
    }

    /// Checks that the tables cover the shifted image.
    fn require_known(&self, tables: &CameraTables) -> Result<()> {
        let ends = [tables.et_s[0], tables.et_s[tables.et_s.len() - 1]].map(Et::from_seconds);
        let known = Interval::new(ends[0], ends[1]);
        let required = self.image.exposures().shifted(self.shift_s());
        let rounding_s = NODE_TOLERANCE * known.duration_s() / tables.et_s.len() as f64;
        let held = known.padded(rounding_s);
        // Written so that NaN is refused too.
        if held.contains(required.start) && held.contains(required.stop) {
            return Ok(());
        }
        Err(ReorientError::Shift {
            image: self.image.id.clone(),
            shift_lines: self.shift_lines,
            required,
            known,
        }
        .into())
    }

    fn correction(&self, line_offset: f64) -> Result<LineCorrection> {
        let correction = (self.correction)(line_offset);
        let values = correction.position_m.iter();
        let mut values = values.chain(correction.rotation_rad.iter());
        match values.find(|value| !value.is_finite()) {
            None => Ok(correction),
            Some(value) => Err(ReorientError::NotFinite {
                image: self.image.id.clone(),
                line_offset,
                value: *value,
            }
            .into()),
        }
    }

    /// Start of the rays in IAU 2000 and the rotation from the camera to this frame, for the line with the tag `tag`.
    fn camera(&self, tag: Et) -> Result<Camera> {
        let et = tag.plus(self.shift_s());
        let camera = self.nodes.camera(et);
        let missed = self.residual.pose(et.seconds());
        let to_mars = camera.to_mars.matrix() * missed.mars_to_camera.transpose();
        self.corrected(tag, camera.position.xyz_m + missed.position_m, to_mars)
    }

    /// The camera by the tables.
    fn tabulated(&self, tag: Et) -> Result<Camera> {
        let camera = self.nodes.camera(tag.plus(self.shift_s()));
        self.corrected(tag, camera.position.xyz_m, *camera.to_mars.matrix())
    }

    /// A position and a rotation to Mars with the correction at the line with the tag `tag`.
    fn corrected(
        &self,
        tag: Et,
        position_m: Vector3<f64>,
        to_mars: Matrix3<f64>,
    ) -> Result<Camera> {
        let correction = self.correction(self.image.line_offset(tag))?;
        let turned = matrix_of_rotation_vector(&correction.rotation_rad);
        Ok(Camera {
            position: Position::new(position_m + correction.position_m),
            to_mars: Rotation::new(to_mars * turned.transpose(), tag),
        })
    }

    fn tables(&self, original: &CameraTables) -> Result<CameraTables> {
        let last = original.et_s.len() - 1;
        let start_s = original.et_s[0];
        let step_s = (original.et_s[last] - start_s) / last as f64;
        let place = |et_s: f64| (et_s - start_s) / step_s;
        let known = -NODE_TOLERANCE..=last as f64 + NODE_TOLERANCE;
        let rows: Vec<usize> = (0..=last)
            .filter(|row| known.contains(&place(original.et_s[*row] + self.shift_s())))
            .collect();
        let mut tables = CameraTables {
            et_s: rows.iter().map(|row| original.et_s[*row]).collect(),
            position_m: Vec::new(),
            velocity_m_s: Vec::new(),
            inertial_to_bus: Vec::new(),
            bus_angular_velocity_rad_s: Vec::new(),
            inertial_to_mars: rows
                .iter()
                .map(|row| original.inertial_to_mars[*row])
                .collect(),
            mars_angular_velocity_rad_s: rows
                .iter()
                .map(|row| original.mars_angular_velocity_rad_s[*row])
                .collect(),
            ..original.clone()
        };
        for row in &rows {
            let at = place(original.et_s[*row] + self.shift_s());
            self.push_node(&mut tables, original, *row, at)?;
        }
        let sun_at =
            [rows.first(), rows.last()].map(|row| row.map_or(0.0, |row| *row as f64 / last as f64));
        tables.sun_position_m = sun_at.map(|at| lagrange(&original.sun_position_m, at));
        tables.sun_velocity_m_s = sun_at.map(|at| lagrange(&original.sun_velocity_m_s, at));
        let own = InterpolationCheck::of(self.image, &tables, |et| self.tabulated(et))?;
        tables.interpolation = InterpolationCheck {
            error_max_px: original.interpolation.error_max_px + own.error_max_px,
            epochs: own.epochs,
        };
        Ok(tables)
    }

    /// Appends the node of `row`, whose camera the original tables have at the place `at`.
    fn push_node(
        &self,
        tables: &mut CameraTables,
        original: &CameraTables,
        row: usize,
        at: f64,
    ) -> Result<()> {
        let tag = Et::from_seconds(original.et_s[row]);
        let et = tag.plus(self.shift_s());
        let camera = self.tabulated(tag)?;
        let to_mars = *original.inertial_to_mars[row].matrix();
        let [mars, mars_then] = [tag, et].map(|et| *body_rotation(self.image.body, et).matrix());
        let to_mars_then = mars_then * mars.transpose() * to_mars;
        let to_camera = camera.to_mars.matrix().transpose() * to_mars;
        let to_bus = tables.bus_to_camera.matrix().transpose() * to_camera;
        let (drift_m_s, turn_rad_s) = self.rates(self.image.line_offset(tag))?;
        let spin = original.mars_angular_velocity_rad_s[row];
        let old_position_m = lagrange(&original.position_m, at);
        let old_velocity_m_s = lagrange(&original.velocity_m_s, at);
        let old_turn_rad_s = lagrange(&original.bus_angular_velocity_rad_s, at);
        // Velocities relative to Mars are the same at the tag and at the kernels' instant.
        let over_ground_m_s = to_mars_then * (old_velocity_m_s - spin.cross(&old_position_m));
        let position_m = to_mars.transpose() * camera.position.xyz_m;
        let velocity_m_s =
            to_mars.transpose() * (over_ground_m_s + drift_m_s) + spin.cross(&position_m);
        // To first order in θ, which neglects 1e-3 of a rate that is small itself.
        let bus_rad_s = to_mars.transpose() * (to_mars_then * old_turn_rad_s)
            - to_camera.transpose() * turn_rad_s;
        tables.position_m.push(position_m);
        tables.velocity_m_s.push(velocity_m_s);
        tables.inertial_to_bus.push(Rotation::new(to_bus, tag));
        tables.bus_angular_velocity_rad_s.push(bus_rad_s);
        Ok(())
    }

    /// Rates of the correction, metres and radians per second, between the line before and the line after.
    fn rates(&self, line_offset: f64) -> Result<(Vector3<f64>, Vector3<f64>)> {
        let (before, behind) = (
            self.correction(line_offset - 1.0)?,
            self.correction(line_offset + 1.0)?,
        );
        let between_s = 2.0 * self.image.line_times.mean_period_s();
        Ok((
            (behind.position_m - before.position_m) / between_s,
            (behind.rotation_rad - before.rotation_rad) / between_s,
        ))
    }
}
