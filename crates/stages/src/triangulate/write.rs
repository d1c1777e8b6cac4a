//! The result with names and in metres.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    judge::{Evidence, judge},
    lay::{Laid, shown_controls},
    place::{Placed, control_sigma_m},
    read::NetData,
    result::{
        BrickResult, ControlResult, Deviation, MeasurementResult, PictureResult, PointResult,
        Seams, ShrinkageResult, Totals, Triangulation,
    },
    scales::{Scales, SizeCheck},
    spread::{half_side, largest, rms, rms_of_both},
};
use areograph_config::NetConfig;
use areograph_geom::plane::{
    FLAG_LIMIT, Figure, Place, Precision, Shrinkage, Solution, projection_floor_m, robust_sigma,
};

/// Deviations below this share of a figure's size are rounding, as are redundancies below it.
const ROUNDING: f64 = 1e-9;

/// All data from which the result is written.
pub(super) struct Report<'a> {
    pub(super) config: &'a NetConfig,
    pub(super) data: &'a NetData,
    pub(super) laid: &'a Laid,
    pub(super) placed: &'a Placed,
    pub(super) sizes: &'a [SizeCheck],
}

impl Report<'_> {
    /// The result with names and in metres.
    pub(super) fn write(&self) -> Triangulation {
        let precision = self.placed.solution.precision();
        let of_point = Solution::measurements_of(&self.placed.weighted);
        let places = self.places(&of_point);
        let measurements = self.measurements(&precision, &of_point, &places);
        let points = self.points(&precision, &of_point, &places);
        let pictures = self.pictures(&precision, &of_point, &measurements);
        let controls = self.controls(&places);
        let bricks = self.bricks(&measurements);
        let seams = self.seams();
        let totals = self.totals(&measurements, &points, &pictures, &controls);
        let remarks = [&*self.data.remarks, &*self.laid.remarks].concat();
        let verdict = judge(&Evidence {
            totals: &totals,
            bricks: &bricks,
            seams: seams.as_ref(),
            controls: &controls,
            scales: &Scales::of(self.sizes, &pictures, self.laid, self.config.controls.limit),
            measurements: measurements.len(),
            complaints: self.data.complaint_count,
            remarks: &remarks,
        });
        Triangulation {
            pictures,
            points,
            measurements,
            controls,
            bricks,
            seams,
            totals,
            verdict,
            complaints: self.data.complaints.clone(),
            complaint_count: self.data.complaint_count,
        }
    }

    /// Mean of the images of every point, blunders left out.
    fn places(&self, of_point: &[Vec<usize>]) -> Vec<Option<Place>> {
        let image = |index: &usize| {
            let measured = &self.laid.net.measurements[*index];
            self.placed.pictures[measured.picture].map(measured.at)
        };
        let mean = |of: &Vec<usize>| {
            let sum = of.iter().map(image).sum::<Place>();
            (!of.is_empty()).then(|| sum / of.len() as f64)
        };
        of_point.iter().map(mean).collect()
    }

    /// Mean of the images of points that were left out completely.
    fn places_of_removed(&self, places: &[Option<Place>]) -> BTreeMap<usize, Place> {
        let mut sums: BTreeMap<usize, (Place, f64)> = BTreeMap::new();
        for measured in &self.data.net.measurements {
            if places[measured.point].is_none() {
                let image = self.placed.pictures[measured.picture].map(measured.at);
                let (sum, count) = sums.entry(measured.point).or_default();
                *sum += image;
                *count += 1.0;
            }
        }
        let means = sums.into_iter();
        means
            .map(|(point, (sum, count))| (point, sum / count))
            .collect()
    }

    fn geographic(&self, place: Place) -> [f64; 2] {
        let (longitude, latitude) = self.config.map.map.unproject((place.re, place.im));
        [longitude, latitude]
    }

    fn points(
        &self,
        precision: &Precision,
        of_point: &[Vec<usize>],
        places: &[Option<Place>],
    ) -> Vec<PointResult> {
        let net = &self.placed.weighted;
        let weights: BTreeMap<usize, f64> = net
            .controls
            .iter()
            .map(|control| (control.point, control.weight))
            .collect();
        let points = places.iter().enumerate();
        let points = points.filter_map(|(point, place)| {
            let (place, of, weight) = ((*place)?, &of_point[point], weights.get(&point).copied());
            let sigma_m = self
                .placed
                .tie_sigma_m
                .map(|sigma_m| sigma_m * precision.place(net, of, weight).sqrt());
            Some(PointResult {
                point: self.data.points[point].clone(),
                pictures: count(of.len()),
                is_control: weight.is_some(),
                place_m: [place.re, place.im],
                place_rad: self.geographic(place),
                sigma_m,
            })
        });
        points.collect()
    }

    fn measurements(
        &self,
        precision: &Precision,
        of_point: &[Vec<usize>],
        places: &[Option<Place>],
    ) -> Vec<MeasurementResult> {
        let (in_brick, flagged) = self.in_bricks();
        let mut alive_as = vec![None; self.data.net.measurements.len()];
        for (at, index) in self.laid.alive.iter().enumerate() {
            alive_as[*index] = Some(at);
        }
        let gone = self.places_of_removed(places);
        let measured = self.data.net.measurements.iter().enumerate();
        let results = measured.map(|(index, measured)| {
            let image = self.placed.pictures[measured.picture].map(measured.at);
            let place = places[measured.point]
                .or_else(|| gone.get(&measured.point).copied())
                .unwrap_or(image);
            let of = &of_point[measured.point];
            MeasurementResult {
                picture: self.data.pictures[measured.picture].clone(),
                point: self.data.points[measured.point].clone(),
                at: [measured.at.re, measured.at.im],
                place_m: [place.re, place.im],
                deviation: deviation(image - place),
                in_brick: in_brick[index].map(deviation),
                redundancy: alive_as[index]
                    .map_or(1.0, |at| precision.deviation(&self.placed.weighted, of, at)),
                flagged: flagged[index],
                removed: self.laid.removed[index],
            }
        });
        results.collect()
    }

    /// Deviations within bricks along the axes of the map, and which of them are flagged.
    fn in_bricks(&self) -> (Vec<Option<Place>>, Vec<bool>) {
        let count = self.data.net.measurements.len();
        let (mut deviations, mut flagged) = (vec![None; count], self.laid.removed.clone());
        for (brick, figure) in self.laid.figures.iter().enumerate() {
            let turn = self.placed.bricks[brick].turn;
            let tied = self.tied(figure);
            let limit = FLAG_LIMIT * robust_sigma(tied.iter().map(|(_, of)| *of));
            let limit = limit.max(ROUNDING * figure.extent());
            for (index, of) in tied {
                deviations[index] = Some(of * turn);
                flagged[index] = of.norm() > limit;
            }
        }
        (deviations, flagged)
    }

    /// Deviations of a brick's points on several of its pictures.
    fn tied(&self, figure: &Figure) -> Vec<(usize, Place)> {
        let mut views: BTreeMap<usize, u32> = BTreeMap::new();
        let point = |index: usize| self.data.net.measurements[index].point;
        for (index, _) in &figure.deviations {
            *views.entry(point(*index)).or_default() += 1;
        }
        let tied = figure.deviations.iter();
        tied.filter(|(index, _)| views[&point(*index)] > 1)
            .copied()
            .collect()
    }

    fn pictures(
        &self,
        precision: &Precision,
        of_point: &[Vec<usize>],
        measurements: &[MeasurementResult],
    ) -> Vec<PictureResult> {
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); self.data.pictures.len()];
        for (index, measured) in self.data.net.measurements.iter().enumerate() {
            own[measured.picture].push(index);
        }
        let mut brick_of = vec![""; self.data.pictures.len()];
        for (figure, name) in self.laid.figures.iter().zip(&self.laid.names) {
            for picture in &figure.pictures {
                brick_of[*picture] = name;
            }
        }
        let map = &self.config.map.map;
        let pictures = self.placed.pictures.iter().enumerate();
        let pictures = pictures.map(|(picture, way)| {
            let at = |index: &usize| self.data.net.measurements[*index].at;
            let places: Vec<Place> = own[picture].iter().map(at).collect();
            let centre = way.map(places.iter().sum::<Place>() / places.len().max(1) as f64);
            let half_side = half_side(&places) * way.scale();
            let place = (centre.re, centre.im);
            let deviations: Vec<Place> = own[picture]
                .iter()
                .filter(|index| of_point[self.data.net.measurements[**index].point].len() > 1)
                .map(|index| &measurements[*index])
                .filter(|of| !of.removed)
                .map(|of| Place::new(of.deviation.x_m, of.deviation.y_m))
                .collect();
            let [turn, shift] = precision.picture(picture);
            let sigma_m = self.placed.tie_sigma_m;
            PictureResult {
                picture: self.data.pictures[picture].clone(),
                brick: brick_of[picture].to_owned(),
                coefficients: [way.turn.re, way.turn.im, way.shift.re, way.shift.im],
                angle_rad: way.angle_rad(),
                centre_m: [centre.re, centre.im],
                centre_rad: self.geographic(centre),
                sigma_m: sigma_m.map(|sigma_m| sigma_m * shift.sqrt()),
                sigma_scale: sigma_m.map(|sigma_m| sigma_m * turn.sqrt() / way.scale()),
                ties: count(deviations.len()),
                deviation_rms_m: rms_of_both(&deviations),
                projection_floor_m: projection_floor_m(
                    half_side / map.scale(place),
                    map.scale_gradient(place),
                    map.radius_m,
                ),
            }
        });
        pictures.collect()
    }

    fn controls(&self, places: &[Option<Place>]) -> Vec<ControlResult> {
        let shown = shown_controls(&self.laid.net, &self.laid.block.places);
        let judged = self
            .laid
            .scaled
            .residuals
            .iter()
            .zip(&self.laid.scaled.kept);
        let controls = shown
            .iter()
            .zip(judged)
            .map(|((index, _, given), (of_scale, kept))| {
                let point = self.laid.net.controls[*index].point;
                let residual = places[point].map_or(*of_scale, |place| given - place);
                ControlResult {
                    point: self.data.points[point].clone(),
                    given_m: [given.re, given.im],
                    residual_m: [residual.re, residual.im],
                    scale_residual_m: [of_scale.re, of_scale.im],
                    sigma_m: control_sigma_m(self.config, self.data, self.laid, *index),
                    kept: *kept,
                }
            });
        controls.collect()
    }

    fn bricks(&self, measurements: &[MeasurementResult]) -> Vec<BrickResult> {
        let mut removed_in = vec![0; self.data.pictures.len()];
        for (measured, removed) in self.data.net.measurements.iter().zip(&self.laid.removed) {
            removed_in[measured.picture] += usize::from(*removed);
        }
        let bricks = self.laid.figures.iter().enumerate();
        let bricks = bricks.map(|(brick, figure)| {
            let turn = self.placed.bricks[brick].turn;
            let tied = self.tied(figure);
            let deviations: Vec<Place> = tied.iter().map(|(_, of)| of * turn).collect();
            let points: BTreeSet<usize> = tied
                .iter()
                .map(|(index, _)| self.data.net.measurements[*index].point)
                .collect();
            let flagged = tied
                .iter()
                .filter(|(index, _)| measurements[*index].flagged);
            let removed = figure.pictures.iter().map(|picture| removed_in[*picture]);
            BrickResult {
                brick: self.laid.names[brick].clone(),
                pictures: count(figure.pictures.len()),
                ties: count(points.len()),
                redundancy: count(figure.redundancy.total()),
                largest_m: largest(&deviations),
                rms_m: rms(&deviations),
                robust_sigma_m: robust_sigma(deviations.iter().copied()),
                flagged: count(flagged.count()),
                removed: count(removed.sum()),
                shrinkage: figure.shrinkage.map(shrinkage),
            }
        });
        bricks.collect()
    }

    fn seams(&self) -> Option<Seams> {
        let seams = &self.placed.seams;
        let points: BTreeSet<usize> = self
            .laid
            .block
            .seams
            .iter()
            .map(|(_, point, _)| *point)
            .collect();
        (self.laid.figures.len() > 1).then(|| Seams {
            points: count(points.len()),
            largest_m: largest(seams),
            rms_m: rms(seams),
            local_rms_m: self.placed.local_rms_m,
            shrinkage: self.laid.block.shrinkage.map(shrinkage),
        })
    }

    fn totals(
        &self,
        measurements: &[MeasurementResult],
        points: &[PointResult],
        pictures: &[PictureResult],
        controls: &[ControlResult],
    ) -> Totals {
        let redundancy = self.placed.solution.redundancy;
        let used = measurements
            .iter()
            .filter(|measurement| !measurement.removed);
        let deviations: Vec<Place> = used
            .clone()
            .filter(|measurement| measurement.redundancy > ROUNDING)
            .map(|measurement| Place::new(measurement.deviation.x_m, measurement.deviation.y_m))
            .collect();
        let residuals: Vec<Place> = controls
            .iter()
            .filter(|control| control.kept)
            .map(|control| Place::new(control.residual_m[0], control.residual_m[1]))
            .collect();
        let largest_sigma_m = points
            .iter()
            .filter_map(|point| point.sigma_m)
            .reduce(f64::max);
        Totals {
            tie_equations: redundancy.ties as u64,
            control_equations: redundancy.controls as u64,
            unknowns: redundancy.unknowns as u64,
            redundancy: redundancy.total() as u64,
            tie_sigma_m: self.placed.tie_sigma_m,
            tie_sigma_given: self.config.triangulation.tie_sigma_m.is_some(),
            scale_sigma_m: self.laid.scaled.sigma,
            control_rms_m: rms(&residuals),
            deviation_rms_m: rms(&deviations),
            removed: measurements
                .iter()
                .filter(|measurement| measurement.removed)
                .count() as u64,
            flagged: used.filter(|of| of.flagged).count() as u64,
            rejected_controls: controls.iter().filter(|control| !control.kept).count() as u64,
            largest_sigma_m,
            projection_floor_m: pictures
                .iter()
                .map(|picture| picture.projection_floor_m)
                .fold(0.0, f64::max),
        }
    }
}

fn count(of: usize) -> u32 {
    u32::try_from(of).unwrap_or(u32::MAX)
}

fn deviation(of: Place) -> Deviation {
    Deviation {
        x_m: of.re,
        y_m: of.im,
    }
}

fn shrinkage(of: Shrinkage) -> ShrinkageResult {
    ShrinkageResult {
        factor: of.factor,
        law: of.law,
    }
}
