//! The flow without a site: the names of its stages, in their order.

use std::{
    path::PathBuf,
    sync::{LazyLock, atomic::AtomicBool},
};

use super::{
    PUBLISH,
    driver::{Driver, Flow, Publication, SiteDriver},
    site::site,
};
use crate::{
    config::{ImageConfig, SiteConfig, WindowConfig},
    error::Result,
    files::{HashedFile, InputFiles},
    geom::window::WindowShape,
    stage::{Output, Stage},
};

/// The names of the stages in the order of the flow, for `--until`.
#[must_use]
pub fn stages() -> &'static [&'static str] {
    static NAMES: LazyLock<Vec<&str>> = LazyLock::new(|| {
        let mut outline = Outline::default();
        // Without kernels; with an image, its pixels, its window and tie points, so that no stage is skipped.
        let mut config = SiteConfig::default();
        config.images.push(ImageConfig {
            pixels: Some(PathBuf::new()),
            ..ImageConfig::default()
        });
        config.windows.push(WindowConfig {
            id: String::new(),
            shape: WindowShape::Image {
                image: String::new(),
                margin_m: 0.0,
            },
        });
        config.ties.files.push(PathBuf::new());
        config.ties.matched = true;
        config.surface.cell_m = Some(1.0);
        config.surface.orthoimage_cell_m = Some(1.0);
        // Nothing is read and nothing runs, so nothing fails.
        let _ = site(&mut outline, &config);
        outline.names
    });
    &NAMES
}

/// Number of stages that a run of the site passes, counting each image and round.
pub(super) fn stage_count(of: &SiteConfig) -> usize {
    let mut outline = Outline::default();
    // Only the parts of the configuration that determine stages: nothing is read.
    let mut config = SiteConfig::default();
    let image = |image: &ImageConfig| ImageConfig {
        pixels: image.pixels.clone(),
        ..ImageConfig::default()
    };
    config.images = of.images.iter().map(image).collect();
    config.ties.files.clone_from(&of.ties.files);
    config.ties.matched = of.ties.matched;
    config.surface = of.surface.clone();
    let _ = site(&mut outline, &config);
    outline.passed
}

/// The names of the stages of a flow.
#[derive(Default)]
pub(super) struct Outline {
    files: InputFiles,
    never: AtomicBool,
    pub(super) names: Vec<&'static str>,
    /// Stages passed, counting each image.
    pub(super) passed: usize,
}

impl Driver for Outline {
    fn files(&self) -> &InputFiles {
        &self.files
    }

    fn stop(&self) -> &AtomicBool {
        &self.never
    }

    fn enter(&mut self, stage: &'static str) -> Flow<()> {
        if !self.names.contains(&stage) {
            self.names.push(stage);
        }
        Ok(())
    }

    fn stage<S: Stage>(&mut self, stage: &S) -> Flow<Output<S::Output>> {
        self.enter(S::NAME)?;
        self.passed += 1;
        Ok(Output::pending(stage.label()))
    }

    fn hash(&mut self, stage: &'static str, _paths: &[PathBuf]) -> Flow<Vec<HashedFile>> {
        self.enter(stage)?;
        Ok(Vec::new())
    }

    fn attempt<T>(&mut self, _stage: &str, result: Result<T>) -> Flow<Option<T>> {
        Ok(result.ok())
    }

    fn publish(&mut self, _publication: &impl Publication) -> Flow<()> {
        self.passed += 1;
        self.enter(PUBLISH)
    }
}

impl SiteDriver for Outline {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::LOAD_KERNELS;

    #[test]
    fn every_image_has_stages_of_its_own() {
        let count = |images: usize, change: &dyn Fn(&mut SiteConfig)| {
            let mut config = SiteConfig::default();
            config.images.resize_with(images, ImageConfig::default);
            change(&mut config);
            stage_count(&config)
        };
        let [none, one, two] = [0, 1, 2].map(|images| count(images, &|_| ()));
        assert!(none < one && two - one == one - none);
        let read = count(2, &|config| config.ties.files.push(PathBuf::new()));
        assert!(read > two);
        assert!(count(2, &|config| config.ties.matched = true) > two);
        let pixels = |config: &mut SiteConfig| config.images[0].pixels = Some(PathBuf::new());
        assert_eq!(count(2, &pixels), two + 1);
    }

    #[test]
    fn the_flow_begins_with_kernels_passes_the_adjustment_and_ends_with_products() {
        let stages = stages();
        assert_eq!(stages.first(), Some(&LOAD_KERNELS));
        assert_eq!(stages.last(), Some(&PUBLISH));
        let place = |name| stages.iter().position(|stage| *stage == name).unwrap();
        let adjustment = ["register", "read_ties", "match_ties", "adjust", "reorient"].map(place);
        assert!(adjustment.is_sorted(), "{stages:?}");
    }
}
