//! Terms of a site's texts: its body, its altimeter and the source of its shots.
//!
//! Sentences take these terms as values. Texts that are declared once for all sites, such as descriptions of columns,
//! name them in braces, and [`Terms::fill`] inserts the values.
//!
//! ```
//! use areograph_base::{body::Body, terms::Terms};
//!
//! let lunar = Terms { body: Body::Moon, altimeter: "LOLA", has_tables: true, has_areoid: false };
//! assert_eq!(lunar.fill("record of the {shot_file}, {latitude} latitude"), "record of the table of shots, planetocentric latitude");
//! assert_eq!(Terms::MARS.fill("distance from the centre of {body}"), "distance from the centre of Mars");
//! ```

use std::borrow::Cow;

use crate::body::Body;

/// The terms of a site.
#[derive(Debug, Clone, Copy)]
pub struct Terms<'a> {
    /// The body.
    pub body: Body,
    /// Name of the altimeter.
    pub altimeter: &'a str,
    /// Whether shots come from tables.
    pub has_tables: bool,
    /// Whether shots have heights above the areoid.
    pub has_areoid: bool,
}

impl Terms<'static> {
    /// The terms of a site at Mars with shots of MOLA in PEDR files, which the documentation uses.
    pub const MARS: Self = Self {
        body: Body::Mars,
        altimeter: "MOLA",
        has_tables: false,
        has_areoid: true,
    };
}

impl Terms<'_> {
    /// The body within a sentence.
    #[must_use]
    pub fn body(&self) -> &'static str {
        &self.body.names().in_text
    }

    /// The frame of the products in two or three words.
    #[must_use]
    pub fn short_frame(&self) -> &'static str {
        &self.body.names().short_frame
    }

    /// Adjective of latitudes at the centre of the body.
    #[must_use]
    pub const fn latitude(&self) -> &'static str {
        match self.body {
            Body::Mars => "areocentric",
            Body::Moon => "planetocentric",
        }
    }

    /// The surface to which heights of the shots refer.
    #[must_use]
    pub const fn areoid(&self) -> &'static str {
        if self.has_areoid {
            "areoid"
        } else {
            "ellipsoid"
        }
    }

    /// A file of shots.
    #[must_use]
    pub const fn shot_file(&self) -> &'static str {
        if self.has_tables {
            "table of shots"
        } else {
            "PEDR file"
        }
    }

    /// The shots as a source, as in "orbit of the PEDR".
    #[must_use]
    pub const fn shot_source(&self) -> &'static str {
        if self.has_tables {
            "table of shots"
        } else {
            "PEDR"
        }
    }

    /// The value of a name that texts may contain in braces.
    fn value(&self, name: &str) -> Option<&str> {
        Some(match name {
            "altimeter" => self.altimeter,
            "body" => self.body(),
            "body_name" => &self.body.names().name,
            "frame" => self.short_frame(),
            "latitude" => self.latitude(),
            "latitude_of_maps" if self.body == Body::Mars => "areographic",
            "latitude_of_maps" => "planetographic",
            "areoid" => self.areoid(),
            "asp_datum" => &self.body.map().asp_datum,
            "record" if self.has_tables => {
                "line of the table of shots, counted from 1, heading included"
            }
            "record" => "record of the PEDR file, counted from 1, label records included",
            "shot_file" => self.shot_file(),
            "shot_source" => self.shot_source(),
            _ => return None,
        })
    }

    /// A declared text with the values of the terms that it names in braces; other braces are kept.
    #[must_use]
    pub fn fill<'t>(&self, text: &'t str) -> Cow<'t, str> {
        if !text.contains('{') {
            return Cow::Borrowed(text);
        }
        let mut filled = String::with_capacity(text.len());
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            filled.push_str(before);
            let named = after.split_once('}');
            rest = if let Some((value, after)) =
                named.and_then(|(name, after)| Some((self.value(name)?, after)))
            {
                filled.push_str(value);
                after
            } else {
                filled.push('{');
                after
            };
        }
        filled.push_str(rest);
        Cow::Owned(filled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LUNAR: Terms = Terms {
        body: Body::Moon,
        altimeter: "LOLA",
        has_tables: true,
        has_areoid: false,
    };

    #[test]
    fn a_lunar_site_has_no_term_of_mars() {
        let all = "{altimeter} {body} {body_name} {frame} {latitude} {latitude_of_maps} {areoid} {asp_datum} {record} \
                   {shot_file} {shot_source}";
        let lunar = LUNAR.fill(all);
        assert!(!lunar.contains('{'), "{lunar}");
        for word in ["Mars", "MARS", "MOLA", "PEDR", "areo"] {
            assert!(!lunar.contains(word), "{lunar}");
        }
    }

    #[test]
    fn other_braces_are_kept() {
        for text in ["", "plain", "{", "}", "{unknown}", "a {} b", "{ body }"] {
            assert_eq!(LUNAR.fill(text), text);
        }
        assert_eq!(LUNAR.fill("{{body}"), "{the Moon");
    }

    #[test]
    fn tables_of_mola_at_mars_have_its_names_but_no_pedr_files() {
        let table = Terms {
            has_tables: true,
            ..Terms::MARS
        };
        assert_eq!(
            table.fill("{altimeter} in the {shot_file}, {latitude}, {frame}, {areoid}"),
            "MOLA in the table of shots, areocentric, IAU 2000, areoid"
        );
    }
}
