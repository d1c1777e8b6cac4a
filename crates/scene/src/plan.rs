//! Plan of the synthetic mission: the six images of Shan et al. 2005 and the days around them.

use areograph_base::{
    body::Datum,
    time::{Et, Interval},
    units::{RADIANS_PER_DEGREE, SECONDS_PER_MS},
};
use areograph_config::usual_instrument;

/// A site that two images show.
#[derive(Debug)]
pub struct Site<'a> {
    /// Identifier, as in the site's TOML.
    pub id: &'a str,
    /// Name in the report.
    pub name: &'a str,
    /// Areocentric latitude of the image centres, IAU 2000, degrees.
    pub latitude_deg: f64,
    /// East longitude of the image centres, IAU 2000, degrees.
    pub longitude_deg: f64,
}

impl Site<'_> {
    /// Half the window's extent in latitude, degrees: 59 km in all, where the longest image has 54 km.
    pub const WINDOW_HALF_LATITUDE_DEG: f64 = 0.5;
    /// Half the window's extent in longitude, degrees.
    pub const WINDOW_HALF_LONGITUDE_DEG: f64 = 0.25;

    /// Unit vector towards the site, IAU 2000.
    #[must_use]
    pub fn direction(&self) -> nalgebra::Vector3<f64> {
        areograph_geom::ellipsoid::spherical_to_xyz_m(
            self.longitude_deg * RADIANS_PER_DEGREE,
            self.latitude_deg * RADIANS_PER_DEGREE,
            1.0,
        )
    }

    /// Whether a point in radians lies in the site's window.
    #[must_use]
    pub fn contains(&self, longitude_rad: f64, latitude_rad: f64) -> bool {
        let half_deg = [
            Self::WINDOW_HALF_LONGITUDE_DEG,
            Self::WINDOW_HALF_LATITUDE_DEG,
        ];
        self.holds(longitude_rad, latitude_rad, half_deg)
    }

    /// Whether a point in radians lies in a window of this half width and height around the site, degrees.
    #[must_use]
    pub fn holds(&self, longitude_rad: f64, latitude_rad: f64, half_deg: [f64; 2]) -> bool {
        let east_deg =
            areograph_base::units::wrap_pi(longitude_rad - self.longitude_deg * RADIANS_PER_DEGREE)
                / RADIANS_PER_DEGREE;
        let north_deg = latitude_rad / RADIANS_PER_DEGREE - self.latitude_deg;
        east_deg.abs() <= half_deg[0] && north_deg.abs() <= half_deg[1]
    }
}

/// Pointing of the camera during an image.
#[derive(Debug, Clone, Copy)]
pub enum Look {
    /// The bus at nadir; the camera's mounting leaves 0.14°.
    Nadir,
    /// The bus rolled out of nadir and held inertially.
    Roll {
        /// Emission angle at the image centre from the areocentric vertical, degrees.
        emission_deg: f64,
        /// Whether the camera looks east.
        east: bool,
    },
}

/// An image and the PEDR file of its day.
#[derive(Debug)]
pub struct PlannedImage<'a> {
    /// Product id with `-` for `/`.
    pub id: &'a str,
    /// The site it shows.
    pub site: &'a Site<'a>,
    /// UTC of the first line as published in Shan et al. 2005, Table 2.
    pub utc_start: &'a str,
    /// The first line as a clock string, rounded down to 1/256 s; this is the truth.
    pub sclk_start: &'a str,
    /// Exposure of a detector line, milliseconds.
    pub exposure_ms: f64,
    /// Detector lines and pixels summed.
    pub summing: u32,
    /// Lines exposed.
    pub lines_header: u32,
    /// Lines delivered.
    pub lines_delivered: u32,
    /// Lines by which all lines were truly exposed later than in the label; tie points show it.
    pub time_bias_lines: f64,
    /// Its pointing.
    pub look: Look,
    /// Number in the name of the day's PEDR file.
    pub pedr_number: u32,
    /// Version letter of that file.
    pub pedr_version: char,
    /// Whether that file holds a full day rather than one revolution.
    pub whole_day: bool,
}

