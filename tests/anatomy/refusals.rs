//! What is refused: headers that cannot be, values that are no labels, bombs, and files that were cut or damaged.

use std::panic::catch_unwind;
use std::path::PathBuf;

use stylet::anatomy::{Labelled, markups, parse};

use super::by_hand::*;

fn refused(bytes: &[u8], because: &str) {
    let error = parse("volume", bytes).expect_err(because).to_string();
    assert!(error.contains(because) && error.contains("way out"), "{because}: {error}");
    assert!(error.starts_with("volume:"), "{error}");
}

#[test]
fn nrrd_that_cannot_be_is_refused() {
    for (lines, because) in [
        ("sizes: 1000 1000 1000", "volume:10: sizes: 1000 x 1000 x 1000 voxels are more than"),
        ("sizes: 4294967296 4294967296 4294967296", "are more than"),
        ("sizes: 18446744073709551616 1 1", "is not a number"),
        ("sizes: 0 2 1", "0 x 2 x 1 voxels are none"),
        ("sizes: -3 2 1", "`-3` is not a number"),
        ("sizes: 3 2", "3 numbers"),
        ("sizes: 3 2 1 1", "3 numbers"),
        ("sizes: 3 2 2", "12 bytes of values should stand here, but there are 6 bytes"),
        ("space directions: (nan,0,0) (0,2,0) (0,0,3)", "not finite"),
        ("space directions: (inf,0,0) (0,2,0) (0,0,3)", "not finite"),
        ("space directions: (1e300,1e300,0) (0,2,0) (0,0,3)", "not finite"),
        ("space directions: (0,0,0) (0,2,0) (0,0,3)", "voxels are 0 mm apart along i"),
        ("space directions: (0.0005,0,0) (0,2,0) (0,0,3)", "0.001 mm to 100 mm"),
        ("space directions: (1,0,0) (0,101,0) (0,0,3)", "voxels are 101 mm apart along j"),
        ("space directions: (1,0,0) (0,2,0) (1,2,0)", "in one plane"),
        ("space directions: (1,0,0) (0,2,0)", "a vector for each of three axes"),
        ("space directions: (1,0,0) (0,2,0) none", "a vector for each of three axes"),
        ("space directions: (1,0,0) (0,2) (0,0,3)", "is not `none` or a vector"),
        ("space directions: (1,0,0", "is not `none` or a vector"),
        ("space origin: (nan,0,0)", "volume:10: space origin: the origin is not within 1 km"),
        ("space origin: (1,0,0) (1,0,0)", "one vector"),
        ("-space directions:", "neither `space directions` nor `spacings`"),
        ("-space directions:\nspacings: 1 -1 1", "every spacing must be above 0"),
        ("-space directions:\nspacings: 1 nan 1", "not finite"),
        ("-space directions:\nspacings: 1 1", "3 numbers"),
        ("space: scanner-xyz", "not that of a patient"),
        ("space: right-anterior-superior-time", "with time"),
        ("space: LPST", "with time"),
        ("space units: \"inch\" \"mm\" \"mm\"", "not known here"),
        ("space units: \"mm\"", "a unit for every axis"),
        ("-space:\nspace dimension: 2", "`2` axes"),
        // As an older 3D Slicer wrote segmentations.
        (
            "-space:\nspace dimension: 4\nspace directions: (1,0,0,0) (0,1,0,0) (0,0,1,0) (0,0,0,1)",
            "a space of `4` axes",
        ),
        ("dimension: 2", "`2` axes"),
        ("-dimension:", "no `dimension`"),
        ("-type:", "no `type`"),
        ("type: block", "type `block`"),
        ("-encoding:", "no `encoding`"),
        ("encoding: zstd", "volume:10: encoding: the encoding `zstd`"),
        ("type: short\nsizes: 3 1 1\n-endian:", "no `endian`"),
        ("endian: middle", "`little` or `big`"),
        ("type: float\nsizes: 1 1 1\nendian: big", "voxel (0, 0, 0) has the value -132104.046875"),
        ("encoding: hex", "there are 6 bytes"),
        ("encoding: hex\nsizes: 3 1 1", "hexadecimal"),
        ("encoding: gzip", "ends after 0 of 6 values"),
        ("encoding: bz2", "cannot be unpacked"),
        ("encoding: ascii\nsizes: 3 1 1", "has the value `"),
        ("line skip: 3", "fewer lines"),
        ("byte skip: 7", "fewer bytes"),
        ("byte skip: -2", "or -1"),
        ("byte skip: -1\nencoding: ascii", "encoding raw alone"),
        ("type: uchar\ntype: uchar", "second time, first on line 10"),
        ("no colon", "no line of a header"),
        ("Segment0_Name:=a\nSegment0_LabelValue:=-1", "a label from 1 to 65535"),
        ("Segment0_Name:=a\nSegment0_LabelValue:=1\nSegment0_Layer:=1", "a layer from 0 to 0"),
        ("dimension: 4\nsizes: 3 2 1 1", "four entries"),
        ("dimension: 4\nsizes: 3 2 1 1\nspace directions: none (1,0,0) (0,2,0) none", "exactly one of four axes"),
        ("dimension: 4\nsizes: 3 2 1 1\nspace directions: (1,0,0) none (0,2,0) (0,0,3)", "four entries"),
        ("dimension: 4\nsizes: 0 3 2 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)", "layers"),
        ("dimension: 4\nsizes: 2 3 2 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)", "12 bytes"),
        ("dimension: 4\nsizes: 18446744073709551615 3 2 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)", "layers"),
        (
            "dimension: 4\nsizes: 3 2 2 2\nspace directions: none (1,0,0) (0,2,0) (0,0,3)\nkinds: RGB-color domain domain domain",
            "`RGB-color` holds no labels",
        ),
    ] {
        refused(&nrrd(lines, &[200, 1, 2, 3, 4, 5]), because);
    }
    refused(b"NRRD0006\n\n", "volume:1: `NRRD0006`");
    refused(b"NRRD0004\ntype: uchar", "no `dimension`");
    let open = nrrd("", b"");
    refused(&open[..open.len() - 1], "neither an empty line at its end nor a `data file`");
    refused(b"", "empty");
    refused(b"\0\0\0\0", "no volume of a format");
    refused(&gzip(&nrrd("", &SIX)), "no NIfTI volume");
    refused(b"{\"markups\": []}", "points");
}

