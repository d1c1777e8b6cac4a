//! Errors that the adjustment does not model, over missions: whether verdicts notice them, and whether what is stated holds
//! where they do not.
//!
//! Seeds begin at 50,000. The long run writes the page with `SNAPSHOTS=overwrite`.

use std::fmt::Write as _;

use areograph::scene::{Jitter, Misregistration, Roughness, SceneErrors};

use super::{
    SITES, by_chance,
    common::{case::Case, kept, long},
    flown::{Pair, Plan, Site, Sizes, flown},
    root_mean_square,
};
use crate::mutations::change;

const PAGE: &str = "docs/guide/src/unmodelled_errors.md";
/// Missions of three sites for every error.
const MISSIONS: u32 = 4;
const FIRST_SEED: u32 = 50_001;
/// Errors and missions of every run.
const FEW: usize = 2;
/// Stated noise of tie points, pixels.
const NOISE_PX: f64 = 0.5;

/// An error and its size.
struct Kind {
    words: &'static str,
    errors: fn(&mut SceneErrors),
    files: fn(&Case),
    /// Part of the entry of the verdict's list of what is not tested that describes it.
    untested: &'static str,
}

const UNCHANGED: Kind = Kind {
    words: "none, for comparison",
    errors: |_| {},
    files: |_| {},
    untested: "",
};

const ATTITUDE: &str = "an attitude error that all images share";
const LINE_TIMES: &str = "an error that the start times of all images";
const SHOTS: &str = "errors that ranges and radii of the shots share";
const ACROSS: &str = "errors of single tie points across the track";
const CAMERA: &str = "an error of the focal length, or a bend of the detector line";

