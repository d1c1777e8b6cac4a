//! JSON Schemas of documents, from the types that write them: doc comments become descriptions.

use schemars::{
    JsonSchema, Schema,
    generate::SchemaSettings,
    transform::{RecursiveTransform, Transform},
};
use serde_json::{Value, json};

/// A document whose JSON Schema is kept in `config/schema`.
#[derive(Debug, Clone, PartialEq)]
pub struct DocumentSchema {
    /// Name of the file, without `.schema.json`.
    pub name: &'static str,
    /// The schema.
    pub schema: Value,
}

impl DocumentSchema {
    /// The schema of what `T` writes, under `name`.
    ///
    /// Objects have only declared members, and nothing is null: unknown values are left out.
    #[must_use]
    pub fn of<T: JsonSchema>(name: &'static str) -> Self {
        let settings = SchemaSettings::draft2020_12()
            .for_serialize()
            .with_transform(RecursiveTransform(close));
        let schema = settings.into_generator().into_root_schema_for::<T>();
        Self {
            name,
            schema: schema.to_value(),
        }
    }

    /// Sets `keyword` of the schema at a JSON pointer, for rules that the type does not express.
    #[must_use]
    pub fn with(mut self, pointer: &str, keyword: &str, value: impl Into<Value>) -> Self {
        if let Some(part) = self.schema.pointer_mut(pointer) {
            part[keyword] = value.into();
        }
        self
    }
}

/// Sets `keyword` at the JSON pointer `pointer` of a member's schema, for rules that attributes cannot express, such
/// as limits of the numbers in an array.
pub fn at(pointer: &'static str, keyword: &'static str, value: impl Into<Value>) -> impl Transform {
    let value = value.into();
    move |schema: &mut Schema| {
        if let Some(Value::Object(part)) = schema.pointer_mut(pointer) {
            part.insert(keyword.to_owned(), value.clone());
        }
    }
}

/// The numbers of an array or a map are above 0.
pub fn all_positive(schema: &mut Schema) {
    at("/items", "exclusiveMinimum", 0).transform(schema);
}

/// The numbers of an array or a map are not below 0.
pub fn none_negative(schema: &mut Schema) {
    at("/items", "minimum", 0).transform(schema);
}

fn close(schema: &mut Schema) {
    let Some(object) = schema.as_object_mut() else {
        return;
    };
    // Rust's formats of numbers.
    object.remove("format");
    if object.contains_key("properties") && !object.contains_key("additionalProperties") {
        object.insert("additionalProperties".to_owned(), json!(false));
    }
    if let Some(Value::Array(types)) = object.get_mut("type") {
        types.retain(|kind| kind != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            object.insert("type".to_owned(), only);
        }
    }
    if let Some(Value::Array(choices)) = object.get_mut("anyOf") {
        choices.retain(|choice| choice != &json!({ "type": "null" }));
        if let [Value::Object(only)] = choices.as_slice() {
            let only = only.clone();
            object.remove("anyOf");
            for (keyword, value) in only {
                object.entry(keyword).or_insert(value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::Serialize;

    use super::*;

    #[derive(Serialize, JsonSchema)]
    struct Inner {
        /// Share.
        #[schemars(range(min = 0.0, max = 1.0))]
        share: f64,
    }

    #[derive(Serialize, JsonSchema)]
    struct Outer {
        #[serde(skip_serializing_if = "Option::is_none")]
        known: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        inner: Option<Inner>,
        #[schemars(transform = all_positive)]
        sizes_m: [f64; 2],
    }

    #[test]
    fn documents_have_no_other_members_and_no_nulls() {
        let found = DocumentSchema::of::<Outer>("outer").schema;
        assert_eq!(found["additionalProperties"], json!(false));
        assert_eq!(found["required"], json!(["sizes_m"]));
        assert_eq!(found["properties"]["known"], json!({ "type": "number" }));
        assert_eq!(
            found["properties"]["inner"],
            json!({ "$ref": "#/$defs/Inner" })
        );
        assert_eq!(
            found["properties"]["sizes_m"],
            json!({
                "type": "array", "minItems": 2, "maxItems": 2,
                "items": { "type": "number", "exclusiveMinimum": 0 },
            })
        );
        assert_eq!(
            found["$defs"]["Inner"]["properties"]["share"],
            json!({ "description": "Share.", "type": "number", "minimum": 0.0, "maximum": 1.0 })
        );
    }
}
