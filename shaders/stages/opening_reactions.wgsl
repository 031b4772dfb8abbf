// Stage opening_reactions: what the sections of the path do to their tissue, to the needle and to the tip; friction.
// One workgroup. Equations: CpuEngine::station_reactions.
#import shared/params
#import shared/step_input
#import effects/puncture
#import effects/opening
#import shared/tip_read
#import shared/beside_needle

#ifdef FRICTION
@group(2) @binding(1) var<storage, read> node_velocity: array<vec4<f32>>;
#endif
@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
@group(3) @binding(20) var<storage, read_write> path_stations: array<OpeningStation>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;
@group(3) @binding(23) var<storage, read_write> opening_record: OpeningRecord;

#ifdef WIDE
const LANES: u32 = 256u;
#else
const LANES: u32 = 64u;
#endif

// Per thread: forces along and across, and what else the record sums.
var<workgroup> parts: array<vec4<f32>, LANES>;
var<workgroup> lateral: array<vec4<f32>, LANES>;
var<workgroup> torque: array<vec4<f32>, LANES>;
var<workgroup> bent: array<f32, LANES>;
var<workgroup> most: array<f32, LANES>;

// Part of a station that is on the shaft.
fn on_shaft(i: u32) -> f32 {
    let place = path_stations[i].place;
    return select(0.0, place.y, place.x >= opening.entry.w);
}

