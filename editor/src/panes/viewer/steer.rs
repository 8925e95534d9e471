//! Camera control with mouse and keys.

use egui::{Key, PointerButton, Response, Ui};

use crate::session::Session;

/// Radians of camera rotation per point of a drag.
const TURN: f32 = 0.006;

/// Turns drags and held keys into movements of the camera.
pub fn steer(ui: &Ui, session: &mut Session, response: &Response) {
    let shift = ui.input(|input| input.modifiers.shift);
    let drag = response.drag_delta() * TURN;
    if response.dragged_by(PointerButton::Primary) && !shift {
        session.move_camera(|rig| rig.orbit(drag.x, drag.y));
    }
    if response.dragged_by(PointerButton::Secondary) {
        session.move_camera(|rig| rig.look(drag.x, drag.y));
    }
    // A focused text field gets the keys.
    let typing = ui.ctx().memory(|memory| memory.focused().is_some_and(|id| id != response.id));
    if !(response.hovered() || response.has_focus()) || typing || ui.input(|input| input.modifiers.command) {
        return;
    }
    let (held, seconds) = ui.input(|input| {
        let axis = |plus: Key, minus: Key| f32::from(input.key_down(plus)) - f32::from(input.key_down(minus));
        let held = [axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S)];
        (held, input.stable_dt.min(0.1))
    });
    if held != [0.0; 3] {
        session.move_camera(|rig| rig.fly(held, seconds));
        ui.ctx().request_repaint();
    }
}
