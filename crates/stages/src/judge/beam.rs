//! Verdict on the attitude of images: by the beam of a laser on the same bus, and by the place of its footprints.

use super::{
    Check, CheckKind,
    CheckOutcome::{self, Fail, Pass, Warning},
    Evidence,
};
use crate::check_beam::{Beam, ImageBeam};
use areograph_base::{constants::SPACECRAFT, minus::signed, terms::Terms, units::METRES_PER_KM};
use areograph_config::{AdjustmentConfig, MolaSurfaceConfig};
use areograph_geom::statistics::BAARDA_LIMIT;

/// Milliradians in a radian.
pub(super) const PER_MILLI: f64 = 1e3;
/// At least this share of the footprints that the mountings place in an image must lie in it.
const INSIDE_SHARE_MIN: f64 = 0.5;
/// Support data may contain apparent positions, up to this far from geometric ones, metres.
const APPARENT_M: f64 = 330.0;
/// Images whose middles are closer in time are of one pass, seconds: they share the error of the attitude and the profile.
const PASS_S: f64 = 600.0;
/// Where the position of the images follows from their attitude, the mean over passes is a remark beyond this many standard
/// deviations. A beam tests that attitude with half the standard deviation of the attitude itself: at this limit, an error of three
/// stated standard deviations of the position is found in nine of ten cases, and one site in eleven has such a remark by chance.
const POSITION_SIGMAS: f64 = 2.0;
/// Fewer expected footprints do not test an orientation.
const EXPECTED_MIN: u32 = 5;

/// The evidence of the laser's beam.
#[derive(Debug, Clone, Copy)]
pub struct BeamEvidence<'a> {
    /// The images with the orientation from the kernels.
    pub images: &'a [ImageBeam],
    /// A priori standard deviations of attitude and boresight.
    pub adjustment: &'a AdjustmentConfig,
    /// A priori standard deviation of the position of a profile in plan.
    pub surface: &'a MolaSurfaceConfig,
}

/// The two axes of the bus.
const AXES: [(CheckKind, &str); 2] = [
    (CheckKind::BeamAlong, "along the track"),
    (CheckKind::BeamAcross, "across the track"),
];

/// Number of images over which a mean is stated.
fn on_average(images: usize) -> String {
    format!("{images} images, on average")
}

/// A beam along one axis, of an image or on average over all, with its standard deviation.
struct Deviation {
    axis: usize,
    /// Images.
    subjects: Vec<String>,
    shots: u32,
    angle_rad: f64,
    sigma_rad: f64,
    range_m: f64,
}

impl Deviation {
    /// * `mean_sigmas` – limit of remarks on a mean over passes
    fn outcome(&self, limit_sigma: f64, mean_sigmas: f64) -> CheckOutcome {
        let sigmas = self.angle_rad.abs() / self.sigma_rad;
        let doubtful = if self.subjects.len() > 1 {
            mean_sigmas
        } else {
            BAARDA_LIMIT
        };
        // Written so that NaN counts.
        if !(sigmas <= limit_sigma) {
            Fail
        } else if !(sigmas <= doubtful) {
            Warning
        } else {
            Pass
        }
    }

    fn subject(&self) -> String {
        match &*self.subjects {
            [one] => one.clone(),
            all => on_average(all.len()),
        }
    }

    fn check(&self, limit_sigma: f64, mean_sigmas: f64) -> Check {
        let [angle, limit] =
            [self.angle_rad, limit_sigma * self.sigma_rad].map(|rad| PER_MILLI * rad);
        let kind = AXES[self.axis].0;
        let mut check = Check::new(kind, self.subject(), angle, limit, Fail);
        check.outcome = self.outcome(limit_sigma, mean_sigmas);
        check
    }

