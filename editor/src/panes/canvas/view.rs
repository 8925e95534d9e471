//! The part of the canvas that the pane shows.

use egui::{Pos2, Rect, Vec2};

/// Points on screen per point of the canvas, at least and at most.
const ZOOMS: [f32; 2] = [0.15, 2.5];
/// Largest magnification when fitting.
const FIT_ZOOM: f32 = 1.15;
/// Room around the fitted area, points on screen.
const FRAME: f32 = 26.0;
/// Least zoom at which the names of pins are shown.
const LEGIBLE: f32 = 0.66;

/// A zoom and a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Points on screen per point of the canvas.
    pub zoom: f32,
    /// The canvas's point at the centre of the pane.
    pub center: Pos2,
    /// The pane.
    pub pane: Rect,
}

impl Default for View {
    fn default() -> Self {
        Self { zoom: 1.0, center: Pos2::ZERO, pane: Rect::ZERO }
    }
}

impl View {
    /// From the canvas to the screen.
    pub fn point(&self, at: Pos2) -> Pos2 {
        self.pane.center() + (at - self.center) * self.zoom
    }

    /// From the canvas to the screen.
    pub fn rect(&self, rect: Rect) -> Rect {
        Rect::from_min_max(self.point(rect.min), self.point(rect.max))
    }

    /// From the screen to the canvas.
    pub fn back(&self, at: Pos2) -> Pos2 {
        self.center + (at - self.pane.center()) / self.zoom
    }

    /// Changes the pane; the canvas's point at its top left corner stays there.
    pub fn resize(&mut self, pane: Rect) {
        self.center += (pane.size() - self.pane.size()) / (2.0 * self.zoom);
        self.pane = pane;
    }

    /// True if names of pins are readable.
    pub fn is_near(&self) -> bool {
        self.zoom >= LEGIBLE
    }

    /// Pans by a drag on screen.
    pub fn pan(&mut self, by: Vec2) {
        self.center -= by / self.zoom;
    }

    /// Zooms about a point on screen.
    pub fn zoom(&mut self, by: f32, about: Pos2) {
        let fixed = self.back(about);
        self.zoom = (self.zoom * by).clamp(ZOOMS[0], ZOOMS[1]);
        self.center += fixed - self.back(about);
    }

    /// Fits an area of the canvas into the pane.
    pub fn fit(&mut self, bounds: Rect) {
        if !bounds.is_finite() || self.pane.width() < 1.0 {
            return;
        }
        let room = (self.pane.size() - Vec2::splat(2.0 * FRAME)).max(Vec2::splat(1.0));
        let ratio = room / bounds.size().max(Vec2::splat(1.0));
        self.zoom = ratio.min_elem().clamp(ZOOMS[0], FIT_ZOOM);
        self.center = bounds.center();
    }

    /// Pans as little as needed to show a box.
    pub fn reveal(&mut self, rect: Rect) {
        let seen =
            Rect::from_min_max(self.back(self.pane.min), self.back(self.pane.max)).shrink(FRAME / self.zoom);
        let shift = |low: f32, high: f32, from: f32, to: f32| {
            if low < from {
                low - from
            } else if high > to {
                (high - to).min(low - from)
            } else {
                0.0
            }
        };
        self.center.x += shift(rect.left(), rect.right(), seen.left(), seen.right());
        self.center.y += shift(rect.top(), rect.bottom(), seen.top(), seen.bottom());
    }
}

#[cfg(test)]
mod tests {
    use egui::{pos2, vec2};

    use super::*;

    fn view() -> View {
        View { pane: Rect::from_min_size(pos2(100.0, 50.0), vec2(600.0, 400.0)), ..View::default() }
    }

    #[test]
    fn zooming_keeps_the_point_under_the_pointer_and_has_limits() {
        let mut view = view();
        let at = pos2(130.0, 90.0);
        let before = view.back(at);
        view.zoom(1.7, at);
        assert!(view.back(at).distance(before) < 1e-3);
        view.zoom(1000.0, at);
        assert_eq!(view.zoom, ZOOMS[1]);
        view.zoom(1e-6, at);
        assert_eq!(view.zoom, ZOOMS[0]);
    }

    #[test]
    fn resizing_the_pane_keeps_its_top_left_point() {
        let mut view = View { zoom: 0.7, center: pos2(10.0, 20.0), ..view() };
        let corner = view.back(view.pane.min);
        view.resize(Rect::from_min_size(pos2(90.0, 70.0), vec2(500.0, 100.0)));
        assert!(view.back(view.pane.min).distance(corner) < 1e-3);
    }

    #[test]
    fn fitting_shows_everything_and_revealing_pans_only_as_needed() {
        let mut view = view();
        let bounds = Rect::from_min_size(pos2(-300.0, 20.0), vec2(2000.0, 500.0));
        view.fit(bounds);
        assert!(view.pane.contains_rect(view.rect(bounds)));
        let before = view;
        view.reveal(Rect::from_center_size(bounds.center(), vec2(50.0, 50.0)));
        assert_eq!(view, before);
        let outside = Rect::from_min_size(pos2(3000.0, 100.0), vec2(50.0, 50.0));
        view.reveal(outside);
        assert!(view.pane.contains_rect(view.rect(outside)));
        assert_eq!(view.center.y, before.center.y);
    }
}
