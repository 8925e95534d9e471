//! The regions that contain all rays of an event, and the boxes of bodies that may block them.

use glam::{DMat3, DVec3};

use super::{
    boundary::CLEARANCE,
    event::{Event, HalfSpace, Source},
};
use crate::{Body, Pose};

/// The factor by which a ray may end farther beside the event's part of the plane than off the plane: the inverse of
/// the minimum sine between receivers and the plane, 1/100.
const BESIDE: f64 = 100.0;

/// Distance outside of a region at which rays in f32 may still hit geometry, as a share of the largest coordinate.
const SLACK: f64 = 1e-5;

/// A body's box in one of its poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct PosedBox {
    center: DVec3,
    /// Its axes, each half as long as the box.
    sides: [DVec3; 3],
}

impl PosedBox {
    /// The box of `body` in `pose`; `None` for a body without triangles.
    pub fn new(body: &Body, pose: &Pose) -> Option<Self> {
        let [low, high] = body.bounds_at_rest().map(|corner| corner.as_dvec3());
        if low.x > high.x {
            return None;
        }
        let turn = DMat3::from_quat(pose.rotation.as_dquat());
        let half = 0.5 * (high - low);
        Some(Self {
            center: turn * low.midpoint(high) + pose.translation.as_dvec3(),
            sides: [turn.x_axis * half.x, turn.y_axis * half.y, turn.z_axis * half.z],
        })
    }

    /// The largest value of a linear function in the box.
    fn most(&self, function: &HalfSpace) -> f64 {
        let beyond = self.sides.iter().map(|&side| function.gradient.dot(side).abs());
        function.at(self.center) + beyond.sum::<f64>()
    }
}

/// A convex region that contains all rays on which an event's boundaries depend: those between the light and all
/// possible receivers. Geometry outside of it does not affect the event.
pub(super) struct Region {
    /// At least 0 inside the region.
    sides: [HalfSpace; 4],
    slack: f64,
}

impl Region {
    /// The region of `event`; `reach` is the largest coordinate of the scene. `None` if the region has no useful bound,
    /// as the blocker is so close to the light that the clearance of rays is not small.
    pub fn new(event: &Event, source: &Source, reach: f64) -> Option<Self> {
        // The distance from the plane of a ray that passes the blocker at the clearance, as a linear function of
        // position, which is 0 at the light.
        let clearance = CLEARANCE * reach * event.magnification()?;
        let off = event.reach.plus(1.0).times(clearance);
        // A ray does not end exactly at its point on the receiver, where this function is a little smaller.
        if 2.0 * BESIDE * off.gradient.length() > 1.0 {
            return None;
        }
        let plane = HalfSpace::new(event.normal, event.middle);
        let sides = [
            plane.and(&off.times(2.0)),
            plane.times(-1.0).and(&off.times(2.0)),
            event.sides[0].and(&off.times(2.0 * BESIDE)),
            event.sides[1].and(&off.times(2.0 * BESIDE)),
        ];
        // The corners of the light are inside, as rays go from each of them to all receivers.
        let with_light = |side: &HalfSpace| {
            let least = source.corners.iter().map(|&corner| side.at(corner)).fold(0.0, f64::min);
            side.plus(-least)
        };
        Some(Self { sides: sides.each_ref().map(with_light), slack: SLACK * reach })
    }

    /// Returns true if a box may intersect the region.
    pub fn touches(&self, posed: &PosedBox) -> bool {
        self.sides.iter().all(|side| posed.most(side) >= -self.slack)
    }
}
