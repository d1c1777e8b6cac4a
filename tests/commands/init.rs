//! `areograph init`: what it writes is ready to run, and what it cannot write it refuses.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{fs, process::Command};

use common::{case::Case, golden::assert_messages, mission::succeed};

/// The command in the folder of the case, whose standard input is no terminal.
fn init(case: &Case, arguments: &[&str]) -> Command {
    let mut command = case.areograph();
    command.args(["--quiet", "init"]).args(arguments);
    command.stdin(std::process::Stdio::null());
    command
}

const PAIR: [&str; 12] = [
    "sites/isidis",
    "--kernels",
    "kernels/nav.tm",
    "--pedr",
    "pedr/*.b",
    "--label",
    "labels/E02-01301.lbl",
    "--label",
    "labels/E02-02016.lbl",
    "--ties",
    "ties/isidis.csv",
    "--description=Isidis \"pair\"",
];

#[test]
fn a_new_site_is_ready_with_and_without_a_window() {
    let case = Case::pair();
    for (site, window) in [("seen", None), ("boxed", Some("--box=87.5,88.5,4.0,5.0"))] {
        let named = format!("--site={site}");
        let mut arguments = PAIR.to_vec();
        arguments.push(&named);
        arguments.extend(window);
        let printed = succeed(&mut init(&case, &arguments)).stdout;
        let file = format!("sites/isidis/{site}.toml");
        let expected = format!("{file}: written; next: areograph check {file}\n");
        assert_eq!(String::from_utf8(printed).unwrap(), expected);
        let text = fs::read_to_string(case.path(&file)).unwrap();
        assert!(text.contains("id = \"E02-02016\"\n"), "{text}");
        assert!(
            text.contains("metakernel = \"../../kernels/nav.tm\""),
            "{text}"
        );
        assert_eq!(text.contains("margin_km"), window.is_none());
        let mut check = case.areograph();
        let ready = succeed(check.args(["--quiet", "check"]).arg(&file)).stdout;
        let ready = String::from_utf8(ready).unwrap();
        assert!(ready.starts_with(&format!("{site}: ready\n")), "{ready}");
    }
}

/// A site from tables alone: its window is the box around their shots, over 0° as elsewhere.
#[test]
fn tables_of_shots_become_a_site() {
    let case = Case::pair();
    let heading = "long_East,lat_North,topography, MOLArange,  planet_rad, c,A,  Ephermis Time,            UTC,          Orbit\r\n";
    let row = |longitude_deg: f64, latitude_deg: f64, at: u32| {
        format!(
            "{longitude_deg:.5},{latitude_deg:.5}, -1000.00, 380000.00, 3392000.00,1,0,{:.5},2001-01-01T00:00:00.000,{}\r\n",
            f64::from(at).mul_add(0.1, 31_579_264.184),
            15_000 + at
        )
    };
    fs::create_dir(case.path("tables")).unwrap();
    case.write(
        "tables/one.csv",
        heading.to_owned() + &row(359.504, 1.001, 0),
    );
    case.write("tables/two.csv", heading.to_owned() + &row(0.301, 0.5, 1));
    let arguments = [
        "sites/zero",
        "--kernels",
        "kernels/nav.tm",
        "--shots",
        "tables/*.csv",
    ];
    succeed(&mut init(&case, &arguments));
    let text = fs::read_to_string(case.path("sites/zero/zero.toml")).unwrap();
    for expected in [
        "files = [\"../../tables/*.csv\"]\n",
        "layout = \"ode_pedr\"\n",
        "longitude_deg = [-0.5, 0.31]\n",
        "latitude_deg = [0.5, 1.01]\n",
    ] {
        assert!(text.contains(expected), "{expected} in {text}");
    }
    succeed(case.areograph().args([
        "--quiet",
        "pedr",
        "search",
        "tables/one.csv",
        "tables/two.csv",
        "--box=-0.5,0.31,0.5,1.01",
    ]));
    let wide = case.outcome(init(
        &case,
        &[
            "wide",
            "--box=138,137,-5,-4",
            "--kernels",
            "kernels/nav.tm",
            "--pedr",
            "pedr",
        ],
    ));
    assert!(wide.contains("the other 1°, or give --wide"), "{wide}");
    // Tables without a shot are no place.
    case.write("tables/one.csv", heading);
    case.write("tables/two.csv", heading);
    let refused = case.outcome(init(
        &case,
        &[
            "new",
            "--kernels",
            "kernels/nav.tm",
            "--shots",
            "tables/*.csv",
        ],
    ));
    assert!(
        refused.contains("missing: a shot in the tables"),
        "{refused}"
    );
    assert!(!case.path("new/new.toml").exists());
}

#[test]
fn what_cannot_be_a_site_is_refused_and_leaves_no_folder() {
    let case = Case::pair();
    let kernels = ["--kernels", "kernels/nav.tm"];
    let cases: [(&str, Vec<&str>); 7] = [
        ("nothing said", vec!["new"]),
        ("kernels alone", [&["new"], &kernels[..]].concat()),
        (
            "shots without a place",
            [&["new", "--pedr", "pedr/*.b"], &kernels[..]].concat(),
        ),
        (
            "kernels that are not there",
            vec![
                "new",
                "--kernels",
                "none.tm",
                "--pedr",
                "pedr/*.b",
                "--box=1,2,3,4",
            ],
        ),
        (
            "south above north",
            [
                &["new", "--pedr", "pedr/*.b", "--box=1,2,4,3"],
                &kernels[..],
            ]
            .concat(),
        ),
        (
            "no label",
            [&["new", "--label", "ties/isidis.csv"], &kernels[..]].concat(),
        ),
        ("no four numbers", vec!["new", "--box=1,2,3"]),
    ];
    let mut told = Vec::new();
    for (what, arguments) in cases {
        told.push((what, case.outcome(init(&case, &arguments))));
        assert!(!case.path("new").exists(), "{what}");
    }
    let again = |case: &Case| case.outcome(init(case, &PAIR));
    assert!(again(&case).starts_with("exit 0\n"));
    told.push(("a file that is there", again(&case)));
    assert_messages("init_refused", &told);
}
