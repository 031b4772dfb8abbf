// Stage advance_free_tip: springs of the tip on a free path; the tip advances, slips sideways or draws back through the
// material. One workgroup. Equations: src/needle/free_path.rs and CpuEngine::advance_free_tip.
#import shared/params
#import shared/step_input
#import shared/displacement
#import shared/grid_lines
#import effects/puncture
#import shared/tip_written
#import effects/free_path

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

var<workgroup> gaps: array<f32, ANCHOR_COUNT>;
var<workgroup> sways: array<vec3<f32>, ANCHOR_COUNT>;
var<workgroup> columns_x: array<vec3<f32>, ANCHOR_COUNT>;
var<workgroup> columns_y: array<vec3<f32>, ANCHOR_COUNT>;
var<workgroup> columns_z: array<vec3<f32>, ANCHOR_COUNT>;
var<workgroup> old_sway: vec3<f32>;
var<workgroup> moved: f32;
// Threshold [N] in a step in which the cap on the advance holds the force above it, else NO_CAP.
var<workgroup> capped: f32;
const NO_CAP: f32 = 1e30;

struct GridPlace {
    cell: vec3<u32>,
    // Local coordinates 0..1 and edges of the cell [m].
    local: vec3<f32>,
    width: vec3<f32>,
}

struct MaterialPlace {
    grid: GridPlace,
    // x(X) [m] and the columns of F there.
    position: vec3<f32>,
    fx: vec3<f32>,
    fy: vec3<f32>,
    fz: vec3<f32>,
}

// The rest position itself or the nearest one in the block.
fn within_block(X: vec3<f32>) -> vec3<f32> {
    let y0 = NODES_X;
    let z0 = y0 + NODES_Y;
    let low = vec3<f32>(grid_lines[0], grid_lines[y0], grid_lines[z0]);
    let high = vec3<f32>(grid_lines[y0 - 1u], grid_lines[z0 - 1u], grid_lines[z0 + NODES_Z - 1u]);
    return clamp(X, low, high);
}

// Cell of the last place that was looked for: the next one is near it.
var<private> near_cell: vec3<u32>;

fn grid_place(X: vec3<f32>) -> GridPlace {
    let y0 = NODES_X;
    let z0 = y0 + NODES_Y;
    let cell = vec3<u32>(
        find_cell_near(X.x, 0u, NODES_X, near_cell.x),
        find_cell_near(X.y, y0, NODES_Y, near_cell.y),
        find_cell_near(X.z, z0, NODES_Z, near_cell.z),
    );
    near_cell = cell;
    let low = vec3<f32>(grid_lines[cell.x], grid_lines[y0 + cell.y], grid_lines[z0 + cell.z]);
    let high = vec3<f32>(grid_lines[cell.x + 1u], grid_lines[y0 + cell.y + 1u], grid_lines[z0 + cell.z + 1u]);
    let width = high - low;
    return GridPlace(cell, clamp((X - low) / width, vec3<f32>(0.0), vec3<f32>(1.0)), width);
}

fn material_place(X: vec3<f32>) -> MaterialPlace {
    let grid = grid_place(X);
    var place = MaterialPlace(
        grid, X, vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0),
    );
    for (var corner = 0u; corner < 8u; corner++) {
        let bit = vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let at = grid.cell + bit;
        let node = (at.z * NODES_Y + at.y) * NODES_X + at.x;
        let upper = bit == vec3<u32>(1u);
        let n = select(1.0 - grid.local, grid.local, upper);
        let rate = select(vec3<f32>(-1.0), vec3<f32>(1.0), upper) / grid.width
            * vec3<f32>(n.y * n.z, n.z * n.x, n.x * n.y);
        let u = vec3<f32>(node_displacement[node].xyz) * DISPLACEMENT_UNIT;
        place.position += u * (n.x * n.y * n.z);
        place.fx += u * rate.x;
        place.fy += u * rate.y;
        place.fz += u * rate.z;
    }
    return place;
}

