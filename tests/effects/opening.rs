//! Scheme `opening` of the effect puncture: what it gives against the theory of the wedged crack (src/penetration), on several meshes and
//! both engines, without a calibrated number.

use std::path::Path;

use stylet::mesh::BlockMesh;
use stylet::model::Model;
use stylet::observables::FrameRecord;
use stylet::penetration::steady::{Indenter, Resistance, Steady};
use stylet::{EngineChoice, Scene, Simulation};

use crate::common::*;

/// A 16G cone in muscle across the fibres, toughness 164 J/m^2.
const INSERTION: &str = r#"
effects = ["puncture", "mass_scaling"]
[tissue]
size_mm = [20.0, 20.0, 16.0]
cell_size_mm = 1.0
growth = 1.45
[material]
preset = "across-fibre"
[needle]
gauge = "16G"
tip_half_angle_deg = 18.0
[motion]
entry_mm = [0.0, 0.0]
[[motion.phase]]
kind = "insert"
speed_mm_s = 2.0
depth_mm = 9.0
[puncture]
scheme = "opening"
[outputs]
pictures_at_depth_mm = []
fields_at_depth_mm = []
"#;

const FRICTION: &str = "effects=[\"puncture\", \"friction\", \"mass_scaling\"]";

fn scene(overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_string()).collect();
    Scene::parse(Path::new("opening.toml"), INSERTION, &overrides).unwrap()
}

/// All frames; nothing may be clamped, turned inside out, lost or created.
fn frames(scene: Scene, engine: EngineChoice) -> Vec<FrameRecord> {
    let mut simulation = Simulation::new(scene, engine).unwrap();
    let mut all = Vec::new();
    while let Some(frame) = simulation.next_frame().unwrap() {
        assert_eq!(frame.health.clamped_nodes, 0, "at {} mm", frame.depth * 1e3);
        assert_eq!(frame.health.inverted_cells, 0, "at {} mm", frame.depth * 1e3);
        all.push(frame);
    }
    assert_eq!(simulation.verdict().sentence(), None);
    all
}

fn engines_here() -> Vec<EngineChoice> {
    let mut engines = vec![EngineChoice::Cpu];
    engines.extend(gpu().map(|_| EngineChoice::Gpu));
    engines
}

fn predicted(scene: &Scene) -> Steady {
    let material = &scene.material;
    let resistance = Resistance { toughness: material.toughness.unwrap(), tear_stretch: material.tear_stretch };
    let radius = scene.needle().unwrap().radius;
    Steady::new(&material.law.isochoric, resistance, radius, Indenter::Pointed).unwrap()
}

/// The same slit in tissue that changes its volume as that of the scene: force of the tip [N], normal force per length of shaft [N/m].
fn with_change_of_volume(scene: &Scene) -> (f64, f64) {
    predicted(scene).with_change_of_volume(&scene.material.law).unwrap()
}

/// Mean over the depths from `from` to `to` [m] of the first phase.
fn mean(frames: &[FrameRecord], from: f64, to: f64, of: impl Fn(&FrameRecord) -> f64) -> f64 {
    let within = || frames.iter().filter(|f| f.phase == 0 && f.depth > from && f.depth <= to);
    within().map(&of).sum::<f64>() / within().count() as f64
}

/// Slope over depth of the same.
fn slope(frames: &[FrameRecord], from: f64, to: f64, of: impl Fn(&FrameRecord) -> f64) -> f64 {
    let (x, y) = (mean(frames, from, to, |f| f.depth), mean(frames, from, to, &of));
    mean(frames, from, to, |f| (f.depth - x) * (of(f) - y)) / mean(frames, from, to, |f| (f.depth - x).powi(2))
}

/// Largest less smallest axial force of these depths, without the slope over them [N]: sections of the path come and go one after the other.
fn ripple(frames: &[FrameRecord], from: f64, to: f64) -> f64 {
    let rise = slope(frames, from, to, |f| f.force.axial);
    let within = frames.iter().filter(|f| f.phase == 0 && f.depth > from && f.depth <= to);
    let (least, most) = within
        .map(|f| f.force.axial - rise * f.depth)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), f| (a.min(f), b.max(f)));
    most - least
}

#[test]
fn a_tip_without_friction_meets_the_force_of_the_theory_wherever_the_axis_lies() {
    // The theory of tissue that changes its volume, as this one does (nu 0.473): 4.3 % less than that of tissue that keeps it.
    let expected = with_change_of_volume(&scene(&[])).0;
    let mut forces = Vec::new();
    // Cell edge, place of the axis in a cell.
    for (cell, axis) in [("1.0", "[0.0,0.0]"), ("1.0", "[0.5,0.5]"), ("0.8", "[0.25,0.25]")] {
        let overrides = [format!("tissue.cell_size_mm={cell}"), format!("tissue.axis_offset_cells={axis}")];
        let frames = frames(scene(&overrides.each_ref().map(String::as_str)), engines_here().pop().unwrap());
        let force = mean(&frames, 7e-3, 8.9e-3, |f| f.force.axial);
        let imbalance = frames.iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max);
        println!("cells {cell} mm, axis {axis}: {force:.4} N, theory {expected:.4} N, imbalance {imbalance:.2e}");
        close("steady force", force, expected, 0.02);
        at_most("imbalance", imbalance, 0.01);
        at_most("ripple", ripple(&frames, 7e-3, 8.9e-3) / force, 0.05);
        forces.push(force);
    }
    let (least, most) = forces.iter().fold((f64::MAX, 0.0f64), |(a, b), f| (a.min(*f), b.max(*f)));
    at_most("spread over meshes", most / least - 1.0, 0.02);
}

