//! Stored outputs: kept, damaged, and read as they are needed.

use areograph_base::column::{Column, Tiles};

use super::*;

#[test]
fn a_field_that_documents_leave_out_comes_back() {
    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Figure {
        #[serde(skip_serializing_if = "areograph_base::stored::is_left_out")]
        value: Option<f64>,
        unit: String,
    }
    let folder = tempfile::tempdir().unwrap();
    let cache = StageCache::new(folder.path(), false);
    let figure = || Figure {
        value: None,
        unit: "m".to_owned(),
    };
    cache.store("judge", Inputs::new(1), figure()).unwrap();
    let loaded = cache.load::<Figure>("judge", &Inputs::new(1)).unwrap();
    assert_eq!(loaded.value().unwrap(), &figure());
}

#[test]
fn an_output_is_kept_until_an_input_changes_or_the_file_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let cache = StageCache::new(folder.path(), false);
    let inputs = |value: u32| {
        let mut inputs = Inputs::new(1);
        inputs.setting("windows", &value);
        inputs
    };
    let why = |cache: &StageCache, value| cache.load::<u32>("search", &inputs(value)).err();
    assert_eq!(why(&cache, 1), Some(Reason::First));
    let stored = cache.store("search", inputs(1), 10_u32).unwrap();
    let loaded = cache.load::<u32>("search", &inputs(1)).unwrap();
    assert_eq!(loaded.value().unwrap(), &10);
    assert_eq!(loaded.provenance(), stored.provenance());
    let changed = Reason::Changed(vec!["key windows changed".to_owned()]);
    assert_eq!(why(&cache, 2), Some(changed));
    let path = folder.path().join("search");
    let mut bytes = fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    atomic::write(&path, &bytes).unwrap();
    assert_eq!(why(&cache, 1), Some(Reason::Damaged));
    let forced = StageCache::new(folder.path(), true);
    assert_eq!(why(&forced, 1), Some(Reason::Forced));
    cache.forget("search");
    assert_eq!(why(&cache, 1), Some(Reason::First));
    // An entry that exists and cannot be read.
    fs::create_dir(&path).unwrap();
    assert_eq!(why(&cache, 1), Some(Reason::Damaged));
}

#[test]
fn a_large_output_is_read_when_it_is_used_and_a_damaged_one_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let cache = StageCache::new(folder.path(), false).knowing(InputFiles::default());
    let heights: Vec<u32> = (0..1 << 20).collect();
    let stored = cache
        .store("search", Inputs::new(1), heights.clone())
        .unwrap();
    let load = || cache.load::<Vec<u32>>("search", &Inputs::new(1)).unwrap();
    let loaded = load();
    assert_eq!(loaded.provenance(), stored.provenance());
    assert_eq!(loaded.value().unwrap(), &heights);
    let fewer = load().without_rows(|heights| heights.truncate(3));
    assert_eq!(fewer.value().unwrap(), &[0, 1, 2]);
    // One bit, after the output was examined and before it is used.
    let unread = load();
    let path = folder.path().join("search");
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    atomic::write(&path, &bytes).unwrap();
    assert!(!cache.has_lost_output());
    let lost = unread.value().unwrap_err().to_string();
    assert!(cache.has_lost_output() && unread.get().is_none());
    assert!(
        lost.contains("the stored output of search is damaged"),
        "{lost}"
    );
    // The file remains; whoever reads all outputs at once identifies it.
    let at_once = StageCache::new(folder.path(), false);
    let damaged = at_once.load::<Vec<u32>>("search", &Inputs::new(1));
    assert_eq!(damaged.err(), Some(Reason::Damaged));
}

#[test]
fn an_output_whose_bytes_are_read_as_they_are_needed_is_the_same() {
    type Rows = (String, Vec<u32>, Column<f64>, Tiles, Option<char>);
    let folder = tempfile::tempdir().unwrap();
    let cache = StageCache::new(folder.path(), false);
    let rows: Rows = (
        "Gusev".to_owned(),
        (0..9_000).collect(),
        (0..40_000).map(f64::from).collect(),
        Tiles::of([100, 100], &[7; 10_000]),
        Some('σ'),
    );
    cache.store("search", Inputs::new(1), rows.clone()).unwrap();
    let path = folder.path().join("search");
    let mut file = File::open(&path).unwrap();
    let (_, start) = read_head(&mut file).unwrap();
    file.seek(SeekFrom::Start(start)).unwrap();
    assert_eq!(streamed::read::<Rows>(file), Some(rows.clone()));
    let read = |in_memory: u64| read_intact_within::<Rows>(in_memory, &path);
    assert_eq!(read(0).unwrap().1, rows);
    assert_eq!(read(u64::MAX).unwrap().1, rows);
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    atomic::write(&path, &bytes).unwrap();
    assert!(read(0).is_none() && read(u64::MAX).is_none());
}

#[test]
fn an_output_that_a_power_failure_left_incomplete_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let heights: Vec<u32> = (0..1 << 16).collect();
    let cache = StageCache::new(folder.path(), false);
    cache.store("search", Inputs::new(1), heights).unwrap();
    let path = folder.path().join("search");
    let whole = fs::read(&path).unwrap();
    let half = whole.len() / 2;
    let zeros = |kept: usize| [&whole[..kept], &vec![0; whole.len() - kept]].concat();
    let left = [Vec::new(), whole[..half].to_vec(), zeros(half), zeros(0)];
    for bytes in left {
        atomic::write(&path, &bytes).unwrap();
        // Read at once, and on demand.
        let on_demand = StageCache::new(folder.path(), false).knowing(InputFiles::default());
        for cache in [&cache, &on_demand] {
            // Zeros are a header of other inputs: whatever the reason, the stage runs.
            let loaded = cache.load::<Vec<u32>>("search", &Inputs::new(1));
            assert!(loaded.is_err());
        }
        assert_eq!(stored::<Vec<u32>>(folder.path(), "search"), None);
    }
}

#[test]
fn a_large_head_is_read_in_pieces() {
    let folder = tempfile::tempdir().unwrap();
    let cache = StageCache::new(folder.path(), false);
    let mut inputs = Inputs::new(1);
    for image in 0..10_000 {
        inputs.setting(&format!("image {image}"), &image);
    }
    cache.store("publish", inputs.clone(), 7_u32).unwrap();
    assert!(fs::metadata(folder.path().join("publish")).unwrap().len() > 2 * HEAD_BYTES);
    let loaded = cache.load::<u32>("publish", &inputs).unwrap();
    assert_eq!(loaded.value().unwrap(), &7);
}
