//! The summary of a campaign.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    phases::{PhaseSummary, phases},
    pooled::{
        HeightsPooled, ImagesPooled, MisregistrationPooled, RangesPooled, ResidualsPooled,
        RmsePooled,
    },
    rows::{CampaignRows, ImageRow, PairRow, PairState, SiteRow, SiteState},
};
use areograph_geom::uncertainty::UncertaintyBudget;

/// Numbers of sites.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SiteCounts {
    /// All.
    pub sites: u32,
    /// Valid, without remarks.
    pub valid: u32,
    /// Valid, with remarks.
    pub valid_with_remarks: u32,
    /// Invalid.
    pub invalid: u32,
    /// Last run failed.
    pub failed: u32,
    /// Without products.
    pub absent: u32,
    /// Damaged products, or products of a different version.
    pub unusable: u32,
}

impl SiteCounts {
    fn of(sites: &[SiteRow]) -> Self {
        let count = |is: &dyn Fn(&SiteRow) -> bool| {
            let count = sites.iter().filter(|site| is(site)).count();
            u32::try_from(count).unwrap_or(u32::MAX)
        };
        let in_state = |state: SiteState| count(&|site| site.state == state);
        Self {
            sites: count(&|_| true),
            valid: count(&|site| site.is_valid && site.remarks.is_empty()),
            valid_with_remarks: count(&|site| site.is_valid && !site.remarks.is_empty()),
            invalid: count(&|site| site.state == SiteState::Published && !site.is_valid),
            failed: in_state(SiteState::Failed),
            absent: in_state(SiteState::Absent),
            unusable: in_state(SiteState::Unusable),
        }
    }
}

/// Budgets of eq. 5 to 9 of Shan et al. 2005, squares averaged over the pairs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BudgetsPooled {
    /// Pairs with a budget.
    pub pairs: u32,
    /// Over all of them; without an observed misregistration where a pair has none.
    pub all: UncertaintyBudget,
    /// Pairs with a budget and footprints in both images.
    pub observed_pairs: u32,
    /// Over these pairs, with the observed misregistration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub observed: Option<UncertaintyBudget>,
}

/// Results of a campaign, pooled over its valid sites.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[schemars(
    title = "Summary of a campaign",
    description = "summary.json of areograph: results of many sites, pooled over the valid ones: Tables 2 to 5 of Shan et al. 2005, \
                   the budget of its eq. 5 to 9 with the squares averaged over the pairs, and biases of mission phases. Unknown \
                   values are omitted."
)]
pub struct CampaignSummary {
    /// Form of the document.
    #[schemars(extend("const" = "areograph campaign 1"))]
    pub format: &'static str,
    /// Name of the campaign.
    pub campaign: String,
    /// Sites by verdict.
    pub sites: SiteCounts,
    /// Rows of the table of images.
    pub image_rows: u32,
    /// Rows of the table of pairs.
    pub pair_rows: u32,
    /// Rows of the table of profiles.
    pub profile_rows: u32,
    /// Pairs that are pooled: of valid sites, each once.
    pub pairs: u32,
    /// Groups of these pairs without a common image or orbit.
    pub groups: u32,
    /// Images (Table 2).
    pub images: ImagesPooled,
    /// Range minus distance, all shots (Table 3).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ranges: Option<RangesPooled>,
    /// Range minus distance, shots that simultaneous images show (Table 3).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ranges_in_images: Option<RangesPooled>,
    /// Residuals of polynomials of order 1 and 2 (Table 4).
    pub polynomials: Vec<RmsePooled>,
    /// With the orientation from the kernels.
    pub before: StatePooled,
    /// With the adjusted orientation.
    pub after: StatePooled,
    /// Budgets before the adjustment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<BudgetsPooled>,
    /// Mission phases, with the orientation from the kernels.
    pub phases: Vec<PhaseSummary>,
}

/// Pairs with one orientation.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct StatePooled {
    /// Reprojection residuals of tie points (Table 5).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residuals: Option<ResidualsPooled>,
    /// Misregistration of footprints.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misregistration: Option<MisregistrationPooled>,
    /// Heights of tie points above the laser surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heights: Option<HeightsPooled>,
}

