//! Values of the page, as JSON inside it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{
    columns::{Packed, instants},
    frame::MapFrame,
    layers::{Layer, LayerPlace, Part, Pixels, layers},
    terrain::{self, TerrainLine},
};
use crate::{
    error::Result,
    frames::{BodyFixed, Position},
    geom::ellipsoid::{Spherical, local_axes},
    products::{
        Place, RegisteredFootprint, SiteProducts, on_ground_m, registered_footprints, tie_residuals,
    },
    report::parts::{HEIGHT_COLOURS, Outline, window_outlines},
    stages::adjust::PointKind,
    units::RADIANS_PER_DEGREE,
};

/// Largest number of footprints: 8 MB. Of more, all inside images and some of the others are on the page.
const FOOTPRINTS_MAX: usize = 150_000;

/// Everything that the script shows.
#[derive(Serialize)]
pub(super) struct Data<'a> {
    site: &'a str,
    altimeter: &'a str,
    areoid: &'static str,
    latitude: &'static str,
    frame: &'a str,
    /// The sphere to which heights of tie points refer.
    sphere_m: f64,
    pub(super) map: MapFrame,
    colours: [[f64; 3]; 7],
    layers: Vec<LayerEntry>,
    images: Vec<Image<'a>>,
    windows: Vec<Window>,
    profiles: Vec<&'a str>,
    pub(super) footprints: Footprints,
    registered: Vec<Registered>,
    terrain: Vec<TerrainLine>,
    ties: Ties<'a>,
    measures: Measures,
}

/// A picture on the map or of an image.
#[derive(Serialize)]
struct LayerEntry {
    title: String,
    /// Whether it lies below the others.
    below: bool,
    /// On the map.
    edges_m: Option<[f64; 4]>,
    image: Option<usize>,
    reduction: Option<u32>,
    /// Rows and columns.
    size: [usize; 2],
    parts: Vec<Part>,
}

impl LayerEntry {
    fn of(layer: &Layer) -> Self {
        let (edges_m, image) = match layer.place {
            LayerPlace::Map(edges_m) => (Some(edges_m), None),
            LayerPlace::Image { image, reduction } => (None, Some((image, reduction))),
        };
        Self {
            title: layer.title.clone(),
            below: matches!(layer.pixels, Pixels::Png(_)),
            edges_m,
            image: image.map(|(image, _)| image),
            reduction: image.map(|(_, reduction)| reduction),
            size: layer.size,
            parts: layer.parts(),
        }
    }
}

#[derive(Serialize)]
struct Image<'a> {
    id: &'a str,
    lines: u32,
    samples: u32,
    /// East longitude and latitude of its corners and edges, with the orientation from the kernels.
    outline_deg: Vec<[f64; 2]>,
}

/// An edge of a search window.
#[derive(Serialize)]
struct Window {
    id: String,
    /// East longitude and latitude.
    ring_deg: Vec<[f64; 2]>,
}

impl Window {
    fn of(outline: Outline) -> Self {
        let corners = outline.ring.into_iter();
        Self {
            id: outline.name,
            ring_deg: corners
                .map(|(longitude_rad, latitude_rad)| [longitude_rad, latitude_rad].map(degrees))
                .collect(),
        }
    }
}

/// Footprints, in the order of the products.
#[derive(Serialize)]
pub(super) struct Footprints {
    pub(super) count: usize,
    /// Number in the products.
    of: usize,
    row: Packed,
    longitude_deg: Packed,
    latitude_deg: Packed,
    topography_m: Packed,
    ground_radius_m: Packed,
    areoid_radius_m: Packed,
    profile: Packed,
    record: Packed,
    shot: Packed,
    utc: String,
}

/// Footprints in an image.
#[derive(Serialize)]
struct Registered {
    image: usize,
    /// Places among the footprints of the page.
    footprint: Packed,
    before_line: Packed,
    before_sample: Packed,
    adjusted_line: Packed,
    adjusted_sample: Packed,
    /// 1 inside before, 2 inside after the adjustment.
    inside: Packed,
    moved_px: Packed,
    sigma_m: [Packed; 3],
}

/// Ground points of tie points, adjusted if there is an adjustment.
#[derive(Serialize)]
struct Ties<'a> {
    adjusted: bool,
    ids: Vec<&'a str>,
    longitude_deg: Packed,
    latitude_deg: Packed,
    radius_m: Packed,
    sigma_m: [Packed; 3],
}

/// Measurements of tie points, and their residuals.
#[derive(Serialize)]
struct Measures {
    tie: Packed,
    image: Packed,
    line: Packed,
    sample: Packed,
    residual_line: Packed,
    residual_sample: Packed,
    residual_east_m: Packed,
    residual_north_m: Packed,
}

