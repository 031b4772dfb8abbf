//! Names of labels from a file beside a volume that has none: colour tables of 3D Slicer (`.ctbl`, `.txt`, `.csv`), FreeSurfer and
//! ITK-SNAP, and JSON objects such as the labels of nnU-Net.
//!
//! In text a line is a number, a name and possibly a colour: `1 spleen 157 108 162 255`, `1,spleen,157,108,162`, `1: spleen`,
//! `1 255 0 0 1 1 1 "spleen"`. Lines that begin with `#` do not count.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::reading::{self, most};

const AS_A_TABLE: &str = "write a line for each label, a number and a name, e.g. `1 spleen`";

/// The names in a file.
///
/// # Errors
/// Where it cannot be read or names nothing.
pub fn read(path: &Path) -> Result<BTreeMap<u16, String>> {
    let text = reading::text(path, most::CURVE).map_err(|unread| unread.of(path, "check the name"))?;
    parse(&path.display().to_string(), &text)
}

/// The names in a text; `file` stands for it in messages.
///
/// # Errors
/// As [`read`].
pub(crate) fn parse(file: &str, text: &str) -> Result<BTreeMap<u16, String>> {
    let text = text.trim_start_matches('\u{feff}');
    let names = if text.trim_start().starts_with('{') { json(file, text)? } else { table(file, text)? };
    match names.is_empty() {
        true => Err(Error::input(format!("{file}: it names no label"), AS_A_TABLE)),
        false => Ok(names),
    }
}

/// `{"1": "spleen"}` or `{"spleen": 1}`, at the top or under `labels`.
fn json(file: &str, text: &str) -> Result<BTreeMap<u16, String>> {
    let value: Value = serde_json::from_str(text)
        .map_err(|reason| Error::input(format!("{file}: this is no JSON: {reason}"), AS_A_TABLE))?;
    let object = value.get("labels").unwrap_or(&value).as_object();
    let pairs = object.into_iter().flatten().filter_map(|(key, value)| {
        let by_number = key.parse().ok().zip(value.as_str().map(str::to_string));
        let by_name = || value.as_u64().and_then(|n| u16::try_from(n).ok()).map(|n| (n, key.clone()));
        by_number.or_else(by_name)
    });
    Ok(pairs.filter(|(label, _)| *label != 0).collect())
}

fn table(file: &str, text: &str) -> Result<BTreeMap<u16, String>> {
    let mut names = BTreeMap::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with(['#', '/']) {
            continue;
        }
        let columns: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        let words: Vec<&str> = line.split([' ', ':', '=']).filter(|word| !word.is_empty()).collect();
        let first = if columns.len() > 1 { columns.first() } else { words.first() };
        let Some(label) = first.and_then(|word| word.parse::<u64>().ok()) else {
            // The heads of columns.
            if names.is_empty() {
                continue;
            }
            return Err(Error::input(
                format!("{file}:{}: no number of a label begins this line", number + 1),
                AS_A_TABLE,
            ));
        };
        let quoted = line.split('"').nth(1).map(str::to_string);
        let in_column = columns.get(1).filter(|_| columns.len() > 1).map(ToString::to_string);
        let name = quoted.or(in_column).unwrap_or_else(|| {
            // A colour has three or four numbers; a name may end in one or two.
            let numbers = words.iter().rev().take_while(|word| word.parse::<f64>().is_ok()).count();
            let colour = if numbers >= 3 { numbers.min(4) } else { 0 };
            words[..words.len() - colour].get(1..).unwrap_or_default().join(" ")
        });
        match u16::try_from(label) {
            Ok(label) if label != 0 && !name.trim().is_empty() => {
                names.insert(label, name.trim().to_string());
            }
            // Background, and numbers that no volume here has.
            _ => {}
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_several_programs_say_the_same() {
        for text in [
            "# 3D Slicer\n0 background 0 0 0 0\n1 spleen 157 108 162 255\n2 rib left 4 253 232 158 255\n",
            "LabelValue,Name,Color_R,Color_G,Color_B\n1,spleen,157,108,162\n2,rib left 4,253,232,158\n",
            "0 0 0 0 0 0 0 \"Clear Label\"\n1 255 0 0 1 1 1 \"spleen\"\n2 0 255 0 1 1 1 \"rib left 4\"\n",
            "1: spleen\n2 = rib left 4\n70000 beyond\n",
            "1\tspleen\n2\trib left 4\t1\t2\t3\n",
            "{\"labels\": {\"background\": 0, \"spleen\": 1, \"rib left 4\": 2}}",
            "{\"1\": \"spleen\", \"2\": \"rib left 4\"}",
        ] {
            let names = parse("names", text).unwrap();
            let expected = BTreeMap::from([(1, "spleen".to_string()), (2, "rib left 4".to_string())]);
            assert_eq!(names, expected, "{text}");
        }
    }

    #[test]
    fn what_names_nothing_is_refused() {
        for text in ["", "{}", "{\"a\": [1]}", "no table\n", "1 spleen\nliver\n", "{\"1\": "] {
            let message = parse("names.txt", text).unwrap_err().to_string();
            assert!(message.contains("names.txt") && message.contains("way out"), "{text}: {message}");
        }
    }
}
