//! From the TOML form to the scene in SI: ranges, relations between keys, geometry, stability, memory.
//!
//! A check reports and goes on, so that one call shows all problems; the geometry is looked at only when every single
//! number is in range.

mod anatomy;
mod effect_tables;
mod effects;
mod faces;
mod frames;
pub(super) mod library;
mod loads;
mod material;
mod mesh;
mod mesh_path;
mod missing;
mod outputs;
mod own;
pub(super) mod parameters;
mod placement;
mod regions;
mod supports;
mod targets;
mod task;
mod tool;

use std::path::Path;

use glam::DVec3;

use own::OwnNumbers;
use parameters::OwnTables;
use supports::Held;

use missing::{refusal, unreadable};

use super::builder::hourglass_quartic;
use super::document::{Document, Problems, closest};
use super::file::*;
use super::*;
use crate::anatomy::Case;
use crate::effects::SELF_CONTAINED;
use crate::effects::mass_scaling::Loading;
use crate::effects::own::OwnEffect;
use crate::effects::parameters::Table;
use crate::effects::puncture::SchemeWord;
use crate::mesh::{BlockMesh, Mesh, TetMesh};
use crate::needle::Phase;
use crate::reading::{self, Unread};
use crate::units;
use crate::units::four_digits;
use crate::within::Within;

const MM: f64 = units::MILLIMETRE.si;
const KPA: f64 = units::KILOPASCAL.si;

/// Distance that the path keeps from the sides and the bottom of the block [m].
const PATH_MARGIN: f64 = 1.0e-3;
/// Memory per cell and node, an upper estimate over all effects [B].
const BYTES_PER_CELL: f64 = 220.0;
const BYTES_PER_NODE: f64 = 60.0;
/// Largest array per cell, and the largest storage binding that every device offers [B].
const BINDING_BYTES_PER_CELL: f64 = 160.0;
const LARGEST_BINDING: f64 = 128.0 * 1024.0 * 1024.0;
/// Range of solver.frame_rate_hz [Hz].
const LOWEST_FRAME_RATE: f64 = 0.1;
const HIGHEST_FRAME_RATE: f64 = 1e5;

