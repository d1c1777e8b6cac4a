//! What a campaign selects, and how its sites ended, as lines or JSON.

use std::process::ExitCode;

use serde_json::{Value, json};

use crate::{
    cli::{output, pool::cores, progress::duration},
    error::Kind,
    flow::{Campaign, CampaignAnswer, Costs, End, SiteEnd},
    service::words::counted,
};

/// Failures and invalid sites, and sites left out, that are printed; all are counted.
const PRINTED_MAX: usize = 10;
const BYTES_PER_GB: f64 = 1e9;

/// Prints how the sites ended; a failure outranks an invalid site.
pub(super) fn ended(
    campaign: &Campaign,
    ended: &[SiteEnd],
    results: &CampaignAnswer,
    as_json: bool,
) -> ExitCode {
    let count = |is: &dyn Fn(&SiteEnd) -> bool| ended.iter().filter(|of| is(of)).count();
    let valid = count(&SiteEnd::is_valid);
    let failed = count(&|of| of.failure().is_some());
    let invalid = ended.len() - valid - failed;
    let unchanged = count(&|of| {
        matches!(
            of.end,
            End::Products {
                unchanged: true,
                ..
            }
        )
    });
    let name = &campaign.config.campaign;
    if as_json {
        output::json(&json!({
            "campaign": name,
            "selected_images": campaign.images.len(),
            "excluded_images": campaign.excluded,
            "counts": {"valid": valid, "invalid": invalid, "failed": failed, "unchanged": unchanged},
            "sites": ended,
            "left_out": left_out(campaign),
            "results": results.to_json(),
        }));
    } else {
        let sites = counted(ended.len(), "site");
        output::line(format_args!(
            "{name}: {sites}: {valid} valid, {invalid} invalid, {failed} failed; {unchanged} unchanged",
        ));
        print_not_valid(ended);
        print_left_out(campaign);
        output::line(format_args!(
            "  tables and page of all sites: {}",
            results.page.display()
        ));
    }
    let failure = ended.iter().find_map(SiteEnd::failure);
    let invalid = (invalid > 0).then_some(Kind::Validation.exit_code());
    ExitCode::from(failure.or(invalid).unwrap_or(0))
}

/// Prints failures in full, and the first reason of invalid sites.
fn print_not_valid(ended: &[SiteEnd]) {
    let not_valid = || ended.iter().filter(|of| !of.is_valid());
    for of in not_valid().take(PRINTED_MAX) {
        match &of.end {
            End::Failed { text, .. } => output::error(text),
            End::Products { reasons, .. } => output::line(format_args!(
                "  {}: invalid: {}",
                of.site,
                reasons.first().map_or("", |reason| reason)
            )),
        }
    }
    let more = not_valid().count().saturating_sub(PRINTED_MAX);
    if more > 0 {
        let more = counted(more, "further site");
        output::line(format_args!("  {more}: --json lists all"));
    }
}

fn left_out(campaign: &Campaign) -> Vec<Value> {
    let left_out = campaign.left_out.iter();
    left_out
        .map(|of| json!({"site": of.site, "because": of.lack}))
        .collect()
}

fn print_left_out(campaign: &Campaign) {
    if campaign.left_out.is_empty() {
        return;
    }
    let count = counted(campaign.left_out.len(), "site");
    output::line(format_args!(
        "  {count} left out, because a file is missing:"
    ));
    for of in campaign.left_out.iter().take(PRINTED_MAX) {
        output::line(format_args!("    {}: {}", of.site, of.lack));
    }
    let more = campaign.left_out.len().saturating_sub(PRINTED_MAX);
    if more > 0 {
        let more = counted(more, "further site");
        output::line(format_args!("    {more}: --json lists all"));
    }
}

/// Prints what the rules select, and what it costs.
pub(super) fn plan(campaign: &Campaign, costs: Option<Costs>, jobs: u16, as_json: bool) {
    let pairs = campaign.sites.iter().filter(|site| site.images.len() > 1);
    let pairs = pairs.count();
    let singles = campaign.sites.len() - pairs;
    let name = &campaign.config.campaign;
    if as_json {
        let sites = campaign.sites.iter().map(|site| {
            let images = site.images.iter();
            let ids = images.map(|number| &*campaign.images[*number].image.product_id);
            json!({"site": site.id, "images": ids.collect::<Vec<_>>()})
        });
        output::json(&json!({
            "campaign": name,
            "selected_images": campaign.images.len(),
            "excluded_images": campaign.excluded,
            "pairs": pairs,
            "single_images": singles,
            "input": campaign.input_size(),
            "processed": costs,
            "sites": sites.collect::<Vec<_>>(),
            "left_out": left_out(campaign),
        }));
        return;
    }
    output::line(format_args!(
        "{name}: {} of {} selected; {} of two images, {} of one image",
        campaign.images.len(),
        counted(campaign.images.len() + campaign.excluded, "image"),
        counted(pairs, "site"),
        counted(singles, "site"),
    ));
    print_size(campaign, costs, jobs);
    print_left_out(campaign);
}

/// Prints the size of the input, and the estimated costs.
fn print_size(campaign: &Campaign, costs: Option<Costs>, jobs: u16) {
    let size = campaign.input_size();
    let mut input = Vec::new();
    if size.image_files > 0 {
        let files = counted(size.image_files, "image file");
        let gb = size.image_bytes as f64 / BYTES_PER_GB;
        input.push(format!("{files} ({gb:.2} GB)"));
    }
    if size.pedr_files > 0 {
        let files = counted(size.pedr_files, "PEDR file");
        let gb = size.pedr_bytes as f64 / BYTES_PER_GB;
        input.push(format!(
            "{files} ({gb:.2} GB, at most {} shots)",
            size.shots
        ));
    }
    if !input.is_empty() {
        output::line(format_args!("  input: {}", input.join(", ")));
    }
    let Some(costs) = costs else {
        output::line(
            "  time and size of products: unknown before a site has been processed (run a few with --only)",
        );
        return;
    };
    let images: usize = campaign.sites.iter().map(|site| site.images.len()).sum();
    let share = images as f64 / costs.images as f64;
    output::line(format_args!(
        "  for all sites, estimated from {}: {} with --jobs {jobs}, {:.2} GB of products, {:.0} footprints",
        counted(costs.images, "processed image"),
        duration(costs.seconds * share / f64::from(jobs.min(cores(None)))),
        costs.bytes as f64 * share / BYTES_PER_GB,
        costs.footprints as f64 * share,
    ));
}
