//! The verdict on a calibration.

use super::{
    elsewhere::{Noise, elsewhere},
    result::{
        CalibrationStep, CameraResult, HeldBack, PointKind, Scatter, Scattered, ValidationResult,
    },
};
use crate::{
    config::CalibrationMode,
    geom::{calibration::TieSight, statistics::unit_weight_limits},
    stages::judge::{Check, CheckKind, CheckOutcome::Fail, Verdict},
};

/// What control misses over what is expected: beyond, standard deviations are not true.
const SCATTER_MAX: f64 = 1.5;
/// Below, they are larger than they need be.
const SCATTER_MIN: f64 = 0.6;
/// Residuals of ties, pixels, beyond which the lines do not see one ground.
const TIES_MAX_PX: f64 = 1.0;
/// Share of points that may be left out.
const LEFT_OUT_MAX: f64 = 0.1;
/// A calibration moves the image by at most so many standard deviations of what was known beforehand.
const MOVED_MAX: f64 = 3.0;
/// What the support data may leave of the look directions, pixels, without a word.
const ISD_LEFT_PX: f64 = 0.5;

/// What is known of a calibration when it is judged.
pub(super) struct Evidence<'a> {
    pub(super) mode: CalibrationMode,
    pub(super) steps: &'a [CalibrationStep],
    pub(super) used: Option<Scatter>,
    pub(super) held_back: Option<&'a HeldBack>,
    pub(super) cameras: &'a [CameraResult],
    pub(super) sight: &'a TieSight,
    pub(super) validation: &'a [ValidationResult],
    /// What measurement and laser alone make of each.
    pub(super) validation_noise: &'a [Noise],
    /// Points, and those that were left out: ties, then control.
    pub(super) left_out: [[usize; 2]; 2],
    /// What was known beforehand.
    pub(super) known: Known,
    /// What support data say of the body's frame.
    pub(super) of_frames: Vec<String>,
    pub(super) complaints: u64,
}

/// By how much orbit and attitude as known beforehand let things move, one standard deviation.
#[derive(Clone, Copy)]
pub(super) struct Known {
    /// The image, pixels.
    pub(super) image_px: f64,
    /// The ground, metres along an axis.
    pub(super) ground_m: f64,
}

pub(super) fn judge(of: &Evidence<'_>) -> Verdict {
    let mut reasons = Vec::new();
    match of.held_back {
        None => reasons.push(format!(
            "no laser control: nothing tells where the camera looks, nor how well ties tell the rest; not seen by ties: {}",
            of.sight.unseen_words()
        )),
        Some(held_back) => {
            let scatters = scatters(of);
            let scattered = scatters.iter().filter_map(Judged::reason);
            reasons.extend(scattered);
            if reasons.is_empty() {
                reasons.extend(coarse(held_back, of.known));
            }
        }
    }
    if let Some(last) = of.steps.last() {
        match last.figures.ties.worst_px() {
            Some(worst_px) if worst_px <= TIES_MAX_PX => {}
            Some(worst_px) => reasons.push(format!(
                "tie points miss each other by {worst_px:.2} px (root mean square); expected at most {TIES_MAX_PX} px"
            )),
            None => reasons.push("no tie point is left in a camera".to_owned()),
        }
    }
    for (what, [all, left_out]) in ["tie", "control"].iter().zip(of.left_out) {
        if left_out as f64 > LEFT_OUT_MAX * all as f64 {
            reasons.push(format!(
                "{left_out} of {all} {what} points were left out; expected a tenth at most"
            ));
        }
    }
    for camera in of.cameras {
        if !(camera.moved_px <= MOVED_MAX * of.known.image_px) {
            reasons.push(format!(
                "camera {} is moved by {:.0} px; expected at most {:.0} px, {MOVED_MAX} standard deviations of orbit and \
                 attitude beforehand",
                camera.camera,
                camera.moved_px,
                MOVED_MAX * of.known.image_px
            ));
        }
    }
    let elsewhere = elsewhere(of.validation, of.validation_noise, of.cameras);
    reasons.extend(elsewhere.reasons);
    let mut remarks = remarks(of);
    remarks.extend(elsewhere.remarks);
    let mut checks = checks(of);
    checks.extend(Check::worst(elsewhere.checks.into_iter()));
    Verdict::of(reasons, remarks, checks)
}

/// What control misses in the plane or in height, used or held back, and what it may.
struct Judged {
    kind: CheckKind,
    /// In words.
    what: &'static str,
    found: Scattered,
    limit: f64,
}

impl Judged {
    /// Why standard deviations are not true, if they are not.
    fn reason(&self) -> Option<String> {
        let Self {
            what, found, limit, ..
        } = self;
        // Written so that NaN is a reason.
        (!(found.sigmas <= *limit)).then(|| {
            format!(
                "{what} {:.2} times as far as expected (root mean square); expected at most {limit:.2} times: standard deviations are too \
                 small, or something else than the camera is wrong",
                found.sigmas
            )
        })
    }
}

