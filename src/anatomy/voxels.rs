//! What the readers of volumes share: sizes and grids that can be, and values on their way to labels.

use std::fmt::{Debug, Display};
use std::io::{ErrorKind, Read};
use std::path::{Component, Path};

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use glam::{DMat3, DVec3};

use super::label_map::MOST_VOXELS;
use crate::{Error, Result};

/// Way out of a file that breaks its own format.
pub(super) const WRITE_AGAIN: &str =
    "write the file again with the program that made it; it was cut short, damaged or edited by hand";
/// Way out of a volume with too many voxels.
pub(super) const SMALLER: &str = "crop or resample it, e.g. in 3D Slicer (module Crop Volume), and save it again";
/// Way out of values that are no labels.
pub(super) const SEGMENT: &str = "this looks like an image, not a label map: make a segmentation of it, e.g. in 3D Slicer (module \
     Segment Editor), and export that as a label map with whole numbers from 0 to 65535";
/// Way out of a file that refers to other places.
pub(super) const SAME_FOLDER: &str =
    "put the data file into the folder of its header and name it there without a folder, or save both as one file";

/// A file beside the one that is read, by its name; none where there is none.
pub(super) type Beside<'a> = &'a dyn Fn(&str) -> Result<Option<Vec<u8>>>;

/// What is wrong, without its place.
#[derive(Debug)]
pub(super) struct Fault {
    pub what: String,
    pub way_out: &'static str,
}

impl Fault {
    pub fn new(what: impl Into<String>, way_out: &'static str) -> Self {
        Fault { what: what.into(), way_out }
    }

    /// The wrong input at a place.
    pub fn at(self, place: impl Display) -> Error {
        Error::input(format!("{place}: {}", self.what), self.way_out)
    }
}

/// The size of a volume that can be held, and its number of voxels.
pub(super) fn volume(size: [u64; 3]) -> std::result::Result<([usize; 3], usize), Fault> {
    let [i, j, k] = size;
    if i == 0 || j == 0 || k == 0 {
        return Err(Fault::new(format!("{i} x {j} x {k} voxels are none"), WRITE_AGAIN));
    }
    let count = i.checked_mul(j).and_then(|n| n.checked_mul(k)).filter(|n| *n <= MOST_VOXELS as u64);
    match count {
        // None of them is larger than their product.
        Some(count) => Ok((size.map(|n| n as usize), count as usize)),
        None => Err(Fault::new(
            format!("{i} x {j} x {k} voxels are more than the {MOST_VOXELS} that are read here"),
            SMALLER,
        )),
    }
}

/// Which part of a grid is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Steps,
    Origin,
}

/// Refuses a grid that no volume of a patient has: steps as columns and origin [m].
pub(super) fn check_grid(steps: &DMat3, origin: DVec3) -> std::result::Result<(), (Part, Fault)> {
    const LENGTHS: &str =
        "correct the header, or write the file again; lengths are taken in mm where the file states no unit";
    let mut size = 1.0;
    for (n, step) in [steps.x_axis, steps.y_axis, steps.z_axis].into_iter().enumerate() {
        let axis = ['i', 'j', 'k'][n];
        let length = step.length();
        if !length.is_finite() {
            return Err((Part::Steps, Fault::new(format!("the step along {axis} is not finite"), LENGTHS)));
        }
        if !(0.999_999e-6..=100.000_1e-3).contains(&length) {
            let what = format!("voxels are {} mm apart along {axis}; 0.001 mm to 100 mm are read here", length * 1e3);
            return Err((Part::Steps, Fault::new(what, LENGTHS)));
        }
        size *= length;
    }
    // The tilt of a scanner leaves more than a half.
    if steps.determinant().abs() < 1e-3 * size {
        let what = "the directions of i, j, k lie in one plane, so that voxels have no volume";
        return Err((Part::Steps, Fault::new(what, LENGTHS)));
    }
    if !is_near(origin) {
        return Err((Part::Origin, Fault::new("the origin is not within 1 km of the patient", LENGTHS)));
    }
    Ok(())
}

/// Whether a place is within 1 km of the origin; what is no number is not.
pub(super) fn is_near(place: DVec3) -> bool {
    place.to_array().iter().all(|x| x.abs() <= 1e3)
}

/// A unit of length: how many of it are a metre.
pub(super) fn per_metre(word: &str) -> Option<f64> {
    Some(match word.trim().to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 1e2,
        "" | "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1e3,
        "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre"
        | "micrometres" => 1e6,
        _ => return None,
    })
}

/// The name of a data file that stands beside its header.
pub(super) fn same_folder(name: &str) -> std::result::Result<&str, Fault> {
    let plain = name.strip_prefix("./").unwrap_or(name);
    let mut parts = Path::new(plain).components();
    // A backslash or a colon leads elsewhere on some systems.
    match (parts.next(), parts.next()) {
        (Some(Component::Normal(part)), None) if part == plain && !plain.contains(['\\', ':', '\0']) => Ok(plain),
        _ => {
            Err(Fault::new(format!("the data file `{}` is not in the folder of the header", shown(name)), SAME_FOLDER))
        }
    }
}

