//! The report page of a small site: what its first lines say, and that nothing in it is lost or leaks.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly and write as they like"
)]

use crate::common::{
    mission::site_run,
    page::{csv, lead, section},
    products_site as fixture,
};

use std::{collections::BTreeSet, fs, path::Path};

use areograph::{capabilities, geom::statistics::Summary, stages::judge::CheckKind};
use areograph_testing::replace;

use crate::qgis;
use fixture::{SHOTS, Site};

/// The page, also left below `target`, where a person may look at it.
fn page(name: &str, site: &Site, image: bool) -> String {
    let page = site.with(image, capabilities::page).unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report_page");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join(format!("{name}.html")), &page).unwrap();
    page
}

/// What stands between `start` and the next `end` after each `start`.
fn between<'a>(text: &'a str, start: &'a str, end: char) -> impl Iterator<Item = &'a str> {
    text.split(start)
        .skip(1)
        .map(move |rest| rest.split(end).next().unwrap())
}

#[test]
fn a_failed_range_check_is_said_in_the_first_lines() {
    let mut site = Site::small();
    site.ranges.profiles[0].range_minus_distance_m.mean = 11.0;
    site.ranges.profiles[0].mean_without_outliers_m = 11.0;
    let page = page("small", &site, true);
    let lead = lead(&page);
    assert!(lead.contains("class=\"verdict invalid\""));
    assert!(lead.contains("<strong>Invalid, for one reason:</strong>"));
    assert!(lead.contains("<li>profile antimeridian/9019: mean of range − distance 11.000 m"));
    assert!(lead.contains("skipped records: ap19019l.b record 4"));
    assert!(page.contains("beyond the limit"));
    // The checks are in the lead too, the worst first, each with a link to its section; those that pass are folded.
    let [_, checks] = lead
        .splitn(2, "<caption>Checks</caption>")
        .collect::<Vec<_>>()[..]
    else {
        panic!("no checks in {lead}");
    };
    let (shown, folded) = checks.split_once("other checks pass</summary>").unwrap();
    assert!(!shown.contains("outcome valid") && folded.contains("outcome valid"));
    // A section is unfolded if one of its checks fails or warns, and only then.
    let sections = page.split("<details class=\"more whole\"").skip(1);
    let summaries: Vec<&str> = sections
        .map(|of| of.split("</summary>").next().unwrap())
        .collect();
    for summary in &summaries {
        let is_open = summary.starts_with(" open>");
        let needs = summary.contains("outcome invalid") || summary.contains("outcome remarks");
        assert_eq!(is_open, needs, "{summary}");
    }
    assert!(
        summaries.iter().any(|of| of.contains("fails</span>")),
        "{summaries:?}"
    );
    assert!(
        summaries.iter().any(|of| of.contains("outcome valid")),
        "{summaries:?}"
    );
    assert!(section(&page, "range-check").contains(" open>"));
    assert!(checks.contains("<a href=\"#range-check\">Range − distance (mean)</a>"));
}

#[test]
fn the_longest_profile_is_one_whose_ranges_are_tested() {
    let mut site = Site::small();
    let mut blind = site.ranges.profiles[0].clone();
    blind.profile = "blind/1".to_owned();
    blind.shots *= 10;
    (blind.range_minus_distance_m, blind.decoding_m) = (Summary::of(&[]), Summary::of(&[]));
    let longest = |site: &Site| {
        let checks = site.with(true, |products| products.verdict.checks.clone());
        let check = checks
            .into_iter()
            .find(|check| check.kind == CheckKind::Shots);
        check.unwrap().subject
    };
    site.ranges.profiles.push(blind.clone());
    assert_eq!(longest(&site), site.ranges.profiles[0].profile);
    // Where no range is tested, it is the longest of all.
    site.ranges.profiles = vec![blind.clone()];
    assert_eq!(longest(&site), blind.profile);
}

