//! The report page of a site with tie points: its sections are there, and say what the stages found.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly and write as they like"
)]

use crate::common;
use crate::common::page;

mod site;

use areograph::{
    capabilities,
    config::all_instruments,
    geom::uncertainty::GroundPart,
    pds::isd::{Rotations, States, SupportTables},
    stages::{
        adjust::{
            ObservationType, OtherReading, PointKind, RejectedPoint, RejectionReason,
            accuracy_withheld,
        },
        compare_pairs::PairComparison,
        judge::{CheckKind, CheckOutcome},
        tag_times::SupportFile,
    },
    units::RADIANS_PER_ARCSECOND,
};
use nalgebra::{Matrix3, Vector3};
use page::{csv, lead, number, section, table, text};
use site::Site;

const SECTIONS: [&str; 4] = [
    "tie-points-and-misregistration",
    "combined-adjustment",
    "gap-of-footprints",
    "accuracy",
];

/// Numbers of a page have so many decimals.
fn agree(text: &str, value: f64, decimals: i32) {
    // Half of the last digit, and rounding.
    let tolerance = 0.5 * 10_f64.powi(-decimals) + 1e-9;
    let found = number(text);
    assert!((found - value).abs() <= tolerance, "{text} {value}");
}

/// Mean size of what footprints of a pair disagree by along the flight, metres.
fn apart_m(pair: &PairComparison) -> f64 {
    let profiles = &pair.footprints.as_ref().unwrap().profiles;
    let shots: f64 = profiles.iter().map(|of| f64::from(of.lines.n)).sum();
    let each = profiles
        .iter()
        .map(|of| f64::from(of.lines.n) * of.along_m.abs());
    each.sum::<f64>() / shots
}

#[test]
fn the_first_lines_tell_how_far_images_disagree_before_and_after() {
    let site = Site::gusev();
    let page = site.page();
    let spacing_m = site.pairs[0].mola_spacing_m.unwrap();
    let (before_m, after_m) = (apart_m(&site.pairs[0]), apart_m(&site.adjusted_pairs[0]));
    // The mission is made so: most of a spacing before, metres after.
    assert!(before_m > 0.5 * spacing_m && after_m < 0.05 * spacing_m);
    let [before_sigma_m, sigma_m] = [&site.pairs[0], &site.adjusted_pairs[0]]
        .map(|pair| pair.footprints.as_ref().unwrap().apart_sigma_m.unwrap());
    let words = format!(
        ", along track: the two positions of a footprint were on average {:.2} shot spacings ({before_m:.0} m, σ \
         {before_sigma_m:.1} m) apart before the adjustment; {:.3} shot spacings ({after_m:.1} m, σ {sigma_m:.1} m) after it.",
        before_m / spacing_m,
        after_m / spacing_m,
    );
    let told = section(&page, "tie-points-and-misregistration");
    assert!(told.contains(&words), "{words}\n{told}");
    let minus = |value: f64| format!("{value:+.1}").replace('-', "−");
    let heights = format!(
        "{} m median of {} tie points, controlled by MOLA; before the adjustment {} m, median of {}, independent of it",
        minus(site.adjusted_heights.above_m.median),
        site.adjusted_heights.above_m.n,
        minus(site.heights.above_m.median),
        site.heights.above_m.n
    );
    let images = format!(
        "{:.2} m at the tie points of {}, which the adjustment fits; {:.0} m before",
        site.adjusted_pairs[0].along_track_parallax_m.abs(),
        site.pairs[0].images.join(" and "),
        site.pairs[0].along_track_parallax_m.abs()
    );
    for said in [heights, images] {
        let lead = text(lead(&page));
        assert!(lead.contains(&said), "{said}\n{lead}");
    }
}

