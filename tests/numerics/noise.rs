//! Filters of noise, against `algorithms.md` section 12.

use std::sync::LazyLock;

use epigraph_core::{
    Harness,
    testing::{Random, settings},
};
use epigraph_stages::atrous::{Atrous, AtrousParams};

use crate::{
    Group, both,
    colors::{DIRECTIONS, Shape},
    interval::ulp,
    measured,
    pixels::sides,
    table::{Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| measured(&[|| vec![averaged()]]));

/// A picture: colours, variances (`None` in holes), and which primary regions are joined.
struct Picture {
    shape: Shape,
    colors: Vec<[f64; 3]>,
    variances: Vec<Option<f64>>,
    n8: Vec<u32>,
}

impl Picture {
    /// Where straight walks of some steps to the sides end that cross no edge.
    fn walks(&self, at: [i32; 2], steps: u32) -> impl Iterator<Item = usize> {
        [0, 2, 4, 6].into_iter().filter_map(move |d| self.walk(at, d, steps))
    }

    fn walk(&self, mut at: [i32; 2], d: usize, steps: u32) -> Option<usize> {
        for _ in 0..steps {
            let is_joined = self.n8[self.shape.index(at)?] >> (4 * d) & 1 == 1;
            at = [at[0] + DIRECTIONS[d][0], at[1] + DIRECTIONS[d][1]];
            self.shape.index(at).filter(|_| is_joined)?;
        }
        self.shape.index(at)
    }

    /// With each variance the mean of those around.
    fn smoothed(self) -> Self {
        let around = |at| {
            let own = self.shape.index(at).and_then(|own| self.variances[own])?;
            let known = self.walks(at, 1).filter_map(|there| self.variances[there]);
            let [sum, weights] =
                known.fold([2.0 * own, 2.0], |[sum, weights], variance| [sum + variance, weights + 1.0]);
            Some(sum / weights)
        };
        Self { variances: self.shape.pixels().map(around).collect(), ..self }
    }

    fn averaged(self, level: u32, tolerance: f64) -> Self {
        let mean = |at| {
            let own = self.shape.index(at).expect("inside");
            let (color, variance) = (self.colors[own], self.variances[own]);
            let weighed = self.walks(at, 1 << level).filter_map(|there| {
                let (tap, noise) = (self.colors[there], self.variances[there]?);
                let aside = |lane: usize| (tap[lane] - color[lane]).abs();
                let aside = 0.2126 * aside(0) + 0.7152 * aside(1) + 0.0722 * aside(2);
                let unlike =
                    variance.map_or(0.0, |variance| (aside / tolerance).powi(2) / variance.max(1e-30));
                Some(((1.0 - unlike).max(0.0).powi(2), tap, noise))
            });
            let all: Vec<_> = variance.map(|noise| (2.0, color, noise)).into_iter().chain(weighed).collect();
            let weights: f64 = all.iter().map(|tap| tap.0).sum();
            if weights == 0.0 {
                return (color, None);
            }
            let lane = |lane: usize| all.iter().map(|tap| tap.0 * tap.1[lane]).sum::<f64>() / weights;
            let noise = all.iter().map(|tap| tap.0.powi(2) * tap.2).sum::<f64>() / weights.powi(2);
            ([lane(0), lane(1), lane(2)], Some(noise))
        };
        let (colors, variances) = self.shape.pixels().map(mean).unzip();
        Self { colors, variances, ..self }
    }
}

/// Colours averaged along surfaces (section 12.2).
fn averaged() -> Row {
    let mut measure = Measure::within(
        "atrous",
        "colours",
        "radiance 0, 10^-40 to 65,408; variances 0, 10^-40 to 10^9, holes; 1 to 8 levels; 1x1 to 4096x1",
        "f64, level by level",
        8.0,
        Unit::Of("ULP of the largest"),
    );
    let mut random = Random(12);
    for (size, levels, tolerance) in [
        ([1, 1], 3, 24.0),
        ([1, 41], 5, 24.0),
        ([61, 47], 1, 0.5),
        ([61, 47], 5, 24.0),
        ([130, 70], 8, 1000.0),
        ([4096, 1], 8, 24.0),
    ] {
        // All colours of a picture have about the same size, so that they count.
        for scale in [1e-40f32, 1e-6, 1.0, 16_000.0] {
            let pixels = (size[0] * size[1]) as usize;
            let color: Vec<[f32; 4]> = (0..pixels)
                .map(|_| {
                    [0; 4].map(|_| if random.below(9) == 0 { 0.0 } else { scale * random.between(0.5, 4.0) })
                })
                .collect();
            let variance: Vec<f32> = (0..pixels)
                .map(|_| match random.below(9) {
                    0 => -1.0,
                    1 => 0.0,
                    _ => (scale * random.between(0.0, 1.0)).powi(2) * random.between(-9.0, 0.0).exp2(),
                })
                .collect();
            let n8: Vec<u32> = (0..pixels).map(|_| random.bits() | random.bits() | random.bits()).collect();
            let params = AtrousParams { levels, tolerance };
            let mut harness = Harness::<Atrous>::new(params, &settings(size, 1));
            harness.set("color", &color);
            harness.set("variance", &variance);
            harness.set("n8", &n8);
            let given = Picture {
                shape: Shape::new(size),
                colors: color.iter().map(|color| [0, 1, 2].map(|lane| f64::from(color[lane]))).collect(),
                variances: variance.iter().map(|&v| (v >= 0.0).then_some(f64::from(v))).collect(),
                n8,
            };
            let expected = (0..levels)
                .fold(given.smoothed(), |picture, level| picture.averaged(level, tolerance.into()))
                .colors;
            let unit = ulp((4.0 * scale).into());
            for (side, outputs) in sides(&both(&mut harness)) {
                let got = outputs.get::<[f32; 4]>("filtered");
                let errors = got.iter().zip(&expected).flat_map(|(got, expected)| {
                    (0..3).map(|lane| (f64::from(got[lane]) - expected[lane]).abs() / unit)
                });
                let worst = errors.fold(0f64, |worst, error| if error <= worst { worst } else { error });
                measure.record(side, &format!("{size:?} {levels} {scale:e}"), worst, 3 * pixels);
            }
        }
    }
    measure.row()
}
