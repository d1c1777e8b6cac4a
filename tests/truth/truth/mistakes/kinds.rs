//! The mistakes, as changes of the files of a mission or of its errors.

use areograph::scene::SceneErrors;

use super::super::{
    common::case::Case,
    unmodelled::changes::{in_sites, of_files, of_shots},
};
use crate::mutations::make_changes;

/// A mistake in the input of all sites of a mission.
pub(super) struct Mistake {
    pub(super) words: &'static str,
    pub(super) errors: fn(&mut SceneErrors),
    pub(super) files: fn(&Case, u32),
    /// Sites that may be valid beyond what is stated, because the verdict lists the error with these words among those that no
    /// datum tests.
    pub(super) untested: Option<&'static str>,
}

/// The image at nadir of each site, the image off nadir, and the PEDR file of the former.
const PAIRS: [(&str, &str, &str); 3] = [
    ("E02-02855", "E04-01275", "ap19215k.b"),
    ("E02-00665", "E02-01453", "ap18933l.b"),
    ("E02-02016", "E02-01301", "ap19117l.b"),
];
/// Errors that no datum of a site may test, as verdicts list them.
const ATTITUDE: &str = "an attitude error that all images share, up to";
const SHOTS: &str = "errors that ranges and radii of the shots share";
const CROSSOVERS: &str = "an error that the crossover residuals of all profiles at nadir share";
const START_TIMES: &str = "an error common to the start times of all images";
const RADII: &str = r#"["shot_radii", "mid_radius"]"#;
const RANGES: &str = r#"["ranges"]"#;

/// A mission without mistakes: in those, one profile in forty is misplaced, which is a mistake here.
pub(super) const NONE: Mistake = Mistake {
    words: "none",
    errors: |of| of.altimeter.misplaced_chance = 0.0,
    files: |_, _| {},
    untested: None,
};

fn change(case: &Case, changes: &str) {
    make_changes(case, &format!("changes = [{changes}]"));
}

/// A change of every pair.
fn of_pairs(case: &Case, changes: impl Fn([&str; 2]) -> String) {
    for (nadir, other, _) in PAIRS {
        change(case, &changes([nadir, other]));
    }
}

