//! NRRD volumes (`.nrrd`, `.nhdr` with a data file, `.seg.nrrd` of 3D Slicer).
//!
//! Source: "Definition of NRRD File Format" of Teem (<https://teem.sourceforge.net/nrrd/format.html>), and "Segmentations" in the
//! developer guide of 3D Slicer for its `SegmentN_...` keys. Lines are skipped before unpacking, bytes after it.

use std::collections::{BTreeMap, HashMap};
use std::io::Read;

use glam::{DMat3, DVec3};

use super::Labelled;
use super::label_map::{LabelMap, MOST_VOXELS};
use super::layers::Layers;
use super::voxels::{self, Beside, Fault, Hex, Kind, Packing, Part, SEGMENT, SMALLER, Values, WRITE_AGAIN, shown};
use crate::{Error, Result};

/// Way out where the header leaves out or contradicts what must be known.
const MEND_HEADER: &str = "correct the header in a text editor, or write the file again, e.g. with 3D Slicer";

/// Whether the bytes begin as a NRRD file does.
pub(super) fn looks_like(head: &[u8]) -> bool {
    head.starts_with(b"NRRD")
}

/// Reads the bytes of a `.nrrd` or `.nhdr` file.
pub(super) fn read(name: &str, bytes: &[u8], beside: Beside) -> Result<Labelled> {
    let header = Header::of(name, bytes)?;
    let mut notices = Vec::new();
    header.tell_unknown(&mut notices);
    // Before the axes: those of a space of four cannot be told from one of three and a list.
    check_space(&header)?;
    let axes = Axes::of(&header)?;
    let (steps, origin) = geometry(&header, &axes, &mut notices)?;
    let segments = segments(&header, axes.layers)?;
    let encoding = Encoding::of(&header)?;
    let values = values(&header, &axes, encoding)?;
    let detached;
    let all = match header.field("datafile") {
        None if header.data_at.is_none() => {
            let message = format!("{name}: the header has neither an empty line at its end nor a `data file`");
            return Err(Error::input(message, WRITE_AGAIN));
        }
        None => &bytes[header.data_at.unwrap_or(bytes.len())..],
        Some(field) => {
            if field.value.contains('%') || field.value.to_uppercase().starts_with("LIST") {
                let way_out = "save the volume as one .nrrd file, e.g. with 3D Slicer";
                return Err(header.fail(field, "the data lies in several files, which is not read here", way_out));
            }
            detached = voxels::data_file(&field.value, beside, header.place(field))?;
            detached.as_slice()
        }
    };
    let data = skipped(&header, all, encoding, values)?;
    let mut map = LabelMap { size: axes.size, steps, origin, ..LabelMap::default() };
    let more;
    if axes.layers == 1 {
        let voxel = |n| voxels::voxel(axes.size, n);
        map.labels = voxels::room(values.count).map_err(|fault| fault.at(name))?;
        let labels = &mut map.labels;
        more = data.read(values, |_, label| labels.push(label)).map_err(|t| t.fault(values.count, voxel).at(name))?;
        for segment in segments {
            if let Some(other) = map.names.insert(segment.label, segment.name.clone()) {
                notices.push(format!(
                    "Segments `{}` and `{}` have the same label {}; the later name is taken.",
                    shown(&other),
                    shown(&segment.name),
                    segment.label
                ));
            }
        }
    } else {
        let voxel_count = values.count / axes.layers;
        let place = |n: usize| match axes.list_first {
            true => (n % axes.layers, n / axes.layers),
            false => (n / voxel_count, n % voxel_count),
        };
        let voxel = |n| {
            let (layer, n) = place(n);
            format!("{} of layer {layer}", voxels::voxel(axes.size, n))
        };
        let segments = segments.into_iter().map(|s| (s.layer, s.label, s.name));
        let mut layers = Layers::new(voxel_count, segments).map_err(|fault| fault.at(name))?;
        let take = |n, label| {
            let (layer, n) = place(n);
            layers.put(n, layer, label);
        };
        more = data.read(values, take).map_err(|trouble| trouble.fault(values.count, voxel).at(name))?;
        (map.labels, map.names) = layers.finish(&mut notices).map_err(|fault| fault.at(name))?;
    }
    if more {
        if data.packing != Packing::Plain {
            let message = format!("{name}: there are more values than the {} of `sizes`", values.count);
            return Err(Error::input(message, WRITE_AGAIN));
        }
        notices.push(format!("There is more data than the {} values of `sizes`; the rest is not read.", values.count));
    }
    Ok(Labelled { map, notices })
}

