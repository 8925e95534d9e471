//! Finds the parts of an event's cuts that are shadow boundaries, with shadow rays to points on both sides of a cut.

use std::cell::Cell;

use glam::DVec3;

use super::{
    ShadowKind, ShadowSegment, ShadowSettings,
    event::{Event, Source},
    receivers::{Cut, Cutting, Receivers, join},
};
use crate::Tracer;

/// Distance from the blocker's outline at which the rays pass it on either side, as a share of the largest coordinate:
/// about ten times the error of rays in f32.
pub(super) const CLEARANCE: f64 = 2e-5;

/// Distance of the rays' ends from the receiver's plane and from the light's, as a share of the largest coordinate: 32
/// units in the last place, as in the tracer.
const LIFT: f64 = 32.0 * f32::EPSILON as f64;

/// Minimum sine of the angle between a ray and the surface of a receiver or light, and between a receiver and the
/// event's plane. Shallower cases are skipped, as their rays would graze the surface.
const MIN_SINE: f64 = 0.01;

/// Length of the steps in which a cut is sampled, as a share of the scene's diagonal. A cut has at most [`MAX_STEPS`]
/// steps; those of very long cuts are longer.
const STEP: f64 = 1.0 / 256.0;
const MAX_STEPS: f64 = 256.0;

/// Number of bisection steps that locate an end of a boundary.
const HALVINGS: u32 = 8;

/// The least [`Width`]: narrower penumbrae are not distinguished.
const NARROWEST: f64 = -24.0;

/// The effort that is left for the search of one event, in tests of a ray with a triangle.
pub(super) struct Effort(Cell<u64>);

impl Effort {
    /// Takes some from what is left. Returns false if nothing was.
    #[inline]
    pub fn spend(&self, much: u64) -> bool {
        let left = self.0.get();
        self.0.set(left.saturating_sub(much));
        left > 0
    }

    pub fn is_spent(&self) -> bool {
        self.0.get() == 0
    }
}

/// Finds the boundaries of one light's events.
pub(super) struct Finder<'a> {
    tracer: &'a Tracer,
    receivers: &'a Receivers,
    source: &'a Source,
    contact: [f64; 2],
    /// The scene's diagonal, metres.
    diagonal: f64,
    /// Maximum width of a penumbra, metres.
    max_penumbra: f64,
    /// [`CLEARANCE`] and [`LIFT`] in metres.
    clearance: f64,
    lift: f64,
}

/// A cut whose points are tested.
struct Line<'a> {
    event: &'a Event,
    effort: &'a Effort,
    ends: [DVec3; 2],
    normal: DVec3,
    /// A step across the line on the receiver, towards the blocker's side, that changes the distance from the event's
    /// plane by 1.
    across: DVec3,
}

/// The width of the penumbra at a point of a boundary as a share of the scene's diagonal, in half octaves, rounded
/// down: 0 is the diagonal itself, -2 is half of it.
type Width = i32;

impl<'a> Finder<'a> {
    /// `reach` is the largest coordinate of the scene.
    pub fn new(
        tracer: &'a Tracer,
        receivers: &'a Receivers,
        source: &'a Source,
        settings: &ShadowSettings,
        reach: f64,
    ) -> Self {
        let [low, high] = tracer.scene().bounds.map(|bound| bound.as_dvec3());
        let diagonal = low.distance(high);
        let contact = f64::from(settings.contact);
        Self {
            tracer,
            receivers,
            source,
            contact: [contact, 0.1 * contact],
            diagonal,
            max_penumbra: f64::from(settings.max_penumbra) * diagonal,
            clearance: CLEARANCE * reach,
            lift: LIFT * reach,
        }
    }

    /// Appends the boundaries of an event, as far as the effort lasts. Returns what is left of it: 0 if some boundaries may
    /// be missing.
    pub fn find(&self, event: &Event, effort: u64, found: &mut Vec<ShadowSegment>) -> u64 {
        let effort = Effort(Cell::new(effort));
        if event.length >= STEP * self.diagonal || self.sees_outline(event, &effort) {
            let mut cuts = Vec::new();
            let scene = self.tracer.scene();
            let cutting = Cutting { scene, event, contact: self.contact, effort: &effort };
            self.receivers.cut(&cutting, &mut cuts);
            join(&mut cuts, event);
            for cut in &cuts {
                self.divide(event, cut, &effort, found);
            }
        }
        effort.0.get()
    }

    /// Returns true if the light sees the middle of the event's edge (or its vertex). A cheap first test for short
    /// edges: most silhouette edges of a dense mesh are hidden from the light by others, and then cast no boundary.
    fn sees_outline(&self, event: &Event, effort: &Effort) -> bool {
        let middle = event.middle - event.normal * self.clearance;
        self.clear(event.light(), middle, 0.0, effort)
    }

