// Stage cell_fields: what a window draws of every cell. Equations: src/simulation/fields.rs, `snapshot`.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/point_stress
#import shared/symmetric_eigen
#ifdef TETRAHEDRA
#import shared/drawn_tetrahedron
#else
#import shared/drawn_hexahedron
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
// Von Mises stress and pressure [Pa], largest principal stretch, part of the stiffness that is left (negative: no tissue).
@group(2) @binding(20) var<storage, read_write> drawn_cells: array<vec4<f32>>;

@compute @workgroup_size(64)
fn cell_fields(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= CELL_COUNT) {
        return;
    }
    let cell = drawn_cell(index);
    let place = PointPlace(index, cell.material, cell.length, cell.kept, 0.0, 0.0);
    let point = point_stress(place, cell.H, cell.pressure);
    let sigma = point.sigma;
    let mean = (sigma[0].x + sigma[1].y + sigma[2].z) / 3.0;
    let normal = vec3<f32>(sigma[0].x, sigma[1].y, sigma[2].z) - mean;
    let shear = vec3<f32>(sigma[0].y + sigma[1].x, sigma[1].z + sigma[2].y, sigma[2].x + sigma[0].z) * 0.5;
    let F = deformation_gradient(cell.H);
    let stretch = symmetric_eigen(transpose(F) * F).values;
    drawn_cells[index] = vec4<f32>(
        sqrt(1.5 * dot(normal, normal) + 3.0 * dot(shear, shear)),
        -mean,
        sqrt(max(max(stretch.x, stretch.y), max(stretch.z, 0.0))),
        select(-1.0, point.intact, cell.tissue),
    );
}
