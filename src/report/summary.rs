//! The lead of a site's page: valid or not, why, and what to weigh.

use super::{
    html::{Tone, counted, list, paragraph, verdict},
    misregistration::BeforeAfter,
};
use crate::products::SiteProducts;

/// Reasons, and remarks, in the verdict; the rest is counted.
const REASONS_SHOWN: usize = 12;

/// Valid or not, why, and what to weigh: the first lines of the page.
pub(super) fn lead(site: &SiteProducts) -> String {
    let (reasons, remarks) = (&site.verdict.reasons, &site.verdict.remarks);
    let (tone, headline) = match (reasons.len(), remarks.len()) {
        (0, 0) => (
            Tone::Good,
            "Valid: every profile and image is within the limits of the configuration.".to_owned(),
        ),
        (0, 1) => (Tone::Remarks, "Valid, with one remark:".to_owned()),
        (0, count) => (Tone::Remarks, format!("Valid, with {count} remarks:")),
        (1, _) => (Tone::Bad, "Invalid, for one reason:".to_owned()),
        (count, _) => (Tone::Bad, format!("Invalid, for {count} reasons:")),
    };
    let mut body = first_of(reasons);
    if !reasons.is_empty() && !remarks.is_empty() {
        body += &paragraph("Also:");
    }
    body += &first_of(remarks);
    body += &paragraph(&counts(site));
    body += &paragraph(&together(site));
    paragraph(&site.config.description) + &verdict(tone, &headline, &body)
}

fn counts(site: &SiteProducts) -> String {
    let mut text = format!(
        "{} in {}; {}.",
        counted(site.footprints.len(), "footprint"),
        counted(site.profiles.len(), "profile"),
        counted(site.images.len(), "image")
    );
    // Of an invalid site the reasons say what is beyond its limit, and by how much.
    let nearest = nearest_limit(site).filter(|_| site.verdict.valid);
    if let Some((share, what)) = nearest {
        text += &format!(
            " Nearest to its limit: {what}, at {:.0} % of it.",
            100.0 * share
        );
    }
    text
}

/// How far apart the images see the same ground, before and after the adjustment; nothing without tie points.
fn together(site: &SiteProducts) -> String {
    let Some(geometric) = &site.geometric else {
        return String::new();
    };
    let pairs = BeforeAfter::all(geometric);
    let words = BeforeAfter::worst(&pairs).map_or_else(String::new, |pair| {
        let others = match pairs.len() {
            1 => String::new(),
            count => format!(" It is the worst of {}.", counted(count, "pair")),
        };
        pair.sentence() + &others
    });
    format!("{words} {}", super::heights::in_a_sentence(geometric))
        .trim_start()
        .to_owned()
}

/// As many sentences as leave the verdict on one screen; the manifest has all.
fn first_of(sentences: &[String]) -> String {
    let shown = &sentences[..sentences.len().min(REASONS_SHOWN)];
    let mut html = list(shown);
    if shown.len() < sentences.len() {
        let more = sentences.len() - shown.len();
        html += &paragraph(&format!(
            "And {more} more, all of them in ../manifest.json."
        ));
    }
    html
}

/// The valid figure that uses most of its limit.
fn nearest_limit(site: &SiteProducts) -> Option<(f64, String)> {
    let limits = &site.config.range_check;
    let means = site.ranges.profiles.iter().flat_map(|ranges| {
        let share = |mean_m: f64, limit_m: f64| mean_m.abs() / limit_m;
        [
            (
                share(ranges.range_minus_distance_m.mean, limits.mean_max_m),
                format!("the mean range residual of profile {}", ranges.profile),
            ),
            (
                share(ranges.decoding_m.mean, limits.decoding_max_m),
                format!("the decoding residual of profile {}", ranges.profile),
            ),
            (
                share(ranges.orbits_apart_m(), limits.orbit_max_m),
                format!(
                    "the distance of the two orbits in profile {}",
                    ranges.profile
                ),
            ),
        ]
    });
    let limits = &site.config.orientation;
    let images = site.images.iter().flat_map(|image| {
        let id = &image.times.id;
        [
            (
                image.model.second_order.position_rmse_m() / limits.position_rmse_max_m,
                format!("the position RMSE of image {id}"),
            ),
            (
                image.model.rotation_vector.rmse_rad() / limits.pointing_rmse_max_rad,
                format!("the pointing RMSE of image {id}"),
            ),
        ]
    });
    means
        .chain(images)
        .filter(|(share, _)| *share <= 1.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
}