impl PlannedImage<'_> {
    /// Whether any part of it was delivered.
    #[must_use]
    pub fn is_delivered(&self) -> bool {
        self.lines_delivered > 0
    }

    /// Time between two image lines, seconds.
    #[must_use]
    pub fn line_period_s(&self) -> f64 {
        self.exposure_ms * SECONDS_PER_MS * f64::from(self.summing)
    }

    /// Samples per line: a multiple of 16.
    #[must_use]
    pub fn samples(&self) -> u32 {
        usual_instrument().detector.pixels / self.summing / 16 * 16
    }

    /// Time of exposure when the first line begins at `start`.
    #[must_use]
    pub fn exposed(&self, start: Et) -> Interval {
        let duration_s = self.line_period_s() * f64::from(self.lines_header);
        Interval::new(start, start.plus(duration_s))
    }

    /// Datum of the day's PEDR file: version L is IAU 2000, older ones IAU 1991.
    #[must_use]
    pub fn datum(&self) -> Datum {
        if self.pedr_version == 'L' {
            Datum::Iau2000
        } else {
            Datum::Iau1991
        }
    }

    /// Name of the day's PEDR file.
    #[must_use]
    pub fn pedr_name(&self) -> String {
        format!(
            "ap{}{}.b",
            self.pedr_number,
            self.pedr_version.to_ascii_lowercase()
        )
    }

    /// Seconds of frames in that file, when full days have `day_s`.
    #[must_use]
    pub fn pedr_duration_s(&self, day_s: f64) -> f64 {
        const ONE_REVOLUTION_S: f64 = 7_056.0;
        if self.whole_day {
            day_s
        } else {
            day_s.min(ONE_REVOLUTION_S)
        }
    }
}

static EOS_CHASMA: Site = Site {
    id: "eos_chasma",
    name: "Eos Chasma",
    latitude_deg: -13.4,
    longitude_deg: 318.35,
};
static GUSEV_CRATER: Site = Site {
    id: "gusev_crater",
    name: "Gusev crater",
    latitude_deg: -14.6,
    longitude_deg: 175.3,
};
static ISIDIS: Site = Site {
    id: "isidis",
    name: "Isidis Planitia",
    latitude_deg: 4.5,
    longitude_deg: 88.0,
};

/// Beside Gusev crater, in the window of its wide-angle images.
static EAST_OF_GUSEV: Site = Site {
    id: "east_of_gusev",
    name: "east of Gusev crater",
    latitude_deg: -14.6,
    longitude_deg: 176.2,
};

/// The sites, in the order of their names.
pub static SITES: [&Site; 3] = [&EOS_CHASMA, &GUSEV_CRATER, &ISIDIS];