/// The bytes of the data file of a header.
pub(super) fn data_file(name: &str, beside: Beside, place: impl Display) -> Result<Vec<u8>> {
    let plain = same_folder(name).map_err(|fault| fault.at(&place))?;
    beside(plain)?
        .ok_or_else(|| Fault::new(format!("the data file `{}` is not there", shown(plain)), SAME_FOLDER).at(&place))
}

/// A piece of a file that can stand in a message.
pub(super) fn shown(text: &str) -> String {
    const LONGEST: usize = 40;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.into(),
    }
}

/// How values are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Packing {
    Plain,
    Gzip,
    Zlib,
    Bzip2,
}

impl Packing {
    /// Most bytes that one packed byte becomes. Deflate has this bound by its nature; bzip2 reaches a million, but a segmentation
    /// with anything in it stays far below this.
    fn most_per_byte(self) -> u64 {
        match self {
            Packing::Plain => 1,
            Packing::Gzip | Packing::Zlib => 1032,
            Packing::Bzip2 => 1 << 16,
        }
    }

    /// Refuses a promise of `needed` bytes that `bytes` cannot keep.
    pub fn can_hold(self, bytes: &[u8], needed: u64) -> std::result::Result<(), Fault> {
        let found = bytes.len() as u64;
        if needed <= found.saturating_mul(self.most_per_byte()) {
            return Ok(());
        }
        let packed = if self == Packing::Plain { "" } else { " compressed" };
        Err(Fault::new(
            format!("{needed} bytes of values should stand here, but there are {found}{packed} bytes"),
            WRITE_AGAIN,
        ))
    }

    /// The bytes unpacked, piece by piece.
    pub fn open<'a>(self, bytes: &'a [u8]) -> Box<dyn Read + 'a> {
        match self {
            Packing::Plain => Box::new(bytes),
            Packing::Gzip => Box::new(MultiGzDecoder::new(bytes)),
            Packing::Zlib => Box::new(ZlibDecoder::new(bytes)),
            Packing::Bzip2 => Box::new(MultiBzDecoder::new(bytes)),
        }
    }
}

/// Bytes written as two hexadecimal digits each, with any space between.
pub(super) struct Hex<'a>(pub &'a [u8]);

impl Read for Hex<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut digit = || -> std::io::Result<Option<u8>> {
            while let Some((first, rest)) = self.0.split_first() {
                self.0 = rest;
                if !first.is_ascii_whitespace() {
                    let digit = char::from(*first).to_digit(16).map(|d| d as u8);
                    let wrong =
                        || std::io::Error::new(ErrorKind::InvalidData, "a character that is no hexadecimal digit");
                    return digit.map(Some).ok_or_else(wrong);
                }
            }
            Ok(None)
        };
        for (n, slot) in buffer.iter_mut().enumerate() {
            match (digit()?, digit()?) {
                (Some(high), Some(low)) => *slot = 16 * high + low,
                _ => return Ok(n),
            }
        }
        Ok(buffer.len())
    }
}

/// How a value is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            Kind::I8 | Kind::U8 => 1,
            Kind::I16 | Kind::U16 => 2,
            Kind::I32 | Kind::U32 | Kind::F32 => 4,
            Kind::I64 | Kind::U64 | Kind::F64 => 8,
        }
    }
}

/// Why values are no labels.
#[derive(Debug)]
pub(super) enum Trouble {
    /// The value at this number is none.
    Value(usize, String),
    /// So many values stand there.
    Short(usize),
    Damaged(String),
}

impl Trouble {
    /// What is wrong with a volume; `voxel` names the place of a value.
    pub fn fault(self, count: usize, voxel: impl Fn(usize) -> String) -> Fault {
        match self {
            Trouble::Value(n, value) => {
                Fault::new(format!("{} has the value {value}, which is no label (0 to 65535)", voxel(n)), SEGMENT)
            }
            Trouble::Short(found) => Fault::new(format!("the data ends after {found} of {count} values"), WRITE_AGAIN),
            Trouble::Damaged(reason) => Fault::new(format!("the data cannot be unpacked: {reason}"), WRITE_AGAIN),
        }
    }
}

/// Names voxel `n` of a volume of this size.
pub(super) fn voxel(size: [usize; 3], n: usize) -> String {
    let [i, j, _] = size;
    format!("voxel ({}, {}, {})", n % i, n / i % j, n / i / j)
}

/// Values in bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values {
    pub kind: Kind,
    pub big_endian: bool,
    pub count: usize,
    /// Factor and summand that make a label of what is stored.
    pub scale: Option<(f64, f64)>,
}

