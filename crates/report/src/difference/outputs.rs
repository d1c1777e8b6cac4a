//! Matching folders of two outputs.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use super::{RANGES, error::DifferenceError};
use areograph_base::error::{IoError, Locate, Result};
use areograph_store::{publish::read_manifest, published::is_site_folder};

/// Folders of sites that two outputs have in common, and the names of the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pairs {
    /// Folders of one site in A and in B.
    pub both: Vec<(PathBuf, PathBuf)>,
    /// Sites only in A.
    pub only_in_a: Vec<String>,
    /// Sites only in B.
    pub only_in_b: Vec<String>,
    /// Products of nets, calibrations and matches in A or B.
    pub no_sites: Vec<String>,
}

/// The folders to compare for `a` and `b`: two folders of one site, or two folders of sites.
///
/// # Errors
/// A folder without products, the same folder twice, a site's folder beside one of several, no site in
/// both.
pub fn pairs(a: &Path, b: &Path) -> Result<Pairs> {
    let real = |path: &Path| {
        fs::canonicalize(path)
            .map_err(IoError::on("read the folder"))
            .in_file(path)
    };
    if real(a)? == real(b)? {
        return Err(DifferenceError::SameFolder).in_file(b);
    }
    for folder in [a, b] {
        if is_of_other_flow(folder) {
            return Err(DifferenceError::NoSite).in_file(folder);
        }
    }
    match (is_site_folder(a), is_site_folder(b)) {
        (true, true) => Ok(Pairs {
            both: vec![(a.to_owned(), b.to_owned())],
            only_in_a: Vec::new(),
            only_in_b: Vec::new(),
            no_sites: Vec::new(),
        }),
        (false, false) => common(a, b),
        (one_in_a, _) => {
            // If the other one holds nothing at all, that is the better message.
            sites(if one_in_a { b } else { a })?;
            Err(DifferenceError::OneAndSeveral).in_file(if one_in_a { a } else { b })
        }
    }
}

/// Sites in both roots.
fn common(a: &Path, b: &Path) -> Result<Pairs> {
    let (mut first, mut second) = (products(a)?, products(b)?);
    let mut no_sites: Vec<String> = Vec::new();
    for found in [&mut first, &mut second] {
        found.retain(|name, folder| {
            let is_other = is_of_other_flow(folder);
            if is_other && !no_sites.contains(name) {
                no_sites.push(name.clone());
            }
            !is_other
        });
    }
    no_sites.sort();
    for (folder, found) in [(a, &first), (b, &second)] {
        if found.is_empty() {
            return Err(DifferenceError::NoSite).in_file(folder);
        }
    }
    let names = |sites: &BTreeMap<String, PathBuf>| sites.keys().cloned().collect::<Vec<_>>();
    let (names_a, names_b) = (names(&first), names(&second));
    let mut both = Vec::new();
    for name in &names_a {
        if second.contains_key(name) {
            both.extend(first.remove(name).zip(second.remove(name)));
        }
    }
    if both.is_empty() {
        return Err(DifferenceError::NoneInBoth {
            a: names_a.join(", "),
            b: names_b.join(", "),
        }
        .into());
    }
    Ok(Pairs {
        both,
        only_in_a: names(&first),
        only_in_b: names(&second),
        no_sites,
    })
}

/// Folders of sites in `root`, by name.
///
/// # Errors
/// A folder without products, or one that cannot be read.
pub fn sites(root: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let mut found = products(root)?;
    found.retain(|_, folder| !is_of_other_flow(folder));
    if found.is_empty() {
        return Err(DifferenceError::NoProducts).in_file(root);
    }
    Ok(found)
}

/// Whether the products of a folder are those of a net, a calibration or a match: every site has ranges.
fn is_of_other_flow(folder: &Path) -> bool {
    let manifest = read_manifest(folder);
    manifest.is_some_and(|manifest| {
        let mut products = manifest.products.iter();
        !products.any(|product| product.path == RANGES)
    })
}

/// Folders of products in `root`, by name.
fn products(root: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let mut sites = BTreeMap::new();
    let entries = fs::read_dir(root)
        .map_err(IoError::on("read the folder"))
        .in_file(root)?;
    for entry in entries {
        let entry = entry
            .map_err(IoError::on("read the folder"))
            .in_file(root)?;
        if is_site_folder(&entry.path()) {
            let name = entry.file_name().to_string_lossy().into_owned();
            sites.insert(name, entry.path());
        }
    }
    if sites.is_empty() {
        return Err(DifferenceError::NoProducts).in_file(root);
    }
    Ok(sites)
}
