//! Kernel files, lists and folders: which are accepted, which are rejected and with which messages.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests outside a test function"
)]

use areograph_testing as common;

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
};

use areograph_base::{
    body::Body,
    error::{Error, Kind},
    time::Et,
};
use areograph_config::usual_instrument;
use areograph_spice::{KernelRole, KernelSet, Session};
use common::real_data;
use tempfile::{TempDir, tempdir};

/// Copies a real file under another name.
fn copy(from: &Path, folder: &Path, name: &str) -> PathBuf {
    let to = folder.join(name);
    fs::copy(from, &to).unwrap();
    // The originals may be read-only.
    let mut permissions = fs::metadata(&to).unwrap().permissions();
    #[allow(
        clippy::permissions_set_readonly_false,
        reason = "a file in a temporary folder"
    )]
    permissions.set_readonly(false);
    fs::set_permissions(&to, permissions).unwrap();
    to
}

#[allow(clippy::disallowed_methods, reason = "input of a test, not a product")]
fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, content).unwrap();
    path
}

/// The folder of real kernels and an empty one.
fn folders(test: &str) -> Option<(PathBuf, TempDir)> {
    Some((real_data("ale_mgs/m0402852", test)?, tempdir().unwrap()))
}

fn one(path: &Path) -> Error {
    KernelSet::from_files(&[path.to_owned()]).unwrap_err()
}

fn et(seconds: f64) -> Et {
    Et::from_seconds(seconds)
}

fn times(folder: &Path) -> KernelSet {
    let files = ["naif0012.tls", "MGS_SCLKSCET.00061.tsc"].map(|name| folder.join(name));
    KernelSet::from_files(&files).unwrap()
}

#[test]
fn sessions_follow_one_another_and_threads_wait() {
    let Some((folder, _)) = folders("500 sessions") else {
        return;
    };
    let files: Vec<PathBuf> = [
        "naif0012.tls",
        "MGS_SCLKSCET.00061.tsc",
        "moc20.ti",
        "m0402852.ale_1.bsp",
        "mgs_sc_map2_1_sliced_-94000.bc",
    ]
    .iter()
    .map(|name| folder.join(name))
    .collect();
    let set = KernelSet::from_files(&files).unwrap();
    let work = |count: usize| {
        for _ in 0..count {
            let session = Session::open(&set).unwrap();
            let start = session.sclk_to_et("619971158:28").unwrap();
            assert!((start.seconds() - -11_224_002.182_053_322).abs() < 1e-9);
            assert!(
                (session.state(start).unwrap().position.xyz_m.norm() - 3_746_369.0).abs() < 500.0
            );
        }
    };
    thread::scope(|scope| {
        scope.spawn(|| work(250));
        scope.spawn(|| work(250));
        // A thread that panics inside a session leaves the lock usable and the kernels unloaded.
        let broken = scope.spawn(|| {
            let _session = Session::open(&set).unwrap();
            panic!("inside a session");
        });
        assert!(broken.join().is_err());
    });
    work(1);
    let _session = Session::open(&set).unwrap();
    let second = Session::open(&set).unwrap_err();
    assert_eq!(second.kind(), Kind::Bug);
    let text = second.cause.to_string();
    assert_eq!(text, "a SPICE session is already open on this thread");
}

