//! The tie points that areograph measured, as measured: a table for `ties.files` and a control network of ISIS.

use super::{
    adjusted::isis_name,
    binary_network::write_binary_network,
    control_network::{ControlNetwork, NetworkMeasure, NetworkPoint, write_control_network},
    points::ImageMeasure,
};
use crate::{
    GeometricProducts, SiteProducts,
    files::write_text,
    product::{Content, Declaration, Program, Role, Use, Write},
};
use areograph_base::ties::{TieMeasure, TiePoint};
use areograph_config::ImageConfig;
use areograph_pds::ties::ties_table;
use areograph_stages::read_ties::Ties;

pub(crate) static TABLE: Declaration = Declaration {
    path: "exchange/matched_ties.csv",
    what: "matched tie points, with the standard deviations of their measurements, in the format of ties.files",
    readers: "areograph, scripts",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Matched(|path, of, geometric| {
        let names: Vec<&str> = of
            .site
            .config
            .images
            .iter()
            .map(ImageConfig::name_in_ties)
            .collect();
        let ties: Vec<TiePoint<String>> = matched(geometric.ties)
            .map(|tie| named(tie, &names))
            .collect();
        write_text(path, &ties_table(&ties))?;
        Ok(ties.len() as u64)
    }),
    uses: &[],
};

pub(crate) static NETWORK: Declaration = Declaration {
    path: "exchange/matched_ties.pvl",
    what: "matched tie points as a control network, as text",
    readers: "ISIS",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Matched(|path, of, geometric| {
        let serials = serials(of.site);
        write_control_network(path, &network(of.site, geometric, &serials))
    }),
    uses: &[],
};

pub(crate) static BINARY_NETWORK: Declaration = Declaration {
    path: "exchange/matched_ties.net",
    what: "matched tie points as a control network, binary",
    readers: "ISIS",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Matched(|path, of, geometric| {
        let serials = serials(of.site);
        write_binary_network(path, &network(of.site, geometric, &serials))
    }),
    uses: &[Use {
        program: Program::Isis,
        lines: "cnetstats fromlist=cubes.lis cnet=matched_ties.net",
    }],
};

/// The points that follow the points of files.
fn matched(ties: &Ties) -> impl Iterator<Item = &TiePoint> {
    let count: usize = ties.matched_points();
    ties.points.iter().skip(ties.points.len() - count)
}

/// The point with the names that tie point files of the site have for its images.
fn named(tie: &TiePoint, names: &[&str]) -> TiePoint<String> {
    let measures = tie.measures.iter().map(|measure| TieMeasure {
        image: names[measure.image].to_owned(),
        line: measure.line,
        sample: measure.sample,
        sigma_px: measure.sigma_px,
    });
    TiePoint {
        id: tie.id.clone(),
        known: None,
        measures: measures.collect(),
    }
}

fn serials(site: &SiteProducts) -> Vec<String> {
    site.images
        .iter()
        .map(|image| isis_name(site, image))
        .collect()
}

fn network<'a>(
    site: &'a SiteProducts,
    geometric: &'a GeometricProducts,
    serials: &'a [String],
) -> ControlNetwork<'a> {
    let points = matched(geometric.ties).map(|tie| {
        let measures = tie.measures.iter().map(|measure| NetworkMeasure {
            measure: ImageMeasure {
                image: &serials[measure.image],
                line: measure.line,
                sample: measure.sample,
            },
            sigma_px: measure.sigma_px,
            residual_px: None,
        });
        NetworkPoint {
            id: &tie.id,
            known: None,
            initial_m: None,
            adjusted: None,
            is_rejected: false,
            measures: measures.collect(),
        }
    });
    ControlNetwork {
        id: &site.config.site,
        body: site.config.body,
        description: "tie points matched by areograph".to_owned(),
        created_utc: site.newest_utc(),
        points: points.collect(),
    }
}
