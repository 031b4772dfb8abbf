//! Readers of label volumes and points: files written by hand and files that other programs wrote.

mod by_hand;
mod refusals;

use glam::{DMat3, DVec3};
use stylet::anatomy::label_map::LabelMap;
use stylet::anatomy::{Labelled, markups, parse, read};

use self::by_hand::*;

/// A voxel, its place in RAS [mm] and its label.
type Voxel = ([usize; 3], [f64; 3], u16);

/// Files of SimpleITK 2.5.7 (`itk_`), pynrrd 1.1.3 (`pynrrd_`) and nibabel 5.4.2 (`nib`), and what the same program says of three voxels after
/// it has read the file again.
const TOLD: &[(&[&str], [Voxel; 3])] = &[
    (
        &[
            "itk_oblique.nrrd",
            "itk_oblique_n.nhdr",
            "itk_oblique.mha",
            "itk_oblique_m.mhd",
            "itk_oblique.nii.gz",
            "itk_oblique.nii",
            "itk_oblique_pair.hdr",
            "itk_zraw.mhd",
        ],
        [
            ([1, 0, 0], [11.897937, -33.534542, 101.215769], 3),
            ([5, 4, 3], [13.047131, -36.313241, 109.841787], 2),
            ([2, 3, 1], [13.343116, -35.954574, 104.327828], 1),
        ],
    ),
    (
        &[
            "itk_mirrored.nrrd",
            "itk_mirrored_n.nhdr",
            "itk_mirrored.mha",
            "itk_mirrored_m.mhd",
            "itk_mirrored.nii.gz",
            "itk_mirrored.nii",
            "itk_mirrored_pair.hdr",
        ],
        [
            ([1, 0, 0], [-4.000000, 6.000000, 7.000000], 900),
            ([5, 4, 3], [0.000000, -2.000000, 16.000000], 600),
            ([2, 3, 1], [-3.000000, 0.000000, 10.000000], 300),
        ],
    ),
    (
        &[
            "pynrrd_sheared_gzip.nrrd",
            "pynrrd_sheared_bzip2.nrrd",
            "pynrrd_sheared_ascii.nrrd",
            "pynrrd_sheared_raw.nrrd",
        ],
        [
            ([1, 0, 0], [2.300000, -2.400000, 3.500000], 3),
            ([5, 4, 3], [6.300000, 1.300000, 8.200000], 2),
            ([2, 3, 1], [3.700000, 0.300000, 5.150000], 1),
        ],
    ),
    (
        &["pynrrd_lps.nhdr"],
        [
            ([1, 0, 0], [-2.300000, 2.400000, 3.500000], 3),
            ([5, 4, 3], [-6.300000, -1.300000, 8.200000], 2),
            ([2, 3, 1], [-3.700000, -0.300000, 5.150000], 1),
        ],
    ),
    (
        &["nib1_sform.nii.gz"],
        [
            ([1, 0, 0], [-19.225920, 15.365840, 40.277417], 3),
            ([5, 4, 3], [-18.648088, 19.689796, 48.145830], 2),
            ([2, 3, 1], [-19.844034, 18.601200, 43.283158], 1),
        ],
    ),
    (
        &["nib1_qform_mirrored.nii"],
        [
            ([1, 0, 0], [-19.225920, 15.365840, 40.277417], 3),
            ([5, 4, 3], [-17.192953, 22.726342, 36.577409], 2),
            ([2, 3, 1], [-19.746029, 19.430462, 39.288309], 1),
        ],
    ),
    (
        &["nib2_both.nii.gz", "nib1_big.nii", "nib2_big.nii.gz", "nib1_pair.hdr"],
        [
            ([1, 0, 0], [-19.225920, 15.365840, 40.277417], 3),
            ([5, 4, 3], [-19.576985, 19.250788, 47.812929], 2),
            ([2, 3, 1], [-20.540706, 18.271944, 43.033483], 1),
        ],
    ),
    (
        &["nib1_scaled.nii.gz"],
        [
            ([1, 0, 0], [-19.225920, 15.365840, 40.277417], 15),
            ([5, 4, 3], [-19.576985, 19.250788, 47.812929], 11),
            ([2, 3, 1], [-20.540706, 18.271944, 43.033483], 7),
        ],
    ),
];

