//! Every combination of effects composes and validates; layouts, bindings and budget. No adapter needed.

#[path = "../own_effect/swelling.rs"]
mod swelling;

mod second_compiler;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use glam::DVec3;
use rayon::prelude::*;
use stylet::effects::{EFFECTS, EffectSet, Kind, SELF_CONTAINED, mass_scaling};
use stylet::engine::Stage;
use stylet::gpu::compose::{Defines, PARAMS, SCENE_DEFINES, SOURCES, compose, compose_without_effects};
use stylet::gpu::kernel::{BindingKind, Reflected, reflect};
use stylet::gpu::plan::{Features, defines, stages};
use stylet::gpu::structs::layouts;
use stylet::material::LAWS;

/// Features of a block of Mooney-Rivlin tissue.
fn scene(loaded_faces: bool, driven_faces: bool) -> Features {
    let laws = BTreeSet::from(["mooney_rivlin"]);
    Features {
        loaded_faces,
        driven_faces,
        regions: false,
        empty_cells: false,
        tetrahedra: false,
        free_path: false,
        opening: false,
        laid: false,
        drawn: true,
        wide: false,
        bore: false,
        slit: false,
        laws,
    }
}

/// Features of a mesh of tetrahedra without loads.
fn tetrahedra(driven_faces: bool, regions: bool) -> Features {
    Features { tetrahedra: true, regions, ..scene(false, driven_faces) }
}

/// Scenes that differ in what is no effect: loads, driven faces, regions, element.
fn scenes() -> Vec<Features> {
    let mut scenes = vec![scene(false, false), scene(true, false), scene(false, true), scene(true, true)];
    scenes.push(Features { regions: true, ..scene(false, false) });
    scenes.push(Features { regions: true, empty_cells: true, ..scene(false, false) });
    scenes.push(Features { free_path: true, ..scene(false, false) });
    scenes.push(Features { opening: true, ..scene(false, false) });
    scenes.push(Features { opening: true, regions: true, ..scene(true, true) });
    scenes.push(Features { opening: true, wide: true, ..scene(false, false) });
    scenes.push(Features { opening: true, laid: true, ..scene(false, false) });
    scenes.push(Features { opening: true, laid: true, wide: true, ..scene(true, true) });
    scenes.push(Features { bore: true, ..scene(false, false) });
    scenes.push(Features { slit: true, ..scene(true, true) });
    scenes.push(Features { free_path: true, regions: true, ..scene(true, true) });
    scenes.extend([tetrahedra(false, false), tetrahedra(true, false), tetrahedra(false, true)]);
    scenes.push(Features { loaded_faces: true, ..tetrahedra(true, true) });
    scenes.push(Features { opening: true, ..tetrahedra(false, false) });
    scenes.push(Features { opening: true, wide: true, ..tetrahedra(false, true) });
    scenes.push(Features { opening: true, loaded_faces: true, ..tetrahedra(true, true) });
    scenes
}

/// Scenes of every elastic law alone, of pairs with Ogden's and with Mooney-Rivlin's, and of all together.
fn scenes_of_laws() -> Vec<Features> {
    let keys: Vec<&'static str> = LAWS.iter().map(|law| law.key).collect();
    let mut sets: Vec<BTreeSet<&'static str>> = keys.iter().map(|k| BTreeSet::from([*k])).collect();
    sets.extend(keys.iter().flat_map(|k| [BTreeSet::from([*k, "ogden"]), BTreeSet::from([*k, "mooney_rivlin"])]));
    sets.push(keys.into_iter().collect());
    let of = |laws: &BTreeSet<&'static str>, tetrahedra: bool| Features {
        regions: laws.len() > 1,
        laws: laws.clone(),
        tetrahedra,
        ..scene(false, false)
    };
    sets.iter().flat_map(|laws| [of(laws, false), of(laws, true)]).collect()
}

