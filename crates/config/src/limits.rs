//! `[limits]`.

use serde::Deserialize;

use super::{
    declare::{declare_table, key},
    forms::{above_to, from_to, whole_from_to},
};

declare_table! {
    /// Limits on shots, tie points, their adjustment and a terrain model that make a site valid or invalid. Independent data
    /// are checked first: heights against MOLA, then the agreement of images with each other.
    pub struct LimitsConfig: Deserialize {
        /// Largest share of the pulses of a profile without a shot; above it most of the profile is interpolated, and the
        /// site receives a remark.
        missing_shots_max: f64 = key(from_to(0.0, 1.0)).or(0.5),
        /// Largest |median| height of tie points above the MOLA surface before the adjustment. A priori the height of a
        /// pair is known to some 500 m; the default is five times that.
        height_before_max_m: f64 = key(above_to(0.0, 1e6)).or(2500.0),
        /// Largest |median| height of tie points above the MOLA surface after the adjustment, where it is not within
        /// three of its own standard deviations.
        height_after_max_m: f64 = key(above_to(0.0, 1e6)).or(10.0),
        /// Largest share of tie points farther from the MOLA surface than 3.29 of their standard deviations.
        height_outliers_max: f64 = key(from_to(0.0, 1.0)).or(0.1),
        /// Largest mean difference between the surfaces of single profiles at the tie points, in its standard
        /// deviations: profiles that contradict each other are no control.
        profiles_apart_max_sigma: f64 = key(above_to(0.0, 1000.0)).or(4.0),
        /// Largest correction of an image's position or pointing by the adjustment, in its standard deviations.
        /// Drift and bend of the attitude up to 1.5 times as large are a remark, because tie points determine them.
        correction_max_sigma: f64 = key(above_to(0.0, 1000.0)).or(4.0),
        /// Largest distance along the flight between two images at their tie points before the adjustment. Shan et
        /// al. 2005 find 225 to 271 m; the default corresponds to the rotation of the attitude in 3 s.
        parallax_before_max_m: f64 = key(above_to(0.0, 1e6)).or(1000.0),
        /// Largest distance along the flight between two images at their tie points after the adjustment: six lines of
        /// MOC's usual 4 m.
        parallax_after_max_m: f64 = key(above_to(0.0, 1e6)).or(25.0),
        /// Largest standard deviation of unit weight of the tie points along and across the track.
        sigma0_max: f64 = key(above_to(0.0, 1000.0)).or(1.5),
        /// Fewest tie points of a sound adjustment.
        ties_min: u32 = key(whole_from_to(0, 1_000_000)).or(10),
        /// Least share of the common ground for which a terrain model must have heights.
        surface_filled_min: f64 = key(from_to(0.0, 1.0)).or(0.2),
        /// Largest robust spread of the altimeter's shots about a terrain model, in their standard deviations.
        surface_spread_max_sigma: f64 = key(above_to(0.0, 1000.0)).or(3.0),
        /// Largest share of rejected tie points in a sound adjustment; above one half the site is invalid.
        rejected_share_max: f64 = key(from_to(0.0, 1.0)).or(0.1),
    }
}
