//! The three stereo pairs from first principles: tie points, shots, and images whose clocks are off.

use std::sync::LazyLock;

use areograph::geom::{
    bundle::{Adjustment, BundleOptions, solve},
    pushbroom::EulerPolynomial,
    statistics::Summary,
};
use nalgebra::Vector3;

use super::{
    recipe::{
        self, Recipe, Simulated, adjusted_orientation, line_spacing_m, mola_shift_lines,
        mola_shift_px, reprojection,
    },
    scene::{GROUND_RADIUS_M, ORBIT_RADIUS_M, Scene},
    table_2::{Printed, TABLE_2},
};

/// A site's pair, the image that looks down first.
pub(crate) struct Pair {
    pub(crate) simulated: Simulated<EulerPolynomial>,
    /// Whether the papers call the image that looks down their first.
    nadir_first: bool,
}

/// What becomes of a pair by the adjustment.
pub(crate) struct Adjusted {
    pub(crate) pair: Pair,
    pub(crate) adjustment: Adjustment,
}

/// Moments along and across the track of each image, in the papers' order and with their sense of y.
pub(crate) type Moments = [[Summary; 2]; 2];

/// Which site.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Site {
    Eos,
    Gusev,
    Isidis,
}

impl Site {
    /// Columns of Table 2: the image that looks down, the other; and whether the former comes first.
    const fn columns(self) -> ([usize; 2], bool) {
        match self {
            Self::Eos => ([0, 1], true),
            Self::Gusev => ([2, 3], true),
            Self::Isidis => ([5, 4], false),
        }
    }

    /// Mean residuals along the track in Table 5, of the image that looks down and of the other, lines.
    const fn disagreement_lines(self) -> [f64; 2] {
        match self {
            Self::Eos => [-33.82, 20.52],
            Self::Gusev => [-26.25, 23.55],
            Self::Isidis => [-25.48, 34.29],
        }
    }

    /// Tie points of Table 5.
    const fn ties(self) -> usize {
        match self {
            Self::Eos => 162,
            Self::Gusev => 154,
            Self::Isidis => 41,
        }
    }

    /// Both images; the second looks from the west at the place of the first, its emission angle taken at the ground.
    pub(crate) fn scenes(self) -> [Scene; 2] {
        let [nadir, oblique] = self.columns().0.map(|column| &TABLE_2[column]);
        let below = nadir.scene();
        [below, off_nadir(oblique, &below)]
    }

    /// Ties alone, measured with a line's noise in images whose clocks are off by Table 5; ten times as many as there,
    /// so that chance counts less.
    pub(crate) fn intersected(self) -> Pair {
        let recipe = Recipe {
            ties: 10 * self.ties(),
            shots: [0; 2],
            mola_views: 0,
            tie_noise: 1.0,
            ..Recipe::EXACT
        };
        pair(recipe, self)
    }

    /// The recipe of the adjustment with shots, ties and all errors.
    pub(crate) fn adjusted(self) -> &'static Adjusted {
        static ALL: [LazyLock<Adjusted>; 3] = [
            LazyLock::new(|| adjusted(Site::Eos, 1)),
            LazyLock::new(|| adjusted(Site::Gusev, 1)),
            LazyLock::new(|| adjusted(Site::Isidis, 1)),
        ];
        &ALL[self as usize]
    }

    /// The same with ten times as many ties, so that chance counts less in their residuals.
    pub(crate) fn adjusted_with_many_ties(self) -> Adjusted {
        adjusted(self, 10)
    }
}

fn pair(recipe: Recipe, site: Site) -> Pair {
    let recipe = Recipe {
        shift_lines: site.disagreement_lines(),
        ..recipe
    };
    Pair {
        simulated: recipe.simulate_pair(site.scenes(), |scene| scene.euler(2)),
        nadir_first: site.columns().1,
    }
}

fn adjusted(site: Site, times: usize) -> Adjusted {
    let shots = site
        .columns()
        .0
        .map(|column| TABLE_2[column].shots.parse().unwrap());
    let recipe = Recipe {
        ties: times * site.ties(),
        shots,
        mola_views: usize::MAX,
        ..Recipe::GUSEV
    };
    let pair = pair(recipe, site);
    let adjustment = solve(&pair.simulated.network, &BundleOptions::default()).unwrap();
    Adjusted { pair, adjustment }
}

