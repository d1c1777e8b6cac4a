//! The page of many sites.

use super::*;
use areograph_base::body::Body;
use areograph_geom::{random::Random, uncertainty::ResidualMoments};
use areograph_stages::pool_sites::{
    KernelSetName, Measured, PairMisregistration, PairRow, PairState, ProfileRow, RangeStatistics,
    SiteRow, SiteState, pool_sites,
};

/// Rows of so many sites with a pair and two profiles each; of every hundred, one failed and one is invalid.
fn rows(count: usize) -> CampaignRows {
    let mut random = Random::new(1, "rows of a campaign");
    let mut rows = CampaignRows::default();
    for number in 0..count {
        let site = site(number, &mut random);
        rows.pairs.push(pair(&site, number, &mut random));
        rows.profiles
            .extend([1, 2].map(|orbit| profile(&site, orbit, &mut random)));
        rows.sites.push(site);
    }
    rows
}

fn site(number: usize, random: &mut Random) -> SiteRow {
    let failed = number % 100 == 7;
    let is_valid = !failed && number % 100 != 8;
    let verdict = match (failed, is_valid) {
        (true, _) => "",
        (false, true) => "valid with remarks",
        (false, false) => "INVALID",
    };
    let text = |is_there: bool, text: &str| {
        let lines = is_there.then(|| text.repeat(20));
        lines.into_iter().collect::<Vec<String>>()
    };
    SiteRow {
        site: format!("e{number:05}_e{:05}", number + 1),
        phase: format!("E{:02}", number % 24),
        state: if failed {
            SiteState::Failed
        } else {
            SiteState::Published
        },
        verdict,
        is_valid,
        reasons: text(!is_valid && !failed, "mean of <ranges>; "),
        remarks: text(true, "a remark; "),
        failure: text(failed, "a kernel & more are gone; ").concat(),
        body: Body::Mars,
        place_rad: Some([
            random.between(0.0, std::f64::consts::TAU),
            random.between(-1.5, 1.5),
        ]),
        images: 2,
        pairs: 1,
        profiles: 2,
        ties: 100,
        footprints: 300,
        kernels: KernelSetName {
            name: format!("ext{}.bsp", number / 500),
            blake3: String::new(),
        },
        configuration_blake3: String::new(),
        fingerprint: String::new(),
        version: String::new(),
    }
}

fn state(along_m: f64) -> PairState {
    let moments = ResidualMoments {
        mean_x: 20.0,
        deviation_x: 1.0,
        mean_y: 2.0,
        deviation_y: 0.3,
    };
    PairState {
        ties: 100,
        ties_along_m: None,
        along_track_parallax_m: along_m.abs(),
        residuals: [moments; 2],
        misregistration: Some(PairMisregistration {
            footprints: 80,
            along_lines: along_m / 4.0,
            along_m: Measured {
                value: along_m,
                sigma: Some(1.0),
            },
            across_px: 1.0,
            across_m: Measured {
                value: 4.0,
                sigma: None,
            },
            along_spacings: Some(along_m / 300.0),
        }),
        heights: None,
    }
}

fn pair(site: &SiteRow, number: usize, random: &mut Random) -> PairRow {
    PairRow {
        site: site.site.clone(),
        verdict: site.verdict,
        is_valid: site.is_valid,
        is_repeated: false,
        images: [0, 1].map(|image| format!("E{image}-{number:05}")),
        phases: [site.phase.clone(), site.phase.clone()],
        utc_start: [0, 1].map(|day| format!("2001-{:03}T01:00:00", 1 + number % 300 + day)),
        emission_rad: [Some(0.0), Some(0.3)],
        latitude_rad: Some(0.1),
        summing: [2, 2],
        convergence_rad: 0.35,
        height_over_base: 2.5,
        pixel_size_m: 4.4,
        shot_spacing_m: Some(300.0),
        clock_m_s: None,
        before: state(200.0 * random.normal()),
        after: Some(state(2.0 * random.normal())),
        budget: Err("no budget".to_owned()),
        kernels: site.kernels.clone(),
    }
}

fn profile(site: &SiteRow, orbit: u32, random: &mut Random) -> ProfileRow {
    ProfileRow {
        site: site.site.clone(),
        verdict: site.verdict,
        is_valid: site.is_valid,
        is_repeated: false,
        phase: site.phase.clone(),
        profile: format!("window/{orbit}"),
        orbit,
        image: String::new(),
        off_nadir_rad: 0.0,
        ranges: RangeStatistics {
            n: 150,
            mean_m: random.normal(),
            deviation_m: 0.3,
        },
        mean_without_outliers_m: random.normal(),
        outliers: 0,
        in_image: RangeStatistics::default(),
        spacecraft_m: [0.0; 3],
        is_judged: true,
        invalid_because: String::new(),
        rejected_because: String::new(),
        kernels: site.kernels.clone(),
    }
}

#[test]
fn the_page_of_any_number_of_sites_is_below_a_megabyte() {
    for count in [0, 1, 10_000, 100_000] {
        let rows = rows(count);
        let summary = pool_sites("test <1>", &rows);
        let page = campaign_page(&summary, &rows).unwrap();
        println!("{count} sites: {} bytes", page.len());
        assert!(page.len() < 1_000_000, "{count}: {}", page.len());
        assert!(!page.contains("<script") && !page.contains("<1>") && !page.contains("<ranges>"));
        if count == 10_000 {
            assert!(page.contains(
                "10\u{202f}000 sites: 100 failed, 100 invalid, 9800 valid with remarks."
            ));
            // Lists end.
            assert!(page.matches("/report/index.html").count() <= 30);
            assert!(page.contains("The first 10 of 100"));
        }
    }
}

/// A page states what the phases decide.
#[test]
fn a_biased_phase_is_named_on_the_first_screen() {
    let mut rows = rows(480);
    let biased = rows.pairs.iter_mut();
    for pair in biased.filter(|pair| pair.phases[0] == "E05") {
        let found = pair.before.misregistration.as_mut().unwrap();
        found.along_m.value = 450.0 + 0.1 * found.along_m.value;
    }
    let summary = pool_sites("test", &rows);
    let page = campaign_page(&summary, &rows).unwrap();
    let lead = page.split("<section").next().unwrap();
    assert!(
        lead.contains("differs from zero in 1 mission phase: E05 (+4"),
        "{}",
        &lead[lead.len().saturating_sub(900)..]
    );
    assert!(
        lead.contains("No mean along-track misregistration was detected in 23 mission phases.")
    );
}

#[test]
fn phases_without_a_decision_are_counted() {
    for (count, words) in [
        (
            1,
            "1 mission phase has too few independent groups for a decision.",
        ),
        (
            5,
            "5 mission phases have too few independent groups for a decision.",
        ),
    ] {
        let rows = rows(count);
        let page = campaign_page(&pool_sites("test", &rows), &rows).unwrap();
        assert!(page.contains(words), "{words}");
    }
}
