//! The exposure that fits the picture (`algorithms.md` section 1.10): its white is the brightness that a given share of
//! the pixels stays below, and follows the picture slowly.
//!
//! All of it is arithmetic on integers, the bits of floats, so that both sides find the same white. The bits of
//! positive floats grow like their logarithm, nearly: linearly within each octave, by [`OCTAVE`] from one to the next.

use epigraph_core::constants;

/// Bits of a float below its exponent.
const OCTAVE_BITS: u32 = 23;
/// What doubling a float adds to its bits.
const OCTAVE: u32 = 1 << OCTAVE_BITS;
/// Octaves that the histogram covers: as many as the exposures that a number can set.
const OCTAVES: u32 = 48;
/// Bins of each octave.
const OCTAVE_BINS: u32 = 16;

constants! {
    /// Bins of the histogram.
    pub const BINS: u32 = OCTAVES * OCTAVE_BINS;
    /// Bits of the darkest brightness that has a bin of its own, 2^-24.
    const DARKEST: u32 = (127 - OCTAVES / 2) << OCTAVE_BITS;
    /// Binary logarithm of the width of a bin, in bits of a float.
    const BIN_SHIFT: u32 = OCTAVE_BITS - OCTAVE_BINS.ilog2();
    /// Steps of the white within a bin. More would overflow in pictures of 2^28 pixels.
    const STEPS: u32 = 8;
    /// How far the fitting white may move before the shown one follows it: 1/8 EV.
    const BAND: i32 = OCTAVE as i32 / 8;
    /// In each frame, the shown white goes 1 / `SLOWNESS` of the way.
    const SLOWNESS: i32 = 16;
}

/// Bits of the smallest float that counts as light. Drivers may read smaller ones as 0.
const LIGHT: u32 = f32::MIN_POSITIVE.to_bits();

/// The bin of a colour by its brightest channel; `None` if it has no light, or a channel that is not finite.
#[inline(always)]
pub fn bin(color: [f32; 3]) -> Option<usize> {
    if !color.iter().all(|channel| channel.is_finite()) {
        return None;
    }
    let brightest = color.iter().fold(0f32, |most, &channel| most.max(channel)).to_bits();
    let place = brightest.saturating_sub(DARKEST) >> BIN_SHIFT;
    (brightest >= LIGHT).then_some(place.min(BINS - 1) as usize)
}

/// The white below which this percentage of the counted pixels is; `None` if none is counted.
pub fn fitting(histogram: &[u32], percentile: u32) -> Option<f32> {
    let count: u32 = histogram.iter().sum();
    // The product alone could overflow.
    let rank = (count / 100 * percentile + count % 100 * percentile / 100).max(1);
    let mut before = 0;
    for (bin, &pixels) in (0..).zip(histogram) {
        if before + pixels >= rank {
            let step = (rank - before) * STEPS / pixels;
            return Some(f32::from_bits(DARKEST + (bin << BIN_SHIFT) + (step << BIN_SHIFT) / STEPS));
        }
        before += pixels;
    }
    None
}

/// The white of the next frame: `fitting` at once if there is none yet, which is 0.
pub fn follow(white: f32, fitting: f32) -> f32 {
    if white == 0.0 {
        return fitting;
    }
    let away = fitting.to_bits() as i32 - white.to_bits() as i32;
    let beyond = away.signum() * (away.abs() - BAND).max(0);
    f32::from_bits((white.to_bits() as i32 + beyond / SLOWNESS) as u32)
}

