//! Chooses the nodes of a point set that show it in enough detail, and brings their blocks to where they are decoded
//! (`algorithms.md` section 6, step 8).
//!
//! From frame to frame, few nodes change. Their blocks stay in a list of words that is kept; only those of nodes that
//! are new to the cut are written, and uploaded if the next stage runs on the GPU.

mod cache;
mod cut;

use std::sync::{Arc, Mutex, PoisonError};

use epigraph_core::{CpuContext, Extent, Finding, Io, Out, Site, Stage, params};
use epigraph_scenes::{Scene, streams::PointSet};

use crate::{
    World, column, facts,
    meaning::{STREAM_NODES, STREAM_NUMBERS, STREAM_POOLS, STREAM_WORDS},
    shared::{
        streams::{
            BRICKS, MOST_GROUPS, NEW_BYTES, NO_ATTRIBUTE, NODES, NUMBERS, POINTS, POOLS, START_STEP,
            StreamNode, StreamPool, VERTICES, write_block,
        },
        words::count,
    },
};
use cache::Cache;
use cut::{Chooser, Limits, Placed};

/// Words in a MiB.
const MIB: u32 = 1 << 18;

params! {
    /// Parameters of [`StreamCut`].
    pub struct StreamCutParams {
        /// Split nodes whose cells are larger than this in the image.
        cell: f32 = 1.0, in 0.05..=1000.0, unit "pixels";
        /// Merge nodes again when the cells of the larger one are smaller than this share of `cell`. Below 1, a camera
        /// that moves to and fro does not split and merge with every step.
        merge: f32 = 0.7, in 0.0..=1.0;
        /// Most points of a cut, for each pixel of the image. Give `stream_decode` the same number.
        points_per_pixel: f32 = 4.0, in 0.01..=256.0, unit "points/pixel";
        /// Memory for blocks; 0: as much as the blocks of all nodes take. Otherwise the cut takes up to half of it, so
        /// that blocks find room as nodes come and go.
        cache: u32 = 0, in 0..=4095, unit "MiB";
        /// Most bytes of new blocks in a frame. A larger block still comes, alone.
        upload: u32 = 4096, in 1..=4194303, unit "KiB";
    }
}

/// See the module.
pub struct StreamCut {
    words: Out<u32>,
    nodes: Out<StreamNode>,
    pools: Out<StreamPool>,
    starts: Out<u32>,
    numbers: Out<u32>,
    state: Mutex<Option<State>>,
}

/// What is kept between frames.
struct State {
    scene: Arc<Scene>,
    chooser: Chooser,
    cache: Cache,
    /// The cut that the lists are of.
    written: Option<Vec<Placed>>,
}

impl Stage for StreamCut {
    const KIND: &'static str = "stream_cut";
    const DOC: &'static str = "Chooses the nodes of a point set that show it in enough detail.";
    type Params = StreamCutParams;

    fn declare(params: &StreamCutParams, io: &mut Io) -> Self {
        io.column(column::P1);
        let memory = match params.cache {
            0 => facts::STREAM_WORDS.list(),
            mib => Extent::Fixed([mib * MIB, 1]),
        };
        let words = io.persistent("words", STREAM_WORDS, memory);
        let nodes = io.persistent("nodes", STREAM_NODES, facts::STREAM_NODES.list());
        let pools = io.persistent("pools", STREAM_POOLS, facts::STREAM_POOLS.list());
        let starts = io.persistent(
            "starts",
            "The pool of every 256th point.",
            Extent::PerPixel(params.points_per_pixel / START_STEP as f32),
        );
        let numbers = io.persistent("numbers", STREAM_NUMBERS, Extent::Fixed([NUMBERS, 1]));
        Self { words, nodes, pools, starts, numbers, state: Mutex::default() }
    }

    fn cpu(&self, params: &StreamCutParams, cx: &CpuContext) -> Result<(), String> {
        let tracer = cx.host::<World>()?.at(cx.frame().index);
        let scene = tracer.scene();
        let points = points_of(scene)?;
        let memory = cx.dims(self.words).count();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let state = match &mut *state {
            Some(state) if Arc::ptr_eq(&state.scene, scene) => state,
            state => {
                let (nodes, compiled) = (points.placed(|_| 1), cx.dims(self.nodes).count());
                if nodes != compiled {
                    return Err(format!(
                        "the graph was compiled for a point set of {compiled} nodes, this one has {nodes}; compile it again"
                    ));
                }
                let cache = Cache::new(points.nodes().count(), memory as u32);
                state.insert(State {
                    scene: scene.clone(),
                    chooser: Chooser::new(points),
                    cache,
                    written: None,
                })
            }
        };

        let (frame, per_pixel) = (cx.frame(), f64::from(params.points_per_pixel));
        let limits = Limits {
            cell: params.cell,
            merge: params.merge * params.cell,
            slots: epigraph_core::share_of(frame.size, per_pixel),
            words: if params.cache == 0 { memory } else { memory / 2 } as u64,
            new_words: u64::from(params.upload) * 256,
        };
        let State { chooser, cache, written, .. } = state;
        chooser.choose(&frame.view, frame.size, &limits, |node| cache.place(node).is_none());
        let (cut, words_of) = (&chooser.cut, |node: usize| chooser.branch(node).words);
        if chooser.slots() > limits.slots {
            return Err(format!(
                "the coarsest view of the point set has {} points, the image has room for {}: raise points_per_pixel of \
                 this stage and of the one that decodes, or show a larger image",
                chooser.slots(),
                limits.slots
            ));
        }
        cache.hold(&chooser.blocks, words_of).ok_or_else(|| {
            let words: u64 = chooser.blocks.iter().map(|&node| u64::from(words_of(node))).sum();
            format!("the blocks to show take {} bytes: raise cache from {} MiB", 4 * words, params.cache)
        })?;
        if cache.new.is_empty() {
            cx.unchanged(self.words);
        }
        let words = &mut cx.write(self.words);
        for &node in &cache.new {
            let place = cache.place(node).expect("the cut has a place");
            let place = place.start as usize..place.end as usize;
            write_block(points.node(node), &mut words[place.clone()]);
            cx.changed(self.words, place);
        }
        let was_still = cx.write(self.numbers)[NEW_BYTES as usize] == 0;
        if cache.new.is_empty() && was_still && written.as_ref() == Some(cut) {
            cx.unchanged(self.nodes);
            cx.unchanged(self.pools);
            cx.unchanged(self.starts);
            cx.unchanged(self.numbers);
            return Ok(());
        }
        self.write_lists(cx, points, chooser, cache);
        written.get_or_insert_default().clone_from(cut);
        Ok(())
    }