impl StatePooled {
    fn of<'a>(
        pairs: &[(&'a PairRow, usize)],
        of: fn(&'a PairRow) -> Option<&'a PairState>,
    ) -> Self {
        let states: Vec<&PairState> = pairs.iter().filter_map(|(pair, _)| of(pair)).collect();
        Self {
            residuals: ResidualsPooled::of(&states),
            misregistration: MisregistrationPooled::of(pairs, of),
            heights: HeightsPooled::of(pairs, of),
        }
    }
}

/// Pools the rows of a campaign.
#[must_use]
pub fn pool_sites(campaign: &str, rows: &CampaignRows) -> CampaignSummary {
    let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    let pairs = pooled_pairs(&rows.pairs, &rows.images);
    let groups: BTreeSet<usize> = pairs.iter().map(|(_, group)| *group).collect();
    let images = rows.pooled_images();
    let profiles = rows.pooled_profiles();
    CampaignSummary {
        format: "areograph campaign 1",
        campaign: campaign.to_owned(),
        sites: SiteCounts::of(&rows.sites),
        image_rows: count(rows.images.len()),
        pair_rows: count(rows.pairs.len()),
        profile_rows: count(rows.profiles.len()),
        pairs: count(pairs.len()),
        groups: count(groups.len()),
        images: ImagesPooled::of(&images),
        ranges: RangesPooled::of_all(&profiles),
        ranges_in_images: RangesPooled::of_images(&profiles),
        polynomials: RmsePooled::of(&images),
        before: StatePooled::of(&pairs, |pair| Some(&pair.before)),
        after: StatePooled::of(&pairs, |pair| pair.after.as_ref()),
        budget: budgets(&pairs),
        phases: phases(&pairs),
    }
}

fn budgets(pairs: &[(&PairRow, usize)]) -> Option<BudgetsPooled> {
    let all = pairs
        .iter()
        .filter_map(|(pair, _)| pair.budget.as_ref().ok());
    let all: Vec<UncertaintyBudget> = all.cloned().collect();
    let observed = all.iter().filter(|budget| budget.total_along_px.is_some());
    let observed: Vec<UncertaintyBudget> = observed.cloned().collect();
    let count = |of: &[UncertaintyBudget]| u32::try_from(of.len()).unwrap_or(u32::MAX);
    Some(BudgetsPooled {
        pairs: count(&all),
        all: UncertaintyBudget::pooled(&all)?,
        observed_pairs: count(&observed),
        observed: UncertaintyBudget::pooled(&observed),
    })
}

/// What pairs may share, and with it errors: images of one orbit have its position and attitude in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Shared<'a> {
    Image(&'a str),
    /// An orbit of a mission phase.
    Orbit(&'a str, u32),
}

/// The pairs of valid sites, each once, with their groups: pairs of different groups share neither an image nor an orbit.
fn pooled_pairs<'a>(rows: &'a [PairRow], images: &'a [ImageRow]) -> Vec<(&'a PairRow, usize)> {
    let pairs: Vec<&PairRow> = rows
        .iter()
        .filter(|pair| pair.is_valid && !pair.is_repeated)
        .collect();
    let orbits: BTreeMap<&str, (&str, u32)> = images
        .iter()
        .filter_map(|image| Some((&*image.image, (&*image.phase, image.orbit?))))
        .collect();
    let shared = |pair: &'a PairRow| {
        let images = pair.images.iter().map(|image| Shared::Image(image));
        let of_images = pair.images.iter().filter_map(|image| orbits.get(&**image));
        images.chain(of_images.map(|of| Shared::Orbit(of.0, of.1)))
    };
    let mut numbers: BTreeMap<Shared<'_>, usize> = BTreeMap::new();
    let mut joined: Vec<usize> = Vec::new();
    let mut first_of_pairs = Vec::new();
    for pair in pairs.iter().copied() {
        let mut top: Option<usize> = None;
        for of in shared(pair) {
            let number = *numbers.entry(of).or_insert_with(|| {
                joined.push(joined.len());
                joined.len() - 1
            });
            let own = root(&mut joined, number);
            let least = top.map_or(own, |top| top.min(own));
            joined[own] = least;
            if let Some(top) = top {
                joined[top] = least;
            }
            top = Some(least);
        }
        first_of_pairs.push(top.unwrap_or_default());
    }
    pairs
        .into_iter()
        .zip(first_of_pairs)
        .map(|(pair, first)| (pair, root(&mut joined, first)))
        .collect()
}

/// What represents the group of an image or orbit; everything on the way is joined to it directly.
fn root(joined: &mut [usize], of: usize) -> usize {
    let mut top = of;
    while joined[top] != top {
        top = joined[top];
    }
    let mut at = of;
    while joined[at] != top {
        at = std::mem::replace(&mut joined[at], top);
    }
    top
}
