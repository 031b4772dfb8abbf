//! The TOML document of a scene with the place of every key, so that any later check can point at its line.
//!
//! Command-line overrides are merged into the parsed document; they carry a span behind the end of the file, which
//! tells them apart from the file's own text in every later message.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use codespan_reporting::diagnostic::{Diagnostic, Label};
use codespan_reporting::files::{self, Files};
use codespan_reporting::term::{self, Chars, Config};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue, ValueDeserializer};

use crate::error::brief;
use crate::terminal::plain;

/// Most entries of any list: counted before anything is made of them.
const MOST_ENTRIES: usize = 4096;

/// Most entries of all tables and lists together: a thousand targets, goals and phases have fewer. Each is kept with its path.
const MOST_IN_ALL: usize = 32_768;

/// Most tables and lists within each other; a scene needs five. What walks down a document may then call itself.
const DEEPEST: usize = 24;

/// Longest key [byte]; every entry below it has it in its path.
const LONGEST_KEY: usize = 200;

/// Most problems that are told at once, and most bytes of them.
const MOST_PROBLEMS: usize = 30;
const MOST_TOLD: usize = 6000;

/// A parsed scene file with overrides.
pub struct Document<'s> {
    name: String,
    source: &'s str,
    /// Where every line of the source begins.
    lines: Vec<usize>,
    overrides: &'s [String],
    /// The merged document; always a table.
    root: Spanned<DeValue<'s>>,
    /// Key and value span of every dotted path (`motion.phase.0.speed_mm_s`).
    places: BTreeMap<String, Place>,
}

#[derive(Debug, Clone)]
struct Place {
    key: Range<usize>,
    value: Range<usize>,
}

/// The problems found in one document, in the order of the file once rendered.
pub struct Problems<'a> {
    document: &'a Document<'a>,
    /// Position in the file and rendered text.
    found: Vec<(usize, String)>,
}

