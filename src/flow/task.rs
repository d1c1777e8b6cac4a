//! The flows, and what each is called.

use std::path::{Path, PathBuf};

use super::{
    PUBLISH,
    archive::{self, ArchiveRequest, archive},
    calibration::calibration,
    driver::{Flow, SiteDriver},
    laser_match::{self, laser_match},
    net::net,
    outline::Outline,
    site::{STAGES, site},
};
use crate::{
    config::{CalibrationConfig, NetConfig, SiteConfig},
    error::{Cause, Result},
    stages::match_laser::MatchRequest,
};

/// Input of a flow.
#[derive(Debug, Clone, Copy)]
pub enum Task<'a> {
    /// A site, from kernels, shots and labels.
    Site(&'a SiteConfig),
    /// A net of pictures in the plane.
    Net(&'a NetConfig),
    /// The lines of a camera.
    Calibration(&'a CalibrationConfig),
    /// Laser profiles and a terrain model.
    Match(&'a MatchRequest),
    /// An archive of PEDR files.
    Archive(&'a ArchiveRequest<'a>),
}

/// A stage that the flow does not have.
#[derive(Debug, thiserror::Error, Cause)]
#[error("--until is {until:?}; expected a stage of this flow: {}", .stages.join(", "))]
#[cause(Configuration: "name one of these stages")]
struct UnknownStage {
    until: String,
    stages: Vec<&'static str>,
}

impl Task<'_> {
    /// Its name in messages.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Site(config) => &config.site,
            Self::Net(config) => &config.net,
            Self::Calibration(config) => &config.calibration,
            Self::Match(_) => laser_match::NAME,
            Self::Archive(_) => archive::NAME,
        }
    }

    /// Its kind in answers in JSON.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Site(_) => "site",
            Self::Net(_) => "net",
            Self::Calibration(_) => "calibration",
            Self::Match(_) => "model",
            Self::Archive(_) => "archive",
        }
    }

    /// Folder of its products: a subfolder of `out`, or `out` itself where no configuration gives a name.
    pub(super) fn folder(&self, out: &Path) -> PathBuf {
        match self {
            Self::Site(_) | Self::Net(_) | Self::Calibration(_) => out.join(self.name()),
            Self::Match(_) | Self::Archive(_) => out.to_owned(),
        }
    }

    /// Drives the flow.
    pub(super) fn drive<D: SiteDriver>(self, flow: &mut D) -> Flow<()> {
        match self {
            Self::Site(config) => site(flow, config),
            Self::Net(config) => net(flow, config),
            Self::Calibration(config) => calibration(flow, config),
            Self::Match(request) => laser_match(flow, request),
            Self::Archive(request) => archive(flow, request),
        }
    }

    /// The names of its stages in order; of a site those of every site.
    #[must_use]
    pub fn stages(self) -> Vec<&'static str> {
        match self {
            Self::Site(_) => STAGES.to_vec(),
            // Its description reads kernels before the first stage.
            Self::Archive(_) => vec![archive::STAGE, PUBLISH],
            Self::Net(_) | Self::Calibration(_) | Self::Match(_) => self.outline().names(),
        }
    }

    /// Number of stages that a run passes, as far as the configuration determines it.
    #[must_use]
    pub fn stage_count(self) -> usize {
        match self {
            Self::Archive(_) => 2,
            _ => self.outline().passed.len(),
        }
    }

    fn outline(self) -> Outline {
        let mut outline = Outline::default();
        // Nothing is read and nothing runs, so nothing fails.
        let _ = self.drive(&mut outline);
        outline
    }

    /// The stages, of which `until` is one.
    pub(super) fn stages_with(self, until: &str) -> Result<Vec<&'static str>> {
        let stages = self.stages();
        if !stages.contains(&until) {
            let until = until.to_owned();
            return Err(UnknownStage { until, stages }.into());
        }
        Ok(stages)
    }
}