fn label(map: &LabelMap, [i, j, k]: [usize; 3]) -> u16 {
    map.labels[i + map.size[0] * (j + map.size[1] * k)]
}

#[test]
fn files_of_other_programs_stand_where_they_say() {
    for (names, voxels) in TOLD {
        for name in *names {
            let Labelled { map, .. } = read(&files().join(name)).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(map.size, [6, 5, 4], "{name}");
            assert_eq!(map.labels.len(), 120, "{name}");
            for (voxel, place, expected) in voxels {
                let place = DVec3::from_array(*place) / 1e3;
                let found = map.position(voxel[0], voxel[1], voxel[2]);
                assert!((found - place).length() < 1e-7, "{name}: {voxel:?} at {found}, not {place}");
                assert_eq!(label(&map, *voxel), *expected, "{name}: {voxel:?}");
                assert_eq!(map.label_at(place), *expected, "{name}: {voxel:?}");
            }
        }
    }
    let told: usize = TOLD.iter().map(|(names, _)| names.len()).sum();
    // Those with layers have their own test.
    assert_eq!(told + 2, fixtures().len());
}

#[test]
fn mirrored_volumes_stay_mirrored() {
    for name in ["itk_mirrored.nrrd", "itk_mirrored.mha", "itk_mirrored.nii.gz"] {
        let map = read(&files().join(name)).unwrap().map;
        assert!(map.steps.determinant() < 0.0, "{name}");
        assert_eq!(map.orientation(), "RPS", "{name}");
        assert_eq!(map.volumes().keys().copied().collect::<Vec<_>>(), [300, 600, 900], "{name}");
    }
    let map = read(&files().join("nib1_qform_mirrored.nii")).unwrap().map;
    assert!(map.steps.determinant() < 0.0);
}

#[test]
fn overlapping_layers_become_labels_of_their_own() {
    for name in ["pynrrd_layers.seg.nrrd", "pynrrd_layers_last.seg.nrrd"] {
        let Labelled { map, notices } = read(&files().join(name)).unwrap();
        let counts: Vec<(u16, usize)> = map.volumes().into_iter().map(|(label, (count, _))| (label, count)).collect();
        // pynrrd: 6 voxels of the liver and 1 of the rib are outside the tumour, which has 27.
        assert_eq!(counts, [(1, 6), (2, 1), (3, 27)], "{name}");
        let names: Vec<&str> = map.names.values().map(String::as_str).collect();
        assert_eq!(names, ["liver", "rib: left", "tumour"], "{name}");
        assert!(notices.iter().any(|notice| notice.contains("overlap in 8 voxels")), "{name}: {notices:?}");
        assert_eq!(map.position(1, 2, 3), DVec3::new(-0.0105, -0.021, 0.036), "{name}");
    }
}

