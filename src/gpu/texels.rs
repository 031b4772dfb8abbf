//! Arrays that lie in textures, for an adapter that reads storage buffers badly.
//!
//! llvmpipe loads from a storage buffer in a loop over the lanes of a vector, component by component: 7 ns for each of them on a
//! processor without AVX-512, which was two thirds of the time of a step. Its loads from storage textures are unrolled gathers: 0.8 ns.
//! (Measured with Mesa 22.3.6, eight lanes; storing costs 2.5 ns in a buffer and 3-5 ns in a texture.) So the arrays that every step
//! reads lie in textures of one number per texel there, and shaders are rewritten to match; on other adapters nothing changes.
//! The texels of a texture, row by row, are the numbers of the array: copies and checkpoints do not know the difference.

use super::arrays::{self, Place};

/// Bytes in a row of such a texture.
const ROW: u64 = 32768;

/// Where the array of this name lies; in a buffer what no entry knows.
fn place(name: &str) -> Place {
    arrays::find(name).map_or(Place::Buffer, |array| array.place)
}

/// How a rewritten shader reads what steps change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// By storage textures: compute shaders.
    Storage,
    /// By sampled textures: shaders that draw, whose vertices must not bind storage that can be written.
    Sampled,
}

/// Format of an array's texture: the bits of its numbers.
pub fn format_of(numbers_per_texel: u64) -> wgpu::TextureFormat {
    if numbers_per_texel == 4 { wgpu::TextureFormat::Rgba32Uint } else { wgpu::TextureFormat::R32Uint }
}

/// The source with its arrays in textures. Line n of it is line n of `source`.
///
/// Known are declarations of the form `@group(G) @binding(B) var<storage, ACCESS> NAME: array<TYPE>;` on a line of their own, `TYPE` a
/// number of 32 bits, a vec4 of them, or a struct of such members whose size is one of whole vectors; uses `NAME[INDEX]` anywhere, and
/// `NAME[INDEX] = VALUE;`, `NAME[INDEX] += VALUE;`, the same with a member.
pub fn rewritten(source: &str, access: Access) -> String {
    let lines: Vec<String> =
        source.lines().map(|line| declaration(source, line, access).unwrap_or(line.into())).collect();
    let text = with_calls(&lines.join("\n"));
    if source.ends_with('\n') { text + "\n" } else { text }
}

/// A member of an entry, or the entry itself: name, type, how many numbers lie before it and in it.
struct Member<'a> {
    name: &'a str,
    kind: &'a str,
    first: u64,
    count: u64,
}

fn numbers_in(kind: &str) -> Option<u64> {
    match kind {
        "f32" | "i32" | "u32" => Some(1),
        "vec4<f32>" | "vec4<i32>" | "vec4<u32>" => Some(4),
        _ => None,
    }
}

/// What an entry of this type consists of.
fn members<'a>(source: &'a str, kind: &'a str) -> Option<Vec<Member<'a>>> {
    if let Some(count) = numbers_in(kind) {
        return Some(vec![Member { name: "", kind, first: 0, count }]);
    }
    let (_, body) = source.split_once(&format!("struct {kind} {{"))?;
    let (body, _) = body.split_once('}')?;
    let mut first = 0;
    body.lines()
        .map(|line| line.trim().trim_end_matches(','))
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .map(|line| {
            let (name, kind) = line.split_once(": ")?;
            let count = numbers_in(kind)?;
            first += count;
            Some(Member { name, kind, first: first - count, count })
        })
        .collect()
}

