//! Errors that no datum of the site can show, grouped by the reason: stated with the verdict, since a valid site may
//! contain them.

use areograph_base::altimetry::GroundRadius;

use super::{Evidence, JudgedImage, beam::PER_MILLI};

/// Reason why the attitude of an image is not tested; the page uses the same words.
pub const NO_BEAM: &str = "no beam tests the attitude";

/// Errors that remain undetected for one reason.
struct Group {
    errors: Vec<String>,
    reason: String,
}

impl Group {
    fn new(reason: impl Into<String>) -> Self {
        Self {
            errors: Vec::new(),
            reason: reason.into(),
        }
    }

    fn with(mut self, error: impl Into<String>) -> Self {
        self.errors.push(error.into());
        self
    }

    /// The errors, and why nothing detects them; `None` without any.
    fn phrase(&self) -> Option<String> {
        let errors = self.errors.join("; ");
        (!errors.is_empty()).then(|| format!("{errors} ({})", self.reason))
    }
}

/// Errors that no datum of the site tests, one phrase for each reason.
pub(super) fn untested(evidence: &Evidence<'_>) -> Vec<String> {
    let is_tested = |image: &&JudgedImage| evidence.beam.tests(image.id());
    let (tested, blind): (Vec<&JudgedImage>, Vec<&JudgedImage>) =
        evidence.images.iter().partition(is_tested);
    let mut groups = if evidence.adjustment.is_none() {
        attitudes(evidence, &blind)
    } else if tested.is_empty() {
        common_attitude(evidence, &blind)
    } else {
        // Tie points test one image against the other, so that one beam suffices.
        Vec::new()
    };
    groups.extend(small_attitude(evidence, !tested.is_empty()));
    groups.extend(images(evidence));
    groups.extend(evidence.adjustment.map(|of| {
        let reason = if of.adjusted.heights.is_some() {
            "within the limit of their heights"
        } else {
            "heights absorb them"
        };
        Group::new(reason).with("errors of single tie points across the track")
    }));
    groups.push(profiles(evidence));
    groups.push(shots(evidence, !tested.is_empty()));
    groups.extend([orbit(evidence), radii(evidence), uncovered(evidence)]);
    groups.iter().filter_map(Group::phrase).collect()
}

/// Attitudes of images that no beam tests, by the reason.
fn attitudes(evidence: &Evidence<'_>, blind: &[&JudgedImage]) -> Vec<Group> {
    let mut by_reason: Vec<(String, Vec<&JudgedImage>)> = Vec::new();
    for image in blind.iter().copied() {
        let reason = no_beam(evidence, image);
        let mut known = by_reason.iter_mut();
        match known.find(|(other, _)| *other == reason) {
            Some((_, images)) => images.push(image),
            None => by_reason.push((reason, vec![image])),
        }
    }
    let groups = by_reason.into_iter().map(|(reason, images)| {
        Group::new(format!("{NO_BEAM}: {reason}")).with(format!("attitude of {}", listed(&images)))
    });
    groups.collect()
}

/// With tie points, the attitude error that all images share.
fn common_attitude(evidence: &Evidence<'_>, blind: &[&JudgedImage]) -> Vec<Group> {
    let mut reasons: Vec<String> = blind.iter().map(|image| no_beam(evidence, image)).collect();
    reasons.dedup();
    let group = Group::new(format!("{NO_BEAM}: {}", reasons.join(", ")));
    let is_shared = !blind.is_empty();
    Vec::from_iter(is_shared.then(|| group.with("an attitude error that all images share")))
}

/// The attitude error that all images may share within the limit of the beam, and the error in the place of a profile.
fn small_attitude(evidence: &Evidence<'_>, is_tested: bool) -> Option<Group> {
    let limits = evidence
        .beam
        .unnoticed(evidence.limits.correction_max_sigma);
    let [[along_rad, along_m], [across_rad, across_m]] = limits.try_into().ok()?;
    let one_m = evidence
        .beam
        .unnoticed_of_one_m(evidence.limits.correction_max_sigma)?;
    is_tested.then(|| {
        Group::new("within the limit of the beam")
            .with(format!(
                "an attitude error that all images share, up to {:.1} mrad along and {:.1} mrad across the track, {along_m:.0} and \
                 {across_m:.0} m on the ground",
                PER_MILLI * along_rad,
                PER_MILLI * across_rad
            ))
            .with(format!("an error in the position of a single profile, up to {one_m:.0} m"))
    })
}

