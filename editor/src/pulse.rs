//! The frame rate of the window.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

/// The times of the window's frames in the last second.
#[derive(Debug, Default)]
pub struct Pulse {
    frames: VecDeque<Instant>,
}

impl Pulse {
    /// Records that a frame is drawn at `now`.
    pub fn beat(&mut self, now: Instant) {
        self.frames.push_back(now);
        while self.frames.front().is_some_and(|first| now - *first >= Duration::from_secs(1)) {
            self.frames.pop_front();
        }
    }

    /// Number of frames in the second before the last recorded one, which counts too.
    pub fn rate(&self) -> usize {
        self.frames.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_last_second_are_counted() {
        let mut pulse = Pulse::default();
        let start = Instant::now();
        for frame in 0..90 {
            pulse.beat(start + frame * Duration::from_millis(25));
        }
        assert_eq!(pulse.rate(), 40);
        pulse.beat(start + Duration::from_secs(60));
        assert_eq!(pulse.rate(), 1);
    }
}
