//! The words of every language are complete, and each is used.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use fluent_syntax::ast::{Entry, Expression, InlineExpression, Pattern, PatternElement};
use fluent_syntax::parser;
use stylet::scene::Scene;
use stylet::training::scene_words;
use stylet::words::{LANGUAGES, Language, Value, choose, say, say_of, say_with};

/// The language is that of the whole program.
static LANGUAGE: Mutex<()> = Mutex::new(());

/// Keys that are put together where they are used: `say_of(&format!("figure-{key}"))`.
const PUT_TOGETHER: [&str; 6] = ["figure-", "task-", "field-", "force-", "seen-from-", "name-"];

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

/// What the program's own scenes say: English stands in the scenes.
const OF_SCENES: &str = "tasks";

/// Places of every text of a language, without those of the scenes.
fn texts(language: &Language) -> BTreeMap<String, BTreeSet<String>> {
    places_in(language, |file| file != OF_SCENES)
}

/// The same of chosen files.
fn places_in(language: &Language, wanted: impl Fn(&str) -> bool) -> BTreeMap<String, BTreeSet<String>> {
    let mut found = BTreeMap::new();
    for (file, text) in language.files.iter().filter(|(file, _)| wanted(file)) {
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

/// Title, briefing and every name of every training scene has its words in every other language, and there are no words for what is in none.
#[test]
fn every_training_scene_is_told_in_every_language() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut expected = BTreeMap::new();
    let mut scenes = 0;
    for folder in ["scenes/training", "scenes/anatomy"] {
        for entry in std::fs::read_dir(root.join(folder)).expect("the scenes are there") {
            let path = entry.expect("an entry").path();
            let scene = Scene::load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
            assert!(scene.task.is_some(), "{} has no task", path.display());
            expected.extend(scene_words::keys(&scene));
            scenes += 1;
        }
    }
    assert_eq!(scenes, 9);
    let others = BTreeSet::from_iter(expected.keys().filter(|key| !key.starts_with("task-")).cloned());
    assert!(expected.len() - others.len() == scenes && others.len() > 60, "{} texts", others.len());
    for language in &LANGUAGES[1..] {
        let found = places_in(language, |file| file == OF_SCENES);
        let placed: Vec<&String> = found.iter().filter(|(_, places)| !places.is_empty()).map(|(key, _)| key).collect();
        assert!(placed.is_empty(), "{}: a text of a scene has a place: {placed:?}", language.code);
        let found: BTreeSet<String> = found.into_keys().collect();
        let missing: Vec<&String> = others.difference(&found).collect();
        assert!(missing.is_empty(), "{}/{OF_SCENES} lacks {missing:?}", language.code);
        let extra: Vec<&String> = found.difference(&others).collect();
        assert!(extra.is_empty(), "{}/{OF_SCENES} has what no training scene says: {extra:?}", language.code);
    }
    assert!(LANGUAGES[0].files.iter().all(|(file, _)| *file != OF_SCENES));
    // The way there: from the text of the scene to that of the language, and back to the scene where it is another's.
    let _alone = LANGUAGE.lock().unwrap_or_else(PoisonError::into_inner);
    let hit = Scene::load(&root.join("scenes/training/hit_target.toml"), &[]).unwrap_or_else(|error| panic!("{error}"));
    let task = hit.task.expect("a task");
    let all = || {
        [
            scene_words::title(&hit.title),
            scene_words::briefing(&task.briefing),
            scene_words::task(&task.name),
            scene_words::name(&hit.targets[0].name),
        ]
    };
    let mine = "Bring the tip to my lesson's lesion.";
    assert_eq!(all(), [&hit.title, &task.briefing, "Hit a lesion", "lesion"]);
    assert!(choose("de"));
    assert_eq!(all()[2..], ["Läsion treffen", "Läsion"]);
    assert!(all()[0].starts_with("Training: eine Läsion") && all()[1].starts_with("Eine feste Läsion"), "{:?}", all());
    assert_eq!([scene_words::title(mine), scene_words::briefing(mine), scene_words::task(mine)], [mine; 3]);
    assert_eq!(scene_words::name("left adrenal gland"), "left adrenal gland");
    assert!(choose("en"));
}

/// What is to be done stands in the strip over the view, which has two lines where it is narrow; a third would move the view.
#[test]
fn a_step_is_said_in_two_lines() {
    for language in &LANGUAGES {
        let lines = language.files.iter().flat_map(|(_, text)| text.lines());
        let steps = lines
            .filter_map(|line| line.split_once(" = "))
            .filter(|(key, _)| key.starts_with("step-") && key.ends_with("-text"));
        let lengths: Vec<(&str, usize)> = steps.map(|(key, text)| (key, text.chars().count())).collect();
        assert_eq!(lengths.len(), 6, "{lengths:?}");
        assert!(lengths.iter().all(|(_, length)| *length <= 80), "{}: {lengths:?}", language.code);
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
    let _alone = LANGUAGE.lock().unwrap_or_else(PoisonError::into_inner);
    assert_eq!(say("language"), "language");
    assert!(choose("de_AT.UTF-8"));
    assert_eq!(say("language"), "Sprache");
    assert!(!choose("den") && !choose("xx"));
    assert_eq!(say_of("no-such-key"), None);
    assert_eq!(say_with("no-such-key", &[("n", Value::from(3))]), "no-such-key");
    assert!(choose("en"));
}
