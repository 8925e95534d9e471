//! Points for tests, by formulas that the reference program repeats.

use glam::Vec3;

use crate::{cell::Cell, points::Points};

/// The generator of Numerical Recipes; the upper bits are the good ones.
pub(crate) struct Random(pub(crate) u32);

impl Random {
    pub(crate) fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0 >> 8
    }

    pub(crate) fn below(&mut self, limit: u32) -> u32 {
        self.next() % limit
    }

    /// From 0 to 1.
    pub(crate) fn unit(&mut self) -> f32 {
        self.next() as f32 / (1 << 24) as f32
    }

    /// At most this many cells within an extent, in order.
    pub(crate) fn cells(&mut self, count: usize, extent: [u32; 3]) -> Vec<Cell> {
        in_order((0..count).map(|_| extent.map(|extent| self.below(extent) as i32)).collect())
    }

    /// 7 bits, the upper ones.
    fn seven(&mut self) -> i32 {
        (self.next() >> 17) as i32
    }
}

fn in_order(places: Vec<[i32; 3]>) -> Vec<Cell> {
    let mut cells: Vec<Cell> = places.into_iter().map(|at| Cell::new(at).expect("in the grid")).collect();
    cells.sort();
    cells.dedup();
    cells
}

/// A curved surface above the whole x-y plane of the grid: 16,384 cells.
pub(crate) fn patch() -> Vec<Cell> {
    let height = |x: i32, y: i32| 10 + (x * x + 2 * y * y) / 700 + x * y / 512;
    in_order((0..128).flat_map(|y| (0..128).map(move |x| [x, y, height(x, y)])).collect())
}

/// 3000 cells at random.
pub(crate) fn scatter() -> Vec<Cell> {
    let mut random = Random(1);
    in_order((0..3000).map(|_| [0; 3].map(|_| random.seven())).map(|[z, y, x]| [x, y, z]).collect())
}

/// A part of 60 cells at random, at 8 places.
pub(crate) fn repeats() -> Vec<Cell> {
    let [mut parts, mut places] = [Random(2), Random(3)];
    let part: Vec<[i32; 3]> = (0..60).map(|_| [0; 3].map(|_| parts.seven() / 4)).collect();
    let places: Vec<[i32; 3]> = (0..8).map(|_| [0; 3].map(|_| places.seven() / 2)).collect();
    let at = |a: [i32; 3], b: [i32; 3]| [2, 1, 0].map(|axis| a[axis] + b[axis]);
    in_order(places.iter().flat_map(|&place| part.iter().map(move |&cell| at(place, cell))).collect())
}

/// A bumpy sphere, as a scan of one would be: points at random on its surface, with a little noise.
pub(crate) fn scan(count: usize, seed: u32) -> Vec<Vec3> {
    let mut random = Random(seed);
    let mut signed = || 2.0 * random.unit() - 1.0;
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let at = Vec3::new(signed(), signed(), signed());
        if at.length_squared() <= 1.0 && at != Vec3::ZERO {
            let at = at.normalize();
            let radius = 1.0 + 0.1 * (5.0 * at.x + 1.0).sin() * (4.0 * at.y).cos() + 0.0005 * signed();
            points.push(at * radius * Vec3::new(1.0, 0.8, 0.5));
        }
    }
    points
}

/// Points whose colours and normals follow from their places.
pub(crate) fn colored(positions: Vec<Vec3>) -> Points {
    let color = |at: &Vec3| {
        let [r, g, b] = (at * 97.0).to_array().map(|along| along.rem_euclid(256.0) as u8);
        [r, g, b, r ^ g]
    };
    Points {
        colors: Some(positions.iter().map(color).collect()),
        normals: Some(positions.clone()),
        ..Points::from(positions)
    }
}
