//! The boresight of the laser over many sites, and positions of further sites with it.

use areograph::{
    config::{BoresightOfSite, BoresightStatements, LaserMounting},
    geom::boresight::{PooledBoresight, pooled},
    scene::{Roughness, SceneErrors},
};
use serde_json::Value;

use super::{
    common::{case::Case, long_test},
    flown::{Plan, Site, flown},
    root_mean_square,
};

const FIRST_SEED: u32 = 220_000;
const PRIOR_RAD: f64 = 1e-4;
const KEYS: &str = "common_bus = \"yes\"\n";
/// Missions of a group that state the boresight, and further ones that use it; three sites each.
const STATING: u32 = 5;
const FURTHER: u32 = 2;
/// True angles towards X and Y of the bus in each group, radians; the last is beyond the a priori standard deviation.
const TRUTHS: [[f64; 2]; 5] = [
    [-4e-5, 9e-5],
    [1.1e-4, -6e-5],
    [-1.5e-4, 1.2e-4],
    [2e-5, -1.6e-4],
    [0.0, 5e-4],
];
const ERRORS: [fn(&mut SceneErrors); 5] = [
    |errors| errors.altimeter.boresight_rad = Some(TRUTHS[0]),
    |errors| errors.altimeter.boresight_rad = Some(TRUTHS[1]),
    |errors| errors.altimeter.boresight_rad = Some(TRUTHS[2]),
    |errors| errors.altimeter.boresight_rad = Some(TRUTHS[3]),
    |errors| errors.altimeter.boresight_rad = Some(TRUTHS[4]),
];

fn plan(group: usize, mission: u32, files: fn(&Case, u32)) -> Plan<'static> {
    let grounds = [Roughness::Medium, Roughness::Rough, Roughness::Plains];
    Plan {
        keys: KEYS,
        errors: ERRORS[group],
        files,
        passes: 12,
        ties_at_shots: true,
        ..Plan::drawn(
            FIRST_SEED + 100 * u32::try_from(group).unwrap() + mission,
            grounds[mission as usize % 3],
            0.3,
        )
    }
}

fn numbers<const N: usize>(of: &Value) -> [f64; N] {
    let numbers: Vec<f64> = of
        .as_array()
        .unwrap()
        .iter()
        .map(|of| of.as_f64().unwrap())
        .collect();
    numbers.try_into().unwrap()
}

/// What the valid sites state; images and orbits of different missions have the same names.
fn statements(sites: &[Site]) -> BoresightStatements {
    let mut statements = BoresightStatements {
        prior_sigma_rad: PRIOR_RAD,
        mountings: Vec::new(),
        sites: Vec::new(),
    };
    for site in sites.iter().filter(|site| site.is_valid()) {
        let Some(stated) = &site.stated else { continue };
        let found = &stated.adjustment["boresight"];
        let Some(information) = found.get("information") else {
            continue;
        };
        for image in found["images"].as_array().unwrap() {
            statements.mountings.push(LaserMounting {
                spacecraft: "MARS GLOBAL SURVEYOR".to_owned(),
                camera: "moc_na".to_owned(),
                beam: numbers(&image["beam"]),
            });
        }
        statements.sites.push(BoresightOfSite {
            site: site.name.clone(),
            images: vec![site.name.clone()],
            orbits: vec![site.name.clone()],
            matrix: numbers(&information["matrix"]),
            vector: numbers(&information["vector"]),
        });
    }
    statements.mountings.truncate(1);
    statements
}

fn estimate(statements: &BoresightStatements) -> PooledBoresight {
    let sites = statements.sites.iter().map(BoresightOfSite::information);
    pooled(&sites.collect::<Vec<_>>(), PRIOR_RAD)
}

/// Errors of the mean towards east over their standard deviations, and these, of the valid sites.
fn east(sites: &[Site]) -> Vec<[f64; 2]> {
    let valid = sites.iter().filter(|site| site.is_valid());
    let stated = valid.filter_map(|site| site.stated.as_ref());
    let east = stated.map(|of| [of.judged.mean_m().x, of.judged.mean_sigmas_m.x]);
    east.collect()
}

