//! Every number of the page that is marked with its place in the products, against what stands there; and that hardly
//! any number of a table is without a mark.

use std::{collections::BTreeMap, fs, path::Path};

use serde_json::Value;

use super::{
    common::json,
    copy, gusev,
    numbers::numbers,
    page::{assert_complete, text},
};

/// Tables of numbers that stand in no document, with what holds them instead.
const ELSEWHERE: [(&str, &str); 10] = [
    (
        "Images, one row each",
        "sums over single residuals; tests/report_geometric",
    ),
    (
        "Redundancy: fraction of a gross error",
        "means over single observations",
    ),
    ("Blunders", "words of a reason"),
    ("Rejected tie points", "counted by reason"),
    ("Ranges of shots fired", "means of parts of profiles"),
    ("Windows", "counted in footprints.csv"),
    ("Datum of the PEDR coordinates", "means over footprints"),
    ("Clock corrections", "the configuration"),
    ("Kernels with data of", "exchange/kernels.json, summed"),
    ("Stages; the number increases", "the program itself"),
];

/// Columns of numbers that follow from others of their row or from Parquet, by the table that they are in.
const DERIVED: [(&str, &str); 14] = [
    ("Correction of least spread", "best − configured"),
    (
        "Correction of least spread",
        "least spread at a scanned correction, m",
    ),
    ("Images (Table 2", "duration, s"),
    ("Images (Table 2", "range at the middle, km"),
    ("Images (Table 2", "emission, degrees"),
    ("RMSE of the polynomials", "order"),
    ("RMSE of the polynomials", "pointing, ″"),
    ("Profiles in the images", "lines"),
    ("Profiles in the images", "samples"),
    ("Observations by kind", "per observation"),
    (
        "Rejected shots inside a window",
        "share of the shots in windows",
    ),
    ("Shift of the camera", "along track, body-fixed"),
    ("Shift of the camera", "cross track"),
    ("Shift of the camera", "radial"),
];

/// A marked element: its text and its places, whole ones.
struct Marked {
    text: String,
    places: Vec<String>,
}

/// The value of an attribute in a tag.
fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let rest = tag.split(&format!(" {name}=\"")).nth(1)?;
    rest.split('"').next()
}

/// Every marked element of the page.
fn marked(page: &str) -> Vec<Marked> {
    let mut found = Vec::new();
    let mut row = String::new();
    for (at, _) in page.match_indices('<') {
        let piece = page[at + 1..].split('<').next().unwrap();
        if piece.starts_with("tr") || piece.starts_with("/tr") {
            attribute(piece, "data-in")
                .unwrap_or_default()
                .clone_into(&mut row);
        }
        let Some(places) = attribute(piece, "data-from") else {
            continue;
        };
        // Up to the end of the same element; marked ones hold no others of their name.
        let name = piece.split(' ').next().unwrap();
        let html = page[at..].split(&format!("</{name}>")).next().unwrap();
        let whole = |place: &str| {
            let (size, place) = place
                .strip_prefix('|')
                .map_or(("", place), |rest| ("|", rest));
            if place.contains('#') {
                format!("{size}{place}")
            } else {
                format!("{size}{row}{place}")
            }
        };
        found.push(Marked {
            text: text(html),
            // A row without a place has cells that no document tells.
            places: places
                .split(' ')
                .map(whole)
                .filter(|place| place.contains('#'))
                .collect(),
        });
    }
    found
}

/// What the products in `folder` have at `place`; `None` where there is nothing.
fn told(documents: &mut BTreeMap<String, Value>, folder: &Path, place: &str) -> Option<f64> {
    let (size, place) = place
        .strip_prefix('|')
        .map_or((false, place), |rest| (true, rest));
    let (file, pointer) = place.split_once('#').unwrap();
    let (pointer, factor) = pointer.split_once('*').unwrap_or((pointer, "1"));
    let pointer = pointer.replace("%20", " ").replace("%25", "%");
    let document = documents
        .entry(file.to_owned())
        .or_insert_with(|| json(&folder.join(file)));
    let value = document.pointer(&pointer)?.as_f64()?;
    let value = value * factor.parse::<f64>().unwrap();
    Some(if size { value.abs() } else { value })
}

