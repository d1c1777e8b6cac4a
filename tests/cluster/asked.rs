//! Queries of a cluster of processes.

use std::{
    path::Path,
    process::Stdio,
    thread::sleep,
    time::{Duration, Instant},
};

use areograph_testing::long_test;
use proptest::{
    prelude::*,
    strategy::ValueTree as _,
    test_runner::{RngAlgorithm, TestRng, TestRunner},
};

use crate::{
    archive, areograph,
    common::archive_server::{ArchiveServer, Listing},
    failed, index, lines, name,
    processes::Cluster,
    sql,
};

/// Relative difference of means and sums: a cluster adds parts in another order, and each addition of doubles rounds
/// by 1.1e-16.
const SUMS: f64 = 1e-10;

fn ask(cluster: &Cluster, archive: &Path, question: &str) -> std::process::Output {
    sql(archive, question, &["--cluster", &cluster.url])
        .output()
        .unwrap()
}

/// Whether texts are equal, or both numbers of about the same value.
fn is_near(a: &str, b: &str) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= SUMS * a.abs().max(b.abs()).max(1e-6);
    let [x, y] = [a, b].map(str::parse::<f64>);
    a == b || x.is_ok_and(|x| y.is_ok_and(|y| near(x, y)))
}

/// Compares two answers: rows exactly, but for sums of doubles.
fn compare(question: &Asked, here: &[String], there: &[String]) {
    let text = &question.text;
    assert_eq!(here.len(), there.len(), "{text}");
    let rows = |lines: &[String]| {
        let mut rows = lines.to_vec();
        if !question.is_ordered {
            rows.sort();
        }
        rows
    };
    for (here, there) in rows(here).iter().zip(&rows(there)) {
        let is_equal = if question.has_sums {
            let [here, there] = [here, there].map(|line| line.split(',').collect::<Vec<_>>());
            let mut cells = here.iter().zip(&there);
            here.len() == there.len() && cells.all(|(a, b)| is_near(a, b))
        } else {
            here == there
        };
        assert!(is_equal, "{text}\n{here}\n{there}");
    }
}

/// A query, and how its answers are compared.
#[derive(Debug, Clone)]
struct Asked {
    text: String,
    is_ordered: bool,
    has_sums: bool,
}

/// A box of longitudes and latitudes.
fn place() -> impl Strategy<Value = String> + Clone {
    (0.0..350.0, 2.0..60.0, -85.0..80.0, 1.0..30.0).prop_map(
        |(west, width, south, height): (f64, f64, f64, f64)| {
            format!(
                "longitude_deg between {west:.3} and {:.3} and latitude_deg between {south:.3} and {:.3}",
                west + width,
                south + height
            )
        },
    )
}

/// A condition on place, time or properties of shots.
fn condition() -> impl Strategy<Value = String> {
    let place = place();
    let others = proptest::sample::select(vec![
        "return_class = 1",
        "channel in (1, 2)",
        "off_nadir_deg < 1",
        "latitude_deg > 70 or latitude_deg < -80.5",
        "abs(latitude_deg) < 12.5",
        "source_file like '%l.b' or longitude_deg < 90",
    ]);
    let others = others.prop_map(str::to_owned);
    prop_oneof![
        3 => place.clone(),
        1 => others.clone(),
        1 => (place.clone(), others).prop_map(|(a, b)| format!("({a}) and ({b})")),
        1 => (place.clone(), place).prop_map(|(a, b)| format!("({a}) or ({b})")),
    ]
}

fn question() -> impl Strategy<Value = Asked> {
    // Rows and their order in a box, since memory for sorting is limited.
    let forms = (condition(), condition(), place(), 0_usize..9);
    forms.prop_map(|(of, other, place, form)| {
        let text = match form {
            0 => format!("select count(*), min(radius_m), max(range_m), min(et_s), max(record) from shots where {of}"),
            1 => format!("select orbit, count(*) as n, avg(topography_m) as mean, stddev(radius_m) as s from shots where {of} group by orbit order by orbit"),
            2 => format!("select source_file, record, shot, et_s, longitude_deg, latitude_deg, radius_m from shots where ({of}) and {place} and shot % 7 = 3"),
            3 => format!("select et_s, range_m, radius_m from shots where {of} order by range_m desc, et_s limit 50"),
            4 => format!("select floor(latitude_deg / 10) as band, floor(longitude_deg / 45) as sector, count(*) as n, sum(topography_m) as total, count(distinct orbit) as orbits from shots where {of} group by 1, 2 order by 1, 2"),
            5 => format!("select a.orbit, a.n, b.n from (select orbit, count(*) as n from shots where {of} group by orbit) a join (select orbit, count(*) as n from shots where {other} group by orbit) b on a.orbit = b.orbit order by a.orbit"),
            6 => format!("select * from (select orbit, et_s, radius_m, row_number() over (partition by orbit order by radius_m desc, et_s) as rank from shots where ({of}) and {place}) where rank <= 3 order by orbit, rank"),
            7 => format!("select upper(source_file) as name, case when return_class = 1 then 'ground' else 'other' end as kind, count(*) as n, median(orbit) as middle from shots where {of} group by 1, 2 order by 1, 2"),
            _ => format!("select et_s, radius_m from shots where ({of}) and radius_m > (select max(radius_m) - 50 from shots where {other}) and shot < 3"),
        };
        Asked {
            has_sums: matches!(form, 1 | 4),
            is_ordered: matches!(form, 1 | 3 | 4 | 5 | 6 | 7),
            text,
        }
    })
}