/// Attitudes of the images at nadir.
fn of_nadir_images(case: &Case, axis: &str, mrad: f64) {
    of_pairs(case, |[nadir, _]| {
        format!(r#"{{ attitude = {{ image = "{nadir}", axis = {axis}, mrad = {mrad} }} }}"#)
    });
}

/// Fields of the shots on the days of the images at nadir.
fn of_nadir_shots(case: &Case, fields: &str, number: &str) {
    let files = PAIRS.map(|(_, _, file)| format!("pedr/{file}"));
    of_files(case, &files, fields, number, None);
}

fn beam(errors: &mut SceneErrors, angles_rad: [f64; 2]) {
    (NONE.errors)(errors);
    errors.altimeter.boresight_rad = Some(angles_rad);
}

pub(super) const MISTAKES: &[Mistake] = &[
    Mistake {
        words: "all attitudes rotated by 1 mrad about the X axis of the spacecraft",
        files: |case, _| change(case, "{ attitude = { axis = [1, 0, 0], mrad = 1 } }"),
        untested: Some(ATTITUDE),
        ..NONE
    },
    Mistake {
        words: "all attitudes rotated by 1 mrad about the Y axis of the spacecraft",
        files: |case, _| change(case, "{ attitude = { axis = [0, 1, 0], mrad = 1 } }"),
        untested: Some(ATTITUDE),
        ..NONE
    },
    Mistake {
        words: "attitude of one image rotated by 1 mrad about the X axis",
        files: |case, _| of_nadir_images(case, "[1, 0, 0]", 1.0),
        ..NONE
    },
    Mistake {
        words: "attitude of one image rotated by 1 mrad about the Y axis",
        files: |case, _| of_nadir_images(case, "[0, 1, 0]", 1.0),
        ..NONE
    },
    Mistake {
        words: "laser beam rotated by 1 mrad across the track",
        errors: |of| beam(of, [0.0, 1e-3]),
        ..NONE
    },
    Mistake {
        words: "laser beam rotated by 1 mrad along the track",
        errors: |of| beam(of, [1e-3, 0.0]),
        ..NONE
    },
    Mistake {
        words: "times of shots 0.1 s late",
        files: |case, _| of_shots(case, r#"["time"]"#, "add = 0.1", None),
        ..NONE
    },
    Mistake {
        words: "times of shots 1 s late",
        files: |case, _| of_shots(case, r#"["time"]"#, "add = 1", None),
        ..NONE
    },
    Mistake {
        words: "one profile 600 m too far east, without the spacecraft",
        files: |case, _| of_nadir_shots(case, r#"["ground_longitude"]"#, "add = 10000"),
        ..NONE
    },
    Mistake {
        words: "one profile 3 km too far north, with the spacecraft",
        files: |case, _| {
            let fields = r#"["ground_latitude", "spacecraft_latitude"]"#;
            of_nadir_shots(case, fields, "add = 50000");
        },
        ..NONE
    },
    Mistake {
        words: "heights of one profile too high by 30 m, with consistent ranges",
        files: |case, _| {
            of_nadir_shots(case, RADII, "add = 3000");
            of_nadir_shots(case, RANGES, "add = -3000");
        },
        untested: Some(SHOTS),
        ..NONE
    },
    Mistake {
        words: "crossover residuals of one profile 100 times too large, as in another unit",
        files: |case, _| of_nadir_shots(case, r#"["crossover"]"#, "multiply = 100"),
        ..NONE
    },
    Mistake {
        words: "crossover residuals of all profiles 10 m too large",
        files: |case, _| of_shots(case, r#"["crossover"]"#, "add = 1000", None),
        untested: Some(CROSSOVERS),
        ..NONE
    },
    Mistake {
        words: "opposite sign of the altimeter's clock bias",
        files: |case, _| in_sites(case, "sign = \"late\"", "sign = \"early\""),
        ..NONE
    },
    Mistake {
        words: "longitudes of shots 0.033° too large, as by the prime meridian of another datum",
        files: |case, _| {
            let fields = r#"["ground_longitude", "spacecraft_longitude"]"#;
            of_shots(case, fields, "add = 33000", None);
        },
        ..NONE
    },
    Mistake {
        words: "labels of the two images exchanged",
        files: |case, _| {
            of_pairs(case, |[one, other]| {
                format!(
                    r#"{{ exchange = {{ files = ["labels/{one}.lbl", "labels/{other}.lbl"] }} }}"#
                )
            });
        },
        ..NONE
    },
    Mistake {
        words: "images of the tie points exchanged",
        files: |case, _| {
            for (site, (one, other, _)) in super::super::SITES.iter().zip(PAIRS) {
                let replace = |from: &str, to: &str| {
                    case.replace(&format!("ties/{site}.csv"), from, to);
                };
                replace(one, "third");
                replace(other, one);
                replace("third", other);
            }
        },
        ..NONE
    },
    Mistake {
        words: "start times in both labels 2 s late, by clock and UTC",
        files: |case, _| {
            of_pairs(case, |pair| {
                let late = pair.map(|image| {
                    format!(r#"{{ label_times = {{ file = "labels/{image}.lbl", seconds = 2 }} }}"#)
                });
                late.join(", ")
            });
        },
        untested: Some(START_TIMES),
        ..NONE
    },
    Mistake {
        words: "pointing bias −1.65 s instead of −1.15 s",
        files: |case, _| in_sites(case, "ck_bias_s = -1.15", "ck_bias_s = -1.65"),
        ..NONE
    },
    Mistake {
        words: "clock kernel wrong by 0.1 s",
        files: |case, _| {
            change(
                case,
                r#"{ number = { file = "kernels/mgs_clock.tsc", after = "3.1133176578000E+10", number = { add = 0.1 } } }"#,
            );
        },
        ..NONE
    },
    Mistake {
        words: "orbit kernel 300 m ahead",
        files: |case, _| change(case, "{ orbit = { along_up_cross_m = [300, 0, 0] } }"),
        ..NONE
    },
    Mistake {
        words: "orbit kernel displaced by 150 m across the track",
        files: |case, _| change(case, "{ orbit = { along_up_cross_m = [0, 0, 150] } }"),
        ..NONE
    },
];
