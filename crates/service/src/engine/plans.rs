//! Effect of a change on a site: a worker plans it, and the decision is recorded with its reason, even if nothing has
//! to run.

use std::{collections::BTreeMap, fs, path::Path, sync::Arc, time::Duration};

use rusqlite::{Connection, Transaction};
use serde_json::json;

use super::{
    core::{Core, working},
    folders::{Folder, as_listed, role},
    fresh::refresh,
    losses::is_named,
    reasons::{change_text, decision},
    workers::{Workers, words},
};
use crate::{
    database::{
        About, CauseKind, CauseRow, JobRequest, Moved, Priority, Stored, advance, append, enqueue,
        files::{FileState, file},
        pending_job,
        runs::{is_run, run},
        sites::{Checked, OTHER_PROGRAM, SiteInput, SiteRow, inputs_of, put_checked, put_inputs},
        waits::lost_input,
    },
    state::JobState,
    worker::{
        parent::How,
        protocol::{Answer, Failure, PlanAnswer, What},
    },
};
use areograph_base::error::Kind;
use areograph_store::publish::MANIFEST;

/// Longest time for a plan.
const LIMIT: Duration = Duration::from_mins(30);
/// The reason for a run without a stage to run.
const NOT_KEPT: &str = "the products were published, but not kept as a run";

/// A site that a change may affect.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The site.
    pub site: SiteRow,
    /// Changed files that it reads.
    pub changed: Vec<String>,
}

/// Plans a site and takes the resulting actions.
///
/// # Errors
/// The database cannot be written.
pub async fn plan<W: Workers>(
    core: &Arc<Core<W>>,
    candidate: Candidate,
    round: i64,
    night: Option<i64>,
    folders: &[Folder],
) -> Stored<()> {
    let site = &candidate.site;
    let products = &core.shared.config().outputs.products;
    let what = What::Plan {
        site_file: site.file.clone().into(),
        out: working(products, &site.name),
    };
    let ended = core.ask(&format!("plan {}", site.name), what, LIMIT).await;
    let now_ms = core.now_ms();
    let planned = match &ended.answer {
        Some(Ok(Answer::Plan(answer))) => Planned::Answer(answer),
        Some(Err(failure)) if is_final(failure.code) => Planned::Refused(failure),
        // A kernel that crashes CSPICE: the following job reports it.
        None if matches!(ended.how, How::Signalled(_)) => Planned::Crashed(words(&ended)),
        // Retried in the next round.
        _ => {
            tracing::warn!(site = site.name, "no plan: {}", words(&ended));
            return Ok(());
        }
    };
    let manifest = working(products, &site.name)
        .join(&site.name)
        .join(MANIFEST);
    let kept = core
        .shared
        .read(|connection| is_kept(connection, &site.name, &manifest))?;
    let context = Context {
        candidate: &candidate,
        kept,
        folders,
        round,
        night,
        now_ms,
    };
    core.shared
        .write(|transaction| context.record(transaction, &planned))
}

enum Planned<'a> {
    Answer(&'a PlanAnswer),
    Refused(&'a Failure),
    Crashed(String),
}

/// Whether only another input can resolve the failure.
fn is_final(code: u8) -> bool {
    [Kind::Configuration, Kind::Input, Kind::Coverage, Kind::Bug]
        .iter()
        .any(|kind| kind.exit_code() == code)
}

struct Context<'a> {
    candidate: &'a Candidate,
    /// Whether the products in the working folder are a run.
    kept: bool,
    folders: &'a [Folder],
    round: i64,
    night: Option<i64>,
    now_ms: i64,
}

