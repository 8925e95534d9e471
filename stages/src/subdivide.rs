//! Colours complex pixels by quarters (`algorithms.md` sections 2.2 and 2.11): an option of the original that its GPU
//! version dropped, off by default.
//!
//! Regions of a complex pixel are unknown, so `interpolate` mixes all samples around it, and colours bleed. But most
//! quarters of such a pixel are empty or simple. `edge_raster` with `middle` records where edges cross the two lines
//! through each pixel's middle. With these, the 3x3 pixels around a complex one become 6x6 quarters, and the rules for
//! pixels hold for quarters (sections 2.3 to 2.5):
//!
//! - **Classes.** A quarter's perimeter is a ring of 16 slots, four a side, clockwise from its top left corner: the
//!   outer sides are halves of the pixel's sides, the inner ones halves of its middle lines. With at most one crossing
//!   it is empty, one region; with two it is simple, and the chord between the slots' centres parts region A from
//!   region B; with more it is complex. So are the quarters outside of the image.
//! - **Reachability.** For quarters that share a side, the regions are joined that touch along an interval between
//!   crossings. A region reaches another if some shortest path from quarter to quarter, over shared sides, leads
//!   through joined regions: the direct paths. A complex quarter joins nothing.
//! - **Samples.** A sample belongs to the quarter, and to the region of it, that contains its sub-pixel cell. If the
//!   chord touches the cell, or the quarter is complex, the sample does not count.
//!
//! Each region of the pixel's four quarters takes the mean of the samples that it reaches, weighted by a Gaussian of
//! their distance from the quarter's centre. If it reaches none, it takes the mean of the colours of the pixels around,
//! each at those of its corners that are in its primary region and that the region reaches: these colours come from
//! farther away, but across no edge either. If there are none, or the quarter is complex, it keeps the pixel's colour,
//! the mean over 5x5. The pixel is the mean of the regions, by area; it needs no other anti-aliasing. No other pixel
//! changes.

use std::cell::LazyCell;

use epigraph_core::{Access, CpuContext, Extent, In, Io, Out, Stage, constants, params, texel};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{self, CELL, CROSSINGS, ID, POINTS, RADIANCE},
    shared::{
        cloud::{NO_POINT, decode_radiance},
        edge_pixel::{
            CLASS, COMPLEX, Chord, EMPTY, P_SHIFT, PIXEL_AREA, PRIMARY_IS_A, Q_SHIFT, SIMPLE, area_of_arc,
            chain, class_of, ends, joined, region, transpose,
        },
    },
};

constants! {
    /// Pixels along an axis of the neighbourhood, itself included.
    const PIXELS: usize = 3;
    /// Quarters along that axis.
    const SPAN: usize = 2 * PIXELS;
    /// All of these quarters.
    const QUARTERS: usize = SPAN * SPAN;
    /// The area of a quarter, in 1/512 pixel.
    const QUARTER_AREA: u32 = PIXEL_AREA / 4;
}

/// Number of distances along an axis, in 1/32 pixel, from the centre of one of the pixel's own quarters to a tap: the
/// window's sides are 40 and 56 away.
const DISTANCES: usize = 57;

/// The four quarters of the pixel itself.
const OWN: [[usize; 2]; 4] = [[2, 2], [3, 2], [2, 3], [3, 3]];

params! {
    /// Parameters of [`Subdivide`].
    pub struct SubdivideParams {
        /// Standard deviation of the Gaussian. It has little influence, as few samples are reached.
        sigma: f32 = 0.5, in 0.3..=2.0, unit "px";
        /// Bits of the cells in `subpixel`, as in `project`.
        subpixel_bits: u32 = 8, in 2..=8, unit "bits";
    }
}

/// See the module.
pub struct Subdivide {
    radiance: In<u32>,
    id: In<u32>,
    subpixel: In<u32>,
    mask: In<u32>,
    cls: In<u32>,
    primary: In<texel::Rgba32Float>,
    color: Out<texel::Rgba32Float>,
}

impl Stage for Subdivide {
    const KIND: &'static str = "subdivide";
    const DOC: &'static str =
        "Colours complex pixels by quarters, each from the samples that no edge separates from it.";
    type Params = SubdivideParams;