/// Reason why no beam tests the attitude of an image.
fn no_beam(evidence: &Evidence<'_>, image: &JudgedImage) -> String {
    let beams = evidence.beam.images.iter();
    let gap = beams
        .filter(|beam| beam.image == image.id())
        .find_map(|beam| beam.beam.as_ref().err());
    match gap {
        Some(gap) => gap.to_string(),
        None if evidence.footprints.is_none() => "the site has no shots".to_owned(),
        None => "the a priori standard deviation is infinite".to_owned(),
    }
}

/// Times and cameras of images.
fn images(evidence: &Evidence<'_>) -> [Group; 3] {
    let has_ties = evidence.adjustment.is_some();
    let by_label = |image: &&JudgedImage| image.times.support.is_none();
    let (of_labels, of_support): (Vec<&JudgedImage>, Vec<&JudgedImage>) =
        evidence.images.iter().partition(by_label);
    let endless = of_labels.iter().filter(|image| !image.times.has_stop_time);
    let endless: Vec<&JudgedImage> = endless.copied().collect();
    let mut by_ties = Group::new("not observable from tie points");
    let mut without_ties = Group::new("no tie points were adjusted");
    let mut one_label = Group::new("stated by the label alone");
    if has_ties && of_labels.len() > 1 {
        by_ties = by_ties.with(
            "an error common to the start times of all images or to the lines of all tie points",
        );
    } else if !of_labels.is_empty() {
        let labels = listed(&of_labels);
        one_label = one_label.with(format!(
            "an error common to clock and UTC in the label of {labels}"
        ));
    }
    if !has_ties && !endless.is_empty() {
        let labels = listed(&endless);
        one_label = one_label.with(format!("line period of {labels} without STOP_TIME"));
    }
    if has_ties {
        by_ties = by_ties.with(
            "an error in the focal length, a bend in the detector line, or a camera distortion across the track",
        );
        if !of_support.is_empty() {
            by_ties =
                by_ties.with("an error in the first detector sample that all support data share");
        }
    } else if !evidence.images.is_empty() {
        without_ties = without_ties
            .with("rotation about the line of sight")
            .with("focal length, distortion and sample direction of the camera")
            .with("first sample and summing of the labels");
        if !of_support.is_empty() {
            without_ties = without_ties.with("line times of support data");
        }
    }
    [one_label, by_ties, without_ties]
}

/// Positions of profiles, where relief under them determines the position of the images.
fn profiles(evidence: &Evidence<'_>) -> Group {
    let group = Group::new("crossovers show differences between profiles only");
    let adjusted = evidence.adjustment.map(|of| of.adjusted);
    let relief = adjusted.and_then(|adjusted| adjusted.relief.as_ref());
    if relief.is_some_and(|relief| relief.used) {
        group.with("a horizontal shift that many profiles share")
    } else {
        group
    }
}

/// Errors that both sides of a comparison with shots contain.
fn shots(evidence: &Evidence<'_>, is_attitude_tested: bool) -> Group {
    let mut group = Group::new("common to both sides of the comparison");
    if evidence.footprints.is_some_and(|count| count > 0) {
        group = group.with("errors that ranges and radii of the shots share");
    }
    if is_attitude_tested {
        group = group.with(
            "an attitude error that the images share with the footprints, for which shot files state no attitude",
        );
    }
    group
}

/// Shots that no kernel covers: their ranges are compared with the positions of their own table alone.
fn uncovered(evidence: &Evidence<'_>) -> Group {
    let group = Group::new("no kernels cover these shots");
    let mut profiles = evidence.ranges.profiles.iter();
    if profiles.any(|profile| profile.range_minus_distance_m.n == 0 && profile.is_tested()) {
        group.with("times and positions of the spacecraft in tables of shots")
    } else {
        group
    }
}

/// The orbit, where the orbit of the shots' own files tests it.
fn orbit(evidence: &Evidence<'_>) -> Group {
    let group = Group::new("within range_check.orbit_max_m");
    if evidence.footprints.is_some_and(|count| count > 0) {
        group.with(format!(
            "an orbit error along or across the track, up to {} m",
            evidence.range_limits.orbit_max_m
        ))
    } else {
        group
    }
}

/// Radii of the ground.
fn radii(evidence: &Evidence<'_>) -> Group {
    let is_corrected = evidence.ground == Some(GroundRadius::Corrected);
    let group = Group::new("no other radius of the ground is available");
    if is_corrected {
        group.with("an error that the crossover residuals of all profiles at nadir share")
    } else {
        group
    }
}

fn listed(images: &[&JudgedImage]) -> String {
    let ids: Vec<&str> = images.iter().map(|image| image.id()).collect();
    match ids.as_slice() {
        [] | [_] | [_, _] => ids.join(" and "),
        [first, rest @ ..] => format!("{first} and {} others", rest.len()),
    }
}
