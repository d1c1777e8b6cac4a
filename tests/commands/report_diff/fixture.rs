//! A case that has run, its products kept aside, and its C-kernel turned by a known angle.

use std::{fs, path::Path};

use areograph::{
    config::usual_instrument,
    frames::{J2000, Rotation, SpacecraftBus},
    geom::{
        attitude::{make_continuous, spice_quaternion},
        body_rotation::frame_rotation_1,
    },
    spice::{CkSegment, KernelSet, Session, write_ck},
    time::{Et, Interval, PointingBias},
    units::RADIANS_PER_ARCSECOND,
};

use crate::common::{self, case::Case};

/// By how much [`turn_attitudes`] turns the camera about its x axis.
pub(crate) const TURN_ARCSEC: f64 = 20.0;

/// A case that has run once, its products kept in `before/case`.
pub(crate) fn after_a_first_run() -> Case {
    let case = Case::new();
    // Light time depends on where the camera looks: without it a turned camera stays where it is.
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    case.write("site.toml", site + "[orientation]\nlight_time = \"none\"\n");
    case.stages_run();
    copy_products(&case.path("out/case"), &case.path("before/case"));
    case
}

/// Copies what was published; the cache stays behind.
pub(crate) fn copy_products(from: &Path, to: &Path) {
    for (relative, _) in common::mission::products(from) {
        let target = to.join(&relative);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::copy(from.join(&relative), target).unwrap();
    }
}

/// Exit code and everything printed by the command with these further arguments.
pub(crate) fn diff(case: &Case, arguments: &[&str]) -> String {
    let mut command = case.areograph();
    command.args(["--quiet", "report", "diff"]).args(arguments);
    case.outcome(command)
}

/// Replaces the case's C-kernel by a copy with every attitude turned about the camera's x axis.
pub(crate) fn turn_attitudes(case: &Case) {
    let path = case.path("kernels/mgs_sc_scene.bc");
    let turned = case.path("kernels/turned.bc");
    let kernels = KernelSet::from_metakernel(&case.path("kernels/nav.tm")).unwrap();
    let session = Session::open(&kernels).unwrap();
    let columns: Vec<_> = session
        .coverage()
        .unwrap()
        .ck
        .as_slice()
        .iter()
        .map(|interval| {
            // The scene's samples, 4 s apart: between them both kernels turn evenly.
            turned_attitudes(&session, *interval)
        })
        .collect();
    let segments: Vec<CkSegment> = columns
        .iter()
        .map(|(instants, quaternions, rates)| CkSegment {
            name: "turned",
            instants,
            quaternions,
            angular_velocities_rad_s: rates,
            interval_starts: &instants[..1],
        })
        .collect();
    write_ck(&turned, &session, &segments, "every attitude turned").unwrap();
    drop(session);
    fs::rename(turned, path).unwrap();
}

type Attitudes = (Vec<Et>, Vec<[f64; 4]>, Vec<[f64; 3]>);

/// Attitudes of an interval as the kernel counts time, turned; rates in J2000 stay as they are.
fn turned_attitudes(session: &Session, interval: Interval) -> Attitudes {
    let turn = frame_rotation_1(TURN_ARCSEC * RADIANS_PER_ARCSECOND);
    let unbiased = PointingBias::from_seconds(0.0);
    let (mut instants, mut quaternions, mut rates) = (Vec::new(), Vec::new(), Vec::new());
    // The last sample may be a rounding of the clock beyond the interval's end.
    let samples = (0..).map(|index| interval.start.plus(4.0 * f64::from(index)));
    for at in samples.take_while(|at| at.since(interval.stop) < 0.01) {
        let attitude = session.attitude(unbiased.lookup(at), at, 0.01).unwrap();
        let mounting = *session.mounting(usual_instrument(), at).unwrap().matrix();
        let turned = mounting.transpose() * turn * mounting * attitude.inertial_to_bus.matrix();
        let turned: Rotation<J2000, SpacecraftBus> = Rotation::new(turned, at);
        instants.push(at);
        quaternions.push(spice_quaternion(turned.matrix()));
        rates.push(attitude.angular_velocity_rad_s.into());
    }
    make_continuous(&mut quaternions);
    (instants, quaternions, rates)
}
