//! The words of a page: sections are written for MOLA at Mars, and say the names of another body and altimeter where a
//! site has them.

use crate::{body::Body, products::SiteProducts};

/// The text of a section in the words of the site.
pub(super) fn of_the_site(site: &SiteProducts, text: String) -> String {
    let body = site.config.body;
    if body == Body::Mars {
        return text;
    }
    let (names, altimeter) = (body.names(), &*site.config.altimeter.name);
    let fixed = format!("{}-fixed", names.name);
    let of_body = format!("of {}", names.in_text);
    let from_body = format!("from {}", names.in_text);
    let words = [
        ("areocentric", "planetocentric"),
        ("IAU 2000", &names.short_frame),
        ("PEDR", altimeter),
        ("MOLA", altimeter),
        ("Mars-fixed", &fixed),
        ("of Mars", &of_body),
        ("from Mars", &from_body),
    ];
    let words = words.into_iter();
    words.fold(text, |text, (at_mars, here)| text.replace(at_mars, here))
}
