//! `stylet check`: what a scene means, before it runs.

use std::fmt::Write;
use std::time::Instant;

use clap::Args;

use super::{SceneArgs, check_penetration};
use crate::effects::own::Chosen;
use crate::effects::parameter::COUNT;
use crate::effects::puncture::SchemeWord;
use crate::effects::{Effect, EffectSet, Numbers, TissueMaterial, damage, fibres, plasticity, viscoelastic};
use crate::ending;
use crate::engine::stable_dt::power_iteration;
use crate::error::{Result, brief};
use crate::material::{describe_constants, describe_verdict};
use crate::mesh::Mesh;
use crate::model::{Model, loads};
use crate::needle::{TipShape, Tool};
use crate::scene::{Face, FaceDrive, RegionShape, Scene};
use crate::simulation::advice::tool_mach;
use crate::simulation::{EngineChoice, Simulation};
use crate::units::four_digits;

/// Wall time that the trial of the prediction may take [s].
const TRIAL: f64 = 0.5;

/// Most cells of a mesh whose stable step is also found by power iteration: more would take seconds.
const MOST_ITERATED: usize = 30_000;

#[derive(Debug, Clone, Default, Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// auto, gpu, cpu or cpu64; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
}

/// The command: prints what the scene means.
///
/// # Errors
/// Those of the scene, and as [`check`].
pub fn execute(args: &CheckArgs) -> Result<u8> {
    ending::watch();
    println!("{}", check(args.scene.load()?, args.engine)?);
    Ok(0)
}

/// Validates a scene (loading it did) and tells moduli, waves, stability, steps, effects and the predicted time.
pub fn check(scene: Scene, engine: EngineChoice) -> Result<String> {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    let mut simulation = Simulation::new(scene, engine)?;
    let model = simulation.model.clone();
    let scene = &model.scene;
    let law = scene.material.law;
    line(format!("scene        {} ({})", scene.name, scene.path.display()));
    line(format!("             {}", brief(&scene.title)));
    // What changes the meaning of all that follows comes first.
    for notice in &scene.notices {
        line(format!("note         {notice}"));
    }
    line(format!("tissue       {}", describe_tissue(&model)));
    line(format!("material     {}: {}", scene.material.name, scene.material.source));
    for text in describe_material(&scene.material, &scene.effects) {
        line(format!("             {text}"));
    }
    let wave = |modulus: f64| (modulus / scene.material.density).sqrt();
    line(format!(
        "             wave speeds: P {:.2} m/s, S {:.2} m/s (at true density)",
        wave(law.p_wave_modulus()),
        wave(law.shear_modulus())
    ));
    line(format!("stability    {}", describe_verdict(&law)));
    for region in &scene.regions {
        line(format!("region       {}: {}", region.name, describe_shape(&region.shape)));
        line(format!("             {}: {}", region.material.name, region.material.source));
        for text in describe_material(&region.material, &scene.effects) {
            line(format!("             {text}"));
        }
        line(format!("             {}", describe_verdict(&region.material.law)));
    }
    line(format!("boundaries   {}", describe_faces(scene)));
    if let Some(free) = scene.skin_free {
        let held = model.composition.skin.len();
        line(format!("skin         {held} nodes farther than {} mm from the path held", four_digits(free * 1e3)));
    }
    for support in &scene.supports {
        let names = ["x", "y", "z"].into_iter().zip(support.fixed);
        let fixed: String = names.filter(|(_, on)| *on).map(|(name, _)| name).collect();
        line(format!("support      {}: {fixed} held", support.set));
    }
    for load in &scene.loads {
        let (area, force) = model.mesh.as_tets().map(|mesh| loads::resultant(mesh, load)).unwrap_or_default();
        let [x, y, z] = force.to_array().map(four_digits);
        let name = load.set.as_deref().unwrap_or("the whole surface");
        line(format!("load         {name}: {} mm2, together ({x}, {y}, {z}) N", four_digits(area * 1e6)));
    }
    for target in &scene.targets {
        let [x, y, z] = (target.position * 1e3).to_array().map(four_digits);
        let radius = four_digits(target.radius * 1e3);
        line(format!("target       {} at ({x}, {y}, {z}) mm, hit within {radius} mm", target.name));
    }
    if let Some(tool) = &scene.tool {
        line(format!("tool         {}", describe_tool(tool)));
    }
    if let Some(k) = &model.kinematics {
        line(format!(
            "motion       {} phases, {:.3} s, to {:.2} mm, at most {:.2} mm/s",
            scene.motion.phases.len(),
            k.duration(),
            scene.motion.deepest() * 1e3,
            scene.motion.largest_speed() * 1e3
        ));
        let mach = tool_mach(&model).unwrap_or(0.0);
        line(format!("             tool speed over scaled shear wave speed {mach:.4}"));
    }
    line(format!("effects      {}", if scene.effects.keys().is_empty() { "none" } else { "only these run:" }));
    for effect in scene.effects.active() {
        line(format!("  {:<13}{}; cost: {}", effect.key, effect.summary, effect.cost));
        line(format!("  {:<13}{}", "", describe_parameters(effect, &scene.numbers())));
    }
    for text in check_penetration::describe(scene) {
        line(text);
    }
    describe_run(&mut simulation, &mut line)?;
    line("ok".into());
    Ok(out.trim_end().into())
}

