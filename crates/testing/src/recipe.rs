//! A stereo pair like Gusev's with MOLA shots and tie points, and its true values.

use areograph_geom::{
    bundle::{Adjustment, BundleImage, BundlePoint, KnownCoordinates, Network, Range, View},
    intersection::{IntersectionLimits, Ray, intersect},
    pushbroom::{
        CorrectedOrientation, Distortion, EulerPolynomial, ExteriorOrientation,
        OrientationCorrection, Projector,
    },
    statistics::Summary,
};
use nalgebra::{Vector2, Vector3};

use super::scene::{GUSEV, Held, Scene};

/// Half the width of an image that sums two pixels, pixels.
pub const HALF_SWATH_PX: f64 = 512.0;
/// Shots within this distance outside a swath count as measured in it, pixels.
const OUTSIDE_PX: f64 = 200.0;
/// Approximate distance from perspective centre to ground: converts a standard deviation of positions to one of
/// angles.
pub const RANGE_M: f64 = 380e3;
/// Interval of MOLA's shots, seconds.
pub const SHOT_INTERVAL_S: f64 = 0.1;

/// Normal numbers by Box and Muller from a linear congruential generator, the same in every run.
pub struct Normals(u64);

impl Normals {
    pub fn new(seed: u64) -> Self {
        let mut normals = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        normals.uniform();
        normals
    }

    /// Evenly spread over `0..1`.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    pub fn next(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next())
    }
}

/// Parameters of the simulation.
#[derive(Debug, Clone, Copy)]
pub struct Recipe {
    /// Latitude and longitude of the nadir image, degrees.
    pub place_deg: [f64; 2],
    pub seed: u64,
    pub ties: usize,
    /// Shots along the track of each image.
    pub shots: [usize; 2],
    /// Delay of the time tags of each image, lines.
    pub shift_lines: [f64; 2],
    /// Standard deviation of a constant error of each image's position, metres.
    pub position_bias_m: f64,
    pub ground_noise_m: f64,
    pub range_noise_m: f64,
    /// Noise of ties, lines and pixels.
    pub tie_noise: f64,
    /// Image coordinates of shots that are kept: all in their own image, and in the other image those nearest its middle.
    pub mola_views: usize,
}

impl Recipe {
    /// The verified synthetic recipe of the adjustment.
    pub const GUSEV: Self = Self {
        place_deg: [GUSEV.latitude_deg, GUSEV.longitude_deg],
        seed: 7,
        ties: 154,
        shots: [142, 124],
        shift_lines: [26.0, -23.5],
        position_bias_m: 20.0,
        ground_noise_m: 10.0,
        range_noise_m: 7.0,
        tie_noise: 1.0,
        mola_views: 430,
    };

    /// The same without any error.
    pub const EXACT: Self = Self {
        shift_lines: [0.0, 0.0],
        position_bias_m: 0.0,
        ground_noise_m: 0.0,
        range_noise_m: 0.0,
        tie_noise: 0.0,
        ..Self::GUSEV
    };
}

/// A network and its true values.
#[derive(Debug, Clone)]
pub struct Simulated<M> {
    /// Initial orientations are the true ones with errors of time and position.
    pub network: Network<CorrectedOrientation<M>>,
    /// The images.
    pub scenes: [Scene; 2],
    /// True orientation of each image.
    pub orientations: [M; 2],
    /// True points: shots of the first track, of the second, then ties.
    pub points_m: Vec<Vector3<f64>>,
    /// Number of shots.
    pub shots: usize,
}

impl<M: ExteriorOrientation> Simulated<M> {
    /// The same observations with other initial orientations, derived from the present ones.
    pub fn based_on<N>(
        &self,
        base: impl Fn(&BundleImage<CorrectedOrientation<M>>) -> N,
    ) -> Network<N> {
        let images = self.network.images.iter().map(|image| BundleImage {
            base: base(image),
            half_lines: image.half_lines,
            line_period_s: image.line_period_s,
            focal_length_px: image.focal_length_px,
            distortion: image.distortion,
            sigmas: image.sigmas,
            time_bias_sigma_s: image.time_bias_sigma_s,
        });
        Network {
            images: images.collect(),
            points: self.network.points.clone(),
            views: self.network.views.clone(),
            ranges: self.network.ranges.clone(),
            range_bias_sigmas_m: self.network.range_bias_sigmas_m.clone(),
            heights: None,
            attitude_clock: None,
            common_bus: None,
            expected_m: Vec::new(),
            passes: Vec::new(),
        }
    }
}

