//! An image on the graphics card, and what it was made of.

use std::sync::Arc;

use egui::{ColorImage, Context, TextureFilter, TextureHandle, TextureOptions};
use epigraph_core::Snapshot;
use epigraph_pictures::{Look, Mode, Shown, edges, show};

/// Pixels are squares when they are large, and means when they are small.
const OPTIONS: TextureOptions =
    TextureOptions { magnification: TextureFilter::Nearest, ..TextureOptions::LINEAR };

/// A port's image as it is shown.
pub struct Layer {
    /// The numbers.
    pub snapshot: Arc<Snapshot>,
    /// How they became colours.
    pub look: Look,
    /// The colours.
    pub shown: Shown,
    /// The words of pixels, where the mode draws what they mean.
    pub words: Vec<u32>,
    /// Shares of the pixels that are empty, simple and complex, where the mode tells classes.
    pub classes: Option<[f32; 3]>,
    /// The colours on the card.
    pub texture: TextureHandle,
}

impl Layer {
    /// Makes a layer show an image; nothing where it does already.
    pub fn update(layer: &mut Option<Box<Self>>, context: &Context, snapshot: Arc<Snapshot>, look: Look) {
        if let Some(old) = layer
            && Arc::ptr_eq(&old.snapshot, &snapshot)
            && old.look == look
        {
            return;
        }
        let shown = show(&snapshot, &look);
        let draws = matches!(shown.mode, Mode::Edges | Mode::Classes | Mode::Reach);
        let words: Vec<u32> =
            if draws && snapshot.element.bytes() == 4 { snapshot.get() } else { Vec::new() };
        let share = |class| {
            let count = words.iter().filter(|word| edges::class(**word) == class).count();
            count as f32 / words.len().max(1) as f32
        };
        let classes = (shown.mode == Mode::Classes).then(|| [0, 1, 2].map(share));
        let texture = layer.take().map(|layer| layer.texture);
        let texture = upload(texture, context, shown.size, &shown.colors);
        *layer = Some(Box::new(Self { snapshot, look, shown, words, classes, texture }));
    }
}

/// Puts colours into a texture: the one that there is, or a new one.
pub fn upload(
    texture: Option<TextureHandle>,
    context: &Context,
    size: [usize; 2],
    colors: &[[u8; 3]],
) -> TextureHandle {
    let image = ColorImage::from_rgb(size, colors.as_flattened());
    match texture {
        Some(mut texture) => {
            texture.set(image, OPTIONS);
            texture
        }
        None => context.load_texture("viewer", image, OPTIONS),
    }
}
