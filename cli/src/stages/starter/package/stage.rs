//! The stage: its ports, parameters and CPU twin. The shader is `shaders/STARTER.wgsl`.

use epigraph_core::{CpuContext, Extent, In, Io, Out, Stage, params, shader, texel::Rgba32Float};
use epigraph_stages::meaning::RADIANCE;
use rayon::prelude::*;

params! {
    /// Parameters of [`StarterStage`]. The shader's `Params` has the same members in the same order.
    pub struct StarterParams {
        /// Weight of the mean; 0 keeps the picture as it is.
        amount: f32 = 0.5, in 0.0..=1.0;
    }
}

/// Blends each pixel with the mean of the 3x3 pixels around it.
pub struct StarterStage {
    color: In<Rgba32Float>,
    smoothed: Out<Rgba32Float>,
}

impl Stage for StarterStage {
    const KIND: &'static str = "STARTER";
    const DOC: &'static str = "Blends each pixel with the mean of the 3x3 pixels around it.";
    type Params = StarterParams;

    // A port has the name of the shader's variable that it binds, says what it holds, and has a meaning, by which pictures
    // and the editor show it. `Extent::Frame(1)` is one element for each pixel.
    fn declare(_: &StarterParams, io: &mut Io) -> Self {
        let color = io.read("color", RADIANCE, Extent::Frame(1));
        let smoothed = io.write("smoothed", RADIANCE.doc("Linear radiance, smoothed."), Extent::Frame(1));
        io.shader(shader!("STARTER"));
        // One thread for each element of `smoothed`.
        io.dispatch("main", smoothed);
        Self { color, smoothed }
    }

    // The same in Rust: it runs where there is no GPU, and says what is right when the two differ.
    fn cpu(&self, params: &StarterParams, cx: &CpuContext) -> Result<(), String> {
        let (color, mut smoothed) = (cx.read(self.color), cx.write(self.smoothed));
        let color = &*color;
        let [width, height] = cx.frame().size.map(|side| side as usize);
        smoothed.par_iter_mut().enumerate().for_each(|(pixel, smoothed)| {
            let (x, y) = (pixel % width, pixel / width);
            let mut sum = [0.0; 4];
            for i in 0..9 {
                // Pixels at the border stand in for those beyond it.
                let x = (x + i % 3).saturating_sub(1).min(width - 1);
                let y = (y + i / 3).saturating_sub(1).min(height - 1);
                for channel in 0..4 {
                    sum[channel] += color[y * width + x][channel];
                }
            }
            for channel in 0..4 {
                let (here, mean) = (color[pixel][channel], sum[channel] / 9.0);
                smoothed[channel] = here * (1.0 - params.amount) + mean * params.amount;
            }
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
    fn by_hand() {
        // An image of 3x3 pixels for one frame: nine at the centre, zero around.
        let mut harness = Harness::<StarterStage>::new(StarterParams { amount: 0.5 }, &settings([3, 3], 1));
        let mut color = [[0.0f32; 4]; 9];
        color[4] = [9.0; 4];
        harness.set("color", &color);
        let smoothed = run_cpu(&mut harness, &epigraph::registry()).get::<[f32; 4]>("smoothed");
        assert_eq!(smoothed[4], [5.0; 4]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(1);
        let color: Vec<[f32; 4]> = (0..61 * 47).map(|_| [0; 4].map(|_| random.between(0.0, 1.0))).collect();
        let mut harness = Harness::<StarterStage>::new(StarterParams { amount: 0.3 }, &settings([61, 47], 1));
        harness.set("color", &color);
        // GPUs round sums in their own ways; `assert_equal` is for stages of integers.
        run_both(&mut harness, &epigraph::registry()).assert_close("smoothed", 1e-6);
    }
}
