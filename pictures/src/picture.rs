//! Images read from files.

use std::{io::Cursor, path::Path};

use epigraph_core::{Dims, Element, Format, Snapshot};
use epigraph_files::{FileError, MOST_DATA};
use exr::prelude::{AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers};

use crate::{Mode, Number, Shown, lanes, tone};

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
        let encode = |value: f32| if self.linear { tone::encode(value) } else { value };
        self.colors.iter().map(|color| color.map(encode)).collect()
    }
}

fn read_png(bytes: &[u8]) -> Result<Picture, String> {
    let image =
        image::load_from_memory_with_format(bytes, image::ImageFormat::Png).map_err(|e| e.to_string())?;
    let image = image.into_rgb32f();
    let size = [image.width() as usize, image.height() as usize];
    Ok(Picture { size, colors: bytemuck::cast_vec(image.into_raw()), linear: false })
}

/// The first layer of an EXR file, with its channels as they are stored.
pub(crate) fn exr_layer(bytes: &[u8]) -> exr::error::Result<Layer<AnyChannels<FlatSamples>>> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))?;
    Ok(image.layer_data)
}

fn read_exr(bytes: &[u8]) -> Result<Picture, String> {
    let layer = exr_layer(bytes).map_err(|error| error.to_string())?;
    let size = [layer.size.width(), layer.size.height()];
    let channels = &layer.channel_data.list;
    let named = |name: &str| {
        let channel = channels.iter().find(|channel| channel.name.eq_case_insensitive(name));
        channel.map(|channel| channel.sample_data.values_as_f32().collect::<Vec<f32>>())
    };
    let lanes = match (named("R"), named("G"), named("B"), channels.as_slice()) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (.., [only]) => {
            let grey: Vec<f32> = only.sample_data.values_as_f32().collect();
            [grey.clone(), grey.clone(), grey]
        }
        _ => {
            let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
            return Err(format!("expected channels R, G, B or a single one, found {}", names.join(", ")));
        }
    };
    let colors = (0..size[0] * size[1]).map(|i| [lanes[0][i], lanes[1][i], lanes[2][i]]).collect();
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
}
