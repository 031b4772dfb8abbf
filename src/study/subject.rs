//! The scene of a study: what is kept of it, where it starts from, and how settings change it.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{Engine, MeshSize, Settings, scene_hash};
use crate::cpu::unknown_to_lanes;
use crate::effects::{EFFECTS, Kind};
use crate::engine::stable_dt::wave_speed_bound;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::device::{adapter_wanted_by_name, describe};
use crate::hash::fnv1a;
use crate::mesh::{BlockMesh, Mesh};
use crate::model::Model;
use crate::needle::{Phase, Tool};
use crate::reading;
use crate::scene::Scene;
use crate::simulation::EngineChoice;
use crate::units::{rounded, trimmed};

/// Of numbers as the overrides have them.
pub(super) const DECIMALS: i32 = 4;

/// Sample points of the displacement per axis, and the part of the block that they span.
const SAMPLES: usize = 9;
const SPAN: f64 = 0.8;
/// Distance of the sample points from the path in radii of the tool, and at most in lateral edges of the block.
const CLEARANCE_RADII: f64 = 3.0;
const CLEARANCE_EDGES: f64 = 0.2;

/// One effect more or less than the base has.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Keys of the effects that come or go together.
    pub keys: Vec<String>,
    /// True where they come.
    pub added: bool,
    /// All effects that are on then.
    pub effects: Vec<String>,
}

/// The scene, its base settings and its variants.
#[derive(Debug, Clone)]
pub struct Subject {
    pub path: PathBuf,
    pub overrides: Vec<String>,
    /// Text of the scene file.
    pub text: String,
    /// The insertion alone, with the base settings.
    pub scene: Scene,
    pub base: Settings,
    /// Adapter of the GPU engine; `None` where there is none.
    pub adapter: Option<String>,
    /// Engines that the study may take.
    pub engines: Vec<Engine>,
    /// What the study changes in the scene beside its axes, one sentence each.
    pub changes: Vec<String>,
    pub variants: Vec<Variant>,
    /// Effects that are neither switched on nor off, with the reason.
    pub skipped: Vec<(String, String)>,
}

impl Subject {
    /// Reads the scene and finds what can be varied.
    ///
    /// # Errors
    /// `Error::Scene` for a broken scene, `Error::Input` for one without an insertion along one line, `Error::Adapter` where
    /// the wanted engine is not to be had.
    pub fn load(path: &Path, overrides: &[String], choice: EngineChoice) -> Result<Self> {
        let loaded = Scene::load(path, overrides)?;
        let text = reading::text(path, reading::most::SCENE).map_err(|unread| unread.of(path, "name a scene file"))?;
        let (scene, changes) = insertion(loaded)?;
        let gpu = match choice {
            // No adapter is looked for: parts of a study on several machines then agree.
            EngineChoice::Cpu | EngineChoice::Cpu64 => None,
            EngineChoice::Gpu => Some(Gpu::open()?),
            EngineChoice::Auto => match Gpu::open() {
                Err(error) if adapter_wanted_by_name() => return Err(error),
                found => found.ok(),
            },
        };
        let is_known = choice != EngineChoice::Cpu64 && unknown_to_lanes(&scene).is_none();
        let processor = if is_known { Engine::Cpu } else { Engine::Cpu64 };
        // As a run chooses.
        let engine = match &gpu {
            Some(gpu) if choice == EngineChoice::Gpu || adapter_wanted_by_name() || !gpu.is_software() || !is_known => {
                Engine::Gpu
            }
            _ => processor,
        };
        let adapter = gpu.map(|gpu| describe(&gpu.info));
        let engines = match (choice, is_known) {
            (EngineChoice::Cpu | EngineChoice::Cpu64, _) => vec![processor],
            (_, true) => vec![Engine::Cpu, Engine::Cpu64],
            (_, false) => vec![Engine::Cpu64],
        };
        let engines = adapter.iter().map(|_| Engine::Gpu).chain(engines).collect();
        let base = Settings {
            cell_size_mm: rounded(scene.tissue.cell_size * 1e3, DECIMALS),
            mass_scaling: rounded(scene.effects.mass_scaling.map_or(1.0, |p| p.factor), DECIMALS),
            safety: scene.solver.safety,
            engine,
            effects: scene.effects.keys().into_iter().map(str::to_string).collect(),
            repetition: 0,
        };
        let mut subject = Subject {
            path: path.to_path_buf(),
            overrides: overrides.to_vec(),
            text,
            scene,
            base,
            adapter,
            engines,
            changes,
            variants: Vec::new(),
            skipped: Vec::new(),
        };
        subject.find_variants();
        Ok(subject)
    }