#[test]
fn the_published_page_has_all_sections_and_stays_small() {
    let site = Site::gusev();
    let page = &site.published;
    for id in SECTIONS {
        assert!(
            section(page, id).starts_with("<details class=\"more whole\""),
            "{id}"
        );
        assert_eq!(
            section(page, id),
            section(&site.page(), id),
            "{id}: the page of the run shows what its stages stored"
        );
    }
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    for word in page.split(|letter: char| !letter.is_alphanumeric()) {
        assert!(!["NaN", "inf", "Infinity"].contains(&word), "{word}");
    }
    page::assert_complete(page);
}

#[test]
fn every_number_of_the_checks_is_that_of_the_manifest() {
    let site = Site::gusev();
    let checks = site.manifest["verdict"]["checks"].as_array().unwrap();
    let rows = table(&site.published, "Checks");
    assert_eq!(rows.len(), checks.len());
    assert!(checks.len() > 20, "{}", checks.len());
    for (row, check) in rows.iter().zip(checks) {
        let outcome = check["outcome"].as_str().unwrap();
        assert!(row[0].ends_with(outcome), "{row:?} {check}");
        assert!(
            row[1].ends_with(check["subject"].as_str().unwrap()),
            "{row:?}"
        );
        for (text, value) in [(&row[2], &check["value"]), (&row[3], &check["limit"])] {
            let Some(value) = value.as_f64() else {
                assert_eq!(text, "–");
                continue;
            };
            let text = text.trim_start_matches(['±', '≤', '≥', ' ', '+']);
            let (digits, unit) = text.split_once(' ').unwrap_or((text, ""));
            assert_eq!(unit, check["unit"].as_str().unwrap(), "{row:?}");
            let decimals = digits.split_once('.').map_or(0, |(_, rest)| rest.len());
            // Some values are told without their sign.
            let found = number(digits);
            let value = if found < 0.0 { value } else { value.abs() };
            agree(digits, value, i32::try_from(decimals).unwrap());
        }
    }
    // A site is invalid when, and only when, a check fails.
    let fails = checks.iter().any(|check| check["outcome"] == "fail");
    assert_eq!(site.manifest["verdict"]["valid"], !fails);
}

#[test]
fn pairs_tell_their_residuals_and_footprints_before_and_after() {
    let site = Site::gusev();
    let page = site.page();
    let pairs = [&site.pairs[0], &site.adjusted_pairs[0]];
    let seen = table(&page, "Pairs of images");
    let residuals = table(&page, "Reprojection residuals of tie points");
    assert_eq!((seen.len(), residuals.len()), (2, 2));
    for (row, pair) in pairs.iter().enumerate() {
        assert_eq!(seen[row][2], pair.ties.to_string());
        agree(&seen[row][3], pair.convergence_rad.to_degrees(), 2);
        agree(&seen[row][4], pair.height_over_base, 2);
        agree(&seen[row][5], pair.line_spacing_m[0], 3);
        agree(&seen[row][7], pair.along_track_parallax_m, 2);
        for (image, of) in pair.residuals.iter().enumerate() {
            let moments = [of.mean_x, of.deviation_x, of.mean_y, of.deviation_y];
            for (column, value) in moments.into_iter().enumerate() {
                agree(&residuals[row][3 + 4 * image + column], value, 2);
            }
        }
    }
    let profiles = pairs.map(|pair| &pair.footprints.as_ref().unwrap().profiles);
    let rows = table(&page, "Misregistration of footprints");
    assert_eq!(rows.len(), profiles[0].len());
    for (index, row) in rows.iter().enumerate() {
        let of = profiles.map(|profiles| &profiles[index]);
        assert_eq!(row[0], of[0].profile);
        for (state, of) in of.into_iter().enumerate() {
            agree(&row[3 + state], of.lines.mean, 2);
            agree(&row[5 + state], of.along_m, 1);
            agree(&row[7 + state], of.along_sigma_m, 1);
            agree(&row[9 + state], of.along_spacings.unwrap(), 3);
        }
    }
}

