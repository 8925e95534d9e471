//! Smooths edges without additional samples: a pixel that an edge cuts in two mixes its own colour, that of its primary
//! region, with the colour of a neighbour beyond the edge, by area (`algorithms.md` section 2.8).
//!
//! Crossings are known to 1/8 of a pixel's side, so the area differs from the exact coverage of a straight edge by at
//! most 1/16, on average 1/70.

use std::f32::consts::FRAC_1_SQRT_2;

use epigraph_core::{
    CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, constants, params, texel,
};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{self, JOINS, RADIANCE},
    shared::edge_pixel::{
        CLASS, Chord, DIRECTIONS, EMPTY, PIXEL_AREA, PRIMARY_IS_A, RUN, SIMPLE, ends, primary_area,
    },
};

#[path = "explain/antialias.rs"]
mod explain;

constants! {
    /// The bit of a nibble of N8: the pixel's secondary region and the neighbour's primary region are joined.
    const SECONDARY_TO_PRIMARY: u32 = 4;
}

choice! {
    /// Which neighbour lends the colour of the secondary region.
    pub enum Neighbour {
        /// Of the neighbours whose primary region joins the secondary, the one most nearly perpendicular to the edge.
        Best,
        /// The mean of all of those, weighted by how nearly perpendicular to the edge they are.
        Average,
        /// None: edges stay jagged.
        Off,
    }
}

params! {
    /// Parameters of [`Antialias`].
    pub struct AntialiasParams {
        /// Which neighbour lends the colour of the secondary region.
        neighbour: Neighbour = Neighbour::Best;
    }
}

/// See the module.
pub struct Antialias {
    primary: In<texel::Rgba32Float>,
    cls: In<u32>,
    n8: In<u32>,
    color: Out<texel::Rgba32Float>,
}

impl Stage for Antialias {
    const KIND: &'static str = "antialias";
    const DOC: &'static str =
        "Mixes the colours of both sides of an edge in the pixels that it cuts, by area.";
    type Params = AntialiasParams;

    fn declare(_: &AntialiasParams, io: &mut Io) -> Self {
        io.column(column::I2);
        io.per_view();
        let pixels = || Extent::Frame(1);
        let primary = io.read("primary", RADIANCE.doc("Linear radiance of the primary regions."), pixels());
        let cls = io.read("cls", meaning::CLASS, pixels());
        let n8 = io.read("n8", JOINS, pixels());
        let color = io.write("color", RADIANCE.doc("Linear radiance of whole pixels."), pixels());
        io.shader(shader!("antialias"));
        io.constants(CONSTANTS);
        io.dispatch("antialias", color);
        Self { primary, cls, n8, color }
    }

    fn cpu(&self, params: &AntialiasParams, cx: &CpuContext) -> Result<(), String> {
        let width = cx.dims(self.color).width as usize;
        let (primary, color) = (&cx.read(self.primary)[..], &mut cx.write(self.color)[..]);
        let (cls, n8) = (&cx.read(self.cls)[..], &cx.read(self.n8)[..]);
        color.par_chunks_mut(width).enumerate().for_each(|(y, color)| {
            let row = y * width;
            color.copy_from_slice(&primary[row..][..width]);
            for (first, cls) in (0..width).step_by(RUN).zip(cls[row..][..width].chunks(RUN)) {
                // Most pixels are empty: the bits of all together say whether those of the group are.
                if cls.iter().fold(0, |bits, cls| bits | cls) & CLASS == EMPTY
                    || params.neighbour == Neighbour::Off
                {
                    continue;
                }
                for (x, &cls) in (first..).zip(cls).filter(|(_, cls)| **cls & CLASS == SIMPLE) {
                    let at = |[dx, dy]: [i32; 2]| {
                        let (x, y) = (x.checked_add_signed(dx as isize)?, y.checked_add_signed(dy as isize)?);
                        if x < width { primary.get(y * width + x) } else { None }
                    };
                    color[x] = blend(params.neighbour, cls, n8[row + x], color[x], at);
                }
            }
        });
        Ok(())
    }