/// The set with the effects whose keys `wanted` takes.
fn effect_set(wanted: impl Fn(&str) -> bool) -> EffectSet {
    let gravity = stylet::effects::gravity::Params { acceleration: DVec3::NEG_Z };
    let set = EffectSet {
        mass_scaling: wanted("mass_scaling").then_some(mass_scaling::Params { factor: 100.0 }),
        gravity: wanted("gravity").then_some(gravity),
        plasticity: wanted("plasticity").then(Default::default),
        fibres: wanted("fibres").then(Default::default),
        viscoelastic: wanted("viscoelastic").then(Default::default),
        damage: wanted("damage").then(Default::default),
        cohesive: wanted("cohesive").then(Default::default),
        puncture: wanted("puncture").then(Default::default),
        adhesion: wanted("adhesion").then(Default::default),
        indentation: wanted("indentation").then(Default::default),
        friction: wanted("friction").then(Default::default),
        flexible_needle: wanted("flexible_needle").then(Default::default),
        own: SELF_CONTAINED.iter().filter(|own| wanted(own.effect.key)).map(|own| own.chosen()).collect(),
    };
    let expected: Vec<&str> = EFFECTS.iter().map(|e| e.key).filter(|key| wanted(key)).collect();
    assert_eq!(set.keys(), expected, "order of the effect table");
    set
}

/// All 4096 subsets: none, every single one, all pairs, all together and what lies between.
fn all_sets() -> Vec<EffectSet> {
    let place = |key: &str| EFFECTS.iter().position(|e| e.key == key).unwrap();
    (0..1usize << EFFECTS.len()).map(|bits| effect_set(|key| bits >> place(key) & 1 == 1)).collect()
}

/// All stages of a set of effects.
fn reflected(set: &EffectSet, features: &Features) -> Vec<Reflected> {
    let defines = defines(set, features);
    stages(set, features)
        .into_iter()
        .map(|stage| reflect(stage, &defines, false).unwrap_or_else(|e| panic!("{:?} {features:?}: {e}", set.keys())))
        .collect()
}

/// What a stage is called here, the stage, and what is defined for it.
type Variant = (String, Stage, Defines);

/// Every stage of every set in every kind of scene; of those that compose to the same text only the first.
fn variants() -> &'static [Variant] {
    static ALL: OnceLock<Vec<Variant>> = OnceLock::new();
    ALL.get_or_init(|| {
        let mut seen = BTreeSet::new();
        let (none, every) = (effect_set(|_| false), effect_set(|_| true));
        let of_laws = scenes_of_laws().into_iter().flat_map(|f| [(none.clone(), f.clone()), (every.clone(), f)]);
        let of_effects = all_sets().into_iter().flat_map(|set| scenes().into_iter().map(move |f| (set.clone(), f)));
        // Beside none and all of them an effect that a program brings along; with regions, a free path or a bore too, or a path through
        // tetrahedra, a device would have to bind one array more than a portable one does, which the engine refuses.
        let with_own = |set: EffectSet| EffectSet { own: vec![swelling::SWELLING.chosen()], ..set };
        let of_own = scenes()
            .into_iter()
            .flat_map(|f| {
                let most = if f.tetrahedra { effect_set(|key| key != "puncture") } else { every.clone() };
                [none.clone(), most].map(|set| (with_own(set), f.clone()))
            })
            .filter(|(set, features)| {
                set.viscoelastic.is_none() || !(features.regions || features.free_path || features.bore)
            })
            .collect::<Vec<_>>();
        let mut texts = Vec::new();
        for (set, features) in of_effects.chain(of_laws).chain(of_own) {
            let defines = defines(&set, &features);
            for stage in stages(&set, &features) {
                let own: Vec<&str> = defines.own.iter().map(|own| own.effect.key).collect();
                let what = format!("{} with {:?} and {own:?}", stage.name(), defines.names);
                let composed = compose(&format!("stages/{}", stage.name()), &defines);
                let composed = composed.unwrap_or_else(|e| panic!("{what}: {e}"));
                if seen.insert(composed.source) {
                    texts.push((what, stage, defines.clone()));
                }
            }
        }
        texts
    })
}

/// The same, composed and validated.
fn everything() -> &'static [(String, Reflected)] {
    static ALL: OnceLock<Vec<(String, Reflected)>> = OnceLock::new();
    ALL.get_or_init(|| {
        variants()
            .par_iter()
            .map(|(what, stage, defines)| {
                let reflected = reflect(*stage, defines, false).unwrap_or_else(|e| panic!("{what}: {e}"));
                (what.clone(), reflected)
            })
            .collect()
    })
}

