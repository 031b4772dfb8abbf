//! Arrays that lie in textures, for an adapter that reads storage buffers badly.
//!
//! llvmpipe loads from a storage buffer in a loop over the lanes of a vector, component by component: 7 ns for each of them on a
//! processor without AVX-512, which was two thirds of the time of a step. Its loads from storage textures are unrolled gathers: 0.8 ns.
//! (Measured with Mesa 22.3.6, eight lanes; storing costs 2.5 ns in a buffer and 3-5 ns in a texture.) So the arrays that every step
//! reads lie in textures of one number per texel there, and shaders are rewritten to match; on other adapters nothing changes.
//! The texels of a texture, row by row, are the numbers of the array: copies and checkpoints do not know the difference.

/// Texels in a row of such a texture.
const WIDTH: u64 = 8192;
/// Bytes of a texel.
const TEXEL: u64 = 4;
const ROW: u64 = WIDTH * TEXEL;

/// The arrays that lie in textures. At most four occur in one stage, as many storage textures as a portable device binds.
pub const ARRAYS: [&str; 6] =
    ["node_displacement", "node_velocity", "corner_force", "cell_stiffness", "node_mass", "cell_edges"];

/// How a rewritten shader reads its arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// By storage textures: compute shaders.
    Storage,
    /// By sampled textures: shaders that draw, whose vertices must not bind storage that can be written.
    Sampled,
}

/// The source with the arrays of [`ARRAYS`] in textures. Line n of it is line n of `source`.
///
/// Known are declarations of the form `@group(G) @binding(B) var<storage, ACCESS> NAME: array<TYPE>;` on a line of their own, `TYPE` one
/// of f32, i32, u32 and their vec4; uses `NAME[INDEX]` anywhere, `NAME[INDEX] = VALUE;` and `NAME[INDEX] += VALUE;`.
pub fn rewritten(source: &str, access: Access) -> String {
    let lines: Vec<String> = source.lines().map(|line| declaration(line, access).unwrap_or(line.into())).collect();
    let text = with_calls(&lines.join("\n"));
    if source.ends_with('\n') { text + "\n" } else { text }
}

/// The declaration of a texture and of the functions that stand for the array, where the line declares one of the arrays.
fn declaration(line: &str, access: Access) -> Option<String> {
    let (place, rest) = line.split_once("var<storage, ")?;
    let (mode, rest) = rest.split_once("> ")?;
    let (name, kind) = rest.split_once(": array<")?;
    ARRAYS.iter().find(|array| **array == name)?;
    let kind = kind.strip_suffix(">;")?;
    let number = kind.strip_prefix("vec4<").and_then(|k| k.strip_suffix('>')).unwrap_or(kind);
    let format = match number {
        "f32" => "r32float",
        "i32" => "r32sint",
        "u32" => "r32uint",
        _ => return None,
    };
    let (texture, level) = match access {
        Access::Storage => (format!("texture_storage_2d<{format}, {mode}>"), ""),
        Access::Sampled => (format!("texture_2d<{number}>"), ", 0"),
    };
    let lanes = if kind == number { 1 } else { 4 };
    let per_row = WIDTH / lanes;
    let texel = format!("vec2<u32>((n % {per_row}u) * {lanes}u, n / {per_row}u)");
    let at = |lane: u64| if lane == 0 { "p".into() } else { format!("p + vec2<u32>({lane}u, 0u)") };
    let list = |of: &dyn Fn(u64) -> String, between: &str| (0..lanes).map(of).collect::<Vec<_>>().join(between);
    let loads = list(&|lane| format!("textureLoad({name}, {}{level}).x", at(lane)), ", ");
    let mut out = format!(
        "{place}var {name}: {texture}; fn {name}_at(n: u32) -> {kind} {{ let p = {texel}; return {kind}({loads}); }}"
    );
    if mode == "read_write" {
        let part = |lane: u64| if lanes == 1 { "v".into() } else { format!("v[{lane}]") };
        let stores = list(&|lane| format!("textureStore({name}, {}, vec4<{number}>({}));", at(lane), part(lane)), " ");
        out += &format!(" fn {name}_put(n: u32, v: {kind}) {{ let p = {texel}; {stores} }}");
    }
    Some(out)
}

/// Uses of the arrays as calls of the functions that stand for them.
fn with_calls(text: &str) -> String {
    let Some((start, name)) = ARRAYS.iter().filter_map(|name| Some((find_use(text, name)?, *name))).min() else {
        return text.into();
    };
    let open = start + name.len();
    let end = open + closing(&text[open..]);
    let (before, index, after) = (&text[..start], with_calls(&text[open + 1..end]), &text[end + 1..]);
    // Nothing of the expressions of this language begins with `=` and is no comparison, or with `+=`.
    let value_after = |sign: &str| after.trim_start().strip_prefix(sign).filter(|rest| !rest.starts_with('='));
    let assigned = value_after("=").map(|v| (v, false)).or(value_after("+=").map(|v| (v, true)));
    match assigned.and_then(|(value, adds)| Some((value.split_once(';')?, adds))) {
        None => format!("{before}{name}_at({index}){}", with_calls(after)),
        Some(((value, rest), adds)) => {
            let value = with_calls(value.trim_start());
            let value = if adds { format!("{name}_at({index}) + ({value})") } else { value };
            format!("{before}{name}_put({index}, {value});{}", with_calls(rest))
        }
    }
}

