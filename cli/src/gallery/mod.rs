//! `epigraph gallery`: a page of pictures that shows the steps of the algorithm for each scene, with the command lines
//! that reproduce them.

mod canvas;
mod draw;
mod page;
mod shot;
mod window;

use std::sync::Arc;

use epigraph::{Device, Place, Registry};
use epigraph_core::GraphFile;
use epigraph_pictures::{Difference, png, tone};
use epigraph_scenes::{CameraPath, Tracer};

use self::{
    draw::Panel,
    page::{Names, Page, Section},
    shot::{Camera, Shot},
    window::Window,
};
use crate::{
    args::{ChangeArgs, GalleryArgs},
    bench::{SCENES, needs_fetch},
    error::CliError,
    folder::Folder,
    open,
    output::{Output, Outputs, print},
    reference, sheet,
    values::Light,
};

/// File name of the page.
const PAGE: &str = "gallery.md";

/// Makes the gallery. All files take their places together, when all pictures are rendered.
pub fn gallery(args: &GalleryArgs, registry: &Arc<Registry>) -> Result<(), CliError> {
    let folder = Folder::new(&args.out)?;
    let gallery = Gallery::new(args, registry)?;
    let mut outputs = Outputs::default();
    let scenes = gallery.load(&folder, &mut outputs)?;
    let page = outputs.add("--out", &folder.file(PAGE))?;
    let mut outputs = outputs.ready()?;
    let (mut sections, mut count, mut bytes) = (Vec::new(), 0, 0);
    for loaded in scenes {
        let (section, pictures) = gallery.scene(&loaded)?;
        for (file, (size, colors)) in loaded.files.into_iter().zip(pictures) {
            let png = png(size, &colors).map_err(|error| CliError::write(outputs.path(file), error))?;
            outputs.put(file, &png)?;
            count += 1;
            bytes += png.len();
        }
        sections.push(section);
    }
    let Gallery { samples, device, .. } = &gallery;
    let text = Page { args, side: device.side, samples: *samples, sections: &sections }.markdown();
    outputs.put(page, text.as_bytes())?;
    outputs.commit()?;
    print(&format!(
        "pictures  {count}\nsize      {:.1} MB\npage      {}\n",
        (bytes + text.len()) as f64 / 1e6,
        folder.file(PAGE).display()
    ))
}

/// Width and height of a picture, and its sRGB colours.
type Drawn = ([usize; 2], Vec<[u8; 3]>);

/// A scene of the gallery.
struct Loaded {
    scene: String,
    place: Place,
    names: Names,
    /// In the order of the names.
    files: [Output; 4],
}

/// The settings shared by all scenes.
struct Gallery<'a> {
    args: &'a GalleryArgs,
    registry: &'a Arc<Registry>,
    epi: GraphFile,
    cache: GraphFile,
    device: Device,
    /// Maximum number of samples per frame.
    samples: u32,
}

impl<'a> Gallery<'a> {
    fn new(args: &'a GalleryArgs, registry: &'a Arc<Registry>) -> Result<Self, CliError> {
        let samples = open::samples(args.samples, args.size.0)?;
        Window::check(args.crop, args.size.0).map_err(CliError::Input)?;
        let graph = |name: &str| open::graph(name, &ChangeArgs::default(), registry);
        let (epi, cache) = (graph(&args.graph)?, graph(&args.beside)?);
        let device = Device::open(args.backend)?;
        Ok(Self { args, registry, epi, cache, device, samples })
    }

    /// Loads the scenes, names their pictures, and checks that the graphs compile for them.
    fn load(&self, folder: &Folder, outputs: &mut Outputs) -> Result<Vec<Loaded>, CliError> {
        let GalleryArgs { scene, camera, beside, .. } = self.args;
        let by_default = scene.is_empty();
        let named = scene.iter().map(String::as_str);
        let scenes: Vec<&str> = if by_default { SCENES.into() } else { named.collect() };
        let mut all: Vec<Loaded> = Vec::new();
        for scene in scenes {
            let place = match open::place(scene, camera) {
                // A default scene whose mesh is not fetched is skipped; one that the user names must load.
                Err(error) if by_default && needs_fetch(scene) => {
                    eprintln!("note: skipping scene {scene}: {error}");
                    continue;
                }
                place => place?,
            };
            let names = Names::new(scene, beside);
            if let Some(same) = all.iter().find(|other| other.names.prefix == names.prefix) {
                let text = format!(
                    "--scene {scene}: its pictures would have the same names as those of {}",
                    same.scene
                );
                return Err(CliError::Input(text));
            }
            for graph in [&self.epi, &self.cache] {
                self.camera(scene, &place).check(graph)?;
            }
            let [picture, other, stages, close_ups] =
                names.all().map(|name| outputs.add("--out", &folder.file(name)));
            let files = [picture?, other?, stages?, close_ups?];
            all.push(Loaded { scene: scene.to_owned(), place, names, files });
        }
        Ok(all)
    }

    fn camera<'b>(&'b self, scene: &'b str, place: &'b Place) -> Camera<'b> {
        let Self { args, registry, device, samples, .. } = self;
        Camera { label: scene, registry, device, place, args, samples: *samples }
    }

    /// The section of one scene, and its pictures in the order of their names.
    fn scene(&self, loaded: &Loaded) -> Result<(Section, [Drawn; 4]), CliError> {
        let Loaded { scene, place, names, .. } = loaded;
        let tracer = open::tracer_of_surfaces(place)?;
        let camera = self.camera(scene, place);
        let epi = camera.dissect(&self.epi)?;
        let cache = camera.shoot(&self.cache)?;
        let converged = self.converged(&tracer.at(self.args.frames - 1), &place.path)?;

        let window = match self.args.crop {
            Some(crop) => Window::at(crop, epi.layers.size),
            None => Window::choose(&epi),
        };
        let section = Section::new(
            scene,
            names.clone(),
            window,
            &epi.layers,
            [&cache, &epi.shot].map(|shot| Difference::new(&converged.picture(), &shot.picture()).flip()),
        );
        let stages = Panel::ALL.map(|panel| panel.draw(window, &epi));
        let detail = |label: &str, shot: &Shot| draw::magnified(label, window, shot);
        let close_ups = [
            detail(&page::words(&self.args.beside), &cache),
            detail(&page::words(&self.args.graph), &epi.shot),
            detail("reference", &converged),
        ];
        let whole = |shot: &Shot| (shot.size, shot.colors.clone());
        let pictures = [whole(&epi.shot), whole(&cache), sheet::sheet(&stages), sheet::sheet(&close_ups)];
        Ok((section, pictures))
    }

    /// The reference: the last frame with many samples per pixel.
    fn converged(&self, tracer: &Tracer, path: &CameraPath) -> Result<Shot, CliError> {
        let size = self.args.size.0;
        reference::require_memory(size)?;
        let settings = reference::trace_settings(Light::Direct);
        let camera = path.camera(self.args.frames - 1);
        let colors =
            reference::trace("tracing", tracer, &camera, size, self.args.spp, &settings, self.args.seed)?;
        let colors = colors.into_iter().map(tone::to_srgb8).collect();
        Ok(Shot { size: size.map(|side| side as usize), colors })
    }
}
