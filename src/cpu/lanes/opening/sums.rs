//! What lanes derive of the sections of a path, added up chunk by chunk: chunks are the same for any number of threads.

use glam::DVec3;

use super::WIDEST;
use crate::needle::opening::Derivatives;

/// Rows of what a lane gives its section: by the place [N], by the rate of the middle [J], by the radius [N] and its rate [J], energy [J],
/// moment [N m], energy of the shape without relaxation [J].
pub(super) const SUMS: usize = 13;

/// Sums of these rows.
pub(super) type Rows = [f64; SUMS];

/// Derivatives of the energy of points by what their station is.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::cpu) struct PointSums {
    pub place: DVec3,
    pub centre_rate: DVec3,
    pub radius: f64,
    pub radius_rate: f64,
    /// Moment of the forces on nodes about the path.
    pub moment: DVec3,
    pub energy: f64,
    /// Energy of the shape without relaxation [J].
    pub shape: f64,
}

/// First station and number of stations in a cell, and what is derived of their mean.
pub(in crate::cpu) type OfSpan = ((u16, u16), PointSums);

impl PointSums {
    /// Of derivatives and an energy per volume.
    pub fn new(d: &Derivatives<f64>, moment: DVec3, energy: f64, volume: f64) -> Self {
        let (place, centre_rate) = (DVec3::from(d.place), DVec3::from(d.centre_rate));
        let (radius, radius_rate) = (d.radius, d.radius_rate);
        PointSums { place, centre_rate, radius, radius_rate, moment, energy, shape: energy }.times(volume)
    }

    /// Adds others.
    pub fn add(&mut self, other: &Self) {
        self.place += other.place;
        self.centre_rate += other.centre_rate;
        self.radius += other.radius;
        self.radius_rate += other.radius_rate;
        self.moment += other.moment;
        self.energy += other.energy;
        self.shape += other.shape;
    }

    /// All of it `by` times.
    pub fn times(&self, by: f64) -> Self {
        PointSums {
            place: self.place * by,
            centre_rate: self.centre_rate * by,
            radius: self.radius * by,
            radius_rate: self.radius_rate * by,
            moment: self.moment * by,
            energy: self.energy * by,
            shape: self.shape * by,
        }
    }

    /// Adds what lanes have found.
    pub(super) fn add_rows(&mut self, rows: &Rows) {
        let [px, py, pz, rx, ry, rz, radius, radius_rate, energy, mx, my, mz, shape] = *rows;
        self.add(&PointSums {
            place: DVec3::new(px, py, pz),
            centre_rate: DVec3::new(rx, ry, rz),
            radius,
            radius_rate,
            moment: DVec3::new(mx, my, mz),
            energy,
            shape,
        });
    }
}

/// Sections of some vectors: the first, and how many from it on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chunk {
    first: usize,
    count: usize,
}

impl Chunk {
    /// From the sections of the lanes of every chunk.
    pub fn all(sections: impl Iterator<Item = Vec<usize>>) -> Vec<Self> {
        let chunk = |of_lanes: Vec<usize>| {
            let first = of_lanes.iter().copied().min().unwrap_or(0);
            let count = of_lanes.iter().map(|section| section + 1 - first).max().unwrap_or(0);
            Chunk { first, count }
        };
        sections.map(chunk).collect()
    }

    /// Sums for all of them.
    pub fn rows(all: &[Self]) -> Vec<Rows> {
        vec![[0.0; SUMS]; all.iter().map(|chunk| chunk.count).sum()]
    }

    /// Calls `add` with every section of every chunk, in their order, and its sums there.
    pub fn add(all: &[Self], mut rows: &[Rows], mut add: impl FnMut(usize, &Rows)) {
        for chunk in all {
            let own;
            (own, rows) = rows.split_at(chunk.count);
            for (section, rows) in (chunk.first..).zip(own) {
                add(section, rows);
            }
        }
    }
}

/// The sums of chunks that are still to be handed out.
pub(super) struct SomeSums<'a> {
    chunks: std::slice::Iter<'a, Chunk>,
    rows: &'a mut [Rows],
}

impl<'a> SomeSums<'a> {
    /// All of them.
    pub fn of(chunks: &'a [Chunk], rows: &'a mut [Rows]) -> Self {
        SomeSums { chunks: chunks.iter(), rows }
    }

    /// Those of the next chunk.
    pub fn next_chunk(&mut self) -> ChunkSums<'a> {
        let chunk = self.chunks.next().copied().unwrap_or(Chunk { first: 0, count: 0 });
        let own;
        (own, self.rows) = std::mem::take(&mut self.rows).split_at_mut(chunk.count);
        ChunkSums { first: chunk.first, rows: own }
    }
}

/// The sums of a chunk.
pub(super) struct ChunkSums<'a> {
    first: usize,
    rows: &'a mut [Rows],
}

impl ChunkSums<'_> {
    /// Takes away what the last step has found.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.rows.fill([0.0; SUMS]);
    }

    /// Adds what a lane has found for its section.
    #[inline(always)]
    pub fn add(&mut self, section: usize, of_lanes: &[[f32; WIDEST]; SUMS], lane: usize) {
        let sums = &mut self.rows[section - self.first];
        for (sum, row) in sums.iter_mut().zip(of_lanes) {
            *sum += f64::from(row[lane]);
        }
    }
}
