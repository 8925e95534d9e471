//! The peer: the vertex codec of meshoptimizer, <https://github.com/zeux/meshoptimizer>. It is C++, so that it is built
//! only with the feature `meshopt`.

use epigraph_streams::Node;

use super::Coded;

/// The points of nodes by the codec, each node a buffer of its own: x, y and z as bytes, and 0, in Morton order, which
/// its differences from vertex to vertex like best.
#[cfg(feature = "meshopt")]
pub fn measure(nodes: &[&Node]) -> Option<Coded> {
    use std::{hint::black_box, time::Instant};

    let points = |node: &&Node| {
        let mut cells: Vec<[u8; 4]> = node
            .cells()
            .into_iter()
            .map(|cell| {
                let [x, y, z] = cell.at().map(|part| part as u8);
                [x, y, z, 0]
            })
            .collect();
        cells.sort_by_key(morton);
        cells
    };
    let start = Instant::now();
    let buffers: Vec<Vec<[u8; 4]>> = nodes.iter().map(points).collect();
    let encoded =
        buffers.iter().map(|buffer| Some((meshopt::encode_vertex_buffer(buffer).ok()?, buffer.len())));
    let encoded = encoded.collect::<Option<Vec<_>>>()?;
    let encode = start.elapsed().as_secs_f64();
    let decoded = |(bytes, count): &(Vec<u8>, usize)| meshopt::decode_vertex_buffer::<[u8; 4]>(bytes, *count);
    let is_exact = encoded
        .iter()
        .zip(&buffers)
        .all(|(encoded, buffer)| decoded(encoded).is_ok_and(|all| all == *buffer));
    assert!(is_exact, "meshopt decodes what it encoded");
    let count = buffers.iter().map(Vec::len).sum();
    let decode = super::rate(count, || {
        encoded.iter().for_each(|encoded| drop(black_box(decoded(encoded))));
    });
    let bytes = encoded.iter().map(|(bytes, _)| bytes.len()).sum();
    Some(Coded { codec: "meshopt".into(), bytes, points: count, encode, decode })
}

/// The bits of x, y and z interleaved.
#[cfg(feature = "meshopt")]
fn morton([x, y, z, _]: &[u8; 4]) -> u32 {
    let spread = |part: u8| (0..7).map(|bit| u32::from(part >> bit & 1) << (3 * bit)).sum::<u32>();
    spread(*x) | spread(*y) << 1 | spread(*z) << 2
}

/// Nothing: the program was built without the peer.
#[cfg(not(feature = "meshopt"))]
pub fn measure(_: &[&Node]) -> Option<Coded> {
    None
}

/// What to say of the peer.
pub fn note() -> &'static str {
    if cfg!(feature = "meshopt") {
        "meshopt: meshoptimizer's vertex codec, x, y and z as bytes in Morton order, each node a buffer"
    } else {
        "meshopt, the peer, needs a C++ compiler: cargo run --release --features meshopt -- bench --streams"
    }
}
