//! `[kernels]`: one source of kernels and how coverage is judged.

use std::path::PathBuf;

use serde::Deserialize;
use serde_json::json;

use areograph_base::kernel_source::{
    CkQuality, KernelList, KernelSelection, KernelSource, RivalKernels,
};

use super::{
    declare::{Declare as _, Keys, Many, declare_table, group, key, tables},
    forms::{from_to, list, list_or_none, lower_case_identifier, matching, words},
    paths::{FILE, FOLDER},
};

/// The ways to name kernels; exactly one of them.
const SOURCES: [&str; 4] = ["metakernel", "files", "root", "sets"];
/// Keys that only a folder needs.
const OF_ROOT: [&str; 3] = ["spk_family", "ck_quality", "pinned"];

/// Sets are loaded one after the other and compared; more than this is a mistake.
const SETS: Many = Many {
    count: Some((2, 16)),
    purpose: " sets to choose from",
    ..Many::ANY
};

declare_table! {
    /// Source of the kernels, and rules for their coverage: exactly one of `metakernel`, `files`, `root`,
    /// `sets`.
    pub struct KernelsConfig: Deserialize {
        /// The source of the kernel list.
        #[serde(skip)]
        source: KernelSource = group::<SourceKeys>().map(SourceKeys::source),
        /// Tolerance of attitude look-ups outside the intervals of the C-kernel; with 0, gaps are reported. (The ISIS
        /// addendum for MOC uses 1 s.) Within the tolerance, the nearest attitude is used although the bus rotates:
        /// extrapolation is reported, and is invalid beyond 4 s.
        ck_tolerance_s: f64 = key(from_to(0.0, 60.0)).or(0.0),
        /// Required margin of kernel coverage before the first and after the last instant used. The default exceeds the
        /// rounding of label times (10 ms) and clock ticks (4 ms), but is well below the 4 s between attitude samples:
        /// no image that the kernels can orient is refused.
        padding_s: f64 = key(from_to(0.0, 3600.0)).or(1.0),
    }
}

