//! Filters: what decoded attributes stand for.

/// Applies a filter to elements of `stride` bytes; false if there is none of that name and size.
pub(super) fn apply(filter: &str, elements: &mut [u8], stride: usize) -> bool {
    match (filter, stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => elements.as_chunks_mut().0.iter_mut().for_each(|element: &mut [u8; 4]| {
            let [x, y, z, rest] = element.map(u8::cast_signed);
            let normal = octahedral([x, y, z].map(f32::from), 127.0).map(|n| (n as i8).cast_unsigned());
            *element = [normal[0], normal[1], normal[2], rest.cast_unsigned()];
        }),
        ("OCTAHEDRAL", 8) => of_shorts(elements, |[x, y, z, rest]| {
            let [x, y, z] = octahedral([x, y, z].map(f32::from), 32767.0).map(|n| n as i16);
            [x, y, z, rest]
        }),
        ("QUATERNION", 8) => of_shorts(elements, quaternion),
        ("EXPONENTIAL", _) => elements.as_chunks_mut().0.iter_mut().for_each(|element: &mut [u8; 4]| {
            *element = exponential(i32::from_le_bytes(*element)).to_le_bytes();
        }),
        ("COLOR", 4) => elements.as_chunks_mut().0.iter_mut().for_each(|element: &mut [u8; 4]| {
            let [y, co, cg, a] = *element;
            let [co, cg] = [co, cg].map(|c| i32::from(c.cast_signed()));
            *element = color(y.into(), co, cg, a.into(), 255.0).map(|c| c as u8);
        }),
        ("COLOR", 8) => of_shorts(elements, |[y, co, cg, a]| {
            let [y, a] = [y, a].map(|n| i32::from(n.cast_unsigned()));
            color(y, co.into(), cg.into(), a, 65535.0).map(|c| (c as u16).cast_signed())
        }),
        _ => return false,
    }
    true
}

fn of_shorts(elements: &mut [u8], filter: impl Fn([i16; 4]) -> [i16; 4]) {
    for element in elements.as_chunks_mut::<8>().0 {
        let [a, b, c, d, e, f, g, h] = *element;
        let shorts = filter([[a, b], [c, d], [e, f], [g, h]].map(i16::from_le_bytes));
        let [[a, b], [c, d], [e, f], [g, h]] = shorts.map(i16::to_le_bytes);
        *element = [a, b, c, d, e, f, g, h];
    }
}

/// A unit vector, times `largest`, of its place on an octahedron whose corners are `one` from the centre.
fn octahedral([x, y, one]: [f32; 3], largest: f32) -> [f32; 3] {
    let z = one - x.abs() - y.abs();
    // The lower half is folded outwards.
    let fold = z.min(0.0);
    let [x, y] = [x, y].map(|n| if n >= 0.0 { n + fold } else { n - fold });
    let scale = largest / (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|n| (n * scale).round())
}

/// A unit quaternion of its three smaller components; the lowest bits of the last say which one is missing, the others
/// how large one is.
fn quaternion([x, y, z, w]: [i16; 4]) -> [i16; 4] {
    let one = f32::from(w | 3);
    let [x, y, z] = [x, y, z].map(f32::from);
    let rest = (2.0 * one * one - x * x - y * y - z * z).max(0.0).sqrt();
    let scale = 32767.0 / 2.0_f32.sqrt() / one;
    let [x, y, z, rest] = [x, y, z, rest].map(|n| (n * scale).round() as i16);
    let missing = (w & 3) as usize;
    let mut quaternion = [0; 4];
    for (after, value) in [rest, x, y, z].into_iter().enumerate() {
        quaternion[(missing + after) & 3] = value;
    }
    quaternion
}

/// A float of 24 bits of mantissa and 8 of exponent.
fn exponential(bits: i32) -> f32 {
    let (mantissa, exponent) = (bits << 8 >> 8, bits >> 24);
    mantissa as f32 * 2.0_f32.powi(exponent)
}

