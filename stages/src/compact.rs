//! Collects the edges whose bits are set, in order: the last step of [`crate::silhouette`], and a stage of its own for
//! the CPU, where the papers did it.

use epigraph_core::{CpuContext, Extent, Facts, In, Io, Out, Rule, Stage};

use crate::{
    column, facts,
    meaning::{COUNT, DRAWN, EDGES, SILHOUETTES, VERTICES},
    shared::segments::{MeshEdge, Segment},
};

/// Words of 32 edges per parallel task.
const BLOCK: usize = 256;

/// The list of edges, and the output of a segment for each marked edge.
pub struct Compaction {
    vertices: In<[f32; 4]>,
    edges: In<MeshEdge>,
    segments: Out<Segment>,
    count: Out<u32>,
}

impl Compaction {
    /// Declares the outputs `segments` and `count`.
    pub fn declare(io: &mut Io, vertices: In<[f32; 4]>, edges: In<MeshEdge>) -> Self {
        let segments = io.write(
            "segments",
            SILHOUETTES.doc("The silhouettes, in the order of the edges."),
            facts::EDGES.list(),
        );
        const NUMBER: &[Rule] = &[Rule::count_of("silhouettes")];
        let doc = COUNT.doc("The number of silhouettes.").within(NUMBER);
        let count = io.write("count", doc, Extent::Fixed([1, 1]));
        Self { vertices, edges, segments, count }
    }

    /// Writes the segments of the edges whose bit of `drawn` is set.
    pub fn run(&self, cx: &CpuContext, drawn: &[u32]) {
        let (vertices, edges) = (&cx.read(self.vertices)[..], &cx.read(self.edges)[..]);
        let count = count_ones(drawn);
        cx.write(self.count)[0] = count as u32;
        let segment = |index: usize| {
            let edge = &edges[index];
            let [a, b] = edge.vertices.map(|vertex| {
                let [x, y, z, _] = vertices[vertex as usize];
                [x, y, z]
            });
            Segment { a, flags: 0, b, edge: index as u32 }
        };
        collect(drawn, 0, &segment, &mut cx.write(self.segments)[..count]);
    }
}

/// Writes the segment of each set bit of `words`, whose first bit has index `first`.
fn collect(
    words: &[u32],
    first: usize,
    segment: &(impl Fn(usize) -> Segment + Sync),
    segments: &mut [Segment],
) {
    if words.len() > BLOCK {
        let (low, high) = words.split_at(words.len() / 2);
        let (low_segments, high_segments) = segments.split_at_mut(count_ones(low));
        rayon::join(
            || collect(low, first, segment, low_segments),
            || collect(high, first + 32 * low.len(), segment, high_segments),
        );
        return;
    }
    let mut segments = segments.iter_mut();
    for (index, &word) in words.iter().enumerate() {
        let mut bits = word;
        while bits != 0 {
            let edge = first + 32 * index + bits.trailing_zeros() as usize;
            *segments.next().expect("one segment per bit") = segment(edge);
            bits &= bits - 1;
        }
    }
}

fn count_ones(words: &[u32]) -> usize {
    words.iter().map(|word| word.count_ones() as usize).sum()
}

/// See the module.
pub struct Compact {
    drawn: In<u32>,
    compaction: Compaction,
}

impl Stage for Compact {
    const KIND: &'static str = "compact";
    const DOC: &'static str = "Collects the silhouettes that a stage has marked, on the CPU.";
    type Params = ();

    fn declare(_: &(), io: &mut Io) -> Self {
        io.column(column::E1);
        io.per_view();
        let vertices = io.read("vertices", VERTICES, facts::VERTICES.list());
        let edges = io.read("edges", EDGES, facts::EDGES.list());
        let drawn = io.read("drawn", DRAWN, Extent::BitsOf("edges".into()));
        Self { drawn, compaction: Compaction::declare(io, vertices, edges) }
    }

    fn cpu(&self, _: &(), cx: &CpuContext) -> Result<(), String> {
        self.compaction.run(cx, &cx.read(self.drawn));
        Ok(())
    }

    fn needless(_: &(), facts: &Facts) -> Option<&'static str> {
        (facts.count(facts::FACES) == Some(0)).then_some("the scene has no faces")
    }
}
