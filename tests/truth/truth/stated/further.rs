//! The same statements over missions from other seeds: the last tables of the page.

use std::fmt::Write as _;

use super::{KEYS, Variant, counts, kept, long};

const TABLES: &str = "docs/guide/src/further_missions.md";
const FIRST_SEEDS: [u32; 3] = [60_001, 70_001, 90_001];

const INTRODUCTION: &str = "\
A long test computes these tables (`tests/truth/truth/stated/further.rs`). Entries are ratios, with the share of values
beyond three standard deviations in parentheses.
";

#[test]
fn statements_are_those_of_further_missions() {
    if !long() {
        return;
    }
    let mut tables = INTRODUCTION.to_owned();
    for keys in &KEYS[..2] {
        let sets = FIRST_SEEDS.map(|first_seed| Variant::flown(*keys, first_seed));
        tables += &table(keys[0], &sets);
    }
    kept::is_up_to_date(TABLES, &tables);
}

/// Ratios of the sets, column by column, and the counts of each.
fn table(name: &str, sets: &[Variant; 3]) -> String {
    let mut text = format!("\n### With {name}\n\n| quantity |");
    for first_seed in FIRST_SEEDS {
        let _infallible = write!(text, " seeds from {first_seed} |");
    }
    text += "\n|---|---:|---:|---:|\n";
    let columns = sets.each_ref().map(Variant::quantities);
    for quantity in &columns[0] {
        let _infallible = write!(text, "| {} |", quantity.name);
        for column in &columns {
            let found = column.iter().find(|of| of.name == quantity.name);
            let found = found.unwrap();
            let percent = 100.0 * found.beyond() as f64 / found.pairs.len() as f64;
            let _infallible = write!(text, " {:.2} ({percent:.1} %) |", found.z());
        }
        text.push('\n');
    }
    for (first_seed, set) in FIRST_SEEDS.iter().zip(sets) {
        let of_set = counts(&set.sites);
        let _infallible = write!(text, "\nMissions from seed {first_seed}. {of_set}");
    }
    text
}
