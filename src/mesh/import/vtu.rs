//! VTK XML files of unstructured grids (`.vtu`): text, base64 and appended arrays, plain or compressed with zlib. What is no grid
//! there, the document and its arrays, serves surfaces (`.vtp`), too.
//!
//! Source: "VTK File Formats" of the VTK documentation, "XML File Formats". Binary arrays are preceded by their length
//! in bytes; compressed ones by the number of blocks, the size of a block, the size of the last one (0: it is full)
//! and the compressed size of each.

use std::io::Read;

use flate2::read::ZlibDecoder;
use glam::DVec3;
use roxmltree::{Document, Node, ParsingOptions};

use super::raw::RawMesh;
use super::source::{WRITE_AGAIN, excerpt};
use super::vtk::{Grid, GridArray, Tags, WORDS, region_rank};
use crate::{Error, Result};

/// Reads the bytes of a `.vtu` file.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<RawMesh> {
    let kind = DataSet {
        name: "UnstructuredGrid",
        title: "an unstructured grid",
        way_out: "save the mesh as an unstructured grid of tetrahedra (one .vtu file)",
    };
    opened(name, bytes, kind, |file| file.read())
}

/// What a VTK XML file should hold.
pub(crate) struct DataSet {
    /// `type` of the file and tag of its content.
    pub name: &'static str,
    /// In a message.
    pub title: &'static str,
    /// Where it holds something else.
    pub way_out: &'static str,
}

/// What `read` makes of the document and the arrays of a VTK XML file.
pub(crate) fn opened<T>(
    name: &str,
    bytes: &[u8],
    kind: DataSet,
    read: impl FnOnce(&VtuFile) -> Result<T>,
) -> Result<T> {
    let (xml, appended) = split_appended(bytes);
    let text = std::str::from_utf8(xml).map_err(|error| {
        let line = 1 + xml[..error.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        Error::input(format!("{name}:{line}: this is not UTF-8 text"), WRITE_AGAIN)
    })?;
    // The part behind the appended data only closes the document.
    let closed;
    let text = if appended.is_some() {
        closed = format!("{text}</AppendedData></VTKFile>");
        closed.as_str()
    } else {
        text
    };
    if let Some((line, count)) = crowded_tag(text) {
        return Err(Error::input(
            format!("{name}:{line}: a tag with {count} attributes; one of a mesh has at most {MOST_ATTRIBUTES}"),
            WRITE_AGAIN,
        ));
    }
    // Every element inherits a list of all name spaces around it.
    if text.matches("xmlns").count() > MOST_ATTRIBUTES {
        return Err(Error::input(format!("{name}: it declares more name spaces than any mesh has"), WRITE_AGAIN));
    }
    // A document type could refer to other files and blow up entities; no writer of this format makes one.
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        Error::input(format!("{name}:{}: not well-formed XML: {error}", error.pos().row), WRITE_AGAIN)
    })?;
    read(&VtuFile::new(name, &document, appended, kind)?)
}

/// Most attributes of a tag: arrays have ten, and readers of XML compare each with all others.
pub(crate) const MOST_ATTRIBUTES: usize = 100;

/// Line of the first tag with too many attributes, and how many it has.
pub(crate) fn crowded_tag(text: &str) -> Option<(usize, usize)> {
    let bytes = text.as_bytes();
    let mut at = 0;
    while let Some(begin) = bytes[at..].iter().position(|b| *b == b'<').map(|n| at + n) {
        let rest = &text[begin..];
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")]
            .into_iter()
            .find(|(open, _)| rest.starts_with(open))
            .map(|(open, close)| rest[open.len()..].find(close).map_or(rest.len(), |n| open.len() + n + close.len()));
        if let Some(length) = skipped {
            at = begin + length;
            continue;
        }
        let (mut count, mut quote, mut end) = (0, None, bytes.len());
        for (n, byte) in bytes[begin..].iter().enumerate() {
            match (quote, byte) {
                (Some(open), byte) if open == byte => quote = None,
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => count += 1,
                (None, b'>') => {
                    end = begin + n + 1;
                    break;
                }
                _ => {}
            }
        }
        if count > MOST_ATTRIBUTES {
            return Some((1 + bytes[..begin].iter().filter(|b| **b == b'\n').count(), count));
        }
        at = end;
    }
    None
}

