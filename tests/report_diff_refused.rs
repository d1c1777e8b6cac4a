//! Which outputs `areograph report diff` compares, and what it refuses.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

mod common;
#[path = "report_diff/fixture.rs"]
#[allow(dead_code, reason = "the fixture serves several tests")]
mod fixture;

use std::fs;

use common::case::Case;
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
    let refusals: [(&str, Spoil, &str); 8] = [
        (
            "no folder",
            |case| fs::remove_dir_all(case.path("out")).unwrap(),
            NO_FOLDER,
        ),
        (
            "empty folder",
            |case| {
                fs::remove_dir_all(case.path("out")).unwrap();
                fs::create_dir(case.path("out")).unwrap();
            },
            EMPTY,
        ),
        (
            "no manifest",
            |case| fs::remove_file(case.path("out/case/manifest.json")).unwrap(),
            EMPTY,
        ),
        (
            "stopped early",
            |case| {
                fs::remove_file(case.path("out/case/manifest.json")).unwrap();
                fs::create_dir(case.path("out/case/.cache")).unwrap();
            },
            STOPPED_EARLY,
        ),
        (
            "half-made",
            |case| case.write("out/case/.publishing", "kernels.tm"),
            HALF_MADE,
        ),
        (
            "no JSON",
            |case| case.write("out/case/manifest.json", "{"),
            NO_JSON,
        ),
        (
            "another site",
            |case| {
                case.replace(
                    "out/case/manifest.json",
                    "\"site\": \"case\"",
                    "\"site\": \"other\"",
                );
            },
            ANOTHER_SITE,
        ),
        (
            "no common site",
            |case| fs::rename(case.path("out/case"), case.path("out/other")).unwrap(),
            NO_COMMON_SITE,
        ),
    ];
    for (what, spoil, expected) in refusals {
        let _ = fs::remove_dir_all(case.path("out"));
        copy_products(&case.path("before/case"), &case.path("out/case"));
        spoil(&case);
        assert_eq!(diff(&case, &["before", "out"]), expected, "{what}");
    }
    assert_eq!(diff(&case, &["before", "before/../before"]), ONE_FOLDER);
    let _ = fs::remove_dir_all(case.path("out"));
    copy_products(&case.path("before/case"), &case.path("out/case"));
    assert_eq!(diff(&case, &["before/case", "out"]), ONE_AND_SEVERAL);
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
            "exit 3\nerror: aside/case/{path}: {found}; expected {bytes} bytes with the BLAKE3 hash {hash} of \
             manifest.json\n  what to do: run the site again, which makes damaged products anew\n"
        )
    };
    case.write("aside/case/footprints.csv", "mine");
    let hash = &blake3::hash(b"mine").to_hex()[..12];
    let expected = message(
        "footprints.csv",
        &format!("has 4 bytes with the hash {hash}"),
    );
    assert_eq!(diff(&case, &["aside", "out"]), expected);
    fs::remove_file(case.path("aside/case/footprints.csv")).unwrap();
    let expected = message("footprints.csv", "is missing");
    assert_eq!(diff(&case, &["out", "aside"]), expected);
    // What the manifest vouches for may still be of another version.
    copy_products(&case.path("before/case"), &case.path("aside/case"));
    let product = fs::read(case.path("aside/case/ranges.json")).unwrap();
    let hash = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
    case.write("aside/case/ranges.json", "{}");
    case.replace("aside/case/manifest.json", &hash(&product), &hash(b"{}"));
    let expected = "exit 3\nerror: case: aside/case/ranges.json: cannot be read as range statistics: missing field \
                    `profiles` at line 1 column 2\n  what to do: products of another version of areograph have \
                    to be made again by this one\n";
    assert_eq!(diff(&case, &["before", "aside"]), expected);
}

const NO_FOLDER: &str = "exit 6\nerror: out: cannot read the folder: No such file or directory (os error 2)\n  what to do: check the path; relative paths in a configuration count from that file's folder\n";
const EMPTY: &str = "exit 3\nerror: out: there is no manifest.json in it or in a folder below; expected products of `areograph run`\n  what to do: name the folder given to --out, or a site's folder in it\n";
const STOPPED_EARLY: &str = "exit 3\nerror: out/case: there is no manifest.json, so there are no products\n  what to do: name a site's folder of products, and run the site to the end\n";
const HALF_MADE: &str = "exit 3\nerror: out/case: the publication of products into this folder was not finished\n  what to do: wait for the run that is at work, or run the site again to mend it\n";
const NO_JSON: &str = "exit 3\nerror: out/case/manifest.json: this is no manifest of areograph 0.1.0: EOF while parsing an object at line 1 column 1\n  what to do: run the site again, which makes damaged products anew\n";
const ANOTHER_SITE: &str = "exit 2\nerror: out/case: these are products of site \"other\", the others of site \"case\"; expected one site\n  what to do: compare runs of the same site\n";
const NO_COMMON_SITE: &str = "exit 2\nerror: no site is in both: A has case; B has other\n  what to do: compare runs of the same site\n";
const ONE_FOLDER: &str = "exit 2\nerror: before/../before: A and B are one folder; expected the products of two runs\n  what to do: copy the first products aside before running again, or run into another --out\n";
const ONE_AND_SEVERAL: &str = "exit 2\nerror: before/case: it holds the products of one site, the other folder those of several\n  what to do: name two folders of one site, or two output folders with sites\n";
