//! The verdict on a calibration.

use super::{
    elsewhere::{Noise, elsewhere},
    result::{
        CalibrationStep, CameraResult, HeldBack, PointKind, Scatter, Scattered, ValidationResult,
    },
};
use crate::judge::{Check, CheckKind, CheckOutcome::Fail, Verdict};
use areograph_config::CalibrationMode;
use areograph_geom::{calibration::TieSight, statistics::unit_weight_limits};

/// Largest acceptable scatter of control; beyond it, standard deviations are too small.
const SCATTER_MAX: f64 = 1.5;
/// Below this scatter, standard deviations are too large.
const SCATTER_MIN: f64 = 0.6;
/// Largest acceptable residual of tie points, pixels; beyond it, the lines do not agree.
const TIES_MAX_PX: f64 = 1.0;
/// Residuals of tie points above this many of their standard deviations are a remark.
const TIES_SIGMAS: f64 = 2.0;
/// Share of points that may be left out.
const LEFT_OUT_MAX: f64 = 0.1;
/// A calibration moves the image by at most this many a priori standard deviations.
const MOVED_MAX: f64 = 3.0;
/// Residual of the support data against the look directions, pixels, above which a remark states it.
const ISD_LEFT_PX: f64 = 0.5;

/// The evidence on which a calibration is judged.
pub(super) struct Evidence<'a> {
    pub(super) mode: CalibrationMode,
    pub(super) steps: &'a [CalibrationStep],
    pub(super) used: Option<Scatter>,
    pub(super) held_back: Option<&'a HeldBack>,
    pub(super) cameras: &'a [CameraResult],
    pub(super) sight: &'a TieSight,
    pub(super) validation: &'a [ValidationResult],
    /// Noise of measurement and laser in each.
    pub(super) validation_noise: &'a [Noise],
    /// Points, and those that were left out: ties, then control.
    pub(super) left_out: [[usize; 2]; 2],
    /// Errors that no point tests.
    pub(super) untested: Vec<String>,
    /// A priori knowledge.
    pub(super) known: Known,
    /// Median standard deviation of the measurements of tie points, pixels.
    pub(super) tie_sigma_px: f64,
    /// Remarks on the body's frame in the support data.
    pub(super) of_frames: Vec<String>,
    pub(super) complaints: u64,
}

