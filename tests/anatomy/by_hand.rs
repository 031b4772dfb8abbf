//! Volumes written by hand, and where those of other programs stand.

use std::io::Write;
use std::path::{Path, PathBuf};

use stylet::anatomy::{Labelled, parse};

pub fn files() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/anatomy/files")
}

pub fn is_header(path: &Path) -> bool {
    !["raw", "zraw", "img", "bz2", "stl", "obj", "ply", "vtp"]
        .iter()
        .any(|end| path.extension().is_some_and(|e| e == *end))
}

/// All files that are read by themselves, with their bytes.
pub fn fixtures() -> Vec<(PathBuf, Vec<u8>)> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(files()).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().filter(|path| is_header(path)).map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A NRRD file of 3 x 2 x 1 voxels, 1 x 2 x 3 mm; `lines` replace those with the same key.
pub fn nrrd(lines: &str, data: &[u8]) -> Vec<u8> {
    const WHOLE: &str = "type: uchar\ndimension: 3\nspace: RAS\nsizes: 3 2 1\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n\
                         space origin: (10,20,30)\nencoding: raw\nendian: little\n";
    let key = |line: &str| line.split(':').next().unwrap_or_default().to_string();
    let own: Vec<String> = lines.lines().map(key).collect();
    let mut text = String::from("NRRD0004\n# by hand\n");
    for line in WHOLE.lines().filter(|line| !own.contains(&key(line))).chain(lines.lines()) {
        // `-key:` leaves the line out.
        if !own.contains(&format!("-{}", key(line))) && !line.starts_with('-') {
            text += line;
            text += "\n";
        }
    }
    let mut bytes = text.into_bytes();
    bytes.push(b'\n');
    bytes.extend(data);
    bytes
}

pub const SIX: [u8; 6] = [0, 1, 2, 3, 4, 250];

pub fn six(bytes: &[u8]) -> Labelled {
    let labelled = parse("volume", bytes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(labelled.map.labels, SIX.map(u16::from));
    assert_eq!(labelled.map.size, [3, 2, 1]);
    labelled
}

/// The six values as numbers of any type.
macro_rules! six_as {
    ($kind:ty, $bytes:ident) => {
        SIX.iter().flat_map(|v| <$kind>::from(*v).$bytes()).collect::<Vec<u8>>()
    };
}

/// A NIfTI-1 file, little-endian, with the six voxels as bytes and `change` made to its header.
pub fn nifti(change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = vec![0; 352];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, &348_i32.to_le_bytes());
    for (n, size) in [3_i16, 3, 2, 1, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * n, &size.to_le_bytes());
    }
    put(70, &2_i16.to_le_bytes());
    put(72, &8_i16.to_le_bytes());
    for (n, size) in [1.0_f32, 1.0, 2.0, 3.0].into_iter().enumerate() {
        put(76 + 4 * n, &size.to_le_bytes());
    }
    put(108, &352_f32.to_le_bytes());
    put(123, &[2]);
    put(254, &1_i16.to_le_bytes());
    for (n, value) in [1.0_f32, 0.0, 0.0, 10.0, 0.0, 2.0, 0.0, 20.0, 0.0, 0.0, 3.0, 30.0].into_iter().enumerate() {
        put(280 + 4 * n, &value.to_le_bytes());
    }
    put(344, b"n+1\0");
    bytes.extend(SIX);
    change(&mut bytes);
    bytes
}

pub fn put(at: usize, value: &[u8]) -> impl Fn(&mut Vec<u8>) {
    move |bytes| bytes[at..at + value.len()].copy_from_slice(value)
}

/// A MetaImage of the six voxels; `lines` replace those with the same key.
pub fn meta(lines: &str, data: &[u8]) -> Vec<u8> {
    const WHOLE: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n\
                         Offset = 10 20 30\nAnatomicalOrientation = RAI\nElementSpacing = 1 2 3\nDimSize = 3 2 1\nElementType = MET_UCHAR\n\
                         ElementDataFile = LOCAL\n";
    let key = |line: &str| line.split('=').next().unwrap_or_default().trim().to_string();
    let own: Vec<String> = lines.lines().map(key).collect();
    let last = |line: &&str| key(line) == "ElementDataFile";
    let kept = WHOLE.lines().filter(|line| !own.contains(&key(line)) && !own.contains(&format!("-{}", key(line))));
    let mut all: Vec<&str> = kept.chain(lines.lines().filter(|line| !line.starts_with('-'))).collect();
    all.sort_by_key(|line| last(line));
    let mut bytes = (all.join("\n") + "\n").into_bytes();
    bytes.extend(data);
    bytes
}

pub(crate) use six_as;