impl Values {
    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        self.count as u64 * self.kind.bytes() as u64
    }

    /// Gives every value with its number to `take`, as a label; true where there are more bytes than values.
    pub fn read(&self, source: &mut dyn Read, mut take: impl FnMut(usize, u16)) -> std::result::Result<bool, Trouble> {
        let mut buffer = vec![0_u8; 1 << 16];
        let mut at = 0;
        while at < self.count {
            let wanted = (buffer.len() / self.kind.bytes()).min(self.count - at) * self.kind.bytes();
            let found = fill(source, &mut buffer[..wanted])?;
            let whole = &buffer[..found];
            match self.kind {
                Kind::I8 => self.pass(at, whole, |[b]: [u8; 1]| i64::from(b as i8), exact, &mut take),
                Kind::U8 => self.pass(at, whole, |[b]: [u8; 1]| b, |v| Some(u16::from(v)), &mut take),
                Kind::I16 => self.pass(at, whole, i16::from_le_bytes, exact, &mut take),
                Kind::U16 => self.pass(at, whole, u16::from_le_bytes, Some, &mut take),
                Kind::I32 => self.pass(at, whole, i32::from_le_bytes, exact, &mut take),
                Kind::U32 => self.pass(at, whole, u32::from_le_bytes, exact, &mut take),
                Kind::I64 => self.pass(at, whole, i64::from_le_bytes, exact, &mut take),
                Kind::U64 => self.pass(at, whole, u64::from_le_bytes, exact, &mut take),
                Kind::F32 => self.pass(at, whole, |b| f64::from(f32::from_le_bytes(b)), whole_number, &mut take),
                Kind::F64 => self.pass(at, whole, f64::from_le_bytes, whole_number, &mut take),
            }?;
            at += found / self.kind.bytes();
            if found < wanted {
                return Err(Trouble::Short(at));
            }
        }
        // A stream that ends before its checksum was cut short, even where all values are there.
        loop {
            match source.read(&mut buffer[..1]) {
                Ok(found) => return Ok(found > 0),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(Trouble::Damaged(error.to_string())),
            }
        }
    }

    fn pass<const N: usize, T: Copy + Debug + Number>(
        &self,
        at: usize,
        bytes: &[u8],
        value: impl Fn([u8; N]) -> T,
        label: impl Fn(T) -> Option<u16>,
        take: &mut impl FnMut(usize, u16),
    ) -> std::result::Result<(), Trouble> {
        for (n, bytes) in (at..).zip(bytes.as_chunks::<N>().0) {
            let mut bytes = *bytes;
            if self.big_endian {
                bytes.reverse();
            }
            let stored = value(bytes);
            match self.scale {
                None => take(n, label(stored).ok_or_else(|| Trouble::Value(n, format!("{stored:?}")))?),
                Some((slope, summand)) => {
                    let scaled = slope * stored.float() + summand;
                    // A factor has the digits of a 32-bit number.
                    let near = scaled.round();
                    let found = if (scaled - near).abs() < 1e-3 { whole_number(near) } else { None };
                    take(n, found.ok_or_else(|| Trouble::Value(n, format!("{scaled:?}")))?);
                }
            }
        }
        Ok(())
    }

    /// The same from numbers in text, with space or commas between.
    pub fn read_text(&self, text: &[u8], mut take: impl FnMut(usize, u16)) -> std::result::Result<bool, Trouble> {
        let mut words = text.split(|b| b.is_ascii_whitespace() || *b == b',').filter(|word| !word.is_empty());
        for n in 0..self.count {
            let word = words.next().ok_or(Trouble::Short(n))?;
            let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            let label = number.and_then(whole_number);
            let excerpt = || format!("`{}`", shown(&String::from_utf8_lossy(&word[..word.len().min(200)])));
            take(n, label.ok_or_else(|| Trouble::Value(n, excerpt()))?);
        }
        Ok(words.next().is_some())
    }
}

/// Reads until the buffer is full or the source ends.
fn fill(source: &mut dyn Read, buffer: &mut [u8]) -> std::result::Result<usize, Trouble> {
    let mut filled = 0;
    while filled < buffer.len() {
        match source.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => break,
            Err(error) => return Err(Trouble::Damaged(error.to_string())),
        }
    }
    Ok(filled)
}

fn exact<T: TryInto<u16>>(value: T) -> Option<u16> {
    value.try_into().ok()
}

fn whole_number(value: f64) -> Option<u16> {
    (value.fract() == 0.0 && (0.0..=65535.0).contains(&value)).then_some(value as u16)
}

/// A number as a float, rounded where it must be.
trait Number {
    fn float(self) -> f64;
}

macro_rules! numbers {
    ($($kind:ty)*) => { $(impl Number for $kind { fn float(self) -> f64 { self as f64 } })* };
}
numbers!(u8 i16 u16 i32 u32 i64 u64 f64);

/// Room for so many labels, once it is known that there are so many.
pub(super) fn room(count: usize) -> std::result::Result<Vec<u16>, Fault> {
    let mut labels = Vec::new();
    match labels.try_reserve_exact(count) {
        Ok(()) => Ok(labels),
        Err(_) => Err(Fault::new(format!("there is no memory for {count} voxels"), SMALLER)),
    }
}
