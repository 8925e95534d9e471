//! A window of a program with stages of its own.

use egui_kittest::kittest::Queryable;
use epigraph_core::{CpuContext, Extent, In, Io, Out, Stage, params, texel};

use crate::support::Opened;

params! {
    /// Parameters of [`Negative`].
    struct NegativeParams {
        /// The value that becomes black.
        white: f32 = 1.0, in 0.0..=10.0;
    }
}

/// A stage that can stand in for `tonemap`, with the same ports and other parameters.
struct Negative {
    color: In<texel::Rgba32Float>,
    image: Out<texel::Rgba8Unorm>,
}

impl Stage for Negative {
    const KIND: &'static str = "negative";
    const DOC: &'static str = "Shows dark as light.";
    type Params = NegativeParams;

    fn declare(_: &NegativeParams, io: &mut Io) -> Self {
        Self {
            color: io.read("color", "Linear radiance.", Extent::Frame(1)),
            image: io.write("image", "The negative.", Extent::Frame(1)),
        }
    }

    fn cpu(&self, params: &NegativeParams, cx: &CpuContext) -> Result<(), String> {
        let (color, mut image) = (cx.read(self.color), cx.write(self.image));
        for (image, color) in image.iter_mut().zip(color.iter()) {
            *image = color.map(|value| ((1.0 - value / params.white).clamp(0.0, 1.0) * 255.0) as u8);
        }
        Ok(())
    }
}

/// Swaps `tonemap` for `negative` by `swap`, which gets a window. The parameter that only `tonemap` has must go.
#[track_caller]
fn swapped(swap: impl FnOnce(&mut Opened)) {
    let mut opened = Opened::with_stages("render-cache.ron", epigraph::registry().with::<Negative>());
    let path = opened.app().session.document.path().to_owned();
    let before = opened.text().replace("kind: \"tonemap\",", "kind: \"tonemap\", params: (exposure: 1.0),");
    opened.harness.state_mut().session.document.type_text(&path, &before);
    opened.frames(2);
    swap(&mut opened);
    opened.frames(1);
    let after = opened.text();
    assert!(after.contains("kind: \"negative\"") && !after.contains("exposure"), "{after}");
    assert_eq!(opened.app().session.problems(), []);
    let graph = opened.app().session.state.graph.clone().unwrap();
    assert_eq!(graph.node("tonemap").map(|node| node.kind.as_str()), Some("negative"));
    opened.click("Undo");
    assert_eq!(opened.text(), before);
}

#[test]
fn parameters_swap_for_a_stage_of_the_programs_own() {
    swapped(|opened| {
        opened.click("tonemap");
        opened.pick("stage", "negative");
    });
}

#[test]
fn the_canvas_swaps_for_a_stage_of_the_programs_own() {
    swapped(|opened| {
        opened.click("Canvas");
        opened.harness.get_by_label("node tonemap").click_secondary();
        opened.harness.run_steps(4);
        opened.harness.get_by_label_contains("Swap for").click();
        opened.harness.run_steps(4);
        opened.click("negative");
    });
}

/// Hands on colours; one is not a number from frame 2 on.
struct Spoil {
    color: In<texel::Rgba32Float>,
    spoiled: Out<texel::Rgba32Float>,
}

impl Stage for Spoil {
    const KIND: &'static str = "spoil";
    const DOC: &'static str = "Spoils one colour.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        Self {
            color: io.read("color", "Linear radiance.", Extent::Frame(1)),
            spoiled: io.write("spoiled", "The same, but for one pixel.", Extent::Frame(1)),
        }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let mut spoiled = cx.write(self.spoiled);
        spoiled.copy_from_slice(&cx.read(self.color));
        if cx.frame().index >= 2 {
            spoiled[64 * 9 + 11][2] = f32::INFINITY;
        }
        Ok(())
    }
}

#[test]
fn the_window_pauses_at_the_first_bad_number_and_shows_node_and_pixel() {
    let mut opened = Opened::with_stages("render-cache.ron", epigraph::registry().with::<Spoil>());
    let path = opened.app().session.document.path().to_owned();
    let spoil =
        "\"spoil\": (kind: \"spoil\", inputs: { \"color\": \"fill.color\" }),\n        \"tonemap\": (";
    let text = opened.text().replace("\"tonemap\": (", spoil).replacen(
        "inputs: { \"color\": \"fill.color\" },\n        ),\n    },",
        "inputs: { \"color\": \"spoil.spoiled\" },\n        ),\n    },",
        1,
    );
    assert!(text.contains("spoil.spoiled"), "{text}");
    opened.harness.state_mut().session.document.type_text(&path, &text);
    opened.frames(1);
    opened.choose(&["Output", "Pause at the first bad number"]);
    opened.click("▶ Run");
    opened.until("the bad number", |app| app.session.state.bad.is_some());
    opened.settle(4);
    let session = &opened.app().session;
    assert!(session.state.paused);
    assert_eq!(session.selected.as_deref(), Some("spoil"));
    assert_eq!(session.inspection.pixel(), Some([11, 9]));
    assert!(session.state.fields("spoil.spoiled").next().is_some(), "the port is shown");
    assert!(opened.harness.query_by_label_contains("`spoil.spoiled`, pixel (11, 9)").is_some());
}
