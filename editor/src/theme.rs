//! Spacing and colours.

use egui::{Color32, Context, CornerRadius, vec2};

/// Says: wrong.
pub const BAD: Color32 = Color32::from_rgb(240, 92, 92);
/// Says: this is the one in use.
pub const ACCENT: Color32 = Color32::from_rgb(90, 170, 250);
/// Nodes that run on the CPU.
pub const CPU: Color32 = Color32::from_rgb(110, 165, 220);
/// Nodes that run on the GPU.
pub const GPU: Color32 = Color32::from_rgb(130, 195, 120);

/// Sets both themes up.
pub fn apply(context: &Context) {
    context.all_styles_mut(|style| {
        style.spacing.item_spacing = vec2(8.0, 5.0);
        style.spacing.button_padding = vec2(7.0, 3.0);
        style.spacing.slider_width = 84.0;
        // Buttons, sliders and boxes in a row are of one height.
        style.spacing.interact_size.y = 22.0;
        style.spacing.combo_width = 60.0;
        // Plain steps where sliders snap, and no surprise while a graph runs.
        style.animation_time = 0.06;
        let radius = CornerRadius::same(3);
        for widget in [
            &mut style.visuals.widgets.inactive,
            &mut style.visuals.widgets.hovered,
            &mut style.visuals.widgets.active,
            &mut style.visuals.widgets.open,
        ] {
            widget.corner_radius = radius;
        }
    });
}