@compute @workgroup_size(LANES)
fn opening_reactions(@builtin(local_invocation_index) lane: u32) {
    let t = needle_direction();
    let count = opening.counts.x;
    let spacing = opening.numbers.x;
#ifdef WIDE
    // By stage path_sums, but for the runs: behind the points in the list of a station.
    for (var i = lane; i < count; i += LANES) {
        let lists = path_stations[i].lists;
        var sum = OpeningSum(path_stations[i].by_centre, path_stations[i].by_rate, path_stations[i].by_moment);
        for (var e = lists.w; e > lists.z && path_entries[e - 1u].index >= opening.sums.z; e--) {
            let entry = path_entries[e - 1u];
            let told = opening_sums[entry.index];
            sum.by_centre += told.by_centre * entry.first;
            sum.by_rate += told.by_rate * entry.first;
#ifdef LAID
            sum.by_moment += told.by_moment * entry.first;
#endif
        }
        path_stations[i].by_centre = sum.by_centre;
        path_stations[i].by_rate = sum.by_rate;
#ifdef LAID
        path_stations[i].by_moment = sum.by_moment;
#endif
    }
#else
    // Cells around the same stations, once for all of these.
    for (var run = lane; run < opening.sums.y; run += LANES) {
        let slots = path_entries[run];
        var sum = OpeningSum();
        for (var slot = slots.index; slot < slots.index + u32(slots.first); slot++) {
            let told = opening_sums[slot];
            sum.by_centre += told.by_centre;
            sum.by_rate += told.by_rate;
#ifdef LAID
            sum.by_moment += told.by_moment;
#endif
        }
        opening_sums[opening.sums.z + run] = sum;
    }
    storageBarrier();
    for (var i = lane; i < count; i += LANES) {
        let lists = path_stations[i].lists;
        var sum = OpeningSum();
        for (var e = lists.z; e < lists.w; e++) {
            let entry = path_entries[e];
            let told = opening_sums[entry.index];
            sum.by_centre += told.by_centre * entry.first;
            sum.by_rate += told.by_rate * entry.first;
#ifdef LAID
            sum.by_moment += told.by_moment * entry.first;
#endif
        }
        path_stations[i].by_centre = sum.by_centre;
        path_stations[i].by_rate = sum.by_rate;
#ifdef LAID
        path_stations[i].by_moment = sum.by_moment;
#endif
    }
#endif
    storageBarrier();
    // along: spreading, friction, friction work, energy in springs; lateral: force across, resistance of the tip.
    var along = vec4<f32>(0.0);
    var aside = vec4<f32>(0.0);
    var turning = vec3<f32>(0.0);
    // Sum of the normal forces on the shaft; work of the needle beside that of its motion as a whole [J].
    var squeezed = 0.0;
    var bend_work = 0.0;
    var most_spread = 0.0;
    for (var i = lane; i < count; i += LANES) {
        let now = path_stations[i];
        // By the centre and by rc with all that follows from them.
        var by = now.by_centre;
        let last = count - 1u;
        let previous = max(i, 1u) - 1u;
        let next = min(i + 1u, last);
        // The rate of station k has the weight 1/(distance of its neighbours) at the one behind it, and its negative before it.
        if (i > 0u) {
            by += path_stations[previous].by_rate / (spacing * f32(i - (max(previous, 1u) - 1u)));
        }
        if (i < last) {
            by -= path_stations[next].by_rate / (spacing * f32(min(next + 1u, last) - i));
        }
        // Stations at the ends are their own neighbours.
        if (i == 0u) {
            by -= now.by_rate / spacing;
        }
        if (i == last) {
            by += now.by_rate / spacing;
        }
        let by_centre = across(by.xyz);
        var normal = 0.0;
        var weight = 0.0;
        let reach = opening.sums.x;
        for (var j = max(i, reach) - reach; j <= min(i + reach, last); j++) {
            let on = on_shaft(j);
            normal += on * path_stations[j].by_centre.w;
            weight += on;
        }
        normal = select(0.0, normal / weight, weight > 0.0);
        // Where the middle is open it is held on the axis; sections of a bevel lie aside of the tip as far as they are wide. One that lies
        // beside the needle closes: `guide` in src/cpu/opening.rs.
        let per_radius = now.springs.x;
        let beside = beside_needle(now.centre.xyz, now.place.x, now.rubbing.x, now.depth.z);
        let axis = beside.axis;
        let lever = beside.lever;
        let offset = beside.offset;
        let left = left_beside(offset);
        let whole = now.rubbing.x * now.place.y;
        let by_radius = by.w + 0.5 * per_radius * dot(offset, offset);
        let guide = offset * -(per_radius * now.centre.w + 2.0 * by_radius * whole * left.y);
        let held = whole * (per_radius + leaving_curvature() * abs(by.w));
        let tilted = dot(along_axis(axis, -guide, -t), t) + dot(guide, beside.shift) * -now.place.w;
        let spread = by_radius * now.place.w * now.place.y * left.x - tilted;
        most_spread = max(most_spread, spread);
        var stick = now.rubbing.z;
        var rubbing = 0.0;
        var bound = 0.0;
        let squeeze = max(normal, 0.0) * clamp((now.place.x - opening.entry.w) / opening.numbers.w, 0.0, 1.0) * now.place.y;
        squeezed += squeeze;
#ifdef FRICTION
        let limit = opening.numbers.z * squeeze;
        let kt = now.springs.y;
        // Speed of the section along the needle.
        var speed = 0.0;
        for (var e = now.lists.x; e < now.lists.y; e++) {
            speed += dot(node_velocity[path_entries[e].index].xyz, t) * path_entries[e].second;
        }
        let trial = stick + (speed - dot(velocity_behind(), t)) * params.dt;
        let allowed = limit / kt;
        let stretch = select(0.0, clamp(trial, -allowed, allowed), limit > 0.0);
        rubbing = -kt * stretch;
        along += vec4<f32>(0.0, 0.0, 0.5 * kt * (stick + stretch) * (trial - stretch), 0.5 * kt * stretch * stretch);
        stick = stretch;
        bound = 2.0 * kt;
#endif
        along += vec4<f32>(spread, rubbing, 0.0, 0.5 * per_radius * now.centre.w * dot(offset, offset));
        aside += vec4<f32>(guide, by_radius * now.rubbing.x * now.place.z * left.x);
#ifdef LAID
        // As the moment of all forces on the tissue.
        let from_tip = opening.entry.xyz - step_input.tip.xyz;
        turning += cross(from_tip + now.centre.xyz, guide - by_centre + across(now.by_centre.xyz))
            + cross(from_tip + now.disc.xyz, t * (spread + rubbing)) - now.by_moment.xyz;
#else
        turning += cross(lever - t * now.place.x, guide);
#endif
        bend_work += axis_power(axis, guide) * params.dt;
#ifdef FLEXIBLE_NEEDLE
        let before = select(now.impulse.xyz, vec3<f32>(0.0), step_input.step == centre_line.first_step);
        path_stations[i].impulse = vec4<f32>(before + (t * (spread + rubbing) + guide) * params.dt, 0.0);
#endif
        path_stations[i].rubbing.z = stick;
        path_stations[i].along = vec4<f32>(spread + rubbing, bound, 2.0 * held, 0.0);
        path_stations[i].across = vec4<f32>(guide - by_centre, 0.0);
    }
    parts[lane] = along;
    lateral[lane] = aside;
    bent[lane] = bend_work;
    most[lane] = most_spread;
    torque[lane] = vec4<f32>(turning, squeezed);
    workgroupBarrier();
    // Halves onto halves.
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        if (lane < half) {
            parts[lane] += parts[lane + half];
            lateral[lane] += lateral[lane + half];
            torque[lane] += torque[lane + half];
            bent[lane] += bent[lane + half];
            most[lane] = max(most[lane], most[lane + half]);
        }
        workgroupBarrier();
    }
    if (lane == 0u) {
        along = parts[0];
        aside = lateral[0];
        turning = torque[0].xyz;
        squeezed = torque[0].w;
        bend_work = bent[0];
        let dt = params.dt;
        let total = t * (along.x + along.y) + aside.xyz;
        let impulse = opening_record.impulse.xyz + total * dt;
        var power = dot(total, step_input.velocity.xyz);
        var power_ahead = dot(total, step_input.velocity_ahead.xyz);
#ifdef TURNS
        power += dot(turning, angular_velocity());
        power_ahead += dot(turning, step_input.angular_velocity_ahead.xyz);
#endif
        opening_record.impulse = vec4<f32>(impulse, power_ahead * dt + bend_work);
        opening_record.angular_impulse += vec4<f32>(turning * dt, squeezed * dt);
        opening_record.parts += vec4<f32>(along.x * dt, along.y * dt, power * dt + bend_work, along.z);
        // The tip was told what the path took before it advanced: half of what that changed by comes off.
        let told = opening_record.now;
        opening_record.late.x += 0.5 * ((along.x - told.z) * tip_state.shifted - (aside.w - told.x) * tip_state.advanced);
        opening_record.now = vec4<f32>(aside.w, along.w, along.x, most[0] / spacing);
    }
}