    /// One sentence; `limit` states the limit.
    fn text(&self, limit: &str, terms: &Terms<'_>) -> String {
        let (images, whose) = match &*self.subjects {
            [one] => (format!("image {one}"), "its orientation"),
            all => (on_average(all.len()), "the orientation of the images"),
        };
        let ground_m = self.angle_rad.abs() * self.range_m;
        let ground = if ground_m < METRES_PER_KM {
            format!("{ground_m:.0} m")
        } else {
            format!("{:.1} km", ground_m / METRES_PER_KM)
        };
        format!(
            "{images}: according to {whose}, the beam of {} in the {} deviates by {} mrad {} from its mounting \
             ({ground} on the ground, {} shots){limit}",
            terms.altimeter,
            terms.shot_source(),
            signed(PER_MILLI * self.angle_rad, 2),
            AXES[self.axis].1,
            self.shots
        )
    }
}

impl BeamEvidence<'_> {
    fn beams(&self) -> impl Iterator<Item = (&ImageBeam, &Beam)> {
        let images = self.images.iter();
        images.filter_map(|image| Some((image, image.beam.as_ref().ok()?)))
    }

    /// Whether the beam tests the attitude of the image with this identifier.
    pub(super) fn tests(&self, image: &str) -> bool {
        let tested = |(of, beam): (&ImageBeam, &Beam)| {
            of.image == image && self.own_sigmas_rad(of, beam).iter().all(|s| s.is_finite())
        };
        self.beams().any(tested)
    }

    /// Standard deviations along and across the track of the errors of a single image: its attitude and its profile in
    /// plan.
    fn own_sigmas_rad(&self, image: &ImageBeam, beam: &Beam) -> [f64; 2] {
        let own = self
            .adjustment
            .images
            .iter()
            .find(|of| of.id == image.image);
        let of_camera = own.and_then(|image| image.rotation_rad);
        // About Y of the camera the beam moves along the track, about X across it.
        // The beam tests images from the spacecraft of the laser only.
        let usual_rad = self.adjustment.rotation_sigma_rad(&SPACECRAFT)[0];
        let attitude_rad = of_camera.map_or([usual_rad; 2], |sigmas| [sigmas[3], sigmas[0]]);
        let plan_rad = self.surface.profile_plan_sigma_m / beam.range_m;
        attitude_rad.map(|rad| rad.hypot(plan_rad))
    }

    /// Standard deviations of the errors that all images share: the boresight, and along the track the clocks of
    /// attitude and altimeter.
    fn common_sigmas_rad(&self, turn_rad_s: f64, clock_s: f64) -> [f64; 2] {
        let boresight_rad = self.adjustment.boresight_sigma_rad;
        let attitude_s = if self.adjustment.attitude_clock {
            self.adjustment.attitude_clock_sigma_s
        } else {
            0.0
        };
        let clocks_rad = turn_rad_s * clock_s.hypot(attitude_s);
        [boresight_rad.hypot(clocks_rad), boresight_rad]
    }

    /// Images tested against the beam, grouped by pass.
    fn passes(&self) -> Vec<Vec<(&ImageBeam, &Beam)>> {
        let mut passes: Vec<Vec<(&ImageBeam, &Beam)>> = Vec::new();
        for (image, beam) in self.beams().filter(|(of, _)| self.tests(&of.image)) {
            let at_s = beam.middle_et_s;
            let mut known = passes.iter_mut();
            match known.find(|pass| (pass[0].1.middle_et_s - at_s).abs() <= PASS_S) {
                Some(pass) => pass.push((image, beam)),
                None => passes.push(vec![(image, beam)]),
            }
        }
        passes
    }

    /// Every image along both axes, then the mean of all passes.
    fn deviations(&self) -> Vec<Deviation> {
        let passes = self.passes();
        let count = passes.len() as f64;
        let mut deviations = Vec::new();
        for axis in 0..AXES.len() {
            let (mut variance, mut common_rad) = (0.0_f64, 0.0_f64);
            let mut mean = Deviation {
                axis,
                subjects: Vec::new(),
                shots: 0,
                angle_rad: 0.0,
                sigma_rad: 0.0,
                range_m: 0.0,
            };
            for pass in &passes {
                let share = 1.0 / (count * pass.len() as f64);
                let mut largest_rad = 0.0_f64;
                for (image, beam) in pass {
                    let own_rad = self.own_sigmas_rad(image, beam)[axis];
                    let shared_rad = self.common_sigmas_rad(beam.turn_rad_s, beam.clock_s)[axis];
                    largest_rad = largest_rad.max(own_rad);
                    common_rad = common_rad.max(shared_rad);
                    mean.subjects.push(image.image.clone());
                    mean.shots += beam.shots;
                    mean.angle_rad += share * beam.angles_rad[axis];
                    mean.range_m += share * beam.range_m;
                    deviations.push(Deviation {
                        axis,
                        subjects: vec![image.image.clone()],
                        shots: beam.shots,
                        angle_rad: beam.angles_rad[axis],
                        sigma_rad: own_rad.hypot(shared_rad),
                        range_m: beam.range_m,
                    });
                }
                variance += largest_rad * largest_rad;
            }
            if passes.len() > 1 {
                mean.sigma_rad = (variance.sqrt() / count).hypot(common_rad);
                deviations.push(mean);
            }
        }
        deviations
    }

    /// Largest angle that all images may share undetected: on each axis the limit in radians, and in metres on the
    /// ground.
    pub(super) fn unnoticed(&self, limit_sigma: f64) -> Vec<[f64; 2]> {
        let deviations = self.deviations();
        let on_axis = |axis: usize| {
            // The mean over passes comes last.
            let last = deviations
                .iter()
                .rfind(|deviation| deviation.axis == axis)?;
            let limit_rad = limit_sigma * last.sigma_rad;
            Some([limit_rad, limit_rad * last.range_m])
        };
        (0..AXES.len()).filter_map(on_axis).collect()
    }

    /// Largest error in the place of the shots of a single image that its limits leave undetected, metres.
    pub(super) fn unnoticed_of_one_m(&self, limit_sigma: f64) -> Option<f64> {
        let deviations = self.deviations();
        let limits_m = deviations
            .iter()
            .map(|of| limit_sigma * of.sigma_rad * of.range_m);
        limits_m.reduce(f64::max)
    }

    /// Images whose footprints test the orientation: image, footprints inside, the least number expected.
    fn places(&self) -> impl Iterator<Item = (&ImageBeam, &Beam, f64)> {
        let tested = self
            .beams()
            .filter(|(_, of)| of.expected_inside >= EXPECTED_MIN);
        tested.map(|(image, of)| {
            let least = (INSIDE_SHARE_MIN * f64::from(of.expected_inside)).ceil();
            (image, of, least)
        })
    }
}

