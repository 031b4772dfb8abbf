// Dead load of the face tractions at full ramp [N], w unused.
@group(1) @binding(2) var<storage, read> node_load: array<vec4<f32>>;
