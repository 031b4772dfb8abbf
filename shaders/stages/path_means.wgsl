// Stage path_means: where the sections of an opened path are by the displacement of the nodes around them, one workgroup per section. On
// adapters with many lanes only; elsewhere place_sections does it. Equations: CpuEngine::stations_now.
#import shared/params
#import shared/displacement
#import effects/opening

@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
@group(3) @binding(20) var<storage, read_write> path_stations: array<OpeningStation>;

var<workgroup> shares: array<vec4<f32>, 64>;
#ifdef LAID
var<workgroup> disc_shares: array<vec4<f32>, 64>;
#endif

@compute @workgroup_size(64)
fn path_means(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group.y * groups.x + group.x;
    let count = opening.counts.x;
    let lists = path_stations[min(i, count - 1u)].lists;
    let t = opening.direction.xyz;
    var sum = vec4<f32>(0.0);
#ifdef LAID
    var disc = vec3<f32>(0.0);
#endif
    for (var e = lists.x + lane; e < lists.y; e += 64u) {
        let entry = path_entries[e];
        let u = vec3<f32>(node_displacement[entry.index].xyz) * DISPLACEMENT_UNIT;
        sum += vec4<f32>(u * entry.first, dot(u, t) * entry.second);
#ifdef LAID
        disc += u * entry.second;
#endif
    }
    shares[lane] = sum;
#ifdef LAID
    disc_shares[lane] = vec4<f32>(disc, 0.0);
#endif
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if (lane < half) {
            shares[lane] += shares[lane + half];
#ifdef LAID
            disc_shares[lane] += disc_shares[lane + half];
#endif
        }
        workgroupBarrier();
    }
    if (lane == 0u && i < count) {
#ifdef LAID
        path_stations[i].centre = vec4<f32>(path_stations[i].rest.xyz + shares[0].xyz, 0.0);
        path_stations[i].disc = path_stations[i].rest + disc_shares[0];
#else
        path_stations[i].centre = vec4<f32>(across(shares[0].xyz), 0.0);
#endif
        path_stations[i].rubbing.y = shares[0].w;
    }
}
