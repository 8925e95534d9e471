//! The pixel that the user has picked, and when the engine is to look at it.

/// A picked pixel. The engine is asked to look only while a pane shows what it finds.
#[derive(Default)]
pub struct Picked {
    pixel: Option<[u32; 2]>,
    /// Whether a pane shows it in this frame of the window.
    is_shown: bool,
    /// Counted up by everything that asks for a new look.
    looks: u64,
    sent: Option<([u32; 2], u64)>,
}

impl Picked {
    /// Column and row of the frame's pixel.
    pub fn pixel(&self) -> Option<[u32; 2]> {
        self.pixel
    }

    /// Picks a pixel, which a pane will show.
    pub fn pick(&mut self, pixel: [u32; 2]) {
        self.pixel = Some(pixel);
        self.is_shown = true;
        self.look();
    }

    /// Picks none.
    pub fn forget(&mut self) {
        self.pixel = None;
    }

    /// A pane shows it; to be said in every frame of the window.
    pub fn show(&mut self) {
        self.is_shown = true;
    }

    /// Asks for a new look at the same pixel.
    pub fn look(&mut self) {
        self.looks += 1;
    }

    /// What the engine is to be told, if anything; once for each frame of the window.
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
    fn the_engine_looks_only_while_a_pane_shows_it() {
        let mut picked = Picked::default();
        assert_eq!(picked.news(), None);
        picked.pick([3, 4]);
        // The pane is on its way to the front.
        assert_eq!(picked.news(), Some(Some([3, 4])));
        picked.show();
        assert_eq!(picked.news(), None);
        picked.show();
        picked.look();
        assert_eq!(picked.news(), Some(Some([3, 4])));
        // Now another pane lies before it.
        assert_eq!(picked.news(), Some(None));
        assert_eq!(picked.news(), None);
    }
}