#[test]
fn nrrd_of_every_encoding_type_and_byte_order() {
    let whole = six(&nrrd("", &SIX));
    assert!(whole.notices.is_empty(), "{:?}", whole.notices);
    assert_eq!(whole.map.position(2, 1, 0), DVec3::new(0.012, 0.022, 0.03));
    for (kind, little, big) in [
        ("short", six_as!(i16, to_le_bytes), six_as!(i16, to_be_bytes)),
        ("unsigned short int", six_as!(u16, to_le_bytes), six_as!(u16, to_be_bytes)),
        ("int32", six_as!(i32, to_le_bytes), six_as!(i32, to_be_bytes)),
        ("uint32_t", six_as!(u32, to_le_bytes), six_as!(u32, to_be_bytes)),
        ("signed long long", six_as!(i64, to_le_bytes), six_as!(i64, to_be_bytes)),
        ("ulonglong", six_as!(u64, to_le_bytes), six_as!(u64, to_be_bytes)),
        ("float", six_as!(f32, to_le_bytes), six_as!(f32, to_be_bytes)),
        ("double", six_as!(f64, to_le_bytes), six_as!(f64, to_be_bytes)),
    ] {
        for (endian, data) in [("little", little), ("big", big)] {
            let lines = format!("type: {kind}\nendian: {endian}");
            six(&nrrd(&lines, &data));
            six(&nrrd(&format!("{lines}\nencoding: GZIP"), &gzip(&data)));
            let digits: String = data.iter().map(|b| format!("{b:02x}\n")).collect();
            six(&nrrd(&format!("{lines}\nencoding: hex"), digits.as_bytes()));
            six(&nrrd(&format!("{lines}\nencoding: ascii"), b"0 1\n2 3, 4 250\n"));
        }
    }
    // Two streams one after the other are one.
    six(&nrrd("encoding: gz", &[gzip(&SIX[..2]), gzip(&SIX[2..])].concat()));
    let windows = String::from_utf8(nrrd("encoding: txt", b"0 1 2 3 4 250")).unwrap().replace('\n', "\r\n");
    six(windows.as_bytes());
    assert_eq!(parse("v", &nrrd("type: int8", &[0, 1, 2, 3, 4, 5])).unwrap().map.labels, [0, 1, 2, 3, 4, 5]);
}

#[test]
fn nrrd_skips_what_it_is_told_to() {
    six(&nrrd("line skip: 2", &[b"a\nb\n".as_slice(), &SIX].concat()));
    six(&nrrd("lineskip: 1\nbyte skip: 3", &[b"a\nxyz".as_slice(), &SIX].concat()));
    six(&nrrd("byteskip: -1", &[b"anything".as_slice(), &SIX].concat()));
    // Lines before unpacking, bytes after it.
    let packed = [b"a\n".as_slice(), &gzip(&[b"xyz".as_slice(), &SIX].concat())].concat();
    six(&nrrd("line skip: 1\nbyte skip: 3\nencoding: gzip", &packed));
    let misspelt = six(&nrrd("space orgin: (1,2,3)\nbyte  skip: 0", &SIX));
    assert_eq!(misspelt.notices, ["Line 11: the field `space orgin` is not known, and not heeded."]);
    let more = six(&nrrd("", &[SIX.as_slice(), b"behind"].concat()));
    assert!(more.notices[0].contains("more data"), "{:?}", more.notices);
}

#[test]
fn nrrd_spaces_units_and_shears() {
    let at = |lines: &str, voxel: [usize; 3]| six(&nrrd(lines, &SIX)).map.position(voxel[0], voxel[1], voxel[2]) * 1e3;
    let near = |found: DVec3, x: f64, y: f64, z: f64| assert!((found - DVec3::new(x, y, z)).length() < 1e-9, "{found}");
    near(at("space: left-posterior-superior", [2, 1, 0]), -12.0, -22.0, 30.0);
    near(at("space: LAS", [2, 1, 0]), -12.0, 22.0, 30.0);
    near(at("space directions: (0, 1, 0.5) (-2,1,0) (0,0,3)", [2, 1, 0]), 8.0, 23.0, 31.0);
    near(
        at("space units: \"cm\" \"mm\" \"um\"\nspace directions: (1,0,0) (0,2,0) (0,0,300)", [2, 1, 0]),
        120.0,
        22.0,
        0.03,
    );
    let metres = six(&nrrd(
        "space units: m m m\nspace origin: (0.1,0,0)\nspace directions: (0.001,0,0) (0,.002,0) (0,0,3e-3)",
        &SIX,
    ));
    near(metres.map.position(1, 1, 0) * 1e3, 101.0, 2.0, 0.0);
    assert!(metres.notices[0].contains("taken in m "), "{:?}", metres.notices);
    let lines = "-space directions:\n-space origin:\n-space:\nspacings: 0.1 0.2 0.3\nunits: \"cm\" \"cm\" \"cm\"";
    let plain = six(&nrrd(lines, &SIX));
    near(plain.map.position(2, 1, 0) * 1e3, -2.0, -2.0, 0.0);
    assert_eq!(plain.notices.len(), 4, "{:?}", plain.notices);
}

