//! Groups of verdicts.

/// A group of verdicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    Valid,
    Remarks,
    Invalid,
    NoRun,
}

impl Group {
    /// All groups.
    pub(super) const ALL: [Self; 4] = [Self::Valid, Self::Remarks, Self::Invalid, Self::NoRun];

    /// The group of a verdict.
    pub(super) fn of(verdict: Option<&str>) -> Self {
        match verdict {
            Some("valid") => Self::Valid,
            Some(verdict) if verdict.starts_with("valid") => Self::Remarks,
            Some(_) => Self::Invalid,
            None => Self::NoRun,
        }
    }

    /// Its name in metrics.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::Remarks => "remarks",
            Self::Invalid => "invalid",
            Self::NoRun => "none",
        }
    }
}