impl Context<'_> {
    fn name(&self) -> &str {
        &self.candidate.site.name
    }

    fn record(&self, transaction: &Transaction<'_>, planned: &Planned<'_>) -> Stored<()> {
        let lost = match planned {
            Planned::Refused(failure) => lost_input(transaction, self.name(), |path| {
                is_named(failure, self.folders, Path::new(path))
            })?,
            _ => None,
        };
        let note = match planned {
            Planned::Answer(answer) => self.answered(transaction, answer)?,
            Planned::Refused(failure) => {
                let text = lost.as_deref().unwrap_or(&failure.text);
                self.refused(transaction, text, Some(text))?
            }
            Planned::Crashed(text) => self.refused(transaction, text, None)?,
        };
        // A lost file is reported once for all sites that read it.
        if lost.is_none() {
            tracing::info!(site = self.name(), "{note}");
        }
        let about = About {
            site: Some(self.name()),
            ..About::default()
        };
        let data = json!({ "text": note });
        append(transaction, self.now_ms, "checked", about, &data)?;
        refresh(transaction, self.now_ms, Some(self.name()))
    }

    fn answered(&self, transaction: &Transaction<'_>, answer: &PlanAnswer) -> Stored<String> {
        let before = inputs_of(transaction, self.name())?;
        let inputs = self.inputs(transaction, answer)?;
        let mut causes = self.causes(transaction, &before, &inputs, answer)?;
        put_inputs(transaction, self.name(), &inputs)?;
        let stages_run = answer.stages.iter().any(|stage| stage.runs);
        // A plan compares with the published products, which a worker that died has not kept.
        let only_keeps = !stages_run && !self.kept;
        if only_keeps {
            causes.push(CauseRow::plain(CauseKind::RetryOf, NOT_KEPT, self.now_ms));
        }
        let runs = stages_run || only_keeps;
        if runs && causes.is_empty() {
            let (kind, text) = match &self.candidate.site.problem {
                // A missing file has appeared, and was no input before: a blocked job waits for it, also in a night.
                Some(_) => (CauseKind::RetryOf, "the previous plan of the site failed"),
                None => self.without_change(transaction)?,
            };
            causes.push(CauseRow::plain(kind, text, self.now_ms));
        }
        let note = if only_keeps {
            NOT_KEPT.to_owned()
        } else {
            decision(&causes, answer)
        };
        self.checked(transaction, Some(answer), None, &note)?;
        if !runs {
            self.supersede(transaction, &note)?;
            return Ok(note);
        }
        for cause in &mut causes {
            cause.detail = change_text(cause, answer);
        }
        self.request(transaction, &causes)?;
        Ok(note)
    }

    /// A site that cannot be planned has a job nevertheless, which reports the reason and waits for another input. It is
    /// held, not run, while the reason is a lost file.
    fn refused(
        &self,
        transaction: &Transaction<'_>,
        text: &str,
        problem: Option<&str>,
    ) -> Stored<String> {
        let before = inputs_of(transaction, self.name())?;
        let seen = before.iter().map(|input| seen(transaction, &input.path));
        let seen: BTreeMap<String, Option<String>> = before
            .iter()
            .map(|input| input.path.clone())
            .zip(seen.collect::<Stored<Vec<_>>>()?)
            .collect();
        let mut inputs: Vec<SiteInput> = before
            .iter()
            .map(|input| SiteInput {
                blake3: seen[&input.path].clone(),
                ..input.clone()
            })
            .collect();
        self.with_site_file(transaction, &mut inputs)?;
        let differences = differences(&before, &inputs, self.now_ms);
        let mut causes: Vec<CauseRow> = differences
            .into_iter()
            .map(|cause| CauseRow {
                detail: format!("{}; {text}", cause.detail),
                ..cause
            })
            .collect();
        put_inputs(transaction, self.name(), &inputs)?;
        self.checked(transaction, None, problem, text)?;
        let is_new =
            self.candidate.site.needs_plan() || pending_job(transaction, self.name())?.is_some();
        if causes.is_empty() && (is_new || self.night.is_some()) {
            let (kind, _) = self.without_change(transaction)?;
            causes.push(CauseRow::plain(kind, text, self.now_ms));
        }
        if !causes.is_empty() {
            self.request(transaction, &causes)?;
        }
        Ok(text.to_owned())
    }

    fn checked(
        &self,
        transaction: &Transaction<'_>,
        answer: Option<&PlanAnswer>,
        problem: Option<&str>,
        note: &str,
    ) -> Stored<()> {
        let checked = Checked {
            round: self.round,
            at_ms: self.now_ms,
            config_blake3: answer.map(|answer| &*answer.config_blake3),
            bounds_deg: answer.and_then(|answer| answer.bounds_deg),
            body: answer.map(|answer| answer.body),
            problem,
            note,
        };
        put_checked(transaction, self.name(), &checked)
    }

    /// The files of a plan with the content that the plan saw.
    fn inputs(&self, connection: &Connection, answer: &PlanAnswer) -> Stored<Vec<SiteInput>> {
        let mut inputs: Vec<SiteInput> = Vec::with_capacity(answer.files.len() + 1);
        for file in &answer.files {
            // Changes of files elsewhere are not detected; the worker rejects those that must not be read.
            if let Some(path) = as_listed(self.folders, &file.path) {
                inputs.push(SiteInput {
                    role: role(self.folders, &path).to_owned(),
                    blake3: Some(file.blake3.clone()),
                    path,
                });
            }
        }
        // Files that the site read before and that were removed: so that their return is detected.
        for path in &self.candidate.changed {
            if seen(connection, path)?.is_none() && inputs.iter().all(|input| input.path != *path) {
                inputs.push(SiteInput {
                    path: path.clone(),
                    role: role(self.folders, path).to_owned(),
                    blake3: None,
                });
            }
        }
        self.with_site_file(connection, &mut inputs)?;
        inputs.sort_by(|one, other| one.path.cmp(&other.path));
        Ok(inputs)
    }

    fn with_site_file(&self, connection: &Connection, inputs: &mut Vec<SiteInput>) -> Stored<()> {
        let path = &self.candidate.site.file;
        if inputs.iter().all(|input| input.path != *path) {
            inputs.push(SiteInput {
                path: path.clone(),
                role: "site".to_owned(),
                blake3: seen(connection, path)?,
            });
        }
        Ok(())
    }

    fn causes(
        &self,
        connection: &Connection,
        before: &[SiteInput],
        inputs: &[SiteInput],
        answer: &PlanAnswer,
    ) -> Stored<Vec<CauseRow>> {
        let site = &self.candidate.site;
        let mut causes = differences(before, inputs, self.now_ms);
        // Before a first plan the inputs of the site are unknown.
        if site.config_blake3.is_empty() {
            causes.retain(|cause| cause.old_blake3.is_some());
        }
        // Comments of a site file are not a change.
        if answer.config_blake3 == site.config_blake3 {
            causes.retain(|cause| cause.kind != CauseKind::ConfigChanged.name());
        }
        let current = match &site.current_run {
            Some(current) => run(connection, current)?,
            None => None,
        };
        let version = env!("CARGO_PKG_VERSION");
        if let Some(current) = current.filter(|current| current.version != version) {
            let text = format!("areograph {} was replaced by {version}", current.version);
            causes.push(CauseRow::plain(CauseKind::ToolChanged, &text, self.now_ms));
        }
        Ok(causes)
    }

    /// The reason to run a site without a changed input.
    fn without_change(&self, connection: &Connection) -> Stored<(CauseKind, &'static str)> {
        let site = &self.candidate.site;
        let pending = pending_job(connection, &site.name)?.is_some();
        Ok(match &site.current_run {
            None if site.needs_plan() && !pending => (CauseKind::First, "the site is new"),
            Some(_) if site.round == OTHER_PROGRAM && !pending => (
                CauseKind::ToolChanged,
                "this build of areograph computes stages differently",
            ),
            _ if self.night.is_some() => (
                CauseKind::Scheduled,
                "the products do not correspond to the inputs",
            ),
            _ => (
                CauseKind::RetryOf,
                "an earlier job ended without products from these inputs",
            ),
        })
    }

    fn request(&self, transaction: &Transaction<'_>, causes: &[CauseRow]) -> Stored<()> {
        let only = |kind: CauseKind| causes.iter().all(|cause| cause.kind == kind.name());
        let priority = if only(CauseKind::ToolChanged) {
            Priority::Backfill
        } else if only(CauseKind::Scheduled) {
            Priority::Scheduled
        } else {
            Priority::Changed
        };
        let request = JobRequest {
            site: self.name(),
            priority,
            force: false,
            night: self.night,
            asked_by: None,
            ready: true,
            causes,
        };
        enqueue(transaction, self.now_ms, &request).map(|_| ())
    }

    /// Pending work is superseded: the inputs are again as they were. A person's request stays.
    fn supersede(&self, transaction: &Transaction<'_>, note: &str) -> Stored<()> {
        let Some(job) = pending_job(transaction, self.name())? else {
            return Ok(());
        };
        if job.force || job.asked_by.is_some() {
            return Ok(());
        }
        let moved = Moved {
            outcome: Some(json!({ "text": note })),
            ..Moved::default()
        };
        advance(
            transaction,
            self.now_ms,
            job.id,
            JobState::Superseded,
            &moved,
        )
    }
}