/// Splits the XML from the appended data, which may be raw bytes and start behind an underscore.
fn split_appended(bytes: &[u8]) -> (&[u8], Option<&[u8]>) {
    const MARK: &[u8] = b"<AppendedData";
    let Some(start) = bytes.windows(MARK.len()).position(|w| w == MARK) else {
        return (bytes, None);
    };
    let Some(head) = bytes[start..].iter().position(|b| *b == b'>') else {
        return (bytes, None);
    };
    let data = start + head + 1;
    // `<AppendedData .../>` holds nothing.
    if bytes[data - 2] == b'/' {
        return (bytes, None);
    }
    match bytes[data..].iter().position(|b| !b.is_ascii_whitespace()) {
        Some(space) if bytes[data + space] == b'_' => (&bytes[..data], Some(&bytes[data + space + 1..])),
        _ => (bytes, None),
    }
}

/// A VTK XML document with its appended data.
pub(crate) struct VtuFile<'a> {
    name: &'a str,
    document: &'a Document<'a>,
    appended: Option<&'a [u8]>,
    appended_raw: bool,
    big_endian: bool,
    /// Bytes per number in the head of an array.
    header_bytes: usize,
    compressed: bool,
}

pub(crate) type XmlNode<'a> = Node<'a, 'a>;

/// Result of decoding an array; the problem becomes an error where the array and its line are known.
type Decoded<T> = std::result::Result<T, String>;