#[test]
fn faults_of_cspice_carry_both_messages_of_naif() {
    let Some((folder, _)) = folders("NAIF's messages") else {
        return;
    };
    let session = Session::open(&times(&folder)).unwrap();
    let failure = session.utc_to_et("1999-13-24T25:00:00").unwrap_err();
    println!("{failure}");
    let text = failure.cause.to_string();
    assert!(text.starts_with(
        "str2et_c(\"1999-13-24T25:00:00\"): SPICE(BADTIMESTRING): The month specified was 13."
    ));
    assert_eq!(failure.kind(), Kind::Input);
    // The session remains usable after an error.
    assert!(session.utc_to_et("1999-08-24T14:12:13.64").is_ok());
    for utc in ["1999-02-30T00:00:00", "1999-12-31T24:59:00", "yesterday"] {
        let kind = session.utc_to_et(utc).map_err(|failure| failure.kind());
        assert_eq!(kind, Err(Kind::Input), "{utc}");
    }
    for sclk in ["", "lots", "999999999999:0"] {
        let kind = session.sclk_to_et(sclk).map_err(|failure| failure.kind());
        assert_eq!(kind, Err(Kind::Input), "{sclk}");
    }
    let long = "9".repeat(300);
    assert_eq!(
        session.sclk_to_et(&long).unwrap_err().cause.to_string(),
        "a clock string cannot be passed to CSPICE: its length is 300 bytes; expected at most 255"
    );
    assert!(
        session.state(et(0.0)).is_err() && session.mounting(usual_instrument(), et(0.0)).is_err()
    );
    assert!(
        session.body_matrix(Body::Mars, et(0.0)).is_err() && session.sun_state(et(0.0)).is_err()
    );
    drop(session);
    let empty = Session::open(&KernelSet::default()).unwrap();
    let failure = empty.utc_to_et("1999-08-24").unwrap_err();
    assert_eq!(failure.kind(), Kind::Coverage);
    assert_eq!(
        failure.cause.to_string(),
        "no leap-second kernel (.tls) in the set, which is empty"
    );
}

#[test]
fn what_is_no_kernel_is_refused_with_its_name() {
    let Some((folder, temporary)) = folders("files that are no kernels") else {
        return;
    };
    let at = temporary.path();
    let spk = fs::read(folder.join("m0402852.ale_1.bsp")).unwrap();
    let mut circle = spk.clone();
    let summary = usize::try_from(i32::from_le_bytes(spk[76..80].try_into().unwrap())).unwrap();
    let offset = (summary - 1) * 1_024;
    circle[offset..offset + 8].copy_from_slice(&(summary as f64).to_le_bytes());
    let cases: [(&str, &[u8], &str); 10] = [
        (
            "frames.tf",
            b"KPL/FK\n\\begindata\nFRAME_X = 1\nKERNELS_TO_LOAD += 'hidden.tls'\n",
            "is a metakernel; expected a kernel",
        ),
        ("empty.bsp", b"", "is an empty file; expected"),
        (
            "page.bsp",
            b"<!DOCTYPE html><html>404</html>",
            "is a web page; expected",
        ),
        (
            "notes.tls",
            b"KPL/LSK\nno data here\n",
            "is a text without a \\begindata block",
        ),
        (
            "image.bc",
            b"\x89PNG\0\0\0\0\0",
            "is a binary file of a different kind; expected",
        ),
        (
            "odd.ti",
            b"\\begindata\nCOLOUR = 3\n",
            "is a text kernel of unknown kind",
        ),
        (
            "broken.ti",
            b"\\begindata\nINS-1 = (3\n",
            "line 2: the list of INS-1 is not closed by ')'",
        ),
        (
            "head.bsp",
            &spk[..900],
            "record 1 lies beyond the end of the file (900 bytes)",
        ),
        (
            "short.bsp",
            &spk[..spk.len() - 1_024],
            "its file record states",
        ),
        ("circle.bsp", &circle, "the summary records form a cycle"),
    ];
    for (name, content, expected) in cases {
        let failure = one(&write(at, name, content));
        let text = failure.to_string();
        assert!(text.contains(expected), "{name}: {text}");
        assert!(
            text.contains(name) && failure.kind() == Kind::Input,
            "{text}"
        );
    }
    let transfer = one(&folder.join("m0402852.ale_1.xsp")).to_string();
    assert!(
        transfer.contains("is a transfer file (convert it"),
        "{transfer}"
    );
    assert_eq!(one(&at.join("absent.bsp")).kind(), Kind::Input);
    assert_eq!(one(at).kind(), Kind::Input);
    let deep = at.join("d".repeat(200)).join("e".repeat(200));
    let failure = one(&deep.join("naif.tls")).to_string();
    assert!(
        failure.contains("a path cannot be passed to CSPICE"),
        "{failure}"
    );
}

