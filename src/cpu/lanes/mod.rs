//! Cells of a structured block in lanes of f32: one vector computes as many cells side by side along x as the processor has lanes.
//!
//! Displacements stay f64. Each is split in two f32, `u = high + low`: high is a multiple of 2^-20 m and low of 2^-44 m, so that differences of
//! neighbours are exact, as they are in the fixed point of the GPU engine; and none is so small that its square is denormal, which costs a
//! processor a hundred times the time. What a row of cells does to its four lines of nodes is added up along the row;
//! a second pass adds the four rows around every line. No sum hangs on the number of threads.
//!
//! A vector in which a cell has left the range of `material/regular.rs` is computed cell by cell in f64.

mod nodes;
mod number;
mod rows;

use glam::DVec3;
use pulp::Arch;

use super::team::Team;
use crate::effects::TissueMaterial;
use crate::engine::elements::{CellForces, Elements};
use crate::material::law::IsochoricLaw;
use crate::material::regular::Polynomial;
use crate::material_point::Material;
use crate::mesh::{BlockMesh, Mesh};
use crate::model::Model;
use crate::scene::Scene;
use rows::{CellRows, gather_rows};

/// Most values of a vector.
const WIDEST: usize = 16;
/// f32 per line of nodes in [`LaneBlock::places`]: high and low part of every axis.
const PLACE: usize = 6;
/// f32 per row of cells in [`LaneBlock::lines`]: force of every axis on four lines of nodes, and the bound of all.
const LINES: usize = 13;
/// f32 per line of nodes in [`LaneBlock::nodes`]: force of every axis, and the bound.
const NODE: usize = 4;

/// Constants of a material, as a vector needs them.
#[derive(Debug, Clone, Copy)]
struct LaneMaterial {
    law: Polynomial,
    bulk_modulus: f64,
    /// kappa 3.11 mu0 [Pa].
    hourglass: f64,
}

/// What varies along x: an entry per cell, zeros behind the last and for gaps.
#[derive(Debug, Default)]
struct EdgesX {
    /// [m], 1/(4 d) [1/m], d^(1/3), d^(-2/3).
    length: Vec<f32>,
    quarter: Vec<f32>,
    cube_root: Vec<f32>,
    inverse_square: Vec<f32>,
}

/// The same of one cell along y or z.
#[derive(Debug, Clone, Copy)]
struct Edge {
    length: f32,
    quarter: f32,
    cube_root: f32,
    inverse_square: f32,
}

impl Edge {
    fn new(length: f64) -> Self {
        let exact = |x: f64| if length > 0.0 { x as f32 } else { 0.0 };
        Edge {
            length: length as f32,
            quarter: exact(0.25 / length),
            cube_root: length.cbrt() as f32,
            inverse_square: exact(length.powf(-2.0 / 3.0)),
        }
    }
}

/// What does not change.
struct Grid {
    arch: Arch,
    cells: [usize; 3],
    /// f32 of a row.
    stride: usize,
    x: EdgesX,
    y: Vec<Edge>,
    z: Vec<Edge>,
    materials: Vec<LaneMaterial>,
    quartic: f64,
    /// 1 for cells where open faces meet, in rows of `stride`; empty: none.
    on_edge: Vec<f32>,
}

impl Grid {
    /// Where the first number of a node stands in [`LaneBlock::nodes`]; the next follow a row later each.
    fn first_number(&self, node: usize) -> usize {
        let width = self.cells[0] + 1;
        node / width * NODE * self.stride + node % width
    }

    /// Force on a node (-f_int) [N] and its stiffness bound [N/m].
    fn node_at(&self, nodes: &[f32], node: usize) -> (DVec3, f64) {
        let first = self.first_number(node);
        let value = |number: usize| f64::from(nodes[first + number * self.stride]);
        (DVec3::new(value(0), value(1), value(2)), value(3))
    }
}

/// A block in lanes.
pub struct LaneBlock {
    grid: Grid,
    team: Team,
    places: Vec<f32>,
    lines: Vec<f32>,
    nodes: Vec<f32>,
}

