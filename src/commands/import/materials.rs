//! From the name of a label to a material of the library.
//!
//! A name of the library or one of its aliases; else the longest of them that stands in the name word by word, the last one
//! where two are as long ("rib bone" is bone, "hepatic vein" a vein). Sides and numbers do not count.

use crate::scene::presets::{folded, tissues};
use crate::scene::tissue_preset::TissuePreset;

/// What a label without a known name is taken for.
pub const FALLBACK: &str = "across-fibre";
/// What is never computed as a material that deforms.
const BONE: &str = "bone";
/// What stands for air: the softest of the library.
const SOFTEST: &str = "lung";

/// Words of anatomy that the library does not have, and what is nearest to them.
const WORDS: &[(&str, &str)] = &[
    ("femur", BONE),
    ("tibia", BONE),
    ("fibula", BONE),
    ("humerus", BONE),
    ("radius", BONE),
    ("ulna", BONE),
    ("pelvis", BONE),
    ("hip", BONE),
    ("scapula", BONE),
    ("clavicula", BONE),
    ("clavicle", BONE),
    ("patella", BONE),
    ("mandible", BONE),
    ("cranium", BONE),
    ("marrow", BONE),
    ("disc", "cartilage"),
    ("disk", "cartilage"),
    ("ligament", "supraspinous-ligament"),
    ("epidermis", "skin"),
    ("cyst", "csf"),
    ("renal", "kidney"),
    ("hepatic", "liver"),
    ("vertebral column", BONE),
    ("spinal column", BONE),
    ("spine", BONE),
    ("cerebral white matter", "brain"),
    ("cerebellum white matter", "brain"),
    ("cortex", "brain"),
    ("ctx", "brain"),
    ("gyrus", "brain"),
    ("thalamus", "brain"),
    ("caudate", "brain"),
    ("putamen", "brain"),
    ("pallidum", "brain"),
    ("hippocampus", "brain"),
    ("amygdala", "brain"),
    ("accumbens", "brain"),
    ("insula", "brain"),
    ("lateral ventricle", "csf"),
    ("3rd ventricle", "csf"),
    ("4th ventricle", "csf"),
];

/// Words for what no needle feels.
const AIR: &[&str] = &["air", "airway", "airways", "trachea", "bronchus", "bronchi", "gas", "sinus"];

/// What a label is in a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A material by a name of the library.
    Known,
    /// Air in the body.
    Air,
    /// The name says nothing, or there is none.
    Unknown,
}

/// The material of a label.
#[derive(Debug, Clone, Copy)]
pub struct Matched {
    pub preset: &'static TissuePreset,
    pub kind: Kind,
}

impl Matched {
    pub fn is_rigid(&self) -> bool {
        self.preset.name == BONE
    }

    /// In a table: what it becomes.
    pub fn text(&self) -> String {
        match self.kind {
            _ if self.is_rigid() => "bone, rigid".into(),
            Kind::Known => self.preset.name.clone(),
            Kind::Air => format!("air, as soft as {SOFTEST}"),
            Kind::Unknown => "not known: muscle".into(),
        }
    }
}

/// The material for a label of this name.
pub fn of_label(name: Option<&str>) -> Matched {
    let fallback = tissues().iter().find(|preset| preset.name == FALLBACK).unwrap_or(&tissues()[0]);
    let named = |wanted: &str| tissues().iter().find(|preset| preset.name == wanted);
    let Some(name) = name else { return Matched { preset: fallback, kind: Kind::Unknown } };
    if let Some(preset) = crate::scene::presets::tissue(name) {
        return Matched { preset, kind: Kind::Known };
    }
    let words = words(name);
    if words.iter().any(|word| AIR.contains(&word.as_str()))
        && let Some(preset) = named(SOFTEST)
    {
        return Matched { preset, kind: Kind::Air };
    }
    let own = tissues().iter().flat_map(|preset| {
        std::iter::once(&preset.name).chain(&preset.aliases).map(move |known| (known.as_str(), preset))
    });
    let more = WORDS.iter().filter_map(|(word, preset)| Some((*word, named(preset)?)));
    let mut best: Option<((usize, usize), &TissuePreset)> = None;
    for (known, preset) in own.chain(more) {
        let Some(rank) = place_of(&words, &self::words(known)) else { continue };
        if best.is_none_or(|(other, _)| rank > other) {
            best = Some((rank, preset));
        }
    }
    match best {
        Some((_, preset)) => Matched { preset, kind: Kind::Known },
        None => Matched { preset: fallback, kind: Kind::Unknown },
    }
}

