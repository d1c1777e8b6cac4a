//! Selection of kernels from a folder.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests outside a test function"
)]

use areograph_testing as common;

use std::{fs, path::Path};

use areograph_base::{
    frames::Position,
    kernel_source::{CkQuality, KernelSelection},
    time::{Interval, Intervals, PointingBias},
};
use areograph_config::built_in_instruments;
use areograph_spice::{
    CkSegment, Kernel, KernelSet, RequiredCoverage, Session, SpkSegment, State, write_ck, write_spk,
};
use common::real_data;
use nalgebra::Vector3;
use tempfile::{TempDir, tempdir};

/// Source of each file of the folder, and its name in the archive.
const FILES: [(&str, &str); 11] = [
    ("mgs_text/pck00010.tpc", "pck00010.tpc"),
    ("mgs_text/pck00011.tpc", "pck00011.tpc"),
    ("mgs_text/naif0009.tls", "naif0009.tls"),
    ("mgs_text/naif0012.tls", "naif0012.tls"),
    ("mgs_text/MGS_SCLKSCET.00061.tsc", "MGS_SCLKSCET.00061.tsc"),
    ("ale_mgs/m0402852/moc20.ti", "mgs_moc_v20.ti"),
    ("ale_mgs/m0402852/mocAddendum004.ti", "mocAddendum004.ti"),
    ("ale_mgs/m0402852/m0402852.ale_0.bsp", "mgs_map2_first.bsp"),
    ("ale_mgs/m0402852/m0402852.ale_1.bsp", "mgs_map2.bsp"),
    (
        "ale_mgs/m0402852/mgs_sc_map2_0_sliced_-94000.bc",
        "ck/mgs_sc_map2_first.bc",
    ),
    (
        "ale_mgs/m0402852/mgs_sc_map2_1_sliced_-94000.bc",
        "ck/mgs_sc_map2.bc",
    ),
];

const BIAS: PointingBias = PointingBias::from_seconds(-1.15);

/// A folder of kernels, a rival orbit and commanded attitudes among them, and the required time.
fn archive(test: &str) -> Option<(TempDir, Interval)> {
    let temporary = tempdir().unwrap();
    let root = temporary.path();
    fs::create_dir(root.join("ck")).unwrap();
    for (from, to) in FILES {
        // Bytes only: the originals may be read-only.
        let bytes = fs::read(real_data(from, test)?).unwrap();
        write(root, to, &bytes);
    }
    write(root, "README", b"kernels\n");
    // An ephemeris that has not arrived whole.
    fs::create_dir_all(root.join(".fetch/parts")).unwrap();
    let whole = fs::read(root.join("mgs_map2.bsp")).unwrap();
    write(root, ".fetch/parts/1.part", &whole[..whole.len() / 2]);
    let times = ["naif0012.tls", "MGS_SCLKSCET.00061.tsc"].map(|name| root.join(name));
    let session = Session::open(&KernelSet::from_files(&times).unwrap()).unwrap();
    let instants =
        ["1999-08-24T14:12:10", "1999-08-24T14:12:20"].map(|utc| session.utc_to_et(utc).unwrap());
    let commanded = CkSegment {
        name: "commanded",
        instants: &instants,
        quaternions: &[[1.0, 0.0, 0.0, 0.0]; 2],
        angular_velocities_rad_s: &[[0.0; 3]; 2],
        interval_starts: &instants[..1],
    };
    let nominal = root.join("ck/mgs_ext_roto_all_v9.bc");
    write_ck(&nominal, &session, &[commanded], "").unwrap();
    drop(session);
    let state = State {
        position: Position::new(Vector3::new(3.8e6, 0.0, 0.0)),
        velocity_m_s: Vector3::new(0.0, 3_400.0, 0.0),
    };
    let rival = SpkSegment {
        target: -94,
        centre: 499,
        name: "gsfc",
        degree: 1,
        epochs: &instants,
        states: &[state; 2],
    };
    write_spk(&root.join("mgs_map2_gsfc_mgm0827.bsp"), &[rival], "").unwrap();
    Some((temporary, Interval::new(instants[0], instants[1])))
}

