//! Vertex attributes: blocks of vertices, in each of which every byte of a vertex has its row of differences.

use super::Reader;

/// Differences that share a width.
const GROUP: usize = 16;
/// Most vertices of a block, and most bytes.
const BLOCK: usize = 256;
const BLOCK_BYTES: usize = 8192;

/// `count` elements of `stride` bytes, a multiple of 4 up to 256; `None` if the data is damaged.
pub(super) fn decode(data: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let (header, data) = data.split_first()?;
    // The second version says for each four bytes of a vertex how their differences are formed.
    let (kinds, shortest_tail) = match header {
        0xA0 => (0, 32),
        0xA1 => (stride / 4, 24),
        _ => return None,
    };
    let padded = (stride + kinds).max(shortest_tail);
    let (body, tail) = data.split_at_checked(data.len().checked_sub(padded)?)?;
    let (first, kinds) = tail[padded - stride - kinds..].split_at(stride);
    let mut last = first.to_vec();
    let mut elements = vec![0; count * stride];
    let mut body = Reader(body);
    let block = (BLOCK_BYTES / stride / GROUP * GROUP).min(BLOCK);
    for vertices in elements.chunks_mut(block * stride) {
        decode_block(&mut body, vertices, &mut last, kinds)?;
    }
    body.0.is_empty().then_some(elements)
}

/// Fills in a block of vertices; `last` is the vertex before them and becomes the last of them.
fn decode_block(body: &mut Reader, vertices: &mut [u8], last: &mut [u8], kinds: &[u8]) -> Option<()> {
    let stride = last.len();
    let count = vertices.len() / stride;
    let controls = body.take(kinds.len())?;
    let mut rows = [[0; BLOCK]; 4];
    for (word, last) in last.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        for (byte, row) in rows.iter_mut().enumerate() {
            let groups = &mut row[..count.next_multiple_of(GROUP)];
            match controls.get(word).map(|control| control >> (2 * byte) & 3) {
                None => decode_groups(body, groups, [0, 2, 4, 8])?,
                Some(0) => decode_groups(body, groups, [0, 1, 2, 4])?,
                Some(1) => decode_groups(body, groups, [1, 2, 4, 8])?,
                Some(2) => groups.fill(0),
                Some(_) => groups[..count].copy_from_slice(body.take(count)?),
            }
        }
        let kind = kinds.get(word).copied().unwrap_or(0);
        for vertex in 0..count {
            let difference = rows.each_ref().map(|row| row[vertex]);
            *last = add(*last, difference, kind)?;
            vertices[vertex * stride + 4 * word..][..4].copy_from_slice(last);
        }
    }
    Some(())
}

/// Four bytes of the next vertex.
fn add(last: [u8; 4], difference: [u8; 4], kind: u8) -> Option<[u8; 4]> {
    // Signs are in the lowest bit.
    let byte = |i: usize| last[i].wrapping_add(difference[i] >> 1 ^ 0_u8.wrapping_sub(difference[i] & 1));
    let short = |i: usize| {
        let [last, difference] = [last, difference].map(|all| u16::from_le_bytes([all[i], all[i + 1]]));
        last.wrapping_add(difference >> 1 ^ 0_u16.wrapping_sub(difference & 1)).to_le_bytes()
    };
    match kind & 3 {
        0 => Some([byte(0), byte(1), byte(2), byte(3)]),
        1 => {
            let [[a, b], [c, d]] = [short(0), short(2)];
            Some([a, b, c, d])
        }
        2 => {
            let turned = u32::from_le_bytes(difference).rotate_right(u32::from(kind >> 4));
            Some((turned ^ u32::from_le_bytes(last)).to_le_bytes())
        }
        _ => None,
    }
}

