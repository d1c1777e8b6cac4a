//! Sound inputs that rows start from, and the command of each.

use std::{fs, path::Path, process::Command};

use serde::Deserialize;

use super::{
    common::{
        case::Case,
        mission::{areograph, once, site_run, succeed},
    },
    measure::{self, Measured},
};

/// The images of the pair.
pub(super) const IMAGES: [&str; 2] = ["E02-01301", "E02-02016"];

/// Sound inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Start {
    /// The pair over Isidis with its tie points, after a run of it.
    #[default]
    Pair,
    /// The same without tie points.
    WithoutTies,
    /// The pair with support data `isd/<image>.json` in place of labels.
    SupportData,
    /// The pair with its shots in a table `shots.csv` in place of PEDR files.
    ShotTable,
    /// A net of pictures in the plane.
    Net,
    /// Two lines of a camera to be calibrated.
    Calibration,
}

/// The mission's own files of a command.
fn scene(name: &str, kind: &str, case: &Case) {
    let stored = once(name, |folder| {
        succeed(areograph().args(["--quiet", "scene", kind]).arg(folder));
    });
    copy(&stored, &case.path(""));
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            fs::copy(&path, target).unwrap();
        }
    }
}

impl Start {
    /// A folder with the files.
    pub(super) fn case(self) -> Case {
        let case = match self {
            Self::Net | Self::Calibration => Case::empty(),
            _ => Case::pair_after_a_run(),
        };
        match self {
            Self::Pair => {}
            Self::WithoutTies => {
                case.replace("site.toml", "[ties]\nfiles = [\"ties/isidis.csv\"]\n", "");
            }
            Self::SupportData => {
                fs::create_dir(case.path("isd")).unwrap();
                for image in IMAGES {
                    let isd = site_run("isidis").join(format!("images/{image}/isd.json"));
                    fs::copy(isd, case.path(&format!("isd/{image}.json"))).unwrap();
                    let label = format!("label = \"labels/{image}.lbl\"\nlines_delivered = 7680\n");
                    case.replace(
                        "site.toml",
                        &label,
                        &format!("isd = \"isd/{image}.json\"\n"),
                    );
                }
            }
            Self::ShotTable => {
                case.write(
                    "shots.csv",
                    fs::read(site_run("isidis").join("footprints.csv")).unwrap(),
                );
                case.replace(
                    "site.toml",
                    "[pedr]\nfiles = [\"pedr/ap19019k.b\", \"pedr/ap19117l.b\"]\ndatum = \"auto\"\n",
                    "[[shots]]\nfiles = [\"shots.csv\"]\nlayout = \"areograph\"\n",
                );
            }
            Self::Net => scene("scene-of-net", "net", &case),
            Self::Calibration => scene("scene-of-calibration", "calibration", &case),
        }
        case
    }

    /// The file that the command is given.
    pub(super) const fn file(self) -> &'static str {
        match self {
            Self::Net => "net.toml",
            Self::Calibration => "calibration.toml",
            _ => "site.toml",
        }
    }

    /// The folder of the products.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Net => "synthetic_net",
            Self::Calibration => "synthetic_lines",
            _ => "isidis",
        }
    }

    pub(super) fn command(self, case: &Case) -> Command {
        let verb = match self {
            Self::Net => "triangulate",
            Self::Calibration => "calibrate",
            _ => return case.run(),
        };
        let mut command = case.areograph();
        command.args(["--quiet", verb, self.file(), "--out", "out"]);
        command
    }

    /// The result against the truth; nothing where no product has a result that can be compared.
    pub(super) fn measured(self, case: &Case) -> Option<Measured> {
        match self {
            Self::Net => measure::net(case),
            Self::Calibration => measure::calibration(case),
            _ => measure::site(case),
        }
    }
}
