//! Site files of a campaign.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use toml::Value;

use areograph_base::error::Error;

use super::{CampaignConfig, SITE};
use crate::{
    declare::ValueKind,
    document::{Document as _, Loaded, read},
    paths::{real, seen_from, without_parents},
    problems::IS_NOW_CALLED,
    written::Written,
};

/// Tables and keys of a campaign that are not those of a site.
const OF_CAMPAIGN: [&str; 7] = [
    "campaign",
    "description",
    "archive",
    "windows",
    "select",
    "pairs",
    "executor",
];
/// Tables that need several images.
const OF_SEVERAL_IMAGES: [&str; 4] = ["ties", "intersection", "adjustment", "surface"];

/// An image of a new site.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignImage {
    /// Identifier.
    pub id: String,
    /// Its label, or image file with a label.
    pub label: Option<PathBuf>,
    /// Its pixels, if the site uses them.
    pub pixels: Option<PathBuf>,
    /// Keys that replace a label, with their values.
    pub fields: toml::Table,
}

/// What the sites of a campaign have in common, as written.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteTemplate {
    tables: toml::Table,
    margin_km: f64,
    ties: Option<String>,
    folder: PathBuf,
    has_former_names: bool,
}

/// A campaign, and what its sites have in common.
///
/// # Errors
/// As [`load`](crate::Document::load).
pub fn load_campaign(path: &Path) -> Result<(Loaded<CampaignConfig>, SiteTemplate), Error> {
    let text = read(path)?;
    let loaded = CampaignConfig::parse(&text, path)?;
    // The same text has just been read as a table.
    let mut tables: toml::Table = text.parse().unwrap_or_default();
    for key in OF_CAMPAIGN {
        tables.remove(key);
    }
    let campaign = &loaded.config;
    let file = real(path)?;
    let template = SiteTemplate {
        tables,
        margin_km: campaign.archive.margin_km,
        ties: campaign.pairs.ties.clone(),
        folder: file.parent().unwrap_or(&file).to_owned(),
        has_former_names: loaded
            .warnings
            .iter()
            .any(|text| text.contains(IS_NOW_CALLED)),
    };
    Ok((loaded, template))
}

impl SiteTemplate {
    /// The tie point file of a pair, if the campaign names one.
    #[must_use]
    pub fn ties_of(&self, site: &str) -> Option<PathBuf> {
        let written = self.ties.as_ref()?;
        Some(without_parents(
            &self.folder.join(written.replace(SITE, site)),
        ))
    }

    /// BLAKE3, hexadecimal, of the keys and values of the text of a site file, as [`crate::SiteConfig::blake3`]; `None` for a
    /// campaign that uses former names of keys.
    #[must_use]
    pub fn hash_of_site_file(&self, text: &str) -> Option<String> {
        let table = text.parse().ok()?;
        let hash = || Written::of(table, &BTreeSet::new()).blake3;
        (!self.has_former_names).then(hash)
    }

    /// The text of the site file of a site, for the folder `folder` (absolute, without links upwards).
    ///
    /// * `ties` – tie point file of the site
    #[must_use]
    pub fn site_file(
        &self,
        site: &str,
        description: &str,
        images: &[CampaignImage],
        ties: Option<&Path>,
        folder: &Path,
    ) -> String {
        let mut tables = self.tables.clone();
        self.rebase(&mut tables, folder);
        if images.len() < 2 {
            for table in OF_SEVERAL_IMAGES {
                tables.remove(table);
            }
        }
        let path =
            |path: &Path| Value::from(seen_from(folder, path).to_string_lossy().into_owned());
        if let Some(ties) = ties {
            let table = tables
                .entry("ties")
                .or_insert_with(|| Value::Table(toml::Table::new()));
            if let Some(table) = table.as_table_mut() {
                let files = table
                    .entry("files")
                    .or_insert_with(|| Value::Array(Vec::new()));
                if let Some(files) = files.as_array_mut() {
                    let glob = glob_of(&seen_from(folder, ties));
                    files.push(Value::from(glob.to_string_lossy().into_owned()));
                }
            }
        }
        let has_shots = tables.contains_key("pedr") || tables.contains_key("shots");
        let images_of_site = images.iter().map(|image| {
            let mut table = image.fields.clone();
            table.insert("id".to_owned(), Value::from(image.id.as_str()));
            for (key, file) in [("label", &image.label), ("pixels", &image.pixels)] {
                if let Some(file) = file {
                    table.insert(key.to_owned(), path(file));
                }
            }
            Value::Table(table)
        });
        tables.insert("images".to_owned(), Value::Array(images_of_site.collect()));
        if has_shots {
            let windows = images.iter().map(|image| {
                let mut table = toml::Table::new();
                table.insert("id".to_owned(), Value::from(image.id.as_str()));
                table.insert("image".to_owned(), Value::from(image.id.as_str()));
                table.insert("margin_km".to_owned(), Value::from(self.margin_km));
                Value::Table(table)
            });
            tables.insert("windows".to_owned(), Value::Array(windows.collect()));
        }
        tables.insert("site".to_owned(), Value::from(site));
        tables.insert("description".to_owned(), Value::from(description));
        format!("{SITE_FILE_MARK}\n{tables}")
    }