    /// The scene with other settings.
    ///
    /// # Errors
    /// `Error::Scene` where the settings do not fit it.
    pub fn scene(&self, settings: &Settings) -> Result<Scene> {
        let mut overrides = self.overrides.clone();
        if self.scene.mesh.is_none() {
            overrides.push(format!("tissue.cell_size_mm={}", trimmed(settings.cell_size_mm)));
        }
        overrides.push(format!("solver.mass_scaling={:?}", settings.mass_scaling));
        overrides.push(format!("solver.safety={:?}", settings.safety));
        let keys: Vec<String> = settings.effects.iter().map(|key| format!("\"{key}\"")).collect();
        overrides.push(format!("effects=[{}]", keys.join(", ")));
        Ok(insertion(Scene::load(&self.path, &overrides)?)?.0)
    }

    /// Size of the mesh with cells of this edge [mm] and the effects of the base; the error says why there is none.
    pub fn mesh_size(&self, cell_size_mm: f64) -> std::result::Result<MeshSize, String> {
        let scene = self
            .scene(&Settings { cell_size_mm, ..self.base.clone() })
            .map_err(|error| first_line(&error.to_string()))?;
        let mesh = match &scene.mesh {
            Some(tets) => Mesh::Tets(tets.clone()),
            None => Mesh::Block(BlockMesh::for_scene(&scene)),
        };
        let model = Model::new(scene, mesh);
        Ok(MeshSize {
            cells: model.mesh.cell_count() as u64,
            unit_step_s: wave_speed_bound(&model) / model.mass_scaling().sqrt(),
        })
    }

    /// Edge beyond which coarser meshes than the base tell nothing [mm]: a needle's path is softened within a tube, and cells wider
    /// than that answer with their own width.
    pub fn coarsest_mm(&self) -> f64 {
        let path = self.scene.effects.puncture.as_ref().map_or(f64::INFINITY, |p| 2e3 * p.softened_radius);
        path.max(self.base.cell_size_mm)
    }

    /// True where the cells have an edge that can be chosen.
    pub fn has_block(&self) -> bool {
        self.scene.mesh.is_none()
    }

    /// Simulated time of the insertion [s].
    pub fn duration(&self) -> f64 {
        self.scene.motion.legs().iter().map(|leg| leg.duration).sum()
    }

