//! One offset of the attitude's clock, or images that err each for itself: the standard deviations of either reading hold
//! where it is true, and only there. Nothing measured tells which is, so the reading is a decision.

use std::{fs, path::Path};

use super::{Judged, SITES, common::json, is_within, root_mean_square, run, scene, seeds};

/// Missions with the option on, run.
fn by_the_clock(
    folder: &Path,
    seeds: impl IntoIterator<Item = u32>,
    scene_options: &[&str],
) -> Vec<Judged> {
    let missions: Vec<_> = seeds
        .into_iter()
        .map(|seed| {
            let mission = scene(folder, seed, scene_options);
            for site in SITES {
                let path = mission.join(format!("sites/{site}.toml"));
                let text = fs::read_to_string(&path).unwrap();
                let keys = "[adjustment]\nattitude_clock = \"yes\"\n";
                assert!(text.contains("[adjustment]\n"), "{text}");
                let text = text.replacen("[adjustment]\n", keys, 1);
                fs::write(&path, text).unwrap();
            }
            mission
        })
        .collect();
    missions
        .iter()
        .flat_map(|mission| {
            let out = folder.join("out").join(mission.file_name().unwrap());
            let code = run(mission, &out).output().unwrap().status.code();
            // 5: a site is invalid, since corrections are beyond what this reading allows.
            assert!(matches!(code, Some(0 | 5)), "{code:?}");
            let judged = SITES.map(|site| Judged::of(mission, &out, site));
            fs::remove_dir_all(&out).unwrap();
            judged
        })
        .collect()
}

/// Errors of the mean towards the north, as the sites' images fly, over their standard deviations: by the clock, and evenly
/// where the images disagree by so much that both are told.
fn normalised(sites: &[Judged]) -> [Vec<f64>; 2] {
    let clock = sites
        .iter()
        .map(|site| site.mean_m().y / site.mean_sigmas_m.y);
    let even = sites.iter().filter_map(|site| {
        let [moved_m, sigma_m] = site.other_m?;
        Some((site.mean_m() + moved_m).y / sigma_m.y)
    });
    [clock.collect(), even.collect()]
}

/// What is found at a site, by either reading.
fn line(site: &Judged) -> String {
    let (mean_m, sigma_m) = (site.mean_m(), site.mean_sigmas_m);
    let other_m = site.other_m.map(|[moved_m, sigma_m]| {
        let even_m = mean_m + moved_m;
        format!(
            "{:.0} {:.0} {:.1} ± {:.0} {:.0}",
            even_m.x, even_m.y, even_m.z, sigma_m.x, sigma_m.y
        )
    });
    let clock_s = site.clock_s.unwrap();
    format!(
        "{:28} by the clock ({:.3} ± {:.3} s): {:.0} {:.0} {:.1} ± {:.0} {:.0} {:.1} m; evenly {}",
        site.name,
        clock_s.0,
        clock_s.1,
        mean_m.x,
        mean_m.y,
        mean_m.z,
        sigma_m.x,
        sigma_m.y,
        sigma_m.z,
        other_m.as_deref().unwrap_or("not told")
    )
}

#[test]
fn the_place_is_right_by_the_clock_where_the_clock_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let sites = by_the_clock(
        folder.path(),
        seeds(206..=210, 2),
        &["--realistic", "--attitude-clock"],
    );
    for site in &sites {
        println!("{}", line(site));
    }
    for (axis, name) in ["east", "north", "up"].into_iter().enumerate() {
        let z = sites
            .iter()
            .map(|site| site.mean_m()[axis] / site.mean_sigmas_m[axis]);
        let pooled = root_mean_square(z);
        println!("{name}: errors of the mean over stated standard deviations {pooled:.2}");
        // 15 values: chance gives 0.56 to 1.44 in 99 of 100 cases.
        assert!(
            is_within(pooled, [0.5, 1.45], sites.len()),
            "{name}: {pooled}"
        );
    }
    // The offset itself, one draw a mission.
    for site in &sites {
        let mission = site.name.split(' ').next().unwrap();
        let truth = json(&folder.path().join(mission).join("truth.json"));
        let drawn_s = truth["errors_drawn"][0]["attitude_clock_s"]
            .as_f64()
            .unwrap();
        let (found_s, sigma_s) = site.clock_s.unwrap();
        assert!(
            (found_s - drawn_s).abs() < 3.5 * sigma_s,
            "{}: {found_s} ± {sigma_s}, drawn {drawn_s} s",
            site.name
        );
    }
    // Where the offset is large, an even split is wrong by more than by the clock, although it states more.
    let [clock, even] = normalised(&sites);
    println!(
        "north: by the clock {:.2}, evenly {:.2}",
        root_mean_square(clock.into_iter()),
        root_mean_square(even.into_iter())
    );
    let told = sites.iter().filter(|site| site.other_m.is_some());
    let errors_m = told.map(|site| {
        [
            site.mean_m().y,
            (site.mean_m() + site.other_m.unwrap()[0]).y,
        ]
    });
    let errors_m: Vec<[f64; 2]> = errors_m.collect();
    let [clock_m, even_m] = [0, 1].map(|way| root_mean_square(errors_m.iter().map(|of| of[way])));
    println!(
        "north, rms of {} sites whose images disagree by more than 100 m: by the clock {clock_m:.0} m, evenly {even_m:.0} m",
        errors_m.len()
    );
    assert!(
        3 * errors_m.len() >= sites.len() && 1.5 * clock_m < even_m,
        "{clock_m} {even_m}"
    );
}

#[test]
fn the_place_by_the_clock_is_not_to_be_trusted_where_every_image_errs_for_itself() {
    let folder = tempfile::tempdir().unwrap();
    let sites = by_the_clock(folder.path(), seeds(211..=215, 2), &["--realistic"]);
    for site in &sites {
        println!("{}", line(site));
    }
    let [clock, even] = normalised(&sites);
    let clock = root_mean_square(clock.into_iter());
    println!(
        "north: by the clock {clock:.2}, evenly {:.2} of {}",
        root_mean_square(even.clone().into_iter()),
        even.len()
    );
    // What is stated by the clock does not hold then: this is why it is a decision, and no estimate.
    assert!(clock > 1.5, "{clock}");
    // Heights do not depend on it: MOLA has them.
    let heights = root_mean_square(
        sites
            .iter()
            .map(|site| site.mean_m().z / site.mean_sigmas_m.z),
    );
    assert!(is_within(heights, [0.5, 1.45], sites.len()), "{heights}");
}