#[test]
fn nrrd_segments_have_names() {
    let pairs =
        "Segment0_Name:=skin\nSegment0_LabelValue:=4\nSegment0_Layer:=0\nSegment1_Name:=a: b\nSegment1_LabelValue:=250";
    let labelled = six(&nrrd(pairs, &SIX));
    assert_eq!(labelled.map.names.into_iter().collect::<Vec<_>>(), [(4, "skin".into()), (250, "a: b".into())]);
    // As 3D Slicer wrote it up to 4.10: a layer of zeros and ones for each segment, one of which lists nothing.
    let lines = "dimension: 4\nsizes: 3 3 2 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)\nSegment0_Name:=one\nSegment1_Name:=two";
    let data = [1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 0, 0, 0, 7, 0, 1, 1];
    let Labelled { map, notices } = parse("v", &nrrd(lines, &data)).unwrap();
    assert_eq!(map.labels, [1, 2, 2, 0, 3, 4]);
    assert_eq!(map.names.into_values().collect::<Vec<_>>(), ["one", "two"]);
    assert!(
        notices.iter().any(|n| n.starts_with("2 labels in its layers"))
            && notices.iter().any(|n| n.contains("in 2 voxels"))
    );
    // One entry on the fourth axis is no layer of its own.
    six(&nrrd("dimension: 4\nsizes: 3 2 1 1\nspace directions: (1,0,0) (0,2,0) (0,0,3) none", &SIX));
    six(&nrrd(
        "dimension: 4\nsizes: 1 3 2 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)\nkinds: vector domain domain domain",
        &SIX,
    ));
}

#[test]
fn detached_data_is_found_beside_its_header_alone() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    std::fs::write(inner.join("a.raw"), SIX).unwrap();
    std::fs::write(folder.path().join("a.raw"), SIX).unwrap();
    let path = inner.join("a.nhdr");
    for name in ["a.raw", "./a.raw"] {
        // Neither the empty line nor the last line end is needed here.
        let text = String::from_utf8(nrrd(&format!("data file: {name}"), b"")).unwrap();
        std::fs::write(&path, text.trim_end()).unwrap();
        assert_eq!(read(&path).unwrap().map.labels, SIX.map(u16::from));
        std::fs::write(&path, nrrd(&format!("datafile: {name}\nbyte skip: -1"), b"")).unwrap();
        assert_eq!(read(&path).unwrap().map.labels, SIX.map(u16::from));
    }
    let absolute = inner.join("a.raw").display().to_string();
    for name in [
        "../a.raw",
        absolute.as_str(),
        "inner/a.raw",
        "..",
        ".",
        "..\\a.raw",
        "c:a.raw",
        "b.raw",
        "a%d.raw 1 2 1",
        "LIST",
    ] {
        std::fs::write(&path, nrrd(&format!("data file: {name}"), b"")).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("data") && error.contains("way out"), "{error}");
        std::fs::write(&path, meta(&format!("ElementDataFile = {name}"), b"")).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("data") && error.contains("way out"), "{error}");
    }
    std::fs::write(&path, meta("ElementDataFile = a.raw", b"")).unwrap();
    assert_eq!(read(&path).unwrap().map.labels, SIX.map(u16::from));
    let error = parse("a.nhdr", &nrrd("data file: a.raw", b"")).unwrap_err().to_string();
    assert!(error.contains("`a.raw`, which is not at hand"), "{error}");
}

