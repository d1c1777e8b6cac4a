//! Results of a campaign: tables, pooled numbers and page over many published sites.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests read and spoil products, and may fail loudly"
)]

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    flow::{CampaignAnswer, CampaignSite, publish_results},
    pds::image_index::IndexedImage,
};
use arrow_array::{RecordBatch, cast::AsArray, types::Float64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

use crate::common::{
    alone,
    case::Case,
    json, long,
    mission::{once, products, site_run, succeed},
    number,
    readers::{output, python},
};

/// Sites of the demo: three pairs of narrow-angle images, and wide-angle images.
const SITES: [&str; 4] = ["eos_chasma", "gusev_crater", "isidis", "gusev_context"];

/// An image of an index, in a phase.
fn indexed(image: &str, phase: &str, orbit: u32) -> IndexedImage {
    IndexedImage {
        product_id: image.replace('-', "/"),
        volume: String::new(),
        file: String::new(),
        utc_start: "2001-03-08T12:52:54.66".to_owned(),
        orbit: Some((phase.to_owned(), orbit)),
        instrument: ["MOC-NA".to_owned(), String::new()],
        target: None,
        sclk_start: None,
        size: [1024, 8064],
        summing: [Some(2), Some(2)],
        exposure_s: Some(4.821e-4),
        first_detector: None,
        pixel_m: Some(3.0),
        angles_rad: [Some(0.1), Some(0.7), None],
        centre_rad: Some([1.5, 0.1]),
        corners_rad: [None; 4],
        extent_m: [None; 2],
        altitude_m: None,
        sub_solar_rad: None,
        sub_spacecraft_rad: None,
        solar_longitude_rad: None,
        rationale: String::new(),
        quality: String::new(),
    }
}

/// Images of the demo's pairs in the order of their sites.
const IMAGES: [(&str, &str); 6] = [
    ("E02-02855", "E02"),
    ("E04-01275", "E04"),
    ("E02-00665", "E02"),
    ("E02-01453", "E02"),
    ("E02-01301", "E02"),
    ("E02-02016", "E02"),
];

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let to = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &to);
        } else {
            fs::copy(&path, to).unwrap();
        }
    }
}

/// A folder of products of these sites.
fn sites(names: &[&str]) -> tempfile::TempDir {
    let out = tempfile::tempdir().unwrap();
    for name in names {
        copy(&site_run(name), &out.path().join(name));
    }
    out
}

/// Adds a site of one image, without tie points, as `case`.
fn add_site_without_ties(out: &Path) {
    let run = once("run-without-ties", |folder| {
        let case = Case::new();
        succeed(&mut case.run());
        copy(&case.path("out"), folder);
    });
    copy(&run.join("case"), &out.join("case"));
}

/// Publishes the results of these sites; the images of the first three are in an index.
fn publish(out: &Path, names: &[&str]) -> CampaignAnswer {
    let index: Vec<IndexedImage> = IMAGES
        .iter()
        .zip(100..)
        .map(|((image, phase), orbit)| indexed(image, phase, orbit))
        .collect();
    let of = |name: &&str| {
        let place = SITES[..3].iter().position(|site| site == name);
        let images = place.map_or(&[][..], |place| &index[2 * place..2 * place + 2]);
        images.iter().collect()
    };
    let sites: Vec<CampaignSite<'_>> = names
        .iter()
        .map(|name| CampaignSite {
            id: name,
            images: of(name),
            ..CampaignSite::default()
        })
        .collect();
    publish_results(out, "test", &sites).unwrap()
}

/// All rows of a table of the campaign, phase by phase.
fn rows(folder: &Path, name: &str) -> Vec<(String, RecordBatch)> {
    let mut parts: Vec<PathBuf> = fs::read_dir(folder.join(name))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    parts.sort();
    let phase = |part: &Path| {
        let name = part.file_name().unwrap().to_string_lossy().into_owned();
        name.strip_prefix("phase=").unwrap().to_owned()
    };
    let each = parts.iter();
    each.map(|part| (phase(part), table(&part.join("part-0.parquet"))))
        .collect()
}

/// All rows of a Parquet file of fewer than a million rows.
fn table(path: &Path) -> RecordBatch {
    let file = fs::File::open(path).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let schema = reader.schema().clone();
    let mut reader = reader.with_batch_size(1 << 20).build().unwrap();
    let rows = reader.next().map(Result::unwrap);
    rows.unwrap_or_else(|| RecordBatch::new_empty(schema))
}

fn texts(rows: &RecordBatch, name: &str) -> Vec<String> {
    let column = rows.column_by_name(name).unwrap().as_string::<i32>();
    column.iter().map(|text| text.unwrap().to_owned()).collect()
}

