//! MetaImage volumes (`.mha`, `.mhd` with `.raw` or `.zraw`).
//!
//! Source: "MetaIO" of the ITK wiki (<https://itk.org/Wiki/ITK/MetaIO/Documentation>), checked against files that SimpleITK wrote: each row
//! of `TransformMatrix` is the direction of one index axis, and the space is LPS.

use std::collections::HashMap;

use glam::{DMat3, DVec3};

use super::Labelled;
use super::label_map::LabelMap;
use super::voxels::{self, Beside, Fault, Kind, Packing, Part, SEGMENT, Values, WRITE_AGAIN, shown};
use crate::{Error, Result};

const MEND_HEADER: &str = "correct the header in a text editor, or write the file again, e.g. with 3D Slicer";

/// Whether the bytes begin as the text of such a header does.
pub(super) fn looks_like(head: &[u8]) -> bool {
    let mut lines = head.split(|b| *b == b'\n').take(20);
    // The data that may follow is no text.
    lines.any(|line| {
        let key = line.split(|b| *b == b'=').next().unwrap_or_default().trim_ascii();
        key.len() < line.len() && (key.eq_ignore_ascii_case(b"ObjectType") || key.eq_ignore_ascii_case(b"NDims"))
    })
}

/// Reads the bytes of a `.mha` or `.mhd` file.
pub(super) fn read(name: &str, bytes: &[u8], beside: Beside) -> Result<Labelled> {
    let header = Header::of(name, bytes)?;
    let mut notices = Vec::new();
    if let Some(field) = header.field(&["ObjectType"])
        && !field.value.eq_ignore_ascii_case("image")
    {
        return Err(header.fail(
            field,
            format!("`{}` is no image", shown(&field.value)),
            "save the label map as an image",
        ));
    }
    let field = header.needed(&["NDims"])?;
    if field.value != "3" {
        let message = format!("`{}` axes are not read here", shown(&field.value));
        return Err(header.fail(field, message, "save one volume of three axes"));
    }
    if let Some(field) = header.field(&["ElementNumberOfChannels"])
        && field.value != "1"
    {
        let message = format!("`{}` values per voxel are no labels", shown(&field.value));
        return Err(header.fail(field, message, SEGMENT));
    }
    let dimensions = header.needed(&["DimSize"])?;
    let (size, count) =
        voxels::volume(header.numbers::<u64, 3>(dimensions)?).map_err(|fault| fault.at(header.place(dimensions)))?;
    let (steps, origin) = geometry(&header, &mut notices)?;
    let values = Values {
        kind: kind(&header)?,
        big_endian: header.is_true(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"], false)?,
        count,
        scale: None,
    };
    let is_text = !header.is_true(&["BinaryData"], true)?;
    let is_packed = header.is_true(&["CompressedData"], false)?;

    let file = header.needed(&["ElementDataFile"])?;
    let separate;
    let mut data = match file.value.to_ascii_uppercase().as_str() {
        "LOCAL" => &bytes[header.data_at.min(bytes.len())..],
        value if value.starts_with("LIST") || value.contains('%') => {
            let way_out = "save the volume as one .mha file, e.g. with 3D Slicer";
            return Err(header.fail(file, "the data lies in several files, which is not read here", way_out));
        }
        _ => {
            separate = voxels::data_file(&file.value, beside, header.place(file))?;
            separate.as_slice()
        }
    };
    if let Some(field) = header.field(&["HeaderSize"]) {
        let skip = match field.value.parse::<i64>() {
            Ok(-1) if !is_packed && !is_text => {
                data.len().saturating_sub(usize::try_from(values.bytes()).unwrap_or(usize::MAX))
            }
            Ok(skip @ 0..) => usize::try_from(skip).unwrap_or(usize::MAX),
            _ => return Err(header.fail(field, "a whole number from 0 must stand here", MEND_HEADER)),
        };
        data = data
            .get(skip..)
            .ok_or_else(|| header.fail(field, "the data has fewer bytes than are to be skipped", WRITE_AGAIN))?;
    }
    let packing = match is_packed {
        false => Packing::Plain,
        // Both are unpacked by ITK.
        true if data.starts_with(&[0x1f, 0x8b]) => Packing::Gzip,
        true => Packing::Zlib,
    };
    let needed = if is_text { (2 * count as u64).saturating_sub(1) } else { values.bytes() };
    packing.can_hold(data, needed).map_err(|fault| fault.at(header.place(dimensions)))?;
    let mut labels = voxels::room(count).map_err(|fault| fault.at(name))?;
    let take = |_, label| labels.push(label);
    let more = match is_text {
        true if is_packed => {
            let field = header.needed(&["CompressedData"])?;
            return Err(header.fail(
                field,
                "numbers in text that are compressed are not read here",
                "save the values as binary data",
            ));
        }
        true => values.read_text(data, take),
        false => values.read(&mut packing.open(data), take),
    };
    let more = more.map_err(|trouble| trouble.fault(count, |n| voxels::voxel(size, n)).at(name))?;
    if more && is_packed {
        return Err(header.fail(dimensions, format!("there are more values than these {count}"), WRITE_AGAIN));
    }
    if more {
        notices.push(format!("There is more data than the {count} values of DimSize; the rest is not read."));
    }
    Ok(Labelled { map: LabelMap { size, steps, origin, labels, ..LabelMap::default() }, notices })
}

/// A line of the header.
struct Field {
    line: usize,
    key: String,
    value: String,
}

struct Header<'a> {
    name: &'a str,
    /// By their keys in small letters.
    fields: HashMap<String, Field>,
    /// Where the data begins that stands in the same file.
    data_at: usize,
}

