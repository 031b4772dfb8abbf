//! Messages of OpenIGTLink as bytes: a header of 58 bytes and a body, every number big endian [OpenIGTLink, header.md]:
//! ```text
//! version u16 | type char[12] | device char[20] | time u64 | size of the body u64 | CRC-64 of the body u64
//! ```
//! Version 1 is the header of protocols 1 and 2: the body is the content. Version 2 is that of protocol 3: the content stands
//! between an extended header and metadata, which are skipped. Version 1 is written, because every peer reads it.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use glam::{DMat3, DQuat, DVec3};

use super::crc::crc64;
use crate::error::{Error, Result};

/// Size of a header [byte].
pub const HEADER: usize = 58;
/// Size of the extended header of version 2 as it is known today [byte].
const EXTENDED_HEADER: usize = 12;
/// Size of the content of a TRANSFORM, of a POSITION with orientation, and of what stands before the text of a STATUS and
/// before the values of a SENSOR [byte].
const TRANSFORM: usize = 48;
const POSITION: usize = 28;
const STATUS: usize = 30;
const SENSOR: usize = 10;
/// Longest name of a type and of a device [byte].
const TYPE_NAME: usize = 12;
const DEVICE_NAME: usize = 20;
/// Longest text of a STRING [byte]: its length is a u16.
const LONGEST_STRING: usize = u16::MAX as usize;
/// Numbers of the encodings of text in IANA's list of character sets.
const ASCII: u16 = 3;
const UTF_8: u16 = 106;

/// SENSOR unit: newton, exponent 1 [OpenIGTLink, unit.md]. The example in sensordata.md has its exponent two bits too low; the
/// reference library and unit.md agree on this one.
pub const NEWTON: u64 = unit(0x0, 0x0b);
/// SENSOR unit: millimetre, as metre with the prefix milli.
pub const MILLIMETRE: u64 = unit(0xb, 0x01);

/// The 64 bits of an SI unit with exponent 1: prefix 4 bits, then unit 6 bits and exponent 4 bits, five more of both unused.
const fn unit(prefix: u64, symbol: u64) -> u64 {
    prefix << 60 | symbol << 54 | 1 << 50
}

/// What a message holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Transform,
    Position,
    Status,
    Sensor,
    Text,
}

impl Kind {
    pub const ALL: [Kind; 5] = [Kind::Transform, Kind::Position, Kind::Status, Kind::Sensor, Kind::Text];

    /// Name of the type of message.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Transform => "TRANSFORM",
            Kind::Position => "POSITION",
            Kind::Status => "STATUS",
            Kind::Sensor => "SENSOR",
            Kind::Text => "STRING",
        }
    }
}

/// What a client asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verb {
    /// One message, now.
    Get,
    /// A message for every state.
    Start,
    /// No more of them.
    Stop,
}

/// What the name of a type means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    Data(Kind),
    Request(Verb, Kind),
    /// `RTS_...`: whether a request was granted.
    Answer(Kind),
    /// A type that is not known here, which is to be skipped.
    Unknown,
}

impl Meaning {
    /// What the name of a type means. A name that is longer than 12 bytes with its prefix is cut: `GET_TRANSFOR`.
    pub fn of(name: &str) -> Meaning {
        let kind = |prefix: &str| {
            let rest = name.strip_prefix(prefix)?;
            let cut = TYPE_NAME - prefix.len();
            Kind::ALL.into_iter().find(|kind| &kind.name()[..kind.name().len().min(cut)] == rest)
        };
        kind("")
            .map(Meaning::Data)
            .or_else(|| Some(Meaning::Request(Verb::Get, kind("GET_")?)))
            .or_else(|| Some(Meaning::Request(Verb::Start, kind("STT_")?)))
            .or_else(|| Some(Meaning::Request(Verb::Stop, kind("STP_")?)))
            .or_else(|| Some(Meaning::Answer(kind("RTS_")?)))
            .unwrap_or(Meaning::Unknown)
    }

