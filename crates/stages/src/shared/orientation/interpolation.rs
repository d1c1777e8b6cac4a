//! The error of the interpolation between the nodes of camera tables.

use super::tables::{Camera, CameraTables, InterpolationCheck, Nodes};
use crate::tag_times::ImageTimes;
use areograph_base::{error::Result, time::Et};
use areograph_geom::statistics::largest;

/// Points between two nodes at which the interpolation is compared with the kernels, shares of their distance.
const CHECKED_AT: [f64; 3] = [0.25, 0.5, 0.75];
/// Of how many such places one is compared where the nodes give no reason for more; not divisible by their number, so
/// that all three take their turns.
const CHECKED_EVERY: usize = 10;
/// Share of the limit from which on a node that its neighbours do not predict is suspicious.
const SUSPECT_SHARE: f64 = 0.1;

impl InterpolationCheck {
    /// Compares the interpolated camera with `camera` between the nodes over the image: at every tenth of the places of
    /// [`CHECKED_AT`], which in turn are a quarter, half and three quarters of the way between two nodes, and at all
    /// places beside nodes that their neighbours do not predict.
    ///
    /// # Accuracy
    /// Whatever moves the camera at the spacing of the nodes or more slowly shows at the nodes: a kink or a jump between
    /// two of them is missed by twice its interpolation error or more when every second node predicts the others.
    /// From a tenth of the limit on, such errors are those of all places. What repeats from node to node appears at the
    /// places between any two. A single motion that begins and ends between the same two nodes is found only if one of the
    /// compared places lies in it, in one of ten cases; ten image lines last a few milliseconds.
    pub(crate) fn of(
        image: &ImageTimes,
        tables: &CameraTables,
        camera: impl Fn(Et) -> Result<Camera>,
    ) -> Result<Self> {
        let nodes = Nodes::new(tables);
        let missed = Missed::of(image, &nodes);
        let (mut check, mut place) = (Self::default(), 0_usize);
        for (before, pair) in tables.et_s.windows(2).enumerate() {
            let beside_missed = missed.is_beside(before);
            for share in CHECKED_AT {
                let et = Et::from_seconds(pair[0] + share * (pair[1] - pair[0]));
                if !image.exposures().contains(et) {
                    continue;
                }
                if beside_missed || place.is_multiple_of(CHECKED_EVERY) {
                    let error_px = error_px(image, &camera(et)?, &nodes.camera(et));
                    check.error_max_px =
                        largest([check.error_max_px, error_px]).unwrap_or_default();
                    check.epochs += 1;
                }
                place += 1;
            }
        }
        Ok(check)
    }
}

/// Errors with which the nodes are predicted by their neighbours.
struct Missed {
    by_px: Vec<f64>,
    /// Least error of a node beside which all places are compared, image pixels.
    suspect_px: f64,
}

impl Missed {
    /// Predicts the nodes of even numbers from those of odd numbers, and vice versa.
    fn of(image: &ImageTimes, nodes: &Nodes) -> Self {
        let others = [nodes.every_second(1), nodes.every_second(0)];
        let (mut by_px, mut largest_px) = (Vec::new(), None);
        for (node, known) in nodes.cameras().enumerate() {
            let et = known.to_mars.at();
            let missed_px = error_px(image, &known, &others[node % 2].camera(et));
            if image.exposures().contains(et) {
                largest_px = largest(largest_px.into_iter().chain([missed_px]));
            }
            by_px.push(missed_px);
        }
        let suspect_px = InterpolationCheck::LIMIT_PX * SUSPECT_SHARE;
        Self {
            by_px,
            // Beside the node that is missed by most in any case: the largest error is usually there.
            suspect_px: largest_px.map_or(suspect_px, |largest_px| suspect_px.min(largest_px)),
        }
    }

    /// Whether one of the nodes `before` and after it is missed by much, or by most.
    fn is_beside(&self, before: usize) -> bool {
        let beside = self.by_px.iter().skip(before).take(2);
        // Written so that NaN counts.
        beside.into_iter().any(|px| !(*px < self.suspect_px))
    }
}

