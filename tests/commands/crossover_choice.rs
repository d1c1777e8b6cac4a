//! The radius of the ground: after the crossover correction of the files, or before it, by one key for the whole run.
#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests read their own products and may fail loudly"
)]

use crate::common::{case::Case, json};

use areograph::pds::pedr::{LABEL_BYTES, Record};

/// The pair over Isidis with the residuals of one profile raised by so many metres: its heights fall by as much.
fn raised(residual_m: i32) -> Case {
    let case = Case::pair();
    let bytes = case.read("pedr/ap19117l.b");
    let (label, records) = bytes.split_at(LABEL_BYTES);
    let mut records = Record::slice_of(records).to_vec();
    for record in &mut records {
        let residual_cm = record.crossover_residual_cm.get();
        record
            .crossover_residual_cm
            .set(residual_cm + 100 * residual_m);
    }
    let mut bytes = label.to_vec();
    bytes.extend(records.iter().flat_map(Record::to_bytes));
    case.write("pedr/ap19117l.b", bytes);
    case
}

/// Outcome of a run of `case` with the radius that `choice` names, and by how many standard deviations its profiles disagree.
fn run(case: &Case, choice: &str) -> (String, f64) {
    case.replace(
        "site.toml",
        "[pedr]\n",
        &format!("[pedr]\ncrossover = \"{choice}\"\n"),
    );
    let outcome = case.outcome(case.run());
    let document = json(&case.path("out/isidis/registration.json"));
    assert_eq!(document["ground_radius"], choice);
    let manifest = json(&case.path("out/isidis/manifest.json"));
    let checks = manifest["verdict"]["checks"].as_array().unwrap();
    let apart = checks.iter().find(|of| of["kind"] == "profiles_apart");
    (outcome, apart.unwrap()["value"].as_f64().unwrap())
}

#[test]
fn profiles_that_crossovers_put_apart_are_noticed_where_their_radii_are_used() {
    let (sound, sigmas) = run(&Case::pair(), "corrected");
    assert!(
        sound.starts_with("exit 0\n") && sigmas.abs() < 1.0,
        "{sound}"
    );
    // The height of the other profile, 18° off nadir, is known to 65 to 80 m.
    let (_, sigmas) = run(&raised(200), "corrected");
    assert!(sigmas.abs() > 2.0, "{sigmas}");
    let (apart, _) = run(&raised(400), "corrected");
    assert!(
        apart.starts_with("exit 5\nisidis: INVALID; ") && apart.contains("profiles"),
        "{apart}"
    );
    // Before the correction the profiles lie where they did.
    let (raw, sigmas) = run(&raised(400), "raw");
    assert!(raw.starts_with("exit 0\n") && sigmas.abs() < 1.0, "{raw}");
}

#[test]
fn another_radius_is_refused() {
    let case = Case::pair();
    case.replace("site.toml", "[pedr]\n", "[pedr]\ncrossover = \"both\"\n");
    let refused = case.outcome(case.run());
    assert!(
        refused.starts_with("exit 2\n")
            && refused.contains("pedr.crossover is \"both\"; expected one of corrected, raw"),
        "{refused}"
    );
}
