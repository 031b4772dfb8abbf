// Linear index of a thread; dispatches wrap into y beyond 65,535 workgroups.
const WORKGROUP: u32 = 64u;

fn thread_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * WORKGROUP + id.x;
}