/// The declaration of a texture and of the functions that stand for the array, where the line declares one of the arrays.
fn declaration(source: &str, line: &str, access: Access) -> Option<String> {
    let (place, rest) = line.split_once("var<storage, ")?;
    let (mode, rest) = rest.split_once("> ")?;
    let (name, kind) = rest.strip_suffix(';')?.split_once(": ")?;
    if let (Place::Uniform(count), "read") = (self::place(name), mode) {
        let kind = match (count, kind.strip_suffix('>')) {
            (Some(count), Some(kind)) => format!("{kind}, {count}>"),
            _ => kind.into(),
        };
        return Some(format!("{place}var<uniform> {name}: {kind};"));
    }
    let constant = match self::place(name) {
        Place::Texels => false,
        Place::Sampled(_) => true,
        Place::Buffer | Place::Uniform(_) => return None,
    };
    let kind = kind.strip_prefix("array<")?.strip_suffix('>')?;
    let members = members(source, kind)?;
    let count: u64 = members.iter().map(|m| m.count).sum();
    // Numbers in a texel.
    let width = if constant && count.is_multiple_of(4) { 4 } else { 1 };
    let sampled = constant || access == Access::Sampled;
    let (texture, level) = match sampled {
        false => (format!("texture_storage_2d<r32uint, {mode}>"), ""),
        // No shader reads how many numbers a texel has; the host asks the name of the variable, see `texel_numbers`.
        true => ("texture_2d<u32>".into(), ", 0"),
    };
    let (per_entry, per_row) = (count / width, ROW / 4 / width);
    let texel = |number: u64| match (per_row.is_multiple_of(per_entry), number / width) {
        // The texels of an entry lie in one row.
        (true, 0) => format!("vec2<u32>(n % {0}u * {per_entry}u, n / {0}u)", per_row / per_entry),
        (true, t) => format!("vec2<u32>(n % {0}u * {per_entry}u + {t}u, n / {0}u)", per_row / per_entry),
        (false, t) => {
            format!("vec2<u32>((n * {per_entry}u + {t}u) % {per_row}u, (n * {per_entry}u + {t}u) / {per_row}u)")
        }
    };
    let load = |m: &Member| {
        let bits = |lane: u64| format!("textureLoad({name}, {}{level})", texel(m.first + lane));
        let vector = format!("vec{}<u32>", m.count);
        match (width, m.count) {
            (4, 4) => format!("bitcast<{}>({})", m.kind, bits(0)),
            (4, _) => format!("bitcast<{}>({}[{}])", m.kind, bits(0), m.first % 4),
            (_, 1) => format!("bitcast<{}>({}.x)", m.kind, bits(0)),
            _ => {
                let numbers: Vec<String> = (0..m.count).map(|lane| bits(lane) + ".x").collect();
                format!("bitcast<{}>({vector}({}))", m.kind, numbers.join(", "))
            }
        }
    };
    let loads: Vec<String> = members.iter().map(load).collect();
    let entry = if members[0].name.is_empty() { loads[0].clone() } else { format!("{kind}({})", loads.join(", ")) };
    let mut out = format!("{place}var {name}: {texture}; fn {name}_at(n: u32) -> {kind} {{ return {entry}; }}");
    if mode == "read_write" {
        for m in &members {
            let part = |lane: u64| if m.count == 1 { String::from("v") } else { format!("v[{lane}]") };
            let store = |lane: u64| {
                let bits = format!("vec4<u32>(bitcast<u32>({}))", part(lane));
                format!("textureStore({name}, {}, {bits});", texel(m.first + lane))
            };
            let stores: Vec<String> = (0..m.count).map(store).collect();
            let separator = if m.name.is_empty() { "" } else { "_" };
            let stores = stores.join(" ");
            out += &format!(" fn {name}_put{separator}{}(n: u32, v: {}) {{ {stores} }}", m.name, m.kind);
        }
    }
    Some(out)
}

/// Numbers in a texel of the array of this name.
pub fn texel_numbers(name: &str) -> u64 {
    match place(name) {
        Place::Sampled(numbers) => numbers,
        _ => 1,
    }
}

/// Uses of the arrays as calls of the functions that stand for them.
fn with_calls(text: &str) -> String {
    let names = arrays::all().filter(|array| matches!(array.place, Place::Texels | Place::Sampled(_)));
    let Some((start, name)) = names.filter_map(|array| Some((find_use(text, array.name)?, array.name))).min() else {
        return text.into();
    };
    let open = start + name.len();
    let end = open + closing(&text[open..]);
    let (before, index, after) = (&text[..start], with_calls(&text[open + 1..end]), &text[end + 1..]);
    let member = after.strip_prefix('.').map_or("", |rest| rest.split(|c: char| !in_word(c)).next().unwrap_or(""));
    let rest = &after[if member.is_empty() { 0 } else { member.len() + 1 }..];
    // Nothing of the expressions of this language begins with `=` and is no comparison, or with `+=`.
    let value_after = |sign: &str| rest.trim_start().strip_prefix(sign).filter(|rest| !rest.starts_with('='));
    let assigned = value_after("=").map(|v| (v, false)).or(value_after("+=").map(|v| (v, true)));
    match assigned.and_then(|(value, adds)| Some((value.split_once(';')?, adds))) {
        None => format!("{before}{name}_at({index}){}", with_calls(after)),
        Some(((value, rest), adds)) => {
            let (dot, line) = if member.is_empty() { ("", "") } else { (".", "_") };
            let value = with_calls(value.trim_start());
            let value = if adds { format!("{name}_at({index}){dot}{member} + ({value})") } else { value };
            format!("{before}{name}_put{line}{member}({index}, {value});{}", with_calls(rest))
        }
    }
}