/// The words of a name, small and without sides and numbers, in the singular.
fn words(name: &str) -> Vec<String> {
    const SIDES: &[&str] = &["left", "right", "l", "r", "upper", "lower", "the", "of", "wall"];
    let plain = |c: char| if c.is_alphanumeric() { c } else { ' ' };
    let words: String = folded(name).chars().map(plain).collect();
    // `liver2` is a liver, and `L3` beside a vertebra no word.
    let bare = words.split_whitespace().map(|word| word.trim_end_matches(char::is_numeric));
    let kept = bare.filter(|word| !word.is_empty() && !SIDES.contains(word));
    kept.map(|word| match word.strip_suffix('s') {
        Some(single) if word.len() > 4 && !single.ends_with(['s', 'u', 'i']) => single.to_string(),
        _ => word.to_string(),
    })
    .collect()
}

/// How many words of `known` stand in a row in `words`, and where they end; `None`: not all.
fn place_of(words: &[String], known: &[String]) -> Option<(usize, usize)> {
    if known.is_empty() || known.len() > words.len() {
        return None;
    }
    let at = words.windows(known.len()).rposition(|window| window == known)?;
    Some((known.len(), at + known.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_segmentations_lead_to_materials() {
        for (name, material) in [
            ("liver", "liver"),
            ("Skin", "skin"),
            ("femur_left", "bone"),
            ("bone L3", "bone"),
            ("rib bone", "bone"),
            ("rib_right_4", "bone"),
            ("bone marrow", "bone"),
            ("hepatic vein", "vein"),
            ("internal jugular vein", "vein"),
            ("common carotid artery", "artery"),
            ("intercostal vessels", "vessel"),
            ("sternocleidomastoid muscle", "across-fibre"),
            ("epidural fat", "epidural-fat"),
            ("ligamentum flavum", "ligamentum-flavum"),
            ("cerebrospinal fluid", "csf"),
            ("intervertebral disc", "cartilage"),
            ("kidney cyst left", "csf"),
            ("vertebrae_L3", "bone"),
            ("Left Femur", "bone"),
            ("lumbar vertebral column", "bone"),
            ("vertebral artery", "artery"),
            ("liver2", "liver"),
            ("Left-Cerebral-White-Matter", "brain"),
            ("Right-Thalamus-Proper", "brain"),
            ("ctx-lh-precuneus", "brain"),
            ("Left-Lateral-Ventricle", "csf"),
            ("4th-Ventricle", "csf"),
        ] {
            let found = of_label(Some(name));
            assert_eq!((found.preset.name.as_str(), found.kind), (material, Kind::Known), "{name}");
            assert_eq!(found.is_rigid(), material == "bone", "{name}");
        }
        assert_eq!(of_label(Some("airway")).kind, Kind::Air);
        for name in [None, Some("Segment_1"), Some("Mesh1"), Some("platysma"), Some(""), Some("7")] {
            let found = of_label(name);
            assert_eq!((found.preset.name.as_str(), found.kind), (FALLBACK, Kind::Unknown), "{name:?}");
        }
    }

    #[test]
    fn every_word_leads_to_a_material_of_the_library() {
        for (word, preset) in WORDS {
            assert!(tissues().iter().any(|known| known.name == *preset), "{word} -> {preset}");
        }
        assert!(tissues().iter().any(|known| known.name == SOFTEST));
    }
}
