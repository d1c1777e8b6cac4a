//! Requested plans, kept in memory for a while.

use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

use serde::Serialize;
use utoipa::ToSchema;

use crate::instant::Instant;

/// Number of plans kept; the oldest are removed first.
const KEPT: usize = 64;

/// A plan: what a run of a site would do.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Plan {
    /// Its number.
    pub(super) id: u64,
    /// The site.
    pub(super) site: String,
    /// When it was requested.
    pub(super) asked_utc: Instant,
    /// `running`, `done` or `failed`.
    pub(super) state: &'static str,
    /// Every stage, whether it would run, and why.
    pub(super) stages: Vec<Step>,
    /// Files that the site reads.
    pub(super) files: Vec<Input>,
    /// The reason for which there is no plan.
    pub(super) problem: Option<String>,
}

/// A stage of a plan.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Step {
    /// Its name.
    pub(super) stage: String,
    /// Whether it would run.
    pub(super) runs: bool,
    /// The reason, or that it would not run.
    pub(super) because: String,
}

/// A file of a plan.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Input {
    /// Its path from its folder of inputs.
    pub(super) file: String,
    /// BLAKE3 of its content.
    pub(super) blake3: String,
}

/// All kept plans.
#[derive(Debug, Default)]
pub(super) struct Plans(Mutex<(u64, BTreeMap<u64, Plan>)>);

impl Plans {
    /// A plan that begins.
    pub(super) fn begin(&self, site: &str, now_ms: i64) -> Plan {
        let mut plans = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        plans.0 += 1;
        let plan = Plan {
            id: plans.0,
            site: site.to_owned(),
            asked_utc: Instant(now_ms),
            state: "running",
            stages: Vec::new(),
            files: Vec::new(),
            problem: None,
        };
        plans.1.insert(plan.id, plan.clone());
        while plans.1.len() > KEPT {
            plans.1.pop_first();
        }
        plan
    }

    /// Ends the plan.
    pub(super) fn end(&self, plan: Plan) {
        let mut plans = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = plans.1.get_mut(&plan.id) {
            *kept = plan;
        }
    }

    /// A plan by its number.
    pub(super) fn get(&self, id: u64) -> Option<Plan> {
        let plans = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        plans.1.get(&id).cloned()
    }
}
