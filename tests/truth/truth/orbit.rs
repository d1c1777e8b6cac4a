//! The orbit of the PEDR files against that of the kernels: which of them a run uses moves the place by what lies between
//! them, and the option that takes the files' brings the place to where the kernels of that orbit have it.

use std::{fs, path::Path};

use super::{
    Judged, SITES,
    common::{
        long,
        mission::{areograph, succeed},
    },
    root_mean_square, scene,
};

/// The sites with these kernels and keys, run: two of them, and in the long run all.
fn judged(mission: &Path, kernels: &str, keys: &str) -> Vec<Judged> {
    let folder = mission.join(format!("sites-{kernels}-{}", keys.len()));
    fs::create_dir(&folder).unwrap();
    let out = folder.join("out");
    let mut run = areograph();
    run.args(["--quiet", "run"]);
    let sites = if long() { &SITES[..] } else { &SITES[1..] };
    for site in sites {
        let text = fs::read_to_string(mission.join(format!("sites/{site}.toml"))).unwrap();
        assert!(text.contains("kernels/nav.tm"), "{text}");
        let text = text.replace("kernels/nav.tm", &format!("kernels/{kernels}.tm"));
        let text = text.replacen("[adjustment]\n", &format!("[adjustment]\n{keys}"), 1);
        let path = folder.join(format!("{site}.toml"));
        fs::write(&path, text).unwrap();
        run.arg(path);
    }
    succeed(run.arg("--out").arg(&out));
    let judged = sites.iter().map(|site| Judged::of(mission, &out, site));
    judged.collect()
}

#[test]
fn the_orbit_of_the_pedr_files_puts_images_where_its_own_kernels_do() {
    let folder = tempfile::tempdir().unwrap();
    let mission = scene(folder.path(), 1, &[]);
    // The files' orbit is that of the kernels "gsfc", and the true one but for 20 m of each camera.
    let told = judged(&mission, "gsfc", "");
    let plain = judged(&mission, "nav", "");
    let moved = judged(&mission, "nav", "orbit_of_pedr = \"yes\"\n");
    let mut off_m = Vec::new();
    for (told, (plain, moved)) in told.iter().zip(plain.iter().zip(&moved)) {
        let [plain_m, moved_m] = [plain, moved].map(|of| of.mean_m() - told.mean_m());
        println!(
            "{}: {:.1} m from the place by gsfc, {:.2} m with the orbit of the PEDR file",
            told.name,
            plain_m.norm(),
            moved_m.norm()
        );
        // Metres: the orbits' distance changes by less than that over an image.
        assert!(moved_m.norm() < 0.5, "{}: {moved_m}", told.name);
        off_m.push(plain_m.norm());
        // What is stated is what it was: the attitude is known to 150 m only.
        let stated_m = moved.mean_sigmas_m - plain.mean_sigmas_m;
        assert!(stated_m.norm() < 0.5, "{}: {stated_m}", told.name);
    }
    // Without it the place is off by as much as the two orbits, in the mean of both images: a few metres.
    assert!(root_mean_square(off_m.into_iter()) > 2.0);
}