/// Tissue that keeps its volume, as the theory of the wedged crack has it.
#[test]
fn tissue_that_keeps_its_volume_meets_the_theory_that_keeps_it_wherever_the_axis_lies() {
    for (cell, axis) in [("1.0", "[0.0,0.0]"), ("1.0", "[0.5,0.5]"), ("0.8", "[0.25,0.25]")] {
        let overrides = [format!("tissue.cell_size_mm={cell}"), format!("tissue.axis_offset_cells={axis}")];
        let [cell, axis] = overrides.each_ref().map(String::as_str);
        let scene = scene(&[cell, axis, "material.poisson_ratio=0.498"]);
        let expected = predicted(&scene).tip_force;
        let frames = frames(scene, EngineChoice::Cpu);
        close("steady force", mean(&frames, 7e-3, 8.9e-3, |f| f.force.axial), expected, 0.03);
    }
}

/// There a volume once grew without bound, and the run was stopped.
#[test]
fn an_axis_through_the_places_where_volumes_are_taken_is_as_any_other() {
    let [beside, through] = ["[0.0,0.0]", "[0.2113,0.2113]"].map(|axis| {
        let frames = frames(scene(&[&format!("tissue.axis_offset_cells={axis}")]), EngineChoice::Cpu);
        at_most("imbalance", frames.iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max), 0.01);
        mean(&frames, 7e-3, 8.9e-3, |f| f.force.axial)
    });
    close("steady force", through, beside, 0.02);
}

#[test]
fn friction_grows_with_the_normal_force_of_the_theory_and_turns_round_on_the_way_out() {
    let withdrawal = "motion.phase=[{kind=\"insert\", speed_mm_s=2.0, depth_mm=11.0}, {kind=\"withdraw\", speed_mm_s=2.0, depth_mm=6.0}]";
    let scene = scene(&[FRICTION, withdrawal]);
    let expected = 0.3 * with_change_of_volume(&scene).1;
    let frames = frames(scene, engines_here().pop().unwrap());
    let found = slope(&frames, 8e-3, 10.9e-3, |f| f.force.friction);
    // Drag stretches the tissue along the shaft, which plane strain does not have: without it the next test has 2 %.
    close("slope of the friction", found, expected, 0.06);
    let out = frames.iter().map(|f| f.force.friction).fold(0.0, f64::min);
    let all_in = frames.iter().map(|f| f.force.friction).fold(0.0, f64::max);
    println!("slope {found:.1} N/m, theory {expected:.1} N/m; friction {all_in:.3} N in, {out:.3} N out");
    // Nothing holds the cone; over the reversal a few millimetres of the way back go.
    assert!(out < -0.5 * all_in, "{out} N on the way out, {all_in} N on the way in");
}

#[test]
fn the_normal_force_on_the_shaft_is_that_of_the_theory_on_every_mesh() {
    // Too little friction to drag the tissue along.
    let mut found = Vec::new();
    for (cell, toughness) in [("1.0", "164"), ("0.8", "164"), ("1.0", "400")] {
        let (cell, toughness) = (format!("tissue.cell_size_mm={cell}"), format!("material.toughness_j_m2={toughness}"));
        let overrides = [FRICTION, "friction.coefficient=0.001", &cell, &toughness, "motion.phase.0.depth_mm=10.5"];
        let scene = scene(&overrides);
        let expected = with_change_of_volume(&scene).1;
        let frames = frames(scene, EngineChoice::Cpu);
        let normal = slope(&frames, 8e-3, 10.4e-3, |f| f.force.shaft_normal);
        println!("{cell}, {toughness}: {normal:.1} N/m, theory {expected:.1} N/m");
        close("normal force per length", normal, expected, 0.03);
        found.push(normal);
    }
    close("normal force on another mesh", found[1], found[0], 0.03);
}

#[test]
fn friction_is_the_coefficient_times_the_normal_forces() {
    let frames = frames(scene(&[FRICTION, "motion.phase.0.depth_mm=9.5"]), engines_here().pop().unwrap());
    let [rubbing, normal] = [|f: &FrameRecord| f.force.friction, |f: &FrameRecord| f.force.shaft_normal]
        .map(|of| mean(&frames, 8e-3, 9.4e-3, of));
    println!("friction {rubbing:.4} N, normal forces {normal:.4} N in all");
    close("friction", rubbing, 0.3 * normal, 0.005);
}

