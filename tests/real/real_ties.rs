//! Tie points of real control networks.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use crate::common;

use std::collections::BTreeSet;

use areograph::{
    pds::ties::{TieFile, read_ties},
    ties::TieMeasure,
};

fn images(file: &TieFile) -> BTreeSet<&str> {
    let measures = file.ties.iter().flat_map(|tie| &tie.measures);
    measures.map(|measure| measure.image.as_str()).collect()
}

#[test]
fn the_measures_of_a_moc_network_are_read() {
    let name = "the_measures_of_a_moc_network_are_read";
    let Some(path) = common::real_data("asp_moc/control_net_measures.csv", name) else {
        return;
    };
    let file = read_ties(&path).unwrap();
    // 66 points, 129 measures: three of the points are measured once.
    assert_eq!(file.ties.len(), 66);
    let measures: usize = file.ties.iter().map(|tie| tie.measures.len()).sum();
    assert_eq!(measures, 129);
    assert_eq!(
        file.ties
            .iter()
            .filter(|tie| tie.measures.len() == 1)
            .count(),
        3
    );
    assert!(file.complaints.is_empty());
    let expected = [
        "MGS/610472061:131/MOC-NA/BROAD_BAND",
        "MGS/669329623:36/MOC-NA/BROAD_BAND",
    ];
    assert!(
        images(&file).into_iter().eq(expected),
        "{:?}",
        images(&file)
    );
    let first = &file.ties[0].measures[0];
    assert!((first.line - 282.596_279_800_346_2).abs() < 1e-9); // lines, half a line before ISIS's
}

#[test]
fn the_binary_network_has_the_measures_of_its_table() {
    let name = "the_binary_network_has_the_measures_of_its_table";
    let (Some(path), Some(table)) = (
        common::real_data("asp_moc/control.net", name),
        common::real_data("asp_moc/control_net_measures.csv", name),
    ) else {
        return;
    };
    let (file, table) = (read_ties(&path).unwrap(), read_ties(&table).unwrap());
    assert!(file.complaints.is_empty(), "{:?}", file.complaints);
    assert_eq!(file.ignored, 0);
    // The table has no standard deviations and no known ground.
    let places = |file: &TieFile| -> Vec<(String, String, f64, f64)> {
        let measures = file.ties.iter().flat_map(|tie| {
            let place =
                |of: &TieMeasure<String>| (tie.id.clone(), of.image.clone(), of.line, of.sample);
            tie.measures.iter().map(place)
        });
        measures.collect()
    };
    assert_eq!(places(&file), places(&table));
}

#[test]
fn the_network_of_a_lunar_pair_is_read() {
    let name = "the_network_of_a_lunar_pair_is_read";
    let Some(path) = common::real_data("isis_lidar/LidarNetwork/network.pvl", name) else {
        return;
    };
    let file = read_ties(&path).unwrap();
    assert_eq!(
        (file.ties.len(), file.ignored, file.complaints.len()),
        (311, 0, 0)
    );
    assert!(file.ties.iter().all(|tie| tie.measures.len() == 2));
    assert!(
        images(&file)
            .into_iter()
            .eq(["LRO/1/286265995:36824/NACL", "LRO/1/286272781:34203/NACL"])
    );
    assert_eq!(file.ties[0].id, "lro_pair00002");
    let missing = read_ties(&path.with_file_name("no.pvl")).unwrap_err();
    assert_eq!(missing.kind().exit_code(), 3);
}