impl<'s> Document<'s> {
    /// Parses `source` and applies `overrides` (`key=value`); the error is rendered.
    pub fn parse(path: &Path, source: &'s str, overrides: &'s [String]) -> Result<Document<'s>, String> {
        let mut document = Document {
            name: brief(&path.display().to_string()),
            source,
            lines: files::line_starts(source).collect(),
            overrides,
            root: Spanned::new(0..0, DeValue::Table(DeTable::new())),
            places: BTreeMap::new(),
        };
        match DeTable::parse(source) {
            Ok(root) => document.root = Spanned::new(0..0, DeValue::Table(root.into_inner())),
            Err(error) => {
                return Err(document.render(
                    error.span().unwrap_or(0..0),
                    &format!("this is not TOML: {}", one_line(error.message())),
                    "here",
                    "mend the line; a text needs quotes, a table starts with [name], a list is [1, 2, 3]",
                ));
            }
        }
        let mut problems = Vec::new();
        for (number, text) in overrides.iter().enumerate() {
            let place = document.override_span(number);
            if let Err((message, way_out)) = apply_override(&mut document.root, text, &place) {
                problems.push(document.render(place, &message, "", &way_out));
            }
        }
        if !problems.is_empty() {
            return Err(told(&problems));
        }
        if let Some(found) = oversized(&document.root, DEEPEST, &mut MOST_IN_ALL.clone()) {
            let path: Vec<&str> = found.path.iter().rev().map(String::as_str).collect();
            let (message, way_out) = found.problem.in_words(&path.join("."));
            return Err(document.render(found.span, &message, "too much", &way_out));
        }
        record_places("", &document.root, &mut document.places);
        Ok(document)
    }

    /// Reads the document into `T`; the error is rendered.
    ///
    /// The lengths of lists are checked against the schema first: the reading layer stops after the last number that it wants and
    /// leaves the others unread, and names no key where one is missing.
    pub fn deserialize<T: DeserializeOwned + JsonSchema>(&self) -> Result<T, String> {
        let schema = schemars::schema_for!(T).to_value();
        let mut problems = Problems::new(self);
        wrong_lengths("", self.root.get_ref(), &schema, &schema, &mut problems);
        problems.check()?;
        T::deserialize(ValueDeserializer::from(self.root.clone())).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let message = one_line(error.message());
            let way_out = way_out_of_reading(&message);
            let message = in_plain_words(&message, is_date(&self.root, &span)).unwrap_or(message);
            // A missing field is reported for its whole table; the first line shows which one.
            self.render(span, &message, "here", &way_out)
        })
    }

    /// Takes every table called `key` out of what [`Document::deserialize`] reads, each with its path: the one at the top, and those in
    /// the tables of the list `list`. Messages still find their places.
    pub fn take(&mut self, key: &str, list: &str) -> Vec<(String, DeValue<'s>)> {
        let DeValue::Table(root) = self.root.get_mut() else { return Vec::new() };
        let top = root.remove(key).map(|value| (key.to_string(), value.into_inner()));
        let Some(DeValue::Array(entries)) = root.get_mut(list).map(Spanned::get_mut) else {
            return top.into_iter().collect();
        };
        let below = entries.iter_mut().enumerate().filter_map(|(index, entry)| {
            let DeValue::Table(table) = entry.get_mut() else { return None };
            Some((format!("{list}.{index}.{key}"), table.remove(key)?.into_inner()))
        });
        top.into_iter().chain(below).collect()
    }

    /// Paths of all numbers that are NaN, infinite or too large for a double.
    pub fn non_finite_numbers(&self) -> Vec<String> {
        let mut found = Vec::new();
        collect_non_finite("", self.root.get_ref(), &mut found);
        found
    }

    /// Span of override `number`: behind the end of the file.
    fn override_span(&self, number: usize) -> Range<usize> {
        let place = self.source.len() + 1 + number;
        place..place
    }

    /// Span of the value at `path`, or of the nearest table around it.
    fn span(&self, path: &str) -> Range<usize> {
        let mut path = path;
        let mut exact = true;
        loop {
            if let Some(place) = self.places.get(path) {
                return if exact { place.value.clone() } else { place.key.clone() };
            }
            exact = false;
            match path.rfind('.') {
                Some(dot) => path = &path[..dot],
                None => return 0..0,
            }
        }
    }

    /// One problem as text: file, line, excerpt, label and the way out.
    fn render(&self, span: Range<usize>, message: &str, label: &str, way_out: &str) -> String {
        let (message, label, way_out) = (&brief(message), &brief(label), &brief(way_out));
        if span.start > self.source.len() {
            let text = brief(&self.overrides[span.start - self.source.len() - 1]);
            return format!("error: --set {text}: {message}\n  = way out: {way_out}\n");
        }
        let (excerpt, shown) = self.excerpt(span);
        let diagnostic = Diagnostic::error()
            .with_message(message)
            .with_labels(vec![Label::primary((), shown).with_message(label)])
            .with_notes(vec![format!("way out: {way_out}")]);
        let config = Config { chars: Chars::ascii(), ..Config::default() };
        let text = term::emit_into_string(&config, &excerpt, &diagnostic)
            .unwrap_or_else(|_| format!("error: {}: {message}\n  = way out: {way_out}\n", self.name));
        plain(&text).into_owned()
    }

    /// The line in which a span begins, cut where it is long, and the place of the span in it. Only the first line of a span is shown:
    /// a table is recognised by its header.
    fn excerpt(&self, span: Range<usize>) -> (Excerpt<'_>, Range<usize>) {
        /// Bytes that are shown of a long line, and those of them before the span.
        const LONGEST: usize = 200;
        const BEFORE: usize = 60;
        let index = self.lines.partition_point(|start| *start <= span.start).saturating_sub(1);
        let (begin, rest) = (self.lines[index], &self.source[self.lines[index]..]);
        let line = rest.lines().next().unwrap_or_default();
        let at = (span.start - begin).min(line.len());
        let to = (span.end.max(span.start) - begin).min(line.len());
        let column = 1 + line[..at].chars().count();
        let (mut low, mut high) = (0, line.len());
        if line.len() > LONGEST {
            low = line.floor_char_boundary(at.saturating_sub(BEFORE));
            high = line.floor_char_boundary(low + LONGEST);
        }
        let dots = |cut: bool| if cut { "..." } else { "" };
        let before = dots(low > 0);
        let text = format!("{before}{}{}", &line[low..high], dots(high < line.len()));
        let shown = before.len() + at - low..before.len() + to.min(high).max(at) - low;
        (Excerpt { name: &self.name, text, line: index + 1, column }, shown)
    }
}

