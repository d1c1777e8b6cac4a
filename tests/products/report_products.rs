//! The report and the products beside it: it is made again from them, its links lead to them, its numbers are theirs.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;
use crate::common::page;

mod numbers;
mod sources;

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::Command,
};

use common::{
    golden::assert_messages,
    mission::{areograph, mission, site_run, succeed},
};
use serde_json::Value;
use tempfile::TempDir;

fn gusev() -> PathBuf {
    site_run("gusev_crater")
}

/// A copy of the products alone, without stage outputs, in a folder of another name.
fn copy() -> TempDir {
    let copy = tempfile::tempdir().unwrap();
    let folder = copy.path().join("elsewhere");
    for relative in common::mission::products(&gusev()).keys() {
        let target = folder.join(relative);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::copy(gusev().join(relative), target).unwrap();
    }
    copy
}

fn report(folder: &TempDir) -> Command {
    let mut report = areograph();
    report
        .current_dir(folder.path())
        .args(["--quiet", "report"]);
    report
}

#[test]
fn a_page_that_no_browser_shows_is_named_in_a_warning() {
    let copy = copy();
    let programs = copy.path().join("programs");
    fs::create_dir(&programs).unwrap();
    let open = || {
        let mut report = report(&copy);
        let output = report.args(["elsewhere", "--open"]).env("PATH", &programs);
        let output = output.output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stderr).unwrap()
    };
    let place = "report/index.html\n";
    let told = open();
    assert!(told.starts_with("warning: cannot start "), "{told}");
    assert!(told.ends_with(place), "{told}");
    // What xdg-open says without a browser.
    for name in ["xdg-open", "open"] {
        let program = programs.join(name);
        fs::write(&program, "#!/bin/sh\nexit 3\n").unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let told = open();
    assert!(told.contains("found no browser (exit status: 3)"), "{told}");
    assert!(told.ends_with(place), "{told}");
    // One that shows the page says nothing.
    for name in ["xdg-open", "open"] {
        fs::write(programs.join(name), "#!/bin/sh\n").unwrap();
    }
    assert_eq!(open(), "");
}

#[test]
fn the_page_is_made_again_from_products_alone() {
    let copy = copy();
    let written = fs::read(gusev().join("report/index.html")).unwrap();
    let page = copy.path().join("elsewhere/report/index.html");
    // Missing and spoiled pages come back as they were; a page elsewhere leaves the products alone.
    fs::remove_file(&page).unwrap();
    succeed(report(&copy).arg("elsewhere"));
    assert!(fs::read(&page).unwrap() == written);
    fs::write(&page, "spoiled").unwrap();
    succeed(report(&copy).args(["elsewhere", "--page", "again.html"]));
    assert!(fs::read(copy.path().join("again.html")).unwrap() == written);
    assert_eq!(fs::read(&page).unwrap(), b"spoiled");
    succeed(report(&copy).arg("elsewhere"));
    assert!(fs::read(&page).unwrap() == written);
    // What it was made from tells nothing of the machine.
    let data = fs::read(gusev().join("report/page.postcard")).unwrap();
    for folder in [mission(), gusev()] {
        let folder = folder.to_string_lossy().into_owned();
        let told = data
            .windows(folder.len())
            .any(|bytes| bytes == folder.as_bytes());
        assert!(!told, "{folder}");
    }
}

/// Sets the manifest's entry of a product to what is there.
fn vouch_for(folder: &Path, path: &str) {
    let manifest = folder.join("manifest.json");
    let mut entries: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
    let bytes = fs::read(folder.join(path)).unwrap();
    let mut products = entries["products"].as_array_mut().unwrap().iter_mut();
    let product = products.find(|product| product["path"] == path).unwrap();
    product["bytes"] = bytes.len().into();
    product["blake3"] = blake3::hash(&bytes).to_hex().to_string().into();
    fs::write(manifest, serde_json::to_vec(&entries).unwrap()).unwrap();
}

type Spoil = fn(&Path);