/// Random queries, the same in every run.
fn questions(count: usize) -> Vec<Asked> {
    let seed = TestRng::from_seed(RngAlgorithm::ChaCha, &[37; 32]);
    let mut runner = TestRunner::new_with_rng(ProptestConfig::default(), seed);
    let mut draw = || question().new_tree(&mut runner).unwrap().current();
    (0..count).map(|_| draw()).collect()
}

/// Asks both; returns the seconds of each, and the number of rows.
fn both(cluster: &Cluster, archive: &Path, question: &Asked) -> ([f64; 2], usize) {
    let begun = Instant::now();
    let here = local(archive, &question.text);
    let local_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let there = lines(&ask(cluster, archive, &question.text));
    let cluster_s = begun.elapsed().as_secs_f64();
    compare(question, &here, &there);
    ([local_s, cluster_s], here.len() - 1)
}

fn local(archive: &Path, question: &str) -> Vec<String> {
    lines(&sql(archive, question, &[]).output().unwrap())
}

/// Kills an executor some time after a query begins, which still runs then and ends with these lines or with an error
/// and no line; returns its seconds.
fn kill_under(
    cluster: &mut Cluster,
    archive: &Path,
    question: &str,
    after: Duration,
    right: &[String],
) -> f64 {
    let begun = Instant::now();
    let mut asked = sql(archive, question, &["--cluster", &cluster.url]);
    asked.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut asked = asked.spawn().unwrap();
    sleep(after);
    assert!(asked.try_wait().unwrap().is_none(), "the query has ended");
    cluster.executors[0].kill();
    let answered = asked.wait_with_output().unwrap();
    if answered.status.success() {
        assert_eq!(lines(&answered), right);
    } else {
        let error = failed(&answered);
        assert!(error.contains(&cluster.url), "{error}");
        assert!(answered.stdout.is_empty());
        println!("{error}");
    }
    begun.elapsed().as_secs_f64()
}

/// A query that takes seconds, and its answer.
const SLOW: &str =
    "select count(distinct sha512(repeat(cast(et_s as varchar), 250))) as n from shots";

#[test]
fn answers_are_the_local_ones() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 6);
    let cluster = Cluster::of(2);
    let asked = questions(12).into_iter();
    let found = asked.filter(|question| both(&cluster, &archive, question).1 > 0);
    assert!(found.count() > 6);
    // What needs no shots needs no cluster either; a query without rows has its columns.
    for text in [
        "describe shots",
        "select 1 as one",
        "select orbit from shots where false",
    ] {
        let here = local(&archive, text);
        assert_eq!(lines(&ask(&cluster, &archive, text)), here, "{text}");
    }
    let none = lines(&ask(
        &cluster,
        &archive,
        "select orbit, shot from shots where latitude_deg > 89.9",
    ));
    assert_eq!(none, ["orbit,shot"]);
    let empty = "select * from (select orbit, row_number() over (partition by orbit order by et_s) as rank from shots where latitude_deg > 89.9) where rank < 3";
    assert_eq!(lines(&ask(&cluster, &archive, empty)), ["orbit,rank"]);
    let unknown = failed(&ask(&cluster, &archive, "select latitude from shots"));
    assert!(unknown.contains("describe shots"), "{unknown}");
    let refused = failed(&ask(&cluster, &archive, "drop table shots"));
    assert!(refused.contains("DDL"), "{refused}");
}

#[test]
fn an_executor_may_be_killed_in_the_middle_of_a_query() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 6);
    let mut cluster = Cluster::of(2);
    let shots = local(&archive, "select count(*) as n from shots");
    let after = Duration::from_millis(700);
    kill_under(&mut cluster, &archive, SLOW, after, &shots);
    both(&cluster, &archive, &questions(1)[0]);

    cluster.scheduler.kill();
    let gone = failed(&ask(&cluster, &archive, "select count(*) from shots"));
    assert!(
        gone.contains("has no answer") && gone.contains(&cluster.url),
        "{gone}"
    );
}

#[test]
fn a_query_without_executors_ends_with_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 2);
    let cluster = Cluster::of(0);
    let waited = failed(&ask(&cluster, &archive, "select count(*) from shots"));
    for part in ["no executor took its tasks", &cluster.url] {
        assert!(waited.contains(part), "{part}: {waited}");
    }
}

