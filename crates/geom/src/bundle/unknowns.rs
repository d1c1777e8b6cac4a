//! Columns of the unknowns of images and profiles in the reduced equations.

use std::{fmt, ops::Range};

use nalgebra::{DVector, Vector3};

use super::{
    CommonBus, CommonPass, Network, ORIENTATION_UNKNOWNS, Part, SharedRotation,
    common_pass::CONSTANTS,
};
use crate::{boresight::BoresightAngles, pushbroom::OrientationCorrection};
use areograph_base::units::METRES_PER_KM;

/// An unknown that is shared by many observations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Unknown {
    /// Coefficient of the correction to an image's orientation at `3·quantity + power`, quantities X, Y, Z and
    /// the rotations about the camera's x, y and z axis.
    Orientation {
        /// Index of the image.
        image: usize,
        /// `3·quantity + power`.
        coefficient: usize,
    },
    /// Bias of the line times of an image.
    TimeBias {
        /// Index of the image.
        image: usize,
    },
    /// Bias of the ranges of a profile.
    RangeBias {
        /// Index of the profile.
        profile: usize,
    },
    /// Offset of the attitude clock, common to all images.
    AttitudeClock,
    /// Offset of a profile's recorded position from its true one, towards east, north or up.
    ProfileShift {
        /// Index of the profile.
        profile: usize,
        /// 0 east, 1 north, 2 up.
        axis: usize,
    },
    /// Delay of the line times of an image against the laser's shots.
    LineTime {
        /// Index of the image.
        image: usize,
    },
    /// An angle between the laser's actual pointing and its mounting.
    Boresight {
        /// 0 or 1.
        axis: usize,
    },
}

/// Coefficient of the constant rotation about the camera's x axis.
pub(super) const CONSTANT_ROLL: usize = 9;
/// Names of the corrected quantities of an orientation.
const QUANTITIES: [&str; 6] = [
    "X position",
    "Y position",
    "Z position",
    "rotation about the camera's x axis",
    "rotation about the camera's y axis",
    "rotation about the camera's z axis",
];
/// Names of the powers of `t`.
const POWERS: [&str; 3] = ["constant", "linear", "quadratic"];

impl Unknown {
    /// Name of the unknown within its image or profile.
    #[must_use]
    pub fn quantity(self) -> String {
        match self {
            Self::Orientation { coefficient, .. } => {
                let quantity = QUANTITIES[coefficient / 3 % QUANTITIES.len()];
                format!("{} {quantity}", POWERS[coefficient % 3])
            }
            Self::TimeBias { .. } => "time bias".to_owned(),
            Self::RangeBias { .. } => "range bias".to_owned(),
            Self::AttitudeClock => "attitude clock offset".to_owned(),
            Self::ProfileShift { axis, .. } => {
                format!("shift {}", ["east", "north", "up"][axis % 3])
            }
            Self::LineTime { .. } => "line-time offset relative to the laser".to_owned(),
            Self::Boresight { axis } => {
                format!(
                    "{} boresight angle of the laser",
                    ["first", "second"][axis % 2]
                )
            }
        }
    }

    /// The image or profile that it belongs to.
    #[must_use]
    pub const fn part(self) -> Part {
        match self {
            Self::Orientation { image, .. }
            | Self::TimeBias { image }
            | Self::LineTime { image } => Part::Image(image),
            Self::RangeBias { profile } | Self::ProfileShift { profile, .. } => {
                Part::Profile(profile)
            }
            Self::AttitudeClock | Self::Boresight { .. } => Part::Images,
        }
    }
}

impl fmt::Display for Unknown {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} of {}", self.quantity(), self.part())
    }
}

pub(super) fn names(unknowns: &[Unknown]) -> String {
    let names: Vec<String> = unknowns.iter().map(Unknown::to_string).collect();
    names.join(", ")
}

