//! The budget of the paper, and that by equation 5.

use super::*;

/// Table 5 of Shan et al. 2005: Eos, Gusev, Isidis.
fn table_5() -> BudgetInput {
    let image = |mean_x, deviation_x, mean_y, deviation_y| ResidualMoments {
        mean_x,
        deviation_x,
        mean_y,
        deviation_y,
    };
    BudgetInput {
        sites: [
            [
                image(-33.82, 17.34, 2.86, 1.36),
                image(20.52, 10.17, -1.61, 0.76),
            ],
            [
                image(-26.25, 0.66, 3.63, 0.27),
                image(23.55, 0.59, -2.62, 0.23),
            ],
            [
                image(34.29, 0.96, -2.57, 0.22),
                image(-25.48, 0.72, 2.88, 0.24),
            ],
        ]
        .map(PairResiduals::of_images)
        .to_vec(),
        // One MOLA spacing, found by eye.
        misregistration: Some(Misregistration {
            mean_m: 325.0,
            rms_m: 325.0,
        }),
        pixel_size_m: 4.4,
        height_over_base: 385.0 / 155.0,
    }
}

/// Two or three printed decimals of the sheet's arithmetic.
fn close(value: f64, expected: f64) {
    assert!((value - expected).abs() < 0.005, "{value} {expected}");
}

#[test]
fn sizes_of_table_5() {
    let expected = [
        [(38.006, 3.167), (22.902, 1.780)],
        [(26.258, 3.640), (23.557, 2.630)],
        [(34.303, 2.579), (25.490, 2.890)],
    ];
    for (site, expected) in table_5()
        .sites
        .iter()
        .flat_map(|site| &site.images)
        .zip(expected.iter().flatten())
    {
        close(site.size_x(), expected.0);
        close(site.size_y(), expected.1);
    }
}

#[test]
fn the_budget_of_the_paper() {
    let budget = uncertainty_budget(&table_5()).unwrap();
    close(budget.along_px, 40.987);
    close(budget.total_along_px.unwrap(), 73.86);
    let GroundPart::Resolved { along_px } = budget.ground else {
        panic!("{budget:?}");
    };
    close(along_px, 61.45);
    close(budget.paper_average.across_px, 2.781);
    close(budget.equation_7.across_px, 4.015);
    // 385/155 times the two readings, and the planimetric sums of squares.
    close(budget.paper_average.height_px, 385.0 / 155.0 * 2.7806);
    close(budget.equation_7.height_px, 9.973);
    close(budget.equation_7.height_m, 43.88);
    close(budget.equation_7.planimetric_px, 41.183);
    close(budget.equation_7.planimetric_m, 181.21);
}

#[test]
fn means_of_opposite_sign_add_up() {
    // 54.34, 49.80 and 59.77 px of the means, with the sums of the standard deviations; eq. 7 has 40.99 px.
    let budget = uncertainty_budget(&table_5()).unwrap();
    let sizes = [(54.34, 27.51), (49.80, 1.25), (59.77, 1.68)];
    let squares = sizes.map(|(mean, deviation): (f64, f64)| mean.powi(2) + deviation.powi(2));
    let expected_px = (squares.iter().sum::<f64>() / 3.0).sqrt();
    close(budget.equation_5.along_px, expected_px);
    assert!(budget.equation_5.along_px > 1.3 * budget.along_px);
    let [first, second] = table_5().sites[0].images;
    let alike = BudgetInput {
        sites: vec![PairResiduals::of_images([first, first])],
        ..table_5()
    };
    // What both images share is no discrepancy: only the scatter is left.
    let alike = uncertainty_budget(&alike).unwrap();
    close(alike.equation_5.along_px, 2.0 * first.deviation_x);
    assert!(alike.along_px > first.mean_x.abs() && second.mean_x > 0.0);
}

