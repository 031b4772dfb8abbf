//! Effects that a program brings along: their words in the list `effects` and the numbers of their tables.

use toml::de::DeValue;

use super::super::document::Document;
use super::super::file::SceneFile;
use super::{Check, Within};
use crate::effects::own::{Chosen, LARGEST_COUNT, OwnEffect};

/// Tables of own effects as written: key of the effect, and its keys with their numbers, `None` for what is no number.
pub(super) type OwnNumbers = Vec<(&'static OwnEffect, Vec<(String, Option<f64>)>)>;

/// Takes the tables of own effects out of what the reading layer sees: it knows none of them.
pub(super) fn take_tables(document: &mut Document, own: &[&'static OwnEffect]) -> OwnNumbers {
    let number = |value: &DeValue| match value {
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|n| n as f64),
        _ => None,
    };
    own.iter()
        .filter_map(|effect| {
            let numbers = match document.take(effect.effect.key)? {
                DeValue::Table(table) => {
                    table.iter().map(|(key, value)| (key.get_ref().to_string(), number(value.get_ref()))).collect()
                }
                // No table at all: one entry without a name and a number.
                _ => vec![(String::new(), None)],
            };
            Some((*effect, numbers))
        })
        .collect()
}

impl Check<'_> {
    /// The own effects of the list, in its order.
    pub(super) fn own_effects(&mut self, file: &SceneFile, own: &[&'static OwnEffect]) -> Vec<Chosen> {
        let tables = std::mem::take(&mut self.own_numbers);
        for (effect, _) in &tables {
            let key = effect.effect.key;
            if !file.effects.iter().any(|listed| listed == key) {
                self.notices.push(format!("Table [{key}] has no effect: `{key}` is not in the list `effects`."));
            }
        }
        let mut chosen = Vec::new();
        for (index, key) in file.effects.iter().enumerate() {
            let Some(effect) = own.iter().find(|own| own.effect.key == key) else { continue };
            let place = format!("effects.{index}");
            if let Some(flaw) = effect.flaw() {
                self.problems.report(&place, flaw, "the program's own effect", "mend the effect in the program");
                continue;
            }
            let needs = effect.effect.needs;
            if !needs.is_empty() && !needs.iter().any(|need| file.effects.iter().any(|listed| listed == need)) {
                self.problems.report(
                    &place,
                    format!("effect `{key}` needs `{}`", needs.join("` or `")),
                    "nothing to act on",
                    format!("add \"{}\" to the list `effects`, or remove \"{key}\"", needs[0]),
                );
            }
            let mut numbers = effect.chosen();
            let written = tables.iter().find(|(other, _)| other == effect).map_or(&[][..], |(_, numbers)| numbers);
            for (name, value) in written {
                let path = format!("{key}.{name}");
                let names: Vec<&str> = effect.numbers.iter().map(|n| n.key).collect();
                match (names.iter().position(|other| other == name), value) {
                    (Some(place), Some(value)) => {
                        let number = &effect.numbers[place];
                        let [low, high] = number.range;
                        numbers.numbers[place] = self.number(&path, *value, Within::Between(low, high)) * number.unit;
                    }
                    (Some(_), None) => self.problems.report(
                        &path,
                        format!("`{path}` is no number"),
                        "here",
                        format!("write a number, e.g. {name} = 0.5"),
                    ),
                    (None, _) => self.unknown_name(&path, "number of this effect", name, &names),
                }
            }
            chosen.push(numbers);
        }
        if chosen.len() > LARGEST_COUNT {
            self.problems.report(
                "effects",
                format!("there are {} effects of the program's own", chosen.len()),
                format!("at most {LARGEST_COUNT}"),
                "remove some of them",
            );
        }
        chosen
    }
}
