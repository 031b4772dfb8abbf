//! A needle that parts the faces of a slit: mesh, energy, volume, bevel, engine.

use super::*;
use stylet::observables::cells_in_needle;
use stylet::output::major_drops;

const SCENE: &str = "slit.toml";
const NO_PICTURES: &str = "outputs.pictures_at_depth_mm=[]";
/// To 12 mm, and so far back that the friction has turned round.
const IN_AND_BACK: &str = "motion.phase=[{kind = \"insert\", speed_mm_s = 2.0, depth_mm = 12.0}, \
                           {kind = \"hold\", duration_s = 0.2}, \
                           {kind = \"withdraw\", speed_mm_s = 2.0, depth_mm = 10.5}]";

fn cell(h: f64) -> String {
    format!("tissue.cell_size_mm={h}")
}

#[test]
fn the_force_does_not_depend_on_the_mesh() {
    let mut ends = Vec::new();
    for h in [0.8, 0.6] {
        let run = run(SCENE, &[&cell(h), NO_PICTURES, IN_AND_BACK], best_engine());
        let s = &run.summary;
        let imbalance = whole_run_imbalance(&run.records);
        assert!(imbalance <= 0.003 && s.doubts.is_empty(), "{h} mm: imbalance {imbalance}, {:?}", s.doubts);
        assert_eq!(s.inverted_cells, 0);
        // In the burst after the puncture, with the coarse mesh only.
        println!("{h} mm: {} clamped", s.clamped_nodes);
        assert!(s.clamped_nodes <= if h > 0.7 { 100 } else { 0 }, "{h} mm: {} clamped", s.clamped_nodes);
        let drops = major_drops(&run.records);
        assert_eq!(drops.len(), 1, "{h} mm: {drops:?}");
        assert_near("force of the puncture [N]", drops[0].force_n, 0.6, 0.1);
        assert!(drops[0].force_after_n < 0.7 * drops[0].force_n, "{drops:?}");
        assert!(run.figures.r2.unwrap() > 0.98, "{h} mm: R2 {:?}", run.figures.r2);
        assert!(run.last().force.friction < -0.2, "{:?}", run.last().force);
        ends.push(run.force_at_depth());
    }
    assert_near("force at 12 mm with 0.8 mm cells [N]", ends[0], ends[1], 0.05);
}

#[test]
fn no_tissue_is_left_in_the_needle() {
    let mut run = run(
        SCENE,
        &[NO_PICTURES, &cell(0.8), "motion.phase=[{kind = \"insert\", speed_mm_s = 2.0, depth_mm = 6.0}]"],
        best_engine(),
    );
    let state = run.state();
    let model = run.simulation.model.clone();
    let pose = model.kinematics.as_ref().unwrap().pose(3.0);
    assert_eq!(cells_in_needle(&model, &state, &pose, None), 0);
    // The count can see: a needle that stood beside its slit would hold tissue.
    let aside = stylet::needle::ToolPose { tip: pose.tip + DVec3::new(2e-3, 0.0, 0.0), ..pose };
    assert!(cells_in_needle(&model, &state, &aside, None) > 3);
    // Every pair that the shaft has passed is open by about the needle.
    let open: Vec<f64> = model
        .separation
        .pairs
        .iter()
        .filter(|p| p.tip_driven.is_some_and(|s0| (0.5e-3..2.0e-3).contains(&s0)))
        .filter(|p| {
            let lateral = model.mesh.rest_position(p.nodes[0] as usize) - model.scene.motion.entry;
            lateral.truncate().length() < 1e-6
        })
        .map(|p| (state.displacement[p.nodes[1] as usize] - state.displacement[p.nodes[0] as usize]).x)
        .collect();
    assert!(open.len() >= 2, "{open:?}");
    let width = 2.0 * model.scene.needle().unwrap().radius;
    assert!(open.iter().all(|o| (0.85..1.05).contains(&(o / width))), "openings {open:?} m of {width} m");
}

#[test]
fn a_bevel_in_a_slit_creates_no_energy() {
    let mut scene = load(SCENE, &[&cell(0.8), NO_PICTURES, IN_AND_BACK]);
    let Some(stylet::needle::Tool::Needle(needle)) = &mut scene.tool else { panic!("no needle") };
    needle.tip = stylet::needle::TipShape::Bevel { heading: 0.0 };
    let mut simulation = Simulation::new(scene, best_engine()).unwrap();
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap() {
        records.push(record);
    }
    let mut summary = Summary::default();
    summary.take_frames(&records);
    let imbalance = whole_run_imbalance(&records);
    println!("imbalance {imbalance:.5}, {} clamped", summary.clamped_nodes);
    assert!(imbalance <= 0.003 && summary.inverted_cells == 0 && summary.doubts.is_empty(), "{:?}", summary.doubts);
    // The flank pushes one face only.
    let lateral = records.iter().map(|r| r.force.lateral.length()).fold(0.0, f64::max);
    assert!(lateral > 0.05, "lateral force {lateral} N");
}

#[test]
fn both_engines_open_the_slit_alike() {
    if !has_gpu() {
        return;
    }
    let end = "motion.phase=[{kind = \"insert\", speed_mm_s = 2.0, depth_mm = 5.5}]";
    let on = |engine| run(SCENE, &[&cell(0.8), NO_PICTURES, end], engine).records;
    let (gpu, cpu) = (on(EngineChoice::Gpu), on(EngineChoice::Cpu));
    let largest = cpu.iter().map(|r| r.force.axial).fold(0.0, f64::max);
    // In the burst the two part by rounding and come together again.
    let apart = gpu.iter().zip(&cpu).filter(|(_, c)| !(2.2e-3..3.0e-3).contains(&c.depth));
    let apart = apart.map(|(g, c)| (g.force.axial - c.force.axial).abs()).fold(0.0, f64::max) / largest;
    println!("engines apart by {apart:.2e} of the largest force");
    assert!(apart < 2e-3, "{apart}");
}

#[test]
fn the_tip_cuts_an_interface_that_it_passes() {
    let end = "motion.phase=[{kind = \"insert\", speed_mm_s = 2.0, depth_mm = 9.0}]";
    let mut run = run("interface.toml", &[&cell(0.8), NO_PICTURES, end], best_engine());
    assert!(whole_run_imbalance(&run.records) <= 0.003 && run.summary.doubts.is_empty(), "{:?}", run.summary.doubts);
    let state = run.state();
    let model = &run.simulation.model;
    let radius = model.scene.needle().unwrap().radius;
    let (mut cut, mut held) = (0, 0);
    for (pair, damage) in model.separation.pairs.iter().zip(&state.pairs).filter(|(p, _)| p.axis == 2) {
        assert!(pair.on_plane && (model.mesh.rest_position(pair.nodes[0] as usize).z + 6e-3).abs() < 1e-12);
        let r0 = model.mesh.rest_position(pair.nodes[0] as usize).truncate().length();
        if r0 < radius {
            assert!(pair.tip_driven.is_some() && *damage == 1.0, "{r0}: damage {damage}");
            cut += 1;
        } else {
            assert!(pair.tip_driven.is_none());
            held += usize::from(*damage < 0.5);
        }
    }
    println!("{cut} pairs cut, {held} hold; {:.2} mm2 torn", run.last().health.torn_area * 1e6);
    assert!(cut >= 3 && held > 100, "{cut} cut, {held} hold");
    // The slit alone: its width times the way of the tip.
    let slit = 2.0 * 1.2 * radius * run.last().tip_coordinate;
    assert!((0.5..2.0).contains(&(run.last().health.torn_area / slit)), "{} m2", run.last().health.torn_area);
}