// Number of a cell in the box of free cells; the length of the box outside it.
fn free_index(cell: vec3<u32>) -> u32 {
    let low = puncture.free_low.xyz;
    let count = puncture.free_count.xyz;
    let part = cell - low;
    let inside = all(cell >= low) && all(part < count);
    return select(puncture.path_cell_count, (part.z * count.y + part.y) * count.x + part.x, inside);
}

#ifdef EMPTY_CELLS
// Height of the skin over a rest position [m]: far below everything where there is no tissue.
fn skin_at(X: vec3<f32>) -> f32 {
    let grid = grid_place(X);
    let low = puncture.free_low.xyz;
    // The heights are those of the column, whatever the layer.
    let index = free_index(vec3<u32>(grid.cell.xy, low.z));
    let cell = min(index, puncture.path_cell_count - 1u);
    let near = mix(free_cells[cell].low.w, free_cells[cell].size.w, grid.local.x);
    let far = mix(free_cells[cell].height_01, free_cells[cell].height_11, grid.local.x);
    return select(NO_SKIN, mix(near, far, grid.local.y), index < puncture.path_cell_count);
}

fn has_skin(height: f32) -> bool {
    return height > 1e-2 * NO_SKIN;
}
#else
// The top face.
fn skin_at(X: vec3<f32>) -> f32 {
    return 0.0;
}

fn has_skin(height: f32) -> bool {
    return true;
}
#endif

// The rest position itself or the nearest one in the tissue: in the block, and not above the skin.
fn within_tissue(X: vec3<f32>) -> vec3<f32> {
    let inside = within_block(X);
#ifdef EMPTY_CELLS
    let skin = skin_at(inside);
    return vec3<f32>(inside.xy, select(inside.z, min(inside.z, skin), has_skin(skin)));
#else
    return inside;
#endif
}

// Where an anchor is with the tip as it stands now; fills the lanes of the workgroup. Returns the cell.
fn place_anchor(anchor: u32, lane: u32) -> GridPlace {
    let T = free_tip.along.xyz;
    let across = free_tip.across.xyz;
    let X0 = free_tip.place.xyz;
    let offset = anchor_offset(anchor);
    let X = within_tissue(X0 + across * offset.x + cross(T, across) * offset.y);
    let place = material_place(X);
    let lever = step_input.tip.xyz - place.position;
    if (lane < ANCHOR_COUNT) {
        gaps[lane] = dot(lever, step_input.direction.xyz) + dot(X - X0, T);
        sways[lane] = lever + (X - X0);
        columns_x[lane] = place.fx;
        columns_y[lane] = place.fy;
        columns_z[lane] = place.fz;
    }
    return place.grid;
}

// Outside: one step of Newton's iteration for the point of the block that the tip is at; through the top face a track
// begins.
fn look_for_surface() {
    let X = free_tip.place.xyz;
    let near = within_tissue(X);
    let place = material_place(near);
    let away = step_input.tip.xyz - place.position - (X - near);
    let next = X + pulled_back(place.fx, place.fy, place.fz, away);
    let skin = skin_at(next);
    // Where the tip is, not at the height: see the CPU engine.
    let on_top = vec3<f32>(next.xy, min(next.z, skin));
    let over = has_skin(skin) && all(within_block(on_top) == on_top);
    // Nearer than a tenth of a millimetre: far from the solution a step may end anywhere.
    let enters = over && next.z <= skin + 1e-9 && dot(away, away) < 1e-8;
    free_tip.place = vec4<f32>(select(next, on_top, enters), 0.0);
    let t = step_input.direction.xyz;
    let guess = select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(1.0, 0.0, 0.0), abs(t.x) < 0.9);
    free_tip.along = vec4<f32>(t, 0.0);
    free_tip.across = vec4<f32>(normalize(guess - t * dot(guess, t)), 0.0);
    free_tip.coordinate = 0.0;
    free_tip.entry = 0.0;
    free_tip.material = 0u;
    free_tip.inside = select(0.0, 1.0, enters);
}

