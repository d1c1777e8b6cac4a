//! A site for a place: window, images of the index with partners, and folders that `areograph fetch` fills.

use std::{
    collections::BTreeMap,
    f64::consts::PI,
    path::{Path, PathBuf},
};

use clap::Args;
use serde::Deserialize;

use super::{Arguments, Refused, identifier, in_new_folder, seen};
use crate::{
    cli::{image::propose, output},
    config::{NewSite, parse_unfilled, window_of_box},
    error::{Cause, Error, Locate as _},
    files::file_name,
    store::atomic,
    units::METRES_PER_KM,
};

/// Names of places.
const PLACES: &str = include_str!("../../../config/places/mars.toml");
/// Mean radius of Mars, metres.
const RADIUS_M: f64 = 3_389_500.0;
/// Widest pixel of images that are proposed: the narrow-angle camera, summed by 8, has 12 m.
const PIXEL_MAX_M: f64 = 15.0;

/// A site from a place.
#[derive(Debug, Args)]
pub(super) struct PlaceArguments {
    /// A place of config/places, or with --box any name: proposes a window and images, and writes a site file for `areograph fetch`.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["kernels", "pedr", "labels", "ties"])]
    place: Option<String>,
    /// Cumulative index of images (cumindex.tab). By default the copy of `areograph fetch --into DIR --index`.
    #[arg(long, value_name = "FILE", requires = "place")]
    index: Option<PathBuf>,
    /// Number of pairs of images to propose.
    #[arg(long, value_name = "COUNT", default_value_t = 1, requires = "place")]
    pairs: usize,
}

impl PlaceArguments {
    pub(super) const fn is_given(&self) -> bool {
        self.place.is_some()
    }
}

/// Reasons why no site is proposed.
#[derive(Debug, thiserror::Error, Cause)]
enum NoPlace {
    #[error("unknown place {name:?}; expected {known}")]
    #[cause(Configuration: "name one of these, or give the window edges with --box")]
    Name { name: String, known: String },
    #[error("the table of places is malformed: {0}")]
    #[cause(Bug: "report this")]
    Table(String),
    #[error("no copy of the image index")]
    #[cause(Input: "run `areograph fetch --into DIR --index` first, or name cumindex.tab with --index")]
    Index,
    #[error("no image in the index shows ground inside the window")]
    #[cause(Input: "give a larger window with --box")]
    Images,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Places {
    places: BTreeMap<String, Place>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Place {
    longitude_deg: f64,
    latitude_deg: f64,
    window_km: f64,
}

impl Place {
    /// West, east, south and north edge of the box around it, degrees, to 0.01.
    fn edges_deg(self) -> [f64; 4] {
        let half_rad = 0.5 * self.window_km * METRES_PER_KM / RADIUS_M;
        let [high, wide] = [half_rad, half_rad / (self.latitude_deg * PI / 180.0).cos()]
            .map(|half_rad| half_rad * 180.0 / PI);
        let edges = [
            self.longitude_deg - wide,
            self.longitude_deg + wide,
            self.latitude_deg - high,
            self.latitude_deg + high,
        ];
        edges.map(|edge| (edge * 100.0).round() / 100.0)
    }
}

fn place(name: &str) -> Result<Place, NoPlace> {
    let read: Places = toml_of(PLACES)?;
    let known = || read.places.keys().cloned().collect::<Vec<_>>().join(", ");
    let found = read.places.get(&name.to_lowercase()).copied();
    found.ok_or_else(|| NoPlace::Name {
        name: name.to_owned(),
        known: known(),
    })
}

fn toml_of<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, NoPlace> {
    toml::from_str(text).map_err(|error: toml::de::Error| NoPlace::Table(error.to_string()))
}

pub(super) fn run(arguments: &Arguments, folder: &Path) -> Result<(), Error> {
    let name = arguments.place.place.as_deref().unwrap_or_default();
    let site = arguments
        .site
        .clone()
        .unwrap_or_else(|| identifier(&file_name(folder)));
    let edges_deg = match arguments.edges_deg {
        Some(written) => arguments.meaning.edges_deg(written)?,
        None => place(name)?.edges_deg(),
    };
    let file = arguments.folder.join(format!("{site}.toml"));
    if file.exists() {
        return Err(Refused::Exists).in_file(file);
    }
    let copy = folder.join(".fetch/indexes/images.tab");
    let index = arguments.place.index.clone().unwrap_or(copy);
    if !index.is_file() {
        return Err(NoPlace::Index).in_file(index);
    }
    let window = window_of_box(&site, edges_deg)?;
    let proposed = propose(&index, &window, arguments.place.pairs, PIXEL_MAX_M)?;
    if proposed.is_empty() {
        return Err(NoPlace::Images).in_file(index);
    }
    let new = NewSite {
        description: arguments
            .description
            .clone()
            .unwrap_or_else(|| format!("Proposed for {name}")),
        kernels: vec![PathBuf::from("kernels")],
        kernels_are_a_folder: true,
        pedr: if arguments.shots.is_empty() {
            vec![PathBuf::from("pedr/*.b")]
        } else {
            Vec::new()
        },
        shots: seen(folder, &arguments.shots)?,
        edges_deg: Some(edges_deg),
        images: proposed
            .iter()
            .map(|image| (image.id.clone(), Path::new("images").join(&image.file)))
            .collect(),
        pixels_in_labels: true,
        site,
        ..NewSite::default()
    };
    let text = new.text();
    in_new_folder(folder, || {
        parse_unfilled(&text, &file)?;
        atomic::write(&file, text.as_bytes())
    })?;
    for image in &proposed {
        output::line(format_args!("image {}: {}", image.id, image.why));
    }
    let file = file.display();
    output::line(format_args!(
        "{file}: written; next: areograph fetch {file} --plan"
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_a_window_around_its_centre() {
        let read: Places = toml_of(PLACES).unwrap();
        for (name, of) in &read.places {
            let [west, east, south, north] = place(&name.to_uppercase()).unwrap().edges_deg();
            assert!(west < of.longitude_deg && of.longitude_deg < east, "{name}");
            // Kilometres; edges are rounded to 0.01 degrees, 0.6 km.
            let height_km = (north - south) * PI / 180.0 * RADIUS_M / METRES_PER_KM;
            assert!(
                (height_km - of.window_km).abs() < 0.7,
                "{name}: {height_km} km"
            );
            window_of_box(name, [west, east, south, north]).unwrap();
        }
        let refused = place("atlantis").unwrap_err().to_string();
        assert!(
            refused.contains("expected becquerel, ") && refused.contains("gale"),
            "{refused}"
        );
    }
}
