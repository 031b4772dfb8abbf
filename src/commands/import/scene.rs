//! A scene around a planned line: regions from labels by their names, a toughness where the library has none.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use glam::DVec3;

use super::content::{Labels, utf8};
use super::line::Course;
use super::materials::{self, FALLBACK, Kind, Matched};
use super::placed;
use super::text;
use crate::anatomy::write_nrrd;
use crate::error::{Error, Result};
use crate::needle::NeedleShape;
use crate::reading;
use crate::scene::needles;
use crate::units;
use crate::whole_file;

/// Width of the block, and its depth over that of the path, as scenes have them by default [m].
const WIDTH: f64 = 40e-3;
const DEPTH_OVER_PATH: f64 = 1.5;
/// How far the block may reach above the skin [m].
const ABOVE: f64 = 20e-3;
/// Step at which the labels of the block are looked for [m].
const STEP: f64 = 1e-3;
/// Most regions: the shaders hold 16 materials, and one is the tissue's own.
const MOST_REGIONS: usize = 15;
/// Diameter of a needle that the table of gauges does not have [m].
const UNKNOWN_DIAMETER: f64 = 1.651e-3;
/// Toughness where the library has none [J/m^2]: of bovine liver under needles [Gokgol2012], and of what gives way at once.
const TOUGHNESS: f64 = 164.0;
const TOUGHNESS_OF_LIQUIDS: f64 = 1.0;
/// Largest J_c/(mu R): with their measured toughness the softest tissues, whose laws know small strain only, are dented by a centimetre and
/// more before they give way. Muscle under a 16G needle has 7.3.
const MOST_RELATIVE: f64 = 8.0;
/// Presets that stand for liquids.
const LIQUIDS: [&str; 2] = ["csf", "blood"];
/// Edge of the cells over the diameter of the needle, up to which forces are those of fine cells (`stylet check`).
const EDGE_OVER_DIAMETER: f64 = 0.9;
/// Speed of the needle [mm/s].
const SPEED: f64 = 5.0;

/// Labels of one material.
struct Group {
    matched: Matched,
    labels: Vec<u16>,
    /// Steps of the block that they fill.
    count: usize,
    on_line: bool,
}

/// The stem of a file name without the endings of volumes (`.seg.nrrd`, `.nii.gz`), plain enough for a name.
pub fn stem(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut stem = name.as_str();
    for end in [
        ".gz", ".nii", ".nrrd", ".seg", ".mha", ".mhd", ".nhdr", ".stl", ".obj", ".ply", ".vtp", ".vtk", ".vtu",
        ".msh", ".toml", ".inp",
    ] {
        let cut = stem.len().checked_sub(end.len()).filter(|at| *at > 0 && stem.is_char_boundary(*at));
        if let Some(at) = cut.filter(|at| stem[*at..].eq_ignore_ascii_case(end)) {
            stem = &stem[..at];
        }
    }
    let plain: String = stem.chars().map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' }).collect();
    if plain.is_empty() { "scene".into() } else { plain }
}

/// Writes the scene, and the label map beside it where the file is none; `replace`: over one that is there.
///
/// # Errors
/// Where it cannot be written.
pub fn write(path: &Path, file: &Path, labels: &Labels, course: &Course, gauge: &str, replace: bool) -> Result<()> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|source| Error::file(folder, source))?;
    }
    let map = match labels.in_file {
        true => relative(file, path),
        false => {
            let name = format!("{}_labels.nrrd", stem(path));
            let map = path.with_file_name(&name);
            if map.exists() && !replace {
                return Err(Error::input(
                    format!("{} exists", map.display()),
                    "give another name with --scene, or replace both with --force",
                ));
            }
            let comment =
                format!("label map made by stylet import of {}", text::name(&file.display().to_string(), 200));
            whole_file::write(&map, &write_nrrd::label_map(&labels.map, &[comment]))?;
            PathBuf::from(name)
        }
    };
    whole_file::write(
        path,
        scene((&utf8(&map)?, &placed::line(&labels.placement)), file, course, gauge, labels.renamed).as_bytes(),
    )
}