// Moves the tip through the material. The gaps, sways and columns of F are those before.
fn move_tip() {
    let t = step_input.direction.xyz;
    let spring = puncture.tip_stiffness / f32(ANCHOR_COUNT);
    var force = 0.0;
    var gap = 0.0;
    var stretched = 0.0;
    var sway = vec3<f32>(0.0);
    var fx = vec3<f32>(0.0);
    var fy = vec3<f32>(0.0);
    var fz = vec3<f32>(0.0);
    for (var i = 0u; i < ANCHOR_COUNT; i++) {
        force += spring * max(gaps[i], 0.0);
        stretched += select(0.0, 1.0, gaps[i] > 0.0);
        gap += gaps[i] / f32(ANCHOR_COUNT);
        sway += sways[i] / f32(ANCHOR_COUNT);
        fx += columns_x[i] / f32(ANCHOR_COUNT);
        fy += columns_y[i] / f32(ANCHOR_COUNT);
        fz += columns_z[i] / f32(ANCHOR_COUNT);
    }
    sway -= t * dot(sway, t);
    old_sway = sway;
    let direction = free_tip.along.xyz;
    let stretch = clamp(dot(fx * direction.x + fy * direction.y + fz * direction.z, t), LEAST_STRETCH, MOST_STRETCH);

    // What lies just ahead: farther than a sample that the tip's plane has marked.
    let X = free_tip.place.xyz;
    let here = grid_place(within_block(X));
    let look = LOOK_AHEAD * 0.5 / SAMPLES * dot(abs(direction), here.width);
    let ahead = grid_place(within_block(X + direction * look));
    let sample = min(vec3<u32>(ahead.local * SAMPLES), vec3<u32>(3u));
    let bit = sample.x + 4u * sample.y + 16u * sample.z;
    let index = free_index(ahead.cell);
    let known = free_index(here.cell) < puncture.path_cell_count && index < puncture.path_cell_count;
    let cell = min(index, puncture.path_cell_count - 1u);
    let word = select(free_cells[cell].marked_low, free_cells[cell].marked_high, bit >= 32u);
    let open = known && ((word >> (bit & 31u)) & 1u) == 1u;
    let tissue = free_cells[cell].tissue;
    let material = select(free_tip.material, tissue, known && tissue != AS_BEFORE);
    var entry = select(free_tip.entry, free_tip.coordinate, material != free_tip.material);
    let forces = puncture.segments[material];
    let speed = length(step_input.velocity.xyz);
    let threshold = select(material_threshold(forces, free_tip.coordinate - entry) * rate_factor(speed), 0.0, open);

    let at_surface = free_tip.coordinate == 0.0;
    let travel = (speed + puncture.needle_radius * length(angular_velocity())) * params.dt;
    let cap = advance_limit(at_surface, travel);
    let slip_cap = MOST_TRAVELS * travel + SLIP_CAP;
    let more = max(force - threshold, 0.0);
    let advance = min(more / (puncture.tip_stiffness * (max(stretched, 1.0) / f32(ANCHOR_COUNT)) * stretch), cap);
    capped = select(NO_CAP, threshold, advance == cap);
    let retreat = clamp((-SLACK - gap) / stretch, 0.0, slip_cap);
    let size = length(sway);
    let held = min(threshold, force) / puncture.tip_stiffness;
    let excess = sway * select(0.0, 1.0 - held / size, size > held);
    var slip = pulled_back(fx, fy, fz, excess);
    let slipped = length(slip);
    slip *= select(1.0, slip_cap / slipped, slipped > slip_cap);
    // Not through the surface yet: the tip glides on it.
    slip.z = select(slip.z, 0.0, at_surface);
    let goes = advance > 0.0 || retreat > 0.0 || any(slip != vec3<f32>(0.0));
    moved = select(0.0, 1.0, goes);
    var next = X + direction * (advance - retreat) + slip;
    let skin = skin_at(next);
#ifdef EMPTY_CELLS
    let before = skin_at(X);
    next.z += select(0.0, skin - before, has_skin(skin) && has_skin(before) && at_surface && advance == retreat);
#endif
    let coordinate = max(free_tip.coordinate + advance - retreat, 0.0);
    // Beside the tissue the needle comes back through it.
    let leaves = retreat > 0.0 && has_skin(skin) && next.z > skin;
    free_tip.material = material;
    free_tip.advance = select(0.0, advance + length(slip), retreat == 0.0 && coordinate > 0.0);
    free_tip.inside = select(1.0, 0.0, leaves);
    free_tip.coordinate = select(coordinate, 0.0, leaves);
    free_tip.entry = select(entry, 0.0, leaves);
    free_tip.place = vec4<f32>(select(within_tissue(next), next, leaves), 0.0);
    // T follows the pulled-back direction of the needle.
    let wanted = pulled_back(fx, fy, fz, t);
    let square = dot(wanted, wanted);
    let way = (advance + retreat + length(slip)) / TURNING;
    let part = select(0.0, min(way, 1.0), square > 1e-6);
    let along = normalize(mix(direction, wanted * inverseSqrt(max(square, 1e-12)), part));
    let across = free_tip.across.xyz;
    free_tip.along = vec4<f32>(along, 0.0);
    free_tip.across = vec4<f32>(normalize(across - along * dot(across, along)), 0.0);
}

