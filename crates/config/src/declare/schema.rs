//! JSON Schema of the configuration file.

use serde::{Serialize, Serializer, ser::SerializeMap as _};
use serde_json::{Value as Json, json};
use toml::Value;

use super::described::{Accept, DescribedKey, DescribedTable, ValueKind};

/// The JSON Schema of the file whose table is `file`.
pub(crate) fn schema(
    title: &'static str,
    description: &str,
    file: &DescribedTable,
) -> impl Serialize + use<> {
    Schema {
        schema: Some("https://json-schema.org/draft/2020-12/schema"),
        title: Some(title),
        ..of_table(file, description.to_owned())
    }
}

/// The words of JSON Schema that are used here, in the order in which they are written.
#[derive(Default, Serialize)]
#[serde(rename_all = "camelCase")]
struct Schema {
    #[serde(rename = "$schema", skip_serializing_if = "Option::is_none")]
    schema: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    title: Option<&'static str>,
    #[serde(skip_serializing_if = "String::is_empty")]
    description: String,
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    of_type: Option<&'static str>,
    #[serde(rename = "enum", skip_serializing_if = "Vec::is_empty")]
    words: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pattern: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    minimum: Option<Json>,
    #[serde(skip_serializing_if = "Option::is_none")]
    exclusive_minimum: Option<Json>,
    #[serde(skip_serializing_if = "Option::is_none")]
    maximum: Option<Json>,
    #[serde(skip_serializing_if = "Option::is_none")]
    min_items: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_items: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unique_items: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    items: Option<Box<Schema>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    additional_properties: Option<bool>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    required: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    any_of: Vec<Json>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    all_of: Vec<Json>,
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "in_order")]
    properties: Vec<(String, Schema)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    default: Option<Json>,
    #[serde(skip_serializing_if = "Option::is_none")]
    deprecated: Option<bool>,
}

/// An object whose members keep their order.
fn in_order<S: Serializer>(members: &[(String, Schema)], serializer: S) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_map(Some(members.len()))?;
    for (name, schema) in members {
        object.serialize_entry(name, schema)?;
    }
    object.end()
}

fn of_table(table: &DescribedTable, description: String) -> Schema {
    let keys = table.keys.iter().flat_map(|key| {
        let former = key.was.map(|was| (was.to_owned(), of_former(key)));
        [(key.name.to_owned(), of_key(key))]
            .into_iter()
            .chain(former)
    });
    let tables = table.tables.iter().flat_map(|below| {
        let described = of_table(below, one_line(below.about));
        let former = below
            .was
            .map(|was| (was.to_owned(), of_former_table(below)));
        [(below.name().to_owned(), of_tables(below, described))]
            .into_iter()
            .chain(former)
    });
    let required = table.keys.iter().filter(|key| key.required);
    Schema {
        description,
        of_type: Some("object"),
        additional_properties: Some(false),
        required: required.map(|key| key.name.to_owned()).collect(),
        all_of: table.rules.clone(),
        properties: keys.chain(tables).collect(),
        ..Schema::default()
    }
}

/// One table, or the list of them.
fn of_tables(table: &DescribedTable, one: Schema) -> Schema {
    let Some(many) = table.many else { return one };
    Schema {
        of_type: Some("array"),
        min_items: many.count.map(|(fewest, _)| fewest),
        max_items: many.count.map(|(_, most)| most),
        items: Some(Box::new(one)),
        ..Schema::default()
    }
}

fn of_key(key: &DescribedKey) -> Schema {
    let mut description = one_line(key.about);
    if let Some(unit) = key.unit() {
        description = format!("{description} Unit: {unit}.");
    }
    Schema {
        description,
        default: key.default.as_ref().map(json_of),
        ..of_kind(&key.kind)
    }
}

fn of_former_table(table: &DescribedTable) -> Schema {
    Schema {
        deprecated: Some(true),
        ..of_table(table, format!("Now called {}.", table.name()))
    }
}

fn of_former(key: &DescribedKey) -> Schema {
    Schema {
        description: format!("Now called {}.", key.name),
        deprecated: Some(true),
        ..of_kind(&key.kind)
    }
}

fn of_kind(kind: &ValueKind) -> Schema {
    let of_type = |of_type| Schema {
        of_type: Some(of_type),
        ..Schema::default()
    };
    match kind {
        ValueKind::Text { empty: true } => of_type("string"),
        ValueKind::Text { empty: false } => Schema {
            pattern: Some(r"\S"),
            ..of_type("string")
        },
        ValueKind::File | ValueKind::Folder | ValueKind::Mirror | ValueKind::Glob => Schema {
            pattern: Some("."),
            ..of_type("string")
        },
        ValueKind::Form { pattern, .. } => Schema {
            pattern: Some(pattern),
            ..of_type("string")
        },
        ValueKind::Number(accept) => of_number(*accept),
        ValueKind::Whole { low, high } => Schema {
            minimum: Some(json!(low)),
            maximum: Some(json!(high)),
            ..of_type("integer")
        },
        ValueKind::Switch => of_type("boolean"),
        ValueKind::Word(words) => Schema {
            words: words.iter().map(|word| word.word).collect(),
            ..Schema::default()
        },
        ValueKind::List {
            of,
            count,
            empty,
            distinct,
            ..
        } => Schema {
            min_items: count.or((!empty).then_some(1)),
            max_items: *count,
            unique_items: distinct.then_some(true),
            items: Some(Box::new(of_kind(of))),
            ..of_type("array")
        },
    }
}

fn of_number(accept: Accept) -> Schema {
    let number = Schema {
        of_type: Some("number"),
        ..Schema::default()
    };
    match accept {
        Accept::FromTo(low, high) => Schema {
            minimum: json_number(low),
            maximum: json_number(high),
            ..number
        },
        Accept::AboveTo(low, high) => Schema {
            exclusive_minimum: json_number(low),
            maximum: json_number(high),
            ..number
        },
        Accept::ZeroOr(low, high) => Schema {
            any_of: vec![json!({"const": 0}), json!({"minimum": json_number(low)})],
            maximum: json_number(high),
            ..number
        },
    }
}

/// Whole numbers without a decimal point; infinity is no limit.
fn json_number(value: f64) -> Option<Json> {
    if !value.is_finite() {
        return None;
    }
    let text = value.to_string();
    Some(
        text.parse::<i64>()
            .map_or_else(|_| json!(value), Json::from),
    )
}

fn json_of(value: &Value) -> Json {
    match value {
        Value::Float(number) => json!(number),
        Value::Integer(number) => json!(number),
        Value::Boolean(is_true) => json!(is_true),
        Value::Array(entries) => entries.iter().map(json_of).collect(),
        Value::String(text) => json!(text),
        other => json!(other.to_string()),
    }
}

fn one_line(lines: &[&str]) -> String {
    let lines: Vec<&str> = lines.iter().map(|line| line.trim()).collect();
    lines.join(" ")
}