/// One line of a file, as messages show it.
struct Excerpt<'a> {
    name: &'a str,
    text: String,
    /// Where the line and the place in it are in the file, counted from 1.
    line: usize,
    column: usize,
}

impl<'a> Files<'a> for Excerpt<'_> {
    type FileId = ();
    type Name = &'a str;
    type Source = &'a str;

    fn name(&'a self, (): ()) -> Result<&'a str, files::Error> {
        Ok(self.name)
    }

    fn source(&'a self, (): ()) -> Result<&'a str, files::Error> {
        Ok(&self.text)
    }

    fn line_index(&'a self, (): (), _: usize) -> Result<usize, files::Error> {
        Ok(0)
    }

    fn line_number(&'a self, (): (), _: usize) -> Result<usize, files::Error> {
        Ok(self.line)
    }

    fn column_number(&'a self, (): (), _: usize, _: usize) -> Result<usize, files::Error> {
        Ok(self.column)
    }

    fn line_range(&'a self, (): (), _: usize) -> Result<Range<usize>, files::Error> {
        Ok(0..self.text.len())
    }
}

impl<'a> Problems<'a> {
    pub fn new(document: &'a Document<'a>) -> Self {
        Problems { document, found: Vec::new() }
    }

    /// Adds a problem at the dotted `path` (or the nearest table around it).
    pub fn report(&mut self, path: &str, message: impl AsRef<str>, label: impl AsRef<str>, way_out: impl AsRef<str>) {
        let span = self.document.span(path);
        let text = self.document.render(span.clone(), message.as_ref(), label.as_ref(), way_out.as_ref());
        self.found.push((span.start, text));
    }

    /// Adds the rendered problems of another file that the value at `path` names.
    pub fn append(&mut self, path: &str, text: String) {
        let start = self.document.span(path).start;
        self.found.push((start, text));
    }

    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// `Err` with all problems, in the order of the file, where there are any.
    pub fn check(&mut self) -> Result<(), String> {
        if self.found.is_empty() {
            return Ok(());
        }
        self.found.sort_by_key(|(place, _)| *place);
        let texts: Vec<&str> = self.found.iter().map(|(_, text)| text.as_str()).collect();
        Err(told(&texts))
    }
}

/// The first of these rendered problems, as many as somebody reads, and how many more there are.
fn told(problems: &[impl AsRef<str>]) -> String {
    let mut bytes = 0;
    let fits = |text: &&str| {
        bytes += text.len();
        // A single one is told whatever its length.
        bytes <= MOST_TOLD || bytes == text.len()
    };
    let all = problems.iter().map(|text| text.as_ref().trim_end());
    let mut texts: Vec<&str> = all.take(MOST_PROBLEMS).take_while(fits).collect();
    let more = format!("and {} more problems of this kind or another", problems.len() - texts.len());
    if problems.len() > texts.len() {
        texts.push(&more);
    }
    texts.join("\n\n") + "\n"
}

/// The entry of `choices` that differs least from `word`, where it is close enough to be a slip of the keys.
pub fn closest<'a>(word: &str, choices: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    /// Longer than any name here.
    const LONGEST: usize = 200;
    if word.len() > LONGEST {
        return None;
    }
    choices
        .into_iter()
        .map(|choice| (edit_distance(word, choice), choice))
        .filter(|(distance, choice)| *distance <= 2 + choice.len() / 4)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, choice)| choice)
}

/// Levenshtein distance of two short words.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

/// Whether the value that stands in `span` is a date, which the reading layer takes for a table.
fn is_date(value: &Spanned<DeValue>, span: &Range<usize>) -> bool {
    match value.get_ref() {
        DeValue::Datetime(_) => value.span() == *span,
        DeValue::Table(table) => table.values().any(|item| is_date(item, span)),
        DeValue::Array(array) => array.iter().any(|item| is_date(item, span)),
        _ => false,
    }
}

