//! Damaged files: whatever is cut off or changed, the answer is a mesh or an error, soon.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::*;

/// The largest block of memory that was ever asked for [bytes].
static LARGEST_BLOCK: AtomicUsize = AtomicUsize::new(0);

/// The allocator of the system, watched: a count in a damaged file must not become an allocation.
struct Watched;

// SAFETY: every call goes to the allocator of the system unchanged.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST_BLOCK.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST_BLOCK.fetch_max(size, Ordering::Relaxed);
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Watched = Watched;

/// Reads damaged bytes; a panic fails the test by itself.
fn survives(path: &Path, bytes: &[u8]) -> Result<(), TestCaseError> {
    let start = Instant::now();
    match parse(&path.display().to_string(), bytes, MILLIMETRES) {
        Ok(imported) => {
            let mesh = imported.mesh;
            let nodes = mesh.positions.len() as u32;
            prop_assert!(mesh.tets.iter().flatten().all(|n| *n < nodes));
            prop_assert!(mesh.tags.iter().all(|t| (*t as usize) < mesh.regions.len()));
            prop_assert!((0..mesh.tets.len()).all(|t| mesh.volume(t) > 0.0));
        }
        Err(error) => {
            let message = error.to_string();
            prop_assert!(message.contains("cube_") && message.contains("way out: "), "{}", message);
        }
    }
    // A sample takes about a millisecond; a loop over a count that is not there would take hours.
    prop_assert!(start.elapsed() < Duration::from_secs(5), "{} took too long", path.display());
    // The largest mesh of these tests, the forearm, needs a few MB at once.
    let largest = LARGEST_BLOCK.load(Ordering::Relaxed);
    prop_assert!(largest < 64 << 20, "{} asked for {largest} bytes at once", path.display());
    Ok(())
}

#[test]
fn truncated_files() {
    for path in samples() {
        let bytes = std::fs::read(&path).unwrap();
        // Whole, a cut file can be only where what follows the mesh is cut.
        let complete = (0..bytes.len())
            .step_by(97)
            .filter(|cut| {
                survives(&path, &bytes[..*cut]).unwrap_or_else(|e| panic!("{}, {cut} bytes: {e}", path.display()));
                parse(&path.display().to_string(), &bytes[..*cut], MILLIMETRES).is_ok()
            })
            .count();
        let may_end_early = path.extension().is_some_and(|e| e == "inp" || e == "vtk");
        assert!(may_end_early || complete <= 2, "{}: {complete} cut files were taken for whole", path.display());
    }
}

#[test]
fn flipped_bytes() {
    for path in samples() {
        let bytes = std::fs::read(&path).unwrap();
        let flips = prop::collection::vec((0..bytes.len(), any::<u8>()), 1..6);
        let mut runner =
            TestRunner::new(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() });
        runner
            .run(&flips, |flips| {
                let mut damaged = bytes.clone();
                for (place, byte) in flips {
                    damaged[place] = byte;
                }
                survives(&path, &damaged)
            })
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

#[test]
fn changed_numbers() {
    // Digits changed into digits pass the syntax and reach the counts.
    for path in samples() {
        let bytes = std::fs::read(&path).unwrap();
        let head = bytes.len().min(1500);
        let digits: Vec<usize> = (0..head).filter(|i| bytes[*i].is_ascii_digit()).collect();
        let change = (prop::sample::select(digits), prop::sample::select(b"0123456789-".to_vec()), 0..6usize);
        let mut runner =
            TestRunner::new(ProptestConfig { cases: 150, failure_persistence: None, ..Default::default() });
        runner
            .run(&change, |(place, digit, repeats)| {
                let mut damaged = bytes.clone();
                damaged.splice(place..=place, std::iter::repeat_n(digit, 1 + 3 * repeats));
                survives(&path, &damaged)
            })
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}
