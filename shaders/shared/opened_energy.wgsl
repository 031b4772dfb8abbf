// Energy that opening adds beside the path where nothing has relaxed.
#import shared/opening_cell

// Of a point [J].
fn energy_of_point(cluster: OpeningCluster, modes: CellModes, point: OpeningPoint) -> f32 {
    let station = path_stations[point.numbers.x];
    let section = section_of(station);
    let p = point.place.xyz;
    let H = strain_at(modes, p, cluster.inverse.xyz);
    let y = cluster.middle.xyz - station.centre.xyz + p / cluster.inverse.xyz + displacement_at(modes, p);
    let eta = across(y) / opening.direction.w;
    let place = opened_place(section, eta, deformation_gradient(H));
    return select(0.0, point.place.w, section.radius > 0.0) * opened_energy(cluster.cell.w, place, H);
}

// Of the shape of what points do not carry in a cell [J], with the gradient H of its middle.
fn energy_of_shape(cell: OpeningCell, mean: OpeningStation, modes: CellModes, H: mat3x3<f32>) -> f32 {
    let gradient = deformation_gradient(H);
    let width = 1.0 / cell.inverse.xyz;
    let middle = cell.middle.xyz + modes.mean - mean.centre.xyz;
    let eta = across(middle + gradient * (cell.place.xyz * width)) / opening.direction.w;
    let volume = cell.place.w * width.x * width.y * width.z;
    return volume * opened_energy(cell.cell.w, opened_place(section_of(mean), eta, gradient), H);
}
