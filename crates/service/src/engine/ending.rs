//! The end of an attempt: its publication is checked, made current and recorded; otherwise the kind of failure
//! determines the next state of the job.

use rusqlite::Transaction;
use serde_json::{Value, json};

use super::{
    alerts::{Standing, tell_standing},
    core::{Core, runs, site_folder},
    fresh,
    retry::{Fruitless, after},
    runs::{Published, current, make_current, read_run, row},
    workers::{Workers, words},
};
use crate::{
    database::{
        About, DatabaseError, Job, Moved, Stored, advance, append,
        attempts::{AttemptEnd, end_attempt},
        causes, give_back, job,
        runs::{Run, put_checked, put_current, put_run},
    },
    state::JobState,
    worker::{
        parent::{Ended, How},
        protocol::{Answer, CancelWhy, Failure, RunAnswer},
        run_folder::{bar, remove},
    },
};
use areograph_base::error::{Error, Result};

/// An attempt, and its last report.
#[derive(Debug, Clone, Default)]
pub struct Attempt {
    /// The job.
    pub job: i64,
    /// Its number in the job.
    pub n: i64,
    /// The site.
    pub site: String,
    /// Its run.
    pub run: String,
    /// Whether Slurm runs it.
    pub is_on_cluster: bool,
    /// The current stage.
    pub stage: Option<String>,
}

/// Result of an attempt.
#[derive(Debug)]
enum Fruit {
    /// A run, checked; its row.
    Run(Box<Run>),
    /// The products were up to date.
    Unchanged,
    /// No result, and the reason.
    None(Ended),
}

/// Ends an attempt, once; returns the run that it published.
///
/// # Errors
/// The database cannot be written, or a worker on a node cannot be kept from publishing; then nothing is recorded, and the call can
/// be repeated.
pub fn finish<W: Workers>(
    core: &Core<W>,
    attempt: &Attempt,
    ended: &Ended,
    cancel: Option<CancelWhy>,
) -> Result<Option<Run>> {
    let fruit = fruit(core, attempt, ended)?;
    let config = core.shared.config();
    let now_ms = core.now_ms();
    let is_first = core.shared.write(|transaction| {
        let job = job(transaction, attempt.job)?
            .ok_or(DatabaseError::from(rusqlite::Error::QueryReturnedNoRows))?;
        let end = AttemptEnd {
            how: &words(ended),
            exit: match ended.how {
                How::Exited(code) => Some(code),
                _ => None,
            },
            signal: match ended.how {
                How::Signalled(signal) => Some(signal),
                _ => None,
            },
        };
        // The first record of the end has already moved the job.
        if !end_attempt(transaction, now_ms, (attempt.job, attempt.n), end)? {
            return Ok(false);
        }
        let (state, moved) = match &fruit {
            Fruit::Run(run) => after_run(transaction, now_ms, run)?,
            Fruit::Unchanged => (JobState::Unchanged, text("the products are up to date")),
            Fruit::None(ended) => {
                let fruitless = Fruitless {
                    job: &job,
                    ended,
                    stage: attempt.stage.as_deref(),
                    memory_mib: config.workers.memory_mib,
                    cancel,
                    retry_s: config.workers.retry_s,
                    now_ms,
                };
                after(&fruitless, core.random)
            }
        };
        let said = moved.outcome.as_ref().map(outcome_text).unwrap_or_default();
        go(transaction, now_ms, &job, state, &moved)?;
        let text = format!("{state}: {said}");
        let alerted = match standing(state) {
            None => false,
            Some(standing) => {
                tell_standing(transaction, &config, now_ms, &attempt.site, standing, &text)?
            }
        };
        // An alert is in the log already.
        if !alerted {
            let (site, attempt) = (&attempt.site, attempt.n);
            tracing::info!(site, job = job.id, attempt, "{text}");
        }
        fresh::refresh(transaction, now_ms, Some(&attempt.site))?;
        Ok(true)
    })?;
    Ok(match fruit {
        Fruit::Run(run) if is_first => Some(*run),
        _ => None,
    })
}

/// Text of an outcome for people.
#[must_use]
pub fn outcome_text(outcome: &Value) -> String {
    outcome["text"].as_str().unwrap_or_default().to_owned()
}

fn text(text: &str) -> Moved {
    Moved {
        outcome: Some(json!({ "text": text })),
        ..Moved::default()
    }
}

