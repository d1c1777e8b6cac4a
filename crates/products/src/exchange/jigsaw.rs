//! Files for users of jigsaw: the adjusted network, residuals, points and images in jigsaw's formats.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::{
    adjusted::{adjusted, isis_name, shared_sigmas, tie_sigmas_px},
    binary_network::write_binary_network,
    bundleout::{ImageRow, PointRow, ResidualRow, write_images, write_points, write_residuals},
    control_network::{
        ControlNetwork, EDGE_TO_ISIS, NetworkMeasure, NetworkPoint, write_control_network,
    },
    points::{ImageMeasure, shared_in_words},
};
use crate::{
    AdjustmentProducts, GeometricProducts, ImageProducts, SiteProducts,
    product::{Content, Declaration, Program, Role, Use, Write},
};
use areograph_base::ties::{KnownGround, TieMeasure, TiePoint};
use areograph_geom::{
    attitude::rotation_vector,
    bundle::ORIENTATION_UNKNOWNS,
    ellipsoid::local_axes,
    polynomial::{Polynomial, root_mean_square},
};
use areograph_stages::{
    adjust::{CorrectedImage, CorrectedPoint, ImageResidual, PointKind},
    intersect::IntersectedPoint,
};

pub(crate) static NETWORK: Declaration = Declaration {
    path: "exchange/adjusted.pvl",
    what: "control network with adjusted points, covariances and residuals, as text",
    readers: "ISIS",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        let joined = Joined::new(of.site, geometric, adjustment);
        let network = joined.network();
        write_control_network(path, &network).map(Some)
    }),
    uses: &[],
};

pub(crate) static BINARY_NETWORK: Declaration = Declaration {
    path: "exchange/adjusted.net",
    what: "control network with adjusted points, covariances and residuals, binary",
    readers: "ISIS",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        let joined = Joined::new(of.site, geometric, adjustment);
        let network = joined.network();
        write_binary_network(path, &network).map(Some)
    }),
    uses: &[Use {
        program: Program::Isis,
        lines: "cnetstats fromlist=cubes.lis cnet=adjusted.net",
    }],
};

pub(crate) static RESIDUALS: Declaration = Declaration {
    path: "exchange/residuals.csv",
    what: "tie-point residuals in jigsaw's format, with standard deviations and redundancy numbers",
    readers: "users of jigsaw",
    rows: "measurements",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        let joined = Joined::new(of.site, geometric, adjustment);
        write_residuals(path, &joined.residuals()).map(Some)
    }),
    uses: &[],
};

pub(crate) static POINTS: Declaration = Declaration {
    path: "exchange/bundleout_points.csv",
    what: "adjusted tie points in jigsaw's format; in columns in metres, latitude, longitude and radius are north, \
           east and up",
    readers: "users of jigsaw",
    rows: "tie points",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        let joined = Joined::new(of.site, geometric, adjustment);
        write_points(path, &joined.points()).map(Some)
    }),
    uses: &[],
};

pub(crate) static IMAGES: Declaration = Declaration {
    path: "exchange/bundleout_images.csv",
    what: "orientation corrections in jigsaw's format, relative to the original kernels as ISIS reads them (light \
           time to the centre of {body}): kilometres and degrees for powers of t, which is 0 in the middle of the \
           image and 1 at its end; rotations about the camera axes",

    readers: "users of jigsaw",
    rows: "images",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        let joined = Joined::new(of.site, geometric, adjustment);
        write_images(path, &joined.images()).map(Some)
    }),
    uses: &[],
};

/// The tie points of a site with their adjustment.
struct Joined<'a> {
    site: &'a SiteProducts<'a>,
    adjustment: &'a AdjustmentProducts<'a>,
    ties: &'a [TiePoint],
    serials: Vec<String>,
    files: Vec<String>,
    /// Standard deviations of line and sample of measurements without their own, by image, lines and pixels.
    usual_sigmas_px: Vec<[f64; 2]>,
    /// Adjusted points by the index of their tie point.
    points: BTreeMap<usize, &'a CorrectedPoint>,
    /// Residuals by the indices of tie point and image.
    views: BTreeMap<(usize, usize), &'a ImageResidual>,
    /// Ground points with the adjusted orientation by the index of their tie point.
    intersected: BTreeMap<usize, &'a IntersectedPoint>,
}

