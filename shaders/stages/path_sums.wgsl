// Stage path_sums: what cells beside one another and the points of a section tell of it, one workgroup per run of cells and per section. On
// adapters with many lanes only; elsewhere opening_reactions does it. Equations: CpuEngine::station_reactions.
#import shared/params
#import effects/opening

@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
@group(3) @binding(20) var<storage, read_write> path_stations: array<OpeningStation>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;

var<workgroup> shares: array<OpeningSum, 64>;

@compute @workgroup_size(64)
fn path_sums(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let item = group.y * groups.x + group.x;
    let runs = opening.sums.y;
    let is_run = item < runs;
    let station = min(max(item, runs) - runs, opening.counts.x - 1u);
    var sum = OpeningSum();
    let slots = path_entries[min(item, runs - 1u)];
    for (var slot = slots.index + lane; is_run && slot < slots.index + u32(slots.first); slot += 64u) {
        sum.by_centre += opening_sums[slot].by_centre;
        sum.by_rate += opening_sums[slot].by_rate;
#ifdef LAID
        sum.by_moment += opening_sums[slot].by_moment;
#endif
    }
    let lists = path_stations[station].lists;
    for (var e = lists.z + lane; !is_run && e < lists.w; e += 64u) {
        let entry = path_entries[e];
        // Runs are not summed yet.
        let weight = select(0.0, entry.first, entry.index < opening.sums.z);
        sum.by_centre += opening_sums[entry.index].by_centre * weight;
        sum.by_rate += opening_sums[entry.index].by_rate * weight;
#ifdef LAID
        sum.by_moment += opening_sums[entry.index].by_moment * weight;
#endif
    }
    shares[lane] = sum;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if (lane < half) {
            shares[lane].by_centre += shares[lane + half].by_centre;
            shares[lane].by_rate += shares[lane + half].by_rate;
#ifdef LAID
            shares[lane].by_moment += shares[lane + half].by_moment;
#endif
        }
        workgroupBarrier();
    }
    if (lane == 0u) {
        if (is_run) {
            opening_sums[opening.sums.z + item] = shares[0];
        } else if (item - runs < opening.counts.x) {
            path_stations[station].by_centre = shares[0].by_centre;
            path_stations[station].by_rate = shares[0].by_rate;
#ifdef LAID
            path_stations[station].by_moment = shares[0].by_moment;
#endif
        }
    }
}