/// Images of support data with the distance of their position from the spacecraft of the altimeter's file, metres, and
/// the limit.
fn support_positions<'a>(evidence: &'a Evidence<'_>) -> impl Iterator<Item = (&'a str, f64, f64)> {
    let limit_m = APPARENT_M + evidence.range_limits.orbit_max_m;
    let images = evidence.images.iter();
    let of_support = images.filter(|image| image.times.support.is_some());
    of_support.filter_map(move |image| {
        let mut beams = evidence.beam.beams();
        let (_, beam) = beams.find(|(of, _)| of.image == image.id())?;
        Some((image.id(), beam.apart_m, limit_m))
    })
}

/// Limit of remarks on a mean over passes, in standard deviations: a lower one if nothing but the attitude determines the position.
fn mean_sigmas(evidence: &Evidence<'_>) -> f64 {
    let rests_on_attitude = evidence.adjustment.is_some_and(|of| {
        let uses_relief = of.adjusted.relief.as_ref().is_some_and(|of| of.used);
        !uses_relief && !matches!(of.adjusted.boresight, Some(Ok(_)))
    });
    if rests_on_attitude {
        POSITION_SIGMAS
    } else {
        BAARDA_LIMIT
    }
}

pub(super) fn checks(evidence: &Evidence<'_>) -> Vec<Check> {
    let (beam, limit_sigma) = (&evidence.beam, evidence.limits.correction_max_sigma);
    let mean_sigmas = mean_sigmas(evidence);
    let deviations = beam.deviations();
    let of_axis = |axis: usize| {
        let such = deviations.iter().filter(|deviation| deviation.axis == axis);
        Check::worst(such.map(|deviation| deviation.check(limit_sigma, mean_sigmas)))
    };
    let inside = beam.places().map(|(image, of, least)| {
        let kind = CheckKind::FootprintsInside;
        Check::new(kind, &*image.image, f64::from(of.inside), least, Fail)
    });
    let meets = evidence.images.iter().map(|image| {
        let samples = &image.orientation.samples;
        let met = samples
            .iter()
            .filter(|sample| sample.boresight.is_some())
            .count();
        let broken = if met == 0 { Fail } else { Warning };
        let kind = CheckKind::BoresightMeets;
        Check::new(kind, image.id(), met as f64, samples.len() as f64, broken)
    });
    let positions = support_positions(evidence).map(|(image, apart_m, limit_m)| {
        Check::new(CheckKind::SupportPosition, image, apart_m, limit_m, Fail)
    });
    let all = [
        Check::worst(positions),
        of_axis(0),
        of_axis(1),
        Check::worst(inside),
        Check::worst(meets),
    ];
    all.into_iter().flatten().collect()
}

