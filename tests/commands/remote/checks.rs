//! The range check of an archive on its server.

use std::{fs, path::Path, sync::atomic::AtomicBool};

use areograph::{
    scene::{ArchiveOptions, write_archive},
    watch::Watch,
};

use crate::common::{
    archive_server::{ArchiveServer, Listing},
    mission::{areograph, succeed},
};

#[test]
fn a_range_check_of_stand_ins_is_that_of_their_files() {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let path = |relative: &str| folder.path().join(relative);
    let options = ArchiveOptions { seed: 1, days: 1 };
    let watch = AtomicBool::new(false);
    write_archive(&path("archive"), &options, Watch::from(&watch)).unwrap();
    let server = ArchiveServer::of(&path("archive"), Listing::Plain);
    let mut index = areograph();
    let url = format!("{}/pedr/", server.url());
    index.args(["--quiet", "pedr", "index", &url, "--into"]);
    succeed(index.arg(path("mola")));
    let check = |pedr: &[&Path], out: &str| -> serde_json::Value {
        let mut check = areograph();
        check.args(["--quiet", "pedr", "qa"]).args(pedr);
        check
            .arg("--kernels")
            .arg(path("archive/kernels/archive.tm"));
        let output = check.arg("--out").arg(path(out)).output().unwrap();
        // The archive has bad orbits.
        assert_eq!(output.status.code(), Some(5), "{output:?}");
        let text = fs::read_to_string(path(out).join("archive.json")).unwrap();
        let pedr = pedr[0].to_str().unwrap();
        serde_json::from_str(&text.replace(pedr, "PEDR")).unwrap()
    };
    let (here, there) = (path("archive/pedr"), path("mola"));
    let of_files = check(&[&here], "qa_files");
    let of_stand_ins = check(&[&there], "qa_stand_ins");
    assert_eq!(of_files, of_stand_ins);
    let hashed = serde_json::to_string(&of_files).unwrap();
    for entry in fs::read_dir(&here).unwrap() {
        let bytes = fs::read(entry.unwrap().path()).unwrap();
        assert!(
            hashed.contains(blake3::hash(&bytes).to_hex().as_str()),
            "{hashed}"
        );
    }
    // A file and its stand-in are copies.
    let of_both = check(&[&here, &there], "qa_both");
    assert_eq!(
        of_both["copies"].as_array().map(Vec::len),
        Some(1),
        "{of_both}"
    );
}
