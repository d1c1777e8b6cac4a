//! The shots of an archive as a table that is queried: the same rows as without any use of conditions, complete or a failure.
#![cfg(feature = "sql")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "helpers of tests fail as tests do"
)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::Arc,
};

use areograph::body::{Body, Datum};
use areograph::sql::datafusion::{
    datasource::MemTable,
    prelude::{SessionConfig, SessionContext},
};
use areograph::{
    pds::archive::Opened,
    products::{CampaignProducts, ShotColumns, write_campaign_products},
    sql::ShotsTable,
    stages::pool_sites::{CampaignRows, KernelSetName, SiteRow, SiteState, pool_sites},
};
use areograph_testing::track::{FRAMES, write};
use arrow_array::RecordBatch;
use arrow_select::concat::concat_batches;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use proptest::{prelude::*, strategy::ValueTree as _, test_runner::TestRunner};

/// Time tag of the first frame of the archive, TDB seconds.
const START_S: f64 = -20_000_000.0;

/// Two files that follow each other, of different datums.
fn archive(folder: &Path) -> PathBuf {
    let archive = folder.join("archive");
    fs::create_dir(&archive).unwrap();
    let (first, second) = (archive.join("ap19030l.b"), archive.join("ap19020k.b"));
    write(&first, Datum::Iau2000, 0, |_, _| ());
    write(&second, Datum::Iau1991, FRAMES / 2, |_, _| ());
    archive
}

fn shots(archive: &Path) -> ShotsTable {
    let Opened { sources, failures } = Opened::all(&[archive.to_owned()]).unwrap();
    assert!(failures.is_empty());
    ShotsTable::new(sources, Arc::new(ShotColumns::default()), Arc::default())
}

fn context() -> SessionContext {
    SessionContext::new_with_config(SessionConfig::new().with_target_partitions(1))
}

/// All rows of an answer in one batch.
fn ask(context: &SessionContext, question: &str) -> RecordBatch {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .build()
        .unwrap();
    let batches = runtime.block_on(async { context.sql(question).await?.collect().await });
    let batches = batches.unwrap_or_else(|error| panic!("{question}: {error}"));
    let schema = batches.first().map_or_else(
        || Arc::new(arrow_schema::Schema::empty()),
        RecordBatch::schema,
    );
    concat_batches(&schema, &batches).unwrap()
}

fn areograph(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_areograph"))
        .args(["pedr"])
        .args(arguments)
        .output()
        .unwrap()
}

fn sql(archive: &Path, more: &[&str]) -> Output {
    let arguments = [&["sql", archive.to_str().unwrap()], more].concat();
    areograph(&arguments)
}

fn error_of(output: &Output) -> String {
    assert!(!output.status.success());
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn parquet(path: &Path) -> RecordBatch {
    let file = fs::File::open(path).unwrap();
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let schema = Arc::clone(builder.schema());
    let batches: Vec<RecordBatch> = builder.build().unwrap().map(Result::unwrap).collect();
    concat_batches(&schema, &batches).unwrap()
}

/// A comparison of a column with a value that its shots have.
fn comparison() -> impl Strategy<Value = String> {
    let operator = || proptest::sample::select(vec!["<", "<=", ">", ">=", "=", "<>"]);
    let number = |column: &'static str, least: f64, greatest: f64| {
        let value = move || least..greatest;
        prop_oneof![
            (operator(), value()).prop_map(move |(op, value)| format!("{column} {op} {value:.4}")),
            (operator(), value()).prop_map(move |(op, value)| format!("{value:.2} {op} {column}")),
            (any::<bool>(), value(), value()).prop_map(move |(not, a, b)| {
                let not = if not { "not " } else { "" };
                format!("{column} {not}between {:.3} and {:.3}", a.min(b), a.max(b))
            }),
        ]
    };
    let stop_s = START_S + 2.0 * f64::from(FRAMES);
    prop_oneof![
        3 => number("longitude_deg", -10.0, 370.0),
        3 => number("latitude_deg", -95.0, 95.0),
        2 => number("et_s", START_S - 100.0, stop_s + 100.0),
        1 => number("et_tag_s", START_S, stop_s),
        1 => number("radius_m", 3.38e6, 3.41e6),
        1 => proptest::sample::select(vec![
            "source_file = 'ap19030l.b'",
            "source_file in ('ap19020k.b', 'none.b')",
            "source_file <> 'ap19030l.b'",
            "source_file like '%k.b'",
            "return_class = 1",
            "channel in (1, 2)",
            "abs(latitude_deg) > 70",
            "longitude_deg > latitude_deg",
        ]).prop_map(str::to_owned),
    ]
}