/// The factor of radiance that shows this white as 1; 1 as long as there is none.
pub fn gain(white: f32) -> f32 {
    if white == 0.0 { 1.0 } else { 1.0 / white }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A histogram of these colours.
    fn count(colors: impl IntoIterator<Item = [f32; 3]>) -> Vec<u32> {
        let mut histogram = vec![0; BINS as usize];
        colors.into_iter().filter_map(bin).for_each(|bin| histogram[bin] += 1);
        histogram
    }

    #[test]
    fn bins_by_hand() {
        let grey = |value: f32| bin([value; 3]);
        // 2^-24 begins the first bin; 1 is 24 octaves of 16 bins above it, 1.0625 a bin above 1.
        assert_eq!([2f32.powi(-24), 1.0, 1.0624, 1.0625, 1.5, 2.0].map(grey), {
            [Some(0), Some(384), Some(384), Some(385), Some(392), Some(400)]
        });
        assert_eq!([1e-30, 1e-37, 1e30, f32::MAX].map(grey), [Some(0), Some(0), Some(767), Some(767)]);
        assert_eq!([0.0, -0.0, -1.0, 1e-40, f32::NAN, f32::INFINITY].map(grey), [None; 6]);
        // The brightest channel decides; one that is not finite spoils the pixel.
        assert_eq!(bin([0.0, -3.0, 1.0]), Some(384));
        assert_eq!([[1.0, f32::NAN, 0.0], [1.0, 0.0, f32::NEG_INFINITY]].map(bin), [None; 2]);
    }

    #[test]
    fn the_fitting_white_by_hand() {
        // 50 pixels each in the bins [0.5, 0.53125) and [1, 1.0625).
        let halves = count((0..100).map(|i| [if i < 50 { 0.5 } else { 1.0 }; 3]));
        for (percentile, white) in [
            // All of the first bin; a quarter, a half and all of the second; the sixteenth pixel of fifty, 2.56 of 8
            // steps, rounded down.
            (50, 0.53125),
            (63, 1.0 + 0.25 * 0.0625),
            (75, 1.0 + 0.5 * 0.0625),
            (100, 1.0625),
            (16, 0.5 + 0.25 * 0.03125),
        ] {
            assert_eq!(fitting(&halves, percentile), Some(white), "{percentile}%");
        }
        // One pixel counts at every percentage, and black ones at none.
        let one = count([[1.0; 3], [0.0; 3], [f32::NAN; 3], [-5.0; 3]]);
        assert_eq!([1, 50, 100].map(|percentile| fitting(&one, percentile)), [Some(1.0625); 3]);
        assert_eq!(fitting(&count([[0.0; 3]; 9]), 95), None);
    }

    #[test]
    fn counts_of_the_largest_pictures_do_not_overflow() {
        let mut histogram = vec![0; BINS as usize];
        histogram[384] = 1 << 28;
        assert_eq!(fitting(&histogram, 100), Some(1.0625));
        assert_eq!(fitting(&histogram, 50), Some(1.0 + 4.0 / 128.0));
        // The range of the parameter: exposures of -24 to 24.
        assert_eq!(fitting(&count([[f32::MAX; 3]]), 100), Some(2f32.powi(24)));
        assert!(fitting(&count([[f32::MIN_POSITIVE; 3]; 100]), 1) >= Some(2f32.powi(-24)));
    }

    #[test]
    fn white_follows_in_64_frames_and_then_rests() {
        assert_eq!(follow(0.0, 3.0), 3.0, "the first picture fits at once");
        for (from, to) in [(1.0f32, 256.0f32), (256.0, 1.0), (1.0, 1.2), (0.9, 0.7)] {
            let mut white = from;
            let mut steps = Vec::new();
            for _ in 0..400 {
                let next = follow(white, to);
                steps.push((next / white).log2().abs());
                white = next;
            }
            let distance = (to / from).log2().abs();
            let [after_64, all] = [&steps[..64], &steps].map(|steps| steps.iter().sum::<f32>());
            assert!(distance - after_64 < 1.0 / 3.0, "{from} {to}: {after_64}");
            // It never passes what fits, nor turns back, and rests within the band: 1/8 of an octave's bits.
            assert!(all <= distance && ((to / white).log2().abs() - (distance - all)).abs() < 1e-3);
            assert!((to / white).log2().abs() < 0.18 && steps[399] == 0.0, "{from} {to}: {white}");
        }
        // What fits moves by less than the band: nothing does.
        assert_eq!([0.94, 0.97, 1.0, 1.05, 1.1].map(|fitting| follow(1.0, fitting)), [1.0; 5]);
    }
}
