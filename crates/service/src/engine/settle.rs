//! Files in quiet folders are read: unchanged content has no effect, and a kernel is used if CSPICE opens it.

use std::{path::Path, sync::Arc, time::Duration};

use serde_json::json;
use tokio::task::JoinSet;

use super::{core::Core, poll::is_missing, workers::Workers, workers::words};
use crate::{
    database::{
        About, Stored, append,
        files::{FileRow, FileState, knows_coverage, put_coverage, put_file},
    },
    worker::{
        parent::{Ended, How},
        protocol::{Answer, Hashed, Probed, What},
    },
};
use areograph_base::error::Kind;
use areograph_store::files::file_name;

/// Files that one process hashes, and kernels that one process opens.
const HASHED_TOGETHER: usize = 256;
const PROBED_TOGETHER: usize = 16;
/// Longest time for such a part: 256 PEDR files of an archive on a slow disk.
const LIMIT: Duration = Duration::from_mins(30);
/// Suffixes of kernels that CSPICE opens without others.
const KERNELS: [&str; 10] = [
    "bc", "bsp", "bpc", "tls", "tsc", "tpc", "tf", "ti", "bds", "tk",
];

/// Reads files that have settled, and records their state. Those that cannot be read now are unchanged.
///
/// # Errors
/// The database cannot be written.
pub async fn settle<W: Workers>(
    core: &Arc<Core<W>>,
    settled: Vec<FileRow>,
    round: i64,
) -> Stored<()> {
    let (missing, there): (Vec<FileRow>, Vec<FileRow>) = settled.into_iter().partition(is_missing);
    core.shared.write(|transaction| {
        for file in missing {
            tracing::info!("{} was removed", file.path);
            let gone = FileRow {
                state: FileState::Gone,
                detail: String::new(),
                round,
                ..file
            };
            put_file(transaction, &gone)?;
        }
        Ok(())
    })?;
    let mut parts = JoinSet::new();
    let places = Arc::new(tokio::sync::Semaphore::new(usize::from(
        core.shared.config().workers.count,
    )));
    for (number, part) in there.chunks(HASHED_TOGETHER).enumerate() {
        let (core, places, part) = (Arc::clone(core), Arc::clone(&places), part.to_vec());
        parts.spawn(async move {
            let _place = places.acquire_owned().await;
            read_part(&core, number, part, round).await
        });
    }
    while let Some(done) = parts.join_next().await {
        match done {
            Ok(done) => done?,
            Err(panicked) => tracing::error!("reading files failed: {panicked}"),
        }
    }
    Ok(())
}

async fn read_part<W: Workers>(
    core: &Arc<Core<W>>,
    number: usize,
    part: Vec<FileRow>,
    round: i64,
) -> Stored<()> {
    let files = part.iter().map(|file| file.path.clone().into()).collect();
    let what = What::Hash {
        files,
        rehash: false,
    };
    let ended = core.ask(&format!("hash {number}"), what, LIMIT).await;
    let Some(hashed) = hashes(&ended).filter(|hashed| hashed.len() == part.len()) else {
        tracing::warn!("files could not be read: {}", words(&ended));
        return Ok(());
    };
    let read: Vec<(FileRow, Hashed)> = part.into_iter().zip(hashed).collect();
    for kernels in read.chunks(PROBED_TOGETHER) {
        let opened = probe_together(core, number, kernels).await?;
        let now_ms = core.now_ms();
        core.shared.write(|transaction| {
            for ((file, hashed), opened) in kernels.iter().zip(&opened) {
                let problem = match opened {
                    Opened::Usable => None,
                    Opened::Faulty(problem) => Some(problem),
                    Opened::Unknown(why) => {
                        tracing::warn!("{} could not be checked: {why}", file.path);
                        continue;
                    }
                };
                let file = judged(file, hashed, problem, round, now_ms);
                if let Some(note) = &file.1 {
                    tracing::info!("{note}");
                    let data = json!({ "path": file_name(Path::new(&file.0.path)), "text": note });
                    append(transaction, now_ms, "file", About::default(), &data)?;
                }
                put_file(transaction, &file.0)?;
            }
            Ok(())
        })?;
    }
    Ok(())
}

/// The hashes from a worker's answer.
#[must_use]
pub fn hashes(ended: &Ended) -> Option<Vec<Hashed>> {
    match &ended.answer {
        Some(Ok(Answer::Hash { files })) => Some(files.clone()),
        _ => None,
    }
}

