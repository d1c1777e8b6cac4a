//! Grouping of the footprints of one orbit inside one window into profiles, marked where an image was exposed at the
//! same time. Windows that share a footprint act as one window: a pass over both is one profile, with one shift.
//!
//! This is a separate stage, because profiles need footprints and image times, and two stages need profiles.

use std::{collections::BTreeSet, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use super::{convert_datum::Converted, tag_times::ImageTimes};
use areograph_base::{
    altimetry::NO_ATTITUDE,
    error::Result,
    footprints::Footprints,
    frames::BodyFixed,
    time::{Et, Interval},
};
use areograph_config::WindowConfig;
use areograph_geom::statistics::median;
use areograph_store::{
    stage::{InOrder, Output, Stage},
    stage_inputs,
};

/// Shots of one orbit inside one window, or inside windows that overlap, in order of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// `<window>/<orbit>`, with `.2`, `.3` … when the orbit crosses the window again.
    pub id: String,
    /// Window identifier; of windows that overlap, the first that contains a shot of the profile.
    pub window: String,
    /// Orbit number in the PEDR.
    pub orbit: u32,
    /// Rows of the footprints, counted from 0.
    #[serde(with = "areograph_base::packed")]
    pub rows: Vec<u32>,
    /// First and last corrected shot time.
    pub interval: Interval,
    /// Images exposed while the profile was measured.
    pub simultaneous: Vec<SimultaneousImage>,
}

/// An image that was exposed during a profile.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimultaneousImage {
    /// Index of the image.
    pub image: usize,
    /// Number of shots of the profile that were fired while the image was exposed.
    pub shots: u32,
}

impl Profile {
    /// A pause longer than this starts another profile of the same orbit, seconds.
    ///
    /// An orbit crosses a wide window twice, on its day and its night side, tens of minutes apart; clouds and lost
    /// packets cause gaps of seconds.
    pub const PAUSE_S: f64 = 300.0;

    /// Median angle of its beam off nadir, radians.
    #[must_use]
    pub fn off_nadir_rad(&self, footprints: &Footprints<BodyFixed>) -> f64 {
        let angles_rad = self.rows.iter();
        let angles_rad = angles_rad.map(|row| footprints.off_nadir_rad.at(*row as usize).abs());
        median(&mut angles_rad.collect::<Vec<f64>>())
    }

    /// Whether its file states the attitude of every shot.
    #[must_use]
    pub fn attitude_is_known(&self, footprints: &Footprints<BodyFixed>) -> bool {
        let flag = |row: &u32| footprints.attitude_flag.at(*row as usize);
        self.rows.iter().all(|row| flag(row) < NO_ATTITUDE)
    }
}

stage_inputs! {
    /// Footprints, windows, and the images that may be simultaneous.
    pub struct GroupProfiles<'a> {
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Windows in the order of the footprints' bits.
        pub windows: &'a [WindowConfig],
        /// Line times of the images.
        pub images: InOrder<'a, Output<ImageTimes>>,
    }
}

impl Stage for GroupProfiles<'_> {
    const NAME: &'static str = "group_profiles";
    const METHOD: u32 = 4;
    const CHECKED: bool = true;
    type Output = Vec<Profile>;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Vec<Profile>> {
        let images = self.images.0.iter().map(|image| Ok(image.value()?.clone()));
        let images = images.collect::<Result<Vec<_>>>()?;
        let footprints = &self.converted.value()?.footprints;
        Ok(group_profiles(footprints, self.windows, &images))
    }
}

