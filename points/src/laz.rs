//! Lengths within LAS and LAZ files that the crates `las` and `laz` take on trust: they would take memory for them, or
//! panic.

use std::io::Cursor;

use las::Header;
use laz::{LazItemType, LazVlr, laszip::ChunkTable};

/// Refuses an extended record that is longer than the file.
pub(crate) fn check_record(bytes: &[u8]) -> Result<(), String> {
    // Since LAS 1.4.
    if bytes.get(25).is_none_or(|&minor| minor < 4) || number(bytes, 243, 4).is_none_or(|count| count == 0) {
        return Ok(());
    }
    let start = number(bytes, 235, 8).and_then(|start| usize::try_from(start).ok());
    match start.and_then(|start| number(bytes, start.checked_add(20)?, 8)) {
        Some(length) if length > bytes.len() as u64 => {
            Err(format!("its extended record has {length} bytes, more than the file"))
        }
        _ => Ok(()),
    }
}

/// Refuses chunks of compressed points that are longer than the file, or have fewer points than the header says.
pub(crate) fn check_chunks(bytes: &[u8], header: &Header) -> Result<(), String> {
    let vlr = header
        .vlrs()
        .iter()
        .find(|vlr| las::laz::is_laszip_vlr(vlr))
        .ok_or("its points are compressed, but no record says how")?;
    let vlr = LazVlr::read_from(&vlr.data[..])
        .map_err(|error| format!("its record of compression is wrong: {error}"))?;
    if vlr.items().is_empty() || vlr.items_size() != u64::from(header.point_format().len()) {
        return Err("its record of compression does not fit its points".into());
    }
    let start = number(bytes, 96, 4).ok_or("it ends early")?;
    let at = number(bytes, start as usize, 8).filter(|&at| at as i64 > start as i64);
    let at = at.or_else(|| number(bytes, bytes.len().checked_sub(8)?, 8));
    let chunks = at.and_then(|at| number(bytes, usize::try_from(at).ok()?.checked_add(4)?, 4));
    if chunks.is_some_and(|chunks| chunks > bytes.len() as u64) {
        return Err(format!("it promises {} chunks, more than the file can contain", chunks.unwrap_or(0)));
    }
    let mut file = Cursor::new(bytes);
    file.set_position(start);
    let table = ChunkTable::read_from(&mut file, &vlr).ok();
    // Of chunks of the same number of points, the table is not needed.
    let counts = match &table {
        Some(table) if vlr.uses_variable_size_chunks() => {
            Counts::Listed(table.as_ref().iter().map(|chunk| chunk.point_count).collect())
        }
        _ if vlr.uses_variable_size_chunks() => Counts::InChunks,
        _ => Counts::Same(vlr.chunk_size().into()),
    };
    let is_layered = vlr.items()[0].version() >= 3;
    if is_layered || matches!(counts, Counts::Listed(_)) {
        let layers = is_layered.then(|| vlr.items().iter().map(|item| layers(item.item_type())).sum());
        let there = points(bytes, start as usize + 8, vlr.items_size() as usize, layers, &counts);
        if there < header.number_of_points() {
            return Err(format!("it has {} points, but chunks of only {there}", header.number_of_points()));
        }
    }
    Ok(())
}

/// Where the numbers of points of chunks are.
enum Counts {
    Same(u64),
    Listed(Vec<u64>),
    /// At the beginning of a layered chunk.
    InChunks,
}

/// The number of points in chunks, up to the first that does not fit the file. `layers` is the number of layers of a
/// chunk, if it has some: after its first point, a chunk has the number of its points, and the length of each layer.
fn points(bytes: &[u8], start: usize, record: usize, layers: Option<usize>, counts: &Counts) -> u64 {
    let (mut at, mut all) = (start, 0_u64);
    for chunk in 0.. {
        let mut own = None;
        if let Some(layers) = layers {
            let begin = at + record;
            let lengths =
                (0..layers).map(|layer| number(bytes, begin + 4 + 4 * layer, 4)).sum::<Option<u64>>();
            let end = lengths.map(|lengths| begin + 4 + 4 * layers + lengths as usize);
            let Some(end) = end.filter(|&end| end <= bytes.len()) else { break };
            own = number(bytes, begin, 4);
            at = end;
        }
        let count = match counts {
            Counts::Same(count) => Some(*count),
            Counts::Listed(counts) => counts.get(chunk).copied(),
            Counts::InChunks => own,
        };
        let Some(count) = count else { break };
        all = all.saturating_add(count);
    }
    all
}

/// The number of layers of an item of a point.
fn layers(item: LazItemType) -> usize {
    match item {
        LazItemType::Point14 => 9,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => count.into(),
        _ => 1,
    }
}

/// A little-endian number of up to 8 bytes.
fn number(bytes: &[u8], at: usize, length: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(length)?)?;
    Some(bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte)))
}
