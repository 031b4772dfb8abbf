//! Which three figures matter for a task: `assets/training/key_figures.toml`.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

use super::score::{Row, Score};
use crate::scene::{Goal, Task};

/// The table as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    kind: BTreeMap<String, [String; 3]>,
    task: BTreeMap<String, [String; 3]>,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let text = include_str!("../../assets/training/key_figures.toml");
    toml::from_str(text).unwrap_or_else(|e| panic!("assets/training/key_figures.toml: {e}"))
});

/// What kind of task it is, by its first goal that says more than what to stay away from.
pub fn kind(task: &Task) -> &'static str {
    let said = task.goals.iter().find_map(|goal| match goal {
        Goal::HitTarget { .. } => Some("hit_target"),
        Goal::StopInLayer { .. } => Some("stop_in_layer"),
        Goal::CoreMass { .. } | Goal::CoreVolume { .. } => Some("core"),
        Goal::Avoid { .. } | Goal::Figure { .. } => None,
    });
    said.unwrap_or("avoid")
}

/// Keys of the three figures of a task, as the table writes them.
pub fn of_task(task: &Task) -> &'static [String; 3] {
    let table = &*TABLE;
    table.task.get(&task.name).unwrap_or_else(|| &table.kind[kind(task)])
}

/// The row of a key of the table, if the score has it.
pub fn row<'a>(score: &'a Score, key: &str) -> Option<&'a Row> {
    score.rows.iter().find(|row| if key.ends_with('.') { row.key.starts_with(key) } else { row.key == key })
}

/// All keys that the table writes.
pub fn all() -> impl Iterator<Item = &'static str> {
    let table = &*TABLE;
    table.kind.values().chain(table.task.values()).flatten().map(String::as_str)
}
