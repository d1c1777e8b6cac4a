//! The last test program, which says how many tests found what they need from outside (real data, other people's
//! programs, a disk to fill), and which were skipped. A test harness of its own, so that `cargo test` shows it.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what it is for, and helpers of tests may fail loudly"
)]

mod common;

fn main() {
    let (found, skipped) = common::outside::take_notes();
    for (test, why) in &skipped {
        println!("skipped {test}: {why}");
    }
    println!(
        "\ntests that need something from outside: {found} had it, {} skipped\n",
        skipped.len()
    );
}