#[test]
fn the_puncture_is_the_same_on_every_mesh() {
    let expected = predicted(&scene(&[])).puncture_force;
    let mut depths = Vec::new();
    for cell in ["1.0", "0.6"] {
        let cell = format!("tissue.cell_size_mm={cell}");
        let frames = frames(scene(&[&cell, "motion.phase.0.depth_mm=5.0"]), engines_here().pop().unwrap());
        let at = frames.iter().position(|f| f.tip_coordinate > 0.0).expect("a puncture");
        let largest = frames.iter().map(|f| f.force.axial).fold(0.0, f64::max);
        let early = mean(&frames, 1.9e-3, 2.1e-3, |f| f.force.axial);
        println!("{cell}: {early:.4} N at 2 mm, puncture {largest:.4} N at {:.3} mm", frames[at].depth * 1e3);
        close("puncture force", largest, expected, 0.03);
        depths.push((frames[at].depth, early));
    }
    close("depth of the puncture on the coarser mesh", depths[0].0, depths[1].0, 0.03);
    close("force at 2 mm on the coarser mesh", depths[0].1, depths[1].1, 0.02);
}

#[test]
fn both_engines_give_the_same_force() {
    if gpu().is_none() {
        return;
    }
    let overrides = [FRICTION, "tissue.size_mm=[14.0,14.0,9.0]", "motion.phase.0.depth_mm=6.5"];
    let [cpu, gpu] = [EngineChoice::Cpu, EngineChoice::Gpu].map(|engine| frames(scene(&overrides), engine));
    let largest = cpu.iter().map(|f| f.force.axial).fold(0.0, f64::max);
    // The crack starts in the step in which the force passes its threshold: rounding may shift that by one, and with it the drop, which takes
    // a hundredth of the peak per step. Where the tip goes with the needle nothing is left of that.
    let runs =
        |i: usize| i > 0 && cpu[i].tip_coordinate - cpu[i - 1].tip_coordinate > 2.0 * (cpu[i].depth - cpu[i - 1].depth);
    let (mut slow, mut fast) = (0.0_f64, 0.0_f64);
    for (i, (a, b)) in cpu.iter().zip(&gpu).enumerate() {
        let apart = (a.force.axial - b.force.axial).abs() / largest;
        let near_the_run = (i.saturating_sub(3)..=(i + 2).min(cpu.len() - 1)).any(runs);
        *(if near_the_run { &mut fast } else { &mut slow }) = apart.max(if near_the_run { fast } else { slow });
    }
    println!("apart by {slow:.2e} of the peak of {largest:.3} N, {fast:.2e} while the crack runs");
    at_most("difference of the engines", slow, 1e-3);
    at_most("difference of the engines while the crack runs", fast, 0.02);
    close("elastic energy", gpu.last().unwrap().energy.elastic, cpu.last().unwrap().energy.elastic, 1e-3);
}

#[test]
fn a_tougher_tissue_is_cut_narrower_and_holds_the_needle_harder() {
    // Narrow slits stretch the tissue beside them so far that even at a Poisson's ratio of 0.498 it grows: 2.6 % less force at 400 J/m^2.
    for toughness in ["100", "400"] {
        let material = "material={c10_kpa=9.52, c01_kpa=4.14, poisson_ratio=0.498, toughness_j_m2=";
        let scene = scene(&[&format!("{material}{toughness}}}"), "motion.phase.0.depth_mm=10.5"]);
        let (expected, _) = with_change_of_volume(&scene);
        let frames = frames(scene, engines_here().pop().unwrap());
        let force = mean(&frames, 8.5e-3, 10.4e-3, |f| f.force.axial);
        println!("{toughness} J/m^2: {force:.4} N, theory {expected:.4} N");
        close("steady force", force, expected, 0.02);
    }
}

#[test]
fn twice_the_size_takes_four_times_the_force() {
    // Lengths, speed and toughness times two: every strain is the same.
    let twice = [
        "tissue.size_mm=[40.0,40.0,32.0]",
        "tissue.cell_size_mm=2.0",
        "needle.outer_diameter_mm=3.302",
        "motion.phase.0.depth_mm=18.0",
        "motion.phase.0.speed_mm_s=4.0",
        "material.toughness_j_m2=328",
        "puncture.tip_stiffness_n_mm=4.0",
    ];
    let force = |overrides: &[&str], scale: f64| {
        let text = INSERTION.replace("gauge = \"16G\"", "outer_diameter_mm = 1.651");
        let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_string()).collect();
        let scene = Scene::parse(Path::new("opening.toml"), &text, &overrides).unwrap();
        let frames = frames(scene, engines_here().pop().unwrap());
        mean(&frames, 7e-3 * scale, 8.9e-3 * scale, |f| f.force.axial)
    };
    let (one, two) = (force(&[], 1.0), force(&twice, 2.0));
    println!("{one:.4} N, {two:.4} N");
    close("four times the force", two, 4.0 * one, 0.01);
}

#[test]
fn an_oblique_needle_meets_the_same_force() {
    let oblique = scene(&[
        "tissue.size_mm=[26.0,18.0,14.0]",
        "motion.entry_mm=[-3.0,0.0]",
        "motion.direction=[0.7071,0.0,-0.7071]",
        "motion.phase.0.depth_mm=10.0",
    ]);
    let expected = with_change_of_volume(&oblique).0;
    let frames = frames(oblique, engines_here().pop().unwrap());
    let force = mean(&frames, 7.5e-3, 9.9e-3, |f| f.force.axial);
    println!("45 degrees: {force:.4} N, theory {expected:.4} N");
    close("steady force", force, expected, 0.03);
}

