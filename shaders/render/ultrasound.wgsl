// A section of the deformed tissue that looks like a B-mode picture. Drawn from geometry: no wave is computed.
//
// Speckle: the envelope of many echoes of random phase in one resolution cell is Rayleigh distributed [Burckhardt1978],
// [Wagner1983]; here a sum over scatterers of a lattice, with complex normal amplitudes, so that the sum is complex normal
// wherever it is taken. The lattice lies in the material: speckle moves as the tissue does. The envelope is shown on a logarithmic
// scale, as scanners compress it. Left out, beside the wave itself: refraction, the widening of the beam away from its focus,
// decorrelation of the speckle under strain, motion of the material out of its plane.
struct Slice {
    // Axes of the picture: to the right, and down into the tissue; where the picture's centre line lies along both [m] in w.
    lateral: vec4<f32>,
    depth: vec4<f32>,
    // Left and upper edge of the picture along the axes, its width and height [m].
    window: vec4<f32>,
    // Edges of the speckle cell, lateral and axial; distance of the slice from the entry point, as a part of the beam width;
    // edge of a pixel. [m] but for the third.
    grain: vec4<f32>,
    // Gain [dB]; what attenuation takes beyond what the time gain gives back [dB/m]; range from black to white [dB]; unused.
    scan: vec4<f32>,
    echo_count: u32,
    // Where in `echoes` the parts of a label map begin; how many there are, 0: no label map.
    first_part: u32,
    part_count: u32,
    _pad: u32,
    // Low corner of the texture of parts at rest, and edge of its texels [m].
    parts_low: vec4<f32>,
}

// Where tissue of a certain brightness lies at rest [m]; later ones lie over earlier ones.
struct Echo {
    // Slab: depth of top and bottom. Box: low corner. Sphere: centre. Cylinder: one end of its axis. Radius in w.
    first: vec4<f32>,
    // Box: high corner. Cylinder: other end. w unused.
    second: vec4<f32>,
    // 0 slab, 1 box, 2 sphere, 3 cylinder.
    kind: u32,
    // Mean brightness below white [dB].
    level: f32,
    // Amplitude of the boundary, 1: white; the part of it that is seen from every side.
    edge: f32,
    edge_aside: f32,
}

@group(0) @binding(0) var<uniform> slice: Slice;
@group(0) @binding(1) var<uniform> echoes: array<Echo, 256>;
// Displacement in fixed point, 2^-36 m; rest position [m].
@group(0) @binding(2) var<storage, read> node_displacement: array<vec4<i32>>;
@group(0) @binding(3) var<storage, read> node_rest: array<vec4<f32>>;
// Number of the part at rest, and texels of bone or air above it.
@group(0) @binding(4) var parts: texture_3d<u32>;

const DISPLACEMENT_UNIT: f32 = 1.4551915228366852e-11;
const TAU: f32 = 6.283185307179586;
// Standard deviation of the drawn boundaries and walls [m].
const LINE: f32 = 0.05e-3;
// What a texel of bone or air takes, and what is lost below it at most [dB].
const LOSS: f32 = 9.0;
const MOST_LOSS: f32 = 42.0;
// Step of brightness at which a boundary answers in full [dB], its amplitude, and the part that is seen from every side.
const FULL_STEP: f32 = 40.0;
const PART_EDGE: f32 = 0.32;
const PART_ASIDE: f32 = 0.05;

// Clip coordinates of a place in the picture [m].
fn on_picture(place: vec2<f32>) -> vec4<f32> {
    let part = (place - slice.window.xy) / slice.window.zw;
    return vec4<f32>(2.0 * part.x - 1.0, 1.0 - 2.0 * part.y, 0.0, 1.0);
}

struct SliceCorner {
    @builtin(position) clip: vec4<f32>,
    // Rest position [m].
    @location(0) rest: vec3<f32>,
    // Depth below the probe [m].
    @location(1) depth: f32,
}

@vertex
fn slice_corner(@location(0) nodes: vec2<u32>, @location(1) part: f32) -> SliceCorner {
    let u = mix(
        vec3<f32>(node_displacement[nodes.x].xyz),
        vec3<f32>(node_displacement[nodes.y].xyz),
        part,
    ) * DISPLACEMENT_UNIT;
    var out: SliceCorner;
    out.rest = mix(node_rest[nodes.x].xyz, node_rest[nodes.y].xyz, part);
    let x = out.rest + u;
    out.depth = dot(x, slice.depth.xyz) - slice.depth.w;
    out.clip = on_picture(vec2<f32>(dot(x, slice.lateral.xyz) - slice.lateral.w, out.depth));
    return out;
}

