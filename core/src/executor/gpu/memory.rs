//! The memory of slots on the GPU, and the layout of its contents in a staging buffer.

use std::collections::HashSet;

use index_vec::IndexVec;

use super::{Fill, Gpu, RunError};
use crate::{
    graph::Graph,
    id::SlotId,
    plan::{Plan, SlotPair},
    port::{Dims, Element, FieldRef, Format, Scalar},
    shader::Pass,
    side::Side,
};

/// Rows must be a multiple of this many bytes in copies between buffers and textures.
const ROW_ALIGNMENT: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// The memory of one slot on the GPU.
pub(super) enum GpuMemory {
    Buffer(wgpu::Buffer),
    Texture(wgpu::Texture, wgpu::TextureView),
}

impl GpuMemory {
    /// The binding for a shader.
    pub fn binding(&self) -> wgpu::BindingResource<'_> {
        match self {
            Self::Buffer(buffer) => buffer.as_entire_binding(),
            Self::Texture(_, view) => wgpu::BindingResource::TextureView(view),
        }
    }

    /// The texture that a raster pass draws to.
    pub fn target(&self) -> (&wgpu::Texture, &wgpu::TextureView) {
        match self {
            Self::Texture(texture, view) => (texture, view),
            Self::Buffer(_) => unreachable!("checked: raster targets are textures"),
        }
    }

    /// The buffer that an indirect dispatch reads.
    pub fn buffer(&self) -> &wgpu::Buffer {
        match self {
            Self::Buffer(buffer) => buffer,
            Self::Texture(..) => unreachable!("checked: numbers of workgroups are in buffers"),
        }
    }

    /// Records a copy from a staging buffer.
    pub fn copy_in(&self, encoder: &mut wgpu::CommandEncoder, from: &wgpu::Buffer, layout: Layout) {
        match self {
            Self::Buffer(buffer) => {
                encoder.copy_buffer_to_buffer(from, 0, buffer, 0, layout.staged_bytes());
            }
            Self::Texture(texture, _) => {
                encoder.copy_buffer_to_texture(layout.staged(from), texture.as_image_copy(), texture.size());
            }
        }
    }

    /// Records a copy to a staging buffer.
    pub fn copy_out(&self, encoder: &mut wgpu::CommandEncoder, to: &wgpu::Buffer, layout: Layout) {
        match self {
            Self::Buffer(buffer) => {
                encoder.copy_buffer_to_buffer(buffer, 0, to, 0, layout.staged_bytes());
            }
            Self::Texture(texture, _) => {
                encoder.copy_texture_to_buffer(texture.as_image_copy(), layout.staged(to), texture.size());
            }
        }
    }

    /// Replaces the contents before the next submission takes effect.
    pub fn write(&self, queue: &wgpu::Queue, bytes: &[u8], layout: Layout) {
        let mut padded = vec![0; layout.staged_bytes() as usize];
        layout.pad(bytes, &mut padded);
        match self {
            Self::Buffer(buffer) => queue.write_buffer(buffer, 0, &padded),
            Self::Texture(texture, _) => {
                queue.write_texture(texture.as_image_copy(), &padded, layout.texel_layout(), texture.size());
            }
        }
    }
}

/// The layout of a slot's contents in a staging buffer: rows of textures are padded there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    row: usize,
    padded_row: u32,
    rows: u32,
}

impl Layout {
    pub fn new(element: &Element, dims: Dims) -> Self {
        let bytes = dims.width * element.bytes();
        match element {
            Element::Item { .. } => {
                let row = dims.count() * element.bytes() as usize;
                Self { row, padded_row: row as u32, rows: 1 }
            }
            _ => Self {
                row: bytes as usize,
                padded_row: bytes.next_multiple_of(ROW_ALIGNMENT),
                rows: dims.height,
            },
        }
    }

    pub fn staged_bytes(&self) -> u64 {
        u64::from(self.padded_row) * u64::from(self.rows)
    }

    /// Whether the layout in a staging buffer is the same as on the CPU.
    pub fn is_packed(&self) -> bool {
        self.row == self.padded_row as usize
    }

    /// Removes the padding.
    pub fn unpad(&self, staged: &[u8], out: &mut [u8]) {
        for row in 0..self.rows as usize {
            let from = row * self.padded_row as usize;
            out[row * self.row..][..self.row].copy_from_slice(&staged[from..][..self.row]);
        }
    }

    /// Adds the padding.
    pub fn pad(&self, bytes: &[u8], staged: &mut [u8]) {
        for row in 0..self.rows as usize {
            let to = row * self.padded_row as usize;
            staged[to..][..self.row].copy_from_slice(&bytes[row * self.row..][..self.row]);
        }
    }

    fn texel_layout(&self) -> wgpu::TexelCopyBufferLayout {
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(self.padded_row), rows_per_image: None }
    }

    fn staged<'b>(&self, buffer: &'b wgpu::Buffer) -> wgpu::TexelCopyBufferInfo<'b> {
        wgpu::TexelCopyBufferInfo { buffer, layout: self.texel_layout() }
    }
}

