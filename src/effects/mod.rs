//! Effects are chosen by the scene. `None` means absent: no define, no buffer, no binding, no code.

#![warn(missing_docs)]

pub mod adhesion;
pub mod cohesive;
pub mod damage;
pub mod fibres;
pub mod flexible_needle;
pub mod friction;
pub mod gravity;
pub mod indentation;
pub mod mass_scaling;
pub mod own;
pub mod parameter;
pub mod parameters;
pub mod plasticity;
pub mod puncture;
pub mod viscoelastic;

use crate::material::ElasticLaw;
use crate::needle::NeedleShape;
use crate::penetration::steady::Resistance;
use crate::penetration::{Steady, Unsolved};

/// Effects of the program that have the form of [`own`]: law, memory, energy, column and numbers stand in one file, the WGSL in another,
/// and this line is all that names them. For what acts in a cell and needs no other effect's state.
pub const SELF_CONTAINED: &[&own::OwnEffect] = &[];

/// One line per effect, under the text of its field: the field in [`EffectSet`] and its entry in [`EFFECTS`].
macro_rules! effects {
    ($($(#[$text:meta])* $name:ident,)+) => {
        /// The effects of one scene, one field per effect, in the order of [`EFFECTS`]. Parameters of a constitutive effect are those of
        /// materials that state none of their own.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct EffectSet {
            $($(#[$text])* pub $name: Option<$name::Params>,)+
            /// Those of [`SELF_CONTAINED`] and of a program that uses the library, in the order of the scene's list.
            pub own: Vec<own::Chosen>,
        }

        const WITH_A_FIELD: [Effect; [$(stringify!($name)),+].len()] = [$($name::EFFECT),+];

        impl EffectSet {
            /// Which effects with a field are on.
            fn presence(&self) -> [bool; WITH_A_FIELD.len()] {
                [$(self.$name.is_some()),+]
            }
        }
    };
}

effects! {
    /// Inertia of the tissue times a factor, for longer steps.
    mass_scaling,
    /// Weight of the tissue.
    gravity,
    /// Permanent flow above a yield stress.
    plasticity,
    /// One family of fibres that stiffen in tension.
    fibres,
    /// Stress that relaxes with time.
    viscoelastic,
    /// Failure by plastic displacement.
    damage,
    /// Faces between cells that separate.
    cohesive,
    /// Tip law, and contact with the opened path of the needle.
    puncture,
    /// Tissue that sticks to the tip and lets go.
    adhesion,
    /// Contact of the top face with a sphere or a flat punch.
    indentation,
    /// Coulomb friction with stick memory.
    friction,
    /// The needle as a beam clamped in its hub.
    flexible_needle,
}

/// All effects. The order is the order of their blocks in the stages.
pub const EFFECTS: [Effect; WITH_A_FIELD.len() + SELF_CONTAINED.len()] = {
    let mut all = [WITH_A_FIELD[0]; WITH_A_FIELD.len() + SELF_CONTAINED.len()];
    let mut place = 1;
    while place < all.len() {
        all[place] = match place < WITH_A_FIELD.len() {
            true => WITH_A_FIELD[place],
            false => SELF_CONTAINED[place - WITH_A_FIELD.len()].effect,
        };
        place += 1;
    }
    all
};

/// Material of the tissue with its origin.
#[derive(Debug, Clone)]
pub struct TissueMaterial {
    /// Preset name, or `constants`.
    pub name: String,
    /// Where the constants come from, one line.
    pub source: String,
    /// Elastic constants.
    pub law: ElasticLaw,
    /// Density [kg/m^3].
    pub density: f64,
    /// Parameters of this material's own; `None`: those of the scene's table, if the effect is on.
    pub plasticity: Option<plasticity::Params>,
    /// The same for fibres.
    pub fibres: Option<fibres::Params>,
    /// The same for relaxation.
    pub viscoelastic: Option<viscoelastic::Params>,
    /// The same for failure.
    pub damage: Option<damage::Params>,
    /// Numbers of this material's own for effects of [`EffectSet::own`]; those that are not here have the scene's.
    pub own: Vec<own::Chosen>,
    /// Tip forces in this material; `None`: those of the scene's puncture table.
    pub cutting: Option<puncture::Cutting>,
    /// A membrane: energy that puncturing this layer takes beyond cutting through it [J].
    pub membrane_energy: Option<f64>,
    /// Toughness J_c [J/m^2], counted over a slit of width 2a.
    pub toughness: Option<f64>,
    /// Stretch at which it tears; `None`: it holds any.
    pub tear_stretch: Option<f64>,
    /// Bone and the like: it does not deform, and a needle does not enter it.
    pub rigid: bool,
}

impl TissueMaterial {
    /// A material without parameters of its own for the effects. `density` [kg/m^3].
    pub fn new(name: impl Into<String>, source: impl Into<String>, law: ElasticLaw, density: f64) -> Self {
        TissueMaterial {
            name: name.into(),
            source: source.into(),
            law,
            density,
            plasticity: None,
            fibres: None,
            viscoelastic: None,
            damage: None,
            own: Vec::new(),
            cutting: None,
            membrane_energy: None,
            toughness: None,
            tear_stretch: None,
            rigid: false,
        }
    }

    /// What follows from the law and the toughness for a needle; `None`: the toughness is not known.
    pub fn steady(&self, needle: &NeedleShape) -> Option<Result<Steady, Unsolved>> {
        let resistance = Resistance { toughness: self.toughness?, tear_stretch: self.tear_stretch };
        Some(Steady::new(&self.law.isochoric, resistance, needle.radius, needle.tip.into()))
    }

    /// [`TissueMaterial::steady`] as the scheme `opening` carries it.
    pub fn opened(&self, needle: &NeedleShape) -> Option<Result<Steady, Unsolved>> {
        Some(self.steady(needle)?.and_then(|steady| steady.carried(&self.law.isochoric)))
    }
}

/// Where [`parameter::Parameter`] finds its present value.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a> {
    /// Those of the scene.
    pub effects: &'a EffectSet,
    /// Of the tissue outside all regions.
    pub material: &'a TissueMaterial,
}

impl Numbers<'_> {
    /// The scene's number `key` of the effect called `effect` in [`EffectSet::own`], in the unit of the key; `None`: it is not on.
    pub fn own(&self, effect: &str, key: &str) -> Option<f64> {
        let chosen = self.effects.own.iter().find(|chosen| chosen.effect.effect.key == effect)?;
        let place = chosen.effect.numbers.iter().position(|number| number.key == key)?;
        Some(chosen.numbers[place] / chosen.effect.numbers[place].unit)
    }
}

/// What an effect acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nodes: inertia and loads.
    Nodes,
    /// The stress in a cell; a material may state parameters of its own.
    Constitutive,
    /// Faces between cells, which separate.
    Faces,
    /// Touch: lets a tool touch the tissue.
    Contact,
    /// What a tool does beyond touching.
    Tool,
}

