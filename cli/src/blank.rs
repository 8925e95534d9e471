//! Words about a picture that is all black or all white.

use epigraph_scenes::{Camera, Mode, TraceSettings, Tracer, reference};

/// The share of black pixels in a picture that shows nothing, and of white ones among the others.
const MOST: f64 = 0.999;
const MOST_SHOWN: f64 = 0.95;
/// The brightest byte that looks black.
const BLACK: u8 = 2;
/// The side of the image that is traced to find out why.
const SIDE: u32 = 32;
/// Paths of each of its pixels.
const PATHS: u32 = 4;
/// The radiance that a picture shows as a middle grey.
const GREY: f32 = 0.18;

/// Why a picture of a scene, in sRGB bytes, shows nothing; `None` if it shows something.
pub fn why(colors: &[[u8; 3]], tracer: &Tracer, camera: &Camera, size: [u32; 2]) -> Option<String> {
    let count = |is: fn(&[u8; 3]) -> bool| colors.iter().filter(|color| is(color)).count() as f64;
    let shown = count(|color| color.iter().any(|&byte| byte > BLACK));
    let is_black = shown <= (1.0 - MOST) * colors.len() as f64;
    // Around what is too bright, there may be a black background.
    let is_white = !is_black && count(|color| color.iter().all(|&byte| byte == 255)) >= MOST_SHOWN * shown;
    if !is_black && !is_white {
        return None;
    }
    let color = if is_black { "black" } else { "white" };
    Some(format!("the picture is {color}: {}", cause(tracer, camera, size, is_black)))
}

fn cause(tracer: &Tracer, camera: &Camera, size: [u32; 2], is_black: bool) -> String {
    if !sees_surfaces(tracer, camera, size) {
        return "the camera sees no surface; another --camera may, such as orbit".into();
    }
    let settings = TraceSettings { mode: Mode::Direct, ..TraceSettings::default() };
    let colors =
        reference::render(tracer, camera, size.map(|side| side.min(SIDE)), PATHS, &settings, 0, &|| true);
    let colors = colors.unwrap_or_default();
    let mean = colors.iter().map(|color| color.element_sum() / 3.0).sum::<f32>() / colors.len().max(1) as f32;
    let exposure = (GREY / mean).log2().clamp(-24.0, 24.0);
    let tip = format!(
        "the mean radiance is {mean:.1e}; try --set tonemap.exposure={exposure:.0} or Auto, which fits the picture"
    );
    match mean {
        0.0 if tracer.scene().lights.is_empty() => {
            "no surface that the camera sees emits light, and none lights it".into()
        }
        0.0 => {
            "no light reaches what the camera sees; --set trace.mode=Path also follows light around corners"
                .into()
        }
        mean if is_black && mean < GREY / 64.0 => format!("it is dim, {tip}"),
        mean if !is_black && mean > 1.0 => format!("it is bright, {tip}"),
        _ => "but its samples are not, so that the graph's stages lost them; --sheet shows where".into(),
    }
}

/// Whether rays through an even grid of pixels meet a surface.
fn sees_surfaces(tracer: &Tracer, camera: &Camera, size: [u32; 2]) -> bool {
    (0..SIDE * SIDE).any(|index| {
        let [x, y] = [index % SIDE, index / SIDE].map(|k| (k as f32 + 0.5) / SIDE as f32);
        let direction = camera.direction(x * size[0] as f32, y * size[1] as f32, size);
        let mut random = epigraph_scenes::Rng::new(0, index.into());
        tracer.trace(camera.eye, direction, &TraceSettings::default(), &mut random).hit
    })
}
