//! Biases of mission phases over many sites: a phase whose images share an offset of the attitude clock, and a phase whose
//! images have independent errors.

use std::fs;

use areograph::{
    flow::{CampaignSite, publish_results},
    pds::image_index::IndexedImage,
};

use super::{SITES, common::long, readings::rename_images, run, scene};

const FIRST_SEED: u32 = 160_000;
/// Missions of a phase, each with three pairs.
const MISSIONS: [u32; 2] = [2, 6];
/// The offset of the first phase, seconds.
const CLOCK_S: f64 = 1.0;

/// An image of an index that states its name alone, and so its phase.
fn indexed(image: &str) -> IndexedImage {
    IndexedImage {
        product_id: image.to_owned(),
        volume: String::new(),
        file: String::new(),
        utc_start: String::new(),
        orbit: None,
        instrument: [String::new(), String::new()],
        target: None,
        sclk_start: None,
        size: [1, 1],
        summing: [None; 2],
        exposure_s: None,
        first_detector: None,
        pixel_m: None,
        angles_rad: [None; 3],
        centre_rad: None,
        corners_rad: [None; 4],
        extent_m: [None; 2],
        altitude_m: None,
        sub_solar_rad: None,
        sub_spacecraft_rad: None,
        solar_longitude_rad: None,
        rationale: String::new(),
        quality: String::new(),
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn the_offset_of_a_phase_is_found_and_the_other_phase_has_none() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("all");
    fs::create_dir(&out).unwrap();
    let clock = format!("--attitude-clock-s={CLOCK_S}");
    let missions = MISSIONS[usize::from(long())];
    let mut own = 0;
    for (phase, options, truth_s) in [
        (
            "offset",
            vec!["--realistic", "--attitude-clock", &clock],
            CLOCK_S,
        ),
        ("independent", vec!["--realistic"], 0.0),
    ] {
        let mut sites: Vec<(String, Vec<IndexedImage>)> = Vec::new();
        for number in 0..missions {
            let mission = scene(folder.path(), FIRST_SEED + own, &options);
            rename_images(&mission, own);
            let part = folder.path().join(format!("part-{own}"));
            own += 1;
            let code = run(&mission, &part).output().unwrap().status.code();
            // 5: a site is invalid, for example by a misplaced profile.
            assert!(matches!(code, Some(0 | 5)), "{code:?}");
            for site in SITES {
                let name = format!("{site}-{phase}-{number}");
                fs::rename(part.join(site), out.join(&name)).unwrap();
                let text = fs::read_to_string(mission.join(format!("sites/{site}.toml"))).unwrap();
                let images = text
                    .lines()
                    .filter_map(|line| line.strip_prefix("id = \"E"));
                let images =
                    images.map(|rest| indexed(&format!("E{}", rest.trim_end_matches('"'))));
                sites.push((name, images.collect()));
            }
        }
        let sites: Vec<CampaignSite<'_>> = sites
            .iter()
            .map(|(id, images)| CampaignSite {
                id,
                images: images.iter().collect(),
                ..CampaignSite::default()
            })
            .collect();
        let answer = publish_results(&out, "phases", &sites).unwrap();
        println!("{:?}", answer.summary.sites);
        // The first image of every pair was taken in the same phase.
        let [found] = &answer.summary.phases[..] else {
            panic!("{:?}", answer.summary.phases);
        };
        let clock = found.attitude_clock_s.unwrap();
        let along = found.along_m.unwrap();
        println!(
            "{phase}: {} pairs, along {:.1} ± {:.1} m, clock {:.3} ± {:.3} s, limit {:.1}",
            found.pairs,
            along.mean.value,
            along.mean.sigma.unwrap(),
            clock.mean.value,
            clock.mean.sigma.unwrap(),
            clock.mean.limit_sigmas.unwrap_or_default(),
        );
        let limit_s = clock.mean.limit_sigmas.unwrap() * clock.mean.sigma.unwrap();
        assert!((clock.mean.value - truth_s).abs() < limit_s, "{found:?}");
        assert_eq!(clock.differs_from_zero, Some(truth_s > 0.0), "{found:?}");
    }
}