#[allow(clippy::disallowed_methods, reason = "input of a test, not a product")]
fn write(folder: &Path, name: &str, content: &[u8]) {
    fs::write(folder.join(name), content).unwrap();
}

fn selection(root: &Path) -> KernelSelection {
    KernelSelection {
        root: root.to_owned(),
        spk_family: "nav".to_owned(),
        ck_quality: vec![CkQuality::Reconstructed, CkQuality::Nominal],
        pinned: Vec::new(),
    }
}

/// Positions at the exposures, attitudes shifted by the pointing bias of MGS, a second more each.
fn around(exposures: Interval) -> RequiredCoverage {
    let attitudes = exposures.shifted(BIAS.seconds()).padded(1.0);
    RequiredCoverage {
        positions: Intervals::union_of([exposures.padded(1.0)]),
        attitudes: Intervals::union_of([attitudes]),
        ..RequiredCoverage::default()
    }
}

fn names(set: &KernelSet) -> Vec<String> {
    set.kernels().iter().map(Kernel::file_name).collect()
}

#[test]
fn the_latest_texts_and_the_files_of_the_wanted_time_are_chosen() {
    let Some((temporary, required)) = archive("selection") else {
        return;
    };
    let selection = selection(temporary.path());
    let set = KernelSet::select(&selection, built_in_instruments(), &around(required)).unwrap();
    let texts = [
        "naif0012.tls",
        "MGS_SCLKSCET.00061.tsc",
        "pck00010.tpc",
        "mgs_moc_v20.ti",
    ];
    // Commanded attitude comes before telemetry, which therefore wins.
    let binaries = [
        "mgs_map2.bsp",
        "mgs_map2_first.bsp",
        "mgs_ext_roto_all_v9.bc",
        "mgs_sc_map2.bc",
    ];
    assert_eq!(names(&set), [&texts[..], &binaries[..]].concat());
    let explanation = set.explanation().join("\n");
    for line in [
        "naif0012.tls: latest of 2 with leap seconds",
        "pck00010.tpc: latest of 1 with the rotation of Mars",
        // It ends before the exposures, and alone holds the Sun when the light left that Mars saw then.
        "mgs_map2_first.bsp: position of the Sun when the light that reaches Mars left it",
        "mgs_map2_gsfc_mgm0827.bsp: not used because it is not from the orbit solution nav",
        "mgs_sc_map2_first.bc: not used because it contains no attitude near the required times",
        "README: not used, is a text without a \\begindata block",
    ] {
        assert!(explanation.contains(line), "{line} in {explanation}");
    }
    let session = Session::open(&set).unwrap();
    session.require_attitude(required, BIAS, 1.0, 0.0).unwrap();
    drop(session);
    assert_eq!(
        names(
            &KernelSet::select(
                &selection,
                built_in_instruments(),
                &RequiredCoverage::default()
            )
            .unwrap()
        ),
        texts
    );
}

#[test]
fn pins_families_and_qualities_are_obeyed() {
    let Some((temporary, required)) = archive("selection by wish") else {
        return;
    };
    let mut selection = selection(temporary.path());
    // It is not required, but a pinned kernel is always selected.
    let extra = b"KPL/PCK\n\\begindata\nBODY9_X = 1\n";
    write(temporary.path(), "extra.tpc", extra);
    selection.pinned = ["naif0009.tls", "pck00011.tpc", "extra.tpc"]
        .map(str::to_owned)
        .to_vec();
    selection.spk_family = "gsfc".to_owned();
    selection.ck_quality = vec![CkQuality::Reconstructed];
    let set =
        names(&KernelSet::select(&selection, built_in_instruments(), &around(required)).unwrap());
    assert_eq!(
        set,
        [
            "MGS_SCLKSCET.00061.tsc",
            "mgs_moc_v20.ti",
            "naif0009.tls",
            "pck00011.tpc",
            "extra.tpc",
            "mgs_map2_gsfc_mgm0827.bsp",
            "mgs_sc_map2.bc"
        ]
    );
}