impl<'a> Data<'a> {
    /// The values of `site`, to which `registered` belongs.
    ///
    /// # Errors
    /// An output that cannot be read; a picture that the library rejects.
    pub(super) fn of(site: &'a SiteProducts<'a>) -> Result<Self> {
        let terms = site.config.terms();
        let registered = if site.footprints.is_empty() {
            Vec::new()
        } else {
            registered_footprints(site)
        };
        let kept = kept(site, &registered);
        let (footprints, profiles) = footprints(site, &kept);
        let (ties, measures) = ties(site);
        Ok(Self {
            site: &site.config.site,
            altimeter: terms.altimeter,
            areoid: terms.areoid(),
            latitude: terms.latitude(),
            frame: terms.short_frame(),
            sphere_m: site.config.body.map().radius_m,
            map: MapFrame::of(site)?,
            colours: HEIGHT_COLOURS,
            layers: layers(site)?.iter().map(LayerEntry::of).collect(),
            images: site.images.iter().map(image).collect(),
            windows: window_outlines(site).into_iter().map(Window::of).collect(),
            profiles: site.profiles.iter().map(|of| &*of.id).collect(),
            terrain: terrain::lines(site, &profiles)?,
            footprints,
            registered: by_image(site, &kept, &registered),
            ties,
            measures,
        })
    }
}

/// To millionths.
fn degrees(angle_rad: f64) -> f64 {
    (angle_rad / RADIANS_PER_DEGREE * 1e6).round() / 1e6
}

fn image<'a>(image: &crate::products::ImageProducts<'a>) -> Image<'a> {
    let outline = image.orientation.outline.as_deref().unwrap_or_default();
    let corners = outline
        .iter()
        .map(|corner| [corner.longitude_rad, corner.latitude_rad].map(degrees));
    Image {
        id: &image.times.id,
        lines: image.times.lines_delivered,
        samples: image.times.samples,
        outline_deg: corners.collect(),
    }
}

/// Rows of the footprints on the page, with their places there.
fn kept(site: &SiteProducts, registered: &[RegisteredFootprint]) -> BTreeMap<usize, usize> {
    let count = site.footprints.len();
    let step = count.div_ceil(FOOTPRINTS_MAX).max(1);
    let inside = registered.iter().map(|of| of.footprint);
    let rows = (0..count).step_by(step).chain(inside);
    let mut kept: BTreeMap<usize, usize> = rows.map(|row| (row, 0)).collect();
    for (place, (_, at)) in kept.iter_mut().enumerate() {
        *at = place;
    }
    kept
}

/// The footprints, and the rows of each profile. A footprint in several windows has the first of its profiles.
fn footprints(site: &SiteProducts, kept: &BTreeMap<usize, usize>) -> (Footprints, Vec<Vec<usize>>) {
    let of = site.footprints;
    let mut profile = vec![usize::MAX; of.len()];
    for (index, one) in site.profiles.iter().enumerate().rev() {
        for row in &one.rows {
            profile[*row as usize] = index;
        }
    }
    let mut profiles = vec![Vec::new(); site.profiles.len()];
    for row in kept.keys() {
        if let Some(rows) = profiles.get_mut(profile[*row]) {
            rows.push(*row);
        }
    }
    let numbers = |decimals: i32, value: &dyn Fn(usize) -> f64| {
        Packed::of(decimals, kept.keys().map(|row| Some(value(*row))))
    };
    let whole = |value: &dyn Fn(usize) -> u32| Packed::whole(kept.keys().map(|row| value(*row)));
    let footprints = Footprints {
        count: kept.len(),
        of: of.len(),
        row: whole(&|row| u32::try_from(row).unwrap_or(u32::MAX)),
        longitude_deg: numbers(6, &|row| of.longitude_rad.at(row) / RADIANS_PER_DEGREE),
        latitude_deg: numbers(6, &|row| of.latitude_rad.at(row) / RADIANS_PER_DEGREE),
        topography_m: numbers(2, &|row| of.topography_of_m(row)),
        ground_radius_m: numbers(2, &|row| of.ground_radius_m(row)),
        areoid_radius_m: numbers(2, &|row| of.areoid_radius_m.at(row)),
        // Of a footprint outside all profiles, the number of profiles.
        profile: whole(&|row| {
            u32::try_from(profile[row].min(site.profiles.len())).unwrap_or(u32::MAX)
        }),
        record: whole(&|row| of.record.at(row)),
        shot: whole(&|row| u32::from(of.shot.at(row))),
        utc: instants(kept.keys().map(|row| site.utc.at(*row).microseconds())),
    };
    (footprints, profiles)
}

