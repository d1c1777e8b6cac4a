//! `[kernels]`: one source of kernels and how coverage is judged.

use std::collections::BTreeSet;

use toml::Spanned;

use crate::kernel_source::{CkQuality, KernelList, KernelSelection, KernelSource, RivalKernels};

use super::{
    super::{
        problems::Review,
        raw::{RawKernelSet, RawKernels},
        site::KernelsConfig,
    },
    no_repeats,
    values::{Accept, Target},
};

/// Beyond the rounding of label times (10 ms) and clock ticks (4 ms), well below the 4 s between
/// attitude samples, so that no image is refused which the kernels can orient.
const PADDING_S: f64 = 1.0;

/// What a table of kernels must say.
const SOURCES: &str =
    "exactly one of kernels.metakernel, kernels.files, kernels.root, kernels.sets";

/// Sets are loaded one after the other and compared; more than this is a slip.
const SETS_MAX: usize = 16;

const QUALITIES: [(&str, CkQuality); 2] = [
    ("reconstructed", CkQuality::Reconstructed),
    ("nominal", CkQuality::Nominal),
];

pub(super) fn kernels(raw: Option<Spanned<RawKernels>>, review: &mut Review<'_>) -> KernelsConfig {
    let table = raw.as_ref().map(Spanned::span);
    let raw = raw.map(Spanned::into_inner).unwrap_or_default();
    let given = [
        raw.metakernel.as_ref().map(Spanned::span),
        raw.files.as_ref().map(Spanned::span),
        raw.root.as_ref().map(Spanned::span),
        raw.sets.as_ref().map(Spanned::span),
    ];
    let sources = given.iter().flatten().count();
    if sources == 0 {
        review.problem(table, format!("kernels has no source; expected {SOURCES}"));
    } else if sources > 1 {
        let second = given.iter().flatten().max_by_key(|span| span.start);
        review.problem(
            second.cloned(),
            format!("kernels has {sources} sources; expected {SOURCES}"),
        );
    }
    KernelsConfig {
        source: source(&raw, review),
        ck_tolerance_s: review.number(
            "kernels.ck_tolerance_s",
            &raw.ck_tolerance_s,
            Accept::FromTo(0.0, 60.0),
            0.0,
        ),
        padding_s: review.number(
            "kernels.padding_s",
            &raw.padding_s,
            Accept::FromTo(0.0, 3600.0),
            PADDING_S,
        ),
    }
}

/// The first source given; when it is not the folder, keys that only a folder needs are never used.
fn source(raw: &RawKernels, review: &mut Review<'_>) -> KernelSource {
    if let Some(root) = &raw.root {
        return KernelSource::Root(selection(root, raw, review));
    }
    for (key, span) in [
        ("spk_family", raw.spk_family.as_ref().map(Spanned::span)),
        ("ck_quality", raw.ck_quality.as_ref().map(Spanned::span)),
        ("pinned", raw.pinned.as_ref().map(Spanned::span)),
    ] {
        if let Some(span) = span {
            review.warn(
                span,
                format!("kernels.{key} is never used: it belongs to kernels.root"),
            );
        }
    }
    if let Some(sets) = &raw.sets {
        return KernelSource::Sets(rival_sets(sets, review));
    }
    let list = kernel_list(
        "kernels",
        raw.metakernel.as_ref(),
        raw.files.as_ref(),
        review,
    );
    KernelSource::Listed(list)
}

/// The list of the table `table`; of several the metakernel, of none an empty one.
fn kernel_list(
    table: &str,
    metakernel: Option<&Spanned<String>>,
    files: Option<&Spanned<Vec<Spanned<String>>>>,
    review: &mut Review<'_>,
) -> KernelList {
    let metakernel =
        metakernel.map(|path| review.existing(&format!("{table}.metakernel"), path, Target::File));
    let files = files.map(|files| kernel_files(&format!("{table}.files"), files, review));
    match (metakernel, files) {
        (Some(metakernel), _) => KernelList::Metakernel(metakernel),
        (None, files) => KernelList::Files(files.unwrap_or_default()),
    }
}

fn rival_sets(
    raw: &Spanned<Vec<Spanned<RawKernelSet>>>,
    review: &mut Review<'_>,
) -> Vec<RivalKernels> {
    let sets = raw.get_ref();
    if !(2..=SETS_MAX).contains(&sets.len()) {
        review.problem(
            Some(raw.span()),
            format!(
                "kernels.sets has {} entries; expected 2 to {SETS_MAX} sets to choose from",
                sets.len()
            ),
        );
    }
    no_repeats(
        "kernels.sets.id",
        sets.iter().map(|set| set.get_ref().id.as_ref()),
        review,
    );
    let rivals = sets.iter().map(|set| {
        let fields = set.get_ref();
        if fields.metakernel.is_some() == fields.files.is_some() {
            let text = "kernels.sets has no clear source; expected either metakernel or files";
            review.problem(Some(set.span()), text.to_owned());
        }
        let (metakernel, files) = (fields.metakernel.as_ref(), fields.files.as_ref());
        RivalKernels {
            id: review.identifier("kernels.sets.id", &fields.id, Some(set.span()), false),
            list: kernel_list("kernels.sets", metakernel, files, review),
        }
    });
    rivals.collect()
}

fn kernel_files(
    key: &str,
    raw: &Spanned<Vec<Spanned<String>>>,
    review: &mut Review<'_>,
) -> Vec<std::path::PathBuf> {
    review.not_empty(key, raw);
    let mut seen = BTreeSet::new();
    raw.get_ref()
        .iter()
        .map(|written| {
            let path = review.existing(key, written, Target::File);
            if !seen.insert(path.clone()) {
                review.refuse(written.span(), key, "each kernel once");
            }
            path
        })
        .collect()
}

fn selection(root: &Spanned<String>, raw: &RawKernels, review: &mut Review<'_>) -> KernelSelection {
    let spk_family = match &raw.spk_family {
        None => "nav".to_owned(),
        some => review.identifier("kernels.spk_family", some, None, false),
    };
    let ck_quality = raw.ck_quality.as_ref().map_or_else(
        || QUALITIES.map(|(_, quality)| quality).to_vec(),
        |list| qualities(list, review),
    );
    KernelSelection {
        root: review.existing("kernels.root", root, Target::Folder),
        spk_family,
        ck_quality,
        pinned: pinned(raw, review),
    }
}

fn qualities(raw: &Spanned<Vec<Spanned<String>>>, review: &mut Review<'_>) -> Vec<CkQuality> {
    review.not_empty("kernels.ck_quality", raw);
    let mut accepted = Vec::new();
    for written in raw.get_ref() {
        match review.word("kernels.ck_quality", Some(written), &QUALITIES) {
            Some(quality) if accepted.contains(&quality) => {
                review.refuse(written.span(), "kernels.ck_quality", "each quality once");
            }
            Some(quality) => accepted.push(quality),
            None => {}
        }
    }
    accepted
}

fn pinned(raw: &RawKernels, review: &mut Review<'_>) -> Vec<String> {
    let names = raw.pinned.as_ref().map(Spanned::get_ref);
    let mut accepted = Vec::new();
    for name in names.into_iter().flatten() {
        let text = name.get_ref();
        if text.is_empty() || text.contains(['/', '\\']) {
            review.refuse(name.span(), "kernels.pinned", "file names without folders");
        }
        accepted.push(text.clone());
    }
    accepted
}
