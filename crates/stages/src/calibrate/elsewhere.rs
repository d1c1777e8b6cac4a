//! Tests of a calibration by other orbits, which are independent of it.

use super::result::{CameraResult, ControlOffset, PointKind, ValidationResult};
use crate::judge::{Check, CheckKind, CheckOutcome};

/// A figure of control may worsen by this many standard deviations of measurement and laser.
const WORSE_MAX: f64 = 3.0;
/// The control of another orbit may be off on average by this many standard deviations of one of its points. The mean
/// itself is far better known: constant errors of two orbits may differ by this much, and no point separates them from
/// an error of the control that determined the calibration.
pub(super) const OFFSET_MAX: f64 = 1.5;
/// The limit also allows this many standard deviations of the calibration itself.
pub(super) const CALIBRATION_SIGMAS: f64 = 3.0;
/// Growth of tie residuals above which a remark states it.
const TIES_WORSE: f64 = 1.05;
/// Remaining share of an error of control above which a remark states it.
const CONTROL_KEPT: f64 = 0.9;

/// Figures of control in another orbit from the noise of measurement and laser only, metres: root mean squares.
#[derive(Clone, Copy)]
pub(super) struct Noise {
    /// In the plane.
    pub(super) plane_m: Option<f64>,
    /// In height; `None` where no point is in two cameras.
    pub(super) height_m: Option<f64>,
}

/// A figure of control without and with the calibration, and its noise from measurement and laser, metres.
struct Compared {
    what: String,
    before_m: f64,
    after_m: f64,
    noise_m: f64,
}

/// Results of other orbits.
#[derive(Default)]
pub(super) struct Elsewhere {
    pub(super) reasons: Vec<String>,
    pub(super) remarks: Vec<String>,
    /// Checks of every figure of control in every orbit.
    pub(super) checks: Vec<Check>,
    /// Checks of every mean offset.
    pub(super) offsets: Vec<Check>,
}

/// Compares every orbit without the calibration and with it.
///
/// * `noise` – of every orbit
pub(super) fn elsewhere(
    validation: &[ValidationResult],
    noise: &[Noise],
    cameras: &[CameraResult],
) -> Elsewhere {
    let mut found = Elsewhere::default();
    for (orbit, noise) in validation.iter().zip(noise) {
        found.remarks.extend(ties(orbit, cameras));
        let mut is_worse = false;
        for compared in control(orbit, *noise, cameras, &mut found.remarks) {
            found.checks.push(compared.check(&orbit.orbit));
            is_worse |= compared.reason().is_some();
            match compared.reason() {
                Some(reason) => found
                    .reasons
                    .push(format!("orbit {}: {reason}", orbit.orbit)),
                None if compared.is_kept() => found.remarks.push(format!(
                    "orbit {}: {}, no significant improvement",
                    orbit.orbit,
                    compared.words()
                )),
                None => {}
            }
        }
        found.offsets.extend(
            orbit
                .offsets
                .iter()
                .map(|offset| offset.check(&orbit.orbit)),
        );
        if !is_worse {
            let reasons = orbit.offsets.iter().filter_map(ControlOffset::reason);
            let reasons = reasons.map(|reason| format!("orbit {}: {reason}", orbit.orbit));
            found.reasons.extend(reasons);
        }
    }
    found
}

impl ControlOffset {
    fn words(&self) -> String {
        self.camera.as_ref().map_or_else(
            || "in height".to_owned(),
            |camera| format!("in plan (camera {camera})"),
        )
    }

    fn check(&self, orbit: &str) -> Check {
        let subject = format!("{orbit}: control {}", self.words());
        let [sigmas, limit] = [self.offset_m, self.limit_m].map(|of| of / self.point_sigma_m);
        Check::new(
            CheckKind::OtherOrbitsOffset,
            subject,
            sigmas,
            limit,
            CheckOutcome::Fail,
        )
    }