impl LaneBlock {
    /// # Errors
    /// What the lanes do not know of the model.
    pub fn new(model: &Model, elements: &Elements) -> Result<Self, String> {
        let block = known_block(&model.mesh)?;
        let material = |(index, m): (usize, &Material)| {
            let (law, bulk_modulus) = (known_law(m)?, m.law.bulk_modulus);
            Ok(LaneMaterial { law, bulk_modulus, hourglass: elements.hourglass_of(index) })
        };
        let materials: Vec<LaneMaterial> =
            model.materials.iter().enumerate().map(material).collect::<Result<_, String>>()?;
        let cells = block.cells();
        let [nx, ny, nz] = cells;
        let stride = (nx + 1 + WIDEST).next_multiple_of(WIDEST);
        let edges =
            |axis: usize| -> Vec<Edge> { block.lines[axis].windows(2).map(|w| Edge::new(w[1] - w[0])).collect() };
        let along_x = |value: fn(&Edge) -> f32| {
            let mut values: Vec<f32> = edges(0).iter().map(value).collect();
            values.resize(stride, 0.0);
            values
        };
        let mut on_edge = vec![0.0; ny * nz * stride];
        for cell in (0..block.cell_count()).filter(|c| elements.is_on_edge(model, *c)) {
            let [i, j, k] = block.cell_coordinates(cell);
            on_edge[(k * ny + j) * stride + i] = 1.0;
        }
        if on_edge.iter().all(|e| *e == 0.0) {
            on_edge.clear();
        }
        let lines = (ny + 1) * (nz + 1) * stride;
        Ok(LaneBlock {
            grid: Grid {
                arch: Arch::new(),
                cells,
                stride,
                x: EdgesX {
                    length: along_x(|e| e.length),
                    quarter: along_x(|e| e.quarter),
                    cube_root: along_x(|e| e.cube_root),
                    inverse_square: along_x(|e| e.inverse_square),
                },
                y: edges(1),
                z: edges(2),
                materials,
                quartic: elements.quartic(),
                on_edge,
            },
            team: Team::new(threads_for(block.cell_count())),
            places: vec![0.0; lines * PLACE],
            lines: vec![0.0; ny * nz * LINES * stride],
            nodes: vec![0.0; lines * NODE],
        })
    }

    /// The threads that its stages share.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// Law of a material.
    pub fn law(&self, material: usize) -> Polynomial {
        self.grid.materials[material].law
    }

    /// Values of a vector.
    pub fn width(&self) -> usize {
        struct Width;
        impl pulp::WithSimd for Width {
            type Output = usize;

            fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
                S::F32_LANES
            }
        }
        self.grid.arch.dispatch(Width)
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        4 * (self.places.len() + self.lines.len() + self.nodes.len() + self.grid.on_edge.len())
    }

    /// Forces and bounds of all cells at the nodes, for this displacement and the stiffness that a path left (empty: all of it).
    pub fn compute(&mut self, model: &Model, elements: &Elements, displacement: &[DVec3], stiffness: &[f64]) {
        let LaneBlock { grid, team, places, lines, nodes } = self;
        let (stride, [_, ny, nz]) = (grid.stride, grid.cells);
        let weakened = stiffness.iter().any(|s| *s != 1.0);
        let stiffness = if weakened { stiffness } else { &[] };
        let rows = CellRows { grid, places, model, elements, displacement, stiffness };
        let part = team.part(ny * nz);
        team.map(lines.chunks_mut(part * LINES * stride), |i, lines| rows.compute(i * part, lines));
        let lines = lines.as_slice();
        let part = team.part((ny + 1) * (nz + 1));
        team.map(nodes.chunks_mut(part * NODE * stride), |i, nodes| gather_rows(grid, lines, i * part, nodes));
    }

    /// Takes in a displacement that the last step did not make.
    pub fn take(&mut self, displacement: &[DVec3]) {
        let (stride, width) = (self.grid.stride, self.grid.cells[0] + 1);
        let lines = self.places.chunks_exact_mut(PLACE * stride).zip(self.nodes.chunks_exact(NODE * stride));
        for ((places, nodes), u) in lines.zip(displacement.chunks(width)) {
            NodeLine { stride, places, nodes }.set_places(u);
        }
    }

    /// Force on a node (-f_int) [N] and its stiffness bound [N/m].
    pub fn at(&self, node: usize) -> (DVec3, f64) {
        self.grid.node_at(&self.nodes, node)
    }

    /// Adds forces of a cell (with the sign of f_int) and its bounds.
    pub fn add(&mut self, nodes: &[usize], forces: &CellForces) {
        for (corner, node) in nodes.iter().enumerate() {
            let first = self.grid.first_number(*node);
            for axis in 0..3 {
                self.nodes[first + axis * self.grid.stride] -= forces.force[corner][axis] as f32;
            }
            self.nodes[first + 3 * self.grid.stride] += forces.bound[corner] as f32;
        }
    }
}

