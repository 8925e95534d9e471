//! Surfaces for tests.

use glam::{DQuat, DVec3, Vec3};

use super::Surface;
use crate::testing::Random;

/// A surface that owns what it is made of.
#[derive(Clone, Debug, Default)]
pub(super) struct Solid {
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) normals: Option<Vec<Vec3>>,
    pub(super) colors: Option<Vec<[u8; 4]>>,
    pub(super) materials: Option<Vec<u32>>,
}

impl Solid {
    pub(super) fn surface(&self) -> Surface<'_> {
        Surface {
            positions: &self.positions,
            triangles: &self.triangles,
            normals: self.normals.as_deref(),
            colors: self.colors.as_deref(),
            materials: self.materials.as_deref(),
            ..Surface::default()
        }
    }

    /// Several in one mesh. All have the same attributes.
    pub(super) fn all(solids: &[Self]) -> Self {
        let mut all = Self::default();
        for solid in solids {
            let first = all.positions.len() as u32;
            all.positions.extend(&solid.positions);
            all.triangles.extend(solid.triangles.iter().map(|corners| corners.map(|vertex| first + vertex)));
            solid.materials.iter().for_each(|own| all.materials.get_or_insert_default().extend(own));
            solid.normals.iter().for_each(|own| all.normals.get_or_insert_default().extend(own));
            solid.colors.iter().for_each(|own| all.colors.get_or_insert_default().extend(own));
        }
        all
    }

    pub(super) fn moved(&self, by: Vec3) -> Self {
        self.turned(DQuat::IDENTITY, by.as_dvec3())
    }

    /// Turned and moved in double precision, then rounded, as tools that bake transformations do at best.
    pub(super) fn turned(&self, rotation: DQuat, by: DVec3) -> Self {
        let mut turned = self.clone();
        turned.positions.iter_mut().for_each(|at| *at = (rotation * at.as_dvec3() + by).as_vec3());
        turned
            .normals
            .iter_mut()
            .flatten()
            .for_each(|normal| *normal = (rotation * normal.as_dvec3()).as_vec3());
        turned
    }

    /// Its mirror image, with the front still outside.
    pub(super) fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        mirrored.positions.iter_mut().for_each(|at| at.x = -at.x);
        mirrored.normals.iter_mut().flatten().for_each(|normal| normal.x = -normal.x);
        mirrored.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
        mirrored
    }

    /// Each triangle with vertices of its own.
    pub(super) fn soup(&self) -> Self {
        let each = |corners: &[u32; 3]| *corners;
        let corners: Vec<usize> =
            self.triangles.iter().flat_map(each).map(|vertex| vertex as usize).collect();
        Self {
            positions: corners.iter().map(|&vertex| self.positions[vertex]).collect(),
            triangles: (0..self.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            normals: self.normals.as_ref().map(|all| corners.iter().map(|&vertex| all[vertex]).collect()),
            colors: self.colors.as_ref().map(|all| corners.iter().map(|&vertex| all[vertex]).collect()),
            materials: self.materials.clone(),
        }
    }

    /// Vertices and triangles in another order, and triangles beginning at other corners.
    pub(super) fn shuffled(&self, random: &mut Random) -> Self {
        let order = |count: usize, random: &mut Random| {
            let mut order: Vec<usize> = (0..count).collect();
            (1..count).for_each(|i| order.swap(i, random.below(i as u32 + 1) as usize));
            order
        };
        let vertices = order(self.positions.len(), random);
        let mut index = vec![0; vertices.len()];
        (0..).zip(&vertices).for_each(|(new, &old)| index[old] = new);
        let triangles = order(self.triangles.len(), random);
        let corners = |&old: &usize| {
            let mut corners = self.triangles[old].map(|vertex| index[vertex as usize]);
            corners.rotate_left(random.below(3) as usize);
            corners
        };
        Self {
            positions: vertices.iter().map(|&old| self.positions[old]).collect(),
            triangles: triangles.iter().map(corners).collect(),
            normals: self.normals.as_ref().map(|all| vertices.iter().map(|&old| all[old]).collect()),
            colors: self.colors.as_ref().map(|all| vertices.iter().map(|&old| all[old]).collect()),
            materials: self.materials.as_ref().map(|all| triangles.iter().map(|&old| all[old]).collect()),
        }
    }
}

