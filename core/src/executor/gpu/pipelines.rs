//! The pipelines and bind groups of nodes, built once.

use std::sync::Arc;

use index_vec::IndexVec;

use super::{
    Gpu, RunError,
    memory::{GpuMemory, texture},
    watch::GpuWatch,
};
use crate::{
    executor::{
        programs::{Program, Raster},
        watch::Watch,
    },
    graph::Graph,
    id::{NodeId, SlotId},
    plan::Plan,
    port::{Dims, FieldRef},
    reflect::{self, Entry, Reflected},
    shader::{Pass, ShaderLibrary, Shape, Threads},
    side::Side,
};

/// Lists are dispatched in rows of at most this many workgroups; `shared/index.wgsl` reads the row length from
/// `groups.x`.
const MAX_GROUPS_X: u32 = 32768;

/// A node, ready to be recorded.
pub(super) struct GpuNode {
    pub passes: Vec<GpuPass>,
    /// Kept alive for the next executor.
    _programs: Vec<Arc<Program>>,
}

/// A dispatch or a draw: all that it takes to record it, for even and odd frames, whose history pairs are swapped.
#[derive(Clone)]
pub(crate) struct GpuPass {
    pub pipeline: Pipeline,
    pub bindings: [wgpu::BindGroup; 2],
}

#[derive(Clone)]
pub(crate) enum Pipeline {
    Compute {
        pipeline: wgpu::ComputePipeline,
        groups: Groups,
    },
    Raster {
        pipeline: wgpu::RenderPipeline,
        vertices: u32,
        targets: [Vec<wgpu::TextureView>; 2],
        depth: Option<wgpu::TextureView>,
        clear: f64,
    },
}

/// The number of workgroups of a dispatch.
#[derive(Clone)]
pub(crate) enum Groups {
    /// Along x and y.
    Known([u32; 2]),
    /// At the start of a buffer.
    InBuffer([wgpu::Buffer; 2]),
}

impl Pipeline {
    pub fn is_compute(&self) -> bool {
        matches!(self, Self::Compute { .. })
    }
}

/// Builds nodes.
pub(super) struct Builder<'a> {
    pub gpu: &'a Gpu,
    pub graph: &'a Graph,
    pub plan: &'a Plan,
    pub library: &'a ShaderLibrary,
    pub memory: &'a IndexVec<SlotId, GpuMemory>,
    /// The uniform `frame`.
    pub frame: &'a wgpu::Buffer,
    /// What watches the nodes, if the run is watched.
    pub watch: Option<(&'a Watch, &'a GpuWatch)>,
}

