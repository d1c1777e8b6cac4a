//! The table of a cluster without its processes: its partitions are together the table of one computer, and files that
//! are not those for which it was made are errors.

use std::{fs, path::Path, sync::Arc};

use areograph::{
    cluster::{ArchiveTable, Place},
    pds::archive::Opened,
    products::ShotColumns,
    sql::{
        ShotsTable,
        datafusion::{
            arrow::{array::RecordBatch, util::pretty::pretty_format_batches},
            catalog::TableProvider,
            common::Result as Answer,
            prelude::{SessionConfig, SessionContext},
        },
    },
};
use areograph_testing::track::write;

use crate::{FRAMES_OF_FILE, archive, index, name};

fn opened(archive: &Path) -> Opened {
    let opened = Opened::all(&[archive.to_owned()]).unwrap();
    assert!(opened.failures.is_empty());
    opened
}

fn table(archive: &Path) -> Arc<dyn TableProvider> {
    let columns = Arc::new(ShotColumns::default());
    Arc::new(ArchiveTable::of(opened(archive).sources, columns).unwrap())
}

fn answer(table: &Arc<dyn TableProvider>, question: &str) -> Answer<Vec<RecordBatch>> {
    let config = SessionConfig::new().with_target_partitions(4);
    let context = SessionContext::new_with_config(config);
    context.register_table("shots", Arc::clone(table)).unwrap();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async { context.sql(question).await?.collect().await })
}

fn error(table: &Arc<dyn TableProvider>) -> String {
    let question = "select count(*) from shots";
    answer(table, question).unwrap_err().to_string()
}

#[test]
fn an_address_is_a_host_and_a_port() {
    let place: Place = "df://node-1.example:50050".parse().unwrap();
    assert_eq!((&*place.host, place.port), ("node-1.example", 50050));
    assert_eq!(place.to_string(), "df://node-1.example:50050");
    for text in [
        "",
        "node:1",
        "http://node:1",
        "df://node",
        "df://:1",
        "df://a/b:1",
        "df://n:70000",
    ] {
        assert!(text.parse::<Place>().is_err(), "{text}");
    }
}

#[test]
fn partitions_are_together_the_table_of_one_computer() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 4);
    let columns = Arc::new(ShotColumns::default());
    let local: Arc<dyn TableProvider> = Arc::new(ShotsTable::new(
        opened(&archive).sources,
        columns,
        Arc::default(),
    ));
    let shared = table(&archive);
    for question in [
        "select count(*) from shots",
        "select source_file, count(*) as n, max(record) as last from shots group by source_file order by source_file",
        "select * from shots where longitude_deg between 100 and 140 and latitude_deg > 40 order by et_s",
        "select shot, range_m from shots where source_file in ('ap19021k.b', 'ap19023k.b') and et_s < -19993000 order by et_s",
    ] {
        let [here, there] = [&local, &shared].map(|table| {
            let rows = answer(table, question).unwrap();
            pretty_format_batches(&rows).unwrap().to_string()
        });
        assert!(here.lines().count() > 4, "{question}");
        assert!(here == there, "{question}");
    }
    // Every partition may end after the limit.
    let rows = answer(&shared, "select * from shots limit 7").unwrap();
    assert_eq!(rows.iter().map(RecordBatch::num_rows).sum::<usize>(), 7);
}

#[test]
fn other_files_than_planned_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 3);
    let table = table(&archive);
    let second = archive.join(name(1));
    let good = fs::read(&second).unwrap();
    let mut other = good.clone();
    *other.last_mut().unwrap() ^= 1;

    fs::write(&second, &other).unwrap();
    let changed = error(&table);
    assert!(changed.contains(&name(1)), "{changed}");
    assert!(changed.contains("no valid entry in an index"), "{changed}");
    index(&archive);
    let another = error(&table);
    assert!(another.contains(&name(1)), "{another}");
    assert!(another.contains("another file"), "{another}");
    fs::write(&second, &good[..good.len() / 2]).unwrap();
    index(&archive);
    assert!(error(&table).contains("another file"));
    fs::remove_file(&second).unwrap();
    let missing = error(&table);
    assert!(missing.contains(&name(1)), "{missing}");

    // The same bytes, of another time.
    fs::write(&second, &good).unwrap();
    index(&archive);
    assert!(answer(&table, "select count(*) from shots").is_ok());
    fs::remove_file(archive.join("areograph-pedr.index")).unwrap();
    assert!(error(&table).contains("no valid entry in an index"));
    let columns = Arc::new(ShotColumns::default());
    let refused = ArchiveTable::of(opened(&archive).sources, columns).unwrap_err();
    assert!(refused.to_string().contains("pedr index"), "{refused}");
}

#[test]
fn shots_in_two_files_are_found_though_files_are_searched_apart() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 4);
    // Another version of a part of the second and third file.
    let datum = areograph::body::Datum::Iau1991;
    let first = FRAMES_OF_FILE * 2 - 10;
    write(&archive.join("ap19099k.b"), datum, first, |_, _| ());
    index(&archive);
    let twice = error(&table(&archive));
    assert!(twice.contains("would be counted twice"), "{twice}");
}
