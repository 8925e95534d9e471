//! Spacing and colours, of a dark and a light theme.
//!
//! All text has a contrast of at least 4.5 to its background; a test checks every pair.

use egui::{Color32, Context, CornerRadius, Stroke, Theme, Ui, Visuals, vec2};

/// Colours with a meaning.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// Errors.
    pub bad: Color32,
    /// The selected or focused item.
    pub accent: Color32,
    /// Runs on the CPU.
    pub cpu: Color32,
    /// Runs on the GPU.
    pub gpu: Color32,
    /// Differs from the base.
    pub changed: Color32,
}

const DARK: Palette = Palette {
    bad: Color32::from_rgb(250, 110, 110),
    accent: Color32::from_rgb(90, 170, 250),
    cpu: Color32::from_rgb(110, 165, 220),
    gpu: Color32::from_rgb(130, 195, 120),
    changed: Color32::from_rgb(214, 150, 245),
};

const LIGHT: Palette = Palette {
    bad: Color32::from_rgb(180, 24, 24),
    accent: Color32::from_rgb(0, 92, 170),
    cpu: Color32::from_rgb(28, 96, 160),
    gpu: Color32::from_rgb(36, 112, 28),
    changed: Color32::from_rgb(122, 40, 158),
};

/// Marks the selected item.
pub const ACCENT: Color32 = DARK.accent;
/// Nodes that run on the CPU.
pub const CPU: Color32 = DARK.cpu;
/// Nodes that run on the GPU.
pub const GPU: Color32 = DARK.gpu;

/// The colours of the theme in use.
pub fn palette(ui: &Ui) -> &'static Palette {
    palette_of(ui.visuals())
}

/// The colours of these visuals' theme.
pub fn palette_of(visuals: &Visuals) -> &'static Palette {
    if visuals.dark_mode { &DARK } else { &LIGHT }
}

/// Sets both themes up.
pub fn apply(context: &Context) {
    context.all_styles_mut(|style| {
        style.spacing.item_spacing = vec2(8.0, 5.0);
        style.spacing.button_padding = vec2(7.0, 3.0);
        style.spacing.slider_width = 84.0;
        // Buttons, sliders and boxes in a row have the same height.
        style.spacing.interact_size.y = 22.0;
        style.spacing.combo_width = 60.0;
        // Short animations, which disturb less while a graph runs.
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
    for theme in [Theme::Dark, Theme::Light] {
        context.style_mut_of(theme, |style| color(&mut style.visuals));
    }
}

/// Egui's own colours where their contrast is too low, and the colours with a meaning.
fn color(visuals: &mut Visuals) {
    let palette = palette_of(visuals);
    let gray = Color32::from_gray;
    let [text, weak, button, warning] = if visuals.dark_mode {
        [gray(190), gray(146), gray(205), Color32::from_rgb(255, 165, 60)]
    } else {
        [gray(45), gray(92), gray(35), Color32::from_rgb(140, 72, 0)]
    };
    visuals.widgets.noninteractive.fg_stroke.color = text;
    visuals.widgets.inactive.fg_stroke.color = button;
    visuals.weak_text_color = Some(weak);
    visuals.hyperlink_color = palette.accent;
    visuals.error_fg_color = palette.bad;
    visuals.warn_fg_color = warning;
    // Egui draws the focused widget like the active one: give it a conspicuous frame.
    visuals.widgets.active.bg_stroke = Stroke::new(2.0, palette.accent);
    visuals.selection.stroke.color =
        if visuals.dark_mode { Color32::from_rgb(205, 228, 255) } else { Color32::from_rgb(0, 48, 84) };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least contrast of text: level AA of the Web Content Accessibility Guidelines 2.2, 1.4.3.
    const CONTRAST: f32 = 4.5;

    /// Relative luminance (WCAG 2.2) of an opaque colour.
    fn luminance(color: Color32) -> f32 {
        let [r, g, b, _] = color.to_array().map(egui::ecolor::linear_f32_from_gamma_u8);
        epigraph_stages::shared::color::luminance([r, g, b])
    }

    fn contrast(a: Color32, b: Color32) -> f32 {
        let [a, b] = [a, b].map(|color| luminance(color) + 0.05);
        a.max(b) / a.min(b)
    }

    #[test]
    fn contrast_is_computed_as_in_the_guidelines() {
        assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-3);
        // The lightest grey with enough contrast on white.
        assert!(contrast(Color32::from_gray(118), Color32::WHITE) > CONTRAST);
        assert!(contrast(Color32::from_gray(119), Color32::WHITE) < CONTRAST);
    }

    #[test]
    fn all_text_has_enough_contrast_in_both_themes() {
        let context = Context::default();
        apply(&context);
        for theme in [Theme::Dark, Theme::Light] {
            let visuals = context.style_of(theme).visuals.clone();
            let palette = palette_of(&visuals);
            let grounds = [
                ("panel", visuals.panel_fill),
                ("window", visuals.window_fill),
                ("field", visuals.extreme_bg_color),
                ("stripe", visuals.panel_fill.blend(visuals.faint_bg_color)),
            ];
            let texts = [
                ("text", visuals.text_color()),
                ("weak text", visuals.weak_text_color()),
                ("strong text", visuals.strong_text_color()),
                ("link", visuals.hyperlink_color),
                ("error", visuals.error_fg_color),
                ("warning", visuals.warn_fg_color),
                ("bad", palette.bad),
                ("accent", palette.accent),
                ("cpu", palette.cpu),
                ("gpu", palette.gpu),
                ("changed", palette.changed),
            ];
            let mut pairs: Vec<(String, Color32, Color32)> = Vec::new();
            for (on, ground) in grounds {
                pairs.extend(texts.map(|(name, text)| (format!("{name} on {on}"), text, ground)));
            }
            let widgets = &visuals.widgets;
            for (name, widget) in [
                ("button", widgets.inactive),
                ("hovered", widgets.hovered),
                ("active", widgets.active),
                ("open", widgets.open),
            ] {
                pairs.push((name.into(), widget.text_color(), widget.weak_bg_fill));
                pairs.push((format!("{name} box"), widget.text_color(), widget.bg_fill));
            }
            pairs.push(("selection".into(), visuals.selection.stroke.color, visuals.selection.bg_fill));
            for (name, text, ground) in pairs {
                let contrast = contrast(text, ground);
                assert!(contrast >= CONTRAST, "{theme:?}, {name}: {contrast:.2}, {text:?} on {ground:?}");
            }
        }
    }
}
