//! Real indexes of archives and real files in the layout of the archives: plans, and a site filled in one command.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{
    fs,
    path::Path,
    process::Output,
    time::{Duration, Instant},
};

use areograph::fetch::index::{checksums, kernel_rows};
use common::{
    archive_server::{ArchiveServer, Kernel, Listing, write, write_kernels},
    case::Case,
    json,
    mission::{areograph, succeed},
};

#[test]
fn real_indexes_of_kernels_are_read_whole() {
    let Some(folder) = common::real_data("naif_index", "indexes of kernels") else {
        return;
    };
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    let rows = kernel_rows(&read("msl_dsindex.tab"), &read("msl_dsindex.lbl")).unwrap();
    // As many as the label states.
    assert_eq!(rows.len(), 304);
    let sums = checksums(&read("msl_checksum.tab")).unwrap();
    assert_eq!(sums.len(), 675);
    for row in &rows {
        assert!(sums.contains_key(&row.path), "{} has no checksum", row.path);
        let is_binary = ["SPK", "CK"].contains(&&*row.kind);
        assert!(!is_binary || row.span.is_some(), "{}", row.path);
    }
    let first = &rows[0];
    assert_eq!(first.path, "data/ck/msl_cruise_recon_nospin.bc");
    let span = first.span.unwrap().map(|utc| utc.to_string());
    assert_eq!(span, ["2011-11-26T15:01:29.687", "2012-08-06T04:53:35.138"]);
    assert!(checksums(&read("mro_checksum.tab")).unwrap().len() > 5_000);
}