impl<'a> VtuFile<'a> {
    fn new(name: &'a str, document: &'a Document<'a>, appended: Option<&'a [u8]>, wanted: DataSet) -> Result<Self> {
        let root = document.root_element();
        let mut file = VtuFile {
            name,
            document,
            appended,
            appended_raw: false,
            big_endian: false,
            header_bytes: 4,
            compressed: false,
        };
        let kind = root.attribute("type").unwrap_or_default();
        if root.tag_name().name() != "VTKFile" || kind != wanted.name {
            return Err(file.fail(
                root,
                format!("<{} type=\"{kind}\"> is not {}", root.tag_name().name(), wanted.title),
                wanted.way_out,
            ));
        }
        file.big_endian = match root.attribute("byte_order") {
            None | Some("LittleEndian") => false,
            Some("BigEndian") => true,
            Some(other) => return Err(file.broken(root, format!("byte_order=\"{other}\" is not known"))),
        };
        file.header_bytes = match root.attribute("header_type") {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => return Err(file.broken(root, format!("header_type=\"{other}\" is not known"))),
        };
        file.compressed = match root.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(file.fail(
                    root,
                    format!("compression with {other} is not read here"),
                    "save the file with zlib compression or none",
                ));
            }
        };
        if let Some(node) = child(root, "AppendedData") {
            file.appended_raw = match node.attribute("encoding") {
                Some("raw") => true,
                None | Some("base64") => false,
                Some(other) => return Err(file.broken(node, format!("encoding=\"{other}\" is not known"))),
            };
        }
        Ok(file)
    }

    pub(crate) fn root(&self) -> XmlNode<'a> {
        self.document.root_element()
    }

    pub(crate) fn fail(&self, node: XmlNode, message: String, way_out: &str) -> Error {
        let line = self.document.text_pos_at(node.range().start).row;
        Error::input(format!("{}:{line}: {message}", self.name), way_out)
    }

    pub(crate) fn broken(&self, node: XmlNode, message: String) -> Error {
        self.fail(node, message, WRITE_AGAIN)
    }

    pub(crate) fn child(&self, node: XmlNode<'a>, tag: &str) -> Result<XmlNode<'a>> {
        child(node, tag).ok_or_else(|| self.broken(node, format!("<{}> holds no <{tag}>", node.tag_name().name())))
    }

    pub(crate) fn named_array(&self, node: XmlNode<'a>, name: &str) -> Result<XmlNode<'a>> {
        arrays(node)
            .find(|a| a.attribute("Name").is_some_and(|n| n.eq_ignore_ascii_case(name)))
            .ok_or_else(|| self.broken(node, format!("<{}> holds no array `{name}`", node.tag_name().name())))
    }

    pub(crate) fn count(&self, node: XmlNode, attribute: &str) -> Result<usize> {
        let text = node.attribute(attribute).unwrap_or_default();
        text.trim().parse().map_err(|_| {
            self.broken(
                node,
                format!("{attribute}=\"{}\" is not a whole number without sign", excerpt(text.as_bytes())),
            )
        })
    }

    fn read(&self) -> Result<RawMesh> {
        let grid = self.child(self.document.root_element(), "UnstructuredGrid")?;
        let mut raw = RawMesh::new(self.name, WORDS);
        let mut cells = 0;
        let mut pieces = 0;
        for piece in grid.children().filter(|n| n.has_tag_name("Piece")) {
            cells += self.piece(piece, cells, &mut raw)?;
            pieces += 1;
        }
        if pieces == 0 {
            return Err(self.broken(grid, "<UnstructuredGrid> holds no <Piece>".into()));
        }
        raw.refuse_other_volumes()?;
        Ok(raw)
    }

    /// Reads one piece; returns its number of cells.
    fn piece(&self, piece: XmlNode<'a>, first_cell: u64, raw: &mut RawMesh) -> Result<u64> {
        let point_count = self.count(piece, "NumberOfPoints")?;
        let cell_count = self.count(piece, "NumberOfCells")?;
        if cell_count == 0 {
            return Ok(0);
        }
        let points = self.child(piece, "Points")?;
        let points = arrays(points).next().ok_or_else(|| self.broken(points, "<Points> holds no array".into()))?;
        let cells = self.child(piece, "Cells")?;
        let [connectivity, offsets, types] = ["connectivity", "offsets", "types"].map(|n| self.named_array(cells, n));
        let (connectivity, offsets, types) = (connectivity?, offsets?, types?);
        let mut candidates: Vec<(usize, XmlNode<'a>)> = child(piece, "CellData")
            .into_iter()
            .flat_map(arrays)
            .filter(|a| matches!(a.attribute("NumberOfComponents"), None | Some("1")))
            .filter_map(|a| a.attribute("Name").and_then(region_rank).map(|rank| (rank, a)))
            .collect();
        candidates.sort_by_key(|(rank, _)| *rank);
        let tags = candidates.first().map(|(_, array)| *array);

        let unused = candidates.iter().skip(1).filter_map(|(_, array)| array.attribute("Name"));
        let mut grid = Grid { unused_tags: unused.map(str::to_string).collect(), ..Grid::default() };
        let coordinates = self.values(points, point_count.checked_mul(3), "NumberOfPoints")?;
        for (number, x) in coordinates.chunks_exact(3).enumerate() {
            let position = DVec3::new(x[0].float(), x[1].float(), x[2].float());
            if !position.is_finite() {
                let DVec3 { x, y, z } = position;
                return Err(
                    self.broken(points, format!("point {number} stands at ({x}, {y}, {z}), which is not finite"))
                );
            }
            grid.points.push(position);
        }
        let integers = |array: XmlNode<'a>, count: Option<usize>| -> Result<Vec<i64>> {
            let name = array.attribute("Name").unwrap_or_default();
            let values = self.values(array, count, "NumberOfCells")?;
            values
                .into_iter()
                .map(|v| {
                    v.integer().ok_or_else(|| self.broken(array, format!("array `{name}` must hold whole numbers")))
                })
                .collect()
        };
        grid.types = integers(types, Some(cell_count))?;
        // The file states the end of each cell; the first one starts at 0.
        grid.offsets = vec![0];
        grid.offsets.extend(integers(offsets, Some(cell_count))?);
        let length = usize::try_from(grid.offsets[cell_count]).ok();
        let connectivity_values = self.values(connectivity, length, "the last offset")?;
        for value in connectivity_values {
            let Some(value) = value.integer() else {
                return Err(self.broken(connectivity, "array `connectivity` must hold whole numbers".into()));
            };
            grid.connectivity.push(value);
        }
        if let Some(array) = tags {
            let values = self.values(array, Some(cell_count), "NumberOfCells")?;
            grid.tags = Some(Tags {
                name: array.attribute("Name").unwrap_or_default().to_string(),
                values: values.into_iter().map(Value::float).collect(),
            });
        }
        grid.add_to(raw, first_cell, |array, _, message| {
            let node = match array {
                GridArray::Connectivity => connectivity,
                GridArray::Offsets => offsets,
                GridArray::Types => types,
                GridArray::Tags => tags.unwrap_or(piece),
            };
            self.broken(node, message)
        })?;
        Ok(cell_count as u64)
    }

    /// The values of an array, whose number is known from elsewhere (`source` of the number, for the message).
    pub(crate) fn values(&self, array: XmlNode<'a>, count: Option<usize>, source: &str) -> Result<Vec<Value>> {
        let name = array.attribute("Name").unwrap_or("points");
        let type_name = array.attribute("type").unwrap_or_default();
        let Some(kind) = ValueType::of_name(type_name) else {
            let message = format!("array `{name}` has the type `{type_name}`, which is not read here");
            return Err(self.fail(array, message, "save the array as Int32, Int64, Float32 or Float64"));
        };
        let Some(count) = count else {
            return Err(self.broken(array, format!("array `{name}`: the count from {source} is impossible")));
        };
        let Some(length) = count.checked_mul(kind.bytes) else {
            return Err(self.broken(array, format!("array `{name}`: {count} values cannot be in a file")));
        };
        let wrong_count = |found: usize| {
            let message = format!("array `{name}` holds {found} values where {count} are expected from {source}");
            self.broken(array, message)
        };
        let inline = || array.text().unwrap_or_default();
        let bytes = match array.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let mut values = Vec::new();
                for word in inline().split_ascii_whitespace() {
                    let Some(value) = kind.parse(word) else {
                        let message = format!(
                            "array `{name}`: `{}` is not a number of type {type_name}",
                            excerpt(word.as_bytes())
                        );
                        return Err(self.broken(array, message));
                    };
                    values.push(value);
                }
                return if values.len() == count { Ok(values) } else { Err(wrong_count(values.len())) };
            }
            "binary" => self.decode(&mut Base64::new(inline().as_bytes()), length),
            "appended" => {
                let offset = self.count(array, "offset")?;
                let Some(data) = self.appended.and_then(|data| data.get(offset..)) else {
                    let message =
                        format!("array `{name}` should start at byte {offset} of the appended data, which ends before");
                    return Err(self.broken(array, message));
                };
                if self.appended_raw {
                    self.decode(&mut Raw(data), length)
                } else {
                    self.decode(&mut Base64::new(data), length)
                }
            }
            other => return Err(self.broken(array, format!("array `{name}`: format=\"{other}\" is not known"))),
        };
        let bytes = bytes.map_err(|problem| self.broken(array, format!("array `{name}`: {problem}")))?;
        if bytes.len() != length {
            return Err(wrong_count(bytes.len() / kind.bytes));
        }
        Ok(bytes.chunks_exact(kind.bytes).map(|b| kind.decode(self.word(b))).collect())
    }

    /// Joins bytes in the order of the file.
    fn word(&self, bytes: &[u8]) -> u64 {
        let join = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
        if self.big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) }
    }

    fn head_number(&self, stream: &mut dyn Stream) -> Decoded<usize> {
        let bytes = stream.take(self.header_bytes)?;
        usize::try_from(self.word(&bytes)).map_err(|_| "a length in its head is impossible".to_string())
    }

    /// The bytes of an array that should be `expected` long; never more than one byte above it is unpacked.
    fn decode(&self, stream: &mut dyn Stream, expected: usize) -> Decoded<Vec<u8>> {
        let first = self.head_number(stream)?;
        if !self.compressed {
            if first != expected {
                return Err(format!("its head tells {first} bytes where {expected} are expected"));
            }
            return stream.take(first);
        }
        let (block, last) = (self.head_number(stream)?, self.head_number(stream)?);
        let full = if first > 0 && last != 0 { first - 1 } else { first };
        if full.checked_mul(block).and_then(|n| n.checked_add(last)) != Some(expected) {
            return Err(format!(
                "its head tells {first} blocks of {block} bytes (last: {last}) where {expected} bytes are expected"
            ));
        }
        let mut sizes = Vec::new();
        for _ in 0..first {
            sizes.push(self.head_number(stream)?);
        }
        // A compressed block starts its own base64 group.
        stream.start_group();
        let mut bytes = Vec::new();
        for (number, size) in sizes.into_iter().enumerate() {
            let packed = stream.take(size)?;
            let size = if number < full { block } else { last };
            let before = bytes.len();
            ZlibDecoder::new(packed.as_slice())
                .take(size as u64 + 1)
                .read_to_end(&mut bytes)
                .map_err(|error| format!("block {number} cannot be unpacked: {error}"))?;
            if bytes.len() - before != size {
                return Err(format!("block {number} does not unpack to {size} bytes"));
            }
        }
        Ok(bytes)
    }
}

