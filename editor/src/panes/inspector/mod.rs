//! One pixel, traced through the whole graph: its sample, and the effect of each node.

mod drawing;

use egui::{
    Align, Button, Color32, Label, Layout, RichText, ScrollArea, Sense, Ui, WidgetInfo, WidgetType, vec2,
};
use epigraph_core::{Finding, Side};

use crate::{
    engine::Command,
    inspect::{Inspection, Visit},
    session::Session,
    theme,
};

/// Seconds between inspections while frames run and the pane follows them.
const FOLLOW: f64 = 0.5;

/// Points between a node's findings and its drawing.
const GAP: f32 = 8.0;
/// Room for the names of values, points.
const NAMES: f32 = 68.0;
/// Room for the scroll bar.
const MARGIN: f32 = 10.0;

/// The pane's own state.
#[derive(Default)]
pub struct InspectorPane {
    /// Inspect repeatedly while frames run.
    follow: bool,
    /// Show the plain numbers too.
    numbers: bool,
    /// Time of the last inspection, seconds of the window's time.
    looked: f64,
}

impl InspectorPane {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        session.inspection.show();
        let Some(pixel) = session.inspection.pixel() else {
            empty(ui);
            return;
        };
        self.header(ui, session, pixel);
        let Some(inspection) = session.state.inspection.clone() else {
            ui.weak("Waiting for a frame …");
            return;
        };
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 3.0;
            ui.spacing_mut().interact_size.y = 16.0;
            // Wrap long lines, so that they do not widen the pane.
            ui.set_max_width(ui.available_width() - MARGIN);
            self.body(ui, session, &inspection);
        });
    }

    fn header(&mut self, ui: &mut Ui, session: &mut Session, [x, y]: [u32; 2]) {
        let paused = session.state.paused;
        ui.horizontal(|ui| {
            ui.strong(format!("({x}, {y})"));
            if let Some(inspection) = &session.state.inspection {
                let mib = inspection.bytes as f64 / f64::from(1 << 20);
                let cost = "Size of the copies of all nodes' outputs. A click copies one frame while frames run, or the \
                            last frame during a pause. Twice this memory is used during a pause, and while this pane is \
                            open.";
                ui.weak(format!("frame {}, {mib:.0} MiB", inspection.frame)).on_hover_text(cost);
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let forget = ui.add(Button::new("×").frame(false)).on_hover_text("Forget the pixel");
                forget.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, "forget the pixel"));
                if forget.clicked() {
                    session.inspection.forget();
                }
                ui.checkbox(&mut self.numbers, "numbers")
                    .on_hover_text("Also show the values of each port at this pixel, as plain numbers");
            });
        });
        if !paused {
            ui.horizontal(|ui| {
                ui.checkbox(&mut self.follow, "follow")
                    .on_hover_text("Inspect twice a second. Each time copies the outputs of all nodes");
                if ui
                    .small_button("Pause")
                    .on_hover_text("Pause; all ports of the last frame can then be viewed")
                    .clicked()
                {
                    session.engine.send(Command::Pause(true));
                }
            });
        }
        if self.follow && !paused {
            let now = ui.input(|input| input.time);
            if now - self.looked > FOLLOW {
                self.looked = now;
                session.inspection.look();
            }
            ui.ctx().request_repaint_after_secs(FOLLOW as f32);
        }
    }

    fn body(&self, ui: &mut Ui, session: &mut Session, inspection: &Inspection) {
        section(ui, |ui| {
            ui.label(RichText::new("Sample").strong().color(theme::palette(ui).accent))
                .on_hover_text("The point of the cloud that falls into the pixel, nearest to the eye");
            match &inspection.sample {
                Some(findings) => show_findings(ui, findings),
                None => {
                    ui.label("No point of the cloud falls into this pixel.");
                }
            }
        });
        for visit in inspection.nodes.iter().filter(|visit| !visit.is_silent()) {
            section(ui, |ui| {
                title(ui, session, visit);
                show_findings(ui, visit.findings.as_deref().unwrap_or_default());
                if self.numbers || visit.findings.is_none() {
                    numbers(ui, visit);
                }
            });
        }
        let silent: Vec<&str> = inspection
            .nodes
            .iter()
            .filter(|visit| visit.is_silent())
            .map(|visit| visit.node.as_str())
            .collect();
        if !silent.is_empty() {
            ui.add_space(4.0);
            ui.weak(format!("No values per pixel: {}", silent.join(", ")));
        }
    }
}