/// The orbit from which the image sees the middle of `below` under its emission angle.
fn off_nadir(image: &Printed, below: &Scene) -> Scene {
    let target_m = below.boresight_ground_m(0.0);
    let emission_rad = image.emission_deg.parse::<f64>().unwrap().to_radians();
    let look_rad = (GROUND_RADIUS_M / ORBIT_RADIUS_M * emission_rad.sin()).asin();
    let mut west_deg =
        (emission_rad - look_rad).to_degrees() / below.latitude_deg.to_radians().cos();
    let mut scene = image.scene();
    for _ in 0..6 {
        let placed = Scene {
            latitude_deg: below.latitude_deg,
            longitude_deg: below.longitude_deg - west_deg,
            ..scene
        };
        scene = recipe::held_on(placed, &target_m);
        let found_rad = (scene.pose(0.0).position_m - target_m).angle(&target_m);
        west_deg *= emission_rad / found_rad;
    }
    scene
}

impl Pair {
    /// In the papers' order of the images.
    pub(crate) fn ordered<T>(&self, of: impl Fn(usize) -> T) -> [T; 2] {
        if self.nadir_first {
            [of(0), of(1)]
        } else {
            [of(1), of(0)]
        }
    }

    /// Reprojection residuals of the ties as the images are told.
    pub(crate) fn residuals(&self) -> Moments {
        self.ordered(|image| {
            let base = &self.simulated.network.images[image].base;
            let points = &self.simulated.network.points;
            moments(reprojection(&self.simulated, image, base, |point| {
                points[point].ground_m
            }))
        })
    }

    /// Distance of two lines on the ground, metres.
    pub(crate) fn line_spacings_m(&self) -> [f64; 2] {
        self.ordered(|image| line_spacing_m(&self.simulated, image))
    }

    /// Size of a pixel on the ground in the middle of each image, in the papers' order, metres.
    pub(crate) fn pixels_m(&self) -> [f64; 2] {
        self.ordered(|image| {
            let scene = &self.simulated.scenes[image];
            let range_m = (scene.pose(0.0).position_m - scene.boresight_ground_m(0.0)).norm();
            range_m / scene.focal_length_px()
        })
    }
}

fn moments([lines, pixels]: [Vec<f64>; 2]) -> [Summary; 2] {
    // The papers' y runs with the samples, ours against them.
    let pixels: Vec<f64> = pixels.into_iter().map(|pixel| -pixel).collect();
    [Summary::of(&lines), Summary::of(&pixels)]
}

impl Adjusted {
    /// Reprojection residuals of the ties after the adjustment.
    pub(crate) fn residuals(&self) -> Moments {
        self.pair.ordered(|image| {
            let simulated = &self.pair.simulated;
            let orientation = adjusted_orientation(simulated, &self.adjustment, image);
            let ground = |point: usize| self.adjustment.points[point].unwrap().ground_m;
            moments(reprojection(simulated, image, &orientation, ground))
        })
    }

    /// Corrections of MOLA's image coordinates along the track, lines, and across it, pixels with the papers' sense of y; of
    /// both images each.
    pub(crate) fn footprints_moved(&self) -> [[Summary; 2]; 2] {
        let simulated = &self.pair.simulated;
        let along =
            (self.pair).ordered(|image| mola_shift_lines(simulated, &self.adjustment, image));
        let across = (self.pair)
            .ordered(|image| -> Vec<f64> { mola_shift_px(simulated, &self.adjustment, image) });
        // The papers' y runs with the samples, ours against them.
        let across = across.map(|shifts| {
            let shifts: Vec<f64> = shifts.into_iter().map(|shift| -shift).collect();
            Summary::of(&shifts)
        });
        [along, across]
    }

    /// Corrections of X, Y, Z of the shots, or else of the ties, metres.
    pub(crate) fn moved_m(&self, shots: bool) -> [Summary; 3] {
        let simulated = &self.pair.simulated;
        let points = self.points(shots);
        let moved: Vec<Vector3<f64>> = points
            .map(|point| {
                let adjusted = self.adjustment.points[point].unwrap().ground_m;
                adjusted - simulated.network.points[point].ground_m
            })
            .collect();
        [0, 1, 2].map(|axis| {
            let values: Vec<f64> = moved.iter().map(|vector| vector[axis]).collect();
            Summary::of(&values)
        })
    }

    /// Mean standard deviations of X, Y, Z of the shots, or else of the ties, after the adjustment with its σ0, metres.
    pub(crate) fn sigmas_m(&self, shots: bool) -> [f64; 3] {
        let points: Vec<usize> = self.points(shots).collect();
        [0, 1, 2].map(|axis| {
            let sum: f64 = points
                .iter()
                .map(|point| {
                    let cofactor = self.adjustment.points[*point].unwrap().cofactor_m2;
                    self.adjustment.sigma0() * cofactor[(axis, axis)].sqrt()
                })
                .sum();
            sum / points.len() as f64
        })
    }

    fn points(&self, shots: bool) -> std::ops::Range<usize> {
        let simulated = &self.pair.simulated;
        if shots {
            0..simulated.shots
        } else {
            simulated.shots..simulated.points_m.len()
        }
    }
}