#[test]
fn nifti_forms_units_and_scales() {
    let whole = six(&nifti(|_| {}));
    assert!(whole.notices.is_empty(), "{:?}", whole.notices);
    assert_eq!(whole.map.position(2, 1, 0), DVec3::new(0.012, 0.022, 0.03));
    six(&gzip(&nifti(|_| {})));
    let near = |bytes: &[u8], x: f64, y: f64, z: f64| {
        let labelled = six(bytes);
        let found = labelled.map.position(2, 1, 0) * 1e3;
        assert!((found - DVec3::new(x, y, z)).length() < 1e-5, "{found}");
        labelled.notices
    };
    // No form at all.
    let notices = near(&nifti(put(254, &[0, 0])), 2.0, 2.0, 0.0);
    assert!(notices[0].contains("neither sform nor qform"), "{notices:?}");
    // A quarter turn about z, mirrored; then half a turn about x whose parts are rounded.
    let half = 0.5_f32.sqrt().to_le_bytes();
    let quarter = |bytes: &mut Vec<u8>| {
        put(252, &[1, 0, 0, 0])(bytes);
        put(264, &half)(bytes);
        put(76, &(-1.0_f32).to_le_bytes())(bytes);
        put(268, &5_f32.to_le_bytes())(bytes);
    };
    assert!(near(&nifti(quarter), 3.0, 2.0, 0.0).is_empty());
    assert!(six(&nifti(quarter)).map.steps.determinant() < 0.0);
    let turned = |bytes: &mut Vec<u8>| {
        put(252, &[1, 0, 0, 0])(bytes);
        put(256, &1.000_000_1_f32.to_le_bytes())(bytes);
    };
    near(&nifti(turned), 2.0, -2.0, 0.0);
    // Both forms, apart.
    let notices = near(&nifti(put(252, &[1, 0])), 12.0, 22.0, 30.0);
    assert!(notices[0].contains("up to 37.4 mm apart; sform is taken"), "{notices:?}");
    let notices = near(&nifti(put(123, &[0])), 12.0, 22.0, 30.0);
    assert!(notices[0].contains("no unit"), "{notices:?}");
    // Metres are 100 mm at most, micrometres 1 at least.
    let wide = |bytes: &mut Vec<u8>| {
        put(123, &[1])(bytes);
        for (at, value) in [(280, 0.001_f32), (300, 0.002), (320, 0.003), (292, 0.01), (308, 0.02), (324, 0.03)] {
            put(at, &value.to_le_bytes())(bytes);
        }
    };
    near(&nifti(wide), 12.0, 22.0, 30.0);
    near(&nifti(put(123, &[3 + 8])), 0.012, 0.022, 0.03);
    // 2 v + 4, then nothing as its factor is 0.
    let scaled = |bytes: &mut Vec<u8>| {
        put(112, &2_f32.to_le_bytes())(bytes);
        put(116, &4_f32.to_le_bytes())(bytes);
    };
    assert_eq!(parse("v", &nifti(scaled)).unwrap().map.labels, [4, 6, 8, 10, 12, 504]);
    six(&nifti(put(116, &4_f32.to_le_bytes())));
    // A factor of 1/255 on what was multiplied by 255.
    let fine = |bytes: &mut Vec<u8>| {
        put(112, &(1.0 / 255.0_f32).to_le_bytes())(bytes);
        bytes.truncate(352);
        bytes.extend([0, 255, 0, 0, 0, 255]);
    };
    assert_eq!(parse("v", &nifti(fine)).unwrap().map.labels, [0, 1, 0, 0, 0, 1]);
    // Extensions before the data are stepped over.
    let extended = |bytes: &mut Vec<u8>| {
        put(108, &368_f32.to_le_bytes())(bytes);
        put(348, &[1])(bytes);
        bytes.splice(352..352, [16, 0, 0, 0, 6, 0, 0, 0, 9, 9, 9, 9, 9, 9, 9, 9]);
    };
    six(&nifti(extended));
    six(&gzip(&nifti(extended)));
}