/// Every field of the format, without spaces, whether it matters here or not.
const KNOWN: &[&str] = &[
    "dimension",
    "type",
    "blocksize",
    "encoding",
    "endian",
    "content",
    "min",
    "max",
    "oldmin",
    "oldmax",
    "datafile",
    "lineskip",
    "byteskip",
    "number",
    "sampleunits",
    "space",
    "spacedimension",
    "spaceunits",
    "spaceorigin",
    "spacedirections",
    "measurementframe",
    "sizes",
    "spacings",
    "thicknesses",
    "axismins",
    "axismaxs",
    "centers",
    "centerings",
    "labels",
    "units",
    "kinds",
];

/// A line of the header.
struct Field {
    line: usize,
    /// As written.
    key: String,
    value: String,
}

struct Header<'a> {
    name: &'a str,
    /// By their name in small letters without spaces: several have both forms.
    fields: HashMap<String, Field>,
    /// Keys of the user, in their order.
    pairs: Vec<Field>,
    /// Where the data begins; none where no empty line ends the header.
    data_at: Option<usize>,
}

impl<'a> Header<'a> {
    fn of(name: &'a str, bytes: &[u8]) -> Result<Self> {
        let mut header = Header { name, fields: HashMap::new(), pairs: Vec::new(), data_at: None };
        let (mut at, mut number) = (0, 0);
        while at < bytes.len() {
            let rest = &bytes[at..];
            let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
            let line = rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]);
            at = (at + length + 1).min(bytes.len());
            number += 1;
            if number == 1 {
                if !(matches!(line, b"NRRD00.01")
                    || line.len() == 8 && matches!(&line[4..], [b'0', b'0', b'0', b'1'..=b'5']))
                {
                    let message =
                        format!("{name}:1: `{}` is no NRRD that is read here", shown(&String::from_utf8_lossy(line)));
                    return Err(Error::input(message, "save the file as NRRD0001 to NRRD0005, e.g. with 3D Slicer"));
                }
                continue;
            }
            if line.is_empty() {
                header.data_at = Some(at);
                break;
            }
            if line.starts_with(b"#") {
                continue;
            }
            header.add(number, &String::from_utf8_lossy(line))?;
        }
        Ok(header)
    }

    fn add(&mut self, line: usize, text: &str) -> Result<()> {
        let place = format!("{}:{line}", self.name);
        let Some((key, value)) = text.split_once(':') else {
            return Err(Fault::new(format!("`{}` is no line of a header", shown(text)), WRITE_AGAIN).at(place));
        };
        if let Some(value) = value.strip_prefix('=') {
            let value = value.replace("\\n", "\n").replace("\\\\", "\\");
            self.pairs.push(Field { line, key: key.trim().into(), value });
            return Ok(());
        }
        let plain = key.to_lowercase().replace([' ', '\t'], "");
        let field = Field { line, key: key.trim().into(), value: value.trim().into() };
        match self.fields.insert(plain, field) {
            None => Ok(()),
            Some(first) => {
                let message =
                    format!("`{}` stands here for the second time, first on line {}", shown(&first.key), first.line);
                Err(Fault::new(message, MEND_HEADER).at(place))
            }
        }
    }

    fn field(&self, plain: &str) -> Option<&Field> {
        self.fields.get(plain)
    }

    fn needed(&self, plain: &str) -> Result<&Field> {
        let missing = || Error::input(format!("{}: the header has no `{plain}`", self.name), MEND_HEADER);
        self.field(plain).ok_or_else(missing)
    }

    /// A field that is misspelt would be missed without a word.
    fn tell_unknown(&self, notices: &mut Vec<String>) {
        let unknown = self.fields.iter().filter(|(plain, _)| !KNOWN.contains(&plain.as_str()));
        if let Some((_, field)) = unknown.min_by_key(|(_, field)| field.line) {
            notices.push(format!(
                "Line {}: the field `{}` is not known, and not heeded.",
                field.line,
                shown(&field.key)
            ));
        }
    }

    fn place(&self, field: &Field) -> String {
        format!("{}:{}: {}", self.name, field.line, shown(&field.key))
    }

    fn fail(&self, field: &Field, message: impl Into<String>, way_out: &'static str) -> Error {
        Fault::new(message, way_out).at(self.place(field))
    }

    /// The numbers of a field, at most `most` of them.
    fn numbers<T: std::str::FromStr>(&self, field: &Field, most: usize) -> Result<Vec<T>> {
        let words = field.value.split_whitespace().take(most + 1);
        let numbers = words.map(|word| {
            let wrong =
                || self.fail(field, format!("`{}` is not a number that can stand here", shown(word)), MEND_HEADER);
            word.parse().map_err(|_| wrong())
        });
        numbers.collect()
    }

    /// The one word of a field in small letters.
    fn word(&self, plain: &str) -> Option<(&Field, String)> {
        self.field(plain).map(|field| (field, field.value.to_lowercase()))
    }
}

