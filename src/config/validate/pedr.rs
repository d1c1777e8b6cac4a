//! `[pedr]`: globs resolved to files, datum, filters.

use toml::Spanned;

use crate::{
    altimetry::{DatumChoice, ShotFilter},
    frames::MarsDatum,
    units::RADIANS_PER_DEGREE,
};

use super::{
    super::{
        problems::Review,
        raw::{RawFilter, RawPedr},
        site::PedrConfig,
    },
    globs::found_files,
    values::Accept,
};

const DATUMS: [(&str, DatumChoice); 4] = [
    ("auto", DatumChoice::Auto),
    ("iau1991", DatumChoice::Stated(MarsDatum::Iau1991)),
    ("iau1994", DatumChoice::Stated(MarsDatum::Iau1994)),
    ("iau2000", DatumChoice::Stated(MarsDatum::Iau2000)),
];

pub(super) fn pedr(raw: Option<Spanned<RawPedr>>, review: &mut Review<'_>) -> PedrConfig {
    let table = raw.as_ref().map(Spanned::span);
    let raw = raw.map(Spanned::into_inner).unwrap_or_default();
    if table.is_some() && raw.files.is_none() {
        review.missing(
            table,
            "pedr.files",
            "paths or globs of PEDR files (or no table pedr at all)",
        );
    }
    PedrConfig {
        files: raw
            .files
            .map(|globs| found_files("pedr.files", &globs, review))
            .unwrap_or_default(),
        datum: review
            .word("pedr.datum", raw.datum.as_ref(), &DATUMS)
            .unwrap_or(DatumChoice::Auto),
        filter: filter(&raw.filter.unwrap_or_default(), review),
    }
}

fn filter(raw: &RawFilter, review: &mut Review<'_>) -> ShotFilter {
    ShotFilter {
        classes: review.whole_list(
            "pedr.filter.classes",
            raw.classes.as_ref(),
            (i16::MIN, i16::MAX),
            &[1],
        ),
        channels: review.whole_list(
            "pedr.filter.channels",
            raw.channels.as_ref(),
            (1, 4),
            &[1, 2, 3, 4],
        ),
        // Flags 2 and 3 say that the footprint assumes nadir pointing: off nadir it can be
        // 100 km from where the laser struck.
        attitude_flags: review.whole_list(
            "pedr.filter.attitude_flags",
            raw.attitude_flags.as_ref(),
            (u16::MIN, u16::MAX),
            &[0, 1],
        ),
        off_nadir_max_rad: RADIANS_PER_DEGREE
            * review.number(
                "pedr.filter.off_nadir_max_deg",
                &raw.off_nadir_max_deg,
                Accept::AboveTo(0.0, 90.0),
                90.0,
            ),
    }
}