#[test]
fn a_chain_of_segments_ends_with_zero_only() {
    let Some((folder, temporary)) = folders("a broken chain of segments") else {
        return;
    };
    let spk = fs::read(folder.join("m0402852.ale_1.bsp")).unwrap();
    let summary = usize::try_from(i32::from_le_bytes(spk[76..80].try_into().unwrap())).unwrap();
    let offset = (summary - 1) * 1_024;
    for next in [f64::NAN, f64::INFINITY, -1.0, 0.5, 2.5, 1e-300] {
        let mut bytes = spk.clone();
        bytes[offset..offset + 8].copy_from_slice(&next.to_le_bytes());
        let failure = one(&write(temporary.path(), "chain.bsp", &bytes));
        let text = failure.to_string();
        assert!(
            text.contains(&format!("the summary records continue at record {next}")),
            "{text}"
        );
        assert_eq!(failure.kind(), Kind::Input);
    }
    let mut bytes = spk;
    bytes[76..80].copy_from_slice(&(-3_i32).to_le_bytes());
    let text = one(&write(temporary.path(), "first.bsp", &bytes)).to_string();
    assert!(text.contains("continue at record -3"), "{text}");
}

#[test]
fn damaged_bytes_end_in_a_result() {
    let Some((folder, temporary)) = folders("damaged kernels") else {
        return;
    };
    for name in ["m0402852.ale_0.bsp", "mgs_sc_map2_0_sliced_-94000.bc"] {
        let sound = fs::read(folder.join(name)).unwrap();
        let summary = usize::try_from(i32::from_le_bytes(sound[76..80].try_into().unwrap()));
        let summaries = (summary.unwrap() - 1) * 1_024;
        // Every byte of the file record's numbers and of the segment list, with four values each.
        for position in (8..96).chain(summaries..summaries + 200) {
            for value in [0x00, 0x01, 0x7f, 0xff] {
                let mut bytes = sound.clone();
                bytes[position] = value;
                let path = write(temporary.path(), "damaged", &bytes);
                if let Err(failure) = KernelSet::from_files(&[path]) {
                    assert_eq!(failure.kind(), Kind::Input, "byte {position}: {failure}");
                }
            }
        }
    }
}

#[test]
fn roles_follow_content_and_nothing_is_loaded_twice() {
    let Some((folder, temporary)) = folders("roles by content") else {
        return;
    };
    let at = temporary.path();
    let files = [
        copy(&folder.join("naif0012.tls"), at, "one.bsp"),
        copy(&folder.join("MGS_SCLKSCET.00061.tsc"), at, "two"),
        copy(&folder.join("pck00009.tpc"), at, "three.bc"),
        copy(&folder.join("mocAddendum004.ti"), at, "four.tls"),
        copy(&folder.join("m0402852.ale_1.bsp"), at, "five.txt"),
        copy(
            &folder.join("mgs_sc_map2_1_sliced_-94000.bc"),
            at,
            "six.bsp",
        ),
        copy(&folder.join("naif0012.tls"), at, "seven.tls"),
    ];
    let set = KernelSet::from_files(&files).unwrap();
    let roles: Vec<KernelRole> = set.kernels().iter().map(|kernel| kernel.role).collect();
    assert_eq!(
        roles,
        [
            KernelRole::Sclk,
            KernelRole::Pck,
            KernelRole::Ik,
            KernelRole::Spk,
            KernelRole::Ck,
            KernelRole::Lsk
        ]
    );
    assert_eq!(
        set.explanation().last().unwrap(),
        "one.bsp: not loaded at its earlier position because it has the same content as seven.tls"
    );
    let last = set.kernels().last().unwrap();
    assert_eq!(
        (last.file_name().as_str(), last.bytes),
        ("seven.tls", 5_257)
    );
    let session = Session::open(&set).unwrap();
    assert!(session.utc_to_et("1999-08-24").is_ok());
}

