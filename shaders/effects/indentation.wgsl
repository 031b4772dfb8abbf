// Indentation: shape of the tool and penalty contact. Equations: src/effects/indentation.rs.
struct IndentationParams {
    // Radius of the sphere or punch [m], contact stiffness kappa [Pa/m], damping over stiffness tau [s].
    radius: f32,
    face_stiffness: f32,
    face_damping: f32,
    // 1: flat punch, 0: sphere.
    flat: u32,
    // 1: a touched node sticks to the tool for good.
    bonded: u32,
    _pad0: u32,
    // Where the axis of the tool meets the top face at rest [m].
    entry: vec2<f32>,
}

// Ahead of other effects' parameters: a software adapter (lavapipe of Mesa 22.3) crashes where a branch depends on a stage's fourth
// uniform buffer, and branches ask for `bonded` and `flat`.
@group(0) @binding(4) var<uniform> indentation: IndentationParams;

// Penetration depth [m] (xyz: outward normal of the tool, w: depth) of a point at `lever` from the tip; `rest_radius`
// decides what lies under a flat punch.
fn tool_penetration(lever: vec3<f32>, direction: vec3<f32>, rest_radius: f32) -> vec4<f32> {
    let from_centre = lever + direction * indentation.radius;
    let distance = max(length(from_centre), 1e-9);
    let sphere = vec4<f32>(from_centre / distance, indentation.radius - distance);
    let under = rest_radius <= indentation.radius;
    let punch = vec4<f32>(direction, select(-1.0, -dot(lever, direction), under));
    return select(sphere, punch, indentation.flat == 1u);
}
