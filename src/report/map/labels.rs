//! Names on a map that do not lie on each other.

use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::super::plots::{Canvas, Drawn, INK};

/// Size of the letters of maps, in units of the drawing.
pub(in crate::report) const LETTERS: i32 = 28;

/// Words on a map, in its size.
pub(in crate::report) fn write<'a>(
    area: &Canvas<'a>,
    text: &str,
    at: (i32, i32),
    anchor: HPos,
    colour: RGBColor,
) -> Drawn<'a> {
    let style = TextStyle::from(("sans-serif", LETTERS).into_font())
        .color(&colour)
        .pos(Pos::new(anchor, VPos::Center));
    area.draw_text(text, &style, at)
}

/// A name in its place.
pub(in crate::report) struct Label {
    pub(in crate::report) text: String,
    pub(in crate::report) at: (i32, i32),
    pub(in crate::report) colour: RGBColor,
}

/// The names of a map so far.
pub(in crate::report) struct Labels {
    width: i32,
    height: i32,
    taken: Vec<[i32; 4]>,
    pub(in crate::report) placed: Vec<Label>,
}

impl Labels {
    /// No names on a map of this size.
    pub(in crate::report) const fn new(width: i32, height: i32) -> Self {
        Self {
            width,
            height,
            taken: Vec::new(),
            placed: Vec::new(),
        }
    }

    /// Puts a name with its left edge, at half its height, at the first of `places` where it fits on the map and on no
    /// other name; leaves it out where there is none.
    pub(in crate::report) fn place(
        &mut self,
        text: &str,
        colour: RGBColor,
        places: impl Iterator<Item = (i32, i32)>,
    ) {
        let wide = width(text);
        for (x, y) in places {
            let own = [x - 3, y - LETTERS / 2, x + wide + 3, y + LETTERS / 2];
            let inside = own[0] >= 0 && own[1] >= 0 && own[2] < self.width && own[3] < self.height;
            if inside && !self.taken.iter().any(|other| overlap(&own, other)) {
                self.taken.push(own);
                self.placed.push(Label {
                    text: text.to_owned(),
                    at: (x, y),
                    colour,
                });
                return;
            }
        }
    }

    /// Keeps names off what is drawn at most so far from a place.
    pub(in crate::report) fn keep_off(&mut self, (x, y): (i32, i32), by: i32) {
        self.taken.push([x - by, y - by, x + by, y + by]);
    }

    /// Draws all of them.
    pub(in crate::report) fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        let mut names = self.placed.iter();
        names.try_for_each(|name| write(area, &name.text, name.at, HPos::Left, name.colour))
    }
}

/// Width of a text in units of the drawing: sans-serif letters are half as wide as they are high, and some more.
pub(in crate::report) fn width(text: &str) -> i32 {
    let letters = i32::try_from(text.chars().count()).unwrap_or(i32::MAX / LETTERS);
    letters * LETTERS * 58 / 100
}

fn overlap(one: &[i32; 4], other: &[i32; 4]) -> bool {
    one[0] < other[2] && other[0] < one[2] && one[1] < other[3] && other[1] < one[3]
}

/// Colour of names that belong to nothing drawn in a colour.
pub(in crate::report) const PLAIN: RGBColor = INK;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_clear_of_each_other_and_of_the_edge() {
        let mut labels = Labels::new(400, 200);
        labels.place("17010", PLAIN, [(10, 50)].into_iter());
        labels.place("17023", PLAIN, [(40, 60), (200, 60)].into_iter());
        labels.place("17036", PLAIN, [(390, 100), (12, 52)].into_iter());
        let at: Vec<(i32, i32)> = labels.placed.iter().map(|label| label.at).collect();
        assert_eq!(at, [(10, 50), (200, 60)]);
    }
}
