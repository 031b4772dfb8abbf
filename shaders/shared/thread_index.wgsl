// Linear index of a thread; dispatches wrap into y beyond 65,535 workgroups.
const WORKGROUP: u32 = 64u;

fn thread_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * WORKGROUP + id.x;
}

// n / d for n < 2^24. Software adapters divide integers lane by lane (measured: half the time of the node stage); a
// float division with a correction is exact and stays in vectors.
fn quotient(n: u32, d: u32) -> u32 {
    let q = i32((f32(i32(n)) + 0.5) / f32(i32(d)));
    let rest = i32(n) - q * i32(d);
    return u32(q + select(0, 1, rest >= i32(d)) - select(0, 1, rest < 0));
}