/// The path of a file from the folder of the scene: relative where it lies there or below, else from the root.
fn relative(file: &Path, scene: &Path) -> PathBuf {
    let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if reading::is_built_in(file) {
        // It is found from where the program runs: out of the folder of the scene.
        let ups = folder.components().filter(|part| matches!(part, Component::Normal(_))).count();
        return std::iter::repeat_n(Path::new(".."), ups).collect::<PathBuf>().join(file);
    }
    let (Ok(file), Ok(folder)) = (file.canonicalize(), folder.canonicalize()) else { return file.to_path_buf() };
    file.strip_prefix(&folder).map(Path::to_path_buf).unwrap_or(file)
}

/// Text of the scene; `map`: the file and the line that places it, `by_number`: it does not have the names of its labels.
fn scene((map, transform): (&str, &str), file: &Path, course: &Course, gauge: &str, by_number: bool) -> String {
    let needle = needles::needle(gauge).map_or(UNKNOWN_DIAMETER, |needle| needle.outer_diameter);
    let path = course.length;
    let title = format!("needle to a target in {}", stem(file));
    // Twenty cells to the target, 0.5 to 1 mm, and no coarser than the needle asks for.
    let cell = (path / 20.0).min(EDGE_OVER_DIAMETER * needle).clamp(0.5e-3, 1e-3);
    let cell = (cell * 1e4).round() / 10.0;
    let mut all = format!(
        "# Made by `stylet import`; every line may be changed. Materials are those of assets/materials.toml, taken by the names of\n\
         # labels. Forces follow from elastic constants, toughness and needle; no force is written. A toughness marked `choice` is no\n\
         # measurement of that tissue: 164 J/m^2 is that of bovine liver under needles, liquids have 1, and the softest tissues no more\n\
         # than 8 times shear modulus times radius of the needle. Scenes are for research and training, not for treatment.\n\
         title = {}\n\
         effects = [\"puncture\", \"friction\", \"mass_scaling\"]\n\n\
         [tissue]\n\
         labels = {}\n{transform}\
         cell_size_mm = {cell}\n",
        quoted(&title),
        quoted(map)
    );
    // Air is no tissue; where the line runs through it something has to stand for it.
    let (air, groups): (Vec<Group>, Vec<Group>) =
        groups(course).into_iter().partition(|group| group.matched.kind == Kind::Air && !group.on_line);
    let outside: Vec<String> =
        air.iter().flat_map(|group| &group.labels).map(|label| entry(*label, course, by_number)).collect();
    if !outside.is_empty() {
        all += &format!("# No tissue.\noutside = [{}]\n", outside.join(", "));
    }
    all += "\n";
    let (own, regions) = split(groups);
    all += &own_material(&own, course, 0.5 * needle);
    for group in &regions {
        all += &region(group, course, 0.5 * needle, by_number);
    }
    all += "[puncture]\nscheme = \"opening\"\n\n";
    all += &format!(
        "[needle]\ngauge = {}\ntip_length_mm = {:.1}\n\n",
        quoted(gauge),
        // A cone of 18 degrees.
        NeedleShape::cone(gauge, 0.5 * needle, needle * 1.54).tip_length * 1e3
    );
    let point = |x: DVec3| {
        let [x, y, z] = (x * 1e3).to_array().map(|x| (x * 1e3).round() / 1e3 + 0.0);
        format!("[{x}, {y}, {z}]")
    };
    all += &crossings_comment(course);
    all += &format!(
        "[motion]\nentry_ras_mm = {}\ntarget_ras_mm = {}\n\n[[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = {SPEED}\n\n",
        point(course.line.entry),
        point(course.line.target)
    );
    all += "[solver]\nmass_scaling = \"auto\"\n\n";
    let depth = |part: f64| (path * part * 1e4).floor() / 10.0;
    all += &format!(
        "[outputs]\npictures_at_depth_mm = [{}, {}]\n\
         # Displacement field and deformed label map for 3D Slicer:\n# volumes_at_depth_mm = [{}]\n",
        depth(0.5),
        depth(1.0),
        depth(1.0)
    );
    all
}