/// Attitudes that contradict the laser or miss the body, one sentence each.
pub(super) fn invalid_because(evidence: &Evidence<'_>) -> Vec<String> {
    let limit_sigma = evidence.limits.correction_max_sigma;
    let deviations = evidence.beam.deviations();
    let mean_sigmas = mean_sigmas(evidence);
    let far = deviations
        .iter()
        .filter(|deviation| deviation.outcome(limit_sigma, mean_sigmas) == Fail);
    let mut reasons: Vec<String> = far
        .map(|deviation| {
            let limit = PER_MILLI * limit_sigma * deviation.sigma_rad;
            deviation.text(
                &format!(
                "; expected at most {limit:.2} mrad; check the C-kernels, pointing.ck_bias_s and altimeter_clock, and \
                 check that the shots belong to this orbit"
                ),
                &evidence.terms,
            )
        })
        .collect();
    for (image, of, least) in evidence.beam.places() {
        if f64::from(of.inside) < least {
            reasons.push(format!(
                "image {}: its orientation places {} of {} simultaneous footprints inside, whereas the mountings of \
                 camera and laser place all of them inside; expected at least {least:.0}: check attitude, frames and \
                 times",
                image.image, of.inside, of.expected_inside
            ));
        }
    }
    let source = evidence.terms.shot_source();
    for (image, apart_m, limit_m) in support_positions(evidence) {
        // Written so that NaN counts.
        if !(apart_m <= limit_m) {
            reasons.push(format!(
                "image {image}: the spacecraft position in its support data differs by {apart_m:.0} m from the \
                 position in the {source}; expected at most {limit_m:.0} m; check that the support data belong to this \
                 image, and check their frame"
            ));
        }
    }
    let blind = evidence.images.iter().filter(|image| {
        let samples = &image.orientation.samples;
        samples.iter().all(|sample| sample.boresight.is_none())
    });
    reasons.extend(blind.map(|image| {
        format!(
            "image {}: its boresight misses the ellipsoid; check attitude and frames",
            image.id()
        )
    }));
    reasons
}

/// Points on the attitude that the reader must weigh, one sentence each.
pub(super) fn remarks(evidence: &Evidence<'_>) -> Vec<String> {
    let limit_sigma = evidence.limits.correction_max_sigma;
    let deviations = evidence.beam.deviations();
    let mean_sigmas = mean_sigmas(evidence);
    let doubtful = deviations
        .iter()
        .filter(|deviation| deviation.outcome(limit_sigma, mean_sigmas) == Warning);
    let mut remarks: Vec<String> = doubtful
        .map(|deviation| {
            let sigmas = deviation.angle_rad.abs() / deviation.sigma_rad;
            deviation.text(
                &format!(
                    ", {sigmas:.1} standard deviations: the position is less certain than stated"
                ),
                &evidence.terms,
            )
        })
        .collect();
    for image in evidence.images {
        let samples = &image.orientation.samples;
        let missed = samples
            .iter()
            .filter(|sample| sample.boresight.is_none())
            .count();
        if missed > 0 && missed < samples.len() {
            remarks.push(format!(
                "image {}: its boresight misses the ellipsoid at {missed} of {} epochs",
                image.id(),
                samples.len()
            ));
        }
    }
    remarks
}