/// Groups footprints by window, orbit and pause; windows that share a footprint are one group.
///
/// Profiles are in the order of the groups' first windows and, within one, of time.
#[must_use]
pub fn group_profiles(
    footprints: &Footprints<BodyFixed>,
    windows: &[WindowConfig],
    images: &[ImageTimes],
) -> Vec<Profile> {
    let mut profiles = Vec::new();
    for group in groups_of_windows(footprints.windows.iter()) {
        let mut rows: Vec<u32> = (0_u32..)
            .zip(&footprints.windows)
            .filter(|(_, mask)| *mask & group != 0)
            .map(|(row, _)| row)
            .collect();
        // The sort is stable: shots with equal times stay in file order.
        rows.sort_by(|a, b| {
            footprints
                .et_s
                .at(*a as usize)
                .total_cmp(&footprints.et_s.at(*b as usize))
        });
        let crossings = rows.chunk_by(|a, b| {
            let (a, b) = (*a as usize, *b as usize);
            footprints.orbit.at(a) == footprints.orbit.at(b)
                && footprints.et_s.at(b) - footprints.et_s.at(a) <= Profile::PAUSE_S
        });
        let first_of_group = profiles.len();
        for rows in crossings {
            let seen_in = footprints.windows_of(rows);
            let window = windows.get(seen_in.trailing_zeros() as usize);
            let window = window.map_or("", |window| &*window.id);
            let orbit = footprints.orbit.at(rows[0] as usize);
            let earlier = profiles[first_of_group..]
                .iter()
                .filter(|profile: &&Profile| profile.orbit == orbit && profile.window == window)
                .count();
            profiles.push(profile(footprints, window, earlier, rows, images));
        }
    }
    profiles
}

/// Sets of windows that share footprints, as bits, in the order of their first windows.
fn groups_of_windows(masks: impl Iterator<Item = u64>) -> Vec<u64> {
    let distinct: BTreeSet<u64> = masks.collect();
    let mut groups: Vec<u64> = Vec::new();
    for mask in distinct.into_iter().filter(|mask| *mask != 0) {
        let mut joined = mask;
        groups.retain(|group| {
            let is_apart = group & mask == 0;
            if !is_apart {
                joined |= group;
            }
            is_apart
        });
        groups.push(joined);
    }
    groups.sort_by_key(|group| group.trailing_zeros());
    groups
}

fn profile(
    footprints: &Footprints<BodyFixed>,
    window: &str,
    earlier: usize,
    rows: &[u32],
    images: &[ImageTimes],
) -> Profile {
    let time = |row: &u32| Et::from_seconds(footprints.et_s.at(*row as usize));
    let orbit = footprints.orbit.at(rows[0] as usize);
    let suffix = if earlier == 0 {
        String::new()
    } else {
        format!(".{}", earlier + 1)
    };
    let simultaneous = images
        .iter()
        .enumerate()
        // Images oriented by the kernels of another spacecraft have no laser.
        .filter(|(_, image)| image.support.is_some() || image.has_laser())
        .filter_map(|(index, image)| {
            let exposures = image.exposures();
            let before = rows.partition_point(|row| time(row) < exposures.start);
            let until = rows.partition_point(|row| time(row) <= exposures.stop);
            let shots = u32::try_from(until - before).unwrap_or(u32::MAX);
            (shots > 0).then_some(SimultaneousImage {
                image: index,
                shots,
            })
        })
        .collect();
    Profile {
        id: format!("{window}/{orbit}{suffix}"),
        window: window.to_owned(),
        orbit,
        rows: rows.to_vec(),
        interval: Interval::new(time(&rows[0]), time(&rows[rows.len() - 1])),
        simultaneous,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_share_footprints_are_one_group() {
        let groups_of_windows = |masks: &[u64]| groups_of_windows(masks.iter().copied());
        assert!(groups_of_windows(&[]).is_empty());
        assert_eq!(groups_of_windows(&[0b1, 0b10, 0b1]), [0b1, 0b10]);
        // The first and the third share a footprint; the fourth and the third do, too.
        assert_eq!(
            groups_of_windows(&[0b1, 0b10, 0b100, 0b101, 0b1100, 0b1000]),
            [0b1101, 0b10]
        );
        // Two groups become one by a later mask.
        assert_eq!(groups_of_windows(&[0b11, 0b1100, 0b1010]), [0b1111]);
    }
}