#[test]
fn a_track_that_is_there_needs_no_cutting() {
    let phases = "motion.phase=[{kind=\"insert\", speed_mm_s=4.0, depth_mm=8.0}, {kind=\"withdraw\", speed_mm_s=4.0, depth_mm=4.0}, \
                  {kind=\"insert\", speed_mm_s=4.0, depth_mm=9.5}]";
    let scene = scene(&[phases]);
    let steady = predicted(&scene);
    let frames = frames(scene, engines_here().pop().unwrap());
    let again = |from: f64, to: f64, of: &dyn Fn(&FrameRecord) -> f64| {
        let within: Vec<f64> =
            frames.iter().filter(|f| f.phase == 2 && f.depth > from && f.depth < to).map(of).collect();
        within.iter().sum::<f64>() / within.len() as f64
    };
    let cutting = again(5.5e-3, 7e-3, &|f| f.force.cutting);
    println!("in the track {cutting:.5} N, beyond it {:.4} N", again(8.8e-3, 9.4e-3, &|f| f.force.cutting));
    at_most("cutting in the track, of that of new tissue", cutting.abs() / steady.cutting_force, 0.01);
    close("cutting beyond it", again(8.8e-3, 9.4e-3, &|f| f.force.cutting), steady.cutting_force, 0.03);
}

#[test]
fn an_inner_layer_is_cut_by_the_crack_that_is_there() {
    let deep = "region=[{name=\"deep\", layer_mm=[8.0, 16.0], \
                material={c10_kpa=5.0, c01_kpa=2.0, poisson_ratio=0.47, toughness_j_m2=300}}]";
    let scene = scene(&[deep, "motion.phase.0.depth_mm=12.5"]);
    let frames = frames(scene, engines_here().pop().unwrap());
    let [above, below] = [(7.0e-3, 7.9e-3), (10.5e-3, 12.4e-3)].map(|(a, b)| mean(&frames, a, b, |f| f.force.cutting));
    let largest = frames.iter().filter(|f| f.tip_coordinate > 7e-3).map(|f| f.force.cutting).fold(0.0, f64::max);
    println!("cutting {above:.4} N above, {below:.4} N below, {largest:.4} N at the most between");
    assert!(largest < 1.05 * above.max(below), "{largest} N at the border");
}

/// The material of the rest, where there is no rest: with the springs of muscle in lung, a hundredth as stiff, 2.6 % of the work was lost.
#[test]
fn a_material_that_the_path_does_not_meet_does_not_act() {
    let lung = "{preset=\"lung\", toughness_j_m2=1.7, density_kg_m3=1060}";
    let short = ["motion.phase.0.depth_mm=7.0", "motion.phase.0.speed_mm_s=5.0", "solver.mass_scaling=50", FRICTION];
    let run = |tissue: &str| {
        let mut overrides = vec![tissue];
        overrides.extend(short);
        frames(scene(&overrides), EngineChoice::Cpu)
    };
    let own = run(&format!("material={lung}"));
    let covered = run(&format!("region=[{{name=\"lung\", layer_mm=[0.0, 16.0], material={lung}}}]"));
    let peak = own.iter().map(|f| f.force.axial).fold(0.0, f64::max);
    let imbalance = covered.iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max);
    assert_eq!(own.len(), covered.len());
    assert!(covered.last().unwrap().tip_coordinate > 4e-3);
    let apart = own.iter().zip(&covered).map(|(a, b)| (a.force.axial - b.force.axial).abs()).fold(0.0, f64::max);
    at_most("difference of the force over its peak", apart / peak, 1e-6);
    at_most("imbalance", imbalance, 0.002);
}

/// Around a narrow slit tissue changes its volume: the force is below that of the theory without, by 15 % at 400 J/m^2, and meets the one
/// that knows it. With a map that kept the volume near the path cells of 1 mm were 9 % off there.
#[test]
fn tissue_that_gives_way_meets_the_theory_of_its_volume() {
    let material = "material={c10_kpa=8.0, c01_kpa=2.35, poisson_ratio=0.45, toughness_j_m2=";
    for (toughness, cell) in [("76", "1.0"), ("164", "0.8"), ("400", "1.0")] {
        let cell = format!("tissue.cell_size_mm={cell}");
        let size = "tissue.size_mm=[24.0, 24.0, 16.0]";
        let scene = scene(&[&format!("{material}{toughness}}}"), &cell, size, "motion.phase.0.depth_mm=10.5"]);
        let theory = predicted(&scene);
        let expected = with_change_of_volume(&scene).0;
        assert!(expected < 0.975 * theory.tip_force, "{expected} of {}", theory.tip_force);
        let frames = frames(scene, engines_here().pop().unwrap());
        let force = mean(&frames, 8e-3, 10.4e-3, |f| f.force.axial);
        println!(
            "{toughness} J/m^2: {force:.4} N, theory {expected:.4} N, without change of volume {:.4} N",
            theory.tip_force
        );
        close("steady force", force, expected, 0.025);
    }
}

