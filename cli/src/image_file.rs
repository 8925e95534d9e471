//! Ports and pictures as files: PNG to look at, EXR with raw values, CSV for lists.

use std::{fmt::Write as _, io::Cursor, path::Path};

use epigraph_core::{Dims, Snapshot};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
};
use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};

use crate::{
    columns::{self, Column, Kind, Value},
    error::CliError,
    output::Target,
    visual::{self, Look},
};

/// The kinds of file that a port can be saved to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kinds {
    /// 8-bit sRGB.
    Png,
    /// Raw values.
    Exr,
    /// Raw values as text, a row for each element.
    Csv,
}

impl Kinds {
    /// The kind by the path's ending.
    ///
    /// # Errors
    /// For any other ending.
    pub fn of(path: &Path) -> Result<Self, CliError> {
        match path.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
            "png" => Ok(Self::Png),
            "exr" => Ok(Self::Exr),
            "csv" => Ok(Self::Csv),
            _ => Err(CliError::write(path, "the name must end in .png, .exr or .csv")),
        }
    }

    /// The kind of a picture's file, never [`Kinds::Csv`].
    ///
    /// # Errors
    /// For endings other than `.png` and `.exr`.
    pub fn of_picture(path: &Path) -> Result<Self, CliError> {
        match Self::of(path) {
            Ok(kind @ (Self::Png | Self::Exr)) => Ok(kind),
            _ => Err(CliError::write(path, "a picture's name must end in .png or .exr")),
        }
    }
}

/// A port's file to be.
#[derive(Debug)]
pub struct PortFile {
    kind: Kinds,
    target: Target,
}

impl PortFile {
    /// Checks that the file can be written.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        Ok(Self { kind: Kinds::of(path)?, target: Target::new(path)? })
    }

    /// Checks that the file can be written, and that its name is a picture's.
    pub fn picture(path: &Path) -> Result<Self, CliError> {
        Ok(Self { kind: Kinds::of_picture(path)?, target: Target::new(path)? })
    }

    /// Whether it holds an image.
    pub fn is_image(&self) -> bool {
        self.kind != Kinds::Csv
    }

    /// The file's path.
    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Writes a port. Images take the first field; a table has columns for all of them.
    pub fn write(&self, fields: &[&Snapshot], look: &Look) -> Result<(), CliError> {
        let fail = |cause: String| CliError::write(self.target.path(), cause);
        let bytes = match (self.kind, fields) {
            (Kinds::Csv, fields) => csv(fields).into_bytes(),
            (_, []) => return Err(fail("the port has no contents".into())),
            (Kinds::Png, [first, ..]) => {
                png(size(first.dims), &visual::show(first, look)).map_err(|error| fail(error.to_string()))?
            }
            (Kinds::Exr, [first, ..]) => exr_of(first).map_err(fail)?,
        };
        self.target.write(&bytes)
    }
}

/// Dims as width and height.
pub fn size(dims: Dims) -> [usize; 2] {
    [dims.width as usize, dims.height as usize]
}

/// A PNG file's bytes.
pub fn png([width, height]: [usize; 2], colors: &[[u8; 3]]) -> Result<Vec<u8>, image::ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    // Against the fast level: half the size for drawings, a tenth less for noisy pictures, some 0.2 s more a megapixel.
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    encoder.write_image(colors.as_flattened(), width as u32, height as u32, ExtendedColorType::Rgb8)?;
    Ok(bytes.into_inner())
}

/// An EXR file's bytes for linear colours.
pub fn exr_of_colors(size: [usize; 2], colors: &[[f32; 3]]) -> Result<Vec<u8>, String> {
    let lane = |lane: usize| FlatSamples::F32(colors.iter().map(|color| color[lane]).collect());
    encode_exr(size, ["R", "G", "B"].into_iter().enumerate().map(|(i, name)| AnyChannel::new(name, lane(i))))
}

/// An EXR file's bytes: a channel for each scalar. Unsigned integers stay integers; signed ones become floats, exact up
/// to 2^24.
fn exr_of(snapshot: &Snapshot) -> Result<Vec<u8>, String> {
    let columns = columns::of(&snapshot.element);
    let single = columns.len() == 1;
    let channels = columns.iter().map(|column| {
        // OpenEXR's names: Y for the only channel, capitals for colours.
        let name = if single { "Y".to_owned() } else { column.name.to_uppercase() };
        AnyChannel::new(name.as_str(), samples(column, snapshot))
    });
    encode_exr(size(snapshot.dims), channels)
}

