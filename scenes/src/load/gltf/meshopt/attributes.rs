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