    fn declare(_: &SubdivideParams, io: &mut Io) -> Self {
        io.column(column::I2);
        io.per_view();
        let mut cloud = io.bundle(Access::Read, "cloud", POINTS, Extent::Any);
        let radiance = cloud.read("radiance");
        let pixels = || Extent::Frame(1);
        let id = io.read("id", ID, pixels());
        let subpixel = io.read("subpixel", CELL, pixels());
        let mask = io.read(
            "mask",
            CROSSINGS.doc(
                "Crossings with the left and top side of each pixel, and with its middle lines: set `middle` in \
                 `edge_raster`.",
            ),
            Extent::Corners,
        );
        let cls = io.read("cls", meaning::CLASS, pixels());
        let primary = io.read("primary", RADIANCE.doc("Linear radiance of the primary regions."), pixels());
        let color = io.write(
            "color",
            RADIANCE.doc("The same, but that of the whole pixel in complex pixels."),
            pixels(),
        );
        io.shader(shader!("subdivide"));
        io.constants(CONSTANTS);
        io.dispatch("subdivide", color);
        Self { radiance, id, subpixel, mask, cls, primary, color }
    }

    fn cpu(&self, params: &SubdivideParams, cx: &CpuContext) -> Result<(), String> {
        let (width, height) = (cx.dims(self.color).width as usize, cx.dims(self.color).height as usize);
        let image = Image {
            radiance: &cx.read(self.radiance),
            id: &cx.read(self.id),
            subpixel: &cx.read(self.subpixel),
            mask: &cx.read(self.mask),
            cls: &cx.read(self.cls),
            primary: &cx.read(self.primary),
            size: [width, height],
            cells_log2: params.subpixel_bits / 2,
            weights: weights(params.sigma),
        };
        cx.write(self.color).par_chunks_mut(width).enumerate().for_each(|(y, color)| {
            for (x, color) in color.iter_mut().enumerate() {
                let p = y * width + x;
                let is_complex = image.cls[p] & CLASS == COMPLEX;
                *color = if is_complex { image.color([x, y]) } else { image.primary[p] };
            }
        });
        Ok(())
    }
}

/// The perimeter of a quarter from the 4-bit masks of its sides.
fn quarter_ring(left: u32, top: u32, right: u32, bottom: u32) -> u32 {
    let reversed = |mask: u32| mask.reverse_bits() >> 28;
    top | right << 4 | reversed(bottom) << 8 | reversed(left) << 12
}

/// Class and chord of a quarter, in the bits of `cls`, with A as the primary region.
fn classify(ring: u32) -> u32 {
    let class = class_of(ring) | PRIMARY_IS_A;
    if class & CLASS == SIMPLE {
        class | ring.trailing_zeros() << P_SHIFT | (31 - ring.leading_zeros()) << Q_SHIFT
    } else {
        class
    }
}

/// Centre of a slot, in 1/16 pixel from the quarter's top left corner.
fn slot_position(slot: u32) -> [i32; 2] {
    let along = 2 * (slot & 3) as i32 + 1;
    match slot >> 2 {
        0 => [along, 0],
        1 => [8, along],
        2 => [8 - along, 8],
        _ => [0, 8 - along],
    }
}

/// The areas of a quarter's regions, in 1/512 pixel.
fn areas(quarter: u32) -> [u32; 2] {
    if quarter & CLASS != SIMPLE {
        return [QUARTER_AREA, 0];
    }
    let slots = ends(quarter);
    let a = area_of_arc(slots, slots.map(slot_position), [(4, [8, 0]), (8, [8, 8]), (12, [0, 8])]);
    [a, QUARTER_AREA - a]
}

/// The region of a quarter that contains a square cell, if one does: `corner` is its top left one and `size` the length
/// of its sides, in 1/16 pixel.
fn region_of_cell(quarter: u32, corner: [i32; 2], size: i32) -> Option<u32> {
    if quarter & CLASS != SIMPLE {
        return (quarter & CLASS == EMPTY).then_some(0);
    }
    let [p, q] = ends(quarter).map(slot_position);
    let chord = Chord::between(p, q);
    // Twice the chord's function at the cell's centre, and its maximum difference to that at a corner.
    let distance = chord.side(corner) + chord.side(corner.map(|at| at + size));
    let reach = size * (chord.normal[0].abs() + chord.normal[1].abs());
    (distance.abs() > reach).then_some(u32::from(distance < 0))
}

