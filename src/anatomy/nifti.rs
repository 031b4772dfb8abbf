//! NIfTI volumes (`.nii`, `.nii.gz`, pairs of `.hdr` and `.img`), versions 1 and 2.
//!
//! Source: `nifti1.h` and `nifti2.h` of the NIfTI Data Format Working Group (<https://nifti.nimh.nih.gov>), whose axes are RAS. The header
//! is read here and not by the crate `nifti`, because that one reserves memory for all that a header promises before it looks at the
//! data, and holds every value beside the labels.

use std::collections::BTreeMap;
use std::io::Read;

use glam::{DMat3, DQuat, DVec3};

use super::Labelled;
use super::label_map::LabelMap;
use super::nifti_names;
use super::voxels::{self, Beside, Fault, Kind, Packing, Part, SEGMENT, Values, WRITE_AGAIN};
use crate::{Error, Result};

/// Bytes of the header of version 1 and of version 2.
const HEADS: [usize; 2] = [348, 540];
/// Way out of a header that does not say where the voxels lie.
const SAVE_AGAIN: &str = "save the volume again with a valid orientation, e.g. with 3D Slicer";
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Whether the bytes begin as a NIfTI file does, compressed or not.
pub(super) fn looks_like(head: &[u8]) -> bool {
    let mut first = Vec::new();
    // What is cut short still gives its beginning.
    let _ = packing(head).open(head).take(4).read_to_end(&mut first);
    first.first_chunk().is_some_and(|size| version(*size).is_some())
}

fn packing(bytes: &[u8]) -> Packing {
    if bytes.starts_with(&GZIP) { Packing::Gzip } else { Packing::Plain }
}

/// Bytes of the header that begins with these, and whether they stand with the high byte first.
fn version(first: [u8; 4]) -> Option<(usize, bool)> {
    HEADS.into_iter().find_map(|size| {
        let size_as = u32::try_from(size).ok()?;
        match first {
            first if first == size_as.to_le_bytes() => Some((size, false)),
            first if first == size_as.to_be_bytes() => Some((size, true)),
            _ => None,
        }
    })
}

/// Reads the bytes of a `.nii`, `.nii.gz` or `.hdr` file.
pub(super) fn read(name: &str, bytes: &[u8], beside: Beside) -> Result<Labelled> {
    let broken = |message: &str| Error::input(format!("{name}: {message}"), WRITE_AGAIN);
    // Lives longer than what reads it.
    let pair;
    let mut source = packing(bytes).open(bytes);
    let mut head = Vec::new();
    let mut more = |head: &mut Vec<u8>, count: usize| {
        let wanted = count - head.len();
        let found = source.by_ref().take(wanted as u64).read_to_end(head);
        match found {
            Ok(found) if found == wanted => Ok(()),
            Ok(_) => Err(broken("the file ends within its header")),
            Err(reason) => Err(broken(&format!("the header cannot be unpacked: {reason}"))),
        }
    };
    more(&mut head, 4)?;
    let (size, big_endian) =
        head.first_chunk().and_then(|first| version(*first)).ok_or_else(|| broken("this is no NIfTI file"))?;
    more(&mut head, size)?;
    let header = Header { name, head, big_endian };
    let mut notices = Vec::new();
    let in_pair = header.is_pair()?;
    let (size, count) = header.size()?;
    let values = header.values(count)?;
    let offset = header.data_offset(in_pair)?;
    let (steps, origin) = header.geometry(size, &mut notices)?;
    let mut at = header.head.len() as u64;
    let mut all = bytes;
    if in_pair {
        pair = image_of(name, beside)?;
        (all, at) = (&pair, 0);
        source = packing(all).open(all);
    }
    let needed = values.bytes().saturating_add(offset);
    packing(all).can_hold(all, needed).map_err(|fault| fault.at(header.place("dim")))?;
    let mut names = BTreeMap::new();
    if !in_pair {
        let mut extensions = Vec::new();
        let length = offset.saturating_sub(at).min(nifti_names::LONGEST);
        source
            .by_ref()
            .take(length)
            .read_to_end(&mut extensions)
            .map_err(|reason| broken(&format!("the data cannot be unpacked: {reason}")))?;
        at += extensions.len() as u64;
        names = nifti_names::of_extensions(&extensions, big_endian, &mut notices);
    }
    std::io::copy(&mut source.by_ref().take(offset.saturating_sub(at)), &mut std::io::sink())
        .map_err(|reason| broken(&format!("the data cannot be unpacked: {reason}")))?;
    let mut labels = voxels::room(count).map_err(|fault| fault.at(name))?;
    let voxel = |n| voxels::voxel(size, n);
    let more = values
        .read(&mut source, |_, label| labels.push(label))
        .map_err(|trouble| trouble.fault(count, voxel).at(name))?;
    if more && packing(all) != Packing::Plain {
        return Err(broken(&format!("there are more values than the {count} of dim")));
    }
    if more {
        notices.push(format!("There is more data than the {count} values of dim; the rest is not read."));
    }
    Ok(Labelled { map: LabelMap { size, steps, origin, labels, names }, notices })
}

