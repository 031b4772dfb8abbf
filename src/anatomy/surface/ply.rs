//! PLY files: text, and binary of either byte order.
//!
//! Source: G. Turk, "The PLY Polygon File Format" (1994). Read are x, y, z of `vertex` and the list `vertex_indices` (or `vertex_index`)
//! of `face`; other elements and properties are stepped over.

use glam::DVec3;

use super::draft::Draft;
use super::stl::too_many;
use crate::Result;
use crate::mesh::import::source::{Source, excerpt};

/// A number in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scalar {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Scalar {
    fn named(name: &[u8]) -> Option<Scalar> {
        Some(match name {
            b"char" | b"int8" => Scalar::Signed(1),
            b"uchar" | b"uint8" => Scalar::Unsigned(1),
            b"short" | b"int16" => Scalar::Signed(2),
            b"ushort" | b"uint16" => Scalar::Unsigned(2),
            b"int" | b"int32" => Scalar::Signed(4),
            b"uint" | b"uint32" => Scalar::Unsigned(4),
            b"float" | b"float32" => Scalar::Float(4),
            b"double" | b"float64" => Scalar::Float(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        let (Scalar::Signed(bytes) | Scalar::Unsigned(bytes) | Scalar::Float(bytes)) = self;
        bytes
    }

    /// The number whose bits these are; all kinds fit a double exactly.
    fn decode(self, word: u64) -> f64 {
        let spare = 64 - 8 * self.bytes() as u32;
        match self {
            Scalar::Signed(_) => ((word << spare) as i64 >> spare) as f64,
            Scalar::Unsigned(_) => word as f64,
            Scalar::Float(4) => f64::from(f32::from_bits(word as u32)),
            Scalar::Float(_) => f64::from_bits(word),
        }
    }
}

struct Property<'a> {
    name: &'a [u8],
    /// Kind of the length of a list.
    list: Option<Scalar>,
    kind: Scalar,
}

struct Element<'a> {
    at: usize,
    name: &'a [u8],
    count: u64,
    properties: Vec<Property<'a>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

struct PlyFile<'a> {
    source: Source<'a>,
    encoding: Encoding,
}

/// Reads the bytes of a file.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Draft> {
    let mut file = PlyFile { source: Source::new(name, bytes), encoding: Encoding::Text };
    let elements = file.head()?;
    let vertices = elements.iter().filter(|e| e.name == b"vertex").fold(0_u64, |sum, e| sum.saturating_add(e.count));
    if elements.iter().any(|e| e.name == b"tristrips" && e.count > 0) {
        return Err(file.source.fail(0, "triangle strips are not read", "export the surface as single triangles"));
    }
    let mut draft = Draft::default();
    draft.parts.push((String::new(), Vec::new()));
    for element in &elements {
        file.element(element, vertices, &mut draft)?;
    }
    Ok(draft)
}

