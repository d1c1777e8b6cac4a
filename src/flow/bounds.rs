//! Extent of a run or a plan.

use std::sync::atomic::AtomicBool;

use super::driver::{Exit, Flow};
use crate::{
    error::{Locate, Stopped},
    files::InputFiles,
};

/// Last stage of a run or a plan, and the files that it reads.
pub(super) struct Bounds<'a> {
    /// The stages of the flow in order.
    pub(super) stages: Vec<&'static str>,
    pub(super) until: &'a str,
    pub(super) stop: &'a AtomicBool,
    pub(super) files: InputFiles,
}

impl Bounds<'_> {
    /// Leaves the flow before `stage` if it was not requested, or when the user stops the program.
    pub(super) fn enter(&self, stage: &'static str) -> Flow<()> {
        let place = |name: &str| self.stages.iter().position(|stage| *stage == name);
        if place(self.until) < place(stage) {
            return Err(Exit::StageReached);
        }
        Ok(Stopped::check(self.stop).in_stage(stage)?)
    }
}