#[test]
fn errors_that_nothing_shows_are_listed_by_their_reason() {
    let site = Site::small();
    let untested = site.with(true, |products| products.verdict.untested.clone());
    let reasons: BTreeSet<&str> = untested
        .iter()
        .map(|phrase| phrase.rsplit_once(" (").unwrap().1)
        .collect();
    assert_eq!(reasons.len(), untested.len(), "{untested:?}");
    let camera = "rotation about the line of sight; focal length, distortion and sample direction of the camera; first \
                  sample and summing of the labels (no tie points were adjusted)";
    assert!(
        untested.iter().any(|phrase| phrase == camera),
        "{untested:?}"
    );
    assert!(
        untested[0].contains("no beam tests the attitude"),
        "{untested:?}"
    );
    let page = page("untested", &site, true);
    let (_, list) = page.split_once("Not tested by the data:").unwrap();
    let (list, _) = list.split_once("</ul>").unwrap();
    assert_eq!(list.matches("<li>").count(), untested.len(), "{list}");
}

#[test]
fn what_came_from_files_stays_text() {
    let page = page("escaped", &Site::small(), true);
    assert!(page.contains("One orbit &amp; one image &lt;made by hand&gt;"));
    assert!(page.contains("record 4: &lt;script&gt;alert(1)&lt;/script&gt; &amp; more"));
    assert!(page.contains("class 0 &lt;cloud&gt;"));
    assert!(!page.contains("<script"));
    assert!(page.contains(">naif0012.tls</th>"));
    assert!(page.contains("<li>ap19019l.b: already in IAU 2000"));
}

#[test]
fn nothing_is_fetched_and_every_plot_is_told_in_words_and_numbers() {
    let page = page("alone", &Site::small(), true);
    for outside in [
        "src=",
        "url(",
        "@import",
        "<iframe",
        "<link rel=\"stylesheet\"",
    ] {
        assert!(!page.contains(outside), "{outside}");
    }
    for target in between(&page, "href=\"", '"') {
        let inside = ["#", "data:", "../", "figures/", "explore.html"]
            .iter()
            .any(|start| target.starts_with(start));
        assert!(inside, "{target:.60}");
    }
    let ids: Vec<&str> = between(&page, " id=\"", '"').collect();
    let unique: BTreeSet<&str> = ids.iter().copied().collect();
    assert_eq!(ids.len(), unique.len(), "names inside the page are unique");
    for named in between(&page, "aria-labelledby=\"", '"') {
        for id in named.split(' ') {
            assert!(unique.contains(id), "{id}");
        }
    }
    for anchor in between(&page, "href=\"#", '"') {
        assert!(unique.contains(anchor), "{anchor}");
    }
    // Residuals, scan, image, image plane, convergence, map and the kernels of one stretch of time.
    assert_eq!(page.matches("<svg").count(), 7);
    assert_eq!(page.matches("<svg role=\"img\"").count(), 7);
    assert_eq!(page.matches("href=\"data:text/csv").count(), 7);
    // Every shot is in the data of the residuals, once as residual and once as angle.
    let name = "download=\"range-distance-along-antimeridian-9019.csv\" href=\"";
    let residuals = between(&page, name, '"').next().unwrap();
    let lines = residuals.matches("%0A").count();
    let trend_ends = 2;
    assert_eq!(lines, 1 + 2 * SHOTS as usize + trend_ends);
}

#[test]
fn a_gap_in_attitude_is_seen_and_measured() {
    let page = page("gap", &Site::small(), true);
    let picture = page.split("<figure id=\"kernels-at-").nth(1).unwrap();
    let caption = between(picture, "<figcaption>", '\n').next().unwrap();
    assert!(
        caption.contains(
            "Of the requested time, margins included, 2.000 s are not covered, the first 2.000 s at"
        ),
        "{caption:.300}"
    );
    // One red bar for the gap; the swatch of its key is not part of the picture.
    let svg = picture.split("</svg>").next().unwrap();
    assert_eq!(svg.matches("fill=\"#C10019\"").count(), 1);
}