#[test]
fn a_law_that_stiffens_meets_the_force_of_its_own_curve() {
    let material =
        "material={law=\"yeoh\", c10_kpa=10.0, c20_kpa=4.0, c30_kpa=0.0, poisson_ratio=0.47, toughness_j_m2=164}";
    let scene = scene(&[material, "motion.phase.0.depth_mm=11.0"]);
    let expected = with_change_of_volume(&scene).0;
    let frames = frames(scene, engines_here().pop().unwrap());
    let force = mean(&frames, 9e-3, 10.9e-3, |f| f.force.axial);
    println!("Yeoh: {force:.4} N, theory {expected:.4} N");
    close("steady force", force, expected, 0.03);
}

#[test]
fn a_bevel_is_pushed_aside_and_a_flexible_one_gives_way() {
    // The apex of a bevel lies at +x of its shaft, which pushes the tissue of the path towards -x: the tissue pushes back.
    let bevel = "needle={gauge=\"18G\", bevel_angle_deg=20.0}";
    let flexible = "effects=[\"puncture\", \"mass_scaling\", \"flexible_needle\"]";
    let run = |overrides: &[&str], engine: EngineChoice| {
        let depth = "motion.phase.0.depth_mm=8.0";
        let mut simulation = Simulation::new(scene(&[&[bevel, depth], overrides].concat()), engine).unwrap();
        let mut all = Vec::new();
        while let Some(frame) = simulation.next_frame().unwrap() {
            all.push(frame);
        }
        all
    };
    let rigid = engines_here().into_iter().map(|engine| run(&[], engine)).collect::<Vec<_>>();
    let bent = engines_here()
        .into_iter()
        .map(|engine| run(&[flexible, "flexible_needle.free_length_mm=60.0"], engine))
        .collect::<Vec<_>>();
    for runs in [&rigid, &bent] {
        for other in &runs[1..] {
            close("lateral force of the engines", last(other).force.lateral.x, last(&runs[0]).force.lateral.x, 1e-2);
            close("axial force of the engines", last(other).force.axial, last(&runs[0]).force.axial, 1e-2);
        }
    }
    let [stiff, soft] = [&rigid[0], &bent[0]].map(|frames| last(frames));
    let offset = soft.needle.tip_offset.x;
    println!(
        "lateral {:.3} N rigid, {:.3} N flexible, tip {:.3} mm aside",
        stiff.force.lateral.x,
        soft.force.lateral.x,
        offset * 1e3
    );
    assert!(stiff.force.lateral.x < -0.2, "{}", stiff.force.lateral.x);
    assert!(soft.force.lateral.x.abs() < 0.5 * stiff.force.lateral.x.abs());
    assert!(offset > 0.2e-3, "{offset}");
    let imbalance = rigid[0].iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max);
    at_most("imbalance of the rigid one", imbalance, 0.01);
    // Loads of a frame reach the beam in the next one.
    let imbalance = bent[0].iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max);
    at_most("imbalance of the flexible one", imbalance, 0.03);
}

fn last(frames: &[FrameRecord]) -> &FrameRecord {
    frames.last().unwrap()
}

#[test]
fn a_membrane_costs_its_energy_where_it_lies() {
    let capsule = "region=[{name=\"capsule\", layer_mm=[7.5, 8.5], material={preset=\"across-fibre\"}, \
                   membrane={puncture_energy_mj=0.08}}]";
    let run = |overrides: &[&str]| frames(scene(overrides), engines_here().pop().unwrap());
    let depth = "motion.phase.0.depth_mm=10.0";
    let (with, without) = (run(&[depth, capsule]), run(&[depth]));
    let cutting = |frames: &[FrameRecord]| last(frames).energy.cutting;
    let first = with.iter().find(|f| f.force.membrane > 0.0).expect("the tip meets the membrane");
    println!("{:.4} mJ more, met at {:.3} mm", (cutting(&with) - cutting(&without)) * 1e3, first.tip_coordinate * 1e3);
    close("energy of the membrane", cutting(&with) - cutting(&without), 0.08e-3, 0.1);
    close("material depth of the membrane", first.tip_coordinate, 7.5e-3, 0.1 / 7.5);
}

/// On the surface a membrane adds its energy to what the surface takes by itself, so that it never gives way sooner.
#[test]
fn a_membrane_on_the_surface_adds_to_what_the_surface_takes() {
    let plan = |membrane: &str| {
        let skin =
            format!("region=[{{name=\"skin\", layer_mm=[0.0, 1.0], material={{preset=\"across-fibre\"}}{membrane}}}]");
        let scene = scene(&[&skin]);
        let mesh = BlockMesh::for_scene(&scene);
        Model::new(scene, mesh).puncture.unwrap()
    };
    let energy = 0.05e-3;
    let (with, without) = (plan(", membrane={puncture_energy_mj=0.05}"), plan(""));
    let length = with.params.transition_length;
    // 2 W/l more at the surface.
    close("puncture force", with.threshold(0.0) - without.threshold(0.0), 2.0 * energy / length, 1e-6);
    let steps = 100_000;
    let step = length / f64::from(steps);
    let beyond = |i: i32| (with.threshold(step * f64::from(i)) - without.threshold(step * f64::from(i))) * step;
    close("energy of the membrane", (0..steps).map(beyond).sum(), energy, 1e-3);
    let marked: Vec<f64> = with.segments.iter().filter(|s| s.membrane).map(|s| s.start).collect();
    assert_eq!((marked.len(), marked[0]), (2, 0.0));
}

