//! The regions in which the light rays of events run, and the bodies that may block them.

use glam::{DMat3, DVec3};

use super::{
    boundary::CLEARANCE,
    event::{Event, HalfSpace, Source},
};
use crate::{Body, Pose};

/// The least sine at which receivers are looked at is 1/100: so much farther than off the event's plane, rays may end beside
/// the event's part of it.
const BESIDE: f64 = 100.0;

/// Geometry within this share of the largest coordinate of a region's side may be cut by rays in f32.
const SLACK: f64 = 1e-5;

/// A body's box in one of its poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct PosedBox {
    center: DVec3,
    /// Half of its size.
    sides: [DVec3; 3],
}

impl PosedBox {
    /// `None` for a body without a surface.
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

    /// Largest value of a linear function in the box.
    fn most(&self, function: &HalfSpace) -> f64 {
        let beyond = self.sides.iter().map(|&side| function.gradient.dot(side).abs());
        function.at(self.center) + beyond.sum::<f64>()
    }
}

/// A convex region in which all rays run that decide about an event: between the light and whatever may receive its
/// boundary. What does not touch it changes nothing about the event.
pub(super) struct Region {
    /// Not negative within.
    sides: [HalfSpace; 4],
    slack: f64,
}

impl Region {
    /// `reach` is the largest coordinate of the scene. `None` where the rays may run anywhere: a blocker so close to the
    /// light that the clearance of rays counts.
    pub fn new(event: &Event, source: &Source, reach: f64) -> Option<Self> {
        // How far a ray that passes the blocker at the clearance is off the plane, as a linear function: none at the light.
        let clearance = CLEARANCE * reach * event.magnification()?;
        let off = event.reach.plus(1.0).times(clearance);
        // A ray's end lies off its place on the receiver, and so this function is a little less there.
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
        // From the light's corners, too, rays go to all of the receivers.
        let with_light = |side: &HalfSpace| {
            let least = source.corners.iter().map(|&corner| side.at(corner)).fold(0.0, f64::min);
            side.plus(-least)
        };
        Some(Self { sides: sides.each_ref().map(with_light), slack: SLACK * reach })
    }

    /// Returns true if a box may intersect it.
    pub fn touches(&self, posed: &PosedBox) -> bool {
        self.sides.iter().all(|side| posed.most(side) >= -self.slack)
    }
}
