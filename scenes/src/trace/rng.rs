//! The tracer's random numbers: a small generator and a stratified sequence. Both depend only on a seed and a key, so
//! that a request gets the same numbers on any thread.

/// 2^-24: scales 24 bits to [0, 1).
const UNIT: f32 = 1.0 / (1u64 << 24) as f32;

/// 2^64 divided by the golden ratio: sums and products with it are far apart for neighbouring numbers.
const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;

/// Index of the stratified pair of [`Rng::subpixel`]. The tracer numbers its own pairs from 0.
const SUBPIXEL_PAIR: u32 = u32::MAX;

/// The random numbers of one sample: a PCG32 generator (O'Neill 2014, XSH-RR output) for unstratified numbers, and
/// Owen-scrambled Sobol pairs that stratify the light paths of a sample or of a pixel.
#[derive(Clone, Debug)]
pub struct Rng {
    state: u64,
    increment: u64,
    /// Seed of the Sobol pairs, common to all samples of a key.
    sequence: u32,
    /// Index of the sample among those of its key.
    nth: u32,
}

impl Rng {
    /// The generator of a job, from the run's `seed` and the job's `key` (see [`Rng::key`]).
    pub fn new(seed: u64, key: u64) -> Self {
        Self::nth(seed, key, 0)
    }

    /// The generator of sample number `nth` of a key. Its Sobol pairs continue where those of sample `nth - 1` end, so
    /// that all samples of a pixel are stratified together.
    pub fn nth(seed: u64, key: u64, nth: u32) -> Self {
        let root = mix(mix(seed) ^ key);
        let mut rng = Self {
            state: mix(root.wrapping_add(u64::from(nth))),
            increment: root | 1,
            sequence: (root >> 32) as u32,
            nth,
        };
        rng.next_u32();
        rng
    }

    /// The key of a pixel (its index in the image) in a frame.
    pub fn key(frame: u32, pixel: u32) -> u64 {
        u64::from(frame) << 32 | u64::from(pixel)
    }

    /// 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(self.increment);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// A number in [0, 1).
    pub fn next_f32(&mut self) -> f32 {
        unit(self.next_u32())
    }

    /// Two independent numbers in [0, 1).
    pub fn next_pair(&mut self) -> [f32; 2] {
        [self.next_f32(), self.next_f32()]
    }

    /// Position of the sample within its pixel, both coordinates in [0, 1). All samples of a key are stratified
    /// together.
    pub fn subpixel(&self) -> [f32; 2] {
        self.stratified(SUBPIXEL_PAIR, 0, 1)
    }

    /// Point `path` of `paths` of the stratified pair number `dimension`, both coordinates in [0, 1). Different
    /// dimensions are independent of each other.
    pub(crate) fn stratified(&self, dimension: u32, path: u32, paths: u32) -> [f32; 2] {
        let index = self.nth.wrapping_mul(paths).wrapping_add(path);
        sobol_pair(index, mix(u64::from(self.sequence) << 32 | u64::from(dimension)))
    }
}

/// The top 24 bits as a number in [0, 1): an f32 holds no more bits without rounding up to 1.
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * UNIT
}