impl Unknown {
    /// The change of this unknown that is comparable to a kilometre, a radian or a second.
    pub(super) fn step_unit(self) -> f64 {
        match self {
            Self::Orientation { coefficient, .. } if coefficient < 9 => METRES_PER_KM,
            Self::RangeBias { .. } | Self::ProfileShift { .. } => METRES_PER_KM,
            Self::Orientation { .. }
            | Self::TimeBias { .. }
            | Self::LineTime { .. }
            | Self::AttitudeClock
            | Self::Boresight { .. } => 1.0,
        }
    }
}

/// Whether the initial value of an unknown with this standard deviation has a weight: it is neither fixed nor free.
pub(super) fn is_weighted(sigma: f64) -> bool {
    sigma > 0.0 && sigma.is_finite()
}

/// The unknowns that are solved for, in column order, and their standard deviations.
pub(super) struct Columns {
    pub(super) unknowns: Vec<Unknown>,
    pub(super) sigmas: Vec<f64>,
    /// Their expected values.
    pub(super) expected: Vec<f64>,
    /// The unknowns whose multiples are added to the expected value of each, by their columns, and the factors.
    pub(super) follows: Vec<Vec<(usize, f64)>>,
    /// Column of each image's 18 coefficients and its time bias.
    pub(super) of_image: Vec<[Option<usize>; ORIENTATION_UNKNOWNS + 1]>,
    /// All columns of each image; they are adjacent.
    pub(super) images: Vec<Range<usize>>,
    /// Columns that are adjacent because they belong to one image or profile.
    pub(super) blocks: Vec<Range<usize>>,
    /// Column of the delay of each image's line times.
    pub(super) line_time_of_image: Vec<Option<usize>>,
    /// Column of each profile's bias.
    pub(super) of_profile: Vec<Option<usize>>,
    /// Columns of each profile's shift.
    pub(super) shift_of_profile: Vec<[Option<usize>; 3]>,
    /// All columns of each profile.
    pub(super) profiles: Vec<Range<usize>>,
    /// Column of the attitude clock offset.
    pub(super) attitude_clock: Option<usize>,
    /// Columns of the boresight angles of the laser.
    pub(super) boresight: [Option<usize>; 2],
}

impl Columns {
    pub(super) fn of<M>(network: &Network<M>) -> Self {
        let mut columns = Self {
            unknowns: Vec::new(),
            sigmas: Vec::new(),
            expected: Vec::new(),
            follows: Vec::new(),
            of_image: Vec::new(),
            images: Vec::new(),
            blocks: Vec::new(),
            line_time_of_image: Vec::new(),
            of_profile: Vec::new(),
            shift_of_profile: Vec::new(),
            profiles: Vec::new(),
            attitude_clock: None,
            boresight: [None; 2],
        };
        let bus = network.common_bus.as_ref();
        for (image, entry) in network.images.iter().enumerate() {
            let first = columns.len();
            let mut of_image = [None; ORIENTATION_UNKNOWNS + 1];
            for (coefficient, sigma) in entry.sigmas.iter().enumerate() {
                of_image[coefficient] =
                    columns.add(Unknown::Orientation { image, coefficient }, *sigma);
            }
            let expected_m = network.expected_m.get(image).into_iter().flatten();
            for (constant, expected_m) in of_image.iter().step_by(3).zip(expected_m) {
                if let Some(column) = constant {
                    columns.expected[*column] = *expected_m;
                }
            }
            of_image[ORIENTATION_UNKNOWNS] =
                columns.add(Unknown::TimeBias { image }, entry.time_bias_sigma_s);
            columns.of_image.push(of_image);
            let with_spots =
                bus.filter(|bus| bus.spots.iter().any(|spot| spot.view.image == image));
            let line_time_s = with_spots.map_or(0.0, |bus| bus.line_time_sigma_s);
            let line_time = columns.add(Unknown::LineTime { image }, line_time_s);
            columns.line_time_of_image.push(line_time);
            columns.images.push(first..columns.len());
        }
        for pass in &network.passes {
            columns.add_pass(pass);
        }
        for (profile, sigma_m) in network.range_bias_sigmas_m.iter().enumerate() {
            let first = columns.len();
            let column = columns.add(Unknown::RangeBias { profile }, *sigma_m);
            columns.of_profile.push(column);
            let sigma_m = bus.map_or_else(Vector3::zeros, |bus| bus.profiles[profile].sigma_m);
            let shift = |axis| Unknown::ProfileShift { profile, axis };
            let shift = [0, 1, 2].map(|axis| columns.add(shift(axis), sigma_m[axis]));
            let shared = bus.and_then(|bus| bus.profiles[profile].shared);
            columns.follow(&shift, shared);
            columns.shift_of_profile.push(shift);
            columns.profiles.push(first..columns.len());
        }
        let clock = network.attitude_clock.as_ref();
        columns.attitude_clock =
            clock.and_then(|clock| columns.add(Unknown::AttitudeClock, clock.sigma_s));
        let first = columns.len();
        if let Some(bus) = bus {
            columns.add_boresight(&bus.boresight);
        }
        let clock = columns.attitude_clock.map(|column| column..column + 1);
        let blocks = columns.images.iter().chain(&columns.profiles).cloned();
        let blocks = blocks
            .chain(clock)
            .chain(std::iter::once(first..columns.len()));
        columns.blocks = blocks.filter(|block| !block.is_empty()).collect();
        columns
    }

