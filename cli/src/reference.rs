//! `epigraph reference`: traces a picture with many samples per pixel.

use std::{path::Path, time::Instant};

use epigraph::memory;
use epigraph_pictures::{Kind, exr, png, tone};
use epigraph_scenes::{Camera, Mode, TraceSettings, Tracer, reference};

use crate::{
    args::ReferenceArgs,
    blank, edge_mask,
    error::CliError,
    interrupt, open,
    output::{Output, Outputs, print},
    progress,
    values::Light,
};

/// Bytes per pixel during tracing and encoding.
const BYTES_PER_PIXEL: u64 = 48;

/// Traces and writes the picture.
pub fn reference(args: &ReferenceArgs) -> Result<(), CliError> {
    let kind = Kind::of_picture(&args.out)?;
    let mut outputs = Outputs::default();
    let out = outputs.add("--out", &args.out)?;
    let edges = args.edges.as_deref().map(|path| add_mask(&mut outputs, path)).transpose()?;
    let size = args.scene.size.0;
    require_memory(size)?;
    let place = open::place_of(&args.scene)?;
    let mut outputs = outputs.ready()?;
    let tracer = open::tracer_of_surfaces(&place)?.at(args.frame);
    let settings = trace_settings(args.mode);

    let start = Instant::now();
    let camera = place.path.camera(args.frame);
    let colors = trace("tracing", &tracer, &camera, size, args.spp, &settings, args.seed)?;
    let seconds = start.elapsed().as_secs_f64();

    outputs.put(out, &encode(kind, size.map(|side| side as usize), &colors, &args.out)?)?;
    let samples = f64::from(size[0]) * f64::from(size[1]) * f64::from(args.spp);
    let mut text = format!(
        "{} samples per pixel in {seconds:.1} s, {:.2} million samples per second\npicture: {}\n",
        args.spp,
        samples / seconds / 1e6,
        args.out.display()
    );
    if let Some(edges) = edges {
        let mask = edge_mask::trace(&tracer, &camera, size);
        let png = edge_mask::png(&mask, size.map(|side| side as usize));
        outputs.put(edges, &png.map_err(|error| CliError::write(outputs.path(edges), error))?)?;
        let share = 100.0 * edge_mask::share(&mask);
        text += &format!("edges: {}, {share:.1}% of the pixels\n", outputs.path(edges).display());
    }
    outputs.commit()?;
    print(&text)?;
    let shown: Vec<[u8; 3]> = colors.iter().copied().map(tone::to_srgb8).collect();
    if let Some(why) = blank::why(&shown, &tracer, &camera, size) {
        eprintln!("warning: {why}");
    }
    Ok(())
}

/// The tracing settings of a reference with this light transport.
pub fn trace_settings(light: Light) -> TraceSettings {
    let mode = match light {
        Light::Direct => Mode::Direct,
        Light::Path => Mode::Path,
    };
    TraceSettings { mode, ..TraceSettings::default() }
}

fn add_mask(outputs: &mut Outputs, path: &Path) -> Result<Output, CliError> {
    match Kind::of(path)? {
        Kind::Png => outputs.add("--edges", path),
        _ => Err(CliError::write(path, "the mask is written as PNG; name it FILE.png")),
    }
}

/// Checks that there is enough memory for a picture.
pub fn require_memory(size: [u32; 2]) -> Result<(), CliError> {
    Ok(memory::require(u64::from(size[0]) * u64::from(size[1]) * BYTES_PER_PIXEL)?)
}

/// The linear colours of a picture with `spp` samples per pixel, rows from the top. `label` is shown at the progress
/// bar.
///
/// # Errors
/// [`CliError::Interrupted`].
pub fn trace(
    label: &str,
    tracer: &Tracer,
    camera: &Camera,
    size: [u32; 2],
    spp: u32,
    settings: &TraceSettings,
    seed: u32,
) -> Result<Vec<[f32; 3]>, CliError> {
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let bar = progress::bar(pixels, label, "pixels");
    let pixel_done = || {
        bar.inc(1);
        !interrupt::asked()
    };
    let colors = reference::render(tracer, camera, size, spp, settings, seed.into(), &pixel_done);
    bar.finish_and_clear();
    let colors = colors.ok_or(CliError::Interrupted)?;
    Ok(colors.into_iter().map(Into::into).collect())
}

/// Encodes a picture of linear colours as a file.
fn encode(kind: Kind, size: [usize; 2], colors: &[[f32; 3]], path: &Path) -> Result<Vec<u8>, CliError> {
    if kind == Kind::Exr {
        return exr(size, colors).map_err(|cause| CliError::write(path, cause));
    }
    let bytes: Vec<[u8; 3]> = colors.iter().copied().map(tone::to_srgb8).collect();
    png(size, &bytes).map_err(|error| CliError::write(path, error))
}
