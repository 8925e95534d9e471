//! An image on the graphics card, and what it was made of.

use std::sync::Arc;

use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use epigraph_core::Snapshot;
use epigraph_pictures::{Look, Mode, Shown, edges, show};

/// A port's image as it is shown.
pub struct Layer {
    /// The numbers.
    pub snapshot: Arc<Snapshot>,
    /// How they became colours.
    pub look: Look,
    /// Whether pixels are smaller than those of the screen.
    pub small: bool,
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
    pub fn update(
        layer: &mut Option<Box<Self>>,
        context: &Context,
        snapshot: Arc<Snapshot>,
        look: Look,
        small: bool,
    ) {
        if let Some(old) = layer
            && Arc::ptr_eq(&old.snapshot, &snapshot)
            && (old.look, old.small) == (look, small)
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
        let texture = upload(texture, context, shown.size, &shown.colors, small);
        *layer = Some(Box::new(Self { snapshot, look, small, shown, words, classes, texture }));
    }
}

/// Puts colours into a texture: the one that there is, or a new one. Large pixels are squares, small ones are mixed;
/// drivers are not asked which they are, since some get that wrong.
pub fn upload(
    texture: Option<TextureHandle>,
    context: &Context,
    size: [usize; 2],
    colors: &[[u8; 3]],
    small: bool,
) -> TextureHandle {
    let options = if small { TextureOptions::LINEAR } else { TextureOptions::NEAREST };
    let image = ColorImage::from_rgb(size, colors.as_flattened());
    match texture {
        Some(mut texture) => {
            texture.set(image, options);
            texture
        }
        None => context.load_texture("viewer", image, options),
    }
}
