//! Names of widgets for screen readers.

use egui::{Response, WidgetInfo, WidgetType};

/// Names a widget whose own text does not describe it.
pub trait Named {
    /// Sets the name to `name`.
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
