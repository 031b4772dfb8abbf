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

#ifdef WIDE
// As `pieces` in src/gpu/grain.rs.
const PIECES: u32 = 8u;
var<workgroup> shares: array<vec4<f32>, 64>;
#else
const PIECES: u32 = 1u;
#endif

// PIECES threads per node.
@compute @workgroup_size(64)
fn opening_nodes(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
    let piece = thread % PIECES;
    let there = thread / PIECES < opening.counts.w;
    let index = min(thread / PIECES, opening.counts.w - 1u);
    let reached = there && tip_state.coordinate > bitcast<f32>(path_nodes[index].more.y);
    var sum = vec4<f32>(0.0);
    // A loop that runs once or not at all where nothing near the node is cut.
    for (var once = select(1u, 0u, reached); once == 0u; once++) {
        sum = gathered(path_nodes[index], piece);
    }
#ifdef WIDE
    let lane = thread % 64u;
    shares[lane] = sum;
    workgroupBarrier();
    for (var other = 1u; other < PIECES; other++) {
        sum += shares[min(lane + other, 63u)];
    }
#endif
    for (var once = select(1u, 0u, reached && piece == 0u); once == 0u; once++) {
        corner_force[path_nodes[index].numbers.x] += sum;
    }
}

// Every PIECES-th of what acts on a node.
fn gathered(node: OpeningNode, piece: u32) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var e = node.numbers.y + piece; e < node.numbers.z; e += PIECES) {
        let corner = opening_corners[path_corners[e]];
        sum += vec4<f32>(-corner.xyz, corner.w);
    }
    let t = needle_direction();
    for (var e = node.numbers.w + piece; e < node.more.x; e += PIECES) {
        let entry = path_entries[e];
        let along = path_stations[entry.index].along;
        let force = t * (along.x * entry.second) + path_stations[entry.index].across.xyz * entry.first;
        sum += vec4<f32>(force, along.y * entry.second + along.z * entry.first);
    }
    return sum;
}
