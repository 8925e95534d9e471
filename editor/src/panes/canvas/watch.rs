//! The ports that the engine captures for thumbnails: the visible ones, and those that were visible some seconds ago.
//!
//! To capture other ports, the engine must recompile the graph. So while the user pans, a port that is no longer
//! visible is captured for some more seconds, and newly visible ports are collected for a moment before the next
//! change.

use std::collections::BTreeMap;

/// Seconds for which a port stays captured after it was last visible.
const KEPT: f64 = 5.0;
/// Least number of seconds from one change to the next.
const APART: f64 = 0.5;

/// The captured ports.
#[derive(Debug, Default)]
pub struct Watch {
    /// When each port was last visible, seconds.
    seen: BTreeMap<String, f64>,
    asked: Vec<String>,
    changed: Option<f64>,
}

impl Watch {
    /// The ports captured now.
    pub fn ports(&self) -> &[String] {
        &self.asked
    }

    /// Updates the captured ports from all ports with thumbnails and whether each is visible at `now`. Returns the
    /// number of seconds after which it must be called again, if it must.
    pub fn see<'a>(&mut self, ports: impl Iterator<Item = (&'a str, bool)>, now: f64) -> Option<f64> {
        let before = std::mem::take(&mut self.seen);
        for (port, in_sight) in ports {
            let last = before.get(port).copied().filter(|last| now - last <= KEPT);
            if let Some(seen) = if in_sight { Some(now) } else { last } {
                let known = self.seen.entry(port.to_owned()).or_insert(seen);
                *known = known.max(seen);
            }
        }
        if self.seen.len() == self.asked.len() && self.asked.iter().all(|port| self.seen.contains_key(port)) {
            return None;
        }
        let wait = self.changed.map_or(0.0, |changed| changed + APART - now);
        if wait > 0.0 {
            return Some(wait);
        }
        self.asked = self.seen.keys().cloned().collect();
        self.changed = Some(now);
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The captured ones of three ports when these are visible.
    fn see(watch: &mut Watch, in_sight: &[&str], now: f64) -> String {
        watch.see(["a.x", "b.x", "c.x"].into_iter().map(|port| (port, in_sight.contains(&port))), now);
        watch.ports().join(" ")
    }

    #[test]
    fn only_visible_ports_are_captured() {
        let mut watch = Watch::default();
        assert_eq!(see(&mut watch, &["a.x"], 0.0), "a.x");
        assert_eq!(see(&mut watch, &["b.x", "c.x"], 3.0), "a.x b.x c.x", "the first is kept");
        assert_eq!(see(&mut watch, &["c.x"], 4.0), "a.x b.x c.x");
        assert_eq!(see(&mut watch, &["c.x"], 5.5), "b.x c.x");
        assert_eq!(see(&mut watch, &[], 30.0), "");
    }

    #[test]
    fn panning_changes_the_captured_ports_rarely() {
        let mut watch = Watch::default();
        let mut changes = 0;
        let mut before = String::new();
        // In each of sixty frames a second, a different port is visible.
        for frame in 0..120 {
            let now = see(&mut watch, &[["a.x", "b.x", "c.x"][frame % 3]], frame as f64 / 60.0);
            changes += usize::from(now != before);
            before = now;
        }
        assert_eq!((changes, before.as_str()), (2, "a.x b.x c.x"));
    }

    #[test]
    fn a_delayed_change_returns_how_long_to_wait() {
        let mut watch = Watch::default();
        assert_eq!(watch.see([("a.x", true)].into_iter(), 10.0), None);
        let both = || [("a.x", true), ("b.x", true)].into_iter();
        assert_eq!(watch.see(both(), 10.25), Some(0.25));
        assert_eq!(watch.see(both(), 10.5), None);
        assert_eq!(watch.ports(), ["a.x", "b.x"]);
        // A port that the graph no longer has is dropped.
        watch.see([("b.x", false)].into_iter(), 12.0);
        assert_eq!(watch.ports(), ["b.x"]);
    }
}
