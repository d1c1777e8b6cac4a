//! A line scanner that knows nothing but `isd.json`: what `usgscsm` computes, written from its description.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|number| number.as_f64().unwrap())
        .collect()
}

pub(crate) fn rows(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}

/// The matrix of a quaternion (w, x, y, z) that turns components from the first frame to the second.
pub(crate) fn matrix(q: &[f64]) -> Matrix3<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
        .to_rotation_matrix()
        .into_inner()
}

/// Values over uniform epochs, by Neville's scheme over eight nodes, fewer towards the ends.
#[derive(Clone)]
pub(crate) struct Nodes {
    pub(crate) et_s: Vec<f64>,
    pub(crate) values: Vec<Vec<f64>>,
}

impl Nodes {
    pub(crate) fn new(table: &Value, key: &str) -> Self {
        let (et_s, values) = (numbers(&table["ephemeris_times"]), rows(&table[key]));
        assert_eq!(et_s.len(), values.len());
        Self { et_s, values }
    }

    pub(crate) fn at(&self, et_s: f64) -> Vec<f64> {
        let last = self.et_s.len() - 1;
        assert!(
            (self.et_s[0]..=self.et_s[last]).contains(&et_s),
            "{et_s} would be extrapolated"
        );
        let before = self
            .et_s
            .partition_point(|node| *node <= et_s)
            .clamp(1, last)
            - 1;
        let half = (before + 1).min(last - before).min(4);
        let nodes = before + 1 - half..before + 1 + half;
        (0..self.values[0].len())
            .map(|component| {
                let mut p: Vec<f64> = nodes.clone().map(|k| self.values[k][component]).collect();
                let t = &self.et_s[nodes.clone()];
                for level in 1..p.len() {
                    for i in 0..p.len() - level {
                        let (a, b) = (t[i], t[i + level]);
                        p[i] = ((et_s - b) * p[i] - (et_s - a) * p[i + 1]) / (a - b);
                    }
                }
                p[0]
            })
            .collect()
    }
}

pub(crate) struct Pushbroom {
    isd: Value,
    position_km: Nodes,
    camera_to_mars: Nodes,
}

impl Pushbroom {
    pub(crate) fn new(isd: Value) -> Self {
        let body = Nodes::new(&isd["body_rotation"], "quaternions");
        let pointing = Nodes::new(&isd["instrument_pointing"], "quaternions");
        let position = Nodes::new(&isd["instrument_position"], "positions");
        assert_eq!(body.et_s, pointing.et_s);
        let constant = numbers(&isd["instrument_pointing"]["constant_rotation"]);
        let constant = Matrix3::from_row_slice(&constant);
        let mut camera_to_mars: Vec<Vec<f64>> = Vec::new();
        for (to_mars, to_bus) in body.values.iter().zip(&pointing.values) {
            let rotation = matrix(to_mars) * (constant * matrix(to_bus)).transpose();
            let q = UnitQuaternion::from_matrix(&rotation);
            let q = vec![q.w, q.i, q.j, q.k];
            let flip = camera_to_mars.last().is_some_and(|previous| {
                previous.iter().zip(&q).map(|(a, b)| a * b).sum::<f64>() < 0.0
            });
            camera_to_mars.push(if flip {
                q.iter().map(|c| -c).collect()
            } else {
                q
            });
        }
        let position_km = Nodes {
            values: position
                .et_s
                .iter()
                .zip(&position.values)
                .map(|(et_s, p)| {
                    let fixed = matrix(&body.at(*et_s)) * Vector3::from_row_slice(p);
                    fixed.as_slice().to_vec()
                })
                .collect(),
            et_s: position.et_s,
        };
        let camera_to_mars = Nodes {
            et_s: body.et_s,
            values: camera_to_mars,
        };
        Self {
            isd,
            position_km,
            camera_to_mars,
        }
    }

    fn value(&self, pointer: &str) -> f64 {
        self.isd.pointer(pointer).and_then(Value::as_f64).unwrap()
    }

    pub(crate) fn lines(&self) -> f64 {
        self.value("/image_lines")
    }

    pub(crate) fn samples(&self) -> f64 {
        self.value("/image_samples")
    }

    /// Line coordinates count from the top edge of the first line, whose centre is 0.5. As in `getImageTime`, the last row
    /// counts whose line is not above the coordinate, or the first.
    pub(crate) fn time(&self, line: f64) -> f64 {
        let table = rows(&self.isd["line_scan_rate"]);
        let after = table.partition_point(|row| row[0] <= line);
        let row = &table[after.saturating_sub(1)];
        self.value("/center_ephemeris_time") + row[1] + row[2] * (line - row[0] + 0.5)
    }

    /// Position in kilometres, Mars-fixed, and rotation from the camera.
    pub(crate) fn camera(&self, et_s: f64) -> (Vector3<f64>, Matrix3<f64>) {
        (
            Vector3::from_vec(self.position_km.at(et_s)),
            matrix(&self.camera_to_mars.at(et_s)),
        )
    }

    /// Direction of a sample in the camera frame, its third component 1.
    fn across(&self, sample: f64) -> f64 {
        let detector = sample * self.value("/detector_sample_summing")
            + self.value("/starting_detector_sample")
            - self.value("/detector_center/sample");
        detector
            / self.value("/focal2pixel_samples/2")
            / self.value("/focal_length_model/focal_length")
    }

    /// Ground point on the ellipsoid of `radii`, kilometres.
    pub(crate) fn ground(&self, line: f64, sample: f64) -> Vector3<f64> {
        let (position, to_mars) = self.camera(self.time(line));
        let look = to_mars * Vector3::new(0.0, self.across(sample), 1.0);
        let (a, c) = (
            self.value("/radii/semimajor"),
            self.value("/radii/semiminor"),
        );
        let scale = Vector3::new(1.0 / a, 1.0 / a, 1.0 / c);
        let (p, d) = (position.component_mul(&scale), look.component_mul(&scale));
        let (pd, dd) = (p.dot(&d), d.norm_squared());
        let root = (pd * pd - dd * (p.norm_squared() - 1.0)).sqrt();
        position + look * ((-pd - root) / dd)
    }

    /// Along and across the line, in the units of [`Self::across`], where `line` sees the ground.
    fn seen(&self, line: f64, ground: &Vector3<f64>) -> (f64, f64) {
        let (position, to_mars) = self.camera(self.time(line));
        let q = to_mars.transpose() * (ground - position);
        (q.x / q.z, q.y / q.z)
    }

    /// Line and sample of a ground point, by secants from the middle of the image.
    pub(crate) fn image(&self, ground: &Vector3<f64>) -> (f64, f64) {
        let (mut a, mut b) = (0.45 * self.lines(), 0.55 * self.lines());
        let (mut fa, mut fb) = (self.seen(a, ground).0, self.seen(b, ground).0);
        for _ in 0..30 {
            if (b - a).abs() < 1e-9 || (fb - fa).abs() < f64::MIN_POSITIVE {
                break;
            }
            let next = (b - fb * (b - a) / (fb - fa)).clamp(0.0, self.lines());
            (a, fa) = (b, fb);
            (b, fb) = (next, self.seen(next, ground).0);
        }
        let across = self.seen(b, ground).1;
        // The direction is linear in the sample.
        let (first, step) = (self.across(0.0), self.across(1.0) - self.across(0.0));
        (b, (across - first) / step)
    }
}