/// Words that a page shows as it opens, without tables, figures drawn as SVG, and text that is folded.
fn words_as_opened(page: &str) -> usize {
    let mut text = String::new();
    // Elements whose text is not shown, and how many of them are open at a place.
    let (mut hidden, mut folded, mut summary) = (0_i32, Vec::new(), false);
    let body = page.split("<body").nth(1).unwrap();
    for part in body.split('<').skip(1) {
        let (tag, after) = part.split_once('>').unwrap();
        let name = tag
            .split([' ', '/'])
            .find(|of| !of.is_empty())
            .unwrap_or("");
        let is_end = tag.starts_with('/');
        match name {
            "table" | "svg" | "style" => hidden += if is_end { -1 } else { 1 },
            "details" if is_end => {
                folded.pop();
            }
            "details" => folded.push(!tag.split(' ').any(|of| of == "open")),
            "summary" => summary = !is_end,
            _ => {}
        }
        let own = folded.len() - usize::from(summary && !folded.is_empty());
        if hidden == 0 && !folded[..own].iter().any(|is_folded| *is_folded) {
            text += after;
        }
        text.push(' ');
    }
    assert!(hidden == 0 && folded.is_empty(), "{hidden} {folded:?}");
    text.split_whitespace().count()
}

/// All figures count heights from the same surface. The areoid lies 86 m below the ellipsoid at this site.
#[test]
fn heights_of_tie_points_are_above_the_areoid() {
    let folder = site_run("isidis");
    let (equator_m, pole_m) = (3_396_190.0_f64, 3_376_200.0_f64);
    let ellipsoid_m = |latitude_rad: f64| {
        let (sine, cosine) = latitude_rad.sin_cos();
        equator_m * pole_m / (pole_m * cosine).hypot(equator_m * sine)
    };
    let footprints = qgis::table(&folder.join("footprints.parquet"));
    let [areoids_m, latitudes] =
        ["areoid_radius_m", "latitude_deg"].map(|name| qgis::column(&footprints, name));
    let above_m: Vec<f64> = areoids_m
        .iter()
        .zip(&latitudes)
        .map(|(areoid_m, latitude)| areoid_m - ellipsoid_m(latitude.to_radians()))
        .collect();
    let areoid_m = Summary::of(&above_m).median;
    assert!(areoid_m < -80.0, "{areoid_m}");
    let ties = qgis::table(&folder.join("ties.parquet"));
    let [x, y, z] =
        ["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"].map(|name| qgis::column(&ties, name));
    let heights_m = (0..x.len()).filter(|row| x[*row].is_finite()).map(|row| {
        let across_m = x[row].hypot(y[row]);
        across_m.hypot(z[row]) - ellipsoid_m(z[row].atan2(across_m)) - areoid_m
    });
    let expected_m = Summary::of(&heights_m.collect::<Vec<f64>>()).median;
    let page = fs::read_to_string(folder.join("report/index.html")).unwrap();
    let rows = csv(&page, "heights-of-tie-points-and-of-the-mola-surface");
    let drawn = rows.iter().filter(|row| {
        row[0] == "\"above the areoid" && row.iter().any(|cell| cell == "after the adjustment")
    });
    let drawn_m: Vec<f64> = drawn
        .map(|row| row.last().unwrap().parse().unwrap())
        .collect();
    assert!(drawn_m.len() > 50, "{}", drawn_m.len());
    // Metres: the areoid varies by 1 m over the site.
    let found_m = Summary::of(&drawn_m).median;
    assert!((found_m - expected_m).abs() < 2.0, "{found_m} {expected_m}");
}

/// A report as it opens is short; `scripts/look` measures its height.
#[test]
fn a_report_opens_with_at_most_1200_words() {
    let few = "<body><p>one two</p><details><summary>three</summary>four</details><details open><summary>five</summary>six \
               <table><td>seven</td></table></details><svg>eight</svg>";
    assert_eq!(words_as_opened(few), 5);
    for site in ["eos_chasma", "gusev_context", "gusev_crater", "isidis"] {
        let page = fs::read_to_string(site_run(site).join("report/index.html")).unwrap();
        let words = words_as_opened(&page);
        println!("{site}: {words} words");
        assert!((100..=1200).contains(&words), "{site}: {words}");
    }
}

