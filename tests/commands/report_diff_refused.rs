//! Which outputs `areograph report diff` compares, and what it refuses.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;
use crate::report_diff::fixture;

use std::fs;

use common::{case::Case, golden::assert_messages, mission};
use fixture::{after_a_first_run, copy_products, diff};
use serde_json::Value;

#[test]
fn every_site_of_two_outputs_is_compared() {
    let case = after_a_first_run();
    for (folder, site) in [("before", "gone"), ("out", "new")] {
        copy_products(&case.path("before/case"), &case.path(folder).join(site));
    }
    let printed = diff(&case, &["before", "out"]);
    assert!(
        printed.starts_with("exit 0\ncase: nothing changed\n"),
        "{printed}"
    );
    assert!(
        printed.ends_with("gone: only in A, not compared\nnew: only in B, not compared\n"),
        "{printed}"
    );
    let limited = diff(&case, &["before", "out", "--limit-m", "1"]);
    assert!(limited.starts_with("exit 5\n"), "{limited}");
    assert!(
        limited.contains("gone: BEYOND THE LIMIT: only in A, so limits cannot be applied"),
        "{limited}"
    );
    // A site that cannot be read does not hide the others.
    copy_products(&case.path("before/case"), &case.path("out/gone"));
    case.write("out/gone/kernels.tm", "mine");
    let printed = diff(&case, &["before", "out"]);
    assert!(
        printed.starts_with("exit 3\ncase: nothing changed\n"),
        "{printed}"
    );
    assert!(
        printed.contains("error: out/gone/kernels.tm: has 4 bytes"),
        "{printed}"
    );
    let mut command = case.areograph();
    command.args(["report", "diff", "before", "out", "--json"]);
    let answer: Value = serde_json::from_slice(&command.output().unwrap().stdout).unwrap();
    assert_eq!(answer["sites"][1]["exit_code"], 3);
    assert_eq!(answer["only_in_b"], serde_json::json!(["new"]));
    common::assert_keeps_schema(&answer, "difference");
}

type Spoil = fn(&Case);

#[test]
fn outputs_that_cannot_be_compared_are_refused() {
    let case = after_a_first_run();
    let renew = || {
        let _ = fs::remove_dir_all(case.path("out"));
        copy_products(&case.path("before/case"), &case.path("out/case"));
    };
    let spoiled: [(&str, Spoil); 8] = [
        ("no folder", |case| {
            fs::remove_dir_all(case.path("out")).unwrap();
        }),
        ("empty folder", |case| {
            fs::remove_dir_all(case.path("out")).unwrap();
            fs::create_dir(case.path("out")).unwrap();
        }),
        ("no manifest", |case| {
            fs::remove_file(case.path("out/case/manifest.json")).unwrap();
        }),
        ("stopped early", |case| {
            fs::remove_file(case.path("out/case/manifest.json")).unwrap();
            fs::create_dir(case.path("out/case/.cache")).unwrap();
        }),
        ("half-made", |case| {
            case.write("out/case/.publishing", "kernels.tm");
        }),
        ("no JSON", |case| case.write("out/case/manifest.json", "{")),
        ("another site", |case| {
            let manifest = "out/case/manifest.json";
            case.replace(manifest, "\"site\": \"case\"", "\"site\": \"other\"");
        }),
        ("no common site", |case| {
            fs::rename(case.path("out/case"), case.path("out/other")).unwrap();
        }),
    ];
    let mut told = Vec::new();
    for (what, spoil) in spoiled {
        renew();
        spoil(&case);
        told.push((what, diff(&case, &["before", "out"])));
    }
    renew();
    let one_folder = diff(&case, &["before", "before/../before"]);
    told.push(("one folder", one_folder));
    let one_and_several = diff(&case, &["before/case", "out"]);
    told.push(("one and several", one_and_several));
    assert_messages("report_diff_refused", &told);
}

/// A page replaces an earlier page or nothing, and makes no folders.
#[test]
#[cfg(unix)]
fn pages_are_written_over_pages_that_are_no_products() {
    use std::os::unix::fs::symlink;
    let case = after_a_first_run();
    case.write("notes.html", "old");
    symlink("notes.html", case.path("link.html")).unwrap();
    symlink("out/case", case.path("elsewhere")).unwrap();
    fs::create_dir(case.path("folder")).unwrap();
    mission::succeed(std::process::Command::new("mkfifo").arg(case.path("pipe")));
    let before = mission::products(&case.path("out"));
    let page = |place: &str| diff(&case, &["before", "out", "--page", place]);
    let places = [
        "folder",
        "link.html",
        "pipe",
        "/dev/null",
        "none/page.html",
        "notes.html",
        "kernels/nav.tm",
        "notes.html/page.html",
        "out/case/report/index.html",
        "out/case/new.html",
        "elsewhere/new.html",
        "out/index.html",
    ];
    let mut told: Vec<(&str, String)> = places.iter().map(|place| (*place, page(place))).collect();
    let mut compare = case.areograph();
    compare.args(["--quiet", "kernels", "compare", "kernels/nav.tm"]);
    compare.args(["kernels/ipng.tm", "--page", "/dev/full"]);
    told.push(("kernels compare /dev/full", case.outcome(compare)));
    assert_messages("page_refused", &told);
    assert!(mission::products(&case.path("out")) == before);
    assert!(case.path("link.html").is_symlink() && !case.path("none").exists());
    assert_eq!(case.read("notes.html"), b"old");
    for place in ["new.html", "new.html", "out/difference.html"] {
        let outcome = page(place);
        assert!(outcome.starts_with("exit 0\n"), "{outcome}");
        assert!(case.read(place).starts_with(b"<!DOCTYPE html>"), "{place}");
    }
}

#[test]
fn products_that_contradict_the_manifest_are_refused() {
    let case = after_a_first_run();
    copy_products(&case.path("before/case"), &case.path("aside/case"));
    let manifest: Value = serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap();
    let message = |path: &str, found: &str| {
        let mut products = manifest["products"].as_array().unwrap().iter();
        let product = products.find(|product| product["path"] == path).unwrap();
        let hash = &product["blake3"].as_str().unwrap()[..12];
        let bytes = &product["bytes"];
        format!(
            "exit 3\nerror: aside/case/{path}: {found}; expected {bytes} bytes with the BLAKE3 hash {hash}, \
             as in manifest.json\n  what to do: run areograph again on the configuration file of these products: damaged products are rewritten\n"
        )
    };
    case.write("aside/case/footprints.parquet", "mine");
    let hash = &blake3::hash(b"mine").to_hex()[..12];
    let expected = message(
        "footprints.parquet",
        &format!("has 4 bytes with the hash {hash}"),
    );
    assert_eq!(diff(&case, &["aside", "out"]), expected);
    fs::remove_file(case.path("aside/case/footprints.parquet")).unwrap();
    let expected = message("footprints.parquet", "is missing");
    assert_eq!(diff(&case, &["out", "aside"]), expected);
    // What the manifest vouches for may still be of another version.
    copy_products(&case.path("before/case"), &case.path("aside/case"));
    let product = fs::read(case.path("aside/case/ranges.json")).unwrap();
    let hash = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
    case.write("aside/case/ranges.json", "{}");
    case.replace("aside/case/manifest.json", &hash(&product), &hash(b"{}"));
    let expected = "exit 3\nerror: case: aside/case/ranges.json: cannot be read as range statistics: missing field \
                    `profiles` at line 1 column 2\n  what to do: if another version of areograph wrote the products, \
                    regenerate them with this version\n";
    assert_eq!(diff(&case, &["before", "aside"]), expected);
}
