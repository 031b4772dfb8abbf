// Eigenvalues and eigenvectors (columns) of a symmetric matrix: four sweeps of cyclic Jacobi rotations.
struct Eigen {
    values: vec3<f32>,
    vectors: mat3x3<f32>,
}

// Cosine and sine of the rotation that removes the entry `off` between the diagonal entries `p` and `q`.
fn jacobi_rotation(p: f32, q: f32, off: f32) -> vec2<f32> {
    let theta = (q - p) / (2.0 * select(1.0, off, off != 0.0));
    let t = select(1.0, -1.0, theta < 0.0) / (abs(theta) + sqrt(theta * theta + 1.0));
    let tangent = select(0.0, t, off != 0.0 && abs(theta) < 1e18);
    let c = inverseSqrt(tangent * tangent + 1.0);
    return vec2<f32>(c, tangent * c);
}

fn symmetric_eigen(A: mat3x3<f32>) -> Eigen {
    var d = vec3<f32>(A[0].x, A[1].y, A[2].z);
    var xy = A[1].x;
    var zx = A[2].x;
    var yz = A[2].y;
    var v = mat3x3<f32>(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0));
    for (var sweep = 0u; sweep < 4u; sweep++) {
        var r = jacobi_rotation(d.x, d.y, xy);
        var t = r.y / r.x * xy;
        d = vec3<f32>(d.x - t, d.y + t, d.z);
        let zx1 = r.x * zx - r.y * yz;
        yz = r.y * zx + r.x * yz;
        zx = zx1;
        xy = 0.0;
        v = mat3x3<f32>(v[0] * r.x - v[1] * r.y, v[0] * r.y + v[1] * r.x, v[2]);
        r = jacobi_rotation(d.x, d.z, zx);
        t = r.y / r.x * zx;
        d = vec3<f32>(d.x - t, d.y, d.z + t);
        let xy1 = r.x * xy - r.y * yz;
        yz = r.y * xy + r.x * yz;
        xy = xy1;
        zx = 0.0;
        v = mat3x3<f32>(v[0] * r.x - v[2] * r.y, v[1], v[0] * r.y + v[2] * r.x);
        r = jacobi_rotation(d.y, d.z, yz);
        t = r.y / r.x * yz;
        d = vec3<f32>(d.x, d.y - t, d.z + t);
        let xy2 = r.x * xy - r.y * zx;
        zx = r.y * xy + r.x * zx;
        xy = xy2;
        yz = 0.0;
        v = mat3x3<f32>(v[0], v[1] * r.x - v[2] * r.y, v[1] * r.y + v[2] * r.x);
    }
    return Eigen(d, v);
}
