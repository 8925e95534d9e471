//! The pictures of a view. They are worked out away from the window's thread, which only hands finished pixels to the
//! graphics card: nothing that it does here grows with the image but that copy.
//!
//! All that is seen at once comes from one piece of work, so that both sides of a comparison, their difference and the
//! histogram are of the same frame. Until it is done, the pictures before stay.

use std::{sync::Arc, time::Duration};

use egui::{ColorImage, Context, TextureHandle};
use epigraph_core::Snapshot;
use epigraph_pictures::{Histogram, Look, apart};

use super::layer::{Layer, Painted, pixels, upload};
use crate::task::Task;

/// Pictures of usual sizes keep up with the graph, also where all cores are busy; only those that take longer leave some
/// of their time to the tracer.
const FREE: Duration = Duration::from_millis(100);

/// What is to be drawn.
#[derive(Clone)]
pub struct Order {
    /// The image in view.
    pub image: Arc<Snapshot>,
    /// The image of the same size that it is held against.
    pub other: Option<Arc<Snapshot>>,
    /// How.
    pub wish: Wish,
}

/// How images are to be drawn: what a person chooses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// How numbers become colours.
    pub look: Look,
    /// Whether they are counted.
    pub histogram: bool,
    /// What differences are multiplied by, where they are shown.
    pub gain: Option<f32>,
}

impl PartialEq for Order {
    fn eq(&self, other: &Self) -> bool {
        let others = [&self.other, &other.other].map(|image| image.as_ref().map(Arc::as_ptr));
        Arc::ptr_eq(&self.image, &other.image) && others[0] == others[1] && self.wish == other.wish
    }
}

/// What came of an order.
struct Drawn {
    image: Fresh,
    other: Option<Fresh>,
    difference: Option<ColorImage>,
    histogram: Option<Option<Histogram>>,
}

/// A painted image with its pixels; without, where the card has them already.
struct Fresh {
    painted: Arc<Painted>,
    pixels: Option<ColorImage>,
}

/// The newest pictures that are finished.
pub struct Pictures {
    /// The image in view.
    pub image: Option<Layer>,
    /// What it is held against.
    pub other: Option<Layer>,
    /// How far their colours are apart.
    pub difference: Option<TextureHandle>,
    /// How often which values occur, once that is counted; none where they are no amounts.
    pub histogram: Option<Option<Histogram>>,
    work: Task<Order, Drawn>,
}

impl Default for Pictures {
    fn default() -> Self {
        Self { image: None, other: None, difference: None, histogram: None, work: Task::free(FREE) }
    }
}

impl Pictures {
    /// Sees to it that an order is carried out, and shows what is finished: call it in every frame of the window.
    pub fn update(&mut self, context: &Context, order: Order) {
        if let Some(drawn) = self.work.take() {
            self.show(context, drawn);
        }
        // Newer frames may come when there is time for them, but nobody is to wait for what he has chosen.
        if self.work.done().is_some_and(|done| done.wish != order.wish) {
            self.work.hurry();
        }
        let before =
            [&self.image, &self.other].map(|layer| layer.as_ref().map(|layer| layer.painted.clone()));
        let asked = order.clone();
        self.work.want_after_take(context, order, move || Drawn::new(&asked, before));
    }

    /// Whether something newer is being worked out.
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

/// Replaces a layer. It has been the same since the work began that found its colours unchanged.
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
    /// What is painted already is not painted again.
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