    fn explain(&self, params: &AntialiasParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// The colour of a simple pixel, from its primary region's and those of the neighbours at offsets from it.
fn blend<'a>(
    rule: Neighbour,
    cls: u32,
    n8: u32,
    own: [f32; 4],
    neighbour: impl Fn([i32; 2]) -> Option<&'a [f32; 4]>,
) -> [f32; 4] {
    let weights = weights(rule, cls, n8, |d| neighbour(DIRECTIONS[d]).is_some());
    let (mut beyond, mut total) = ([0.0; 3], 0.0);
    for (d, weight) in weights.into_iter().enumerate().filter(|(_, weight)| *weight > 0.0) {
        if let Some([r, g, b, _]) = neighbour(DIRECTIONS[d]) {
            beyond = [beyond[0] + r * weight, beyond[1] + g * weight, beyond[2] + b * weight];
            total += weight;
        }
    }
    if total == 0.0 {
        return own;
    }
    let share = primary_area(cls) as f32 / PIXEL_AREA as f32;
    let mix = |channel: usize| own[channel] * share + beyond[channel] / total * (1.0 - share);
    [mix(0), mix(1), mix(2), own[3]]
}

/// Each neighbour's weight in the colour of a simple pixel's secondary region; 0 for those that do not contribute.
fn weights(rule: Neighbour, cls: u32, n8: u32, exists: impl Fn(usize) -> bool) -> [f32; 8] {
    let [p, q] = ends(cls);
    let normal = Chord::new(p, q).normal;
    let towards_secondary = if cls & PRIMARY_IS_A != 0 { normal.map(|n| -n) } else { normal };
    let (mut weights, mut best) = ([0.0; 8], 0.0);
    for d in (0..8).filter(|&d| n8 >> (4 * d) & SECONDARY_TO_PRIMARY != 0 && exists(d)) {
        let square = squareness(towards_secondary, d);
        match rule {
            Neighbour::Best if square > best => {
                (weights, best) = ([0.0; 8], square);
                weights[d] = square;
            }
            Neighbour::Average if square > 0.0 => weights[d] = square,
            _ => {}
        }
    }
    weights
}

/// How nearly perpendicular to an edge the neighbour in direction `d` lies: the edge's normal projected on that
/// direction.
fn squareness([x, y]: [i32; 2], d: usize) -> f32 {
    let [dx, dy] = DIRECTIONS[d];
    let along = (x * dx + y * dy) as f32;
    if d.is_multiple_of(2) { along } else { along * FRAC_1_SQRT_2 }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        edge_pixel::{AREA_SHIFT, COMPLEX, EMPTY, P_SHIFT, Q_SHIFT, area_of_a, class_of, ring},
        testing::{Random, run_alike, run_both, run_cpu, settings},
    };

    /// A simple pixel.
    fn simple(p: u32, q: u32, primary_is_a: bool) -> u32 {
        let area = if primary_is_a { area_of_a(p, q) } else { PIXEL_AREA - area_of_a(p, q) };
        let primary = if primary_is_a { PRIMARY_IS_A } else { 0 };
        SIMPLE | p << P_SHIFT | q << Q_SHIFT | primary | area << AREA_SHIFT
    }

    fn harness(neighbour: Neighbour, size: [u32; 2], pixels: &[([f32; 4], u32, u32)]) -> Harness<Antialias> {
        let mut harness = Harness::new(AntialiasParams { neighbour }, &settings(size, 0));
        harness.set("primary", &pixels.iter().map(|pixel| pixel.0).collect::<Vec<_>>());
        harness.set("cls", &pixels.iter().map(|pixel| pixel.1).collect::<Vec<_>>());
        harness.set("n8", &pixels.iter().map(|pixel| pixel.2).collect::<Vec<_>>());
        harness
    }