fn numbers(rows: &RecordBatch, name: &str) -> Vec<Option<f64>> {
    let column = rows.column_by_name(name).unwrap();
    column.as_primitive::<Float64Type>().iter().collect()
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|of| of * of).sum::<f64>() / values.len() as f64).sqrt()
}

fn close(found: f64, expected: f64) {
    // Documents have all digits; sums are rounded.
    let tolerance = 1e-9 * expected.abs().max(1e-3);
    assert!((found - expected).abs() < tolerance, "{found} {expected}");
}

/// Mean over the footprints of a pair of a value of its profiles.
fn over_footprints(pair: &Value, of: &str) -> f64 {
    let profiles = pair["footprints"]["profiles"].as_array().unwrap();
    let (mut sum, mut count) = (0.0, 0.0);
    for profile in profiles {
        let n = number(&profile["lines"]["n"]);
        sum += n * number(profile.pointer(of).unwrap());
        count += n;
    }
    sum / count
}

/// Every pooled number again, from the documents of the sites.
#[test]
fn pooled_numbers_follow_from_the_documents_of_the_sites() {
    let names = [SITES[0], SITES[1], SITES[2], "case"];
    let out = sites(&SITES[..3]);
    add_site_without_ties(out.path());
    let answer = publish(out.path(), &names);
    let summary = json(&answer.folder.join("summary.json"));
    assert_eq!(summary["sites"]["sites"], 4);
    let manifest = |site: &str| json(&out.path().join(site).join("manifest.json"));
    let valid = names
        .iter()
        .filter(|site| manifest(site)["verdict"]["valid"] == true);
    let valid: Vec<&str> = valid.copied().collect();
    assert!(valid.len() >= 3 && valid.contains(&"case"), "{valid:?}");
    assert_eq!(summary["pairs"], valid.len() - 1);
    for state in ["before", "after"] {
        let (mut lines, mut metres, mut sizes, mut budgets, mut means) = (
            Vec::new(),
            Vec::new(),
            [Vec::new(), Vec::new()],
            Vec::new(),
            Vec::new(),
        );
        for site in &valid {
            let path = out.path().join(site).join("adjustment.json");
            if !path.is_file() {
                continue;
            }
            let document = json(&path);
            for pair in document[state]["pairs"].as_array().unwrap() {
                let spacing_m = number(&pair["line_spacing_m"][1]);
                lines.push(over_footprints(pair, "/lines/mean"));
                metres.push(over_footprints(pair, "/lines/mean") * spacing_m);
                for (image, sizes) in sizes.iter_mut().enumerate() {
                    let of = |name: &str| number(&pair["residuals"][image][name]);
                    sizes.push(of("mean_x").hypot(of("deviation_x")));
                }
                budgets.push(number(&pair["budget"]["along_px"]));
                means.push(number(
                    &document[state]["heights"]["above_surface_m"]["mean"],
                ));
            }
        }
        assert!(lines.len() >= 2);
        let pooled = &summary[state];
        close(
            number(&pooled["misregistration"]["along_rms_lines"]),
            root_mean_square(&lines),
        );
        close(
            number(&pooled["misregistration"]["along_rms_m"]),
            root_mean_square(&metres),
        );
        for (image, sizes) in sizes.iter().enumerate() {
            let found = number(&pooled["residuals"]["images"][image]["size_along_lines"]);
            close(found, root_mean_square(sizes));
        }
        // Each of these sites has one pair, and all tie points are in both images.
        close(
            number(&pooled["heights"]["means_rms_m"]),
            root_mean_square(&means),
        );
        if state == "before" {
            // Eq. 7 with the squares averaged over the sites.
            close(
                number(&summary["budget"]["all"]["along_px"]),
                root_mean_square(&budgets),
            );
        }
    }
    let (mut shots, mut sum, mut profiles) = (0.0, 0.0, 0);
    for site in &valid {
        let document = json(&out.path().join(site).join("ranges.json"));
        for profile in document["profiles"].as_array().unwrap() {
            let of = &profile["range_minus_distance_m"];
            let n = number(&of["n"]);
            shots += n;
            sum += n * number(&of["mean"]);
            profiles += u64::from(n > 0.0);
        }
    }
    close(number(&summary["ranges"]["shots"]), shots);
    close(number(&summary["ranges"]["mean_m"]), sum / shots);
    assert_eq!(summary["ranges"]["profiles"], profiles);
    // Fewer shots lie in the simultaneous image, and with the same ranges to a fraction of the scatter.
    let inside = number(&summary["ranges_in_images"]["shots"]);
    assert!(inside > 100.0 && inside < shots, "{inside} of {shots}");
}