#[test]
fn residual_vectors_are_those_of_the_intersection() {
    let site = Site::gusev();
    let page = site.page();
    for (index, times) in site.times.iter().enumerate() {
        let name = format!("residual-vectors-on-{}", times.id.to_lowercase());
        let rows = csv(&page, &name);
        let header = "quantity,series,line,value,by line,by value";
        assert_eq!(rows[0].join(","), header);
        for (state, ties, pair) in [
            ("before", &site.intersected, &site.pairs[0]),
            ("after", &site.adjusted_intersected, &site.adjusted_pairs[0]),
        ] {
            let own: Vec<&Vec<String>> = rows.iter().filter(|row| row[1] == state).collect();
            let good = ties.points.iter().filter(|point| !point.outlier).count();
            assert_eq!(own.len(), good, "{name} {state}");
            let mean = |column: usize| {
                let values = own.iter().map(|row| number(&row[column]));
                values.sum::<f64>() / own.len() as f64
            };
            // Samples run against y. The data have eight digits.
            let moments = &pair.residuals[index];
            assert!((mean(4) - moments.mean_x).abs() < 1e-5, "{name} {state}");
            assert!((mean(5) + moments.mean_y).abs() < 1e-5, "{name} {state}");
            // The vectors start where the tie points were measured.
            for (row, point) in own.iter().zip(ties.points.iter().filter(|p| !p.outlier)) {
                let mut ties = site.ties.points.iter();
                let tie = ties.nth(point.tie).unwrap();
                let mut measures = tie.measures.iter();
                let measure = measures.find(|of| of.image == index).unwrap();
                // Eight digits of line numbers up to 10496.
                assert!((number(&row[2]) - measure.line).abs() < 1e-3, "{}", tie.id);
                assert!(
                    (number(&row[3]) - measure.sample).abs() < 1e-3,
                    "{}",
                    tie.id
                );
            }
        }
    }
}

#[test]
fn moved_footprints_go_where_the_adjusted_image_has_them() {
    let site = Site::gusev();
    let page = site.page();
    for ((times, before), (_, _, after)) in site
        .times
        .iter()
        .zip(&site.registrations)
        .zip(&site.adjusted_images)
    {
        let name = format!("footprints-on-{}-before-and-after", times.id.to_lowercase());
        let rows = csv(&page, &name);
        let moved: Vec<_> = rows.iter().filter(|row| row[1] == "moved").collect();
        assert!(moved.len() > 5, "{name}: {} footprints", moved.len());
        for row in moved {
            let [x, y, by_x, by_y] = [2, 3, 4, 5].map(|column| number(&row[column]));
            // Eight digits of line numbers up to 10496.
            let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
            let (old, new) = (&before.points, &after.points);
            let found = (0..old.len())
                .find(|index| near(old.line.at(*index), x) && near(old.sample.at(*index), y))
                .unwrap();
            let shot = |points: &areograph::stages::register::RegisteredPoints, index: usize| {
                (points.profile.at(index), points.row.at(index))
            };
            let same = (0..new.len())
                .find(|index| shot(new, *index) == shot(old, found))
                .unwrap();
            assert!(near(new.line.at(same), x + by_x) && near(new.sample.at(same), y + by_y));
        }
    }
}

