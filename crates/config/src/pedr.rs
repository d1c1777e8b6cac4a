//! `[pedr]`: files, datum, filter.

use std::path::PathBuf;

use serde::Deserialize;

use areograph_base::{
    altimetry::{DatumChoice, GroundRadius, ShotFilter},
    body::Datum,
    units::RADIANS_PER_DEGREE,
};

use super::{
    declare::{Declare as _, declare_table, key, table},
    forms::{Words, above_to, from_to, list, several, whole_from_to, words},
    paths::{Globs, PEDR_ENDINGS},
};

declare_table! {
    /// PEDR files. Without this table, images are oriented, but there are no footprints and no range check.
    pub struct PedrConfig: Deserialize {
        /// Paths, folders or globs of PEDR files. A folder stands for all files `*.b` in it and its subfolders. A glob
        /// may contain `*`, `?` and `[..]` in at most three parts of the path; `**` is not accepted, and letter case is
        /// significant. A path that matches no file is refused. Every shot is counted once: a copy of a file is read
        /// once, and two versions of one orbit are refused.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(PEDR_ENDINGS))
            .required_as("paths or globs of PEDR files (or no table [pedr] at all)")
            .example(r#"["../pedr/*.b"]"#),
        /// Datum of the coordinates in the files; a stated datum must not contradict the version letter or the label.
        /// IAU 1991 and IAU 1994 differ by 0.033 degrees of longitude, 1.96 km at the equator; pck00006, which Shan et
        /// al. 2005 call IAU 1991, contains the 1994 constants.
        datum: DatumChoice = key(words([
            ("auto", DatumChoice::Auto, "from the version letter and the label: version L refers to IAU 2000, and older \
                versions to IAU 1991"),
            ("iau1991", DatumChoice::Stated(Datum::Iau1991), ""),
            ("iau1994", DatumChoice::Stated(Datum::Iau1994), ""),
            ("iau2000", DatumChoice::Stated(Datum::Iau2000), ""),
        ])).or(DatumChoice::Auto),
        /// Shot radius that every stage uses as the radius of the ground: corrected by the crossover residuals of the
        /// files (as in Shan, Lee & Yoon 2002), or raw. The range check reports both; tables of shots have one radius.
        crossover: GroundRadius = key(ground_radius()).or(GroundRadius::Corrected),
        /// Shots to keep.
        filter: ShotFilter = table(),
    }
}

declare_table! {
    /// Selection of shots; a shot must pass every test.
    fill ShotFilter {
        /// Accepted classification codes: 1 is ground, and 0 is cloud or noise. The default is from pedr2tab.
        classes = key(list(whole_from_to(i16::MIN, i16::MAX))).or(vec![1]).map(sorted),
        /// Accepted trigger channels. (The grids of the MOLA team exclude channel 4.)
        channels = key(list(whole_from_to(ShotFilter::CHANNELS[0], ShotFilter::CHANNELS[1]))).or(vec![1, 2, 3, 4]).map(sorted),
        /// Accepted attitude flags. With flag 2 (attitude missing for part of the frame) or 3 (for the whole frame),
        /// the footprint was computed for nadir pointing and may be in error by 100 km off nadir; the MOLA surface
        /// quadruples the standard deviations of the shifts of these profiles. Flag 1 has no published meaning. In
        /// files from before October 1998, the field is undefined: list the values found in these files.
        attitude_flags = key(list(whole_from_to(u16::MIN, u16::MAX))).or(vec![0, 1]).map(sorted),
        /// Largest off-nadir angle of the laser. The default keeps all shots, because images are also taken off nadir:
        /// Shan et al. 2005, Table 2, list emission angles of up to 22.1 degrees. (The grids of the MOLA team are
        /// limited to 1.0 or 1.2.)
        off_nadir_max_rad as "off_nadir_max_deg" =
            key(above_to(0.0, ShotFilter::OFF_NADIR_LIMIT_DEG)).or(90.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// First and last areocentric longitude of the Sun: the season of Mars, 0 at the northward equinox; if the
        /// first exceeds the last, the interval contains 0. The default is all seasons.
        solar_longitude_rad as "solar_longitude_deg" =
            key(several(from_to(0.0, 360.0), "two numbers [first, last]")).or([0.0, 360.0]).map(|season| season.map(|degrees| degrees * RADIANS_PER_DEGREE)),
    }
}

/// The radius of a shot that represents the ground.
pub(super) const fn ground_radius() -> Words<GroundRadius, 2> {
    words([
        (
            GroundRadius::Corrected.word(),
            GroundRadius::Corrected,
            "where the file contains a crossover residual",
        ),
        (GroundRadius::Raw.word(), GroundRadius::Raw, ""),
    ])
}

fn sorted<T: Ord>(mut values: Vec<T>) -> Vec<T> {
    values.sort_unstable();
    values.dedup();
    values
}
