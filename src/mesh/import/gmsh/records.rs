//! Records of a section, in text or binary.

use super::*;

/// Reader of numbers that hides whether they stand as text or binary.
pub(super) struct Records<'a> {
    pub(super) source: Source<'a>,
    /// `None` for text.
    pub(super) width: Option<Binary>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Binary {
    pub(super) big_endian: bool,
    /// Bytes of `size_t`: 4 or 8.
    pub(super) size: u64,
}

impl Records<'_> {
    pub(super) fn binary(&mut self, size: u64, big_endian: bool, what: &str) -> Result<u64> {
        let bytes = self.source.take(size, what)?;
        let join = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
        Ok(if big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) })
    }

    pub(super) fn int(&mut self, what: &str) -> Result<i64> {
        match self.width {
            None => self.source.number_in_line::<i64>(what),
            Some(b) => Ok(i64::from(self.binary(4, b.big_endian, what)? as u32 as i32)),
        }
    }

    pub(super) fn size(&mut self, what: &str) -> Result<u64> {
        match self.width {
            None => self.source.number_in_line::<u64>(what),
            Some(b) => self.binary(b.size, b.big_endian, what),
        }
    }

    pub(super) fn float(&mut self, what: &str) -> Result<f64> {
        match self.width {
            None => self.source.number_in_line::<f64>(what),
            Some(b) => Ok(f64::from_bits(self.binary(8, b.big_endian, what)?)),
        }
    }

    /// A number that is an `int` in binary files but cannot be negative.
    pub(super) fn id(&mut self, what: &str) -> Result<u64> {
        let at = self.source.at();
        let id = self.int(what)?;
        u64::try_from(id).map_err(|_| self.source.broken(at, format!("{what}: {id} is negative")))
    }

    /// Ends a line of text; a binary record has no end mark.
    pub(super) fn end(&mut self) -> Result<()> {
        if self.width.is_none() { self.source.end_line() } else { Ok(()) }
    }

    pub(super) fn position(&mut self, id: u64) -> Result<DVec3> {
        let at = self.source.at();
        let [x, y, z] = [self.float("coordinate x")?, self.float("coordinate y")?, self.float("coordinate z")?];
        let position = DVec3::new(x, y, z);
        if !position.is_finite() {
            return Err(self.source.broken(at, format!("node {id} stands at ({x}, {y}, {z}), which is not finite")));
        }
        Ok(position)
    }
}
