//! Kernels by type, as SpiceQL reports them, with hashes and coverage.

use std::{collections::BTreeMap, path::Path};

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    files::write_json,
    product::{Content, Declaration, Role, Write},
    site::SiteProducts,
};
use areograph_base::{
    body::Body, kernel_names::quality_of, kernel_source::CkQuality, schema::DocumentSchema,
    time::Intervals,
};
use areograph_stages::describe_kernels::KernelLine;

pub(super) static KERNELS: Declaration = Declaration {
    path: "exchange/kernels.json",
    what: "kernels by type with the keys of SpiceQL; hashes and coverage under the key areograph",
    readers: "SpiceQL, scripts",
    rows: "kernels",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::Site(|path, of| {
        write_json(path, &report(of.site))?;
        Ok(Some(of.site.kernels.len() as u64))
    }),
    uses: &[],
};

/// Kernel names by SpiceQL's types, in load order: `ck`, `spk`, `tspk` (ephemerides of other bodies), `pck`,
/// `fk`, `ik`, `iak` (ISIS addenda), `lsk`, `sclk`.
fn names_by_type<'a>(site: &SiteProducts<'a>) -> BTreeMap<String, Vec<&'a str>> {
    let mut names: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for kernel in site.kernels {
        names.entry(type_of(kernel)).or_default().push(&kernel.name);
    }
    names
}

fn type_of(kernel: &KernelLine) -> String {
    let name = kernel.name.to_lowercase();
    let holds_spacecraft = kernel
        .held
        .as_ref()
        .is_some_and(|held| !held.as_slice().is_empty());
    match kernel.role.as_str() {
        "SPK" if !holds_spacecraft => "tspk".to_owned(),
        "IK" if name.contains("addendum") => "iak".to_owned(),
        role => role.to_lowercase(),
    }
}

/// By its key, the least of the qualities of a spacecraft's kernels of one type, in SpiceQL's words: commanded attitude
/// is `predicted`, archived kernels are `reconstructed`, other names give `noquality`.
fn qualities(site: &SiteProducts) -> BTreeMap<String, &'static str> {
    let ids = site.spacecraft_of_kernels().into_iter();
    let ids: Vec<&str> = ids.map(|spacecraft| &*spacecraft.id).collect();
    let quality = |kernel: &&KernelLine| {
        let name = kernel.name.to_lowercase();
        if quality_of(Path::new(&name)) == CkQuality::Nominal {
            "predicted"
        } else if ids.iter().any(|id| name.starts_with(&format!("{id}_"))) {
            "reconstructed"
        } else {
            "noquality"
        }
    };
    // Alphabetic order is the order of quality, the least first.
    let least = |required: &str| {
        let of_type = site.kernels.iter().filter(|line| type_of(line) == required);
        of_type.map(|kernel| quality(&kernel)).min()
    };
    let keys = ids
        .iter()
        .flat_map(|id| ["ck", "spk"].map(|kind| (id, kind)));
    keys.filter_map(|(id, kind)| Some((format!("{id}_{kind}_quality"), least(kind)?)))
        .collect()
}

/// SpiceQL's members, and `areograph` with a kernel per entry.
#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Kernels of a site",
    description = "exchange/kernels.json of areograph: kernel names by type, and qualities, as SpiceQL reports them; \
                   the key `areograph` contains the size, hash and coverage of each kernel.",
    extend("dependentRequired" = {
        "mgs_ck_quality": ["ck"],
        "mgs_spk_quality": ["spk"],
        "mex_ck_quality": ["ck"],
        "mex_spk_quality": ["spk"],
    }),
    extend("dependentSchemas" = {
        "ck": {"anyOf": [{"required": ["mgs_ck_quality"]}, {"required": ["mex_ck_quality"]}]},
        "spk": {"anyOf": [{"required": ["mgs_spk_quality"]}, {"required": ["mex_spk_quality"]}]},
    })
)]
struct Report<'a> {
    areograph: Extension<'a>,
    #[serde(flatten)]
    kernels: KernelsByType<'a>,
}