// Two random numbers of a lattice point: the mixing of PCG [Jarzynski2020].
fn random(at: vec2<i32>) -> vec2<u32> {
    var v = bitcast<vec2<u32>>(at) * 1664525u + 1013904223u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> vec2<u32>(16u);
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    return v ^ (v >> vec2<u32>(16u));
}

// Envelope of the echoes around a point of the material, mean square 1. Each scatterer turns its phase and changes its strength at a
// pace of its own while the slice is shifted: the speckle of slices two beam widths apart has little in common.
fn envelope(place: vec2<f32>) -> f32 {
    let at = place / slice.grain.xy;
    let base = vec2<i32>(floor(at));
    var sum = vec2<f32>(0.0);
    var squares = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let cell = base + vec2<i32>(x, y);
            let bits = random(cell);
            let low = vec2<f32>(bits & vec2<u32>(0xffffu)) / 65536.0;
            let high = vec2<f32>(bits >> vec2<u32>(16u)) / 65536.0;
            let way = at - vec2<f32>(cell) - low;
            let weight = exp(-1.6 * dot(way, way));
            let turned = high + slice.grain.z * (2.0 * low.yx - 1.0);
            // To and fro between 0 and 1: as uniform as the number that it begins with.
            let uniform_part = abs(2.0 * fract(turned.x) - 1.0);
            let amplitude = weight * sqrt(-log(max(uniform_part, 1e-5)));
            let phase = TAU * turned.y;
            sum += amplitude * vec2<f32>(cos(phase), sin(phase));
            squares += weight * weight;
        }
    }
    return length(sum) * inverseSqrt(squares);
}

// How far a point of the material lies outside [m]; negative inside.
fn outside(echo: Echo, X: vec3<f32>) -> f32 {
    switch echo.kind {
        case 0u: {
            return max(echo.first.x + X.z, -X.z - echo.first.y);
        }
        case 1u: {
            let way = abs(X - 0.5 * (echo.first.xyz + echo.second.xyz)) - 0.5 * (echo.second.xyz - echo.first.xyz);
            return length(max(way, vec3<f32>(0.0))) + min(max(way.x, max(way.y, way.z)), 0.0);
        }
        case 2u: {
            return distance(X, echo.first.xyz) - echo.first.w;
        }
        default: {
            let axis = echo.second.xyz - echo.first.xyz;
            let long = length(axis);
            let along = dot(X - echo.first.xyz, axis) / long;
            let aside = length(X - echo.first.xyz - axis * (along / long)) - echo.first.w;
            let beyond = abs(along - 0.5 * long) - 0.5 * long;
            return length(max(vec2<f32>(aside, beyond), vec2<f32>(0.0))) + min(max(aside, beyond), 0.0);
        }
    }
}

fn decibel(amplitude: f32) -> f32 {
    return 8.685889638 * log(max(amplitude, 1e-6));
}

// Brightness of the parts around a point of the material, and texels of bone or air above it; between texels their mean, so that a
// boundary is no staircase.
fn part_level(X: vec3<f32>) -> vec2<f32> {
    let size = vec3<i32>(textureDimensions(parts));
    let at = (X - slice.parts_low.xyz) / slice.parts_low.w - 0.5;
    let low = floor(at);
    let share = at - low;
    var sum = vec2<f32>(0.0);
    for (var n = 0; n < 8; n++) {
        let step = vec3<i32>(n & 1, (n >> 1u) & 1, n >> 2u);
        let weights = mix(1.0 - share, share, vec3<f32>(step));
        let texel = textureLoad(parts, clamp(vec3<i32>(low) + step, vec3<i32>(0), size - 1), 0);
        let found = vec2<f32>(echoes[slice.first_part + texel.x].level, f32(texel.y));
        sum += weights.x * weights.y * weights.z * found;
    }
    return sum;
}