    /// Smallest and largest size of the content [byte]; `None` where nothing is known of it.
    pub fn size(self) -> Option<(usize, usize)> {
        match self {
            Meaning::Data(Kind::Transform) => Some((TRANSFORM, TRANSFORM)),
            Meaning::Data(Kind::Position) => Some((POSITION, POSITION)),
            Meaning::Data(Kind::Status) => Some((STATUS, usize::MAX)),
            Meaning::Data(Kind::Sensor) => Some((SENSOR, SENSOR + 8 * usize::from(u8::MAX))),
            Meaning::Data(Kind::Text) => Some((4, 4 + LONGEST_STRING)),
            // The request may name the shortest time between two messages, which is not regarded.
            Meaning::Request(Verb::Start, _) => Some((0, 8)),
            Meaning::Request(..) => Some((0, 0)),
            Meaning::Answer(_) => Some((1, 1)),
            Meaning::Unknown => None,
        }
    }
}

/// Head of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// 1 or 2.
    pub version: u16,
    /// Name of the type: 1 to 12 printable ASCII characters.
    pub type_name: String,
    /// Name of the device; what is no UTF-8 in it is replaced.
    pub device: String,
    /// Seconds since 1970-01-01 UTC with 32 bits behind the point; 0 where the sender does not tell.
    pub time: u64,
    /// Size of the body [byte].
    pub body: u64,
    /// CRC-64 of the body.
    pub crc: u64,
}

impl Header {
    /// # Errors
    /// `Error::Input` for another version and for a type whose name is no text: what follows cannot be understood.
    pub fn decode(bytes: &[u8; HEADER]) -> Result<Header> {
        let mut rest = Fields(bytes);
        let version = u16::from_be_bytes(rest.take()?);
        if !(1..=2).contains(&version) {
            return Err(wrong(format!("a header of version {version}; versions 1 and 2 are known")));
        }
        let name: [u8; TYPE_NAME] = rest.take()?;
        let name = until_zero(&name);
        if name.is_empty() || !name.iter().all(u8::is_ascii_graphic) {
            return Err(wrong(format!("a type of message named \"{}\"", name.escape_ascii())));
        }
        let type_name = String::from_utf8_lossy(name).into_owned();
        let device: [u8; DEVICE_NAME] = rest.take()?;
        let device = String::from_utf8_lossy(until_zero(&device)).into_owned();
        let mut number = || rest.take().map(u64::from_be_bytes);
        Ok(Header { version, type_name, device, time: number()?, body: number()?, crc: number()? })
    }

    /// The content in a body: all of it, or what the extended header and the metadata leave.
    ///
    /// # Errors
    /// `Error::Input` where they are larger than the body.
    pub fn content<'a>(&self, body: &'a [u8]) -> Result<&'a [u8]> {
        if self.version == 1 {
            return Ok(body);
        }
        let mut rest = Fields(body);
        let extended = usize::from(u16::from_be_bytes(rest.take()?));
        let metadata = usize::from(u16::from_be_bytes(rest.take()?)) as u64;
        let metadata = metadata + u64::from(u32::from_be_bytes(rest.take()?));
        let end = (body.len() as u64).checked_sub(metadata).map(|end| end as usize);
        match end {
            Some(end) if (EXTENDED_HEADER..=end).contains(&extended) => Ok(&body[extended..end]),
            _ => {
                Err(wrong(format!("an extended header and metadata larger than the {} bytes of the body", body.len())))
            }
        }
    }
}

/// A rigid motion as a TRANSFORM writes it: columns of the rotation, then the translation [mm], 12 numbers f32.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    pub rotation: DMat3,
    /// [mm]
    pub translation: DVec3,
}

/// State of the sender.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// [`Status::OK`] and others.
    pub code: u16,
    /// Of the sender's own making.
    pub subcode: i64,
    /// At most 20 bytes; more are cut.
    pub name: String,
    pub text: String,
}

/// Codes of [OpenIGTLink, status.md].
impl Status {
    pub const OK: u16 = 1;
    pub const ACCESS_DENIED: u16 = 5;
    pub const BUSY: u16 = 6;
    pub const ILLEGAL_INSTRUCTION: u16 = 12;
    pub const NOT_READY: u16 = 13;
    pub const DISABLED: u16 = 15;
}

/// Readings of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// [`NEWTON`] or another of [OpenIGTLink, unit.md].
    pub unit: u64,
    /// At most 255.
    pub values: Vec<f64>,
}

