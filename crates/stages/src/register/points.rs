//! Points of an image as columns, and statistics of each profile.

use serde::{Deserialize, Serialize};

use super::methods::{Method, MethodRun};
use areograph_base::column::Column;
use areograph_geom::pushbroom::CameraModel;

macro_rules! columns {
    ($($(#[$doc:meta])* $column:ident: $kind:ty,)*) => {
        /// Place of one footprint in an image.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct PointOnImage { $($(#[$doc])* pub $column: $kind,)* }

        /// Footprints in an image, one entry per point in every column.
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
        pub struct RegisteredPoints {
            /// Index of the profile.
            pub profile: Column<u32>,
            /// Row of the footprint.
            pub row: Column<u32>,
            $($(#[$doc])* pub $column: Column<$kind>,)*
            /// Evaluations of the frame-first iteration with the second-order model; 0 where it was not
            /// tried (outside the image's lines) or does not converge.
            pub evaluations_frame_first: Column<u32>,
            /// Evaluations of the fixed-point iteration, eq. 4 of Shan et al. 2005; 0 in the same cases.
            pub evaluations_fixed_point: Column<u32>,
        }

        impl RegisteredPoints {
            pub(super) fn push(&mut self, profile: u32, row: u32, point: &PointOnImage) {
                self.profile.push(profile);
                self.row.push(row);
                $(self.$column.push(point.$column);)*
                self.evaluations_frame_first.push(0);
                self.evaluations_fixed_point.push(0);
            }
        }
    };
}

columns! {
    /// Line coordinate: 0 at the start of the first line, 0.5 at its centre.
    line: f64,
    /// Sample coordinate: 0 at the outer edge of the first pixel, 0.5 at its centre.
    sample: f64,
    /// Line in the delivered file as ISIS sees it, 1 at the centre of the first line; 0 where the file does not show the
    /// point to ISIS.
    isis_line: f64,
    /// Its sample, in the same way.
    isis_sample: f64,
    /// Line offset from the middle of the header image, lines.
    line_offset: f64,
    /// Across-track focal-plane coordinate from the boresight, image pixels (against the samples).
    y_px: f64,
    /// Distance from the camera, metres.
    range_m: f64,
    /// Along-track focal-plane coordinate at the solution, image pixels: the residual of the iteration.
    residual_px: f64,
    /// Last step of the iteration, lines.
    step_lines: f64,
    /// Evaluations of the orientation.
    evaluations: u32,
    /// Whether the delivered image shows the point.
    inside: bool,
    /// Whether the point lies beyond the first or last header line, where the orientation is extrapolated.
    extrapolated: bool,
}

/// One profile in an image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ProfileOnImage {
    /// Points that have a line.
    pub points: u32,
    /// Points that the delivered image shows.
    pub inside: u32,
    /// Median distance in lines of successive shots within the image's lines; `None` for fewer than two.
    pub shot_spacing_lines: Option<f64>,
}

impl RegisteredPoints {
    /// Number of points.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.row.len()
    }

    /// Whether it has no points.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.row.is_empty()
    }

    /// Points that the delivered image shows.
    #[must_use]
    pub fn inside_count(&self) -> usize {
        self.inside.iter().filter(|inside| *inside).count()
    }

    /// Indices of the points within the image's lines.
    pub(super) fn on_lines(&self) -> Vec<usize> {
        let points = self.extrapolated.iter().enumerate();
        points
            .filter(|(_, extrapolated)| !*extrapolated)
            .map(|(index, _)| index)
            .collect()
    }

    /// Stores the evaluations of `method` with the second-order model for the points `on_lines`.
    pub(super) fn count(
        &mut self,
        method: Method,
        on_lines: &[usize],
        runs: &[(MethodRun, Vec<u32>)],
    ) {
        let column = match method {
            Method::FrameFirst => &mut self.evaluations_frame_first,
            Method::FixedPoint => &mut self.evaluations_fixed_point,
        };
        let run = runs
            .iter()
            .find(|(run, _)| run.method == method && run.model == CameraModel::SecondOrder);
        let mut counted = on_lines.iter().zip(run.iter().flat_map(|(_, each)| each));
        let mut next = counted.next();
        *column = column.changed(|index, before| match next {
            Some((at, evaluations)) if *at == index => {
                next = counted.next();
                *evaluations
            }
            _ => before,
        });
    }
}

/// Statistics of each of `count` profiles.
pub(super) fn on_image(points: &RegisteredPoints, count: usize) -> Vec<ProfileOnImage> {
    let mut profiles = vec![ProfileOnImage::default(); count];
    let mut spacings: Vec<Vec<f64>> = vec![Vec::new(); count];
    for index in 0..points.len() {
        let profile = points.profile.at(index) as usize;
        profiles[profile].points += 1;
        profiles[profile].inside += u32::from(points.inside.at(index));
        let follows = index > 0
            && points.profile.at(index - 1) == points.profile.at(index)
            && !points.extrapolated.at(index - 1)
            && !points.extrapolated.at(index);
        if follows {
            spacings[profile].push((points.line.at(index) - points.line.at(index - 1)).abs());
        }
    }
    for (profile, spacings) in profiles.iter_mut().zip(&mut spacings) {
        spacings.sort_by(f64::total_cmp);
        profile.shot_spacing_lines = spacings.get(spacings.len() / 2).copied();
    }
    profiles
}
