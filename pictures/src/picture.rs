//! Images read from files.

use std::{io::Cursor, path::Path};

use epigraph_core::{Dims, Element, Format, Snapshot};
use epigraph_files::{FileError, MOST_DATA};
use exr::{
    meta::MetaData,
    prelude::{AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers},
};
use image::{DynamicImage, ImageDecoder, codecs::png::PngDecoder};

use crate::{Mode, Number, Shown, lanes, tone};

/// The most pixels of a picture that is read: 8192x8192. Comparing two of them takes 2 GB.
pub const MOST_PIXELS: usize = 1 << 26;

/// The most channels of an EXR file.
const MOST_CHANNELS: usize = 64;

/// An image's colours, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height.
    pub size: [usize; 2],
    /// As stored in the file: linear light from EXR, sRGB in [0, 1] from PNG.
    pub colors: Vec<[f32; 3]>,
    /// True if they are linear.
    pub linear: bool,
}

impl Picture {
    /// Reads a `.png` or `.exr` file. An image of one channel becomes grey.
    ///
    /// # Errors
    /// The file cannot be read, or is not an image of the kind that its extension names.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = epigraph_files::bytes(path, MOST_DATA).map_err(|error| FileError::read(path, error))?;
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match ending.as_str() {
            "png" => read_png(&bytes).map_err(|cause| FileError::read(path, cause)),
            "exr" => read_exr(&bytes).map_err(|cause| FileError::read(path, cause)),
            _ => Err(FileError::read(path, "only .png and .exr images are read")),
        }
    }

    /// The colours as displayed: 8-bit sRGB.
    pub fn shown(size: [usize; 2], colors: &[[u8; 3]]) -> Self {
        let colors = colors.iter().map(|color| color.map(|byte| f32::from(byte) / 255.0)).collect();
        Self { size, colors, linear: false }
    }

    /// A port's image for comparison: floats of three lanes or more unchanged, everything else as it is shown.
    pub fn of_port(snapshot: &Snapshot, shown: &Shown) -> Self {
        let lanes = lanes(&snapshot.element);
        let is_light = shown.mode == Mode::Color && snapshot.element != Element::Texel(Format::Rgba8Unorm);
        match lanes.as_slice() {
            [r, g, b, ..] if is_light && [r, g, b].iter().all(|lane| lane.is_float()) => {
                let channels = [r, g, b].map(|lane| lane.numbers(snapshot).map(Number::as_f32));
                let [r, g, b] = channels;
                let colors = r.zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
                Self { size: shown.size, colors, linear: true }
            }
            _ => Self::shown(shown.size, &shown.colors),
        }
    }

    /// The image as a port, so that it can be shown like one.
    pub fn to_port(&self, name: &str) -> Snapshot {
        let (format, bytes) = if self.linear {
            let texel = |[r, g, b]: &[f32; 3]| [*r, *g, *b, 1.0];
            let texels: Vec<[f32; 4]> = self.colors.iter().map(texel).collect();
            (Format::Rgba32Float, bytemuck::cast_slice(&texels).to_vec())
        } else {
            let texel = |color: &[f32; 3]| color.map(tone::to_byte);
            let texels = self.colors.iter().map(texel).flat_map(|[r, g, b]| [r, g, b, u8::MAX]);
            (Format::Rgba8Unorm, texels.collect())
        };
        let [width, height] = self.size.map(|side| side as u32);
        let (name, element, dims) = (name.to_owned(), Element::Texel(format), Dims { width, height });
        Snapshot { name, field: String::new(), meaning: None, element, dims, frame: 0, bytes }
    }

    /// The colours in sRGB, clamped to [0, 1].
    pub fn srgb(&self) -> Vec<[f32; 3]> {
        (0..self.colors.len()).map(|index| self.srgb_at(index)).collect()
    }

    /// The colour of one pixel in sRGB, clamped to [0, 1].
    pub fn srgb_at(&self, index: usize) -> [f32; 3] {
        let color = self.colors[index];
        if self.linear { color.map(tone::encode) } else { color }
    }
}

fn read_png(bytes: &[u8]) -> Result<Picture, String> {
    let decoder = PngDecoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    check_size(width as usize, height as usize)?;
    let image = DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?.into_rgb32f();
    let size = [image.width() as usize, image.height() as usize];
    Ok(Picture { size, colors: bytemuck::cast_vec(image.into_raw()), linear: false })
}

/// Refuses a picture of more than [`MOST_PIXELS`], before its pixels are read.
fn check_size(width: usize, height: usize) -> Result<(), String> {
    if width.saturating_mul(height) > MOST_PIXELS {
        return Err(format!(
            "it has {width}x{height} pixels, but pictures of at most {MOST_PIXELS} pixels (8192x8192) are read"
        ));
    }
    Ok(())
}

