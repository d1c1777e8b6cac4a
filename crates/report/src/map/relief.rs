//! The ground of a map as a shaded picture: heights of all shots, fitted by a membrane on a grid.
//!
//! A picture for display, not for measurement: heights are tested against a kriged surface ([`areograph_geom::surface`]).

use super::super::{graticule::View, plots::image};
use areograph_base::error::Result;
use areograph_products::error::ProductError;

/// Cells along the longer side of the picture.
const CELLS: usize = 240;
/// Cells farther from every shot than this share of the longer side stay empty.
const REACH: f64 = 0.09;
/// Sweeps of each level of the grid, and the weight of shots against the four neighbours of a cell.
const SWEEPS: usize = 12;
const FIRMNESS: f64 = 4.0;
/// Root mean square slope for shading: lower relief is exaggerated up to it.
const SLOPE: f64 = 0.35;
/// Largest exaggeration of heights.
const EXAGGERATION_MAX: f64 = 100.0;
/// Colours of heights, the lowest first; lightness rises throughout, for any colour vision and any printer.
pub const COLOURS: [[f64; 3]; 7] = [
    [38.0, 56.0, 102.0],
    [44.0, 92.0, 126.0],
    [60.0, 127.0, 127.0],
    [116.0, 155.0, 108.0],
    [179.0, 174.0, 98.0],
    [224.0, 190.0, 128.0],
    [247.0, 229.0, 203.0],
];

/// The colour of a height by its share of the range.
pub(crate) fn colour(share: f64) -> [u8; 3] {
    let last = COLOURS.len() - 1;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = (place as usize).min(last - 1);
    let rest = place - below as f64;
    let mixed = |channel: usize| {
        let (from, to) = (COLOURS[below][channel], COLOURS[below + 1][channel]);
        (from + rest * (to - from)).round() as u8
    };
    [mixed(0), mixed(1), mixed(2)]
}

/// Values on a grid, row by row from the north-west.
#[derive(Debug, Clone)]
struct Grid {
    columns: usize,
    rows: usize,
    values: Vec<f64>,
}

impl Grid {
    fn of(columns: usize, rows: usize) -> Self {
        let values = vec![0.0; columns * rows];
        Self {
            columns,
            rows,
            values,
        }
    }

    /// The value of a cell; beyond the edge, of the nearest edge cell.
    fn at(&self, column: isize, row: isize) -> f64 {
        let held = |place: isize, count: usize| place.clamp(0, count as isize - 1) as usize;
        self.values[held(row, self.rows) * self.columns + held(column, self.columns)]
    }

    /// Sums of two by two cells.
    fn halved(&self) -> Self {
        let mut half = Self::of(self.columns.div_ceil(2), self.rows.div_ceil(2));
        for row in 0..self.rows {
            for column in 0..self.columns {
                let place = row / 2 * half.columns + column / 2;
                half.values[place] += self.values[row * self.columns + column];
            }
        }
        half
    }

    /// The value at a place in cells, between cell centres.
    fn between(&self, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor(), y.floor());
        let (right, down) = (x - column, y - row);
        let (column, row) = (column as isize, row as isize);
        let level =
            |row: isize| (1.0 - right) * self.at(column, row) + right * self.at(column + 1, row);
        (1.0 - down) * level(row) + down * level(row + 1)
    }

    /// Mean of the four neighbours of a cell.
    fn around(&self, column: usize, row: usize) -> f64 {
        let (column, row) = (column as isize, row as isize);
        let sum = self.at(column - 1, row) + self.at(column + 1, row);
        (sum + self.at(column, row - 1) + self.at(column, row + 1)) / 4.0
    }
}