/// Law, moduli and what the material states of its own for effects that are on.
fn describe_material(material: &TissueMaterial, effects: &EffectSet) -> Vec<String> {
    let law = &material.law;
    let mut lines = vec![
        format!(
            "{}: {}, density {} kg/m^3",
            law.isochoric.key(),
            describe_constants(law),
            four_digits(material.density)
        ),
        format!(
            "shear modulus {:.3} kPa, bulk modulus {:.1} kPa, E {:.2} kPa, nu {:.4}",
            law.shear_modulus() / 1e3,
            law.bulk_modulus / 1e3,
            law.youngs_modulus() / 1e3,
            law.poisson_ratio()
        ),
    ];
    let own = [
        material.plasticity.filter(|_| effects.plasticity.is_some()).map(|p| describe_plasticity(&p)),
        material.fibres.filter(|_| effects.fibres.is_some()).map(|p| describe_fibres(&p)),
        material.viscoelastic.as_ref().filter(|_| effects.viscoelastic.is_some()).map(describe_viscoelastic),
        material.damage.filter(|_| effects.damage.is_some()).map(|p| describe_damage(&p)),
        material.cutting.filter(|_| effects.puncture.is_some()).map(|c| {
            let [puncture, cutting] = [c.puncture_force, c.cutting_force].map(four_digits);
            format!("puncture {puncture} N, cutting {cutting} N (calibrated)")
        }),
        material
            .membrane_energy
            .filter(|_| effects.puncture.is_some())
            .map(|w| format!("membrane, {} mJ", four_digits(w * 1e3))),
        material.toughness.map(|j| format!("toughness {} J/m^2", four_digits(j))),
        material.tear_stretch.map(|stretch| format!("tears at stretch {}", four_digits(stretch))),
    ];
    let of_own = |chosen: &Chosen| format!("{} {}", chosen.effect.effect.key, chosen.describe());
    let own: Vec<String> = own.into_iter().flatten().chain(material.own.iter().map(of_own)).collect();
    if !own.is_empty() {
        lines.push(format!("its own: {}", own.join("; ")));
    }
    lines
}

/// A region's shape in mm.
fn describe_shape(shape: &RegionShape) -> String {
    let mm = |length: f64| four_digits(length * 1e3);
    let point = |p: &glam::DVec3| format!("({}, {}, {})", mm(p.x), mm(p.y), mm(p.z));
    match shape {
        RegionShape::Layer { top, bottom } => format!("layer from {} to {} mm below the top", mm(*top), mm(*bottom)),
        RegionShape::Box { low, high } => format!("box from {} to {} mm", point(low), point(high)),
        RegionShape::Sphere { centre, radius } => format!("sphere of {} mm about {} mm", mm(*radius), point(centre)),
        RegionShape::Cylinder { from, to, radius } => {
            format!("cylinder of {} mm from {} to {} mm", mm(*radius), point(from), point(to))
        }
        RegionShape::MeshTag(tag) => format!("cells of the mesh called {tag}"),
        RegionShape::Labels { labels, case } => {
            let named = |label: &u16| match case.map.names.get(label) {
                Some(name) => format!("{label} \"{name}\""),
                None => label.to_string(),
            };
            format!("label {}", labels.iter().map(named).collect::<Vec<_>>().join(", "))
        }
    }
}

/// Size, cells and nodes.
fn describe_tissue(model: &Model) -> String {
    let size = (model.scene.tissue.size * 1e3).to_array().map(four_digits);
    let kind = match &model.mesh {
        Mesh::Block(block) => {
            let [nx, ny, nz] = block.cells();
            format!("{nx} x {ny} x {nz} = ")
        }
        Mesh::Tets(_) => "tetrahedra, ".into(),
    };
    format!(
        "{} x {} x {} mm, {kind}{} cells, {} nodes, smallest edge {:.3} mm",
        size[0],
        size[1],
        size[2],
        model.mesh.cell_count(),
        model.mesh.node_count(),
        model.mesh.smallest_edge() * 1e3
    )
}