impl<'a> Joined<'a> {
    fn new(
        site: &'a SiteProducts<'a>,
        geometric: &GeometricProducts<'a>,
        adjustment: &'a AdjustmentProducts<'a>,
    ) -> Self {
        let result = adjustment.adjusted;
        let points: BTreeMap<usize, &CorrectedPoint> = adjustment
            .adjusted_ties()
            .map(|point| (point.index, point))
            .collect();
        let views = result.views.iter().filter_map(|view| {
            let point = &result.points[view.point];
            let is_tie = point.kind == PointKind::Tie;
            is_tie.then_some(((point.index, view.image), view))
        });
        Self {
            site,
            adjustment,
            ties: &geometric.ties.points,
            serials: site
                .images
                .iter()
                .map(|image| isis_name(site, image))
                .collect(),
            files: site
                .images
                .iter()
                .map(|image| format!("{}.cub", image.times.id))
                .collect(),
            usual_sigmas_px: tie_sigmas_px(site, adjustment),
            views: views.collect(),
            intersected: adjustment
                .intersected
                .points
                .iter()
                .map(|point| (point.tie, point))
                .collect(),
            points,
        }
    }

    /// All measurements with the indices of their tie points.
    fn measures(&self) -> impl Iterator<Item = (usize, &'a TieMeasure)> {
        let ties = self.ties.iter().enumerate();
        ties.flat_map(|(index, tie)| tie.measures.iter().map(move |measure| (index, measure)))
    }

    /// Standard deviations of line and sample of a measurement, lines and pixels.
    fn sigma_px(&self, measure: &TieMeasure) -> [f64; 2] {
        measure
            .sigma_px
            .unwrap_or(self.usual_sigmas_px[measure.image])
    }

    /// Measured minus adjusted line and sample; of a rejected point by its intersection.
    fn residual_px(&self, tie: usize, measure: &TieMeasure) -> Option<[f64; 2]> {
        if let Some(view) = self.views.get(&(tie, measure.image)) {
            return Some(view.in_image_px);
        }
        let point = self.intersected.get(&tie)?;
        let mut own = point.measures.iter();
        let own = own.find(|of| of.image == measure.image)?;
        let sense = self.site.images[measure.image]
            .times
            .detector()
            .sample_sense;
        Some([own.reprojection_lines, sense * own.reprojection_px])
    }

    fn network(&'a self) -> ControlNetwork<'a> {
        let point = |(index, tie): (usize, &'a TiePoint)| {
            let found = self.points.get(&index);
            let measures = tie.measures.iter().map(|measure| NetworkMeasure {
                measure: ImageMeasure {
                    image: &self.serials[measure.image],
                    line: measure.line,
                    sample: measure.sample,
                },
                sigma_px: Some(self.sigma_px(measure)),
                residual_px: self.residual_px(index, measure),
            });
            NetworkPoint {
                id: &tie.id,
                known: tie.known,
                initial_m: found.map(|point| point.initial.xyz_m),
                adjusted: found.map(|point| adjusted(point)),
                is_rejected: found.is_none(),
                measures: measures.collect(),
            }
        };
        let description = format!(
            "adjusted tie points of areograph; {}; {}",
            self.site.config.body.names().short_frame,
            shared_in_words(shared_sigmas(self.adjustment).as_ref()),
        );
        ControlNetwork {
            id: &self.site.config.site,
            body: self.site.config.body,
            description,
            created_utc: self.site.newest_utc(),
            points: self.ties.iter().enumerate().map(point).collect(),
        }
    }

    fn residuals(&self) -> Vec<ResidualRow<'_>> {
        let row = |(tie, measure): (usize, &TieMeasure)| {
            let image = measure.image;
            let times = self.site.images[image].times;
            let detector = times.detector();
            let pixel_mm = times.instrument.optics.focal_length_mm / detector.focal_length_px;
            let place_px = detector.place_px(measure.sample);
            let view = self.views.get(&(tie, image));
            let [line_sigma, sample_sigma] = self.sigma_px(measure);
            let across_along = |view: &&ImageResidual| [view.across_px, view.along_px];
            ResidualRow {
                point: &self.ties[tie].id,
                file: &self.files[image],
                serial: &self.serials[image],
                // Areograph's coordinate runs against the samples where their sense is negative; the coordinate of ISIS
                // never does.
                focal_mm: [
                    pixel_mm * place_px.x,
                    pixel_mm * detector.sample_sense * place_px.y,
                ],
                place: [measure.sample, measure.line].map(|edge| edge + EDGE_TO_ISIS),
                residual_px: self
                    .residual_px(tie, measure)
                    .map(|[line, sample]| [sample, line]),
                sigma_px: [sample_sigma, line_sigma],
                redundancy: view
                    .map(across_along)
                    .map(|of| of.map(|one| one.redundancy)),
                standardised: view
                    .map(across_along)
                    .map_or([None; 2], |of| of.map(|one| one.standardised)),
                rejected: !self.points.contains_key(&tie),
            }
        };
        self.measures().map(row).collect()
    }

