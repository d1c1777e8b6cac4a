//! A pass with the heights along it.

use serde::{Deserialize, Serialize};

/// A pass of the laser over the box of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// Its number, from 1, in the order of time.
    pub pass: usize,
    /// Its shots, in the order of time.
    pub shots: Vec<PassShot>,
}

impl Pass {
    /// Number of shots at which the shifted model has a height.
    #[must_use]
    pub fn shifted(&self) -> usize {
        let shots = self.shots.iter();
        shots.filter(|shot| shot.shifted_model_m.is_some()).count()
    }
}

/// A shot, with the heights of the model there; heights are above the reference sphere of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassShot {
    /// File, record and shot.
    pub name: String,
    /// Distance along the pass from its first shot over the model, on the reference sphere, metres.
    pub distance_m: f64,
    /// East longitude and latitude by the laser, radians.
    pub place_rad: [f64; 2],
    /// Height by the laser, metres.
    pub laser_m: f64,
    /// Height of the model at the position by the laser, metres; `None` where the model has none.
    pub model_m: Option<f64>,
    /// Height of the model at this position plus the shift of the shot's unit, metres; `None` where the model has none,
    /// and outside kept units. The bias of the model is not removed.
    pub shifted_model_m: Option<f64>,
    /// Number of its unit; `None` outside units.
    pub unit: Option<usize>,
    /// Whether it was withheld from the search of its unit.
    pub is_held_out: bool,
}