/// What lanes do not know of a scene on a mesh; `None`: they know it.
pub fn unknown_to_lanes(scene: &Scene, mesh: &Mesh) -> Option<String> {
    let mut tissues = std::iter::once(&scene.material).chain(scene.regions.iter().map(|region| &region.material));
    let known = |tissue: &TissueMaterial| known_law(&Material::of(tissue, &scene.effects)).map(drop);
    known_block(mesh).map(drop).and_then(|()| tissues.try_for_each(known)).err()
}

fn known_block(mesh: &Mesh) -> Result<&BlockMesh, String> {
    match mesh {
        Mesh::Block(block) if block.bore.is_none() => Ok(block),
        Mesh::Block(_) => Err("the grid around a hollow needle".into()),
        Mesh::Tets(_) => Err("tetrahedra".into()),
    }
}

fn known_law(material: &Material) -> Result<Polynomial, String> {
    let effects = [
        (material.plasticity.is_some(), "plasticity"),
        (material.viscoelastic.is_some(), "viscoelasticity"),
        (material.damage.is_some(), "damage"),
        (material.fibres.is_some(), "fibres"),
        (!material.own.is_empty(), "effects of a program's own"),
    ];
    if let Some((_, name)) = effects.into_iter().find(|(is_on, _)| *is_on) {
        return Err(name.into());
    }
    let law = &material.law.isochoric;
    law.polynomial().ok_or_else(|| format!("the law {}", law.key()))
}

/// Threads that a block is worth: a stage of a few hundred cells is done before another thread has joined.
fn threads_for(cells: usize) -> usize {
    const CELLS_PER_THREAD: usize = 800;
    rayon::current_num_threads().min(cells / CELLS_PER_THREAD).max(1)
}

/// A line of nodes along x.
struct NodeLine<'a> {
    stride: usize,
    places: &'a mut [f32],
    nodes: &'a [f32],
}

impl NodeLine<'_> {
    /// Forces of the cells on the nodes of the line (-f_int) [N], by axis, and their stiffness bounds [N/m].
    #[inline(always)]
    fn numbers(&self, count: usize) -> [&[f32]; NODE] {
        let mut numbers = [&self.nodes[..count]; NODE];
        for (number, values) in numbers.iter_mut().enumerate() {
            *values = &self.nodes[number * self.stride..][..count];
        }
        numbers
    }

    /// Keeps the displacement of its nodes as `u = high + low`.
    pub fn set_places(&mut self, displacement: &[DVec3]) {
        // Adding what has digits of 2^-20 m, and of 2^-44 m, rounds to them.
        const ROUNDED: f32 = 12.0;
        const FINE: f32 = 1.5 / (1 << 21) as f32;
        for (axis, both) in self.places.chunks_exact_mut(2 * self.stride).enumerate() {
            let (high, low) = both.split_at_mut(self.stride);
            for ((high, low), u) in high.iter_mut().zip(low).zip(displacement) {
                let u = u[axis];
                *high = (u as f32 + ROUNDED) - ROUNDED;
                *low = ((u - f64::from(*high)) as f32 + FINE) - FINE;
            }
        }
    }
}