    /// The resulting colour of the middle of 3x3 pixels with the given class and reachability. Its own colour is 1,
    /// that of its neighbour in direction d is 10 + d.
    fn middle(neighbour: Neighbour, cls: u32, n8: u32) -> f32 {
        let mut pixels = [([1.0; 4], EMPTY, 0); 9];
        pixels[4].1 = cls;
        pixels[4].2 = n8;
        for (d, [dx, dy]) in (0..).zip(DIRECTIONS) {
            pixels[(4 + dx + 3 * dy) as usize].0 = [10.0 + d as f32; 4];
        }
        let color = run_alike(&mut harness(neighbour, [3, 3], &pixels)).get::<[f32; 4]>("color");
        pixels[4].0 = color[4];
        assert_eq!(color, pixels.map(|pixel| pixel.0), "only the middle pixel may change");
        color[4][0]
    }

    #[test]
    fn golden_directions() {
        // Example E10 of algorithms.md section 2.6: primary above, area 320, neighbour S (2); then below, 192, N (6).
        let mix = |area: f32, neighbour: f32| (area + (512.0 - area) * (10.0 + neighbour)) / 512.0;
        assert_eq!(middle(Neighbour::Best, simple(14, 28, false), 0x1116_4469), mix(320.0, 2.0));
        assert_eq!(middle(Neighbour::Best, simple(14, 28, true), 0x4449_1196), mix(192.0, 6.0));
        assert_eq!(middle(Neighbour::Off, simple(14, 28, true), 0x4449_1196), 1.0);
        // The dangling edge's pixel (3, 2): primary on the left, the secondary joins E, SE, S and NE only.
        assert_eq!(middle(Neighbour::Best, simple(4, 19, false), 0x4911_5554), mix(288.0, 0.0));
    }

    #[test]
    fn the_next_best_neighbour_is_used_if_the_best_is_not_joined() {
        // The normal of the chord 14..28 towards B is (6, -16) in 1/16 pixel: the best neighbours are N, then NE, NW
        // and E; the others are on the other side.
        let join = |directions: &[u32]| directions.iter().map(|d| 4 << (4 * d)).sum::<u32>();
        let of = |neighbour, directions: &[u32]| middle(neighbour, simple(14, 28, true), join(directions));
        let mix = |neighbour: f32| 1.0 * 0.375 + neighbour * 0.625;
        let cases: [(&[u32], f32); 5] = [
            (&[0, 5, 6, 7], 16.0),
            (&[0, 5, 7], 17.0),
            (&[0, 1, 5], 15.0),
            (&[0, 1, 4], 10.0),
            (&[1, 2, 3, 4], 1.0),
        ];
        for (directions, expected) in cases {
            assert!((of(Neighbour::Best, directions) - mix(expected)).abs() < 1e-5, "{directions:?}");
        }
        // Only neighbours beyond the edge count: the dot products are 16 and 22 / sqrt 2.
        let mean = (16.0 * 16.0 + 17.0 * 22.0 / 2f32.sqrt()) / (16.0 + 22.0 / 2f32.sqrt());
        assert!((of(Neighbour::Average, &[6, 7, 1]) - mix(mean)).abs() < 1e-5);
        assert_eq!(of(Neighbour::Average, &[1, 2, 3]), 1.0);
    }

    #[test]
    fn only_simple_pixels_change() {
        assert_eq!(middle(Neighbour::Best, EMPTY, u32::MAX), 1.0);
        assert_eq!(middle(Neighbour::Average, COMPLEX, u32::MAX), 1.0);
    }