/// What the program knows about an effect without running it.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Key in the scene's `effects` list and stem of its files.
    pub key: &'static str,
    /// What it acts on.
    pub kind: Kind,
    /// Keys of effects of which one must be on beside it; none: it works alone.
    pub needs: &'static [&'static str],
    /// Name tested by `#ifdef` in the shaders.
    pub define: &'static str,
    /// One line for `check`, the window and `docs/effects`.
    pub summary: &'static str,
    /// Where the equations come from.
    pub source: &'static str,
    /// What it costs, one line.
    pub cost: &'static str,
    /// Numbers that may be changed while a run goes on.
    pub parameters: &'static [parameter::Parameter],
}

impl Effect {
    /// True for effects that work on the block only: faces between cells of a grid, a beam beside the grid.
    pub fn needs_block(&self) -> bool {
        matches!(self.key, "cohesive" | "flexible_needle")
    }
}

impl EffectSet {
    /// True where the finer step bound of cells within a block serves. Its lack of margin needs mass scaling, which follows the
    /// stiffness of squeezed cells and of contact; and faces that may part (cohesive) have edges of their own in every cell.
    pub fn bounds_inner_cells(&self) -> bool {
        self.mass_scaling.is_some() && self.cohesive.is_none()
    }

    /// The effects that are on, in the order of [`EFFECTS`]; behind them those of [`EffectSet::own`].
    pub fn active(&self) -> impl Iterator<Item = &'static Effect> + '_ {
        let built_in = WITH_A_FIELD.iter().zip(self.presence()).filter_map(|(effect, on)| on.then_some(effect));
        built_in.chain(self.own.iter().map(|chosen| &chosen.effect.effect))
    }