const KINDS: &[Kind] = &[
    UNCHANGED,
    Kind {
        words: "bend of the detector line, 2 pixels at its ends",
        errors: |of| of.camera.bend_sigma_px = 2.0,
        untested: CAMERA,
        ..UNCHANGED
    },
    Kind {
        words: "all heights of shots 5 m low, with their ranges",
        files: |case| {
            of_shots(case, r#"["shot_radii", "mid_radius"]"#, "add = -500", "");
            of_shots(case, r#"["ranges"]"#, "add = 500", "");
        },
        untested: SHOTS,
        ..UNCHANGED
    },
    Kind {
        words: "focal length, 0.1 %",
        errors: |of| of.camera.focal_length_sigma = 1e-3,
        untested: CAMERA,
        ..UNCHANGED
    },
    Kind {
        words: "drift of the attitude, 0.08 mrad (30 m) over half an image",
        errors: |of| of.attitude.linear_sigma_rad = 8e-5,
        ..UNCHANGED
    },
    Kind {
        words: "jitter of 2 pixels with periods of 1 to 10 s",
        errors: |of| {
            of.attitude.slow_jitter = Jitter {
                sinusoids: 1,
                amplitude_rad: [7e-6, 8e-6],
                period_s: [1.0, 10.0],
            };
        },
        ..UNCHANGED
    },
    Kind {
        words: "noise of tie points twice the stated one",
        errors: |of| of.tie_noise_factor = 2.0,
        ..UNCHANGED
    },
    Kind {
        words: "two thirds of that noise common to neighbours",
        errors: |of| of.tie_noise_common = 2.0 / 3.0,
        ..UNCHANGED
    },
    Kind {
        words: "noise of the samples of tie points three times the stated one",
        files: samples_scatter,
        untested: ACROSS,
        ..UNCHANGED
    },
    Kind {
        words: "attitude, 1 mrad about each axis",
        errors: |of| of.attitude.constant_sigma_rad = [1e-3; 3],
        untested: ATTITUDE,
        ..UNCHANGED
    },
    Kind {
        words: "pointing bias wrong by 0.5 s",
        files: |case| {
            for site in SITES {
                let file = format!("sites/{site}.toml");
                case.replace(&file, "ck_bias_s = -1.15", "ck_bias_s = -1.65");
            }
        },
        untested: ATTITUDE,
        ..UNCHANGED
    },
    Kind {
        words: "sign of the altimeter's clock bias",
        files: |case| {
            for site in SITES {
                let file = format!("sites/{site}.toml");
                case.replace(&file, "sign = \"late\"", "sign = \"early\"");
            }
        },
        ..UNCHANGED
    },
    Kind {
        words: "line times of 60 lines",
        errors: |of| of.misregistration = Misregistration::LineTimes { sigma_lines: 60.0 },
        untested: LINE_TIMES,
        ..UNCHANGED
    },
    Kind {
        words: "orbit 80 m ahead",
        files: |case| orbit(case, "[80, 0, 0]"),
        ..UNCHANGED
    },
    Kind {
        words: "orbit 80 m aside",
        files: |case| orbit(case, "[0, 0, 80]"),
        ..UNCHANGED
    },
    Kind {
        words: "coordinates of shots that contain the attitude error of the images",
        errors: |of| of.altimeter.attitude_share_max = [0.0, 1.0],
        ..UNCHANGED
    },
    Kind {
        words: "one profile of two 0.5 to 2 km elsewhere",
        errors: |of| of.altimeter.misplaced_chance = 0.5,
        ..UNCHANGED
    },
    Kind {
        words: "every fifth frame of shots 30 m high, with its ranges",
        files: |case| {
            of_shots(case, r#"["shot_radii", "mid_radius"]"#, "add = 3000", "5");
            of_shots(case, r#"["ranges"]"#, "add = -3000", "5");
        },
        untested: SHOTS,
        ..UNCHANGED
    },
    Kind {
        words: "one frame of 20 300 m high, with its ranges, as of a cloud",
        files: |case| {
            of_shots(case, r#"["shot_radii", "mid_radius"]"#, "add = 30000", "20");
            of_shots(case, r#"["ranges"]"#, "add = -30000", "20");
        },
        ..UNCHANGED
    },
];

/// Changes fields of all PEDR files, centimetres; of one frame in `one_in` where it is given.
fn of_shots(case: &Case, fields: &str, number: &str, one_in: &str) {
    let folder = case.path("pedr").read_dir().unwrap();
    let mut files: Vec<String> = folder
        .map(|file| format!("pedr/{}", file.unwrap().file_name().display()))
        .filter(|file| Some("b") == file.rsplit('.').next())
        .collect();
    files.sort_unstable();
    let one_in = match one_in {
        "" => String::new(),
        frames => format!(", one_in = {frames}"),
    };
    change(
        case,
        &format!(
            "changes = [{{ pedr = {{ files = {files:?}, fields = {fields}, number = {{ {number} }}{one_in} }} }}]"
        ),
    );
}

fn orbit(case: &Case, along_up_cross_m: &str) {
    change(
        case,
        &format!("changes = [{{ orbit = {{ along_up_cross_m = {along_up_cross_m} }} }}]"),
    );
}

/// Adds noise to the samples of all tie points: three times the stated one with that of the scene.
fn samples_scatter(case: &Case) {
    let mut state = 1_u64;
    // The sum of twelve even numbers has a variance of 1; the generator is Knuth's.
    let mut normal = || {
        let even = (0..12).map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        });
        even.sum::<f64>() - 6.0
    };
    for site in SITES {
        let file = format!("ties/{site}.csv");
        let text = String::from_utf8(case.read(&file)).unwrap();
        let (head, rows) = text.split_once('\n').unwrap();
        assert_eq!(head, "point_id,serial_number,sample,line");
        let mut changed = format!("{head}\n");
        for row in rows.lines() {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            let sample: f64 = cells[2].parse().unwrap();
            cells[2] = format!("{:.4}", sample + 8.0_f64.sqrt() * NOISE_PX * normal());
            changed += &(cells.join(",") + "\n");
        }
        case.write(&file, changed);
    }
}

/// The sites of one kind of error.
struct Trial {
    kind: &'static Kind,
    sites: Vec<Site>,
}

impl Trial {
    fn valid(&self) -> impl Iterator<Item = &Site> {
        self.sites.iter().filter(|site| site.is_valid())
    }

    /// Mean errors of the valid sites on an axis.
    fn means(&self, axis: usize) -> Vec<Pair> {
        let stated = self.valid().filter_map(|site| site.stated.as_ref());
        stated.map(|of| of.ties.shared.map(|of| of[axis])).collect()
    }

    /// Height errors of single tie points of the valid sites.
    fn singles(&self) -> Vec<Pair> {
        let stated = self.valid().filter_map(|site| site.stated.as_ref());
        let single = stated.flat_map(|of| &of.ties.single);
        single.map(|of| of.map(|of| of.z)).collect()
    }

    /// Whether what is stated holds on an axis, by more than chance allows.
    fn holds(pairs: &[Pair]) -> bool {
        let [_, most] = by_chance(pairs.len());
        let is_beyond = |[error_m, sigma_m]: &Pair| error_m.abs() > 3.5 * sigma_m;
        ratio(pairs) < most.max(1.25) && !pairs.iter().any(is_beyond)
    }

    fn answer(&self) -> &'static str {
        let count = self.valid().count();
        let means_hold = (0..3).all(|axis| Self::holds(&self.means(axis)));
        let is_listed = |site: &Site| {
            !self.kind.untested.is_empty() && site.list("untested").contains(self.kind.untested)
        };
        match count {
            0 => "noticed",
            // Errors of neighbouring points of a site are correlated: some three independent ones.
            _ if means_hold && ratio(&self.singles()) < by_chance(3 * count)[1].max(1.3) => {
                "σ holds"
            }
            _ if self.valid().all(is_listed) => "stated as not tested",
            _ => "**not noticed**",
        }
    }

    fn line(&self) -> String {
        let valid = self.valid().count();
        let mut cells = vec![
            self.kind.words.to_owned(),
            self.sites.len().to_string(),
            (self.sites.len() - valid).to_string(),
        ];
        for axis in [2, 0, 1] {
            let pairs = self.means(axis);
            cells.push(if pairs.is_empty() {
                "–".to_owned()
            } else {
                let errors_m = pairs.iter().map(|[error_m, _]| *error_m);
                let error_m = root_mean_square(errors_m);
                format!("{error_m:.1} m, {:.2}", ratio(&pairs))
            });
        }
        let singles = self.singles();
        cells.push(if singles.is_empty() {
            "–".to_owned()
        } else {
            format!("{:.2}", ratio(&singles))
        });
        cells.push(self.answer().to_owned());
        format!("| {} |", cells.join(" | "))
    }
}

/// Root mean square of errors over their standard deviations.
fn ratio(pairs: &[Pair]) -> f64 {
    root_mean_square(pairs.iter().map(|[error_m, sigma_m]| error_m / sigma_m))
}

const INTRODUCTION: &str = "\
# Errors that the adjustment does not model

Each row adds one error to missions whose other errors have the sizes that areograph assumes. Four missions of three sites are run for
each. A test computes the table (`tests/truth/truth/unmodelled.rs`, in the long run) and writes this page.
[*Wrong inputs*](wrong_inputs.md) lists larger mistakes, each on one site; in the missions of [*Stated against true*](stated_against_true.md)
many such errors occur together.

*Invalid* counts the sites whose verdict notices the error. The other columns are of the valid sites: root mean square of the mean
errors of a site's tie points with its ratio to the stated standard deviations, and the ratio of single heights. *Answer*:

- *noticed*: all sites are invalid.
- *σ holds*: errors of the valid sites agree with their stated standard deviations.
- *stated as not tested*: terminal, page and manifest list this error among those that no datum of the site tests.

A drift of 0.08 mrad is eight times what is assumed. Two thirds of these sites are invalid, although tie points determine the drift:
the same limit (`limits.correction_max_sigma`) is the only one that notices labels of both images with a wrong summing across the track, which move
the ground by 707 m.

| error | sites | invalid | height | east | north | single heights | answer |
|---|---:|---:|---:|---:|---:|---:|---|
";

fn plans(kind: &'static Kind) -> impl Iterator<Item = Plan<'static>> {
    let grounds = [Roughness::Plains, Roughness::Medium, Roughness::Varied];
    let count = if long() { MISSIONS } else { 1 };
    let missions = (0..count).zip(grounds.into_iter().cycle());
    missions.map(|(index, ground)| Plan {
        sizes: Sizes::Cited,
        errors: kind.errors,
        files: kind.files,
        ..Plan::drawn(FIRST_SEED + index, ground, NOISE_PX)
    })
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn errors_that_are_not_modelled_are_noticed_or_stated() {
    let kinds = &KINDS[..if long() { KINDS.len() } else { 1 + FEW }];
    let all: Vec<Plan<'_>> = kinds.iter().flat_map(plans).collect();
    let mut sites = flown(&all);
    let of_kind = sites.len() / kinds.len();
    let mut trials = Vec::new();
    for kind in kinds {
        let rest = sites.split_off(of_kind);
        trials.push(Trial { kind, sites });
        sites = rest;
    }
    let mut page = INTRODUCTION.to_owned();
    for trial in &trials {
        for site in trial.sites.iter().filter(|site| !site.is_valid()) {
            println!(
                "{}, {}: {}",
                trial.kind.words,
                site.name,
                site.list("reasons")
            );
        }
        let _infallible = writeln!(page, "{}", trial.line());
    }
    println!("{page}");
    if long() {
        kept::is_up_to_date(PAGE, &page);
        assert!(!page.contains("not noticed"), "see the page");
    }
    for trial in &trials {
        assert_ne!(trial.answer(), "**not noticed**", "{}", trial.kind.words);
    }
}
