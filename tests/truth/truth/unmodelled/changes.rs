//! Errors that are written into the files of a mission.

use std::path::Path;

use areograph::geom::random::Random;

use super::{
    super::{SITES, common::case::Case},
    NOISE_PX,
};
use crate::mutations::make_changes;

/// Files of the days of images off nadir.
const OFF_NADIR: [&str; 3] = ["ap19019k.b", "ap19043k.b", "ap19802l.b"];

/// Changes a text of every site file.
pub(in crate::truth) fn in_sites(case: &Case, from: &str, to: &str) {
    for site in SITES {
        case.replace(&format!("sites/{site}.toml"), from, to);
    }
}

/// Changes fields of these PEDR files, centimetres; of one frame in `one_in` where it is given.
pub(in crate::truth) fn of_files(
    case: &Case,
    files: &[String],
    fields: &str,
    number: &str,
    one_in: Option<u32>,
) {
    let one_in = one_in.map_or_else(String::new, |frames| format!(", one_in = {frames}"));
    make_changes(
        case,
        &format!(
            "changes = [{{ pedr = {{ files = {files:?}, fields = {fields}, number = {{ {number} }}{one_in} }} }}]"
        ),
    );
}

/// The same of all PEDR files.
pub(in crate::truth) fn of_shots(case: &Case, fields: &str, number: &str, one_in: Option<u32>) {
    let folder = case.path("pedr").read_dir().unwrap();
    let names = folder.map(|file| file.unwrap().file_name().display().to_string());
    let mut files: Vec<String> = names
        .filter(|name| Path::new(name).extension().is_some_and(|end| end == "b"))
        .map(|name| format!("pedr/{name}"))
        .collect();
    files.sort_unstable();
    of_files(case, &files, fields, number, one_in);
}

/// The same of the profiles off nadir.
pub(super) fn off_nadir(case: &Case, fields: &str, number: &str) {
    let files = OFF_NADIR.map(|name| format!("pedr/{name}"));
    of_files(case, &files, fields, number, None);
}

pub(super) fn orbit(case: &Case, along_up_cross_m: &str) {
    make_changes(
        case,
        &format!("changes = [{{ orbit = {{ along_up_cross_m = {along_up_cross_m} }} }}]"),
    );
}

/// Changes lines and samples of all tie points: of the first image of a site that they name, and of the others.
pub(super) fn in_ties(case: &Case, mut change: impl FnMut(bool, [f64; 2]) -> [f64; 2]) {
    for site in SITES {
        let file = format!("ties/{site}.csv");
        let text = String::from_utf8(case.read(&file)).unwrap();
        let (head, rows) = text.split_once('\n').unwrap();
        assert_eq!(head, "point_id,serial_number,sample,line");
        let mut changed = format!("{head}\n");
        let first = rows.split(',').nth(1).unwrap();
        for row in rows.lines() {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            let [sample, line] = [2, 3].map(|cell| cells[cell].parse().unwrap());
            let [line, sample] = change(cells[1] != first, [line, sample]);
            cells[2] = format!("{sample:.4}");
            cells[3] = format!("{line:.4}");
            changed += &(cells.join(",") + "\n");
        }
        case.write(&file, changed);
    }
}

/// Adds noise to the samples of all tie points: three times the stated one with that of the scene.
pub(super) fn samples_scatter(case: &Case, seed: u32) {
    let mut random = Random::new(seed.into(), "samples");
    in_ties(case, |_, [line, sample]| {
        [line, sample + 8.0_f64.sqrt() * NOISE_PX * random.normal()]
    });
}

/// Adds noise of Student's distribution with three degrees of freedom, whose standard deviation is the stated one.
pub(super) fn noise_with_tails(case: &Case, seed: u32) {
    let mut random = Random::new(seed.into(), "tails");
    let mut noise = || {
        let squares: f64 = (0..3).map(|_| random.normal().powi(2)).sum();
        NOISE_PX * random.normal() / squares.sqrt()
    };
    in_ties(case, |_, at| at.map(|at| at + noise()));
}