/// What a message says.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    Transform(Transform),
    /// Position [mm] and orientation.
    Position(DVec3, DQuat),
    Status(Status),
    Sensor(Sensor),
    /// A STRING of at most 65,535 bytes; more are cut.
    Text(String),
    Request(Verb, Kind),
    /// Whether a request was granted.
    Answer(Kind, bool),
}

impl Content {
    /// Name of the type of message.
    pub fn type_name(&self) -> String {
        let prefixed = |prefix: &str, kind: &Kind| {
            let name = format!("{prefix}{}", kind.name());
            name[..name.len().min(TYPE_NAME)].to_string()
        };
        match self {
            Content::Transform(_) => Kind::Transform.name().into(),
            Content::Position(..) => Kind::Position.name().into(),
            Content::Status(_) => Kind::Status.name().into(),
            Content::Sensor(_) => Kind::Sensor.name().into(),
            Content::Text(_) => Kind::Text.name().into(),
            Content::Request(Verb::Get, kind) => prefixed("GET_", kind),
            Content::Request(Verb::Start, kind) => prefixed("STT_", kind),
            Content::Request(Verb::Stop, kind) => prefixed("STP_", kind),
            Content::Answer(kind, _) => prefixed("RTS_", kind),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let real = |bytes: &mut Vec<u8>, values: &[f64]| {
            values.iter().for_each(|v| bytes.extend((*v as f32).to_be_bytes()));
        };
        match self {
            Content::Transform(transform) => {
                real(&mut bytes, &transform.rotation.to_cols_array());
                real(&mut bytes, &transform.translation.to_array());
            }
            Content::Position(position, orientation) => {
                real(&mut bytes, &position.to_array());
                real(&mut bytes, &orientation.to_array());
            }
            Content::Status(status) => {
                bytes.extend(status.code.to_be_bytes());
                bytes.extend(status.subcode.to_be_bytes());
                bytes.extend(padded::<DEVICE_NAME>(&status.name));
                bytes.extend(status.text.as_bytes());
                // Not in the specification, but the reference library drops a text without it.
                bytes.push(0);
            }
            Content::Sensor(sensor) => {
                let count = u8::try_from(sensor.values.len()).expect("a sensor has at most 255 values");
                bytes.extend([count, 0]);
                bytes.extend(sensor.unit.to_be_bytes());
                sensor.values.iter().for_each(|v| bytes.extend(v.to_be_bytes()));
            }
            Content::Text(text) => {
                let text = cut(text, LONGEST_STRING);
                bytes.extend(if text.is_ascii() { ASCII } else { UTF_8 }.to_be_bytes());
                bytes.extend((text.len() as u16).to_be_bytes());
                bytes.extend(text.as_bytes());
            }
            Content::Request(..) => {}
            Content::Answer(_, granted) => bytes.push(u8::from(!granted)),
        }
        bytes
    }

    /// A whole message with a header of version 1. `device`: at most 20 bytes, more are cut; `time`: as in [`Header::time`].
    ///
    /// # Panics
    /// For a sensor of more than 255 values.
    pub fn encode(&self, device: &str, time: u64) -> Vec<u8> {
        let body = self.bytes();
        let mut bytes = Vec::with_capacity(HEADER + body.len());
        bytes.extend(1_u16.to_be_bytes());
        bytes.extend(padded::<TYPE_NAME>(&self.type_name()));
        bytes.extend(padded::<DEVICE_NAME>(device));
        bytes.extend(time.to_be_bytes());
        bytes.extend((body.len() as u64).to_be_bytes());
        bytes.extend(crc64(&body).to_be_bytes());
        bytes.extend(body);
        bytes
    }

    /// What the content of a message says; `None` for a type that is not known.
    ///
    /// # Errors
    /// `Error::Input` where its size or its text is not one of the type.
    pub fn decode(type_name: &str, bytes: &[u8]) -> Result<Option<Content>> {
        let meaning = Meaning::of(type_name);
        let Some((least, most)) = meaning.size() else { return Ok(None) };
        if !(least..=most).contains(&bytes.len()) {
            return Err(wrong(format!("a {type_name} with {} bytes of content", bytes.len())));
        }
        let mut rest = Fields(bytes);
        let content = match meaning {
            Meaning::Data(Kind::Transform) => {
                let mut column = || rest.vector();
                let rotation = DMat3::from_cols(column()?, column()?, column()?);
                Content::Transform(Transform { rotation, translation: column()? })
            }
            Meaning::Data(Kind::Position) => {
                let position = rest.vector()?;
                let axis = rest.vector()?;
                Content::Position(position, DQuat::from_xyzw(axis.x, axis.y, axis.z, rest.real()?))
            }
            Meaning::Data(Kind::Status) => {
                let (code, subcode) = (u16::from_be_bytes(rest.take()?), i64::from_be_bytes(rest.take()?));
                let name: [u8; DEVICE_NAME] = rest.take()?;
                let name = String::from_utf8_lossy(until_zero(&name)).into_owned();
                let text = String::from_utf8_lossy(until_zero(rest.0)).into_owned();
                Content::Status(Status { code, subcode, name, text })
            }
            Meaning::Data(Kind::Sensor) => {
                let [count, _reserved] = rest.take()?;
                let unit = u64::from_be_bytes(rest.take()?);
                if rest.0.len() != 8 * usize::from(count) {
                    return Err(wrong(format!("a SENSOR of {count} values with {} bytes of them", rest.0.len())));
                }
                let mut values = Vec::with_capacity(usize::from(count));
                for _ in 0..count {
                    values.push(f64::from_be_bytes(rest.take()?));
                }
                Content::Sensor(Sensor { unit, values })
            }
            Meaning::Data(Kind::Text) => {
                let (encoding, length) = (u16::from_be_bytes(rest.take()?), u16::from_be_bytes(rest.take()?));
                if rest.0.len() != usize::from(length) {
                    return Err(wrong(format!("a STRING of {length} bytes with {} of them", rest.0.len())));
                }
                match std::str::from_utf8(rest.0) {
                    Ok(text) if encoding == UTF_8 || (encoding == ASCII && text.is_ascii()) => {
                        Content::Text(text.to_string())
                    }
                    _ => return Err(wrong(format!("a STRING that is no text in encoding {encoding}"))),
                }
            }
            Meaning::Request(verb, kind) => Content::Request(verb, kind),
            Meaning::Answer(kind) => Content::Answer(kind, rest.take()? == [0_u8]),
            Meaning::Unknown => return Ok(None),
        };
        Ok(Some(content))
    }
}

/// A moment as [`Header::time`] has it.
pub fn timestamp(moment: SystemTime) -> u64 {
    let since = moment.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    // The seconds are 32 bits wide and begin anew in 2106.
    (since.as_secs() << 32) | ((u64::from(since.subsec_nanos()) << 32) / 1_000_000_000)
}

/// A message that is none of OpenIGTLink.
pub(super) fn wrong(reason: impl std::fmt::Display) -> Error {
    Error::input(
        format!("OpenIGTLink: {reason}"),
        "let the client send messages of OpenIGTLink with headers of version 1 or 2",
    )
}

/// The bytes of a message that were not read yet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let (field, rest) = self.0.split_first_chunk::<N>().ok_or_else(|| wrong("a message that ends too early"))?;
        self.0 = rest;
        Ok(*field)
    }

    fn real(&mut self) -> Result<f64> {
        Ok(f64::from(f32::from_be_bytes(self.take()?)))
    }

    fn vector(&mut self) -> Result<DVec3> {
        Ok(DVec3::new(self.real()?, self.real()?, self.real()?))
    }
}

