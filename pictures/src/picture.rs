//! Images read from files.

use std::{io::Cursor, path::Path};

use exr::prelude::{ReadChannels, ReadLayers};

use crate::{FileError, tone};

/// An image's colours, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height.
    pub size: [usize; 2],
    /// As they stand in the file: linear light from EXR, sRGB in [0, 1] from PNG.
    pub colors: Vec<[f32; 3]>,
    /// Whether they are linear.
    pub linear: bool,
}

impl Picture {
    /// Reads a `.png` or `.exr` file. An image of one channel becomes grey.
    ///
    /// # Errors
    /// That it cannot be read, or is no image of the kind that its ending promises.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = std::fs::read(path).map_err(|error| FileError::read(path, error))?;
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match ending.as_str() {
            "png" => read_png(&bytes).map_err(|cause| FileError::read(path, cause)),
            "exr" => read_exr(&bytes).map_err(|cause| FileError::read(path, cause)),
            _ => Err(FileError::read(path, "only .png and .exr images are read")),
        }
    }

    /// What a screen shows: 8-bit sRGB.
    pub fn shown(size: [usize; 2], colors: &[[u8; 3]]) -> Self {
        let colors = colors.iter().map(|color| color.map(|byte| f32::from(byte) / 255.0)).collect();
        Self { size, colors, linear: false }
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

fn read_exr(bytes: &[u8]) -> Result<Picture, String> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    let layer = image.layer_data;
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
