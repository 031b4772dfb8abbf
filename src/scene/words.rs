//! The words that a scene may choose from, for the JSON schema: taken from the tables that the program itself looks them up in.

use std::fmt;

use schemars::{Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, Error, Visitor};
use serde_json::json;

use super::needles;
use crate::effects::own::Number;
use crate::effects::{EFFECTS, SELF_CONTAINED};
use crate::mesh::import::LengthUnit;

/// A text that is one of `words`.
fn one_of<'a>(words: impl Iterator<Item = &'a str>) -> Schema {
    json_schema!({ "type": "string", "enum": words.collect::<Vec<&str>>() })
}

/// The list of effects: each at most once.
pub fn effects(_: &mut SchemaGenerator) -> Schema {
    let key = one_of(EFFECTS.iter().map(|effect| effect.key));
    json_schema!({ "type": "array", "items": key, "uniqueItems": true })
}

/// Adds the tables of effects that are complete by themselves to the tables of the others.
pub fn self_contained_tables(around: &mut Schema) {
    for effect in SELF_CONTAINED {
        let number = |n: &Number| {
            let text = format!("{}; default {}.", n.text, n.default);
            let [low, high] = n.range;
            (n.key.to_string(), json!({ "description": text, "type": "number", "minimum": low, "maximum": high }))
        };
        let numbers: serde_json::Map<String, serde_json::Value> = effect.numbers.iter().map(number).collect();
        let table = json!({
            "description": format!("Effect `{}`: {}.", effect.effect.key, effect.effect.summary),
            "type": "object",
            "additionalProperties": false,
            "properties": numbers,
        });
        if let Some(properties) = around.get_mut("properties").and_then(serde_json::Value::as_object_mut) {
            properties.insert(effect.effect.key.into(), table);
        }
    }
}

/// Gauges of the needle library.
pub fn gauges(_: &mut SchemaGenerator) -> Schema {
    one_of(needles::needles().iter().map(|needle| needle.gauge.as_str()))
}

/// Names of the needle materials.
pub fn needle_materials(_: &mut SchemaGenerator) -> Schema {
    one_of(needles::needle_materials().iter().map(|material| material.name.as_str()))
}

/// Units of length of a mesh file.
pub fn units(_: &mut SchemaGenerator) -> Schema {
    one_of(LengthUnit::ALL.into_iter().map(LengthUnit::symbol))
}

/// Names and aliases of the built-in materials, read off their file: the presets themselves are made of the tables that this schema describes.
fn preset_names() -> Vec<String> {
    #[derive(Deserialize)]
    struct Library {
        material: Vec<Named>,
    }
    #[derive(Deserialize)]
    struct Named {
        name: String,
        #[serde(default)]
        aliases: Vec<String>,
    }
    let library: Library = toml::from_str(include_str!("../../assets/materials.toml"))
        .expect("assets/materials.toml is part of the program and tested");
    let (names, aliases): (Vec<_>, Vec<_>) = library.material.into_iter().map(|m| (m.name, m.aliases)).unzip();
    names.into_iter().chain(aliases.into_iter().flatten()).collect()
}

/// Without a library of its own a material knows the built-in presets alone.
pub fn known_presets(material: &mut Schema) {
    let names = preset_names();
    material.insert("if".into(), json!({ "not": { "required": ["library"] } }));
    material.insert("then".into(), json!({ "properties": { "preset": { "enum": names } } }));
}

/// Reads a gauge; a bare number is kept as its digits, so that the refusal can name the gauge that is meant.
///
/// # Errors
/// Anything but a text or a number.
pub fn gauge<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    struct Gauge;
    impl Visitor<'_> for Gauge {
        type Value = String;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a gauge in quotes like \"16G\"")
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<String, E> {
            Ok(text.into())
        }

        fn visit_i64<E: Error>(self, number: i64) -> Result<String, E> {
            Ok(number.to_string())
        }

        fn visit_f64<E: Error>(self, number: f64) -> Result<String, E> {
            Ok(number.to_string())
        }
    }
    deserializer.deserialize_any(Gauge).map(Some)
}
