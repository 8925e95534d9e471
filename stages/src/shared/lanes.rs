//! Eight pixels or points at a time, in the vectors of [`fearless_simd`]. Each function here and each one that works on
//! lanes is inlined into a `dispatch!`, which compiles it for each kind of processor; all compute the same bits.

#[cfg(target_arch = "x86_64")]
use fearless_simd::x86::Avx2;
use fearless_simd::{Simd, f32x8, mask32x8, prelude::*, u32x8};

/// The number of lanes.
pub const LANES: usize = 8;

/// Eight vectors of four numbers by channel: lane i of channel c is `vectors[i][c]`.
#[inline(always)]
pub fn load_transposed<S: Simd>(simd: S, vectors: &[[f32; 4]; LANES]) -> [f32x8<S>; 4] {
    let (halves, _) = vectors.as_flattened().as_chunks::<16>();
    let [first, second] = [0, 1].map(|half| simd.load_four_interleaved_f32x4(&halves[half]));
    std::array::from_fn(|channel| first[channel].combine(second[channel]))
}

/// The inverse of [`load_transposed`].
#[inline(always)]
fn store_transposed<S: Simd>(simd: S, channels: [f32x8<S>; 4], vectors: &mut [[f32; 4]; LANES]) {
    let (halves, _) = vectors.as_flattened_mut().as_chunks_mut::<16>();
    let [a, b, c, d] = channels.map(SimdSplit::split);
    simd.store_four_interleaved_f32x4([a.0, b.0, c.0, d.0], &mut halves[0]);
    simd.store_four_interleaved_f32x4([a.1, b.1, c.1, d.1], &mut halves[1]);
}

/// Writes as many of eight vectors, given by channel, as there is room for.
#[inline(always)]
pub fn store_vectors<S: Simd>(simd: S, channels: [f32x8<S>; 4], to: &mut [[f32; 4]]) {
    match to.as_mut_array() {
        Some(to) => store_transposed(simd, channels, to),
        None => {
            let mut vectors = [[0.0; 4]; LANES];
            store_transposed(simd, channels, &mut vectors);
            to.copy_from_slice(&vectors[..to.len()]);
        }
    }
}

/// The smaller number of each lane, the second one where one is NaN. `nearer.rs` has it for a single lane.
#[inline(always)]
pub fn lesser<S: Simd>(simd: S, a: f32x8<S>, b: f32x8<S>) -> f32x8<S> {
    simd.select_f32x8(simd.simd_lt_f32x8(a, b), a, b)
}

/// All bits of the lanes that are set, else none.
#[inline(always)]
pub fn bits<S: Simd>(simd: S, mask: mask32x8<S>) -> u32x8<S> {
    simd.select_u32x8(mask, u32x8::splat(simd, !0), u32x8::splat(simd, 0))
}

/// [`if_odd`](super::edge_pixel::if_odd) of eight numbers: those of the lanes whose lowest bit is set in `lanes`, else 0.
#[inline(always)]
pub fn if_odd<S: Simd>(simd: S, lanes: u32x8<S>, numbers: u32x8<S>) -> u32x8<S> {
    (u32x8::splat(simd, 0) - (lanes & 1)) & numbers
}

/// Eight elements of a slice, with zeros behind the last one.
#[inline(always)]
pub fn padded<T: Copy + Default>(slice: &[T], first: usize) -> [T; LANES] {
    match slice.get(first..first + LANES).and_then(|lanes| lanes.as_array()) {
        Some(lanes) => *lanes,
        None => std::array::from_fn(|lane| slice.get(first + lane).copied().unwrap_or_default()),
    }
}

/// Writes as many of eight elements as there is room for.
#[inline(always)]
pub fn store<T: Copy>(lanes: &[T; LANES], to: &mut [T]) {
    match to.as_mut_array() {
        Some(to) => *to = *lanes,
        None => to.copy_from_slice(&lanes[..to.len()]),
    }
}

/// Writes the numbers of the lanes that are set, one after the other, and returns how many these are. Writes eight in any
/// case, as it then needs no branch; the next group overwrites the rest. So a list has room for [`LANES`] more.
#[inline(always)]
pub fn append<S: Simd>(simd: S, numbers: u32x8<S>, mask: mask32x8<S>, to: &mut [u32]) -> usize {
    store(&simd.compress_u32x8(numbers, mask).to_array(), &mut to[..LANES]);
    mask.to_bitmask().count_ones() as usize
}

/// The entries of a table at these indices, of which the lowest four bits count.
#[inline(always)]
pub fn look_up<S: Simd>(simd: S, table: &[f32; 16], indices: u32x8<S>) -> f32x8<S> {
    let indices = indices.to_array();
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = simd.level().as_avx2() {
        return f32x8::load_array(simd, permute(avx2, table, indices));
    }
    f32x8::from_fn(simd, |lane| table[(indices[lane] & 15) as usize])
}

#[cfg(target_arch = "x86_64")]
fearless_simd::kernel!(
    #[inline(always)]
    fn permute(avx2: Avx2, table: &[f32; 16], indices: [u32; LANES]) -> [f32; LANES] {
        use std::arch::x86_64::{
            __m256, __m256i, _mm256_blendv_ps, _mm256_castsi256_ps, _mm256_permutevar8x32_ps,
            _mm256_slli_epi32,
        };
        let indices: __m256i = u32x8::load_array(avx2, indices).into();
        let halves: (&[[f32; LANES]], _) = table.as_chunks();
        let [low, high] = [0, 1].map(|half| -> __m256 {
            _mm256_permutevar8x32_ps(f32x8::load_array(avx2, halves.0[half]).into(), indices)
        });
        // The fourth bit says which half.
        let is_high = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(indices));
        let found: f32x8<Avx2> = _mm256_blendv_ps(low, high, is_high).simd_into(avx2);
        found.to_array()
    }
);
