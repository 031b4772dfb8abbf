// Energies of one material point. Formulas in src/material_point.rs.

// W - q:E of the undamaged point [J/m^3]; `He`: the strain that the law sees, H: that of the point.
fn free_energy(place: PointPlace, He: mat3x3<f32>, H: mat3x3<f32>, dj: f32) -> f32 {
    var energy = isochoric_energy(materials[place.material], He) + volumetric_energy(place, dj);
#ifdef FIBRES
    energy += fibre_energy(place.material, H, dj);
#endif
#ifdef VISCOELASTIC
    energy -= double_dot(viscous_sum(place.cell), green_lagrange(H));
#endif
#ifdef OWN
    energy += own_energy(place.material, place.cell, H, dj);
#endif
    return energy;
}

struct PointEnergy {
    // Stored, and the part of it that Prony terms hold [J/m^3]; J - 1; part of the stiffness that is left.
    stored: f32,
    held: f32,
    dj: f32,
    intact: f32,
}

// Energies of a point that keeps `place.kept` of its stiffness for other reasons; changes nothing.
fn point_energy(place: PointPlace, H: mat3x3<f32>) -> PointEnergy {
    var out: PointEnergy;
    out.dj = jacobian_minus_one(H);
    out.intact = place.kept;
#ifdef HISTORY
    var alpha = 0.0;
#endif
    var He = H;
#ifdef PLASTICITY
    let plastic = flow_plastically(materials[place.material], place.material, place.cell, H, false);
    alpha = plastic.alpha;
    He = plastic.He;
#endif
#ifdef VISCOELASTIC
    out.held = viscous_energy(place.material, place.cell);
#endif
#ifdef DAMAGE
    out.intact *= 1.0 - degradation(place.material, alpha, place.length);
#endif
    out.stored = out.intact * (free_energy(place, He, H, out.dj) + out.held);
    out.held *= out.intact;
    return out;
}
