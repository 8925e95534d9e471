//! Ports and pictures as files: PNG to look at, EXR with raw values, CSV for lists.

use std::{fmt::Write as _, path::Path};

use epigraph_core::Snapshot;
use epigraph_files::{FileError, Target, is_stream};

use crate::{Lane, Look, encode, lanes, show, size};

/// A kind of file that a port can be saved to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// 8-bit sRGB.
    Png,
    /// Raw values.
    Exr,
    /// Raw values as text, a row for each element.
    Csv,
}

impl Kind {
    /// The kind that the path's extension names; PNG for a pipe or a device without one.
    ///
    /// # Errors
    /// The extension is another one.
    pub fn of(path: &Path) -> Result<Self, FileError> {
        match path.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
            "png" => Ok(Self::Png),
            "exr" => Ok(Self::Exr),
            "csv" => Ok(Self::Csv),
            "" if is_stream(path) => Ok(Self::Png),
            _ => Err(FileError::write(path, "the name must end in .png, .exr or .csv")),
        }
    }

    /// The kind of a picture file, never [`Kind::Csv`].
    ///
    /// # Errors
    /// The extension is neither `.png` nor `.exr`.
    pub fn of_picture(path: &Path) -> Result<Self, FileError> {
        match Self::of(path) {
            Ok(kind @ (Self::Png | Self::Exr)) => Ok(kind),
            _ => Err(FileError::write(path, "a picture's name must end in .png or .exr")),
        }
    }

    /// True if the file holds an image.
    pub fn is_image(self) -> bool {
        self != Self::Csv
    }

    /// The bytes of a file of this kind that holds a port. Images take the first field; a table has columns for all of
    /// them.
    ///
    /// # Errors
    /// The port has no contents, or the encoder's error.
    pub fn encode(self, fields: &[&Snapshot], look: &Look) -> Result<Vec<u8>, String> {
        match (self, fields) {
            (Self::Csv, fields) => Ok(csv(fields).into_bytes()),
            (_, []) => Err("the port has no contents".into()),
            (Self::Png, [first, ..]) => encode::png(size(first.dims), &show(first, look).colors),
            (Self::Exr, [first, ..]) => encode::exr_of_port(first),
        }
    }
}

/// The file that a port will be saved to.
#[derive(Debug)]
pub struct PortFile {
    kind: Kind,
    target: Target,
}

impl PortFile {
    /// Checks that the file can be written.
    ///
    /// # Errors
    /// The file cannot be written, or its name has another extension.
    pub fn new(path: &Path) -> Result<Self, FileError> {
        Ok(Self { kind: Kind::of(path)?, target: Target::new(path)? })
    }

    /// Checks that the file can be written, and that its name is that of a picture.
    ///
    /// # Errors
    /// The file cannot be written, or its name has another extension.
    pub fn picture(path: &Path) -> Result<Self, FileError> {
        Ok(Self { kind: Kind::of_picture(path)?, target: Target::new(path)? })
    }

    /// The file's path.
    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Writes a port, as [`Kind::encode`] makes it.
    ///
    /// # Errors
    /// The error of the system or the encoder.
    pub fn write(&self, fields: &[&Snapshot], look: &Look) -> Result<(), FileError> {
        let bytes = self.kind.encode(fields, look);
        self.target.write(&bytes.map_err(|cause| FileError::write(self.target.path(), cause))?)
    }
}

/// A table with a row for each element. The first columns are x and y for images, the index for lists; the scalars of
/// every field follow.
fn csv(fields: &[&Snapshot]) -> String {
    let Some(first) = fields.first() else { return String::new() };
    let is_image = first.dims.height > 1;
    let columns: Vec<(Lane, &Snapshot)> = fields
        .iter()
        .flat_map(|field| lanes(&field.element).into_iter().map(|lane| (lane, *field)))
        .collect();
    let mut text = String::from(if is_image { "x,y" } else { "index" });
    for (lane, field) in &columns {
        let parts = [field.field.as_str(), lane.name.as_str()];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        text += ",";
        text += if parts.is_empty() { "value" } else { "" };
        text += &parts.join(".");
    }
    text += "\n";
    let mut values: Vec<_> = columns.iter().map(|(lane, field)| lane.numbers(field)).collect();
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
    use std::fs;

    use epigraph_core::{Dims, Element, PortElement, texel};
    use epigraph_stages::meaning::DEPTH;
    use exr::prelude::FlatSamples;

    use super::*;
    use crate::{Picture, picture::exr_layer, tone};

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
            meaning: None,
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
        let bytes = encode::exr_of_port(&ids).unwrap();
        let layer = exr_layer(&bytes).unwrap();
        let channel = &layer.channel_data.list[0];
        assert_eq!(channel.name.to_string(), "Y");
        assert_eq!(channel.sample_data, FlatSamples::U32(vec![0xFFFF_FFFF, 16_777_217]));
    }

    #[test]
    fn exr_keeps_distances_as_metres_though_they_are_kept_as_bits() {
        let bits = [2.5f32, f32::INFINITY].map(f32::to_bits);
        let depth = Snapshot { meaning: Some(DEPTH), ..snapshot("", u32::element(), [2, 1], &bits) };
        let layer = exr_layer(&encode::exr_of_port(&depth).unwrap()).unwrap();
        let samples = &layer.channel_data.list[0].sample_data;
        assert_eq!(*samples, FlatSamples::F32(vec![2.5, f32::INFINITY]));
    }

    #[test]
    fn exr_and_png_of_bytes_are_the_same_picture() {
        let folder = tempfile::tempdir().unwrap();
        let bytes: Vec<u8> = (0..=255).collect();
        let image = snapshot("", texel::Rgba8Unorm::element(), [8, 8], &bytes);
        let [png, exr] = ["a.png", "a.exr"].map(|name| {
            let path = folder.path().join(name);
            PortFile::new(&path).unwrap().write(&[&image], &Look::default()).unwrap();
            Picture::read(&path).unwrap()
        });
        assert_eq!((png.linear, exr.linear), (false, true));
        let shown = |picture: &Picture| {
            picture.srgb().iter().map(|color| color.map(tone::to_byte)).collect::<Vec<_>>()
        };
        assert_eq!(shown(&exr), shown(&png));
        // Alpha is coverage, not light.
        let layer = exr_layer(&fs::read(folder.path().join("a.exr")).unwrap()).unwrap();
        let alpha = layer.channel_data.list.iter().find(|channel| channel.name.to_string() == "A").unwrap();
        assert_eq!(alpha.sample_data.values_as_f32().nth(12), Some(51.0 / 255.0));
    }

    #[test]
    fn png_is_what_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = snapshot("", texel::Rgba8Unorm::element(), [1, 2], &[[0u8, 128, 255, 255], [9, 8, 7, 0]]);
        PortFile::new(&path).unwrap().write(&[&image], &Look::default()).unwrap();
        let read = Picture::read(&path).unwrap();
        let bytes: Vec<[u8; 3]> = read.colors.iter().map(|c| c.map(tone::to_byte)).collect();
        assert_eq!((read.linear, bytes), (false, vec![[0, 128, 255], [9, 8, 7]]));
    }
}