#[test]
fn the_tables_of_the_adjustment_are_its_summary() {
    let site = Site::gusev();
    let page = site.page();
    let summary = &site.adjusted.summary;
    let corrections = table(&page, "Corrections of ground points");
    let sigmas = table(&page, "A posteriori standard deviations of ground points");
    for (row, of) in [&summary.shots, &summary.ties].into_iter().enumerate() {
        for axis in 0..3 {
            agree(
                &corrections[row][2 + 2 * axis],
                of.corrections_m[axis].mean,
                3,
            );
            agree(
                &corrections[row][3 + 2 * axis],
                of.corrections_m[axis].standard_deviation,
                3,
            );
            agree(&sigmas[row][1 + axis], of.sigmas_m[axis].mean, 3);
        }
        agree(&sigmas[row][5], summary.sigma0, 3);
    }
    let coordinates = table(&page, "Image coordinates (Table 3");
    let expected = summary
        .images
        .iter()
        .flat_map(|image| [&image.mola_corrections, &image.tie_residuals_px]);
    assert_eq!(coordinates.len(), 2 * summary.images.len());
    for (row, of) in coordinates.iter().zip(expected) {
        assert_eq!(row[2], of[0].n.to_string());
        if of[0].n == 0 {
            assert_eq!(row[3], "–");
            continue;
        }
        agree(&row[3], of[0].mean, 3);
        agree(&row[6], of[1].standard_deviation, 3);
    }
    let images = table(&page, "Images, one row each");
    assert_eq!(images.len(), site.adjusted.images.len());
    for (index, (row, image)) in images.iter().zip(&site.adjusted.images).enumerate() {
        let views = site.adjusted.views.iter();
        let ties: Vec<f64> = views
            .filter(|view| view.kind == PointKind::Tie && view.image == index)
            .map(|view| view.along_px.value)
            .collect();
        assert_eq!(row[1], ties.len().to_string());
        let squares: f64 = ties.iter().map(|value| value * value).sum();
        agree(&row[2], (squares / ties.len() as f64).sqrt(), 2);
        let shift_m = [0, 3, 6].map(|at| image.correction[at].powi(2));
        agree(&row[5], shift_m.iter().sum::<f64>().sqrt(), 1);
    }
    let observations = table(&page, "Observations by kind");
    assert_eq!(observations.len(), summary.types.len());
    for (row, of) in observations.iter().zip(&summary.types) {
        assert_eq!(row[1], of.observations.to_string());
        agree(&row[2], of.redundancy, 1);
        assert_eq!(row[7], of.beyond_limit.to_string());
    }
    let steps = csv(&page, "convergence-of-the-adjustment");
    assert_eq!(steps.len(), 1 + site.adjusted.weighted_squares.len());
    for (row, squares) in steps[1..].iter().zip(&site.adjusted.weighted_squares) {
        // The data have eight digits.
        assert!((number(&row[3]) / squares - 1.0).abs() < 1e-6, "{row:?}");
    }
}

#[test]
fn corrections_of_images_and_their_ranges_are_told() {
    let site = Site::gusev();
    let page = site.page();
    let shifts = table(&page, "Shift of the camera at the middle");
    let turns = table(&page, "Rotation of the camera at the middle");
    assert_eq!((shifts.len(), turns.len()), (2, 2));
    for ((shift, turn), image) in shifts.iter().zip(&turns).zip(&site.adjusted.images) {
        let at = |cell: &str, part: usize| cell.split(" ± ").nth(part).unwrap().to_owned();
        let mut square_m2 = [0.0; 2];
        for axis in 0..3 {
            agree(&at(&shift[1 + axis], 0), image.correction[3 * axis], 1);
            agree(&at(&shift[1 + axis], 1), image.sigmas[3 * axis], 1);
            let angle = image.correction[9 + 3 * axis] / RADIANS_PER_ARCSECOND;
            agree(&at(&turn[1 + axis], 0), angle, 1);
            square_m2[0] += image.correction[3 * axis].powi(2);
            square_m2[1] += number(&shift[4 + axis]).powi(2);
        }
        // Axes of the orbit turn the shift and keep its length, to the tenth of a metre of each number.
        assert!((square_m2[0].sqrt() - square_m2[1].sqrt()).abs() < 0.1);
        // The mission's misregistration is along the flight: pitch takes it up, as line times and positions may not.
        let turned = |axis: usize| number(&at(&turn[1 + axis], 0)).abs();
        assert!(turned(1) > turned(2), "{turn:?}");
    }
    let ranges = table(&page, "Ranges of shots");
    let taken: usize = ranges
        .iter()
        .map(|row| row[2].parse::<usize>().unwrap())
        .sum();
    assert_eq!(taken, site.adjusted.ranges.len());
    for row in &ranges {
        let residuals = site
            .adjusted
            .ranges
            .iter()
            .filter(|of| site.profiles[of.profile].id == row[0]);
        let values: Vec<f64> = residuals.map(|of| of.residual_m.value).collect();
        agree(&row[5], values.iter().sum::<f64>() / values.len() as f64, 3);
        // All shots of these profiles were fired near or in an image; the check's mean is close to theirs.
        let mut checked = site.ranges.profiles.iter();
        let checked = checked.find(|of| of.profile == row[0]).unwrap();
        let off_m = number(&row[3]) - checked.range_minus_distance_m.mean;
        assert!(off_m.abs() < 0.1, "{off_m} m");
    }
}