/// Checks that shaders can bind every storage.
pub(super) fn check_limits(gpu: &Gpu, plan: &Plan) -> Result<(), RunError> {
    let limits = gpu.device.limits();
    for storage in plan.storages.iter().filter(|storage| storage.slots.gpu.is_some()) {
        let too_large = match storage.element {
            Element::Item { .. } => storage.bytes() > limits.max_storage_buffer_binding_size,
            _ => storage.dims.width.max(storage.dims.height) > limits.max_texture_dimension_2d,
        };
        if too_large {
            return Err(RunError::Gpu(format!(
                "`{}` has {} elements, {} bytes: more than {} can bind; run with --backend cpu or at a smaller size",
                storage.name,
                storage.dims.count(),
                storage.bytes(),
                gpu.name()
            )));
        }
    }
    Ok(())
}

/// Allocates the memory of every slot.
pub(super) fn allocate(device: &wgpu::Device, graph: &Graph, plan: &Plan) -> IndexVec<SlotId, GpuMemory> {
    let targets = slots_of(graph, plan, Pass::targets);
    let counts = slots_of(graph, plan, Pass::group_counts);
    let slots = plan.slots.gpu.iter_enumerated();
    slots
        .map(|(id, slot)| match &slot.element {
            Element::Texel(format) => {
                let mut usage = wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST;
                if targets.contains(&id) {
                    usage |= wgpu::TextureUsages::RENDER_ATTACHMENT;
                }
                let texture = device.create_texture(&texture(slot.dims, wgpu_format(*format), usage));
                let view = texture.create_view(&Default::default());
                GpuMemory::Texture(texture, view)
            }
            _ => {
                let mut usage =
                    wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
                if counts.contains(&id) {
                    usage |= wgpu::BufferUsages::INDIRECT;
                }
                GpuMemory::Buffer(device.create_buffer(&wgpu::BufferDescriptor {
                    label: None,
                    size: slot.bytes(),
                    usage,
                    mapped_at_creation: false,
                }))
            }
        })
        .collect()
}

/// Describes a texture with one mip level and one sample.
pub(super) fn texture(
    dims: Dims,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::TextureDescriptor<'static> {
    wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: dims.width, height: dims.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    }
}

fn wgpu_format(format: Format) -> wgpu::TextureFormat {
    match format {
        Format::R32Float => wgpu::TextureFormat::R32Float,
        Format::R32Uint => wgpu::TextureFormat::R32Uint,
        Format::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
        Format::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        Format::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
    }
}

