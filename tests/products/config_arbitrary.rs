//! Whatever the text, the loader answers: it never panics, and it answers soon.

use std::{path::Path, time::Instant};

use areograph::config::{Document as _, SiteConfig};
use proptest::prelude::*;

const EXAMPLE: &str = include_str!("../../config/sites/example.toml");

fn answer(text: &str) -> String {
    match SiteConfig::parse(text, Path::new("nowhere/site.toml")) {
        Ok(_) => String::new(),
        Err(problems) => problems.to_string(),
    }
}

/// Pieces that reach deep into the loader.
const PIECES: [&str; 24] = [
    "nan",
    "-inf",
    "1e999",
    "-0.0",
    "9223372036854775807",
    "\"\"",
    "\"\u{0}\"",
    "\"/*/*/*\"",
    "[]",
    "[[]]",
    "{}",
    "{a=1}",
    "'../x'",
    "1979-05-27",
    "true",
    "\n[[windows]]\n",
    "\n[[images]]\n",
    "\n[kernels]\n",
    "\n[pedr]\n",
    "files = ['*']\n",
    "= ",
    "é\u{301}",
    "\u{feff}",
    "# ",
];

/// 2000 cases unless `PROPTEST_CASES` says otherwise.
fn seeds_kept() -> ProptestConfig {
    ProptestConfig {
        cases: 2_000,
        ..areograph_testing::seeds_kept("config")
    }
}

proptest! {
    #![proptest_config(seeds_kept())]

    #[test]
    fn any_text_is_answered(text in any::<String>()) {
        answer(&text);
    }

    #[test]
    fn any_changed_example_is_answered(
        cuts in proptest::collection::vec((any::<prop::sample::Index>(), 0_usize..40, 0..PIECES.len()), 1..6)
    ) {
        let mut text = EXAMPLE.to_owned();
        for (at, length, piece) in cuts {
            let start = text.floor_char_boundary(at.index(text.len()));
            let stop = text.ceil_char_boundary((start + length).min(text.len()));
            text.replace_range(start..stop, PIECES[piece]);
        }
        for line in answer(&text).lines() {
            prop_assert!(line.starts_with("nowhere/site.toml:") || line.starts_with('…'), "{line}");
        }
    }

    #[test]
    fn any_number_in_any_numeric_key_is_answered(number in any::<f64>(), key in 0_usize..8) {
        let key = [
            "kernels.padding_s", "pointing.ck_bias_s", "altimeter_clock.bias_s", "range_check.scan_step_s",
            "range_check.scan_half_width_s", "pedr.filter.off_nadir_max_deg",
            "orientation.position_rmse_max_m", "range_check.mean_max_m",
        ][key];
        answer(&format!("{key} = {number:e}\n"));
        answer(&format!("windows = [{{ id = 'w', longitude_deg = [{number:e}, 0], latitude_deg = [0, {number:e}] }}]"));
    }
}

#[test]
fn texts_made_to_be_slow_or_deep_are_answered_soon() {
    let megabyte = 1 << 20;
    for text in [
        "[".repeat(megabyte),
        "a.".repeat(megabyte / 2) + "a = 1",
        format!("a = {}", "[".repeat(megabyte)),
        format!("a = {}", "{a=".repeat(megabyte / 3)),
        "x\n".repeat(megabyte / 2),
        "[[windows]]\n".repeat(megabyte / 12),
        "[[images]]\n".repeat(megabyte / 11),
        "[[images]]\nid='a'\n".repeat(megabyte / 18),
        format!("pedr.filter.channels = [{}]", "9,".repeat(megabyte / 2)),
        format!("kernels.files = [{}]", "'a',".repeat(megabyte / 4)),
        format!("{} = 1", "k".repeat(megabyte)),
        format!("site = '{}'", "k".repeat(megabyte)),
        format!("altimeter_clock.sign = '{}'", "k".repeat(megabyte)),
        format!("pedr.files = ['{}']", "[".repeat(megabyte)),
        format!("pedr.files = ['{}']", "*/".repeat(megabyte / 2)),
    ] {
        let start = Instant::now();
        let found = answer(&text);
        assert!(!found.is_empty() && found.lines().count() <= 101);
        let took = start.elapsed();
        // Milliseconds in practice; the limit only tells a hang from a slow machine.
        assert!(took.as_secs() < 20, "{}… took {took:?}", &text[..30]);
    }
}