/// The material of the tissue where no region is, and which labels have it.
fn own_material(own: &Own, course: &Course, radius: f64) -> String {
    let mut all = String::new();
    if own.known.is_empty() && own.unknown.is_empty() {
        all += "# No label in the block has this material.\n";
    }
    for (labels, what) in [
        (&own.known, "Muscle"),
        (&own.unknown, "Not known by name, so taken for muscle; give each a region of its own if it is another tissue"),
        (&own.many, "Taken for muscle, since a scene has at most 15 regions"),
    ] {
        if !labels.is_empty() {
            let names: Vec<String> = labels.iter().map(|label| course.label_name(*label)).collect();
            let sentence = format!("# {what}: {}.", names.join(", "));
            all += &format!("{}\n", text::wrapped(&sentence, 0).replace('\n', "\n# "));
        }
    }
    let muscle = materials::of_label(None);
    let toughness = toughness(&muscle, radius).map_or(String::new(), |j| format!("toughness_j_m2 = {j} # choice\n"));
    all + &format!("[material]\npreset = {}\n{toughness}\n", quoted(&muscle.preset.name))
}

/// What a scene has to say of the toughness of a material [J/m^2]; `None`: the library knows it.
fn toughness(matched: &Matched, radius: f64) -> Option<f64> {
    let preset = matched.preset;
    if matched.kind == Kind::Air || LIQUIDS.contains(&preset.name.as_str()) {
        return Some(TOUGHNESS_OF_LIQUIDS);
    }
    let most = units::significant(MOST_RELATIVE * preset.law.shear_modulus() * radius, 2);
    match preset.toughness {
        Some(known) if known <= most => None,
        known => Some(known.unwrap_or(TOUGHNESS).min(most)),
    }
}

/// Labels that have the scene's own material.
#[derive(Default)]
struct Own {
    known: Vec<u16>,
    unknown: Vec<u16>,
    many: Vec<u16>,
}

/// What is muscle, and the groups that become regions: those on the line first, then the largest.
fn split(groups: Vec<Group>) -> (Own, Vec<Group>) {
    let mut own = Own::default();
    let mut regions = Vec::new();
    for group in groups {
        match group.matched.kind {
            Kind::Unknown => own.unknown.extend(group.labels),
            _ if group.matched.preset.name == FALLBACK => own.known.extend(group.labels),
            _ => regions.push(group),
        }
    }
    regions.sort_by_key(|group| (!group.on_line, std::cmp::Reverse(group.count)));
    let many = regions.split_off(regions.len().min(MOST_REGIONS));
    own.many = many.into_iter().flat_map(|group| group.labels).collect();
    (own, regions)
}

/// The labels in the block around the line, by material.
fn groups(course: &Course) -> Vec<Group> {
    let mut counts = BTreeMap::<u16, usize>::new();
    let along = |length: f64| (length / STEP).ceil() as i64;
    let half = along(0.5 * WIDTH);
    for k in -along(course.length * DEPTH_OVER_PATH)..=along(ABOVE) {
        for (i, j) in (-half..=half).flat_map(|i| (-half..=half).map(move |j| (i, j))) {
            let at = DVec3::new(i as f64, j as f64, k as f64) * STEP;
            *counts.entry(course.case.label_at(at)).or_default() += 1;
        }
    }
    for crossing in &course.crossings {
        *counts.entry(crossing.label).or_default() += 1;
    }
    counts.remove(&0);
    let mut groups: Vec<Group> = Vec::new();
    for (label, count) in counts {
        let matched = materials::of_label(course.case.map.names.get(&label).map(String::as_str));
        let on_line = course.crossings.iter().any(|crossing| crossing.label == label);
        let same = |group: &&mut Group| {
            (&group.matched.preset.name, group.matched.kind) == (&matched.preset.name, matched.kind)
        };
        match groups.iter_mut().find(same) {
            Some(group) => {
                group.labels.push(label);
                group.count += count;
                group.on_line |= on_line;
            }
            None => groups.push(Group { matched, labels: vec![label], count, on_line }),
        }
    }
    groups
}

