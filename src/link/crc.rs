//! Checksum of a body: CRC-64 of ECMA-182 as [OpenIGTLink, header.md] uses it.
//!
//! Polynomial 0x42F0E1EBA9EA3693, highest bit first, start 0, no final inversion; a body of no bytes has checksum 0.

const POLYNOMIAL: u64 = 0x42f0_e1eb_a9ea_3693;

/// Remainder of every byte.
const REMAINDERS: [u64; 256] = remainders();

const fn remainders() -> [u64; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < table.len() {
        let mut rest = (byte as u64) << 56;
        let mut bit = 0;
        while bit < 8 {
            rest = if rest >> 63 == 1 { (rest << 1) ^ POLYNOMIAL } else { rest << 1 };
            bit += 1;
        }
        table[byte] = rest;
        byte += 1;
    }
    table
}

/// Checksum of `bytes` behind others, whose checksum is `before`; 0 where there are none.
pub fn extended(before: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(before, |rest, byte| (rest << 8) ^ REMAINDERS[usize::from((rest >> 56) as u8 ^ byte)])
}

/// Checksum of `bytes`.
pub fn crc64(bytes: &[u8]) -> u64 {
    extended(0, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of CRC-64/ECMA-182 in the usual catalogues.
    #[test]
    fn digits_have_the_known_checksum() {
        assert_eq!(crc64(b"123456789"), 0x6c40_df5f_0b49_7347);
        assert_eq!(crc64(b""), 0);
    }

    #[test]
    fn parts_give_the_checksum_of_the_whole() {
        let bytes: Vec<u8> = (0..=255).collect();
        for at in [0, 1, 17, 255, 256] {
            assert_eq!(extended(crc64(&bytes[..at]), &bytes[at..]), crc64(&bytes));
        }
    }
}