#[test]
fn metakernels_are_read_and_written() {
    let Some((folder, temporary)) = folders("metakernels") else {
        return;
    };
    let at = temporary.path();
    let kernels =
        at.join("a folder with a name that is much longer than one string may be, it's so");
    fs::create_dir_all(kernels.join("lsk")).unwrap();
    copy(
        &folder.join("naif0012.tls"),
        &kernels.join("lsk"),
        "naif0012.tls",
    );
    copy(
        &folder.join("MGS_SCLKSCET.00061.tsc"),
        &kernels,
        "mgs_sclkscet_00061.tsc",
    );
    let metakernel = write(
        at,
        "mgs.tm",
        "KPL/MK\n\\begindata\nPATH_VALUES = ( 'a folder with a name that is much longer +'\n\
         'than one string may be, it''s so' )\nPATH_SYMBOLS = ( 'K' )\n\
         KERNELS_TO_LOAD = ( '$K/lsk/+'\n  'naif0012.tls',\n  '$K/MGS_SCLKSCET.00061.tsc' )\n\
         EXTRA = 3\n\\begintext\n",
    );
    let set = KernelSet::from_metakernel(&metakernel).unwrap();
    assert_eq!(set.kernels().len(), 2);
    let explanation = set.explanation().join("\n");
    assert!(explanation.contains("mgs_sclkscet_00061.tsc: stands in for a folder"));
    assert!(explanation.contains("mgs.tm: variable EXTRA is not loaded"));

    let out = at.join("out");
    fs::create_dir(&out).unwrap();
    let text = set.metakernel_text(Some(&out));
    assert!(text.contains("'../a folder"), "{text}");
    assert!(text.lines().all(|line| line.len() <= 132));
    let again = KernelSet::from_metakernel(&write(&out, "kernels.tm", &text)).unwrap();
    let hashes = |set: &KernelSet| -> Vec<String> {
        set.kernels()
            .iter()
            .map(|kernel| kernel.blake3.clone())
            .collect()
    };
    assert_eq!(hashes(&again), hashes(&set));
    let whole = write(&out, "whole.tm", set.metakernel_text(None));
    assert_eq!(
        hashes(&KernelSet::from_metakernel(&whole).unwrap()),
        hashes(&set)
    );

    for (list, expected) in [
        (
            "KERNELS_TO_LOAD = ( 'gone.tls' )",
            "names gone.tls, which does not exist (looked in",
        ),
        ("KERNELS_TO_LOAD = ( 3 )", "with the number"),
        ("KERNELS_TO_LOAD = ( 'a+' )", "ends with '+'"),
        (
            "KERNELS_TO_LOAD = ( 'out/kernels.tm' )",
            "is a metakernel; expected a kernel",
        ),
        (
            "PATH_SYMBOLS = 'A' KERNELS_TO_LOAD = '$A/x'",
            "1 PATH_SYMBOLS and 0 PATH_VALUES",
        ),
        (
            "KERNELS_TO_LOAD = (",
            "line 3: the list of KERNELS_TO_LOAD is not closed",
        ),
        ("A = 1", "lists no kernels"),
    ] {
        let bad = write(
            at,
            "bad.tm",
            format!("KPL/MK\n\\begindata\n{list}\n\\begintext\n"),
        );
        let text = KernelSet::from_metakernel(&bad).unwrap_err().to_string();
        assert!(text.contains(expected), "{text}");
    }
    let failure = KernelSet::from_metakernel(&folder.join("naif0012.tls")).unwrap_err();
    assert!(
        failure.to_string().contains("expected a metakernel"),
        "{failure}"
    );
}

#[test]
fn a_path_that_is_too_long_for_cspice_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let deep = folder
        .path()
        .join("long".repeat(50))
        .join("folders".repeat(20));
    fs::create_dir_all(&deep).unwrap();
    let path = write(&deep, "naif0012.tls", "KPL/LSK\n\\begindata\nA = 1\n");
    let failure = KernelSet::from_files(std::slice::from_ref(&path)).unwrap_err();
    assert_eq!(failure.kind(), Kind::Input);
    assert_eq!(failure.file.as_deref(), Some(&*path));
    let text = failure.to_string();
    assert!(text.contains("bytes; expected at most 255"), "{text}");
}
