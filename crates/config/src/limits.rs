//! `[limits]`.

use serde::Deserialize;

use super::{
    declare::{declare_table, key},
    forms::{above_to, from_to, whole_from_to},
};

declare_table! {
    /// Limits on shots, tie points, adjustment and terrain model, which decide whether a site is valid. Independent
    /// data are checked first: heights above the MOLA surface, then the agreement between images.
    pub struct LimitsConfig: Deserialize {
        /// Largest share of missing shots in a profile; above this limit, the site receives a remark, because much of
        /// the profile is interpolated.
        missing_shots_max: f64 = key(from_to(0.0, 1.0)).or(0.5),
        /// Largest |median| height of tie points above the MOLA surface before the adjustment. The a priori height of a
        /// pair is known to about 500 m; the default is five times this value.
        height_before_max_m: f64 = key(above_to(0.0, 1e6)).or(2500.0),
        /// Largest |median| height of tie points above the MOLA surface after the adjustment, unless the median is
        /// within three of its own standard deviations.
        height_after_max_m: f64 = key(above_to(0.0, 1e6)).or(10.0),
        /// Largest share of tie points that are more than 3.29 of their standard deviations from the MOLA surface.
        height_outliers_max: f64 = key(from_to(0.0, 1.0)).or(0.1),
        /// Largest mean difference between the surfaces of single profiles at the tie points, in units of its standard
        /// deviation: contradictory profiles provide no control.
        profiles_apart_max_sigma: f64 = key(above_to(0.0, 1000.0)).or(4.0),
        /// Largest correction of an image's position or pointing by the adjustment, in units of its a priori standard
        /// deviation. Up to 1.5 times this limit, drift and bend of the attitude cause only a remark, because tie
        /// points determine them.
        correction_max_sigma: f64 = key(above_to(0.0, 1000.0)).or(4.0),
        /// Largest along-track parallax of two images at their tie points before the adjustment. Shan et al. 2005 found
        /// 225 to 271 m; the default corresponds to the rotation of the attitude in 3 s.
        parallax_before_max_m: f64 = key(above_to(0.0, 1e6)).or(1000.0),
        /// Largest along-track parallax of two images at their tie points after the adjustment: six MOC lines at the
        /// usual spacing of 4 m.
        parallax_after_max_m: f64 = key(above_to(0.0, 1e6)).or(25.0),
        /// Largest standard deviation of unit weight of the tie points along and across the track.
        sigma0_max: f64 = key(above_to(0.0, 1000.0)).or(1.5),
        /// Smallest number of tie points in a sound adjustment.
        ties_min: u32 = key(whole_from_to(0, 1_000_000)).or(10),
        /// Smallest share of the common ground for which a terrain model must have heights.
        surface_filled_min: f64 = key(from_to(0.0, 1.0)).or(0.2),
        /// Largest robust spread of altimeter shots about a terrain model, in units of their standard deviation.
        surface_spread_max_sigma: f64 = key(above_to(0.0, 1000.0)).or(3.0),
        /// Largest share of rejected tie points in a sound adjustment; above one half, the site is invalid.
        rejected_share_max: f64 = key(from_to(0.0, 1.0)).or(0.1),
    }
}
