//! VTK XML files of surfaces (`.vtp`), with the document and the arrays of `.vtu` meshes.
//!
//! Source: "VTK File Formats" of the VTK documentation, "PolyData". Read are polygons and triangle strips; vertices and lines are
//! stepped over.

use glam::DVec3;

use super::draft::Draft;
use super::stl::too_many;
use crate::Result;
use crate::mesh::import::vtu::{DataSet, VtuFile, XmlNode, arrays, child, opened};

/// Reads the bytes of a file; all pieces are one surface.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Draft> {
    let kind =
        DataSet { name: "PolyData", title: "a surface", way_out: "save the surface as poly data (one .vtp file)" };
    opened(name, bytes, kind, |file| {
        let data = file.child(file.root(), "PolyData")?;
        let mut draft = Draft::default();
        let mut left = bytes.len().saturating_mul(DENSEST);
        draft.parts.push((String::new(), Vec::new()));
        for piece in data.children().filter(|n| n.has_tag_name("Piece")) {
            let count = file.count(piece, "NumberOfPoints")?;
            if draft.points.len().checked_add(count).is_none_or(|n| n >= u32::MAX as usize) {
                return Err(too_many(name));
            }
            add_piece(file, piece, count, &mut left, &mut draft)?;
        }
        Ok(draft)
    })
}

/// Most numbers per byte of the file: compressed surfaces have one or two, a file that is made to fill the memory a thousand.
const DENSEST: usize = 16;

/// Adds a piece with `count` points; `left`: how many numbers the pieces may still hold, all together.
fn add_piece(file: &VtuFile, piece: XmlNode, count: usize, left: &mut usize, draft: &mut Draft) -> Result<()> {
    let mut refuse_more = |what: &str, numbers: Option<usize>| {
        *left = numbers.and_then(|numbers| left.checked_sub(numbers)).ok_or_else(|| {
            file.broken(piece, format!("{what} promises more numbers than a file of this size can hold"))
        })?;
        Ok(())
    };
    let number = |attribute: &str| match piece.attribute(attribute) {
        None => Ok(0),
        Some(_) => file.count(piece, attribute),
    };
    let (polygons, strips) = (number("NumberOfPolys")?, number("NumberOfStrips")?);
    draft.lines += number("NumberOfLines")?;
    if count == 0 || (polygons == 0 && strips == 0) {
        return Ok(());
    }
    refuse_more("NumberOfPoints", count.checked_mul(3))?;
    let first = draft.points.len();
    let points = file.child(piece, "Points")?;
    let Some(points) = arrays(points).next() else {
        return Err(file.broken(points, "<Points> holds no array".into()));
    };
    for (number, x) in file.values(points, count.checked_mul(3), "NumberOfPoints")?.chunks_exact(3).enumerate() {
        let point = DVec3::new(x[0].float(), x[1].float(), x[2].float());
        if !point.is_finite() {
            let DVec3 { x, y, z } = point;
            return Err(file.broken(points, format!("point {number} stands at ({x}, {y}, {z}), which is not finite")));
        }
        draft.points.push(point);
    }
    let kinds = [("Polys", "NumberOfPolys", polygons, false), ("Strips", "NumberOfStrips", strips, true)];
    for (tag, attribute, cells, strip) in kinds {
        if cells == 0 {
            continue;
        }
        refuse_more(attribute, Some(cells))?;
        let Some(node) = child(piece, tag) else {
            return Err(file.broken(piece, format!("{attribute} tells {cells}, but there is no <{tag}>")));
        };
        let (connectivity, offsets) = (file.named_array(node, "connectivity")?, file.named_array(node, "offsets")?);
        let ends = file.values(offsets, Some(cells), attribute)?;
        let last = ends.last().and_then(|end| end.integer()).and_then(|end| usize::try_from(end).ok());
        refuse_more("the last offset", last)?;
        let corners = file.values(connectivity, last, "the last offset")?;
        let (mut begin, mut cell) = (0, Vec::new());
        for end in ends {
            let end = end.integer().and_then(|end| usize::try_from(end).ok());
            let Some(list) = end.and_then(|end| corners.get(begin..end)) else {
                return Err(
                    file.broken(offsets, format!("the offsets of <{tag}> do not rise to the number of corners"))
                );
            };
            begin += list.len();
            cell.clear();
            for corner in list {
                match corner.integer().and_then(|n| usize::try_from(n).ok()).filter(|n| *n < count) {
                    Some(n) => cell.push((first + n) as u32),
                    None => {
                        return Err(file.broken(connectivity, format!("{corner:?} names none of the {count} points")));
                    }
                }
            }
            if strip {
                draft.add_strip(&cell);
            } else {
                draft.add_polygon(&cell);
            }
        }
    }
    Ok(())
}