/// The three axes of space, and that of layers where there is one.
struct Axes {
    dimension: usize,
    size: [usize; 3],
    layers: usize,
    /// Whether the layers of a voxel stand together.
    list_first: bool,
}

impl Axes {
    fn of(header: &Header) -> Result<Axes> {
        let field = header.needed("dimension")?;
        let dimension = match field.value.as_str() {
            "3" => 3,
            "4" => 4,
            other => {
                let message = format!("`{}` axes are not read here", shown(other));
                return Err(header.fail(
                    field,
                    message,
                    "save one volume of three axes, or a segmentation of 3D Slicer",
                ));
            }
        };
        let field = header.needed("sizes")?;
        let sizes: Vec<u64> = header.numbers(field, dimension)?;
        if sizes.len() != dimension {
            return Err(header.fail(field, format!("{dimension} numbers must stand here"), MEND_HEADER));
        }
        let has_list = dimension == 4;
        let list_first = has_list && list_is_first(header, &sizes)?;
        let (layers, space) = match (has_list, list_first) {
            (false, _) => (1, &sizes[..]),
            (true, true) => (sizes[0], &sizes[1..]),
            (true, false) => (sizes[3], &sizes[..3]),
        };
        let (size, count) =
            voxels::volume([space[0], space[1], space[2]]).map_err(|fault| fault.at(header.place(field)))?;
        if let (Some(field), 2..) = (header.field("kinds"), layers) {
            // Colours and vectors stand on an axis of their own, too.
            let list = if list_first { 0 } else { dimension - 1 };
            let kind = field.value.split_whitespace().nth(list).unwrap_or("list");
            if !["list", "none", "???", "scalar", "stub"].iter().any(|known| known.eq_ignore_ascii_case(kind)) {
                let message = format!("an axis of the kind `{}` holds no labels", shown(kind));
                return Err(header.fail(field, message, SEGMENT));
            }
        }
        let most = 10 * MOST_VOXELS as u64 / count as u64;
        let layers = usize::try_from(layers).ok().filter(|n| (1..=most).contains(&(*n as u64)));
        match layers {
            Some(layers) => Ok(Axes { dimension, size, layers, list_first }),
            None => Err(header.fail(field, "so many layers cannot be read", SMALLER)),
        }
    }

    /// Number of the first axis of space.
    fn first(&self) -> usize {
        usize::from(self.list_first)
    }
}