declare_table! {
    /// The source of the kernel list.
    struct SourceKeys {
        /// SPICE metakernel; relative paths in the metakernel are relative to its folder.
        metakernel: Option<PathBuf> = key(FILE).example(r#""../kernels/scene.tm""#),
        /// Alternatively, kernels in load order, as plain paths without wildcards; later kernels take precedence.
        files: Option<Vec<PathBuf>> = key(list(FILE).each_once("each kernel once"))
            .unused(r#"["../kernels/naif0012.tls", "../kernels/mgs_ext1.bsp"]"#),
        /// Alternatively, a folder, searched with its subfolders; `spk_family`, `ck_quality` and `pinned` then apply.
        root: Option<PathBuf> = key(FOLDER).unused(r#""../kernels""#),
        /// Or rival sets, each complete with the same clocks.
        sets: Option<Vec<RivalKernels>> = tables(SETS).then(|sets, keys: &mut Keys<'_, '_>| {
            keys.span_of("sets").is_some().then_some(sets)
        }),
        /// Orbit solution: "nav" (MGS navigation team, recommended by NAIF and used by Shan et al. 2005), "gsfc" or
        /// "ipng"; the solutions differ by 0 to 50 m, mostly across the track. With `root`.
        spk_family: String = key(lower_case_identifier()).or("nav".to_owned()).unused(r#""nav""#),
        /// Permitted kinds of attitude, best first: "reconstructed" is from telemetry, and "nominal" is the commanded
        /// attitude, which fills gaps in telemetry. With `root`.
        ck_quality: Vec<CkQuality> = key(list(words([
            ("reconstructed", CkQuality::Reconstructed, ""),
            ("nominal", CkQuality::Nominal, ""),
        ])).each_once("each quality once"))
            .or(vec![CkQuality::Reconstructed, CkQuality::Nominal])
            .unused(r#"["reconstructed", "nominal"]"#),
        /// Kernels pinned by file name; of all other kernels, the latest version is used. With `root`.
        pinned: Vec<String> = key(list_or_none(matching(
            "file names without folders",
            r"^[^/\\]+$",
            |name| !name.is_empty() && !name.contains(['/', '\\']),
        ))).or(Vec::new()).unused(r#"["pck00010.tpc"]"#),
    }
    check one_source
}

fn one_source(_: &SourceKeys, keys: &mut Keys<'_, '_>) {
    keys.rule(|| json!({"oneOf": SOURCES.map(|source| json!({"required": [source]}))}));
    let given = SOURCES.map(|source| keys.span_of(source));
    let expected = format!(
        "exactly one of {}",
        SOURCES.map(|key| format!("kernels.{key}")).join(", ")
    );
    match given.iter().flatten().count() {
        0 if keys.is_no_table() || keys.misspelt(&SOURCES) => {}
        0 => keys.problem(format!("kernels has no source; expected {expected}")),
        1 => {}
        sources => {
            let second = given.into_iter().flatten().max_by_key(|span| span.start);
            let text = format!("kernels has {sources} sources; expected {expected}");
            keys.review().problem(second, text);
        }
    }
    if keys.span_of("root").is_none() {
        for key in OF_ROOT {
            keys.unused(key, "it applies only with kernels.root");
        }
    }
}

impl SourceKeys {
    /// The folder before the sets before the list, when several are given.
    fn source(self) -> KernelSource {
        match (self.root, self.sets) {
            (Some(root), _) => KernelSource::Root(KernelSelection {
                root,
                spk_family: self.spk_family,
                ck_quality: self.ck_quality,
                pinned: self.pinned,
            }),
            (None, Some(sets)) => KernelSource::Sets(sets),
            (None, None) => KernelSource::Listed(listed(self.metakernel, self.files)),
        }
    }
}

/// With both, the metakernel; with neither, an empty list.
fn listed(metakernel: Option<PathBuf>, files: Option<Vec<PathBuf>>) -> KernelList {
    metakernel.map_or_else(
        || KernelList::Files(files.unwrap_or_default()),
        KernelList::Metakernel,
    )
}

declare_table! {
    /// Alternatively, 2 to 16 rival sets with the same clocks, each complete and given by either `metakernel` or
    /// `files`. As in Shan et al. 2005, the set whose trajectory is closest to the mean of all sets is used (root mean
    /// square distance over the positions that the site needs); the manifest states the distances. If there are only
    /// two sets, they are equally far from their mean, and the first is used.
    fill RivalKernels {
        /// Identifier, unique in the site.
        id = key(lower_case_identifier()).required().unused(r#""nav""#).unused_in(1, r#""ipng""#),
        /// Its kernels.
        list = group::<ListKeys>().map(|keys| listed(keys.metakernel, keys.files)),
    }
}

declare_table! {
    /// Kernels of a set.
    struct ListKeys {
        /// SPICE metakernel; relative paths in the metakernel are relative to its folder.
        metakernel: Option<PathBuf> = key(FILE).unused(r#""../kernels/nav.tm""#),
        /// Alternatively, kernels in load order, as plain paths without wildcards; later kernels take precedence.
        files: Option<Vec<PathBuf>> = key(list(FILE).each_once("each kernel once"))
            .unused_in(1, r#"["../kernels/naif0012.tls", "../kernels/mgs_ipng.bsp"]"#),
    }
    check one_list
}

fn one_list(_: &ListKeys, keys: &mut Keys<'_, '_>) {
    const LISTS: [&str; 2] = ["metakernel", "files"];
    keys.rule(|| json!({"oneOf": LISTS.map(|list| json!({"required": [list]}))}));
    let given = LISTS.map(|list| keys.span_of(list).is_some());
    if given[0] == given[1] && !keys.is_no_table() && !keys.misspelt(&LISTS) {
        keys.problem(
            "kernels.sets has no clear source; expected either metakernel or files".to_owned(),
        );
    }
}
