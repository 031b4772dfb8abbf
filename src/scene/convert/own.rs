//! Effects that are complete by themselves: their words in the list `effects` and the numbers of their tables.

use toml::de::DeValue;

use super::super::Region;
use super::super::document::Document;
use super::super::file::SceneFile;
use super::{Check, Within};
use crate::effects::EffectSet;
use crate::effects::own::{Chosen, LARGEST_COUNT, OwnEffect};

/// The table of an own effect as written.
pub(super) struct Written {
    effect: &'static OwnEffect,
    /// Its path: that of the scene is the key of the effect, that of a region `region.0.` and the key.
    place: String,
    /// Its keys with their numbers, `None` for what is no number.
    numbers: Vec<(String, Option<f64>)>,
}

pub(super) type OwnNumbers = Vec<Written>;

/// Takes the tables of own effects out of what the reading layer sees: it knows none of them.
pub(super) fn take_tables(document: &mut Document, own: &[&'static OwnEffect]) -> OwnNumbers {
    let number = |value: &DeValue| match value {
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|n| n as f64),
        _ => None,
    };
    let mut written = Vec::new();
    for &effect in own {
        for (place, value) in document.take(effect.effect.key, "region") {
            let numbers = match value {
                DeValue::Table(table) => {
                    table.iter().map(|(key, value)| (key.get_ref().to_string(), number(value.get_ref()))).collect()
                }
                // No table at all: one entry without a name and a number.
                _ => vec![(String::new(), None)],
            };
            written.push(Written { effect, place, numbers });
        }
    }
    written
}

impl Check<'_> {
    /// The own effects of the list, in its order.
    pub(super) fn own_effects(&mut self, file: &SceneFile, own: &[&'static OwnEffect]) -> Vec<Chosen> {
        let unlisted = |key: &str| !file.effects.iter().any(|listed| listed == key);
        let without_effect = |table: &Written| {
            let key = table.effect.effect.key;
            unlisted(key).then(|| match table.place == key {
                true => format!("Table [{key}] has no effect: `{key}` is not in the list `effects`."),
                false => format!("Table `{}` has no effect: `{key}` is not in the list `effects`.", table.place),
            })
        };
        self.notices.extend(self.own_numbers.iter().filter_map(without_effect));
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
            let numbers = self.own_table(key, effect.chosen());
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

    /// What regions state for the own effects that are on, over the numbers of the scene.
    pub(super) fn own_numbers_of_regions(&mut self, file: &SceneFile, effects: &EffectSet, regions: &mut [Region]) {
        for (index, region) in regions.iter_mut().enumerate().take(file.region.len()) {
            for scene in &effects.own {
                let place = format!("region.{index}.{}", scene.effect.effect.key);
                let own = self.own_table(&place, scene.clone());
                if own != *scene {
                    region.material.own.push(own);
                }
            }
        }
    }

    /// The numbers of the table at `place` over those of `base`.
    fn own_table(&mut self, place: &str, mut base: Chosen) -> Chosen {
        let table = self.own_numbers.iter().position(|table| table.place == place);
        let written = table.map_or(Vec::new(), |table| self.own_numbers.swap_remove(table).numbers);
        for (name, value) in &written {
            let path = format!("{place}.{name}");
            let names: Vec<&str> = base.effect.numbers.iter().map(|n| n.key).collect();
            match (names.iter().position(|other| other == name), value) {
                (Some(index), Some(value)) => {
                    let number = &base.effect.numbers[index];
                    let [low, high] = number.range;
                    base.numbers[index] = self.number(&path, *value, Within::Between(low, high)) * number.unit;
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
        base
    }
}