#[test]
fn products_that_the_page_cannot_be_made_from_are_refused() {
    let spoiled: [(&str, Spoil); 8] = [
        ("no folder", |folder| fs::remove_dir_all(folder).unwrap()),
        ("no manifest", |folder| {
            fs::remove_file(folder.join("manifest.json")).unwrap();
        }),
        ("a product is missing", |folder| {
            fs::remove_file(folder.join("report/page.postcard")).unwrap();
        }),
        ("another product was changed", |folder| {
            fs::write(folder.join("kernels.tm"), "mine").unwrap();
        }),
        (
            "what the page is made from is cut, and the manifest says so too",
            |folder| {
                let path = folder.join("report/page.postcard");
                let bytes = fs::read(&path).unwrap();
                fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
                vouch_for(folder, "report/page.postcard");
            },
        ),
        ("another version", |folder| {
            let path = folder.join("manifest.json");
            let manifest = fs::read_to_string(&path).unwrap();
            let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
            assert!(manifest.contains(&version));
            fs::write(path, manifest.replace(&version, "\"version\": \"0.0.9\"")).unwrap();
        }),
        ("a table of other columns", |folder| {
            let table = folder.join("registration.parquet");
            fs::copy(table, folder.join("ranges.parquet")).unwrap();
            vouch_for(folder, "ranges.parquet");
        }),
        ("another page was published", |folder| {
            fs::write(folder.join("report/index.html"), "another").unwrap();
            vouch_for(folder, "report/index.html");
        }),
    ];
    let mut told = Vec::new();
    for (what, spoil) in spoiled {
        let copy = copy();
        spoil(&copy.path().join("elsewhere"));
        let output = report(&copy).arg("elsewhere").output().unwrap();
        assert!(output.stdout.is_empty());
        let text = String::from_utf8(output.stderr).unwrap();
        // Sizes and hashes are those of this run.
        let text = text.replace(&copy.path().display().to_string(), "");
        let text: Vec<&str> = text.split("; expected").collect();
        let first = text[0].split(" with the hash").next().unwrap();
        told.push((
            what,
            format!("exit {}\n{first}", output.status.code().unwrap()),
        ));
        let left = copy.path().join("elsewhere/report/index.html");
        let published = fs::read(gusev().join("report/index.html")).unwrap();
        let changed = what == "another page was published" || what == "no folder";
        assert!(changed || fs::read(left).unwrap() == published, "{what}");
    }
    assert_messages("report_again_refused", &told);
}

#[test]
fn every_link_leads_to_a_product_and_every_product_has_one() {
    let folder = gusev();
    let page = fs::read_to_string(folder.join("report/index.html")).unwrap();
    let targets = page
        .split("href=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap());
    let files: Vec<&str> = targets
        .filter(|target| !target.starts_with('#') && !target.starts_with("data:"))
        .collect();
    for target in &files {
        // The page over all sites is written after the last of them.
        let path = folder.join("report").join(target);
        assert!(path.exists(), "{target}");
    }
    let manifest = common::json(&folder.join("manifest.json"));
    for product in manifest["products"].as_array().unwrap() {
        let path = product["path"].as_str().unwrap();
        if path.starts_with("report/explore/") {
            // Pictures of another page, which has all of them (`explore.rs`).
            continue;
        }
        let link = path.strip_prefix("report/figures/").map_or_else(
            || format!("../{path}"),
            |figure| format!("figures/{figure}"),
        );
        assert!(files.contains(&link.as_str()), "{link}");
    }
}

#[test]
fn every_figure_is_a_file_with_number_legend_and_caption() {
    let folder = gusev();
    let page = fs::read_to_string(folder.join("report/index.html")).unwrap();
    let figures: Vec<&str> = page.split("<figure id=\"").skip(1).collect();
    assert!(figures.len() > 15, "{}", figures.len());
    for (place, figure) in figures.iter().enumerate() {
        let id = figure.split('"').next().unwrap();
        let svg = fs::read_to_string(folder.join(format!("report/figures/{id}.svg"))).unwrap();
        assert!(svg.contains(&format!(">Figure {}. ", place + 1)), "{id}");
        assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count());
        // All words of legend and caption, however the lines break.
        let words = |html: &str| -> String {
            let text = html.split('<').filter_map(|part| part.split_once('>'));
            let text: Vec<&str> = text.map(|(_, text)| text.trim()).collect();
            text.join(" ")
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" ")
        };
        let caption = figure.split("-words\">").nth(1).unwrap();
        let caption = words(&format!("<>{}", caption.split("</span>").next().unwrap()));
        assert!(words(&svg).contains(&caption), "{id}: {caption}");
        for key in figure.split("<i ").skip(1) {
            let label = key.split("</i>").nth(1).unwrap().split('<').next().unwrap();
            assert!(svg.contains(&format!(">{label}</text>")), "{id}: {label}");
        }
    }
    let files = fs::read_dir(folder.join("report/figures")).unwrap().count();
    assert_eq!(files, figures.len());
}
