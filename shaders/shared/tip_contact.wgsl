// The tip on a surface: force and dimple over its gap. Equations: src/needle/tip_contact.rs.
#import effects/puncture
#import effects/opening

struct SurfaceTouch {
    // Force of the tip [N], depth of the dimple [m].
    force: f32,
    dimple: f32,
}

// What spreads the opened path, as the step before has left it: force [N], by how much it falls per length that the path is shifted on [N/m],
// and how far it was shifted [m].
struct Spreading {
    force: f32,
    stiffness: f32,
    shift: f32,
}

// u(Q) [m].
fn dimple_depth(force: f32) -> f32 {
    let root = sqrt(max(force, 0.0));
    var row = opening.dimple[0];
    for (var i = 1u; i < 26u; i++) {
        row = select(row, opening.dimple[i], opening.dimple[i].x <= root);
    }
    return row.y + row.z * (root - row.x);
}

// V(U) [J].
fn dimple_energy(depth: f32) -> f32 {
    var row = opening.dimple[0];
    for (var i = 1u; i < 26u; i++) {
        row = select(row, opening.dimple[i], opening.dimple[i].y <= depth);
    }
    let root = row.x + select(0.0, (depth - row.y) / row.z, row.z > 0.0);
    return row.w + row.z * (root * root * root - row.x * row.x * row.x) / 3.0;
}

// Q with Q + by u(Q) = load [N].
fn dimple_force(load: f32, by: f32) -> f32 {
    var row = opening.dimple[0];
    for (var i = 1u; i < 26u; i++) {
        let next = opening.dimple[i];
        row = select(row, next, next.x * next.x + by * next.y <= load);
    }
    let slope = by * row.z;
    let rest = max(load - by * (row.y - row.z * row.x), 0.0);
    let root = 2.0 * rest / max(slope + sqrt(slope * slope + 4.0 * rest), 1e-20);
    return select(0.0, root * root, load > 0.0);
}

// Q under the force of the tip [N], which the dimple shifts by `part`.
fn dimple_load(force: f32, part: f32, spreading: Spreading) -> f32 {
    let unshifted = spreading.force + spreading.stiffness * spreading.shift;
    return dimple_force(part * (force + unshifted), part * part * spreading.stiffness);
}

// The tip with the gap `gap` [m] where the dimple shifts it by `part`.
fn surface_touch(gap: f32, part: f32, spreading: Spreading) -> SurfaceTouch {
    let k = puncture.tip_stiffness;
    let unshifted = spreading.force + spreading.stiffness * spreading.shift;
    let pressed = dimple_force(part * (k * gap + unshifted), part * part * (k + spreading.stiffness));
    let dimple = dimple_depth(max(pressed, dimple_load(0.0, part, spreading)));
    return SurfaceTouch(k * max(gap - part * dimple, 0.0), dimple);
}

// Gap at which the tip force is `force` [m].
fn surface_gap(force: f32, part: f32, spreading: Spreading) -> f32 {
    return force / puncture.tip_stiffness + part * dimple_depth(dimple_load(force, part, spreading));
}

// What tip spring and dimple hold [J].
fn touch_energy(touch: SurfaceTouch) -> f32 {
    return 0.5 * touch.force * touch.force / puncture.tip_stiffness + dimple_energy(touch.dimple);
}
