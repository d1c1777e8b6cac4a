//! Comparison of a new run with its predecessor after every update. A failed comparison delays nothing.

use std::{fs, path::PathBuf, sync::Arc, time::Duration};

use serde_json::{Value, json};

use super::{
    alerts::{Alert, tell},
    core::{Core, runs, site_folder},
    workers::{Workers, words},
};
use crate::{
    database::{
        About, Stored, append,
        runs::{Run, put_moved, uncompared_runs},
    },
    worker::protocol::{Answer, What},
};
use areograph_config::AlertKind;

/// Longest time for a comparison.
const LIMIT: Duration = Duration::from_mins(30);
/// Folder of the pages, beside the folder of the runs.
const DIFFS: &str = "diffs";

/// The page of a run's comparison with its predecessor.
#[must_use]
pub fn page(products: &std::path::Path, site: &str, run: &str) -> PathBuf {
    site_folder(products, site)
        .join(DIFFS)
        .join(format!("{run}.html"))
}

/// Compares runs that have not been compared with their predecessors.
///
/// # Errors
/// The database cannot be read or written.
pub async fn compare_all<W: Workers>(core: &Arc<Core<W>>) -> Stored<()> {
    for run in core.shared.read(uncompared_runs)? {
        if core.shared.ending.is_cancelled() {
            return Ok(());
        }
        compare(core, &run).await?;
    }
    Ok(())
}

async fn compare<W: Workers>(core: &Arc<Core<W>>, run: &Run) -> Stored<()> {
    let Some(before) = &run.predecessor else {
        return Ok(());
    };
    let config = core.shared.config();
    let products = &config.outputs.products;
    let page = page(products, &run.site, &run.id);
    if let Some(folder) = page.parent() {
        // The worker reports a folder that cannot be created.
        let _ = fs::create_dir_all(folder);
    }
    let folder = runs(products, &run.site);
    let what = What::Diff {
        before: folder.join(before),
        after: folder.join(&run.id),
        page: Some(page.clone()),
        limit_m: config.moved.limit_m,
        limit_arcsec: config.moved.limit_arcsec,
    };
    let ended = core.ask(&format!("diff {}", run.id), what, LIMIT).await;
    if core.shared.ending.is_cancelled() && ended.answer.is_none() {
        return Ok(());
    }
    let now_ms = core.now_ms();
    let about = About {
        site: Some(&run.site),
        job: Some(run.job),
        run: Some(&run.id),
    };
    core.shared.write(|transaction| {
        let moved = match &ended.answer {
            Some(Ok(Answer::Diff {
                headline,
                sentences,
                beyond_limit,
            })) => {
                if *beyond_limit {
                    let alert = Alert {
                        kind: AlertKind::Moved,
                        site: Some(&run.site),
                        run: Some(&run.id),
                        text: headline,
                    };
                    tell(transaction, &config, now_ms, &alert, &Value::Null)?;
                }
                json!({
                    "headline": headline,
                    "sentences": sentences,
                    "beyond_limit": beyond_limit,
                    "page": page.is_file(),
                })
            }
            _ => json!({ "problem": words(&ended) }),
        };
        put_moved(transaction, &run.id, &moved)?;
        append(
            transaction,
            now_ms,
            "run",
            about,
            &json!({ "moved": moved }),
        )
        .map(|_| ())
    })
}
