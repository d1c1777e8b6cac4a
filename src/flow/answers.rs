//! Outcomes of runs, plans and checks as JSON, for scripts and other languages.

use std::path::Path;

use serde_json::{Value, json};

use super::{Checked, Ending, FoundProducts, RunOutcome, RunPlan, StageReason, Task};
use crate::store::{manifest::Manifest, publish::read_manifest};

/// Answer of `areograph run --json` on one site: stages with their reasons, and the verdict of the products.
#[must_use]
pub fn run_answer(outcome: &RunOutcome) -> Value {
    let folder = &outcome.folder;
    let ending = match &outcome.ending {
        Ending::Published(manifest) => products(folder, true, manifest),
        Ending::Unchanged(manifest) => products(folder, false, manifest),
        Ending::StoppedAfter(stage) => json!({
            "stopped_after": stage,
            "earlier_products_utc": read_manifest(folder).map(|earlier| earlier.finished_utc),
        }),
    };
    let stages: Vec<Value> = outcome.stages.iter().map(stage_answer).collect();
    json!({ "site": outcome.name, "folder": folder, "stages": stages, "ending": ending })
}

fn products(folder: &Path, published: bool, manifest: &Manifest) -> Value {
    json!({
        "published": published,
        "page": folder.join("report/index.html"),
        "verdict": manifest.verdict.word(),
        "valid": manifest.verdict.valid,
        "reasons": manifest.verdict.reasons,
        "remarks": manifest.verdict.remarks,
        "untested": manifest.verdict.untested,
        "checks": manifest.verdict.checks,
        "figures": manifest.figures,
        "counts": manifest.counts,
        "complaints": manifest.complaints.count,
    })
}

/// Answer of `areograph plan --json` on one task.
#[must_use]
pub fn plan_answer(task: Task<'_>, plan: &RunPlan) -> Value {
    let stages: Vec<Value> = plan.stages.iter().map(stage_answer).collect();
    json!({ task.kind(): task.name(), "stages": stages })
}

/// A stage with its reason.
fn stage_answer(stage: &StageReason) -> Value {
    json!({
        "stage": stage.stage,
        "runs": stage.reason.runs(),
        "because": stage.reason.to_string(),
    })
}

/// Answer of `areograph check --json` on one site.
#[must_use]
pub fn check_answer(site: &str, checked: &Checked) -> Value {
    let failures = checked.failures.iter().map(ToString::to_string);
    json!({
        "site": site,
        "ready": checked.failures.is_empty(),
        "findings": checked.findings,
        "verdict": checked.verdict,
        "products_are_current": checked.products == FoundProducts::Current,
        "failures": failures.collect::<Vec<_>>(),
    })
}
