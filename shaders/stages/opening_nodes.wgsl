// Stage opening_nodes: gathers what points, cells and sections do to a node, into the corner-force slot that the node owns.
#import shared/params
#import shared/thread_index
#import shared/corner_force
#import effects/puncture
#import effects/opening
#import shared/tip_read

// A node near the path: its slot of `corner_force`, its corners (first, end), first entry of its sections; their end,
// and material coordinate [m] of a tip that has cut nothing near it (bits of a float).
struct OpeningNode {
    numbers: vec4<u32>,
    more: vec4<u32>,
}

@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
@group(1) @binding(25) var<storage, read> path_corners: array<u32>;
@group(1) @binding(24) var<storage, read> path_nodes: array<OpeningNode>;
@group(3) @binding(20) var<storage, read> path_stations: array<OpeningStation>;
@group(3) @binding(21) var<storage, read> opening_corners: array<vec4<f32>>;

@compute @workgroup_size(64)
fn opening_nodes(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= opening.counts.w) {
        return;
    }
    // A loop that runs once or not at all where nothing near the node is cut.
    for (var once = select(1u, 0u, tip_state.coordinate > bitcast<f32>(path_nodes[index].more.y)); once == 0u; once++) {
        gather_on(path_nodes[index]);
    }
}

fn gather_on(node: OpeningNode) {
    var sum = vec4<f32>(0.0);
    for (var e = node.numbers.y; e < node.numbers.z; e++) {
        let corner = opening_corners[path_corners[e]];
        sum += vec4<f32>(-corner.xyz, corner.w);
    }
    let t = opening.direction.xyz;
    for (var e = node.numbers.w; e < node.more.x; e++) {
        let entry = path_entries[e];
        let along = path_stations[entry.index].along;
        let force = t * (along.x * entry.second) + path_stations[entry.index].across.xyz * entry.first;
        sum += vec4<f32>(force, along.y * entry.second + along.z * entry.first);
    }
    corner_force[node.numbers.x] += sum;
}