/// The quarters of the 3x3 pixels around one, row by row.
struct Window {
    /// Class and chord of each.
    quarters: [u32; QUARTERS],
    /// The matrices of each quarter and its right (bits 0 to 3) and lower (4 to 7) neighbours.
    pairs: [u32; QUARTERS],
}

impl Window {
    /// For each quarter, the matrix of this one and it: which regions reach which.
    fn reached(&self, [column, row]: [usize; 2]) -> [u32; QUARTERS] {
        let mut reached = [0; QUARTERS];
        let start = SPAN * row + column;
        reached[start] = [1, 9, 0][(self.quarters[start] & CLASS) as usize];
        // Outwards, so that the quarters a step nearer are ready: from the start to the end, then back to the
        // beginning.
        for i in 0..SPAN {
            let v = if row + i < SPAN { row + i } else { SPAN - 1 - i };
            for j in 0..SPAN {
                let u = if column + j < SPAN { column + j } else { SPAN - 1 - j };
                let q = SPAN * v + u;
                if u > column {
                    reached[q] |= chain(reached[q - 1], self.pairs[q - 1] & 15);
                } else if u < column {
                    reached[q] |= chain(reached[q + 1], transpose(self.pairs[q] & 15));
                }
                if v > row {
                    reached[q] |= chain(reached[q - SPAN], self.pairs[q - SPAN] >> 4);
                } else if v < row {
                    reached[q] |= chain(reached[q + SPAN], transpose(self.pairs[q] >> 4));
                }
            }
        }
        reached
    }
}

/// A colour somewhere in the window.
#[derive(Clone, Copy)]
struct Tap {
    /// The quarter in which it lies.
    quarter: usize,
    /// The region of that.
    region: u32,
    /// The place, in 1/32 pixel from the window's top left corner.
    at: [i32; 2],
    rgb: [f32; 3],
}

/// The stage's inputs.
struct Image<'a> {
    radiance: &'a [u32],
    id: &'a [u32],
    subpixel: &'a [u32],
    mask: &'a [u32],
    cls: &'a [u32],
    primary: &'a [[f32; 4]],
    size: [usize; 2],
    /// Logarithm of the number of cells of an axis of a pixel, 1 to 4.
    cells_log2: u32,
    weights: [f32; DISTANCES],
}

/// The Gaussian of each distance along an axis, in 1/32 pixel.
fn weights(sigma: f32) -> [f32; DISTANCES] {
    let scale = 0.5 / (32.0 * 32.0 * sigma * sigma);
    std::array::from_fn(|distance| (-((distance * distance) as f32) * scale).exp())
}