#[test]
fn what_cannot_be_trusted_is_said() {
    let site = Site::gusev();
    let page = site.page();
    let words = text(section(&page, SECTIONS[1]));
    let [east_m, north_m, up_m] = site.adjusted.heights.unwrap().mean_sigma_m;
    assert!(words.contains(&format!(
        "Relative registration is corrected; heights follow MOLA to {up_m:.1} m on average; position is known to \
         {east_m:.0} m east and {north_m:.0} m north, from orbit and attitude."
    )));
    // The surface controls tie points across the track in part: with its spacing of shots not all of them.
    let shown = table(
        &page,
        "Redundancy: fraction of a gross error that appears in the residual of its observation",
    );
    let across = shown
        .iter()
        .find(|row| row[0] == "tie point across the track")
        .unwrap();
    let mean = number(across[2].trim_end_matches(" %"));
    assert!((20.0..60.0).contains(&mean), "{mean}");
    let correlated = &site.adjusted.summary.correlated;
    let most = correlated.iter().map(|of| of.2.abs()).fold(0.0, f64::max);
    if correlated.is_empty() {
        assert!(words.contains(
            "No correlation of two unknowns of the adjustment exceeds 0.95 in magnitude."
        ));
    } else {
        let rows = table(&page, "Largest correlations");
        assert_eq!(rows.len(), correlated.len().min(12));
        agree(&number(&rows[0][0]).abs().to_string(), most, 4);
    }
    let blunders = table(&page, "Blunders");
    let found = |of: &&RejectedPoint| {
        use RejectionReason::{Blunder, Height};
        matches!(of.reason, Blunder { .. } | Height { .. })
    };
    let expected: Vec<&RejectedPoint> = site.adjusted.rejected.iter().filter(found).collect();
    assert_eq!(blunders.len(), expected.len());
    assert!(
        blunders
            .iter()
            .zip(expected)
            .all(|(row, of)| row[0] == of.id)
    );
}

#[test]
fn budgets_are_told_by_both_readings() {
    let site = Site::gusev();
    let page = site.page();
    let rows = table(&page, "Distance between the two footprints");
    let budgets = [&site.pairs[0], &site.adjusted_pairs[0]].map(|pair| pair.budget.clone());
    assert_eq!(rows.len(), 2);
    for (row, of) in rows.iter().zip(budgets.iter().flatten()) {
        agree(&row[3], of.along_px, 2);
        agree(&row[5], of.paper_average.planimetric_m, 2);
        agree(&row[6], of.paper_average.height_m, 2);
        agree(&row[7], of.equation_7.height_m, 2);
    }
    let GroundPart::Resolved { along_px } = budgets[0].as_ref().unwrap().ground else {
        unreachable!("misregistration of less than a spacing");
    };
    agree(&rows[0][4], along_px, 2);
    assert_eq!([&*rows[1][2], &*rows[1][4]], ["–", "–"]);
    // The total is the observed misregistration, and not one spacing.
    let observed_px = budgets[0].as_ref().unwrap().total_along_px.unwrap();
    agree(&rows[0][2], observed_px, 2);
    let pair = &site.pairs[0];
    let observed_m = observed_px * 0.5 * (pair.line_spacing_m[0] + pair.line_spacing_m[1]);
    let apart_m = pair.footprints.as_ref().unwrap().apart_m.unwrap();
    // The root mean square over footprints has their scatter as well.
    assert!(
        (observed_m / apart_m - 1.0).abs() < 0.02,
        "{observed_m} {apart_m}"
    );
    let spacing_m = pair.mola_spacing_m.unwrap();
    assert!(
        (observed_m / spacing_m - 1.0).abs() > 0.1,
        "{observed_m} {spacing_m}"
    );
}