/// What holds, moves or loads each face.
fn describe_faces(scene: &Scene) -> String {
    let describe = |face: Face| {
        let c = &scene.faces[face as usize];
        let fixed: String = ["x", "y", "z"].into_iter().zip(c.fixed).filter(|(_, on)| *on).map(|(n, _)| n).collect();
        let moved = match c.drive {
            None => String::new(),
            Some(FaceDrive { cycles: 0, duration, .. }) => format!(" moved over {duration:.3} s"),
            Some(FaceDrive { cycles, duration, .. }) => {
                format!(" moved {cycles} times to and fro, {duration:.3} s each way")
            }
        };
        let loaded = if c.traction.is_some() { " loaded" } else { "" };
        let held = if fixed.is_empty() { "free".into() } else { format!("{fixed} held") };
        format!("{} {held}{moved}{loaded}", face.key())
    };
    Face::ALL.map(describe).join(", ")
}

/// Steps, engine and predicted time.
fn describe_run(simulation: &mut Simulation, line: &mut impl FnMut(String)) -> Result<()> {
    let model = simulation.model.clone();
    let scene = &model.scene;
    line(format!("mass scaling {}", model.mass_scaling()));
    line(format!(
        "stable step  {:.3} us (wave-speed bound{})",
        simulation.stable_dt * 1e6,
        match model.mesh.cell_count() {
            // It goes over all cells many times.
            0..=MOST_ITERATED => format!("; power iteration {:.3} us", power_iteration(&model) * 1e6),
            _ => format!("; no power iteration beyond {MOST_ITERATED} cells"),
        }
    ));
    line(format!(
        "step         {:.3} us{}, {} steps, {} frames, {:.3} s simulated",
        simulation.dt() * 1e6,
        if scene.solver.time_step.is_some() { " (the scene's own)" } else { "" },
        simulation.total_steps(),
        simulation.frame_count(),
        simulation.duration()
    ));
    let info = simulation.engine().info().clone();
    line(format!("engine       {} on {} ({})", info.engine, info.adapter, info.driver));
    line(format!(
        "device       {:.2} MB, {:.0} B per cell",
        info.device_bytes as f64 / 1e6,
        info.device_bytes as f64 / model.mesh.cell_count() as f64
    ));
    match predicted_seconds(simulation)? {
        Some(seconds) => line(format!(
            "prediction   {seconds:.1} s of wall time on this adapter, real-time factor {:.2} (from a trial of {TRIAL} s)",
            simulation.duration() / seconds
        )),
        None => line("prediction   shorter than the trial".into()),
    }
    for notice in &simulation.notices {
        line(format!("note         {notice}"));
    }
    Ok(())
}

fn describe_plasticity(p: &plasticity::Params) -> String {
    format!("yield {} kPa, hardening {} kPa", four_digits(p.yield_stress / 1e3), four_digits(p.hardening / 1e3))
}

fn describe_fibres(p: &fibres::Params) -> String {
    if p.k1 == 0.0 {
        return "no fibres".into();
    }
    let [x, y, z] = p.direction.to_array().map(four_digits);
    format!("fibres along ({x}, {y}, {z}), k1 {} kPa, k2 {}", four_digits(p.k1 / 1e3), four_digits(p.k2))
}

fn describe_viscoelastic(p: &viscoelastic::Params) -> String {
    let terms: Vec<String> =
        p.terms.iter().map(|t| format!("{} in {} s", four_digits(t.ratio), four_digits(t.time))).collect();
    let left = 1.0 - p.terms.iter().map(|t| t.ratio).sum::<f64>();
    format!("relaxes {}; {} is left", terms.join(", "), four_digits(left))
}

fn describe_damage(p: &damage::Params) -> String {
    format!(
        "damage from plastic strain {}, failure displacement {} mm, at most {}{}",
        four_digits(p.onset),
        four_digits(p.failure_displacement * 1e3),
        four_digits(p.largest),
        if p.deletion { ", then deleted" } else { "" }
    )
}