/// Rows of each phase of a table.
fn rows_of_phases(folder: &Path, name: &str) -> Vec<(String, usize)> {
    let parts = rows(folder, name).into_iter();
    parts
        .map(|(phase, rows)| (phase, rows.num_rows()))
        .collect()
}

#[test]
fn tables_are_divided_by_the_phases_of_the_index() {
    let out = sites(&SITES);
    let answer = publish(out.path(), &SITES);
    let pairs = rows_of_phases(&answer.folder, "pairs");
    assert_eq!(pairs[0], ("E02".to_owned(), 3));
    // The index does not have the images of the last site.
    assert_eq!((pairs.len(), &*pairs[1].0), (2, "unknown"));
    let images = rows_of_phases(&answer.folder, "images");
    let of_index = [("E02".to_owned(), 5), ("E04".to_owned(), 1)];
    assert_eq!(images[..2], of_index);
    assert_eq!(images[2].0, "unknown");
    let (_, of_phase) = &rows(&answer.folder, "images")[1];
    assert_eq!(numbers(of_phase, "orbit"), [Some(101.0)]);
    assert_eq!(texts(of_phase, "image"), ["E04-01275"]);
}

/// Numbers of sites: valid ones, invalid ones, and those in each state without usable products.
fn counts(answer: &CampaignAnswer) -> [u32; 5] {
    let of = answer.summary.sites;
    let valid = of.valid + of.valid_with_remarks;
    [valid, of.invalid, of.failed, of.absent, of.unusable]
}

/// A damaged product, products of another version, a failed run, and a site that never ran.
#[test]
fn sites_without_usable_products_are_rows_with_the_reason() {
    let out = sites(&SITES);
    let names: Vec<&str> = SITES.iter().copied().chain(["never_run"]).collect();
    let spoil = |site: &str, file: &str, from: &str, to: &str| {
        let path = out.path().join(site).join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{file}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
    };
    let sound = publish(out.path(), &names);
    let [valid, invalid, ..] = counts(&sound);
    assert_eq!(counts(&sound), [valid, 4 - valid, 0, 1, 0]);
    spoil("eos_chasma", "ranges.json", "\"shots\"", "\"Shots\"");
    let version = "\"version\": \"";
    spoil(
        "gusev_crater",
        "manifest.json",
        version,
        &format!("{version}9."),
    );
    let failed = out.path().join("isidis/.failed");
    fs::write(failed, "a kernel is gone\n  what to do: look").unwrap();
    let answer = publish(out.path(), &names);
    assert_eq!(counts(&answer), [valid - 3, invalid, 1, 1, 2]);
    // The pairs of the remaining site.
    let [(_, rest)] = &rows_of_phases(&answer.folder, "pairs")[..] else {
        panic!("pairs of several phases");
    };
    assert_eq!(answer.summary.pair_rows as usize, *rest);
    let mut reasons = Vec::new();
    for (_, rows) in rows(&answer.folder, "sites") {
        let columns = ["site", "state", "failure"].map(|name| texts(&rows, name));
        for row in 0..rows.num_rows() {
            reasons.push(columns.each_ref().map(|column| column[row].clone()));
        }
    }
    for (site, state, reason) in [
        ("isidis", "failed", "a kernel is gone"),
        ("never_run", "absent", "no run of the site has finished"),
        ("eos_chasma", "unusable", "eos_chasma/ranges.json: has "),
        ("gusev_crater", "unusable", "products of areograph 9."),
    ] {
        let found = reasons.iter().find(|of| of[0] == site).unwrap();
        assert!(found[1] == state && found[2].contains(reason), "{found:?}");
    }
    // The index still has their images.
    let images = rows_of_phases(&answer.folder, "images");
    assert!(images.iter().map(|of| of.1).sum::<usize>() >= 6);
    let page = fs::read_to_string(&answer.page).unwrap();
    for words in [
        "1 failed",
        "1 without products",
        "2 with unusable products",
        "a kernel is gone",
    ] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("<script") && !page.contains(&out.path().display().to_string()));
}