fn told(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

#[test]
fn all_files_of_the_laser_are_planned_in_under_a_second() {
    let test = "a plan of the whole archive of the laser";
    let Some(list) = common::real_data("pedr_urls/wget_mola.script", test) else {
        return;
    };
    let case = Case::empty();
    let list = fs::read_to_string(list).unwrap();
    let files = list
        .lines()
        .filter_map(|line| line.split_once("/mgsl_21xx/data/"));
    let mut count = 0;
    for (_, below) in files {
        write(&case.path("archive").join(below.trim()), b"");
        count += 1;
    }
    assert_eq!(count, 771);
    let mirror = format!(
        "[pedr]\nurl = 'file://{}/'\n",
        case.path("archive").display()
    );
    case.write("hosts.toml", mirror);
    let fetch = |more: &[&str]| {
        let mut command = areograph();
        command.args(["fetch", "--only", "pedr"]).args(more);
        command.arg("--archives").arg(case.path("hosts.toml"));
        told(&succeed(command.arg("--into").arg(case.path("mars"))))
    };
    let all = ["--dates", "1999-02-28,2001-07-01"];
    fetch(&[&all[..], &["--index"]].concat());
    let start = Instant::now();
    let plan = fetch(&[&all[..], &["--plan"]].concat());
    let elapsed = start.elapsed();
    println!("771 files planned in {elapsed:?}");
    assert!(plan.contains("files: 771, "), "{plan}");
    assert!(elapsed < Duration::from_secs(1), "{elapsed:?}");
    // The passes at Gusev: orbits 18940 and 19053.
    let plan = fetch(&[
        "--orbits",
        "18940,18940",
        "--orbits",
        "19053,19053",
        "--plan",
    ]);
    assert!(plan.contains("files: 2, "), "{plan}");
    assert!(
        plan.contains("ap18xxx/ap18933l.b") && plan.contains("ap19xxx/ap190"),
        "{plan}"
    );
}

/// The kernels of image M04/02852 under names of the archive, with what they cover.
const KERNELS: [(&str, &str, &str, [&str; 2]); 8] = [
    ("naif0012.tls", "LSK", "naif0012.tls", ["", ""]),
    ("pck00009.tpc", "PCK", "pck00009.tpc", ["", ""]),
    (
        "MGS_SCLKSCET.00061.tsc",
        "SCLK",
        "mgs_sclkscet_00061.tsc",
        ["", ""],
    ),
    ("moc20.ti", "IK", "mgs_moc_v20.ti", ["", ""]),
    (
        "m0402852.ale_0.bsp",
        "SPK",
        "mgs_map2_a.bsp",
        ["1999-08-24T13:58:15.744", "1999-08-24T14:02:21.961"],
    ),
    (
        "m0402852.ale_1.bsp",
        "SPK",
        "mgs_map2_b.bsp",
        ["1999-08-24T14:10:13.635", "1999-08-24T14:14:19.559"],
    ),
    (
        "mgs_sc_map2_0_sliced_-94000.bc",
        "CK",
        "mgs_sc_map2_a.bc",
        ["1999-08-24T13:58:15.745", "1999-08-24T14:02:21.959"],
    ),
    (
        "mgs_sc_map2_1_sliced_-94000.bc",
        "CK",
        "mgs_sc_map2_b.bc",
        ["1999-08-24T14:10:13.635", "1999-08-24T14:14:19.561"],
    ),
];

/// A row of the cumulative index of images: the columns that a fetch reads, all others empty.
fn image_row() -> String {
    let mut row = vec![String::new(); 53];
    for (column, value) in [
        (0, "MGSC_1240"),
        (1, "M04028/M0402852.IMQ"),
        (2, "M04/02852"),
        (3, "1999-08-24T14:12:13.64"),
        (4, "MOC-NA"),
        (6, "256"),
        (7, "1536"),
        (8, "8"),
        (9, "8"),
        (29, "0.4821"),
    ] {
        value.clone_into(&mut row[column]);
    }
    row.iter()
        .map(|value| format!("\"{value}\""))
        .collect::<Vec<_>>()
        .join(",")
        + "\r\n"
}

#[test]
fn a_site_is_filled_from_an_archive_in_one_command_and_runs() {
    let Some(data) = common::real_data("ale_mgs/m0402852", "a site filled from an archive") else {
        return;
    };
    let case = Case::empty();
    let root = case.path("archive");
    let kernels = KERNELS.map(|(from, kind, name, span)| -> Kernel<'_> {
        (kind, name, span, fs::read(data.join(from)).unwrap())
    });
    write_kernels(&root.join("naif"), &kernels);
    let image = fs::read(data.join("m0402852_isis.lbl")).unwrap();
    write(&root.join("moc/mgsc_1240/m04028/m0402852.imq"), &image);
    write(
        &root.join("moc/mgsc_1578/index/cumindex.tab"),
        image_row().as_bytes(),
    );
    let server = ArchiveServer::of(&root, Listing::Plain);
    let url = server.url();
    case.write(
        "hosts.toml",
        format!("[kernels]\nurl = '{url}/naif/'\n[images]\nurl = '{url}/moc/'\n[network]\npause_s = 0.01\n"),
    );
    case.write(
        "m04.toml",
        "site = 'm04'\n[kernels]\nroot = 'kernels'\n[[images]]\nid = 'M04-02852'\nlabel = 'images/m0402852.imq'\n",
    );
    let site = case.path("m04.toml");
    let fetch = |more: &[&str]| {
        let mut command = areograph();
        command.arg("fetch").arg(&site).args(more);
        told(&succeed(
            command.arg("--archives").arg(case.path("hosts.toml")),
        ))
    };
    let filled = fetch(&[]);
    assert!(
        filled.contains("fetched: 8; present: 0; failed: 0"),
        "{filled}"
    );
    // An earlier attitude is not needed; the earlier ephemeris holds the Sun when its light left.
    let exists = |name: &str| Path::new(&case.path("kernels")).join(name).exists();
    assert!(exists("mgs_map2_a.bsp") && !exists("mgs_sc_map2_a.bc"));
    let mut run = areograph();
    run.args(["--quiet", "run"])
        .arg(&site)
        .arg("--out")
        .arg(case.path("out"));
    let output = succeed(&mut run);
    assert!(told(&output).starts_with("m04: valid"), "{}", told(&output));
    let manifest = json(&case.path("out/m04/manifest.json"));
    assert_eq!(manifest["counts"]["images"], 1);
    assert!(fetch(&["--plan"]).ends_with("not present: 0\n"));
    assert!(fetch(&["--verify"]).starts_with("files unchanged since they were fetched: 8"));
}
