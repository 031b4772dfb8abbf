// Scheme `opening` of the effect puncture: the map that opens a path of no width. Equations: src/needle/opening.rs.
// Lengths across the path are in needle radii R here, so that all numbers are near 1.
#import shared/params
#import shared/kinematics
#ifdef LAID
#import shared/step_input
#endif

struct OpeningParams {
    // Direction of the path ahead of the tip, and of the needle where the path is planned; w: R [m].
    direction: vec4<f32>,
    // Where the path enters [m]; w: length of the tip [m].
    entry: vec4<f32>,
    // Distance of stations [m], s0 in R^2, coefficient of friction, length over which that grows [m].
    numbers: vec4<f32>,
    // Stations, clusters, cells, nodes.
    counts: vec4<u32>,
    // Half of the stations over which the normal force is averaged; runs of cells; first sum of the runs, and of the cells.
    sums: vec4<u32>,
    // Length over which the surface closes behind a tip that has entered [m]; yzw: shift of a section's centre per radius, of a bevel.
    surface: vec4<f32>,
    // Table of the dimple: root of the force [N^(1/2)], depth u [m], its slope up to the next row, energy V [J].
    dimple: array<vec4<f32>, 26>,
    // Most that a crack runs in a step [m], in every stretch of the path.
    advances: array<vec4<f32>, 4>,
}

// A section of the path. The first three are known before the run. Of a run of cells only the mean of the sections in them: first and end
// in `lists`, `centre`, `centre_rate` and the part that is cut.
struct OpeningStation {
    // Material coordinate Z [m], and that from which it counts as cut; rc over the radius of the needle; w: 1 + b of the growth.
    depth: vec4<f32>,
    // Stiffness that holds its middle on the needle, per radius rc [N/m^2], and of the stick spring [N/m]; zw unused.
    springs: vec4<f32>,
    // Entries of the means over nodes: first, end; entries of the slots that tell of it: first, end.
    lists: vec4<u32>,
    // Displacement of the middle of the path, across it [m], where the path is laid its place from the entry; w: radius rc [m].
    centre: vec4<f32>,
    // Their rates with Z.
    centre_rate: vec4<f32>,
    // Distance behind the tip [m], part that is cut, its rate [1/m], slope of the radius.
    place: vec4<f32>,
    // Radius where all is cut [m], mean displacement of the disc along the path [m] (adapters with many lanes only), stretch of the
    // stick spring [m]; w unused.
    rubbing: vec4<f32>,
    // Derivatives of the energy: by the centre [N] and by rc [N]; by the rates of both [J].
    by_centre: vec4<f32>,
    by_rate: vec4<f32>,
    // Force along the needle [N] on the section, bound of its stiffness, that of the middle; w unused.
    along: vec4<f32>,
    // Force across the needle on the middle of the path [N]; w unused.
    across: vec4<f32>,
    // Impulse of the needle on the tissue there in this frame [N s]; w unused.
    impulse: vec4<f32>,
    // On a path that is laid while the needle comes. Rest position from the entry [m] and direction t0 at rest, of a run the mean of the
    // directions; w: f and q of the growth [R^2].
    rest: vec4<f32>,
    rest_direction: vec4<f32>,
    // Middle of the section of the needle from the entry [m]; moment of the forces on nodes about the centre [N m]. w unused.
    disc: vec4<f32>,
    by_moment: vec4<f32>,
    // Where the tissue relaxes. Part of the stress that is left; steps of this frame so far; energy of the shape without relaxation, and
    // what of it was dissipated since t = 0 [J].
    relaxation: vec4<f32>,
    // r_i [m], g_i and 1/tau_i [1/s] of SectionRelaxation in src/effects/viscoelastic.rs.
    opened: array<vec4<f32>, 2>,
    shares: array<vec4<f32>, 2>,
    rates: array<vec4<f32>, 2>,
}

// Place in a list, and two weights.
struct OpeningEntry {
    index: u32,
    first: f32,
    second: f32,
    _pad: f32,
}

// What the points of a cluster, a cell or a run of cells tell of a station: derivatives of its energy by centre and rc, and by their rates.
struct OpeningSum {
    by_centre: vec4<f32>,
    by_rate: vec4<f32>,
    // Moment of the forces on nodes about the centre [N m], where the needle may turn; w: energy of the shape without relaxation [J].
    by_moment: vec4<f32>,
}

// What the scheme has summed in this frame, and what it holds.
struct OpeningRecord {
    // Impulse on the tissue [N s]; w: work of the tool in the last step with the velocity ahead [J].
    impulse: vec4<f32>,
    // Angular impulse about the tip [N m s]; w: sum of the normal forces on the shaft times the time [N s].
    angular_impulse: vec4<f32>,
    // Impulse along the needle of spreading and of friction [N s], work of the tool [J], dissipated by friction [J].
    parts: vec4<f32>,
    // Force that opening takes per advance of the tip [N], energy in guide and stick springs [J], force that spreads the path [N] and by how
    // much it falls per length that the path is shifted on, at most [N/m].
    now: vec4<f32>,
    // What the tip dissipated beyond what it was told before it advanced [J]; what relaxation dissipated since t = 0 and in this frame [J];
    // w unused.
    late: vec4<f32>,
}

