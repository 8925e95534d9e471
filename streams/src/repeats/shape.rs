//! Shapes, and where they are.

use glam::{DVec3, Mat3, Quat, Vec3};

/// The most bits of a coordinate: single precision has as many.
pub(super) const MOST_BITS: u32 = 24;

/// The bits that a number needs.
pub(super) fn bits_of(number: u32) -> u32 {
    u32::BITS - number.leading_zeros()
}

/// The grid of a shape's vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Where cell (0, 0, 0) is.
    pub(super) low: Vec3,
    /// The distance from cell to cell.
    pub(super) step: f32,
    /// The bits that the cells' coordinates need, along each axis.
    pub(super) bits: [u32; 3],
}

impl Grid {
    /// The coarsest grid on which no point is farther than `error` from its cell, and the cells of one point or more.
    /// A grid of [`MOST_BITS`] if that is too coarse.
    pub(super) fn quantize(points: &[DVec3], error: f64) -> (Self, Vec<[u32; 3]>) {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.iter().fold(nothing, |(low, high), &at| (low.min(at), high.max(at)));
        let finest = (high - low).max_element() / f64::from((1 << MOST_BITS) - 1);
        // The centre of a cube is half its diagonal from a corner.
        let step = (2.0 / 3_f64.sqrt() * error).max(finest) as f32;
        let step = step.max(f32::MIN_POSITIVE);
        let low = low.as_vec3();
        let most = f64::from((1_u32 << MOST_BITS) - 1);
        let cell = |at: &DVec3| {
            let along = (*at - low.as_dvec3()) / f64::from(step);
            along.to_array().map(|along| along.round().clamp(0.0, most) as u32)
        };
        let cells: Vec<[u32; 3]> = points.iter().map(cell).collect();
        let bits = [0, 1, 2].map(|axis| cells.iter().map(|cell| bits_of(cell[axis])).fold(0, u32::max));
        (Self { low, step, bits }, cells)
    }

    pub(super) fn position(&self, cell: [u32; 3]) -> Vec3 {
        self.low + self.step * Vec3::from(cell.map(|along| along as f32))
    }
}

/// A part in a frame of its own: the centre of its vertices is the origin, its axes are the principal ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    pub(super) grid: Grid,
    pub(super) cells: Vec<[u32; 3]>,
    pub(super) normals: Option<Vec<u32>>,
    pub(super) colors: Option<Vec<[u8; 4]>>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// The number of vertices. A position that has several normals or colours is as many vertices.
    pub fn vertex_count(&self) -> usize {
        self.cells.len()
    }

    /// The position of a vertex.
    pub fn position(&self, vertex: usize) -> Vec3 {
        self.grid.position(self.cells[vertex])
    }

    /// The positions of all vertices.
    pub fn positions(&self) -> impl ExactSizeIterator<Item = Vec3> {
        self.cells.iter().map(|&cell| self.grid.position(cell))
    }

    /// The bits in which a position is stored.
    pub fn bits(&self) -> u32 {
        self.grid.bits.iter().sum()
    }

    /// The direction of the surface at each vertex, as [`pack_normal`](crate::pack_normal) has it.
    pub fn normals(&self) -> Option<&[u32]> {
        self.normals.as_deref()
    }

    /// The colour of each vertex: sRGB, and alpha.
    pub fn colors(&self) -> Option<&[[u8; 4]]> {
        self.colors.as_deref()
    }

    /// The vertices of each triangle, with the winding of the surface.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
}

/// A shape at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The shape by its index.
    pub shape: u32,
    /// A unit quaternion: the rotation from the shape's frame to the surface's.
    pub rotation: Quat,
    /// Where the origin of the shape's frame is.
    pub translation: Vec3,
    /// The material of all its triangles.
    pub material: Option<u32>,
}

impl Instance {
    /// Takes positions from the shape's frame to the surface's, in single precision.
    pub fn place(&self) -> impl Fn(Vec3) -> Vec3 {
        let (turn, by) = (Mat3::from_quat(self.rotation), self.translation);
        move |at| turn * at + by
    }
}

/// A surface as shapes and their instances.
#[derive(Clone, Debug, PartialEq)]
pub struct Repeats {
    pub(super) shapes: Vec<Shape>,
    pub(super) instances: Vec<Instance>,
    pub(super) deviation: f32,
    pub(super) origin: DVec3,
}

impl Repeats {
    /// The same with another origin.
    pub(crate) fn at(self, origin: DVec3) -> Self {
        Self { origin, ..self }
    }

    /// What to add to all positions.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The different parts, in the order in which the surface first has them.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// All parts, shape by shape.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The largest distance of a vertex from its place in the surface.
    pub fn deviation(&self) -> f32 {
        self.deviation
    }

    /// The instances of each shape.
    pub fn instances_by_shape(&self) -> impl Iterator<Item = (&Shape, &[Instance])> {
        self.instances
            .chunk_by(|a, b| a.shape == b.shape)
            .map(|instances| (&self.shapes[instances[0].shape as usize], instances))
    }

    /// The number of vertices of all instances.
    pub fn vertex_count(&self) -> usize {
        self.instances.iter().map(|instance| self.shapes[instance.shape as usize].vertex_count()).sum()
    }

    /// The positions of all vertices of the surface: instance by instance, each in the order of its shape.
    pub fn positions(&self) -> Vec<Vec3> {
        let placed = |instance: &Instance| {
            let place = instance.place();
            self.shapes[instance.shape as usize].positions().map(place).collect::<Vec<_>>()
        };
        self.instances.iter().flat_map(placed).collect()
    }
}