/// Which of four axes is that of layers.
fn list_is_first(header: &Header, sizes: &[u64]) -> Result<bool> {
    let ends = |first: bool, last: bool, field: &Field| match (first, last) {
        (true, false) => Ok(true),
        (false, true) => Ok(false),
        _ => {
            let message =
                "exactly one of four axes, the first or the last, may have no direction in space: that of layers";
            Err(header.fail(field, message, "save a segmentation with 3D Slicer, or one volume of three axes"))
        }
    };
    if let Some(field) = header.field("spacedirections") {
        let vectors = vectors(header, field, 4)?;
        let none: Vec<bool> = vectors.iter().map(Option::is_none).collect();
        if none.len() != 4 || none[1] || none[2] {
            return Err(header.fail(
                field,
                "four entries must stand here, the first or the last of them `none`",
                MEND_HEADER,
            ));
        }
        return ends(none[0], none[3], field);
    }
    if let Some(field) = header.field("spacings") {
        let spacings: Vec<f64> = header.numbers(field, 4)?;
        if spacings.len() == 4 && (spacings[0].is_nan() != spacings[3].is_nan()) {
            return Ok(spacings[0].is_nan());
        }
    }
    if let Some(field) = header.field("kinds") {
        let is_list: Vec<bool> = field.value.split_whitespace().map(|kind| kind.eq_ignore_ascii_case("list")).collect();
        if is_list.len() == 4 && (is_list[0] || is_list[3]) {
            return ends(is_list[0], is_list[3], field);
        }
    }
    let field = header.needed("sizes")?;
    ends(sizes[0] == 1 && sizes[3] != 1, sizes[3] == 1, field)
}

/// Vectors in brackets, or `none`.
fn vectors(header: &Header, field: &Field, most: usize) -> Result<Vec<Option<DVec3>>> {
    let wrong = |what: &str| {
        header.fail(field, format!("`{}` is not `none` or a vector such as (1,0,0)", shown(what)), MEND_HEADER)
    };
    let (mut rest, mut found) = (field.value.trim_start(), Vec::new());
    while !rest.is_empty() && found.len() <= most {
        let tail = if let Some(tail) = rest.strip_prefix("none") {
            found.push(None);
            tail
        } else {
            let (inside, tail) = rest.strip_prefix('(').and_then(|r| r.split_once(')')).ok_or_else(|| wrong(rest))?;
            let numbers: Vec<f64> = inside.split(',').take(4).map_while(|word| word.trim().parse().ok()).collect();
            match (numbers.as_slice(), inside.split(',').count()) {
                ([x, y, z], 3) => found.push(Some(DVec3::new(*x, *y, *z))),
                _ => return Err(wrong(rest)),
            }
            tail
        };
        rest = tail.trim_start();
    }
    Ok(found)
}

/// Units as they stand in quotes, or without.
fn units(header: &Header, field: &Field, notices: &mut Vec<String>) -> Result<Vec<f64>> {
    let words: Vec<&str> = match field.value.contains('"') {
        true => field.value.split('"').skip(1).step_by(2).take(5).collect(),
        false => field.value.split_whitespace().take(5).collect(),
    };
    let mut found = Vec::new();
    for word in words {
        let known = voxels::per_metre(word);
        // An axis of layers has any unit.
        found.push(known.unwrap_or(f64::NAN));
        if known.is_some_and(|unit| unit != 1e3) {
            let sentence = format!("Lengths are taken in {} as `{}` says.", shown(word), field.key);
            if !notices.contains(&sentence) {
                notices.push(sentence);
            }
        }
    }
    match found.len() {
        3 | 4 => Ok(found),
        _ => Err(header.fail(field, "a unit for every axis must stand here", MEND_HEADER)),
    }
}

const KNOWN_UNITS: &str = "write \"mm\", \"cm\", \"m\" or \"um\" there, whichever is right";