/// Bijective 64-bit mix in which every input bit reaches every output bit (the finaliser of SplitMix64).
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(SPREAD);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Point `index` of the first two Sobol dimensions. `seed` shuffles the order and Owen-scrambles the digits (Burley,
/// "Practical Hash-based Owen Scrambling", JCGT 2020).
fn sobol_pair(index: u32, seed: u64) -> [f32; 2] {
    let order = (seed.wrapping_mul(SPREAD) >> 32) as u32;
    // The first dimension is the index in reverse; scrambling works on reversed digits, which are the index again.
    let index = scramble(index.reverse_bits(), order).reverse_bits();
    let x = scramble(index, seed as u32);
    let y = scramble(sobol_second(index), (seed >> 32) as u32);
    // Both in reverse at once.
    let digits = (u64::from(x) | u64::from(y) << 32).reverse_bits();
    [unit((digits >> 32) as u32), unit(digits as u32)]
}

/// The second Sobol dimension, lowest digit first. Its generator matrix is Pascal's triangle modulo 2, the fifth Kronecker
/// power of `[[1, 1], [0, 1]]`, so that five butterflies replace a product with 32 columns.
fn sobol_second(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^= (x >> 16) & 0x0000_ffff;
    x
}

/// Nested uniform scramble of digits in reverse, the lowest first: flips each by a hash of those below it, since carries
/// and products depend on lower bits only.
fn scramble(digits: u32, seed: u32) -> u32 {
    let mut x = digits.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_keys_give_equal_numbers_and_different_keys_do_not() {
        let draw = |seed, key, nth| Rng::nth(seed, key, nth).next_u32();
        assert_eq!(draw(1, 7, 0), draw(1, 7, 0));
        assert_ne!(draw(1, 7, 0), draw(2, 7, 0));
        assert_ne!(draw(1, 7, 0), draw(1, 8, 0));
        assert_ne!(draw(1, 7, 0), draw(1, 7, 1));
        assert_ne!(Rng::key(0, 1), Rng::key(1, 0));
    }

    #[test]
    fn neighbouring_keys_are_uncorrelated() {
        let first: Vec<f32> = (0..4096).map(|key| Rng::new(3, key).next_f32()).collect();
        let mean = first.iter().sum::<f32>() / 4096.0;
        let lag: f32 = first.windows(2).map(|w| (w[0] - 0.5) * (w[1] - 0.5)).sum::<f32>() / 4095.0;
        // Standard errors: 0.289 / 64 and 0.0833 / 64.
        assert!((mean - 0.5).abs() < 4.0 * 0.289 / 64.0, "{mean}");
        assert!(lag.abs() < 4.0 * 0.0833 / 64.0, "{lag}");
    }

    #[test]
    fn pairs_of_a_pixel_fill_every_stratum_once() {
        // 64 samples of one light path each: if the unit square is divided into 64 boxes of equal size, 2^a by 2^b,
        // each box contains one point.
        for (nx, ny) in [(1, 64), (8, 8), (64, 1), (16, 4)] {
            let mut seen = vec![0; 64];
            for nth in 0..64 {
                let [x, y] = Rng::nth(5, 9, nth).stratified(3, 0, 1);
                seen[(x * nx as f32) as usize * ny + (y * ny as f32) as usize] += 1;
            }
            assert!(seen.iter().all(|&n| n == 1), "{nx}x{ny}: {seen:?}");
        }
    }

    #[test]
    fn second_dimension_is_the_published_sequence() {
        let expected = [0.0, 0.5, 0.75, 0.25, 0.625, 0.125, 0.375, 0.875];
        for (index, y) in expected.into_iter().enumerate() {
            assert_eq!(unit(sobol_second(index as u32).reverse_bits()), y, "index {index}");
        }
    }

    #[test]
    fn dimensions_are_independent() {
        let rng = Rng::new(1, 1);
        let same = (0..64).filter(|&i| rng.stratified(0, i, 64) == rng.stratified(1, i, 64)).count();
        assert_eq!(same, 0);
    }

    #[test]
    fn the_light_paths_of_all_samples_of_a_pixel_are_stratified_together() {
        // 16 samples of 4 light paths.
        for (nx, ny) in [(1, 64), (8, 8), (64, 1)] {
            let mut seen = vec![0; 64];
            for nth in 0..16 {
                for path in 0..4 {
                    let [x, y] = Rng::nth(5, 9, nth).stratified(3, path, 4);
                    seen[(x * nx as f32) as usize * ny + (y * ny as f32) as usize] += 1;
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "{nx}x{ny}: {seen:?}");
        }
    }

    #[test]
    fn places_in_a_pixel_are_stratified_and_independent_of_the_light_paths() {
        let mut columns = [0; 64];
        for nth in 0..64 {
            let rng = Rng::nth(5, 9, nth);
            columns[(rng.subpixel()[0] * 64.0) as usize] += 1;
            assert_ne!(rng.subpixel(), rng.stratified(0, 0, 1));
        }
        assert_eq!(columns, [1; 64]);
    }

    #[test]
    fn the_second_dimension_is_that_of_pascals_triangle_to_the_last_bit() {
        // Bit b of the index, from the lowest, adds column b of the matrix: C(b, k) mod 2 in row k, the lowest bit first.
        // C(b, k) is odd if k is a subset of b.
        for b in 0..32u32 {
            let column = (0..=b).filter(|k| k & b == *k).fold(0u32, |bits, k| bits | 1 << k);
            assert_eq!(sobol_second(1 << b), column, "bit {b}");
        }
    }
}
