//! Reconciliation after a start: workers of an earlier service are ended, their publications are adopted, the rest is
//! queued again. Links on the disk take precedence over the database.

use std::{fs::File, path::Path};

use serde_json::{Value, json};

use super::{
    core::{Core, site_folder},
    ending::{Attempt, finish},
    runs::{Published, current, finished_ms, identify_run_of, row, run_id, tidy},
    workers::Workers,
};
use crate::{
    database::{
        Job, Stored, attempts,
        attempts::Attempt as AttemptRow,
        facts, jobs_in,
        runs::{put_current, put_run, reserve_job, run},
        sites::{OTHER_PROGRAM, SiteRow, require_plans, sites},
    },
    record::record,
    state::JobState,
    words::counted,
    worker::{
        parent::{Ended, How},
        process::ProcessIdentity,
        protocol::CancelWhy,
        srun,
    },
};
use areograph_base::error::{Locate as _, Result};
use areograph_config::ExecutorKind;

/// Number of checks for the end of a worker, and the time between two checks.
const LOOKS: u32 = 200;
const LOOK: std::time::Duration = std::time::Duration::from_millis(50);

/// Takes over from an earlier service.
///
/// # Errors
/// The database or the folder of the products cannot be read or written.
pub fn adopt<W: Workers>(core: &Core<W>) -> Result<()> {
    let state = core.shared.config().outputs.state.clone();
    adopt_jobs(core).in_file(&state)?;
    let known = core.shared.read(sites).in_file(&state)?;
    for site in &known {
        core.shared.note_progress();
        adopt_runs(core, site)?;
    }
    adopt_sites(core, &known)?;
    new_version(core).in_file(&state)
}

fn adopt_jobs<W: Workers>(core: &Core<W>) -> Result<()> {
    let states = [JobState::Starting, JobState::Running, JobState::Cancelling];
    for state in states {
        for job in core.shared.read(|connection| jobs_in(connection, state))? {
            let rows = core
                .shared
                .read(|connection| attempts::attempts(connection, job.id, 1))?;
            let newest = rows.into_iter().next();
            let attempt = attempt_of(core, &job, newest.as_ref());
            if attempt.is_on_cluster {
                srun::cancel(&srun::job_name(&attempt.run));
            }
            if let Some(process) = newest.and_then(|newest| newest.process) {
                end(&process);
            }
            let ended = Ended {
                how: How::Cancelled,
                answer: None,
                rss_peak_kib: 0,
            };
            finish(core, &attempt, &ended, Some(CancelWhy::Shutdown))?;
        }
    }
    Ok(())
}

/// Ends a worker that outlived its service, and waits for its end.
fn end(process: &ProcessIdentity) {
    if !process.end() {
        return;
    }
    for _ in 0..LOOKS {
        if !process.is_there() {
            return;
        }
        std::thread::sleep(LOOK);
    }
    // The lock of its site excludes the next worker.
    tracing::warn!("process {} cannot be ended", process.pid);
}

/// The attempt of a job that an earlier service left.
fn attempt_of<W: Workers>(core: &Core<W>, job: &Job, newest: Option<&AttemptRow>) -> Attempt {
    let none = Attempt {
        job: job.id,
        n: job.attempt,
        site: job.site.clone(),
        ..Attempt::default()
    };
    let Some(newest) = newest else {
        return none;
    };
    Attempt {
        run: run_id(newest.started_utc.0, job.id, job.attempt),
        is_on_cluster: newest
            .is_on_cluster
            .unwrap_or_else(|| core.shared.config().executor.kind == ExecutorKind::Slurm),
        stage: newest.stage.clone(),
        ..none
    }
}