#[test]
fn nifti_tables_behind_the_header_name_labels() {
    let extended = |text: &str| {
        // Of a length that is a multiple of 16, as the format wants it, filled with zeros.
        let length = (8 + text.len()).next_multiple_of(16);
        let mut extension = [(length as i32).to_le_bytes(), 0_i32.to_le_bytes()].concat();
        extension.extend(text.bytes());
        extension.resize(length, 0);
        nifti(|bytes| {
            put(108, &(352.0 + length as f32).to_le_bytes())(bytes);
            put(348, &[1])(bytes);
            bytes.splice(352..352, extension.iter().copied());
        })
    };
    // As TotalSegmentator writes it.
    let table = "<?xml version=\"1.0\" encoding=\"UTF-8\"?> <CaretExtension>  <VolumeInformation Index=\"0\">   <LabelTable>\n\
        <Label Key=\"0\" Red=\"0\"><![CDATA[background]]></Label>\n<Label Key=\"1\" Red=\"0.0\"><![CDATA[spleen]]></Label>\n\
        <Label Key=\"2\"><![CDATA[kidney_right]]></Label><Label Key=\"70000\">beyond</Label><Label>none</Label>\n\
        </LabelTable>  </VolumeInformation></CaretExtension>";
    for bytes in [extended(table), gzip(&extended(table))] {
        let Labelled { map, notices } = six(&bytes);
        let names: Vec<(u16, &str)> = map.names.iter().map(|(label, name)| (*label, name.as_str())).collect();
        assert_eq!(names, [(1, "spleen"), (2, "kidney_right")]);
        assert!(notices.is_empty(), "{notices:?}");
    }
    // A table that is damaged is told and does no harm, nor does what is no table.
    let cut = six(&extended(&table[..table.len() - 30]));
    assert!(cut.map.names.is_empty() && cut.notices[0].contains("table of names"), "{:?}", cut.notices);
    let entities = table.replace("?> ", "?><!DOCTYPE x [<!ENTITY e \"eeee\">]>");
    assert!(six(&extended(&entities)).notices[0].contains("left out"));
    let crowded = table.replace("Index", &(0..200).map(|n| format!("a{n}=\"\" ")).collect::<String>());
    assert!(six(&extended(&crowded)).notices[0].contains("attributes"));
    assert!(six(&extended("<other/>")).notices.is_empty());
    // A length beyond the voxels.
    let mut bytes = extended(table);
    put(352, &i32::MAX.to_le_bytes())(&mut bytes);
    assert!(six(&bytes).map.names.is_empty());
}

#[test]
fn metaimages_by_hand() {
    let whole = six(&meta("", &SIX));
    assert!(whole.notices.is_empty(), "{:?}", whole.notices);
    assert_eq!(whole.map.position(2, 1, 0), DVec3::new(-0.012, -0.022, 0.03));
    assert_eq!(whole.map.orientation(), "LPS");
    six(&meta("CompressedData = True\nCompressedDataSize = 14", &zlib(&SIX)));
    six(&meta("CompressedData = True", &gzip(&SIX)));
    six(&meta("BinaryData = False", b"0 1 2\n3 4 250\n"));
    six(&meta("ElementType = MET_USHORT\nElementByteOrderMSB = True", &six_as!(u16, to_be_bytes)));
    six(&meta("ElementType = MET_FLOAT\nBinaryDataByteOrderMSB = False", &six_as!(f32, to_le_bytes)));
    six(&meta("ElementType = MET_LONG_LONG\nBinaryDataByteOrderMSB = True", &six_as!(i64, to_be_bytes)));
    six(&meta("HeaderSize = -1", &[b"before".as_slice(), &SIX].concat()));
    six(&meta("HeaderSize = 4", &[b"four".as_slice(), &SIX].concat()));
    six(&meta("-ObjectType", &SIX));
    // The rows of the matrix are the directions of i, j, k.
    let turned = six(&meta("TransformMatrix = 0 1 0 0.6 0 0.8 -0.8 0 0.6", &SIX)).map;
    let j = DVec3::new(-1.2, 0.0, 1.6) / 1e3;
    assert!(
        (turned.steps - DMat3::from_cols(DVec3::new(0.0, -1e-3, 0.0), j, DVec3::new(2.4, 0.0, 1.8) / 1e3))
            .abs_diff_eq(DMat3::ZERO, 1e-12)
    );
    let old = six(&meta(
        "-Offset\n-TransformMatrix\n-ElementSpacing\nElementSize = 1 2 3\nPosition = 1 2 3\nOrientation = -1 0 0 0 1 0 0 0 1",
        &SIX,
    ));
    assert!((old.map.position(1, 0, 0) * 1e3 - DVec3::new(0.0, -2.0, 3.0)).length() < 1e-12 && old.notices.is_empty());
    assert_eq!(six(&meta("-Offset\n-TransformMatrix", &SIX)).notices.len(), 2);
}

