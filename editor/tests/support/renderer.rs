//! Draws a window without a screen into an image. The feature `wgpu` of `egui_kittest` does the same, but enables more
//! features of wgpu than the programs use, so that Cargo would compile wgpu twice.

use eframe::egui_wgpu::{self, RendererOptions, ScreenDescriptor, wgpu};
use egui::{Context, FullOutput, TexturesDelta};
use egui_kittest::TestRenderer;
use epigraph_core::Gpu;
use image::RgbaImage;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A device with egui's pipelines, buffers and textures.
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    renderer: egui_wgpu::Renderer,
}

impl Renderer {
    /// Opens a device, on a software adapter if there is one: these draw the same image on every machine.
    pub fn new() -> Self {
        let adapter = Gpu::adapters()
            .into_iter()
            .min_by_key(|adapter| adapter.get_info().device_type != wgpu::DeviceType::Cpu)
            .expect("a driver for Vulkan, Metal or Direct3D; tests/run installs one");
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))
            .expect("an adapter with the limits of WebGPU");
        let renderer = egui_wgpu::Renderer::new(&device, FORMAT, RendererOptions::PREDICTABLE);
        Self { device, queue, renderer }
    }
}

impl TestRenderer for Renderer {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        for (id, images) in delta.set.drain() {
            for image in images {
                self.renderer.update_texture(&self.device, &self.queue, id, &image);
            }
        }
        for id in delta.free.drain() {
            self.renderer.free_texture(&id);
        }
    }

    fn render(&mut self, context: &Context, output: &FullOutput) -> Result<RgbaImage, String> {
        let Self { device, queue, renderer } = self;
        let pixels_per_point = context.pixels_per_point();
        let size = (context.content_rect().size() * pixels_per_point).round();
        let [width, height] = [size.x, size.y].map(|side| side as u32);
        let target = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let row = 4 * width;
        let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("pixels of the window"),
            size: u64::from(padded_row) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });

        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let triangles = context.tessellate(output.shapes.clone(), pixels_per_point);
        let screen = ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point };
        let mut commands = renderer.update_buffers(device, queue, &mut encoder, &triangles, &screen);
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target.create_view(&wgpu::TextureViewDescriptor::default()),
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                    depth_slice: None,
                })],
                ..Default::default()
            })
            .forget_lifetime();
        renderer.render(&mut pass, &triangles, &screen);
        drop(pass);
        encoder.copy_texture_to_buffer(
            target.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_row),
                    rows_per_image: None,
                },
            },
            target.size(),
        );
        commands.push(encoder.finish());
        queue.submit(commands);

        buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.expect("a buffer for reading"));
        device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| error.to_string())?;
        let bytes = buffer.get_mapped_range(..).map_err(|error| error.to_string())?;
        let rows = bytes.chunks_exact(padded_row as usize);
        let pixels = rows.flat_map(|padded| &padded[..row as usize]).copied().collect();
        Ok(RgbaImage::from_raw(width, height, pixels).expect("four bytes a pixel"))
    }
}