/// Differences in groups, each of one of four widths in bits, which come first.
fn decode_groups(body: &mut Reader, row: &mut [u8], widths: [u32; 4]) -> Option<()> {
    let choices = body.take((row.len() / GROUP).div_ceil(4))?;
    for (index, group) in row.chunks_mut(GROUP).enumerate() {
        let width = widths[usize::from(choices[index / 4] >> (2 * (index % 4)) & 3)];
        if width == 0 {
            group.fill(0);
        } else if width == 8 {
            group.copy_from_slice(body.take(GROUP)?);
        } else {
            let packed = body.take(GROUP * width as usize / 8)?;
            let escape = (1 << width) - 1;
            for (index, value) in group.iter_mut().enumerate() {
                let bit = index as u32 * width;
                let byte = packed[bit as usize / 8];
                // Single bits count from the lowest, wider values from the highest.
                let shift = if width == 1 { bit % 8 } else { 8 - width - bit % 8 };
                let code = byte >> shift & escape;
                // What is too large for the width follows in full.
                *value = if code == escape { body.byte()? } else { code };
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    /// Differences in groups of sixteen, each of one of the widths that it can have.
    fn encode_groups(row: &[u8], widths: [u32; 4], below: &mut dyn FnMut(usize) -> usize, out: &mut Vec<u8>) {
        let (mut choices, mut data) = (vec![0_u8; row.len().div_ceil(64)], Vec::new());
        for (index, group) in row.chunks(16).enumerate() {
            let group: Vec<u8> = (0..16).map(|at| group.get(at).copied().unwrap_or(0)).collect();
            let choice = loop {
                let choice = below(4);
                if widths[choice] > 0 || group.iter().all(|value| *value == 0) {
                    break choice;
                }
            };
            choices[index / 4] |= (choice << (2 * (index % 4))) as u8;
            let (width, mut escaped) = (widths[choice], Vec::new());
            let escape = ((1_u32 << width) - 1) as u8;
            let codes = group.iter().map(|&value| {
                if width < 8 && value >= escape {
                    escaped.push(value);
                }
                if width < 8 { value.min(escape) } else { value }
            });
            let codes: Vec<u8> = codes.collect();
            for codes in codes.chunks(8 / width.max(1) as usize).filter(|_| width > 0) {
                let place = |at: usize| if width == 1 { at } else { 8 - width as usize * (at + 1) };
                data.push(codes.iter().enumerate().fold(0, |byte, (at, code)| byte | code << place(at)));
            }
            data.extend(escaped.into_iter().filter(|_| width > 0));
        }
        out.extend(choices);
        out.extend(data);
    }

    /// A stream with these elements, in the first version of the format, or in the second if there are kinds.
    fn encode(
        elements: &[u8],
        stride: usize,
        kinds: &[u8],
        below: &mut dyn FnMut(usize) -> usize,
    ) -> Vec<u8> {
        let first: Vec<u8> = (0..stride).map(|_| below(256) as u8).collect();
        let mut out = vec![if kinds.is_empty() { 0xA0 } else { 0xA1 }];
        let mut last = first.clone();
        for block in elements.chunks((8192 / stride / 16 * 16).min(256) * stride) {
            let mut rows = vec![Vec::new(); stride];
            for vertex in block.chunks(stride) {
                for (word, now) in vertex.as_chunks::<4>().0.iter().enumerate() {
                    let before = last.as_chunks::<4>().0[word];
                    let kind = kinds.get(word).copied().unwrap_or(0);
                    let difference = match kind & 3 {
                        0 => [0, 1, 2, 3].map(|i| {
                            let by = now[i].wrapping_sub(before[i]);
                            if by < 128 { 2 * by } else { !(2 * (by - 128)) }
                        }),
                        1 => {
                            let [low, high] = [0, 2].map(|i| {
                                let [now, before] =
                                    [now, &before].map(|all| u16::from_le_bytes([all[i], all[i + 1]]));
                                let by = now.wrapping_sub(before);
                                (if by < 1 << 15 { 2 * by } else { !(2 * (by - (1 << 15))) }).to_le_bytes()
                            });
                            [low[0], low[1], high[0], high[1]]
                        }
                        _ => {
                            let changed = u32::from_le_bytes(*now) ^ u32::from_le_bytes(before);
                            changed.rotate_left(u32::from(kind >> 4)).to_le_bytes()
                        }
                    };
                    (0..4).for_each(|byte| rows[4 * word + byte].push(difference[byte]));
                }
                last.copy_from_slice(vertex);
            }
            let controls: Vec<usize> = rows
                .iter()
                .map(|row| if row.iter().all(|value| *value == 0) { below(4) } else { [0, 1, 3][below(3)] })
                .collect();
            if !kinds.is_empty() {
                let bits =
                    |four: &[usize]| four.iter().rev().fold(0, |bits, control| bits << 2 | *control as u8);
                out.extend(controls.chunks(4).map(bits));
            }
            for (row, control) in rows.iter().zip(controls) {
                match control {
                    _ if kinds.is_empty() => encode_groups(row, [0, 2, 4, 8], below, &mut out),
                    0 => encode_groups(row, [0, 1, 2, 4], below, &mut out),
                    1 => encode_groups(row, [1, 2, 4, 8], below, &mut out),
                    2 => {}
                    _ => out.extend(row),
                }
            }
        }
        let shortest = if kinds.is_empty() { 32_usize } else { 24 };
        out.resize(out.len() + shortest.saturating_sub(stride + kinds.len()), 0);
        out.extend(first);
        out.extend(kinds);
        out
    }

    #[test]
    fn streams_of_all_widths_kinds_and_sizes_are_decoded() {
        let mut rng = Rng::new(7, 0);
        let mut below = |limit: usize| (rng.next_f32() * limit as f32) as usize;
        for stride in [4, 8, 12, 24, 28, 32, 60, 64, 100, 256] {
            for count in [1, 15, 16, 17, 65, 257, 600] {
                // Words that stay, that change by little, and that are anything.
                let most: Vec<usize> = (0..stride / 4).map(|_| [1, 2, 5, 20, 256][below(5)]).collect();
                let mut elements = Vec::new();
                for at in 0..count * stride {
                    let before = if at < stride { 0 } else { elements[at - stride] };
                    elements.push(u8::wrapping_add(before, below(most[at % stride / 4]) as u8));
                }
                let all = [0, 1, 2, 0x12, 0x72, 0xF2];
                let kinds: Vec<u8> = (0..stride / 4).map(|_| all[below(6)]).collect();
                for kinds in [&[][..], &kinds] {
                    let mut stream = encode(&elements, stride, kinds, &mut below);
                    let found = decode(&stream, count, stride);
                    assert!(found.as_ref() == Some(&elements), "{count} of {stride} bytes, {kinds:?}");
                    stream[0] = 0xA2;
                    assert_eq!(decode(&stream, count, stride), None, "a version that there is not");
                }
            }
        }
        // The fourth kind is none.
        let stream = encode(&[1, 2, 3, 4], 4, &[0], &mut below);
        let unknown = [&stream[..stream.len() - 1], &[3]].concat();
        assert!(decode(&stream, 1, 4).is_some() && decode(&unknown, 1, 4).is_none());
    }
}
