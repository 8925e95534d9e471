//! Names of widgets for those who hear the window rather than see it.

use egui::{Response, WidgetInfo, WidgetType};

/// Names a widget that carries no text of its own that says what it is for.
pub trait Named {
    /// Calls it `name`.
    #[must_use = "the response says what the user did"]
    fn named(self, kind: WidgetType, name: &str) -> Self;
}

impl Named for Response {
    fn named(self, kind: WidgetType, name: &str) -> Self {
        let enabled = self.enabled();
        self.widget_info(|| WidgetInfo::labeled(kind, enabled, name));
        self
    }
}
