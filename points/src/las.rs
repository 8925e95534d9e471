//! LAS and LAZ.

use std::{
    io::Cursor,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    thread,
};

use glam::DVec3;
use las::{Header, PointDataBuilder, Reader};

use crate::{
    cloud::Cloud,
    laz::{check_chunks, check_record},
};

/// The most points that are read together, and the most bytes. Memory is taken for these, however many points a header
/// promises, and however long ones.
const BATCH: u64 = 1 << 14;
const BATCH_BYTES: u64 = 1 << 20;

/// The stack for decoding LAZ, in bytes: the decoder calls itself as often as damaged points say.
const STACK: usize = 256 << 20;

/// Reads a whole file.
pub(crate) fn read(bytes: Vec<u8>) -> Result<Cloud, String> {
    let decoder = thread::Builder::new().stack_size(STACK).spawn(|| decode(bytes));
    let decoder = decoder.map_err(|error| format!("there is no memory to read it: {error}"))?;
    decoder.join().unwrap_or_else(|panic| resume_unwind(panic))
}

fn decode(bytes: Vec<u8>) -> Result<Cloud, String> {
    let wrong = |error: las::Error| format!("its header is wrong: {error}");
    check_record(&bytes)?;
    let header = Header::new(Cursor::new(&bytes[..])).map_err(wrong)?;
    if header.point_format().is_compressed {
        check_chunks(&bytes, &header)?;
    }
    let mut reader = Reader::new(Cursor::new(bytes)).map_err(wrong)?;
    let count = reader.header().number_of_points();
    let together = together(reader.header().point_format().len());
    let has_color = reader.header().point_format().has_color;
    let mut cloud = Cloud::default();
    let mut colors: Vec<[u16; 3]> = Vec::new();
    let mut batch = PointDataBuilder::new().for_header(reader.header()).build();
    let mut index = 0;
    while index < count {
        let fail = |error: las::Error| format!("after point {index} of {count}: {error}");
        // The decoder of LAZ checks most of what it reads, but indexes its tables with some of it.
        let filled = catch_unwind(AssertUnwindSafe(|| reader.fill_points(together, &mut batch)));
        let damaged = || format!("after point {index} of {count}: the compressed points are damaged");
        filled.map_err(|_| damaged())?.map_err(fail)?;
        for point in batch.points() {
            let point = point.map_err(fail)?;
            if point.is_withheld {
                cloud.withheld += 1;
                continue;
            }
            cloud.push(DVec3::new(point.x, point.y, point.z))?;
            if has_color {
                let color = point.color.unwrap_or_default();
                colors.push([color.red, color.green, color.blue]);
            }
        }
        index += batch.len() as u64;
    }
    cloud.colors = bytes_of(&colors);
    Ok(cloud)
}

/// The number of points of so many bytes that are read together.
fn together(length: u16) -> u64 {
    (BATCH_BYTES / u64::from(length.max(1))).clamp(1, BATCH)
}

/// Colours of 16 bits as bytes. Many programs write bytes, against the specification: then no channel of any point is
/// above 255.
fn bytes_of(colors: &[[u16; 3]]) -> Vec<[u8; 4]> {
    let are_bytes = colors.iter().flatten().all(|&channel| channel <= 255);
    let byte =
        |channel: u16| if are_bytes { channel as u8 } else { ((u32::from(channel) + 128) / 257) as u8 };
    colors
        .iter()
        .map(|color| {
            let [red, green, blue] = color.map(byte);
            [red, green, blue, 255]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_points_take_no_more_memory() {
        assert_eq!([0, 20, 64, 256, u16::MAX].map(together), [BATCH, BATCH, BATCH, BATCH / 4, 16]);
    }
}