/// A name in `N` bytes, zeros behind it.
fn padded<const N: usize>(name: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let name = cut(name, N);
    bytes[..name.len()].copy_from_slice(name.as_bytes());
    bytes
}

/// The beginning of a text that takes at most `most` bytes; no character is cut.
pub(super) fn cut(text: &str, most: usize) -> &str {
    &text[..text.floor_char_boundary(most)]
}

fn until_zero(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len())]
}

#[cfg(test)]
mod tests {
    use super::super::read::{self, Received};
    use super::*;

    /// 1234567890.5 s after 1970-01-01.
    const MOMENT: u64 = 0x4996_02d2_8000_0000;

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u8> = hex.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
        digits.chunks(2).map(byte).collect()
    }

    fn decoded(bytes: &[u8]) -> (Header, Content) {
        let mut source = bytes;
        let received = read::message(&mut source, |_| true, true).unwrap().unwrap();
        assert!(source.is_empty());
        let Received { header, content } = received;
        (header, content.unwrap())
    }

    fn golden_transform() -> Transform {
        Transform {
            rotation: DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
            translation: DVec3::new(1.5, -2.25, -30.0),
        }
    }

    /// Written by pyigtl 0.3.4 as `TransformMessage([[0,0,1,1.5],[1,0,0,-2.25],[0,1,0,-30],[0,0,0,1]])`.
    #[test]
    fn transforms_are_those_of_pyigtl() {
        let golden = bytes(
            "0001 5452414e53464f524d000000 4e6565646c650000000000000000000000000000 499602d280000000 0000000000000030
             f046f765fc359fef 000000003f80000000000000 00000000000000003f800000 3f8000000000000000000000 3fc00000c0100000c1f00000",
        );
        let content = Content::Transform(golden_transform());
        assert_eq!(content.encode("Needle", MOMENT), golden);
        let (header, found) = decoded(&golden);
        assert_eq!((header.version, header.device.as_str(), header.time), (1, "Needle", MOMENT));
        assert_eq!(found, content);
    }

    /// The same with the header of version 2 and metadata {"a": "bc"}, written by pyigtl.
    #[test]
    fn headers_of_version_2_are_read() {
        let golden = bytes(
            "0002 5452414e53464f524d000000 4e6565646c650000000000000000000000000000 499602d280000000 0000000000000049
             911226e817e31f07 000c000a0000000300000007 000000003f80000000000000 00000000000000003f800000
             3f8000000000000000000000 3fc00000c0100000c1f00000 00010001000300000002616263",
        );
        let (header, found) = decoded(&golden);
        assert_eq!(header.version, 2);
        assert_eq!(found, Content::Transform(golden_transform()));
        // A metadata header of 0xffff bytes, an extended header of 11.
        for (at, value) in [(HEADER + 2, 0xff), (HEADER + 1, 0x0b)] {
            let mut body = golden[HEADER..].to_vec();
            body[at - HEADER] = value;
            assert!(header.content(&body).is_err());
        }
        assert!(header.content(&[0; 7]).is_err());
    }

    /// Written by pyigtl as `StringMessage("0.5 N")`.
    #[test]
    fn strings_are_those_of_pyigtl() {
        let golden = bytes(
            "0001 535452494e47000000000000 4e6565646c655374617465000000000000000000 499602d280000000 0000000000000009
             4e4755ed9607b17d 0003 0005 302e35204e",
        );
        let content = Content::Text("0.5 N".into());
        assert_eq!(content.encode("NeedleState", MOMENT), golden);
        assert_eq!(decoded(&golden).1, content);
        let (_, found) = decoded(&Content::Text("0,5 µN".into()).encode("x", 0));
        assert_eq!(found, Content::Text("0,5 µN".into()));
    }

    /// Bodies laid out by hand from status.md and sensordata.md; checksums by crcmod 1.7, which pyigtl uses.
    #[test]
    fn status_and_sensor_have_the_bytes_of_the_specification() {
        let status =
            Status { code: Status::ACCESS_DENIED, subcode: 0, name: "Access denied".into(), text: "no".into() };
        let message = Content::Status(status.clone()).encode("Stylet", 0);
        assert_eq!(message[50..58], 0xb2db_5aa6_6774_6ba4_u64.to_be_bytes());
        let body = bytes("0005 0000000000000000 4163636573732064656e69656400000000000000 6e6f00");
        assert_eq!(message[HEADER..], body);
        assert_eq!(decoded(&message).1, Content::Status(status));

        let sensor = Content::Sensor(Sensor { unit: NEWTON, values: vec![0.5, -0.25] });
        let message = sensor.encode("NeedleForce", 0);
        assert_eq!(message[50..58], 0xa055_73c3_fa6d_1b5c_u64.to_be_bytes());
        assert_eq!(message[HEADER..], bytes("02 00 02c4000000000000 3fe0000000000000 bfd0000000000000"));
        assert_eq!(decoded(&message).1, sensor);
    }

    /// Checksums of the sample messages that the reference library of OpenIGTLink tests itself with: equal ones mean equal bodies.
    #[test]
    fn bodies_have_the_checksums_of_the_reference_library() {
        let checksum =
            |content: Content| u64::from_be_bytes(content.encode("DeviceName", 0)[50..58].try_into().unwrap());
        let x = DVec3::new(-0.954892, 0.196632, -0.222525);
        let y = DVec3::new(-0.196632, 0.142857, 0.970014);
        let z = DVec3::new(0.222525, 0.970014, -0.0977491);
        let translation = DVec3::new(46.0531, 19.4709, 46.0531);
        let transform = Transform { rotation: DMat3::from_cols(x, y, z), translation };
        assert_eq!(checksum(Content::Transform(transform)), 0xf6dd_2b8e_b4df_6dd2);
        let orientation = DQuat::from_xyzw(0.0, 0.5773502691, 0.5773502691, 0.3333333333);
        assert_eq!(checksum(Content::Position(translation, orientation)), 0x6bc8_d628_2b79_a3a1);
        let (name, text) = ("ACTUATOR_DISABLED".into(), "Actuator A is disabled.".into());
        let status = Status { code: 15, subcode: 10, name, text };
        assert_eq!(checksum(Content::Status(status)), 0x98ee_43ee_d8e4_31cf);
        // Metre / second^2.
        let unit = 0x01 << 54 | 1 << 50 | 0x03 << 44 | 0xe << 40;
        let values = vec![123456.78, 12345.678, 1234.5678, 123.45678, 12.345678, 1.2345678];
        assert_eq!(checksum(Content::Sensor(Sensor { unit, values })), 0x637b_8008_6620_20e7);
    }

    #[test]
    fn positions_come_back() {
        let content = Content::Position(DVec3::new(1.5, -2.25, -30.0), DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5));
        assert_eq!(decoded(&content.encode("NeedlePosition", 1)).1, content);
    }

    #[test]
    fn requests_and_answers_are_known_by_their_cut_names() {
        assert_eq!(Meaning::of("GET_TRANSFOR"), Meaning::Request(Verb::Get, Kind::Transform));
        assert_eq!(Meaning::of("STT_SENSOR"), Meaning::Request(Verb::Start, Kind::Sensor));
        assert_eq!(Meaning::of("STP_POSITION"), Meaning::Request(Verb::Stop, Kind::Position));
        for name in ["TRANSFOR", "GET_TRANSFORM", "GET_", "IMAGE", "get_status", ""] {
            assert_eq!(Meaning::of(name), Meaning::Unknown, "{name}");
        }
        for kind in Kind::ALL {
            for content in
                [Content::Request(Verb::Get, kind), Content::Answer(kind, false), Content::Answer(kind, true)]
            {
                assert_eq!(decoded(&content.encode("", 0)).1, content);
            }
        }
    }

    #[test]
    fn names_are_cut_between_characters() {
        let (header, _) = decoded(&Content::Request(Verb::Get, Kind::Status).encode("nineteen bytes longµ", 0));
        assert_eq!(header.device, "nineteen bytes long");
    }

    #[test]
    fn sizes_and_texts_that_no_type_has_are_refused() {
        for (name, size) in
            [("TRANSFORM", 47), ("TRANSFORM", 49), ("STATUS", 29), ("SENSOR", 11), ("GET_STATUS", 1), ("STRING", 3)]
        {
            let error = Content::decode(name, &vec![0; size]).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("way out"), "{error}");
        }
        assert!(Content::decode("SENSOR", &bytes("02 00 02c4000000000000 3fe0000000000000")).is_err());
        assert!(Content::decode("STRING", &bytes("0003 0001 ff")).is_err());
        assert!(Content::decode("STRING", &bytes("0003 0002 c2b5")).is_err());
        assert!(Content::decode("STRING", &bytes("0007 0001 41")).is_err());
        assert!(Content::decode("STRING", &bytes("006a 0003 41")).is_err());
        assert_eq!(Content::decode("IMAGE", &[1, 2]).unwrap(), None);
    }

    #[test]
    fn time_is_seconds_and_their_fraction() {
        let moment = UNIX_EPOCH + Duration::from_millis(1_234_567_890_500);
        assert_eq!(timestamp(moment), MOMENT);
        assert_eq!(timestamp(UNIX_EPOCH), 0);
    }
}