/// The bytes of the image file of a pair.
fn image_of(name: &str, beside: Beside) -> Result<Vec<u8>> {
    let file = name.rsplit(['/', std::path::MAIN_SEPARATOR]).next().unwrap_or(name);
    let lower = file.to_ascii_lowercase();
    let stem =
        [".hdr.gz", ".hdr"].into_iter().find(|end| lower.ends_with(end)).map(|end| &file[..file.len() - end.len()]);
    let way_out = "keep both files of the pair in one folder and name the .hdr, or save the volume as one .nii.gz";
    let Some(stem) = stem else {
        return Err(Error::input(
            format!("{name}: the header of a pair must be named .hdr, so that its .img is found"),
            way_out,
        ));
    };
    for end in [".img", ".img.gz", ".IMG"] {
        if let Some(bytes) = beside(&format!("{stem}{end}"))? {
            return Ok(bytes);
        }
    }
    Err(Error::input(format!("{name}: the data file `{stem}.img` of this header is not there"), way_out))
}

struct Header<'a> {
    name: &'a str,
    head: Vec<u8>,
    big_endian: bool,
}

impl Header<'_> {
    fn is_second(&self) -> bool {
        self.head.len() == HEADS[1]
    }

    /// The place of a field in versions 1 and 2.
    fn at(&self, places: [usize; 2]) -> usize {
        places[usize::from(self.is_second())]
    }

    fn take<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = self.head.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    /// Whole number `n` of a field of 16 bits in version 1, of 64 in version 2.
    fn long(&self, places: [usize; 2], n: usize) -> i64 {
        let at = self.at(places);
        match self.is_second() {
            false => i16::from_le_bytes(self.take(at + 2 * n)).into(),
            true => i64::from_le_bytes(self.take(at + 8 * n)),
        }
    }

    /// A code of 16 bits in version 1, of 32 in version 2.
    fn code(&self, places: [usize; 2]) -> i32 {
        let at = self.at(places);
        match self.is_second() {
            false => i16::from_le_bytes(self.take(at)).into(),
            true => i32::from_le_bytes(self.take(at)),
        }
    }

    /// Number `n` of a field of 32 bits in version 1, of 64 in version 2.
    fn real(&self, places: [usize; 2], n: usize) -> f64 {
        let at = self.at(places);
        match self.is_second() {
            false => f32::from_le_bytes(self.take(at + 4 * n)).into(),
            true => f64::from_le_bytes(self.take(at + 8 * n)),
        }
    }

    fn place(&self, field: &str) -> String {
        format!("{}: header field {field}", self.name)
    }

    fn fail(&self, field: &str, message: impl Into<String>, way_out: &'static str) -> Error {
        Fault::new(message, way_out).at(self.place(field))
    }

    /// Whether the data stands in another file.
    fn is_pair(&self) -> Result<bool> {
        let magic = &self.head[self.at([344, 4])..][..4];
        let version = if self.is_second() { b'2' } else { b'1' };
        match magic {
            [b'n', b'+', v, 0] if *v == version => Ok(false),
            [b'n', b'i', v, 0] if *v == version => Ok(true),
            _ => {
                let way_out = "convert the file to NIfTI with a program that knows its orientation, e.g. 3D Slicer";
                Err(self.fail(
                    "magic",
                    "this is no NIfTI file but Analyze 7.5, which does not tell left from right, or damaged",
                    way_out,
                ))
            }
        }
    }

    fn size(&self) -> Result<([usize; 3], usize)> {
        let dim = |n| self.long([40, 16], n);
        let axes = dim(0);
        if !(3..=7).contains(&axes) {
            return Err(self.fail("dim", format!("{axes} axes are not read here"), "save one volume of three axes"));
        }
        let mut size = [0; 3];
        for (n, slot) in size.iter_mut().enumerate() {
            let wrong = |_| self.fail("dim", format!("an axis of {} voxels cannot be", dim(n + 1)), WRITE_AGAIN);
            *slot = u64::try_from(dim(n + 1)).map_err(wrong)?;
        }
        for n in 4..=axes as usize {
            if dim(n) > 1 {
                let way_out = "save one volume alone, e.g. one time or one label map, as a file of its own";
                return Err(self.fail("dim", format!("there are {} volumes in the file", dim(n)), way_out));
            }
        }
        voxels::volume(size).map_err(|fault| fault.at(self.place("dim")))
    }

    fn values(&self, count: usize) -> Result<Values> {
        let kind = match i16::from_le_bytes(self.take(self.at([70, 12]))) {
            2 => Kind::U8,
            4 => Kind::I16,
            8 => Kind::I32,
            16 => Kind::F32,
            64 => Kind::F64,
            256 => Kind::I8,
            512 => Kind::U16,
            768 => Kind::U32,
            1024 => Kind::I64,
            1280 => Kind::U64,
            other => {
                let what = match other {
                    1 => "single bits",
                    32 | 1792 | 2048 => "complex numbers",
                    128 | 2304 => "colours",
                    _ => "of a kind that is not known here",
                };
                return Err(self.fail("datatype", format!("the values ({other}) are {what}"), SEGMENT));
            }
        };
        let (slope, summand) = (self.real([112, 176], 0), self.real([112, 176], 1));
        let scale = match (slope.is_finite() && slope != 0.0, summand.is_finite()) {
            // Left out: nothing is scaled.
            (false, _) => None,
            (true, false) => return Err(self.fail("scl_inter", "the summand is not finite", WRITE_AGAIN)),
            (true, true) => Some((slope, summand)).filter(|scale| *scale != (1.0, 0.0)),
        };
        Ok(Values { kind, big_endian: self.big_endian, count, scale })
    }

    /// Where the data begins in its file.
    fn data_offset(&self, in_pair: bool) -> Result<u64> {
        let least = if in_pair { 0 } else { self.head.len() as u64 };
        let wrong =
            |found: String| Err(self.fail("vox_offset", format!("data cannot begin at byte {found}"), WRITE_AGAIN));
        let offset = match self.is_second() {
            false => {
                let offset = self.real([108, 168], 0);
                if !(0.0..=1e12).contains(&offset) || offset.fract() != 0.0 {
                    return wrong(format!("{offset:?}"));
                }
                offset as u64
            }
            true => match u64::try_from(self.long([108, 168], 0)) {
                Ok(offset) => offset,
                Err(_) => return wrong(self.long([108, 168], 0).to_string()),
            },
        };
        match offset {
            // Left out: behind the header and the four bytes that announce extensions.
            0 if !in_pair => Ok(least + 4),
            offset if offset >= least => Ok(offset),
            offset => wrong(offset.to_string()),
        }
    }

    /// Steps as columns and origin, RAS [m].
    fn geometry(&self, size: [usize; 3], notices: &mut Vec<String>) -> Result<(DMat3, DVec3)> {
        let unit = match self.is_second() {
            false => self.head[123],
            true => i32::from_le_bytes(self.take(500)) as u8,
        };
        let per_metre = match unit & 7 {
            1 => {
                notices.push("Lengths are taken in m as xyzt_units says.".into());
                1.0
            }
            2 => 1e3,
            3 => {
                notices.push("Lengths are taken in um as xyzt_units says.".into());
                1e6
            }
            0 => {
                notices.push("The file gives no unit of length; mm is taken.".into());
                1e3
            }
            other => {
                return Err(self.fail("xyzt_units", format!("the unit of length {other} is not known"), SAVE_AGAIN));
            }
        };
        let (sform, qform) = (self.code([254, 348]) > 0, self.code([252, 344]) > 0);
        let (field, (steps, origin)) = match (sform, qform) {
            (true, _) => ("srow_x, srow_y, srow_z", self.sform()),
            (false, true) => ("quatern_b, quatern_c, quatern_d, pixdim", self.qform()),
            (false, false) => {
                notices.push(
                    "The file gives neither sform nor qform: its axes are taken as right, anterior, superior, its first voxel as the origin."
                        .into(),
                );
                ("pixdim", (DMat3::from_diagonal(self.pixdim()), DVec3::ZERO))
            }
        };
        let (steps, origin) = (divided(steps, per_metre), origin / per_metre);
        voxels::check_grid(&steps, origin).map_err(|(part, fault)| match (part, sform, qform) {
            (Part::Origin, false, true) => fault.at(self.place("qoffset_x, qoffset_y, qoffset_z")),
            _ => fault.at(self.place(field)),
        })?;
        if sform && qform {
            let (other_steps, other_origin) = self.qform();
            let (other_steps, other_origin) = (divided(other_steps, per_metre), other_origin / per_metre);
            let corners = (0..8).map(|corner| {
                let at = [0, 1, 2].map(|n| if corner >> n & 1 == 0 { 0.0 } else { size[n] as f64 - 1.0 });
                let at = DVec3::from_array(at);
                (steps * at + origin - other_steps * at - other_origin).length()
            });
            let apart = corners.fold(0.0, f64::max);
            if apart.is_nan() || apart > 1e-4 {
                notices.push(format!("sform and qform are up to {:.1} mm apart; sform is taken.", apart * 1e3));
            }
        }
        Ok((steps, origin))
    }

    fn pixdim(&self) -> DVec3 {
        DVec3::from_array([1, 2, 3].map(|n| self.real([76, 104], n)))
    }

    fn sform(&self) -> (DMat3, DVec3) {
        let row = |n: usize| [0, 1, 2, 3].map(|column| self.real([280, 400], 4 * n + column));
        let [x, y, z] = [row(0), row(1), row(2)];
        let column = |n: usize| DVec3::new(x[n], y[n], z[n]);
        (DMat3::from_cols(column(0), column(1), column(2)), column(3))
    }

    fn qform(&self) -> (DMat3, DVec3) {
        let part = |n| self.real([256, 352], n);
        let imaginary = DVec3::new(part(0), part(1), part(2));
        let rest = 1.0 - imaginary.length_squared();
        // Rounded to 32 bits, half a turn may come out a little longer than it can be.
        let rotation = match rest < 1e-7 {
            true => DQuat::from_vec4(imaginary.normalize_or_zero().extend(0.0)),
            false => DQuat::from_vec4(imaginary.extend(rest.sqrt())),
        };
        let mirrored = if self.real([76, 104], 0) < 0.0 { -1.0 } else { 1.0 };
        let steps = self.pixdim() * DVec3::new(1.0, 1.0, mirrored);
        (DMat3::from_quat(rotation) * DMat3::from_diagonal(steps), DVec3::new(part(3), part(4), part(5)))
    }
}

/// Every length by its unit: the number nearest to it in metres.
fn divided(steps: DMat3, per_metre: f64) -> DMat3 {
    DMat3::from_cols(steps.x_axis / per_metre, steps.y_axis / per_metre, steps.z_axis / per_metre)
}
