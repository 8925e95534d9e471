//! Compiled shaders and their pipelines. They live as long as an executor uses them. When a graph is recompiled while
//! the previous executor still exists, for another parameter or another visible port, the new one reuses everything
//! unchanged.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use super::Gpu;
use crate::{
    reflect::{self, Reflected},
    shader::{Needs, Shader, ShaderLibrary},
};

/// The programs in use on a device, by their full source.
#[derive(Default)]
pub(crate) struct Programs {
    known: Mutex<HashMap<(String, Needs), Weak<Program>>>,
}

/// A compiled shader.
pub(crate) struct Program {
    pub reflected: Reflected,
    module: wgpu::ShaderModule,
    compute: Mutex<HashMap<String, wgpu::ComputePipeline>>,
    raster: Mutex<HashMap<Raster, wgpu::RenderPipeline>>,
}

/// The key of a raster pipeline.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Raster {
    pub vertex: String,
    pub fragment: String,
    pub topology: wgpu::PrimitiveTopology,
    pub formats: Vec<wgpu::TextureFormat>,
    pub depth_test: bool,
}

impl Programs {
    /// The program of a shader, compiled unless an executor already holds it.
    ///
    /// # Errors
    /// The message of naga or wgpu.
    pub fn get(
        &self,
        gpu: &Gpu,
        shader: &Shader,
        library: &ShaderLibrary,
        needs: Needs,
    ) -> Result<Arc<Program>, String> {
        let composed = reflect::join(shader, library).map_err(|error| error.to_string())?;
        let key = (composed.text.clone(), needs);
        let mut known = lock(&self.known);
        if let Some(program) = known.get(&key).and_then(Weak::upgrade) {
            return Ok(program);
        }
        let reflected = reflect::validate(&composed, needs).map_err(|error| error.to_string())?;
        let module = gpu.scoped(|| {
            gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(&shader.name),
                source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(reflected.module.clone())),
            })
        });
        let module = module.map_err(|error| error.to_string())?;
        let program =
            Arc::new(Program { reflected, module, compute: Mutex::default(), raster: Mutex::default() });
        known.retain(|_, program| program.strong_count() > 0);
        known.insert(key, Arc::downgrade(&program));
        Ok(program)
    }
}

impl Program {
    /// The pipeline of a compute entry point.
    pub fn compute(&self, device: &wgpu::Device, entry: &str) -> wgpu::ComputePipeline {
        let make = || {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &self.module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        lock(&self.compute).entry(entry.to_owned()).or_insert_with(make).clone()
    }

    /// The pipeline that draws into textures of given formats.
    pub fn raster(&self, device: &wgpu::Device, raster: &Raster) -> wgpu::RenderPipeline {
        let Raster { vertex, fragment, topology, formats, depth_test } = raster;
        let targets: Vec<_> = formats.iter().map(|&format| Some(format.into())).collect();
        let make = || {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(vertex),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &self.module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState { topology: *topology, ..Default::default() },
                depth_stencil: depth_test.then(|| wgpu::DepthStencilState {
                    format: wgpu::TextureFormat::Depth32Float,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Less),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &self.module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        lock(&self.raster).entry(raster.clone()).or_insert_with(make).clone()
    }
}

/// Locks even after a panic elsewhere: no update here can be left half done.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AdapterChoice;

    #[test]
    fn a_program_is_shared_while_it_is_in_use() {
        let gpu = Gpu::open(AdapterChoice::Any).unwrap();
        let shader = |twice: &str| {
            let text = format!(
                "@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n\
                 @compute @workgroup_size(1) fn main() {{ out[0] = {twice}; }}"
            );
            Shader::new("twice.wgsl", text)
        };
        let get =
            |text: &str| gpu.programs.get(&gpu, &shader(text), &ShaderLibrary::default(), Needs::default());
        let first = get("2u").unwrap();
        let pipeline = first.compute(&gpu.device, "main");
        let again = get("2u").unwrap();
        assert!(Arc::ptr_eq(&first, &again));
        assert_eq!(again.compute(&gpu.device, "main"), pipeline);
        assert!(!Arc::ptr_eq(&first, &get("3u").unwrap()), "another text is another program");
        assert!(get("2.5").err().unwrap().contains("twice.wgsl"));
        // One holder is enough, also while others are compiled.
        drop(again);
        let other = get("4u").unwrap();
        assert!(Arc::ptr_eq(&first, &get("2u").unwrap()));
        drop((first, other));
        assert!(lock(&gpu.programs.known).values().all(|program| program.strong_count() == 0));
    }
}