/// Movements that the a priori orbit and attitude allow, one standard deviation.
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
            "no laser control: absolute pointing is not determined, and results from tie points are not validated; not \
             determined by tie points: {}",
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
                "residuals of tie points reach {worst_px:.2} px (root mean square per camera and axis); expected at \
                 most {TIES_MAX_PX} px"
            )),
            None => reasons.push("one camera has no usable tie points".to_owned()),
        }
    }
    for (what, [all, left_out]) in ["tie", "control"].iter().zip(of.left_out) {
        if left_out as f64 > LEFT_OUT_MAX * all as f64 {
            reasons.push(format!(
                "{left_out} of {all} {what} points were rejected; expected at most a tenth"
            ));
        }
    }
    for camera in of.cameras {
        if !(camera.moved_px <= MOVED_MAX * of.known.image_px) {
            reasons.push(format!(
                "the calibration changes look directions of camera {} by up to {:.0} px; expected at most {:.0} px, \
                 {MOVED_MAX} standard deviations of the a priori orbit and attitude",
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
    checks.extend(Check::worst(elsewhere.offsets.into_iter()));
    Verdict {
        untested: untested(of),
        ..Verdict::of(reasons, remarks, checks)
    }
}

/// Errors that no datum of the calibration shows.
fn untested(of: &Evidence<'_>) -> Vec<String> {
    let mut untested = vec![
        "an error in position or radius that the control of all orbits shares (no other control is available)".to_owned(),
        "a shift along the flight that all tie points of a line share (equivalent to an angle of the line)".to_owned(),
    ];
    let offsets = of.validation.iter().flat_map(|orbit| &orbit.offsets);
    let largest_m = |in_height: bool| {
        let of_kind = offsets
            .clone()
            .filter(|offset| offset.camera.is_none() == in_height);
        of_kind.map(|offset| offset.limit_m).reduce(f64::max)
    };
    if let Some((plane_m, height_m)) = largest_m(false).zip(largest_m(true)) {
        untested.push(format!(
            "an error of up to {plane_m:.0} m in plan and {height_m:.0} m in height in the control of the calibrated \
             orbit (control of other orbits reveals only larger errors)"
        ));
    }
    untested
}

/// Scatter of used or withheld control in plan or in height, and its limit.
struct Judged {
    kind: CheckKind,
    /// In words.
    what: &'static str,
    found: Scattered,
    limit: f64,
}

impl Judged {
    /// Why the scatter is too large, if it is.
    fn reason(&self) -> Option<String> {
        let Self {
            what, found, limit, ..
        } = self;
        // Written so that NaN is a reason.
        (!(found.sigmas <= *limit)).then(|| {
            format!(
                "{what} are {:.2} times as large as expected (root mean square); limit {limit:.2}: standard deviations \
                 are too small, or an error has a source other than the camera",
                found.sigmas
            )
        })
    }
}

fn scatters(of: &Evidence<'_>) -> Vec<Judged> {
    let judged = |kind, what, found: Option<Scattered>| {
        let found = found?;
        // Few coordinates scatter more by chance. The limit is rounded up to the reported hundredths.
        let [_, by_chance] = unit_weight_limits(found.coordinates)?;
        Some(Judged {
            kind,
            what,
            found,
            limit: SCATTER_MAX.max((100.0 * by_chance).ceil() / 100.0),
        })
    };
    let held_back = of.held_back.map(|held_back| held_back.scatter);
    let both = |of: Option<Scatter>| of.map_or((None, None), |of| (of.plane, of.height));
    let [(plane, height), (held_plane, held_height)] = [of.used, held_back].map(both);
    [
        judged(
            CheckKind::HeldBackPlane,
            "horizontal residuals of the withheld control",
            held_plane,
        ),
        judged(
            CheckKind::HeldBackHeight,
            "height residuals of the withheld control",
            held_height,
        ),
        judged(
            CheckKind::ControlPlane,
            "horizontal residuals of the control used",
            plane,
        ),
        judged(
            CheckKind::ControlHeight,
            "height residuals of the control used",
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
        None => checks.push(Check::without_number(
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

/// Reason why the accuracy on the ground does not exceed the a priori accuracy, if it does not.
fn coarse(held_back: &HeldBack, known: Known) -> Option<String> {
    let Some((plane_m, height_m)) = held_back.accuracy_plane_m.zip(held_back.accuracy_height_m)
    else {
        return Some("no tie point has a position with a standard deviation".to_owned());
    };
    if held_back.intersected == 0 {
        return Some(
            "no withheld laser point is in two cameras: positions and heights are not validated; expected laser points in \
             two cameras or more"
                .to_owned(),
        );
    }
    let better = plane_m < std::f64::consts::SQRT_2 * known.ground_m && height_m < known.ground_m;
    (!better).then(|| {
        format!(
            "the accuracy of tie points is {plane_m:.0} m in plan and {height_m:.0} m in height (root mean square), \
             compared with {:.0} m per axis from the a priori orbit and attitude: the laser control is too coarse, too \
             sparse or too far away to determine the pointing",
            known.ground_m
        )
    })
}

fn remarks(of: &Evidence<'_>) -> Vec<String> {
    let ties_px = of
        .steps
        .last()
        .and_then(|last| last.figures.ties.worst_px());
    let mut remarks = [&*of.of_frames, &*of.untested].concat();
    let mut say = |when: bool, text: String| {
        if when {
            remarks.push(text);
        }
    };
    say(
        of.mode == CalibrationMode::AsPublished,
        format!(
            "all angles are free in the tie-point step, as published: {} combinations of angles are not determined \
             ({}), and a difference in scale appears as a common pitch; values after this step may have large errors",
            of.sight.unseen,
            of.sight.unseen_words()
        ),
    );
    for [all, left_out] in of.left_out {
        say(
            left_out > 0,
            format!("points rejected: {left_out} of {all}"),
        );
    }
    let sigmas = ties_px.unwrap_or_default() / of.tie_sigma_px;
    say(
        sigmas > TIES_SIGMAS,
        format!(
            "residuals of tie points reach {sigmas:.1} times their standard deviations (root mean square per camera \
             and axis): the standard deviations are too small, and positions are less accurate than stated"
        ),
    );
    say(
        of.held_back.is_some_and(|held_back| {
            let Scatter { plane, height } = held_back.scatter;
            let both = [plane, height].into_iter().flatten();
            both.clone().next().is_some() && both.into_iter().all(|of| of.sigmas < SCATTER_MIN)
        }),
        "withheld control fits better than its standard deviations predict: these may be too large"
            .to_owned(),
    );
    for camera in of.cameras {
        say(
            camera.isd_left_px > ISD_LEFT_PX,
            format!(
                "the calibrated support data of camera {} deviate by up to {:.2} px from its look directions, which \
                 their distortion of third degree does not represent",
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
                    "no withheld laser point is in camera {}: only tie points validate its pointing",
                    camera.camera
                ),
            );
        }
    }
    say(
        of.complaints > 0,
        format!(
            "rows and points skipped or rejected, with reasons: {}",
            of.complaints
        ),
    );
    remarks
}