/// "invalid type: integer `16`, expected a string" in words of a scene file; `None` for any other message.
fn in_plain_words(message: &str, date: bool) -> Option<String> {
    let (found, expected) = message.strip_prefix("invalid type: ")?.split_once(", expected ")?;
    let quoted = found.split_once('`').and_then(|(_, rest)| rest.strip_suffix('`')).unwrap_or_default();
    let found = match found.split(' ').next()? {
        "integer" | "floating" => format!("the number {quoted}"),
        "boolean" => quoted.to_string(),
        "string" => format!("the text {}", found.strip_prefix("string ")?),
        "sequence" => "a list".into(),
        "map" if date => "a date".into(),
        "map" => "a table".into(),
        _ => found.into(),
    };
    let expected = match expected {
        "a string" => "a text in quotes",
        "f32" | "f64" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number",
        "a boolean" => "true or false",
        "a sequence" => "a list [...]",
        table if table.starts_with("struct ") => "a table with keys of its own",
        other => other,
    };
    Some(format!("{found} stands where {expected} is expected"))
}

/// The way out of an error of the reading layer, from the names that its message quotes.
fn way_out_of_reading(message: &str) -> String {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let Some((word, choices)) = quoted.split_first() else {
        return "write a value of the kind that the message names; `stylet schema` lists all keys".into();
    };
    if message.starts_with("unknown") {
        let list = choices.join(", ");
        match closest(word, choices.iter().copied()) {
            Some(near) => format!("did you mean `{near}`? Known here: {list}"),
            None if choices.is_empty() => format!("remove `{word}`"),
            None => format!("remove `{word}` or use one of: {list}"),
        }
    } else if message.starts_with("missing field") {
        format!("add `{word}` here; `stylet schema` describes every key")
    } else {
        "write a value of the kind that the message names; `stylet schema` lists all keys".into()
    }
}

/// Sets one value of the table. The error is (message, way out).
fn apply_override<'s>(
    root: &mut Spanned<DeValue<'s>>,
    text: &'s str,
    place: &Range<usize>,
) -> Result<(), (String, String)> {
    const FORM: &str = "write --set table.key=value, e.g. --set motion.phase.0.speed_mm_s=5";
    let fail = |message: String, way_out: &str| Err((message, way_out.to_string()));
    let Some((path, value)) = text.split_once('=') else {
        return fail("there is no `=`".into(), FORM);
    };
    let (path, value) = (path.trim(), value.trim());
    let parts: Vec<&str> = path.split('.').map(str::trim).take(DEEPEST + 1).collect();
    if parts.len() > DEEPEST {
        return fail(format!("the key has more than {DEEPEST} parts"), FORM);
    }
    if parts.iter().any(|part| part.is_empty()) {
        return fail("the key is incomplete".into(), FORM);
    }
    if value.is_empty() {
        return fail("there is no value behind `=`".into(), FORM);
    }
    let value = match DeValue::parse(value) {
        Ok(value) => moved_value(value.into_inner(), place),
        Err(_) if value.chars().all(|c| c.is_alphanumeric() || "-_./ ".contains(c)) => {
            DeValue::String(value.to_string().into())
        }
        Err(error) => {
            return fail(
                format!("the value is not TOML: {}", error.message().trim().replace('\n', ", ")),
                "write a number, a word, a list like [1, 2, 3] or a table like {speed_mm_s = 5}; quote it from the shell",
            );
        }
    };
    let (last, parents) = parts.split_last().expect("split gives at least one part");
    set(root, parents, last, value, place, path).map_err(|message| (message, FORM.to_string()))
}

