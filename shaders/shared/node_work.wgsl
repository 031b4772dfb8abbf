// Work of supports and face loads on a node in this frame [J].
@group(2) @binding(4) var<storage, read_write> node_work: array<f32>;