#[test]
fn points_are_read_in_ras() {
    let point = |label: &str, x: f64, y: f64, z: f64| markups::MarkupPoint {
        label: label.into(),
        position: DVec3::new(x, y, z),
    };
    let json = |system: &str, units: &str| {
        format!(
            "{{\"@schema\": \"x\", \"markups\": [{{\"type\": \"Fiducial\", \"coordinateSystem\": {system}, \"coordinateUnits\": {units},
             \"controlPoints\": [{{\"id\": \"1\", \"label\": \"entry, \\u00e4\", \"position\": [1.0, -2.5, 3], \"positionStatus\": \"defined\"}},
             {{\"id\": \"2\", \"label\": \"unset\", \"position\": [0.0, 0.0, 0.0], \"positionStatus\": \"undefined\"}},
             {{\"position\": [4, 5, 6]}}]}}]}}"
        )
    };
    for (system, sign) in [("\"LPS\"", -1.0), ("\"RAS\"", 1.0), ("1", -1.0), ("0", 1.0), ("\"0\"", 1.0), ("null", -1.0)]
    {
        let expected =
            [point("entry, \u{e4}", sign * 0.001, sign * -0.0025, 0.003), point("", sign * 0.004, sign * 0.005, 0.006)];
        assert_eq!(markups::parse("p", json(system, "\"mm\"").as_bytes()).unwrap(), expected);
    }
    assert_eq!(markups::parse("p", json("\"RAS\"", "\"cm\"").as_bytes()).unwrap()[1], point("", 0.04, 0.05, 0.06));
    let table = |system: &str| {
        format!(
            "# Markups fiducial file version = 4.11\n# CoordinateSystem = {system}\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n\
             1,1.0,-2.5,3,0,0,0,1,1,1,0,\"entry, \"\"a\"\"\",,\nvtkMRML_2,4,5,6,0,0,0,1,1,1,0,target,,,2,0\n"
        )
    };
    for (system, sign) in [("LPS", -1.0), ("RAS", 1.0), ("0", 1.0), ("1", -1.0)] {
        let expected = [
            point("entry, \"a\"", sign * 0.001, sign * -0.0025, 0.003),
            point("target", sign * 0.004, sign * 0.005, 0.006),
        ];
        assert_eq!(markups::parse("p", table(system).as_bytes()).unwrap(), expected);
    }
    for (wrong, because) in [
        (json("\"IJK\"", "\"mm\""), "coordinate system `IJK`"),
        (json("\"LPS\"", "\"inch\""), "unit of length `inch`"),
        (json("\"LPS\"", "\"mm\"").replace("[4, 5, 6]", "[4, 5]"), "no position of three numbers"),
        (json("\"LPS\"", "\"mm\"").replace("[4, 5, 6]", "[4, 5, 1e99]"), "within 1 km"),
        ("{\"markups\": 3}".into(), "no markups of 3D Slicer"),
        (table("2"), "p:2: the coordinate system `2`"),
        (table("LPS").replace("CoordinateSystem", "Nothing"), "CoordinateSystem"),
        (table("LPS").replace("id,x,y", "id,x,q"), "columns x, y and z"),
        (table("LPS").replace("4,5,6", "4,nan,6"), "p:5: point `target`"),
        (table("LPS").replace("4,5,6", "4,five,6"), "p:5: x, y and z"),
        (" ".into(), "empty"),
        ("x,y,z".into(), "neither"),
    ] {
        let error = markups::parse("p", wrong.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(because) && error.contains("way out"), "{because}: {error}");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.fcsv"), table("LPS")).unwrap();
    assert_eq!(markups::read(&folder.path().join("p.fcsv")).unwrap().len(), 2);
    assert!(markups::read(&folder.path().join("q.fcsv")).unwrap_err().to_string().contains("way out"));
}
