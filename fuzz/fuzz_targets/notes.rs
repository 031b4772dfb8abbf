#![no_main]

use stylet::untrusted::Reader;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    Reader::named("notes").expect("a reader of this name").survives(bytes);
});
