//! Plane triangulation of a net of rectified pictures: bricks, figure, map, standard deviations and blunders.

mod error;
mod judge;
mod lay;
mod place;
mod read;
mod result;
mod run;
mod scales;
mod spread;
mod write;

use std::{path::PathBuf, sync::atomic::AtomicBool};

use areograph_base::error::Result;
use areograph_config::NetConfig;
use areograph_store::{
    files::HashedFile,
    stage::{InOrder, Input, Inputs, Stage},
    stage_inputs,
};

pub use error::NetError;
pub use read::{NetData, read_net};
pub use result::{
    BrickResult, ControlResult, Deviation, MeasurementResult, PictureResult, PointResult, Seams,
    ShrinkageResult, Totals, Triangulation,
};

stage_inputs! {
    /// A net and its files.
    pub struct Triangulate<'a> {
        /// The configuration of the net.
        pub net: NetKeys<'a>,
        /// Its files with their hashes.
        pub files: NetFiles<'a>,
    }
}

/// The keys of a net's configuration that enter the result.
#[derive(Debug)]
pub struct NetKeys<'a>(pub &'a NetConfig);

impl Input for NetKeys<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        inputs.setting("measurements", &self.0.measurements);
        inputs.setting("controls", &self.0.controls);
        inputs.setting("map", &self.0.map);
        inputs.setting("triangulation", &self.0.triangulation);
        // Number of files of each key: hashes do not identify the key.
        inputs.setting("files", &kinds(self.0).map(Vec::len));
    }
}

/// The files of a net, in order.
#[derive(Debug)]
pub struct NetFiles<'a>(pub &'a [HashedFile]);

impl Input for NetFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        InOrder(self.0).add_to("table", inputs);
    }
}

impl Stage for Triangulate<'_> {
    const NAME: &'static str = "triangulate";
    const METHOD: u32 = 15;
    type Output = Triangulation;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Triangulation> {
        let data = read_net(self.net.0)?;
        Ok(run::triangulate(self.net.0, &data)?)
    }
}

/// Every file that a net names, kind by kind.
#[must_use]
pub fn net_files(net: &NetConfig) -> Vec<PathBuf> {
    kinds(net).into_iter().flatten().cloned().collect()
}

/// The tables of a net, by kind.
const fn kinds(net: &NetConfig) -> [&Vec<PathBuf>; 4] {
    [
        &net.measurements.files,
        &net.controls.files,
        &net.pictures.files,
        &net.film.files,
    ]
}