    fn reason(&self) -> Option<String> {
        // Written so that NaN counts.
        (!(self.offset_m <= self.limit_m)).then(|| {
            format!(
                "the mean offset of control {} is {:.0} m ± {:.0} m with the calibration; expected at most {:.0} m \
                 (root sum of squares of {OFFSET_MAX} standard deviations of one point and {CALIBRATION_SIGMAS} of the \
                 calibration): the laser points of the two orbits, or the orbits themselves, contradict each other; \
                 check the datum and reference sphere of the laser points of both orbits",
                self.words(),
                self.offset_m,
                self.mean_sigma_m,
                self.limit_m
            )
        })
    }
}

/// Tie points that the calibration makes worse.
fn ties(orbit: &ValidationResult, cameras: &[CameraResult]) -> Vec<String> {
    let mut worse = Vec::new();
    let [before, after] = [&orbit.before, &orbit.after].map(|of| &of.ties.cameras_px);
    for (camera, (before, after)) in cameras.iter().zip(before.iter().zip(after)) {
        for (what, axis) in [("across", 0), ("along", 1)] {
            if let Some((before, after)) = before[axis].zip(after[axis])
                && after > TIES_WORSE * before
            {
                worse.push(format!(
                    "orbit {}: tie-point residuals {what} the flight in camera {} are {before:.2} px without the \
                     calibration and {after:.2} px with it (root mean square)",
                    orbit.orbit, camera.camera
                ));
            }
        }
    }
    worse
}

/// The figures of control; missing ones become remarks.
fn control(
    orbit: &ValidationResult,
    noise: Noise,
    cameras: &[CameraResult],
    remarks: &mut Vec<String>,
) -> Vec<Compared> {
    let [before, after] = [&orbit.before, &orbit.after].map(|of| of.of(PointKind::Control));
    let Some((before, after)) = before.zip(after) else {
        remarks.push(format!(
            "orbit {}: no control points for validation",
            orbit.orbit
        ));
        return Vec::new();
    };
    let mut all = Vec::new();
    let figures = before.cameras.iter().zip(&after.cameras).zip(cameras);
    let figures = figures.map(|((before, after), camera)| {
        let what = format!("control in plan (camera {})", camera.camera);
        (what, [before.plane_m, after.plane_m, noise.plane_m])
    });
    let height = [before.height_m, after.height_m, noise.height_m];
    let height = ("control in height".to_owned(), height);
    for (what, [before_m, after_m, noise_m]) in figures.chain([height]) {
        let (Some(before_m), Some(after_m), Some(noise_m)) = (before_m, after_m, noise_m) else {
            remarks.push(format!("orbit {}: no values for {what}", orbit.orbit));
            continue;
        };
        all.push(Compared {
            what,
            before_m,
            after_m,
            noise_m,
        });
    }
    all
}

impl Compared {
    fn words(&self) -> String {
        format!(
            "{} is off by {:.0} m without the calibration and {:.0} m with it (root mean square)",
            self.what, self.before_m, self.after_m
        )
    }

    fn is_kept(&self) -> bool {
        self.after_m > CONTROL_KEPT * self.before_m && self.after_m > WORSE_MAX * self.noise_m
    }

    /// Deterioration by the calibration, in standard deviations of measurement and laser.
    fn worse_sigmas(&self) -> f64 {
        let squares = self.after_m * self.after_m - self.before_m * self.before_m;
        squares.max(0.0).sqrt() / self.noise_m
    }

    fn check(&self, orbit: &str) -> Check {
        let (kind, subject) = (CheckKind::OtherOrbits, format!("{orbit}: {}", self.what));
        Check::new(
            kind,
            subject,
            self.worse_sigmas(),
            WORSE_MAX,
            CheckOutcome::Fail,
        )
    }

    fn reason(&self) -> Option<String> {
        // Written so that NaN counts.
        (!(self.worse_sigmas() <= WORSE_MAX)).then(|| {
            format!(
                "{}, a deterioration of more than {WORSE_MAX} standard deviations of measurement and laser: the orbits \
                 differ in their errors by more than the calibration improves, or the laser points are wrong: check the datum, epoch, lines and \
                 samples of the laser points of both orbits",
                self.words()
            )
        })
    }
}
