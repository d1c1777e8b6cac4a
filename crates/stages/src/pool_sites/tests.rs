//! Pooling of rows.

use super::*;
use areograph_geom::{random::Random, uncertainty::ResidualMoments};

/// A pair of these images whose second image has the larger emission, with this misregistration.
fn pair(images: [&str; 2], along_m: f64) -> PairRow {
    let moments = |mean_x: f64| ResidualMoments {
        mean_x,
        deviation_x: 0.0,
        mean_y: 0.0,
        deviation_y: 0.0,
    };
    PairRow {
        site: "site".to_owned(),
        verdict: "valid",
        is_valid: true,
        is_repeated: false,
        images: images.map(str::to_owned),
        phases: ["E02", "E03"].map(str::to_owned),
        utc_start: [String::new(), String::new()],
        emission_rad: [Some(0.0), Some(0.3)],
        latitude_rad: None,
        summing: [2, 2],
        convergence_rad: 0.3,
        height_over_base: 2.5,
        pixel_size_m: 4.0,
        shot_spacing_m: Some(300.0),
        clock_m_s: Some(370.0),
        before: PairState {
            ties: 10,
            ties_along_m: Some(Measured {
                value: -along_m,
                sigma: Some(1.0),
            }),
            along_track_parallax_m: along_m.abs(),
            residuals: [moments(0.1 * along_m), moments(-0.1 * along_m)],
            misregistration: Some(PairMisregistration {
                footprints: 10,
                along_lines: along_m / 4.0,
                along_m: Measured {
                    value: along_m,
                    sigma: Some(1.0),
                },
                across_px: 0.0,
                across_m: Measured {
                    value: 0.0,
                    sigma: None,
                },
                along_spacings: Some(along_m / 300.0),
            }),
            heights: None,
        },
        after: None,
        budget: Err("none".to_owned()),
        kernels: KernelSetName::default(),
    }
}

fn pooled(pairs: Vec<PairRow>) -> CampaignSummary {
    let rows = CampaignRows {
        pairs,
        ..CampaignRows::default()
    };
    pool_sites("test", &rows)
}

#[test]
fn the_order_of_the_images_of_a_pair_does_not_matter() {
    let mut random = Random::new(1, "pairs");
    let mut pairs = Vec::new();
    for number in 0..40 {
        let [first, second] = [0, 1].map(|image| format!("{number}-{image}"));
        pairs.push(pair([&first, &second], 100.0 + 10.0 * random.normal()));
    }
    let expected = pooled(pairs.clone());
    for pair in pairs.iter_mut().step_by(3) {
        pair.images.reverse();
        pair.emission_rad.reverse();
        let found = pair.before.misregistration.as_mut().unwrap();
        found.along_m.value *= -1.0;
        found.along_lines *= -1.0;
    }
    let found = pooled(pairs);
    let mean = |of: &CampaignSummary| {
        let pooled = of.before.misregistration.as_ref().unwrap();
        pooled.along_mean_m.unwrap()
    };
    assert!((mean(&found).value - mean(&expected).value).abs() < 1e-9);
    assert!((mean(&found).value - 100.0).abs() < 6.0);
    assert_eq!(
        found.phases[0].along_m.unwrap().differs_from_zero,
        Some(true)
    );
}

#[test]
fn pairs_that_share_images_are_one_group_and_repeated_ones_are_left_out() {
    let pairs = vec![
        pair(["a", "b"], 1.0),
        pair(["c", "d"], 2.0),
        pair(["b", "e"], 3.0),
        pair(["f", "d"], 4.0),
        pair(["g", "h"], 5.0),
        PairRow {
            is_repeated: true,
            ..pair(["b", "a"], 6.0)
        },
        PairRow {
            is_valid: false,
            ..pair(["x", "y"], 7.0)
        },
    ];
    let found = pooled(pairs);
    assert_eq!((found.pair_rows, found.pairs, found.groups), (7, 5, 3));
    let along = found.phases[0].along_m.unwrap();
    assert_eq!((along.mean.n, along.mean.groups), (5, 3));
    assert_eq!(along.differs_from_zero, None);
    // √((1 + 4 + 9 + 16 + 25) / 5)
    let rms_m = found.before.misregistration.unwrap().along_rms_m;
    assert!((rms_m - 11.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn ranges_of_profiles_are_those_of_all_shots() {
    let shots: [&[f64]; 3] = [&[1.0, 2.0, 4.0], &[10.0], &[-3.0, -5.0]];
    let summary = |values: &[f64]| areograph_geom::statistics::Summary::of(values);
    let profiles = shots.map(|of| RangeStatistics::of(&summary(of)));
    let found = RangesPooled::of(&profiles).unwrap();
    let all = summary(&shots.concat());
    assert_eq!((found.profiles, found.shots), (3, 6));
    assert!((found.mean_m - all.mean).abs() < 1e-12);
    assert!((found.deviation_m - all.standard_deviation).abs() < 1e-12);
    assert_eq!(RangesPooled::of(&[RangeStatistics::default()]), None);
}

#[test]
fn nothing_is_pooled_of_nothing() {
    let found = pooled(Vec::new());
    assert_eq!(found.pairs, 0);
    assert!(found.phases.is_empty() && found.budget.is_none() && found.ranges.is_none());
}