/// Steps as columns and origin, RAS [m].
fn geometry(header: &Header, axes: &Axes, notices: &mut Vec<String>) -> Result<(DMat3, DVec3)> {
    let signs = space(header, notices)?;
    let mut per_metre = DVec3::splat(1e3);
    let unknown = |field| header.fail(field, "a unit of length is not known here", KNOWN_UNITS);
    if let Some(field) = header.field("spaceunits") {
        per_metre = DVec3::from_slice(&units(header, field, notices)?);
        if per_metre.is_nan() {
            return Err(unknown(field));
        }
    }
    let (field, steps) = if let Some(field) = header.field("spacedirections") {
        let all = vectors(header, field, 4)?;
        let found: Vec<DVec3> = all.iter().skip(axes.first()).take(3).copied().flatten().collect();
        let [i, j, k] = found[..] else {
            return Err(header.fail(field, "a vector for each of three axes must stand here", MEND_HEADER));
        };
        if all.len() != axes.dimension {
            return Err(header.fail(field, format!("{} entries must stand here", axes.dimension), MEND_HEADER));
        }
        (field, [i, j, k].map(|step| signs * step / per_metre))
    } else if let Some(field) = header.field("spacings") {
        let spacings: Vec<f64> = header.numbers(field, axes.dimension)?;
        if spacings.len() != axes.dimension {
            return Err(header.fail(field, format!("{} numbers must stand here", axes.dimension), MEND_HEADER));
        }
        let mut along = per_metre;
        if let Some(units_field) = header.field("units") {
            let units = units(header, units_field, notices)?;
            if units.len() != axes.dimension {
                return Err(header.fail(units_field, "a unit for every axis must stand here", MEND_HEADER));
            }
            along = DVec3::from_slice(&units[axes.first()..]);
            if along.is_nan() {
                return Err(unknown(units_field));
            }
        }
        let spacing = DVec3::from_slice(&spacings[axes.first()..]) / along;
        // A negative one would mirror the patient without a word.
        if spacing.min_element() <= 0.0 {
            return Err(header.fail(field, "every spacing must be above 0", MEND_HEADER));
        }
        notices.push("The file gives no directions of its axes; they are taken along those of its space.".into());
        (field, [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * spacing * signs))
    } else {
        let message = format!("{}: neither `space directions` nor `spacings` say how large voxels are", header.name);
        return Err(Error::input(message, MEND_HEADER));
    };
    let steps = DMat3::from_cols(steps[0], steps[1], steps[2]);
    let mut origin = (field, DVec3::ZERO);
    match header.field("spaceorigin") {
        None => notices
            .push("The file gives no `space origin`; the centre of its first voxel is taken as the origin.".into()),
        Some(field) => match vectors(header, field, 1)?[..] {
            [Some(at)] => origin = (field, signs * at / per_metre),
            _ => return Err(header.fail(field, "one vector must stand here", MEND_HEADER)),
        },
    }
    match voxels::check_grid(&steps, origin.1) {
        Ok(()) => Ok((steps, origin.1)),
        Err((Part::Steps, fault)) => Err(fault.at(header.place(field))),
        Err((Part::Origin, fault)) => Err(fault.at(header.place(origin.0))),
    }
}

const PATIENT: &str = "save the volume in the space LPS or RAS of a patient, e.g. with 3D Slicer";

fn check_space(header: &Header) -> Result<()> {
    match header.field("spacedimension") {
        Some(field) if field.value != "3" => {
            Err(header.fail(field, format!("a space of `{}` axes is not read here", shown(&field.value)), PATIENT))
        }
        _ => Ok(()),
    }
}

/// Signs of the axes of the file's space in RAS.
fn space(header: &Header, notices: &mut Vec<String>) -> Result<DVec3> {
    const LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);
    let way_out = PATIENT;
    let Some((field, word)) = header.word("space") else {
        notices.push(
            "The file names no space of a patient; its axes are taken as left, posterior, superior (LPS), as ITK does."
                .into(),
        );
        return Ok(LPS);
    };
    Ok(match word.as_str() {
        "ras" | "right-anterior-superior" => DVec3::ONE,
        "las" | "left-anterior-superior" => DVec3::new(-1.0, 1.0, 1.0),
        "lps" | "left-posterior-superior" => LPS,
        "rast" | "last" | "lpst" => return Err(header.fail(field, "a space with time is not read here", way_out)),
        other if other.ends_with("-time") => {
            return Err(header.fail(field, "a space with time is not read here", way_out));
        }
        other => {
            return Err(header.fail(field, format!("the space `{}` is not that of a patient", shown(other)), way_out));
        }
    })
}

