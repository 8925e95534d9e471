//! A stage: its ports, parameters and CPU twin. The shader is `shaders/median.wgsl`.

use epigraph_core::{CpuContext, Extent, In, Io, Out, Stage, params, shader, texel::Rgba32Float};
use rayon::prelude::*;

params! {
    /// Parameters of [`Median`].
    pub struct MedianParams {
        /// How many times brighter than the median of its 3x3 pixels a pixel may be.
        factor: f32 = 2.0, in 0.0..=100.0;
    }
}

/// Replaces pixels that are much brighter than the 3x3 pixels around them by the median, in each channel by itself.
pub struct Median {
    color: In<Rgba32Float>,
    calm: Out<Rgba32Float>,
}

impl Stage for Median {
    const KIND: &'static str = "median";
    const DOC: &'static str = "Replaces pixels that are much brighter than the pixels around them.";
    type Params = MedianParams;

    fn declare(_: &MedianParams, io: &mut Io) -> Self {
        let color = io.read("color", "Linear radiance.", Extent::Frame(1));
        let calm = io.write("calm", "The same without bright single pixels.", Extent::Frame(1));
        io.shader(shader!("median"));
        io.dispatch("main", calm);
        Self { color, calm }
    }

    fn cpu(&self, params: &MedianParams, cx: &CpuContext) -> Result<(), String> {
        let (color, mut calm) = (cx.read(self.color), cx.write(self.calm));
        let color = &*color;
        let [width, height] = cx.frame().size.map(|side| side as usize);
        calm.par_iter_mut().enumerate().for_each(|(pixel, calm)| {
            let (x, y) = (pixel % width, pixel / width);
            // Pixels at the border stand in for those beyond it.
            let around: [[f32; 4]; 9] = std::array::from_fn(|i| {
                let x = (x + i % 3).saturating_sub(1).min(width - 1);
                let y = (y + i / 3).saturating_sub(1).min(height - 1);
                color[y * width + x]
            });
            *calm = std::array::from_fn(|channel| {
                let mut sorted = around.map(|color| color[channel]);
                sorted.sort_unstable_by(f32::total_cmp);
                let (here, median) = (color[pixel][channel], sorted[4]);
                if here > params.factor * median { median } else { here }
            });
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{
        Harness,
        testing::{Random, run_both, run_cpu, settings},
    };

    use super::*;

    #[test]
    fn a_bright_pixel_goes() {
        let mut harness = Harness::<Median>::new(MedianParams { factor: 2.0 }, &settings([3, 3], 1));
        let mut color = [[1.0f32; 4]; 9];
        color[4] = [9.0, 2.0, 3.0, 1.0];
        harness.set("color", &color);
        let calm = run_cpu(&mut harness, &epigraph::registry()).get::<[f32; 4]>("calm");
        assert_eq!(calm[4], [1.0, 2.0, 1.0, 1.0]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(1);
        let color: Vec<[f32; 4]> = (0..61 * 47).map(|_| [0; 4].map(|_| random.between(0.0, 1.0))).collect();
        let mut harness = Harness::<Median>::new(MedianParams { factor: 1.2 }, &settings([61, 47], 1));
        harness.set("color", &color);
        run_both(&mut harness, &epigraph::registry()).assert_equal::<[f32; 4]>("calm");
    }
}