/// Removes incomplete runs, records those unknown to the database, and follows the link.
fn adopt_runs<W: Workers>(core: &Core<W>, site: &SiteRow) -> Result<()> {
    let products = core.shared.config().outputs.products.clone();
    let folder = site_folder(&products, &site.name);
    let linked = current(&folder);
    let published = tidy(&folder).unwrap_or_else(|failure| {
        tracing::warn!("runs of {} are not adopted: {failure}", site.name);
        Vec::new()
    });
    for path in published {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let known = core.shared.read(|connection| run(connection, &name));
        if known.in_file(&path)?.is_some() {
            continue;
        }
        match identify_run_of(&site.name, &path) {
            Ok(published) => note(core, &published).in_file(&path)?,
            Err(failure) => tracing::warn!("a run is not adopted: {failure}"),
        }
    }
    let Some(linked) = linked.filter(|linked| site.current_run.as_ref() != Some(linked)) else {
        return Ok(());
    };
    let now_ms = core.now_ms();
    core.shared
        .write(|transaction| {
            let found = run(transaction, &linked)?;
            // A copied folder links to a run of the site from which it was copied.
            if found.as_ref().is_some_and(|run| run.site != site.name) {
                return Ok(());
            }
            let since_ms = found.map_or(now_ms, |run| run.published_utc.0);
            put_current(transaction, &site.name, &linked, since_ms)
        })
        .in_file(&folder)
}

/// Records the runs of sites that the database does not know, as after a return to an old copy.
fn adopt_sites<W: Workers>(core: &Core<W>, known: &[SiteRow]) -> Result<()> {
    if core.shared.is_recovering() {
        return Ok(());
    }
    let products = core.shared.config().outputs.products.clone();
    let is_known = |name: &str| known.iter().any(|site| site.name == name);
    let unknown = |folder: &Path| {
        let name = folder.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| !is_known(name))
    };
    let database = core.shared.database();
    let found = record(database, &products, core.now_ms(), unknown, || false)?;
    if let Some(found) = found.filter(|found| found.runs > 0) {
        tracing::warn!(
            "{} of {} were found on the disk",
            counted(found.runs, "run"),
            counted(found.sites, "unknown site")
        );
    }
    Ok(())
}

fn note<W: Workers>(core: &Core<W>, published: &Published) -> Stored<()> {
    let published_ms = finished_ms(&published.manifest).unwrap_or_else(|| core.now_ms());
    let because = json!(["found on the disk when the service started"]);
    let run = row(
        published,
        because,
        Value::Array(Vec::new()),
        None,
        published_ms,
    );
    core.shared.write(|transaction| {
        put_run(transaction, &run)?;
        reserve_job(transaction, run.job)
    })
}

/// Version and content of a program: another build of the same version may compute differently.
fn build_of(program: &Path) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut content = blake3::Hasher::new();
    let read = File::open(program).and_then(|file| content.update_reader(file).map(|_| ()));
    match read {
        Ok(()) => format!("{version} {}", content.finalize().to_hex()),
        Err(_) => version.to_owned(),
    }
}

/// With another version or build of areograph every site is planned again.
fn new_version<W: Workers>(core: &Core<W>) -> Stored<()> {
    let build = build_of(&core.shared.program);
    core.shared.write(|transaction| {
        let before = facts::fact(transaction, facts::TOOL_VERSION)?;
        if before.as_deref() != Some(&build) {
            // A database without this fact does not know the former program.
            let round = before.map_or(0, |_| OTHER_PROGRAM);
            require_plans(transaction, round)?;
            facts::note(transaction, facts::TOOL_VERSION, &build)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::disallowed_methods, reason = "programs of a test")]
    fn two_builds_of_one_version_differ() {
        let folder = tempfile::tempdir().unwrap();
        let builds = ["one", "other", "one"].map(|content| {
            let program = folder.path().join("areograph");
            std::fs::write(&program, content).unwrap();
            build_of(&program)
        });
        assert!(builds[0] != builds[1] && builds[0] == builds[2]);
        let version = env!("CARGO_PKG_VERSION");
        assert!(builds[0].starts_with(&format!("{version} ")));
        assert_eq!(build_of(&folder.path().join("none")), version);
    }
}
