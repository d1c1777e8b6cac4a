//! The cause of along-track disagreements over ten pairs, decided by `compare-readings`: missions with independent line times and
//! attitudes of 0.26 to 0.5 mrad, and missions with one offset of the attitude clock and attitudes of 0.07 to 0.13 mrad.

use std::{fs, path::Path};

use areograph::geom::random::Random;
use serde_json::Value;

use super::{
    SITES,
    common::{
        long,
        mission::{areograph, succeed},
    },
    run, scene,
};

/// Groups of missions by each cause.
const GROUPS: u32 = 20;
const FIRST_SEED: u32 = 130_000;

/// Gives the images of a mission names of their own: an image that two sites name is one observation.
pub(super) fn rename_images(mission: &Path, number: u32) {
    for site in SITES {
        let path = mission.join(format!("sites/{site}.toml"));
        let text = fs::read_to_string(&path).unwrap();
        let mut names: Vec<&str> = text
            .lines()
            .filter_map(|line| line.strip_prefix("id = \"E"))
            .collect();
        names.retain(|name| name.ends_with('"'));
        let names: Vec<String> = names
            .iter()
            .map(|name| format!("E{}", name.trim_end_matches('"')))
            .collect();
        assert_eq!(names.len(), 2, "{text}");
        let ties_path = mission.join(format!("ties/{site}.csv"));
        let mut ties = fs::read_to_string(&ties_path).unwrap();
        let mut renamed = text.clone();
        for name in &names {
            renamed = renamed.replace(
                &format!("id = \"{name}\""),
                &format!("id = \"{name}-{number}\""),
            );
            ties = ties.replace(&format!(",{name},"), &format!(",{name}-{number},"));
        }
        fs::write(path, renamed).unwrap();
        fs::write(ties_path, ties).unwrap();
    }
}

/// The answer for `pairs` pairs of a group of missions, three pairs each, with this offset of the attitude clock, or with line times of
/// every image.
fn answer(group: u32, pairs: usize, clock_s: Option<f64>) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let mut options = vec!["--realistic".to_owned()];
    if let Some(clock_s) = clock_s {
        options.push("--attitude-clock".to_owned());
        options.push(format!("--attitude-clock-s={clock_s}"));
    }
    let options: Vec<&str> = options.iter().map(String::as_str).collect();
    let mut sites = Vec::new();
    let missions = u32::try_from(pairs.div_ceil(SITES.len())).unwrap();
    for number in 0..missions {
        let own = number + if clock_s.is_some() { 50 } else { 0 };
        let mission = scene(folder.path(), FIRST_SEED + 100 * group + own, &options);
        rename_images(&mission, number);
        let out = folder.path().join(format!("out-{number}"));
        let code = run(&mission, &out).output().unwrap().status.code();
        // 5: a site is invalid, for example by a misplaced profile. Its tie points are as good as those of others.
        assert!(matches!(code, Some(0 | 5)), "{code:?}");
        sites.extend(SITES.map(|site| out.join(site)));
    }
    let mut compare = areograph();
    compare
        .arg("compare-readings")
        .args(&sites[..pairs])
        .arg("--json");
    serde_json::from_slice(&succeed(&mut compare).stdout).unwrap()
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn pairs_decide_the_cause_of_their_disagreement() {
    // Six pairs of a group that decides by either cause, or ten of all groups.
    let (numbers, pairs) = if long() { (0..GROUPS, 10) } else { (1..2, 6) };
    let groups = u32::try_from(numbers.len()).unwrap();
    let (mut right, mut wrong, mut squares) = ([0; 2], [0_u32; 2], Vec::new());
    for group in numbers {
        let mut random = Random::new(u64::from(group), "attitude clock of a group");
        // As the scene draws it; in the short run, an offset that six pairs determine.
        let drawn_s = if long() { 0.73 * random.normal() } else { 1.0 };
        for (index, clock_s) in [None, Some(drawn_s)].into_iter().enumerate() {
            let answer = answer(group, pairs, clock_s);
            let causes = ["single_images", "attitude_clock"];
            let [found_s, sigma_s] = ["attitude_clock_s", "attitude_clock_sigma_s"]
                .map(|name| answer[name].as_f64().unwrap());
            println!(
                "{group} {} {clock_s:.3?}: {}, {:.1}, {found_s:.3} ± {sigma_s:.3} s",
                causes[index],
                answer["supported"],
                answer["log_odds_of_clock"].as_f64().unwrap()
            );
            assert_eq!(answer["pairs"].as_array().unwrap().len(), pairs);
            if answer["supported"] == causes[index] {
                right[index] += 1;
            } else if answer["supported"] != "undecided" {
                wrong[index] += 1;
            }
            if let Some(drawn_s) = clock_s {
                squares.push(((found_s - drawn_s) / sigma_s).powi(2));
            }
        }
    }
    println!("of {groups} by each cause, decided correctly {right:?}, wrongly {wrong:?}");
    assert_eq!(wrong, [0, 0]);
    // A small offset displaces by less than errors of single images.
    assert!(
        right.iter().all(|right| 10 * right >= 6 * groups),
        "{right:?}"
    );
    let ratio = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    println!("errors of the offset over stated standard deviations {ratio:.2}");
    assert!(
        super::is_within(ratio, [0.6, 1.4], squares.len()),
        "{ratio}"
    );
}
