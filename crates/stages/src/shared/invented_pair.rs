//! Two synthetic cameras over synthetic ground, for tests of stages that compare pixels.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of a byte"
)]

use std::{fs::File, io::Write as _, path::Path};

use nalgebra::{Matrix3, Vector2, Vector3};

use super::image_view::View;
use areograph_base::{line_times::LineTimes, time::Et};
use areograph_config::usual_instrument;
use areograph_geom::{
    oriented_camera::OrientedCamera,
    pushbroom::{Detector, ExteriorOrientation, Pose, SampledOrientation},
};
use areograph_pds::pixel_file::{PixelFile, Pyramid};

pub(crate) const RADIUS_M: f64 = 3_390_000.0;
pub(crate) const HEIGHT_M: f64 = 380_000.0;
pub(crate) const LINES: u32 = 1_280;
pub(crate) const SAMPLES: u32 = 256;
/// Line spacing of the first camera and of the second, metres.
pub(crate) const LINE_SPACING_M: [f64; 2] = [4.4, 4.0];
/// Distance of their tracks east of the ground, metres.
pub(crate) const EAST_M: [f64; 2] = [0.0, 120_000.0];

/// Height of the ground above the sphere at a place, metres.
pub(crate) type Hill = fn(&Vector3<f64>) -> f64;

/// Pseudorandom numbers with a fixed seed.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The cameras, their ground, and its rendering.
pub(crate) struct Invented;

impl Invented {
    pub(crate) fn waves(seed: u64) -> Vec<[f64; 5]> {
        let mut random = Random(seed);
        let mut wave = || {
            let length_m = 15.0 * 20.0_f64.powf(random.unit());
            let (height, around) = (2.0 * random.unit() - 1.0, 6.3 * random.unit());
            let side = (1.0 - height * height).sqrt();
            let number = std::f64::consts::TAU / length_m;
            [
                number * side * around.cos(),
                number * side * around.sin(),
                number * height,
                6.3 * random.unit(),
                2.0 * length_m.powf(0.35),
            ]
        };
        (0..24).map(|_| wave()).collect()
    }

    /// A camera that flies north and looks at the ground below the first one; `off_m` away from there, north and east.
    pub(crate) fn camera(number: usize, off_m: [f64; 2]) -> OrientedCamera<SampledOrientation> {
        let poses: Vec<(f64, Pose)> = (0..=30)
            .map(|step| {
                let x_lines = f64::from(LINES) * (f64::from(step) / 30.0 - 0.5);
                let north_m = x_lines * LINE_SPACING_M[number] + off_m[0];
                let target_m = Vector3::new(RADIUS_M, off_m[1], north_m);
                let position_m =
                    Vector3::new(RADIUS_M + HEIGHT_M, EAST_M[number] + off_m[1], north_m);
                let look = (target_m - position_m).normalize();
                let along = Vector3::z();
                let across = look.cross(&along).normalize();
                let rows = [across.cross(&look), across, look].map(|row| row.transpose());
                let pose = Pose {
                    position_m,
                    mars_to_camera: Matrix3::from_rows(&rows),
                };
                (x_lines, pose)
            })
            .collect();
        OrientedCamera {
            id: ["one", "two"][number].to_owned(),
            orientation: SampledOrientation::new(&poses).unwrap(),
            detector: Detector::new(usual_instrument(), 2, 768, SAMPLES),
            line_times: LineTimes::even(Et::from_seconds(0.0), LINES, 1.4e-3).unwrap(),
        }
    }

    /// The ground that a place of a camera truly shows.
    pub(crate) fn ground_m(
        camera: &OrientedCamera<SampledOrientation>,
        place: &Vector2<f64>,
        hill_m: Hill,
    ) -> Vector3<f64> {
        let (x_lines, _) = camera.focal_plane_coordinates(place.x, place.y);
        let pose = camera.orientation.pose(x_lines);
        let look = pose
            .mars_to_camera
            .tr_mul(&camera.detector.look(place.y))
            .normalize();
        let mut range_m = HEIGHT_M;
        for _ in 0..8 {
            let at_m = pose.position_m + range_m * look;
            let above_m = at_m.norm() - RADIUS_M - hill_m(&at_m);
            range_m += above_m / -look.dot(&at_m.normalize());
        }
        pose.position_m + range_m * look
    }

    /// Brightness of a place: plane waves 15 to 300 m long.
    pub(crate) fn brightness(place_m: &Vector3<f64>, waves: &[[f64; 5]]) -> f64 {
        let of_wave = |wave: &[f64; 5]| {
            let phase = wave[0] * place_m.x + wave[1] * place_m.y + wave[2] * place_m.z + wave[3];
            wave[4] * phase.sin()
        };
        waves.iter().map(of_wave).sum()
    }

    pub(crate) fn rendered(
        camera: &OrientedCamera<SampledOrientation>,
        lines: u32,
        hill_m: Hill,
        waves: &[[f64; 5]],
        seed: u64,
    ) -> Vec<u8> {
        let mut random = Random(seed);
        let places = (0..lines).flat_map(|line| (0..SAMPLES).map(move |sample| [line, sample]));
        let number = |[line, sample]: [u32; 2]| {
            let place = Vector2::new(f64::from(line) + 0.5, f64::from(sample) + 0.5);
            let noise = 2.0 * (random.unit() + random.unit() + random.unit() - 1.5);
            let dn =
                120.0 + Self::brightness(&Self::ground_m(camera, &place, hill_m), waves) + noise;
            dn.round().clamp(0.0, 255.0) as u8
        };
        places.map(number).collect()
    }

    /// A `.img` file with these pixels.
    pub(crate) fn pyramid(folder: &Path, pixels: &[u8]) -> Pyramid {
        let label = format!(
            "PDS_VERSION_ID = PDS3\r\nRECORD_BYTES = 2048\r\n^IMAGE = 2\r\nINSTRUMENT_ID = \"{}\"\r\nOBJECT = IMAGE\r\n\
             LINES = {LINES}\r\nLINE_SAMPLES = {SAMPLES}\r\nSAMPLE_BITS = 8\r\nEND_OBJECT = IMAGE\r\nEND\r\n",
            usual_instrument().label.instrument
        );
        let mut bytes = label.into_bytes();
        bytes.resize(2048, b' ');
        bytes.extend_from_slice(pixels);
        let path = folder.join("pixels.img");
        File::create(&path).unwrap().write_all(&bytes).unwrap();
        let file = PixelFile::open(&path, std::slice::from_ref(usual_instrument())).unwrap();
        Pyramid::of(&file).unwrap()
    }

    /// A view through a camera of these pixels.
    pub(crate) fn view<'a>(
        camera: &'a OrientedCamera<SampledOrientation>,
        pixels: &'a Pyramid,
    ) -> View<'a> {
        let OrientedCamera {
            id,
            orientation,
            detector,
            line_times,
        } = camera;
        let camera = OrientedCamera {
            id: id.clone(),
            orientation: orientation as &(dyn ExteriorOrientation + 'static),
            detector: *detector,
            line_times: line_times.clone(),
        };
        View::through(camera, pixels).unwrap()
    }
}
