//! Support data of a camera that does not fly along its x axis, so that no line sees a point.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "tests work in temporary folders, and their helpers may fail loudly"
)]

use std::fs;

use crate::common::{json, mission::site_run};
use areograph::{body::Body, error::Kind, stages::line_camera::LineCamera};
use serde_json::{Value, json};

/// The support data of a spacecraft that stands still over a body that does not turn.
fn standing(support: &Value) -> Value {
    let mut standing = support.clone();
    for (block, keys) in [
        ("instrument_position", ["positions", "velocities"]),
        ("body_rotation", ["quaternions", "angular_velocities"]),
    ] {
        for key in keys {
            let rows = standing[block][key].as_array_mut().unwrap();
            let first = match key {
                "positions" | "quaternions" => rows[0].clone(),
                _ => json!([0.0, 0.0, 0.0]),
            };
            rows.fill(first);
        }
    }
    standing
}

#[test]
fn a_spacecraft_that_stands_still_is_refused() {
    let site = site_run("gusev_crater");
    let path = site.join("images/E02-00665/isd.json");
    let support = json(&path);
    let folder = tempfile::tempdir().unwrap();
    let still = folder.path().join("still.json");
    fs::write(&still, standing(&support).to_string()).unwrap();
    let read = |path| LineCamera::read(path, "E02-00665", Body::Mars).unwrap();
    assert!(read(&path).projector().is_ok());
    let camera = read(&still);
    let failure = camera.projector().map(|_| ()).unwrap_err();
    assert_eq!(failure.kind(), Kind::Input);
    let told = failure.to_string();
    assert!(
        told.contains("image E02-00665: ") && told.contains("moves along its detector line"),
        "{told}"
    );
    assert!(
        told.contains("belong to an image that shows the ground"),
        "{told}"
    );
}