#[test]
fn exact_shots_contribute_nothing_with_signs_and_much_as_published() {
    let site = Site::gusev();
    let page = site.page();
    let rows = table(&page, "The same with");
    let pair = &site.pairs[0];
    let budget = pair.budget.as_ref().unwrap();
    let pixel_m = 0.5 * (pair.line_spacing_m[0] + pair.line_spacing_m[1]);
    agree(&rows[0][3], budget.equation_5.along_px, 2);
    agree(&rows[0][5], budget.equation_5.point.planimetric_m, 2);
    agree(&rows[0][6], budget.equation_5.point.height_m, 2);
    // Means of opposite sign add up to the parallax of the tie points.
    let along_m = budget.equation_5.along_px * pixel_m;
    assert!(
        (along_m / pair.along_track_parallax_m - 1.0).abs() < 0.01,
        "{along_m}"
    );
    assert!(along_m > 1.3 * budget.along_px * pixel_m, "{along_m}");
    // The shots of this mission are exact. Three of its own standard deviations, some metres, by the tie points.
    let left_px = budget.equation_5.unexplained_px.unwrap();
    agree(&rows[0][4], left_px, 2);
    let sigma_m = pair.footprints.as_ref().unwrap().apart_sigma_m.unwrap();
    assert!(
        (left_px * pixel_m).abs() < 3.0 * sigma_m,
        "{left_px} {sigma_m}"
    );
    // Equations 6 and 7 assign them more than a hundred metres, which the page calls a flaw.
    let GroundPart::Resolved { along_px } = budget.ground else {
        unreachable!("orientation explains less than is observed");
    };
    assert!(along_px * pixel_m > 100.0, "{along_px}");
    assert!(
        section(&page, SECTIONS[2]).contains("This remainder is not the accuracy of the altimeter")
    );
}

#[test]
fn several_pairs_are_pooled_as_the_sites_of_the_paper() {
    let mut site = Site::gusev();
    assert_eq!(table(&site.page(), "The same with").len(), 2);
    let mut other = site.pairs[0].clone();
    other.images = other.images.map(|image| format!("{image}-b"));
    other.budget.as_mut().unwrap().total_along_px = None;
    site.pairs.push(other);
    let page = site.page();
    let rows = table(&page, "The same with");
    let last = &rows[rows.len() - 1];
    assert_eq!([&*last[0], &*last[2]], ["all: 2 pairs", "–"]);
    // Both pairs have the same tie points.
    agree(
        &last[3],
        site.pairs[0].budget.as_ref().unwrap().equation_5.along_px,
        2,
    );
}

/// Support data of a spacecraft, with the shortest tables; no page shows them.
fn support_of(platform: &str) -> SupportFile {
    let states = States {
        et_s: vec![0.0, 1.0],
        position_m: vec![Vector3::x() * 4e6; 2],
        velocity_m_s: vec![Vector3::zeros(); 2],
    };
    let rotations = Rotations {
        et_s: vec![0.0, 1.0],
        turning: vec![Matrix3::identity(); 2],
        rate_rad_s: vec![Vector3::zeros(); 2],
        constant: Matrix3::identity(),
    };
    SupportFile {
        name: "isd.json".to_owned(),
        bytes: 0,
        blake3: String::new(),
        platform: platform.to_owned(),
        has_laser: false,
        tables: SupportTables {
            position: states.clone(),
            sun: states,
            pointing: rotations.clone(),
            body_rotation: rotations,
        },
    }
}