/// The pair: the nadir image, and one from an orbit 2.45° west that is aimed at the same ground.
pub fn pair([latitude_deg, longitude_deg]: [f64; 2]) -> [Scene; 2] {
    let nadir = Scene {
        latitude_deg,
        longitude_deg,
        ..GUSEV
    };
    [nadir, aimed(&nadir, -2.45)]
}

/// An image from an orbit `east_deg` beside the orbit of `nadir`, aimed at the same ground.
pub fn aimed(nadir: &Scene, east_deg: f64) -> Scene {
    let oblique = Scene {
        longitude_deg: nadir.longitude_deg + east_deg,
        lines: 8_960,
        duration_s: 12.958,
        ..*nadir
    };
    held_on(oblique, &nadir.boresight_ground_m(0.0))
}

/// The image held inertially, its middle on the target.
pub fn held_on(mut oblique: Scene, target_m: &Vector3<f64>) -> Scene {
    for _ in 0..4 {
        let unrolled = Scene {
            held: Held::Inertial { roll_deg: 0.0 },
            ..oblique
        };
        let camera_m = unrolled.pose(0.0).camera_vector_m(target_m);
        let roll_deg = camera_m.y.atan2(camera_m.z).to_degrees();
        // The camera flies along its −X: points ahead have a negative x.
        oblique.latitude_deg -= (camera_m.x / target_m.norm()).to_degrees();
        oblique.held = Held::Inertial { roll_deg };
    }
    oblique
}

/// Standard deviations of the paper: `sigma_m` for positions, the equivalent on the ground for angles.
pub fn sigmas(sigma_m: f64) -> [f64; 18] {
    std::array::from_fn(|index| {
        if index < 9 {
            sigma_m
        } else {
            sigma_m / RANGE_M
        }
    })
}

/// Measures of a point: line and place in the line.
pub fn project(
    projector: &Projector<'_, impl ExteriorOrientation>,
    focal_length_px: f64,
    point_m: &Vector3<f64>,
) -> (f64, f64) {
    let seen = projector.project(point_m).unwrap();
    let y_px = -focal_length_px * seen.camera_m.y / seen.camera_m.z;
    (seen.x, y_px)
}

/// A measurement for intersection, one focal-plane pixel in both axes.
pub fn ray(image: &BundleImage<impl ExteriorOrientation>, x_lines: f64, y_px: f64) -> Ray {
    let pose = image.base.pose(x_lines);
    Ray {
        position_m: pose.position_m,
        mars_to_camera: pose.mars_to_camera,
        focal_length_px: image.focal_length_px,
        focal_px: Vector2::new(0.0, y_px),
        along_sigma_px: 1.0,
        across_sigma_px: 1.0,
    }
}

impl Recipe {
    /// With the sensor model of the papers as the true orientation.
    pub fn simulate(&self) -> Simulated<EulerPolynomial> {
        self.simulate_with(|scene| scene.euler(2))
    }

    /// With any sensor model of the scenes as the true orientation.
    pub fn simulate_with<M: ExteriorOrientation + Clone>(
        &self,
        model: impl Fn(&Scene) -> M,
    ) -> Simulated<M> {
        self.simulate_pair(pair(self.place_deg), model)
    }

    /// The same for other images; the first is a nadir image.
    pub fn simulate_pair<M: ExteriorOrientation + Clone>(
        &self,
        scenes: [Scene; 2],
        model: impl Fn(&Scene) -> M,
    ) -> Simulated<M> {
        let mut normals = Normals::new(self.seed);
        let orientations = scenes.each_ref().map(model);
        let mut network = Network {
            images: (0..2)
                .map(|image| {
                    let half_lines = 0.5 * f64::from(scenes[image].lines);
                    let mut bias =
                        OrientationCorrection::of(&[0.0; 18], half_lines, self.shift_lines[image]);
                    bias.position_m[0] = normals.vector() * self.position_bias_m;
                    BundleImage {
                        base: CorrectedOrientation {
                            base: orientations[image].clone(),
                            correction: bias,
                        },
                        half_lines,
                        line_period_s: scenes[image].line_period_s(),
                        focal_length_px: scenes[image].focal_length_px(),
                        distortion: Distortion::NONE,
                        sigmas: sigmas([100.0, 200.0][image]),
                        time_bias_sigma_s: 0.0,
                    }
                })
                .collect(),
            range_bias_sigmas_m: vec![0.0; 2],
            ..Network::default()
        };
        let mut points_m = Vec::new();
        self.shoot(
            &scenes,
            &orientations,
            &mut normals,
            &mut network,
            &mut points_m,
        );
        let shots = points_m.len();
        self.tie(
            &scenes,
            &orientations,
            &mut normals,
            &mut network,
            &mut points_m,
        );
        Simulated {
            network,
            scenes,
            orientations,
            points_m,
            shots,
        }
    }

