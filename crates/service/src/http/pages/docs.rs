//! The interface for programs as a page, from the document that describes it.

use std::sync::Arc;

use axum::{extract::State, response::Response};
use maud::{Markup, html};
use serde_json::{Map, Value};

use super::{
    layout::Page,
    parts::{prose, table},
};
use crate::http::{api::description, app::App, caller::Reader, problem::Problem};

/// Methods of operations, in the order of the page.
const METHODS: [&str; 5] = ["get", "post", "put", "patch", "delete"];
/// Start of a reference to a document.
const SCHEMAS: &str = "#/components/schemas/";

/// All operations and documents.
pub(super) async fn docs(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
) -> Result<Response, Problem> {
    let description = description();
    let body = html! {
        p { (prose(text(&description["info"]["description"]))) }
        p {
            "The same description in machine-readable form: " a href="/openapi.json" { "openapi.json" } " (OpenAPI "
            (text(&description["openapi"])) "). A token is sent as " code { "Authorization: Bearer areo_…" }
            "; " code { "areograph service token add" } " creates one."
        }
        section {
            h2 { "Operations" }
            @for (path, item) in entries(&description["paths"]) {
                @for method in METHODS {
                    @if let Some(operation) = item.get(method) { (one(path, method, operation)) }
                }
            }
        }
        section {
            h2 { "Documents" }
            @for (name, schema) in entries(&description["components"]["schemas"]) { (document(name, schema)) }
        }
    };
    Ok(Page {
        title: "Interface for programs",
        place: "/docs",
    }
    .answer(&app, &caller, &body))
}

fn entries(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flat_map(Map::iter)
}

fn items(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

fn one(path: &str, method: &str, operation: &Value) -> Markup {
    let bodies = entries(&operation["requestBody"]["content"]);
    html! {
        details {
            summary { code { (method.to_uppercase()) " " (path) } " " (prose(text(&operation["summary"]))) }
            @if !text(&operation["description"]).is_empty() { p { (prose(text(&operation["description"]))) } }
            @if items(&operation["parameters"]).next().is_some() {
                (table("Parameters", &["Name", "In", "Type", "Required", "Meaning"], &html! {
                    @for parameter in items(&operation["parameters"]) {
                        tr {
                            th scope="row" { code { (text(&parameter["name"])) } }
                            td { (text(&parameter["in"])) }
                            td { (kind(&parameter["schema"])) }
                            td { (if parameter["required"] == true { "yes" } else { "no" }) }
                            td class="long" { (text(&parameter["description"])) }
                        }
                    }
                }))
            }
            @for (media, body) in bodies { p { "Body, " code { (media) } ": " (kind(&body["schema"])) } }
            (table("Answers", &["Status", "Media type", "Document", "Meaning"], &html! {
                @for (status, answer) in entries(&operation["responses"]) {
                    tr {
                        th scope="row" { (status) }
                        td { @for (media, _) in entries(&answer["content"]) { code { (media) } " " } }
                        td { @for (_, body) in entries(&answer["content"]) { (kind(&body["schema"])) " " } }
                        td class="long" { (text(&answer["description"])) }
                    }
                }
            }))
        }
    }
}

fn document(name: &str, schema: &Value) -> Markup {
    // A document may contain the entries of others.
    let parts: Vec<&Value> = std::iter::once(schema)
        .chain(items(&schema["allOf"]))
        .collect();
    let required = |name: &str| {
        parts
            .iter()
            .any(|part| items(&part["required"]).any(|one| one == name))
    };
    html! {
        details id={ "document-" (name) } {
            summary { code { (name) } " " (prose(text(&schema["description"]))) }
            @for part in &parts { @if part.get("$ref").is_some() { p { "Contains the entries of " (kind(part)) "." } } }
            @if items(&schema["enum"]).next().is_some() {
                p { "One of " @for (k, word) in items(&schema["enum"]).enumerate() { @if k > 0 { ", " } code { (text(word)) } } "." }
            }
            @if parts.iter().any(|part| part.get("properties").is_some()) {
                (table("Entries", &["Name", "Type", "Required", "Meaning"], &html! {
                    @for part in &parts {
                        @for (entry, property) in entries(&part["properties"]) {
                            tr {
                                th scope="row" { code { (entry) } }
                                td { (kind(property)) }
                                td { (if required(entry) { "yes" } else { "no" }) }
                                td class="long" { (prose(text(&property["description"]))) }
                            }
                        }
                    }
                }))
            }
        }
    }
}

/// The type of a value; a document is linked.
fn kind(schema: &Value) -> Markup {
    let reference = text(&schema["$ref"]);
    let either = ["oneOf", "anyOf"].map(|key| items(&schema[key]));
    html! {
        @if let Some(name) = reference.strip_prefix(SCHEMAS) { a href={ "#document-" (name) } { (name) } }
        @else if schema["type"] == "array" { "list of " (kind(&schema["items"])) }
        @else if let Some(types) = schema["type"].as_array() {
            @for (k, one) in types.iter().enumerate() { @if k > 0 { " or " } (text(one)) }
        }
        @else if schema["type"].is_string() {
            (text(&schema["type"]))
            @if !text(&schema["format"]).is_empty() { ", " (text(&schema["format"])) }
        }
        @else { @for (k, one) in either.into_iter().flatten().enumerate() { @if k > 0 { " or " } (kind(one)) } }
    }
}