impl<'a> Header<'a> {
    fn of(name: &'a str, bytes: &[u8]) -> Result<Self> {
        let mut header = Header { name, fields: HashMap::new(), data_at: bytes.len() };
        let (mut at, mut line) = (0, 0);
        while at < bytes.len() {
            let rest = &bytes[at..];
            let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
            at = (at + length + 1).min(bytes.len());
            line += 1;
            let text = String::from_utf8_lossy(&rest[..length]);
            if text.trim().is_empty() || text.starts_with('#') {
                continue;
            }
            let Some((key, value)) = text.split_once('=').filter(|(key, _)| key.len() < 200) else {
                let message = format!("`{}` is no line of a header", shown(&text));
                return Err(Fault::new(message, WRITE_AGAIN).at(format!("{name}:{line}")));
            };
            let plain = key.trim().to_ascii_lowercase();
            let is_last = plain == "elementdatafile";
            let field = Field { line, key: key.trim().into(), value: value.trim().into() };
            // What other programs note for themselves may stand there twice.
            if let Some(first) = header.fields.insert(plain, field)
                && KEYS.iter().any(|known| known.eq_ignore_ascii_case(&first.key))
            {
                let message = format!("`{}` stands here for the second time, first on line {}", first.key, first.line);
                return Err(Fault::new(message, MEND_HEADER).at(format!("{name}:{line}")));
            }
            if is_last {
                header.data_at = at;
                break;
            }
        }
        Ok(header)
    }

    /// The field of one of these keys, the first that there is.
    fn field(&self, keys: &[&str]) -> Option<&Field> {
        keys.iter().find_map(|key| self.fields.get(&key.to_ascii_lowercase()))
    }

    fn needed(&self, keys: &[&str]) -> Result<&Field> {
        let missing = || Error::input(format!("{}: the header has no `{}`", self.name, keys[0]), MEND_HEADER);
        self.field(keys).ok_or_else(missing)
    }

    fn place(&self, field: &Field) -> String {
        format!("{}:{}: {}", self.name, field.line, shown(&field.key))
    }

    fn fail(&self, field: &Field, message: impl Into<String>, way_out: &'static str) -> Error {
        Fault::new(message, way_out).at(self.place(field))
    }

    fn is_true(&self, keys: &[&str], otherwise: bool) -> Result<bool> {
        let Some(field) = self.field(keys) else { return Ok(otherwise) };
        match field.value.to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(true),
            "false" | "0" => Ok(false),
            _ => Err(self.fail(field, "True or False must stand here", MEND_HEADER)),
        }
    }

    fn numbers<T: std::str::FromStr, const N: usize>(&self, field: &Field) -> Result<[T; N]> {
        let words = field.value.split_whitespace().take(N + 1);
        let numbers: std::result::Result<Vec<T>, T::Err> = words.map(str::parse).collect();
        let numbers = numbers.ok().and_then(|numbers| numbers.try_into().ok());
        numbers.ok_or_else(|| {
            self.fail(field, format!("{N} numbers must stand here, not `{}`", shown(&field.value)), MEND_HEADER)
        })
    }
}