#[test]
fn many_profiles_share_plots_and_the_page_stays_small() {
    let mut site = Site::small();
    let (profile, ranges) = (site.profiles[0].clone(), site.ranges.profiles[0].clone());
    let shots = site.ranges.shots.clone();
    for copy in 1..300_u32 {
        let mut profile = profile.clone();
        profile.id = format!("antimeridian/{}", 9019 + copy);
        let mut ranges = ranges.clone();
        ranges.profile.clone_from(&profile.id);
        site.profiles.push(profile);
        site.ranges.profiles.push(ranges);
        let all = &mut site.ranges.shots;
        all.profile.extend(shots.profile.iter().map(|_| copy));
        all.row.extend(&shots.row);
        all.range_minus_distance_m
            .extend(&shots.range_minus_distance_m);
        all.range_minus_distance_crossover_m
            .extend(&shots.range_minus_distance_crossover_m);
        all.decoding_m.extend(&shots.decoding_m);
        all.spacecraft_radial_m.extend(&shots.spacecraft_radial_m);
        all.spacecraft_along_m.extend(&shots.spacecraft_along_m);
        all.spacecraft_cross_m.extend(&shots.spacecraft_cross_m);
        all.outlier.extend(&shots.outlier);
    }
    let page = page("many", &site, false);
    // All profiles in one plot and the worst six alone, each with its scan; one map, one stretch of kernels.
    assert_eq!(page.matches("<svg").count(), 1 + 6 + 6 + 1 + 1);
    // The verdict stays on one screen, however many profiles break their limit.
    assert!(page.contains("Invalid, for 300 reasons:"));
    assert!(page.contains("And 296 more; ../manifest.json lists all."));
    assert!(page.len() < 2_000_000, "{} bytes", page.len());
}

#[test]
fn the_map_tells_heights_of_shots_that_it_does_not_draw() {
    let mut site = Site::small();
    let shot = site.footprints.row(0);
    for _ in 0..10_000 {
        site.footprints.push(&shot);
    }
    // 10060 shots: every third is drawn, the first, the fourth …
    replace(
        &mut site.footprints.radius_crossover_m,
        1,
        shot.radius_crossover_m + 4_000.0,
    );
    let page = page("high", &site, false);
    assert!(page.contains(
        "10\u{202f}060 footprints (dots, profiles named by orbit), −1499 to 2501 m above the areoid."
    ));
}

#[test]
fn maps_work_at_the_pole_and_across_the_antimeridian() {
    for (name, site, longitude) in [
        ("antimeridian", Site::small(), "180° E"),
        ("polar", Site::polar(), "270° E"),
    ] {
        let page = page(name, &site, true);
        let map = page
            .split("<figure id=\"windows-footprints-and-images\"")
            .nth(1)
            .unwrap();
        let svg = map.split("</svg>").next().unwrap();
        assert!(svg.contains(longitude), "{name}");
        // All shots are on the sheet: dots whose centre lies inside the picture.
        let width = between(svg, "viewBox=\"0 0 ", ' ').next().unwrap();
        let width: f64 = width.parse().unwrap();
        let centres: Vec<f64> = between(svg, "<circle ", '>')
            .filter(|circle| circle.contains(" r=\"2\""))
            .map(|circle| {
                between(circle, "cx=\"", '"')
                    .next()
                    .unwrap()
                    .parse()
                    .unwrap()
            })
            .collect();
        assert_eq!(centres.len(), SHOTS as usize, "{name}");
        assert!(centres.iter().all(|x| (0.0..=width).contains(x)), "{name}");
    }
}

#[test]
fn a_site_without_shots_and_images_has_a_page_too() {
    let page = page("empty", &Site::empty(), false);
    assert!(page.contains("Invalid, for one reason:"));
    assert!(page.contains("no footprint in any window"));
    assert_eq!(page.matches("<svg").count(), 2); // the window and the kernels
}