/// A membrane through known sums of heights and their counts, from coarse grids to fine ones.
fn membrane(sums: &Grid, counts: &Grid) -> Grid {
    let (columns, rows) = (sums.columns, sums.rows);
    let mut surface = Grid::of(columns, rows);
    if columns <= 2 && rows <= 2 {
        let (sum, count): (f64, f64) = (sums.values.iter().sum(), counts.values.iter().sum());
        surface.values.fill(sum / count.max(1.0));
        return surface;
    }
    let coarse = membrane(&sums.halved(), &counts.halved());
    for row in 0..rows {
        for column in 0..columns {
            let place = |cell: usize| 0.5 * cell as f64 - 0.25;
            surface.values[row * columns + column] = coarse.between(place(column), place(row));
        }
    }
    for _ in 0..SWEEPS {
        for row in 0..rows {
            for column in 0..columns {
                let cell = row * columns + column;
                let around = surface.around(column, row);
                let count = counts.values[cell];
                surface.values[cell] = if count > 0.0 {
                    (around + FIRMNESS * sums.values[cell] / count) / (1.0 + FIRMNESS)
                } else {
                    around
                };
            }
        }
    }
    surface
}

/// Opacity of each cell: 1 near a known one, 0 beyond `reach` cells, decreasing in between.
fn within_reach(counts: &Grid, reach: f64) -> Vec<f64> {
    let (columns, rows) = (counts.columns, counts.rows);
    let known = counts.values.iter().map(|count| *count > 0.0);
    let mut far: Vec<f64> = known
        .map(|known| if known { 0.0 } else { f64::INFINITY })
        .collect();
    // Steps to neighbours visited in a forward and a backward pass (Borgefors 1986).
    let diagonal = std::f64::consts::SQRT_2;
    let steps = [
        (-1, 0, 1.0),
        (0, -1, 1.0),
        (-1, -1, diagonal),
        (1, -1, diagonal),
    ];
    let cells = columns * rows;
    for (sign, order) in [(1, 0), (-1, cells - 1)] {
        for index in 0..cells {
            let cell = order.abs_diff(index);
            let (column, row) = ((cell % columns) as isize, (cell / columns) as isize);
            for (right, down, length) in steps {
                let (column, row) = (column + sign * right, row + sign * down);
                let inside =
                    (0..columns as isize).contains(&column) && (0..rows as isize).contains(&row);
                if inside {
                    let other = far[row as usize * columns + column as usize];
                    far[cell] = far[cell].min(other + length);
                }
            }
        }
    }
    let fading = 0.4 * reach;
    far.into_iter()
        .map(|far| ((reach - far) / fading).clamp(0.0, 1.0))
        .collect()
}

/// The ground of a sheet, shaded.
pub(super) struct Relief {
    surface: Grid,
    /// Opacity of each cell, 0 to 1.
    shown: Vec<f64>,
    cell_m: f64,
    /// Exaggeration of heights for the shading.
    pub(super) exaggeration: f64,
}

impl Relief {
    /// The ground of `view` by shots: place on the map, and height, metres. `None` without a shot on it.
    pub(super) fn of(view: &View, shots: impl Iterator<Item = ((f64, f64), f64)>) -> Option<Self> {
        let cell_m = view.width_m().max(view.height_m()) / CELLS as f64;
        let cells = |length_m: f64| ((length_m / cell_m).round() as usize).max(3);
        let (columns, rows) = (cells(view.width_m()), cells(view.height_m()));
        let (mut sums, mut counts) = (Grid::of(columns, rows), Grid::of(columns, rows));
        for ((x, y), height_m) in shots.filter(|(place, _)| view.contains(*place)) {
            let cell = |length_m: f64, count: usize| ((length_m / cell_m) as usize).min(count - 1);
            let place = cell(view.north_m - y, rows) * columns + cell(x - view.west_m, columns);
            sums.values[place] += height_m;
            counts.values[place] += 1.0;
        }
        if counts.values.iter().all(|count| *count <= 0.0) {
            return None;
        }
        let mut surface = membrane(&sums, &counts);
        surface.values = smooth(&surface);
        let shown = within_reach(&counts, REACH * CELLS as f64);
        let mut relief = Self {
            surface,
            shown,
            cell_m,
            exaggeration: 1.0,
        };
        relief.exaggeration = relief.suitable_exaggeration();
        Some(relief)
    }

