//! Stated accuracies and verdicts against the truth of synthetic missions.

#[path = "../common/mod.rs"]
mod common;
mod mutations;
mod scene_errors;
mod scene_mission;
mod scene_ties;
mod truth;