/// A worker that published, or found the products up to date, has been running, even if its hello was not received.
fn go(
    transaction: &Transaction<'_>,
    now_ms: i64,
    job: &Job,
    state: JobState,
    moved: &Moved,
) -> Stored<()> {
    let from_start =
        job.state == JobState::Starting && matches!(state, JobState::Unchanged | JobState::Blocked);
    if from_start {
        let running = Moved::default();
        advance(transaction, now_ms, job.id, JobState::Running, &running)?;
    }
    give_back(transaction, now_ms, job.id, state, moved)
}

fn standing(state: JobState) -> Option<Standing> {
    match state {
        JobState::Succeeded | JobState::Unchanged => Some(Standing::Well),
        JobState::Failed | JobState::Blocked => Some(Standing::Failed),
        JobState::Invalid => Some(Standing::Invalid),
        _ => None,
    }
}

fn fruit<W: Workers>(core: &Core<W>, attempt: &Attempt, ended: &Ended) -> Result<Fruit> {
    let answer = match &ended.answer {
        Some(Ok(Answer::Run(answer))) => Some(answer),
        _ => None,
    };
    let products = core.shared.config().outputs.products.clone();
    let folder = runs(&products, &attempt.site).join(&attempt.run);
    let has_run = !attempt.run.is_empty();
    if has_run && attempt.is_on_cluster && ended.answer.is_none() {
        // A worker on a lost node may still work: it publishes before this, or not at all. Even an srun that started no worker may
        // have left its job in the queue.
        bar(&folder)?;
    }
    // A worker that died after publishing has nevertheless published.
    if !has_run || !folder.is_dir() {
        return Ok(match answer {
            Some(answer) if answer.run.is_none() => Fruit::Unchanged,
            _ => Fruit::None(ended.clone()),
        });
    }
    let checked = read_run(&attempt.site, &folder).and_then(|published| {
        if published.manifest.verdict.valid {
            let site = site_folder(&products, &attempt.site);
            let before = current(&site);
            make_current(&site, &attempt.run)?;
            return Ok((published, before));
        }
        Ok((published, None))
    });
    match checked {
        Ok((published, before)) => {
            let run = noted(core, attempt, &published, answer, before)?;
            Ok(Fruit::Run(Box::new(run)))
        }
        Err(failure) => {
            // An incomplete run is useless; the next attempt links it again.
            if let Err(kept) = remove(&folder) {
                tracing::warn!("{kept}");
            }
            let mut ended = ended.clone();
            if answer.is_some() {
                ended.answer = Some(Err(as_failure(&failure)));
            }
            Ok(Fruit::None(ended))
        }
    }
}

fn noted<W: Workers>(
    core: &Core<W>,
    attempt: &Attempt,
    published: &Published,
    answer: Option<&RunAnswer>,
    before: Option<String>,
) -> Stored<Run> {
    let reasons = core
        .shared
        .read(|connection| causes(connection, attempt.job))?;
    let because: Vec<String> = reasons.into_iter().map(|cause| cause.detail).collect();
    let stages = json!(answer.map_or(&[][..], |answer| &answer.ran));
    let before = before.filter(|before| *before != attempt.run);
    Ok(row(
        published,
        json!(because),
        stages,
        before,
        core.now_ms(),
    ))
}

/// Records a run; returns the state and outcome of its job.
fn after_run(transaction: &Transaction<'_>, now_ms: i64, run: &Run) -> Stored<(JobState, Moved)> {
    put_run(transaction, run)?;
    // Its products were read for this.
    put_checked(transaction, &run.id, now_ms)?;
    let about = About {
        site: Some(&run.site),
        job: Some(run.job),
        run: Some(&run.id),
    };
    let data = json!({ "valid": run.valid, "verdict": run.verdict });
    append(transaction, now_ms, "run", about, &data)?;
    if run.valid {
        put_current(transaction, &run.site, &run.id, run.published_utc.0)?;
        return Ok((JobState::Succeeded, text(&run.verdict)));
    }
    let reasons = run.reasons.as_array().cloned().unwrap_or_default();
    let reasons: Vec<&str> = reasons.iter().filter_map(Value::as_str).collect();
    Ok((JobState::Invalid, text(&reasons.join("; "))))
}

/// A failure of the service itself, in the form that a worker would report.
fn as_failure(error: &Error) -> Failure {
    Failure {
        code: error.kind().exit_code(),
        busy: false,
        site: error.site.clone(),
        stage: error.stage.clone(),
        file: error.file.clone(),
        text: error.to_string(),
    }
}
