//! The stages of the flow: plain functions from typed input to typed output, none calling another.

pub mod search_footprints;