#[test]
fn values_that_are_no_labels_are_refused() {
    let with = |kind: &str, data: Vec<u8>| nrrd(&format!("type: {kind}\nsizes: 2 1 1"), &data);
    refused(
        &with("short", [1_i16, -1].iter().flat_map(|v| v.to_le_bytes()).collect()),
        "voxel (1, 0, 0) has the value -1, which is no label",
    );
    refused(&with("int", [65535_i32, 65536].iter().flat_map(|v| v.to_le_bytes()).collect()), "has the value 65536");
    refused(
        &with("ulonglong", [1, u64::MAX].iter().flat_map(|v| v.to_le_bytes()).collect()),
        "has the value 18446744073709551615",
    );
    for value in [0.5, f64::NAN, -0.25, 65535.5, f64::INFINITY, 1e300] {
        refused(
            &with("double", [1.0, value].iter().flat_map(|v| v.to_le_bytes()).collect()),
            "voxel (1, 0, 0) has the value",
        );
    }
    refused(&nrrd("encoding: ascii\nsizes: 2 1 1", b"1 2.5"), "voxel (1, 0, 0) has the value `2.5`");
    refused(&nrrd("encoding: ascii\nsizes: 2 1 1", b"1       "), "ends after 1 of 2 values");
    assert_eq!(
        parse("v", &with("double", [-0.0, 65535.0_f64].iter().flat_map(|v| v.to_le_bytes()).collect()))
            .unwrap()
            .map
            .labels,
        [0, 65535]
    );
    refused(&nifti(put(112, &0.3_f32.to_le_bytes())), "voxel (1, 0, 0) has the value 0.3");
    let layers =
        nrrd("dimension: 4\nsizes: 2 1 1 1\ntype: int8\nspace directions: none (1,0,0) (0,2,0) (0,0,3)", &[0, 255]);
    refused(&layers, "voxel (0, 0, 0) of layer 1 has the value -1");
}