#[test]
fn stand_ins_are_read_from_their_server() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 4);
    let server = ArchiveServer::of(folder.path(), Listing::Plain);
    let url = format!("{}/archive", server.url());
    let [limits, mola] = ["limits.toml", "mola"].map(|name| folder.path().join(name));
    std::fs::write(&limits, "contact = 'tester@example.org'\n").unwrap();
    let mut indexed = areograph();
    indexed.args(["--quiet", "pedr", "index", &url, "--into"]);
    let indexed = indexed.arg(&mola).arg("--archives").arg(&limits).output();
    lines(&indexed.unwrap());
    let cluster = Cluster::of(2);
    for question in [
        "select et_s, radius_m from shots where latitude_deg between 20 and 21 order by et_s",
        "select source_file, count(*) as n, max(range_m) as m from shots group by source_file order by source_file",
    ] {
        let here = local(&archive, question);
        assert!(here.len() > 4, "{question}");
        assert_eq!(lines(&ask(&cluster, &mola, question)), here, "{question}");
    }
    // Blocks that have not arrived, of a file that has changed on the server.
    std::fs::remove_dir_all(mola.join(".fetch/blocks")).unwrap();
    let second = archive.join(name(1));
    let bytes = std::fs::read(&second).unwrap();
    let other: Vec<u8> = bytes.iter().map(|byte| byte ^ 1).collect();
    std::fs::write(&second, other).unwrap();
    let changed = failed(&ask(&cluster, &mola, "select count(*) from shots"));
    for part in [&*name(1), "according to the index", &cluster.url] {
        assert!(changed.contains(part), "{part}: {changed}");
    }
}

#[test]
fn a_file_that_cannot_be_searched_ends_a_query_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let archive = archive(folder.path(), 2);
    let cluster = Cluster::of(1);
    // The same orbit in two files is an error of the executor that searches both.
    std::fs::copy(archive.join("ap19020l.b"), archive.join("ap19020m.b")).unwrap();
    index(&archive);
    let twice = failed(&ask(&cluster, &archive, "select count(*) from shots"));
    for part in ["ap19020m.b", "would be counted twice", &cluster.url] {
        assert!(twice.contains(part), "{part}: {twice}");
    }
    // Addresses that an executor cannot have.
    let taken = cluster.url.strip_prefix("df://").unwrap();
    for (listen, expected) in [
        (taken, "listen at the address"),
        ("127.0.0.1:0", "no address at which"),
        ("0.0.0.0:50051", "no address at which"),
    ] {
        let mut executor = areograph();
        executor.args(["pedr", "cluster", "executor", "--scheduler", &cluster.url]);
        let refused = failed(&executor.args(["--listen", listen]).output().unwrap());
        assert!(refused.contains(expected), "{refused}");
    }
    std::fs::remove_file(archive.join("areograph-pedr.index")).unwrap();
    let bare = failed(&ask(&cluster, &archive, "select count(*) from shots"));
    assert!(bare.contains("pedr index"), "{bare}");
}

/// 20 million shots: 50 random queries, and one executor killed in the middle of a query.
#[test]
fn a_large_archive_has_the_local_answers() {
    if !long_test("a_large_archive_has_the_local_answers") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut scene = areograph();
    scene
        .args(["--quiet", "scene", "archive"])
        .arg(folder.path().join("scene"));
    assert!(
        scene
            .args(["--gb", "0.8"])
            .output()
            .unwrap()
            .status
            .success()
    );
    let archive = folder.path().join("scene/pedr");
    index(&archive);
    let mut cluster = Cluster::of(2);
    let shots = local(&archive, "select count(*) as n from shots");
    assert!(shots[1].parse::<u64>().unwrap() > 20_000_000, "{shots:?}");
    let (mut seconds, mut found) = (Vec::new(), 0);
    for question in questions(50) {
        let (taken @ [local_s, cluster_s], rows) = both(&cluster, &archive, &question);
        println!(
            "{local_s:.2} s, {cluster_s:.2} s, {rows} rows: {}",
            question.text
        );
        seconds.push(taken);
        found += usize::from(rows > 0);
    }
    assert!(found > 35, "only {found} queries have an answer");
    let total = |which: usize| seconds.iter().map(|taken| taken[which]).sum::<f64>();
    println!(
        "50 queries: {:.1} s on this computer alone, {:.1} s",
        total(0),
        total(1)
    );

    let text = "select floor(latitude_deg) as y, floor(longitude_deg) as x, count(*) as n, max(et_s) as last from shots group by 1, 2 order by 1, 2";
    let after = Duration::from_secs(3);
    let here = local(&archive, text);
    let taken_s = kill_under(&mut cluster, &archive, text, after, &here);
    println!("with an executor killed after 3 s: {taken_s:.1} s");
}
