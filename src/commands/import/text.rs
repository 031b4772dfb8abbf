//! Plain text of this command, for terminals of 100 columns.

/// Longest line.
pub const WIDTH: usize = 100;

/// The text in lines of at most [`WIDTH`] characters; further lines begin with `indent` blanks.
pub fn wrapped(text: &str, indent: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let Some(line) = lines.last_mut() else { break };
        let used = line.chars().count();
        let is_begin = line.trim().is_empty();
        if !is_begin && used + 1 + word.chars().count() > WIDTH {
            lines.push(format!("{}{word}", " ".repeat(indent)));
            continue;
        }
        if !is_begin {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.join("\n")
}

/// A title and a list below it; nothing for an empty list.
pub fn list(title: &str, items: &[String]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let items = items.iter().map(|item| format!("  {}\n", wrapped(item, 4)));
    format!("{title}\n{}", items.collect::<String>())
}

/// A name of a file in a table or a comment: no line ends, no signs that steer, at most `most` characters.
pub fn name(text: &str, most: usize) -> String {
    let plain: String = text.chars().map(|c| if c.is_control() { '?' } else { c }).collect();
    if plain.chars().count() <= most {
        return plain;
    }
    plain.chars().take(most.saturating_sub(3)).chain("...".chars()).collect()
}

/// A table: columns as wide as needed, numbers (`right`) to the right.
pub fn table(rows: &[Vec<String>], right: &[bool]) -> String {
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..right.len()).map(|column| width(column).unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::from(" ");
        for ((cell, width), right) in row.iter().zip(&widths).zip(right) {
            let room = " ".repeat(width - cell.chars().count());
            line += &if *right { format!(" {room}{cell}") } else { format!(" {cell}{room}") };
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_short_and_nothing_is_lost() {
        let long = "a word and another ".repeat(40);
        let wrapped = wrapped(&long, 4);
        assert!(wrapped.lines().all(|line| line.chars().count() <= WIDTH));
        assert!(wrapped.lines().skip(1).all(|line| line.starts_with("    a") || line.starts_with("    w")));
        assert_eq!(wrapped.split_whitespace().collect::<Vec<_>>(), long.split_whitespace().collect::<Vec<_>>());
    }

    #[test]
    fn names_do_not_break_lines() {
        assert_eq!(name("a\nb", 10), "a?b");
        assert_eq!(name("abcdefghijkl", 6), "abc...");
    }

    #[test]
    fn columns_stand_below_each_other() {
        let rows = [vec!["no".into(), "name".into()], vec!["12".into(), "x".into()], vec!["3".into(), "y".into()]];
        assert_eq!(table(&rows, &[true, false]), "  no name\n  12 x\n   3 y\n");
    }
}