#[test]
fn arrays_in_textures_keep_the_budget() {
    let most = variants()
        .par_iter()
        .map(|(what, stage, defines)| {
            let r = reflect(*stage, defines, true).unwrap_or_else(|e| panic!("{what} with arrays in textures: {e}"));
            let count = |kind| r.bindings.iter().filter(|b| b.kind == kind).count();
            let counts = [BindingKind::Texels, BindingKind::Sampled, BindingKind::Storage].map(count);
            let [texels, sampled, storage] = counts;
            assert!(texels <= 4 && sampled <= 16 && storage <= 8, "{what}: {texels}, {sampled}, {storage}");
            counts
        })
        .reduce(|| [0; 3], |a, b| std::array::from_fn(|n| a[n].max(b[n])));
    println!("at most {} storage textures, {} sampled ones, {} storage buffers", most[0], most[1], most[2]);
    assert!(most[0] >= 3 && most[1] >= 2, "nothing lies in textures");
}

#[test]
fn every_combination_composes_validates_and_keeps_the_budget() {
    let (mut most_buffers, mut most_memory) = (0, 0);
    for (place, r) in everything() {
        let storage = r.bindings.iter().filter(|b| b.kind != BindingKind::Uniform).count();
        assert!(storage <= 8, "{place}: {storage} storage buffers");
        assert!(r.bindings.iter().all(|b| b.group < 4), "{place}: more than 4 groups");
        assert!(r.workgroup_size <= 256, "{place}: workgroup of {}", r.workgroup_size);
        let memory: u32 = r
            .module
            .global_variables
            .iter()
            .filter(|(_, v)| v.space == naga::AddressSpace::WorkGroup)
            .map(|(_, v)| r.module.types[v.ty].inner.size(r.module.to_ctx()))
            .sum();
        assert!(memory <= 16 * 1024, "{place}: {memory} bytes of workgroup memory");
        for (_, ty) in r.module.types.iter() {
            let scalar = match ty.inner {
                naga::TypeInner::Scalar(s) | naga::TypeInner::Atomic(s) => Some(s),
                naga::TypeInner::Vector { scalar, .. } | naga::TypeInner::Matrix { scalar, .. } => Some(scalar),
                _ => None,
            };
            assert!(
                scalar.is_none_or(|s| s.width <= 4 && !(s.kind == naga::ScalarKind::Float && s.width != 4)),
                "{place}: a type that is not portable: {ty:?}"
            );
        }
        let source = code(&r.composed.source);
        for word in ["f16", "f64", "i64", "u64", "subgroup", "enable", "requires"] {
            assert!(!words(&source).contains(word), "{place}: uses {word}");
        }
        most_buffers = most_buffers.max(storage);
        most_memory = most_memory.max(memory);
    }
    let count = everything().len();
    println!(
        "{count} different shaders; at most {most_buffers} storage buffers and {most_memory} bytes of workgroup memory"
    );
}