    /// Appends the parts of a cut that are boundaries, as far as the effort lasts.
    fn divide(&self, event: &Event, cut: &Cut, effort: &Effort, found: &mut Vec<ShadowSegment>) {
        if effort.is_spent() {
            return;
        }
        let [start, end] = cut.ends;
        let length = start.distance(end);
        let Some(across) = super::across(cut.normal, end - start) else { return };
        let sine = event.normal.dot(across);
        if sine.abs() < MIN_SINE || length < self.lift {
            return;
        }
        let line = Line { event, effort, ends: cut.ends, normal: cut.normal, across: across / sine };
        let steps = (length / (STEP * self.diagonal)).ceil().clamp(1.0, MAX_STEPS) as usize;
        let place = |step: usize| (step as f64 + 0.5) / steps as f64;
        let mut begin = 0.0;
        let mut now = self.width(&line, place(0));
        for step in 1..=steps {
            let next = if step < steps { self.width(&line, place(step)) } else { None };
            if step < steps && next == now {
                continue;
            }
            let (here, there) = (place(step - 1), place(step));
            let border = if step == steps {
                1.0
            } else if next.is_some() && now.is_some() {
                0.5 * (here + there)
            } else {
                self.border(&line, here, there, now.is_some())
            };
            if effort.is_spent() {
                return;
            }
            if let Some(width) = now {
                let ends = [begin, border].map(|place| start.lerp(end, place).as_vec3());
                found.push(ShadowSegment {
                    ends,
                    kind: event.kind,
                    penumbra: self.widest(event.kind, width),
                    edge: event.edge,
                    face: cut.face,
                });
            }
            (begin, now) = (border, next);
        }
    }

    /// The place between two others at which a boundary begins or ends, by bisection. `is_here` is true if `here` is on
    /// the boundary and `there` is not, false if it is the other way round.
    fn border(&self, line: &Line, mut here: f64, mut there: f64, is_here: bool) -> f64 {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (here + there);
            if self.width(line, middle).is_some() == is_here {
                here = middle;
            } else {
                there = middle;
            }
        }
        0.5 * (here + there)
    }

    /// The width of the penumbra at a point of a line, or `None` if the point is not on a boundary.
    fn width(&self, line: &Line, place: f64) -> Option<Width> {
        let point = line.ends[0].lerp(line.ends[1], place);
        let [light, blocker] = line.event.in_line(point);
        let width = self.penumbra(line, point, blocker)?;
        // The ends of the two rays that pass the blocker on either side at the clearance.
        let away = self.clearance * point.distance(light) / blocker.distance(light);
        let [bright, dark] = [-away, away].map(|away| point + line.across * away);
        let sees = |from: DVec3, light: DVec3| self.sees(from, line.normal, light, line.effort);
        if !sees(bright, light) || sees(dark, light) {
            return None;
        }
        let corners = &self.source.corners;
        let center = corners[0].midpoint(corners[corners.len() / 2]);
        let mut others = corners.iter().copied().chain([center]);
        let outermost = match line.event.kind {
            ShadowKind::Hard => return Some(0),
            ShadowKind::Umbra => !others.any(|light| sees(dark, light)),
            ShadowKind::Penumbra => others.all(|light| sees(bright, light)),
        };
        outermost.then(|| (2.0 * (width / self.diagonal).log2()).floor().max(NARROWEST) as Width)
    }

    /// Width of the penumbra across a line, metres: the largest distance between `point` and the shadow of `blocker`
    /// from any corner of the light. `None` if it exceeds the maximum width.
    fn penumbra(&self, line: &Line, point: DVec3, blocker: DVec3) -> Option<f64> {
        let across = line.across.normalize();
        let moved = |&light: &DVec3| {
            let (above, ray) = (line.normal.dot(light - point), blocker - light);
            let sinks = -line.normal.dot(ray);
            let meets = light + ray * (above / sinks);
            // From a corner below the receiver's horizon, the shadow is infinitely far away.
            if above > 0.0 && sinks > 0.0 { across.dot(meets - point).abs() } else { f64::INFINITY }
        };
        match line.event.kind {
            ShadowKind::Hard => Some(0.0),
            _ => Some(self.source.corners.iter().map(moved).fold(0.0, f64::max))
                .filter(|&width| width <= self.max_penumbra),
        }
    }

    /// The greatest width of a penumbra, metres, that rounds down to `width`.
    fn widest(&self, kind: ShadowKind, width: Width) -> f32 {
        match kind {
            ShadowKind::Hard => 0.0,
            _ => (self.diagonal * (0.5 * f64::from(width + 1)).exp2()) as f32,
        }
    }

    /// Returns true if the point `from` of a receiver with the given normal sees the point `light` of the light.
    fn sees(&self, from: DVec3, normal: DVec3, light: DVec3, effort: &Effort) -> bool {
        let towards = (light - from).normalize_or_zero();
        let sine = normal.dot(towards);
        sine >= MIN_SINE && self.clear(light, from, self.lift / sine, effort)
    }

    /// Returns true if nothing blocks the ray from a point of the light to a point at the distance `short` before `to`.
    fn clear(&self, light: DVec3, to: DVec3, short: f64, effort: &Effort) -> bool {
        let (direction, distance) = (to - light).normalize_and_length();
        let begin = match self.source.normal {
            None => 0.0,
            // The ray starts off the light's own surface.
            Some(normal) if normal.dot(direction) >= MIN_SINE => self.lift / normal.dot(direction),
            Some(_) => return false,
        };
        let end = distance - short;
        let at = |distance: f64| (light + direction * distance).as_vec3();
        begin < end && self.tracer.reaches(at(begin), at(end), || effort.spend(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effort_lasts_until_nothing_is_left() {
        let effort = Effort(Cell::new(4));
        let steps = [(2, true, false), (1, true, false), (5, true, true), (1, false, true)];
        for (much, is_left, is_spent) in steps {
            assert_eq!((effort.spend(much), effort.is_spent()), (is_left, is_spent), "{much}");
        }
    }
}