/// A crack runs ahead of the needle in soft tissue whose mass is scaled: the force does not grow beyond that of the puncture, and falls.
#[test]
fn the_force_falls_behind_the_puncture_of_soft_tissue() {
    let soft = "material={youngs_modulus_kpa=30.0, poisson_ratio=0.45, toughness_j_m2=164.0}";
    let needle = ["needle.gauge=\"20G\"", "needle.tip_half_angle_deg=12.0", "motion.phase.0.speed_mm_s=5.0"];
    let all = [&[soft, "tissue.cell_size_mm=0.8", "solver.mass_scaling=4000"][..], &needle].concat();
    let surface = predicted(&scene(&all)).puncture_force;
    for engine in engines_here() {
        let found = frames(scene(&all), engine);
        let peak = found.iter().max_by(|a, b| a.force.axial.total_cmp(&b.force.axial)).unwrap();
        let behind = found.iter().find(|f| f.depth > peak.depth + 2e-3).unwrap();
        println!(
            "{engine:?}: {:.3} N at {:.2} mm, then {:.3} N",
            peak.force.axial,
            peak.depth * 1e3,
            behind.force.axial
        );
        close("largest force", peak.force.axial, surface, 0.1);
        at_most("part of it 2 mm behind", behind.force.axial / peak.force.axial, 0.5);
        // As soon as there is work to compare with.
        let pressed = found.iter().filter(|f| f.depth > 1e-3);
        at_most("imbalance", pressed.map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max), 0.01);
    }
}

/// Elastic constants of the preset of [`INSERTION`] by `factor`, the bulk modulus as it is.
fn shear_times(factor: f64) -> String {
    let (c10, c01, toughness) = (9.52 * factor, 4.14 * factor, 164.0 * factor);
    format!(
        "material={{c10_kpa={c10}, c01_kpa={c01}, d_per_mpa=4.0, density_kg_m3=1060.0, toughness_j_m2={toughness}}}"
    )
}

const RELAXING: &str = "effects=[\"puncture\", \"friction\", \"viscoelastic\", \"mass_scaling\"]";
/// So little that no tissue is dragged along.
const SMOOTH: &str = "friction.coefficient=0.001";

fn then_hold(seconds: f64) -> String {
    format!(
        "motion.phase=[{{kind=\"insert\", speed_mm_s=10.0, depth_mm=7.0}}, {{kind=\"hold\", duration_s={seconds}}}, \
         {{kind=\"withdraw\", speed_mm_s=10.0, depth_mm=0.0}}]"
    )
}

/// Whatever the way there: with half of its modulus left, and the same slit, tissue presses on the shaft as one of half the modulus does.
#[test]
fn relaxed_tissue_holds_the_needle_as_tissue_of_the_lasting_modulus() {
    let hold = then_hold(0.5);
    let held = |frames: &[FrameRecord]| frames.iter().rev().find(|f| f.phase == 1).unwrap().force.shaft_normal;
    let quick = ["viscoelastic.g=[0.3, 0.2]", "viscoelastic.tau_s=[0.02, 0.05]"];
    let relaxing = scene(&[RELAXING, quick[0], quick[1], SMOOTH, &hold, &shear_times(1.0)]);
    let soft = scene(&[FRICTION, SMOOTH, &hold, &shear_times(0.5)]);
    let relaxing = frames(relaxing, engines_here().pop().unwrap());
    let soft = frames(soft, EngineChoice::Cpu);
    println!("{:.4} N, {:.4} N with half of the modulus", held(&relaxing), held(&soft));
    close("normal force on the shaft", held(&relaxing), held(&soft), 0.025);
    let imbalance = relaxing.iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max);
    at_most("imbalance", imbalance, 2e-3);
}

/// While a needle is held nothing but time acts on the shape; the part of the force that comes from the volume does not change.
#[test]
fn the_force_on_a_held_shaft_falls_with_the_time_of_the_series() {
    let tau = 0.4;
    let [g, times] = ["viscoelastic.g=[0.4]".to_string(), format!("viscoelastic.tau_s=[{tau}]")];
    let scene = scene(&[RELAXING, &g, &times, &then_hold(2.0 * tau + 0.1)]);
    let all = frames(scene, EngineChoice::Cpu);
    let begin = all.iter().find(|f| f.phase == 1).unwrap().time + 0.05;
    let at = |time: f64| all.iter().find(|f| f.time >= time).unwrap();
    let [first, second, third] = [0.0, tau, 2.0 * tau].map(|t| at(begin + t));
    let normal = |f: &FrameRecord| f.force.shaft_normal;
    let fallen = (normal(first) - normal(second)) / (normal(second) - normal(third));
    println!("{:.4}, {:.4}, {:.4} N: {fallen:.4}", normal(first), normal(second), normal(third));
    close("ratio of what is lost in two times tau", fallen, std::f64::consts::E, 0.03);
    assert!(normal(third) < 0.8 * normal(first));
    // Friction follows, and what has relaxed is dissipated for good.
    close("friction", third.force.friction, 0.3 * normal(third), 0.01);
    let held = all.iter().filter(|f| f.phase == 1).map(|f| f.energy.viscous);
    assert!(held.clone().zip(held.skip(1)).all(|(a, b)| b >= a));
    assert!(third.energy.viscous > 1e-4);
    at_most("imbalance", all.iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max), 2e-3);
}

