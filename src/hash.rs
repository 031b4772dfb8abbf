//! A hash that is the same on every machine.

/// Fowler-Noll-Vo hash of texts, as 16 hexadecimal digits: the same on every machine and in every version of the compiler.
pub fn fnv1a(texts: &[&str]) -> String {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for text in texts {
        // The end of a text counts, so that two texts are not one.
        for byte in text.bytes().chain([0]) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
    format!("{hash:016x}")
}
