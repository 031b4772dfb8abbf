// Stage opening_stations: where the sections of the path are, how far they are behind the tip, and what of them is cut.
// One workgroup. Equations: src/needle/opening.rs and CpuEngine::stations_now.
#import shared/params
#import shared/step_input
#import shared/displacement
#import effects/puncture
#import effects/opening
#import shared/tip_read

@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;
@group(3) @binding(20) var<storage, read_write> path_stations: array<OpeningStation>;

@compute @workgroup_size(64)
fn opening_stations(@builtin(local_invocation_index) lane: u32) {
    let t = opening.direction.xyz;
    let count = opening.counts.x;
    let spacing = opening.numbers.x;
    let tip_length = opening.entry.w;
    let shift = dimple_part(tip_state.coordinate) * tip_state.dimple;
    for (var i = lane; i < count; i += 64u) {
        let depth = path_stations[i].depth;
        let lists = path_stations[i].lists;
        var middle = vec3<f32>(0.0);
        var moved = 0.0;
        var speed = 0.0;
        for (var e = lists.x; e < lists.y; e++) {
            let entry = path_entries[e];
            let u = vec3<f32>(node_displacement[entry.index].xyz) * DISPLACEMENT_UNIT;
            middle += u * entry.first;
            moved += dot(u, t) * entry.second;
            speed += dot(node_velocity[entry.index].xyz, t) * entry.second;
        }
        let behind = step_input.depth - depth.x - moved - shift;
        let part = (tip_state.coordinate - depth.y) / spacing + 0.5;
        let cut = clamp(part, 0.0, 1.0);
        let rate = select(0.0, 1.0 / spacing, part > 0.0 && part < 1.0);
        let shaft = opening.direction.w * depth.z;
        let full = shaft * clamp(behind / tip_length, 0.0, 1.0);
        let slope = select(0.0, shaft / tip_length, behind > 0.0 && behind < tip_length);
        path_stations[i].centre = vec4<f32>(across(middle), full * cut);
        path_stations[i].place = vec4<f32>(behind, cut, rate, slope);
        let stick = path_stations[i].rubbing.z;
        path_stations[i].rubbing = vec4<f32>(full, speed, stick, 0.0);
    }
    storageBarrier();
    for (var i = lane; i < count; i += 64u) {
        let before = max(i, 1u) - 1u;
        let behind = min(i + 1u, count - 1u);
        let by = 1.0 / (spacing * f32(behind - before));
        path_stations[i].centre_rate = (path_stations[behind].centre - path_stations[before].centre) * by;
    }
}
