//! Table 2 of Shan et al. 2005 as printed, and what follows from its line periods.

use areograph::scene::plan::{IMAGES, PlannedImage};

use super::scene::{EOS_OBLIQUE, GUSEV, Held, Scene};

/// A column of the table.
pub(crate) struct Printed {
    pub(crate) id: &'static str,
    pub(crate) emission_deg: &'static str,
    pub(crate) start_utc: &'static str,
    pub(crate) exposure_ms: f64,
    pub(crate) sum: f64,
    pub(crate) header_lines: &'static str,
    pub(crate) file_lines: &'static str,
    pub(crate) file_samples: &'static str,
    pub(crate) pixel_m: &'static str,
    /// First orbit in the file of MOLA's profile.
    pub(crate) profile: u32,
    pub(crate) shots: &'static str,
    pub(crate) shot_spacing_m: &'static str,
    /// Not printed: the image's place, degrees.
    pub(crate) place_deg: [f64; 2],
    /// Not printed: lines that its row of Table 4 takes.
    pub(crate) lines: u32,
}

/// The images in the order of the table.
pub(crate) const TABLE_2: [Printed; 6] = [
    Printed {
        id: "E02-02855",
        emission_deg: "0.16",
        start_utc: "2001-03-31T18:17:09.41",
        exposure_ms: 1.8078,
        sum: 3.0,
        header_lines: "9856",
        file_lines: "9856",
        file_samples: "672",
        pixel_m: "5.5",
        profile: 19_215,
        shots: "174",
        shot_spacing_m: "305",
        place_deg: [-13.4, -41.65],
        lines: 9_856,
    },
    Printed {
        id: "E04-01275",
        emission_deg: "17.97",
        start_utc: "2001-05-18T00:48:12.50",
        exposure_ms: 1.2052,
        sum: 2.0,
        header_lines: "7424",
        file_lines: "7424",
        file_samples: "1024",
        pixel_m: "4.1",
        profile: 19_802,
        shots: "76",
        shot_spacing_m: "341",
        place_deg: [-13.4, -44.05],
        lines: 8_064,
    },
    Printed {
        id: "E02-00665",
        emission_deg: "0.2",
        start_utc: "2001-03-08T12:52:54.66",
        exposure_ms: 1.4462,
        sum: 2.0,
        header_lines: "10496",
        file_lines: "10112",
        file_samples: "1024",
        pixel_m: "4.4",
        profile: 18_933,
        shots: "142",
        shot_spacing_m: "305",
        place_deg: [-14.6, 175.3],
        lines: 10_496,
    },
    Printed {
        id: "E02-01453",
        emission_deg: "22.1",
        start_utc: "2001-03-17T18:39:14.26",
        exposure_ms: 1.4462,
        sum: 2.0,
        header_lines: "8960",
        file_lines: "8960",
        file_samples: "1024",
        pixel_m: "4.9",
        profile: 19_043,
        shots: "124",
        shot_spacing_m: "341",
        place_deg: [-14.6, 177.8],
        lines: 8_960,
    },
    Printed {
        id: "E02-01301",
        emission_deg: "13.0",
        start_utc: "2001-03-15T23:34:57.72",
        exposure_ms: 0.9642,
        sum: 2.0,
        header_lines: "8064",
        file_lines: "7680",
        file_samples: "1024",
        pixel_m: "3.3",
        profile: 19_019,
        shots: "71",
        shot_spacing_m: "340",
        place_deg: [4.5, 88.0],
        lines: 8_064,
    },
    Printed {
        id: "E02-02016",
        emission_deg: "0.2",
        start_utc: "2001-03-23T04:17:44.58",
        exposure_ms: 1.4462,
        sum: 2.0,
        header_lines: "8064",
        file_lines: "7680",
        file_samples: "1024",
        pixel_m: "4.4",
        profile: 19_117,
        shots: "107",
        shot_spacing_m: "304",
        place_deg: [4.5, 88.0],
        lines: 8_064,
    },
];

/// How fast the boresight of a nadir image runs over the ground; one held inertially runs as fast as the spacecraft
/// against the turning ground, metres per second.
pub(crate) fn ground_speed_m_s(nadir: bool) -> f64 {
    let [after_m, before_m] = [0.5, -0.5].map(|at_s| {
        if nadir {
            GUSEV.boresight_ground_m(at_s)
        } else {
            EOS_OBLIQUE.pose(at_s).position_m
        }
    });
    (after_m - before_m).norm()
}

impl Printed {
    /// Whether the camera looks down.
    pub(crate) fn nadir(&self) -> bool {
        self.emission_deg.parse::<f64>().unwrap() < 1.0
    }

    /// Time between two lines; the printed exposure is of a summed line.
    pub(crate) fn line_period_s(&self) -> f64 {
        1e-3 * self.exposure_ms
    }

    /// Distance of two lines on the ground, metres.
    pub(crate) fn line_spacing_m(&self) -> f64 {
        ground_speed_m_s(self.nadir()) * self.line_period_s()
    }

    /// Time of exposure, seconds.
    pub(crate) fn duration_s(&self) -> f64 {
        f64::from(self.lines) * self.line_period_s()
    }

    /// The image from first principles, off nadir without its roll.
    pub(crate) fn scene(&self) -> Scene {
        Scene {
            latitude_deg: self.place_deg[0],
            longitude_deg: self.place_deg[1],
            lines: self.lines,
            duration_s: self.duration_s(),
            summing: self.sum,
            held: if self.nadir() {
                Held::Nadir
            } else {
                Held::Inertial { roll_deg: 0.0 }
            },
        }
    }

    /// The same image as the synthetic mission flies it.
    pub(crate) fn flown(&self) -> &'static PlannedImage<'static> {
        IMAGES.iter().find(|image| image.id == self.id).unwrap()
    }
}
