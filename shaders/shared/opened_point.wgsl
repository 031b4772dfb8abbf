// What opening adds at a place of the tissue: law and fibres of the opened gradient less those of the closed one.
#import shared/elastic
#import effects/opening
#ifdef FIBRES
#import effects/fibres
#endif

struct OpenedStress {
    derivatives: OpeningDerivatives,
    // Bounds of the tangent modulus: beside |N|^2, and beside |cof F N|^2 [Pa].
    tangent: f32,
    turned_tangent: f32,
}

// F - I.
fn strain_of(F: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(
        F[0] - vec3<f32>(1.0, 0.0, 0.0),
        F[1] - vec3<f32>(0.0, 1.0, 0.0),
        F[2] - vec3<f32>(0.0, 0.0, 1.0),
    );
}

// Stress of law and fibres, without the pressure.
fn shape_stress(material: u32, H: mat3x3<f32>) -> IsochoricStress {
    var stress = isochoric_stress(materials[material], H);
#ifdef FIBRES
    let fibre = fibre_stress(material, H, stress.cof, stress.dj);
    stress.P += fibre.P;
    stress.tangent += fibre.tangent;
#endif
    return stress;
}

// Energy of law and fibres per volume, without the pressure [J/m^3].
fn shape_energy(material: u32, H: mat3x3<f32>) -> f32 {
    var energy = isochoric_energy(materials[material], H);
#ifdef FIBRES
    energy += fibre_energy(material, H, jacobian_minus_one(H));
#endif
    return energy;
}

// Part of the energy of the closed path that is taken off, by J, and its rate: Taken in src/cpu/opening.rs.
fn taken(J: f32) -> vec2<f32> {
    let x = clamp(J / J_CONTINUATION, 0.0, 1.0);
    return vec2<f32>(x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / J_CONTINUATION);
}

// `H`: F_h - I of the closed path; `closed`: its stress.
fn opened_stress(material: u32, place: OpenedPlace, H: mat3x3<f32>, closed: mat3x3<f32>) -> OpenedStress {
    let gradient = deformation_gradient(H);
    let stress = shape_stress(material, strain_of(opened_gradient(place, gradient)));
    var out: OpenedStress;
    out.derivatives = pull_back(place, stress.P);
    out.tangent = stress.tangent;
    out.turned_tangent = stress.turned_tangent;
    let off = taken(1.0 + jacobian_minus_one(H));
    out.derivatives.gradient -= closed * off.x;
    for (var once = select(1u, 0u, off.y > 0.0); once == 0u; once++) {
        let cof = cofactor(gradient);
        let energy = shape_energy(material, H);
        out.derivatives.gradient -= cof * (off.y * energy);
        out.turned_tangent += 6.0 / (J_CONTINUATION * J_CONTINUATION) * energy
            + 2.0 * off.y * sqrt(double_dot(closed, closed) / double_dot(cof, cof));
    }
    return out;
}

// Energy per volume [J/m^3].
fn opened_energy(material: u32, place: OpenedPlace, H: mat3x3<f32>) -> f32 {
    let open = strain_of(opened_gradient(place, deformation_gradient(H)));
    return shape_energy(material, open) - taken(1.0 + jacobian_minus_one(H)).x * shape_energy(material, H);
}
