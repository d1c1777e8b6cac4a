//! Stated accuracies and verdicts against the truth of synthetic missions.

mod clean_missions;
#[path = "../common/mod.rs"]
mod common;
mod joined_terrain;
mod matched_ties;
mod mutations;
mod orthoimages;
mod scene_campaign;
mod scene_errors;
mod scene_mission;
mod scene_ties;
mod truth;
