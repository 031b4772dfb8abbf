//! Which settings nothing beats: no other costs as little and errs as little.

/// Marks the points (cost, error) that lie on the Pareto front. Points that are not finite are never on it; of equal points the
/// first one is.
pub fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let usable = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            usable(p)
                && !points.iter().enumerate().filter(|(j, q)| *j != i && usable(q)).any(|(j, q)| {
                    let no_worse = q.0 <= p.0 && q.1 <= p.1;
                    no_worse && (q.0 < p.0 || q.1 < p.1 || j < i)
                })
        })
        .collect()
}
