//! The ports that the engine captures for thumbnails: visible ones, and for a while those that were visible.
//!
//! The engine recompiles the graph for other ports. So while the user moves about the canvas, a port that is out of sight is
//! still captured for some seconds, and a port that comes into sight may wait a moment for others to join it.

use std::collections::BTreeMap;

/// Seconds for which a port stays captured after it left sight.
const KEPT: f64 = 5.0;
/// Least number of seconds from one change to the next.
const APART: f64 = 0.5;

/// The captured ports.
#[derive(Debug, Default)]
pub struct Watch {
    /// When each was last in sight, seconds.
    seen: BTreeMap<String, f64>,
    asked: Vec<String>,
    changed: Option<f64>,
}

impl Watch {
    /// The ports captured now.
    pub fn ports(&self) -> &[String] {
        &self.asked
    }

    /// Takes all ports that have thumbnails, and whether they are visible at `now`. Returns the seconds until the next
    /// call is needed, if one is.
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

    /// The ports captured of three when these are visible.
    fn see(watch: &mut Watch, in_sight: &[&str], now: f64) -> String {
        watch.see(["a.x", "b.x", "c.x"].into_iter().map(|port| (port, in_sight.contains(&port))), now);
        watch.ports().join(" ")
    }

    #[test]
    fn only_what_is_in_sight_is_taken() {
        let mut watch = Watch::default();
        assert_eq!(see(&mut watch, &["a.x"], 0.0), "a.x");
        assert_eq!(see(&mut watch, &["b.x", "c.x"], 3.0), "a.x b.x c.x", "the first is kept");
        assert_eq!(see(&mut watch, &["c.x"], 4.0), "a.x b.x c.x");
        assert_eq!(see(&mut watch, &["c.x"], 5.5), "b.x c.x");
        assert_eq!(see(&mut watch, &[], 30.0), "");
    }

    #[test]
    fn moving_about_changes_little() {
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
    fn what_has_to_wait_says_how_long() {
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
