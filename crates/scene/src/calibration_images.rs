//! Three lines of an ageing camera in several orbits, with their pixels and laser passes, and true values: calibrations from pixels,
//! each of which can validate the others.

use std::{collections::BTreeMap, path::Path};

use super::{
    calibration_loop::{
        CAMERAS, Folders, LINES, LineErrors, LineScene, OneOfOrbits, SIZE, Truth, put_truth,
    },
    calibration_orbits::OrbitsScene,
    files::{Draft, put},
};
use areograph_base::{
    error::{Locate as _, Result},
    watch::Watch,
};

const README: &str = "Three lines of a camera in several orbits: support data (isd/), pixels (images/), PEDR files of laser passes over the\n\
    ground of each orbit (pedr/), and a calibration file of each. The lines are mounted askew and age; every orbit, attitude and\n\
    laser pass has errors of its own, and images have shadows, unequal light and loss by compression. truth.json states the errors\n\
    and the true image coordinates of ground points. The first calibration validates itself in the other orbits, with the\n\
    measurements of their calibrations, which it expects in out/.\n\
    Next: areograph calibrate o02.toml --out out (and each later orbit), then areograph calibrate o01.toml --out out\n";

/// Writes three lines in several orbits with their pixels into `directory`, replacing an older scene unless files were added or
/// changed. The same options give the same bytes.
///
/// * `size` – lines and samples of an image; without it, 65 by 22 km
///
/// # Errors
/// [`SceneError`](super::SceneError) when the folder holds something else; errors of writing.
pub fn write_calibration_images(
    directory: &Path,
    scene: &OrbitsScene,
    size: Option<[u32; 2]>,
    watch: Watch<'_>,
) -> Result<String> {
    let draft = Draft::begin(directory, README)?;
    let folders = Folders::of(&draft)?;
    let size = size.unwrap_or(SIZE);
    watch.announce(scene.orbits as usize * LINES * size[0] as usize);
    let mut truth: BTreeMap<String, Truth> = BTreeMap::new();
    let name = |number: u32| format!("o{:02}", number + 1);
    for number in 0..scene.orbits {
        let lines = LineScene {
            seed: scene.seed,
            size,
            errors: LineErrors::Drawn(OneOfOrbits { number, of: *scene }),
        };
        let prefix = format!("{}_", name(number));
        let mut text = CALIBRATION.replace("ORBIT", &name(number))
            + &CAMERAS.replace("PREFIX", &prefix)
            + CONTROL;
        if number == 0 {
            let others = (1..scene.orbits).map(|other| VALIDATION.replace("ORBIT", &name(other)));
            text.extend(others);
        }
        truth.insert(name(number), folders.write(&lines, &prefix, watch)?);
        let path = draft.root().join(format!("{}.toml", name(number)));
        put(&path, &text).in_file(&path)?;
    }
    put_truth(&draft, &truth)?;
    draft.finish()?;
    Ok(format!(
        "{}: three lines with pixels in {} orbits; next: areograph calibrate {} --out {} and each later orbit, then o01.toml",
        directory.display(),
        scene.orbits,
        directory.join("o02.toml").display(),
        directory.join("out").display()
    ))
}

const CALIBRATION: &str = "\
calibration = \"ORBIT\"
description = \"Three synthetic lines in orbit ORBIT, from their pixels\"

";

const CONTROL: &str = "\
[laser]
files = [\"pedr/*.b\"]
cell_m = 100
search_cells = 40

[control]
sigma_px = 0.3
sigma_horizontal_m = 70.0
sigma_vertical_m = 1.0

[a_priori]
control_angle_deg = 0.3
look_px = 10.0
";

const VALIDATION: &str = "
[[validation]]
id = \"ORBIT\"
isd = [\"isd/ORBIT_*.json\"]
ties = [\"out/ORBIT/ties.csv\"]
control = [\"out/ORBIT/control.csv\"]
";