/// A box around the origin.
pub(super) fn cuboid(half: Vec3) -> Solid {
    prism(
        &[
            Vec3::new(-1.0, 0.0, -1.0),
            Vec3::new(-1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, -1.0),
        ]
        .map(|at| at * half),
        half.y,
    )
}

/// A closed prism from -`half` to `half` along y over an outline that is counter-clockwise seen from above.
pub(super) fn prism(outline: &[Vec3], half: f32) -> Solid {
    let n = outline.len() as u32;
    let at = |y: f32| outline.iter().map(move |at| Vec3::new(at.x, y, at.z));
    let mut triangles = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    for i in 1..n - 1 {
        triangles.extend([[0, i + 1, i], [n, n + i, n + i + 1]]);
    }
    Solid { positions: at(-half).chain(at(half)).collect(), triangles, ..Solid::default() }
}

/// A regular prism of `sides` sides.
pub(super) fn drum(sides: u32, radius: f32, half: f32) -> Solid {
    let corner = |i: u32| {
        let angle = std::f32::consts::TAU * i as f32 / sides as f32;
        Vec3::new(radius * angle.sin(), 0.0, radius * angle.cos())
    };
    prism(&(0..sides).map(corner).collect::<Vec<_>>(), half)
}

/// A grid of quads over a closed or open strip: vertex (i, j) of `columns` x `rows` is at `point(i, j)`; both ends may
/// be joined.
pub(super) fn grid(columns: u32, rows: u32, closed: [bool; 2], point: impl Fn(u32, u32) -> Vec3) -> Solid {
    let (wide, high) = (columns - u32::from(!closed[0]), rows - u32::from(!closed[1]));
    let at = |i: u32, j: u32| j % rows * columns + i % columns;
    let quad = |i: u32, j: u32| {
        [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
    };
    Solid {
        positions: (0..rows)
            .flat_map(|j| (0..columns).map(move |i| (i, j)))
            .map(|(i, j)| point(i, j))
            .collect(),
        triangles: (0..high).flat_map(|j| (0..wide).flat_map(move |i| quad(i, j))).collect(),
        ..Solid::default()
    }
}

/// A closed ring of `columns` facets around, and `around` facets around its wire.
pub(super) fn torus(columns: u32, around: u32) -> Solid {
    grid(columns, around, [true; 2], |i, j| {
        let [turn, angle] =
            [(i, columns), (j, around)].map(|(i, n)| std::f32::consts::TAU * i as f32 / n as f32);
        let radius = 1.0 + 0.3 * angle.cos();
        Vec3::new(radius * turn.cos(), 0.3 * angle.sin(), radius * turn.sin())
    })
}

/// A sphere of `columns` facets around and `rows` rings between two poles.
pub(super) fn sphere(columns: u32, rows: u32) -> Solid {
    let mut solid = grid(columns, rows, [true, false], |i, j| {
        let latitude = std::f32::consts::PI * ((j + 1) as f32 / (rows + 1) as f32 - 0.5);
        let longitude = std::f32::consts::TAU * i as f32 / columns as f32;
        Vec3::new(latitude.cos() * longitude.sin(), latitude.sin(), latitude.cos() * longitude.cos())
    });
    let south = solid.positions.len() as u32;
    solid.positions.extend([Vec3::NEG_Y, Vec3::Y]);
    for i in 0..columns {
        let j = (i + 1) % columns;
        let top = (rows - 1) * columns;
        solid.triangles.extend([[south, j, i], [south + 1, top + i, top + j]]);
    }
    solid
}

/// A vector with components from -1 to 1.
pub(super) fn signed(random: &mut Random) -> DVec3 {
    DVec3::from([0; 3].map(|_| 2.0 * f64::from(random.unit()) - 1.0))
}

/// A rotation, not quite uniformly distributed.
pub(super) fn rotation(random: &mut Random) -> DQuat {
    let axis = signed(random);
    DQuat::from_xyzw(axis.x, axis.y, axis.z, signed(random).x + 0.01).normalize()
}
