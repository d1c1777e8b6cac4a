//! Summary of a triangulation, as JSON.

use schemars::JsonSchema;
use serde::Serialize;

use super::{NetProducts, WriteNet};
use crate::{
    coordinates::degrees,
    files::write_json,
    product::{Content, Declaration, Role},
};
use areograph_base::schema::DocumentSchema;
use areograph_config::Method;
use areograph_geom::conformal_map::Projection;
use areograph_stages::{
    judge::Verdict,
    triangulate::{BrickResult, Seams, Totals},
};

pub(super) static DOCUMENT: Declaration<WriteNet> = Declaration {
    path: "triangulation.json",
    what: "bricks, seams, controls, redundancy, standard deviations and verdict",
    readers: "scripts",
    rows: "bricks",
    role: Role::Metadata,
    content: Content::Document(schema),
    write: |path, of| {
        write_json(path, &Document::of(of))?;
        Ok(of.result.bricks.len() as u64)
    },
    uses: &[],
};

/// The document.
#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Triangulation of a net",
    description = "triangulation.json of areograph: a plane triangulation of rectified pictures."
)]
struct Document<'a> {
    /// Always `areograph triangulation 1`.
    #[schemars(extend("const" = "areograph triangulation 1"))]
    format: &'static str,
    /// Identifier of the net.
    net: &'a str,
    /// Method of placing the pictures on the map: `scale`, `mortar` or `one_shot`.
    #[schemars(with = "String")]
    method: Method,
    /// The map.
    map: MapDocument,
    /// Whether the triangulation is usable.
    verdict: &'a Verdict,
    /// Sums of the net.
    totals: &'a Totals,
    /// The bricks.
    bricks: &'a [BrickResult],
    /// Seams between bricks; absent for a single brick.
    #[serde(skip_serializing_if = "Option::is_none")]
    seams: Option<&'a Seams>,
}

/// A conformal map of a sphere.
#[derive(Serialize, JsonSchema)]
struct MapDocument {
    /// Map projection: Mercator or stereographic.
    #[schemars(extend("enum" = ["mercator", "stereographic"]))]
    projection: &'static str,
    /// East longitude of the central meridian or centre, degrees.
    longitude_deg: f64,
    /// Latitude of true scale or of the centre, degrees.
    latitude_deg: f64,
    /// Radius of the sphere, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_m: f64,
}

impl<'a> Document<'a> {
    fn of(net: &NetProducts<'a>) -> Self {
        let map = &net.config.map.map;
        Self {
            format: "areograph triangulation 1",
            net: &net.config.net,
            method: net.config.triangulation.method,
            map: MapDocument {
                projection: match map.projection {
                    Projection::Mercator => "mercator",
                    Projection::Stereographic => "stereographic",
                },
                longitude_deg: degrees(map.longitude_rad),
                latitude_deg: degrees(map.latitude_rad),
                radius_m: map.radius_m,
            },
            verdict: &net.result.verdict,
            totals: &net.result.totals,
            bricks: &net.result.bricks,
            seams: net.result.seams.as_ref(),
        }
    }
}

fn schema() -> DocumentSchema {
    DocumentSchema::of::<Document>("triangulation")
}