/// The slots that the passes of GPU nodes use for a purpose; `fields` gives the fields of a pass that serve it.
fn slots_of<'g, F: IntoIterator<Item = &'g FieldRef>>(
    graph: &'g Graph,
    plan: &Plan,
    fields: impl Fn(&'g Pass) -> F,
) -> HashSet<SlotId> {
    let nodes = graph.nodes.iter().zip(&plan.nodes).filter(|(node, _)| node.side == Side::Gpu);
    let values = nodes.flat_map(|(node, planned)| {
        let passes = &node.declaration().passes;
        passes.iter().flat_map(&fields).filter_map(|field| planned.value(*field))
    });
    values.filter_map(|value| plan.storages[value.storage].slots.gpu).flat_map(SlotPair::both).collect()
}

/// The 32-bit pattern that poisons an element: NaN where it is a float.
pub(crate) fn poison_word(element: &Element) -> u32 {
    match element {
        Element::Texel(Format::R32Float | Format::Rgba32Float) => f32::NAN.to_bits(),
        // Two half-precision NaNs.
        Element::Texel(Format::Rgba16Float) => 0x7E00_7E00,
        Element::Item { members, .. } if members.iter().all(|m| m.scalar == Scalar::F32) => {
            f32::NAN.to_bits()
        }
        _ => 0xDEAD_BEEF,
    }
}

/// For each slot, a staging buffer filled with what the slot is filled with.
pub(super) fn fill_buffers(device: &wgpu::Device, plan: &Plan, fill: Fill) -> IndexVec<SlotId, wgpu::Buffer> {
    let slots = plan.slots.gpu.iter();
    slots
        .map(|slot| {
            let size = Layout::new(&slot.element, slot.dims).staged_bytes().max(16);
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("fill"),
                size,
                usage: wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: true,
            });
            let words = vec![fill.word(&slot.element); (size / 4) as usize];
            if let Ok(mut range) = buffer.get_mapped_range_mut(..) {
                range.copy_from_slice(bytemuck::cast_slice(&words));
            }
            buffer.unmap();
            buffer
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        AdapterChoice, CpuContext, Extent, Facts, GraphFile, Io, Registry, Settings, Shader, Stage, compile,
        port::{Member, PortElement, texel},
    };

    #[test]
    fn rows_of_textures_are_padded_and_buffers_are_not() {
        let layout = |element: &Element, width, height| Layout::new(element, Dims { width, height });
        let narrow = layout(&Element::Texel(Format::Rgba16Float), 33, 3);
        assert!(!narrow.is_packed());
        assert_eq!(narrow.staged_bytes(), 3 * 512);
        let bytes: Vec<u8> = (0..3 * 33 * 8).map(|at| (at % 251) as u8 + 1).collect();
        let mut staged = vec![0; 3 * 512];
        narrow.pad(&bytes, &mut staged);
        for (row, staged) in staged.chunks(512).enumerate() {
            let (texels, padding) = staged.split_at(33 * 8);
            assert_eq!(texels, &bytes[row * 33 * 8..][..33 * 8]);
            assert!(padding.iter().all(|byte| *byte == 0));
        }
        let mut back = vec![0; bytes.len()];
        narrow.unpad(&staged, &mut back);
        assert_eq!(back, bytes);
        let fitting = layout(&Element::Texel(Format::R32Uint), 64, 5);
        assert!(fitting.is_packed());
        assert_eq!(fitting.staged_bytes(), 5 * 256);
        let buffer = layout(&<[f32; 2]>::element(), 3, 7);
        assert!(buffer.is_packed());
        assert_eq!(buffer.staged_bytes(), 3 * 7 * 8);
        let mut copied = vec![0; 3 * 7 * 8];
        buffer.unpad(&bytes[..copied.len()], &mut copied);
        assert_eq!(copied, bytes[..copied.len()]);
    }

    /// Writes 16 bytes for each pixel to a buffer, or a texture with one texel more than pixels on each axis.
    struct Large;

    crate::params! {
        struct LargeParams {
            /// A texture instead of a buffer.
            texture: bool = false;
        }
    }

    impl Stage for Large {
        const KIND: &'static str = "large";
        const DOC: &'static str = "Much memory.";
        type Params = LargeParams;
        fn declare(params: &LargeParams, io: &mut Io) -> Self {
            io.shader(Shader::new("large.wgsl", ""));
            let out = match params.texture {
                true => FieldRef::from(io.write::<texel::R32Float>("out", "written", Extent::Corners)),
                false => io.write::<[f32; 4]>("out", "written", Extent::Frame(1)).into(),
            };
            io.dispatch("main", out);
            Self
        }
        fn cpu(&self, _: &LargeParams, _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    #[test]
    fn what_shaders_can_bind_reaches_up_to_the_limits() {
        let gpu = Gpu::open(AdapterChoice::Any).unwrap();
        let limits = gpu.device.limits();
        let check = |texture: bool, size| {
            let text = format!(
                "Graph(version: 1, nodes: {{ \"large\": (kind: \"large\", on: Gpu, params: (texture: {texture})) }}, \
                 outputs: {{ \"image\": \"large.out\" }})"
            );
            let file = GraphFile::parse("large.ron", &text).unwrap();
            let registry = Registry::default().with::<Large>();
            let (_, plan) = compile(&file, &registry, &Settings::new(size, 0, Facts::none())).unwrap();
            check_limits(&gpu, &plan)
        };
        let side = limits.max_texture_dimension_2d.min(crate::MAX_SIDE);
        for (fits, exceeds) in [([side - 1, 3], [side, 3]), ([3, side - 1], [3, side])] {
            assert_eq!(check(true, fits), Ok(()));
            // If textures may be larger than any frame, there is nothing to exceed.
            if side == limits.max_texture_dimension_2d {
                assert!(matches!(check(true, exceeds), Err(RunError::Gpu(_))));
            }
        }
        // Buffers are as large as their number of pixels: rows that fill the limit to the last element.
        let width = 4096;
        let rows = u32::try_from(limits.max_storage_buffer_binding_size / (16 * u64::from(width))).unwrap();
        assert_eq!(check(false, [width, rows]), Ok(()));
        assert!(matches!(check(false, [width, rows + 1]), Err(RunError::Gpu(_))));
    }

    #[test]
    fn poison_is_not_a_number_where_all_is_float_and_else_a_known_word() {
        let word = |format: Format| poison_word(&Element::Texel(format));
        for format in [Format::R32Float, Format::Rgba32Float] {
            assert!(f32::from_bits(word(format)).is_nan(), "{format:?}");
        }
        let halves = word(Format::Rgba16Float).to_le_bytes();
        for half in [[halves[0], halves[1]], [halves[2], halves[3]]] {
            assert!(half::f16::from_le_bytes(half).is_nan());
        }
        for format in [Format::R32Uint, Format::Rgba8Unorm] {
            assert_eq!(word(format), 0xDEAD_BEEF, "{format:?}");
        }
        for element in [f32::element(), <[f32; 2]>::element(), <[f32; 4]>::element()] {
            assert!(f32::from_bits(poison_word(&element)).is_nan(), "{element}");
        }
        let member =
            |name: &'static str, scalar, offset| Member { name: name.into(), scalar, lanes: 1, offset };
        let members = vec![member("number", Scalar::F32, 0), member("index", Scalar::U32, 4)];
        let mixed = Element::Item { name: "Mixed".into(), stride: 8, members: members.into() };
        for element in [u32::element(), i32::element(), <[u32; 4]>::element(), mixed] {
            assert_eq!(poison_word(&element), 0xDEAD_BEEF, "{element}");
        }
    }
}