/// A segment of 3D Slicer.
struct Segment {
    layer: usize,
    label: u16,
    name: String,
}

/// The segments by their numbers.
fn segments(header: &Header, layers: usize) -> Result<Vec<Segment>> {
    #[derive(Default)]
    struct Written<'a> {
        name: Option<&'a Field>,
        label: Option<&'a Field>,
        layer: Option<&'a Field>,
    }
    let mut written: BTreeMap<u32, Written> = BTreeMap::new();
    for field in &header.pairs {
        let parts = field.key.strip_prefix("Segment").and_then(|rest| rest.split_once('_'));
        let Some((Ok(number), key)) = parts.map(|(number, key)| (number.parse::<u32>(), key)) else { continue };
        match key {
            "Name" => written.entry(number).or_default().name = Some(field),
            "LabelValue" => written.entry(number).or_default().label = Some(field),
            "Layer" => written.entry(number).or_default().layer = Some(field),
            _ => {}
        }
    }
    let alone = written.len() == 1;
    let mut found = Vec::new();
    for (order, (number, written)) in written.into_iter().enumerate() {
        // Older versions wrote every segment as a layer of zeros and ones.
        let old = if layers > 1 || alone { Some(1) } else { None };
        let label = match written.label {
            None => old,
            Some(field) => match field.value.trim().parse() {
                Ok(label) if label > 0 => Some(label),
                _ => return Err(header.fail(field, "a label from 1 to 65535 must stand here", MEND_HEADER)),
            },
        };
        let layer = match written.layer {
            None if layers > 1 => order,
            None => 0,
            Some(field) => match field.value.trim().parse() {
                Ok(layer) if layer < layers => layer,
                _ => {
                    return Err(header.fail(
                        field,
                        format!("a layer from 0 to {} must stand here", layers - 1),
                        MEND_HEADER,
                    ));
                }
            },
        };
        let name = written.name.map(|field| field.value.trim().to_string()).filter(|name| !name.is_empty());
        if let (Some(label), true) = (label, name.is_some() || layers > 1) {
            found.push(Segment { layer, label, name: name.unwrap_or_else(|| format!("Segment {number}")) });
        }
    }
    Ok(found)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Packed(Packing),
    Text,
    Hex,
}

impl Encoding {
    fn of(header: &Header) -> Result<Encoding> {
        let field = header.needed("encoding")?;
        Ok(match field.value.to_lowercase().as_str() {
            "raw" => Encoding::Packed(Packing::Plain),
            "gzip" | "gz" => Encoding::Packed(Packing::Gzip),
            "bzip2" | "bz2" => Encoding::Packed(Packing::Bzip2),
            "ascii" | "text" | "txt" => Encoding::Text,
            "hex" => Encoding::Hex,
            other => {
                let message = format!("the encoding `{}` is not known here", shown(other));
                return Err(header.fail(
                    field,
                    message,
                    "save the file with the encoding gzip or raw, e.g. with 3D Slicer",
                ));
            }
        })
    }
}

