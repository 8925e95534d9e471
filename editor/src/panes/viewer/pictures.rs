//! The pictures of a view. They are computed on another thread; the window's thread only uploads finished pixels to the
//! graphics card, so no other work on it grows with the image.
//!
//! All pictures of a view are computed together, so that both sides of a comparison, their difference and the histogram
//! belong to the same frame. Until they are done, the previous pictures stay.

use std::{sync::Arc, time::Duration};

use egui::{ColorImage, Context, TextureHandle};
use epigraph_core::Snapshot;
use epigraph_pictures::{Histogram, Look, apart};

use super::layer::{Layer, Painted, pixels, upload};
use crate::task::Task;

/// Pictures that take longer than this leave some time to the tracer. Pictures of usual sizes are faster, so they keep
/// up with the graph even if all cores are busy.
const FREE: Duration = Duration::from_millis(100);

/// The pictures to draw.
#[derive(Clone)]
pub struct Order {
    /// The image in view.
    pub image: Arc<Snapshot>,
    /// The image of the same size to compare with.
    pub other: Option<Arc<Snapshot>>,
    /// The settings.
    pub wish: Wish,
}

/// The user's settings for the pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// The mapping from numbers to colours.
    pub look: Look,
    /// True if a histogram is counted.
    pub histogram: bool,
    /// Gain of the differences, if they are shown.
    pub gain: Option<f32>,
}

impl PartialEq for Order {
    fn eq(&self, other: &Self) -> bool {
        let others = [&self.other, &other.other].map(|image| image.as_ref().map(Arc::as_ptr));
        Arc::ptr_eq(&self.image, &other.image) && others[0] == others[1] && self.wish == other.wish
    }
}

/// The result of an order.
struct Drawn {
    image: Fresh,
    other: Option<Fresh>,
    difference: Option<ColorImage>,
    histogram: Option<Option<Histogram>>,
}

/// A painted image with its pixels, or without if the card has them already.
struct Fresh {
    painted: Arc<Painted>,
    pixels: Option<ColorImage>,
}

/// The newest finished pictures.
pub struct Pictures {
    /// The image in view.
    pub image: Option<Layer>,
    /// The image to compare with.
    pub other: Option<Layer>,
    /// The difference of their colours.
    pub difference: Option<TextureHandle>,
    /// The histogram, once it is counted; `Some(None)` if the values are not quantities.
    pub histogram: Option<Option<Histogram>>,
    work: Task<Order, Drawn>,
}

impl Default for Pictures {
    fn default() -> Self {
        Self { image: None, other: None, difference: None, histogram: None, work: Task::free(FREE) }
    }
}

impl Pictures {
    /// Starts an order if it differs from the last one, and shows finished pictures. Call it in every frame of the
    /// window.
    pub fn update(&mut self, context: &Context, order: Order) {
        if let Some(drawn) = self.work.take() {
            self.show(context, drawn);
        }
        // Newer frames may wait, but a change of the settings must not.
        if self.work.done().is_some_and(|done| done.wish != order.wish) {
            self.work.hurry();
        }
        let before =
            [&self.image, &self.other].map(|layer| layer.as_ref().map(|layer| layer.painted.clone()));
        let asked = order.clone();
        self.work.want_after_take(context, order, move || Drawn::new(&asked, before));
    }

    /// True if newer pictures are being computed.
    pub fn is_behind(&self) -> bool {
        self.work.is_behind()
    }

    fn show(&mut self, context: &Context, drawn: Drawn) {
        fresh(&mut self.image, context, Some(drawn.image));
        fresh(&mut self.other, context, drawn.other);
        let texture = self.difference.take();
        self.difference = drawn.difference.map(|pixels| upload(texture, context, pixels));
        self.histogram = drawn.histogram;
    }
}

/// Replaces a layer. If there are no new pixels, the layer's texture is still valid.
fn fresh(layer: &mut Option<Layer>, context: &Context, fresh: Option<Fresh>) {
    let texture = layer.take().map(|layer| layer.texture);
    *layer = fresh.and_then(|Fresh { painted, pixels }| {
        let texture = match pixels {
            Some(pixels) => upload(texture, context, pixels),
            None => texture?,
        };
        Some(Layer { painted, texture })
    });
}

impl Drawn {
    fn new(order: &Order, [image, other]: [Option<Arc<Painted>>; 2]) -> Self {
        let Wish { look, histogram, gain } = order.wish;
        let image = Fresh::new(&order.image, look, image);
        let shown = &image.painted.shown;
        let other = order.other.as_ref().map(|snapshot| {
            // The same numbers have the same colours on both sides.
            let range = shown.scale.map(|scale| scale.range).or(look.range);
            Fresh::new(snapshot, Look { mode: Some(shown.mode), range, ..look }, other)
        });
        let apart = |(other, gain): (&Fresh, f32)| {
            pixels(shown.size, &apart(&shown.colors, &other.painted.shown.colors, gain))
        };
        let difference = other.as_ref().zip(gain).map(apart);
        let histogram = histogram.then(|| Histogram::new(&order.image, &look));
        Self { image, other, difference, histogram }
    }
}

impl Fresh {
    /// Paints the image, unless it is painted already.
    fn new(snapshot: &Arc<Snapshot>, look: Look, before: Option<Arc<Painted>>) -> Self {
        if let Some(painted) = before.filter(|before| before.is_of(snapshot, &look)) {
            return Self { painted, pixels: None };
        }
        let painted = Arc::new(Painted::new(snapshot.clone(), look));
        let pixels = pixels(painted.shown.size, &painted.shown.colors);
        Self { painted, pixels: Some(pixels) }
    }
}

#[cfg(test)]
mod tests;
