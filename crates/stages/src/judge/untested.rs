//! Errors that no datum of the site can show: stated with the verdict, since a valid site may contain them.

use super::{Evidence, JudgedImage};

/// What nothing tested, one phrase each.
pub(super) fn untested(evidence: &Evidence<'_>) -> Vec<String> {
    let mut phrases: Vec<String> = attitude(evidence).into_iter().collect();
    let of_labels: Vec<&JudgedImage> = evidence
        .images
        .iter()
        .filter(|image| image.times.support.is_none())
        .collect();
    let of_support = evidence.images.len() - of_labels.len();
    let has_ties = evidence.adjustment.is_some();
    if !of_labels.is_empty() {
        phrases.push(match (has_ties, of_labels.len()) {
            (true, 2..) => "an error that the start times of all images share".to_owned(),
            _ => format!(
                "an error that clock and UTC in the label of {} share",
                listed(&of_labels)
            ),
        });
    }
    let endless = of_labels
        .into_iter()
        .filter(|image| !image.times.has_stop_time);
    let endless: Vec<&JudgedImage> = endless.collect();
    if !has_ties && !endless.is_empty() {
        phrases.push(format!(
            "line period of {}: no STOP_TIME is stated",
            listed(&endless)
        ));
    }
    if of_support > 0 && !has_ties {
        phrases.push("line times of support data".to_owned());
    }
    if !evidence.images.is_empty() {
        phrases.push(
            if has_ties {
                "focal length, whose error tie points absorb"
            } else {
                "rotation about the line of sight; camera: focal length, distortion, direction of the samples"
            }
            .to_owned(),
        );
    }
    if evidence.footprints.is_some_and(|count| count > 0) {
        phrases.push("errors that ranges and radii of the shots share".to_owned());
    }
    phrases
}

/// Attitudes that no beam tests: with tie points, which test one image against the other, only if no image has one.
fn attitude(evidence: &Evidence<'_>) -> Option<String> {
    let is_tested = |image: &&JudgedImage| evidence.beam.tests(image.id());
    let (tested, blind): (Vec<&JudgedImage>, Vec<&JudgedImage>) =
        evidence.images.iter().partition(is_tested);
    let first = blind.first()?;
    if evidence.adjustment.is_some() && !tested.is_empty() {
        return None;
    }
    let gaps = evidence.beam.images.iter();
    let gap = gaps
        .filter(|of| of.image == first.id())
        .find_map(|of| of.beam.as_ref().err());
    let why = match gap {
        Some(gap) => gap.to_string(),
        None if evidence.footprints.is_none() => "the site has no shots".to_owned(),
        None => "its a priori standard deviation is infinite".to_owned(),
    };
    let whose = if evidence.adjustment.is_some() {
        "attitude error that all images share".to_owned()
    } else {
        format!("attitude of {}", listed(&blind))
    };
    Some(format!("{whose}: {why}"))
}

fn listed(images: &[&JudgedImage]) -> String {
    let ids: Vec<&str> = images.iter().map(|image| image.id()).collect();
    match ids.as_slice() {
        [] | [_] | [_, _] => ids.join(" and "),
        [first, rest @ ..] => format!("{first} and {} others", rest.len()),
    }
}