/// Reads, checks and converts; the error is the rendered text of all problems of the first stage that finds any:
/// document, keys, numbers, geometry, memory.
pub fn load(path: &Path, overrides: &[String], own: &[&'static OwnEffect]) -> std::result::Result<Scene, String> {
    let source = reading::text(path, reading::most::SCENE).map_err(|unread| match unread {
        Unread::System(error) => unreadable(path, &error),
        Unread::Refused { reason, way_out } => {
            refusal(&format!("cannot read the scene file {}: {reason}", path.display()), way_out)
        }
    })?;
    let mut scene = parse(path, &source, overrides, own)?;
    if reading::is_built_in(path) {
        let notice =
            format!("there is no file {} here: the scene that is built into the program is used", path.display());
        scene.notices.insert(0, notice);
    }
    Ok(scene)
}

/// The same with the text in memory.
pub fn parse(
    path: &Path,
    source: &str,
    overrides: &[String],
    own: &[&'static OwnEffect],
) -> std::result::Result<Scene, String> {
    let mut document = Document::parse(path, source, overrides)?;
    Check::new(&document, path).finite_numbers(&document)?;
    let own = &[SELF_CONTAINED, own].concat();
    let own_numbers = own::take_tables(&mut document, own);
    let mut check = Check { own_numbers, ..Check::new(&document, path) };
    let file: SceneFile = document.deserialize()?;
    check.scene(path, &file, own)
}

/// The running check: problems stop the load, notices travel with the scene.
struct Check<'a> {
    problems: Problems<'a>,
    notices: Vec<String>,
    /// Folder that relative paths start from: that of the file.
    folder: &'a Path,
    /// Tables of effects that are complete by themselves.
    own_numbers: OwnNumbers,
    /// Whether the scene names a label map.
    has_labels: bool,
    /// Length of the way from the skin to the target in a patient: how deep an insertion goes that says nothing [m].
    path: Option<f64>,
}

type Checked<T> = std::result::Result<T, String>;

impl<'a> Check<'a> {
    /// The check of the document that was read from `path`.
    fn new(document: &'a Document<'a>, path: &'a Path) -> Self {
        Check {
            problems: Problems::new(document),
            notices: Vec::new(),
            folder: path.parent().unwrap_or(Path::new("")),
            own_numbers: Vec::new(),
            has_labels: false,
            path: None,
        }
    }

    fn finite_numbers(&mut self, document: &Document) -> Checked<()> {
        for place in document.non_finite_numbers() {
            self.problems.report(
                &place,
                format!("`{place}` is not a finite number"),
                "NaN, infinite or too large",
                "write a finite number",
            );
        }
        self.problems.check()
    }
}

impl Check<'_> {
    fn scene(&mut self, path: &Path, file: &SceneFile, own: &[&'static OwnEffect]) -> Checked<Scene> {
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let (tissue, mesh, case) = self.tissue(file);
        let (mut material, preset) = self.material("material", &file.material, tissue.cell_size);
        let (mut regions, region_presets) = self.regions(file, &tissue, (mesh.as_deref(), case.as_ref()));
        let supports = self.supports(file, mesh.as_deref());
        let tool = self.tool(file);
        let motion = self.motion(file, tool.as_ref(), mesh.as_deref());
        let by_words = self.faces_by_words(&file.tissue, &motion);
        let faces = self.faces(&file.boundaries, by_words);
        let held = Held {
            regions: &regions,
            supports: &supports,
            faces: &faces,
            motion: &motion,
            tissue: &tissue,
            mesh: mesh.as_deref(),
            case: case.as_deref(),
        };
        let skin_free = self.skin_free(file, &held);
        self.floating(&file.tissue, &held, skin_free);
        let loads = self.loads(file, mesh.as_deref(), &supports, &faces);
        let loading = Loading::of(Some(&motion), &faces, tissue.size).with_loads(&loads, tissue.size);
        let mut effects = self.effects(file, own, &tool, &motion, &loading, &material);
        effects.own = self.own_effects(file, own);
        self.own_numbers_of_regions(file, &effects, &mut regions);
        parameters::settle(
            &mut material,
            &[parameters::of_preset(preset.as_ref()), file.own_tables()],
            &EffectSet::default(),
            &effects,
        );
        // A fracture energy of the scene means another displacement where a region flows at another stress.
        let energy = OwnTables { damage: file.damage.as_ref(), ..OwnTables::default() };
        for ((region, table), preset) in regions.iter_mut().zip(&file.region).zip(&region_presets) {
            let layers = [energy, parameters::of_preset(preset.as_ref()), table.own_tables()];
            parameters::settle(&mut region.material, &layers, &effects, &effects);
        }
        self.scheme_of_the_scene(file, &mut effects, tool.as_ref(), &material, &regions);
        self.cuttings(file, &tool, &effects, (&mut material, preset), (&mut regions, region_presets));
        let solver = self.solver(&file.solver, tool.is_some(), effects.puncture.is_some(), tissue.cell_size);
        self.opening_limits(&effects, tool.as_ref());
        self.case_limits(&effects, &motion, case.is_some(), &regions);
        self.opening_toughness(&effects, tool.as_ref(), &material, &regions, file);
        let outputs = self.outputs(&file.outputs, &motion, tool.is_some(), solver.duration);
        let targets = self.targets(file, case.as_deref());
        let bored = effects.cohesive.is_some() && matches!(&tool, Some(Tool::Needle(n)) if n.bore.is_some());
        let task = file.task.as_ref().map(|table| self.task(table, file, tool.as_ref(), bored, &targets));
        self.problems.check()?;
        self.steps(&solver);
        self.frames(&solver, &motion, targets.len());
        for (index, material) in parameters::all_materials(&material, &regions) {
            self.snap_back(file, index, material, tissue.cell_size, &effects);
        }
        self.cohesive_openings(file, &material, tissue.cell_size, &effects);
        if let Some(mesh) = &mesh {
            let scheme = effects.puncture.map_or(SchemeWord::Ring, |p| p.scheme);
            self.geometry_of_mesh(mesh, tool.as_ref(), (&motion, scheme), &faces);
        } else {
            let open_bottom = faces[Face::ZMin as usize].fixed == [false; 3] && effects.cohesive.is_none();
            self.geometry(&tissue, tool.as_ref(), &motion, open_bottom);
        }
        self.overlaps(&regions, &tissue, mesh.as_deref());
        self.targets_inside(&targets, &tissue, mesh.as_deref());
        self.problems.check()?;
        if mesh.is_none() {
            self.memory(&tissue, tool.as_ref(), &motion);
        }
        self.problems.check()?;
        let cells = match &mesh {
            Some(tets) => Mesh::Tets(tets.clone()),
            None => Mesh::Block(BlockMesh::layered(&tissue, tool.as_ref().map(|_| &motion), &regions)),
        };
        self.cells(&cells, &material, &regions, &tissue, &effects);
        let scene = Scene {
            title: file.title.clone().unwrap_or_else(|| name.replace('_', " ")),
            name,
            path: path.to_path_buf(),
            tissue,
            material,
            regions,
            mesh,
            case,
            supports,
            loads,
            skin_free,
            faces,
            tool,
            motion,
            effects,
            solver,
            outputs,
            targets,
            task,
            notices: std::mem::take(&mut self.notices),
        };
        if scene.mesh.is_none() {
            self.planes(&scene);
            self.problems.check()?;
        }
        Ok(scene)
    }

    /// Every plane of [cohesive] has a grid line of its own, and leaves no cells so thin that they decide the time step.
    fn planes(&mut self, scene: &Scene) {
        /// Thinnest cell beside a plane, in parts of the cell size.
        const THINNEST: f64 = 0.1;
        let Some(cohesive) = scene.effects.cohesive.as_ref().filter(|c| !c.planes.is_empty()) else { return };
        let grid = BlockMesh::for_scene(scene);
        // A plane that is there twice has no grid line, whatever lies beside it.
        for (index, plane) in cohesive.planes.iter().enumerate() {
            if cohesive.planes[..index].iter().any(|other| (other.axis, other.at) == (plane.axis, plane.at)) {
                let axis = ["x", "y", "z"][plane.axis];
                self.problems.report(
                    &format!("cohesive.plane.{index}.at_mm"),
                    format!("the plane {axis} = {} mm is there already", four_digits(plane.at / MM)),
                    "the same plane",
                    "remove one of the two",
                );
            }
        }
        if !self.problems.is_empty() {
            return;
        }
        for (index, plane) in cohesive.planes.iter().enumerate() {
            let axis = ["x", "y", "z"][plane.axis];
            let lines = &grid.lines[plane.axis];
            let doubled = lines.iter().filter(|line| **line == plane.at).count() == 2 && lines.is_sorted();
            let gap = |line: &f64| Some((line - plane.at).abs()).filter(|gap| *gap > 0.0);
            let thinnest = lines.iter().filter_map(gap).fold(f64::INFINITY, f64::min);
            if doubled && thinnest >= THINNEST * scene.tissue.cell_size {
                continue;
            }
            self.problems.report(
                &format!("cohesive.plane.{index}.at_mm"),
                format!(
                    "the plane {axis} = {} mm lies {} mm from another plane, slit or face, too close for cells of {} mm",
                    four_digits(plane.at / MM),
                    four_digits(thinnest / MM),
                    four_digits(scene.tissue.cell_size / MM)
                ),
                "no grid line of its own",
                format!(
                    "move it to at least {} mm from the others and from the faces, write a smaller tissue.cell_size_mm, or remove \
                     one of two planes that mean the same",
                    four_digits(scene.tissue.cell_size / MM)
                ),
            );
        }
    }

    /// Reports a number outside its range and returns it unchanged.
    fn number(&mut self, path: &str, value: f64, within: Within) -> f64 {
        if !within.holds(value) {
            let range = within.words();
            self.problems.report(
                path,
                format!("`{path}` is {value}"),
                format!("must be {range}"),
                format!("write a number {range}; the unit is the end of the key"),
            );
        }
        value
    }

    /// An optional number in SI: `value * unit` where it is written, else `default` (already SI).
    fn optional(&mut self, path: &str, value: Option<f64>, unit: f64, default: f64, within: Within) -> f64 {
        value.map_or(default, |value| self.number(path, value, within) * unit)
    }

    /// Ranges of the plain numbers of a table at `at`, in its order.
    fn ranges<T: Table>(&mut self, at: &str, table: &T) {
        for key in T::KEYS {
            if let Some(value) = (key.written)(table) {
                self.number(&format!("{at}.{}", key.key), value, key.within);
            }
        }
    }

    /// The plain numbers of a table at `at` over the defaults of its effect.
    fn table<T: Table<Params: Default>>(&mut self, at: &str, table: &T) -> T::Params {
        self.ranges(at, table);
        table.over(T::Params::default())
    }

    /// A vector of which every component lies within +-limit.
    fn vector(&mut self, path: &str, value: [f64; 3], limit: f64) -> DVec3 {
        for (index, component) in value.iter().enumerate() {
            self.number(&format!("{path}.{index}"), *component, Within::Between(-limit, limit));
        }
        DVec3::from(value)
    }

    /// The tissue, and the mesh or the label map where the scene names one.
    fn tissue(&mut self, file: &SceneFile) -> (Tissue, Option<Arc<TetMesh>>, Option<Arc<Case>>) {
        let table = &file.tissue;
        // Stands in after a reported problem; it never leaves `scene`.
        let mut tissue = Tissue {
            size: DVec3::splat(10.0 * MM),
            top: 0.0,
            cell_size: MM,
            fine_radius: self.optional(
                "tissue.fine_radius_mm",
                table.fine_radius_mm,
                MM,
                2.5 * MM,
                Within::Positive(1000.0),
            ),
            growth: self.optional("tissue.growth", table.growth, 1.0, 1.25, Within::Between(1.0, 2.0)),
            axis_offset_cells: table.axis_offset_cells.unwrap_or([0.23, 0.31]),
        };
        for (index, value) in tissue.axis_offset_cells.into_iter().enumerate() {
            self.number(&format!("tissue.axis_offset_cells.{index}"), value, Within::Between(0.0, 1.0));
        }
        if table.labels.is_some() || !table.surfaces.is_empty() {
            self.has_labels = true;
            let case = self.labelled_tissue(file, &mut tissue);
            return (tissue, None, case);
        }
        if let Some(name) = &table.mesh {
            let mesh = self.mesh(name, table);
            if let Some(mesh) = &mesh {
                (tissue.size, tissue.cell_size) = mesh::extent(mesh);
            }
            return (tissue, mesh, None);
        }
        self.no_placement(table);
        for (key, written) in [("unit", table.unit.is_some()), ("accept_size", table.accept_size.is_some())] {
            if written {
                self.notices.push(format!("`tissue.{key}` has no effect without tissue.mesh."));
            }
        }
        let (Some(size_mm), Some(cell)) = (table.size_mm, table.cell_size_mm) else {
            let missing = match (table.size_mm, table.cell_size_mm) {
                (None, None) => "neither a block nor a mesh",
                (None, _) => "no `size_mm`",
                _ => "no `cell_size_mm`",
            };
            self.problems.report(
                "tissue",
                format!("the tissue has {missing}"),
                "incomplete",
                "write size_mm = [20, 20, 16] and cell_size_mm = 0.6, or mesh = \"part.msh\" and unit = \"mm\"",
            );
            return (tissue, None, None);
        };
        for (index, size) in size_mm.iter().enumerate() {
            self.number(&format!("tissue.size_mm.{index}"), *size, Within::Positive(1000.0));
        }
        let smallest = size_mm.iter().cloned().fold(f64::INFINITY, f64::min);
        self.number("tissue.cell_size_mm", cell, Within::Between(1e-3, 100.0));
        if cell > 0.5 * smallest && smallest > 0.0 {
            self.problems.report(
                "tissue.cell_size_mm",
                format!("a cell of {cell} mm is more than half of the smallest edge of the block ({smallest} mm)"),
                "too coarse",
                format!("write at most {}", 0.5 * smallest),
            );
        }
        (tissue.size, tissue.cell_size) = (DVec3::from(size_mm) * MM, cell * MM);
        (tissue, None, None)
    }

    /// The block that lies in a label map.
    fn labelled_tissue(&mut self, file: &SceneFile, tissue: &mut Tissue) -> Option<Arc<Case>> {
        let Some(cell) = file.tissue.cell_size_mm else {
            self.problems.report(
                "tissue",
                "the tissue has no `cell_size_mm`",
                "incomplete",
                "write cell_size_mm = 0.8, the edge of the cells around the path",
            );
            return None;
        };
        tissue.cell_size = self.number("tissue.cell_size_mm", cell, Within::Between(1e-3, 100.0)) * MM;
        let placed = self.case(file, tissue)?;
        self.path = placed.path;
        Some(placed.case)
    }

    fn unknown_name(&mut self, path: &str, what: &str, name: &str, names: &[&str]) {
        let list = names.join(", ");
        let way_out = match closest(name, names.iter().copied()) {
            Some(near) => format!("did you mean \"{near}\"? There are: {list}"),
            None => format!("use one of: {list}"),
        };
        self.problems.report(path, format!("there is no {what} called \"{name}\""), "unknown name", way_out);
    }

    /// `cell_size`: edge of the cells in the fine zone [m].
    fn solver(&mut self, table: &SolverTable, has_tool: bool, punctures: bool, cell_size: f64) -> SolverSettings {
        let duration = table.duration_s.map(|value| self.number("solver.duration_s", value, Within::Positive(3600.0)));
        if has_tool && duration.is_some() {
            self.notices
                .push("`solver.duration_s` has no effect: with a tool the phases decide how long the run is.".into());
        }
        if !has_tool && duration.is_none() {
            self.problems.report(
                "solver",
                "a scene without a tool needs the length of the run",
                "no solver.duration_s",
                "add duration_s = 1.0 under [solver], or add a tool",
            );
        }
        SolverSettings {
            on_trouble: table.on_trouble.unwrap_or_default(),
            safety: self.optional("solver.safety", table.safety, 1.0, 0.8, Within::Positive(1.0)),
            time_step: table
                .time_step_us
                .map(|value| self.number("solver.time_step_us", value, Within::Positive(1e5)) * 1e-6),
            mass_damping: self.optional(
                "solver.mass_damping_per_s",
                table.mass_damping_per_s,
                1.0,
                10.0,
                Within::NotNegative(1e5),
            ),
            hourglass_stiffness: self.optional(
                "solver.hourglass_stiffness",
                table.hourglass_stiffness,
                1.0,
                0.1,
                Within::NotNegative(10.0),
            ),
            hourglass_quartic: self.optional(
                "solver.hourglass_quartic",
                table.hourglass_quartic,
                1.0,
                hourglass_quartic(punctures, cell_size),
                Within::NotNegative(1e6),
            ),
            frame_rate: self.optional(
                "solver.frame_rate_hz",
                table.frame_rate_hz,
                1.0,
                60.0,
                Within::Between(LOWEST_FRAME_RATE, HIGHEST_FRAME_RATE),
            ),
            duration: if has_tool { None } else { duration },
        }
    }

    /// The path stays inside the block.
    fn geometry(&mut self, tissue: &Tissue, tool: Option<&Tool>, motion: &Motion, open_bottom: bool) {
        let Some(tool) = tool else { return };
        let half = tissue.size * 0.5;
        let show = |p: DVec3| format!("({:.3}, {:.3}, {:.3}) mm", p.x / MM, p.y / MM, p.z / MM);
        let range =
            format!("x {:.3} to {:.3}, y {:.3} to {:.3} mm", -half.x / MM, half.x / MM, -half.y / MM, half.y / MM);
        if motion.entry.x.abs() > half.x || motion.entry.y.abs() > half.y {
            self.problems.report(
                "motion.entry_mm",
                format!("the entry point {} lies outside the top face ({range})", show(motion.entry)),
                "outside the block",
                format!("choose entry_mm inside {range}"),
            );
            return;
        }
        if motion.is_free() {
            self.free_geometry(tissue, tool, motion);
            return;
        }
        // A needle may leave through the bottom; what it does below does not matter here.
        let through = matches!(tool, Tool::Needle(_)) && open_bottom;
        let end = motion.deepest_point_in(tissue.size.z);
        // The shaft of a needle is inside the tissue, a sphere or punch is not.
        let radius = match tool {
            Tool::Needle(shape) => shape.radius,
            Tool::Sphere { .. } | Tool::FlatPunch { .. } => 0.0,
        };
        let margin = PATH_MARGIN + radius;
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            for (key, point) in [("entry_mm", motion.entry), ("phase", end)] {
                if half[axis] - point[axis].abs() < margin {
                    self.problems.report(
                        &format!("motion.{key}"),
                        format!(
                            "the path comes within {:.3} mm of a side: {} with the sides at {name} = +-{:.3} mm",
                            margin / MM,
                            show(point),
                            half[axis] / MM
                        ),
                        "the path leaves the block sideways",
                        "move entry_mm away from the side, choose a steeper direction or a smaller depth_mm, or enlarge tissue.size_mm",
                    );
                    return;
                }
            }
        }
        if tissue.size.z + end.z < PATH_MARGIN && !through {
            let deepest = motion.phases.iter().enumerate().max_by(|a, b| {
                let depth = |phase: &Phase| match *phase {
                    Phase::Insert { depth, .. } => depth,
                    _ => 0.0,
                };
                depth(a.1).total_cmp(&depth(b.1))
            });
            let index = deepest.map_or(0, |(index, _)| index);
            self.problems.report(
                &format!("motion.phase.{index}.depth_mm"),
                format!(
                    "the path ends at {}, less than {} mm above the bottom at z = {:.3} mm",
                    show(motion.deepest_point()),
                    PATH_MARGIN / MM,
                    -tissue.size.z / MM
                ),
                "too deep for this block",
                format!(
                    "write depth_mm of at most {:.3}, or enlarge tissue.size_mm, or let a needle leave with boundaries.z_min = \
                     \"free\" (the sides hold the block)",
                    (tissue.size.z - PATH_MARGIN) / -motion.direction.z / MM
                ),
            );
        }
    }

    /// A free motion stays inside the block: the tip, and the needle where it enters the surface.
    fn free_geometry(&mut self, tissue: &Tissue, tool: &Tool, motion: &Motion) {
        let half = tissue.size * 0.5;
        let radius = match tool {
            Tool::Needle(shape) => shape.radius,
            Tool::Sphere { .. } | Tool::FlatPunch { .. } => 0.0,
        };
        let margin = PATH_MARGIN + radius;
        for (index, leg) in motion.legs().into_iter().enumerate() {
            const PARTS: u32 = 50;
            let samples = (0..=PARTS).map(|i| leg.at(leg.duration * f64::from(i) / f64::from(PARTS)));
            let beyond = |x: DVec3| x.x.abs() > half.x - margin || x.y.abs() > half.y - margin;
            let leaves = samples.filter(|p| p.depth > 0.0).find_map(|p| {
                let surface = p.tip - p.direction * p.depth;
                let bottom = p.tip.z < PATH_MARGIN - tissue.size.z;
                if beyond(p.tip) || bottom { Some(p.tip) } else { beyond(surface).then_some(surface) }
            });
            let Some(x) = leaves else { continue };
            self.problems.report(
                &format!("motion.phase.{index}"),
                format!(
                    "the needle passes ({:.3}, {:.3}, {:.3}) mm, less than {:.3} mm from a side or {:.3} mm from the bottom",
                    x.x / MM,
                    x.y / MM,
                    x.z / MM,
                    margin / MM,
                    PATH_MARGIN / MM
                ),
                "the path leaves the block",
                format!(
                    "keep it within x +-{:.3}, y +-{:.3} mm above z = {:.3} mm, or enlarge tissue.size_mm",
                    (half.x - margin) / MM,
                    (half.y - margin) / MM,
                    (PATH_MARGIN - tissue.size.z) / MM
                ),
            );
            return;
        }
    }

    /// The mesh fits into the memory of this computer and into the bindings of every device.
    fn memory(&mut self, tissue: &Tissue, tool: Option<&Tool>, motion: &Motion) {
        let motion = tool.map(|_| motion);
        let mesh = BlockMesh::for_tissue(tissue, motion);
        let (excess, limit) = mesh_excess(&mesh);
        if excess <= 1.0 {
            return;
        }
        let mut enough = tissue.clone();
        while mesh_excess(&BlockMesh::for_tissue(&enough, motion)).0 > 1.0 {
            // Between a path and a block the count falls with some power of the edge from 1 to 3.
            enough.cell_size *= 1.1;
        }
        let [nx, ny, nz] = mesh.cells();
        let (cells, nodes) = (product(mesh.cells()), product(mesh.nodes()));
        self.problems.report(
            "tissue.cell_size_mm",
            format!(
                "the mesh of {nx} x {ny} x {nz} cells is too fine: it needs {} GiB; {limit}",
                gib(cells * BYTES_PER_CELL + nodes * BYTES_PER_NODE)
            ),
            "too fine",
            format!(
                "write a cell_size_mm of {:.3} or more, or a smaller block or fine_radius_mm",
                enough.cell_size / MM + 5e-4
            ),
        );
    }
}

