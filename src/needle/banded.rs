//! Symmetric band matrices: factors `L D L^T` with the count of negative pivots.
//!
//! By Sylvester's law of inertia the number of negative pivots is the number of negative eigenvalues. The beam uses it to
//! tell a stable state from one past a bifurcation.

/// A symmetric matrix of which only the lower band is stored, row by row, the diagonal last.
#[derive(Debug, Clone)]
pub struct SymmetricBand {
    size: usize,
    half_width: usize,
    rows: Vec<f64>,
}

impl SymmetricBand {
    /// Zero matrix of `size` rows whose entries vanish where row and column differ by more than `half_width`.
    pub fn new(size: usize, half_width: usize) -> Self {
        SymmetricBand { size, half_width, rows: vec![0.0; size * (half_width + 1)] }
    }

    fn index(&self, row: usize, column: usize) -> usize {
        debug_assert!(column <= row && row - column <= self.half_width);
        row * (self.half_width + 1) + self.half_width - (row - column)
    }

    /// Adds to the entry and, by symmetry, to its mirror; only the lower triangle may be addressed.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        let at = self.index(row, column);
        self.rows[at] += value;
    }

    pub fn diagonal(&self, row: usize) -> f64 {
        self.rows[self.index(row, row)]
    }

    /// Matrix times vector.
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.size];
        for row in 0..self.size {
            for column in row.saturating_sub(self.half_width)..row {
                let a = self.rows[self.index(row, column)];
                y[row] += a * x[column];
                y[column] += a * x[row];
            }
            y[row] += self.diagonal(row) * x[row];
        }
        y
    }

    /// Factors without exchange of rows, which keeps the band.
    pub fn factor(mut self) -> BandFactor {
        let mut negative_pivots = 0;
        for row in 0..self.size {
            let first = row.saturating_sub(self.half_width);
            for column in first..row {
                let start = first.max(column.saturating_sub(self.half_width));
                let mut sum = self.rows[self.index(row, column)];
                for k in start..column {
                    // Left of the diagonal stand the entries of L, on it those of D.
                    let l = self.rows[self.index(column, k)];
                    sum -= self.rows[self.index(row, k)] * l;
                }
                let at = self.index(row, column);
                self.rows[at] = sum;
            }
            // So far the row holds L D; divide by D and collect what it takes from the pivot.
            let mut pivot = self.diagonal(row);
            for column in first..row {
                let at = self.index(row, column);
                let scaled = self.rows[at] / self.diagonal(column);
                pivot -= scaled * self.rows[at];
                self.rows[at] = scaled;
            }
            negative_pivots += usize::from(pivot <= 0.0);
            // An exact zero would divide by zero further down; the shift that follows a non-positive pivot removes it.
            let at = self.index(row, row);
            self.rows[at] = if pivot == 0.0 { f64::MIN_POSITIVE.sqrt() } else { pivot };
        }
        BandFactor { band: self, negative_pivots }
    }
}

/// `L D L^T` of a [`SymmetricBand`].
#[derive(Debug, Clone)]
pub struct BandFactor {
    band: SymmetricBand,
    /// Number of negative (or vanishing) eigenvalues of the matrix.
    pub negative_pivots: usize,
}

impl BandFactor {
    pub fn size(&self) -> usize {
        self.band.size
    }

    /// Solves for one right-hand side.
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let band = &self.band;
        let mut x = right.to_vec();
        for row in 0..band.size {
            for column in row.saturating_sub(band.half_width)..row {
                x[row] -= band.rows[band.index(row, column)] * x[column];
            }
        }
        for (row, value) in x.iter_mut().enumerate() {
            *value /= band.diagonal(row);
        }
        for row in (0..band.size).rev() {
            for column in row.saturating_sub(band.half_width)..row {
                x[column] -= band.rows[band.index(row, column)] * x[row];
            }
        }
        x
    }
}