    /// Slopes towards east and south of every cell that is shown.
    fn slopes(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let (surface, columns) = (&self.surface, self.surface.columns);
        let cells = (0..self.shown.len()).filter(|cell| self.shown[*cell] > 0.0);
        cells.map(move |cell| {
            let (column, row) = ((cell % columns) as isize, (cell / columns) as isize);
            let east = surface.at(column + 1, row) - surface.at(column - 1, row);
            let south = surface.at(column, row + 1) - surface.at(column, row - 1);
            (
                cell,
                east / (2.0 * self.cell_m),
                south / (2.0 * self.cell_m),
            )
        })
    }

    /// 1, 2 or 5 times a power of ten that brings the slopes up to the slope for shading.
    fn suitable_exaggeration(&self) -> f64 {
        let (mut squares, mut count) = (0.0, 0.0);
        for (_, east, south) in self.slopes() {
            squares += east * east + south * south;
            count += 1.0;
        }
        let slope = (squares / f64::max(count, 1.0)).sqrt();
        let wanted = (SLOPE / slope.max(f64::MIN_POSITIVE)).clamp(1.0, EXAGGERATION_MAX);
        super::round_length_m(wanted)
    }

    /// The picture as an image of an SVG that fills `width` by `height`.
    ///
    /// # Errors
    /// A picture that the library rejects, which is a bug in areograph.
    pub(super) fn svg(&self, heights_m: (f64, f64), width: f64, height: f64) -> Result<String> {
        Ok(image([0.0, 0.0, width, height], &self.png(heights_m)?))
    }

    /// The picture: colours of heights between `low` and `high`, lit from the north-west at 45°.
    fn png(&self, (low, high): (f64, f64)) -> Result<Vec<u8>> {
        let mut pixels = vec![0_u8; 4 * self.shown.len()];
        for (cell, east, south) in self.slopes() {
            let share = (self.surface.values[cell] - low) / (high - low).max(f64::MIN_POSITIVE);
            let light = shade(self.exaggeration * east, self.exaggeration * south);
            let lit = colour(share).map(|channel| lit(channel, light));
            pixels[4 * cell..4 * cell + 3].copy_from_slice(&lit);
            pixels[4 * cell + 3] = (255.0 * self.shown[cell]).round() as u8;
        }
        let png = png(
            &pixels,
            self.surface.columns as u32,
            self.surface.rows as u32,
        );
        Ok(png.map_err(ProductError::refused("draw a map"))?)
    }
}

/// The ground between shots (place on a map and height, metres) as a picture of shaded colours, and its west, south, east
/// and north edge on the map; `None` without shots.
///
/// # Errors
/// A picture that the library rejects, which is a bug in areograph.
pub fn relief_of_shots(shots: &[((f64, f64), f64)]) -> Result<Option<(Vec<u8>, [f64; 4])>> {
    let view = View::of(shots.iter().map(|(place, _)| *place));
    let Some(relief) = Relief::of(&view, shots.iter().copied()) else {
        return Ok(None);
    };
    let heights_m = shots.iter().map(|(_, height_m)| *height_m);
    let range = heights_m.fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(low, high), height_m| (low.min(height_m), high.max(height_m)),
    );
    let edges_m = [view.west_m, view.south_m, view.east_m, view.north_m];
    Ok(Some((relief.png(range)?, edges_m)))
}

/// Means of three by three cells, the middle weighted most.
fn smooth(surface: &Grid) -> Vec<f64> {
    let mut values = Vec::with_capacity(surface.values.len());
    for row in 0..surface.rows {
        for column in 0..surface.columns {
            let own = surface.values[row * surface.columns + column];
            values.push(0.5 * (own + surface.around(column, row)));
        }
    }
    values
}

