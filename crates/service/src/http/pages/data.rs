//! Status of database and products on the start page.

use maud::{Markup, html};

use super::parts::{Times, counted};
use crate::database::shown::{DataStatus, ProductStatus};

/// What needs attention: list items.
pub(super) fn attention(data: &DataStatus, recovering: bool) -> Markup {
    let products = &data.products;
    html! {
        @if recovering { li { "The database was lost: it is being made again from the products. Sites appear one after the other." } }
        @if let Some(loss) = &data.database_loss { li { (sentence(&loss.text)) "." } }
        @if products.runs_damaged > 0 {
            li {
                "Products of " (counted(products.runs_damaged, "run")) " do not match their manifests and are withheld: "
                @for (place, run) in products.damaged.iter().enumerate() {
                    @if place > 0 { ", " }
                    a href={ "/runs/" (run.run) } { (run.site) " " (run.run) }
                }
                ". A current run is made again; others can be restored from a copy."
            }
        }
    }
}

/// The last check of products.
pub(super) fn last_scrub(products: &ProductStatus, times: &Times) -> Markup {
    html! {
        p {
            @match &products.last_scrub {
                None => "Products were not read again yet.",
                Some(scrub) => {
                    "Products of " (counted(scrub.runs, "run")) " were read again " (times.age(scrub.ended_utc)) "; "
                    (counted(scrub.damaged_runs, "run")) " with damaged products."
                }
            }
            " " (counted(products.runs_due, "run")) " of " (products.runs) " due."
        }
    }
}

fn sentence(text: &str) -> String {
    let mut text = text.to_owned();
    if let Some(first) = text.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    text
}