/// Largest distance between the image coordinates of the same ground in two cameras, in image pixels, over the middle
/// and both ends of a line; the ground is assumed at its shortest range, at nadir.
fn error_px(image: &ImageTimes, kernels: &Camera, interpolated: &Camera) -> f64 {
    let position_m = kernels.position.xyz_m;
    let distance_m = position_m.norm() - image.body.model().equatorial_radius_m;
    let detector = image.detector();
    let pixel_rad =
        image.instrument.optics.pixel_pitch_mm / image.instrument.optics.focal_length_mm;
    let errors_px = [0.0, 0.5, 1.0].map(|share| {
        let look = detector.look(share * detector.samples);
        let ground_m = position_m + kernels.to_mars.matrix() * look * distance_m;
        let seen =
            interpolated.to_mars.matrix().transpose() * (ground_m - interpolated.position.xyz_m);
        let missed = seen.xy() / seen.z - look.xy();
        let lines = missed.x / f64::from(image.downtrack_summing);
        let samples = missed.y / f64::from(image.crosstrack_summing);
        lines.hypot(samples) / pixel_rad
    });
    largest(errors_px).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::tag_times::StartFrom;
    use areograph_base::{
        body::Body,
        frames::{Position, Rotation},
        line_times::LineTimes,
    };
    use areograph_config::usual_instrument;
    use areograph_geom::attitude::matrix_of_rotation_vector;

    /// Lines between two nodes, and nodes before the image and behind.
    const NODE_LINES: usize = 10;
    const BEYOND: usize = 8;
    const LINES: u32 = 4_000;
    const LINE_S: f64 = 5e-4;
    const NODE_S: f64 = NODE_LINES as f64 * LINE_S;

    fn image() -> ImageTimes {
        ImageTimes {
            id: "m00-00001".to_owned(),
            body: Body::Mars,
            instrument: usual_instrument().clone(),
            line_times: LineTimes::even(Et::from_seconds(0.0), LINES, LINE_S).unwrap(),
            start_from: StartFrom::Sclk,
            sclk_start: None,
            utc_start: String::new(),
            exposure_s: LINE_S,
            downtrack_summing: 1,
            crosstrack_summing: 1,
            lines_delivered: LINES,
            samples: 2_048,
            first_detector: 0,
            has_stop_time: true,
            notes: Vec::new(),
            remarks: Vec::new(),
            support: None,
        }
    }

    /// A camera 380 km above Mars that looks down; its attitude has this error, radians, at an instant.
    fn camera(et: Et, roll_rad: &impl Fn(f64) -> f64) -> Camera {
        let along_rad = 9e-4 * et.seconds();
        let out = Vector3::new(along_rad.cos(), along_rad.sin(), 0.0);
        let ahead = Vector3::new(-along_rad.sin(), along_rad.cos(), 0.0);
        let down = Matrix3::from_columns(&[-ahead, Vector3::z(), -out]);
        let turned = matrix_of_rotation_vector(&Vector3::new(roll_rad(et.seconds()), 0.0, 0.0));
        Camera {
            position: Position::new(3.776e6 * out),
            to_mars: Rotation::new(down * turned, et),
        }
    }

    fn tables(roll_rad: &impl Fn(f64) -> f64) -> CameraTables {
        let nodes = LINES as usize / NODE_LINES + 2 * BEYOND;
        let ets = (0..=nodes)
            .map(|node| Et::from_seconds((node as f64 - BEYOND as f64) * NODE_S))
            .map(|et| (et, camera(et, roll_rad)));
        let mut tables = CameraTables {
            et_s: Vec::new(),
            position_m: Vec::new(),
            velocity_m_s: Vec::new(),
            sun_position_m: [Vector3::zeros(); 2],
            sun_velocity_m_s: [Vector3::zeros(); 2],
            inertial_to_bus: Vec::new(),
            bus_angular_velocity_rad_s: Vec::new(),
            inertial_to_mars: Vec::new(),
            mars_angular_velocity_rad_s: Vec::new(),
            bus_to_camera: Rotation::new(Matrix3::identity(), Et::from_seconds(0.0)),
            interpolation: InterpolationCheck::default(),
        };
        for (et, camera) in ets {
            let inertial_to_bus = camera.to_mars.matrix().transpose();
            tables.et_s.push(et.seconds());
            tables.position_m.push(camera.position.xyz_m);
            tables
                .inertial_to_bus
                .push(Rotation::new(inertial_to_bus, et));
            tables
                .inertial_to_mars
                .push(Rotation::new(Matrix3::identity(), et));
        }
        tables
    }

    /// The check, and the largest error at all places between all nodes, image pixels.
    fn checked(roll_rad: impl Fn(f64) -> f64) -> (InterpolationCheck, f64) {
        let (image, tables) = (image(), tables(&roll_rad));
        let check = InterpolationCheck::of(&image, &tables, |et| Ok(camera(et, &roll_rad)));
        let nodes = Nodes::new(&tables);
        let all = (0..4 * LINES as usize / NODE_LINES).filter(|place| place % 4 != 0);
        let errors_px = all.map(|place| {
            let et = Et::from_seconds(place as f64 / 4.0 * NODE_S);
            error_px(&image, &camera(et, &roll_rad), &nodes.camera(et))
        });
        (check.unwrap(), largest(errors_px).unwrap())
    }

    #[test]
    fn a_smooth_motion_is_compared_at_a_tenth_of_the_places() {
        // A turn of the bus within an orbit, and a sway in two seconds.
        let (check, all_px) = checked(|s| 1e-3 * s + 1e-6 * (3.0 * s).sin());
        assert!(check.keeps_limit() && all_px < InterpolationCheck::LIMIT_PX);
        let places = 3 * LINES as usize / NODE_LINES;
        // Six places at most are beside the node that is missed by most.
        assert!(
            (places / 10..=places / 10 + 6).contains(&check.epochs),
            "{check:?}"
        );
    }

    #[test]
    fn an_error_from_a_tenth_of_the_limit_on_is_found_as_if_all_places_were_compared() {
        // Between any two nodes, and at any place between them; a node at 0.
        for at_nodes in [7.0, 60.1, 133.25, 200.5, 287.66, 391.95] {
            let at_s = at_nodes * NODE_S;
            for (cause, roll_rad) in [
                ("kink", (|s: f64| s.max(0.0)) as fn(f64) -> f64),
                ("jump", |s| if s > 0.0 { 3e-3 } else { 0.0 }),
                ("bump", |s| 3e-3 * (-(s / 8e-3).powi(2)).exp()),
            ] {
                // Errors from far below the limit to above it.
                for scale in [1e-6, 1e-5, 1e-4, 1e-3] {
                    let (check, all_px) = checked(|s| scale * roll_rad(s - at_s));
                    // Rounding of positions 3,800 km from the centre: 1e-9 m, at 1.4 m a pixel.
                    let apart_px = check.error_max_px - all_px;
                    let is_found = apart_px.abs() <= 1e-8;
                    let is_harmless = all_px < SUSPECT_SHARE * InterpolationCheck::LIMIT_PX;
                    assert!(
                        is_found || is_harmless && apart_px < 0.0,
                        "{cause} at node {at_nodes}: {check:?}, but {all_px} px"
                    );
                }
            }
        }
    }

    #[test]
    fn a_vibration_that_no_node_shows_is_found() {
        for periods in [1.0, 2.0, 3.0, 5.0] {
            let turn = std::f64::consts::TAU * periods / NODE_S;
            // Twice the limit halfway between two nodes, for a pixel of 3.7e-6 rad.
            let (check, all_px) = checked(|s| 3.7e-8 * (1.0 - (turn * s).cos()));
            assert!(
                all_px > InterpolationCheck::LIMIT_PX && !check.keeps_limit(),
                "{check:?}"
            );
        }
    }
}
