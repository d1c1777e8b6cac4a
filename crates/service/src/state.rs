//! The states of a job, and its transitions.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// State of a job.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Its inputs are not ready, or a folder of inputs is unavailable.
    Held,
    /// Ready to be taken.
    Queued,
    /// Taken; its worker has not sent a hello.
    Starting,
    /// Its worker is active.
    Running,
    /// Its worker has been asked to stop.
    Cancelling,
    /// Waits for a retry.
    Waiting,
    /// Failed because of configuration, input or coverage: retried when one of its inputs changes or a person requests
    /// it.
    Blocked,
    /// Ended: valid products were published.
    Succeeded,
    /// Ended: the products were up to date.
    Unchanged,
    /// Ended: the products are invalid and did not become current.
    Invalid,
    /// Ended: it failed permanently.
    Failed,
    /// Ended: a person cancelled it.
    Cancelled,
    /// Ended: its inputs reverted to their earlier state.
    Superseded,
}

impl JobState {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::Held,
        Self::Queued,
        Self::Starting,
        Self::Running,
        Self::Cancelling,
        Self::Waiting,
        Self::Blocked,
        Self::Succeeded,
        Self::Unchanged,
        Self::Invalid,
        Self::Failed,
        Self::Cancelled,
        Self::Superseded,
    ];

    /// The states that may follow this one: the complete table of transitions.
    #[must_use]
    pub const fn next(self) -> &'static [Self] {
        use JobState::{
            Blocked, Cancelled, Cancelling, Failed, Held, Invalid, Queued, Running, Starting,
            Succeeded, Superseded, Unchanged, Waiting,
        };
        match self {
            Held => &[Queued, Cancelled, Superseded],
            Queued => &[Starting, Held, Cancelled, Superseded],
            // A worker that never sent a hello may have published nevertheless: the disk takes precedence.
            Starting => &[
                Running, Waiting, Queued, Cancelling, Succeeded, Invalid, Failed,
            ],
            Running => &[
                Succeeded, Unchanged, Invalid, Failed, Blocked, Waiting, Queued, Cancelling,
            ],
            Cancelling => &[Cancelled, Succeeded, Unchanged, Invalid, Queued],
            Waiting | Blocked => &[Queued, Held, Cancelled, Superseded],
            Succeeded | Unchanged | Invalid | Failed | Cancelled | Superseded => &[],
        }
    }

    /// Whether the state is final.
    #[must_use]
    pub const fn is_final(self) -> bool {
        self.next().is_empty()
    }

    /// Whether a worker is, or may be, active.
    #[must_use]
    pub const fn is_active(self) -> bool {
        matches!(self, Self::Starting | Self::Running | Self::Cancelling)
    }

    /// Its name in the database, in the interface and on pages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Queued => "queued",
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Cancelling => "cancelling",
            Self::Waiting => "waiting",
            Self::Blocked => "blocked",
            Self::Succeeded => "succeeded",
            Self::Unchanged => "unchanged",
            Self::Invalid => "invalid",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
            Self::Superseded => "superseded",
        }
    }
}

impl fmt::Display for JobState {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// An unknown name of a state.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown job state {0}")]
pub struct UnknownState(String);

impl FromStr for JobState {
    type Err = UnknownState;

    fn from_str(name: &str) -> Result<Self, UnknownState> {
        let state = Self::ALL.into_iter().find(|state| state.name() == name);
        state.ok_or_else(|| UnknownState(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_can_be_reached_and_left_towards_an_end() {
        let mut reached = vec![JobState::Held, JobState::Queued];
        let mut index = 0;
        while let Some(state) = reached.get(index).copied() {
            for next in state.next() {
                if !reached.contains(next) {
                    reached.push(*next);
                }
            }
            index += 1;
        }
        reached.sort_unstable();
        assert_eq!(reached, JobState::ALL);
        for state in JobState::ALL {
            assert_eq!(state.name().parse(), Ok(state));
            assert!(state.is_final() || state.next().iter().any(|next| next.is_final()));
            assert!(!state.next().contains(&state));
        }
    }
}