fn samples(column: &Column, snapshot: &Snapshot) -> FlatSamples {
    let values = column.values(snapshot);
    let float = |value| match value {
        Value::Float(value) => value,
        Value::Unsigned(value) => value as f32,
        Value::Signed(value) => value as f32,
    };
    match column.kind {
        Kind::U32 => FlatSamples::U32(
            values.map(|value| if let Value::Unsigned(value) = value { value } else { 0 }).collect(),
        ),
        _ => FlatSamples::F32(values.map(float).collect()),
    }
}

fn encode_exr(
    [width, height]: [usize; 2],
    channels: impl Iterator<Item = AnyChannel<FlatSamples>>,
) -> Result<Vec<u8>, String> {
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes.into_inner())
}

/// A table with a row for each element. Images have the columns x and y, lists the column index; then follow the scalars
/// of every field.
fn csv(fields: &[&Snapshot]) -> String {
    let Some(first) = fields.first() else { return String::new() };
    let is_image = first.dims.height > 1;
    let columns: Vec<(Column, &Snapshot)> = fields
        .iter()
        .flat_map(|field| columns::of(&field.element).into_iter().map(|column| (column, *field)))
        .collect();
    let mut text = String::from(if is_image { "x,y" } else { "index" });
    for (column, field) in &columns {
        let parts = [field.field.as_str(), column.name.as_str()];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        text += ",";
        text += if parts.is_empty() { "value" } else { "" };
        text += &parts.join(".");
    }
    text += "\n";
    let mut values: Vec<_> = columns.iter().map(|(column, field)| column.values(field)).collect();
    let width = first.dims.width.max(1) as usize;
    for index in 0..first.dims.count() {
        // Writing to a string cannot fail.
        let _ = if is_image {
            write!(text, "{},{}", index % width, index / width)
        } else {
            write!(text, "{index}")
        };
        for value in values.iter_mut().filter_map(Iterator::next) {
            let _ = write!(text, ",{value}");
        }
        text += "\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Element, PortElement, texel};

    use super::*;
    use crate::picture::Picture;

    fn snapshot<T: bytemuck::Pod>(
        field: &str,
        element: Element,
        [width, height]: [u32; 2],
        data: &[T],
    ) -> Snapshot {
        let bytes = bytemuck::cast_slice(data).to_vec();
        Snapshot {
            name: "a.b".into(),
            field: field.into(),
            element,
            dims: Dims { width, height },
            frame: 0,
            bytes,
        }
    }

    #[test]
    fn lists_become_tables_with_the_columns_of_all_fields() {
        let position = snapshot("position", <[f32; 2]>::element(), [2, 1], &[0.5f32, 1.0, -2.0, f32::NAN]);
        let age = snapshot("age", u32::element(), [2, 1], &[7u32, 8]);
        assert_eq!(csv(&[&position, &age]), "index,position.x,position.y,age\n0,0.5,1,7\n1,-2,NaN,8\n");
        let image = snapshot("", i32::element(), [1, 2], &[-1i32, 3]);
        assert_eq!(csv(&[&image]), "x,y,value\n0,0,-1\n0,1,3\n");
    }

    #[test]
    fn exr_keeps_raw_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let colors = [[1.5f32, -2.0, 1e-6, 1.0], [f32::INFINITY, 0.0, 65504.0, 0.5]];
        let image = snapshot("", texel::Rgba32Float::element(), [2, 1], &colors);
        PortFile::new(&path).unwrap().write(&[&image], &Look::default()).unwrap();
        let read = Picture::read(&path).unwrap();
        assert_eq!((read.size, read.linear), ([2, 1], true));
        assert_eq!(read.colors, [[1.5, -2.0, 1e-6], [f32::INFINITY, 0.0, 65504.0]]);
    }

    #[test]
    fn exr_keeps_integers_that_floats_would_round() {
        let ids = snapshot("", u32::element(), [2, 1], &[0xFFFF_FFFFu32, 16_777_217]);
        let bytes = exr_of(&ids).unwrap();
        use exr::prelude::{ReadChannels, ReadLayers};
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes.as_slice()))
            .unwrap();
        let channel = &image.layer_data.channel_data.list[0];
        assert_eq!(channel.name.to_string(), "Y");
        assert_eq!(channel.sample_data, FlatSamples::U32(vec![0xFFFF_FFFF, 16_777_217]));
    }

    #[test]
    fn png_is_what_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = snapshot("", texel::Rgba8Unorm::element(), [1, 2], &[[0u8, 128, 255, 255], [9, 8, 7, 0]]);
        PortFile::new(&path).unwrap().write(&[&image], &Look::default()).unwrap();
        let read = Picture::read(&path).unwrap();
        let bytes: Vec<[u8; 3]> = read.colors.iter().map(|c| c.map(crate::tone::to_byte)).collect();
        assert_eq!((read.linear, bytes), (false, vec![[0, 128, 255], [9, 8, 7]]));
    }
}
