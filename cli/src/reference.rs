//! `epigraph reference`: a picture with many samples for each pixel.

use std::{path::Path, sync::Arc, time::Instant};

use epigraph_scenes::{CameraPath, Mode, Scene, TraceSettings, Tracer, reference};

use crate::{
    args::{ReferenceArgs, SceneArgs},
    error::CliError,
    image_file::{self, Kinds},
    memory,
    output::{Target, print},
    progress, tone,
    values::Light,
};

/// Bytes that a pixel takes while it is traced and encoded.
const BYTES_PER_PIXEL: u64 = 48;

/// Reads the scene and the camera's path through it.
pub fn load_scene(args: &SceneArgs) -> Result<(Arc<Scene>, CameraPath), CliError> {
    let scene = progress::spinner(format!("loading scene {}", args.scene), || Scene::load(&args.scene))?;
    let path = CameraPath::parse(&args.camera, &scene)?;
    Ok((Arc::new(scene), path))
}

/// Traces and writes the picture.
pub fn reference(args: &ReferenceArgs) -> Result<(), CliError> {
    let kind = Kinds::of_picture(&args.out)?;
    let target = Target::new(&args.out)?;
    let size = args.scene.size.0;
    memory::require(u64::from(size[0]) * u64::from(size[1]) * BYTES_PER_PIXEL)?;
    let (scene, path) = load_scene(&args.scene)?;
    let tracer = progress::spinner("building the tracer".into(), || Tracer::new(scene));
    let mode = match args.mode {
        Light::Direct => Mode::Direct,
        Light::Path => Mode::Path,
    };
    let settings = TraceSettings { mode, ..TraceSettings::default() };

    let bar = progress::bar(size[1].into(), "tracing", "rows");
    let start = Instant::now();
    let camera = path.camera(args.frame);
    let colors =
        reference::render(&tracer, &camera, size, args.spp, &settings, args.seed.into(), &|_| bar.inc(1));
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();

    let colors: Vec<[f32; 3]> = colors.into_iter().map(Into::into).collect();
    target.write(&encode(kind, size.map(|side| side as usize), &colors, target.path())?)?;
    let samples = f64::from(size[0]) * f64::from(size[1]) * f64::from(args.spp);
    print(&format!(
        "{} samples a pixel in {seconds:.1} s, {:.2} million samples a second\npicture: {}\n",
        args.spp,
        samples / seconds / 1e6,
        args.out.display()
    ))
}

/// A picture of linear colours as a file's bytes.
fn encode(kind: Kinds, size: [usize; 2], colors: &[[f32; 3]], path: &Path) -> Result<Vec<u8>, CliError> {
    if kind == Kinds::Exr {
        return image_file::exr_of_colors(size, colors).map_err(|cause| CliError::write(path, cause));
    }
    let bytes: Vec<[u8; 3]> = colors.iter().copied().map(tone::to_srgb8).collect();
    image_file::png(size, &bytes).map_err(|error| CliError::write(path, error))
}