fn empty(ui: &mut Ui) {
    ui.strong("Click a pixel in a view.");
    ui.weak(
        "This pane then shows its way through the whole graph: its sample, the outputs of each node, and the reasons: culled \
         by which neighbours, cut by which edge, filled from which pixels.",
    );
}

/// A section of the pane, separated from the previous one.
fn section(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    ui.add_space(2.0);
    ui.separator();
    show(ui);
}

/// The node's name, which selects it.
fn title(ui: &mut Ui, session: &mut Session, visit: &Visit) {
    ui.horizontal(|ui| {
        let (color, side) = match visit.side {
            Side::Cpu => (theme::palette(ui).cpu, "Ran on the CPU"),
            Side::Gpu => (theme::palette(ui).gpu, "Ran on the GPU"),
        };
        let (rect, dot) = ui.allocate_exact_size(vec2(8.0, 10.0), Sense::hover());
        ui.painter().circle_filled(rect.center(), 3.5, color);
        dot.on_hover_text(side);
        let doc = session.registry.get(&visit.kind).map_or("", |kind| kind.doc());
        let name = ui.add(Button::new(RichText::new(&visit.node).strong()).frame(false));
        if name.on_hover_text(format!("{}: {doc}", visit.kind)).clicked() {
            session.selected = Some(visit.node.clone());
        }
        if !visit.node.ends_with(&visit.kind) {
            ui.weak(&visit.kind);
        }
    });
}

/// Values and reasons on the left, drawings on the right.
fn show_findings(ui: &mut Ui, findings: &[Finding]) {
    let is_drawing = |finding: &&Finding| matches!(finding, Finding::Around(_) | Finding::Sketch(_));
    let drawings: Vec<&Finding> = findings.iter().filter(is_drawing).collect();
    let taken = if drawings.is_empty() { 0.0 } else { drawing::SIDE + GAP };
    // The pane's own width; wide contents above may have stretched `available_width`.
    let width = (ui.clip_rect().right() - MARGIN - ui.cursor().left() - taken).max(80.0);
    ui.horizontal_top(|ui| {
        ui.spacing_mut().item_spacing.x = GAP;
        ui.allocate_ui_with_layout(vec2(width, 0.0), Layout::top_down(Align::Min), |ui| {
            ui.set_width(width);
            findings.iter().for_each(|finding| show_finding(ui, finding));
        });
        ui.vertical(|ui| drawings.iter().for_each(|finding| drawing::show(ui, finding)));
    });
}

/// A value after its name, or a reason.
fn show_finding(ui: &mut Ui, finding: &Finding) {
    let named = |ui: &mut Ui, name: &str, show: &mut dyn FnMut(&mut Ui)| {
        ui.horizontal_top(|ui| {
            ui.allocate_ui_with_layout(vec2(NAMES, 16.0), Layout::left_to_right(Align::Center), |ui| {
                ui.set_width(NAMES);
                ui.add(Label::new(RichText::new(name).weak()).truncate());
            });
            show(ui);
        });
    };
    match finding {
        Finding::Value { name, text } => named(ui, name, &mut |ui| {
            ui.add(Label::new(text).wrap());
        }),
        Finding::Color { name, linear } => named(ui, name, &mut |ui| color(ui, *linear)),
        Finding::Why(why) => {
            ui.add(Label::new(why).wrap());
        }
        Finding::Around(_) | Finding::Sketch(_) => {}
    }
}

/// A swatch with the numbers beside it.
fn color(ui: &mut Ui, linear: [f32; 3]) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let (rect, _) = ui.allocate_exact_size(vec2(16.0, 12.0), Sense::hover());
        let edge = ui.visuals().widgets.noninteractive.bg_stroke;
        ui.painter().rect(rect, 2.0, drawing::screen(linear), edge, egui::StrokeKind::Inside);
        let [r, g, b] = linear;
        ui.label(format!("{r:.3} {g:.3} {b:.3}"));
    });
}

/// The values of the node's ports at the pixel, as plain numbers.
fn numbers(ui: &mut Ui, visit: &Visit) {
    for (port, value) in &visit.values {
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new(port).weak().small());
            ui.label(RichText::new(value).monospace().size(11.0).color(muted(ui)));
        });
    }
}

fn muted(ui: &Ui) -> Color32 {
    ui.visuals().text_color().gamma_multiply(0.85)
}
