//! Boxes for the builder of bounding volume hierarchies.

use obvhs::aabb::Aabb;
use rayon::prelude::*;

/// So many boxes of exactly one size are made unlike.
const MANY: usize = 4096;

/// Enlarges boxes by up to `by`, each by another amount, if thousands have exactly the same size, as the copies of one
/// object have. The builder joins neighbours that suit each other best; in a row of equal ones at equal distances, each
/// would choose the next, and only the last two would agree, in every pass anew.
pub(crate) fn make_unlike(boxes: &mut [Aabb], by: f32) {
    if boxes.len() < MANY {
        return;
    }
    let size = |bounds: &Aabb| (bounds.max - bounds.min).to_array().map(f32::to_bits);
    let mut sizes: Vec<[u32; 3]> = boxes.iter().map(size).collect();
    sizes.par_sort_unstable();
    if sizes.chunk_by(|a, b| a == b).all(|alike| alike.len() < MANY) {
        return;
    }
    for (index, bounds) in (0_u32..).zip(boxes) {
        // The upper bits of a product with an odd number are as good as random.
        let share = (index.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
        bounds.min -= share * by;
        bounds.max += share * by;
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;

    #[test]
    fn only_many_equal_boxes_grow() {
        let row = |count: usize| -> Vec<Aabb> {
            (0..count)
                .map(|i| Aabb::new(Vec3A::splat(2.0 * i as f32), Vec3A::splat(2.0 * i as f32 + 1.0)))
                .collect()
        };
        let mut few = row(4095);
        make_unlike(&mut few, 0.25);
        assert!(few.iter().zip(row(4095)).all(|(a, b)| (a.min, a.max) == (b.min, b.max)));
        let mut many = row(4096);
        make_unlike(&mut many, 0.25);
        let grown: Vec<f32> = many.iter().zip(row(4096)).map(|(a, b)| a.max.x - b.max.x).collect();
        let most = grown.iter().copied().fold(0.0, f32::max);
        assert!(grown.iter().all(|by| (0.0..=0.26).contains(by)) && most > 0.24, "{most}");
        assert!(grown.windows(2).filter(|pair| pair[0] == pair[1]).count() < 50);
        // Coordinates of some thousands are exact to some ten thousandths.
        let both = many.iter().zip(row(4096)).map(|(a, b)| (b.min.x - a.min.x, a.max.x - b.max.x));
        assert!(both.into_iter().all(|(low, high)| (low - high).abs() < 2e-3));
    }
}
