//! Images with footprints on them: pictures for readers, and the marks as points for programs.
//!
//! Marks are drawn into a palette of greys and colours, and the report embeds the same pictures. Bounds on pixels and
//! places keep `report/overlays.html` below 5 MB.

mod canvas;
mod marks;
mod pictures;

use serde_json::{Map, Value, json};

use self::marks::{MarkedFootprint, footprints};
pub use self::pictures::{Picture, anaglyph, piece, strip};
use super::{
    files::{read_bytes, write_bytes, write_json},
    product::{Content, Context, Declaration, Role, Write},
    site::SiteProducts,
};
use crate::error::ProductError;
use areograph_base::error::Locate as _;
use areograph_stages::adjust::PointKind;

pub(super) static PICTURE: Declaration = Declaration {
    path: "images/<image>/overlay.png",
    what: "the image at reduced resolution with its footprints before and after the adjustment",
    readers: "people",
    rows: "footprints in the image",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::ImageWhere {
        images: WITH_PIXELS,
        has: has_pixels,
        write: |path, of, image| {
            let Some(picture) = strip(of.site, image, u64::MAX)? else {
                return Ok(0);
            };
            write_bytes(path, &picture.png)?;
            if read_bytes(path)? != picture.png {
                let what = format!("{} bytes of a picture", picture.png.len());
                return Err(ProductError::ReadBack { what }).in_file(path);
            }
            Ok(footprints(of.site, image).len() as u64)
        },
    },
    uses: &[],
};

pub(super) static MARKS: Declaration = Declaration {
    path: "images/<image>/overlay.geojson",
    what: "footprints and tie points of the image in image coordinates (x is the sample, y = −line), as a layer over the \
           picture that `areograph image extract` writes",
    readers: "GIS",
    rows: "marks",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::ImageWhere {
        images: WITH_PIXELS,
        has: has_pixels,
        write: |path, of, image| {
            let features = features(of, image);
            let count = features.len() as u64;
            let name = &of.site.images[image].times.id;
            write_json(
                path,
                &json!({
                    "type": "FeatureCollection",
                    "name": format!("{name} in image coordinates"),
                    "features": features,
                }),
            )?;
            Ok(count)
        },
    },
    uses: &[],
};

/// Images with these products.
const WITH_PIXELS: &str = "every image with pixels";

fn has_pixels(site: &SiteProducts, image: usize) -> bool {
    let overlays = site.overlays;
    overlays.is_some_and(|overlays| overlays.quick_look(image).is_some())
}

/// Every mark as a point with its meaning.
fn features(of: &Context, image: usize) -> Vec<Value> {
    let site = of.site;
    let mut features = Vec::new();
    for footprint in footprints(site, image) {
        let profile = &site.profiles[footprint.profile].id;
        let MarkedFootprint { number, row, .. } = footprint;
        let states = [("kernels", footprint.before), ("adjusted", footprint.after)];
        for (orientation, place) in states {
            features.extend(place.map(|place| {
                let about = json!({
                    "kind": "footprint",
                    "profile": profile,
                    "number": number,
                    "footprint_row": row,
                    "orientation": orientation,
                });
                feature(place, about)
            }));
        }
    }
    let Some(geometric) = &site.geometric else {
        return features;
    };
    let rejected = geometric
        .adjustment
        .iter()
        .flat_map(|adjustment| &adjustment.adjusted.rejected);
    let rejected: Vec<_> = rejected
        .filter(|point| point.kind == PointKind::Tie)
        .collect();
    for (index, tie) in geometric.ties.points.iter().enumerate() {
        for measure in tie.measures.iter().filter(|measure| measure.image == image) {
            let mut about = json!({ "kind": "tie", "tie": tie.id });
            if let Some(point) = rejected.iter().find(|point| point.index == index) {
                about["rejected"] = json!(point.reason.to_string());
            }
            features.push(feature([measure.line, measure.sample], about));
        }
    }
    features
}

fn feature([line, sample]: [f64; 2], about: Value) -> Value {
    let mut properties = Map::new();
    properties.insert("line".to_owned(), json!(line));
    properties.insert("sample".to_owned(), json!(sample));
    if let Value::Object(about) = about {
        properties.extend(about);
    }
    json!({
        "type": "Feature",
        "geometry": { "type": "Point", "coordinates": [sample, -line] },
        "properties": properties,
    })
}