#[test]
fn nifti_that_cannot_be_is_refused() {
    let short = |value: i16| value.to_le_bytes();
    let float = |value: f32| value.to_le_bytes();
    for (at, value, because) in [
        (40, short(2).to_vec(), "dim: 2 axes"),
        (40, short(8).to_vec(), "dim: 8 axes"),
        (42, short(0).to_vec(), "0 x 2 x 1 voxels are none"),
        (42, short(-3).to_vec(), "an axis of -3 voxels"),
        (42, short(4).to_vec(), "360 bytes of values should stand here, but there are 358"),
        (42, [short(1000), short(1000), short(1000)].concat(), "more than the 300000000"),
        (40, [short(4), short(3), short(2), short(1), short(2)].concat(), "there are 2 volumes"),
        (70, short(128).to_vec(), "(128) are colours"),
        (70, short(32).to_vec(), "complex"),
        (70, short(-7).to_vec(), "not known"),
        (108, float(20.0).to_vec(), "byte 20"),
        (108, float(f32::NAN).to_vec(), "byte NaN"),
        (108, float(352.5).to_vec(), "byte 352.5"),
        (108, float(1e9).to_vec(), "should stand here"),
        (123, vec![4], "xyzt_units"),
        (280, float(f32::NAN).to_vec(), "srow_x, srow_y, srow_z: the step along i is not finite"),
        (280, float(0.0).to_vec(), "0 mm apart along i"),
        (284, float(1e30).to_vec(), "mm apart along j"),
        (292, float(f32::INFINITY).to_vec(), "origin"),
        (284, [float(2.0), float(0.0), float(10.0), float(0.0), float(0.0)].concat(), "in one plane"),
        (344, b"\0\0\0\0".to_vec(), "Analyze"),
        (344, b"ni1\0".to_vec(), "header of a pair must be named .hdr"),
        (344, b"n+2\0".to_vec(), "magic"),
    ] {
        refused(&nifti(put(at, &value)), because);
    }
    let pair = parse("a.hdr", &nifti(put(344, b"ni1\0"))).unwrap_err().to_string();
    assert!(pair.contains("`a.img`"), "{pair}");
    let scaled = |bytes: &mut Vec<u8>| put(112, &[float(1.0), float(f32::NAN)].concat())(bytes);
    refused(&nifti(scaled), "scl_inter");
    let without = |bytes: &mut Vec<u8>| {
        put(254, &[0, 0])(bytes);
        put(80, &float(f32::NAN))(bytes);
    };
    refused(&nifti(without), "pixdim: the step along i");
    let whole = gzip(&nifti(|_| {}));
    for cut in [2, 10, 40, whole.len() - 9, whole.len() - 1] {
        let error = parse("volume", &whole[..cut]).unwrap_err().to_string();
        assert!(error.contains("way out"), "{error}");
    }
    let mut damaged = whole.clone();
    let crc = damaged.len() - 6;
    damaged[crc] ^= 1;
    refused(&damaged, "cannot be unpacked");
}

#[test]
fn metaimages_that_cannot_be_are_refused() {
    for (lines, because) in [
        ("NDims = 2", "`2` axes"),
        ("ObjectType = Tube", "no image"),
        ("ElementNumberOfChannels = 3", "values per voxel"),
        ("DimSize = 1000 1000 1000", "volume:10: DimSize: 1000 x 1000 x 1000 voxels are more than"),
        ("DimSize = 3 2", "3 numbers must stand here"),
        ("DimSize = 3 2 1 1", "3 numbers must stand here"),
        ("DimSize = 3 0 1", "voxels are none"),
        ("DimSize = 3 2 2", "12 bytes of values"),
        ("ElementType = MET_OTHER", "type `MET_OTHER`"),
        ("ElementSpacing = 1 0 1", "above 0"),
        ("ElementSpacing = 1 nan 1", "not finite"),
        ("ElementSpacing = 1 1 200", "200 mm apart along k"),
        ("-ElementSpacing", "neither `ElementSpacing`"),
        (
            "TransformMatrix = 1 0 0 0 1 0 0 1 0",
            "volume:10: TransformMatrix: the directions of i, j, k lie in one plane",
        ),
        ("TransformMatrix = nan 0 0 0 1 0 0 0 1", "must have the length 1"),
        ("TransformMatrix = 1 0 0 0 1 0 0 0 2", "must have the length 1"),
        ("TransformMatrix = 1 0 0 0 1 0 0 0", "9 numbers must stand here"),
        ("Offset = inf 0 0", "volume:10: Offset: the origin"),
        ("BinaryData = Perhaps", "True or False"),
        ("CompressedData = True", "cannot be unpacked"),
        ("CompressedData = True\nBinaryData = False", "text that are compressed"),
        ("HeaderSize = 7", "fewer bytes"),
        ("HeaderSize = -2", "HeaderSize"),
        ("DistanceUnits = inch", "unit of length `inch`"),
        ("DimSize = 3 2 1\nDimSize = 3 2 1", "second time"),
        ("no line", "no line of a header"),
        ("-ElementDataFile", "no `ElementDataFile`"),
    ] {
        refused(&meta(lines, &[9, 9, 9, 9, 9, 9]), because);
    }
    refused(b"NDims = 3\n", "no `DimSize`");
}