    /// Where the displacement of runs is compared [m], the same points in every mesh; none in a mesh of tetrahedra.
    pub fn sample_points(&self) -> Vec<DVec3> {
        if !self.has_block() {
            return Vec::new();
        }
        let size = self.scene.tissue.size;
        let radius = match &self.scene.tool {
            Some(Tool::Needle(needle)) => needle.radius,
            Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. }) => *radius,
            None => 0.0,
        };
        let clearance = (CLEARANCE_RADII * radius).min(CLEARANCE_EDGES * size.x.min(size.y));
        let motion = &self.scene.motion;
        let (entry, end) = (motion.entry, motion.deepest_point_in(size.z));
        let away = |x: &DVec3| {
            let along = end - entry;
            let part = ((*x - entry).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            (*x - entry - along * part).length() >= clearance
        };
        let place = |i: usize| SPAN * (i as f64 / (SAMPLES - 1) as f64 - 0.5);
        let all = (0..SAMPLES.pow(3)).map(|n| {
            let [i, j, k] = [n % SAMPLES, n / SAMPLES % SAMPLES, n / SAMPLES.pow(2)];
            DVec3::new(place(i) * size.x, place(j) * size.y, (place(k) - 0.5) * size.z)
        });
        all.filter(away).collect()
    }

    /// What a run was made from, as one number: scene, overrides, settings and version.
    pub fn hash(&self, settings: &Settings) -> String {
        let settings = serde_json::to_string(settings).unwrap_or_default();
        fnv1a(&[&self.text, &self.overrides.join("\n"), &settings, env!("CARGO_PKG_VERSION")])
    }

    /// The same without the settings, see [`scene_hash`].
    pub fn scene_hash(&self) -> String {
        scene_hash(&self.text, &self.overrides)
    }

    fn find_variants(&mut self) {
        let base = self.base.effects.clone();
        for effect in &EFFECTS {
            let key = effect.key;
            let on = base.iter().any(|k| k == key);
            let skip = match key {
                "mass_scaling" if on => Some(format!(
                    "without it the run takes {:.0} times as long; the axis of mass scaling shows what it changes",
                    self.base.mass_scaling.sqrt()
                )),
                "mass_scaling" => Some("the axis of mass scaling shows what it changes".into()),
                _ if effect.kind == Kind::Contact && on => Some("without it the tool does not touch the tissue".into()),
                _ if effect.kind == Kind::Contact => Some("it belongs to another tool".into()),
                "cohesive" if !on => Some("it is another model of the path, not an addition to this one".into()),
                _ => None,
            };
            if let Some(reason) = skip {
                self.skipped.push((key.into(), reason));
                continue;
            }
            // What does nothing without another effect comes and goes with it.
            let keys: Vec<&str> = match on {
                true => EFFECTS
                    .iter()
                    .filter(|e| e.key == key || (base.iter().any(|k| k == e.key) && e.needs == [key]))
                    .map(|e| e.key)
                    .collect(),
                false => match effect.needs {
                    [need] if effect.kind == Kind::Constitutive && !base.iter().any(|k| k == need) => vec![need, key],
                    _ => vec![key],
                },
            };
            let kept = |k: &&crate::effects::Effect| {
                let here = base.iter().any(|b| b == k.key);
                if keys.contains(&k.key) { !on } else { here }
            };
            let effects: Vec<String> = EFFECTS.iter().filter(kept).map(|e| e.key.to_string()).collect();
            match self.scene(&Settings { effects: effects.clone(), ..self.base.clone() }) {
                Ok(_) => self.variants.push(Variant {
                    keys: keys.iter().map(|k| k.to_string()).collect(),
                    added: !on,
                    effects,
                }),
                Err(error) => self.skipped.push((keys.join(" and "), first_line(&error.to_string()))),
            }
        }
    }
}

/// The way in alone, and what that changes.
fn insertion(mut scene: Scene) -> Result<(Scene, Vec<String>)> {
    let way_out = "give a scene whose tool goes in along one line, e.g. scenes/muscle_biopsy.toml";
    if scene.tool.is_none() {
        return Err(Error::input(format!("the scene {} has no tool, so no force over depth", scene.name), way_out));
    }
    if scene.motion.is_free() {
        return Err(Error::input(
            format!("the tool of the scene {} leaves one straight line; its runs have no common depth", scene.name),
            way_out,
        ));
    }
    let all = scene.motion.phases.len();
    let mut deepest = 0.0;
    scene.motion.phases.retain(|phase| match *phase {
        Phase::Insert { depth, .. } if depth > deepest => {
            deepest = depth;
            true
        }
        _ => false,
    });
    if scene.motion.phases.is_empty() {
        return Err(Error::input(format!("the tool of the scene {} does not go in", scene.name), way_out));
    }
    let mut changes = Vec::new();
    if scene.motion.phases.len() < all {
        changes.push(format!(
            "Only the way in to {} mm is run; what comes after it in the scene (hold, withdrawal) is left out.",
            trimmed(deepest * 1e3)
        ));
    }
    if let Some(step) = scene.solver.time_step.take() {
        changes.push(format!(
            "The scene's own time step of {} us is not used: every run takes the safety times its stable step.",
            trimmed(step * 1e6)
        ));
    }
    Ok((scene, changes))
}

/// First line of a message that stands in the middle of a page.
pub(super) fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_string()
}