#[test]
fn the_same_products_give_the_same_bytes_for_any_number_of_threads() {
    let out = sites(&SITES[..3]);
    let written = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let answer = pool.install(|| publish(out.path(), &SITES[..3]));
        products(&answer.folder)
    };
    let first = written(1);
    assert!(first.len() >= 12, "{}", first.len());
    for threads in [1, 3] {
        assert!(written(threads) == first, "{threads} threads");
    }
    // Fewer sites leave no rows of others.
    let fewer = publish(out.path(), &SITES[..1]);
    assert_eq!(fewer.summary.sites.sites, 1);
    assert!(!fewer.folder.join("images/phase=unknown").exists());
    // A file of another program in the place of a table is not replaced.
    let other = tempfile::tempdir().unwrap();
    let table = other.path().join("campaign/pairs.csv");
    fs::create_dir(other.path().join("campaign")).unwrap();
    fs::write(&table, "mine").unwrap();
    let refused = publish_results(other.path(), "test", &[]).unwrap_err();
    assert!(refused.to_string().contains("pairs.csv"), "{refused}");
    assert_eq!(fs::read(&table).unwrap(), b"mine");
}

#[test]
fn a_pair_that_two_sites_have_counts_once() {
    let out = sites(&["gusev_crater"]);
    copy(&site_run("gusev_crater"), &out.path().join("again"));
    let once = publish(out.path(), &["gusev_crater"]);
    let twice = publish(out.path(), &["gusev_crater", "again"]);
    assert_eq!((once.summary.pair_rows, twice.summary.pair_rows), (1, 2));
    assert_eq!(once.summary.pairs, twice.summary.pairs);
    assert_eq!(once.summary.before, twice.summary.before);
}

/// Another program reads the tables by their folders, and finds the pooled numbers.
#[test]
fn duckdb_finds_the_pooled_numbers_in_the_tables() {
    let Some(mut reader) = python("read_campaign.py", "duckdb_finds_the_pooled_numbers") else {
        return;
    };
    let out = sites(&SITES[..3]);
    let answer = publish(out.path(), &SITES[..3]);
    let found: Value = serde_json::from_str(&output(reader.arg(&answer.folder))).unwrap();
    let summary = json(&answer.folder.join("summary.json"));
    assert_eq!(found["phases"], serde_json::json!(["E02", "E04"]));
    for (name, pointer) in [
        ("along_rms_m", "/before/misregistration/along_rms_m"),
        ("after_along_rms_m", "/after/misregistration/along_rms_m"),
        ("across_rms_px", "/before/misregistration/across_rms_px"),
        ("budget_along_px", "/budget/all/along_px"),
        ("range_mean_m", "/ranges/mean_m"),
        ("range_shots", "/ranges/shots"),
        ("order2_x_rmse_m", "/polynomials/1/position_m/0"),
    ] {
        close(
            number(&found[name]),
            number(summary.pointer(pointer).unwrap()),
        );
    }
}

/// Time and memory of many sites. Copies of a site have the same pair, which is pooled once.
#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn many_sites_take_little_memory() {
    if !alone() {
        return;
    }
    let counts: &[usize] = if long() { &[100, 1_000] } else { &[10, 40] };
    let out = sites(&["gusev_crater"]);
    let template = out.path().join("gusev_crater");
    let peak_mb = || {
        let status = fs::read_to_string("/proc/self/status").unwrap();
        let line = status
            .lines()
            .find(|line| line.starts_with("VmHWM:"))
            .unwrap();
        line.split_whitespace()
            .nth(1)
            .unwrap()
            .parse::<f64>()
            .unwrap()
            / 1024.0
    };
    let mut peaks = Vec::new();
    for count in counts {
        let names: Vec<String> = (0..*count).map(|number| format!("site_{number}")).collect();
        for name in &names {
            let place = out.path().join(name);
            if !place.exists() {
                // Links to the same products: what is read is the same.
                #[cfg(unix)]
                std::os::unix::fs::symlink(&template, &place).unwrap();
            }
        }
        let sites: Vec<CampaignSite<'_>> = names
            .iter()
            .map(|name| CampaignSite {
                id: name,
                images: Vec::new(),
                ..CampaignSite::default()
            })
            .collect();
        let started = std::time::Instant::now();
        let answer = publish_results(out.path(), "many", &sites).unwrap();
        let page = fs::metadata(&answer.page).unwrap().len();
        println!(
            "{count} sites: {:.2} s, peak {:.0} MB, page {page} bytes",
            started.elapsed().as_secs_f64(),
            peak_mb()
        );
        peaks.push(peak_mb());
        assert!(page < 1_000_000);
        assert_eq!(answer.summary.sites.sites as usize, *count);
    }
    // About 2 kB for each row of a site, an image, a pair and a profile.
    let more = (counts[1] - counts[0]) as f64;
    let limit_mb = 60.0 + 0.02 * more;
    assert!(peaks[1] - peaks[0] < limit_mb, "{peaks:?}");
}