/// Kernel names by type, and kernel qualities, as in SpiceQL and ALE.
#[derive(Serialize, JsonSchema)]
pub(super) struct KernelsByType<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    ck: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fk: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    iak: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ik: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lsk: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = QUALITIES))]
    mex_ck_quality: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = QUALITIES))]
    mex_spk_quality: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = QUALITIES))]
    mgs_ck_quality: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = QUALITIES))]
    mgs_spk_quality: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pck: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sclk: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    spk: Option<Names<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tspk: Option<Names<'a>>,
}

/// SpiceQL's terms for the quality of a kernel.
const QUALITIES: [&str; 4] = ["smithed", "reconstructed", "predicted", "noquality"];

/// File names of the kernels of one type, in load order.
#[derive(Serialize, JsonSchema)]
#[serde(transparent)]
pub(super) struct Names<'a>(
    #[schemars(length(min = 1), inner(regex(pattern = "^[^/]+$")))] Vec<&'a str>,
);

#[derive(Serialize, JsonSchema)]
struct Extension<'a> {
    coverage: String,
    wanted_positions_et_s: Vec<[f64; 2]>,
    wanted_attitudes_et_s: Vec<[f64; 2]>,
    kernels: Vec<Entry<'a>>,
}

/// A kernel's identity and coverage.
#[derive(Serialize, JsonSchema)]
struct Entry<'a> {
    #[schemars(regex(pattern = "^[^/]+$"))]
    name: &'a str,
    #[schemars(extend("enum" = ["ck", "spk", "tspk", "pck", "fk", "ik", "iak", "lsk", "sclk"]))]
    r#type: String,
    bytes: u64,
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    blake3: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    coverage_et_s: Option<Vec<[f64; 2]>>,
}

/// Schema of the report.
fn schema() -> DocumentSchema {
    DocumentSchema::of::<Report>("kernels")
}

fn report<'a>(site: &SiteProducts<'a>) -> Report<'a> {
    let entry = |kernel: &'a KernelLine| Entry {
        name: &kernel.name,
        r#type: type_of(kernel),
        bytes: kernel.bytes,
        blake3: &kernel.blake3,
        coverage_et_s: kernel.held.as_ref().map(ends),
    };
    let names = site.spacecraft_of_kernels().into_iter();
    let names: Vec<&str> = names.map(|spacecraft| &*spacecraft.full_name).collect();
    // Images of other bodies have support data.
    let whose = match site.config.body {
        Body::Mars => names.join(" or "),
        Body::Moon => "a spacecraft".to_owned(),
    };
    let [positions, attitudes] = site.required.of_all();
    let areograph = Extension {
        coverage: format!(
            "intervals, TDB seconds past J2000, in which an spk contains the position, or a ck the attitude, of {whose}; \
             gaps of a ck lie between the intervals"
        ),
        wanted_positions_et_s: ends(&positions),
        wanted_attitudes_et_s: ends(&attitudes),
        kernels: site.kernels.iter().map(entry).collect(),
    };
    Report {
        areograph,
        kernels: kernels_by_type(site),
    }
}

/// Names of the site's kernels in load order.
pub(super) fn kernels_by_type<'a>(site: &SiteProducts<'a>) -> KernelsByType<'a> {
    let mut names = names_by_type(site);
    let qualities = qualities(site);
    let mut of_type = |kind: &str| names.remove(kind).map(Names);
    KernelsByType {
        ck: of_type("ck"),
        fk: of_type("fk"),
        iak: of_type("iak"),
        ik: of_type("ik"),
        lsk: of_type("lsk"),
        mex_ck_quality: qualities.get("mex_ck_quality").copied(),
        mex_spk_quality: qualities.get("mex_spk_quality").copied(),
        mgs_ck_quality: qualities.get("mgs_ck_quality").copied(),
        mgs_spk_quality: qualities.get("mgs_spk_quality").copied(),
        pck: of_type("pck"),
        sclk: of_type("sclk"),
        spk: of_type("spk"),
        tspk: of_type("tspk"),
    }
}

fn ends(intervals: &Intervals) -> Vec<[f64; 2]> {
    intervals
        .as_slice()
        .iter()
        .map(|interval| [interval.start.seconds(), interval.stop.seconds()])
        .collect()
}