    fn add(&mut self, unknown: Unknown, sigma: f64) -> Option<usize> {
        // A standard deviation of 0 holds the unknown fixed: it has no column at all.
        (sigma > 0.0).then(|| {
            self.unknowns.push(unknown);
            self.sigmas.push(sigma);
            self.expected.push(0.0);
            self.follows.push(Vec::new());
            self.unknowns.len() - 1
        })
    }

    /// The constant unknowns of the images of a pass follow those of the images before them.
    fn add_pass(&mut self, pass: &CommonPass) {
        let constants = pass.images.iter().flat_map(|image| {
            let of_image = &self.of_image[*image];
            (0..CONSTANTS).map(move |constant| of_image[3 * constant])
        });
        let weighted = constants.enumerate().filter_map(|(at, column)| {
            let column = column.filter(|column| is_weighted(self.sigmas[*column]));
            Some((at, column?))
        });
        let (places, columns): (Vec<usize>, Vec<usize>) = weighted.unzip();
        let expected: Vec<f64> = columns
            .iter()
            .map(|column| self.expected[*column])
            .collect();
        for (column, following) in columns.iter().zip(pass.following(&places)) {
            self.sigmas[*column] = following.sigma;
            for (before, factor) in following.of {
                self.expected[*column] -= factor * expected[before];
                self.follows[*column].push((columns[before], factor));
            }
        }
    }

    /// Adds the boresight angles; the a priori value of the second follows the first by their covariance.
    fn add_boresight(&mut self, prior: &BoresightAngles) {
        let variances = &prior.covariance_rad2;
        let first = self.add(Unknown::Boresight { axis: 0 }, variances[(0, 0)].sqrt());
        let factor = if first.is_some() {
            variances[(0, 1)] / variances[(0, 0)]
        } else {
            0.0
        };
        let left = variances[(1, 1)] - factor * variances[(0, 1)];
        let second = self.add(Unknown::Boresight { axis: 1 }, left.sqrt());
        if let Some(first) = first {
            self.expected[first] = prior.angles_rad[0];
        }
        if let Some(second) = second {
            self.expected[second] = prior.angles_rad[1] - factor * prior.angles_rad[0];
            let followed = first.filter(|_| factor != 0.0);
            self.follows[second] = followed.map(|of| (of, factor)).into_iter().collect();
        }
        self.boresight = [first, second];
    }

    /// The shift of a profile with these columns follows the rotation of an image, where that is an unknown.
    fn follow(&mut self, shift: &[Option<usize>; 3], shared: Option<SharedRotation>) {
        let Some(shared) = shared else {
            return;
        };
        let Some(rotation) = self.of_image[shared.image][CONSTANT_ROLL] else {
            return;
        };
        for (column, by_rotation_m) in shift.iter().zip(&shared.by_rotation_m) {
            if let Some(column) = column {
                self.follows[*column] = vec![(rotation, *by_rotation_m)];
            }
        }
    }