fn condition() -> impl Strategy<Value = String> {
    comparison().prop_recursive(4, 12, 3, |inner| {
        prop_oneof![
            3 => (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a} and {b})")),
            2 => (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a} or {b})")),
            1 => inner.prop_map(|a| format!("not ({a})")),
        ]
    })
}

#[test]
fn conditions_give_the_same_rows_whether_a_search_uses_them_or_not() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let searched = context();
    searched
        .register_table("shots", Arc::new(shots(&archive)))
        .unwrap();
    let every_row = ask(&searched, "select * from shots");
    assert!(every_row.num_rows() > 80_000);
    let read = context();
    let table = MemTable::try_new(every_row.schema(), vec![vec![every_row]]).unwrap();
    read.register_table("shots", Arc::new(table)).unwrap();
    assert!(
        areograph(&["index", archive.to_str().unwrap()])
            .status
            .success()
    );
    let indexed = context();
    indexed
        .register_table("shots", Arc::new(shots(&archive)))
        .unwrap();

    let mut runner = TestRunner::deterministic();
    let mut found = 0;
    for _ in 0..120 {
        let condition = condition().new_tree(&mut runner).unwrap().current();
        let question = format!(
            "select source_file, record, shot, longitude_deg, topography_m from shots where {condition}"
        );
        let expected = ask(&read, &question);
        found += usize::from(expected.num_rows() > 0);
        for (context, way) in [(&searched, "searched"), (&indexed, "with an index")] {
            let answer = ask(context, &question);
            assert_eq!(answer.num_rows(), expected.num_rows(), "{way}: {condition}");
            assert!(
                expected.num_rows() == 0 || answer == expected,
                "{way}: {condition}"
            );
        }
    }
    assert!(found > 40, "only {found} questions have an answer");
}

#[test]
fn conditions_spare_work_and_complaints_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let table = shots(&archive);
    let tally = table.tally();
    let context = context();
    context.register_table("shots", Arc::new(table)).unwrap();
    let read = |question: &str| {
        let before = tally.lock().unwrap().shots_read;
        drop(ask(&context, question));
        tally.lock().unwrap().shots_read - before
    };
    let all = read("select count(*) from shots");
    assert_eq!(all, u64::from(FRAMES) * 20);
    // A band of one degree is crossed by an orbit twice a revolution, in 9 frames each time.
    let band = read("select count(*) from shots where latitude_deg between 10 and 11");
    assert!((1..2_000).contains(&band), "{band} shots");
    let time = read("select count(*) from shots where et_s < -19999990.0");
    assert!((1..400).contains(&time), "{time} shots");
    let file = read("select count(*) from shots where source_file = 'ap19020k.b'");
    assert_eq!(file, all / 2);
    assert_eq!(
        read("select count(*) from shots where latitude_deg > 91"),
        0
    );
    // A limit ends the search long before the end of the archive.
    assert!(read("select * from shots limit 5") < all);
    assert!(tally.lock().unwrap().complaints.is_empty());
}

