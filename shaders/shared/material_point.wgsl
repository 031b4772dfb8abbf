// One material point with all constitutive effects. Order and reasons: src/material_point.rs.
#import shared/elastic
#import shared/point_energy
#ifdef HISTORY
#import shared/point_history
#endif
#ifdef PLASTICITY
#import effects/plasticity
#endif
#ifdef FIBRES
#import effects/fibres
#endif
#ifdef VISCOELASTIC
#import effects/viscoelastic
#endif
#ifdef DAMAGE
#import effects/damage
#endif
#ifdef OWN
#import shared/own_effects
#endif

struct PointPlace {
    cell: u32,
    // Index of the material.
    material: u32,
    // Edge of the cell V^(1/3) [m].
    length: f32,
    // Part of the stiffness that the cell keeps for other reasons.
    kept: f32,
    // Energy per volume beside that of the law: hourglass; and averaged volumetric energy where pressure is averaged.
    other_energy: f32,
    averaged_energy: f32,
}

struct PointAnswer {
    // Stress without its volumetric part [Pa], cof F, J - 1, bounds of the tangent modulus [Pa].
    P: mat3x3<f32>,
    cof: mat3x3<f32>,
    dj: f32,
    tangent: f32,
    turned_tangent: f32,
    // Part of the stiffness that is left; P does not know it yet.
    intact: f32,
}

// Volumetric energy of the undamaged point [J/m^3].
fn volumetric_energy(place: PointPlace, dj: f32) -> f32 {
#ifdef TETRAHEDRA
    let flat = flatness(dj);
    return place.averaged_energy + 0.5 * materials[place.material].bulk_modulus * flat * flat;
#else
    return 0.5 * materials[place.material].bulk_modulus * dj * dj;
#endif
}

// Stress of the point in this step; brings its history up to date.
fn material_point(place: PointPlace, H: mat3x3<f32>) -> PointAnswer {
    let material = materials[place.material];
    var out: PointAnswer;
    out.intact = place.kept;
#ifdef HISTORY
    var history = PointHistory(0.0, 0.0, 0.0, 0.0);
    // Equivalent strain of flow before and after this step, and the strain that the law sees.
    var alpha_before = 0.0;
    var alpha = 0.0;
    var elastic_strain = H;
#endif
#ifdef PLASTICITY
    // First: all others see the elastic part that flow leaves.
    let plastic = flow_plastically(material, place.material, place.cell, H, true);
    var matrix = plastic.elastic;
    matrix.cof = cofactor(deformation_gradient(H));
    matrix.dj = jacobian_minus_one(H);
    alpha_before = plastic.alpha_before;
    alpha = plastic.alpha;
    elastic_strain = plastic.He;
    history.flow = plastic.dissipation;
    history.failures = plastic.failure;
#else
    let matrix = isochoric_stress(material, H);
#endif
    out.P = matrix.P;
    out.cof = matrix.cof;
    out.dj = matrix.dj;
    out.tangent = matrix.tangent;
    out.turned_tangent = matrix.turned_tangent;
#ifdef FIBRES
    // On the whole F: fibres bridge a matrix that flows.
    let fibre = fibre_stress(place.material, H, out.cof, out.dj);
    out.P += fibre.P;
    out.tangent += fibre.tangent;
#endif
#ifdef VISCOELASTIC
    // Relaxes what matrix and fibres hold together.
    let relaxation = relax(place.material, place.cell, H, out.P, out.cof, out.dj);
    history.relaxation_work = relaxation.work;
    out.P -= deformation_gradient(H) * relaxation.sum;
#endif
#ifdef DAMAGE
    // Last: what has failed carries nothing of the sum.
    let before = degradation(place.material, alpha_before, place.length);
    let d = degradation(place.material, alpha, place.length);
    out.intact *= 1.0 - d;
    history.flow *= 1.0 - before;
    history.relaxation_work *= 1.0 - d;
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, d > before); once == 0u; once++) {
        let energy = free_energy(place, elastic_strain, H, out.dj) + place.other_energy;
        history.degradation = (d - before) * energy;
    }
#endif
#ifdef OWN
    // After all others, which know nothing of them: on the whole F, weakened like the rest.
    advance_own(place.material, place.cell, H, out.cof, out.dj, out.intact);
    let own = own_stress(place.material, place.cell, H, out.cof, out.dj);
    out.P += own.P;
    out.tangent += own.tangent;
#endif
#ifdef HISTORY
    let happened = history.flow != 0.0 || history.relaxation_work != 0.0 || history.failures != 0.0;
    for (var once = select(1u, 0u, happened || history.degradation != 0.0); once == 0u; once++) {
        var booked = read_history(place.cell);
        booked.flow += place.kept * history.flow;
        booked.degradation += place.kept * history.degradation;
        booked.relaxation_work += place.kept * history.relaxation_work;
        booked.failures += history.failures;
        write_history(place.cell, booked);
    }
#endif
    return out;
}
