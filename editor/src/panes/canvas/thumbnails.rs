//! Small live images of nodes' outputs.

use std::{
    collections::HashMap,
    sync::{Arc, Weak},
};

use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use epigraph_core::{Dims, Snapshot};
use epigraph_pictures::{Look, show};

use crate::task::Task;

/// Largest width or height, pixels.
const SIDE: u32 = 160;
/// Seconds between two images of a port.
const PAUSE: f64 = 0.25;

/// The images by port.
#[derive(Default)]
pub struct Thumbnails {
    shown: HashMap<String, Shown>,
    /// The next image. It is drawn on another thread, as it may have to wait for cores that are busy with the graph.
    work: Task<Of, ColorImage>,
}

struct Shown {
    of: Of,
    at: f64,
    texture: TextureHandle,
}

/// A port and its values, by a weak reference that does not keep them in memory.
#[derive(Clone)]
struct Of {
    port: String,
    values: Weak<Snapshot>,
}

impl Of {
    fn new(snapshot: &Arc<Snapshot>) -> Self {
        Self { port: snapshot.name.clone(), values: Arc::downgrade(snapshot) }
    }
}

impl PartialEq for Of {
    fn eq(&self, other: &Self) -> bool {
        Weak::ptr_eq(&self.values, &other.values)
    }
}

impl Thumbnails {
    /// Drops all images.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// The image of a port.
    pub fn get(&self, port: &str) -> Option<&TextureHandle> {
        self.shown.get(port).map(|shown| &shown.texture)
    }

    /// Takes the newest values of the port whose image is oldest; one port at a time.
    pub fn update<'s>(&mut self, context: &Context, snapshots: impl Iterator<Item = &'s Arc<Snapshot>>) {
        let now = context.input(|input| input.time);
        self.take(context, now);
        let age = |snapshot: &Arc<Snapshot>| match self.shown.get(&snapshot.name) {
            None => Some(f64::INFINITY),
            Some(shown) if shown.of != Of::new(snapshot) => Some(now - shown.at),
            Some(_) => None,
        };
        let stale = snapshots.filter_map(|snapshot| Some((age(snapshot)?, snapshot)));
        let Some((age, snapshot)) = stale.max_by(|a, b| a.0.total_cmp(&b.0)) else { return };
        if age < PAUSE {
            context.request_repaint_after_secs((PAUSE - age) as f32);
            return;
        }
        let snapshot = snapshot.clone();
        self.work.want_after_take(context, Of::new(&snapshot), move || {
            let picture = show(&reduced(&snapshot), &Look::default());
            ColorImage::from_rgb(picture.size, picture.colors.as_flattened())
        });
    }

    /// Shows finished images.
    fn take(&mut self, context: &Context, now: f64) {
        let (Some(image), Some(of)) = (self.work.take(), self.work.done()) else { return };
        let texture = match self.shown.remove(&of.port) {
            Some(Shown { mut texture, .. }) => {
                texture.set(image, TextureOptions::LINEAR);
                texture
            }
            None => context.load_texture(&of.port, image, TextureOptions::LINEAR),
        };
        self.shown.insert(of.port.clone(), Shown { of: of.clone(), at: now, texture });
    }
}

/// Reduces an image by an integer factor, by point sampling.
fn reduced(snapshot: &Snapshot) -> Snapshot {
    let Dims { width, height } = snapshot.dims;
    let step = width.max(height).div_ceil(SIDE).max(1);
    let dims = Dims { width: width / step, height: height / step };
    let bytes = snapshot.element.bytes() as usize;
    let mut picked = Vec::with_capacity(dims.count() * bytes);
    for y in 0..dims.height {
        for x in 0..dims.width {
            let at = (y * step * width + x * step) as usize * bytes;
            picked.extend_from_slice(snapshot.bytes.get(at..at + bytes).unwrap_or_default());
        }
    }
    let Snapshot { name, field, meaning, element, frame, .. } = snapshot;
    Snapshot {
        name: name.clone(),
        field: field.clone(),
        meaning: *meaning,
        element: element.clone(),
        dims,
        frame: *frame,
        bytes: picked,
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Element, Format};

    use super::*;

    #[test]
    fn a_large_image_is_reduced_by_an_integer_factor() {
        let dims = Dims { width: 640, height: 320 };
        let bytes = (0..dims.count() as u32).flat_map(u32::to_le_bytes).collect();
        let element = Element::Texel(Format::R32Uint);
        let (name, field, meaning) = ("a.b".into(), String::new(), None);
        let snapshot = Snapshot { name, field, meaning, element, dims, frame: 3, bytes };
        let small = reduced(&snapshot);
        assert_eq!((small.dims.width, small.dims.height, small.bytes.len()), (160, 80, 160 * 80 * 4));
        assert_eq!(small.get::<u32>()[..2], [0, 4]);
        assert_eq!(small.get::<u32>()[160], 4 * 640);
    }
}