/// Walks down `parents` from `node`, making tables where they are missing, and sets `last`.
fn set<'s>(
    node: &mut Spanned<DeValue<'s>>,
    parents: &[&str],
    last: &str,
    value: DeValue<'s>,
    place: &Range<usize>,
    path: &str,
) -> Result<(), String> {
    if let Some((first, rest)) = parents.split_first() {
        let child = match node.get_mut() {
            DeValue::Table(table) => {
                if !table.contains_key(*first) {
                    table.insert(
                        Spanned::new(place.clone(), first.to_string().into()),
                        Spanned::new(place.clone(), DeValue::Table(DeTable::new())),
                    );
                }
                table.get_mut(*first).expect("just inserted")
            }
            DeValue::Array(array) => {
                let length = array.len();
                first
                    .parse::<usize>()
                    .ok()
                    .and_then(|index| array.get_mut(index))
                    .ok_or(format!("`{first}` in `{path}` is no index of a list of {length} (the first is 0)"))?
            }
            other => {
                return Err(format!("`{first}` in `{path}` would be inside a {}", other.type_str()));
            }
        };
        return set(child, rest, last, value, place, path);
    }
    let value = Spanned::new(place.clone(), value);
    match node.get_mut() {
        DeValue::Table(table) => {
            table.remove(last);
            table.insert(Spanned::new(place.clone(), last.to_string().into()), value);
            Ok(())
        }
        DeValue::Array(array) => {
            let length = array.len();
            match last.parse::<usize>() {
                Ok(index) if index < length => *array.get_mut(index).expect("index is below the length") = value,
                Ok(index) if index == length => array.push(value),
                _ => {
                    return Err(format!("`{last}` in `{path}` is no index of a list of {length} (the first is 0)"));
                }
            }
            Ok(())
        }
        other => Err(format!("`{last}` in `{path}` would be inside a {}", other.type_str())),
    }
}

/// `value` with all its spans at `place`.
fn moved_value<'s>(value: DeValue<'s>, place: &Range<usize>) -> DeValue<'s> {
    let moved = |item: Spanned<DeValue<'s>>| Spanned::new(place.clone(), moved_value(item.into_inner(), place));
    match value {
        DeValue::Array(array) => DeValue::Array(array.into_iter().map(moved).collect::<DeArray>()),
        DeValue::Table(table) => DeValue::Table(
            table
                .into_iter()
                .map(|(key, item)| (Spanned::new(place.clone(), key.into_inner()), moved(item)))
                .collect::<DeTable>(),
        ),
        scalar => scalar,
    }
}

/// A message of the TOML reader on one line.
fn one_line(message: &str) -> String {
    message.trim().replace('\n', ", ")
}

/// What no scene and no library needs.
enum Oversized {
    /// A list of so many entries.
    List(usize),
    /// A key of so many bytes.
    Key(usize),
    /// More entries in all than any such file has.
    Whole,
    Deep,
}

/// Where a document has it; the path begins with its last part.
struct OversizedAt {
    span: Range<usize>,
    path: Vec<String>,
    problem: Oversized,
}

impl Oversized {
    /// Message and way out.
    fn in_words(&self, path: &str) -> (String, String) {
        let as_described = "write the keys as `stylet schema` describes them".to_string();
        match self {
            Oversized::List(count) => (
                format!("`{path}` has {count} entries; no list of such a file may have more than {MOST_ENTRIES}"),
                format!("keep at most {MOST_ENTRIES} entries, of most lists far fewer; `stylet schema` describes them"),
            ),
            Oversized::Key(length) => {
                (format!("a key of {length} bytes; no key of such a file is longer than {LONGEST_KEY}"), as_described)
            }
            Oversized::Whole => (
                format!("more than {MOST_IN_ALL} entries of tables and lists in all, here in `{path}`"),
                "remove what the scene does not need; `stylet schema` describes all keys".into(),
            ),
            Oversized::Deep => {
                (format!("`{path}`: more than {DEEPEST} tables and lists within each other"), as_described)
            }
        }
    }
}