/// Light on a slope from the north-west at 45°, 0 to 1; level ground has 0.71.
///
/// # Source
/// Horn 1981, Hill shading and the reflectance map, Proc. IEEE 69.
#[must_use]
pub fn shade(east: f64, south: f64) -> f64 {
    // East and south components of the horizontal direction to the light, times its cosine and sine.
    let [to_east, to_south, up] = [-0.5, -0.5, std::f64::consts::FRAC_1_SQRT_2];
    let normal = (1.0 + east * east + south * south).sqrt();
    ((up - east * to_east - south * to_south) / normal).max(0.0)
}

/// A channel of a colour in the light: level ground keeps it.
pub(crate) fn lit(channel: u8, light: f64) -> u8 {
    let level = std::f64::consts::FRAC_1_SQRT_2;
    let channel = f64::from(channel);
    let lit = if light < level {
        channel * (0.45 + 0.55 * light / level)
    } else {
        channel + 0.6 * (255.0 - channel) * (light - level) / (1.0 - level)
    };
    lit.round() as u8
}

/// Pixels of four bytes, the last of them the opacity, as PNG.
///
/// # Errors
/// A picture that the library rejects.
pub(crate) fn png(
    pixels: &[u8],
    columns: u32,
    rows: u32,
) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, columns, rows);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(pixels)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEW: View = View {
        west_m: 0.0,
        east_m: 24_000.0,
        south_m: 0.0,
        north_m: 24_000.0,
    };

    /// Relief of shots on a plane that falls by `slope` towards the east, along three tracks.
    fn plane(slope: f64) -> Relief {
        let shots = [4_000.0, 12_000.0, 20_000.0]
            .into_iter()
            .flat_map(|x| (0..80).map(move |shot| ((x, 300.0 * f64::from(shot)), -slope * x)));
        Relief::of(&VIEW, shots).unwrap()
    }

    #[test]
    fn a_plane_is_a_plane_between_its_tracks() {
        let relief = plane(0.01);
        let columns = relief.surface.columns;
        for column in 45..195 {
            let height_m = relief.surface.values[120 * columns + column];
            let x = (column as f64 + 0.5) * relief.cell_m;
            // Metres: what three cells fall; a shot stands for its cell, and the membrane sags between tracks.
            assert!((height_m + 0.01 * x).abs() < 3.0, "{column}: {height_m}");
        }
    }

    #[test]
    fn ground_that_falls_to_the_south_east_lies_in_shadow() {
        assert!(shade(-0.3, -0.3) < shade(0.0, 0.0));
        assert!(shade(0.3, 0.3) > shade(0.0, 0.0));
        assert!((shade(1.0, 1.0) - 0.985).abs() < 1e-3); // facing the light nearly squarely
        assert_eq!(lit(100, std::f64::consts::FRAC_1_SQRT_2), 100);
    }

    #[test]
    fn what_is_far_from_shots_stays_empty_and_gentle_ground_is_exaggerated() {
        let shots = (0..80).map(|shot| ((4_000.0, 300.0 * f64::from(shot)), f64::from(shot)));
        let relief = Relief::of(&VIEW, shots).unwrap();
        let row = 120 * relief.surface.columns;
        let seen = [40, 50, 58, 64, 200].map(|column| relief.shown[row + column]);
        assert!(seen[..2].iter().all(|share| *share > 0.999), "{seen:?}");
        assert!(0.0 < seen[2] && seen[2] < 1.0, "{seen:?}");
        assert!(seen[3..].iter().all(|share| *share <= 0.0), "{seen:?}");
        assert!(relief.exaggeration >= 50.0, "{}", relief.exaggeration);
        assert!((plane(1.0).exaggeration - 1.0).abs() < 1e-9); // rounding
        assert!(Relief::of(&VIEW, std::iter::empty()).is_none());
    }

    #[test]
    fn colours_grow_lighter_with_height() {
        let light = |share: f64| {
            let [red, green, blue] = colour(share).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        let shares: Vec<f64> = (0..=60).map(|step| light(f64::from(step) / 60.0)).collect();
        assert!(shares.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