// What a frame tells.
struct OpeningTotals {
    record: OpeningRecord,
    // Elastic energy [J].
    elastic: array<array<vec4<f32>, 32>, 8>,
}

@group(0) @binding(16) var<uniform> opening: OpeningParams;

// Part p of the dimple that shifts a tip that has cut to the material coordinate a [m], and -p' [1/m].
fn dimple_part(a: f32) -> f32 {
    let x = clamp(a / opening.surface.x, 0.0, 1.0);
    return (1.0 - x * x) * (1.0 - x * x);
}

fn dimple_closing(a: f32) -> f32 {
    let x = clamp(a / opening.surface.x, 0.0, 1.0);
    return 4.0 * x * (1.0 - x * x) / opening.surface.x;
}

// Direction of the needle.
fn needle_direction() -> vec3<f32> {
#ifdef LAID
    return step_input.direction.xyz;
#else
    return opening.direction.xyz;
#endif
}

// Direction of the path at rest.
fn rest_direction(station: OpeningStation) -> vec3<f32> {
#ifdef LAID
    return station.rest_direction.xyz;
#else
    return opening.direction.xyz;
#endif
}

// Moment of forces on nodes that have these derivatives of an energy by the gradient of y and by y, about what lies at -`offset`.
fn moment_of(gradient: mat3x3<f32>, offset: vec3<f32>, by_gradient: mat3x3<f32>, by_place: vec3<f32>) -> vec3<f32> {
    return cross(offset, by_place) + cross(gradient[0], by_gradient[0]) + cross(gradient[1], by_gradient[1])
        + cross(gradient[2], by_gradient[2]);
}

// The path at one place, across it in R.
struct PathSection {
    // 1 + b, f and q of the growth of the tissue there: Growth in src/needle/opening.rs.
    growth: vec3<f32>,
    centre_rate: vec3<f32>,
    radius: f32,
    radius_rate: f32,
    // t0.
    rest_direction: vec3<f32>,
    // Part of the stress that is left.
    left: f32,
}

fn section_of(station: OpeningStation) -> PathSection {
    return PathSection(
        vec3<f32>(station.depth.w, station.rest.w, station.rest_direction.w),
        station.centre_rate.xyz,
        station.centre.w / opening.direction.w,
        station.centre_rate.w,
        rest_direction(station),
#ifdef VISCOELASTIC
        station.relaxation.x,
#else
        1.0,
#endif
    );
}

struct OpenedPlace {
    eta: vec3<f32>,
    // g, dg/ds, d^2g/ds^2; dg/drc, and its derivatives by s and rc.
    g: f32,
    g1: f32,
    g2: f32,
    gr: f32,
    gr1: f32,
    grr: f32,
    radius_rate: f32,
    rest_direction: vec3<f32>,
    H: mat3x3<f32>,
}

struct OpeningDerivatives {
    gradient: mat3x3<f32>,
    // By y across the path [1/m], by c_Z, by rc [1/m] and rc_Z, all of an energy per volume.
    place: vec3<f32>,
    centre_rate: vec3<f32>,
    radius: f32,
    radius_rate: f32,
}

fn across(v: vec3<f32>) -> vec3<f32> {
    let t = needle_direction();
    return v - t * dot(v, t);
}

// Radius up to which the hole is exact, and over which it fades from there, in needle radii.
const EXACT: f32 = 2.0;
const WIDTH: f32 = 2.0;

// w and its first and second derivative by s.
fn fade(s: f32) -> vec3<f32> {
    let rho = sqrt(s);
    let x = clamp((rho - EXACT) / WIDTH, 0.0, 1.0);
    let value = 1.0 - x * x * x * (10.0 - x * (15.0 - 6.0 * x));
    let slope = -30.0 / WIDTH * x * x * (1.0 - x) * (1.0 - x);
    let curvature = -60.0 / (WIDTH * WIDTH) * x * (1.0 - x) * (1.0 - 2.0 * x);
    let inverse = 1.0 / max(s, 1.0);
    let first = 0.5 * slope * sqrt(inverse);
    return vec3<f32>(value, first, (0.25 * curvature - 0.5 * first) * inverse);
}

// w m and its derivatives, of w with these.
fn grown(s: f32, w: vec3<f32>, growth: vec3<f32>) -> vec3<f32> {
    let q = 1.0 / (s + growth.z);
    let fall = growth.y * q;
    let m = growth.x - fall;
    let m1 = fall * q;
    return vec3<f32>(w.x * m, w.y * m + w.x * m1, w.z * m + 2.0 * m1 * (w.y - w.x * q));
}

// v = w m/(s + s0) and its derivatives, of w m with these.
fn fade_over_area(s: f32, w: vec3<f32>) -> vec3<f32> {
    let a = 1.0 / (s + opening.numbers.y);
    let v = w.x * a;
    let v1 = (w.y - v) * a;
    return vec3<f32>(v, v1, (w.z - 2.0 * v1) * a);
}