/// Red, green, blue and opacity of luma and two differences; the highest bit of `alpha` says what one is.
fn color(luma: i32, co: i32, cg: i32, alpha: i32, largest: f32) -> [f32; 4] {
    let one = ((alpha as u32 + 1).next_power_of_two() - 1) as i32;
    let opacity = (alpha << 1) & one | alpha & 1;
    let scale = largest / one as f32;
    [luma + co - cg, luma + cg, luma - co - cg, opacity]
        .map(|n| (n as f32 * scale + 0.5).floor().clamp(0.0, largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shorts(filter: &str, element: [i16; 4]) -> [i16; 4] {
        let mut bytes = element.map(i16::to_le_bytes).concat();
        assert!(apply(filter, &mut bytes, 8));
        let found: Vec<i16> = bytes.as_chunks().0.iter().map(|pair| i16::from_le_bytes(*pair)).collect();
        found.try_into().unwrap()
    }

    #[test]
    fn octahedra_become_unit_vectors() {
        let root = |square: f32| (32767.0 * square.sqrt()).round() as i16;
        for (element, expected) in [
            ([0, 0, 127, 5], [0, 0, 32767, 5]),
            ([127, 0, 127, 5], [32767, 0, 0, 5]),
            ([64, -64, 128, 0], [root(0.5), -root(0.5), 0, 0]),
            // Beyond the middle, the other side: a corner is straight down.
            ([127, -127, 127, 0], [0, 0, -32767, 0]),
        ] {
            assert_eq!(shorts("OCTAHEDRAL", element), expected);
        }
        // More than a corner away, which is folded over the edge towards -x.
        let found = shorts("OCTAHEDRAL", [0, -100, 64, 0]);
        let expected = [-36.0, -64.0, -36.0].map(|n: f32| (n * 32767.0 / 6688_f32.sqrt()).round() as i16);
        assert_eq!(found[..3], expected);
        let mut bytes = [0, 127_u8.wrapping_neg(), 127, 9];
        assert!(apply("OCTAHEDRAL", &mut bytes, 4));
        assert_eq!(bytes.map(u8::cast_signed), [0, -127, 0, 9]);
    }

    #[test]
    fn quaternions_get_their_largest_component_back() {
        let one = 1 << 10;
        let half = (32767.0 * 0.5_f32.sqrt()).round() as i16;
        // A component of sqrt(1/2) is `one`.
        for missing in 0..4_i16 {
            let mut expected = [0; 4];
            expected[(missing as usize + 1) & 3] = half;
            expected[missing as usize] = half;
            let found = shorts("QUATERNION", [one | 3, 0, 0, one | missing]);
            assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1), "{found:?} {expected:?}");
        }
        // All components, of which the second was the largest: the others follow it.
        for [x, y, z] in [[300, -200, 100], [1027, 0, -1027], [0, 700, 1], [-5, 6, -700]] {
            let found = shorts("QUATERNION", [x, y, z, one | 1]);
            let [x, y, z] = [x, y, z].map(|n| f64::from(n) / 1027.0 * 0.5_f64.sqrt());
            let rest = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
            let expected = [z, rest, x, y].map(|n| (32767.0 * n).round() as i16);
            assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1), "{found:?} {expected:?}");
        }
    }

    #[test]
    fn exponents_and_colours() {
        let float = |mantissa: i32, exponent: i32| exponential(exponent << 24 | mantissa & 0xFF_FFFF);
        assert_eq!([float(3, 0), float(-5, 1), float(3, -2)], [3.0, -10.0, 0.75]);
        // Four bits a channel: luma 7, orange 4, green 2 of 15; half of the opacity.
        let mut bytes = [7, 4, 2, 0b1011];
        assert!(apply("COLOR", &mut bytes, 4));
        assert_eq!(bytes, [9 * 17, 9 * 17, 17, 7 * 17]);
        let mut float = ((-4_i32 << 24) | 5).to_le_bytes();
        assert!(apply("EXPONENTIAL", &mut float, 4));
        assert_eq!(f32::from_le_bytes(float), 0.3125);
        // All opacity and none of it, of one bit and of four.
        for (alpha, luma, expected) in
            [(0b1111, 15, [255; 4]), (0b1000, 8, [136, 136, 136, 0]), (0b11, 3, [255; 4]), (0b1, 1, [255; 4])]
        {
            let mut bytes = [luma, 0, 0, alpha];
            assert!(apply("COLOR", &mut bytes, 4));
            assert_eq!(bytes, expected, "{alpha:b}");
        }
        // Sixteen bits a channel.
        let [bright, all] = [40_000_u16, 65_535].map(u16::cast_signed);
        let expected = [40_150_u16, 39_950, 39_950, 65_535].map(u16::cast_signed);
        assert_eq!(shorts("COLOR", [bright, 100, -50, all]), expected);
        assert!(!apply("COLOR", &mut bytes, 12) && !apply("BLUR", &mut bytes, 4));
    }
}
