//! Status of database and products on the start page.

use maud::{Markup, html};

use super::parts::Times;
use crate::{
    database::shown::{DataStatus, ProductStatus},
    words::counted,
};

/// Points that need attention: list items.
pub(super) fn attention(data: &DataStatus, recovering: bool) -> Markup {
    let products = &data.products;
    html! {
        @if recovering { li { "The database was lost: the service is rebuilding it from the products. The sites appear one by one." } }
        @if let Some(loss) = &data.database_loss { li { (capitalised(&loss.text)) "." } }
        @if products.runs_damaged > 0 {
            li {
                "Products of " (counted(products.runs_damaged, "run")) " do not match their manifests and are withheld: "
                @for (place, run) in products.damaged.iter().enumerate() {
                    @if place > 0 { ", " }
                    a href={ "/runs/" (run.run) } { (run.site) " " (run.run) }
                }
                ". The service regenerates current runs. Restore other runs from a copy."
            }
        }
    }
}

/// The last check of products.
pub(super) fn last_scrub(products: &ProductStatus, times: &Times) -> Markup {
    html! {
        p {
            @match &products.last_scrub {
                None => "The service has not checked the products yet.",
                Some(scrub) => {
                    "The service checked the products of " (counted(scrub.runs, "run")) " " (times.age(scrub.ended_utc)) " and found damage in "
                    (counted(scrub.damaged_runs, "run")) "."
                }
            }
            @match products.runs_due {
                0 => " No run is due for the next check.",
                due => { " The next check is due for " (due) " of " (counted(products.runs, "run")) "." }
            }
        }
    }
}

fn capitalised(text: &str) -> String {
    let mut text = text.to_owned();
    if let Some(first) = text.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    text
}
