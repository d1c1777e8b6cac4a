//! A map in words and numbers: its legend, its caption, its data.

use std::fmt::Write as _;

use super::{
    super::{
        graticule::graticule,
        html::counted,
        outlines::Outline,
        plots::{Key, label, quoted},
    },
    ELLIPSE, IMAGE, MAP_SHOTS, Sheet, TIE,
    relief::Relief,
};
use areograph_base::units::RADIANS_PER_DEGREE;

impl Sheet {
    pub(super) fn keys(&self) -> Vec<Key> {
        let mut keys = Vec::new();
        if !self.shown.images.is_empty() {
            keys.push(Key::colour("image outlines", IMAGE));
        }
        if !self.ties_rad.is_empty() {
            keys.push(Key::colour("tie points", TIE));
        }
        keys.extend(
            self.ellipses
                .key()
                .map(|words| Key::colour(&words, ELLIPSE)),
        );
        keys
    }

    pub(super) fn words(&self, relief: Option<&Relief>) -> String {
        let mut words = String::new();
        if !self.shown.windows.is_empty() {
            words += &format!("Windows (lines): {}. ", names(&self.shown.windows));
        }
        if !self.shown.rows.is_empty() {
            words += &format!(
                "{} (dots, profiles named by orbit), {} to {} m above the {}. ",
                counted(self.shown.rows.len(), "footprint"),
                label(self.heights_m.0, 0),
                label(self.heights_m.1, 0),
                self.areoid
            );
            if self.shots.len() < self.shown.rows.len() {
                words += &format!(
                    "1 in {} is drawn. ",
                    self.shown.rows.len().div_ceil(MAP_SHOTS)
                );
            }
        }
        if let Some(relief) = relief {
            words += &format!(
                "Relief from all shots, lit from the north-west, {} × exaggerated. ",
                label(relief.exaggeration, 0)
            );
        }
        words += &self.ellipses.words();
        let lines = graticule(&self.map, &self.view);
        let (_, unnamed) = self.names(&lines);
        if unnamed > 0 {
            words += &format!("No space for {}. ", counted(unnamed, "name"));
        }
        let south = self.map.latitude_rad() < 0.0;
        words
            + &format!(
                "{}; equal-area projection about {:.2}° E {:.2}° {}.",
                self.frame,
                self.map.longitude_rad() / RADIANS_PER_DEGREE,
                self.map.latitude_rad().abs() / RADIANS_PER_DEGREE,
                if south { "S" } else { "N" }
            )
    }

    pub(super) fn csv(&self) -> String {
        let mut csv = "what,name,longitude_deg,latitude_deg,height_m\n".to_owned();
        let mut line = |what: &str, name: &str, place: &(f64, f64), height: &str| {
            let [longitude, latitude] = [place.0, place.1].map(|angle| angle / RADIANS_PER_DEGREE);
            // Writing to a string cannot fail.
            let _ = writeln!(
                csv,
                "{what},{},{longitude:.6},{latitude:.6},{height}",
                quoted(name)
            );
        };
        for (what, outlines) in [
            ("window", &self.shown.windows),
            ("image", &self.shown.images),
        ] {
            for outline in outlines {
                for place in &outline.ring {
                    line(what, &outline.name, place, "");
                }
            }
        }
        for shot in &self.shots {
            line(
                "shot",
                "",
                &shot.place_rad,
                &format!("{:.2}", shot.height_m),
            );
        }
        for tie in &self.ties_rad {
            line("tie point", "", tie, "");
        }
        csv
    }
}

/// Names of outlines, each once: holes and islands are rings of the same window.
pub(super) fn names(outlines: &[Outline]) -> String {
    let mut names: Vec<&str> = outlines.iter().map(|outline| &*outline.name).collect();
    names.dedup();
    names.join(", ")
}