/// The first key or list that is too long, table that lies `depth` levels below `value`, or entry beyond the `left` that may come;
/// looks no deeper, and makes a path only of what it has found.
fn oversized(value: &Spanned<DeValue>, depth: usize, left: &mut usize) -> Option<OversizedAt> {
    let found = |span, problem| Some(OversizedAt { span, path: Vec::new(), problem });
    let Some(depth) = depth.checked_sub(1) else { return found(value.span(), Oversized::Deep) };
    let mut below = |name: &dyn Fn() -> String, item: &Spanned<DeValue>| {
        let Some(fewer) = left.checked_sub(1) else { return found(item.span(), Oversized::Whole) };
        *left = fewer;
        let mut found = oversized(item, depth, left)?;
        found.path.push(name());
        Some(found)
    };
    match value.get_ref() {
        DeValue::Table(table) => table.iter().find_map(|(key, item)| match key.get_ref().len() {
            length if length > LONGEST_KEY => found(key.span(), Oversized::Key(length)),
            _ => below(&|| key.get_ref().to_string(), item),
        }),
        // A list of tables has no place of its own, its entries have.
        DeValue::Array(array) if array.len() > MOST_ENTRIES => {
            let span = array.get(MOST_ENTRIES).map_or(value.span(), Spanned::span);
            found(span, Oversized::List(array.len()))
        }
        DeValue::Array(array) => array.iter().enumerate().find_map(|(index, item)| below(&|| index.to_string(), item)),
        _ => None,
    }
}

/// Reports every list of a fixed length that has another one. Why a list may only have so many entries is told where it is read.
fn wrong_lengths(
    path: &str,
    value: &DeValue,
    schema: &serde_json::Value,
    whole: &serde_json::Value,
    problems: &mut Problems,
) {
    if let Some(place) = schema["$ref"].as_str().and_then(|place| place.strip_prefix('#')) {
        return wrong_lengths(path, value, whole.pointer(place).unwrap_or_default(), whole, problems);
    }
    for choice in ["anyOf", "oneOf", "allOf"].into_iter().filter_map(|key| schema[key].as_array()).flatten() {
        wrong_lengths(path, value, choice, whole, problems);
    }
    match value {
        DeValue::Table(table) => {
            for (key, item) in table {
                let below = &schema["properties"][key.get_ref().as_ref()];
                wrong_lengths(&join(path, key.get_ref()), item.get_ref(), below, whole, problems);
            }
        }
        DeValue::Array(array) => {
            let (least, most) = (schema["minItems"].as_u64(), schema["maxItems"].as_u64());
            let count = array.len() as u64;
            if let Some(wanted) = most.filter(|most| least == Some(*most) && count != *most) {
                problems.report(
                    path,
                    format!("`{path}` has {count} entries, {wanted} are wanted"),
                    if count > wanted { "too long" } else { "too short" },
                    format!("write {wanted} entries; `stylet schema` tells what they mean"),
                );
            }
            for (index, item) in array.iter().enumerate() {
                wrong_lengths(&join(path, &index.to_string()), item.get_ref(), &schema["items"], whole, problems);
            }
        }
        _ => {}
    }
}

/// `table.key`, or `key` at the top.
fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
}

/// Notes where everything below `value` stands.
fn record_places(path: &str, value: &Spanned<DeValue>, places: &mut BTreeMap<String, Place>) {
    let mut record = |path: String, key: Range<usize>, item: &Spanned<DeValue>| {
        let place = Place { key, value: item.span() };
        places.insert(path.clone(), place);
        record_places(&path, item, places);
    };
    match value.get_ref() {
        DeValue::Table(table) => {
            for (key, item) in table.iter() {
                record(join(path, key.get_ref()), key.span(), item);
            }
        }
        DeValue::Array(array) => {
            for (index, item) in array.iter().enumerate() {
                record(join(path, &index.to_string()), item.span(), item);
            }
        }
        _ => {}
    }
}

/// Collects the paths of numbers that a double cannot hold as a finite value.
fn collect_non_finite(path: &str, value: &DeValue, found: &mut Vec<String>) {
    match value {
        DeValue::Table(table) => {
            for (key, item) in table.iter() {
                collect_non_finite(&join(path, key.get_ref()), item.get_ref(), found);
            }
        }
        DeValue::Array(array) => {
            for (index, item) in array.iter().enumerate() {
                collect_non_finite(&join(path, &index.to_string()), item.get_ref(), found);
            }
        }
        DeValue::Float(float) if !float.as_str().parse::<f64>().is_ok_and(f64::is_finite) => {
            found.push(path.to_string());
        }
        _ => {}
    }
}