@compute @workgroup_size(32)
fn advance_free_tip(@builtin(local_invocation_index) lane: u32) {
    let anchor = min(lane, ANCHOR_COUNT - 1u);
    let spring = puncture.tip_stiffness / f32(ANCHOR_COUNT);
    near_cell = tip_anchor_loads[anchor].cell.xyz;
    if (lane == 0u) {
        free_tip.advance = 0.0;
        moved = 0.0;
        capped = NO_CAP;
        if (free_tip.inside == 0.0) {
            look_for_surface();
        }
    }
    storageBarrier();
    workgroupBarrier();
    var grid = place_anchor(anchor, lane);
    workgroupBarrier();
    let old_gap = max(gaps[anchor], 0.0);
    if (lane == 0u && free_tip.inside == 1.0) {
        move_tip();
    }
    storageBarrier();
    workgroupBarrier();
    let inside = free_tip.inside;
    grid = place_anchor(anchor, lane);
    let gap = max(gaps[anchor], 0.0) * inside;
    workgroupBarrier();
    if (lane < ANCHOR_COUNT) {
        tip_anchor_loads[lane].cell = vec4<u32>(grid.cell, 0u);
        tip_anchor_loads[lane].load = vec4<f32>(grid.local, spring * gap);
        // Energy and, with the force after the move (trapezoidal rule of the leapfrog work), loss of this spring.
        gaps[lane] = 0.5 * spring * gap * gap;
        columns_x[lane] = vec3<f32>(spring * gap * (old_gap - gap), 0.0, 0.0);
    }
    workgroupBarrier();
    if (lane == 0u) {
        let t = step_input.direction.xyz;
        var stored = 0.0;
        var lost = 0.0;
        var force = 0.0;
        var sway = vec3<f32>(0.0);
        for (var i = 0u; i < ANCHOR_COUNT; i++) {
            stored += gaps[i];
            lost += columns_x[i].x;
            force += tip_anchor_loads[i].load.w;
            sway += sways[i] * (inside / f32(ANCHOR_COUNT));
        }
        sway -= t * dot(sway, t);
        stored += 0.5 * puncture.tip_stiffness * dot(sway, sway);
        let beyond = lost * share_beyond(force, capped);
        lost += puncture.tip_stiffness * dot(sway, old_sway - sway) - beyond;
        free_tip.sway = vec4<f32>(sway * spring, 0.0);
        free_tip.spring_energy = stored;
        free_tip.dissipation += select(0.0, lost, moved == 1.0);
        free_tip.cap_dissipation += select(0.0, beyond, moved == 1.0);
    }
}
