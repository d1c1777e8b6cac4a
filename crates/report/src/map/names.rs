//! Placement of names on a map.

use std::f64::consts::FRAC_PI_2;

use super::{
    super::{
        graticule::GridLine,
        plots::{COLOURS, WIDTH},
    },
    IMAGE, Sheet,
    labels::{self, Labels},
};

impl Sheet {
    /// Names of images first, then of the graticule, then of as many profiles as fit; and the number of images
    /// and profiles without a name.
    pub(super) fn names(&self, lines: &[GridLine]) -> (Labels, usize) {
        let mut unnamed = 0;
        let mut labels = Labels::new(WIDTH as i32, self.height());
        for image in self.shown.images.iter().filter(|image| image.is_named) {
            let wide = labels::width(&image.name);
            let mut corners: Vec<(i32, i32)> = image
                .ring
                .iter()
                .filter_map(|point| self.place(*point))
                .collect();
            corners.sort_by_key(|(x, y)| (*y, *x));
            let beside = corners
                .iter()
                .flat_map(|(x, y)| [(x + 10, *y), (x - wide - 10, *y), (x - wide / 2, y - 22)]);
            let placed = labels.place(&image.name, COLOURS[IMAGE], beside);
            unnamed += usize::from(!placed);
        }
        for line in lines {
            labels.place(&line.name, labels::PLAIN, self.places_of(line).into_iter());
        }
        for (name, places) in &self.profiles {
            let ends = [places.first(), places.last()].into_iter().flatten();
            let ends = ends.filter_map(|end| self.place(*end));
            let beside = ends.flat_map(|(x, y)| {
                let wide = labels::width(name);
                [-20, 20]
                    .map(|down| (x - wide / 2, y + down))
                    .into_iter()
                    .chain([(x + 8, y), (x - wide - 8, y)])
            });
            let placed = labels.place(name, labels::PLAIN, beside);
            unnamed += usize::from(!placed);
        }
        (labels, unnamed)
    }

    /// Places for the name of a line of the graticule: a parallel at the left or right edge, a meridian at the lower or
    /// upper one, and where meridians run together in a pole, at the edge of the sheet.
    fn places_of(&self, line: &GridLine) -> Vec<(i32, i32)> {
        let (width, height) = (WIDTH as i32, self.height());
        let wide = labels::width(&line.name);
        let ends: Vec<(i32, i32)> = line
            .segments
            .iter()
            .flatten()
            .map(|place| self.pixel(*place))
            .collect();
        let held = |(x, y): (i32, i32)| (x.clamp(8, width - wide - 8), y.clamp(20, height - 20));
        let left = ends.iter().min_by_key(|(x, _)| *x);
        let right = ends.iter().max_by_key(|(x, _)| *x);
        let low = ends.iter().max_by_key(|(_, y)| *y);
        let high = ends.iter().min_by_key(|(_, y)| *y);
        let outermost = ends
            .iter()
            .max_by_key(|(x, y)| (x - width / 2).pow(2) + (y - height / 2).pow(2));
        let places: Vec<(i32, i32)> = if line.is_parallel {
            [left, right]
                .into_iter()
                .flatten()
                .map(|(x, y)| (*x, y - 18))
                .collect()
        } else if self.pole() {
            outermost.into_iter().copied().collect()
        } else {
            [low, high]
                .into_iter()
                .flatten()
                .map(|(x, y)| (x + 6, *y))
                .collect()
        };
        places.into_iter().map(held).collect()
    }

    /// Whether a pole is on the sheet.
    fn pole(&self) -> bool {
        [FRAC_PI_2, -FRAC_PI_2].into_iter().any(|pole| {
            let place = self.map.project(0.0, pole);
            place.is_some_and(|place| self.view.contains(place))
        })
    }
}
