//! The words that people read in the window and in printed reports: one folder per language, `assets/words/<code>/*.ftl` in the form of
//! [Project Fluent](https://projectfluent.org). [`say`] gives a text, [`say_with`] fills its places.
//!
//! Names of keys, columns and files are not words in this sense: they stay English whatever the language, as does the command line.
//! English is complete (`tests/words.rs` compares all others with it) and stands in where a text is missing. What a scene says in English
//! itself, its briefing and its names, is in the file `tasks` of every other language.

use std::collections::HashMap;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use fluent_bundle::concurrent::FluentBundle;
use fluent_bundle::{FluentArgs, FluentResource};
use fluent_syntax::ast::Entry;

pub use fluent_bundle::FluentValue as Value;

/// A language: its code as in BCP 47, its own name for itself, its files as (name, text).
pub struct Language {
    pub code: &'static str,
    pub name: &'static str,
    pub files: &'static [(&'static str, &'static str)],
}

macro_rules! files {
    ($code:literal: $($file:literal)*) => {
        &[$(($file, include_str!(concat!("../assets/words/", $code, "/", $file, ".ftl")))),*]
    };
}

/// All languages; the first stands in for every other.
pub static LANGUAGES: [Language; 2] = [
    Language { code: "en", name: "English", files: files!("en": "window" "start" "lesson" "teacher") },
    Language { code: "de", name: "Deutsch", files: files!("de": "window" "start" "lesson" "teacher" "tasks") },
];

/// Number of the present language.
static PRESENT: AtomicUsize = AtomicUsize::new(0);

struct Bundle {
    bundle: FluentBundle<FluentResource>,
    /// Texts without places, ready.
    plain: HashMap<String, String>,
}

/// The texts of a language.
fn bundle(number: usize) -> &'static Bundle {
    static BUNDLES: OnceLock<Vec<Bundle>> = OnceLock::new();
    &BUNDLES.get_or_init(|| LANGUAGES.iter().map(read).collect())[number]
}

fn read(language: &Language) -> Bundle {
    let mut bundle = FluentBundle::new_concurrent(language.code.parse().into_iter().collect());
    // The marks around filled places keep languages of both directions apart; a font without them draws boxes.
    bundle.set_use_isolating(false);
    let mut plain = HashMap::new();
    for (_, text) in language.files {
        // What cannot be read is found by the tests.
        let resource = FluentResource::try_new((*text).to_string()).unwrap_or_else(|(resource, _)| resource);
        let keys: Vec<String> = keys_of(&resource).map(str::to_string).collect();
        bundle.add_resource_overriding(resource);
        for key in keys {
            let mut errors = Vec::new();
            let pattern = bundle.get_message(&key).and_then(|message| message.value());
            let said = pattern.map(|pattern| bundle.format_pattern(pattern, None, &mut errors).into_owned());
            if let Some(said) = said.filter(|_| errors.is_empty()) {
                plain.insert(key, said);
            }
        }
    }
    Bundle { bundle, plain }
}

/// Keys of the messages of a file.
fn keys_of(resource: &FluentResource) -> impl Iterator<Item = &str> {
    resource.entries().filter_map(|entry| match entry {
        Entry::Message(message) => Some(message.id.name),
        _ => None,
    })
}

/// The present language.
pub fn language() -> &'static Language {
    &LANGUAGES[PRESENT.load(Ordering::Relaxed)]
}

/// Takes a language by its code, or one of a longer code (`de-AT.UTF-8`); false where there is none.
pub fn choose(code: &str) -> bool {
    let of = |l: &Language| code.strip_prefix(l.code).is_some_and(|rest| !rest.starts_with(char::is_alphanumeric));
    match LANGUAGES.iter().position(of) {
        Some(number) => {
            PRESENT.store(number, Ordering::Relaxed);
            true
        }
        None => false,
    }
}

/// The text of a key in the present language; the key itself where there is none.
pub fn say(key: &'static str) -> &'static str {
    say_of(key).unwrap_or(key)
}

/// The text of a key that is put together, if there is one.
pub fn say_of(key: &str) -> Option<&'static str> {
    let of = |number: usize| bundle(number).plain.get(key).map(String::as_str);
    of(PRESENT.load(Ordering::Relaxed)).or_else(|| of(0))
}

/// The text of a key with its places filled: `say_with("best-score", &[("points", 3.into())])`.
pub fn say_with(key: &str, places: &[(&str, Value<'_>)]) -> String {
    let mut args = FluentArgs::new();
    for (name, value) in places {
        args.set(*name, value.clone());
    }
    for number in [PRESENT.load(Ordering::Relaxed), 0] {
        let bundle = &bundle(number).bundle;
        if let Some(pattern) = bundle.get_message(key).and_then(|message| message.value()) {
            return bundle.format_pattern(pattern, Some(&args), &mut Vec::new()).into_owned();
        }
    }
    key.to_string()
}
