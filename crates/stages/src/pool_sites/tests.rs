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

/// An image of a valid site, of an orbit of phase E02.
fn image(site: &str, image: &str, orbit: u32) -> ImageRow {
    ImageRow {
        site: site.to_owned(),
        is_valid: true,
        image: image.to_owned(),
        phase: "E02".to_owned(),
        orbit: Some(orbit),
        ..ImageRow::default()
    }
}

#[test]
fn pairs_with_images_of_one_orbit_are_one_group() {
    let pairs = [["a", "b"], ["c", "d"], ["e", "f"], ["g", "h"]];
    let orbits = [("a", 1), ("b", 2), ("c", 3), ("d", 1), ("e", 4), ("f", 5)];
    let mut rows = CampaignRows {
        pairs: pairs.map(|images| pair(images, 1.0)).into(),
        images: orbits.map(|(of, orbit)| image("site", of, orbit)).into(),
        ..CampaignRows::default()
    };
    assert_eq!(pool_sites("test", &rows).groups, 3);
    // The same number in another phase is another orbit.
    rows.images[0].phase = "E03".to_owned();
    assert_eq!(pool_sites("test", &rows).groups, 4);
    // A pair that joins two groups.
    rows.pairs.push(pair(["h", "e"], 1.0));
    assert_eq!(pool_sites("test", &rows).groups, 3);
}

#[test]
fn pairs_of_equal_or_unknown_emissions_have_no_sign() {
    for emissions in [[Some(0.2), Some(0.2)], [None, Some(0.2)], [Some(0.2), None]] {
        let signless = PairRow {
            emission_rad: emissions,
            ..pair(["c", "d"], 900.0)
        };
        let found = pooled(vec![pair(["a", "b"], 10.0), signless]);
        let along = found.phases[0].along_m.unwrap();
        assert_eq!((found.pairs, along.mean.n), (2, 1));
        let misregistration = found.before.misregistration.unwrap();
        assert_eq!(misregistration.pairs, 2);
        assert!((misregistration.along_mean_m.unwrap().value - 10.0).abs() < 1e-12);
    }
}

fn profile(site: &str, orbit: u32, image: &str, shots: u32) -> ProfileRow {
    ProfileRow {
        site: site.to_owned(),
        verdict: "valid",
        is_valid: true,
        is_repeated: false,
        phase: "E02".to_owned(),
        profile: format!("window/{orbit}"),
        orbit,
        image: image.to_owned(),
        off_nadir_rad: 0.0,
        ranges: RangeStatistics {
            n: shots,
            mean_m: 1.0,
            deviation_m: 0.3,
        },
        mean_without_outliers_m: 1.0,
        outliers: 0,
        in_image: RangeStatistics::default(),
        spacecraft_m: [0.0; 3],
        is_judged: true,
        invalid_because: String::new(),
        rejected_because: String::new(),
        kernels: KernelSetName::default(),
    }
}

/// A single image and two pairs that contain it, a site elsewhere, and an invalid site.
#[test]
fn images_and_profiles_of_several_sites_count_once() {
    let images = [
        ("x", "a"),
        ("a", "a"),
        ("a_b", "a"),
        ("a_b", "b"),
        ("b_c", "b"),
        ("b_c", "c"),
    ];
    let mut rows = CampaignRows {
        images: images.map(|(site, of)| image(site, of, 1)).into(),
        profiles: vec![
            profile("x", 1, "", 1_000),
            profile("a", 1, "", 1),
            // The image of this orbit is in this site.
            profile("a_b", 1, "b", 10),
            profile("a_b", 2, "", 100),
            // The orbit crosses the site again.
            profile("a_b", 2, "", 200),
            profile("b_c", 1, "b", 11),
            profile("b_c", 2, "", 101),
            profile("elsewhere", 2, "", 300),
        ],
        ..CampaignRows::default()
    };
    rows.images[0].is_valid = false;
    rows.profiles[0].is_valid = false;
    rows.mark_repeated();
    // Of the profiles of orbit 1, the one of the site with its image; rows that are not valid are not repetitions.
    let repeated = rows.profiles.iter().map(|row| row.is_repeated);
    assert_eq!(
        repeated.collect::<Vec<_>>(),
        [false, true, false, false, false, true, true, false]
    );
    let repeated = rows.images.iter().map(|row| row.is_repeated);
    assert_eq!(
        repeated.collect::<Vec<_>>(),
        [false, false, true, false, true, false]
    );
    let found = pool_sites("test", &rows);
    assert_eq!((found.image_rows, found.images.images), (6, 3));
    let ranges = found.ranges.unwrap();
    assert_eq!((ranges.profiles, ranges.shots), (4, 610));
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
