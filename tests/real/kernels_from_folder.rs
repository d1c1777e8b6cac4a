//! Kernels of image M04/02852 chosen from the folder that they came in: slices, of which an earlier one holds the Sun as Mars
//! saw it during the image.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::path::Path;

use serde_json::Value;

use common::{
    case::Case,
    json,
    mission::{areograph, succeed},
};

/// A site of the image alone, with its kernels from this source.
fn site(case: &Case, name: &str, kernels: &str, data: &Path) -> std::path::PathBuf {
    let label = data.join("m0402852_isis.lbl");
    let text = format!(
        "site = '{name}'\n[kernels]\n{kernels}\n[[images]]\nid = 'm04-02852'\nlabel = '{}'\n",
        label.display()
    );
    let file = format!("{name}.toml");
    case.write(&file, text);
    case.path(&file)
}

#[test]
fn the_kernels_of_a_real_image_are_chosen_from_their_folder() {
    let Some(data) = common::real_data("ale_mgs/m0402852", "kernels from a real folder") else {
        return;
    };
    let data = data.canonicalize().unwrap();
    let case = Case::empty();
    let listed: Vec<String> = common::m0402852_files(&data)
        .iter()
        .map(|path| format!("'{}'", path.display()))
        .collect();
    let out = case.path("out");
    let camera = |name: &str, kernels: &str| {
        let site = site(&case, name, kernels, &data);
        let mut run = areograph();
        succeed(
            run.args(["--quiet", "run"])
                .arg(site)
                .arg("--out")
                .arg(&out),
        );
        json(&out.join(name).join("images/m04-02852/isd.json"))
    };
    let by_folder = camera("folder", &format!("root = '{}'", data.display()));
    let by_list = camera("list", &format!("files = [{}]", listed.join(", ")));
    for (table, member) in [
        ("sun_position", "positions"),
        ("instrument_position", "positions"),
        ("instrument_pointing", "quaternions"),
        ("body_rotation", "quaternions"),
    ] {
        let of = |camera: &Value| camera[table][member].clone();
        assert!(of(&by_folder).as_array().unwrap().len() > 1);
        assert!(of(&by_folder) == of(&by_list), "{table}");
    }
    let manifest = json(&out.join("folder/manifest.json"));
    let names: Vec<&str> = manifest["kernels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|kernel| kernel["name"].as_str().unwrap())
        .collect();
    // It ends ten minutes before the image.
    assert!(names.contains(&"m0402852.ale_0.bsp"), "{names:?}");
    assert!(
        !names.contains(&"mgs_sc_map2_0_sliced_-94000.bc"),
        "{names:?}"
    );
}

#[test]
fn a_missing_sun_is_named() {
    let Some(data) = common::real_data("ale_mgs/m0402852", "kernels without the Sun") else {
        return;
    };
    let data = data.canonicalize().unwrap();
    let case = Case::empty();
    std::fs::create_dir(case.path("kernels")).unwrap();
    for path in common::m0402852_files(&data) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name != "m0402852.ale_0.bsp" {
            case.write(&format!("kernels/{name}"), std::fs::read(path).unwrap());
        }
    }
    let site = site(&case, "sun", "root = 'kernels'", &data);
    let mut run = areograph();
    run.args(["--quiet", "run"])
        .arg(site)
        .arg("--out")
        .arg(case.path("out"));
    let output = run.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{told}");
    assert!(
        told.contains("no position of the Sun as seen from Mars at "),
        "{told}"
    );
    assert!(
        told.contains("and the Sun 687 to 834 s earlier, when the light left the Sun"),
        "{told}"
    );
    assert!(!told.contains("SPKINSUFFDATA"), "{told}");
}