fn in_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Where the text indexes the array of this name.
fn find_use(text: &str, name: &str) -> Option<usize> {
    text.match_indices(name)
        .map(|(at, _)| at)
        .find(|at| !text[..*at].chars().next_back().is_some_and(in_word) && text[at + name.len()..].starts_with('['))
}

/// Where the bracket closes with which the text begins.
fn closing(text: &str) -> usize {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at;
        }
    }
    text.len() - 1
}

/// An array in a texture.
#[derive(Debug, Clone)]
pub struct Texels {
    texture: wgpu::Texture,
    /// Bytes of a texel.
    texel: u64,
    /// Length of the array [bytes].
    size: u64,
}

impl Texels {
    /// Most bytes that a portable texture takes: as many rows as it may have.
    pub const LARGEST: u64 = 8192 * ROW;

    /// Zeros.
    pub fn new(device: &wgpu::Device, label: &str, size: u64, numbers_per_texel: u64) -> Self {
        use wgpu::TextureUsages as Usage;
        let texel = 4 * numbers_per_texel;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: (ROW / texel) as u32,
                height: size.div_ceil(ROW).max(1) as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: format_of(numbers_per_texel),
            usage: Usage::STORAGE_BINDING | Usage::TEXTURE_BINDING | Usage::COPY_SRC | Usage::COPY_DST,
            view_formats: &[],
        });
        Texels { texture, texel, size }
    }

    /// Length of the array [bytes].
    pub fn size(&self) -> u64 {
        self.size
    }

    /// What it takes on the device [bytes].
    pub fn device_bytes(&self) -> u64 {
        u64::from(self.texture.height()) * ROW
    }

    pub fn view(&self) -> wgpu::TextureView {
        self.texture.create_view(&Default::default())
    }

    /// Writes the array from its beginning.
    pub fn write(&self, queue: &wgpu::Queue, bytes: &[u8]) {
        for part in parts(0, bytes.len() as u64, self.texel) {
            let data = &bytes[part.from as usize..(part.from + part.size()) as usize];
            queue.write_texture(part.place(&self.texture), data, part.layout(0), part.extent());
        }
    }

    /// Copies `size` bytes from byte `from` on into a buffer; all three are multiples of a texel.
    pub fn encode_copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (from, size): (u64, u64),
        (buffer, offset): (&wgpu::Buffer, u64),
    ) {
        for part in parts(from, size, self.texel) {
            let layout = part.layout(offset + part.from - from);
            let target = wgpu::TexelCopyBufferInfo { buffer, layout };
            encoder.copy_texture_to_buffer(part.place(&self.texture), target, part.extent());
        }
    }
}

/// A rectangle of a texture that is one piece of its array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Part {
    /// Where it begins [bytes].
    from: u64,
    /// In texels.
    width: u64,
    rows: u64,
    /// Bytes of a texel.
    texel: u64,
}

impl Part {
    fn size(self) -> u64 {
        self.width * self.rows * self.texel
    }

    fn place(self, texture: &wgpu::Texture) -> wgpu::TexelCopyTextureInfo<'_> {
        let (x, y) = (self.from % ROW / self.texel, self.from / ROW);
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: x as u32, y: y as u32, z: 0 },
            aspect: wgpu::TextureAspect::All,
        }
    }

    fn layout(self, offset: u64) -> wgpu::TexelCopyBufferLayout {
        let bytes_per_row = (self.rows > 1).then_some(ROW as u32);
        wgpu::TexelCopyBufferLayout { offset, bytes_per_row, rows_per_image: None }
    }

    fn extent(self) -> wgpu::Extent3d {
        wgpu::Extent3d { width: self.width as u32, height: self.rows as u32, depth_or_array_layers: 1 }
    }
}

