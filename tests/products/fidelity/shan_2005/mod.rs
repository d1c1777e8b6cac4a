//! Shan et al. 2005: data preparation, sensor model, registration, intersection and uncertainty.

mod intersection;
mod orientation;
mod platform;
mod ranges;
mod registration;
mod shots;
mod table_2;
mod uncertainty;

use super::row::Paper;

pub(crate) use intersection::TABLE_5;
pub(crate) use table_2::start_s;

pub(crate) static PAPER: Paper = Paper {
    name: "Shan et al. 2005",
    citation: "Data preparation, sensor model, registration, intersection, uncertainty; Photogramm. Eng. Remote Sens. 71(1), 97–108.",
    prefix: "S05",
    count: 70,
    rows: &[
        &platform::ROWS,
        &table_2::ROWS,
        &ranges::ROWS,
        &orientation::ROWS,
        &registration::ROWS,
        &intersection::ROWS,
        &uncertainty::ROWS,
        &shots::ROWS,
    ],
};