/// Where the text indexes the array of this name.
fn find_use(text: &str, name: &str) -> Option<usize> {
    let in_word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(name).map(|(at, _)| at).find(|at| {
        !text[..*at].chars().next_back().is_some_and(in_word) && text[at + name.len()..].starts_with('[')
    })
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
    /// Length of the array [bytes].
    size: u64,
}

impl Texels {
    /// Most bytes that a portable texture takes: as many rows as it may have.
    pub const LARGEST: u64 = 8192 * ROW;

    /// Zeros.
    pub fn new(device: &wgpu::Device, label: &str, size: u64, format: wgpu::TextureFormat) -> Self {
        use wgpu::TextureUsages as Usage;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: WIDTH as u32,
                height: size.div_ceil(ROW).max(1) as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: Usage::STORAGE_BINDING | Usage::TEXTURE_BINDING | Usage::COPY_SRC | Usage::COPY_DST,
            view_formats: &[],
        });
        Texels { texture, size }
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
        for part in parts(0, bytes.len() as u64) {
            let data = &bytes[part.from as usize..(part.from + part.size()) as usize];
            queue.write_texture(part.place(&self.texture), data, part.layout(0), part.extent());
        }
    }

    /// Copies `size` bytes from byte `from` on into a buffer; all three are multiples of four.
    pub fn encode_copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (from, size): (u64, u64),
        (buffer, offset): (&wgpu::Buffer, u64),
    ) {
        for part in parts(from, size) {
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
}

impl Part {
    fn size(self) -> u64 {
        self.width * self.rows * TEXEL
    }

    fn place(self, texture: &wgpu::Texture) -> wgpu::TexelCopyTextureInfo<'_> {
        let (x, y) = (self.from % ROW / TEXEL, self.from / ROW);
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
fn parts(from: u64, size: u64) -> Vec<Part> {
    let mut parts = Vec::new();
    let (mut at, end) = (from, from + size);
    while at < end {
        let rows = if at.is_multiple_of(ROW) { (end - at) / ROW } else { 0 };
        let part = match rows {
            0 => Part { from: at, width: (end.min((at / ROW + 1) * ROW) - at) / TEXEL, rows: 1 },
            rows => Part { from: at, width: WIDTH, rows },
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
        let part = |from, width, rows| Part { from, width, rows };
        assert_eq!(parts(0, 16), [part(0, 4, 1)]);
        assert_eq!(parts(ROW - 8, 24), [part(ROW - 8, 2, 1), part(ROW, 4, 1)]);
        assert_eq!(parts(0, 3 * ROW + 4), [part(0, WIDTH, 3), part(3 * ROW, 1, 1)]);
        assert_eq!(parts(ROW - 4, 2 * ROW + 4), [part(ROW - 4, 1, 1), part(ROW, WIDTH, 2)]);
        assert!(parts(12, 0).is_empty());
    }

    #[test]
    fn uses_become_calls_and_lines_stay() {
        let source = "@group(2) @binding(1) var<storage, read_write> node_velocity: array<vec4<f32>>;\n\
                      @group(1) @binding(1) var<storage, read> node_mass: array<f32>;\n\
                      @group(1) @binding(4) var<storage, read> other: array<f32>;\n\
                      let v = node_velocity[other[node_index[\n1u]]].xyz * node_mass[n] == my_node_mass[n];\n\
                      node_velocity[a + 1u] += vec4<f32>(\nnode_mass[2u], 0.0);\n\
                      node_velocity[a] = node_velocity[b];\n";
        let text = rewritten(source, Access::Storage);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), source.lines().count());
        assert!(lines[0].starts_with("@group(2) @binding(1) var node_velocity: texture_storage_2d<r32float, read_write>;"));
        assert!(lines[0].contains("fn node_velocity_put(n: u32, v: vec4<f32>)"));
        assert!(lines[1].contains("texture_storage_2d<r32float, read>") && !lines[1].contains("node_mass_put"));
        assert_eq!(lines[2], source.lines().nth(2).unwrap());
        assert_eq!(lines[3..5].join(""), "let v = node_velocity_at(other[node_index[1u]]).xyz * node_mass_at(n) == my_node_mass[n];");
        assert_eq!(
            lines[5..7].join(""),
            "node_velocity_put(a + 1u, node_velocity_at(a + 1u) + (vec4<f32>(node_mass_at(2u), 0.0)));"
        );
        assert_eq!(lines[7], "node_velocity_put(a, node_velocity_at(b));");
        assert!(rewritten(source, Access::Sampled).contains("node_mass: texture_2d<f32>"));
    }
}
