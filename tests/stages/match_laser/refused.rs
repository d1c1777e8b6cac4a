//! Input that is damaged, mirrored, elsewhere or in other units: refused or marked, never valid with a wrong answer.

use std::fs;

use areograph::stages::match_laser::{MatchRequest, Similarity};

use super::{
    common::golden::assert_messages,
    matched,
    model::{Model, edited},
    request, scene, with_images,
};

/// What a request is told.
fn told(request: &MatchRequest) -> String {
    match matched(request) {
        Err(failure) => {
            let here = format!("{}/", request.model.parent().unwrap().display());
            let there = format!("{}/", scene().display());
            failure.to_string().replace(&here, "").replace(&there, "")
        }
        Ok(of) => {
            assert!(!of.verdict.valid, "{:?}", of.verdict);
            format!("{}: {}", of.verdict.word(), of.verdict.reasons.join("; "))
        }
    }
}

/// The same for a model that was changed.
fn refused_as(change: impl Fn(&mut MatchRequest), edit: impl Fn(&mut Model)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.tif");
    edited(&scene().join("model.tif"), &path, edit);
    let mut request = MatchRequest {
        model: path,
        ..request(15, None)
    };
    change(&mut request);
    told(&request)
}

fn refused(edit: impl Fn(&mut Model)) -> String {
    refused_as(|_| {}, edit)
}

/// The same for a file of other bytes.
fn refused_bytes(change: impl Fn(Vec<u8>) -> Vec<u8>) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.tif");
    let bytes = fs::read(scene().join("model.tif")).unwrap();
    fs::write(&path, change(bytes)).unwrap();
    told(&MatchRequest {
        model: path,
        ..request(15, None)
    })
}

fn value_of(model: &mut Model, key: u16) -> &mut u16 {
    let entries = model.directory[4..].chunks_exact_mut(4);
    let mut found = entries.filter(|entry| entry[0] == key);
    &mut found.next().unwrap()[3]
}

#[test]
fn models_that_lie_wrong_are_never_valid() {
    let told = [
        (
            "mirrored east to west",
            refused(|model| {
                let columns = model.columns;
                model
                    .heights_m
                    .chunks_exact_mut(columns)
                    .for_each(<[f32]>::reverse);
            }),
        ),
        (
            "upside down",
            refused(|model| {
                let columns = model.columns;
                let rows = model.heights_m.chunks_exact(columns).rev();
                model.heights_m = rows.flatten().copied().collect();
            }),
        ),
        ("elsewhere", refused(|model| model.tie[3] += 900_000.0)),
        (
            "half aside, beyond the search",
            refused(|model| model.tie[3] += 12_000.0),
        ),
        (
            "depths for heights",
            refused(|model| model.change(|height_m| -height_m)),
        ),
        (
            "heights in kilometres",
            refused(|model| model.change(|height_m| height_m / 1e3)),
        ),
        (
            "heights in centimetres",
            refused(|model| model.change(|height_m| height_m * 100.0)),
        ),
        ("flat", refused(|model| model.change(|_| 1_200.0))),
        (
            "a radius that is 190 m off, by concordance",
            refused_as(
                |request| {
                    request.radius_m = Some(3_396_000.0);
                    request.heights_apart = true;
                    request.options.similarity = Some(Similarity::Ccc);
                },
                |_| {},
            ),
        ),
        (
            "heights above the other sphere, by correlation",
            refused(|model| {
                model.change(|height_m| height_m - 35.0 + 190.0);
            }),
        ),
    ];
    assert_messages("match_wrong", &told);
}

#[test]
fn files_that_are_no_terrain_models_are_refused() {
    let told = [
        ("not a TIFF", refused_bytes(|_| b"heights: 1 2 3".to_vec())),
        (
            "cut off",
            refused_bytes(|bytes| bytes[..bytes.len() / 2].to_vec()),
        ),
        (
            "without its pixels",
            refused_bytes(|bytes| bytes[..64].to_vec()),
        ),
        (
            "no height anywhere",
            refused(|model| model.change(|_| -32_768.0)),
        ),
        (
            "no word for no height",
            refused(|model| model.no_data.clear()),
        ),
        (
            "a word that is no number",
            refused(|model| "none".clone_into(&mut model.no_data)),
        ),
        (
            "another radius without saying so",
            refused_as(|request| request.radius_m = Some(3_396_000.0), |_| {}),
        ),
        (
            "no radius",
            refused(|model| {
                let entries = model.directory[4..].chunks_exact(4);
                let kept = entries.filter(|entry| ![2057, 2058].contains(&entry[0]));
                let kept: Vec<u16> = kept.flatten().copied().collect();
                model.directory.truncate(4);
                model.directory.extend(kept);
            }),
        ),
        (
            "of the Earth",
            refused(|model| model.numbers[0] = 6_378_137.0),
        ),
        (
            "a radius in kilometres",
            refused_as(
                |request| {
                    request.radius_m = Some(3_396.19);
                    request.heights_apart = true;
                },
                |_| {},
            ),
        ),
        (
            "on an ellipsoid",
            refused(|model| {
                model.numbers.push(3_376_200.0);
                *value_of(model, 2058) = 3;
            }),
        ),
        (
            "another projection",
            refused(|model| *value_of(model, 3075) = 7),
        ),
        ("in feet", refused(|model| *value_of(model, 3076) = 9002)),
        ("without a place", refused(|model| model.scale.clear())),
        (
            "with negative cells",
            refused(|model| model.scale[1] = -150.0),
        ),
        (
            "larger than the globe",
            refused(|model| model.scale[0] = 1e5),
        ),
        (
            "a key that points nowhere",
            refused(|model| *value_of(model, 2057) = 40),
        ),
    ];
    assert_messages("match_refused", &told);
}

#[test]
fn shots_and_images_that_cannot_count_are_refused() {
    let twice = {
        let folder = tempfile::tempdir().unwrap();
        let copy = folder.path().join("ap99999l.b");
        let pass = fs::read_dir(scene().join("pedr"))
            .unwrap()
            .map(|of| of.unwrap().path());
        fs::copy(pass.min().unwrap(), &copy).unwrap();
        let mut request = request(15, None);
        request.pedr.push(copy);
        told(&request)
    };
    let few = {
        let mut request = request(15, None);
        request.pedr = vec![scene().join("pedr/ap10001l.b")];
        told(&request)
    };
    let damaged = {
        let folder = tempfile::tempdir().unwrap();
        let mut request = with_images(request(15, None));
        request.images[1].isd = folder.path().join("s2.json");
        fs::write(&request.images[1].isd, "{\"name_model\": ").unwrap();
        told(&request).replace(&format!("{}/", folder.path().display()), "")
    };
    let none = {
        let mut request = request(15, None);
        request.options.filter.classes = vec![7];
        told(&request)
    };
    let told = [
        ("the same shots in two files", twice),
        ("one pass", few),
        ("damaged support data", damaged),
        ("no shot of a class", none),
    ];
    assert_messages("match_shots", &told);
}
