//! Every figure of the report as a separate file, with number, legend and caption, for slides and papers.

use std::fmt::Write as _;

use super::{
    files::write_text,
    product::{Content, Context, Declaration, Product, Role, Write, Written},
};
use areograph_base::error::Result;

/// Folder of the figures, below the site's.
const FOLDER: &str = "report/figures";
/// Height of a line of text below a drawing, and size of its letters, units of the drawing.
const LINE: f64 = 36.0;
const LETTERS: f64 = 26.0;
/// Mean width of a letter of a sans-serif font as a fraction of the font size; wide enough for digits and capitals.
const LETTER_SHARE: f64 = 0.54;
/// Room at either side of the text, units of the drawing.
const MARGIN: f64 = 20.0;

pub(super) static FIGURE: Declaration = Declaration {
    path: "report/figures/<figure>.svg",
    what: "a figure of the report with its number, legend and caption, for slides and papers",
    readers: "browsers, Inkscape, LibreOffice, PowerPoint",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Many {
        files: "every figure of the report",
        write,
    },
    uses: &[],
};

/// Writes every figure of the page.
fn write(of: &Context) -> Result<Vec<Written>> {
    let figures = of.pages.report.split("<figure id=\"").skip(1).enumerate();
    let figures = figures.filter_map(|(place, html)| Figure::of(place + 1, html));
    let written = figures.map(|figure| {
        let path = format!("{FOLDER}/{}.svg", figure.id);
        write_text(&of.directory.join(&path), &figure.svg())?;
        let path = path.into();
        Ok((Product { path, rows: 0 }, &FIGURE))
    });
    written.collect()
}

/// A figure of the page; texts are still escaped, with `&amp;` and the like, as in SVG.
struct Figure<'a> {
    number: usize,
    id: &'a str,
    title: &'a str,
    width: f64,
    height: f64,
    /// Contents of the drawing.
    drawing: &'a str,
    /// Colour and label of each entry of the legend.
    keys: Vec<(&'a str, &'a str)>,
    caption: &'a str,
}

impl<'a> Figure<'a> {
    /// The figure, parsed from the text after the quotation mark that begins its name.
    fn of(number: usize, html: &'a str) -> Option<Self> {
        let html = html.split("</figure>").next()?;
        let drawing = between(html, "<svg ", "</svg>")?;
        let mut box_of = between(drawing, "viewBox=\"0 0 ", "\"")?.split(' ');
        let mut size = || box_of.next()?.parse().ok();
        let keys = html.split("<i ").skip(1).filter_map(|key| {
            let label = between(key, "</i>", "</li>")?;
            Some((between(key, "data-colour=\"", "\"")?, label))
        });
        Some(Self {
            number,
            id: html.split('"').next()?,
            title: between(html, "-title\">", "</p>")?,
            width: size()?,
            height: size()?,
            drawing: drawing.split_once('>')?.1,
            keys: keys.collect(),
            caption: between(html, "-words\">", "</span>")?,
        })
    }

    fn svg(&self) -> String {
        let words = format!("Figure {}. {}. {}", self.number, self.title, self.caption);
        let (legend, below_legend) = self.legend();
        let letters = (self.width - 2.0 * MARGIN) / (LETTER_SHARE * LETTERS);
        let mut baseline = below_legend;
        let mut text = String::new();
        for line in lines(&words, letters) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "<text x=\"{MARGIN}\" y=\"{baseline}\">{line}</text>");
            baseline += LINE;
        }
        let (width, height) = (self.width, baseline - 0.5 * LINE);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
             <title>{}</title>\n\
             <style>text{{font-family:system-ui,sans-serif}}\
             .drawing text{{paint-order:stroke;stroke:#fff;stroke-width:5px;stroke-linejoin:round}}</style>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n\
             <g class=\"drawing\">{}</g>\n\
             <g font-size=\"{LETTERS}\" fill=\"#222\">\n{legend}{text}</g>\n</svg>\n",
            self.title, self.drawing
        )
    }

    /// The legend, and the baseline of the next text.
    fn legend(&self) -> (String, f64) {
        let (mut x, mut baseline) = (MARGIN, self.height + LINE);
        let mut legend = String::new();
        for (colour, label) in &self.keys {
            let width = LETTERS * (2.2 + LETTER_SHARE * count(label) as f64);
            if x > MARGIN && x + width > self.width - MARGIN {
                (x, baseline) = (MARGIN, baseline + LINE);
            }
            let _ = writeln!(
                legend,
                "<rect x=\"{x:.0}\" y=\"{:.0}\" width=\"{side:.0}\" height=\"{side:.0}\" fill=\"{colour}\"/>\
                 <text x=\"{:.0}\" y=\"{baseline:.0}\">{label}</text>",
                baseline - 0.75 * LETTERS,
                x + 1.1 * LETTERS,
                side = 0.8 * LETTERS
            );
            x += width;
        }
        let below = if self.keys.is_empty() { 0.0 } else { LINE };
        (legend, baseline + below)
    }
}

/// The text between the first `start` and the next `end`.
fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    text.split_once(start)?
        .1
        .split_once(end)
        .map(|(inside, _)| inside)
}

/// Number of letters of escaped text: `&amp;` is one.
fn count(text: &str) -> usize {
    let mut inside = false;
    let letters = text.chars().filter(|letter| {
        let counts = !inside;
        match letter {
            '&' => inside = true,
            ';' => inside = false,
            _ => {}
        }
        counts
    });
    letters.count()
}

/// Words on lines of at most a given number of letters.
fn lines(words: &str, letters: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if (count(line) + 1 + count(word)) as f64 <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_full_and_entities_are_one_letter() {
        assert_eq!(count("a &lt; b &amp;"), 7);
        assert_eq!(lines("one two three", 7.0), ["one two", "three"]);
        assert_eq!(lines("&lt;&lt; &gt;&gt;", 5.0), ["&lt;&lt; &gt;&gt;"]);
        assert_eq!(lines("overlong word", 3.0), ["overlong", "word"]);
    }

    #[test]
    fn a_figure_is_taken_with_all_that_belongs_to_it() {
        let html = "f\">\n<p id=\"f-title\">A &lt; B</p>\n<svg role=\"img\" viewBox=\"0 0 1040 500\" xmlns=\"x\"><circle r=\"2\"/>\
                    </svg><ul class=\"keys\"><li><i class=\"k0\" data-colour=\"#0E5A99\"></i>shots</li></ul>\n\
                    <figcaption><span id=\"f-words\">Words.</span> </figcaption>\n</figure>\n<p>";
        let figure = Figure::of(3, html).unwrap();
        assert_eq!(
            (figure.id, figure.keys.as_slice()),
            ("f", &[("#0E5A99", "shots")][..])
        );
        let svg = figure.svg();
        assert!(
            svg.contains("<circle r=\"2\"/></g>")
                && svg.contains(">Figure 3. A &lt; B. Words.</text>")
        );
        assert!(
            svg.contains("fill=\"#0E5A99\"") && svg.contains("viewBox=\"0 0 1040 590\""),
            "{svg}"
        );
    }
}