// The map at eta [R] with the gradient F_h of y.
fn opened_place(section: PathSection, eta: vec3<f32>, gradient: mat3x3<f32>) -> OpenedPlace {
    let s = dot(eta, eta);
    let v = fade_over_area(s, grown(s, fade(s), section.growth));
    let rc = section.radius;
    let g = sqrt(1.0 + rc * rc * v.x);
    var out: OpenedPlace;
    out.eta = eta;
    out.g = g;
    out.g1 = rc * rc * v.y / (2.0 * g);
    out.gr = rc * v.x / g;
    out.g2 = rc * rc * v.z / (2.0 * g) - out.g1 * out.g1 / g;
    out.gr1 = rc * v.y / g - out.gr * out.g1 / g;
    out.grr = v.x / g - out.gr * out.gr / g;
    out.radius_rate = section.radius_rate;
    let t = section.rest_direction;
    out.rest_direction = t;
    out.H = mat3x3<f32>(
        across(gradient[0]) - section.centre_rate * t.x,
        across(gradient[1]) - section.centre_rate * t.y,
        across(gradient[2]) - section.centre_rate * t.z,
    );
    return out;
}

// det grad x / det F_h by fading, and its derivatives by s and rc: what growing does to a volume is known before, cell by cell.
fn dilation(section: PathSection, s: f32) -> vec3<f32> {
    // With s0 = 0: no volume on the path grows without bound.
    let w = fade(s);
    let q = 1.0 / (s + section.growth.z);
    let fall = section.growth.y * q;
    let first = w.y * (section.growth.x - fall);
    let second = w.z * (section.growth.x - fall) + w.y * fall * q;
    let rc = section.radius;
    return vec3<f32>(1.0 + rc * rc * first, rc * rc * second, 2.0 * rc * first);
}

// a b^T.
fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(a * b.x, a * b.y, a * b.z);
}

// F = grad x.
fn opened_gradient(place: OpenedPlace, gradient: mat3x3<f32>) -> mat3x3<f32> {
    let turned = transpose(place.H) * place.eta;
    let row = turned * (2.0 * place.g1) + place.rest_direction * (place.gr * place.radius_rate);
    return gradient + place.H * (place.g - 1.0) + outer(place.eta, row);
}

// Derivatives of an energy, from its derivative P by F.
fn pull_back(place: OpenedPlace, P: mat3x3<f32>) -> OpeningDerivatives {
    let eta = place.eta;
    let t = place.rest_direction;
    let h_eta = transpose(place.H) * eta;
    let p_eta = transpose(P) * eta;
    let h_p = double_dot(place.H, P);
    let stretched = dot(p_eta, h_eta);
    let sheared = dot(p_eta, t);
    let by_H = P * (place.g - 1.0) + outer(eta, p_eta * (2.0 * place.g1));
    let lateral = mat3x3<f32>(across(by_H[0]), across(by_H[1]), across(by_H[2]));
    let rcz = place.radius_rate;
    let inverse = 1.0 / opening.direction.w;
    var out: OpeningDerivatives;
    out.gradient = P + lateral;
    out.place = across(
        eta * (2.0 * place.g1 * h_p + 4.0 * place.g2 * stretched + 2.0 * place.gr1 * rcz * sheared)
            + (P * h_eta + place.H * p_eta) * (2.0 * place.g1) + (P * t) * (place.gr * rcz)
    ) * inverse;
    out.centre_rate = -(lateral * t);
    out.radius = (place.gr * h_p + 2.0 * place.gr1 * stretched + place.grr * rcz * sheared) * inverse;
    out.radius_rate = place.gr * sheared;
    return out;
}

// Bound of the square of the spectral norm: largest sum of a column times that of a row.
fn squared_norm_bound(m: mat3x3<f32>) -> f32 {
    let columns = vec3<f32>(dot(abs(m[0]), vec3<f32>(1.0)), dot(abs(m[1]), vec3<f32>(1.0)), dot(abs(m[2]), vec3<f32>(1.0)));
    let rows = abs(m[0]) + abs(m[1]) + abs(m[2]);
    return max(columns.x, max(columns.y, columns.z)) * max(rows.x, max(rows.y, rows.z));
}

// By how much a change of F_h grows in F at most, and by how much one of eta does [1/m]: Opening::amplification.
fn amplification(place: OpenedPlace) -> vec2<f32> {
    let s = dot(place.eta, place.eta);
    let rho = sqrt(s);
    let along = abs(place.g + 2.0 * place.g1 * s);
    let third = max(abs(6.0 * place.g1 * rho + 4.0 * place.g2 * rho * s), 2.0 * abs(place.g1) * rho);
    let by_place = sqrt(squared_norm_bound(place.H)) * third
        + abs(place.radius_rate) * (place.gr + 2.0 * abs(place.gr1) * s);
    return vec2<f32>(max(max(place.g, along), 1.0), by_place / opening.direction.w);
}
