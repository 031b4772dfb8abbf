//! The table of an effect: what a scene may write of it, stated once.
//!
//! From one entry of `parameters!` follow the key of the TOML table with its text in the schema, its unit and range, the field of `Params`
//! with its default, and the slider where there is one. What is no plain number (a list, a vector, a word, a key that another one
//! replaces) has a key, a field or a slider by hand in the same table; relations between keys are plain code in `src/scene/convert`.

use crate::units::Unit;
use crate::within::Within;

/// A key that is a plain number.
pub struct Key<T: Table> {
    /// In the table; its end tells the unit.
    pub key: &'static str,
    pub unit: Unit,
    /// What is accepted, in that unit.
    pub within: Within,
    pub written: fn(&T) -> Option<f64>,
    /// Where it goes, in SI.
    pub place: fn(&mut T::Params) -> &mut f64,
}

/// The table of an effect in a scene file.
pub trait Table: Sized + 'static {
    /// The same in SI, complete.
    type Params;

    /// Plain numbers, in the order of the table.
    const KEYS: &'static [Key<Self>];

    /// `base` with what is written here over it. Keys by hand are no part of it.
    fn over(&self, mut base: Self::Params) -> Self::Params {
        for key in Self::KEYS {
            if let Some(value) = (key.written)(self) {
                *(key.place)(&mut base) = key.unit.read(value);
            }
        }
        base
    }
}

/// The table `Table` and the `Params` of an effect. The head names both structs, the key of the effect, and where its present `Params`
/// stand in `Numbers`, for the sliders. Then the entries, each with its texts: that of a key is its description in the schema.
///
/// ```text
/// key: UNIT, range => field = default, slider(name, ends, source).logarithmic();    a number; the slider may be left out
/// key: UNIT, range => in params: params.field.part, slider(..);                     the same in a field that stands here by hand
/// key name: Type;   field name: Type = default;   slider Parameter::new(..);         one of the three by hand
/// ```
macro_rules! parameters {
    (
        $(#[$table_text:meta])* pub struct $Table:ident;
        $(#[$params_text:meta])* pub struct Params;
        $effect:literal: $numbers:ident => $present:expr;
        $($entries:tt)*
    ) => {
        /// The present values.
        fn present<'a>($numbers: &$crate::effects::Numbers<'a>) -> Option<&'a Params> {
            $present
        }

        $crate::effects::parameters::parameters! {
            @ $effect [$(#[$table_text])* pub struct $Table] [$(#[$params_text])* pub struct Params] [] [] [] [] [] $($entries)*
        }
    };
    // What is read is sorted into fields, defaults, keys, plain numbers and sliders.
    (
        @ $effect:literal $table:tt $params:tt [$($field:tt)*] [$($default:tt)*] $key:tt $number:tt $slider:tt
        $(#[$text:meta])* field $name:ident: $Type:ty = $value:expr; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params [$($field)* $(#[$text])* pub $name: $Type,] [$($default)* $name: $value,] $key $number $slider
            $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt [$($key:tt)*] $number:tt $slider:tt
        $(#[$text:meta])* key $name:ident: $Type:ty; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default [$($key)* $(#[$text])* pub $name: $Type,] $number $slider $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt $key:tt $number:tt [$($slider:tt)*]
        slider $parameter:expr; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default $key $number [$($slider)* $parameter,] $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt [$($key:tt)*] [$($number:tt)*] [$($slider:tt)*]
        $(#[$text:meta])* $name:ident: $unit:expr, $within:expr => in $of:ident: $place:expr
        $(, slider($title:expr, $ends:expr, $source:expr) $(.$how:ident())*)?; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default
            [$($key)* $(#[$text])* pub $name: Option<f64>,]
            [$($number)* $crate::effects::parameters::Key {
                key: stringify!($name),
                unit: $unit,
                within: $within,
                written: |table| table.$name,
                place: |$of| &mut $place,
            },]
            [$($slider)* $($crate::effects::parameter::Parameter::new(
                concat!($effect, ".", stringify!($name)), $title, $unit.word(), $ends, $source,
                |numbers| present(numbers).map(|$of| $place / $unit.si),
            )$(.$how())*,)?]
            $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt $key:tt $number:tt $slider:tt
        $(#[$text:meta])* $name:ident: $unit:expr, $within:expr => $(#[$field_text:meta])* $own:ident = $value:expr
        $(, slider $slide:tt $(.$how:ident())*)?; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default $key $number $slider
            $(#[$field_text])* field $own: f64 = $value;
            $(#[$text])* $name: $unit, $within => in params: params.$own $(, slider $slide $(.$how())*)?;
            $($rest)*
        }
    };
    (
        @ $effect:literal [$(#[$table_text:meta])* pub struct $Table:ident] [$($params:tt)*]
        [$($field:tt)*] [$($default:tt)*] [$($key:tt)*] [$($number:tt)*] [$($slider:tt)*]
    ) => {
        $(#[$table_text])*
        #[derive(Debug, Clone, Default, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $Table { $($key)* }

        $($params)* { $($field)* }

        impl Default for Params {
            fn default() -> Self {
                Params { $($default)* }
            }
        }

        impl $crate::effects::parameters::Table for $Table {
            type Params = Params;
            const KEYS: &'static [$crate::effects::parameters::Key<Self>] = &[$($number)*];
        }

        /// What may be changed while a run goes on.
        const PARAMETERS: &[$crate::effects::parameter::Parameter] = &[$($slider)*];
    };
}

pub(crate) use parameters;
