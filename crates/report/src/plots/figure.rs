//! A figure of a page: heading, picture, legend, caption, and its data for download.

use plotters::style::RGBColor;

use super::super::html::{Markup, PreEscaped, html, slug};

/// An entry of a legend.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Key {
    label: String,
    /// A class of the page's style that follows light and dark; empty for a colour that does not.
    class: String,
    /// The colour on light pages.
    colour: String,
}

impl Key {
    /// An entry in colour `index` of the palette.
    pub(crate) fn colour(label: &str, index: usize) -> Self {
        let index = index % super::COLOURS.len();
        Self {
            label: label.to_owned(),
            class: format!("k{index}"),
            colour: written(super::COLOURS[index]),
        }
    }

    /// An entry in the colour of marks.
    pub(crate) fn mark(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            class: "km".to_owned(),
            colour: written(super::MARK),
        }
    }

    /// An entry in a colour that is the same on light and dark pages.
    pub(crate) fn fixed(label: &str, colour: RGBColor) -> Self {
        Self {
            label: label.to_owned(),
            class: String::new(),
            colour: written(colour),
        }
    }

    fn html(&self) -> Markup {
        let Self {
            label,
            class,
            colour,
        } = self;
        let (class, style) = match &**class {
            "" => (None, Some(format!("background:{colour}"))),
            class => (Some(class), None),
        };
        // Read from the page to draw the figure separately.
        html! { li { i class=[class] style=[style] data-colour=(colour) {} (label) } }
    }
}

fn written(RGBColor(red, green, blue): RGBColor) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// The figure; `title` is unique on its page, `csv` holds the numbers that are drawn.
pub(crate) fn figure_html(
    title: &str,
    svg: &str,
    keys: &[Key],
    caption: &str,
    csv: &str,
) -> Markup {
    let id = slug(title);
    // The drawing library states its size in pixels; the page decides that.
    let svg = svg.find("viewBox").map_or_else(
        || svg.to_owned(),
        |at| {
            // Attributes that every element repeats although they are the default.
            let drawing = svg[at..]
                .replace(" opacity=\"1\"", "")
                .replace(" stroke=\"none\" stroke-width=\"1\"", "");
            format!("<svg role=\"img\" aria-labelledby=\"{id}-title {id}-words\" {drawing}")
        },
    );
    html! {
        figure #(id) {
            p.title id={ (id) "-title" } { (title) }
            (PreEscaped(svg))
            @if !keys.is_empty() { ul.keys { @for key in keys { (key.html()) } } }
            figcaption { span id={ (id) "-words" } { (caption) } " " (data_link(&id, csv)) }
        }
    }
}

/// The page with a link to the file of every figure, which the products contain beside it.
pub(crate) fn with_files(page: &str) -> String {
    let mut figures = page.split("<figure id=\"");
    let mut linked = figures.next().unwrap_or_default().to_owned();
    for figure in figures {
        let id = figure.split('"').next().unwrap_or_default();
        let link = format!(" <a class=\"data\" href=\"figures/{id}.svg\">SVG</a></figcaption>");
        linked += "<figure id=\"";
        linked += &figure.replacen("</figcaption>", &link, 1);
    }
    linked
}

/// A link that downloads `csv` as `<name>.csv` from inside the page.
pub(crate) fn data_link(name: &str, csv: &str) -> Markup {
    let mut encoded = String::with_capacity(csv.len() + csv.len() / 8);
    for byte in csv.bytes() {
        match byte {
            b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' | b'.' | b',' | b'-' | b'_' | b':' | b'/' => {
                encoded.push(char::from(byte));
            }
            _ => encoded.push_str(&format!("%{byte:02X}")),
        }
    }
    html! {
        a.data download={ (name) ".csv" } href={ "data:text/csv;charset=utf-8," (encoded) } { "Data (CSV)" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_can_be_decoded_again() {
        let csv = "a,\"µ% #\"\n1,-2.5e-3\n";
        let link = data_link("x", csv).0;
        let start = link.find("utf-8,").unwrap() + "utf-8,".len();
        let encoded = &link[start..link[start..].find('"').unwrap() + start];
        let mut bytes = Vec::new();
        let mut rest = encoded.as_bytes();
        while let [first, tail @ ..] = rest {
            rest = tail;
            if *first == b'%' {
                let digits = std::str::from_utf8(&rest[..2]).unwrap();
                bytes.push(u8::from_str_radix(digits, 16).unwrap());
                rest = &rest[2..];
            } else {
                bytes.push(*first);
            }
        }
        assert_eq!(String::from_utf8(bytes).unwrap(), csv);
    }
}
