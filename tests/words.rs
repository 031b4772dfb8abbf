//! The words of every language are complete, and each is used.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use fluent_syntax::ast::{Entry, Expression, InlineExpression, Pattern, PatternElement};
use fluent_syntax::parser;
use stylet::words::{LANGUAGES, Language, Value, choose, say, say_of, say_with};

/// Keys that are put together where they are used: `say_of(&format!("figure-{key}"))`.
const PUT_TOGETHER: [&str; 5] = ["figure-", "task-", "field-", "force-", "seen-from-"];

fn places(pattern: &Pattern<&str>, found: &mut BTreeSet<String>) {
    for element in &pattern.elements {
        let PatternElement::Placeable { expression } = element else { continue };
        match expression {
            Expression::Inline(inline) => place(inline, found),
            Expression::Select { selector, variants } => {
                place(selector, found);
                variants.iter().for_each(|variant| places(&variant.value, found));
            }
        }
    }
}

fn place(inline: &InlineExpression<&str>, found: &mut BTreeSet<String>) {
    match inline {
        InlineExpression::VariableReference { id } => _ = found.insert(id.name.to_string()),
        InlineExpression::FunctionReference { arguments, .. } => {
            arguments.positional.iter().for_each(|inline| place(inline, found));
        }
        _ => {}
    }
}

/// Places of every text of a language.
fn texts(language: &Language) -> BTreeMap<String, BTreeSet<String>> {
    let mut found = BTreeMap::new();
    for (file, text) in language.files {
        let resource =
            parser::parse(*text).unwrap_or_else(|(_, errors)| panic!("{}/{file}: {errors:?}", language.code));
        for entry in &resource.body {
            let Entry::Message(message) = entry else { continue };
            let mut here = BTreeSet::new();
            let value = message.value.as_ref();
            places(value.unwrap_or_else(|| panic!("{} has no text", message.id.name)), &mut here);
            let before = found.insert(message.id.name.to_string(), here);
            assert!(before.is_none(), "{}/{file}: {} stands there twice", language.code, message.id.name);
        }
    }
    found
}

fn sources(folder: &Path, text: &mut String) {
    for entry in std::fs::read_dir(folder).expect("the sources are there") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, text);
        } else if path.extension().is_some_and(|e| e == "rs") {
            text.push_str(&std::fs::read_to_string(&path).expect("a source is text"));
        }
    }
}

#[test]
fn all_languages_have_the_same_texts_and_places() {
    let english = texts(&LANGUAGES[0]);
    for language in &LANGUAGES[1..] {
        let other = texts(language);
        for (key, places) in &english {
            let there = other.get(key).unwrap_or_else(|| panic!("{} is missing in {}", key, language.code));
            assert_eq!(there, places, "places of {key} in {}", language.code);
        }
        let extra: Vec<&String> = other.keys().filter(|key| !english.contains_key(*key)).collect();
        assert!(extra.is_empty(), "{} has texts that English lacks: {extra:?}", language.code);
    }
}

#[test]
fn every_text_that_is_said_exists_and_every_text_is_said() {
    let english = texts(&LANGUAGES[0]);
    let mut source = String::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut source);
    let mut said = BTreeSet::new();
    for call in ["say(\"", "say_with(\"", "say_of(\""] {
        for part in source.split(call).skip(1) {
            said.extend(part.split('"').next().map(str::to_string));
        }
    }
    // The examples of the module itself.
    said.remove("best-score");
    let missing: Vec<&String> = said.iter().filter(|key| !english.contains_key(*key)).collect();
    assert!(missing.is_empty(), "said, and in no file: {missing:?}");
    let quoted = |key: &str| source.contains(&format!("\"{key}\""));
    let unused: Vec<&String> =
        english.keys().filter(|key| !quoted(key) && !PUT_TOGETHER.iter().any(|start| key.starts_with(start))).collect();
    assert!(unused.is_empty(), "never said: {unused:?}");
}

#[test]
fn a_language_is_chosen_by_its_code_and_english_stands_in() {
    assert_eq!(say("language"), "language");
    assert!(choose("de_AT.UTF-8"));
    assert_eq!(say("language"), "Sprache");
    assert!(!choose("den") && !choose("xx"));
    assert_eq!(say_of("no-such-key"), None);
    assert_eq!(say_with("no-such-key", &[("n", Value::from(3))]), "no-such-key");
    assert!(choose("en"));
}
