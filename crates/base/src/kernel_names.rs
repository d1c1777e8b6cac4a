//! Contents of kernel names: orbit solution, quality of the attitude, version.

use std::path::{Path, PathBuf};

use crate::kernel_source::CkQuality;

/// Orbit solutions that mark their files by name; a file without a mark is `nav`.
const MARKED_FAMILIES: [&str; 2] = ["gsfc", "ipng"];

/// Parts of a name between `_`, `-` and `.`, in lower case.
fn name_parts(path: &Path) -> Vec<String> {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase()
        .split(['_', '-', '.'])
        .map(str::to_owned)
        .collect()
}

/// Whether a file is of this orbit solution, in lower case.
#[must_use]
pub fn family_of(path: &Path, family: &str) -> bool {
    let parts = name_parts(path);
    let unmarked = || {
        !parts
            .iter()
            .any(|part| MARKED_FAMILIES.contains(&part.as_str()))
    };
    parts.iter().any(|part| part == family) || (family == "nav" && unmarked())
}

/// Commanded attitude is recognised by its name: `mgs_ext_roto_all_v*`.
#[must_use]
pub fn quality_of(path: &Path) -> CkQuality {
    let parts = name_parts(path);
    if parts.iter().any(|part| part == "roto" || part == "nominal") {
        CkQuality::Nominal
    } else {
        CkQuality::Reconstructed
    }
}

/// Sort key that compares numbers in names as numbers: `v9` before `v10`; in a tie by path.
#[must_use]
pub fn natural_order(path: &Path) -> (Vec<(usize, String)>, PathBuf) {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let stem = stem.to_ascii_lowercase();
    let is_digit = |character: char| character.is_ascii_digit();
    let mut pieces = Vec::new();
    let mut rest = stem.as_str();
    while let Some(first) = rest.chars().next() {
        let end = rest
            .find(|next| is_digit(next) != is_digit(first))
            .unwrap_or(rest.len());
        let (piece, behind) = rest.split_at(end);
        // Without leading zeros the longer number is the larger one; words have no length.
        let number = piece.trim_start_matches('0');
        pieces.push(if is_digit(first) {
            (number.len(), number.to_owned())
        } else {
            (0, piece.to_owned())
        });
        rest = behind;
    }
    (pieces, path.to_owned())
}

/// The last number in a name: 61 of `MGS_SCLKSCET.00061.tsc`, 10 of `pck00010.tpc`.
#[must_use]
pub fn version_of(path: &Path) -> u64 {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let digits = stem.rsplit(|c: char| !c.is_ascii_digit());
    digits
        .map(str::parse)
        .find_map(std::result::Result::ok)
        .unwrap_or(0)
}