/// The first layer of an EXR file, with its channels as they are stored.
pub(crate) fn exr_layer(bytes: &[u8]) -> Result<Layer<AnyChannels<FlatSamples>>, String> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| error.to_string())?;
    for header in meta.headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
        let channels = header.channels.list.len();
        if channels > MOST_CHANNELS {
            return Err(format!("it has {channels} channels, but at most {MOST_CHANNELS} are read"));
        }
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes));
    Ok(image.map_err(|error| error.to_string())?.layer_data)
}

fn read_exr(bytes: &[u8]) -> Result<Picture, String> {
    let layer = exr_layer(bytes)?;
    let size = [layer.size.width(), layer.size.height()];
    let channels = &layer.channel_data.list;
    let named = |name: &str| channels.iter().find(|channel| channel.name.eq_case_insensitive(name));
    let lanes = match (named("R"), named("G"), named("B"), channels.as_slice()) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (.., [only]) => [only; 3],
        _ => {
            let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
            return Err(format!("expected channels R, G, B or a single one, found {}", names.join(", ")));
        }
    };
    let mut colors = vec![[0.0; 3]; size[0] * size[1]];
    for (lane, channel) in lanes.into_iter().enumerate() {
        let values = channel.sample_data.values_as_f32();
        colors.iter_mut().zip(values).for_each(|(color, value)| color[lane] = value);
    }
    Ok(Picture { size, colors, linear: true })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Look, show};

    #[test]
    fn pictures_become_ports_and_back() {
        let light = Picture { size: [2, 1], colors: vec![[0.18, 2.5, 0.0], [1.0; 3]], linear: true };
        let bytes = Picture::shown([1, 2], &[[1, 2, 3], [255, 0, 128]]);
        for picture in [light, bytes] {
            let port = picture.to_port("a file");
            assert_eq!(Picture::of_port(&port, &show(&port, &Look::default())), picture);
        }
    }

    #[test]
    fn what_is_no_light_is_compared_as_it_is_shown() {
        let port = Picture { size: [2, 1], colors: vec![[0.0; 3], [4.0; 3]], linear: true }.to_port("a file");
        let look = Look { mode: Some(Mode::Grey), ..Look::default() };
        let picture = Picture::of_port(&port, &show(&port, &look));
        assert_eq!(picture, Picture::shown([2, 1], &[[0; 3], [255; 3]]));
    }

    #[test]
    fn pictures_beyond_the_limit_are_refused_by_their_headers() {
        // Headers alone: nothing can be read after them.
        let chunk = |kind: &[u8; 4], data: &[u8]| {
            let mut bytes = (data.len() as u32).to_be_bytes().to_vec();
            bytes.extend(kind);
            bytes.extend(data);
            bytes.extend(crc(&[&kind[..], data].concat()).to_be_bytes());
            bytes
        };
        let png = |width: u32, height: u32| {
            let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
            header.extend([1, 0, 0, 0, 0]);
            [&b"\x89PNG\r\n\x1a\n"[..], &chunk(b"IHDR", &header), &chunk(b"IDAT", &[0; 4])].concat()
        };
        let text = "it has 20000x20000 pixels, but pictures of at most 67108864 pixels (8192x8192) are read";
        assert_eq!(read_png(&png(20_000, 20_000)).unwrap_err(), text);
        assert!(!read_png(&png(8192, 8192)).unwrap_err().contains("pixels"));

        let exr = |size| crate::exr(size, &vec![[0.5; 3]; size[0] * size[1]]).unwrap();
        let small = exr([2, 1]);
        assert_eq!(read_exr(&small).unwrap().colors, [[0.5; 3]; 2]);
        // Its windows are the numbers 0, 0, 1, 0.
        let window = [0_i32, 0, 1, 0].map(i32::to_le_bytes).concat();
        let large = [0_i32, 0, 19_999, 19_999].map(i32::to_le_bytes).concat();
        let mut changed = small.clone();
        let places: Vec<usize> =
            (0..small.len() - 16).filter(|&at| small[at..].starts_with(&window)).collect();
        assert!(!places.is_empty());
        places.iter().for_each(|&at| changed[at..at + 16].copy_from_slice(&large));
        assert_eq!(read_exr(&changed).unwrap_err(), text);
    }

    /// The checksum of PNG chunks (RFC 2083, section 15).
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(
                crc ^ u32::from(byte),
                |crc, _| if crc & 1 == 1 { 0xEDB8_8320 ^ crc >> 1 } else { crc >> 1 },
            )
        })
    }
}
