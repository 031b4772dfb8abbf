//! STL files, binary and text.
//!
//! Source: 3D Systems, "StereoLithography Interface Specification" (1988). Binary: 80 bytes of anything, the number of triangles, and for
//! each of them its normal, three corners (all single precision, little endian) and two bytes. Text: `solid`, facets with their loops,
//! `endsolid`; several solids may follow each other. Normals are not read: the order of the corners says the same.

use glam::DVec3;

use super::draft::Draft;
use crate::mesh::import::source::{Source, WRITE_AGAIN, excerpt};
use crate::{Error, Result};

/// Bytes before the first triangle of a binary file.
pub(super) const HEAD: u64 = 84;

/// Bytes of a triangle there.
pub(super) const TRIANGLE: u64 = 50;

/// Length of a binary file with as many triangles as its head tells.
pub(super) fn promised(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..HEAD as usize)?.first_chunk().map(|c| u32::from_le_bytes(*c))?;
    Some(HEAD + TRIANGLE * u64::from(count))
}

/// Reads a binary file that has at least the length that its head promises.
pub(super) fn binary(name: &str, bytes: &[u8]) -> Result<Draft> {
    let body = &bytes[HEAD as usize..];
    let count = (promised(bytes).unwrap_or(HEAD) - HEAD) / TRIANGLE;
    let length = (count * TRIANGLE) as usize;
    let mut draft = Draft { loose: true, ..Draft::default() };
    draft.parts.push((String::new(), Vec::new()));
    if body.len() > length {
        draft
            .notices
            .push(format!("{} bytes behind the last of {count} triangles were not read.", body.len() - length));
    }
    for (number, record) in body[..length].chunks_exact(TRIANGLE as usize).enumerate() {
        let float = |at: usize| {
            let bytes = [record[at], record[at + 1], record[at + 2], record[at + 3]];
            f64::from(f32::from_le_bytes(bytes))
        };
        let mut corners = [0; 3];
        for (n, corner) in corners.iter_mut().enumerate() {
            let at = 12 + 12 * n;
            let point = DVec3::new(float(at), float(at + 4), float(at + 8));
            if !point.is_finite() {
                let place = HEAD as usize + number * TRIANGLE as usize + at;
                return Err(Error::input(
                    format!(
                        "{name}: byte {place}: corner {n} of triangle {number} stands at ({}, {}, {}), which is not finite",
                        point.x, point.y, point.z
                    ),
                    WRITE_AGAIN,
                ));
            }
            *corner = draft.next_point().ok_or_else(|| too_many(name))?;
            draft.points.push(point);
        }
        draft.add_polygon(&corners);
    }
    Ok(draft)
}

/// Reads a text file.
pub(super) fn text(name: &str, bytes: &[u8]) -> Result<Draft> {
    let mut source = Source::new(name, bytes);
    source.refuse_zeros()?;
    let mut draft = Draft { loose: true, ..Draft::default() };
    let mut corners = Vec::new();
    while !source.is_done() {
        expect(&mut source, "solid")?;
        let title = source.line().unwrap_or_default().trim_ascii();
        draft.parts.push((String::from_utf8_lossy(title).into_owned(), Vec::new()));
        loop {
            let (at, word) = source.word("`facet` or `endsolid`")?;
            if word.eq_ignore_ascii_case(b"endsolid") {
                source.line();
                break;
            }
            if !word.eq_ignore_ascii_case(b"facet") {
                return Err(source.broken(at, format!("`{}` where `facet` or `endsolid` should be", excerpt(word))));
            }
            expect(&mut source, "normal")?;
            for _ in 0..3 {
                // Some writers have a normal of NaN for a triangle without area.
                source.number::<f64>("a component of a normal")?;
            }
            expect(&mut source, "outer")?;
            expect(&mut source, "loop")?;
            corners.clear();
            loop {
                let (at, word) = source.word("`vertex` or `endloop`")?;
                if word.eq_ignore_ascii_case(b"endloop") {
                    break;
                }
                if !word.eq_ignore_ascii_case(b"vertex") {
                    return Err(source.broken(at, format!("`{}` where `vertex` or `endloop` should be", excerpt(word))));
                }
                let mut point = [0.0; 3];
                for x in &mut point {
                    let word = source.word("a coordinate")?;
                    *x = coordinate(&source, word)?;
                }
                corners.push(draft.next_point().ok_or_else(|| too_many(name))?);
                draft.points.push(DVec3::from_array(point));
            }
            expect(&mut source, "endfacet")?;
            draft.add_polygon(&corners);
        }
    }
    Ok(draft)
}

/// A finite number in text.
pub(super) fn coordinate(source: &Source, (at, word): (usize, &[u8])) -> Result<f64> {
    let value: f64 = source.parse((at, word), "a coordinate")?;
    match value.is_finite() {
        true => Ok(value),
        false => Err(source.broken(at, format!("a coordinate: {value} is not finite"))),
    }
}

pub(super) fn too_many(name: &str) -> Error {
    Error::input(format!("{name}: more than 2^32 - 2 points"), "make the surface coarser")
}

fn expect(source: &mut Source, wanted: &str) -> Result<()> {
    let (at, word) = source.word(&format!("`{wanted}`"))?;
    match word.eq_ignore_ascii_case(wanted.as_bytes()) {
        true => Ok(()),
        false => Err(source.broken(at, format!("`{}` where `{wanted}` should be", excerpt(word)))),
    }
}
