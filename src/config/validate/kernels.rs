//! `[kernels]`: one source of kernels and how coverage is judged.

use std::collections::BTreeSet;

use toml::Spanned;

use super::{
    super::{
        problems::Review,
        raw::RawKernels,
        site::{CkQuality, KernelSelection, KernelSource, KernelsConfig},
    },
    values::{Accept, Target},
};

/// Beyond the rounding of label times (10 ms) and clock ticks (4 ms), well below the 4 s between
/// attitude samples, so that no image is refused which the kernels can orient.
const PADDING_S: f64 = 1.0;

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
    ];
    let sources = given.iter().flatten().count();
    if sources == 0 {
        let expected = "exactly one of kernels.metakernel, kernels.files, kernels.root";
        review.problem(table, format!("kernels has no source; expected {expected}"));
    } else if sources > 1 {
        let second = given.iter().flatten().max_by_key(|span| span.start);
        review.problem(
            second.cloned(),
            format!("kernels has {sources} sources; expected exactly one of kernels.metakernel, kernels.files, kernels.root"),
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
    let metakernel = raw
        .metakernel
        .as_ref()
        .map(|path| review.existing("kernels.metakernel", path, Target::File));
    let files = raw.files.as_ref().map(|files| kernel_files(files, review));
    match (metakernel, files) {
        (Some(metakernel), _) => KernelSource::Metakernel(metakernel),
        (None, files) => KernelSource::Files(files.unwrap_or_default()),
    }
}

fn kernel_files(
    raw: &Spanned<Vec<Spanned<String>>>,
    review: &mut Review<'_>,
) -> Vec<std::path::PathBuf> {
    review.not_empty("kernels.files", raw);
    let mut seen = BTreeSet::new();
    raw.get_ref()
        .iter()
        .map(|written| {
            let path = review.existing("kernels.files", written, Target::File);
            if !seen.insert(path.clone()) {
                review.refuse(written.span(), "kernels.files", "each kernel once");
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