/// The state of a file after reading, and its message.
fn judged(
    file: &FileRow,
    hashed: &Hashed,
    problem: Option<&String>,
    round: i64,
    now_ms: i64,
) -> (FileRow, Option<String>) {
    let name = file_name(Path::new(&file.path));
    let same = hashed.blake3.is_some() && hashed.blake3 == file.blake3;
    let problem = hashed.problem.as_ref().or(problem);
    let (state, detail) = match problem {
        Some(problem) => (FileState::Bad, problem.clone()),
        None if same => (FileState::Ready, "touched; content unchanged".to_owned()),
        None => (FileState::Ready, String::new()),
    };
    let note = match (state, same, &file.blake3) {
        (FileState::Bad, ..) => Some(format!("`{name}` cannot be used: {detail}")),
        (_, true, _) => Some(format!("`{name}` was touched; its content is unchanged")),
        (_, false, Some(_)) => Some(format!("`{name}` has new content")),
        // A new service starts with many files.
        (_, false, None) => None,
    };
    let judged = FileRow {
        state,
        detail,
        checked_ms: Some(now_ms),
        round: if same || state == FileState::Bad {
            file.round
        } else {
            round
        },
        blake3: hashed.blake3.clone().or_else(|| file.blake3.clone()),
        ..file.clone()
    };
    (judged, note)
}

fn is_kernel(path: &str) -> bool {
    let ending = Path::new(path)
        .extension()
        .and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| KERNELS.contains(&ending))
}

/// Result of opening a file as a kernel.
#[derive(Debug, Clone)]
enum Opened {
    /// It is a usable kernel, no kernel, or its content is known.
    Usable,
    /// It is not usable, for this reason.
    Faulty(String),
    /// The worker was lost for a reason that implies nothing about the file, which is checked again in the next round.
    Unknown(String),
}

impl From<Option<String>> for Opened {
    fn from(problem: Option<String>) -> Self {
        problem.map_or(Self::Usable, Self::Faulty)
    }
}

/// Opens those of the files that are kernels with unknown content.
async fn probe_together<W: Workers>(
    core: &Arc<Core<W>>,
    number: usize,
    files: &[(FileRow, Hashed)],
) -> Stored<Vec<Opened>> {
    let mut opened = vec![Opened::Usable; files.len()];
    let mut unknown = Vec::new();
    for (place, (file, hashed)) in files.iter().enumerate() {
        let Some(blake3) = hashed.blake3.as_ref().filter(|_| is_kernel(&file.path)) else {
            continue;
        };
        let known = core
            .shared
            .read(|connection| knows_coverage(connection, blake3))?;
        if !known {
            unknown.push(place);
        }
    }
    let path = |place: &usize| files[*place].0.path.clone();
    match probe(core, number, unknown.iter().map(path).collect()).await? {
        Ok(found) => {
            for (place, problem) in unknown.into_iter().zip(found) {
                opened[place] = problem.into();
            }
        }
        // One of them crashes CSPICE: it is identified by opening each alone.
        Err(_) => {
            for place in unknown {
                opened[place] = match probe(core, number, vec![path(&place)]).await? {
                    Ok(mut found) => found.pop().flatten().into(),
                    Err(ended) if is_of_kernel(&ended) => Opened::Faulty(words(&ended)),
                    Err(ended) => Opened::Unknown(words(&ended)),
                };
            }
        }
    }
    Ok(opened)
}

/// Whether a worker that opened a single kernel, and did not report on it, ended because of that kernel: CSPICE crashed,
/// ended the process or did not return. A worker that was stopped, was not started or fell silent implies nothing.
fn is_of_kernel(ended: &Ended) -> bool {
    match (&ended.answer, &ended.how) {
        (Some(Ok(_)), _) => true,
        // Its limit of memory ended it.
        (Some(Err(_)), How::Signalled(_)) => false,
        (Some(Err(failure)), _) => {
            let of_machine = [Kind::Io, Kind::Interrupted].map(Kind::exit_code);
            !of_machine.contains(&failure.code)
        }
        (None, how) => matches!(
            how,
            How::Signalled(_) | How::Exited(_) | How::DeadlinePassed | How::Garbled(_)
        ),
    }
}

/// Has kernels opened, and records their coverage; returns the fault of each, or how the worker ended without a report
/// on every kernel.
async fn probe<W: Workers>(
    core: &Arc<Core<W>>,
    number: usize,
    paths: Vec<String>,
) -> Stored<Result<Vec<Option<String>>, Ended>> {
    if paths.is_empty() {
        return Ok(Ok(Vec::new()));
    }
    let count = paths.len();
    let files = paths.into_iter().map(Into::into).collect();
    let what = What::Probe { files };
    let ended = core.ask(&format!("probe {number}"), what, LIMIT).await;
    let Some(Ok(Answer::Probe { kernels })) = &ended.answer else {
        return Ok(Err(ended));
    };
    if kernels.len() != count {
        let how = How::Garbled("not every kernel is reported".to_owned());
        let answer = None;
        return Ok(Err(Ended {
            how,
            answer,
            ..ended
        }));
    }
    core.shared.write(|transaction| {
        for Probed {
            blake3, coverage, ..
        } in kernels.iter().filter(|kernel| kernel.problem.is_none())
        {
            put_coverage(transaction, blake3, coverage)?;
        }
        Ok(())
    })?;
    let problems = kernels.iter().map(|kernel| kernel.problem.clone());
    Ok(Ok(problems.collect()))
}
