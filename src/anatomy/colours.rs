//! Colours of tissues as they are drawn: by what their names say, so that a picture is read without its legend.
//!
//! A name that says nothing known gets the next colour of a palette that the colour-blind tell apart (Okabe and Ito, "Color universal design", 2008). Parts of one kind, two
//! ligaments or two vertebrae, get shades of its colour.

#![warn(missing_docs)]

/// Red, green, blue as in an image file (sRGB).
pub type Rgb = [u8; 3];

/// What stands for a kind of tissue in a name, and its colour: the first entry with a word that the name has.
const KINDS: [(&[&str], Rgb); 27] = [
    // What grows where it should not comes first: `liver tumour` is no liver.
    (&["lesion", "tumor", "tumour", "metasta", "cancer", "nodule", "cyst", "abscess"], [122, 148, 108]),
    (&["marrow"], [206, 138, 108]),
    (&["cartilage", "meniscus"], [170, 205, 214]),
    (&["disc", "disk"], [176, 192, 208]),
    (&["ligament", "flavum", "tendon", "fascia", "membrane", "aponeuro", "capsule"], [214, 199, 178]),
    (&["dura", "mening", "arachnoid"], [232, 214, 222]),
    (&["cerebrospinal", "csf", "liquor", "ventricle", "fluid"], [150, 205, 238]),
    (&["cord", "nerve", "plexus", "brain", "ganglion"], [240, 222, 130]),
    (&["vein", "vena", "venous", "jugular", "portal"], [62, 98, 190]),
    (&["arter", "aorta", "carotid"], [206, 36, 40]),
    (&["vessel"], [150, 50, 120]),
    (&["epiderm", "dermis", "skin", "cutis"], [228, 172, 140]),
    (&["fat", "adipose", "subcutaneous"], [246, 214, 104]),
    (&["muscle", "musculus", "platysma", "mastoid", "psoas", "gluteus", "diaphragm"], [158, 66, 54]),
    (
        &[
            "bone", "vertebra", "rib", "cortical", "cortex", "femur", "tibia", "radius", "ulna", "skull", "sacrum",
            "pelvis",
        ],
        [238, 231, 208],
    ),
    (&["airway", "trachea", "air", "bronch"], [70, 84, 100]),
    (&["lung", "pleura"], [226, 158, 168]),
    (&["thyroid", "gland", "pancreas"], [196, 116, 88]),
    (&["oesophagus", "esophagus", "stomach", "bowel", "colon", "duodenum", "intestin"], [206, 148, 126]),
    (&["gallbladder", "bile"], [92, 142, 62]),
    (&["liver"], [118, 50, 40]),
    (&["kidney", "renal", "adrenal"], [146, 70, 60]),
    (&["spleen"], [106, 40, 62]),
    (&["heart", "myocard"], [176, 52, 52]),
    (&["bladder", "prostate", "uterus"], [218, 176, 134]),
    (&["breast"], [240, 200, 160]),
    (&["tissue"], [196, 140, 120]),
];

/// For what no word is known.
const PALETTE: [Rgb; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];

/// Lightness of the parts of one kind, over that of its colour: the first has the colour itself.
const SHADES: [f64; 6] = [1.0, 0.86, 1.1, 0.76, 0.93, 0.68];

/// The colour of the kind of tissue that a name tells, in any case of letters; none where it tells nothing known.
pub fn of_kind(name: &str) -> Option<Rgb> {
    kind(name).map(|n| KINDS[n].1)
}

fn kind(name: &str) -> Option<usize> {
    let name = name.to_lowercase();
    // Short words stand alone or begin one: `air` is not in `hair`, `rib` not in `fibrous`.
    let begins = |word: &str| {
        let mut from = 0;
        while let Some(at) = name[from..].find(word).map(|at| at + from) {
            if !name[..at].chars().next_back().is_some_and(char::is_alphabetic) || word.len() > 4 {
                return true;
            }
            from = at + word.len();
        }
        false
    };
    KINDS.iter().position(|(words, _)| words.iter().any(|word| begins(word)))
}

/// A colour for each of several parts by their names: none twice, as long as shades and the palette last.
pub fn of_names<'a>(names: impl Iterator<Item = &'a str>) -> Vec<Rgb> {
    let mut seen = [0usize; KINDS.len()];
    let mut unknown = 0;
    let next = |count: &mut usize, of: usize| {
        *count += 1;
        (*count - 1) % of
    };
    names
        .map(|name| match kind(name) {
            Some(kind) => shade(KINDS[kind].1, SHADES[next(&mut seen[kind], SHADES.len())]),
            None => PALETTE[next(&mut unknown, PALETTE.len())],
        })
        .collect()
}

/// A colour that is lighter or darker by a factor.
pub fn shade(colour: Rgb, factor: f64) -> Rgb {
    colour.map(|byte| (f64::from(byte) * factor).clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_segmentations_tell_their_kind() {
        let [bone, artery, vein, fat, lesion] = ["bone", "artery", "vein", "fat", "lesion"].map(of_kind);
        assert!([bone, artery, vein, fat, lesion].iter().all(Option::is_some));
        for (name, expected) in [
            ("bone L3", bone),
            ("Vertebra L4", bone),
            ("rib_left_7", bone),
            ("radial artery", artery),
            ("Aorta", artery),
            ("internal jugular vein", vein),
            ("portal_vein_and_splenic_vein", vein),
            ("epidural fat", fat),
            ("liver tumour", lesion),
            ("Segment_4", None),
            ("hairy thing", None),
            ("fibrous", None),
        ] {
            assert_eq!(of_kind(name), expected, "{name}");
        }
    }

    #[test]
    fn parts_are_told_apart() {
        let names =
            ["bone L3", "bone L4", "supraspinous ligament", "ligamentum flavum", "Segment_1", "Segment_2", "skin"];
        let colours = of_names(names.into_iter());
        for (n, a) in colours.iter().enumerate() {
            assert!(colours[..n].iter().all(|b| b != a), "{}", names[n]);
        }
    }
}
