//! A new site file with comments: the keys that a site needs, each with its documentation.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    path::{Path, PathBuf},
};

use toml::Value;

use super::keys;

/// Beginning of such a file.
const HEADER: &str = "\
# Written by `areograph init`. Omitted keys have their defaults; relative paths are relative to the folder of this file.
# `areograph check` reports everything that would prevent a run.

";
/// Margin of a window beyond the image that it is named after, kilometres.
const MARGIN_KM: f64 = 5.0;

/// Content of a new site file, with paths as written there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NewSite {
    /// Identifier.
    pub site: String,
    /// Free text for the report; may be empty.
    pub description: String,
    /// A metakernel or, when it is the only path and a folder, a folder to choose from; else kernels in load order.
    pub kernels: Vec<PathBuf>,
    /// Whether the only one of them is a folder.
    pub kernels_are_a_folder: bool,
    /// Paths or globs of PEDR files; empty for images only.
    pub pedr: Vec<PathBuf>,
    /// Paths or globs of tables of the Orbital Data Explorer.
    pub shots: Vec<PathBuf>,
    /// West, east, south and north edge of the window, degrees; without it the window is the outline of the images.
    pub edges_deg: Option<[f64; 4]>,
    /// Identifier and label of every image.
    pub images: Vec<(String, PathBuf)>,
    /// Whether the files of the labels contain the pixels.
    pub pixels_in_labels: bool,
    /// Paths or globs of tie point files.
    pub ties: Vec<PathBuf>,
}

impl NewSite {
    /// The text of the file.
    #[must_use]
    pub fn text(&self) -> String {
        let mut file = Commented::new();
        file.key("site", self.site.as_str());
        if !self.description.is_empty() {
            file.key("description", self.description.as_str());
        }
        file.table("[kernels]");
        match &self.kernels[..] {
            [folder] if self.kernels_are_a_folder => file.key("kernels.root", text(folder)),
            [one] if one.extension().is_some_and(|end| end == "tm") => {
                file.key("kernels.metakernel", text(one));
            }
            files => file.key("kernels.files", texts(files)),
        }
        if !self.pedr.is_empty() {
            file.table("[pedr]");
            file.key("pedr.files", texts(&self.pedr));
        }
        if !self.shots.is_empty() {
            file.table("[[shots]]");
            file.key("shots.files", texts(&self.shots));
            file.key("shots.layout", "ode_pedr");
        }
        if !(self.pedr.is_empty() && self.shots.is_empty()) {
            self.windows(&mut file);
        }
        for (id, label) in &self.images {
            file.table("[[images]]");
            file.key("images.id", id.as_str());
            file.key("images.label", text(label));
            if self.pixels_in_labels {
                file.key("images.pixels", text(label));
            }
        }
        if !self.ties.is_empty() {
            file.table("[ties]");
            file.key("ties.files", texts(&self.ties));
        }
        file.text
    }

    fn windows(&self, file: &mut Commented) {
        if let Some([west, east, south, north]) = self.edges_deg {
            file.table("[[windows]]");
            file.key("windows.id", self.site.as_str());
            file.key("windows.longitude_deg", vec![west, east]);
            file.key("windows.latitude_deg", vec![south, north]);
            return;
        }
        for (id, _) in &self.images {
            file.table("[[windows]]");
            file.key("windows.id", id.as_str());
            file.key("windows.image", id.as_str());
            file.key("windows.margin_km", MARGIN_KM);
        }
    }
}

/// A file with the documentation of each key above its first use.
struct Commented {
    text: String,
    about: BTreeMap<String, Vec<&'static str>>,
}

impl Commented {
    fn new() -> Self {
        let about = keys().into_iter().map(|key| (key.path, key.about));
        Self {
            text: HEADER.to_owned(),
            about: about.collect(),
        }
    }

    fn table(&mut self, head: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "\n{head}");
    }

    fn key(&mut self, path: &str, value: impl Into<Value>) {
        for line in self.about.remove(path).unwrap_or_default() {
            let _ = writeln!(self.text, "# {}", line.trim());
        }
        let name = path.rsplit('.').next().unwrap_or(path);
        let _ = writeln!(self.text, "{name} = {}", value.into());
    }
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn texts(paths: &[PathBuf]) -> Vec<String> {
    paths.iter().map(|path| text(path)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Document as _, SiteConfig};

    #[test]
    fn what_is_written_is_read_with_a_comment_above_every_first_key() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["nav.tm", "a.b", "one.lbl", "two \"quoted\".lbl", "ties.csv"];
        for name in paths {
            std::fs::File::create(folder.path().join(name)).unwrap();
        }
        let path = |place: usize| PathBuf::from(paths[place]);
        let mut site = NewSite {
            site: "gale".to_owned(),
            description: "Gale crater".to_owned(),
            kernels: vec![path(0)],
            pedr: vec!["*.b".into()],
            edges_deg: Some([137.0, 138.0, -5.5, -4.0]),
            images: vec![
                ("E02-02855".to_owned(), path(2)),
                ("two".to_owned(), path(3)),
            ],
            ties: vec![path(4)],
            ..NewSite::default()
        };
        let file = folder.path().join("gale.toml");
        let loaded = SiteConfig::parse(&site.text(), &file).unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        assert_eq!(
            loaded.config.images[1].label,
            Some(folder.path().join(paths[3]))
        );
        assert_eq!(loaded.config.windows.len(), 1);
        let text = site.text();
        let mut above = "";
        for line in text.lines() {
            let first =
                line.contains(" = ") && text.matches(line.split('=').next().unwrap()).count() == 1;
            assert!(!first || above.starts_with('#'), "{line}");
            above = line;
        }
        // Without a box the windows are the outlines of the images; without PEDR files there are none.
        site.edges_deg = None;
        assert_eq!(
            SiteConfig::parse(&site.text(), &file)
                .unwrap()
                .config
                .windows
                .len(),
            2
        );
        site.pedr.clear();
        let loaded = SiteConfig::parse(&site.text(), &file).unwrap();
        assert!(loaded.config.windows.is_empty() && loaded.warnings.len() == 1);
        site.shots = vec!["*.csv".into()];
        let loaded = SiteConfig::parse(&site.text(), &file).unwrap();
        assert!(loaded.config.shots[0].layout.is_some());
        assert_eq!(loaded.config.windows.len(), 2);
        site.kernels = vec![PathBuf::from(".")];
        site.kernels_are_a_folder = true;
        SiteConfig::parse(&site.text(), &file).unwrap();
    }
}
