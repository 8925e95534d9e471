//! The thresholds of [`Kind::BlueNoise`](super::Kind::BlueNoise): every rank from 0 to 4095 once, so that the pixels below
//! any rank are spread evenly, without large gaps and clusters.

epigraph_core::constants! {
    /// Pixels on each side of the mask, which is repeated over the image.
    pub const MASK_SIDE: u32 = 64;
    /// 2^32 over the plastic number, 1.3247: with the next constant, the multiples modulo 2^32 are places evenly spread over
    /// a square for any count (the sequence R2, Roberts 2018).
    pub const STEP_X: u32 = 0xC13F_A9A9;
    /// 2^32 over its square.
    pub const STEP_Y: u32 = 0x91E1_0DA5;
}

const RANKS: usize = (MASK_SIDE * MASK_SIDE) as usize;

/// The ranks row by row, two to a word, the first in the low half; made by the void-and-cluster method (Ulichney 1993), see
/// the tests.
pub static WORDS: [u32; RANKS / 2] = {
    let bytes = include_bytes!("mask.bin");
    let mut words = [0; RANKS / 2];
    let mut i = 0;
    while i < words.len() {
        words[i] = u32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
        i += 1;
    }
    words
};

/// The rank of a pixel in a frame: the mask is in another place in each.
pub fn rank([x, y]: [u32; 2], frame: u32) -> u32 {
    let place = |at: u32, step: u32| (at + (frame.wrapping_mul(step) >> 26)) % MASK_SIDE;
    let at = place(y, STEP_Y) * MASK_SIDE + place(x, STEP_X);
    WORDS[(at / 2) as usize] >> (16 * (at % 2)) & 0xFFFF
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::shared::testing::Random;

    const SIDE: usize = MASK_SIDE as usize;

    /// The width of the filter by which gaps and clusters are found, pixels.
    const SIGMA: f64 = 1.9;

    /// How dense a pattern is around each pixel, with opposite borders joined.
    struct Density {
        /// By horizontal and vertical distance.
        filter: Vec<u64>,
        around: Vec<u64>,
        is_set: Vec<bool>,
    }

    impl Density {
        fn new() -> Self {
            let distance = |place: usize| place.min(SIDE - place) as f64;
            let filter = (0..RANKS).map(|place| {
                let squared = distance(place % SIDE).powi(2) + distance(place / SIDE).powi(2);
                // Whole numbers, so that sums do not depend on their order.
                (2f64.powi(32) * (-squared / (2.0 * SIGMA * SIGMA)).exp()).round() as u64
            });
            Self { filter: filter.collect(), around: vec![0; RANKS], is_set: vec![false; RANKS] }
        }

        fn flip(&mut self, at: usize) {
            self.is_set[at] ^= true;
            let [x, y] = [at % SIDE, at / SIDE];
            for (place, around) in self.around.iter_mut().enumerate() {
                let [dx, dy] = [(place % SIDE).abs_diff(x), (place / SIDE).abs_diff(y)];
                let weight = self.filter[dy * SIDE + dx];
                *around = if self.is_set[at] { *around + weight } else { *around - weight };
            }
        }

        fn places(&self, set: bool) -> impl Iterator<Item = usize> {
            (0..RANKS).filter(move |&place| self.is_set[place] == set)
        }

        /// The pixel of the pattern that is closest to others.
        fn tightest_cluster(&self) -> usize {
            self.places(true).max_by_key(|&place| self.around[place]).unwrap()
        }

        /// The pixel that is farthest from the pattern.
        fn largest_void(&self) -> usize {
            self.places(false).min_by_key(|&place| self.around[place]).unwrap()
        }
    }

    /// The mask, by the method of voids and clusters: pixels of an even pattern are ranked by taking them away, the densest
    /// first; the others by filling the largest gap, again and again.
    fn generated() -> Vec<u32> {
        let mut density = Density::new();
        let mut random = Random(1);
        const FIRST: usize = RANKS / 10;
        while density.places(true).count() < FIRST {
            let place = random.below(RANKS as u32) as usize;
            if !density.is_set[place] {
                density.flip(place);
            }
        }
        loop {
            let cluster = density.tightest_cluster();
            density.flip(cluster);
            let void = density.largest_void();
            density.flip(void);
            if void == cluster {
                break;
            }
        }
        let even = density.is_set.clone();
        let mut ranks = vec![0; RANKS];
        for rank in (0..FIRST).rev() {
            let cluster = density.tightest_cluster();
            density.flip(cluster);
            ranks[cluster] = rank as u32;
        }
        (0..RANKS).filter(|&place| even[place]).for_each(|place| density.flip(place));
        for rank in FIRST..RANKS {
            let void = density.largest_void();
            density.flip(void);
            ranks[void] = rank as u32;
        }
        ranks
    }

    fn stored() -> Vec<u32> {
        (0..RANKS as u32).map(|at| rank([at % MASK_SIDE, at / MASK_SIDE], 0)).collect()
    }

    #[test]
    fn the_stored_mask_is_the_one_that_is_generated() {
        let generated = generated();
        if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
            let bytes: Vec<u8> = generated.iter().flat_map(|&rank| (rank as u16).to_le_bytes()).collect();
            let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/dither/mask.bin");
            std::fs::write(path, bytes).unwrap();
        }
        assert!(generated == stored(), "another mask is generated than is stored");
    }

    /// The mean power of a pattern's frequencies below `limit`, in cycles across the mask, divided by that of pixels picked
    /// independently of each other.
    fn low_power(pattern: &[bool], limit: f64) -> f64 {
        let reach = limit as i32;
        let mut powers = Vec::new();
        for [fx, fy] in (-reach..=reach).flat_map(|fx| (-reach..=reach).map(move |fy| [fx, fy])) {
            let frequency = f64::from(fx * fx + fy * fy).sqrt();
            if frequency == 0.0 || frequency >= limit {
                continue;
            }
            let phases = (0..RANKS).filter(|&place| pattern[place]).map(|place| {
                TAU / SIDE as f64
                    * (f64::from(fx) * (place % SIDE) as f64 + f64::from(fy) * (place / SIDE) as f64)
            });
            let [cosines, sines] =
                phases.fold([0.0, 0.0], |[c, s], phase| [c + phase.cos(), s + phase.sin()]);
            powers.push(cosines * cosines + sines * sines);
        }
        let picked = pattern.iter().filter(|picked| **picked).count() as f64;
        let independent = picked * (1.0 - picked / RANKS as f64);
        powers.iter().sum::<f64>() / powers.len() as f64 / independent
    }

    #[test]
    fn patterns_have_little_power_at_low_frequencies() {
        let ranks = stored();
        let mut random = Random(2);
        for percent in [1, 2, 5, 10, 25, 50, 75] {
            let count = RANKS as u32 * percent / 100;
            // Evenly spread pixels, or gaps, repeat so often across the mask; more than every second pixel cannot.
            let principal = f64::from(count.min(RANKS as u32 - count)).sqrt().min(0.5 * SIDE as f64);
            let below =
                low_power(&ranks.iter().map(|&rank| rank < count).collect::<Vec<_>>(), 0.5 * principal);
            let white: Vec<bool> = (0..RANKS).map(|_| random.below(100) < percent).collect();
            let white = low_power(&white, 0.5 * principal);
            assert!(below < 0.2, "{percent}%: {below}");
            assert!((0.5..2.0).contains(&white), "{percent}%, independent: {white}");
        }
    }
}
