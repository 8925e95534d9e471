//! Images that become textures: PNG, JPEG and WebP, and for old OBJ files BMP and TGA.

use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytemuck::allocation::try_cast_vec;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use rayon::prelude::*;

use super::kind;
use crate::Texture;

/// The most columns and rows of an image.
const MOST_SIDE: u32 = 16_384;

/// The most texels of all images of a file: 1 GiB.
const MOST_TEXELS: u64 = 1 << 28;

/// How files of textures for graphics cards begin.
const KTX2: &[u8] = b"\xABKTX 20\xBB";

/// The images that are being decoded, and how many of them are done.
#[derive(Default)]
struct Progress {
    done: AtomicUsize,
    wanted: AtomicUsize,
}

impl Progress {
    fn numbers(&self) -> [usize; 2] {
        [&self.done, &self.wanted].map(|count| count.load(Ordering::Relaxed))
    }
}

/// That of the whole process.
static PROGRESS: Progress = Progress { done: AtomicUsize::new(0), wanted: AtomicUsize::new(0) };

/// How many textures are decoded of those of the mesh file that is being read, and how many these are, for a display of
/// progress; both 0 at other times. Files that are read at once count together.
pub fn texture_progress() -> [usize; 2] {
    PROGRESS.numbers()
}

/// Images that a progress counts while this lives.
struct Counted<'a> {
    progress: &'a Progress,
    count: usize,
    done: AtomicUsize,
}

impl<'a> Counted<'a> {
    fn new(progress: &'a Progress, count: usize) -> Self {
        progress.wanted.fetch_add(count, Ordering::Relaxed);
        Self { progress, count, done: AtomicUsize::new(0) }
    }

    fn one_done(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
        self.progress.done.fetch_add(1, Ordering::Relaxed);
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.progress.done.fetch_sub(*self.done.get_mut(), Ordering::Relaxed);
        self.progress.wanted.fetch_sub(self.count, Ordering::Relaxed);
    }
}

/// The textures in some image files, given by name and contents, decoded in parallel.
///
/// # Errors
/// For each image, why it cannot be a texture, and what to do: it is too large, together with those before it, or
/// broken, or of another kind.
pub(super) fn decode<B: AsRef<[u8]> + Sync>(images: &[(String, B)]) -> Vec<Result<Arc<Texture>, String>> {
    decode_counted(images, &PROGRESS)
}

fn decode_counted<B: AsRef<[u8]> + Sync>(
    images: &[(String, B)],
    progress: &Progress,
) -> Vec<Result<Arc<Texture>, String>> {
    let mut room = MOST_TEXELS;
    // Sizes are promised by the first bytes, so that what is too large is never made.
    let fits: Vec<Result<(), String>> =
        images.iter().map(|(name, bytes)| take_room(name, bytes.as_ref(), &mut room)).collect();
    let counted = Counted::new(progress, images.len());
    images
        .par_iter()
        .zip(fits)
        .map(|((name, bytes), fits)| {
            let texture = fits.and_then(|()| texture(name, bytes.as_ref()));
            counted.one_done();
            texture.map(Arc::new)
        })
        .collect()
}

/// The number of texels that may be made beside these textures, which were decoded together.
pub(super) fn room_beside(textures: &[Arc<Texture>]) -> u64 {
    let texels = |texture: &Arc<Texture>| texture.size.map(u64::from).iter().product::<u64>();
    MOST_TEXELS - textures.iter().map(texels).sum::<u64>()
}

fn texture(name: &str, bytes: &[u8]) -> Result<Texture, String> {
    let image = decoder(name, bytes).and_then(|decoder| {
        DynamicImage::from_decoder(decoder).map_err(|error| format!("it cannot be decoded: {error}"))
    })?;
    let size = [image.width(), image.height()];
    let bytes = image.into_rgba8().into_raw();
    // The same memory if it can be.
    let texels = try_cast_vec(bytes).unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec());
    Ok(Texture { name: name.to_owned(), size, texels })
}