/// Every marked number that is not that of its product, in words.
fn disagreements(page: &str, folder: &Path) -> Vec<String> {
    let mut documents = BTreeMap::new();
    let mut wrong = Vec::new();
    for Marked { text, places } in marked(page) {
        if places.is_empty() {
            continue;
        }
        let expected: Vec<Option<f64>> = places
            .iter()
            .map(|place| told(&mut documents, folder, place))
            .collect();
        let found = numbers(&text);
        if found.is_empty() && expected.iter().all(Option::is_none) {
            continue;
        }
        let agree = found.len() == expected.len()
            && found
                .iter()
                .zip(&expected)
                .all(|((found, decimals), expected)| {
                    // Half of the last digit that is shown, and what a double cannot hold of a half.
                    let half = 0.5 * 10_f64.powi(-decimals);
                    expected.is_some_and(|value| {
                        (found - value).abs() <= half + 1e-9 * value.abs().max(1.0)
                    })
                });
        if !agree {
            wrong.push(format!("{text}: {places:?} has {expected:?}"));
        }
    }
    wrong
}

fn page_of(folder: &Path) -> String {
    fs::read_to_string(folder.join("report/index.html")).unwrap()
}

#[test]
fn every_marked_number_is_that_of_its_product() {
    let page = page_of(&gusev());
    assert_complete(&page);
    let wrong = disagreements(&page, &gusev());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let marked = marked(&page);
    // Key numbers, checks, profiles, spacing, ranges, scans, images, models, registration, pairs, adjustment, the papers' tables, kernels.
    let documents: std::collections::BTreeSet<&str> = marked
        .iter()
        .flat_map(|of| &of.places)
        .map(|place| place.trim_start_matches('|').split('#').next().unwrap())
        .collect();
    assert!(
        marked.len() > 400 && documents.len() == 8,
        "{} {documents:?}",
        marked.len()
    );
}

#[test]
fn a_changed_product_is_found_wherever_the_page_shows_it() {
    let copy = copy();
    let folder = copy.path().join("elsewhere");
    let page = page_of(&folder);
    assert!(disagreements(&page, &folder).is_empty());
    // One value of each kind of table, and what the page shows of it at least once.
    let changes = [
        ("manifest.json", "/verdict/checks/0/value"),
        ("manifest.json", "/counts/footprints"),
        ("manifest.json", "/kernels/0/bytes"),
        ("ranges.json", "/profiles/1/range_minus_distance_m/mean"),
        ("ranges.json", "/profiles/0/bias_scan/best_s"),
        ("registration.json", "/images/0/profiles/0/inside"),
        ("registration.json", "/images/1/methods/0/evaluations/mean"),
        ("adjustment.json", "/after/heights/above_surface_m/median"),
        ("adjustment.json", "/before/pairs/0/along_track_parallax_m"),
        ("adjustment.json", "/adjustment/images/0/correction/3"),
        ("adjustment.json", "/adjustment/summary/types/0/redundancy"),
        ("adjustment.json", "/adjustment/summary/sigma0"),
        ("adjustment.json", "/adjustment/heights/mean_sigma_m/2"),
    ];
    for (file, pointer) in changes {
        let path = folder.join(file);
        let original = fs::read(&path).unwrap();
        let mut document = json(&path);
        let value = document
            .pointer_mut(pointer)
            .unwrap_or_else(|| panic!("{pointer}"));
        // Two more and a tenth more: beyond the rounding of any number that is shown.
        let other = 1.1 * value.as_f64().unwrap() + 2.0;
        *value = other.into();
        fs::write(&path, document.to_string()).unwrap();
        let wrong = disagreements(&page, &folder);
        assert!(
            wrong.iter().any(|words| words.contains(pointer)),
            "{file}{pointer}: {wrong:?}"
        );
        fs::write(&path, original).unwrap();
    }
}

#[test]
fn hardly_a_number_of_a_table_is_without_its_place() {
    let page = page_of(&gusev());
    let mut without = Vec::new();
    for table in page.split("<caption>").skip(1) {
        let caption = table.split("</caption>").next().unwrap();
        if ELSEWHERE
            .iter()
            .any(|(start, _)| caption.starts_with(start))
        {
            continue;
        }
        let table = table.split("</table>").next().unwrap();
        let (head, body) = table.split_once("<tbody>").unwrap();
        let columns: Vec<String> = head.split("<th ").skip(1).map(column).collect();
        for row in body.lines().filter(|row| row.starts_with("<tr")) {
            let cells = row.split("<t").skip(2);
            for (column, cell) in columns.iter().zip(cells) {
                let is_number =
                    cell.contains("class=\"number") && !numbers(&column_text(cell)).is_empty();
                let derived = DERIVED
                    .iter()
                    .any(|(start, of)| caption.starts_with(start) && column == of);
                if is_number && !cell.contains(" data-from=\"") && !derived {
                    without.push(format!("{caption}: {column}"));
                }
            }
        }
    }
    without.dedup();
    assert!(without.is_empty(), "{without:#?}");
}