/// Streams that unpack to more than is promised, and promises that no stream keeps.
#[test]
fn bombs_are_refused_before_they_go_off() {
    let bomb = vec![0; 40 << 20];
    refused(&nrrd("encoding: gzip", &gzip(&bomb)), "more values than");
    refused(&meta("CompressedData = True", &zlib(&bomb)), "more values than");
    refused(&gzip(&nifti(|bytes| bytes.extend(&bomb))), "more values than");
    for encoding in ["gzip", "bzip2"] {
        refused(&nrrd(&format!("encoding: {encoding}\nsizes: 1000 1000 300"), &gzip(&SIX)), "compressed bytes");
        refused(
            &nrrd(&format!("encoding: {encoding}\nbyte skip: 9000000000000000000"), &gzip(&SIX)),
            "compressed bytes",
        );
    }
    refused(&meta("CompressedData = True\nDimSize = 1000 1000 300", &zlib(&SIX)), "compressed bytes");
    refused(&gzip(&nifti(put(42, &[1000_i16, 1000, 300].map(i16::to_le_bytes).concat()))), "compressed bytes");
    let short = nrrd("encoding: gzip\nsizes: 3 3 1", &gzip(&SIX));
    refused(&short, "ends after 6 of 9 values");
}

#[test]
fn files_cut_short_anywhere_are_refused_or_read() {
    for (path, bytes) in fixtures() {
        let name = path.display().to_string();
        for end in 0..bytes.len() {
            match catch_unwind(|| parse(&name, &bytes[..end])) {
                Ok(Ok(_)) => assert!(end + 2 > bytes.len(), "{name}: taken with {end} of {} bytes", bytes.len()),
                Ok(Err(error)) => assert!(error.to_string().contains("way out"), "{error}"),
                Err(_) => panic!("{name}: panic with {end} of {} bytes", bytes.len()),
            }
        }
    }
}

#[test]
fn flipped_bytes_never_panic() {
    // xorshift64*: the same cases everywhere.
    let mut state = 0x5717_1e57_u64;
    let mut random = move |end: usize| {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as usize % end.max(1)
    };
    let mut points: Vec<(PathBuf, Vec<u8>)> = fixtures();
    let text = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = id,x,y,z,label\n1,1,2,3,\"a, b\"\n2,4,5,6,c\n";
    points.push(("points.fcsv".into(), text.into()));
    let text = "{\"markups\": [{\"coordinateSystem\": \"LPS\", \"controlPoints\": [{\"label\": \"a\", \"position\": [1.0, 2.0, 3.0]}]}]}";
    points.push(("points.mrk.json".into(), text.into()));
    for (path, whole) in points {
        let name = path.display().to_string();
        for case in 0..3000 {
            let mut bytes = whole.clone();
            for _ in 0..1 + random(4) {
                let reach = if random(2) == 0 { bytes.len() } else { bytes.len().min(400) };
                let at = random(reach);
                match random(3) {
                    0 => bytes[at] = random(256) as u8,
                    1 => bytes[at] ^= 1 << random(8),
                    _ => bytes[at] = b"0123456789-.e \n:=(),"[random(20)],
                }
            }
            let outcome = catch_unwind(|| match name.starts_with("points") {
                true => markups::parse(&name, &bytes).map(drop),
                false => parse(&name, &bytes).map(|labelled| {
                    let Labelled { map, .. } = labelled;
                    assert_eq!(map.labels.len(), map.size.iter().product::<usize>());
                    assert!(map.steps.is_finite() && map.steps.determinant() != 0.0 && map.origin.is_finite());
                    assert!(!map.orientation().contains('?'));
                    map.bounds();
                }),
            });
            match outcome {
                Ok(Ok(())) => {}
                Ok(Err(error)) => assert!(error.to_string().contains("way out"), "{error}"),
                Err(_) => panic!("{name}, case {case}: {}", String::from_utf8_lossy(&bytes)),
            }
        }
    }
}
