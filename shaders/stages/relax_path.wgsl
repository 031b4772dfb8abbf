// Stage relax_path: the stress beside the sections of an opened path relaxes, at the end of a frame whose energies are known. One workgroup.
// Equations: SectionRelaxation in src/effects/viscoelastic.rs.
#import shared/params
#import effects/opening

@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
// Sections, and behind them one per run of cells: the mean of the sections in these.
@group(3) @binding(20) var<storage, read_write> path_stations: array<OpeningStation>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;
@group(3) @binding(24) var<storage, read_write> opening_totals: OpeningTotals;

const LANES: u32 = 64u;

// Dissipated since t = 0, and in this frame [J].
var<workgroup> parts: array<vec2<f32>, LANES>;

// 1 - e^-x.
fn decay(x: vec4<f32>) -> vec4<f32> {
    // The difference has no digits left where x is small.
    let series = x * (1.0 - x * (0.5 - x * (0.16666667 - x * 0.041666667)));
    return select(1.0 - exp(-x), series, x < vec4<f32>(0.1));
}

@compute @workgroup_size(LANES)
fn relax_path(@builtin(local_invocation_index) lane: u32) {
    let count = opening.counts.x;
    for (var run = lane; run < opening.sums.y; run += LANES) {
        let slots = path_entries[run];
        var energy = 0.0;
        for (var slot = slots.index; slot < slots.index + u32(slots.first); slot++) {
            energy += opening_sums[slot].by_moment.w;
        }
        path_stations[count + run].relaxation.z = energy;
    }
    storageBarrier();
    var sum = vec2<f32>(0.0);
    for (var i = lane; i < count; i += LANES) {
        let station = path_stations[i];
        var energy = 0.0;
        for (var e = station.lists.z; e < station.lists.w; e++) {
            let entry = path_entries[e];
            // Points, or a run of cells.
            let of_run = entry.index >= opening.sums.z;
            let run = count + max(entry.index, opening.sums.z) - opening.sums.z;
            let of_points = opening_sums[min(entry.index, opening.sums.z - 1u)].by_moment.w;
            energy += entry.first * select(of_points, path_stations[run].relaxation.z, of_run);
        }
        let radius = station.centre.w;
        let time = station.relaxation.y * params.dt;
        var relaxed = 0.0;
        for (var four = 0u; four < 2u; four++) {
            let old = station.opened[four];
            let opened = min(old + decay(station.rates[four] * time) * (radius - old), vec4<f32>(radius));
            path_stations[i].opened[four] = opened;
            relaxed += dot(station.shares[four], opened);
        }
        let left = select(1.0, 1.0 - relaxed / radius, radius > 0.0);
        let lost = energy * (station.relaxation.x - left);
        path_stations[i].relaxation = vec4<f32>(left, 0.0, energy, station.relaxation.w + lost);
        sum += vec2<f32>(station.relaxation.w + lost, lost);
    }
    parts[lane] = sum;
    storageBarrier();
    workgroupBarrier();
    for (var run = lane; run < opening.sums.y; run += LANES) {
        let within = path_stations[count + run].lists;
        var left = 0.0;
        for (var i = within.x; i < within.y; i++) {
            left += path_stations[i].relaxation.x;
        }
        path_stations[count + run].relaxation.x = left / f32(within.y - within.x);
    }
    if (lane == 0u) {
        for (var other = 1u; other < LANES; other++) {
            sum += parts[other];
        }
        opening_totals.record.late.y = sum.x;
        opening_totals.record.late.z = sum.y;
    }
}
