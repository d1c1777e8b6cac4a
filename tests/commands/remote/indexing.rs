//! What an index of a server writes, keeps and removes.

use std::{fs, os::unix::fs::symlink};

use super::{Archive, FIRST, LARGE, SECOND, failed};
use crate::common::{
    archive_server::{Fault, Listing},
    mission::{areograph, succeed},
};

#[test]
fn lists_and_addresses_are_checked_before_anything_is_written() {
    let archive = Archive::new(Listing::Plain);
    let list = archive.path("list.txt");
    let own = [list.to_str().unwrap()];
    let with_list = |text: &str| {
        fs::write(&list, text).unwrap();
        archive.index(&["--list", own[0]])
    };
    for bad in [
        "../data/ap19xxx/AP19030L.B",
        "https://other.gov/ap19xxx/AP19030L.B",
    ] {
        let (code, error) = failed(&with_list(bad).output().unwrap());
        assert!(error.contains("list.txt: line 1") && code == 2, "{error}");
    }
    for (url, expected, code) in [
        ("http://example.org/data/", "expected https://", 2),
        ("https:///data", "not a permitted address", 2),
        ("file://archive/data", "s3://, file:///, or http://", 2),
        ("http://127.0.0.1:1/data/", "attempts: 3", 6),
        (
            &format!("{}/nothing", archive.server.url()),
            "HTTP status 404",
            6,
        ),
        (
            &format!("{}/data/aareadme.txt", archive.server.url()),
            "HTTP status 404",
            6,
        ),
    ] {
        let (found, error) = failed(&archive.index_of(url, &[]).output().unwrap());
        assert!(error.contains(expected), "{url}: {error}");
        assert_eq!(found, code, "{url}: {error}");
    }
    let path = format!("/{FIRST}");
    archive.server.next(&path, [Fault::IgnoresRange]);
    let (_, error) = failed(&archive.index(&[]).output().unwrap());
    assert!(error.contains("no range requests"), "{error}");
    assert!(!archive.path("mola").exists());
    fs::create_dir(archive.path("archive/empty")).unwrap();
    let empty = format!("{}/empty", archive.server.url());
    let (_, error) = failed(&archive.index_of(&empty, &[]).output().unwrap());
    assert!(error.contains("names no PEDR file"), "{error}");
    let script = format!(
        "wget -nc {}/ap19xxx/AP19030L.B\n",
        archive.url().replace("http:", "ftp:")
    );
    succeed(&mut with_list(&script));
    assert!(archive.path("mola/ap19xxx/AP19030L.B").exists());
    assert!(!archive.path("mola/ap19xxx/ap19020k.b").exists());
    // A file of the user with the name of a stand-in.
    fs::copy(
        archive.path("archive").join(SECOND),
        archive.path("mola/ap19xxx/ap19020k.b"),
    )
    .unwrap();
    let (_, error) = failed(&archive.index(&[]).output().unwrap());
    assert!(error.contains("a stand-in that areograph wrote"), "{error}");
    // Without the description of the archive.
    fs::remove_file(archive.path("mola/areograph-archive.toml")).unwrap();
    let (_, _, error) = archive.refused(LARGE);
    assert!(error.contains("areograph-archive.toml"), "{error}");
    for (arguments, expected) in [
        (&["https://a.gov/"][..], "without a folder"),
        (&["mola", "--into", "x"], "without the address"),
    ] {
        let mut index = areograph();
        index.current_dir(archive.folder.path());
        let output = index
            .args(["pedr", "index"])
            .args(arguments)
            .output()
            .unwrap();
        let (code, error) = failed(&output);
        assert!(error.contains(expected) && code == 2, "{error}");
    }
}

#[test]
fn an_index_removes_nothing_of_other_archives() {
    let archive = Archive::indexed();
    let mola = archive.path("mola");
    let other = archive.path("other");
    fs::create_dir(&other).unwrap();
    let stand_in = mola.join("ap19xxx/ap19020k.b");
    // Behind a link, and in a folder of another archive.
    fs::copy(&stand_in, other.join("ap20000l.b")).unwrap();
    symlink(&other, mola.join("link")).unwrap();
    symlink(other.join("ap20000l.b"), mola.join("ap20001l.b")).unwrap();
    let nested = mola.join("nested");
    fs::create_dir(&nested).unwrap();
    fs::copy(
        mola.join("areograph-archive.toml"),
        nested.join("areograph-archive.toml"),
    )
    .unwrap();
    fs::copy(&stand_in, nested.join("ap20002l.b")).unwrap();
    // The archive no longer has it.
    fs::copy(&stand_in, mola.join("ap20003l.b")).unwrap();
    let list = archive.path("list.txt");
    fs::write(&list, "ap19xxx/ap19020k.b").unwrap();
    let removed = |arguments: &[&str]| {
        let stated = succeed(archive.index(arguments).arg("--json")).stdout;
        let stated: serde_json::Value = serde_json::from_slice(&stated).unwrap();
        stated["removed"].as_u64().unwrap()
    };
    assert_eq!(removed(&["--list", list.to_str().unwrap()]), 0);
    assert!(mola.join("ap19xxx/AP19030L.B").exists() && mola.join("ap20003l.b").exists());
    assert_eq!(removed(&[]), 1);
    assert!(!mola.join("ap20003l.b").exists());
    for kept in [
        other.join("ap20000l.b"),
        mola.join("ap20001l.b"),
        nested.join("ap20002l.b"),
    ] {
        assert!(kept.exists(), "{}", kept.display());
    }
    // A second archive in the same folder.
    let second = format!("{}/ap19xxx", archive.url());
    let (code, error) = failed(&archive.index_of(&second, &[]).output().unwrap());
    for part in [
        "areograph-archive.toml",
        &second,
        "a different folder with --into",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
    assert!(code == 2 && stand_in.exists());
}

#[test]
fn a_stand_in_is_found_from_its_folder_and_blocks_do_not_follow_links() {
    let archive = Archive::indexed();
    let folder = archive.path("mola/ap19xxx");
    // Files with the names of the blocks, at which links point.
    let blocks = archive.path("mola/.fetch/blocks");
    fs::create_dir_all(&blocks).unwrap();
    for file in [FIRST, SECOND] {
        let hash = blake3::hash(&fs::read(archive.path("archive").join(file)).unwrap());
        fs::write(archive.path("mine"), "mine").unwrap();
        symlink(archive.path("mine"), blocks.join(hash.to_hex().as_str())).unwrap();
    }
    let mut search = areograph();
    search
        .current_dir(&folder)
        .args(["--quiet", "pedr", "search"]);
    search.args([
        "AP19030L.B",
        "ap19020k.b",
        super::SMALL,
        "--wide",
        "--out",
        "found.csv",
    ]);
    succeed(&mut search);
    let found = fs::read(folder.join("found.csv")).unwrap();
    assert!(found == archive.found("archive", super::SMALL)[0]);
    assert_eq!(fs::read(archive.path("mine")).unwrap(), b"mine");
}
