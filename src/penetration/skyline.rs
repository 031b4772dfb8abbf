//! Direct solver for symmetric matrices in profile (skyline) storage: LDL^T without pivoting, active-column scheme (Bathe, Finite Element
//! Procedures, 8.2.3). Not positive definite matrices are factored too as long as no pivot vanishes; the number of negative pivots is returned.

/// Symmetric matrix: row `i` stores columns `first[i]..=i` of the lower triangle.
#[derive(Clone, Debug)]
pub struct SkylineMatrix {
    first: Vec<usize>,
    start: Vec<usize>,
    values: Vec<f64>,
}

/// A pivot vanished or was not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SingularMatrix {
    /// The row of the pivot.
    pub row: usize,
}

impl SkylineMatrix {
    /// Zero matrix with the given first stored column of every row (`first[i] <= i`).
    pub fn new(first: Vec<usize>) -> Self {
        let mut start = Vec::with_capacity(first.len() + 1);
        let mut total = 0;
        start.push(0);
        for (i, &f) in first.iter().enumerate() {
            total += i + 1 - f;
            start.push(total);
        }
        Self { first, start, values: vec![0.0; total] }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.first.len()
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds `v` to entry (i, j), `j <= i`, inside the profile.
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, v: f64) {
        self.values[self.start[i] + j - self.first[i]] += v;
    }

    /// Replaces the matrix by its factors (unit lower L, and D on the diagonal). Returns the number of negative pivots.
    pub fn factor(&mut self) -> Result<usize, SingularMatrix> {
        let mut negative = 0;
        for i in 0..self.size() {
            let (fi, si) = (self.first[i], self.start[i]);
            let (done, rest) = self.values.split_at_mut(si);
            let row = &mut rest[..i + 1 - fi];
            // g_ij = a_ij - sum_k g_ik l_jk, with g = L D
            for j in fi + 1..i {
                let fj = self.first[j];
                let k0 = fi.max(fj);
                if k0 < j {
                    let sj = self.start[j];
                    let other = &done[sj + k0 - fj..sj + j - fj];
                    let sum = dot(&row[k0 - fi..j - fi], other);
                    row[j - fi] -= sum;
                }
            }
            let mut pivot = row[i - fi];
            for j in fi..i {
                let d = done[self.start[j + 1] - 1];
                let l = row[j - fi] / d;
                pivot -= l * row[j - fi];
                row[j - fi] = l;
            }
            if !pivot.is_finite() || pivot == 0.0 {
                return Err(SingularMatrix { row: i });
            }
            negative += usize::from(pivot < 0.0);
            row[i - fi] = pivot;
        }
        Ok(negative)
    }

    /// Solves in place for one right-hand side, after `factor`.
    pub fn solve(&self, b: &mut [f64]) {
        let n = self.size();
        for i in 0..n {
            let (fi, si) = (self.first[i], self.start[i]);
            b[i] -= dot(&self.values[si..si + i - fi], &b[fi..i]);
        }
        for (i, x) in b.iter_mut().enumerate() {
            *x /= self.values[self.start[i + 1] - 1];
        }
        for i in (0..n).rev() {
            let (fi, si) = (self.first[i], self.start[i]);
            let (head, tail) = b.split_at_mut(i);
            let x = tail[0];
            for (h, l) in head[fi..].iter_mut().zip(&self.values[si..si + i - fi]) {
                *h -= l * x;
            }
        }
    }
}

/// Dot product in eight independent sums, so that the compiler may use vector registers.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let mut acc = [0.0; 8];
    let (ca, cb) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = ca.remainder().iter().zip(cb.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in ca.zip(cb) {
        for k in 0..8 {
            acc[k] += x[k] * y[k];
        }
    }
    tail + ((acc[0] + acc[4]) + (acc[1] + acc[5])) + ((acc[2] + acc[6]) + (acc[3] + acc[7]))
}