/// Need over limit of a mesh for its tightest limit, and that limit in words.
fn mesh_excess(mesh: &BlockMesh) -> (f64, String) {
    let (cells, nodes) = (product(mesh.cells()), product(mesh.nodes()));
    let bytes = cells * BYTES_PER_CELL + nodes * BYTES_PER_NODE;
    let binding = cells * BINDING_BYTES_PER_CELL;
    let mut limits = vec![
        (nodes / 2f64.powi(31), format!("it has {nodes:.3e} nodes and the index holds 2^31")),
        (
            binding / LARGEST_BINDING,
            format!("one of its buffers takes {} GiB and portable devices offer 0.125 GiB", gib(binding)),
        ),
    ];
    if let Some(available) = available_memory() {
        let half = 0.5 * available;
        limits.push((bytes / half, format!("half of the available memory is {} GiB", gib(half))));
    }
    limits.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).expect("two limits at least")
}

/// Product of three counts in floating point: for three long axes it may not fit an index.
fn product(counts: [usize; 3]) -> f64 {
    counts.iter().map(|n| *n as f64).product()
}

fn gib(bytes: f64) -> f64 {
    four_digits(bytes / (1024.0 * 1024.0 * 1024.0))
}

/// Memory that the system can give now [B]; `None` where /proc/meminfo does not exist.
fn available_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("MemAvailable:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024.0)
}