@fragment
fn slice_colour(corner: SliceCorner) -> @location(0) vec4<f32> {
    // Brightness of the tissue, and amplitude of the boundaries: a smooth one answers where the beam meets it square.
    var level = echoes[0].level;
    var boundary = 0.0;
    var lost = 0.0;
    if (slice.part_count > 0u) {
        let here = part_level(corner.rest);
        level = here.x;
        lost = min(LOSS * here.y, MOST_LOSS);
        let along = 0.4 * slice.parts_low.w * slice.depth.xyz;
        let aside = 0.4 * slice.parts_low.w * slice.lateral.xyz;
        let down = part_level(corner.rest + along).x - part_level(corner.rest - along).x;
        let across = part_level(corner.rest + aside).x - part_level(corner.rest - aside).x;
        let steep = down * down + across * across;
        let square = down * down / max(steep, 1e-6);
        boundary = PART_EDGE * min(sqrt(steep) / FULL_STEP, 1.0) * mix(square * square, 1.0, PART_ASIDE);
    }
    for (var n = 0u; n < slice.echo_count; n++) {
        let way = outside(echoes[n], corner.rest);
        let slope = vec2<f32>(dpdx(way), dpdy(way));
        let steep = max(length(slope), 1e-3 * slice.grain.w);
        // In the picture, where the tissue may be stretched.
        let pixels = way / steep;
        let square = slope.y * slope.y / (steep * steep);
        let beside = pixels * slice.grain.w / LINE;
        let line = echoes[n].edge * mix(square * square, 1.0, echoes[n].edge_aside) * exp(-0.5 * beside * beside);
        // Between a region and what it lies over there is one step, as wide as a pixel.
        let inside = clamp(0.5 - pixels, 0.0, 1.0);
        level = mix(level, echoes[n].level, inside);
        boundary = max(boundary * (1.0 - inside * clamp(-beside - 2.0, 0.0, 1.0)), line);
    }
    let rest = vec2<f32>(dot(corner.rest, slice.lateral.xyz), dot(corner.rest, slice.depth.xyz));
    let echo = envelope(rest);
    let amplitude = echo * exp(level / 8.685889638) + boundary * (0.3 + 0.7 * echo);
    let shown = decibel(amplitude) - lost + slice.scan.x - slice.scan.y * max(corner.depth, 0.0);
    return vec4<f32>(vec3<f32>(clamp(1.0 + shown / slice.scan.z, 0.0, 1.0)), 1.0);
}

// What lies under the needle is darker: columns of the picture, taken off in decibels.
struct ShadowCorner {
    @builtin(position) clip: vec4<f32>,
    // [dB]
    @location(0) loss: f32,
}

@vertex
fn shadow_corner(@location(0) place: vec2<f32>, @location(1) loss: f32) -> ShadowCorner {
    return ShadowCorner(on_picture(place), loss);
}

@fragment
fn shadow_colour(corner: ShadowCorner) -> @location(0) vec4<f32> {
    return vec4<f32>(vec3<f32>(corner.loss / slice.scan.z), 0.0);
}

// The needle where it lies in the slice.
struct NeedleCorner {
    @builtin(position) clip: vec4<f32>,
    // From the axis towards the probe [m]; where both edges are, and radius of the bore [m].
    @location(0) across: f32,
    @location(1) edges: vec3<f32>,
    // How much of it the beam meets, 0..1; how square the beam meets its wall, 0..1.
    @location(2) seen: f32,
    @location(3) square: f32,
    // Between two echoes that go to and fro inside [m].
    @location(4) spacing: f32,
}

@vertex
fn needle_corner(
    @location(0) place: vec2<f32>,
    @location(1) across: f32,
    @location(2) edges: vec3<f32>,
    @location(3) look: vec3<f32>,
) -> NeedleCorner {
    return NeedleCorner(on_picture(place), across, edges, look.x, look.y, look.z);
}

fn wall(way: f32) -> f32 {
    return exp(-0.5 * way * way / (1.7 * LINE * LINE));
}

@fragment
fn needle_colour(corner: NeedleCorner) -> @location(0) vec4<f32> {
    let near = wall(corner.across - corner.edges.x);
    let far = wall(corner.across - corner.edges.y);
    // What a bore holds is seen.
    let bore = corner.edges.z;
    let between = corner.across < corner.edges.x && corner.across > corner.edges.y && abs(corner.across) > bore;
    let inside = select(0.0, 1.0, between);
    let inner = select(0.0, 0.8 * wall(abs(corner.across) - bore), bore > 0.0);
    // Echoes between the walls arrive later: fainter lines below the needle, none in the gel above the tissue.
    let depth = slice.window.y + corner.clip.y * slice.grain.w;
    let below = (corner.edges.y - corner.across) / corner.spacing;
    let number = round(below);
    let later = select(0.0, pow(0.6, number), number >= 1.0 && depth > 0.3e-3) * wall((below - number) * corner.spacing);
    let walls = max(max(near, inner), far * mix(1.0, 0.7, corner.square));
    // Along the beam a smooth wall sends little back; it stays visible here, for without it there is nothing to practise.
    let bright = mix(0.9, 1.0, corner.square);
    let cover = max(max(walls, 0.85 * inside), later * sqrt(corner.square));
    let grey = max(max(walls * bright, 0.66 * inside * bright), 0.8 * later);
    let opaque = clamp(cover * corner.seen, 0.0, 1.0);
    return vec4<f32>(vec3<f32>(grey * opaque), opaque);
}
