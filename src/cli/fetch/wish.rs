//! Requested files, by site files and options.

use super::{Arguments, Kind};
use crate::{
    cli::files::{CONFIGURATIONS, expand},
    error::Result,
    fetch::{
        FetchError, Utc,
        plan::{ImagePlace, ImageWish, KernelWish, Span, Wish},
    },
    flow::{Needs, shots_of_box},
    kernel_source::CkQuality,
};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// First and last day of an option.
pub(super) fn days(text: &str) -> std::result::Result<[Utc; 2], String> {
    let expected =
        || format!("{text:?}; expected two days in order, such as 2001-03-01,2001-03-09");
    let (first, last) = text.split_once(',').ok_or_else(expected)?;
    let days = Utc::parse(first).zip(Utc::parse(last));
    let (first, last) = days
        .filter(|(first, last)| first <= last)
        .ok_or_else(expected)?;
    // The last day is included completely.
    Ok([first, last.plus(DAY_S)])
}

/// First and last orbit of an option.
pub(super) fn orbits(text: &str) -> std::result::Result<[u32; 2], String> {
    let expected = || format!("{text:?}; expected two orbits in order, such as 18933,18945");
    let (first, last) = text.split_once(',').ok_or_else(expected)?;
    let orbit = |text: &str| text.trim().parse::<u32>().map_err(|_| expected());
    let [first, last] = [orbit(first)?, orbit(last)?];
    if first <= last {
        Ok([first, last])
    } else {
        Err(expected())
    }
}

/// The needs of the command line.
///
/// # Errors
/// No needs; as of [`Needs::add_site`].
pub(super) fn needs(arguments: &Arguments) -> Result<Needs> {
    let spans = arguments.dates.iter().map(|utc| Span {
        utc: *utc,
        what: format!("--dates {} to {}", utc[0], utc[1]),
    });
    let mut wanted = Needs {
        wish: Wish {
            generic: arguments.generic_kernels.clone(),
            orbits: arguments.orbits.clone(),
            spans: spans.collect(),
            ..Wish::default()
        },
        notes: Vec::new(),
    };
    let into = arguments.folder();
    for product in &arguments.images {
        wanted.wish.images.push(ImageWish {
            product: product.clone(),
            place: ImagePlace::Folder(into.join("images")),
        });
    }
    for path in &expand(&arguments.sites, &CONFIGURATIONS)? {
        wanted.add_site(path)?;
    }
    if let Some(edges) = arguments.edges_deg {
        let edges_deg = arguments.meaning.edges_deg(edges)?;
        let table = shots_of_box(&into.join("shots"), edges_deg);
        wanted.wish.shots.push(table);
    }
    if arguments.sites.is_empty() {
        if wanted.wish.is_empty() && !arguments.index {
            return Err(FetchError::Nothing.into());
        }
        // A box and generic kernels have no times, by which kernels and files of the laser are chosen.
        let has_others = wanted.wish.generic.is_some() || !wanted.wish.shots.is_empty();
        if !has_others || wanted.wish.has_times() {
            wanted.wish.kernels = Some(KernelWish {
                folder: into.join("kernels"),
                spk_family: "nav".to_owned(),
                ck_quality: vec![CkQuality::Reconstructed, CkQuality::Nominal],
                pinned: Vec::new(),
                listed: Vec::new(),
            });
            wanted.wish.pedr = Some(into.join("pedr"));
        }
    }
    if !arguments.takes(Kind::Kernels) {
        wanted.wish.kernels = None;
    }
    if !arguments.takes(Kind::Pedr) {
        wanted.wish.pedr = None;
    }
    if !arguments.takes(Kind::Images) {
        for image in &mut wanted.wish.images {
            image.place = ImagePlace::Nowhere;
        }
    }
    if !arguments.takes(Kind::Shots) {
        wanted.wish.shots.clear();
    }
    Ok(wanted)
}
