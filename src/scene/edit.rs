//! Writes overrides into the text of a scene: the values change, comments and order stay.

use toml_edit::{DocumentMut, Item, Table, Value};

use crate::{Error, Result};

/// `text` with `overrides` (`friction.coefficient=0.4`) as values of its own.
///
/// # Errors
/// `Error::Input` for a text that is no TOML and for an override that finds no place in it.
pub fn written(text: &str, overrides: &[String]) -> Result<String> {
    let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| refused(text, &e.to_string()))?;
    for override_text in overrides {
        let (path, value) = override_text.split_once('=').ok_or_else(|| refused(override_text, "there is no `=`"))?;
        // A bare word is a text, as on the command line.
        let value: Value = value.trim().parse().unwrap_or_else(|_| Value::from(value.trim()));
        let keys: Vec<&str> = path.split('.').map(str::trim).collect();
        set(document.as_item_mut(), &keys, value).ok_or_else(|| refused(override_text, "it finds no place"))?;
    }
    Ok(document.to_string())
}

/// Walks down `keys` and sets the last; tables that are missing are made.
fn set(item: &mut Item, keys: &[&str], value: Value) -> Option<()> {
    let (first, rest) = keys.split_first()?;
    if rest.is_empty() {
        return put(item, first, value);
    }
    if let Ok(index) = first.parse::<usize>() {
        return match item {
            Item::ArrayOfTables(tables) => set_in_table(tables.get_mut(index)?, rest, value),
            Item::Value(Value::Array(array)) => {
                // A list of inline tables.
                let mut inner = Item::Value(array.get(index)?.clone());
                set(&mut inner, rest, value)?;
                array.replace(index, inner.into_value().ok()?);
                Some(())
            }
            _ => None,
        };
    }
    match item {
        Item::Table(table) => set(table.entry(first).or_insert(Item::Table(Table::new())), rest, value),
        Item::Value(Value::InlineTable(table)) => {
            let mut inner = Item::Value(table.get(first)?.clone());
            set(&mut inner, rest, value)?;
            table.insert(*first, inner.into_value().ok()?);
            Some(())
        }
        _ => None,
    }
}

fn set_in_table(table: &mut Table, keys: &[&str], value: Value) -> Option<()> {
    let mut item = Item::Table(std::mem::take(table));
    let done = set(&mut item, keys, value);
    *table = item.into_table().ok()?;
    done
}

/// Sets one value; what stood around the old one stays.
fn put(item: &mut Item, key: &str, mut value: Value) -> Option<()> {
    let keep = |old: Option<&Value>, value: &mut Value| {
        if let Some(old) = old {
            *value.decor_mut() = old.decor().clone();
        }
    };
    match item {
        Item::Table(table) => {
            keep(table.get(key).and_then(Item::as_value), &mut value);
            match table.get_mut(key) {
                Some(old) => *old = Item::Value(value),
                None => drop(table.insert(key, Item::Value(value))),
            }
        }
        Item::Value(Value::InlineTable(table)) => {
            keep(table.get(key), &mut value);
            table.insert(key, value);
        }
        Item::Value(Value::Array(array)) => {
            let index: usize = key.parse().ok()?;
            keep(array.get(index), &mut value);
            if index < array.len() {
                array.replace_formatted(index, value);
            } else if index == array.len() {
                array.push(value);
            } else {
                return None;
            }
        }
        _ => return None,
    }
    Some(())
}

fn refused(what: &str, reason: &str) -> Error {
    let what = what.lines().next().unwrap_or_default();
    Error::input(format!("`{what}` cannot be written into the scene: {reason}"), "edit the scene file by hand")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::checkpoint::fingerprint;
    use crate::scene::Scene;
    use std::path::Path;

    /// The saved scene is the one that ran, and still reads like the one that was written by hand.
    #[test]
    fn a_saved_scene_is_the_one_that_ran() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let overrides: Vec<String> = [
            "friction.coefficient=0.45",
            "gravity.acceleration_m_s2=[0.0, 0.0, -1.62]",
            "motion.phase.1.duration_s=0.75",
            "target.0.position_mm=[0.0, 0.5, -9.0]",
            "outputs.pictures_at_depth_mm.0=2.5",
            r#"effects=["mass_scaling", "gravity", "puncture", "friction"]"#,
        ]
        .map(String::from)
        .to_vec();
        let saved = written(&text, &overrides).unwrap();
        let ran = Scene::parse(&path, &text, &overrides).unwrap();
        let read = Scene::parse(&path, &saved, &[]).unwrap_or_else(|e| panic!("{e}\n{saved}"));
        assert_eq!(fingerprint(&ran), fingerprint(&read));
        assert!(
            saved.contains("coefficient = 0.45") && saved.contains("# Entry, angle and depth are chosen"),
            "{saved}"
        );
        assert!(saved.starts_with("# Task:"), "the head is still there");
        assert_eq!(written(&text, &[]).unwrap(), text);
        assert!(written(&text, &["title.x=1".into()]).is_err());
        assert!(written("no toml", &[]).is_err());
    }
}
