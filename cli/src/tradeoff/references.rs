//! The converged pictures of an experiment: traced once, and kept by what they were traced from.

use std::fmt::Write;

use epigraph::memory;
use epigraph_pictures::{Difference, Picture, metrics, tone};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{
    cell::Cell,
    store::Store,
    study::{Study, View},
};
use crate::{
    converged::{Converged, Take, different},
    error::CliError,
    values::Light,
};

/// Bytes per pixel of the two halves, their comparison and the encoding.
const BYTES_PER_PIXEL: u64 = 320;

/// The seeds of the two halves of a reference.
const SEEDS: [u32; 2] = [0x5245_4631, 0x5245_4632];

/// How far a reference is from the truth, from the difference of two independent halves of its samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// FLIP between the halves.
    pub flip: f64,
    /// RMSE of the reference: the mean of both halves has half the error that they have between each other.
    pub rmse: f64,
    /// Relative MSE of the reference, a quarter of that between its halves.
    pub rel_mse: f64,
    /// PSNR of the reference, decibels: that between its halves and 6.02 dB, as a quarter of their squared difference is
    /// left. `None` if they are equal.
    pub psnr: Option<f64>,
}

/// Part of the names of references. Another one is needed when more is known of them.
const FORMAT: u32 = 2;

#[derive(Deserialize)]
struct Facts {
    noise: Noise,
}

/// A reference with its error.
pub struct Reference {
    /// The picture and the pixels near its edges.
    pub converged: Converged,
    /// Its error.
    pub noise: Noise,
}

/// A frame of which a reference is needed.
pub struct Wanted<'a> {
    /// How it is traced.
    pub take: Take<'a>,
    /// Samples per pixel.
    pub spp: u32,
    key: String,
    label: String,
}

impl<'a> Wanted<'a> {
    /// The reference of a frame of a cell's view.
    pub fn new(study: &'a Study, cell: &Cell, frame: u32) -> Self {
        let View { place, print, .. } = study.view(cell);
        let (spp, mode) = (study.experiment.spp, study.mode);
        let frame = if different(place, &[0, frame]).len() == 1 { 0 } else { frame };
        let take = Take { place, frame, size: cell.size, mode };
        let mut print = *print;
        let poses = place.scene.poses_at(frame);
        let camera = place.path.camera(frame);
        let size = cell.size;
        let version = env!("CARGO_PKG_VERSION");
        write!(print, " {FORMAT} {version} {camera:?} {poses:?} {size:?} {mode:?} {spp}")
            .expect("a fingerprint takes all text");
        let label = format!("reference {}, frame {frame}", cell.view());
        Self { take, spp, key: print.to_string(), label }
    }

    /// The name of its files.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The reference, from the store or traced, and then stored if there is a store.
    ///
    /// # Errors
    /// Too little memory, files that cannot be read or written, and [`CliError::Interrupted`].
    pub fn get(&self, store: Option<&Store>) -> Result<Reference, CliError> {
        let kept = store.map(|store| store.reference(&self.key)).transpose()?.flatten();
        if let Some((picture, Facts { noise })) = kept {
            return Ok(Reference { converged: self.take.converged(picture.colors), noise });
        }
        let size = self.take.size;
        memory::require(u64::from(size[0]) * u64::from(size[1]) * BYTES_PER_PIXEL)?;
        let half = |seed| self.take.colors(&self.label, self.spp / 2, seed);
        let [a, b] = [half(SEEDS[0])?, half(SEEDS[1])?];
        let noise = noise(size.map(|side| side as usize), &a, &b);
        let mean = a.iter().zip(&b).map(|(a, b)| [0, 1, 2].map(|lane| 0.5 * (a[lane] + b[lane]))).collect();
        let converged = self.take.converged(mean);
        let place = self.take.place;
        let facts = json!({
            "scene": place.scene.name,
            "frame": self.take.frame,
            "size": size,
            "mode": if self.take.mode == Light::Path { "path" } else { "direct" },
            "spp": self.spp,
            "version": env!("CARGO_PKG_VERSION"),
            "noise": noise,
        });
        if let Some(store) = store {
            store.keep_reference(&self.key, &converged.picture, &facts)?;
        }
        Ok(Reference { converged, noise })
    }

