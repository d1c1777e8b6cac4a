//! An archive in an object store: as one on a server of files.

use std::{fs, process::Command};

use super::{Archive, FIRST, SECOND, SMALL, failed};
use crate::common::{archive_server::Listing, mission::succeed, object_store::ObjectStore};

#[test]
fn an_object_store_is_read_as_a_server_of_files() {
    let archive = Archive::new(Listing::Plain);
    let root = archive.path("archive");
    let store = ObjectStore::of(&root);
    let url = "s3://mola/data/";
    let index = |key: &str| store.named_by(archive.index_of(url, &["--json"]), key);
    let indexed = || -> serde_json::Value {
        serde_json::from_slice(&succeed(&mut index("KEY")).stdout).unwrap()
    };
    let made = indexed();
    assert!(made["files"] == 2 && made["read"] == 2, "{made}");
    // The first request, which the store was too busy for; one listing of the folder in two answers, and one of the folder below it.
    let listings = |store: &ObjectStore| {
        let requests = store.requests();
        requests
            .iter()
            .filter(|target| target.contains("list-type=2"))
            .count()
    };
    assert_eq!(listings(&store), 5);
    let of_folder = archive.found("archive/data", SMALL);
    let before = store.requests().len();
    let mut search = store.named_by(archive.search("mola", SMALL, "mola.csv"), "KEY");
    let stated = succeed(&mut search).stdout;
    assert_eq!(fs::read(archive.path("mola.csv")).unwrap(), of_folder[0]);
    let stated: serde_json::Value = serde_json::from_slice(&stated).unwrap();
    assert!(stated["complete"] == true && store.requests().len() > before);
    // Unchanged objects are not read again; a changed one is.
    let made = indexed();
    assert!(made["files"] == 2 && made["read"] == 0, "{made}");
    let mut bytes = fs::read(root.join(FIRST)).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(root.join(FIRST), bytes).unwrap();
    assert_eq!(indexed()["read"], 1);
    fs::remove_file(root.join(SECOND)).unwrap();
    assert_eq!(indexed()["removed"], 1);
}

#[test]
fn an_object_store_that_refuses_is_reported_without_signatures() {
    let archive = Archive::new(Listing::Plain);
    let store = ObjectStore::of(&archive.path("archive"));
    let refused = |mut command: Command| {
        let (code, error) = failed(&command.output().unwrap());
        assert!(
            !error.contains("X-Amz") && !error.contains("HIDDEN"),
            "{error}"
        );
        (code, error)
    };
    for (url, key, expected, advice) in [
        (
            "s3://mola/data/",
            "OTHER",
            "s3://mola/data/: HTTP status 403",
            "AWS_ACCESS_KEY_ID",
        ),
        (
            "s3://elsewhere/data/",
            "KEY",
            "HTTP status 301",
            "AWS_REGION",
        ),
        (
            "s3://absent/data/",
            "KEY",
            "HTTP status 404",
            "no object has this key",
        ),
        (
            "s3://mola/nothing/",
            "KEY",
            "HTTP status 404",
            "no object has this key",
        ),
        (
            "s3:///data/",
            "KEY",
            "expected s3://BUCKET/PREFIX/",
            "AWS_ENDPOINT_URL_S3",
        ),
    ] {
        let (_, error) = refused(store.named_by(archive.index_of(url, &[]), key));
        assert!(
            error.contains(expected) && error.contains(advice),
            "{url}: {error}"
        );
    }
    for (name, value, expected) in [
        (
            "AWS_ENDPOINT_URL_S3",
            "http://store.example.org",
            "on this computer",
        ),
        ("AWS_SECRET_ACCESS_KEY", "", "without AWS_SECRET_ACCESS_KEY"),
    ] {
        let mut command = store.named_by(archive.index_of("s3://mola/data/", &[]), "KEY");
        command.env(name, value);
        let (code, error) = refused(command);
        assert!(error.contains(expected) && code == 2, "{error}");
    }
    assert!(!archive.path("mola").exists());
    // An object that is gone after it was indexed.
    succeed(&mut store.named_by(archive.index_of("s3://mola/data/", &[]), "KEY"));
    fs::remove_file(archive.path("archive").join(FIRST)).unwrap();
    let search = archive.search("mola", SMALL, "gone.csv");
    let (_, error) = refused(store.named_by(search, "KEY"));
    assert!(
        error.contains(&format!("s3://mola/{FIRST}: HTTP status 404")),
        "{error}"
    );
}
