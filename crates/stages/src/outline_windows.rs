//! Windows defined by the view of an image: their outlines from the image's times and the kernels, before the search
//! for shots.

use std::sync::atomic::AtomicBool;

use super::{
    orientation::{CameraReader, CameraTables, GroundPoint, Nodes},
    tag_times::ImageTimes,
};
use areograph_base::error::{Cause, Result};
use areograph_config::{KernelsConfig, OrientationConfig, PointingConfig, WindowConfig};
use areograph_geom::{image_outline::widened, window::WindowShape};
use areograph_spice::KernelView;
use areograph_store::{
    stage::{InOrder, Input, Inputs, Output, Stage},
    stage_inputs,
};

/// An image whose edges do not all see Mars.
#[derive(Debug, thiserror::Error, Cause)]
#[error("window {window}: a corner of image {image} shows no ground")]
#[cause(Input: "give this window its own edges or polygon")]
struct NoGround {
    window: String,
    image: String,
}

stage_inputs! {
    /// The windows, and the sources of the orientation of the images.
    pub struct OutlineWindows<'a> {
        /// Windows as they are written.
        pub windows: &'a [WindowConfig],
        /// Line times of the images.
        pub images: InOrder<'a, Output<ImageTimes>>,
        /// All kernels: attitude may pass through any frame.
        pub kernels: &'a KernelView,
        /// Tolerance and padding.
        pub coverage: &'a KernelsConfig,
        /// A pointing bias that replaces the camera's.
        pub pointing: &'a PointingConfig,
        /// The convention for light time.
        pub orientation: &'a OrientationConfig,
    }
}

impl Stage for OutlineWindows<'_> {
    const NAME: &'static str = "outline_windows";
    const METHOD: u32 = 2;
    const CHECKED: bool = true;
    type Output = Vec<WindowConfig>;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Vec<WindowConfig>> {
        let windows = self.windows.iter().map(|window| match &window.shape {
            WindowShape::Image { image, margin_m } => Ok(WindowConfig {
                id: window.id.clone(),
                shape: self.outline(&window.id, image, *margin_m)?,
            }),
            _ => Ok(window.clone()),
        });
        windows.collect()
    }
}

impl OutlineWindows<'_> {
    /// Outline of the view of an image, from its support data or from the kernels.
    fn seen(&self, times: &ImageTimes) -> Result<Option<Vec<GroundPoint>>> {
        if let Some(support) = &times.support {
            let nodes = Nodes::new(&CameraTables::of_support(&support.tables));
            return GroundPoint::outline(times, |et| Ok(nodes.camera(et)));
        }
        let session = self.kernels.session()?.of(times.instrument.spacecraft);
        let reader = CameraReader {
            session: &session,
            instrument: &times.instrument,
            bias: self.pointing.bias_of(&times.instrument),
            tolerance_s: self.coverage.ck_tolerance_s,
            light_time: self.orientation.light_time,
        };
        reader.require_coverage(times, self.coverage.padding_s)?;
        GroundPoint::outline(times, |et| reader.camera(et))
    }

    fn outline(&self, window: &str, image: &str, margin_m: f64) -> Result<WindowShape> {
        let lacking = || NoGround {
            window: window.to_owned(),
            image: image.to_owned(),
        };
        let mut images = self.images.0.iter().filter_map(Output::get);
        let times = images.find(|times| times.id == image).ok_or_else(lacking)?;
        let seen = self.seen(times)?.ok_or_else(lacking)?;
        let places = seen.iter();
        let ring = places.map(|point| [point.longitude_rad, point.latitude_rad]);
        let ring: Vec<[f64; 2]> = ring.collect();
        // A metre is the largest angle at the poles.
        let margin_rad = margin_m / times.body.model().polar_radius_m;
        Ok(widened(&ring, margin_rad, margin_rad))
    }
}

/// The windows of a site, with the outlines of images.
#[derive(Debug, Clone, Copy)]
pub struct Windows<'a> {
    /// As they are written.
    pub written: &'a [WindowConfig],
    /// With outlines; `None` where no window is the view of an image.
    pub outlined: Option<&'a Output<Vec<WindowConfig>>>,
}

impl<'a> Windows<'a> {
    /// The windows in order.
    ///
    /// # Errors
    /// A bug in areograph that no stage triggers; see [`Output::value`].
    pub fn value(&self) -> Result<&'a [WindowConfig]> {
        match self.outlined {
            Some(outlined) => Ok(outlined.value()?),
            None => Ok(self.written),
        }
    }
}

impl Input for Windows<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        match &self.outlined {
            Some(outlined) => outlined.add_to(field, inputs),
            None => inputs.setting(field, self.written),
        }
    }
}
