//! Filters of noise, against `algorithms.md` section 12.

use std::sync::LazyLock;

use epigraph_core::{
    Harness,
    testing::{Random, settings},
};
use epigraph_stages::{
    atrous::{Atrous, AtrousParams},
    refine::Refine,
    shared::{
        moves::Move,
        requests::{HIT_SURFACE, SPREAD, Sample},
    },
};

use crate::{
    Group, both,
    colors::{DIRECTIONS, Shape},
    interval::ulp,
    measured,
    pixels::sides,
    table::{Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| measured(&[|| vec![averaged()], || vec![refined()]]));

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

/// Pictures with the means of each pixel's own samples (section 12.4), while these come in.
fn refined() -> Row {
    let mut measure = Measure::within(
        "refine",
        "colours",
        "radiance 10^-6 to 65,408; 4 to 300 samples a pixel, alike to a share of 10^-3 or not at all; 1x1 to 4096x1",
        "f64, of all samples",
        30.0,
        Unit::Of("ULP of the largest"),
    );
    let mut random = Random(13);
    for (size, frames) in [([1, 1], 300), ([1, 41], 60), ([61, 47], 60), ([4096, 1], 8)] {
        for scale in [1e-6f32, 1.0, 16_000.0] {
            let pixels = (size[0] * size[1]) as usize;
            let mut harness = Harness::<Refine>::new((), &settings(size, pixels as u32));
            let mut colors = |least: f32| -> Vec<[f32; 4]> {
                (0..pixels).map(|_| [0; 4].map(|_| scale * random.between(least, 4.0))).collect()
            };
            let (color, middle) = (colors(0.5), colors(0.5));
            harness.set("color", &color);
            harness.set("id", &vec![0u32; pixels]);
            harness.set("aim", &vec![0u32; pixels]);
            harness.set("shift", &vec![0.0f32; size.map(|side| side.div_ceil(32) as usize).iter().product()]);
            harness.set("moves", &[Move::REST]);
            let noise: Vec<f32> = (0..pixels).map(|_| [1e-3, 0.1, 1.0][random.below(3) as usize]).collect();
            let mut had = vec![Vec::new(); pixels];
            for frame in 1..=frames {
                let samples: Vec<Sample> = (0..pixels)
                    .map(|at| {
                        let share = 1.0 + noise[at] * random.between(-1.0, 0.02);
                        let radiance = [0, 1, 2].map(|lane| middle[at][lane] * share);
                        had[at].push(radiance.map(f64::from));
                        Sample {
                            hit: HIT_SURFACE,
                            pixel: at as u32,
                            radiance,
                            aim: SPREAD,
                            ..Sample::default()
                        }
                    })
                    .collect();
                harness.set("samples", &samples);
                let outputs = both(&mut harness);
                if frame != frames && frame != 4 {
                    continue;
                }
                let expected = with_means(&Shape::new(size), &color, &had);
                let unit = ulp((4.0 * scale).into());
                for (side, outputs) in sides(&outputs) {
                    let got = outputs.get::<[f32; 4]>("refined");
                    let errors = got.iter().zip(&expected).flat_map(|(got, expected)| {
                        (0..3).map(|lane| (f64::from(got[lane]) - expected[lane]).abs() / unit)
                    });
                    let worst = errors.fold(0f64, |worst, error| if error <= worst { worst } else { error });
                    measure.record(side, &format!("{size:?} {frame} {scale:e}"), worst, 3 * pixels);
                }
            }
        }
    }
    measure.row()
}

/// The colours of a picture with their share of the means of these samples.
fn with_means(shape: &Shape, color: &[[f32; 4]], samples: &[Vec<[f64; 3]>]) -> Vec<[f64; 3]> {
    let luminance = |of: [f64; 3]| 0.2126 * of[0] + 0.7152 * of[1] + 0.0722 * of[2];
    let mean = |at: usize| {
        [0, 1, 2].map(|lane| samples[at].iter().map(|of| of[lane]).sum::<f64>() / samples[at].len() as f64)
    };
    // The variance of each mean, and its squared difference from the picture.
    let evidence: Vec<[f64; 2]> = (0..color.len())
        .map(|at| {
            let (number, mean) = (samples[at].len() as f64, mean(at));
            let squares: f64 = samples[at].iter().map(|of| (luminance(*of) - luminance(mean)).powi(2)).sum();
            let aside = luminance([0, 1, 2].map(|lane| (mean[lane] - f64::from(color[at][lane])).abs()));
            [squares / number / (number - 1.0) * (1.0 + 2.0 / (number - 1.0)), aside.powi(2)]
        })
        .collect();
    let of = |[noise, all]: [f64; 2]| (1.0 - noise / all).max(0.0);
    let shown = shape.pixels().map(|at| {
        let around = (-1..=1).flat_map(|y| (-1..=1).map(move |x| [at[0] + x, at[1] + y]));
        let around: Vec<usize> = around.filter_map(|there| shape.index(there)).collect();
        let sums = around.iter().fold([0.0; 2], |[noise, all], &there| {
            [noise + 2.0 * evidence[there][0], all + evidence[there][1]]
        });
        let at = shape.index(at).expect("inside");
        let own = color[at].map(f64::from);
        let shown = |at: usize| luminance([0, 1, 2].map(|lane| f64::from(color[at][lane])));
        let steps: f64 = around.iter().map(|&there| (shown(there) - shown(at)).powi(2)).sum();
        let missed = 2.0 * steps / around.len() as f64 + 16.0 * shown(at).powi(2);
        let missed = missed / (samples[at].len() as f64).powi(2);
        let share = of([evidence[at][0] + missed, evidence[at][1]]).min(of(sums));
        [0, 1, 2].map(|lane| own[lane] + share * (mean(at)[lane] - own[lane]))
    });
    shown.collect()
}
