#![no_main]

use stylet::untrusted::Reader;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    Reader::named("trainee").expect("a reader of this name").survives(bytes);
});