pub(crate) fn child<'a>(node: XmlNode<'a>, tag: &str) -> Option<XmlNode<'a>> {
    node.children().find(|n| n.has_tag_name(tag))
}

pub(crate) fn arrays<'a>(node: XmlNode<'a>) -> impl Iterator<Item = XmlNode<'a>> {
    node.children().filter(|n| n.has_tag_name("DataArray"))
}

/// A value of an array.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Value {
    Integer(i64),
    Float(f64),
}

impl Value {
    pub(crate) fn float(self) -> f64 {
        match self {
            Value::Integer(v) => v as f64,
            Value::Float(v) => v,
        }
    }

    pub(crate) fn integer(self) -> Option<i64> {
        match self {
            Value::Integer(v) => Some(v),
            Value::Float(_) => None,
        }
    }
}

/// A data type of the format.
#[derive(Debug, Clone, Copy)]
struct ValueType {
    bytes: usize,
    float: bool,
    signed: bool,
}

impl ValueType {
    fn of_name(name: &str) -> Option<ValueType> {
        let (bytes, float, signed) = match name {
            "Int8" => (1, false, true),
            "UInt8" => (1, false, false),
            "Int16" => (2, false, true),
            "UInt16" => (2, false, false),
            "Int32" => (4, false, true),
            "UInt32" => (4, false, false),
            "Int64" => (8, false, true),
            "UInt64" => (8, false, false),
            "Float32" => (4, true, true),
            "Float64" => (8, true, true),
            _ => return None,
        };
        Some(ValueType { bytes, float, signed })
    }