#[test]
fn accuracy_by_the_values_of_an_unknown_spacecraft_is_withheld() {
    let mut site = Site::gusev();
    let heights = site.adjusted.heights.as_ref().unwrap();
    site.adjusted.other_reading = Some(Ok(OtherReading {
        attitude_clock_s: Some((0.41, 0.12)),
        mean_sigma_m: Some(heights.mean_sigma_m),
        moved_m: [10.0, 120.0, 1.0],
    }));
    assert!(text(lead(&site.page())).contains("m height"));
    let reason = |site: &Site| {
        site.with(|products| {
            let times = products.images.iter().map(|image| image.times);
            accuracy_withheld(products.config, times)
        })
    };
    // The accuracy of another spacecraft is in its file.
    let other = all_instruments()
        .iter()
        .find(|camera| !camera.spacecraft.has_laser())
        .unwrap();
    let own = site.times[0].instrument.clone();
    for times in &mut site.times {
        times.instrument = other.clone();
    }
    assert_eq!(reason(&site), None);
    for times in &mut site.times {
        times.instrument = own.clone();
        times.support = Some(support_of("LUNAR RECONNAISSANCE ORBITER"));
    }
    let withheld = reason(&site).unwrap();
    assert!(withheld.contains("position_sigma_m"), "{withheld}");
    let page = site.page();
    assert!(text(lead(&page)).contains("withheld"));
    assert!(!text(lead(&page)).contains("m height"));
    assert!(!page.contains("Ellipses: 1 σ"));
    assert!(page.contains("absolute accuracies are withheld"));
    assert!(page.contains("The accuracy of the position from relief is withheld"));
    let rows = table(&page, "Two readings");
    for row in &rows {
        assert!(!row[0].contains('±'), "{row:?}");
        assert_eq!(row[5..], ["withheld"; 3]);
    }
    assert_eq!(rows.len(), 2);
    // With values of its own the site states what follows from them.
    site.config.adjustment.position_sigma_m = Some([1_000.0, 1.0, 0.0]);
    site.config.adjustment.rotation_sigma_rad = Some([4e-4, 1e-5, 0.0]);
    let page = site.page();
    // Profiles are withheld from the surface as well, and predicted from it.
    for words in [
        "accuracies are withheld",
        "from relief is withheld",
        ">withheld<",
    ] {
        assert!(!page.contains(words), "{words}");
    }
    assert!(
        table(&page, "Two readings")
            .iter()
            .all(|row| row[5].starts_with('±'))
    );
}

#[test]
fn a_variance_component_outside_its_interval_is_shown_with_the_verdict() {
    let mut site = Site::gusev();
    let kind = CheckKind::VarianceComponents;
    let check = |site: &Site| {
        let checks = site.verdict().checks;
        checks.into_iter().find(|check| check.kind == kind).unwrap()
    };
    // 10 m a priori for ranges that scatter by millimetres: below the interval, on the first screen.
    let found = check(&site);
    assert_eq!(found.outcome, CheckOutcome::Pass);
    assert!(found.subject.contains("MOLA ranges 0.00"), "{found}");
    assert!(section(&site.page(), SECTIONS[1]).contains("below their interval"));
    // Above it: a remark with both numbers.
    let types = &mut site.adjusted.summary.types;
    let ranges = types
        .iter_mut()
        .find(|of| of.kind == ObservationType::MolaRange)
        .unwrap();
    ranges.variance_component = 1.5;
    let limit = ranges.variance_component_limits[1];
    assert_eq!(check(&site).outcome, CheckOutcome::Warning);
    let remarks = site.verdict().remarks.join("\n");
    let expected =
        format!("the variance component of MOLA ranges is 1.50, by chance at most {limit:.2}");
    assert!(remarks.contains(&expected), "{remarks}");
    assert!(section(&site.page(), SECTIONS[1]).contains("above their interval"));
}