/// Paragraphs and lists with numbers that no document tells, by their first words, with what holds them instead.
const TEXTS: [(&str, &str); 21] = [
    ("Relief alone determines", "a test of this sentence below"),
    ("Surface kriged", "300 m is part of what roughness means"),
    ("At the tie points, the surface", "names of profiles"),
    ("E02-00665 and E02-01453", "the table below has the same"),
    ("Variance component", "levels of tests"),
    ("Shown: redundancy number", "levels of tests"),
    (
        "No correlation of two",
        "the limit of the listed correlations",
    ),
    ("Light time", "spans over images; tests/light_time"),
    ("Limits for order 2", "the configuration"),
    ("Kept: class", "the configuration"),
    ("Datum from the version", "a constant"),
    ("Tolerance", "the method"),
    ("D = √", "a formula"),
    ("The best time-tag correction", "the method"),
    ("1 PEDR file", "a note of the manifest"),
    ("−6.69 m largest mean", "the number of a profile"),
    ("ap18933l.b:", "a note of the manifest"),
    ("ap19043k.b:", "a note of the manifest"),
    ("image E02-", "a note of the manifest"),
    (
        "an attitude error that all",
        "limits of the beam, in the table of checks",
    ),
    (
        "an orbit error along",
        "the configuration; in the table of limits of ranges",
    ),
];

#[test]
fn hardly_a_number_of_the_text_is_without_its_place() {
    let page = page_of(&gusev());
    // Tables and figures have tests of their own; what is folded away says what the manifest does.
    let mut running = page.split("<main>").nth(1).unwrap().to_owned();
    for (start, end) in [
        ("<table", "</table>"),
        ("<figure", "</figure>"),
        ("<details class=\"more\"", "</details>"),
    ] {
        running = without(&running, start, end);
    }
    let mut unmarked = Vec::new();
    let mut marked = 0;
    for (start, end) in [("<p", "</p>"), ("<li", "</li>"), ("<dd", "</dd>")] {
        for piece in running.split(start).skip(1) {
            let piece = format!("{start}{}", piece.split(end).next().unwrap());
            marked += piece.matches(" data-from=").count();
            let rest = text(&without(&piece, "<span data-from", "</span>"));
            let is_known = TEXTS
                .iter()
                .any(|(words, _)| text(&piece).starts_with(words));
            let is_command = piece.contains("<code>") || piece.contains("BLAKE3");
            if !numbers(&rest).is_empty() && !is_known && !is_command {
                unmarked.push(text(&piece));
            }
        }
    }
    assert!(unmarked.is_empty(), "{unmarked:#?}");
    // First screen, heights, tie points, adjustment, limits of ranges.
    assert!(marked > 30, "{marked}");
}

/// `html` without the pieces from `start` to `end`, which hold no others of their kind.
fn without(html: &str, start: &str, end: &str) -> String {
    let mut pieces = html.split(start);
    let mut rest = pieces.next().unwrap().to_owned();
    for piece in pieces {
        rest += piece.split_once(end).map_or("", |(_, rest)| rest);
    }
    rest
}

/// The head of a column.
fn column(html: &str) -> String {
    text(&format!("<th {}", html.split("</th>").next().unwrap()))
}

fn column_text(html: &str) -> String {
    text(&format!("<t{}", html.split("</t").next().unwrap()))
}

#[test]
fn the_sentence_on_relief_has_the_numbers_of_the_adjustment() {
    let folder = gusev();
    let page = page_of(&folder);
    let mut paragraphs = page.split("<p").map(text);
    let paragraph = paragraphs.find(|of| of.contains("Relief alone determines"));
    let paragraph = paragraph.unwrap();
    let sentence = paragraph.split_inclusive("used.").next().unwrap();
    let relief = &json(&folder.join("adjustment.json"))["adjustment"]["relief"];
    let compared = &relief["choice"]["compared"];
    let axes = [
        &relief["sigma_m"],
        &compared["without_sigma_m"],
        &compared["with_sigma_m"],
    ];
    let expected = axes.into_iter().flat_map(|of| of.as_array().unwrap());
    let expected: Vec<f64> = expected.map(|of| of.as_f64().unwrap()).collect();
    let shown = numbers(sentence);
    assert!(
        shown.len() == 6 && expected.len() == 6,
        "{sentence} {expected:?}"
    );
    for ((shown, _), expected) in shown.iter().zip(&expected) {
        // Whole metres.
        assert!((shown - expected).abs() <= 0.5, "{sentence} {expected:?}");
    }
    assert_eq!(
        relief["used"] == true,
        sentence.contains("; relief is used")
    );
}

#[test]
fn the_page_over_all_sites_says_what_the_manifests_hold() {
    let out = gusev().parent().unwrap().to_owned();
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    let wrong = disagreements(&page, &out);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Shots, profiles, images, heights, images apart, ranges.
    assert_eq!(marked(&page).len(), 6);
}
