//! Columns and headings in their groups.

use super::edit::{fixed, integer};

/// The program whose format the table follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// The MOLA team's: off-nadir angle in 7 columns, packet and orbit in 6.
    Team,
    /// The port of the USGS: 8, and 7 and 8 columns; times from the integers, some sums in a different order.
    Usgs,
}

/// The values of one line, in the units of the columns.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Row {
    pub longitude_deg: f64,
    pub latitude_deg: f64,
    pub topography_m: f64,
    pub range_m: f64,
    pub radius_m: f64,
    pub channel: i64,
    pub flag: i64,
    pub spacecraft_longitude_deg: f64,
    pub spacecraft_latitude_deg: f64,
    pub spacecraft_radius_m: f64,
    pub off_nadir_deg: f64,
    pub et_s: f64,
    pub areographic_latitude_deg: f64,
    pub areoid_radius_m: f64,
    pub shot: i64,
    pub packet: i64,
    pub orbit: i64,
    pub orbit_model: i64,
    pub local_hour: f64,
    pub phase_deg: f64,
    pub incidence_deg: f64,
    pub emission_deg: f64,
    pub range_correction_m: f64,
    pub pulse_width: f64,
    pub optical_width: f64,
    pub transmit_energy: f64,
    pub received_energy: f64,
    pub reflectivity: f64,
    pub background: i64,
    pub threshold_mv: f64,
    pub width_counts: i64,
    pub energy_counts: i64,
    pub range_window_m: f64,
    pub range_delay_m: f64,
}

/// Heading and rule of each group of the team's program.
const HEADINGS: [[&str; 2]; 8] = [
    [
        "long_East lat_North topography MOLArange  planet_rad c A",
        "---.-----  --.-----  ------.-- ------.-- --------.-- - -",
    ],
    [
        "  SC_long   SC_lat     SC_radius",
        " ---.----- ---.----- --------.--",
    ],
    [
        " offndr  EphemerisTime  areod_lat areoid_rad",
        " --.--- ---------------  --.-----  ------.--",
    ],
    [" shot pkt  orbit gm", " ---  ---- ----- --"],
    [" hrlcl  s_phas s_inc ", " --.--- ---.-- ---.--"],
    [
        " emissn  Rcorr     PWT  Sigopt  Elaser PulseE Ref*T%",
        " ---.--  -----   ---.-  ------   ----- ------ --.---",
    ],
    ["  bkgrd th_mV Wct Ect", "  ----- ------ -- ---"],
    [" R_wnd   R_dly ", " ------ -------"],
];
/// Groups 2 and 3 of the USGS.
const USGS_HEADINGS: [[&str; 2]; 2] = [
    [
        "  offndr  EphemerisTime  areod_lat areoid_rad",
        " ---.--- ---------------  --.-----  ------.--",
    ],
    [" shot  pkt   orbit gm", " ---  ----- ------ --"],
];

impl Variant {
    /// The two lines of headings.
    pub(super) fn headings(self, groups: [bool; 8]) -> String {
        let mut lines = String::new();
        for line in 0..2 {
            for (group, _) in groups.iter().enumerate().filter(|(_, printed)| **printed) {
                let heading = match (self, group) {
                    (Self::Usgs, 2 | 3) => USGS_HEADINGS[group - 2],
                    _ => HEADINGS[group],
                };
                lines.push_str(heading[line]);
            }
            lines.push('\n');
        }
        lines
    }

    /// Appends the line of a shot.
    pub(super) fn line(self, text: &mut String, groups: [bool; 8], row: &Row) {
        for (group, _) in groups.iter().enumerate().filter(|(_, printed)| **printed) {
            self.group(text, group, row);
        }
        text.push('\n');
    }

    fn group(self, text: &mut String, group: usize, row: &Row) {
        let wide = self == Self::Usgs;
        match group {
            0 => {
                fixed(text, row.longitude_deg, 9, 5);
                fixed(text, row.latitude_deg, 10, 5);
                fixed(text, row.topography_m, 11, 2);
                fixed(text, row.range_m, 10, 2);
                fixed(text, row.radius_m, 12, 2);
                integer(text, row.channel, 2);
                integer(text, row.flag, 2);
            }
            1 => {
                fixed(text, row.spacecraft_longitude_deg, 10, 5);
                fixed(text, row.spacecraft_latitude_deg, 10, 5);
                fixed(text, row.spacecraft_radius_m, 12, 2);
            }
            2 => {
                fixed(text, row.off_nadir_deg, if wide { 8 } else { 7 }, 3);
                fixed(text, row.et_s, 16, 5);
                fixed(text, row.areographic_latitude_deg, 10, 5);
                fixed(text, row.areoid_radius_m, 11, 2);
            }
            3 => {
                integer(text, row.shot, 4);
                integer(text, row.packet, if wide { 7 } else { 6 });
                integer(text, row.orbit, if wide { 8 } else { 6 });
                integer(text, row.orbit_model, 3);
            }
            4 => {
                fixed(text, row.local_hour, 7, 3);
                fixed(text, row.phase_deg, 7, 2);
                fixed(text, row.incidence_deg, 7, 2);
            }
            5 => {
                fixed(text, row.emission_deg, 7, 2);
                fixed(text, row.range_correction_m, 7, 2);
                fixed(text, row.pulse_width, 8, 1);
                fixed(text, row.optical_width, 8, 1);
                fixed(text, row.transmit_energy, 8, 2);
                fixed(text, row.received_energy, 7, 0);
                fixed(text, row.reflectivity, 7, 3);
            }
            6 => {
                integer(text, row.background, 7);
                fixed(text, row.threshold_mv, 7, 1);
                integer(text, row.width_counts, 3);
                integer(text, row.energy_counts, 4);
            }
            _ => {
                fixed(text, row.range_window_m, 7, 0);
                fixed(text, row.range_delay_m, 8, 0);
            }
        }
    }
}
