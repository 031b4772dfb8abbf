// Groups of 64 nodes among which one moves, where cells are empty: three numbers each, its place and a bit per node that stands still.
@group(1) @binding(13) var<storage, read> busy_nodes: array<u32>;

// The node of a thread.
fn busy_node(thread: u32) -> u32 {
    return busy_nodes[3u * (thread >> 6u)] * 64u + (thread & 63u);
}

// Bits 0..2: components that stand still whatever the faces say.
fn standing_components(thread: u32) -> u32 {
    let lane = thread & 63u;
    let word = busy_nodes[3u * (thread >> 6u) + 1u + (lane >> 5u)];
    return 7u * ((word >> (lane & 31u)) & 1u);
}