/// How the values are stored.
fn values(header: &Header, axes: &Axes, encoding: Encoding) -> Result<Values> {
    let field = header.needed("type")?;
    let kind = match field.value.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => Kind::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Kind::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
        "int" | "signed int" | "int32" | "int32_t" => Kind::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Kind::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Kind::U64,
        "float" => Kind::F32,
        "double" => Kind::F64,
        other => {
            let message = format!("values of the type `{}` are not read here", shown(other));
            return Err(header.fail(field, message, "save the labels as unsigned char or unsigned short"));
        }
    };
    let big_endian = match header.word("endian") {
        Some((_, word)) if word == "little" => false,
        Some((_, word)) if word == "big" => true,
        Some((field, _)) => return Err(header.fail(field, "`little` or `big` must stand here", MEND_HEADER)),
        None if kind.bytes() == 1 || encoding == Encoding::Text => false,
        None => {
            let message = format!("{}: the header has no `endian`, which values of several bytes need", header.name);
            return Err(Error::input(message, MEND_HEADER));
        }
    };
    let [i, j, k] = axes.size;
    Ok(Values { kind, big_endian, count: i * j * k * axes.layers, scale: None })
}

/// The data without what is to be skipped, of which it is known that it can hold the values.
struct Data<'a> {
    bytes: &'a [u8],
    encoding: Encoding,
    packing: Packing,
    /// Bytes to skip once it is unpacked.
    skip: u64,
}

/// Skips lines and bytes before the values.
fn skipped<'a>(header: &Header, mut bytes: &'a [u8], encoding: Encoding, values: Values) -> Result<Data<'a>> {
    let packing = if let Encoding::Packed(packing) = encoding { packing } else { Packing::Plain };
    if let Some(field) = header.field("lineskip") {
        let wrong = |_| header.fail(field, "a whole number from 0 must stand here", MEND_HEADER);
        for _ in 0..field.value.parse::<u64>().map_err(wrong)? {
            let end = bytes
                .iter()
                .position(|b| *b == b'\n')
                .ok_or_else(|| header.fail(field, "the data has fewer lines than are to be skipped", WRITE_AGAIN))?;
            bytes = &bytes[end + 1..];
        }
    }
    let mut skip = 0;
    if let Some(field) = header.field("byteskip") {
        match (field.value.parse::<i64>(), encoding) {
            (Ok(-1), Encoding::Packed(Packing::Plain)) => {
                let needed = usize::try_from(values.bytes()).unwrap_or(usize::MAX);
                bytes = &bytes[bytes.len().saturating_sub(needed)..];
            }
            (Ok(count @ 0..), _) => skip = count as u64,
            (Ok(-1), _) => {
                let way_out = "write the number of bytes there, or save the file with the encoding raw";
                return Err(header.fail(field, "-1 is for the encoding raw alone", way_out));
            }
            _ => return Err(header.fail(field, "a whole number from 0, or -1, must stand here", MEND_HEADER)),
        }
        if packing == Packing::Plain {
            let start = usize::try_from(skip).ok().filter(|n| *n <= bytes.len());
            let short = || header.fail(field, "the data has fewer bytes than are to be skipped", WRITE_AGAIN);
            bytes = &bytes[start.ok_or_else(short)?..];
            skip = 0;
        }
    }
    let count = values.count as u64;
    let needed = match encoding {
        Encoding::Packed(_) => values.bytes().saturating_add(skip),
        // A digit and a space each.
        Encoding::Text => (2 * count).saturating_sub(1),
        Encoding::Hex => values.bytes().saturating_mul(2),
    };
    let sizes = header.needed("sizes")?;
    packing.can_hold(bytes, needed).map_err(|fault| fault.at(header.place(sizes)))?;
    Ok(Data { bytes, encoding, packing, skip })
}

impl Data<'_> {
    /// Gives every value to `take`; true where there is more.
    fn read(&self, values: Values, take: impl FnMut(usize, u16)) -> std::result::Result<bool, voxels::Trouble> {
        let mut source: Box<dyn Read> = match self.encoding {
            Encoding::Text => return values.read_text(self.bytes, take),
            Encoding::Hex => Box::new(Hex(self.bytes)),
            Encoding::Packed(packing) => packing.open(self.bytes),
        };
        std::io::copy(&mut source.by_ref().take(self.skip), &mut std::io::sink())
            .map_err(|error| voxels::Trouble::Damaged(error.to_string()))?;
        values.read(&mut source, take)
    }
}
