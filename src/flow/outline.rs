//! A flow without its files: the stages that it passes.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use super::{
    PUBLISH,
    driver::{Driver, Flow, Publication, SiteDriver},
};
use crate::{
    error::Result,
    files::{HashedFile, InputFiles},
    stage::{Output, Stage},
};

/// Passes a flow, reads nothing and runs nothing.
#[derive(Default)]
pub(super) struct Outline {
    files: InputFiles,
    never: AtomicBool,
    /// The names of the stages passed, once for each image and round.
    pub(super) passed: Vec<&'static str>,
}

impl Outline {
    /// The names of the stages, in the order in which the flow passes them first.
    pub(super) fn names(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        for name in &self.passed {
            if !names.contains(name) {
                names.push(*name);
            }
        }
        names
    }
}

impl Driver for Outline {
    fn files(&self) -> &InputFiles {
        &self.files
    }

    fn stop(&self) -> &AtomicBool {
        &self.never
    }

    fn enter(&mut self, _stage: &'static str) -> Flow<()> {
        Ok(())
    }

    fn stage<S: Stage>(&mut self, stage: &S) -> Flow<Output<S::Output>> {
        self.passed.push(S::NAME);
        Ok(Output::pending(stage.label()))
    }

    fn hash(&mut self, _stage: &'static str, _paths: &[PathBuf]) -> Flow<Vec<HashedFile>> {
        Ok(Vec::new())
    }

    fn attempt<T>(
        &mut self,
        _stage: &str,
        _step: impl FnOnce(&InputFiles) -> Result<T>,
    ) -> Flow<Option<T>> {
        Ok(None)
    }

    fn publish(&mut self, _publication: &impl Publication) -> Flow<()> {
        self.passed.push(PUBLISH);
        Ok(())
    }
}

impl SiteDriver for Outline {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        config::{ImageConfig, SiteConfig, WindowConfig},
        flow::{LOAD_KERNELS, STAGES, Task, site::site},
        geom::window::WindowShape,
        kernel_source::KernelSource,
        stages::{interpolate_shots::InterpolateShots, rectify_images::RectifyImages},
    };

    #[test]
    fn every_image_has_stages_of_its_own() {
        let count = |images: usize, change: &dyn Fn(&mut SiteConfig)| {
            let mut config = SiteConfig::default();
            config.images.resize_with(images, ImageConfig::default);
            change(&mut config);
            Task::Site(&config).stage_count()
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
    fn stages_are_listed_in_the_order_in_which_the_flow_passes_them() {
        let mut config = SiteConfig::default();
        // Three images have several pairs.
        for _ in 0..3 {
            config.images.push(ImageConfig {
                pixels: Some(PathBuf::new()),
                ..ImageConfig::default()
            });
        }
        config.windows.push(WindowConfig {
            id: String::new(),
            shape: WindowShape::Image {
                image: String::new(),
                margin_m: 0.0,
            },
        });
        config.kernels.source = KernelSource::Sets(Vec::new());
        config.ties.files.push(PathBuf::new());
        config.ties.matched = true;
        config.surface.cell_m = Some(1.0);
        config.surface.orthoimage_cell_m = Some(1.0);
        config.surface.mosaic = true;
        let mut outline = Outline::default();
        site(&mut outline, &config).unwrap();
        let mut first = outline.names();
        // Without a terrain model, orthoimages are on the ground between shots.
        config.surface.cell_m = None;
        let mut without = Outline::default();
        site(&mut without, &config).unwrap();
        let without = without.names();
        let at = without
            .iter()
            .position(|name| *name == InterpolateShots::NAME)
            .unwrap();
        assert_eq!(without[at + 1], RectifyImages::NAME);
        let rectified = first
            .iter()
            .position(|name| *name == RectifyImages::NAME)
            .unwrap();
        first.insert(rectified, without[at]);
        let listed: Vec<&str> = STAGES.to_vec();
        let (load, stages) = listed.split_first().unwrap();
        assert_eq!(*load, LOAD_KERNELS);
        let mut sorted = first.clone();
        sorted.sort_by_key(|name| stages.iter().position(|stage| stage == name));
        assert_eq!(first, sorted);
        first.sort_unstable();
        let mut stages = stages.to_vec();
        stages.sort_unstable();
        assert_eq!(first, stages);
    }
}
