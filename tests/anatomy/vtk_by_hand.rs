//! Surfaces in VTK files, by hand.

use stylet::anatomy::surface::TriangleSurface;

/// Legacy VTK, in text or with the high byte first.
pub fn legacy_vtk(surface: &TriangleSurface, binary: bool) -> Vec<u8> {
    let (points, triangles) = (surface.points.len(), surface.triangles.len());
    let kind = if binary { "BINARY" } else { "ASCII" };
    let mut bytes =
        format!("# vtk DataFile Version 3.0\nmodel\n{kind}\nDATASET POLYDATA\nPOINTS {points} double\n").into_bytes();
    let numbers = surface.points.iter().flat_map(|x| x.to_array());
    let list = surface.triangles.iter().flat_map(|t| [3, t[0] as i32, t[1] as i32, t[2] as i32]);
    let head = format!("\nPOLYGONS {triangles} {}\n", 4 * triangles);
    if binary {
        bytes.extend(numbers.flat_map(f64::to_be_bytes));
        bytes.extend(head.bytes().chain(list.flat_map(i32::to_be_bytes)));
    } else {
        bytes.extend(numbers.flat_map(|x| format!("{x} ").into_bytes()));
        bytes.extend(head.bytes().chain(list.flat_map(|n| format!("{n} ").into_bytes())));
    }
    bytes.extend(format!("\nPOINT_DATA {points}\n").bytes());
    bytes
}

pub fn vtp(surface: &TriangleSurface) -> Vec<u8> {
    let points: Vec<String> = surface.points.iter().map(|x| format!("{} {} {}", x.x, x.y, x.z)).collect();
    let corners: Vec<String> = surface.triangles.iter().map(|t| format!("{} {} {}", t[0], t[1], t[2])).collect();
    let ends: Vec<String> = (1..=surface.triangles.len()).map(|n| (3 * n).to_string()).collect();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\"><PolyData>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfPolys=\"{}\">\n<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" \
         format=\"ascii\">{}</DataArray></Points>\n<Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">{}\
         </DataArray><DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">{}</DataArray></Polys></Piece></PolyData></VTKFile>",
        points.len(),
        corners.len(),
        points.join("\n"),
        corners.join("\n"),
        ends.join(" ")
    )
    .into_bytes()
}
