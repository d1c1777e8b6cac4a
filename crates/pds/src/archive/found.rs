//! Results of a search.

use std::{collections::BTreeMap, fmt};

use serde::{Deserialize, Serialize};

use crate::pedr::{Complaint, Reason, SpoiledShots};
use areograph_base::{
    altimetry::ShotFilter,
    footprints::{AsRead, Footprint, Footprints},
    time::Et,
};

/// Reason for the rejection of a shot inside a window; the first that applies counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShotRejection {
    /// No laser return.
    NoReturn,
    /// A radius, range or parallax that contradicts the record's other values.
    Spoiled,
    /// Classification not accepted.
    Class,
    /// Trigger channel not accepted.
    Channel,
    /// Attitude flag not accepted.
    Attitude,
    /// Off-nadir angle too large.
    OffNadir,
    /// Season not accepted.
    Season,
}

impl ShotRejection {
    /// Rejection of a shot because of spoiled values in its frame, or by `filter`; without a filter every shot with a
    /// return is accepted.
    #[must_use]
    pub fn of(
        shot: &Footprint,
        spoiled: &SpoiledShots,
        filter: Option<&ShotFilter>,
    ) -> Option<Self> {
        // Written so that a NaN range counts as no return.
        if !(shot.range_m > 0.0) {
            return Some(Self::NoReturn);
        }
        if spoiled.contains(shot.shot) {
            return Some(Self::Spoiled);
        }
        let filter = filter?;
        if !filter.classes.contains(&shot.class) {
            Some(Self::Class)
        } else if !filter.channels.contains(&shot.channel) {
            Some(Self::Channel)
        } else if !filter.attitude_flags.contains(&shot.attitude_flag) {
            Some(Self::Attitude)
        } else if !(shot.off_nadir_rad.abs() <= filter.off_nadir_max_rad) {
            Some(Self::OffNadir)
        } else if !filter.is_in_season(Et::from_seconds(shot.et_tag_s)) {
            Some(Self::Season)
        } else {
            None
        }
    }
}

impl fmt::Display for ShotRejection {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::NoReturn => "no return",
            Self::Spoiled => "spoiled values",
            Self::Class => "class",
            Self::Channel => "channel",
            Self::Attitude => "attitude flag",
            Self::OffNadir => "off-nadir angle",
            Self::Season => "season",
        })
    }
}

/// Window indices of every shot, for any number of windows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WindowLists {
    /// End of the list of each shot in `windows`.
    ends: Vec<usize>,
    windows: Vec<u32>,
}

impl WindowLists {
    /// The windows of the shot in row `row`, in ascending order; empty for a row that does not exist.
    #[must_use]
    pub fn of(&self, row: usize) -> &[u32] {
        let end = |row: usize| self.ends.get(row).map_or(0, |end| *end);
        let start = row.checked_sub(1).map_or(0, end);
        self.windows.get(start..end(row)).unwrap_or_default()
    }

    fn push(&mut self, windows: &[u32]) {
        self.windows.extend(windows);
        self.ends.push(self.windows.len());
    }

    /// Appends the lists of other shots.
    pub fn append(&mut self, other: &Self) {
        let before = self.windows.len();
        self.windows.extend(&other.windows);
        self.ends.extend(other.ends.iter().map(|end| before + end));
    }

    /// Splits off the lists from row `row` on.
    #[must_use]
    pub fn split_off(&mut self, row: usize) -> Self {
        let ends = self.ends.split_off(row.min(self.ends.len()));
        let start = self.ends.last().copied().unwrap_or(0);
        Self {
            windows: self.windows.split_off(start),
            ends: ends.into_iter().map(|end| end - start).collect(),
        }
    }
}

/// Results from a stretch of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Shots in the windows, ordered by record and shot, in the coordinates of their file; `windows` has bits for the
    /// first 64 windows.
    pub footprints: Footprints<AsRead>,
    /// The windows of every shot.
    pub windows: WindowLists,
    /// Faults of the records that were checked.
    pub complaints: Vec<Complaint>,
    /// Complaints by reason.
    pub complaint_counts: BTreeMap<Reason, u64>,
    /// Rejected shots inside a window, by reason.
    pub rejected: BTreeMap<ShotRejection, u64>,
    /// Records examined, including those decided by an index.
    pub frames_read: u64,
    /// Shots whose own position was tested, in frames near a window.
    pub shots_read: u64,
}

impl Found {
    pub(super) const fn new() -> Self {
        Self {
            footprints: Footprints::new(Vec::new()),
            windows: WindowLists {
                ends: Vec::new(),
                windows: Vec::new(),
            },
            complaints: Vec::new(),
            complaint_counts: BTreeMap::new(),
            rejected: BTreeMap::new(),
            frames_read: 0,
            shots_read: 0,
        }
    }

    pub(super) fn complain(&mut self, complaint: Complaint) {
        *self.complaint_counts.entry(complaint.reason).or_default() += 1;
        self.complaints.push(complaint);
    }

    /// Adds a shot with its windows, in ascending order.
    pub(super) fn push(&mut self, shot: &Footprint, windows: &[u32]) {
        let bits = windows.iter().take_while(|window| **window < u64::BITS);
        self.footprints.push(&Footprint {
            windows: bits.fold(0, |bits, window| bits | 1 << window),
            ..*shot
        });
        self.windows.push(windows);
    }
}