/// The rest of a row, whole rows, the beginning of a row.
fn parts(from: u64, size: u64, texel: u64) -> Vec<Part> {
    let mut parts = Vec::new();
    let (mut at, end) = (from, from + size);
    while at < end {
        let rows = if at.is_multiple_of(ROW) { (end - at) / ROW } else { 0 };
        let part = match rows {
            0 => Part { from: at, width: (end.min((at / ROW + 1) * ROW) - at) / texel, rows: 1, texel },
            rows => Part { from: at, width: ROW / texel, rows, texel },
        };
        at += part.size();
        parts.push(part);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_of_an_array_are_rectangles() {
        let part = |from, width, rows| Part { from, width, rows, texel: 4 };
        const WIDTH: u64 = ROW / 4;
        assert_eq!(parts(0, 16, 4), [part(0, 4, 1)]);
        assert_eq!(parts(ROW - 8, 24, 4), [part(ROW - 8, 2, 1), part(ROW, 4, 1)]);
        assert_eq!(parts(0, 3 * ROW + 4, 4), [part(0, WIDTH, 3), part(3 * ROW, 1, 1)]);
        assert_eq!(parts(ROW - 4, 2 * ROW + 4, 4), [part(ROW - 4, 1, 1), part(ROW, WIDTH, 2)]);
        assert!(parts(12, 0, 4).is_empty());
        assert_eq!(parts(0, ROW + 32, 16)[0], Part { from: 0, width: ROW / 16, rows: 1, texel: 16 });
    }

    const SOURCE: &str = "\
struct ContactRecord {
    // What it is.
    stick: vec4<f32>,
    touch: vec4<f32>,
    path: vec4<f32>,
}
@group(2) @binding(1) var<storage, read_write> node_velocity: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read> node_mass: array<f32>;
@group(1) @binding(4) var<storage, read> other: array<f32>;
@group(3) @binding(4) var<storage, read_write> contact_records: array<ContactRecord>;
@group(3) @binding(1) var<storage, read> tip_state: TipState;
@group(3) @binding(2) var<storage, read> tip_anchor_loads: array<TipAnchorLoad>;
let v = node_velocity[other[node_index[
1u]]].xyz * node_mass[n] == my_node_mass[n];
node_velocity[a + 1u] += vec4<f32>(
node_mass[2u], 0.0);
node_velocity[a] = node_velocity[b];
contact_records[i].touch += contact_records[j].touch.zzzz;
";

    #[test]
    fn uses_become_calls_and_lines_stay() {
        let text = rewritten(SOURCE, Access::Storage);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), SOURCE.lines().count());
        assert!(
            lines[6].starts_with("@group(2) @binding(1) var node_velocity: texture_storage_2d<r32uint, read_write>;")
        );
        assert!(lines[6].contains("fn node_velocity_put(n: u32, v: vec4<f32>)"));
        assert!(lines[7].contains("node_mass: texture_2d<u32>;") && !lines[7].contains("node_mass_put"));
        assert_eq!(lines[8], SOURCE.lines().nth(8).unwrap());
        assert!(lines[9].contains("fn contact_records_put_touch(n: u32, v: vec4<f32>)"));
        // Twelve numbers an entry: rows end within entries.
        assert!(lines[9].contains("vec2<u32>((n * 12u + 11u) % 8192u, (n * 12u + 11u) / 8192u)"));
        assert_eq!(lines[10], "@group(3) @binding(1) var<uniform> tip_state: TipState;");
        assert!(lines[11].ends_with("var<uniform> tip_anchor_loads: array<TipAnchorLoad, ANCHOR_COUNT>;"));
        let call = "let v = node_velocity_at(other[node_index[1u]]).xyz * node_mass_at(n) == my_node_mass[n];";
        assert_eq!(lines[12..14].join(""), call);
        let sum = "node_velocity_put(a + 1u, node_velocity_at(a + 1u) + (vec4<f32>(node_mass_at(2u), 0.0)));";
        assert_eq!(lines[14..16].join(""), sum);
        assert_eq!(lines[16], "node_velocity_put(a, node_velocity_at(b));");
        let member = "contact_records_put_touch(i, contact_records_at(i).touch + (contact_records_at(j).touch.zzzz));";
        assert_eq!(lines[17], member);
        assert!(rewritten(SOURCE, Access::Sampled).contains("node_velocity: texture_2d<u32>"));
    }
}