    fn parse(self, word: &str) -> Option<Value> {
        if self.float { word.parse().ok().map(Value::Float) } else { word.parse().ok().map(Value::Integer) }
    }

    fn decode(self, word: u64) -> Value {
        let spare = 64 - 8 * self.bytes as u32;
        match (self.float, self.bytes) {
            (true, 4) => Value::Float(f64::from(f32::from_bits(word as u32))),
            (true, _) => Value::Float(f64::from_bits(word)),
            (false, _) if self.signed => Value::Integer((word << spare) as i64 >> spare),
            (false, _) => Value::Integer(word as i64),
        }
    }
}

/// Bytes in the order in which an array stores them.
trait Stream {
    fn take(&mut self, count: usize) -> Decoded<Vec<u8>>;
    /// Drops what is left of a base64 group.
    fn start_group(&mut self);
}

struct Raw<'a>(&'a [u8]);

impl Stream for Raw<'_> {
    fn take(&mut self, count: usize) -> Decoded<Vec<u8>> {
        match self.0.split_at_checked(count) {
            Some((head, rest)) => {
                self.0 = rest;
                Ok(head.to_vec())
            }
            None => Err(format!("{count} bytes should follow, but only {} do", self.0.len())),
        }
    }

    fn start_group(&mut self) {}
}

/// Base64 (RFC 4648, section 4) with one addition that VTK needs: padding may stand inside, because some writers
/// encode the head of an array apart from its data.
struct Base64<'a> {
    text: &'a [u8],
    /// Decoded bytes of the group under the cursor that were not taken yet.
    pending: Vec<u8>,
}

impl<'a> Base64<'a> {
    fn new(text: &'a [u8]) -> Self {
        Base64 { text, pending: Vec::new() }
    }

    /// Decodes the next four characters; `None` at the end of the text.
    fn next_group(&mut self) -> Decoded<Option<Vec<u8>>> {
        let mut word = 0u32;
        let (mut digits, mut padding) = (0, 0);
        while digits + padding < 4 {
            let Some((&byte, rest)) = self.text.split_first() else {
                return if digits == 0 { Ok(None) } else { Err("its base64 text ends within a group".into()) };
            };
            self.text = rest;
            let digit = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' if digits >= 2 => {
                    padding += 1;
                    continue;
                }
                _ if byte.is_ascii_whitespace() => continue,
                _ => return Err(format!("`{}` is no base64", excerpt(&[byte]))),
            };
            if padding > 0 {
                return Err("its base64 text goes on within the padding".into());
            }
            word = word << 6 | u32::from(digit);
            digits += 1;
        }
        let bytes = (word << (6 * padding)).to_be_bytes();
        Ok(Some(bytes[1..digits].to_vec()))
    }
}

impl Stream for Base64<'_> {
    fn take(&mut self, count: usize) -> Decoded<Vec<u8>> {
        let mut bytes = std::mem::take(&mut self.pending);
        while bytes.len() < count {
            match self.next_group()? {
                Some(group) => bytes.extend(group),
                None => return Err(format!("{count} bytes should follow, but only {} do", bytes.len())),
            }
        }
        self.pending = bytes.split_off(count);
        Ok(bytes)
    }

    fn start_group(&mut self) {
        self.pending.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_with_padding_inside() {
        // RFC 4648, section 10: "f" and "foobar", one behind the other.
        let mut stream = Base64::new(b"Zg==\n Zm9v YmFy");
        assert_eq!(stream.take(4).unwrap(), b"ffoo");
        assert_eq!(stream.take(3).unwrap(), b"bar");
        assert!(stream.take(1).unwrap_err().contains("only 0 do"));
        assert!(Base64::new(b"Zg=").take(1).unwrap_err().contains("within a group"));
        assert!(Base64::new(b"Z!==").take(1).unwrap_err().contains("no base64"));
    }
}
