//! The placement of the image in the pane: zoom and pan.

use egui::{PointerButton, Pos2, Rect, Response, Ui, Vec2, pos2, vec2};
use serde::{Deserialize, Serialize};

/// Most points per pixel.
const MAX_ZOOM: f32 = 256.0;
/// Zoom per point of scrolling, in doublings.
const WHEEL: f32 = 1.0 / 150.0;

/// The placement of an image of any size in the pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Points per pixel; `None` fits the image into the pane.
    pub zoom: Option<f32>,
    /// From the pane's centre to the image's centre, points.
    offset: Vec2,
}

/// An image on screen.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// The part of the window for it.
    pub pane: Rect,
    /// The rectangle of the whole image.
    pub image: Rect,
    /// Its width and height, pixels.
    pub size: [usize; 2],
}

impl Place {
    /// Centred, with this many points per pixel; `None` fits it into the pane.
    pub fn centered(zoom: Option<f32>) -> Self {
        Self { zoom, offset: Vec2::ZERO }
    }

    /// An image of `size` in a pane.
    pub fn put(&self, pane: Rect, size: [usize; 2]) -> Placed {
        let extent = vec2(size[0].max(1) as f32, size[1].max(1) as f32);
        let fit = (pane.width() / extent.x).min(pane.height() / extent.y);
        let image = Rect::from_center_size(pane.center() + self.offset, extent * self.zoom.unwrap_or(fit));
        Placed { pane, image, size }
    }

    /// Handles the mouse: the wheel zooms, Shift drag and middle drag pan, a double click fits.
    pub fn steer(&mut self, ui: &Ui, response: &Response, placed: &Placed) {
        let shift = ui.input(|input| input.modifiers.shift);
        let pans = response.dragged_by(PointerButton::Middle)
            || response.dragged_by(PointerButton::Primary) && shift;
        let zoom = placed.zoom();
        if pans {
            self.zoom = Some(zoom);
            self.offset += response.drag_delta();
        }
        if let Some(pointer) = response.hover_pos() {
            let wheel = ui.input(|input| input.smooth_scroll_delta().y * WHEEL);
            let pinch = ui.input(|input| input.zoom_delta()).log2();
            let factor = (wheel + pinch).exp2();
            if factor != 1.0 {
                let new = (zoom * factor).clamp(1.0 / 16.0, MAX_ZOOM);
                // The pixel under the pointer stays there.
                let middle = pointer + (placed.image.center() - pointer) * (new / zoom);
                (self.zoom, self.offset) = (Some(new), middle - placed.pane.center());
            }
        }
        if response.double_clicked() {
            *self = Self::default();
        }
    }
}

impl Placed {
    /// Points per pixel.
    pub fn zoom(&self) -> f32 {
        self.image.width() / self.size[0].max(1) as f32
    }

    /// The pixel nearest to a point.
    pub fn pixel(&self, at: Pos2) -> [usize; 2] {
        let share = (at - self.image.min) / self.image.size();
        let index =
            |share: f32, size: usize| ((share * size as f32).max(0.0) as usize).min(size.saturating_sub(1));
        [index(share.x, self.size[0]), index(share.y, self.size[1])]
    }

    /// The screen position of a place in the image, in pixels from its top left corner.
    pub fn point(&self, [x, y]: [f32; 2]) -> Pos2 {
        self.image.min + vec2(x, y) * self.zoom()
    }

    /// The rectangle of a pixel.
    pub fn square(&self, [x, y]: [usize; 2]) -> Rect {
        Rect::from_min_size(self.point([x as f32, y as f32]), Vec2::splat(self.zoom()))
    }

    /// The visible part of the image.
    pub fn visible(&self) -> Rect {
        self.pane.intersect(self.image)
    }

    /// The visible pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let visible = self.visible();
        let [from, to] = [self.pixel(visible.min), self.pixel(visible.max)];
        let rows = if visible.is_positive() { from[1]..to[1] + 1 } else { 0..0 };
        rows.flat_map(move |y| (from[0]..to[0] + 1).map(move |x| [x, y]))
    }
}

/// The whole of a texture.
pub const WHOLE: Rect = Rect { min: Pos2::ZERO, max: pos2(1.0, 1.0) };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_points_agree() {
        let pane = Rect::from_min_size(pos2(10.0, 20.0), vec2(100.0, 100.0));
        let placed = Place::default().put(pane, [50, 25]);
        assert_eq!((placed.zoom(), placed.image.min), (2.0, pos2(10.0, 45.0)));
        assert_eq!(placed.pixel(pos2(13.0, 45.5)), [1, 0]);
        assert_eq!(placed.square([1, 0]).min, pos2(12.0, 45.0));
        assert_eq!(placed.pixels().count(), 50 * 25);
        // Zoomed in, only some are visible.
        let near = Place::centered(Some(50.0)).put(pane, [50, 25]);
        assert!(near.pixels().count() <= 9, "{}", near.pixels().count());
        assert!(near.pixels().all(|pixel| near.square(pixel).intersects(pane)));
    }
}