/// Two layers with terms of their own, in and out again.
#[test]
fn all_engines_relax_alike() {
    let deep = "region=[{name=\"deep\", layer_mm=[5.5, 9.0], material={preset=\"across-fibre\"}, viscoelastic={g=[0.1], tau_s=[0.3]}}]";
    let small = ["tissue.size_mm=[14.0,14.0,9.0]", "viscoelastic.g=[0.25, 0.15]", "viscoelastic.tau_s=[0.05, 1.0]"];
    let hold = then_hold(0.2);
    let run = |engine| frames(scene(&[RELAXING, small[0], small[1], small[2], deep, &hold]), engine);
    let oracle = run(EngineChoice::Cpu64);
    let largest = oracle.iter().map(|f| f.force.axial).fold(0.0, f64::max);
    let held = |frames: &[FrameRecord]| frames.iter().rev().find(|f| f.phase == 1).unwrap().clone();
    for engine in engines_here() {
        let found = run(engine);
        // Where no crack runs: see both_engines_give_the_same_force.
        let behind = oracle.iter().zip(&found).filter(|(a, _)| a.phase > 0);
        let apart = behind.map(|(a, b)| (a.force.axial - b.force.axial).abs() / largest).fold(0.0, f64::max);
        println!("{engine:?}: {apart:.1e} of the peak of {largest:.3} N");
        at_most("apart from f64", apart, 5e-4);
        let [a, b] = [&oracle, &found].map(|frames| held(frames).energy);
        close("dissipated by the terms", b.viscous, a.viscous, 2e-3);
        close("elastic energy", b.elastic, a.elastic, 1e-3);
    }
}

/// What is drawn and written of the tissue beside the shaft: where it lies, and its stress, against the round hole of the theory; nothing is
/// drawn within the needle.
#[test]
fn tissue_beside_the_needle_is_seen_where_it_is_and_with_its_stress() {
    for cell in ["tissue.cell_size_mm=1.0", "tissue.cell_size_mm=0.6"] {
        let mut simulation = Simulation::new(scene(&[cell]), EngineChoice::Cpu).unwrap();
        let deep = 255;
        simulation.stop_after(deep);
        let record = loop {
            let record = simulation.next_frame().unwrap().unwrap();
            if record.frame == deep {
                break record;
            }
        };
        let model = simulation.model.clone();
        let fields = simulation.snapshot(&record).unwrap();
        let (path, opening) = (fields.opened.as_ref().unwrap(), model.opening().unwrap());
        let (shaft, law) = (opening.shaft, model.scene.material.law);
        let block = model.mesh.as_block().unwrap();
        let station = &opening.stations[opening.stations.len() / 2];
        let hole = station.hole;
        let (mut farthest, mut strongest, mut ratios) = (0.0f64, 0.0f64, [(0.0, 0.0); 3]);
        for n in 0..120 {
            let (angle, depth) = (0.7 + 2.399 * f64::from(n), 3.0e-3 + 1e-3 * f64::from(n % 3));
            let r = shaft * [0.25, 0.5, 0.8, 1.2][n as usize % 4];
            let rest = glam::DVec3::new(r * angle.cos(), r * angle.sin(), -depth);
            let ([i, j, k], at) = block.locate(rest);
            let cell = block.cell_index(i, j, k);
            let (weights, _) = stylet::mesh::trilinear(at, block.cell_size(cell));
            let corners = block.cell_nodes(cell);
            let y = rest + corners.iter().zip(weights).map(|(n, w)| fields.displacement[*n] * w).sum::<glam::DVec3>();
            let seen = path.at(rest, y).unwrap();
            at_most("place with the path closed [m]", path.closed_place(rest, seen.place).distance(y), 1e-8);
            let x = (r * r + shaft * shaft - hole * hole).sqrt();
            farthest = farthest.max((seen.place.truncate().length() / x - 1.0).abs());
            if seen.weight == 1.0 {
                // Tissue that changes its volume does so around the hole.
                let j = 1.0 + (shaft * shaft - hole * hole) * station.growth.rate(r * r);
                let f = glam::DVec3::new(j * r / x, x / r, 1.0);
                let p = law.isochoric_stress(glam::DMat3::from_diagonal(f - glam::DVec3::ONE));
                let sigma = glam::DVec3::new(p.x_axis.x * f.x, p.y_axis.y * f.y, p.z_axis.z) / j;
                let theory = stylet::material::von_mises(glam::DMat3::from_diagonal(sigma));
                strongest = strongest.max((seen.von_mises / theory - 1.0).abs());
                let (sum, count) = &mut ratios[n as usize % 4];
                (*sum, *count) = (*sum + seen.von_mises / theory, *count + 1.0);
            }
        }
        println!("{cell}: {:.1} % of the place, {:.1} % of the stress", 1e2 * farthest, 1e2 * strongest);
        at_most("place beside the shaft", farthest, 0.04);
        at_most("stress beside the shaft", strongest, 0.25);
        for (sum, count) in ratios {
            close("mean stress at one distance", sum / count, 1.0, 0.06);
        }

        // Files lead to the same places; far from the path nothing is open.
        let text = stylet::output::vtu::vtu(&model.mesh, &fields, &[]);
        assert!(text.contains("Name=\"opened_displacement_m\""));
        let (mut pushed, mut far) = (0, 0);
        for (node, (seen, closed)) in fields.opened_displacement.iter().zip(&fields.displacement).enumerate() {
            let rest = model.mesh.rest_position(node);
            let r = rest.truncate().length();
            if r > 5.0 * shaft {
                far += 1;
                assert!(seen.distance(*closed) < 1e-12, "{seen} {closed}");
            } else if r > 0.1 * shaft && r < 2.0 * shaft && (3e-3..5e-3).contains(&-rest.z) {
                pushed += 1;
                let outside = (rest + *seen).truncate().length() / shaft;
                assert!(outside > 0.99, "a node {:.2} radii from the axis is seen at {outside:.3}", r / shaft);
            }
        }
        assert!(pushed > 10 && far > 200, "{pushed} {far}");

        let plane = stylet::render::slice::Plane::of_scene(&model.scene, &model.mesh, &fields);
        let slice = stylet::render::slice::cut(&model.mesh, &fields, &plane, model.scene.tissue.cell_size);
        assert!(slice.is_opened);
        let tip = plane.project(fields.tool_pose.unwrap().0);
        let mut innermost = 0.0f64;
        for t in &slice.triangles {
            let middle = (t.points[0] + t.points[1] + t.points[2]) / 3.0;
            let (behind, aside) = (middle.y - tip.y, (middle.x - tip.x).abs());
            let radius = opening.radius(behind).0;
            let inside = radius - aside;
            innermost = innermost.max(inside / shaft);
        }
        at_most("drawn within the needle, in radii", innermost, 0.1);
    }
}