impl<'a> PlyFile<'a> {
    fn head(&mut self) -> Result<Vec<Element<'a>>> {
        let mut elements: Vec<Element> = Vec::new();
        let mut encoding = None;
        self.source.line();
        loop {
            let at = self.source.at();
            let Some(line) = self.source.line() else {
                return Err(self.source.broken(at, "the file ends within its head: `end_header` is missing"));
            };
            let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take(6).collect();
            let kind = |word: &[u8]| {
                Scalar::named(word).ok_or_else(|| {
                    self.source.broken(at, format!("`{}` is no kind of number of this format", excerpt(word)))
                })
            };
            match words[..] {
                [] | [b"comment" | b"obj_info", ..] => {}
                [b"format", b"ascii", ..] => encoding = Some(Encoding::Text),
                [b"format", b"binary_little_endian", ..] => encoding = Some(Encoding::LittleEndian),
                [b"format", b"binary_big_endian", ..] => encoding = Some(Encoding::BigEndian),
                [b"element", name, count] => {
                    let count = self.source.parse((at, count), "the number of elements")?;
                    elements.push(Element { at, name, count, properties: Vec::new() });
                }
                [b"property", b"list", length, of, name] => {
                    let (list, of) = (kind(length)?, kind(of)?);
                    if matches!(list, Scalar::Float(_)) {
                        return Err(self.source.broken(at, "the length of a list must be a whole number"));
                    }
                    let Some(element) = elements.last_mut() else {
                        return Err(self.source.broken(at, "a property before the first element"));
                    };
                    element.properties.push(Property { name, list: Some(list), kind: of });
                }
                [b"property", of, name] => {
                    let of = kind(of)?;
                    let Some(element) = elements.last_mut() else {
                        return Err(self.source.broken(at, "a property before the first element"));
                    };
                    element.properties.push(Property { name, list: None, kind: of });
                }
                [b"end_header", ..] => break,
                _ => {
                    let message = format!("`{}` is no line of the head of a PLY file", excerpt(line));
                    return Err(self.source.broken(at, message));
                }
            }
        }
        let Some(encoding) = encoding else {
            return Err(self.source.broken(0, "the head does not tell the format of the numbers"));
        };
        (self.encoding, self.source.binary) = (encoding, encoding != Encoding::Text);
        Ok(elements)
    }

    fn element(&mut self, element: &Element, vertices: u64, draft: &mut Draft) -> Result<()> {
        let title = excerpt(element.name);
        if element.count == 0 {
            return Ok(());
        }
        // Nothing is taken from the count of the head before the file is long enough for it.
        let least: usize = match self.encoding {
            Encoding::Text => 2 * element.properties.len(),
            _ => element.properties.iter().map(|p| p.list.unwrap_or(p.kind).bytes()).sum(),
        };
        let left = self.source.rest().len() as u64 + 1;
        if least == 0 || element.count.checked_mul(least as u64).is_none_or(|bytes| bytes > left) {
            return Err(self.source.broken(
                element.at,
                format!(
                    "{} elements `{title}` are promised, more than the {} bytes left can hold",
                    element.count,
                    left - 1
                ),
            ));
        }
        let place = |name: &[u8]| element.properties.iter().position(|p| p.name == name && p.list.is_none());
        let is_vertex = element.name == b"vertex";
        let axes = [place(b"x"), place(b"y"), place(b"z")];
        if is_vertex && axes.contains(&None) {
            return Err(self.source.broken(element.at, "the element `vertex` has no x, y and z"));
        }
        let indices = element
            .properties
            .iter()
            .position(|p| p.list.is_some() && (p.name == b"vertex_indices" || p.name == b"vertex_index"));
        let is_face = element.name == b"face";
        if is_face && indices.is_none() {
            return Err(self.source.broken(element.at, "the element `face` has no list `vertex_indices`"));
        }
        let mut corners: Vec<u32> = Vec::new();
        for number in 0..element.count {
            let mut point = [0.0; 3];
            for (n, property) in element.properties.iter().enumerate() {
                let Some(list) = property.list else {
                    let (at, value) = self.number(property.kind, "a value")?;
                    if let Some(axis) = axes.iter().position(|a| is_vertex && *a == Some(n)) {
                        if !value.is_finite() {
                            let message = format!("a coordinate of vertex {number} is {value}, which is not finite");
                            return Err(self.source.broken(at, message));
                        }
                        point[axis] = value;
                    }
                    continue;
                };
                let (at, length) = self.number(list, "the length of a list")?;
                if !(length >= 0.0 && length.fract() == 0.0 && length <= self.source.rest().len() as f64) {
                    let message =
                        format!("a list of {length} numbers in element {number} of `{title}` is not in the file");
                    return Err(self.source.broken(at, message));
                }
                let wanted = is_face && indices == Some(n);
                corners.clear();
                for _ in 0..length as u64 {
                    let (at, value) = self.number(property.kind, "a number of a list")?;
                    if !wanted {
                        continue;
                    }
                    if !(value >= 0.0 && value.fract() == 0.0 && value < vertices as f64) {
                        let message =
                            format!("face {number} names vertex {value}, but the file has {vertices} of them");
                        return Err(self.source.broken(at, message));
                    }
                    corners.push(value as u32);
                }
                if wanted {
                    draft.add_polygon(&corners);
                }
            }
            if is_vertex {
                draft.next_point().ok_or_else(|| too_many(self.source.name()))?;
                draft.points.push(DVec3::from_array(point));
            }
        }
        Ok(())
    }

    /// The next number and its place.
    fn number(&mut self, kind: Scalar, what: &str) -> Result<(usize, f64)> {
        if self.encoding == Encoding::Text {
            let word = self.source.word(what)?;
            return Ok((word.0, self.source.parse(word, what)?));
        }
        let at = self.source.at();
        let bytes = self.source.take(kind.bytes() as u64, what)?;
        let join = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
        let word = match self.encoding {
            Encoding::BigEndian => bytes.iter().fold(0, join),
            _ => bytes.iter().rev().fold(0, join),
        };
        Ok((at, kind.decode(word)))
    }
}
