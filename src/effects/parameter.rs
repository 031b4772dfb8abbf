//! Numbers of effects that may be changed while a run goes on, as a slider or a link shows them.
//!
//! A change goes the way of every scene: it becomes an override (`friction.coefficient=0.4`) and the scene is read anew, so that ranges,
//! messages and conversions exist once.

use super::Numbers;

/// One number, or the components of one list, of a scene file.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Key in the scene file; its end tells the unit.
    pub key: &'static str,
    /// For people.
    pub name: &'static str,
    /// Unit of the key; `-` for a pure number.
    pub unit: &'static str,
    /// Ends of a slider, in that unit. What the scene allows may reach further.
    pub range: [f64; 2],
    /// A slider moves by factors.
    pub logarithmic: bool,
    /// Where the usual value comes from.
    pub source: &'static str,
    /// Where the present value is found.
    pub value: Value,
}

/// Unit of whole numbers.
pub const COUNT: &str = "count";

/// Components of a list in the unit of its key.
pub type Components = fn(&Numbers) -> Option<Vec<f64>>;

/// The present value in the unit of the key; `None` where the scene has no such number.
#[derive(Debug, Clone, Copy)]
pub enum Value {
    /// One number.
    Number(fn(&Numbers) -> Option<f64>),
    /// A list, which is always written whole, with the lists that are refused without it: key and values.
    List(Components, Option<(&'static str, Components)>),
}

impl Parameter {
    /// A number with a slider that moves by amounts.
    pub const fn new(
        key: &'static str,
        name: &'static str,
        unit: &'static str,
        range: [f64; 2],
        source: &'static str,
        value: fn(&Numbers) -> Option<f64>,
    ) -> Self {
        Parameter { key, name, unit, range, logarithmic: false, source, value: Value::Number(value) }
    }

    /// The same with another kind of value.
    pub const fn holding(self, value: Value) -> Self {
        Parameter { value, ..self }
    }

    /// The same with a slider that moves by factors; the range is above zero.
    pub const fn logarithmic(self) -> Self {
        Parameter { logarithmic: true, ..self }
    }

    /// Present values: one, or the components of the list; empty where the scene has no such number.
    pub fn values(&self, numbers: &Numbers) -> Vec<f64> {
        match self.value {
            Value::Number(value) => value(numbers).into_iter().collect(),
            Value::List(values, _) => values(numbers).unwrap_or_default(),
        }
    }

    /// Overrides that set component `index` to `value`.
    pub fn overrides(&self, numbers: &Numbers, index: usize, value: f64) -> Vec<String> {
        match self.value {
            Value::Number(_) if self.unit == COUNT => vec![format!("{}={}", self.key, value.round())],
            Value::Number(_) => vec![format!("{}={value}", self.key)],
            Value::List(values, beside) => {
                let mut list = values(numbers).unwrap_or_default();
                if let Some(place) = list.get_mut(index) {
                    *place = value;
                }
                let mut texts = vec![format!("{}={list:?}", self.key)];
                if let Some((key, others)) = beside {
                    texts.push(format!("{key}={:?}", others(numbers).unwrap_or_default()));
                }
                texts
            }
        }
    }
}

/// `overrides` with `more` behind them; a key that is set again loses its older text, and the order stays.
pub fn with_overrides(overrides: &[String], more: &[String]) -> Vec<String> {
    let key = |text: &str| text.split('=').next().unwrap_or_default().trim().to_string();
    let mut all: Vec<String> =
        overrides.iter().filter(|old| more.iter().all(|new| key(new) != key(old))).cloned().collect();
    all.extend_from_slice(more);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::EFFECTS;
    use crate::scene::Scene;
    use std::path::Path;

    fn scene(overrides: &[String]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/calibrated/muscle_biopsy.toml");
        Scene::load(&path, overrides).unwrap_or_else(|e| panic!("{e}"))
    }

    const EVERYTHING: &str = r#"effects=["mass_scaling", "gravity", "plasticity", "fibres", "viscoelastic", "damage", "puncture", "adhesion", "friction", "flexible_needle"]"#;

    /// Every slider of every effect does what it says: it changes its own number, to the value that was asked, and nothing else of the
    /// list.
    #[test]
    fn every_parameter_can_be_read_and_set() {
        // Cells of 0.6 mm are too large for the displacement of the default.
        let base = vec![EVERYTHING.to_string(), "damage.failure_displacement_mm=0.6".to_string()];
        let before = scene(&base);
        let mut seen = 0;
        for parameter in EFFECTS.iter().flat_map(|effect| effect.parameters) {
            for (index, value) in parameter.values(&before.numbers()).into_iter().enumerate() {
                let wanted = if value == 0.0 { 0.01 } else { 0.97 * value };
                let more = parameter.overrides(&before.numbers(), index, wanted);
                let after = scene(&with_overrides(&base, &more));
                let found = parameter.values(&after.numbers());
                if parameter.key == "fibres.direction" {
                    // A vector of any length means its direction.
                    let mut list = parameter.values(&before.numbers());
                    list[index] = wanted;
                    let length = list.iter().map(|x| x * x).sum::<f64>().sqrt();
                    assert!(found.iter().zip(&list).all(|(x, y)| (x - y / length).abs() < 1e-12), "{found:?}");
                    seen += 1;
                    continue;
                }
                // A whole number stays one.
                let wanted = if parameter.unit == COUNT { wanted.round() } else { wanted };
                assert!((found[index] / wanted - 1.0).abs() < 1e-9, "{}: {found:?} instead of {wanted}", parameter.key);
                for (other, old) in
                    parameter.values(&before.numbers()).into_iter().enumerate().filter(|(n, _)| *n != index)
                {
                    assert!((found[other] - old).abs() <= 1e-9 * old.abs(), "{}: {other} moved", parameter.key);
                }
                seen += 1;
            }
        }
        assert!(seen >= 30, "{seen} numbers");
    }

    #[test]
    fn the_last_word_counts() {
        let old = ["a.b=1".to_string(), "c=2".into()];
        assert_eq!(with_overrides(&old, &["a.b = 3".into()]), ["c=2", "a.b = 3"]);
    }
}
