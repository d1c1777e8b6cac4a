//! Adjusted positions of tie points.

use std::path::Path;

use nalgebra::Vector3;

use super::columns;
use areograph_base::error::Result;

/// Identifiers of the adjusted tie points of `ties.parquet` with their places, IAU 2000, metres; each once.
///
/// # Errors
/// As [`super::read_footprints`].
pub fn read_adjusted_ties(path: &Path) -> Result<Vec<(String, Vector3<f64>)>> {
    const PLACE: [&str; 3] = ["adjusted_x_m", "adjusted_y_m", "adjusted_z_m"];
    let mut ties: Vec<(String, Vector3<f64>)> = Vec::new();
    let names = ["tie"].into_iter().chain(PLACE).collect::<Vec<_>>();
    columns::read(path, &names, |batch| {
        let identifiers = batch.texts("tie")?;
        let [x, y, z] = [
            batch.optional_numbers(PLACE[0])?,
            batch.optional_numbers(PLACE[1])?,
            batch.optional_numbers(PLACE[2])?,
        ];
        let places = x.iter().zip(y).zip(z);
        for (identifier, ((x, y), z)) in identifiers.iter().flatten().zip(places) {
            // Rows of one tie point, one a measurement, follow each other.
            let is_new = ties.last().is_none_or(|(last, _)| last != identifier);
            if let (true, Some(x), Some(y), Some(z)) = (is_new, x, y, z) {
                ties.push((identifier.to_owned(), Vector3::new(x, y, z)));
            }
        }
        Ok(())
    })?;
    Ok(ties)
}