    fn shoot<M: ExteriorOrientation>(
        &self,
        scenes: &[Scene; 2],
        orientations: &[M; 2],
        normals: &mut Normals,
        network: &mut Network<CorrectedOrientation<M>>,
        points_m: &mut Vec<Vector3<f64>>,
    ) {
        for (image, scene) in scenes.iter().enumerate() {
            for shot in 0..self.shots[image] {
                let at_s = (shot as f64 - 0.5 * (self.shots[image] as f64 - 1.0)) * SHOT_INTERVAL_S;
                let ground_m = scene.boresight_ground_m(at_s);
                let point_m = ground_m + ground_m.normalize() * (50.0 * normals.next());
                let x_lines = at_s / scene.line_period_s();
                let distance_m = (orientations[image].pose(x_lines).position_m - point_m).norm();
                network.ranges.push(Range {
                    to_laser_m: Vector3::zeros(),
                    point: points_m.len(),
                    image,
                    x_lines,
                    range_m: distance_m + self.range_noise_m * normals.next(),
                    sigma_m: 10.0,
                    profile: image,
                });
                network.points.push(BundlePoint {
                    ground_m: point_m + normals.vector() * self.ground_noise_m,
                    known: Some(KnownCoordinates::of_sigmas(Vector3::repeat(10.0))),
                });
                points_m.push(point_m);
            }
        }
        // MOLA's image coordinates are projections of its footprints with the initial orientation.
        let mut views = Vec::new();
        for (image, entry) in network.images.iter().enumerate() {
            let projector = Projector::new(&entry.base, 2.0 * entry.half_lines).unwrap();
            for (index, point) in network.points.iter().enumerate() {
                let (x_lines, y_px) = project(&projector, entry.focal_length_px, &point.ground_m);
                let outside_px = y_px.abs() - scenes[image].half_swath_px();
                if x_lines.abs() <= entry.half_lines && outside_px <= OUTSIDE_PX {
                    views.push(View {
                        point: index,
                        image,
                        x_lines,
                        y_px,
                        sigma_px: Vector2::new(74.0, 4.0),
                    });
                }
            }
        }
        let far = |view: &View| {
            let own = network.ranges[view.point].image == view.image;
            if own { 0.0 } else { view.x_lines.abs() }
        };
        views.sort_by(|a, b| far(a).total_cmp(&far(b)));
        views.truncate(self.mola_views);
        network.views.extend(views);
    }

    fn tie<M: ExteriorOrientation>(
        &self,
        scenes: &[Scene; 2],
        orientations: &[M; 2],
        normals: &mut Normals,
        network: &mut Network<CorrectedOrientation<M>>,
        points_m: &mut Vec<Vector3<f64>>,
    ) {
        let projectors = [0, 1].map(|image| {
            Projector::new(&orientations[image], f64::from(scenes[image].lines)).unwrap()
        });
        let [focal_length_px, swath_px] = [scenes[0].focal_length_px(), scenes[0].half_swath_px()];
        let mut left = self.ties;
        while left > 0 {
            let at_s = (normals.uniform() - 0.5) * scenes[0].duration_s;
            let pose = scenes[0].pose(at_s);
            let below_m = scenes[0].boresight_ground_m(at_s);
            let across = (2.0 * normals.uniform() - 1.0) * swath_px / focal_length_px;
            let aside_m = below_m
                + pose.mars_to_camera.row(1).transpose()
                    * (across * (pose.position_m - below_m).norm());
            let point_m = aside_m.normalize() * (below_m.norm() + 150.0 * normals.next());
            let seen = [0, 1].map(|image| {
                project(
                    &projectors[image],
                    scenes[image].focal_length_px(),
                    &point_m,
                )
            });
            let inside = seen.iter().zip(scenes).all(|((x_lines, y_px), scene)| {
                x_lines.abs() < 0.5 * f64::from(scene.lines) && y_px.abs() < scene.half_swath_px()
            });
            if !inside {
                continue;
            }
            left -= 1;
            let measured = seen.map(|(x_lines, y_px)| {
                (
                    x_lines + self.tie_noise * normals.next(),
                    y_px + self.tie_noise * normals.next(),
                )
            });
            let rays = [0, 1]
                .map(|image| ray(&network.images[image], measured[image].0, measured[image].1));
            let start = intersect(&rays, &IntersectionLimits::default()).unwrap();
            for (image, (x_lines, y_px)) in measured.into_iter().enumerate() {
                network.views.push(View {
                    point: points_m.len(),
                    image,
                    x_lines,
                    y_px,
                    sigma_px: Vector2::new(1.0, 1.0),
                });
            }
            network.points.push(BundlePoint {
                ground_m: start.ground_m,
                known: None,
            });
            points_m.push(point_m);
        }
    }
}