    /// Paths relative to the campaign file become relative to `folder`.
    fn rebase(&self, tables: &mut toml::Table, folder: &Path) {
        for key in crate::keys() {
            let names_a_file = match &key.kind {
                ValueKind::File | ValueKind::Folder | ValueKind::Mirror | ValueKind::Glob => true,
                ValueKind::List { of, .. } => {
                    matches!(**of, ValueKind::File | ValueKind::Folder | ValueKind::Glob)
                }
                // The altimeter is a word or the path of a file.
                ValueKind::Text { .. } => key.path == "altimeter",
                _ => false,
            };
            let kind = match &key.kind {
                ValueKind::Glob => PathKind::Glob,
                ValueKind::List { of, .. } if **of == ValueKind::Glob => PathKind::Glob,
                ValueKind::Text { .. } => PathKind::WordOrFile,
                _ => PathKind::Path,
            };
            if names_a_file {
                let parts: Vec<&str> = key.path.split('.').collect();
                self.rebase_at(tables, &parts, folder, kind);
            }
        }
    }

    fn rebase_at(&self, table: &mut toml::Table, path: &[&str], folder: &Path, kind: PathKind) {
        let Some((first, rest)) = path.split_first() else {
            return;
        };
        let rebased = |written: &str| {
            let there = without_parents(&self.folder.join(written));
            if kind == PathKind::WordOrFile && !there.is_file() {
                return None;
            }
            let seen = if kind == PathKind::Glob && !Path::new(written).is_absolute() {
                glob_of(&seen_from(folder, &self.folder)).join(written)
            } else {
                seen_from(folder, &there)
            };
            Some(seen.to_string_lossy().into_owned())
        };
        match table.get_mut(*first) {
            Some(Value::Table(below)) => self.rebase_at(below, rest, folder, kind),
            Some(Value::Array(entries)) => {
                for entry in entries {
                    match entry {
                        Value::Table(below) => self.rebase_at(below, rest, folder, kind),
                        Value::String(written) if rest.is_empty() => {
                            if let Some(path) = rebased(written) {
                                *written = path;
                            }
                        }
                        _ => {}
                    }
                }
            }
            Some(Value::String(written)) if rest.is_empty() => {
                if let Some(path) = rebased(written) {
                    *written = path;
                }
            }
            _ => {}
        }
    }
}

/// Kind of a path of the template.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PathKind {
    Path,
    Glob,
    /// An identifier, or the path of a file.
    WordOrFile,
}

/// A path as a glob that matches it alone.
fn glob_of(path: &Path) -> PathBuf {
    glob::Pattern::escape(&path.to_string_lossy()).into()
}

/// First line of a site file that a campaign wrote; such a file is replaced.
pub const SITE_FILE_MARK: &str =
    "# Written by `areograph campaign`, which replaces this file: change the campaign instead.";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SiteConfig;

    const CAMPAIGN: &str = r#"
