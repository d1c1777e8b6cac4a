//! Parts of the uncertainty of a position: missions with the errors of one cause alone show them as large as stated.

use areograph::scene::{Misregistration, PositionErrors, Roughness, SceneErrors};
use nalgebra::Vector3;

use super::{
    SITES,
    common::long,
    flown::{Plan, Sizes, Stated, flown},
    is_within, root_mean_square, vector,
};

const FIRST_SEED: u32 = 210_000;
/// Missions of a cause, each of three sites.
const MISSIONS: [usize; 2] = [1, 8];
const AXES: [&str; 3] = ["east", "north", "height"];

/// Errors of the images: orbit, attitude and line times.
fn no_orientations(errors: &mut SceneErrors) {
    errors.misregistration = Misregistration::LineTimes { sigma_lines: 0.0 };
    errors.position = PositionErrors::Bus {
        sigma_radial_along_cross_m: [0.0; 3],
    };
    let attitude = &mut errors.attitude;
    attitude.constant_sigma_rad = [0.0; 3];
    attitude.linear_sigma_rad = 0.0;
    attitude.quadratic_sigma_rad = 0.0;
    attitude.jitter.sinusoids = 0;
}

fn no_profiles(errors: &mut SceneErrors) {
    errors.altimeter.plan_sigma_m = 0.0;
    errors.altimeter.radial_sigma_m = 0.0;
}

fn no_boresight(errors: &mut SceneErrors) {
    errors.altimeter.boresight_sigma_rad = 0.0;
}

/// Tie points and shots almost without errors; the adjustment expects larger ones.
fn no_noise(errors: &mut SceneErrors) {
    errors.tie_noise_factor = 0.05;
    errors.altimeter.shot_noise_m = 0.05;
    errors.altimeter.spot_m = 0.0;
}

/// A cause of errors, the members of the parts that state it, and the axes on which its part is large enough to be seen.
struct Cause {
    name: &'static str,
    parts: &'static [&'static str],
    axes: &'static [usize],
    keys: &'static str,
    errors: fn(&mut SceneErrors),
}

const CAUSES: [Cause; 4] = [
    Cause {
        name: "orbit, attitude and line times",
        parts: &["orientations_m"],
        axes: &[0, 1],
        keys: "relief_for_plan = \"no\"\n",
        errors: |errors| {
            no_profiles(errors);
            no_boresight(errors);
            no_noise(errors);
        },
    },
    Cause {
        name: "boresight of the laser",
        parts: &["boresight_m"],
        axes: &[0],
        keys: "common_bus = \"yes\"\nrelief_for_plan = \"no\"\n",
        errors: |errors| {
            no_orientations(errors);
            no_profiles(errors);
            no_noise(errors);
        },
    },
    Cause {
        name: "shifts of profiles",
        parts: &["profiles_m"],
        axes: &[0],
        keys: "common_bus = \"yes\"\nrelief_for_plan = \"no\"\n",
        errors: |errors| {
            no_orientations(errors);
            no_boresight(errors);
            no_noise(errors);
        },
    },
    Cause {
        name: "ground between shots, tie points and shots",
        parts: &["ground_m", "observations_m"],
        axes: &[2],
        keys: "relief_for_plan = \"no\"\n",
        errors: |errors| {
            no_orientations(errors);
            no_profiles(errors);
            no_boresight(errors);
        },
    },
];

/// The standard deviations of some parts together, metres.
fn stated_m(site: &Stated, parts: &[&str]) -> Vector3<f64> {
    let all = &site.adjustment["heights"]["mean_sigma_parts"];
    let squares = parts
        .iter()
        .map(|part| vector(&all[*part]).map(|of| of * of));
    squares.sum::<Vector3<f64>>().map(f64::sqrt)
}

/// Parts add up to the whole, to rounding. A rest below zero is stated as zero, and their sum would then exceed the whole.
fn is_whole(site: &Stated) {
    let all = site.adjustment["heights"]["mean_sigma_parts"]
        .as_object()
        .unwrap();
    let names: Vec<&str> = all.keys().map(String::as_str).collect();
    let (sum_m, whole_m) = (stated_m(site, &names), site.judged.mean_sigmas_m);
    for axis in 0..3 {
        let share = sum_m[axis] / whole_m[axis];
        // Rounding of the rest, a difference.
        assert!(
            (share - 1.0).abs() < 1e-6,
            "{}: {axis} {share}",
            site.judged.name
        );
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn errors_of_one_cause_alone_are_as_large_as_their_part() {
    let missions = MISSIONS[usize::from(long())];
    let seeds = (0..).zip(&CAUSES).flat_map(|(number, cause)| {
        let seeds = (FIRST_SEED + 100 * number..).take(missions);
        seeds.map(move |seed| (seed, cause))
    });
    let plans: Vec<Plan<'_>> = seeds
        .map(|(seed, cause)| Plan {
            seed,
            ground: Roughness::Medium,
            noise_px: 0.5,
            sizes: Sizes::Cited,
            pairs: 1,
            passes: 0,
            ties_at_shots: false,
            keys: cause.keys,
            errors: cause.errors,
            files: |_, _| {},
            sites: &SITES,
            may_be_refused: false,
        })
        .collect();
    let all = flown(&plans);
    for (cause, of_cause) in CAUSES.iter().zip(all.chunks(SITES.len() * missions)) {
        let sites: Vec<&Stated> = of_cause
            .iter()
            .filter_map(|site| site.stated.as_ref())
            .collect();
        assert!(
            sites.len() >= 2 * missions,
            "{}: {}",
            cause.name,
            sites.len()
        );
        for site in &sites {
            is_whole(site);
        }
        for (axis, name) in AXES.into_iter().enumerate() {
            let rms = |of: &dyn Fn(&Stated) -> f64| {
                let all: Vec<f64> = sites.iter().map(|site| of(site)).collect();
                root_mean_square(all.into_iter())
            };
            let error_m = rms(&|site| site.judged.mean_m()[axis]);
            let part_m = rms(&|site| stated_m(site, cause.parts)[axis]);
            let whole_m = rms(&|site| site.judged.mean_sigmas_m[axis]);
            let ratio = rms(&|site| site.judged.mean_m()[axis] / stated_m(site, cause.parts)[axis]);
            println!(
                "{}, {}: {error_m:.1} m, stated {part_m:.1} m of {whole_m:.1} m in all; ratio {ratio:.2} of {} sites",
                cause.name,
                name,
                sites.len()
            );
            if cause.axes.contains(&axis) {
                // Of boresight, one value a mission; of the others, one a site.
                let count = if cause.parts[0] == "boresight_m" {
                    missions
                } else {
                    sites.len()
                };
                assert!(
                    is_within(ratio, [0.6, 1.4], count),
                    "{}: {axis} {ratio}",
                    cause.name
                );
            }
        }
    }
}
