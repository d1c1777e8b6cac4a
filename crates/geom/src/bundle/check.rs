//! Checks of values and indices before a network is adjusted.

use super::{BundleError, CommonBus, CommonPass, Network, Part, Spot, View, unknowns::is_weighted};
use crate::pushbroom::ExteriorOrientation;

/// # Errors
/// The first invalid value, the first index without a target.
pub(super) fn check<M: ExteriorOrientation>(network: &Network<M>) -> Result<(), BundleError> {
    for (index, image) in network.images.iter().enumerate() {
        let part = Part::Image(index);
        positive(part, "half the number of lines", image.half_lines)?;
        positive(part, "line period", image.line_period_s)?;
        positive(part, "focal length", image.focal_length_px)?;
        deviation(
            part,
            "standard deviation of the time bias",
            image.time_bias_sigma_s,
        )?;
        for sigma in image.sigmas {
            deviation(part, "standard deviation of an orientation unknown", sigma)?;
        }
        let (pose, motion) = image.base.pose_and_rate(0.0);
        for vector in [pose.position_m, motion.advance_m, motion.turn_rad] {
            for component in &vector {
                finite(part, "initial orientation", *component)?;
            }
        }
    }
    for (index, expected_m) in network.expected_m.iter().enumerate() {
        let part = Part::Image(index);
        for component in expected_m {
            finite(part, "expected position", *component)?;
        }
    }
    if let Some(clock) = &network.attitude_clock {
        let part = Part::Images;
        let what = "standard deviation of the attitude clock offset";
        deviation(part, what, clock.sigma_s)?;
        if clock.turns_rad_s.len() != network.images.len() {
            let missing = Part::Image(clock.turns_rad_s.len());
            return Err(BundleError::Unmatched { part, missing });
        }
        for component in clock.turns_rad_s.iter().flatten() {
            finite(part, "inertial rotation rate", *component)?;
        }
    }
    for pass in &network.passes {
        check_pass(network, pass)?;
    }
    if let Some(bus) = &network.common_bus {
        check_bus(network, bus)?;
    }
    for (index, sigma_m) in network.range_bias_sigmas_m.iter().enumerate() {
        let part = Part::Profile(index);
        deviation(part, "standard deviation of the range bias", *sigma_m)?;
    }
    for (index, point) in network.points.iter().enumerate() {
        let part = Part::Point(index);
        for axis in 0..3 {
            finite(part, "initial coordinate", point.ground_m[axis])?;
            if let Some(known) = &point.known {
                positive(part, "standard deviation", known.sigma_m[axis])?;
            }
        }
    }
    for (index, view) in network.views.iter().enumerate() {
        check_view(network, Part::View(index), view)?;
    }
    for (index, range) in network.ranges.iter().enumerate() {
        let part = Part::Range(index);
        matched(network, part, range.point, range.image)?;
        if range.profile >= network.range_bias_sigmas_m.len() {
            let missing = Part::Profile(range.profile);
            return Err(BundleError::Unmatched { part, missing });
        }
        finite(part, "line", range.x_lines)?;
        positive(part, "distance", range.range_m)?;
        positive(part, "standard deviation", range.sigma_m)?;
    }
    Ok(())
}

fn check_view<M>(network: &Network<M>, part: Part, view: &View) -> Result<(), BundleError> {
    matched(network, part, view.point, view.image)?;
    finite(part, "line", view.x_lines)?;
    finite(part, "position in the line", view.y_px)?;
    positive(part, "standard deviation", view.sigma_px.x)?;
    positive(part, "standard deviation", view.sigma_px.y)
}

fn check_pass<M>(network: &Network<M>, pass: &CommonPass) -> Result<(), BundleError> {
    let part = Part::Images;
    let images = network.images.len();
    if let Some(image) = pass.images.iter().find(|image| **image >= images) {
        let missing = Part::Image(*image);
        return Err(BundleError::Unmatched { part, missing });
    }
    let is_used =
        |image: usize, constant: usize| is_weighted(network.images[image].sigmas[3 * constant]);
    pass.without_factor(is_used).map_or(Ok(()), |value| {
        Err(BundleError::Value {
            part,
            what: "the smallest eigenvalue of the a priori correlations of one pass",
            value,
            expected: "a positive number",
        })
    })
}

fn check_bus<M>(network: &Network<M>, bus: &CommonBus) -> Result<(), BundleError> {
    let part = Part::Images;
    let what = "standard deviation of the laser boresight";
    for sigma_rad in bus.boresight.sigmas_rad() {
        deviation(part, what, sigma_rad)?;
    }
    for angle_rad in &bus.boresight.angles_rad {
        finite(part, "a priori laser boresight", *angle_rad)?;
    }
    let determinant = bus.boresight.covariance_rad2.determinant();
    let what = "determinant of the covariance of the laser boresight";
    deviation(part, what, determinant)?;
    let what = "standard deviation of the line-time offset relative to the laser";
    deviation(part, what, bus.line_time_sigma_s)?;
    if bus.profiles.len() != network.range_bias_sigmas_m.len() {
        let missing = Part::Profile(bus.profiles.len().min(network.range_bias_sigmas_m.len()));
        return Err(BundleError::Unmatched { part, missing });
    }
    for (index, profile) in bus.profiles.iter().enumerate() {
        for sigma_m in &profile.sigma_m {
            let what = "standard deviation of the position";
            deviation(Part::Profile(index), what, *sigma_m)?;
        }
        if let Some(shared) = &profile.shared {
            let part = Part::Profile(index);
            matched(network, part, 0, shared.image)?;
            for by_rotation_m in &shared.by_rotation_m {
                finite(part, "offset due to image rotation", *by_rotation_m)?;
            }
        }
    }
    for (point, profile) in &bus.recorded {
        let part = Part::Point(*point);
        matched(network, part, *point, 0)?;
        if *profile >= bus.profiles.len() {
            let missing = Part::Profile(*profile);
            return Err(BundleError::Unmatched { part, missing });
        }
    }
    for (index, Spot { view, .. }) in bus.spots.iter().enumerate() {
        check_view(network, Part::Spot(index), view)?;
    }
    Ok(())
}

fn value(
    part: Part,
    what: &'static str,
    value: f64,
    valid: bool,
    expected: &'static str,
) -> Result<(), BundleError> {
    if valid {
        Ok(())
    } else {
        Err(BundleError::Value {
            part,
            what,
            value,
            expected,
        })
    }
}

fn positive(part: Part, what: &'static str, number: f64) -> Result<(), BundleError> {
    let valid = number > 0.0 && number.is_finite();
    value(part, what, number, valid, "a positive number")
}

fn finite(part: Part, what: &'static str, number: f64) -> Result<(), BundleError> {
    value(part, what, number, number.is_finite(), "a finite number")
}

fn deviation(part: Part, what: &'static str, sigma: f64) -> Result<(), BundleError> {
    value(part, what, sigma, sigma >= 0.0, "0 or more")
}

fn matched<M>(
    network: &Network<M>,
    part: Part,
    point: usize,
    image: usize,
) -> Result<(), BundleError> {
    if point >= network.points.len() {
        let missing = Part::Point(point);
        return Err(BundleError::Unmatched { part, missing });
    }
    if image >= network.images.len() {
        let missing = Part::Image(image);
        return Err(BundleError::Unmatched { part, missing });
    }
    Ok(())
}
