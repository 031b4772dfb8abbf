// Cauchy stress of one material point; changes nothing. Order and reasons: src/material_point.rs.
#import shared/material_point

struct PointStress {
    sigma: mat3x3<f32>,
    // Part of the stiffness that is left.
    intact: f32,
}

// `pressure`: the volumetric stress dU/dJ [Pa] of the point, or the one that it shares with its neighbours. A point that is
// inside out has no Cauchy stress: zero.
fn point_stress(place: PointPlace, H: mat3x3<f32>, pressure: f32) -> PointStress {
    let F = deformation_gradient(H);
    let cof = cofactor(F);
    let dj = jacobian_minus_one(H);
    var intact = place.kept;
#ifdef PLASTICITY
    let plastic = flow_plastically(materials[place.material], place.material, place.cell, H, false);
    var P = plastic.elastic.P;
#ifdef DAMAGE
    intact *= 1.0 - degradation(place.material, plastic.alpha, place.length);
#endif
#else
    var P = isochoric_stress(materials[place.material], H).P;
#ifdef DAMAGE
    intact *= 1.0 - degradation(place.material, 0.0, place.length);
#endif
#endif
#ifdef FIBRES
    P += fibre_stress(place.material, H, cof, dj).P;
#endif
#ifdef VISCOELASTIC
    P -= F * viscous_sum(place.cell);
#endif
#ifdef OWN
    P += own_stress(place.material, place.cell, H, cof, dj).P;
#endif
#ifdef TETRAHEDRA
    // The pressure that cells share is not weakened with one of them.
    P = P * intact + cof * pressure;
#else
    P = (P + cof * pressure) * intact;
#endif
    let inverse = select(0.0, 1.0 / max(1.0 + dj, 1e-6), dj > -1.0);
    return PointStress(P * transpose(F) * inverse, intact);
}
