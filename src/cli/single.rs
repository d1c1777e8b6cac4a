//! The answer of a flow of one stage: a line or JSON, the verdict, the exit code.

use std::process::ExitCode;

use serde_json::json;

use super::{output, report};
use crate::{
    error::{Kind, Result},
    flow::SingleOutcome,
    store::manifest::Manifest,
    verdict::{NOT_TESTED, Verdict},
};

/// Name of such a flow in its answer.
pub(super) struct Request<'a> {
    /// The key of its name in JSON.
    pub(super) what: &'static str,
    /// Its name.
    pub(super) name: &'a str,
    /// Whether JSON was requested.
    pub(super) json: bool,
}

/// Prints the outcome of a run, with its counts in words.
pub(super) fn answer(
    request: &Request<'_>,
    ran: Result<SingleOutcome>,
    words: impl Fn(&dyn Fn(&str) -> u64) -> String,
) -> ExitCode {
    let outcome = match ran {
        Ok(outcome) => outcome,
        Err(failure) => return report(&failure),
    };
    let manifest = &outcome.manifest;
    if request.json {
        output::json(&json!({
            request.what: request.name,
            "folder": outcome.folder,
            "unchanged": outcome.unchanged,
            "verdict": manifest.verdict,
            "counts": manifest.counts,
            "figures": manifest.figures,
        }));
    } else {
        let count = |name: &str| manifest.counts.get(name).copied().unwrap_or(0);
        let unchanged = if outcome.unchanged {
            ", nothing changed"
        } else {
            ""
        };
        output::line(format_args!(
            "{}: {}{unchanged}; {}; {}",
            request.name,
            manifest.verdict.word(),
            words(&count),
            outcome.folder.join("report/index.html").display(),
        ));
        tell(manifest);
    }
    if manifest.verdict.valid {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(Kind::Validation.exit_code())
    }
}

/// Reports reasons, remarks, and errors that are not tested.
fn tell(manifest: &Manifest) {
    for reason in &manifest.verdict.reasons {
        output::line(format_args!("  invalid: {reason}"));
    }
    for remark in &manifest.verdict.remarks {
        output::line(format_args!("  remark: {remark}"));
    }
    untested(&manifest.verdict);
}

/// Prints errors that no datum of a valid result can show; of an invalid one the reasons matter.
pub(super) fn untested(verdict: &Verdict) {
    if verdict.valid && !verdict.untested.is_empty() {
        output::line(format_args!("  {NOT_TESTED}"));
        for phrase in &verdict.untested {
            output::line(format_args!("    {phrase}"));
        }
    }
}