    /// Terms of the difference between an unknown and its expected value: columns and their factors.
    pub(super) fn prior_terms(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        let followed = self.follows[column].iter();
        let followed = followed.map(|(other, factor)| (*other, -factor));
        std::iter::once((column, 1.0)).chain(followed)
    }

    /// Difference between an unknown and its expected value.
    pub(super) fn off_prior(&self, corrections: &DVector<f64>, column: usize) -> f64 {
        let terms = self.prior_terms(column);
        let sum: f64 = terms
            .map(|(other, factor)| factor * corrections[other])
            .sum();
        sum - self.expected[column]
    }

    /// Pairs of blocks, ascending, that the difference of an unknown from its expected value connects.
    pub(super) fn connected_blocks(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        (0..self.len()).flat_map(move |column| {
            let blocks = move || {
                let terms = self.prior_terms(column);
                terms.map(move |(column, _)| self.block_of(column))
            };
            blocks().flat_map(move |one| {
                let later = blocks().filter(move |two| one < *two);
                later.map(move |two| [one, two])
            })
        })
    }

    pub(super) fn len(&self) -> usize {
        self.unknowns.len()
    }

    /// The shifts of profiles that `bus` makes unknowns: indices on the surface, and columns.
    pub(super) fn shifts_on_surface(&self, bus: &CommonBus) -> Vec<(usize, [Option<usize>; 3])> {
        let profiles = bus.profiles.iter().zip(&self.shift_of_profile);
        profiles
            .map(|(profile, columns)| (profile.surface_profile, *columns))
            .collect()
    }

    /// The block of a column.
    pub(super) fn block_of(&self, column: usize) -> usize {
        self.blocks.partition_point(|block| block.end <= column)
    }
}

/// Values of all unknowns.
#[derive(Clone)]
pub(super) struct State {
    /// Shared unknowns minus their initial values, by column.
    pub(super) corrections: DVector<f64>,
    pub(super) orientations: Vec<OrientationCorrection>,
    pub(super) range_biases_m: Vec<f64>,
    /// Offset of each profile's recorded position from its true one, Mars-fixed.
    pub(super) profile_shifts_m: Vec<Vector3<f64>>,
    pub(super) line_times_s: Vec<f64>,
    pub(super) boresight_rad: [f64; 2],
    pub(super) points_m: Vec<Vector3<f64>>,
}

impl State {
    /// The state with these corrections of shared unknowns and these points.
    pub(super) fn new<M>(
        network: &Network<M>,
        columns: &Columns,
        corrections: DVector<f64>,
        points_m: Vec<Vector3<f64>>,
    ) -> Self {
        let value = |column: Option<usize>| column.map_or(0.0, |column| corrections[column]);
        let images = network.images.iter().zip(&columns.of_image).enumerate();
        let orientations = images.map(|(index, (image, of_image))| {
            let coefficients = std::array::from_fn(|coefficient| value(of_image[coefficient]));
            let time_bias_s = value(of_image[ORIENTATION_UNKNOWNS]);
            let mut correction = OrientationCorrection::of(
                &coefficients,
                image.half_lines,
                time_bias_s / image.line_period_s,
            );
            if let Some(clock) = &network.attitude_clock {
                correction.rotation_rad[0] +=
                    clock.turns_rad_s[index] * value(columns.attitude_clock);
            }
            correction
        });
        Self {
            orientations: orientations.collect(),
            profile_shifts_m: network
                .common_bus
                .iter()
                .flat_map(|bus| bus.profiles.iter().zip(&columns.shift_of_profile))
                .map(|(profile, shift)| profile.axes.tr_mul(&Vector3::from(shift.map(value))))
                .collect(),
            line_times_s: columns
                .line_time_of_image
                .iter()
                .map(|column| value(*column))
                .collect(),
            boresight_rad: network.common_bus.as_ref().map_or([0.0; 2], |bus| {
                let held: [f64; 2] = bus.boresight.angles_rad.into();
                [0, 1].map(|axis| columns.boresight[axis].map_or(held[axis], |of| corrections[of]))
            }),
            range_biases_m: columns
                .of_profile
                .iter()
                .map(|column| value(*column))
                .collect(),
            corrections,
            points_m,
        }
    }
}
