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
    rows::{CampaignRows, PairRow, PairState, SiteRow, SiteState},
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
    /// Groups of these pairs without a common image.
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
    let pairs = pooled_pairs(&rows.pairs);
    let groups: BTreeSet<usize> = pairs.iter().map(|(_, group)| *group).collect();
    let images: Vec<_> = rows.images.iter().filter(|image| image.is_valid).collect();
    let profiles = rows.profiles.iter();
    let profiles: Vec<_> = profiles.filter(|profile| profile.is_valid).collect();
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

/// The pairs of valid sites, each once, with their groups: pairs of different groups share no image.
fn pooled_pairs(rows: &[PairRow]) -> Vec<(&PairRow, usize)> {
    let pairs: Vec<&PairRow> = rows
        .iter()
        .filter(|pair| pair.is_valid && !pair.is_repeated)
        .collect();
    let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
    let mut joined: Vec<usize> = Vec::new();
    for image in pairs.iter().flat_map(|pair| &pair.images) {
        numbers.entry(image).or_insert_with(|| {
            joined.push(joined.len());
            joined.len() - 1
        });
    }
    let ends = |pair: &PairRow| [0, 1].map(|at| numbers[&*pair.images[at]]);
    for pair in &pairs {
        let [first, second] = ends(pair).map(|image| root(&mut joined, image));
        joined[first.max(second)] = first.min(second);
    }
    pairs
        .into_iter()
        .map(|pair| (pair, root(&mut joined, ends(pair)[0])))
        .collect()
}

/// The image that represents the group of an image; every image on the way is joined to it directly.
fn root(joined: &mut [usize], image: usize) -> usize {
    let mut top = image;
    while joined[top] != top {
        top = joined[top];
    }
    let mut at = image;
    while joined[at] != top {
        at = std::mem::replace(&mut joined[at], top);
    }
    top
}