    /// The picture of the reference, if it is in the store.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn picture(&self, store: &Store) -> Result<Option<Picture>, CliError> {
        Ok(store.reference::<Facts>(&self.key)?.map(|(picture, _)| picture))
    }

    /// Traces the reference unless it is in the store.
    ///
    /// # Errors
    /// Those of [`Wanted::get`].
    pub fn ensure(&self, store: &Store) -> Result<(), CliError> {
        if store.has_reference(&self.key)? { Ok(()) } else { self.get(Some(store)).map(drop) }
    }
}

/// The difference of two halves as the error of their mean.
fn noise(size: [usize; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> Noise {
    let picture = |colors: &[[f32; 3]]| Picture { size, colors: colors.to_vec(), linear: true };
    let [a, b] = [picture(a), picture(b)];
    let (light_a, light_b) = (light(&a), light(&b));
    let difference = Difference::new(&a, &b);
    Noise {
        flip: difference.flip(),
        psnr: Some(difference.psnr() + 20.0 * 2_f64.log10()).filter(|psnr| psnr.is_finite()),
        rmse: 0.5 * metrics::rmse(&light_a, &light_b),
        rel_mse: 0.25 * metrics::rel_mse(&light_a, &light_b),
    }
}

/// The linear light of a picture as it is displayed, clamped to [0, 1].
pub fn light(picture: &Picture) -> Vec<[f32; 3]> {
    // NaN is shown as black.
    let shown = |value: f32| if value > 0.0 { value.min(1.0) } else { 0.0 };
    let of = |color: &[f32; 3]| if picture.linear { color.map(shown) } else { color.map(tone::decode) };
    picture.colors.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_halves_tell_the_error_of_their_mean() {
        // Noise of standard deviation 0.05 in each half: 0.05 / sqrt(2) in the mean.
        let mut state = 5_u32;
        let mut noisy = || {
            let mut uniform = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / (1 << 24) as f32 - 0.5
            };
            // The variance of a uniform number is 1/12.
            (0..4096).map(|_| [0, 1, 2].map(|_| 0.5 + uniform() * 0.05 * 12_f32.sqrt())).collect::<Vec<_>>()
        };
        let (a, b) = (noisy(), noisy());
        let found = noise([64, 64], &a, &b);
        let mean: Vec<[f32; 3]> =
            a.iter().zip(&b).map(|(a, b)| [0, 1, 2].map(|lane| 0.5 * (a[lane] + b[lane]))).collect();
        let truth = vec![[0.5; 3]; 4096];
        let (rmse, rel_mse) = (metrics::rmse(&truth, &mean), metrics::rel_mse(&truth, &mean));
        let picture = |colors| Picture { size: [64, 64], colors, linear: true };
        let psnr = Difference::new(&picture(truth), &picture(mean)).psnr();
        assert!((found.psnr.unwrap() - psnr).abs() < 0.2, "{found:?}, but PSNR is {psnr}");
        assert_eq!(noise([64, 64], &a, &a).psnr, None);
        assert!((found.rmse / rmse - 1.0).abs() < 0.05, "{found:?}, but RMSE is {rmse}");
        assert!((found.rel_mse / rel_mse - 1.0).abs() < 0.1, "{found:?}, but relative MSE is {rel_mse}");
    }

    #[test]
    fn light_is_what_is_displayed() {
        let linear = Picture { size: [2, 1], colors: vec![[0.25, 7.0, f32::NAN]; 2], linear: true };
        assert_eq!(light(&linear), [[0.25, 1.0, 0.0]; 2]);
        let shown = Picture::shown([1, 1], &[[255, 0, 188]]);
        assert!((light(&shown)[0][2] - 0.502_886).abs() < 1e-5 && light(&shown)[0][..2] == [1.0, 0.0]);
    }
}