fn take_room(name: &str, bytes: &[u8], room: &mut u64) -> Result<(), String> {
    let (width, height) = decoder(name, bytes)?.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if width.max(height) > MOST_SIDE {
        return Err(format!(
            "it has {width}x{height} texels, but a side may have at most {MOST_SIDE}: scale it down"
        ));
    }
    if texels == 0 {
        return Err("it has no texels".to_owned());
    }
    match room.checked_sub(texels) {
        Some(left) => *room = left,
        None => {
            return Err(format!(
                "its {width}x{height} texels do not fit into the 1 GiB for textures: scale it down"
            ));
        }
    }
    Ok(())
}

fn decoder<'a>(name: &str, bytes: &'a [u8]) -> Result<impl ImageDecoder + 'a, String> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.map_err(|error| error.to_string())?;
    // The one kind without a mark at its beginning.
    if reader.format().is_none() && !bytes.is_empty() && name.to_lowercase().ends_with(".tga") {
        reader.set_format(ImageFormat::Tga);
    }
    match reader.format() {
        Some(
            ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP | ImageFormat::Bmp | ImageFormat::Tga,
        ) => reader.into_decoder().map_err(|error| format!("it cannot be decoded: {error}")),
        _ if bytes.is_empty() => Err("it is empty".to_owned()),
        _ if bytes.starts_with(KTX2) => {
            Err("it is a KTX2 file, which is not read: convert it to PNG".to_owned())
        }
        Some(format) => Err(format!("it is a file of kind {format:?}, which is not read: convert it to PNG")),
        None => Err(kind::check(bytes, name)
            .err()
            .unwrap_or_else(|| "it is not PNG, JPEG, WebP, BMP or TGA: convert it to PNG".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, Luma, Rgb, RgbImage, Rgba, RgbaImage};

    use super::*;

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    fn one(bytes: &[u8]) -> Result<Arc<Texture>, String> {
        decode(&[("name".to_owned(), bytes)]).remove(0)
    }

    #[test]
    fn images_of_three_kinds_become_rows_of_texels_from_the_top() {
        let image = RgbaImage::from_fn(3, 2, |x, y| Rgba([x as u8 * 100, y as u8 * 100, 7, 80]));
        for format in [ImageFormat::Png, ImageFormat::WebP] {
            let texture = one(&encoded(&image.clone().into(), format)).unwrap();
            assert_eq!((texture.name.as_str(), texture.size), ("name", [3, 2]));
            let expected = [0, 1].map(|y| [0, 1, 2].map(|x| [x * 100, y * 100, 7, 80]));
            assert_eq!(texture.texels, expected.concat());
        }
        let opaque = DynamicImage::from(image).into_rgb8();
        // A name says what an image is only where its bytes do not.
        for (name, format) in
            [("a.bmp", ImageFormat::Bmp), ("wall.TGA", ImageFormat::Tga), ("wall.tga", ImageFormat::Png)]
        {
            let bytes = encoded(&opaque.clone().into(), format);
            let texture = decode(&[(name.to_owned(), bytes)]).remove(0).unwrap();
            let expected = [0, 1].map(|y| [0, 1, 2].map(|x| [x * 100, y * 100, 7, 255]));
            assert_eq!((texture.size, &texture.texels), ([3, 2], &expected.concat()), "{name}");
        }
        let jpeg = RgbImage::from_pixel(8, 4, Rgb([200, 100, 50]));
        let texture = one(&encoded(&jpeg.into(), ImageFormat::Jpeg)).unwrap();
        let near = |texel: &[u8; 4]| texel.iter().zip([200, 100, 50, 255]).all(|(a, b)| a.abs_diff(b) < 4);
        assert!(texture.size == [8, 4] && texture.texels.iter().all(near), "{:?}", texture.texels);
        let grey = GrayImage::from_pixel(1, 1, Luma([9]));
        assert_eq!(one(&encoded(&grey.into(), ImageFormat::Png)).unwrap().texels, [[9, 9, 9, 255]]);
        let deep = image::ImageBuffer::<Luma<u16>, _>::from_pixel(1, 1, Luma([0x1234]));
        assert_eq!(one(&encoded(&deep.into(), ImageFormat::Png)).unwrap().texels, [[0x12, 0x12, 0x12, 255]]);
    }

    #[test]
    fn images_are_counted_while_they_are_decoded() {
        /// Looks at the progress whenever its bytes are asked for.
        struct Watched<'a>(Vec<u8>, &'a Progress, std::sync::Mutex<Vec<[usize; 2]>>);
        impl AsRef<[u8]> for Watched<'_> {
            fn as_ref(&self) -> &[u8] {
                self.2.lock().unwrap().push(self.1.numbers());
                &self.0
            }
        }
        let progress = Progress::default();
        let png = encoded(&GrayImage::new(40, 40).into(), ImageFormat::Png);
        let half = png[..png.len() / 2].to_vec();
        let watched =
            |bytes| (String::new(), Watched(bytes, &progress, std::sync::Mutex::<Vec<_>>::default()));
        let files = [png.clone(), half, png].map(watched);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let decoded = one.install(|| decode_counted(&files, &progress));
        assert_eq!(decoded.iter().map(Result::is_ok).collect::<Vec<_>>(), [true, false, true]);
        // First for the size of each, then one after the other.
        let mut seen: Vec<_> =
            files.into_iter().flat_map(|(_, watched)| watched.2.into_inner().unwrap()).collect();
        seen.sort_unstable();
        assert_eq!(seen, [[0, 0], [0, 0], [0, 0], [0, 3], [1, 3], [2, 3]]);
        assert_eq!(progress.numbers(), [0, 0]);
        // Of several files at once.
        let [nine, two] = [9, 2].map(|count| Counted::new(&progress, count));
        nine.one_done();
        nine.one_done();
        two.one_done();
        assert_eq!(progress.numbers(), [3, 11]);
        drop(nine);
        assert_eq!(progress.numbers(), [1, 2]);
        drop(two);
        assert_eq!(progress.numbers(), [0, 0]);
    }

    #[test]
    fn what_is_no_image_is_named() {
        let png = encoded(&GrayImage::new(40, 40).into(), ImageFormat::Png);
        for (bytes, expected) in [
            (&b""[..], "it is empty"),
            (b"<html>", "it is a web page"),
            (b"version https://git-lfs.github.com/spec/v1\n", "it is a git-lfs pointer"),
            (b"JPG", "it is not PNG, JPEG, WebP, BMP or TGA"),
            (b"GIF89a", "it is a file of kind Gif, which is not read"),
            (b"\xABKTX 20\xBB\r\n", "it is a KTX2 file, which is not read: convert it to PNG"),
            (&png[..png.len() / 2], "it cannot be decoded"),
            (&png[..20], "it cannot be decoded"),
        ] {
            let message = one(bytes).unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
    }

    /// The first chunk of a PNG file of this size, and then nothing.
    fn promise(width: u32, height: u32) -> Vec<u8> {
        let mut png = encoded(&GrayImage::new(1, 1).into(), ImageFormat::Png);
        png[16..20].copy_from_slice(&width.to_be_bytes());
        png[20..24].copy_from_slice(&height.to_be_bytes());
        let sum = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&sum.to_be_bytes());
        png
    }

    /// The check sum of PNG chunks.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |sum, byte| {
            (0..8)
                .fold(sum ^ u32::from(*byte), |sum, _| sum >> 1 ^ if sum & 1 == 1 { 0xEDB8_8320 } else { 0 })
        })
    }

    #[test]
    fn images_that_promise_too_much_are_refused_before_they_are_made() {
        let message = one(&promise(16_385, 1)).unwrap_err();
        assert!(message.contains("16385x1 texels, but a side may have at most 16384"), "{message}");
        // Three quarters of the room, then as much again, then what is left.
        let files = [
            promise(16_384, 12_288),
            promise(16_384, 12_288),
            encoded(&GrayImage::new(2, 2).into(), ImageFormat::Png),
        ];
        let mut room = MOST_TEXELS;
        let fits: Vec<bool> = files.iter().map(|file| take_room("", file, &mut room).is_ok()).collect();
        assert_eq!(fits, [true, false, true]);
        // Of 256 Mi texels, 128 Mi are left, and then 127 Mi.
        let texture = |size| Arc::new(Texture { name: String::new(), size, texels: vec![] });
        let (large, small) = (texture([16_384, 8192]), texture([1024, 1024]));
        assert_eq!(room_beside(&[]), 256 << 20);
        assert_eq!(room_beside(std::slice::from_ref(&large)), 128 << 20);
        assert_eq!(room_beside(&[large, small]), 127 << 20);
    }
}
