//! Images that disagree because the clock of the attitude is off: read so, places come right, and a run that reads it
//! otherwise tells what this reading says.

use std::{fs, ops::RangeInclusive, path::PathBuf};

use super::{SITES, judged, root_mean_square, scene};

const SEEDS: RangeInclusive<u32> = 201..=204;

#[test]
fn an_offset_of_the_attitudes_clock_moves_places_where_it_is_read_so() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--realistic", "--attitude-clock"];
    let missions: Vec<PathBuf> = SEEDS
        .map(|seed| scene(folder.path(), seed, &options))
        .collect();
    let even = judged(folder.path(), &missions);
    for mission in &missions {
        for site in SITES {
            let path = mission.join(format!("sites/{site}.toml"));
            let text = fs::read_to_string(&path).unwrap();
            let with = text.replace(
                "[adjustment]\n",
                "[adjustment]\nattitude_clock_sigma_s = 1.0\n",
            );
            assert!(with.len() > text.len(), "{site}");
            fs::write(path, with).unwrap();
        }
    }
    let clock = judged(folder.path(), &missions);
    let mut disputed = 0;
    for (even, clock) in even.iter().zip(&clock) {
        let [apart, read] = [even, clock].map(|of| of.mean_m().y);
        println!(
            "{:28} north {apart:6.1} ± {:.0} m, with the clock {read:6.1} ± {:.0} m; told {:?}",
            even.name, even.mean_sigmas_m.y, clock.mean_sigmas_m.y, even.other_north_m
        );
        if let Some(told_m) = even.other_north_m {
            disputed += 1;
            // Metres: a blunder more or less moves a mean of 150.
            assert!((apart + told_m - read).abs() < 2.0, "{}", even.name);
        }
    }
    // 0.73 s are 240 m: most missions disagree by over 100.
    assert!(disputed >= 6, "{disputed}");
    // The flight goes north: what half of the disagreement does is an error of the mean there.
    let [apart_m, read_m] =
        [&even, &clock].map(|all| root_mean_square(all.iter().map(|of| of.mean_m().y)));
    let normalised = root_mean_square(clock.iter().map(|of| of.mean_m().y / of.mean_sigmas_m.y));
    println!(
        "north {apart_m:.0} m, with the clock {read_m:.0} m, {normalised:.2} of what is stated"
    );
    assert!(read_m < 0.75 * apart_m, "{read_m} {apart_m}");
    assert!((0.5..1.5).contains(&normalised), "{normalised}");
    // Heights are MOLA's in both readings.
    for site in &clock {
        assert!(
            site.mean_m().z.abs() < 3.5 * site.mean_sigmas_m.z,
            "{}",
            site.name
        );
    }
}