/// The scene's parameters of one effect, in words of its own or as its table names them.
fn describe_parameters(effect: &Effect, numbers: &Numbers) -> String {
    let effects = numbers.effects;
    let text = match effect.key {
        "mass_scaling" => effects.mass_scaling.map(|p| format!("factor {}", four_digits(p.factor))),
        "gravity" => effects.gravity.map(|p| format!("acceleration {} m/s^2", p.acceleration)),
        "plasticity" => effects.plasticity.map(|p| describe_plasticity(&p)),
        "fibres" => effects.fibres.map(|p| describe_fibres(&p)),
        "viscoelastic" => effects.viscoelastic.as_ref().map(describe_viscoelastic),
        "damage" => effects.damage.map(|p| describe_damage(&p)),
        "puncture" => effects.puncture.map(|p| {
            let stated = |value: f64, stated: bool| match (stated, p.scheme) {
                (true, _) => format!("{} N (calibrated)", four_digits(value)),
                (false, SchemeWord::Ring) => format!("{} N", four_digits(value)),
                (false, SchemeWord::Opening) => "from the toughness".into(),
            };
            let puncture = stated(p.puncture_force, p.puncture_stated);
            let cutting = stated(p.cutting_force, p.cutting_stated);
            if p.scheme == SchemeWord::Opening {
                let stiffness = four_digits(p.tip_stiffness * 1e-3);
                return format!(
                    "scheme opening, puncture {puncture}, cutting {cutting}, tip stiffness \
                     {stiffness} N/mm"
                );
            }
            format!(
                "puncture {puncture}, cutting {cutting}, transition {} mm, tip stiffness {} N/mm, softened radius {} mm, ring {} mm",
                four_digits(p.transition_length * 1e3),
                four_digits(p.tip_stiffness * 1e-3),
                four_digits(p.softened_radius * 1e3),
                four_digits(p.ring_radius * 1e3)
            )
        }),
        "adhesion" => effects.adhesion.map(|p| {
            format!(
                "static {} N, kinetic {} N, stiffness {} N/mm, sliding distance {} mm",
                four_digits(p.static_force),
                four_digits(p.kinetic_force),
                four_digits(p.stiffness * 1e-3),
                four_digits(p.sliding_distance * 1e3)
            )
        }),
        "indentation" => effects.indentation.map(|p| {
            format!(
                "contact stiffness factor {}, contact damping {}",
                four_digits(p.stiffness_factor),
                four_digits(p.contact_damping)
            )
        }),
        "friction" => effects.friction.map(|p| {
            format!("coefficient {}, fade {} mm", four_digits(p.coefficient), four_digits(p.fade_length * 1e3))
        }),
        _ => None,
    };
    text.unwrap_or_else(|| describe_table(effect, numbers))
}

/// Name, value and unit of every number of an effect.
fn describe_table(effect: &Effect, numbers: &Numbers) -> String {
    let named = effect.parameters.iter().filter_map(|parameter| {
        let values: Vec<String> = parameter.values(numbers).into_iter().map(|v| four_digits(v).to_string()).collect();
        let value = match &values[..] {
            [] => return None,
            [value] => value.clone(),
            several => format!("({})", several.join(", ")),
        };
        let unit = if matches!(parameter.unit, "-" | COUNT) { "" } else { parameter.unit };
        Some(format!("{} {value} {unit}", parameter.name).trim_end().to_string())
    });
    match numbers.effects.own.iter().find(|chosen| chosen.effect.effect.key == effect.key) {
        Some(chosen) => chosen.describe(),
        None => named.collect::<Vec<_>>().join(", "),
    }
}

fn describe_tool(tool: &Tool) -> String {
    match tool {
        Tool::Needle(n) => {
            let tip = match n.tip {
                TipShape::Cone => {
                    format!(
                        "cone {:.3} mm (half angle {:.1} deg)",
                        1e3 * n.tip_length,
                        n.tip_slope().atan().to_degrees()
                    )
                }
                TipShape::Bevel { heading } => format!(
                    "bevel {:.3} mm ({:.1} deg, apex heading {:.0} deg)",
                    1e3 * n.tip_length,
                    (2.0 * n.tip_slope()).atan().to_degrees(),
                    heading.to_degrees()
                ),
            };
            format!("needle {}: diameter {:.3} mm, {tip}, {}", n.name, 2e3 * n.radius, n.material)
        }
        Tool::Sphere { radius } => format!("sphere of radius {:.3} mm", radius * 1e3),
        Tool::FlatPunch { radius, bonded } => {
            format!("flat punch of radius {:.3} mm{}", radius * 1e3, if *bonded { ", bonded" } else { "" })
        }
    }
}

/// Wall time of the whole run, extrapolated from its first steps [s]. A frame may have tens of thousands of steps, so that the trial
/// counts steps, not frames: twice as many each time, as long as they fit into the time of the trial.
fn predicted_seconds(simulation: &mut Simulation) -> Result<Option<f64>> {
    // The first steps compile shaders and fill caches.
    simulation.try_steps(1)?;
    let (begin, mut count) = (Instant::now(), 1);
    loop {
        let piece = Instant::now();
        if !simulation.try_steps(count)? {
            return Ok(None);
        }
        let taken = piece.elapsed().as_secs_f64();
        // The next piece would take twice as long.
        if begin.elapsed().as_secs_f64() + 2.0 * taken > TRIAL {
            return Ok(Some(taken / count as f64 * simulation.total_steps() as f64));
        }
        count *= 2;
    }
}
