//! `areograph pedr sql`.

mod answer;

use std::{
    path::{Path, PathBuf},
    sync::{Arc, PoisonError, atomic::AtomicBool},
    time::Duration,
};

use clap::{Args, ValueEnum};
use tokio::{runtime::Runtime, time::sleep};
use tokio_stream::StreamExt as _;

use self::answer::Answer;
use crate::cli::{output, stop::Signals};
#[cfg(feature = "cluster")]
use crate::{
    cluster::{self, ArchiveTable, Place},
    pds::archive::Source,
};
use crate::{
    error::{Error, IoError, Result, Stopped},
    pds::archive::Opened,
    products::{ShotColumns, is_campaign, read_campaign_tables},
    sql::{
        Question, ShotsTable, Tally, ask, ask_tables,
        datafusion::{common::DataFusionError, execution::SendableRecordBatchStream},
    },
};

/// Time within which a signal ends the wait for rows.
const STOP_WITHIN: Duration = Duration::from_millis(100);

/// Answers an SQL query on the shots of an archive, the table `shots`, or on the results of a campaign.
///
/// The table has the columns of `footprints.parquet` except `windows` ("describe shots" lists them) in IAU 2000, and one row for
/// every shot with a return, of any class; times are the tags of the files, TDB seconds past J2000. With conditions on
/// `longitude_deg`, `latitude_deg`, `et_s` and `source_file`, most of the archive is not read; with an index (`pedr index`), even
/// less is read. The answer is complete, or the command fails. Tables are read-only.
///
/// Of the folder `campaign` of a campaign, the tables are `sites`, `images`, `pairs` and `profiles`.
///
/// Example: `areograph pedr sql archive "select orbit, count(*), avg(topography_m) from shots where latitude_deg between
/// -5.5 and -4 and longitude_deg between 137 and 138 and return_class = 1 group by orbit order by orbit"`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// PEDR files, and folders with .b files in and below them; or the folder of the results of a campaign.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// The SQL query.
    #[arg(required = true, value_name = "SQL")]
    question: String,
    /// Let the cluster with this scheduler answer (`pedr cluster`); it reads the archive at the same path.
    #[cfg(feature = "cluster")]
    #[arg(long, value_name = "URL")]
    cluster: Option<Place>,
    /// Format of the printed answer.
    #[arg(long, value_enum, default_value_t = Format::Table, conflicts_with = "out")]
    format: Format,
    /// Write the answer to this file instead, .parquet or .csv.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A table of at most 1,000 rows.
    Table,
    /// Comma-separated values, all rows.
    Csv,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    #[cfg(feature = "cluster")]
    let is_here = arguments.cluster.is_none();
    #[cfg(not(feature = "cluster"))]
    let is_here = true;
    if is_here
        && let [folder] = &*arguments.paths
        && is_campaign(folder)
    {
        return run_on_campaign(folder, arguments);
    }
    let Opened { sources, failures } = Opened::all(&arguments.paths)?;
    let mut failures = failures.into_iter();
    if let Some(first) = failures.next() {
        failures.for_each(output::error);
        return Err(first);
    }
    let signals = Signals::heard()?;
    #[cfg(feature = "cluster")]
    if let Some(place) = &arguments.cluster
        && answer_there(place, &sources, arguments, signals.stop())?
    {
        return Ok(());
    }
    let table = ShotsTable::new(
        sources,
        Arc::new(ShotColumns::default()),
        Arc::clone(signals.stop()),
    );
    let tally = table.tally();
    let answered = runtime()?.block_on(async {
        let rows = ask(table, &arguments.question).await?;
        answer(rows, arguments, signals.stop(), failure).await
    });
    let mut tally = tally.lock().unwrap_or_else(PoisonError::into_inner);
    tell(&tally);
    // Failures beyond the last requested row are ignored.
    answered.map_err(|told| tally.failure.take().unwrap_or(told))
}

fn runtime() -> Result<Runtime> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    Ok(runtime.map_err(IoError::on("start an asynchronous runtime"))?)
}

/// Answers from the tables of the campaign in `folder`, which are read into memory: about a kilobyte for each row.
fn run_on_campaign(folder: &Path, arguments: &Arguments) -> Result<()> {
    let tables = read_campaign_tables(folder)?.into_iter();
    let tables = tables.map(|table| (table.name, table.schema, table.batches));
    let tables: Vec<_> = tables.collect();
    let signals = Signals::heard()?;
    runtime()?.block_on(async {
        let rows = ask_tables(tables, &arguments.question).await?;
        answer(rows, arguments, signals.stop(), failure).await
    })
}

/// Answers with a cluster; returns whether the query is one for it.
#[cfg(feature = "cluster")]
fn answer_there(
    place: &Place,
    sources: &[Source],
    arguments: &Arguments,
    stop: &AtomicBool,
) -> Result<bool> {
    let columns = Arc::new(ShotColumns::default());
    let table = ArchiveTable::of(sources.to_vec(), Arc::clone(&columns) as _)?;
    runtime()?.block_on(async {
        let asked = cluster::ask(place, table, columns, &arguments.question).await;
        let Some(rows) = asked.map_err(cluster::failure)? else {
            return Ok(false);
        };
        let answered = answer(rows, arguments, stop, cluster::failure).await;
        answered.map(|()| true)
    })
}

fn failure(error: DataFusionError) -> Error {
    Question::from(error).into()
}

async fn answer(
    mut rows: SendableRecordBatchStream,
    arguments: &Arguments,
    stop: &AtomicBool,
    failure: fn(DataFusionError) -> Error,
) -> Result<()> {
    let mut answer = match &arguments.out {
        Some(out) => Answer::in_file(out, &rows.schema())?,
        None => Answer::printed(arguments.format, rows.schema())?,
    };
    loop {
        // A cluster may be silent for minutes.
        let next = tokio::select! {
            next = rows.next() => next,
            () = sleep(STOP_WITHIN) => {
                Stopped::check(stop)?;
                continue;
            }
        };
        Stopped::check(stop)?;
        let Some(batch) = next else { break };
        if !answer.take(batch.map_err(failure)?)? {
            break;
        }
    }
    answer.finish(&arguments.question)
}

/// Complaints, on standard error.
fn tell(tally: &Tally) {
    if tally.complaints.is_empty() {
        return;
    }
    let each = tally.complaints.iter();
    let each = each.map(|(reason, count)| {
        format!(
            "{count} × {}",
            serde_json::json!(reason).as_str().unwrap_or_default()
        )
    });
    let each: Vec<String> = each.collect();
    tracing::warn!(
        "records with errors, whose invalid shots are omitted: {}; `areograph pedr info` lists them",
        each.join(", ")
    );
}
