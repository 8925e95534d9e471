//! The picked pixel, and when the engine has to inspect it.

/// The picked pixel. The engine inspects it only while a pane shows the result.
#[derive(Default)]
pub struct Picked {
    pixel: Option<[u32; 2]>,
    /// True if a pane shows it in this frame of the window.
    is_shown: bool,
    /// Incremented by every request for a new inspection.
    looks: u64,
    sent: Option<([u32; 2], u64)>,
}

impl Picked {
    /// Column and row of the frame's pixel.
    pub fn pixel(&self) -> Option<[u32; 2]> {
        self.pixel
    }

    /// Picks a pixel, for a pane to show.
    pub fn pick(&mut self, pixel: [u32; 2]) {
        self.pixel = Some(pixel);
        self.is_shown = true;
        self.look();
    }

    /// Clears the picked pixel.
    pub fn forget(&mut self) {
        self.pixel = None;
    }

    /// Marks the pixel as shown by a pane. Call it in every frame of the window.
    pub fn show(&mut self) {
        self.is_shown = true;
    }

    /// Requests a new inspection of the same pixel.
    pub fn look(&mut self) {
        self.looks += 1;
    }

    /// The change to send to the engine, if any. Call it once in each frame of the window.
    pub fn news(&mut self) -> Option<Option<[u32; 2]>> {
        let shown = std::mem::take(&mut self.is_shown);
        let wish = self.pixel.filter(|_| shown).map(|pixel| (pixel, self.looks));
        (wish != self.sent).then(|| {
            self.sent = wish;
            wish.map(|(pixel, _)| pixel)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_engine_inspects_only_while_a_pane_shows_the_pixel() {
        let mut picked = Picked::default();
        assert_eq!(picked.news(), None);
        picked.pick([3, 4]);
        // The pane is shown from the next frame on.
        assert_eq!(picked.news(), Some(Some([3, 4])));
        picked.show();
        assert_eq!(picked.news(), None);
        picked.show();
        picked.look();
        assert_eq!(picked.news(), Some(Some([3, 4])));
        // Now another pane hides it.
        assert_eq!(picked.news(), Some(None));
        assert_eq!(picked.news(), None);
    }
}
