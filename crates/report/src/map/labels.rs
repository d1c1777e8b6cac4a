//! Names on a map without overlaps.

use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::super::plots::{Canvas, Drawn, INK};

/// Size of the letters of maps, in units of the drawing.
pub(crate) const LETTERS: i32 = 28;

/// Distances of a name from its mark to try, and the distance from which a line joins them.
const BESIDE: [i32; 7] = [14, 24, 40, 60, 90, 130, 180];
const LEADER_FROM: f64 = 34.0;

/// Words on a map, in the standard size.
pub(crate) fn write<'a>(
    area: &Canvas<'a>,
    text: &str,
    at: (i32, i32),
    anchor: HPos,
    colour: RGBColor,
) -> Drawn<'a> {
    write_in(area, text, at, anchor, (LETTERS, colour))
}

/// Words on a map, in letters of a size and colour.
fn write_in<'a>(
    area: &Canvas<'a>,
    text: &str,
    at: (i32, i32),
    anchor: HPos,
    (letters, colour): (i32, RGBColor),
) -> Drawn<'a> {
    let style = TextStyle::from(("sans-serif", letters).into_font())
        .color(&colour)
        .pos(Pos::new(anchor, VPos::Center));
    area.draw_text(text, &style, at)
}

/// A placed name.
pub(crate) struct Label {
    pub(crate) text: String,
    pub(crate) at: (i32, i32),
    pub(crate) colour: RGBColor,
    letters: i32,
}

/// The names of a map so far.
pub(crate) struct Labels {
    width: i32,
    height: i32,
    /// Size of the letters of the next names.
    letters: i32,
    taken: Vec<[i32; 4]>,
    /// Lines from marks to names that are not beside them.
    leaders: Vec<[(i32, i32); 2]>,
    pub(crate) placed: Vec<Label>,
}

impl Labels {
    /// A map of this size without names.
    pub(crate) const fn new(width: i32, height: i32) -> Self {
        Self {
            width,
            height,
            letters: LETTERS,
            taken: Vec::new(),
            leaders: Vec::new(),
            placed: Vec::new(),
        }
    }

    /// Sets the size of the letters of the next names.
    pub(crate) const fn set_letters(&mut self, letters: i32) {
        self.letters = letters;
    }

    /// Places a name with its left edge, at half its height, at the first of `places` where it fits on the map and on
    /// no other name; otherwise omits it and returns false.
    pub(crate) fn place(
        &mut self,
        text: &str,
        colour: RGBColor,
        places: impl Iterator<Item = (i32, i32)>,
    ) -> bool {
        let (wide, half) = (width_in(text, self.letters), self.letters / 2);
        for (x, y) in places {
            let own = [x - 3, y - half, x + wide + 3, y + half];
            let inside = own[0] >= 0 && own[1] >= 0 && own[2] < self.width && own[3] < self.height;
            if inside && !self.taken.iter().any(|other| overlap(&own, other)) {
                self.taken.push(own);
                self.placed.push(Label {
                    text: text.to_owned(),
                    at: (x, y),
                    colour,
                    letters: self.letters,
                });
                return true;
            }
        }
        false
    }

    /// Names a mark: beside it, or farther off at the end of a line; omits the name and returns false if there is no
    /// room at all.
    pub(crate) fn place_around(&mut self, text: &str, colour: RGBColor, mark: (i32, i32)) -> bool {
        let placed = BESIDE
            .iter()
            .any(|far| self.place(text, colour, around(text, mark, *far).into_iter()));
        if let Some(label) = self.placed.last().filter(|_| placed) {
            let (left, right) = (label.at.0, label.at.0 + width(text));
            let end = (mark.0.clamp(left, right), label.at.1);
            let off = f64::from(end.0 - mark.0).hypot(f64::from(end.1 - mark.1));
            if off > LEADER_FROM {
                self.leaders.push([mark, end]);
            }
        }
        placed
    }

    /// Keeps names away from a drawn object of a given size at a place.
    pub(crate) fn keep_off(&mut self, (x, y): (i32, i32), by: i32) {
        self.taken.push([x - by, y - by, x + by, y + by]);
    }

    /// Draws all of them.
    pub(crate) fn draw<'a>(&self, area: &Canvas<'a>) -> Drawn<'a> {
        for leader in &self.leaders {
            area.draw(&PathElement::new(
                leader.to_vec(),
                PLAIN.mix(0.6).stroke_width(2),
            ))?;
        }
        let mut names = self.placed.iter();
        names.try_for_each(|name| {
            let look = (name.letters, name.colour);
            write_in(area, &name.text, name.at, HPos::Left, look)
        })
    }
}

/// Places of a name at a distance from a mark: right, left, above, below, and between these.
fn around(text: &str, (x, y): (i32, i32), far: i32) -> [(i32, i32); 8] {
    let wide = width(text);
    let (up, aside) = (far + LETTERS / 2, far * 7 / 10);
    let (left, middle, right) = (x - wide, x - wide / 2, x);
    [
        (right + far, y),
        (left - far, y),
        (middle, y - up),
        (middle, y + up),
        (right + aside, y - up),
        (right + aside, y + up),
        (left - aside, y - up),
        (left - aside, y + up),
    ]
}

/// Width of a text in units of the drawing, at most: as wide as the widest of the usual sans-serif fonts has its
/// letters.
pub(crate) fn width(text: &str) -> i32 {
    width_in(text, LETTERS)
}

/// The width in letters of a different size.
pub(crate) fn width_in(text: &str, letters: i32) -> i32 {
    let share = |letter: char| match letter {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ' ' | '-' | '/' | '\'' => 0.42,
        'm' | 'w' | 'M' | 'W' | '−' => 0.98,
        letter if letter.is_uppercase() => 0.76,
        _ => 0.64,
    };
    let shares: f64 = text.chars().map(share).sum();
    (shares * f64::from(letters)).ceil() as i32
}

fn overlap(one: &[i32; 4], other: &[i32; 4]) -> bool {
    one[0] < other[2] && other[0] < one[2] && one[1] < other[3] && other[1] < one[3]
}

/// Colour of names without a coloured object.
pub(crate) const PLAIN: RGBColor = INK;

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

    #[test]
    fn many_marks_in_one_place_are_all_named_apart() {
        let mut labels = Labels::new(1_040, 720);
        let marks: Vec<(i32, i32)> = (0..10).map(|k| (500 + 2 * k, 360 - k)).collect();
        for mark in &marks {
            labels.keep_off(*mark, 9);
        }
        for (number, mark) in marks.iter().enumerate() {
            assert!(labels.place_around(&format!("E02-0{number}665"), PLAIN, *mark));
        }
        // Rectangles of the names, as wide as browsers draw them at most.
        let boxes: Vec<[i32; 4]> = labels
            .placed
            .iter()
            .map(|label| {
                let (x, y) = label.at;
                [x, y - LETTERS / 2, x + width(&label.text), y + LETTERS / 2]
            })
            .collect();
        for (index, one) in boxes.iter().enumerate() {
            assert!(boxes[..index].iter().all(|other| !overlap(one, other)));
            assert!(
                marks
                    .iter()
                    .all(|(x, y)| !overlap(one, &[x - 9, y - 9, x + 9, y + 9]))
            );
        }
        assert!(!labels.leaders.is_empty());
    }
}
