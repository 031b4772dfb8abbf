// The rotation without spin that brings the unit vector `a` to `b`, applied to `v`.
fn swing(a: vec3<f32>, b: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let w = cross(a, b);
    return v + cross(w, v) + cross(w, cross(w, v)) / max(1.0 + dot(a, b), 1e-6);
}