    fn points(&self) -> Vec<PointRow<'_>> {
        let row = |(index, point): (&usize, &&'a CorrectedPoint)| {
            let tie = &self.ties[*index];
            let residuals = tie.measures.iter();
            let residuals: Vec<[f64; 2]> = residuals
                .filter_map(|measure| Some(self.views.get(&(*index, measure.image))?.in_image_px))
                .collect();
            PointRow {
                id: &tie.id,
                status: status(tie.known.as_ref()),
                measures: residuals.len(),
                rms_px: root_mean_square(residuals.as_flattened()),
                ground: adjusted(point),
                relative_sigmas_m: point.relative_sigmas_m(),
                initial_m: point.initial.xyz_m,
            }
        };
        self.points.iter().map(row).collect()
    }

    fn images(&self) -> Vec<ImageRow<'_>> {
        let images = self.adjustment.adjusted.images.iter().enumerate();
        // Lines and samples separately, and the number of measurements, by image.
        let mut residuals = vec![[Vec::new(), Vec::new()]; self.site.images.len()];
        for ((_, image), view) in &self.views {
            let [lines, samples] = &mut residuals[*image];
            lines.push(view.in_image_px[0]);
            samples.push(view.in_image_px[1]);
        }
        let mut measured = vec![0; self.site.images.len()];
        for (_, measure) in self.measures() {
            measured[measure.image] += 1;
        }
        let row = |(index, image): (usize, &'a CorrectedImage)| {
            let [lines, samples] = &residuals[index];
            let [line_px, sample_px] = [lines, samples].map(|of| root_mean_square(of));
            // As many lines as samples.
            let all = (0.5 * (line_px.powi(2) + sample_px.powi(2))).sqrt();
            let constants = [0, 3, 6];
            let position_m2 = Matrix3::from_fn(|row, column| {
                image.covariance[(constants[row], constants[column])]
            });
            let local = local_axes(&middle_m(&self.site.images[index]));
            let local_m2 = local * position_m2 * local.transpose();
            ImageRow {
                file: &self.files[index],
                rms_px: [sample_px, line_px, all],
                initial: over_isis(&self.site.images[index]),
                correction: &image.correction,
                prior_sigmas: &image.prior_sigmas,
                sigmas: &image.sigmas,
                local_sigmas_m: [0, 1, 2].map(|axis| local_m2[(axis, axis)].sqrt()),
                measures: [lines.len(), measured[index] - lines.len()],
            }
        };
        images.map(row).collect()
    }
}

/// The type of a point in jigsaw's terms.
const fn status(known: Option<&KnownGround>) -> &'static str {
    match known {
        None => "FREE",
        Some(KnownGround {
            covariance_m2: Some(_),
            ..
        }) => "CONSTRAINED",
        Some(_) => "FIXED",
    }
}

/// The camera of an image before the adjustment over the camera that ISIS reads from the same kernels, as coefficients of
/// corrections: zero where both are the same.
///
/// The difference is the light time to the centre of the body, over an image a parabola within 1 mm (a test measures it).
fn over_isis(image: &ImageProducts) -> [f64; ORIENTATION_UNKNOWNS] {
    let mut over = [0.0; ORIENTATION_UNKNOWNS];
    let ImageProducts {
        times, orientation, ..
    } = image;
    if orientation.centre.is_none() {
        return over;
    }
    let (isis, _) = orientation.as_isis_sees(times);
    let (own, isis) = (orientation.tables.poses(times), isis.poses(times));
    let half_lines = 0.5 * f64::from(times.line_times.lines());
    let (mut at, mut apart) = (Vec::new(), Vec::new());
    for ((x, own), (_, isis)) in own.iter().zip(&isis) {
        let turned = own.mars_to_camera * isis.mars_to_camera.transpose();
        at.push(x / half_lines);
        apart.push((own.position_m - isis.position_m, rotation_vector(&turned)));
    }
    for quantity in 0..ORIENTATION_UNKNOWNS / 3 {
        let values = apart.iter().map(|(position_m, turn_rad)| match quantity {
            0..3 => position_m[quantity],
            _ => turn_rad[quantity - 3],
        });
        if let Some(fit) = Polynomial::fit(&at, &values.collect::<Vec<_>>(), 2) {
            over[3 * quantity..][..3].copy_from_slice(fit.polynomial.coefficients());
        }
    }
    over
}

/// Position of the camera in the middle of an image, metres.
fn middle_m(image: &ImageProducts) -> Vector3<f64> {
    let samples = &image.orientation.samples;
    samples
        .get(samples.len() / 2)
        .map(|sample| sample.position.xyz_m)
        .unwrap_or_default()
}
