// Effects that are complete by themselves. Contract and equations: src/effects/own.rs. `#for own ... #end` repeats its lines for
// every one of them: `$own` is its key, `$number` its place, `$count` how many there are.
#import shared/params
#import shared/elastic

// What an effect is told of a point.
struct OwnPoint {
    H: mat3x3<f32>,
    // cof F and J - 1.
    cof: mat3x3<f32>,
    dj: f32,
    // Of the material at rest [Pa].
    bulk_modulus: f32,
    shear_modulus: f32,
    // Time step [s].
    dt: f32,
    // Numbers of the effect in SI.
    numbers: array<vec4<f32>, 2>,
}

// What a cell remembers of one effect.
struct OwnState {
    memory: vec4<f32>,
    // Work supplied in this frame [J/m^3].
    supplied: f32,
    _pad0: f32,
    _pad1: f32,
    _pad2: f32,
}

// Two vectors of numbers for each of at most four effects, of each of 16 materials.
@group(0) @binding(15) var<uniform> own_numbers: array<vec4<f32>, 128>;
@group(3) @binding(17) var<storage, read_write> own_states: array<OwnState>;

#for own
#import own/$own
#end

fn own_point(material_index: u32, number: u32, H: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> OwnPoint {
    let material = materials[material_index];
    let first = 8u * material_index + 2u * number;
    let numbers = array<vec4<f32>, 2>(own_numbers[first], own_numbers[first + 1u]);
    return OwnPoint(H, cof, dj, material.bulk_modulus, material.shear_modulus, params.dt, numbers);
}

struct OwnStress {
    P: mat3x3<f32>,
    tangent: f32,
}

// Sum of all stresses; changes nothing.
fn own_stress(material: u32, cell: u32, H: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> OwnStress {
    var out: OwnStress;
#for own
    let point_$number = own_point(material, $number, H, cof, dj);
    let memory_$number = own_states[cell * $count + $number].memory;
    out.P += $own_stress(point_$number, memory_$number);
    out.tangent += $own_tangent(point_$number, memory_$number);
#end
    return out;
}

// Brings all memories to this step; books what they supply to a point that keeps the part `intact` of its stiffness.
fn advance_own(material: u32, cell: u32, H: mat3x3<f32>, cof: mat3x3<f32>, dj: f32, intact: f32) {
#for own
    var memory_$number = own_states[cell * $count + $number].memory;
    let point_$number = own_point(material, $number, H, cof, dj);
    let behind_$number = $own_advance(point_$number, &memory_$number);
    own_states[cell * $count + $number].memory = memory_$number;
    // Mean over the strains at both ends of a step: half of the way here, half of the way ahead.
    let ahead_$number = $own_advance(point_$number, &memory_$number);
    own_states[cell * $count + $number].supplied += intact * 0.5 * (behind_$number + ahead_$number);
#end
}

// Sum of all energies [J/m^3].
fn own_energy(material: u32, cell: u32, H: mat3x3<f32>, dj: f32) -> f32 {
    let cof = cofactor(deformation_gradient(H));
    var energy = 0.0;
#for own
    energy += $own_energy(own_point(material, $number, H, cof, dj), own_states[cell * $count + $number].memory);
#end
    return energy;
}

// Keeps what a measuring thread found [J], behind the entries of the cells. All lines of the list say the same.
fn tell_own_supply(thread: u32, sum: vec4<f32>) {
#for own
    let behind_$number = CELL_COUNT * $count + thread;
#end
    own_states[behind_0].memory = sum;
}

// What all effects supplied to the cells in this frame per rest volume [J/m^3]; clears it.
fn take_own_supply(cell: u32) -> vec4<f32> {
    var supplied = vec4<f32>(0.0);
#for own
    supplied[$number] = own_states[cell * $count + $number].supplied;
    own_states[cell * $count + $number].supplied = 0.0;
#end
    return supplied;
}