/// What must not stand there twice.
const KEYS: &[&str] = &[
    "NDims",
    "DimSize",
    "ElementType",
    "ElementSpacing",
    "ElementSize",
    "Offset",
    "Position",
    "Origin",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "CompressedData",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "HeaderSize",
];

fn kind(header: &Header) -> Result<Kind> {
    let field = header.needed(&["ElementType"])?;
    Ok(match field.value.to_ascii_uppercase().as_str() {
        "MET_CHAR" => Kind::I8,
        "MET_UCHAR" => Kind::U8,
        "MET_SHORT" => Kind::I16,
        "MET_USHORT" => Kind::U16,
        // MetaIO writes four bytes for a long on every system.
        "MET_INT" | "MET_LONG" => Kind::I32,
        "MET_UINT" | "MET_ULONG" => Kind::U32,
        "MET_LONG_LONG" => Kind::I64,
        "MET_ULONG_LONG" => Kind::U64,
        "MET_FLOAT" => Kind::F32,
        "MET_DOUBLE" => Kind::F64,
        other => {
            let message = format!("values of the type `{}` are not read here", shown(other));
            return Err(header.fail(field, message, "save the labels as MET_UCHAR or MET_USHORT"));
        }
    })
}

/// Steps as columns and origin, RAS [m].
fn geometry(header: &Header, notices: &mut Vec<String>) -> Result<(DMat3, DVec3)> {
    const LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);
    let mut per_metre = 1e3;
    if let Some(field) = header.field(&["DistanceUnits"]) {
        let way_out = "write mm, cm, m or um there, whichever is right";
        let unknown =
            || header.fail(field, format!("the unit of length `{}` is not known", shown(&field.value)), way_out);
        per_metre = match field.value.as_str() {
            "?" => 1e3,
            word => voxels::per_metre(word).ok_or_else(unknown)?,
        };
        if per_metre != 1e3 {
            notices.push(format!("Lengths are taken in {} as `{}` says.", shown(&field.value), field.key));
        }
    }
    let spacing_field = header.field(&["ElementSpacing", "ElementSize"]);
    let Some(spacing_field) = spacing_field else {
        let message = format!("{}: neither `ElementSpacing` nor `ElementSize` say how large voxels are", header.name);
        return Err(Error::input(message, MEND_HEADER));
    };
    let spacing = DVec3::from_array(header.numbers(spacing_field)?);
    if spacing.min_element() <= 0.0 {
        return Err(header.fail(spacing_field, "every spacing must be above 0", MEND_HEADER));
    }
    let direction_field = header.field(&["TransformMatrix", "Rotation", "Orientation"]);
    let directions = match direction_field {
        Some(field) => DMat3::from_cols_array(&header.numbers(field)?),
        None => {
            notices.push(
                "The file gives no directions of its axes; they are taken as left, posterior, superior (LPS).".into(),
            );
            DMat3::IDENTITY
        }
    };
    let is_unit = |direction: DVec3| (0.99..1.01).contains(&direction.length());
    if let Some(field) = direction_field
        && ![directions.x_axis, directions.y_axis, directions.z_axis].into_iter().all(is_unit)
    {
        return Err(header.fail(field, "every direction must have the length 1", MEND_HEADER));
    }
    let offset_field = header.field(&["Offset", "Position", "Origin"]);
    let offset = match offset_field {
        Some(field) => DVec3::from_array(header.numbers(field)?),
        None => {
            notices.push("The file gives no `Offset`; the centre of its first voxel is taken as the origin.".into());
            DVec3::ZERO
        }
    };
    let spacing = spacing / per_metre;
    let steps = DMat3::from_cols(
        LPS * directions.x_axis * spacing.x,
        LPS * directions.y_axis * spacing.y,
        LPS * directions.z_axis * spacing.z,
    );
    let origin = LPS * offset / per_metre;
    voxels::check_grid(&steps, origin).map_err(|(part, fault)| {
        let is_plane = fault.what.contains("one plane");
        let field = match part {
            Part::Origin => offset_field,
            Part::Steps if is_plane => direction_field,
            Part::Steps => Some(spacing_field),
        };
        fault.at(header.place(field.unwrap_or(spacing_field)))
    })?;
    Ok((steps, origin))
}