    /// Keys of the effects that are on.
    pub fn keys(&self) -> Vec<&'static str> {
        self.active().map(|e| e.key).collect()
    }
}

/// Keys of the effects of one kind.
pub fn keys_of(kind: Kind) -> impl Iterator<Item = &'static str> {
    EFFECTS.iter().filter(move |e| e.kind == kind).map(|e| e.key)
}

/// The override that switches exactly these effects on, in the order of [`EFFECTS`].
pub fn exactly(on: &[&str]) -> String {
    let keys: Vec<&str> = EFFECTS.iter().map(|e| e.key).filter(|k| on.contains(k)).collect();
    format!("effects={keys:?}")
}

/// The override that switches the effect `key` where those of `on` run. Switched off, it takes along what does nothing without it.
pub fn switched(on: &[&str], key: &str, is: bool) -> String {
    let mut left: Vec<&str> = on.iter().copied().filter(|k| *k != key).chain(is.then_some(key)).collect();
    if !is {
        for dependent in EFFECTS.iter().filter(|e| e.needs.contains(&key)) {
            if !dependent.needs.iter().any(|need| left.contains(need)) {
                left.retain(|k| *k != dependent.key);
            }
        }
    }
    exactly(&left)
}

/// The overrides that are one switch away from where those of `on` run, one per effect.
pub fn one_switch_away(on: &[&str]) -> impl Iterator<Item = String> {
    EFFECTS.iter().map(|effect| switched(on, effect.key, !on.contains(&effect.key)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_a_switch_from_where_one_is() {
        let away: Vec<String> = one_switch_away(&["friction", "puncture"]).collect();
        assert_eq!(away.len(), EFFECTS.len());
        assert!(away.contains(&r#"effects=["puncture"]"#.to_string()), "{away:?}");
        assert!(away.contains(&r#"effects=["gravity", "puncture", "friction"]"#.to_string()), "{away:?}");
    }

    #[test]
    fn a_switch_names_all_effects_that_shall_be_on() {
        assert_eq!(
            switched(&["friction", "puncture"], "gravity", true),
            r#"effects=["gravity", "puncture", "friction"]"#
        );
        assert_eq!(switched(&["friction", "puncture"], "friction", false), r#"effects=["puncture"]"#);
    }

    #[test]
    fn what_does_nothing_alone_goes_with_what_it_needs() {
        let all = ["friction", "puncture", "adhesion", "gravity", "flexible_needle"];
        assert_eq!(switched(&all, "puncture", false), r#"effects=["gravity"]"#);
        assert_eq!(
            switched(&["friction", "puncture", "indentation"], "puncture", false),
            r#"effects=["indentation", "friction"]"#
        );
        assert_eq!(switched(&["damage", "plasticity"], "plasticity", false), "effects=[]");
        // What nobody can use yet is asked for as it is, and refused with its way out.
        assert_eq!(switched(&[], "damage", true), r#"effects=["damage"]"#);
    }
}