#[test]
fn budgets_that_cannot_be_are_told_in_words() {
    let mut site = Site::gusev();
    site.pairs[0].budget.as_mut().unwrap().ground = GroundPart::NotResolvable;
    let fault = "the size of a pixel, metres, is 0, expected a positive number";
    site.adjusted_pairs[0].budget = Err(fault.to_owned());
    let page = site.page();
    let text = section(&page, SECTIONS[2]);
    assert!(text.contains(&format!("has no budget after the adjustment: {fault}.")));
    let rows = table(&page, "Distance between the two footprints");
    assert_eq!(rows.len(), 1);
    assert!(rows[0][4].contains("orientation explains more than is observed"));
}

#[test]
fn many_blunders_are_counted_and_their_names_stay_text() {
    let mut site = Site::gusev();
    site.adjusted.rejected = (0..33)
        .map(|index| RejectedPoint {
            kind: PointKind::Tie,
            index,
            id: format!("<i>{index}"),
            reason: RejectionReason::Blunder { standardised: 5.0 },
        })
        .collect();
    site.adjusted.summary.range_biases_m = vec![("gusev & co".to_owned(), -7.25, 0.125)];
    site.adjusted.images[0].time_bias_s = Some((-0.0425, 0.001));
    site.adjusted.summary.correlated.clear();
    let page = site.page();
    let text = section(&page, SECTIONS[1]);
    assert_eq!(table(&page, "Blunders").len(), 20);
    assert!(text.contains("And 13 more.") && text.contains("&lt;i&gt;19") && !text.contains("<i>"));
    assert!(text.contains("−7.250 ± 0.125") && text.contains("gusev &amp; co"));
    assert!(text.contains("−42.50 ± 1.00"));
    assert!(text.contains("No correlation of two unknowns of the adjustment"));
}

#[test]
fn images_without_a_common_tie_point_are_said_to_be_so() {
    let mut site = Site::gusev();
    site.pairs.clear();
    site.adjusted_pairs.clear();
    let page = site.page();
    assert!(section(&page, SECTIONS[0]).contains("No two images share tie points"));
    assert!(!page.contains(&format!("id=\"{}\"", SECTIONS[2])));
    // Heights by MOLA need no pair; how far apart images are does.
    assert!(lead(&page).contains("<dt>Heights against MOLA</dt>"));
    assert!(!lead(&page).contains("<dt>Between images, along track</dt>"));
}

#[test]
fn tie_points_tell_the_misregistration_where_no_footprint_is_in_both_images() {
    let mut site = Site::gusev();
    // In one of the two states is enough: the two numbers of a sentence are of one kind.
    let adjusted = site.adjusted_pairs[0].footprints.as_mut().unwrap();
    (adjusted.apart_m, adjusted.apart_sigma_m) = (None, None);
    adjusted.profiles.clear();
    let (before_m, after_m) = (
        site.pairs[0].along_track_parallax_m,
        site.adjusted_pairs[0].along_track_parallax_m,
    );
    let page = site.page();
    let words = section(&page, SECTIONS[0]);
    assert!(
        words.contains("along track: the two positions of a tie point were")
            && words.contains(&format!("({before_m:.0} m) apart before the adjustment"))
            && words.contains(&format!("({after_m:.1} m)")),
        "{words}"
    );
    let before = site.pairs[0].footprints.as_mut().unwrap();
    (before.apart_m, before.apart_sigma_m) = (None, None);
    before.profiles.clear();
    before.outside = 1;
    let page = site.page();
    let text = section(&page, SECTIONS[0]);
    assert!(text.contains("No footprint is in both images."));
    assert!(text.contains("1 footprint omitted: outside an image or the tie-point area."));
}

#[test]
fn a_site_without_tie_points_has_none_of_it() {
    let site = Site::gusev();
    let page = site
        .with(|products| {
            let mut products = *products;
            products.geometric = None;
            capabilities::page(&products)
        })
        .unwrap();
    for id in SECTIONS {
        assert!(!page.contains(id), "{id}");
    }
    assert!(!lead(&page).contains("Tie points lie"));
}
