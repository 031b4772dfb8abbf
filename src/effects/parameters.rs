//! The table of an effect: what a scene may write of it, stated once.
//!
//! From one entry of `parameters!` follow the key of the TOML table with its text in the schema, its unit and range, the field of `Params`
//! with its default, its name and place in a shader, and the slider where there is one. What is no plain number (a list, a vector, a word, a key that another one
//! replaces) has a key, a field or a slider by hand in the same table; relations between keys are plain code in `src/scene/convert`.

use crate::units::Unit;
use crate::within::Within;

/// A key that is a plain number.
pub struct Key<T: Table> {
    /// In the table; its end tells the unit.
    pub key: &'static str,
    /// Unit of the key.
    pub unit: Unit,
    /// What is accepted, in that unit.
    pub within: Within,
    /// What a table says, in that unit; `None`: nothing.
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

/// The fields of `Params` that are numbers, as a shader has them: `#params` of the composer writes the struct from the names, and
/// the arrays of the device are filled with the values, both in the order of the table.
pub trait ShaderNumbers {
    /// Names of the fields.
    const NAMES: &'static [&'static str];

    /// In SI.
    fn values(&self) -> Vec<f32>;

    /// The values as a uniform wants them, up to a multiple of 16 bytes.
    fn packed(&self) -> Vec<f32> {
        let mut values = self.values();
        values.resize(values.len().next_multiple_of(4), 0.0);
        values
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
            @ $effect [$(#[$table_text])* pub struct $Table] [$(#[$params_text])* pub struct Params] [] [] [] [] [] [] $($entries)*
        }
    };
    // What is read is sorted into fields, defaults, keys, plain numbers, sliders and names of the fields that are numbers.
    (
        @ $effect:literal $table:tt $params:tt [$($field:tt)*] [$($default:tt)*] $key:tt $number:tt $slider:tt [$($name_of:ident)*]
        $(#[$text:meta])* field $name:ident: f64 = $value:expr; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params [$($field)* $(#[$text])* pub $name: f64,] [$($default)* $name: $value,] $key $number $slider
            [$($name_of)* $name] $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt [$($field:tt)*] [$($default:tt)*] $key:tt $number:tt $slider:tt $names:tt
        $(#[$text:meta])* field $name:ident: $Type:ty = $value:expr; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params [$($field)* $(#[$text])* pub $name: $Type,] [$($default)* $name: $value,] $key $number $slider
            $names $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt [$($key:tt)*] $number:tt $slider:tt $names:tt
        $(#[$text:meta])* key $name:ident: $Type:ty; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default [$($key)* $(#[$text])* pub $name: $Type,] $number $slider $names $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt $key:tt $number:tt [$($slider:tt)*] $names:tt
        slider $parameter:expr; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default $key $number [$($slider)* $parameter,] $names $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt [$($key:tt)*] [$($number:tt)*] [$($slider:tt)*] $names:tt
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
            $names $($rest)*
        }
    };
    (
        @ $effect:literal $table:tt $params:tt $field:tt $default:tt $key:tt $number:tt $slider:tt $names:tt
        $(#[$text:meta])* $name:ident: $unit:expr, $within:expr => $(#[$field_text:meta])* $own:ident = $value:expr
        $(, slider $slide:tt $(.$how:ident())*)?; $($rest:tt)*
    ) => {
        $crate::effects::parameters::parameters! {
            @ $effect $table $params $field $default $key $number $slider $names
            $(#[$field_text])* field $own: f64 = $value;
            $(#[$text])* $name: $unit, $within => in params: params.$own $(, slider $slide $(.$how())*)?;
            $($rest)*
        }
    };
    (
        @ $effect:literal [$(#[$table_text:meta])* pub struct $Table:ident] [$($params:tt)*]
        [$($field:tt)*] [$($default:tt)*] [$($key:tt)*] [$($number:tt)*] [$($slider:tt)*] [$($name:ident)*]
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

        impl $crate::effects::parameters::ShaderNumbers for Params {
            const NAMES: &'static [&'static str] = &[$(stringify!($name)),*];

            fn values(&self) -> Vec<f32> {
                vec![$(self.$name as f32),*]
            }
        }

        /// What may be changed while a run goes on.
        const PARAMETERS: &[$crate::effects::parameter::Parameter] = &[$($slider)*];
    };
}

pub(crate) use parameters;

#[cfg(test)]
mod tests {
    use super::{ShaderNumbers, Table};
    use crate::units::{MILLIMETRE, ONE};
    use crate::within::Within::{Between, Positive};

    parameters! {
        /// A table of a test.
        pub struct MadeUpTable;
        /// In SI.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Params;
        "made_up": _numbers => None;

        /// A length [mm].
        length_mm: MILLIMETRE, Positive(10.0) =>
        /// A length [m].
        length = 2e-3, slider("length", [0.1, 1.0], "test").logarithmic();

        /// A word.
        key word: Option<String>;
        /// What the word and a share make.
        field both: [f64; 2] = [0.5, 0.25];

        /// A share of both.
        share: ONE, Between(0.0, 1.0) =>
        in params: params.both[1];
    }

    #[test]
    fn all_of_a_key_follows_from_its_entry() {
        let table: MadeUpTable = toml::from_str("length_mm = 4\nword = \"a\"").unwrap();
        assert_eq!(table.word.as_deref(), Some("a"));
        assert_eq!(table.over(Params::default()), Params { length: 4e-3, both: [0.5, 0.25] });
        let share = MadeUpTable { share: Some(0.75), ..Default::default() };
        assert_eq!(share.over(Params::default()), Params { length: 2e-3, both: [0.5, 0.75] });
        assert_eq!(MadeUpTable::KEYS.iter().map(|key| key.key).collect::<Vec<_>>(), ["length_mm", "share"]);
        assert_eq!(Params::NAMES, ["length"]);
        assert_eq!(Params::default().packed(), [2e-3, 0.0, 0.0, 0.0]);
        let [slider] = PARAMETERS else { panic!("one slider") };
        assert_eq!((slider.key, slider.unit, slider.logarithmic), ("made_up.length_mm", "mm", true));
        let refused = toml::from_str::<MadeUpTable>("lenth_mm = 4").unwrap_err().to_string();
        assert!(refused.contains("`length_mm`, `word`, `share`"), "{refused}");
        let schema = serde_json::to_value(schemars::schema_for!(MadeUpTable)).unwrap();
        assert_eq!(schema["properties"]["length_mm"]["description"], "A length [mm].");
        assert_eq!(present(&crate::effects::Numbers { effects: &Default::default(), material: &tissue() }), None);
    }

    fn tissue() -> crate::effects::TissueMaterial {
        crate::effects::TissueMaterial::preset("across-fibre").unwrap()
    }

    /// The keys whose default is outside of what is accepted.
    fn wrong<T: Table<Params: Default>>() -> Vec<&'static str> {
        let mut default = T::Params::default();
        let accepted = |key: &super::Key<T>, value: f64| key.within.holds(value / key.unit.si);
        let keys = T::KEYS.iter();
        keys.filter_map(|key| (!accepted(key, *(key.place)(&mut default))).then_some(key.key)).collect()
    }

    #[test]
    fn every_default_is_accepted() {
        use crate::effects::*;
        let wrong = [
            wrong::<adhesion::AdhesionTable>(),
            wrong::<cohesive::CohesiveTable>(),
            wrong::<damage::DamageTable>(),
            wrong::<fibres::FibresTable>(),
            wrong::<flexible_needle::FlexibleNeedleTable>(),
            wrong::<friction::FrictionTable>(),
            wrong::<indentation::IndentationTable>(),
            wrong::<plasticity::PlasticityTable>(),
            wrong::<puncture::PunctureTable>(),
        ];
        assert_eq!(wrong.concat(), [""; 0]);
    }
}
