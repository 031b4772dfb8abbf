//! The arrays of the device: one entry per array tells what it holds, how long, where it lies and who reads and writes it. Allocation,
//! read-backs, checkpoints, changes of numbers and the textures of llvmpipe follow from the entries.
//!
//! A file per owner; the name of an entry is that of the shader variable.

mod cohesive;
mod contact;
mod drawn;
mod material;
mod mesh;
mod opening;
mod own;
mod puncture;
mod sums;

use std::cell::OnceCell;

use glam::DVec3;

use super::grain::Grain;
use super::layout::Layout;
use crate::engine::{FrameSums, State};
use crate::model::Model;

pub use mesh::{STEP_INPUT, STEP_STRIDE, busy_nodes, centre_line, displacement, step_input};
pub use opening::{opening_counts, section_counts};
pub use puncture::free_cell_count;
pub use sums::{CONTACT_PARTS, FACE_PARTS, SEPARATION_PARTS};

/// How long what an array holds is good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Life {
    /// From the start on, or from the last change of numbers.
    Constant,
    /// Steps change it; where a later step may read it, a checkpoint holds it.
    State,
    /// The same, but between frames its counts have been told: a change of numbers writes it anew.
    Told,
    /// Given anew for every frame.
    Input,
    /// What a frame tells, and nothing that the next one needs.
    Result,
    /// What a window draws: it follows from the state.
    Drawn,
}

/// Where an array lies for an adapter that reads storage buffers badly, see [`super::texels`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// In a buffer like everywhere.
    Buffer,
    /// In a texture of one number per texel, which shaders read and write. At most four occur in one stage, as many storage textures as
    /// a portable device binds.
    Texels,
    /// In a texture that is sampled, with this many numbers per texel: no shader writes it.
    Sampled(u64),
    /// A uniform for the stages that do not write it: small, and read by all threads in the same places. With the number of its
    /// entries; none for what is no array.
    Uniform(Option<&'static str>),
}

/// What an array holds at the start: bytes, or zeros of a size.
pub enum Contents {
    Bytes(Vec<u8>),
    Zeros(u64),
}

/// What arrays are filled from.
pub struct Source<'a> {
    pub model: &'a Model,
    pub layout: &'a Layout,
    /// Time step [s].
    pub dt: f64,
    /// How finely work is cut.
    pub grain: Grain,
    /// Most steps of a frame.
    pub max_steps: usize,
    /// Tables of an opened path, made for the first array that asks.
    pub opening: OnceCell<opening::Tables>,
}

impl Source<'_> {
    fn opening(&self) -> &opening::Tables {
        self.opening.get_or_init(|| opening::tables_of(self.model, self.layout, self.grain))
    }

    fn nodes(&self) -> u64 {
        self.model.mesh.node_count() as u64
    }

    fn cells(&self) -> u64 {
        self.model.mesh.cell_count() as u64
    }
}

/// Sums of a frame under way.
pub struct Sums {
    pub sums: FrameSums,
    /// 1 where the frame has steps, else 0.
    pub has_steps: f64,
    /// Sum of nodal mass times displacement [kg m].
    pub moment: DVec3,
    /// Displacement of the nodes around the targets [m].
    pub corners: Vec<DVec3>,
}

/// How the state that both engines give and take is found in an array.
#[derive(Clone, Copy)]
pub struct Exchange {
    /// Takes what the array holds into a state.
    pub read: fn(&[u8], &Model, &mut State),
    /// What the array holds of a state.
    pub write: fn(&Source, &State) -> Vec<u8>,
}

/// One array.
#[derive(Clone, Copy)]
pub struct Array {
    pub name: &'static str,
    pub life: Life,
    pub place: Place,
    pub fill: fn(&Source) -> Contents,
    pub state: Option<Exchange>,
    /// Adds what it tells of a frame.
    pub add: Option<fn(&[u8], &mut Sums)>,
    /// Where that begins in it [bytes].
    pub told_from: fn(&Source) -> u64,
}

impl Array {
    const fn new(name: &'static str, life: Life, fill: fn(&Source) -> Contents) -> Self {
        Array { name, life, place: Place::Buffer, fill, state: None, add: None, told_from: |_| 0 }
    }

    const fn constant(name: &'static str, fill: fn(&Source) -> Contents) -> Self {
        Self::new(name, Life::Constant, fill)
    }

    const fn state(name: &'static str, fill: fn(&Source) -> Contents) -> Self {
        Self::new(name, Life::State, fill)
    }

    const fn result(name: &'static str, fill: fn(&Source) -> Contents, add: fn(&[u8], &mut Sums)) -> Self {
        Array { add: Some(add), ..Self::new(name, Life::Result, fill) }
    }

    const fn at(self, place: Place) -> Self {
        Array { place, ..self }
    }

    const fn exchanged(self, read: fn(&[u8], &Model, &mut State), write: fn(&Source, &State) -> Vec<u8>) -> Self {
        Array { state: Some(Exchange { read, write }), ..self }
    }
}

/// All arrays; what they tell of a frame is summed up in this order.
pub fn all() -> impl Iterator<Item = &'static Array> {
    let owners: [&[Array]; 9] = [
        mesh::ARRAYS,
        material::ARRAYS,
        own::ARRAYS,
        contact::ARRAYS,
        puncture::ARRAYS,
        opening::ARRAYS,
        cohesive::ARRAYS,
        sums::ARRAYS,
        drawn::ARRAYS,
    ];
    owners.into_iter().flatten()
}

/// The array that a shader variable names.
pub fn find(name: &str) -> Option<&'static Array> {
    all().find(|array| array.name == name)
}

pub(super) fn bytes_of<T: bytemuck::NoUninit>(values: &[T]) -> Contents {
    Contents::Bytes(bytemuck::cast_slice(values).to_vec())
}

fn zeros(count: u64, size: usize) -> Contents {
    Contents::Zeros(count * size as u64)
}

pub(super) fn vec4(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

/// The three components of a lane.
fn vector(v: [f32; 4]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

fn to_bytes<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

/// Values of a byte slice that need not be aligned.
pub fn read_all<T: bytemuck::Pod>(bytes: &[u8]) -> impl Iterator<Item = T> + '_ {
    bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
}