/// The registered footprints of the shown images.
fn by_image(
    site: &SiteProducts,
    kept: &BTreeMap<usize, usize>,
    registered: &[RegisteredFootprint],
) -> Vec<Registered> {
    let shown = site.shown_images().into_iter();
    let each = shown.map(|index| {
        let id = &site.images[index].times.id;
        let own = || registered.iter().filter(|of| of.image.times.id == *id);
        let place = |round: usize, value: fn(Place) -> f64| {
            Packed::of(2, own().map(|of| of.places[round].map(value)))
        };
        let is_inside = |of: &RegisteredFootprint, round: usize| {
            u32::from(of.places[round].is_some_and(|place| place.inside))
        };
        let sigma_m =
            |axis: usize| Packed::of(2, own().map(|of| Some(of.adjusted?.local_sigmas_m()[axis])));
        Registered {
            image: index,
            footprint: Packed::whole(own().map(|of| {
                let place = kept.get(&of.footprint).copied();
                place
                    .and_then(|at| u32::try_from(at).ok())
                    .unwrap_or(u32::MAX)
            })),
            before_line: place(0, |of| of.line),
            before_sample: place(0, |of| of.sample),
            adjusted_line: place(1, |of| of.line),
            adjusted_sample: place(1, |of| of.sample),
            inside: Packed::whole(own().map(|of| is_inside(of, 0) + 2 * is_inside(of, 1))),
            moved_px: Packed::of(2, own().map(RegisteredFootprint::moved_px)),
            sigma_m: [0, 1, 2].map(sigma_m),
        }
    });
    each.collect()
}

/// A tie point on the ground: its index, identifier, position and standard deviations in east, north and height.
type Tie<'a> = (usize, &'a str, Position<BodyFixed>, Option<[f64; 3]>);

fn ties<'a>(site: &'a SiteProducts<'a>) -> (Ties<'a>, Measures) {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    let points = adjusted.map(|adjusted| &adjusted.points);
    let adjusted_ties = points.into_iter().flatten();
    let adjusted_ties = adjusted_ties.filter(|point| point.kind == PointKind::Tie);
    // An accuracy that is withheld elsewhere is not stated here.
    let is_stated = site.accuracy_withheld().is_none();
    let adjusted_ties = adjusted_ties.map(|point| {
        let sigmas_m = is_stated.then(|| point.local_sigmas_m());
        (point.index, &*point.id, point.ground, sigmas_m)
    });
    let intersected = site.geometric.filter(|_| adjusted.is_none());
    let intersected = intersected.map(|of| &of.intersected.points);
    let intersected = intersected.into_iter().flatten();
    let intersected = intersected.map(|point| (point.tie, &*point.id, point.ground, None));
    let points: Vec<Tie> = adjusted_ties.chain(intersected).collect();
    let place = |decimals: i32, value: fn(Spherical) -> f64| {
        let places = points.iter();
        let places = places.map(|(_, _, ground, _)| Spherical::from_xyz_m(&ground.xyz_m));
        Packed::of(decimals, places.map(|of| Some(value(of))))
    };
    let sigma_m = |axis: usize| Packed::of(2, points.iter().map(|of| Some(of.3?[axis])));
    let ties = Ties {
        adjusted: adjusted.is_some(),
        ids: points.iter().map(|of| of.1).collect(),
        longitude_deg: place(6, |of| {
            of.longitude_rad.rem_euclid(std::f64::consts::TAU) / RADIANS_PER_DEGREE
        }),
        latitude_deg: place(6, |of| of.latitude.0 / RADIANS_PER_DEGREE),
        radius_m: place(2, |of| of.radius_m),
        sigma_m: [0, 1, 2].map(sigma_m),
    };
    let measures = measures(site, &points);
    (ties, measures)
}

/// A residual of a measurement: line and sample, and east and north on the ground.
type Residual = ([f64; 2], Option<[f64; 2]>);

fn measures(site: &SiteProducts, points: &[Tie]) -> Measures {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    let all = adjusted.map_or(&[][..], |adjusted| &adjusted.points);
    let mut residuals: BTreeMap<(usize, usize), Residual> = BTreeMap::new();
    for (image, view) in tie_residuals(site) {
        if let Some(point) = all.get(view.point) {
            let axes = local_axes(&point.ground.xyz_m);
            let local_m = on_ground_m(image, view).map(|step_m| axes * step_m);
            let on_ground_m = local_m.map(|of| [of.x, of.y]);
            residuals.insert((point.index, view.image), (view.in_image_px, on_ground_m));
        }
    }
    let ties = site.geometric.map_or(&[][..], |of| &of.ties.points);
    let rows: Vec<_> = points
        .iter()
        .enumerate()
        .flat_map(|(place, (tie, ..))| {
            let measures = ties.get(*tie).into_iter().flat_map(|of| &of.measures);
            measures.map(move |of| (place, of, (*tie, of.image)))
        })
        .map(|(place, of, key)| (place, of, residuals.get(&key).copied()))
        .collect();
    let index = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
    let residual = |decimals: i32, value: fn(Residual) -> Option<f64>| {
        Packed::of(decimals, rows.iter().map(|row| value(row.2?)))
    };
    Measures {
        tie: Packed::whole(rows.iter().map(|row| index(row.0))),
        image: Packed::whole(rows.iter().map(|row| index(row.1.image))),
        line: Packed::of(2, rows.iter().map(|row| Some(row.1.line))),
        sample: Packed::of(2, rows.iter().map(|row| Some(row.1.sample))),
        residual_line: residual(3, |of| Some(of.0[0])),
        residual_sample: residual(3, |of| Some(of.0[1])),
        residual_east_m: residual(2, |of| Some(of.1?[0])),
        residual_north_m: residual(2, |of| Some(of.1?[1])),
    }
}
