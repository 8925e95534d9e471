//! Indices: of triangles, by the edges and vertices that they share with those before, or of anything, by differences.

use super::Reader;

/// Indices as numbers of two or four bytes.
pub(super) fn bytes(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// A number in groups of seven bits, the lowest first.
fn variable(body: &mut Reader) -> Option<u32> {
    let mut number = 0;
    for shift in (0..35).step_by(7) {
        let byte = body.byte()?;
        number |= u32::from(byte & 127).wrapping_shl(shift);
        if byte < 128 {
            break;
        }
    }
    Some(number)
}

/// A difference with its sign in the lowest bit.
fn signed(number: u32) -> u32 {
    number >> 1 ^ 0_u32.wrapping_sub(number & 1)
}

/// `count` indices; `None` if the data is damaged.
pub(super) fn sequence(data: &[u8], count: usize) -> Option<Vec<u32>> {
    const TAIL: usize = 4;
    let (0xD0 | 0xD1, data) = data.split_first()? else { return None };
    let mut body = Reader(data.split_at_checked(data.len().checked_sub(TAIL)?)?.0);
    // Two interleaved runs.
    let mut last = [0_u32; 2];
    let mut index = || {
        let number = variable(&mut body)?;
        let run = &mut last[(number & 1) as usize];
        *run = run.wrapping_add(signed(number >> 1));
        Some(*run)
    };
    let indices: Vec<u32> = (0..count).map_while(|_| index()).collect();
    (indices.len() == count && body.0.is_empty()).then_some(indices)
}

/// The last sixteen edges and vertices.
struct Recent {
    edges: [[u32; 2]; 16],
    vertices: [u32; 16],
    edge: usize,
    vertex: usize,
}

impl Recent {
    fn push_edges<const N: usize>(&mut self, edges: [[u32; 2]; N]) {
        for edge in edges {
            self.edges[self.edge & 15] = edge;
            self.edge += 1;
        }
    }

    fn push_vertex(&mut self, vertex: u32) {
        self.vertices[self.vertex & 15] = vertex;
        self.vertex += 1;
    }

    /// The vertex pushed so long ago; 1 is the last.
    fn vertex(&self, ago: usize) -> u32 {
        self.vertices[self.vertex.wrapping_sub(ago) & 15]
    }
}

/// The `count` corners of triangles; `None` if the data is damaged.
pub(super) fn triangles(data: &[u8], count: usize) -> Option<Vec<u32>> {
    const TABLE: usize = 16;
    let (header, data) = data.split_first()?;
    // The second version has short forms for neighbours of the last free index.
    let first_free = match header {
        0xE0 => 15,
        0xE1 => 13,
        _ => return None,
    };
    let (codes, data) = data.split_at_checked(count / 3)?;
    let (body, table) = data.split_at_checked(data.len().checked_sub(TABLE)?)?;
    let mut body = Reader(body);
    let mut recent = Recent { edges: [[u32::MAX; 2]; 16], vertices: [u32::MAX; 16], edge: 0, vertex: 0 };
    // The next new vertex, and the last free one.
    let (mut next, mut last) = (0_u32, 0_u32);
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        let [high, low] = [code >> 4, code & 15].map(usize::from);
        if high < 15 {
            // One new corner at an edge.
            let [a, b] = recent.edges[recent.edge.wrapping_sub(1 + high) & 15];
            let c = if low == 0 {
                take(&mut next)
            } else if low < first_free {
                recent.vertex(1 + low)
            } else {
                last = match low {
                    13 => last.wrapping_sub(1),
                    14 => last.wrapping_add(1),
                    _ => last.wrapping_add(signed(variable(&mut body)?)),
                };
                last
            };
            if low == 0 || low >= first_free {
                recent.push_vertex(c);
            }
            recent.push_edges([[c, b], [a, c]]);
            indices.extend([a, b, c]);
            continue;
        }
        // Three corners: for each 0 is a new one, 15 a free one, and others were so long ago.
        let corners = if low < 14 { table[low] } else { body.byte()? };
        let kinds = [if low == 15 { 15 } else { 0 }, usize::from(corners >> 4), usize::from(corners & 15)];
        if low >= 14 && corners == 0 {
            next = 0;
        }
        let mut triangle = kinds.map(|kind| if kind == 0 { take(&mut next) } else { recent.vertex(kind) });
        for (corner, kind) in triangle.iter_mut().zip(kinds) {
            // The table has none that are free.
            if kind == 15 && low >= 14 {
                last = last.wrapping_add(signed(variable(&mut body)?));
                *corner = last;
            }
        }
        let [a, b, c] = triangle;
        for (corner, kind) in triangle.into_iter().zip(kinds) {
            if kind == 0 || kind == 15 && low >= 14 {
                recent.push_vertex(corner);
            }
        }
        recent.push_edges([[b, a], [c, b], [a, c]]);
        indices.extend(triangle);
    }
    body.0.is_empty().then_some(indices)
}