/// The statements that the site files of a mission name: of the group of its seed.
fn name_statements(case: &Case, seed: u32) {
    let path = std::env::temp_dir().join(format!("areograph-boresight-{}", std::process::id()));
    let group = (seed - FIRST_SEED) / 100;
    let text = std::fs::read_to_string(path.join(format!("{group}.toml"))).unwrap();
    case.write("sites/boresight.toml", text);
    for site in super::SITES {
        let path = format!("sites/{site}.toml");
        let text = String::from_utf8(case.read(&path)).unwrap();
        let with = format!("{KEYS}boresight = \"boresight.toml\"\n");
        case.write(&path, text.replacen(KEYS, &with, 1));
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn sites_together_determine_the_boresight_and_others_use_it() {
    if !long_test("the boresight by 75 sites, and 30 others that use it, 10 minutes") {
        return;
    }
    let files = std::env::temp_dir().join(format!("areograph-boresight-{}", std::process::id()));
    std::fs::create_dir_all(&files).unwrap();
    let (mut ratios, mut scatters) = (Vec::new(), Vec::new());
    let (mut without, mut with) = (Vec::new(), Vec::new());
    for (group, truth) in TRUTHS.iter().enumerate() {
        let plans: Vec<_> = (0..STATING).map(|of| plan(group, of, |_, _| {})).collect();
        let statements = statements(&flown(&plans));
        let found = estimate(&statements);
        let (angles, sigmas) = (found.angles.angles_rad, found.angles.sigmas_rad());
        println!(
            "group {group}: {} sites, true {:?} mrad, found {:.3} ± {:.3}, {:.3} ± {:.3} mrad; scatter {:.2} ({:.1}), left out {:?}, beyond {:?}",
            statements.sites.len(),
            truth.map(|of| 1e3 * of),
            1e3 * angles[0],
            1e3 * sigmas[0],
            1e3 * angles[1],
            1e3 * sigmas[1],
            found.scatter,
            found.freedom,
            found.contradicting,
            found.contradicts_prior,
        );
        let off = (angles[1] - truth[1]) / sigmas[1];
        assert!(off.abs() < 3.0, "{group}: {off}");
        assert!(
            sigmas[1] < 0.9 * PRIOR_RAD || found.contradicts_prior[1],
            "{sigmas:?}"
        );
        ratios.push(off);
        scatters.push(found.scatter);
        std::fs::write(files.join(format!("{group}.toml")), statements.to_toml()).unwrap();
        let missions = 50..50 + FURTHER;
        let plain: Vec<_> = missions
            .clone()
            .map(|of| plan(group, of, |_, _| {}))
            .collect();
        let known: Vec<_> = missions
            .map(|of| plan(group, of, name_statements))
            .collect();
        let [plain, known] = [plain, known].map(|plans| east(&flown(&plans)));
        for (name, sites) in [("without", &plain), ("with", &known)] {
            println!("group {group}, {name}: {sites:.1?}");
        }
        // Mounted beyond the a priori standard deviation: only the other sites show it.
        if group == TRUTHS.len() - 1 {
            assert_eq!(found.contradicts_prior, [false, true]);
            let [before_m, after_m] = [&plain, &known].map(|sites| rms_m(sites));
            println!("beyond: {before_m:.1} m without, {after_m:.1} m with");
            assert!(after_m < 0.8 * before_m, "{before_m} {after_m}");
        }
        without.extend(plain);
        with.extend(known);
    }
    std::fs::remove_dir_all(files).unwrap();
    let ratio = root_mean_square(ratios.iter().copied());
    let scatter = root_mean_square(scatters.iter().copied());
    println!(
        "across: {ratio:.2}, scatter {scatter:.2}; east without {:.1} m ({:.2}), with {:.1} m ({:.2})",
        rms_m(&without),
        normalised(&without),
        rms_m(&with),
        normalised(&with)
    );
    // Some 85 degrees of freedom: chance gives 0.80 to 1.20 in 99 of 100 cases.
    assert!((0.8..1.25).contains(&scatter), "{scatter}");
    // Sites of a mission share the angle: their errors are not independent.
    assert!(
        (0.6..1.35).contains(&normalised(&with)),
        "{}",
        normalised(&with)
    );
}

fn rms_m(sites: &[[f64; 2]]) -> f64 {
    root_mean_square(sites.iter().map(|of| of[0]))
}

fn normalised(sites: &[[f64; 2]]) -> f64 {
    root_mean_square(sites.iter().map(|of| of[0] / of[1]))
}
