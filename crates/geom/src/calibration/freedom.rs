//! The parameters, and which combinations of them are free.

use nalgebra::{DMatrix, DVector};

use super::camera::CalibrationState;

/// A parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// φ, ω or κ of a camera, by 0, 1 or 2.
    Angle {
        /// The camera.
        camera: usize,
        /// The angle.
        axis: usize,
    },
    /// A coefficient of `tan ψx`.
    Across {
        /// The camera.
        camera: usize,
        /// The power of `s'`.
        power: usize,
    },
    /// A coefficient of `tan ψy`.
    Along {
        /// The camera.
        camera: usize,
        /// The power of `s'`.
        power: usize,
    },
    /// A component of the orbit's drift.
    Drift {
        /// The axis.
        axis: usize,
    },
}

/// The order of all parameters: of every camera three angles, `m`, `n`; then the drift of the orbit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Cameras.
    pub cameras: usize,
    /// Order of the polynomials.
    pub order: usize,
}

impl Layout {
    /// Parameters of a camera.
    #[must_use]
    pub const fn of_camera(self) -> usize {
        3 + 2 * (self.order + 1)
    }

    /// Number of parameters.
    #[must_use]
    pub const fn len(self) -> usize {
        self.orbit() + 3
    }

    /// Always false: a drift has three components.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The first parameter of the orbit.
    pub(super) const fn orbit(self) -> usize {
        self.cameras * self.of_camera()
    }

    /// The parameter with an index.
    #[must_use]
    pub const fn parameter(self, index: usize) -> Parameter {
        let orbit = self.orbit();
        if index >= orbit {
            return Parameter::Drift {
                axis: index - orbit,
            };
        }
        let (camera, within) = (index / self.of_camera(), index % self.of_camera());
        match within {
            axis @ 0..3 => Parameter::Angle { camera, axis },
            _ if within - 3 <= self.order => Parameter::Across {
                camera,
                power: within - 3,
            },
            _ => Parameter::Along {
                camera,
                power: within - 4 - self.order,
            },
        }
    }

    /// All parameters in order.
    pub fn parameters(self) -> impl Iterator<Item = Parameter> {
        (0..self.len()).map(move |index| self.parameter(index))
    }
}

impl CalibrationState {
    /// The layout of its parameters.
    #[must_use]
    pub fn layout(&self) -> Layout {
        Layout {
            cameras: self.cameras.len(),
            order: self.cameras.first().map_or(0, |camera| camera.m.len() - 1),
        }
    }

    fn parameter_mut(&mut self, parameter: Parameter) -> &mut f64 {
        match parameter {
            Parameter::Angle { camera, axis } => {
                let offset = &mut self.cameras[camera].offset;
                match axis {
                    0 => &mut offset.phi_rad,
                    1 => &mut offset.omega_rad,
                    _ => &mut offset.kappa_rad,
                }
            }
            Parameter::Across { camera, power } => &mut self.cameras[camera].m[power],
            Parameter::Along { camera, power } => &mut self.cameras[camera].n[power],
            Parameter::Drift { axis } => &mut self.drift_m_per_line[axis],
        }
    }

    /// The state with an increment added to its parameters, in order.
    #[must_use]
    pub fn moved(&self, by: &DVector<f64>) -> Self {
        let mut moved = self.clone();
        for (parameter, by) in self.layout().parameters().zip(by.iter()) {
            *moved.parameter_mut(parameter) += by;
        }
        moved
    }

    /// The parameters in order: angles in radians, tangents, metres, metres per line.
    #[must_use]
    pub fn vector(&self) -> DVector<f64> {
        let mut of = self.clone();
        let values = self
            .layout()
            .parameters()
            .map(|parameter| *of.parameter_mut(parameter));
        let values: Vec<f64> = values.collect();
        DVector::from_vec(values)
    }
}

/// Combinations of parameters that an adjustment may change, each in units of its a priori standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct Freedom {
    /// A priori standard deviation of every parameter.
    pub(super) scale: DVector<f64>,
    /// Orthonormal columns over the scaled parameters.
    pub(super) directions: DMatrix<f64>,
}

impl Freedom {
    /// The parameters that `frees` declares free, one by one; `sigma` gives their a priori standard deviations.
    #[must_use]
    pub fn each(
        layout: Layout,
        sigma: impl Fn(Parameter) -> f64,
        frees: impl Fn(Parameter) -> bool,
    ) -> Self {
        let free: Vec<usize> = (0..layout.len())
            .filter(|index| frees(layout.parameter(*index)))
            .collect();
        let mut directions = DMatrix::zeros(layout.len(), free.len());
        for (column, row) in free.into_iter().enumerate() {
            directions[(row, column)] = 1.0;
        }
        Self {
            scale: scale(layout, sigma),
            directions,
        }
    }

    /// The differences of φ and of the scale `m₁` between the cameras, without their common parts: all that tie points
    /// determine without bias (a common pitch can imitate a scale, which would bias it).
    #[must_use]
    pub fn differential(layout: Layout, sigma: impl Fn(Parameter) -> f64) -> Self {
        let kinds = [0, 4];
        let mut columns = Vec::new();
        for within in kinds {
            for contrast in contrasts(layout.cameras) {
                let mut column = DVector::zeros(layout.len());
                for (camera, share) in contrast.iter().enumerate() {
                    column[camera * layout.of_camera() + within] = *share;
                }
                columns.push(column);
            }
        }
        Self {
            scale: scale(layout, sigma),
            directions: DMatrix::from_columns(&columns),
        }
    }

    /// Free combinations.
    #[must_use]
    pub fn len(&self) -> usize {
        self.directions.ncols()
    }

    /// Whether nothing is free.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Scaled components along the free combinations of a difference of two states.
    pub(super) fn components(&self, difference: &DVector<f64>) -> DVector<f64> {
        self.directions
            .tr_mul(&difference.component_div(&self.scale))
    }

    /// Changes of the parameters by components along the free combinations.
    pub(super) fn change(&self, components: &DVector<f64>) -> DVector<f64> {
        (&self.directions * components).component_mul(&self.scale)
    }

    /// Rows over all parameters, `d V / d parameter`, as rows over the free combinations.
    pub(super) fn rows(&self, mut by_parameters: DMatrix<f64>) -> DMatrix<f64> {
        for (mut column, scale) in by_parameters.column_iter_mut().zip(self.scale.iter()) {
            column *= *scale;
        }
        by_parameters * &self.directions
    }

    /// Covariance of all parameters from the covariance of the free combinations.
    pub(super) fn covariance(&self, of_components: &DMatrix<f64>) -> DMatrix<f64> {
        let mut full = &self.directions * of_components * self.directions.transpose();
        for (row, scale) in self.scale.iter().enumerate() {
            for column in 0..full.ncols() {
                full[(row, column)] *= scale * self.scale[column];
            }
        }
        full
    }
}

fn scale(layout: Layout, sigma: impl Fn(Parameter) -> f64) -> DVector<f64> {
    DVector::from_iterator(layout.len(), layout.parameters().map(sigma))
}

/// Orthonormal differences of `count` items: the first two, then each further one against the mean of those before it.
pub(super) fn contrasts(count: usize) -> Vec<Vec<f64>> {
    let contrast = |next: usize| {
        let before = next as f64;
        let length = (before * (before + 1.0)).sqrt();
        let share = |index: usize| match index.cmp(&next) {
            std::cmp::Ordering::Less => 1.0 / length,
            std::cmp::Ordering::Equal => -before / length,
            std::cmp::Ordering::Greater => 0.0,
        };
        (0..count).map(share).collect()
    };
    (1..count).map(contrast).collect()
}
