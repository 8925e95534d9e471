//! An image on the graphics card, and the values that it shows.

use std::{ops::Deref, sync::Arc};

use egui::{ColorImage, Context, ImageData, TextureFilter, TextureHandle, TextureOptions};
use epigraph_core::Snapshot;
use epigraph_pictures::{Look, Mode, Shown, edges, show};

/// Enlarged pixels are squares, and reduced ones are averaged.
const OPTIONS: TextureOptions =
    TextureOptions { magnification: TextureFilter::Nearest, ..TextureOptions::LINEAR };

/// A port's image as colours.
pub struct Painted {
    /// The values.
    pub snapshot: Arc<Snapshot>,
    /// The mapping from values to colours.
    pub look: Look,
    /// The colours.
    pub shown: Shown,
    /// The pixels' 32-bit words, in modes that draw their bits.
    pub words: Vec<u32>,
    /// Shares of the pixels that are empty, simple and complex, in the mode that shows classes.
    pub classes: Option<[f32; 3]>,
}

impl Painted {
    /// Converts values to colours. Slow for large images.
    pub fn new(snapshot: Arc<Snapshot>, look: Look) -> Self {
        let shown = show(&snapshot, &look);
        let draws = matches!(shown.mode, Mode::Edges | Mode::Classes | Mode::Reach);
        let words: Vec<u32> =
            if draws && snapshot.element.bytes() == 4 { snapshot.get() } else { Vec::new() };
        let share = |class| {
            let count = words.iter().filter(|word| edges::class(**word) == class).count();
            count as f32 / words.len().max(1) as f32
        };
        let classes = (shown.mode == Mode::Classes).then(|| [0, 1, 2].map(share));
        Self { snapshot, look, shown, words, classes }
    }

    /// True if it shows this image with this look.
    pub fn is_of(&self, snapshot: &Arc<Snapshot>, look: &Look) -> bool {
        Arc::ptr_eq(&self.snapshot, snapshot) && self.look == *look
    }
}

/// A port's image on screen.
pub struct Layer {
    /// The painted image.
    pub painted: Arc<Painted>,
    /// The colours on the card.
    pub texture: TextureHandle,
}

impl Deref for Layer {
    type Target = Painted;

    fn deref(&self) -> &Painted {
        &self.painted
    }
}

/// Colours in the format of the card.
pub fn pixels(size: [usize; 2], colors: &[[u8; 3]]) -> ColorImage {
    ColorImage::from_rgb(size, colors.as_flattened())
}

/// Uploads pixels to the existing texture, or to a new one.
pub fn upload(
    texture: Option<TextureHandle>,
    context: &Context,
    image: impl Into<ImageData>,
) -> TextureHandle {
    match texture {
        Some(mut texture) => {
            texture.set(image, OPTIONS);
            texture
        }
        None => context.load_texture("viewer", image, OPTIONS),
    }
}