fn take(next: &mut u32) -> u32 {
    let taken = *next;
    *next = next.wrapping_add(1);
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Groups of seven bits, the lowest first; all but the last with the highest bit set.
    fn groups(mut number: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        while number >= 128 {
            bytes.push(number as u8 | 128);
            number >>= 7;
        }
        bytes.push(number as u8);
        bytes
    }

    /// A difference with its sign in the lowest bit: 0, -1, 1, -2, ...
    fn with_sign(difference: i32) -> u32 {
        if difference < 0 { 2 * difference.unsigned_abs() - 1 } else { 2 * difference as u32 }
    }

    #[test]
    fn numbers_have_one_to_five_bytes() {
        for bits in 0..32 {
            let power = 1_u32 << bits;
            for number in [power - 1, power, power | 1, power.wrapping_mul(3), power ^ 0x5555_5555, u32::MAX]
            {
                let bytes = groups(number);
                let mut reader = Reader(&bytes);
                assert_eq!((variable(&mut reader), reader.0.len()), (Some(number), 0), "{bytes:?}");
                assert_eq!(variable(&mut Reader(&bytes[..bytes.len() - 1])), None, "{bytes:?}");
            }
        }
        for difference in [0, 1, -1, 2, -2, 127, -128, 1 << 29, -(1 << 29)] {
            assert_eq!(signed(with_sign(difference)), difference as u32, "{difference}");
        }
    }

    #[test]
    fn a_sequence_has_two_runs_of_differences() {
        // The index, and its run: near 1000 and near the end, with differences of either sign, odd and even.
        let wanted = [
            (1000, 0),
            (500_000_000, 1),
            (1001, 0),
            (999, 0),
            (499_999_999, 1),
            (500_000_063, 1),
            (935, 0),
            (936, 0),
            (70_000, 0),
            (7, 1),
        ];
        let mut data = vec![0xD1];
        let mut last = [0_i32; 2];
        for (index, run) in wanted {
            data.extend(groups(with_sign(index - last[run]) << 1 | run as u32));
            last[run] = index;
        }
        data.extend([0; 4]);
        let expected: Vec<u32> = wanted.iter().map(|(index, _)| *index as u32).collect();
        assert_eq!(sequence(&data, wanted.len()), Some(expected));
        assert_eq!(sequence(&data, wanted.len() - 1), None, "a number too many");
        assert_eq!(sequence(&data, wanted.len() + 1), None, "one too few");
        data[0] = 0xD2;
        assert_eq!(sequence(&data, wanted.len()), None, "another kind of stream");
    }

    #[test]
    fn triangles_begin_anew_at_edges_and_at_free_corners() {
        // The codes, the bytes after them, and the triangles, of both versions of the format.
        let with_table = |last: u8, header: u8, codes: &[u8], body: &[u8]| {
            let mut table = [0x00, 0x10, 0x12, 0x21, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
            table[13] = last;
            let data = [&[header], codes, body, &table].concat();
            triangles(&data, 3 * codes.len()).map(|all| all.as_chunks::<3>().0.to_vec())
        };
        let decode = |header: u8, codes: &[u8], body: &[u8]| with_table(0, header, codes, body);
        // Three new corners, by the table. Then a new one at the last edge, at the one before, and at the third last.
        let strip = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 2, 5]];
        // Then sixteen corners around the first one, a new one at an edge that is fifteen ago, and others of before.
        let fan: Vec<[u32; 3]> = (0..15).map(|k| [0, k + 1, k + 2]).chain([[0, 9, 17]]).collect();
        let fan_codes = [&[0xF0][..], &[0x00; 14], &[0xE0]].concat();
        let after_fan = |last: u8, header: u8, more: &[u8]| {
            let all = with_table(last, header, &[&fan_codes, more].concat(), &[])?;
            (all[..16] == fan[..]).then(|| all[16..].to_vec())
        };
        for header in [0xE0, 0xE1] {
            assert_eq!(decode(header, &[0xF0, 0x00, 0x10, 0x30], &[]), Some(strip.to_vec()));
            // Corners of before at the last edge: the one before the last, and the one before that.
            let back = [[0, 1, 2], [0, 2, 3], [0, 3, 2], [0, 2, 1]];
            assert_eq!(decode(header, &[0xF0, 0x00, 0x01, 0x02], &[]), Some(back.to_vec()));
            assert_eq!(after_fan(0, header, &[0x0C]), Some(vec![[0, 17, 5]]));
            // Free corners: 5 more, 2 less than the last one. They count among those of before.
            let free = [[0, 1, 2], [0, 2, 5], [0, 5, 3], [0, 3, 5]];
            let differences = [groups(with_sign(5)), groups(with_sign(-2))].concat();
            assert_eq!(decode(header, &[0xF0, 0x0F, 0x0F, 0x01], &differences), Some(free.to_vec()));
            // Three corners by the table: all new; new, the last, new; new, the last, the one before; new, the one
            // before, the last.
            let corners = [[0, 1, 2], [3, 4, 5], [6, 5, 7], [8, 7, 6], [9, 7, 8]];
            assert_eq!(decode(header, &[0xF0, 0xF0, 0xF1, 0xF2, 0xF3], &[]), Some(corners.to_vec()));
            // The last entry of the table: all new; new, the fifteenth last, the last. None there is free.
            assert_eq!(decode(header, &[0xF0, 0xFD], &[]), Some(vec![[0, 1, 2], [3, 4, 5]]));
            assert_eq!(after_fan(0xF1, header, &[0xFD, 0xFD]), Some(vec![[18, 3, 17], [19, 4, 18]]));
            // By a byte: new and those of before; new, free, the last; all free; all new from the beginning.
            let bytes = [
                &[0x12, 0xF1][..],
                &groups(with_sign(40)),
                &[0xFF],
                &groups(with_sign(-1)),
                &groups(with_sign(2)),
                &groups(with_sign(3)),
                &[0x00],
            ];
            let by_byte = [[0, 1, 2], [3, 2, 1], [4, 40, 3], [39, 41, 44], [0, 1, 2]];
            assert_eq!(
                decode(header, &[0xF0, 0xFE, 0xFE, 0xFF, 0xFE], &bytes.concat()),
                Some(by_byte.to_vec())
            );
        }
        // 13 and 14 are the neighbours of the last free corner, but in the first version corners of before.
        let neighbours = [[0, 1, 2], [0, 2, 9], [0, 9, 8], [0, 8, 9]];
        let nine = groups(with_sign(9));
        assert_eq!(decode(0xE1, &[0xF0, 0x0F, 0x0D, 0x0E], &nine), Some(neighbours.to_vec()));
        assert_eq!(after_fan(0, 0xE0, &[0x0D, 0x0E, 0x0C]), Some(vec![[0, 17, 4], [0, 4, 3], [0, 3, 5]]));
        assert_eq!(decode(0xE2, &[0xF0], &[]), None, "another version");
        assert_eq!(decode(0xE1, &[0xF0], &[0]), None, "a byte too many");
        assert_eq!(decode(0xE1, &[0x0F], &[]), None, "one too few");
    }
}
