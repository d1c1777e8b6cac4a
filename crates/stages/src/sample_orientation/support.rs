//! Orientation of an image from its support data: their tables, sampled as kernels are.

use nalgebra::Vector3;

use crate::{
    orientation::{
        CameraTables, GroundPoint, LightTimeEffect, Nodes, Orientation, OrientationSample,
    },
    tag_times::ImageTimes,
};
use areograph_base::{error::Result, time::Et};
use areograph_geom::{
    ellipsoid::range_to_ellipsoid_m,
    light_time::{LightTime, light_time_s},
};
use areograph_pds::isd::SupportTables;

/// The orientation of `image` by its support data at `epochs`.
///
/// Only the positions of the tables are known: their offset from the spacecraft is set to zero. Ranges are measured
/// from them where the site declares them to be positions of the spacecraft with the laser.
pub(super) fn support_orientation(
    image: &ImageTimes,
    support: &SupportTables,
    epochs: &[Et],
) -> Result<Orientation> {
    let tables = CameraTables::of_support(support);
    let nodes = Nodes::new(&tables);
    let middle = nodes.camera(image.middle());
    let boresight = middle.to_mars.matrix() * Vector3::z();
    Ok(Orientation {
        image: image.id.clone(),
        body: image.body,
        samples: OrientationSample::at_epochs(image, epochs, |et| Ok(nodes.camera(et)))?,
        outline: GroundPoint::outline(image, |et| Ok(nodes.camera(et)))?,
        light_time: LightTimeEffect {
            convention: LightTime::Support,
            light_time_s: light_time_s(range_to_ellipsoid_m(
                image.body.model(),
                &middle.position,
                &boresight,
            )),
            others: Vec::new(),
        },
        tables,
        centre: None,
        invalid_because: Vec::new(),
        notes: Vec::new(),
    })
}