impl Builder<'_> {
    /// The pipelines and bind groups of one node.
    pub fn node(&self, id: NodeId) -> Result<GpuNode, RunError> {
        let node = &self.graph.nodes[id];
        let declaration = node.declaration();
        let shader = declaration.shader.as_ref().expect("checked: a GPU node has a shader");
        let fail = |message: String| RunError::Stage { node: node.name.clone(), message };
        if declaration.needs.atomic64 && !self.gpu.has_atomic64() {
            return Err(fail(format!("{} has no 64-bit atomics; choose another method", self.gpu.name())));
        }
        let programs = &self.gpu.programs;
        let watched = self.watch.map(|_| reflect::watched(shader));
        let shader = watched.as_ref().unwrap_or(shader);
        let program = programs.get(self.gpu, shader, self.library, declaration.needs).map_err(fail)?;
        let wrong = reflect::check(&program.reflected, &shader.name, declaration, &node.stage.specs());
        if let Some(error) = wrong.first() {
            return Err(fail(error.to_string()));
        }
        self.check_groups(&program.reflected, id).map_err(fail)?;
        let words = node.stage.words();
        let params = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: (4 * words.len() as u64).next_multiple_of(16).max(16),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.gpu.queue.write_buffer(&params, 0, bytemuck::cast_slice(&words));
        let built = self.gpu.scoped(|| {
            let passes = declaration.passes.iter().map(|pass| {
                let pipeline = self.pipeline(&program, pass, id);
                let bindings =
                    [0, 1].map(|parity| self.bind(&pipeline, &program.reflected, pass, id, parity, &params));
                GpuPass { pipeline, bindings }
            });
            passes.collect()
        });
        let mut passes: Vec<GpuPass> = built.map_err(|error| fail(error.to_string()))?;
        let mut programs = vec![program];
        if let Some((watch, on_gpu)) = self.watch {
            let watching = self.gpu.scoped(|| on_gpu.passes(self.gpu, self.plan, watch, self.memory, id));
            let (more, theirs) = watching.map_err(|error| fail(error.to_string()))?.map_err(fail)?;
            passes.extend(more);
            programs.extend(theirs);
        }
        Ok(GpuNode { passes, _programs: programs })
    }

    fn pipeline(&self, program: &Program, pass: &Pass, node: NodeId) -> Pipeline {
        let device = &self.gpu.device;
        match pass {
            Pass::Compute { entry, threads } => {
                let size = entry_of(&program.reflected, entry).workgroup_size;
                let pipeline = program.compute(device, entry);
                Pipeline::Compute { pipeline, groups: self.groups(*threads, size, node) }
            }
            Pass::Draw { vertex, fragment, shape, vertices, count, targets, depth, clear } => {
                let memory = |parity| {
                    targets.iter().map(move |target| self.memory[self.slot(node, *target, parity)].target())
                };
                let textures = || memory(0).map(|(texture, _)| texture);
                let raster = Raster {
                    vertex: vertex.to_string(),
                    fragment: fragment.to_string(),
                    topology: match shape {
                        Shape::Points => wgpu::PrimitiveTopology::PointList,
                        Shape::Lines => wgpu::PrimitiveTopology::LineList,
                        Shape::Triangles => wgpu::PrimitiveTopology::TriangleList,
                    },
                    formats: textures().map(wgpu::Texture::format).collect(),
                    depth_test: *depth,
                };
                let depth = depth.then(|| {
                    let size = textures().next().expect("checked: a draw has a target").size();
                    let dims = Dims { width: size.width, height: size.height };
                    let (format, usage) =
                        (wgpu::TextureFormat::Depth32Float, wgpu::TextureUsages::RENDER_ATTACHMENT);
                    device.create_texture(&texture(dims, format, usage)).create_view(&Default::default())
                });
                Pipeline::Raster {
                    pipeline: program.raster(device, &raster),
                    vertices: self.list_length(node, *count) * vertices,
                    targets: [0, 1].map(|parity| memory(parity).map(|(_, view)| view.clone()).collect()),
                    depth,
                    clear: *clear,
                }
            }
        }
    }

    /// Checks that the device can run as many workgroups as the passes have.
    fn check_groups(&self, reflected: &Reflected, node: NodeId) -> Result<(), String> {
        let limit = self.gpu.device.limits().max_compute_workgroups_per_dimension;
        for pass in &self.graph.nodes[node].declaration().passes {
            let Pass::Compute { entry, threads } = pass else { continue };
            let size = entry_of(reflected, entry).workgroup_size;
            if let Groups::Known([x, y]) = self.groups(*threads, size, node)
                && x.max(y) > limit
            {
                let [width, height, _] = size;
                return Err(format!(
                    "`{entry}` has {x}x{y} workgroups of {width}x{height} threads, but {limit} along an axis are the \
                     limit; for lists, a workgroup of one row such as @workgroup_size(64) allows more"
                ));
            }
        }
        Ok(())
    }

    fn groups(&self, threads: Threads, size: [u32; 3], node: NodeId) -> Groups {
        let dims = &self.graph.nodes[node].dims;
        let list = |count: usize| in_rows(count, size[0]);
        Groups::Known(match threads {
            Threads::Over(at) => {
                let dims = dims[at.port as usize];
                if size[1] > 1 {
                    [dims.width.div_ceil(size[0]), dims.height.div_ceil(size[1])]
                } else {
                    list(dims.count())
                }
            }
            Threads::Blocks(at, n) => list(dims[at.port as usize].count().div_ceil(n as usize)),
            Threads::Groups(count) => [count, 1],
            Threads::Indirect(at) => {
                let buffer = |parity| self.memory[self.slot(node, at, parity)].buffer().clone();
                return Groups::InBuffer([0, 1].map(buffer));
            }
        })
    }

    fn list_length(&self, node: NodeId, at: FieldRef) -> u32 {
        let value = self.plan.nodes[node].value(at);
        value.map_or(0, |value| self.plan.storages[value.storage].dims.count() as u32)
    }

    fn slot(&self, node: NodeId, at: FieldRef, parity: usize) -> SlotId {
        let value = self.plan.nodes[node].value(at).expect("checked: connected");
        self.plan.slot(value, Side::Gpu, parity)
    }

    fn bind(
        &self,
        pipeline: &Pipeline,
        reflected: &Reflected,
        pass: &Pass,
        id: NodeId,
        parity: usize,
        params: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let node = &self.graph.nodes[id];
        let mut used: Vec<usize> =
            pass.entries().flat_map(|name| &entry_of(reflected, name).uses).copied().collect();
        used.sort_unstable();
        used.dedup();
        let entries: Vec<wgpu::BindGroupEntry> = used
            .into_iter()
            .map(|variable| {
                let variable = &reflected.variables[variable];
                let resource = match variable.name.as_str() {
                    "frame" => self.frame.as_entire_binding(),
                    "params" => params.as_entire_binding(),
                    reflect::CHECKS => self.watch.expect("only watched shaders have checks").1.checks(id),
                    name => {
                        let field = node.declaration().field(name).expect("checked: a port binds it");
                        self.memory[self.slot(id, field, parity)].binding()
                    }
                };
                wgpu::BindGroupEntry { binding: variable.binding, resource }
            })
            .collect();
        let layout = match pipeline {
            Pipeline::Compute { pipeline, .. } => pipeline.get_bind_group_layout(0),
            Pipeline::Raster { pipeline, .. } => pipeline.get_bind_group_layout(0),
        };
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&node.name),
            layout: &layout,
            entries: &entries,
        })
    }
}

