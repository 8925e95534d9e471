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