    #[test]
    fn the_coverage_of_straight_edges_is_accurate_to_a_sixteenth() {
        let mut random = Random(3);
        let (mut worst, mut sum, mut count) = (0f64, 0.0, 0);
        while count < 3000 {
            // A line through the middle pixel of 3x3; white where x cos a + y sin a > d, black elsewhere.
            let angle = f64::from(random.between(0.0, std::f32::consts::TAU));
            let (normal_x, normal_y) = (angle.cos(), angle.sin());
            let through = [0; 2].map(|_| f64::from(random.between(0.0, 1.0)));
            let side = |[x, y]: [f64; 2]| (x - through[0]) * normal_x + (y - through[1]) * normal_y;
            // The crossings of the line with the sides of the pixel: at x = 0 and 1, then at y = 0 and 1.
            let mask = |at: f64| if (0.0..1.0).contains(&at) { 1 << (at * 8.0) as u32 } else { 0 };
            let at_x = |x: f64| mask(through[1] - (x - through[0]) * normal_x / normal_y);
            let at_y = |y: f64| mask(through[0] - (y - through[1]) * normal_y / normal_x);
            let ring = ring(at_x(0.0), at_y(0.0), at_x(1.0), at_y(1.0));
            if class_of(ring) != SIMPLE {
                continue;
            }
            let (p, q) = (ring.trailing_zeros(), 31 - ring.leading_zeros());
            // Region A is white if its first corner is: corners are at slots 8, 16 and 24 of the ring.
            let corner = [(8, [1.0, 0.0]), (16, [1.0, 1.0]), (24, [0.0, 1.0])];
            let Some((_, place)) = corner.into_iter().find(|&(slot, _)| p < slot && slot <= q) else {
                continue;
            };
            let a_is_white = side(place) > 0.0;
            // The primary region is white: its neighbours are black if their primary region joins the secondary.
            let cls = simple(p, q, a_is_white);
            let joined = (0..8).filter(|&d| {
                let [dx, dy] = DIRECTIONS[d as usize].map(f64::from);
                side([0.5 + dx, 0.5 + dy]) < 0.0
            });
            let n8 = joined.map(|d| 4 << (4 * d)).sum();
            let mut pixels = [([0.0; 4], EMPTY, 0); 9];
            pixels[4] = ([1.0; 4], cls, n8);
            let color = run_cpu(&mut harness(Neighbour::Best, [3, 3], &pixels)).get::<[f32; 4]>("color");
            let error = (f64::from(color[4][0]) - coverage(&side)).abs();
            worst = worst.max(error);
            sum += error;
            count += 1;
        }
        // algorithms.md section 2.8 measured a mean of 0.0143 and a maximum of 1/16.
        assert!(worst <= 1.0 / 16.0, "{worst}");
        assert!(worst > 0.03 && sum / f64::from(count) < 0.018, "{worst} {}", sum / f64::from(count));
    }

    /// The exact area of the part of the unit square in which a linear function is positive.
    fn coverage(side: &impl Fn([f64; 2]) -> f64) -> f64 {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0f64]];
        let mut polygon: Vec<[f64; 2]> = Vec::new();
        for (i, a) in corners.into_iter().enumerate() {
            let b = corners[(i + 1) % 4];
            let (at_a, at_b) = (side(a), side(b));
            if at_a > 0.0 {
                polygon.push(a);
            }
            if (at_a > 0.0) != (at_b > 0.0) {
                let t = at_a / (at_a - at_b);
                polygon.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
            }
        }
        let next = |i: usize| polygon[(i + 1) % polygon.len()];
        let cross = |i: usize| polygon[i][0] * next(i)[1] - next(i)[0] * polygon[i][1];
        (0..polygon.len()).map(cross).sum::<f64>() / 2.0
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(17);
        // Arbitrary bits, also at the image's border.
        let pixels: Vec<_> = (0..61 * 43)
            .map(|_| {
                let color = [0; 4].map(|_| random.between(0.0, 4.0));
                let p = random.below(31);
                let q = p + 1 + random.below(31 - p);
                let cls = [EMPTY, simple(p, q, random.below(2) == 0), COMPLEX][random.below(3) as usize];
                (color, cls, random.bits())
            })
            .collect();
        for neighbour in [Neighbour::Best, Neighbour::Average, Neighbour::Off] {
            let both = run_both(&mut harness(neighbour, [61, 43], &pixels));
            // A few sums, a division and a mix of numbers below 4.
            both.assert_close("color", 2e-6);
            let primary: Vec<_> = pixels.iter().map(|pixel| pixel.0).collect();
            assert_eq!(both.gpu.get::<[f32; 4]>("color") == primary, neighbour == Neighbour::Off);
        }
    }
}