/// The numbers of workgroups along x and y for this many threads, of which a workgroup has `width` in a row.
pub(super) fn in_rows(threads: usize, width: u32) -> [u32; 2] {
    let groups = u32::try_from(threads.div_ceil(width as usize)).unwrap_or(u32::MAX).max(1);
    let x = groups.min(MAX_GROUPS_X);
    [x, groups.div_ceil(x)]
}

fn entry_of<'r>(reflected: &'r Reflected, name: &str) -> &'r Entry {
    reflected.entry(name).expect("checked: every pass has its entry point").1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_have_a_thread_for_each_element_in_rows_of_workgroups() {
        let most = MAX_GROUPS_X as usize;
        for (threads, width, expected) in [
            (0, 64, [1, 1]),
            (1, 64, [1, 1]),
            (64, 64, [1, 1]),
            (65, 64, [2, 1]),
            (most, 1, [MAX_GROUPS_X, 1]),
            (64 * most - 1, 64, [MAX_GROUPS_X, 1]),
            (64 * most + 1, 64, [MAX_GROUPS_X, 2]),
            (2 * most + 1, 1, [MAX_GROUPS_X, 3]),
            (usize::MAX, 1, [MAX_GROUPS_X, u32::MAX.div_ceil(MAX_GROUPS_X)]),
        ] {
            assert_eq!(in_rows(threads, width), expected, "{threads} threads, {width} in a workgroup");
        }
    }
}
