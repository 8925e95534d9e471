//! Which ports the engine takes for thumbnails: those in sight, and for a while those that were.
//!
//! The engine compiles the graph anew for other ports. So while somebody moves about the canvas, what has left sight is
//! still taken for some seconds, and what comes into sight may have to wait a moment for more to come with it.

use std::collections::BTreeMap;

/// Seconds for which a port is taken that is out of sight.
const KEPT: f64 = 5.0;
/// Least number of seconds from one change to the next.
const APART: f64 = 0.5;

/// The ports that are taken.
#[derive(Debug, Default)]
pub struct Watch {
    /// When each was last in sight, seconds.
    seen: BTreeMap<String, f64>,
    asked: Vec<String>,
    changed: Option<f64>,
}

impl Watch {
    /// What is taken now.
    pub fn ports(&self) -> &[String] {
        &self.asked
    }

    /// Takes all ports that there are thumbnails of, and which of them are in sight at `now`. Gives the seconds until it
    /// has to be asked again, if it has to.
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

    /// What is taken when of three ports these are in sight.
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
        // Something else is in sight in each of sixty frames a second.
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
        // A port that the graph no longer has is not kept.
        watch.see([("b.x", false)].into_iter(), 12.0);
        assert_eq!(watch.ports(), ["b.x"]);
    }
}