/// Source without comments.
fn code(source: &str) -> String {
    source.lines().map(|l| l.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// Identifiers of a source.
fn words(source: &str) -> BTreeSet<&str> {
    source.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty()).collect()
}

#[test]
fn a_name_has_one_place_and_a_place_one_name() {
    let mut place_of: BTreeMap<String, (u32, u32)> = BTreeMap::new();
    let mut name_at: BTreeMap<(u32, u32), String> = BTreeMap::new();
    let mut kind_of: BTreeMap<String, bool> = BTreeMap::new();
    for (what, r) in everything() {
        // All bound variables of the module, also those that the entry point leaves alone.
        for (_, variable) in r.module.global_variables.iter() {
            let Some(binding) = &variable.binding else {
                continue;
            };
            let name = variable.name.clone().unwrap();
            let place = (binding.group, binding.binding);
            assert_eq!(*place_of.entry(name.clone()).or_insert(place), place, "{name} moves: {what}");
            let uniform = variable.space == naga::AddressSpace::Uniform;
            assert_eq!(*kind_of.entry(name.clone()).or_insert(uniform), uniform, "{name}: {what}");
            let other = name_at.entry(place).or_insert(name.clone());
            assert_eq!(*other, name, "{place:?} has two names: {what}");
        }
    }
    println!("{} bindings", place_of.len());
}

/// Name, span and members (name, offset) of a struct in a shader.
type ShaderStruct = (u32, Vec<(String, u32)>);

/// All structs of all stages with all effects.
fn shader_structs() -> BTreeMap<String, ShaderStruct> {
    let mut found: BTreeMap<String, ShaderStruct> = BTreeMap::new();
    let block = Features { regions: true, ..scene(true, true) };
    let every = EffectSet { own: vec![swelling::SWELLING.chosen()], ..effect_set(|_| true) };
    let free = Features { free_path: true, ..block.clone() };
    let bore = Features { bore: true, ..block.clone() };
    let slit = Features { slit: true, ..block.clone() };
    let opening = Features { opening: true, ..block.clone() };
    for r in [block, free, bore, slit, opening, tetrahedra(true, true)]
        .iter()
        .flat_map(|features| reflected(&every, features))
    {
        for (_, ty) in r.module.types.iter() {
            let (naga::TypeInner::Struct { members, span }, Some(name)) = (&ty.inner, &ty.name) else {
                continue;
            };
            let members = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect();
            let this: ShaderStruct = (*span, members);
            let known = found.entry(name.clone()).or_insert(this.clone());
            assert_eq!(*known, this, "struct {name} differs between stages");
        }
    }
    found
}

/// Differences between a host struct and its shader struct, one sentence each.
fn layout_differences(name: &str, size: usize, fields: &[(&str, usize)], shader: Option<&ShaderStruct>) -> Vec<String> {
    let Some((span, members)) = shader else {
        return vec![format!("struct {name}: not in any shader")];
    };
    let mut wrong = Vec::new();
    if size != *span as usize {
        wrong.push(format!("struct {name}: {size} bytes on the host, {span} in the shader"));
    }
    if fields.len() != members.len() {
        wrong.push(format!("struct {name}: {} fields on the host, {} in the shader", fields.len(), members.len()));
    }
    for ((field, offset), (member, place)) in fields.iter().zip(members) {
        if field != member {
            wrong.push(format!("struct {name}: field {field} on the host is {member} in the shader"));
        } else if *offset != *place as usize {
            wrong.push(format!("struct {name}, field {field}: offset {offset} on the host, {place} in the shader"));
        }
    }
    wrong
}

#[test]
fn host_structs_lie_as_the_shaders_read_them() {
    let shader = shader_structs();
    let mut wrong = Vec::new();
    // Those that the composer writes are numbers one after the other.
    let of_tables = PARAMS.iter().map(|(name, fields)| {
        let count = fields.len().next_multiple_of(4);
        let missing = (fields.len()..count).map(|place| ["_pad0", "_pad1", "_pad2"][place - fields.len()]);
        let all = fields.iter().copied().chain(missing).enumerate();
        (*name, 4 * count, all.map(|(place, field)| (field, 4 * place)).collect())
    });
    let host: Vec<_> = layouts().into_iter().chain(of_tables).collect();
    for (name, size, fields) in &host {
        wrong.extend(layout_differences(name, *size, fields, shader.get(*name)));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Structs that live in buffers must be known to the host.
    let host: BTreeSet<&str> = host.into_iter().map(|l| l.0).collect();
    let local = [
        "BesideNeedle",
        "CellEnergy",
        "CellModes",
        "OpenedPlace",
        "OpenedStress",
        "OpeningDerivatives",
        "PathSection",
        "IsochoricFactors",
        "Measure",
        "AnchorPlace",
        "StraightColumn",
        "BentColumn",
        "Bend",
        "GridPlace",
        "MaterialPlace",
        "FreeTouch",
        "PlannedTouch",
        "StraightAxis",
        "BentAxis",
        "SurfaceTouch",
        "Spreading",
        "Pressing",
        "Contact",
        "Memory",
        "StepSums",
        "Overlap",
        "SlitForce",
        "PointForce",
        "Slopes",
        "IsochoricStress",
        "PointPlace",
        "PointAnswer",
        "PointEnergy",
        "PointStress",
        "DrawnCell",
        "Eigen",
        "PlasticAnswer",
        "MandelStress",
        "FibreStress",
        "Relaxation",
        "NodePlace",
        "MeasuredCell",
        "OwnPoint",
        "OwnStress",
        "TornContact",
        "Dilated",
    ];
    for name in shader.keys().filter(|n| !local.contains(&n.as_str())) {
        assert!(host.contains(name.as_str()), "struct {name} of the shaders is unknown to the host");
    }
}

#[test]
fn a_wrong_layout_is_found_and_named() {
    let shader = shader_structs();
    let all = layouts();
    let (name, size, fields) = all.iter().find(|l| l.0 == "CellEdge").unwrap();
    assert!(layout_differences(name, *size, fields, shader.get(*name)).is_empty());
    let mut shifted = fields.clone();
    shifted[2].1 += 4;
    let wrong = layout_differences(name, *size, &shifted, shader.get(*name));
    assert_eq!(wrong, ["struct CellEdge, field quarter_inverse: offset 12 on the host, 8 in the shader"]);
    let wrong = layout_differences(name, *size + 16, fields, shader.get(*name));
    assert_eq!(wrong, ["struct CellEdge: 32 bytes on the host, 16 in the shader"]);
    let mut renamed = fields.clone();
    renamed.swap(0, 1);
    assert!(layout_differences(name, *size, &renamed, shader.get(*name))[0].contains("cube_root"));
}

/// Words that would betray an effect, by its key.
const TRACES: [(&str, &[&str]); 12] = [
    ("mass_scaling", &["mass_scaling", "stable_mass", "selective"]),
    ("gravity", &["gravity", "free fall"]),
    ("plasticity", &["yield", "hardening", "flow_plastically", "mandel"]),
    ("fibres", &["fibre_", "i4bar", "fibres["]),
    ("viscoelastic", &["visc", "prony[", "relax("]),
    ("damage", &["degradation(", "damage["]),
    ("cohesive", &["cohesive", "pair_state", "separation_sums"]),
    ("puncture", &["puncture", "tip_", "needle", "soften", "remaining"]),
    ("adhesion", &["adhesion"]),
    ("indentation", &["indent", "punch"]),
    ("friction", &["friction", "stick_", "coulomb"]),
    ("flexible_needle", &["centre_line", "bend", "needle_loads"]),
];

/// Lower-case source and binding names of all stages of a set.
fn text_of(set: &EffectSet, features: &Features) -> Vec<(&'static str, String)> {
    let names = |r: &Reflected| r.bindings.iter().map(|b| b.name.clone()).collect::<Vec<_>>().join(" ");
    reflected(set, features)
        .iter()
        .map(|r| (r.stage.name(), format!("{}\n{}", r.composed.source, names(r)).to_lowercase()))
        .collect()
}

#[test]
fn without_effects_the_shaders_know_nothing_of_them() {
    let none = effect_set(|_| false);
    for features in scenes() {
        for (stage, text) in text_of(&none, &features) {
            for word in [
                "contact", "friction", "cutting", "puncture", "needle", "tip", "stick", "indent", "plastic", "fibre",
                "visc",
            ] {
                // The one struct of a step's input serves all scenes that have one; it alone may speak of a tool.
                let mut lines = text.lines().filter(|l| l.contains(word));
                let found =
                    lines.find(|l| !(features.driven_faces | features.loaded_faces && step_input_lines().contains(*l)));
                assert!(found.is_none(), "{stage} {features:?}: {word:?} in {found:?}");
            }
        }
    }
}

/// Lower-case lines of shared/step_input.
fn step_input_lines() -> BTreeSet<String> {
    let (_, text) = SOURCES.iter().find(|(name, _)| *name == "shared/step_input").unwrap();
    text.lines().map(str::to_lowercase).collect()
}

#[test]
fn the_bare_stages_are_those_of_shaders_that_never_had_an_effect() {
    assert!(stylet::commands::bench_effects::off_is_absent().unwrap());
    // Not a comparison of a text with itself: with an effect on the texts differ.
    let set = effect_set(|key| key == "fibres");
    let defines = defines(&set, &scene(false, false));
    let path = "stages/element_forces";
    let without = compose_without_effects(path, &defines).unwrap();
    assert_ne!(compose(path, &defines).unwrap().source, without.source);
    assert!(!without.source.contains("fibre"));
}

#[test]
fn an_absent_effect_leaves_no_trace() {
    assert_eq!(TRACES.map(|t| t.0), EFFECTS.map(|e| e.key));
    for (effect, (key, traces)) in EFFECTS.iter().zip(&TRACES) {
        // The stages of the effect are gone, and so are its blocks in the others.
        let others = effect_set(|other| other != *key);
        for (stage, text) in [scene(true, true), tetrahedra(true, true)].iter().flat_map(|f| text_of(&others, f)) {
            for word in *traces {
                let shared = ["shared/step_input", "shared/contact_node"];
                let known: BTreeSet<String> = SOURCES
                    .iter()
                    .filter(|(name, _)| shared.contains(name))
                    .flat_map(|(_, text)| text.lines().map(str::to_lowercase))
                    .collect();
                let mut lines = text.lines().filter(|l| l.contains(word));
                let found = lines.find(|l| !known.contains(*l));
                assert!(found.is_none(), "{stage} without {key}: {word:?} in {found:?}");
            }
        }
        // Not a vacuous search: with the effect alone (or with a tool, for those that need one) the words are there.
        let needs_tool = effect.kind == Kind::Tool;
        let present = effect_set(|other| other == *key || (needs_tool && other == "puncture"));
        let all: String = text_of(&present, &scene(false, false)).into_iter().map(|t| t.1).collect();
        assert!(traces.iter().any(|word| all.contains(word)), "{key}: none of {traces:?} with it");
    }
}

#[test]
fn every_file_and_every_define_is_used() {
    let mut used = BTreeSet::new();
    for (_, r) in everything() {
        used.extend(r.composed.origin.iter().map(|o| o.0));
    }
    for (name, text) in SOURCES {
        assert!(used.contains(name), "shaders/{name}.wgsl is in no stage");
        let path = format!("{}/shaders/{name}.wgsl", env!("CARGO_MANIFEST_DIR"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), *text, "{path}");
    }
    for define in SCENE_DEFINES.into_iter().chain(EFFECTS.iter().map(|e| e.define)) {
        let test = |text: &str| text.lines().any(|l| l.trim() == format!("#ifdef {define}"));
        let stage_of_its_own = ["INDENTATION"];
        assert!(SOURCES.iter().any(|s| test(s.1)) || stage_of_its_own.contains(&define), "no shader asks for {define}");
    }
}

/// Blocks that stand before one of an effect that is earlier in the table: file, effect, and why.
const OUT_OF_ORDER: [(&str, &str, &str); 2] = [
    ("stages/measure_contact", "FLEXIBLE_NEEDLE", "shares the impulses of the nodes before they are cleared"),
    ("stages/measure_dilatation", "DAMAGE", "holds the block of plasticity, whose strain it needs"),
];

#[test]
fn an_effect_has_at_most_one_block_per_stage_in_the_order_of_the_table() {
    // What effects do in a stage, and in the material point of both elements: their order is physics.
    let has_order = |name: &str| name.starts_with("stages/") || name == "shared/material_point";
    let mut blocks = 0;
    let mut excused = BTreeSet::new();
    for (name, text) in SOURCES.iter().filter(|s| has_order(s.0)) {
        let mut last = 0;
        // Imports stand at the top of a file, blocks of code in its functions.
        let body = text.split("fn ").skip(1).collect::<Vec<_>>().join("fn ");
        for line in body.lines().filter_map(|l| l.trim().strip_prefix("#ifdef ")) {
            let Some(place) = EFFECTS.iter().position(|e| e.define == line) else {
                continue;
            };
            assert!(place >= last, "{name}: the block of {line} comes out of order");
            blocks += 1;
            match OUT_OF_ORDER.iter().find(|o| (o.0, o.1) == (name, line)) {
                Some((_, _, why)) => excused.extend([(*name, *why)]),
                None => last = place,
            }
        }
        for effect in &EFFECTS {
            let count = body.lines().filter(|l| l.trim() == format!("#ifdef {}", effect.define)).count();
            assert!(count <= 1, "{name}: {count} blocks of {}", effect.key);
        }
    }
    assert_eq!(excused.len(), OUT_OF_ORDER.len(), "an exception that nothing needs: {excused:?}");
    println!("{blocks} blocks of effects");
}

#[test]
fn tools_leave_no_trace_in_tetrahedra() {
    let needs_block = |key: &str| EFFECTS.iter().any(|e| e.key == key && e.needs_block());
    let (with, without) = (effect_set(|_| true), effect_set(|key| !needs_block(key)));
    let features = tetrahedra(true, true);
    assert_eq!(stages(&with, &features), stages(&without, &features));
    assert_eq!(text_of(&with, &features), text_of(&without, &features));
    assert!(!stages(&with, &features).contains(&Stage::ElementForces));
    assert!(!stages(&with, &scene(true, true)).contains(&Stage::TetrahedronForces));
}

#[test]
fn every_stage_has_a_file_and_every_file_a_stage() {
    let files: Vec<&str> = SOURCES.iter().filter_map(|s| s.0.strip_prefix("stages/")).collect();
    let mut names: Vec<&str> = Stage::ALL.iter().map(|s| s.name()).collect();
    names.sort_unstable();
    assert_eq!(files, names);
}

#[test]
fn a_broken_stage_names_file_and_line() {
    // The needle's stage without its effect lacks nothing that the composer sees, but the tip stage of a scene
    // without a define still imports what it needs; a line of a shared file must map back to that file.
    let set = effect_set(|key| key == "puncture");
    let composed = compose("stages/needle_contact", &defines(&set, &scene(false, false))).unwrap();
    for (index, line) in composed.source.lines().enumerate() {
        let place = composed.place(index + 1);
        let (file, number) = place.strip_prefix("shaders/").unwrap().split_once(".wgsl:").unwrap();
        let text = SOURCES.iter().find(|s| s.0 == file).unwrap().1;
        let written = text.lines().nth(number.parse::<usize>().unwrap() - 1).unwrap();
        match written.strip_prefix("#const ") {
            Some(name) => assert!(line.starts_with(&format!("const {name}: f32 = ")), "{place}: {line}"),
            None => assert_eq!(written, line, "{place}"),
        }
    }
    // A define without the others that belong to it: `driven_faces` then names a step input that nobody imported.
    let error = reflect(Stage::IntegrateNodes, &Defines::from(["DRIVEN_FACES"]), false).err().unwrap().to_string();
    assert!(error.contains("shaders/shared/driven_faces.wgsl:"), "{error}");
    let line: usize = error.split("driven_faces.wgsl:").nth(1).unwrap().split('\n').next().unwrap().parse().unwrap();
    let text = SOURCES.iter().find(|s| s.0 == "shared/driven_faces").unwrap().1;
    assert!(text.lines().nth(line - 1).unwrap().contains("step_input"), "line {line} of driven_faces: {error}");
}

/// The shaders that draw: they are no stages.
const DRAWING: [(&str, &str); 4] = [
    ("render/stress_picture", include_str!("../../shaders/render/stress_picture.wgsl")),
    (
        "render/tissue",
        concat!(
            include_str!("../../shaders/shared/needle_in_tissue.wgsl"),
            include_str!("../../shaders/render/tissue.wgsl")
        ),
    ),
    // Where faces may part.
    (
        "render/tissue with render/parted",
        concat!(
            include_str!("../../shaders/shared/needle_in_tissue.wgsl"),
            include_str!("../../shaders/render/tissue.wgsl"),
            include_str!("../../shaders/render/parted.wgsl")
        ),
    ),
    ("render/ultrasound", include_str!("../../shaders/render/ultrasound.wgsl")),
];

#[test]
fn the_drawing_shaders_validate_and_keep_the_budget() {
    for (name, source) in DRAWING {
        let module = naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{name}: {e}"));
        let mut validator =
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
        validator.validate(&module).unwrap_or_else(|e| panic!("{name}: {}", e.into_inner()));
        let storage = |v: &naga::GlobalVariable| matches!(v.space, naga::AddressSpace::Storage { .. });
        let count = module.global_variables.iter().filter(|(_, v)| storage(v)).count();
        assert!(count <= 8, "{name}: {count} storage buffers");
    }
}
