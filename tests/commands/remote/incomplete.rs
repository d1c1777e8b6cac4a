//! An archive that is not indexed completely is never taken for complete.

use std::{
    fs::{self, File},
    process::Stdio,
    thread,
    time::Duration,
};

use areograph::files::stand_in::StandIn;

use super::{Archive, FIRST, LARGE, SECOND, SMALL, below_data, failed};
use crate::common::{
    archive_server::{Fault, Listing},
    mission::{areograph, succeed},
};

impl Archive {
    /// Whether a file has a complete stand-in.
    fn has(&self, file: &str) -> bool {
        let file = File::open(self.path("mola").join(below_data(file)));
        file.is_ok_and(|file| StandIn::of_open(&file).is_ok_and(|found| found.is_some()))
    }

    /// All readers refuse the folder.
    fn is_refused_by_all(&self, missing: &str) {
        for window in [SMALL, LARGE] {
            let (code, stated, error) = self.refused(window);
            assert_eq!((code, &stated["complete"]), (3, &false.into()), "{error}");
            for part in ["not indexed yet", missing, "pedr index URL --into DIR"] {
                assert!(error.contains(part), "{part}: {error}");
            }
        }
        let glob = self.path("mola/ap19xxx/*");
        for command in ["info", "crossovers"] {
            let mut reader = areograph();
            reader
                .args(["--quiet", "pedr", command])
                .arg(match command {
                    "info" => glob.clone(),
                    _ => self.path("mola"),
                });
            if command == "crossovers" {
                reader.arg("--box=-80,80,20,21");
            }
            let (_, error) = failed(&reader.output().unwrap());
            assert!(error.contains("not indexed yet"), "{command}: {error}");
        }
    }
}

#[test]
fn a_killed_index_is_incomplete_until_it_is_run_again() {
    let archive = Archive::new(Listing::Plain);
    archive.server.always(&format!("/{SECOND}"), Fault::Slow);
    let mut index = archive.index(&[]).stdout(Stdio::null()).spawn().unwrap();
    let waits = (0..2_000).find(|_| {
        thread::sleep(Duration::from_millis(5));
        archive.has(FIRST)
    });
    index.kill().unwrap();
    index.wait().unwrap();
    assert!(waits.is_some() && !archive.has(SECOND));
    archive.is_refused_by_all("ap19020k.b");
    succeed(&mut archive.index(&[]));
    assert!(archive.found("mola", LARGE) == archive.found("archive", LARGE));
}

#[test]
fn a_file_that_cannot_be_read_leaves_the_index_incomplete() {
    let archive = Archive::new(Listing::Plain);
    archive
        .server
        .always(&format!("/{SECOND}"), Fault::Status(403));
    let (code, error) = failed(&archive.index(&[]).output().unwrap());
    assert!(code == 6 && error.contains("ap19020k.b"), "{error}");
    assert!(archive.has(FIRST));
    archive.is_refused_by_all("ap19020k.b");
    // The archive no longer has it: what remains is complete.
    fs::remove_file(archive.path("archive").join(SECOND)).unwrap();
    succeed(&mut archive.index(&[]));
    assert!(archive.found("mola", LARGE) == archive.found("archive", LARGE));
}

#[test]
fn compressed_files_are_reported() {
    let archive = Archive::new(Listing::Table);
    let served = archive.path("archive").join(SECOND);
    for ending in ["gz", "Z", "zip"] {
        let compressed = served.with_extension(format!("b.{ending}"));
        // Beside the file itself it is one more copy.
        fs::copy(&served, &compressed).unwrap();
        succeed(&mut archive.index(&[]));
        fs::rename(&served, archive.path("aside")).unwrap();
        let (code, error) = failed(&archive.index(&[]).output().unwrap());
        assert_eq!(code, 3, "{error}");
        assert!(
            error.contains(&format!("ap19020k.b.{ending}: a compressed PEDR file")),
            "{error}"
        );
        fs::remove_dir_all(archive.path("mola")).unwrap();
        failed(&archive.index(&[]).output().unwrap());
        archive.is_refused_by_all("ap19020k.b");
        fs::rename(archive.path("aside"), &served).unwrap();
        fs::remove_file(&compressed).unwrap();
        succeed(&mut archive.index(&[]));
    }
}

#[test]
fn links_of_a_listing_are_understood_or_an_error() {
    let archive = Archive::new(Listing::Plain);
    let page = |links: &str| Fault::Text(format!("<html>{links}</html>"));
    let folder = "/data/ap19xxx/";
    let (url, port) = (archive.url(), archive.server.port);
    let first = format!("<a href=\"{url}/ap19xxx/AP19030L.B\">x</a>");
    for second in [
        format!("<a href=\"{url}/ap19xxx/ap19020k.b\">x</a>"),
        format!("<a href=\"//127.0.0.1:{port}/data/ap19xxx/./ap19020k.b\">x</a>"),
        "<a href=\"/DATA/AP19XXX/../ap19xxx/ap19020k.b\">x</a>".to_owned(),
    ] {
        let links = format!("<A HREF='../'>up</A> <a href='?C=N;O=D'>Name</a> {first} {second}");
        archive.server.always(folder, page(&links));
        let stated = succeed(&mut archive.index(&["--json"])).stdout;
        let stated: serde_json::Value = serde_json::from_slice(&stated).unwrap();
        assert_eq!(
            (&stated["files"], &stated["removed"]),
            (&2.into(), &0.into())
        );
    }
    for unclear in [
        "https://b.gov/data/ap19xxx/ap19020k.b",
        "https://b.gov/data/ap20xxx/",
        "/mirror/ap20xxx/",
        "my%20folder/",
        "get.php?file=ap19020k.b",
    ] {
        let links = format!("{first} <a href=\"{unclear}\">x</a>");
        archive.server.always(folder, page(&links));
        let (code, error) = failed(&archive.index(&[]).output().unwrap());
        assert!(error.contains(unclear) && code == 2, "{error}");
        assert!(archive.has(SECOND));
    }
    archive.server.always(folder, page(&first));
    let deep = "1/2/3/4/5/6/7";
    fs::create_dir_all(archive.path("archive/data").join(deep)).unwrap();
    let (_, error) = failed(&archive.index(&[]).output().unwrap());
    assert!(error.contains("more than 6 folders deep"), "{error}");
    assert!(archive.has(SECOND));
}

#[test]
fn a_listing_without_its_end_removes_nothing() {
    let archive = Archive::indexed();
    let folder = "/data/ap19xxx/";
    archive.server.always(folder, Fault::NoEnd(140));
    let (code, error) = failed(&archive.index(&[]).output().unwrap());
    assert!(
        code == 6 && error.contains("ends without </html>"),
        "{error}"
    );
    assert!(archive.has(FIRST) && archive.has(SECOND));
    archive.server.always(folder, Fault::NoLength);
    succeed(&mut archive.index(&[]));
}
