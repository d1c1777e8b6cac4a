//! Pairs, images and profiles that several sites of a campaign have: each counts once.

use std::collections::{BTreeMap, BTreeSet};

use super::rows::{CampaignRows, ImageRow, ProfileRow};

impl CampaignRows {
    /// Marks the rows of valid sites whose pair, image or profile another row of a valid site has.
    ///
    /// Windows of sites with a common image have its outline in common, and with it shots of every orbit that crosses it:
    /// of such sites, one counts for each orbit, and one whose window has the image of this orbit precedes others. Sites that
    /// overlap without a common image may still have shots in common, which rows do not show.
    pub fn mark_repeated(&mut self) {
        let mut pairs: BTreeSet<[String; 2]> = BTreeSet::new();
        for pair in &mut self.pairs {
            let mut images = pair.images.clone();
            images.sort_unstable();
            pair.is_repeated = pair.is_valid && !pairs.insert(images);
        }
        let first = self.first_profiles();
        for (at, row) in self.profiles.iter_mut().enumerate() {
            row.is_repeated = row.is_valid && !first.contains(&at);
        }
        let mut images: BTreeSet<&str> = BTreeSet::new();
        for row in &mut self.images {
            row.is_repeated = row.is_valid && !images.insert(&row.image);
        }
    }

    /// The images of valid sites, each once.
    #[must_use]
    pub fn pooled_images(&self) -> Vec<&ImageRow> {
        let images = self.images.iter();
        images
            .filter(|row| row.is_valid && !row.is_repeated)
            .collect()
    }

    /// The profiles of valid sites, each once, in the order of their rows.
    #[must_use]
    pub fn pooled_profiles(&self) -> Vec<&ProfileRow> {
        let profiles = self.profiles.iter();
        profiles
            .filter(|row| row.is_valid && !row.is_repeated)
            .collect()
    }

    /// Places of the rows of valid profiles that count.
    fn first_profiles(&self) -> BTreeSet<usize> {
        let mut images: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for image in &self.images {
            images.entry(&image.site).or_default().insert(&image.image);
        }
        let has_common = |one: &str, other: &str| {
            let both = images.get(one).zip(images.get(other));
            both.is_some_and(|(one, other)| !one.is_disjoint(other))
        };
        let mut counted: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for is_simultaneous in [true, false] {
            let rows = self.profiles.iter().enumerate();
            let rows = rows.filter(|(_, row)| row.is_valid);
            for (at, row) in rows.filter(|(_, row)| row.image.is_empty() != is_simultaneous) {
                let of_orbit = counted.entry(row.orbit).or_default();
                // A site has each of its profiles once.
                let is_repeated = of_orbit.iter().any(|earlier| {
                    let site = &self.profiles[*earlier].site;
                    *site != row.site && has_common(site, &row.site)
                });
                if !is_repeated {
                    of_orbit.push(at);
                }
            }
        }
        counted.into_values().flatten().collect()
    }
}