/// Out again from just below the surface, where the dimple shifts a path that fibres make stiff: 17 to 23 % of the work were missing while the
/// dimple swung from step to step.
#[test]
fn stiff_fibres_beside_a_path_that_is_just_begun_keep_the_energy() {
    let phases = "motion.phase=[{kind=\"insert\", speed_mm_s=5.0, depth_mm=5.3}, {kind=\"withdraw\", speed_mm_s=5.0, depth_mm=-1.0}]";
    for stiffness in ["fibres={k1_kpa=8.78, k2=0.001}", "fibres={k1_kpa=200.0, k2=0.0001}"] {
        let effects = "effects=[\"puncture\", \"friction\", \"mass_scaling\", \"fibres\"]";
        let scene = || scene(&[phases, effects, stiffness]);
        let exact = frames(scene(), EngineChoice::Cpu64);
        let peak = exact.iter().map(|f| f.force.axial).fold(0.0, f64::max);
        let worst = |frames: &[FrameRecord]| frames.iter().map(|f| f.energy.imbalance().abs()).fold(0.0, f64::max);
        at_most("imbalance", worst(&exact), 0.006);
        for engine in engines_here() {
            let found = frames(scene(), engine);
            let pairs = exact.iter().zip(&found);
            let apart = pairs.map(|(a, b)| (a.force.axial - b.force.axial).abs()).fold(0.0, f64::max) / peak;
            println!("{stiffness}, {engine:?}: {apart:.1e} of the peak {peak:.3} N apart");
            at_most("imbalance", worst(&found), 0.006);
            at_most("apart", apart, 2e-3);
        }
    }
}

/// The crack runs in and opens tissue that moves: masses that were raised under it made as much energy as the whole work, and stopped the run.
#[test]
fn soft_and_tough_tissue_takes_the_puncture_without_energy_of_raised_masses() {
    let soft = ["material={youngs_modulus_kpa=12.0, poisson_ratio=0.45, toughness_j_m2=164.0}", "needle.gauge=\"18G\""];
    let phases = "motion.phase=[{kind=\"insert\", speed_mm_s=5.0, depth_mm=7.0}]";
    let scene = || scene(&[soft[0], soft[1], phases, FRICTION, "tissue.cell_size_mm=1.0"]);
    let exact = frames(scene(), EngineChoice::Cpu64);
    let peak = exact.iter().map(|f| f.force.axial).fold(0.0, f64::max);
    let largest = |frames: &[FrameRecord], of: &dyn Fn(&FrameRecord) -> f64| frames.iter().map(of).fold(0.0, f64::max);
    let cured = |f: &FrameRecord| f.energy.raised_mass.abs();
    let check = |name: &str, frames: &[FrameRecord]| {
        let work = largest(frames, &|f| f.energy.external);
        println!("{name}: {:.2} % in raised masses", 100.0 * largest(frames, &cured) / work);
        at_most("energy in raised masses over the work", largest(frames, &cured) / work, 0.02);
        at_most("imbalance", largest(frames, &|f| f.energy.imbalance().abs()), 0.004);
    };
    check("f64", &exact);
    for engine in engines_here() {
        let found = frames(scene(), engine);
        check(&format!("{engine:?}"), &found);
        let apart = exact.iter().zip(&found).map(|(a, b)| (a.force.axial - b.force.axial).abs()).fold(0.0, f64::max);
        at_most("apart", apart / peak, 0.01);
    }
}
