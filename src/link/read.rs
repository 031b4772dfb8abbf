//! Reading messages from a stream of bytes that anybody may have sent.
//!
//! What the reader asks for is kept, everything else is read and thrown away 4 KiB at a time; so a message takes at most
//! [`LARGEST_KEPT`] bytes of memory whatever its header promises. The order of bytes cannot be trusted behind a wrong message:
//! whoever reads on after an error reads garbage.

use std::io::{ErrorKind, Read};

use super::crc::extended;
use super::message::{Content, HEADER, Header, Meaning, wrong};
use crate::error::{Error, Result};

/// Largest body of any message [byte]; a larger one is refused by its header.
pub const LARGEST_BODY: u64 = 1 << 20;

/// Largest body that is kept [byte]: what is wanted here is smaller by far, metadata included.
pub const LARGEST_KEPT: u64 = 128 << 10;

/// Bytes that are read at once.
const PIECE: usize = 4096;

/// A message that came.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    pub header: Header,
    /// `None`: of a type that is not known or not kept, skipped.
    pub content: Option<Content>,
}

/// The next message; `None` where the stream ends before it. `keeps`: whether the content is wanted. Without `check` the body
/// need not have the checksum of its header.
///
/// # Errors
/// `Error::Input` where the bytes are no message, are larger than the bounds of this file, end within the message or come too late.
pub fn message(source: &mut impl Read, keeps: impl Fn(Meaning) -> bool, check: bool) -> Result<Option<Received>> {
    let mut bytes = [0; HEADER];
    let begun = loop {
        match source.read(&mut bytes) {
            Ok(count) => break count,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            // A client that goes without a word.
            Err(error) if error.kind() == ErrorKind::ConnectionReset => break 0,
            Err(error) => return Err(broken(&error)),
        }
    };
    if begun == 0 {
        return Ok(None);
    }
    source.read_exact(&mut bytes[begun..]).map_err(|error| broken(&error))?;
    let header = Header::decode(&bytes)?;
    let name = &header.type_name;
    let size = header.body;
    if size > LARGEST_BODY {
        return Err(wrong(format!("a {name} of {size} bytes; at most {LARGEST_BODY} are read")));
    }
    let meaning = Meaning::of(name);
    let kept = meaning != Meaning::Unknown && keeps(meaning);
    if kept {
        // Behind a header of version 1 the size is known before a byte of the body is there.
        let (least, most) = match meaning.size() {
            Some((least, most)) if header.version == 1 => (least as u64, (most as u64).min(LARGEST_KEPT)),
            _ => (0, LARGEST_KEPT),
        };
        if !(least..=most).contains(&size) {
            return Err(wrong(format!("a {name} of {size} bytes; it has {least} to {most}")));
        }
    }
    let mut body = Vec::with_capacity(if kept { size as usize } else { 0 });
    let (mut left, mut crc) = (size as usize, 0);
    let mut piece = [0; PIECE];
    while left > 0 {
        let piece = &mut piece[..left.min(PIECE)];
        source.read_exact(piece).map_err(|error| broken(&error))?;
        crc = extended(crc, piece);
        if kept {
            body.extend_from_slice(piece);
        }
        left -= piece.len();
    }
    if check && crc != header.crc {
        return Err(wrong(format!(
            "a {name} whose body has the checksum {crc:016x}, not the {:016x} of its header",
            header.crc
        )));
    }
    let content = if kept { Content::decode(name, header.content(&body)?)? } else { None };
    Ok(Some(Received { header, content }))
}

/// Reads bytes as messages until they end, and gives how many there were.
///
/// # Errors
/// As [`message`].
pub fn all(mut bytes: &[u8], check: bool) -> Result<usize> {
    let mut count = 0;
    while message(&mut bytes, |_| true, check)?.is_some() {
        count += 1;
    }
    Ok(count)
}

fn broken(error: &std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::UnexpectedEof => wrong("the stream ends within a message"),
        ErrorKind::WouldBlock | ErrorKind::TimedOut => wrong("the rest of a message does not come"),
        _ => wrong(error),
    }
}

#[cfg(test)]
mod tests {
    use super::super::message::Kind;
    use super::*;

    fn text(length: usize) -> Vec<u8> {
        Content::Text("x".repeat(length)).encode("device", 0)
    }

    fn reason(bytes: &[u8], check: bool) -> String {
        all(bytes, check).unwrap_err().to_string()
    }

    #[test]
    fn messages_follow_each_other() {
        let mut bytes = text(3);
        bytes.extend(text(60_000));
        bytes.extend(text(0));
        assert_eq!(all(&bytes, true).unwrap(), 3);
        assert_eq!(all(b"", true).unwrap(), 0);
    }

    #[test]
    fn every_wrong_message_is_told() {
        let whole = text(10);
        for end in 1..whole.len() {
            assert!(reason(&whole[..end], true).contains("ends within a message"), "{end}");
        }
        let changed = |at: usize, value: u8| {
            let mut bytes = whole.clone();
            bytes[at] = value;
            bytes
        };
        assert!(reason(&changed(1, 3), true).contains("version 3"));
        assert!(reason(&changed(2, 0), true).contains("named"));
        assert!(reason(&changed(2, 0x80), true).contains("\\x80"));
        assert!(reason(&changed(42, 0xff), true).contains("at most 1048576"));
        assert!(reason(&changed(47, 0x0f), true).contains("it has 4 to"));
        assert!(reason(&changed(HEADER + 5, b'y'), true).contains("checksum"));
        assert_eq!(all(&changed(HEADER + 5, b'y'), false).unwrap(), 1);
    }

    #[test]
    fn what_is_not_wanted_is_skipped() {
        let mut bytes = text(60_000);
        // An IMAGE of no sense, as large as may be.
        let mut image = text(0);
        image[2..14].copy_from_slice(b"IMAGE\0\0\0\0\0\0\0");
        image.truncate(HEADER);
        image[42..50].copy_from_slice(&LARGEST_BODY.to_be_bytes());
        let body = vec![7; LARGEST_BODY as usize];
        image[50..58].copy_from_slice(&extended(0, &body).to_be_bytes());
        bytes.extend(&image);
        bytes.extend(&body);
        bytes.extend(Content::Request(super::super::message::Verb::Get, Kind::Status).encode("", 0));
        let mut source = &bytes[..];
        let mut next = || message(&mut source, |meaning| matches!(meaning, Meaning::Request(..)), true).unwrap();
        assert_eq!(next().unwrap().content, None);
        assert_eq!(next().unwrap().content, None);
        assert!(next().unwrap().content.is_some());
        assert_eq!(next(), None);
    }
}
