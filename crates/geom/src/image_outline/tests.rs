//! Outlines against the ground on a sphere, point by point.

use std::f64::consts::PI;

use super::*;

const DEGREE: f64 = RADIANS_PER_DEGREE;

fn outline(corners_deg: [[f64; 2]; 4]) -> ImageOutline {
    let corners = corners_deg.map(|corner| Some(corner.map(|degrees| degrees * DEGREE)));
    let mean =
        |axis: usize| corners_deg.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0 * DEGREE;
    ImageOutline::new(corners, [mean(0), mean(1)], None).unwrap()
}

#[test]
fn overlaps_are_shares_of_the_smaller_outline() {
    let square = outline([[10.0, 0.0], [12.0, 0.0], [12.0, 2.0], [10.0, 2.0]]);
    for (other, share) in [
        ([[11.0, 0.0], [13.0, 0.0], [13.0, 2.0], [11.0, 2.0]], 0.5),
        // The other direction, and containment.
        ([[10.5, 1.5], [11.5, 1.5], [11.5, 0.5], [10.5, 0.5]], 1.0),
        ([[20.0, 0.0], [22.0, 0.0], [22.0, 2.0], [20.0, 2.0]], 0.0),
        // A diamond with its middle on a corner: a quarter of it.
        ([[12.0, 1.0], [13.0, 2.0], [12.0, 3.0], [11.0, 2.0]], 0.25),
    ] {
        let overlap = square.overlap(&outline(other));
        // Rounding of a few radians.
        assert!((overlap - share).abs() < 1e-12, "{overlap} for {share}");
        assert!((outline(other).overlap(&square) - share).abs() < 1e-12);
    }
    let across = outline([[359.0, 0.0], [361.0, 0.0], [361.0, 2.0], [359.0, 2.0]]);
    let east = outline([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
    assert!((across.overlap(&east) - 0.5).abs() < 1e-12);
}

/// A quadrangle of great circles about a point: from its centre along two directions of a tangent plane.
struct Patch {
    centre: Vector3<f64>,
    across: Vector3<f64>,
    along: Vector3<f64>,
}

impl Patch {
    /// Half sizes are tangents; `azimuth_rad` turns it.
    fn new(
        [longitude_deg, latitude_deg]: [f64; 2],
        half_sizes: [f64; 2],
        azimuth_rad: f64,
    ) -> Self {
        let centre = direction([longitude_deg * DEGREE, latitude_deg * DEGREE]);
        let east = direction([longitude_deg * DEGREE + FRAC_PI_2, 0.0]);
        let north = centre.cross(&east);
        let (sin, cos) = azimuth_rad.sin_cos();
        Self {
            centre,
            across: (east * cos + north * sin) * half_sizes[0],
            along: (north * cos - east * sin) * half_sizes[1],
        }
    }

    fn at(&self, across: f64, along: f64) -> [f64; 2] {
        place(&(self.centre + self.across * across + self.along * along))
    }

    fn corners(&self) -> [[f64; 2]; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| self.at(x, y))
    }
}

fn place(towards: &Vector3<f64>) -> [f64; 2] {
    let towards = towards.normalize();
    [
        wrap_two_pi(towards.y.atan2(towards.x)),
        towards.z.clamp(-1.0, 1.0).asin(),
    ]
}

struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn widened_outlines_hold_every_direction_of_the_image_and_of_its_margin() {
    let mut random = Random(5);
    let mut round = 0;
    for number in 0..1500 {
        // Every third is a wide-angle image by a pole, its corners about 80° to 85°.
        let (latitude, most) = match number % 3 {
            0 => (random.between(82.0, 90.0), 0.15),
            1 => (random.between(-90.0, -70.0), 0.3),
            _ => (random.between(-70.0, 70.0), 0.3),
        };
        let longitude = random.between(0.0, 360.0);
        let sizes = [random.between(0.001, most), random.between(0.001, most)];
        let patch = Patch::new([longitude, latitude], sizes, random.between(0.0, TAU));
        let corners = patch.corners();
        round += usize::from(goes_round_pole(&corners));
        let radius_rad = random.between(0.0, 1.0) * DEGREE;
        let centre = [longitude * DEGREE, latitude * DEGREE];
        let outline = ImageOutline::new(corners.map(Some), centre, None).unwrap();
        let region = outline.widened(radius_rad, radius_rad);
        let lowest = corners
            .iter()
            .map(|corner| corner[1].abs())
            .fold(f64::INFINITY, f64::min);
        for _ in 0..60 {
            let [across, along] = [0, 1].map(|_| random.between(-1.0, 1.0));
            let (sin, cos) = random.between(0.0, TAU).sin_cos();
            let inside = direction(patch.at(across, along));
            let sideways = inside.cross(&Vector3::x()).normalize();
            let away = sideways * cos + inside.cross(&sideways) * sin;
            let beside = place(&(inside + away * (0.999_999 * radius_rad).tan()));
            assert!(
                region.contains(beside[0], beside[1]),
                "{corners:?} by {radius_rad}: {beside:?}"
            );
        }
        // It does not contain half of Mars: neither what is nearer to the equator than all of it, nor the other side.
        if latitude.abs() > 70.0 {
            let below = (lowest - radius_rad - 0.01 * DEGREE).copysign(latitude);
            assert!(!region.contains(random.between(0.0, TAU), below));
        } else {
            assert!(!region.contains(centre[0] + PI, -latitude * DEGREE));
        }
    }
    assert!(round > 100, "{round}");
}

#[test]
fn outlines_over_a_pole_overlap_by_their_ground() {
    // Squares of 0.2 about the pole and half of one beside it.
    let outline = |patch: Patch| {
        let centre = place(&patch.centre);
        ImageOutline::new(patch.corners().map(Some), centre, None).unwrap()
    };
    for latitude in [90.0, -90.0] {
        let whole = outline(Patch::new([0.0, latitude], [0.1, 0.1], 0.0));
        let turned = outline(Patch::new([0.0, latitude], [0.1, 0.1], FRAC_PI_2 / 2.0));
        let half = outline(Patch::new([0.0, latitude], [0.1, 0.05], 0.3));
        // A square and itself turned by 45° share an octagon, 2√2 − 2 of either; the plane is true to 0.1² / 3.
        assert!((whole.overlap(&turned) - 0.828_427).abs() < 0.005);
        assert!((whole.overlap(&whole) - 1.0).abs() < 1e-9);
        let shared = whole.overlap(&half);
        assert!((0.9..=1.0).contains(&shared), "{shared}");
    }
}

#[test]
fn boxes_stand_for_corners_that_are_not_known() {
    let none = [None; 4];
    assert_eq!(ImageOutline::new(none, [1.0, 0.5], None), None);
    for latitude in [0.0, 60.0, 80.0, 89.5] {
        let radius_rad = 3.0 * DEGREE;
        let centre = [1.0, latitude * DEGREE];
        let outline = ImageOutline::new(none, centre, Some(radius_rad)).unwrap();
        let region = outline.widened(0.0, 0.0);
        let at = direction(centre);
        let east = direction([1.0 + FRAC_PI_2, 0.0]);
        for step in 0..360 {
            let (sin, cos) = (f64::from(step) * DEGREE).sin_cos();
            let edge = at + (east * cos + at.cross(&east) * sin) * (0.999_999 * radius_rad).tan();
            let [longitude, latitude] = place(&edge);
            assert!(region.contains(longitude, latitude), "{centre:?} {step}");
        }
    }
}

/// Mars and the height of the spacecraft.
const RADIUS_M: f64 = 3_389_500.0;
const HEIGHT_M: f64 = 380_000.0;

#[test]
fn rays_converge_where_they_do() {
    // A sphere so large that it is flat: 45° to either side.
    let sight = |side: f64| Sight {
        centre_rad: [0.0, 0.0],
        below_rad: [side * 400e3 / 1e9, 0.0],
        altitude_m: 400e3,
    };
    let angle = convergence_rad(&sight(1.0), &sight(-1.0), 1e9);
    // Curvature: 400 km of 10^9 m.
    assert!((angle - FRAC_PI_2).abs() < 1e-3);
    // On a sphere: the law of sines in the triangle of its centre, the ground and the spacecraft.
    let away_rad = 2.0 * DEGREE;
    let sight = |[longitude, latitude]: [f64; 2], below_rad| Sight {
        centre_rad: [longitude * DEGREE, latitude * DEGREE],
        below_rad,
        altitude_m: HEIGHT_M,
    };
    let slant_m = direction([away_rad, 0.0]) * (RADIUS_M + HEIGHT_M) - Vector3::x() * RADIUS_M;
    let emission = ((RADIUS_M + HEIGHT_M) * away_rad.sin() / slant_m.norm()).asin();
    let oblique = sight([0.0, 0.0], [away_rad, 0.0]);
    let nadir = sight([0.0, 0.0], [0.0, 0.0]);
    // Rounding.
    assert!((convergence_rad(&oblique, &nadir, RADIUS_M) - emission).abs() < 1e-9);
}

#[test]
fn nadir_images_shifted_along_the_track_do_not_converge() {
    let sight = |place_deg: [f64; 2]| {
        let place_rad = place_deg.map(|angle| angle * DEGREE);
        Sight {
            centre_rad: place_rad,
            below_rad: place_rad,
            altitude_m: HEIGHT_M,
        }
    };
    for [one, other] in [
        [[50.0, 10.0], [50.1, 10.6]],
        [[10.0, 89.6], [170.0, 89.7]],
        [[0.0, -89.0], [90.0, -89.0]],
    ] {
        let angle = convergence_rad(&sight(one), &sight(other), RADIUS_M);
        assert!(angle < 1e-7, "{angle}");
    }
    // And two with the same forward look along one track over the pole.
    let forward = |north_deg: f64| {
        let at = |colatitude_deg: f64| {
            let longitude = if colatitude_deg > 0.0 { 0.3 } else { 0.3 + PI };
            [longitude, FRAC_PI_2 - colatitude_deg.abs() * DEGREE]
        };
        Sight {
            centre_rad: at(north_deg),
            below_rad: at(north_deg + 2.0),
            altitude_m: HEIGHT_M,
        }
    };
    assert!(convergence_rad(&forward(-1.0), &forward(0.4), RADIUS_M) < 1e-6);
}