#[test]
fn what_is_missing_in_a_folder_is_named() {
    let Some((temporary, required)) = archive("selection of missing kernels") else {
        return;
    };
    let mut selection = selection(temporary.path());
    let text = |selection: &KernelSelection| {
        KernelSet::select(selection, built_in_instruments(), &around(required))
            .unwrap_err()
            .to_string()
    };
    selection.spk_family = "ipng".to_owned();
    let failure = text(&selection);
    assert!(
        failure.contains("contains the orbit of MGS in the solution ipng (found: mgs_map2.bsp"),
        "{failure}"
    );
    selection.pinned = vec!["naif0011.tls".to_owned()];
    let failure = text(&selection);
    assert!(
        failure.contains("is the text kernel naif0011.tls"),
        "{failure}"
    );
    selection.pinned.clear();
    for name in ["mgs_moc_v20.ti", "mocAddendum004.ti"] {
        fs::remove_file(temporary.path().join(name)).unwrap();
    }
    let failure = text(&selection);
    assert!(
        failure
            .contains("no kernel in this folder defines the frame of the MOC narrow angle camera"),
        "{failure}"
    );
    selection.root = temporary.path().join("absent");
    assert!(text(&selection).contains("absent: cannot list folder"));
}

#[test]
fn kernels_that_meet_inside_the_bias_are_chosen_and_versions_count() {
    let Some((temporary, exposures)) = archive("selection across a seam") else {
        return;
    };
    let root = temporary.path();
    let mut selection = selection(root);
    let texts = KernelSet::select(
        &selection,
        built_in_instruments(),
        &RequiredCoverage::default(),
    )
    .unwrap();
    let session = Session::open(&texts).unwrap();
    fs::remove_file(root.join("ck/mgs_sc_map2.bc")).unwrap();
    // Telemetry of two files that meet half a second before the exposures, and ends inside them.
    let seam = exposures.start.plus(-0.5);
    for (name, start, stop) in [
        ("mgs_sc_meet_v9.bc", exposures.start.plus(-20.0), seam),
        ("mgs_sc_meet_v10.bc", seam, exposures.start.plus(4.0)),
    ] {
        let instants = [start, stop];
        let segment = CkSegment {
            name: "telemetry",
            instants: &instants,
            quaternions: &[[1.0, 0.0, 0.0, 0.0]; 2],
            angular_velocities_rad_s: &[[0.0; 3]; 2],
            interval_starts: &instants[..1],
        };
        write_ck(&root.join("ck").join(name), &session, &[segment], "").unwrap();
    }
    drop(session);
    for name in ["mgs_map2_v9.bsp", "mgs_map2_v10.bsp"] {
        let mut bytes = fs::read(root.join("mgs_map2.bsp")).unwrap();
        // A word after the end changes its content.
        bytes.extend_from_slice(name.as_bytes());
        write(root, name, &bytes);
    }
    let required = around(exposures);
    let set = KernelSet::select(&selection, built_in_instruments(), &required).unwrap();
    let chosen = names(&set);
    let expected = [
        "mgs_map2.bsp",
        "mgs_map2_first.bsp",
        "mgs_map2_v9.bsp",
        "mgs_map2_v10.bsp",
        "mgs_ext_roto_all_v9.bc",
        "mgs_sc_meet_v9.bc",
        "mgs_sc_meet_v10.bc",
    ];
    assert_eq!(chosen[chosen.len() - 7..], expected);
    let explanation = set.explanation().join("\n");
    for line in [
        "mgs_ext_roto_all_v9.bc: NOMINAL attitude of MGS: commanded, not measured".to_owned(),
        // Telemetry ends 4 s into the exposures; look-ups end 1.15 s before them, and 1 s later.
        format!(
            "attitude of {} comes from nominal mgs_ext_roto_all_v9.bc",
            Interval::new(
                exposures.start.plus(4.0),
                exposures.stop.plus(BIAS.seconds() + 1.0)
            )
        ),
    ] {
        assert!(explanation.contains(&line), "{line} in {explanation}");
    }
    selection.ck_quality = vec![CkQuality::Reconstructed];
    let set = KernelSet::select(&selection, built_in_instruments(), &required).unwrap();
    assert!(!set.explanation().join("\n").contains("comes from nominal"));
}