/// A table of a region.
fn region(group: &Group, course: &Course, radius: f64, by_number: bool) -> String {
    let preset = group.matched.preset;
    let entries: Vec<String> = group.labels.iter().map(|label| entry(*label, course, by_number)).collect();
    let labels = match entries.as_slice() {
        [one] => one.clone(),
        // One on a line where there are many.
        several if several.len() > 4 => format!("[\n    {},\n]", several.join(",\n    ")),
        several => format!("[{}]", several.join(", ")),
    };
    let name = if group.matched.kind == Kind::Air { "air" } else { preset.name.as_str() };
    let mut table = format!("[[region]]\nname = {}\nlabel = {labels}\n", quoted(name));
    if by_number {
        let names: Vec<String> = group.labels.iter().map(|label| course.label_name(*label)).collect();
        table += &format!("# {}\n", text::wrapped(&names.join(", "), 0).replace('\n', "\n# "));
    }
    if group.matched.is_rigid() {
        return table + "rigid = true\n\n";
    }
    if group.matched.kind == Kind::Air {
        table += "# The line runs through air: a material that gives way at once stands for it.\n";
    }
    let preset = quoted(&preset.name);
    match toughness(&group.matched, radius) {
        None => table + &format!("material = {{ preset = {preset} }}\n\n"),
        Some(j) => table + &format!("material = {{ preset = {preset}, toughness_j_m2 = {j} }} # choice\n\n"),
    }
}

/// How a scene names a label: by its name where that is its own and plain, else by its number.
fn entry(label: u16, course: &Course, by_number: bool) -> String {
    if by_number {
        return format!("{label}");
    }
    let names = &course.case.map.names;
    let own = names.get(&label).filter(|name| {
        let same = names.values().filter(|other| other.eq_ignore_ascii_case(name)).count();
        same == 1 && !name.trim().is_empty() && name.len() < 80 && !name.chars().any(char::is_control)
    });
    own.map_or(label.to_string(), |name| quoted(name))
}

/// What the line crosses, as comments.
fn crossings_comment(course: &Course) -> String {
    let stretches = course.crossings.iter().map(|crossing| {
        let (from, to) = (crossing.from * 1e3, crossing.to * 1e3);
        format!("{} {from:.1}-{to:.1}", course.label_name(crossing.label))
    });
    let crossed: Vec<String> = stretches.collect();
    let sentence = format!("# Crossed, mm below the skin: {}.", crossed.join(", "));
    format!("{}\n", text::wrapped(&sentence, 0).replace('\n', "\n# "))
}

/// A text of TOML.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted += &format!("\\u{:04X}", c as u32),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_are_plain() {
        for (file, expected) in [
            ("a/lumbar.nrrd", "lumbar"),
            ("Case 7.seg.nrrd", "Case_7"),
            ("brain.nii.gz", "brain"),
            ("x.y.stl", "x_y"),
            (".nrrd", "_nrrd"),
        ] {
            assert_eq!(stem(Path::new(file)), expected, "{file}");
        }
    }

    #[test]
    fn texts_are_quoted_as_toml_reads_them() {
        for text in ["plain", "a \"b\" \\ c", "two\nlines\u{7f}", "\u{e9}\u{4e2d}"] {
            let table: toml::Table = toml::from_str(&format!("x = {}", quoted(text))).unwrap();
            assert_eq!(table["x"].as_str(), Some(text));
        }
    }
}