/// Measured minus projected: lines and pixels of each view of the ties of an image.
pub fn reprojection(
    simulated: &Simulated<EulerPolynomial>,
    image: usize,
    orientation: &impl ExteriorOrientation,
    ground_m: impl Fn(usize) -> Vector3<f64>,
) -> [Vec<f64>; 2] {
    let entry = &simulated.network.images[image];
    let projector = Projector::new(orientation, 2.0 * entry.half_lines).unwrap();
    let ties = |view: &&View| view.image == image && view.point >= simulated.shots;
    let differences: Vec<(f64, f64)> = simulated
        .network
        .views
        .iter()
        .filter(ties)
        .map(|view| {
            let (x, y) = project(&projector, entry.focal_length_px, &ground_m(view.point));
            (view.x_lines - x, view.y_px - y)
        })
        .collect();
    let (lines, pixels) = differences.into_iter().unzip();
    [lines, pixels]
}

/// The initial orientation of an image with its correction.
pub fn adjusted_orientation<'a>(
    simulated: &'a Simulated<EulerPolynomial>,
    adjustment: &Adjustment,
    image: usize,
) -> impl ExteriorOrientation + use<'a> {
    CorrectedOrientation {
        base: &simulated.network.images[image].base,
        correction: adjustment.images[image].correction,
    }
}

/// Ground length of a line of an image at its middle, metres.
pub fn line_spacing_m(simulated: &Simulated<EulerPolynomial>, image: usize) -> f64 {
    let scene = &simulated.scenes[image];
    (scene.boresight_ground_m(scene.line_period_s()) - scene.boresight_ground_m(0.0)).norm()
}

/// Mean shift of the shots' image coordinates from the initial to the adjusted orientation, lines.
pub fn mola_shift_lines(
    simulated: &Simulated<EulerPolynomial>,
    adjustment: &Adjustment,
    image: usize,
) -> Summary {
    let shifts = mola_shifts(simulated, adjustment, image);
    Summary::of(&shifts.iter().map(|[lines, _]| *lines).collect::<Vec<f64>>())
}

/// The shifts across the track, pixels against the samples.
pub fn mola_shift_px(
    simulated: &Simulated<EulerPolynomial>,
    adjustment: &Adjustment,
    image: usize,
) -> Vec<f64> {
    let shifts = mola_shifts(simulated, adjustment, image);
    shifts.iter().map(|[_, px]| *px).collect()
}

/// Shift of each shot, lines and pixels.
fn mola_shifts(
    simulated: &Simulated<EulerPolynomial>,
    adjustment: &Adjustment,
    image: usize,
) -> Vec<[f64; 2]> {
    let entry = &simulated.network.images[image];
    let orientation = adjusted_orientation(simulated, adjustment, image);
    let projector = Projector::new(&orientation, 2.0 * entry.half_lines).unwrap();
    let shots = |view: &&View| view.image == image && view.point < simulated.shots;
    let views = simulated.network.views.iter();
    views
        .filter(shots)
        .map(|view| {
            let ground_m = adjustment.points[view.point].unwrap().ground_m;
            let (lines, px) = project(&projector, entry.focal_length_px, &ground_m);
            [lines - view.x_lines, px - view.y_px]
        })
        .collect()
}