/// The six images in order of time.
///
/// Ids, dates, summing, lines, line periods and emission angles follow Shan et al. 2005, Table 2. For E04-01275 the
/// table gives 7 424 header lines, with which the first-order RMSE in their Table 4 would be 9.7 m instead of the
/// published 11.45 m: 8 064 are exposed, 7 424 delivered. The table does not state at which end of the ray the emission
/// angle is; it is taken at the ground, as in the archive. Line spacing over line period is 3.04 km/s for the three
/// nadir images and 3.39 to 3.42 km/s for the three that are held inertially. Exposures are line periods divided by the
/// summing. Time biases are the mean residuals of their Table 5 along the track, to half a line and with the opposite
/// sign.
pub static IMAGES: [PlannedImage; 6] = [
    PlannedImage {
        id: "E02-00665",
        site: &GUSEV_CRATER,
        utc_start: "2001-03-08T12:52:54.66",
        sclk_start: "668523205:82",
        exposure_ms: 0.7231,
        summing: 2,
        lines_header: 10_496,
        lines_delivered: 10_112,
        time_bias_lines: 26.0,
        look: Look::Nadir,
        pedr_number: 18_933,
        pedr_version: 'L',
        whole_day: true,
    },
    PlannedImage {
        id: "E02-01301",
        site: &ISIDIS,
        utc_start: "2001-03-15T23:34:57.72",
        sclk_start: "669166528:118",
        exposure_ms: 0.4821,
        summing: 2,
        lines_header: 8_064,
        lines_delivered: 7_680,
        time_bias_lines: -34.5,
        look: Look::Roll {
            emission_deg: 13.0,
            east: false,
        },
        pedr_number: 19_019,
        pedr_version: 'K',
        whole_day: false,
    },
    PlannedImage {
        id: "E02-01453",
        site: &GUSEV_CRATER,
        utc_start: "2001-03-17T18:39:14.26",
        sclk_start: "669321585:6",
        exposure_ms: 0.7231,
        summing: 2,
        lines_header: 8_960,
        lines_delivered: 8_960,
        time_bias_lines: -23.5,
        look: Look::Roll {
            emission_deg: 22.1,
            east: false,
        },
        pedr_number: 19_043,
        pedr_version: 'K',
        whole_day: false,
    },
    PlannedImage {
        id: "E02-02016",
        site: &ISIDIS,
        utc_start: "2001-03-23T04:17:44.58",
        sclk_start: "669788295:103",
        exposure_ms: 0.7231,
        summing: 2,
        lines_header: 8_064,
        lines_delivered: 7_680,
        time_bias_lines: 25.5,
        look: Look::Nadir,
        pedr_number: 19_117,
        pedr_version: 'L',
        whole_day: false,
    },
    PlannedImage {
        id: "E02-02855",
        site: &EOS_CHASMA,
        utc_start: "2001-03-31T18:17:09.41",
        sclk_start: "670529860:85",
        exposure_ms: 0.6026,
        summing: 3,
        lines_header: 9_856,
        lines_delivered: 9_856,
        time_bias_lines: 34.0,
        look: Look::Nadir,
        pedr_number: 19_215,
        pedr_version: 'K',
        whole_day: true,
    },
    PlannedImage {
        id: "E04-01275",
        site: &EOS_CHASMA,
        utc_start: "2001-05-18T00:48:12.50",
        sclk_start: "674614123:245",
        exposure_ms: 0.6026,
        summing: 2,
        lines_header: 8_064,
        lines_delivered: 7_424,
        time_bias_lines: -20.5,
        look: Look::Roll {
            emission_deg: 17.97,
            east: true,
        },
        pedr_number: 19_802,
        pedr_version: 'L',
        whole_day: false,
    },
];

/// An image that was exposed and not delivered, entirely invented. The laser profile of its day is simultaneous with no
/// image.
pub static LOST_IMAGE: PlannedImage = PlannedImage {
    id: "E02-01071",
    site: &EAST_OF_GUSEV,
    utc_start: "2001-03-12T15:31:00.00",
    sclk_start: "668878290:169",
    exposure_ms: 0.7231,
    summing: 2,
    lines_header: 10_496,
    lines_delivered: 0,
    time_bias_lines: 0.0,
    look: Look::Nadir,
    pedr_number: 18_983,
    pedr_version: 'L',
    whole_day: false,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_periods_are_those_of_table_2() {
        let printed_ms = [1.4462, 0.9642, 1.4462, 1.4462, 1.8078, 1.2052];
        for (image, printed) in IMAGES.iter().zip(printed_ms) {
            assert!(
                (image.line_period_s() * 1e3 - printed).abs() < 2e-6,
                "{}",
                image.id
            ); // ms, 4 published digits
        }
    }

    #[test]
    fn line_spacing_tells_which_images_are_off_nadir() {
        // Metres per line as published in Table 2; ground track 3.05 km/s, inertially held 3.40 km/s.
        let printed_m = [4.4, 3.3, 4.9, 4.4, 5.5, 4.1];
        for (image, spacing_m) in IMAGES.iter().zip(printed_m) {
            let speed_m_s = spacing_m / image.line_period_s();
            let off_nadir = matches!(image.look, Look::Roll { .. });
            assert_eq!(speed_m_s > 3_200.0, off_nadir, "{} {speed_m_s}", image.id);
        }
    }
}