campaign = "eos"
altimeter = "mola"
[archive]
indexes = ["index/cumindex.tab"]
folder = "labels"
margin_km = 2.5
[pairs]
ties = "ties/{site}.csv"
[kernels]
metakernel = "kernels/nav.tm"
[pedr]
files = ["pedr/*.b"]
[adjustment]
common_bus = "yes"
[limits]
ties_min = 7
"#;

    /// A folder with the files of the campaign, and the campaign file in it.
    fn folder() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        for path in [
            "index/cumindex.tab",
            "kernels/nav.tm",
            "pedr/ap10001l.b",
            "labels/one.lbl",
            "labels/two.lbl",
            "ties/one_two.csv",
        ] {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::File::create(path).unwrap();
        }
        let file = folder.path().join("eos.toml");
        areograph_store::atomic::write(&file, CAMPAIGN.as_bytes()).unwrap();
        (folder, file)
    }

    fn image(folder: &Path, id: &str) -> CampaignImage {
        CampaignImage {
            id: id.to_owned(),
            label: Some(folder.join(format!("labels/{id}.lbl"))),
            pixels: None,
            fields: toml::Table::new(),
        }
    }

    #[test]
    fn a_site_file_names_the_files_of_the_campaign_from_its_own_folder() {
        let (folder, file) = folder();
        let (loaded, template) = load_campaign(&file).unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        assert!(loaded.config.has_pairs);
        let sites = folder.path().join("out/sites");
        std::fs::create_dir_all(&sites).unwrap();
        let images = ["one", "two"].map(|id| image(folder.path(), id));
        let ties = template.ties_of("one_two").unwrap();
        let text = template.site_file("one_two", "two images", &images, Some(&ties), &sites);
        assert!(text.contains("\"../../pedr/*.b\""), "{text}");
        assert!(!text.contains(&*folder.path().to_string_lossy()), "{text}");
        let site = SiteConfig::parse(&text, &sites.join("one_two.toml")).unwrap();
        assert!(site.warnings.is_empty(), "{:?}", site.warnings);
        let site = site.config;
        let real = |paths: &[PathBuf]| -> Vec<PathBuf> {
            paths.iter().map(|path| without_parents(path)).collect()
        };
        assert_eq!(real(&site.ties.files), [ties]);
        assert_eq!(
            real(&site.pedr.files),
            [folder.path().join("pedr/ap10001l.b")]
        );
        assert_eq!((site.windows.len(), site.limits.ties_min), (2, 7));

        // A single image has no tie points, and nothing that follows from them.
        let text = template.site_file("one", "", &images[..1], None, &sites);
        let site = SiteConfig::parse(&text, &sites.join("one.toml")).unwrap();
        assert!(site.warnings.is_empty(), "{:?}", site.warnings);
        assert!(!site.config.ties.are_there() && !text.contains("adjustment"));
    }

    #[test]
    fn faults_of_a_campaign_are_reported_at_their_places() {
        let (_folder, file) = folder();
        for (right, wrong, expected) in [
            (
                "campaign = \"eos\"",
                "campaign = \"Eos\"",
                ":2:12: campaign is \"Eos\"",
            ),
            (
                "folder = \"labels\"",
                "pixels = true",
                "archive.pixels is true",
            ),
            (
                "ties/{site}.csv",
                "ties/all.csv",
                "pairs.ties is \"ties/all.csv\"",
            ),
            (
                "[pairs]",
                "[pairs]\nconvergence_deg = [20, 5]",
                "the smaller angle first",
            ),
            (
                "[limits]",
                "[ties]\nmatch = true\n[limits]",
                "ties.match is true",
            ),
            (
                "[limits]",
                "[select]\ncameras = [\"moc\"]\n[limits]",
                "moc_na, moc_wa_red",
            ),
            ("[limits]", "[limit]", "limit is an unknown key"),
            (
                "[limits]",
                "[[windows]]\nid = \"w\"\nimage = \"one\"\n[limits]",
                "boxes or polygons",
            ),
        ] {
            let text = CAMPAIGN.replace(right, wrong);
            let problems = CampaignConfig::parse(&text, &file).unwrap_err().to_string();
            assert!(problems.contains(expected), "{problems}");
        }
    }
}
