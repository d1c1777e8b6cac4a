//! Kernels.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::answer::{ByNumber, List, answer};
use crate::{
    database::shown::{KernelFile, kernel_by_hash, kernels, used_by},
    http::{
        app::App,
        caller::Reader,
        coverage::Covered,
        extract::{At, Parameters},
        problem::{Problem, ProblemDocument},
    },
    instant::Instant,
};

/// Sites listed with a kernel.
const SITES: u32 = 1000;

/// A kernel file.
#[derive(Debug, Serialize, ToSchema)]
struct Kernel {
    /// Its path from its kernel folder.
    file: String,
    /// Size.
    bytes: i64,
    /// BLAKE3 of its content, once it has been read.
    blake3: Option<String>,
    /// `settling`, `ready`, `bad` or `gone`.
    state: String,
    /// The reason, as text.
    detail: String,
    /// When it was first seen.
    first_seen_utc: Instant,
    /// When it last changed.
    changed_utc: Instant,
}

impl Kernel {
    fn of(kernel: KernelFile) -> Self {
        Self {
            file: kernel.path,
            bytes: kernel.bytes,
            blake3: kernel.blake3,
            state: kernel.state,
            detail: kernel.detail,
            first_seen_utc: kernel.first_seen_utc,
            changed_utc: kernel.changed_utc,
        }
    }
}

/// Files in the folders of kernels, in the order in which they were first seen.
#[utoipa::path(get, path = "/api/v1/kernels", tag = "kernels", params(ByNumber), responses(
    (status = 200, body = List<Kernel>),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn list(
    _: Reader,
    State(app): State<Arc<App>>,
    Parameters(piece): Parameters<ByNumber>,
) -> Result<Response, Problem> {
    let (limit, after) = (piece.limit()?, piece.after()?);
    let found = app
        .read(move |connection| kernels(connection, after.unwrap_or(0), limit + 1))
        .await?;
    let piece = List::of(found, limit, |kernel| kernel.number.to_string());
    let piece = List {
        items: piece.items.into_iter().map(Kernel::of).collect(),
        next: piece.next,
    };
    answer(&app, &piece)
}

/// A kernel with its coverage and its readers.
#[derive(Debug, Serialize, ToSchema)]
struct KernelDetail {
    /// The file.
    kernel: Kernel,
    /// Positions of the spacecraft.
    position: Covered,
    /// Attitude of the spacecraft.
    attitude: Covered,
    /// Sites that read it, at most 1000.
    used_by: Vec<String>,
}

/// One kernel, by the BLAKE3 of its content.
#[utoipa::path(get, path = "/api/v1/kernels/{blake3}", tag = "kernels", params(
    ("blake3" = String, Path, description = "BLAKE3 of the content", pattern = "^[0-9a-f]{64}$"),
), responses(
    (status = 200, body = KernelDetail),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn one(
    _: Reader,
    State(app): State<Arc<App>>,
    At(blake3): At<String>,
) -> Result<Response, Problem> {
    let found = app
        .read(move |connection| {
            let Some(kernel) = kernel_by_hash(connection, &blake3)? else {
                return Ok(None);
            };
            Ok(Some(KernelDetail {
                position: Covered::of(&kernel.coverage, "position"),
                attitude: Covered::of(&kernel.coverage, "attitude"),
                used_by: used_by(connection, &kernel.path, SITES)?,
                kernel: Kernel::of(kernel),
            }))
        })
        .await?;
    answer(
        &app,
        &found.ok_or_else(|| Problem::not_found("There is no kernel with this content."))?,
    )
}