    fn explain(&self, _: &StreamCutParams, site: &Site) -> Option<Vec<Finding>> {
        let numbers = site.wrote(self.numbers)?;
        let of = |place: u32| numbers[place as usize] as usize;
        let cut = format!(
            "{}, {}, {}",
            count(of(NODES), "node"),
            count(of(POOLS), "pool"),
            count(of(POINTS), "point")
        );
        Some(vec![
            Finding::value("cut", cut),
            Finding::value("new in this frame", count(of(NEW_BYTES), "byte")),
        ])
    }
}

impl StreamCut {
    /// Writes what leads from points to words.
    fn write_lists(&self, cx: &CpuContext, set: &PointSet, chooser: &Chooser, cache: &Cache) {
        let new_words: u32 = cache.new.iter().map(|&node| chooser.branch(node).words).sum();
        let (nodes, pools) = (&mut cx.write(self.nodes)[..], &mut cx.write(self.pools)[..]);
        let (mut points, mut vertices, mut pool_count) = (0, 0, 0);
        for (at, &Placed { place, node: index }) in chooser.cut.iter().enumerate() {
            let (node, placed) = (set.node(index), &set.places()[place]);
            let frame = node.frame();
            let first = cache.place(index).expect("the cut has a place").start;
            let [x, y, z] = frame.axes.map(|axis| (placed.rotation * axis).into());
            nodes[at] = StreamNode {
                origin: placed.apply(frame.origin).into(),
                cell: frame.cell,
                x,
                colors: NO_ATTRIBUTE,
                y,
                normals: NO_ATTRIBUTE,
                z,
                first_point: points,
                rotation: placed.rotation.into(),
                index: index as u32,
                level: chooser.branch(index).level,
                place: place as u32,
                pad: 0,
            };
            let mut place = first;
            let mut next = |length: usize| {
                let start = place;
                place += length as u32;
                start
            };
            let mut push = |pool: StreamPool, vertex_count: usize, point_count: usize| {
                pools[pool_count] =
                    StreamPool { node: at as u32, first_vertex: vertices, first_point: points, ..pool };
                pool_count += 1;
                vertices += vertex_count as u32;
                points += point_count as u32;
            };
            for (number, pool) in node.pools().iter().enumerate() {
                let lists = StreamPool {
                    tag_words: pool.words() as u32,
                    translations: if pool.is_of_bricks() { BRICKS } else { next(pool.translations().len()) },
                    vertices: next(pool.vertices().len()),
                    tags: next(pool.tags().len()),
                    number: number as u32,
                    ..StreamPool::default()
                };
                push(lists, pool.vertices().len(), pool.points());
            }
            if !node.singles().is_empty() {
                let (number, vertices) = (node.pools().len() as u32, next(node.singles().len()));
                let singles = StreamPool { vertices, number, ..StreamPool::default() };
                push(singles, node.singles().len(), node.singles().len());
            }
            let mut attribute =
                |values: Option<&[u32]>| values.map_or(NO_ATTRIBUTE, |values| next(values.len()));
            (nodes[at].colors, nodes[at].normals) = (attribute(node.colors()), attribute(node.normals()));
        }
        let starts = &mut cx.write(self.starts)[..];
        let mut pool = 0;
        for (start, first) in starts.iter_mut().zip((0..points).step_by(START_STEP as usize)) {
            while pool + 1 < pool_count && pools[pool + 1].first_point <= first {
                pool += 1;
            }
            *start = pool as u32;
        }
        let numbers = &mut cx.write(self.numbers)[..];
        let groups = [vertices.min(MOST_GROUPS), vertices.div_ceil(MOST_GROUPS), 1];
        numbers[..3].copy_from_slice(&groups);
        for (place, value) in [
            (POINTS, points),
            (VERTICES, vertices),
            (POOLS, pool_count as u32),
            (NODES, chooser.cut.len() as u32),
            (NEW_BYTES, 4 * new_words),
        ] {
            numbers[place as usize] = value;
        }
    }
}

/// The point set of a scene.
fn points_of(scene: &Scene) -> Result<&Arc<PointSet>, String> {
    scene.points.as_ref().ok_or_else(|| {
        let name = &scene.name;
        format!(
            "the scene `{name}` has no points. Make some of its surfaces: `epigraph encode {name} --out points.vts`, \
             then render with `--scene points.vts`"
        )
    })
}