/// Whether the products of `manifest`, if any, are a run.
fn is_kept(connection: &Connection, site: &str, manifest: &Path) -> Stored<bool> {
    match fs::read(manifest) {
        Ok(bytes) => is_run(connection, site, blake3::hash(&bytes).to_hex().as_str()),
        // Without products every plan has stages to run.
        Err(_) => Ok(true),
    }
}

/// The content of a file as the service knows it; `None` for one that was removed or never seen.
fn seen(connection: &Connection, path: &str) -> Stored<Option<String>> {
    let file = file(connection, path)?;
    Ok(file
        .filter(|file| file.state != FileState::Gone)
        .and_then(|file| file.blake3))
}

/// Files that changed, were added or removed.
fn differences(before: &[SiteInput], now: &[SiteInput], at_ms: i64) -> Vec<CauseRow> {
    let by_path = |inputs: &[SiteInput]| -> BTreeMap<String, SiteInput> {
        let named = inputs
            .iter()
            .map(|input| (input.path.clone(), input.clone()));
        named.collect()
    };
    let (before, now) = (by_path(before), by_path(now));
    let mut causes = Vec::new();
    for path in before
        .keys()
        .chain(now.keys().filter(|path| !before.contains_key(*path)))
    {
        let (old, new) = (before.get(path), now.get(path));
        let content = |input: Option<&SiteInput>| input.and_then(|input| input.blake3.clone());
        let (old_blake3, new_blake3) = (content(old), content(new));
        if old_blake3 == new_blake3 {
            continue;
        }
        let role = new.or(old).map_or("data", |input| &*input.role);
        let kind = match role {
            "site" => CauseKind::ConfigChanged,
            "kernel" => CauseKind::KernelChanged,
            _ => CauseKind::DataChanged,
        };
        let name = areograph_store::files::file_name(Path::new(path));
        let what = match (&old_blake3, &new_blake3) {
            (None, _) if old.is_some() => "is back",
            (None, _) => "is new",
            (_, None) => "was removed, or is no longer read",
            _ => "changed",
        };
        causes.push(CauseRow {
            kind: kind.name().to_owned(),
            path: Some(path.clone()),
            old_blake3,
            new_blake3,
            detail: format!("`{name}` {what}"),
            at_ms,
        });
    }
    causes
}