#[test]
fn answers_of_the_command_are_those_of_a_search() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let [asked, csv, found] =
        ["asked.parquet", "asked.csv", "found.parquet"].map(|name| folder.path().join(name));
    // The box and the defaults of `pedr search`.
    let question = "select * from shots where (longitude_deg >= 190 or longitude_deg <= 170) and latitude_deg \
                    between -60 and 60 and return_class = 1 and channel between 1 and 4 and attitude_flag in (0, 1)";
    for out in [&asked, &csv] {
        let output = sql(&archive, &[question, "--out", out.to_str().unwrap()]);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let searched = areograph(&[
        "search",
        archive.to_str().unwrap(),
        "--box=-180,180,-60,60",
        "--out",
        found.to_str().unwrap(),
    ]);
    assert!(searched.status.success());
    let (asked, found) = (parquet(&asked), parquet(&found));
    assert!(asked.num_rows() > 20_000);
    for (column, field) in asked.columns().iter().zip(asked.schema().fields()) {
        assert_eq!(
            Some(column),
            found.column_by_name(field.name()),
            "{}",
            field.name()
        );
    }
    let lines = fs::read_to_string(&csv).unwrap();
    assert_eq!(lines.lines().count(), found.num_rows() + 1);

    let counted = sql(
        &archive,
        &["select count(*) as n from shots", "--format", "csv"],
    );
    assert!(
        String::from_utf8(counted.stdout)
            .unwrap()
            .starts_with("n\n")
    );
    let described = sql(&archive, &["describe shots"]);
    assert!(
        String::from_utf8(described.stdout)
            .unwrap()
            .contains("topography_m")
    );
    let many = sql(&archive, &["select orbit from shots"]);
    assert!(many.status.success());
    assert!(String::from_utf8_lossy(&many.stderr).contains("first 1000 rows"));
}

#[test]
fn questions_without_an_answer_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let out = folder.path().join("none.parquet");
    let out_of = ["--out", out.to_str().unwrap()];
    let unknown = error_of(&sql(
        &archive,
        &["select latitude from shots", out_of[0], out_of[1]],
    ));
    assert!(
        unknown.contains("latitude_deg") && unknown.contains("describe shots"),
        "{unknown}"
    );
    for question in [
        "drop table shots",
        "create table more as select * from shots",
        "insert into shots values (1)",
        "copy shots to 'x.csv'",
        "set datafusion.execution.batch_size = 1",
    ] {
        let refused = sql(&archive, &[question]);
        assert_eq!(
            refused.status.code(),
            Some(2),
            "{question}: {}",
            error_of(&refused)
        );
    }
    let ending = error_of(&sql(&archive, &["select 1", "--out", "answer.xlsx"]));
    assert!(ending.contains("parquet or csv"), "{ending}");
    assert!(!out.exists());

    // A file that is no PEDR file is no silence.
    fs::write(archive.join("ap19040l.b"), b"no PEDR").unwrap();
    let failed = error_of(&sql(
        &archive,
        &["select * from shots", out_of[0], out_of[1]],
    ));
    assert!(failed.contains("ap19040l.b"), "{failed}");
    assert!(!out.exists());
    let left = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 1, "only the archive");
}

#[test]
fn an_answer_without_rows_has_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let question = "select orbit, shot from shots where latitude_deg > 89.9";
    let printed = sql(&archive, &[question, "--format", "csv"]);
    assert!(printed.status.success());
    assert_eq!(printed.stdout, b"orbit,shot\n");
    let [csv, rows] = ["none.csv", "none.parquet"].map(|name| folder.path().join(name));
    for out in [&csv, &rows] {
        let output = sql(&archive, &[question, "--out", out.to_str().unwrap()]);
        assert!(output.status.success());
    }
    assert_eq!(fs::read(&csv).unwrap(), b"orbit,shot\n");
    let rows = parquet(&rows);
    assert_eq!((rows.num_rows(), rows.num_columns()), (0, 2));
}

#[test]
fn what_cannot_be_printed_is_a_failure_and_a_reader_who_went_away_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let nested = sql(
        &archive,
        &[
            "select array_agg(shot) as every from shots where et_s < -19999990.0",
            "--format",
            "csv",
        ],
    );
    assert!(error_of(&nested).contains("list"), "{}", error_of(&nested));
    let ask = |stdout: Stdio| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_areograph"));
        let command = command.args(["pedr", "sql"]).arg(&archive);
        let command = command.args(["select orbit, shot from shots", "--format", "csv"]);
        command
            .stdout(stdout)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    };
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let full = ask(full.into()).wait_with_output().unwrap();
    assert_eq!(full.status.code(), Some(6), "{full:?}");
    let mut gone = ask(Stdio::piped());
    drop(gone.stdout.take());
    assert!(gone.wait().unwrap().success());
}