fn scatters(of: &Evidence<'_>) -> Vec<Judged> {
    let judged = |kind, what, found: Option<Scattered>| {
        let found = found?;
        // Few coordinates scatter more by chance. Hundredths are what is printed.
        let [_, by_chance] = unit_weight_limits(found.coordinates)?;
        Some(Judged {
            kind,
            what,
            found,
            limit: SCATTER_MAX.max((100.0 * by_chance).ceil() / 100.0),
        })
    };
    let held_back = of.held_back.map(|of| of.scatter);
    let both = |of: Option<Scatter>| of.map_or((None, None), |of| (of.plane, of.height));
    let [(plane, height), (held_plane, held_height)] = [of.used, held_back].map(both);
    [
        judged(
            CheckKind::HeldBackPlane,
            "control that was held back is off in the plane",
            held_plane,
        ),
        judged(
            CheckKind::HeldBackHeight,
            "control that was held back is off in height",
            held_height,
        ),
        judged(
            CheckKind::ControlPlane,
            "control that was used is off in the plane",
            plane,
        ),
        judged(
            CheckKind::ControlHeight,
            "control that was used is off in height",
            height,
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn checks(of: &Evidence<'_>) -> Vec<Check> {
    let check = |kind, found: f64, limit: f64| Check::new(kind, "", found, limit, Fail);
    let mut checks = Vec::new();
    match of.held_back {
        None => checks.push(Check::told(
            CheckKind::HeldBackPlane,
            "no laser control",
            Fail,
        )),
        Some(held_back) => {
            let scatters = scatters(of).into_iter();
            checks.extend(
                scatters.map(|judged| check(judged.kind, judged.found.sigmas, judged.limit)),
            );
            let known_m = of.known.ground_m;
            let plane = held_back.accuracy_plane_m.map(|found_m| {
                let known_m = std::f64::consts::SQRT_2 * known_m;
                check(CheckKind::PlaceKnown, found_m, known_m)
            });
            let height = held_back.accuracy_height_m;
            let height = height.map(|found_m| check(CheckKind::HeightKnown, found_m, known_m));
            checks.extend(plane.into_iter().chain(height));
        }
    }
    let ties = of
        .steps
        .last()
        .and_then(|last| last.figures.ties.worst_px());
    checks.extend(ties.map(|worst_px| check(CheckKind::LinesAgree, worst_px, TIES_MAX_PX)));
    let kinds = [CheckKind::TiesLeftOut, CheckKind::ControlLeftOut];
    for (kind, [all, left_out]) in kinds.into_iter().zip(of.left_out) {
        let share = left_out as f64 / all.max(1) as f64;
        checks.push(Check::of_share(kind, "", share, LEFT_OUT_MAX, Fail));
    }
    let limit_px = MOVED_MAX * of.known.image_px;
    checks.extend(Check::worst(of.cameras.iter().map(|camera| {
        Check::new(
            CheckKind::CameraMoved,
            &*camera.camera,
            camera.moved_px,
            limit_px,
            Fail,
        )
    })));
    checks
}

/// Why the ground is not known better than beforehand, if it is not.
fn coarse(held_back: &HeldBack, known: Known) -> Option<String> {
    let Some((plane_m, height_m)) = held_back.accuracy_plane_m.zip(held_back.accuracy_height_m)
    else {
        return Some("no tie point has a place with a standard deviation".to_owned());
    };
    if held_back.intersected == 0 {
        return Some(
            "no laser point that was held back is in two cameras: nothing judges places and heights; expected laser points in \
             two cameras or more"
                .to_owned(),
        );
    }
    let better = plane_m < std::f64::consts::SQRT_2 * known.ground_m && height_m < known.ground_m;
    (!better).then(|| {
        format!(
            "a tie point is known to {plane_m:.0} m in the plane and {height_m:.0} m in height, where orbit and attitude \
             beforehand leave {:.0} m an axis: the laser control is too coarse, too little or too far away to tell where the \
             camera looks",
            known.ground_m
        )
    })
}

fn remarks(of: &Evidence<'_>) -> Vec<String> {
    let mut remarks = of.of_frames.clone();
    let mut say = |when: bool, text: String| {
        if when {
            remarks.push(text);
        }
    };
    say(
        of.mode == CalibrationMode::AsPublished,
        format!(
            "all angles were freed by ties alone, as published: {} combinations of them are not seen ({}), and a difference \
             of scale is taken for a common pitch; the step after the ties may lie far off",
            of.sight.unseen,
            of.sight.unseen_words()
        ),
    );
    for [all, left_out] in of.left_out {
        say(
            left_out > 0,
            format!("points left out: {left_out} of {all}"),
        );
    }
    say(
        of.held_back.is_some_and(|held_back| {
            let Scatter { plane, height } = held_back.scatter;
            let both = [plane, height].into_iter().flatten();
            both.clone().next().is_some() && both.into_iter().all(|of| of.sigmas < SCATTER_MIN)
        }),
        "control that was held back fits better than its standard deviations say: they may be smaller".to_owned(),
    );
    for camera in of.cameras {
        say(
            camera.isd_left_px > ISD_LEFT_PX,
            format!(
                "the calibrated support data of camera {} leave {:.2} px of its look directions, which bend: a straight line \
                 of equal samples is all that they hold",
                camera.camera, camera.isd_left_px
            ),
        );
    }
    if let Some(judged) = of
        .steps
        .last()
        .and_then(|last| last.figures.of(PointKind::HeldBack))
    {
        for (camera, figures) in of.cameras.iter().zip(&judged.cameras) {
            say(
                figures.plane_px.is_none(),
                format!(
                    "no laser point that was held back is in camera {}: tie points alone judge where it looks",
                    camera.camera
                ),
            );
        }
    }
    say(
        of.complaints > 0,
        format!("rows and points left out, with reasons: {}", of.complaints),
    );
    remarks
}