#[test]
fn exact_footprints_contribute_nothing() {
    // Orientations disagree by 240 m, and footprints show that disagreement: in px of 4 m, 30 of each image.
    let image = |mean_x: f64| ResidualMoments {
        mean_x,
        deviation_x: 0.5,
        mean_y: 0.0,
        deviation_y: 0.1,
    };
    let budget = uncertainty_budget(&BudgetInput {
        sites: vec![PairResiduals::of_images([image(30.0), image(-30.0)])],
        misregistration: Some(Misregistration {
            mean_m: -240.0,
            rms_m: 240.0,
        }),
        pixel_size_m: 4.0,
        height_over_base: 2.5,
    })
    .unwrap();
    close(budget.equation_5.unexplained_px.unwrap(), 0.0);
    // The paper's equations leave 42 px, 170 m, to the footprints.
    let GroundPart::Resolved { along_px } = budget.ground else {
        panic!("{budget:?}");
    };
    assert!((along_px - 42.4).abs() < 0.1, "{along_px}");
}

#[test]
fn sites_pooled_are_the_budget_of_all() {
    let all = table_5();
    let each: Vec<UncertaintyBudget> = (all.sites.iter())
        .map(|site| {
            let input = BudgetInput {
                sites: vec![*site],
                ..all.clone()
            };
            uncertainty_budget(&input).unwrap()
        })
        .collect();
    let pooled = UncertaintyBudget::pooled(&each).unwrap();
    let expected = uncertainty_budget(&all).unwrap();
    for (pooled, expected) in [
        (pooled.along_px, expected.along_px),
        (pooled.equation_5.along_px, expected.equation_5.along_px),
        (
            pooled.paper_average.height_m,
            expected.paper_average.height_m,
        ),
        (
            pooled.equation_7.planimetric_m,
            expected.equation_7.planimetric_m,
        ),
        (
            pooled.equation_5.point.height_m,
            expected.equation_5.point.height_m,
        ),
    ] {
        close(pooled, expected);
    }
    close(
        pooled.total_along_px.unwrap(),
        expected.total_along_px.unwrap(),
    );
    assert_eq!(
        std::mem::discriminant(&pooled.ground),
        std::mem::discriminant(&expected.ground)
    );
    // One site alone has another one: Gusev 35.28 px.
    close(each[1].along_px, 35.276);
    let mut unseen = each;
    unseen[0].total_along_px = None;
    let pooled = UncertaintyBudget::pooled(&unseen).unwrap();
    assert_eq!(pooled.ground, GroundPart::NotObserved);
    assert_eq!(UncertaintyBudget::pooled(&[]), None);
}

#[test]
fn pixel_and_geometry_are_pooled_without_residuals_as_well() {
    let image = ResidualMoments {
        mean_x: 0.0,
        deviation_x: 0.0,
        mean_y: 0.0,
        deviation_y: 0.0,
    };
    let input = BudgetInput {
        sites: vec![PairResiduals::of_images([image; 2])],
        ..table_5()
    };
    let exact = uncertainty_budget(&input).unwrap();
    let pooled = UncertaintyBudget::pooled(&[exact.clone(), exact]).unwrap();
    close(pooled.pixel_size_m, 4.4);
    close(pooled.height_over_base, 385.0 / 155.0);
}

#[test]
fn what_has_no_answer_says_so() {
    let observed = |metres: Option<f64>| BudgetInput {
        misregistration: metres.map(|metres| Misregistration {
            mean_m: metres,
            rms_m: metres,
        }),
        ..table_5()
    };
    let budget = uncertainty_budget(&observed(Some(100.0))).unwrap();
    assert_eq!(budget.ground, GroundPart::NotResolvable);
    let budget = uncertainty_budget(&observed(None)).unwrap();
    assert_eq!(budget.ground, GroundPart::NotObserved);
    assert_eq!(budget.total_along_px, None);
    assert_eq!(budget.equation_5.unexplained_px, None);
    let refused = |change: fn(&mut BudgetInput)| {
        let mut input = table_5();
        change(&mut input);
        uncertainty_budget(&input).unwrap_err()
    };
    assert_eq!(refused(|input| input.sites.clear()), BudgetError::NoSites);
    for error in [
        refused(|input| input.pixel_size_m = 0.0),
        refused(|input| input.height_over_base = f64::NAN),
        refused(|input| input.sites[1].images[0].mean_y = f64::NAN),
        refused(|input| input.sites[2].apart.mean_x = f64::INFINITY),
        refused(|input| input.misregistration.as_mut().unwrap().mean_m = f64::NAN),
    ] {
        assert!(matches!(error, BudgetError::Value { .. }), "{error}");
    }
}
