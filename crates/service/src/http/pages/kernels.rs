//! Kernels: their coverage, last change and readers.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use maud::html;

use super::{
    jobs::short,
    layout::Page,
    parts::{From, more, size, table, times},
    timeline::{Row, timeline},
};
use crate::{
    database::shown::{KernelFile, kernels, roots, used_by},
    http::{app::App, caller::Reader, coverage::Covered, extract::Parameters, problem::Problem},
};

/// Kernels on one page.
const KERNELS: u32 = 300;
/// Sites listed with a kernel.
const SITES: u32 = 4;

/// Kernels with a timeline of their coverage.
pub(super) async fn list(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    Parameters(from): Parameters<From>,
) -> Result<Response, Problem> {
    let (found, users, roots) = app
        .read(move |connection| {
            let mut found = kernels(connection, from.after.unwrap_or(0), KERNELS + 1)?;
            let next = (found.len() > KERNELS as usize).then(|| found[KERNELS as usize - 1].number);
            found.truncate(KERNELS as usize);
            found.sort_by(|a, b| a.path.cmp(&b.path));
            let users: Vec<Vec<String>> = found
                .iter()
                .map(|kernel| used_by(connection, &kernel.path, SITES + 1))
                .collect::<Result<_, _>>()?;
            Ok(((found, next), users, roots(connection)?))
        })
        .await?;
    let (found, next) = found;
    let times = times(&app);
    let rows: Vec<Row> = found
        .iter()
        .map(row)
        .filter(|row| !row.is_empty())
        .collect();
    let body = html! {
        section {
            h2 { "Folders" }
            (table("Folders of inputs", &["Folder", "Holds", "Files", "State", "Since, UTC", "Why"], &html! {
                @for root in &roots {
                    tr {
                        th scope="row" { (root.path) }
                        td { (root.kind) }
                        td class="number" { (root.files) }
                        td { span class={ "word " (if root.state == "available" { "valid" } else if root.state == "settling" { "remarks" } else { "invalid" }) } { (root.state) } }
                        td { (times.at(root.since_utc)) }
                        td class="long" { (root.detail) }
                    }
                }
            }))
        }
        section { h2 { "Coverage" } (timeline(&rows)) }
        section {
            h2 { "Files" }
            div id="files" data-live="" {
                (table("Kernels by path", &["Kernel", "State", "Last change, UTC", "Size", "BLAKE3", "Read by"], &html! {
                    @for (kernel, users) in found.iter().zip(&users) {
                        tr {
                            th scope="row" { (kernel.path) }
                            td { (kernel.state) @if !kernel.detail.is_empty() { ": " (kernel.detail) } }
                            td { (times.at(kernel.changed_utc)) }
                            td class="number" { (size(kernel.bytes.unsigned_abs())) }
                            td class="hash" { (kernel.blake3.as_deref().map_or("–", short)) }
                            td {
                                @for (k, site) in users.iter().take(SITES as usize).enumerate() { @if k > 0 { ", " } a href={ "/sites/" (site) } { (site) } }
                                @if users.len() > SITES as usize { " and more" }
                                @if users.is_empty() { "no site" }
                            }
                        }
                    }
                }))
            }
            (more(next.map(|next| format!("/kernels?after={next}"))))
        }
    };
    Ok(Page {
        title: "Kernels",
        place: "/kernels",
    }
    .answer(&app, &caller, &body))
}

fn row(kernel: &KernelFile) -> Row {
    Row {
        name: kernel
            .path
            .rsplit('/')
            .next()
            .unwrap_or_default()
            .to_owned(),
        position: Covered::of(&kernel.coverage, "position").intervals,
        attitude: Covered::of(&kernel.coverage, "attitude").intervals,
    }
}