impl Image<'_> {
    /// The colour of a complex pixel.
    fn color(&self, pixel: [usize; 2]) -> [f32; 4] {
        let window = self.window(pixel);
        let samples: [Option<Tap>; PIXELS * PIXELS] =
            std::array::from_fn(|place| self.sample(&window, pixel, place));
        // Not needed if all regions reach samples.
        let corners = LazyCell::new(|| -> [Option<Tap>; QUARTERS] {
            std::array::from_fn(|quarter| self.corner(&window, pixel, quarter))
        });

        let [r, g, b, alpha] = self.primary[pixel[1] * self.size[0] + pixel[0]];
        let mut sum = [0.0; 3];
        for [u, v] in OWN {
            let reached = window.reached([u, v]);
            for (region, area) in (0..).zip(areas(window.quarters[SPAN * v + u])) {
                if area == 0 {
                    continue;
                }
                let mean = |taps: &[Option<Tap>]| self.mean(taps, &reached, [u, v], region);
                let rgb = mean(&samples).or_else(|| mean(&*corners)).unwrap_or([r, g, b]);
                for (sum, channel) in sum.iter_mut().zip(rgb) {
                    *sum += area as f32 * channel;
                }
            }
        }
        let [r, g, b] = sum.map(|channel| channel / PIXEL_AREA as f32);
        [r, g, b, alpha]
    }

    /// The mean of the taps that a region of a quarter reaches, or `None`.
    fn mean(
        &self,
        taps: &[Option<Tap>],
        reached: &[u32; QUARTERS],
        quarter: [usize; 2],
        region: u32,
    ) -> Option<[f32; 3]> {
        let centre = quarter.map(|index| 16 * index as i32 + 8);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for tap in taps.iter().flatten() {
            if reached[tap.quarter] >> (2 * region + tap.region) & 1 == 0 {
                continue;
            }
            let [x, y] = [0, 1].map(|axis| self.weights[tap.at[axis].abs_diff(centre[axis]) as usize]);
            let weight = x * y;
            for (sum, channel) in sum.iter_mut().zip(tap.rgb) {
                *sum += weight * channel;
            }
            total += weight;
        }
        (total > 0.0).then(|| sum.map(|channel| channel / total))
    }

    /// The pixel at a position among the 3x3 around one, if it is in the image.
    fn neighbour(&self, pixel: [usize; 2], place: [usize; 2]) -> Option<usize> {
        let x = (pixel[0] + place[0]).checked_sub(1)?;
        let y = (pixel[1] + place[1]).checked_sub(1)?;
        (x < self.size[0] && y < self.size[1]).then_some(y * self.size[0] + x)
    }

    /// The sample at a position among the 3x3 pixels, if there is one and its region is known.
    fn sample(&self, window: &Window, pixel: [usize; 2], place: usize) -> Option<Tap> {
        let place = [place % PIXELS, place / PIXELS];
        let p = self.neighbour(pixel, place)?;
        if self.id[p] == NO_POINT {
            return None;
        }
        let size = 16 >> self.cells_log2;
        let last = (1 << self.cells_log2) - 1;
        let cell = [self.subpixel[p] & last, self.subpixel[p] >> self.cells_log2 & last];
        // The cell's corner in 1/16 pixel from the window's.
        let corner = [0, 1].map(|axis| 16 * place[axis] as i32 + size * cell[axis] as i32);
        let quarter = SPAN * (corner[1] >> 3) as usize + (corner[0] >> 3) as usize;
        let region = region_of_cell(window.quarters[quarter], corner.map(|at| at & 7), size)?;
        let rgb = decode_radiance(self.radiance[self.id[p] as usize]);
        Some(Tap { quarter, region, at: corner.map(|at| 2 * at + size), rgb })
    }

    /// The colour of the quarter's pixel, at the corner that they share, if that is in the primary region.
    fn corner(&self, window: &Window, pixel: [usize; 2], quarter: usize) -> Option<Tap> {
        let (u, v) = (quarter % SPAN, quarter / SPAN);
        let cls = self.cls[self.neighbour(pixel, [u / 2, v / 2])?];
        // Clockwise from the top left one.
        let nth = [[0, 1], [3, 2]][v % 2][u % 2];
        if (cls | window.quarters[quarter]) & COMPLEX != 0 || region(cls, 32 * nth) != 0 {
            return None;
        }
        let region = region(window.quarters[quarter], 16 * nth);
        let at = [u, v].map(|index| 16 * (index + index % 2) as i32);
        let [r, g, b, _] = self.primary[self.neighbour(pixel, [u / 2, v / 2])?];
        Some(Tap { quarter, region, at, rgb: [r, g, b] })
    }

    /// Classes and matrices of the quarters around a pixel.
    fn window(&self, pixel: [usize; 2]) -> Window {
        let mut window = Window { quarters: [COMPLEX; QUARTERS], pairs: [0; QUARTERS] };
        let inside = |q: usize| self.neighbour(pixel, [q % SPAN / 2, q / SPAN / 2]).is_some();
        // In half pixels; not used outside the image.
        let place =
            |q: usize| [(2 * pixel[0] + q % SPAN).wrapping_sub(2), (2 * pixel[1] + q / SPAN).wrapping_sub(2)];
        for q in (0..QUARTERS).filter(|&q| inside(q)) {
            let [x, y] = place(q);
            let (left, right) = (self.side([x, y], 0), self.side([x + 1, y], 0));
            let (top, bottom) = (self.side([x, y], 1), self.side([x, y + 1], 1));
            window.quarters[q] = classify(quarter_ring(left, top, right, bottom));
        }
        for q in (0..QUARTERS).filter(|&q| inside(q)) {
            let [x, y] = place(q);
            let quarter = |q: usize| window.quarters[q];
            if q % SPAN + 1 < SPAN {
                let right = self.side([x + 1, y], 0);
                window.pairs[q] = joined(quarter(q), quarter(q + 1), || right, 4, |t| [16 + t, 64 - t]);
            }
            if q + SPAN < QUARTERS {
                let bottom = self.side([x, y + 1], 1);
                window.pairs[q] |= joined(quarter(q), quarter(q + SPAN), || bottom, 4, |t| [48 - t, t]) << 4;
            }
        }
        window
    }

    /// The four slots of the left (axis 0) or top (axis 1) side of a quarter, given its column and row in the image.
    fn side(&self, [x, y]: [usize; 2], axis: usize) -> u32 {
        let word = self.mask[y / 2 * (self.size[0] + 1) + x / 2];
        let (line, along) = if axis == 0 { (x, y) } else { (y, x) };
        word >> (16 * (line % 2) + 8 * axis + 4 * (along % 2)) & 15
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        cloud::encode_radiance,
        edge_pixel::{area_of_a, ring, testing::Mask},
        testing::{Random, run_both, run_cpu, settings},
    };

    /// The cell of 16x16 below and to the right of the centre.
    const CENTER: u32 = 8 * 16 + 8;

    /// The stage's inputs, with grey colours.
    struct Input {
        mask: Mask,
        cls: Vec<u32>,
        primary: Vec<f32>,
        /// The grey value and the cell of each pixel's sample.
        samples: Vec<Option<(f32, u32)>>,
    }

    impl Input {
        /// Inputs with the classes of `classify` without samples, and with black colours.
        fn new(mask: Mask) -> Self {
            let [width, height] = mask.size.map(|side| side as usize);
            let word = |x: usize, y: usize| mask.words[y * (width + 1) + x];
            let class = |p: usize| {
                let (x, y) = (p % width, p / width);
                let [left, top] = [word(x, y) & 0xFF, word(x, y) >> 8 & 0xFF];
                let ring = ring(left, top, word(x + 1, y) & 0xFF, word(x, y + 1) >> 8 & 0xFF);
                if class_of(ring) != SIMPLE {
                    return class_of(ring) | PRIMARY_IS_A;
                }
                let (p, q) = (ring.trailing_zeros(), 31 - ring.leading_zeros());
                let larger = if 2 * area_of_a(p, q) >= PIXEL_AREA { PRIMARY_IS_A } else { 0 };
                SIMPLE | p << P_SHIFT | q << Q_SHIFT | larger
            };
            let pixels = width * height;
            let cls = (0..pixels).map(class).collect();
            Self { mask, cls, primary: vec![0.0; pixels], samples: vec![None; pixels] }
        }

        fn harness(&self, params: SubdivideParams) -> Harness<Subdivide> {
            let mut harness = Harness::new(params, &settings(self.mask.size, 0));
            // The cloud has a point for each pixel, with or without a sample.
            let gray = |sample: &Option<(f32, u32)>| sample.map_or(0.0, |sample| sample.0);
            let radiance = self.samples.iter().map(|sample| encode_radiance([gray(sample); 3]));
            harness.set("cloud.radiance", &radiance.collect::<Vec<u32>>());
            let id = |(p, sample): (u32, &Option<_>)| if sample.is_some() { p } else { NO_POINT };
            harness.set("id", &(0..).zip(&self.samples).map(id).collect::<Vec<u32>>());
            let cell = |sample: &Option<(f32, u32)>| sample.map_or(0, |sample| sample.1);
            harness.set("subpixel", &self.samples.iter().map(cell).collect::<Vec<u32>>());
            harness.set("mask", &self.mask.words);
            harness.set("cls", &self.cls);
            harness.set("primary", &self.primary.iter().map(|&gray| [gray; 4]).collect::<Vec<_>>());
            harness
        }

        /// The red of a pixel, computed on the CPU and compared with the shader.
        fn red(&self, p: usize) -> f32 {
            let both = run_both(&mut self.harness(SubdivideParams::default()));
            // Sums and quotients of numbers up to 1000, and exponential functions with relative errors of about 1e-6.
            both.assert_close("color", 2e-2);
            both.cpu.get::<[f32; 4]>("color")[p][0]
        }
    }

    /// A horizontal and a vertical line through the middle one of 3x3 pixels, 3/16 pixel from its corner. They cross in
    /// its first quarter and divide the image into four parts.
    fn crossing_lines() -> Input {
        let mut mask = Mask::new([3, 3]).with_middle();
        mask.line([-256, 304], [1024, 304]);
        mask.line([304, -256], [304, 1024]);
        let mut input = Input::new(mask);
        input.primary[4] = 10.0;
        input
    }

    /// The colour of the middle pixel of [`crossing_lines`] if its first quarter has colour 10, from the colours of the
    /// parts of the image. For example, the second quarter has 3/16 of a pixel by a half above the line, and 5/16
    /// below.
    fn parted([above, left, rest]: [f32; 3]) -> f32 {
        (128.0 * 10.0 + 48.0 * above + 48.0 * left + (80.0 + 80.0 + 128.0) * rest) / 512.0
    }

    #[test]
    fn quarters_of_crossing_lines_take_the_samples_of_their_part() {
        let mut input = crossing_lines();
        for (p, gray) in [(0, 1.0), (2, 2.0), (6, 3.0), (8, 4.0)] {
            input.samples[p] = Some((gray, CENTER));
        }
        let expected = parted([2.0, 3.0, 4.0]);
        assert!((input.red(4) - expected).abs() < 1e-5);
        // A sample in the complex quarter belongs to no part; neither does a sample whose cell touches a chord. To the
        // right of that quarter, the line touches row 3 of 16.
        input.samples[4] = Some((1000.0, 0));
        assert!((input.red(4) - expected).abs() < 1e-5);
        input.samples[4] = Some((1000.0, 3 * 16 + 12));
        assert!((input.red(4) - expected).abs() < 1e-5);
        // A sample whose cell is below the line counts.
        input.samples[4] = Some((1000.0, 4 * 16 + 12));
        assert!(input.red(4) > 100.0);
    }

    #[test]
    fn without_samples_the_colours_of_the_pixels_around_are_used() {
        // In pixels that a line cuts, the larger region is the primary one: below the line, or to its right.
        let mut input = crossing_lines();
        input.primary = vec![1.0, 2.0, 2.0, 3.0, 10.0, 4.0, 3.0, 4.0, 4.0];
        assert!((input.red(4) - parted([2.0, 3.0, 4.0])).abs() < 1e-5);
        // If a region reaches a sample, these colours do not count.
        input.samples[2] = Some((7.0, CENTER));
        assert!((input.red(4) - parted([7.0, 3.0, 4.0])).abs() < 1e-5);
        // Without either, the pixel keeps its colour: complex pixels around it do not count.
        for p in [0, 1, 2, 3, 5, 6, 7, 8] {
            input.cls[p] = COMPLEX;
        }
        input.samples[2] = None;
        assert_eq!(input.red(4), 10.0);
    }

    #[test]
    fn golden_ring_of_three_crossings() {
        // E9 of algorithms.md section 2.6 in the middle of 3x3 pixels. Its edge from left to right also crosses slot 0
        // of the middle line. So the first quarter is complex, and in the second the edge cuts off 1/16 pixel by a
        // half.
        let mut mask = Mask::new([3, 3]).with_middle();
        mask.words[4 + 1] = 1 | 1 << 8 | 1 << 16;
        mask.words[4 + 2] = 1;
        let mut input = Input::new(mask);
        assert_eq!(input.cls[4] & CLASS, COMPLEX);
        input.primary[4] = 10.0;
        input.samples[1] = Some((1.0, CENTER));
        input.samples[7] = Some((3.0, CENTER));
        let expected = (128.0 * 10.0 + 16.0 * 1.0 + (112.0 + 256.0) * 3.0) / 512.0;
        assert!((input.red(4) - expected).abs() < 1e-5);
    }

    #[test]
    fn only_direct_paths_lead_to_samples() {
        // An edge ends in the lower half of the middle pixel, so paths lead around its end. From the upper quarters
        // they are not direct, but the lower quarters, with centres at (1.25, 1.75) and (1.75, 1.75), reach the samples
        // on both sides. These are at 0.53125 and 2.53125 in x, and at 0.53125 in y.
        let mut mask = Mask::new([3, 3]).with_middle();
        mask.line([304, -256], [304, 416]);
        let mut input = Input::new(mask);
        input.cls[4] = COMPLEX;
        input.samples[0] = Some((1.0, CENTER));
        input.samples[2] = Some((2.0, CENTER));
        // 1 / (2 sigma^2) is 2. The distances in y are equal, so only those in x matter.
        let weight = |distance: f32| (-2.0 * distance * distance).exp();
        let mean = |centre: f32| {
            let [left, right] = [weight(centre - 0.53125), weight(centre - 2.53125)];
            (left + 2.0 * right) / (left + right)
        };
        let expected = (48.0 + 80.0 * 2.0 + 128.0 * (2.0 + mean(1.25) + mean(1.75))) / 512.0;
        assert!((input.red(4) - expected).abs() < 1e-5);
    }

    #[test]
    fn golden_quarters() {
        // The masks of the left, top, right and bottom side, slots, area of A in 1/512 pixel.
        let golden = [
            ([8, 0, 8, 0], [4 + 3, 12], 16),
            ([0, 1, 0, 1], [0, 11], 112),
            ([1, 1, 0, 0], [0, 15], 127),
            ([0, 8, 1, 0], [3, 4], 1),
            ([0b1010, 0, 0, 0], [12, 14], 0),
        ];
        for ([left, top, right, bottom], slots, area) in golden {
            let quarter = classify(quarter_ring(left, top, right, bottom));
            assert_eq!((quarter & CLASS, ends(quarter)), (SIMPLE, slots));
            assert_eq!(areas(quarter), [area, 128 - area]);
        }
        for (sides, class) in [([0; 4], EMPTY), ([0, 2, 0, 0], EMPTY), ([1, 1, 1, 0], COMPLEX)] {
            let [left, top, right, bottom] = sides;
            let quarter = classify(quarter_ring(left, top, right, bottom));
            assert_eq!((quarter & CLASS, areas(quarter)), (class, [128, 0]));
        }
        // Cells along the diagonal of a quarter that is cut by a chord from the middle of its left side to the middle
        // of its right side.
        let cut = classify(quarter_ring(2, 0, 2, 0));
        let regions = [0, 1, 2, 3, 4, 5, 6, 7].map(|at| region_of_cell(cut, [at, at], 1));
        let (a, b) = (Some(0), Some(1));
        assert_eq!(regions, [b, b, None, None, a, a, a, a]);
    }

    /// The windows of all pixels of an image.
    fn windows(mask: &Mask) -> Vec<Window> {
        let [width, height] = mask.size.map(|side| side as usize);
        let none = vec![NO_POINT; width * height];
        let image = Image {
            radiance: &[0],
            id: &none,
            subpixel: &none,
            mask: &mask.words,
            cls: &none,
            primary: &[],
            size: [width, height],
            cells_log2: 4,
            weights: weights(0.5),
        };
        (0..width * height).map(|p| image.window([p % width, p / width])).collect()
    }

    #[test]
    fn reachability_is_symmetric() {
        let mut mask = Mask::new([17, 13]).with_middle();
        mask.random_lines(9, &mut Random(21));
        let (mut parted, mut reached_both) = (0, 0);
        for window in windows(&mask) {
            let all: Vec<_> = (0..QUARTERS).map(|q| window.reached([q % SPAN, q / SPAN])).collect();
            let pairs = (0..QUARTERS).flat_map(|p| (0..QUARTERS).map(move |q| [p, q]));
            for [p, q] in pairs {
                assert_eq!(all[p][q], transpose(all[q][p]));
                parted += u32::from(all[p][q] == 0);
                reached_both += u32::from(all[p][q].count_ones() == 2);
            }
        }
        assert!(parted > 10_000 && reached_both > 5000, "{parted} {reached_both}");
    }

    #[test]
    fn a_line_separates_the_samples_and_pixels_are_mixed_by_area() {
        let mut random = Random(5);
        let (mut worst, mut sum, mut count) = (0f64, 0.0, 0);
        while count < 400 {
            // A line through the middle pixel of 3x3, from one side of the image to the other.
            let angle = f64::from(random.between(0.0, std::f32::consts::TAU));
            let [dx, dy] = [angle.cos(), angle.sin()];
            let through = [0; 2].map(|_| 384.0 + f64::from(random.between(-128.0, 128.0)));
            let end = |t: f64| [through[0] + t * dx, through[1] + t * dy].map(|at| at.round() as i64);
            let (a, b) = (end(-2000.0), end(2000.0));
            let mut mask = Mask::new([3, 3]).with_middle();
            mask.line(a, b);
            let mut input = Input::new(mask);
            input.cls[4] = COMPLEX;
            // Samples are 1 to the right of the line and 0 to its left, and there are four, in the corner pixels. If
            // both parts have samples, the picture shows both colours.
            let right = |x: f64, y: f64| {
                (x - a[0] as f64) * (b[1] - a[1]) as f64 > (y - a[1] as f64) * (b[0] - a[0]) as f64
            };
            for (p, [x, y]) in [(0, [0, 0]), (2, [2, 0]), (6, [0, 2]), (8, [2, 2])] {
                let cell = [x, y].map(|at| f64::from(256 * at + 128 + 8));
                input.samples[p] = Some((f32::from(right(cell[0], cell[1])), CENTER));
            }
            input.primary[4] = 100.0;
            let color = run_cpu(&mut input.harness(SubdivideParams::default())).get::<[f32; 4]>("color");
            if color[4][0] > 1.0 {
                // A region reaches no sample, and keeps the pixel's colour.
                continue;
            }
            let covered = (0..64 * 64)
                .filter(|at| right(258.0 + 4.0 * f64::from(at % 64), 258.0 + 4.0 * f64::from(at / 64)));
            let error = (f64::from(color[4][0]) - covered.count() as f64 / 4096.0).abs();
            worst = worst.max(error);
            sum += error;
            count += 1;
        }
        // A slot's centre is at most 1/16 pixel from the crossing, and so is the chord from the line.
        assert!(worst <= 1.0 / 16.0 + 0.01, "{worst}");
        assert!(sum / f64::from(count) < 0.02, "{}", sum / f64::from(count));
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(31);
        for (size, lines) in [([1, 1], 3), ([3, 40], 8), ([67, 45], 40)] {
            let mut mask = Mask::new(size).with_middle();
            mask.random_lines(lines, &mut random);
            let mut input = Input::new(mask);
            input.primary.iter_mut().for_each(|gray| *gray = random.between(0.0, 2.0));
            for p in 0..input.cls.len() {
                if random.below(3) == 0 {
                    input.samples[p] = Some((random.between(0.0, 2.0), random.below(256)));
                }
                // More complex pixels than the mask has.
                if random.below(4) == 0 {
                    input.cls[p] = COMPLEX;
                }
            }
            for subpixel_bits in [2, 4, 6, 8] {
                for sigma in [0.3, 0.5, 2.0] {
                    let both = run_both(&mut input.harness(SubdivideParams { sigma, subpixel_bits }));
                    // Means of numbers up to 2; their weights, down to e^-34, have a relative error of at most 1e-5.
                    both.assert_close("color", 2e-5);
                    let color = both.cpu.get::<[f32; 4]>("color");
                    for (p, color) in color.iter().enumerate() {
                        let is_complex = input.cls[p] & CLASS == COMPLEX;
                        assert!(is_complex || *color == [input.primary[p]; 4], "only complex pixels change");
                    }
                }
            }
        }
    }
}