#[test]
fn two_versions_of_one_orbit_have_no_answer_but_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    write(&archive.join("ap19030k.b"), Datum::Iau1991, 10, |_, _| ());
    let told = error_of(&sql(&archive, &["select count(*) from shots"]));
    for part in ["ap19030k.b", "ap19030l.b", "would be counted twice"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let one = "select count(*) from shots where source_file = 'ap19030l.b'";
    assert!(sql(&archive, &[one]).status.success());
    // A second name of a file is the same file.
    std::os::unix::fs::symlink("ap19030l.b", archive.join("again.b")).unwrap();
    fs::remove_file(archive.join("ap19030k.b")).unwrap();
    assert!(
        sql(&archive, &["select count(*) from shots"])
            .status
            .success()
    );
}

/// What fails beyond the last row of a limit does not count, however far the search is ahead.
#[test]
fn a_limit_does_not_ask_for_what_comes_after() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let table = shots(&archive);
    let second = archive.join("ap19020k.b");
    let bytes = fs::read(&second).unwrap();
    fs::write(&second, &bytes[..bytes.len() / 2]).unwrap();
    let context = context();
    context.register_table("shots", Arc::new(table)).unwrap();
    for _ in 0..10 {
        assert_eq!(ask(&context, "select * from shots limit 5").num_rows(), 5);
    }
}

#[test]
fn a_file_that_changes_under_a_question_ends_it() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path());
    let table = shots(&archive);
    let tally = table.tally();
    let second = archive.join("ap19020k.b");
    let bytes = fs::read(&second).unwrap();
    fs::write(&second, &bytes[..bytes.len() / 2]).unwrap();
    let context = context();
    context.register_table("shots", Arc::new(table)).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .build()
        .unwrap();
    let answer = runtime.block_on(async {
        context
            .sql("select count(*) from shots")
            .await?
            .collect()
            .await
    });
    assert!(answer.is_err());
    let failure = tally.lock().unwrap().failure.take().unwrap();
    assert!(failure.to_string().contains("ap19020k.b"), "{failure}");
}

/// Rows of two sites, in phases whose names folders must encode.
fn campaign(folder: &Path) {
    let row = |site: &str, phase: &str, ties: u32| SiteRow {
        site: site.to_owned(),
        phase: phase.to_owned(),
        state: SiteState::Published,
        verdict: "valid",
        is_valid: true,
        reasons: Vec::new(),
        remarks: Vec::new(),
        failure: String::new(),
        body: Body::Mars,
        place_rad: None,
        images: 2,
        pairs: 1,
        profiles: 2,
        ties,
        footprints: 10,
        kernels: KernelSetName::default(),
        configuration_blake3: String::new(),
        fingerprint: String::new(),
        version: String::new(),
    };
    let rows = CampaignRows {
        sites: vec![
            row("a", "MAPPING PHASE", 5),
            row("b", "", 7),
            row("c", "MAPPING PHASE", 1),
        ],
        ..CampaignRows::default()
    };
    let products = CampaignProducts {
        rows: &rows,
        summary: &pool_sites("test", &rows),
        page: "<html></html>",
    };
    write_campaign_products(folder, &products).unwrap();
}

#[test]
fn tables_of_a_campaign_are_queried_with_their_phases() {
    let folder = tempfile::tempdir().unwrap();
    campaign(folder.path());
    let query = "select phase, sum(ties) as ties from sites group by phase order by phase";
    let answer = sql(folder.path(), &[query, "--format", "csv"]);
    assert!(answer.status.success(), "{}", error_of(&answer));
    let found = String::from_utf8(answer.stdout).unwrap();
    assert_eq!(found, "phase,ties\nMAPPING PHASE,6\nunknown,7\n");
    // The other tables have their columns without a row.
    let answer = sql(
        folder.path(),
        &["select before_along_m from pairs", "--format", "csv"],
    );
    assert_eq!(answer.stdout, b"before_along_m\n");
    let answer = sql(folder.path(), &["delete from sites"]);
    assert!(!answer.status.success());
}
