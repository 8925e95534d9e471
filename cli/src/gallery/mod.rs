//! `epigraph gallery`: a page of pictures that shows the steps of the algorithm for each scene, with the command lines
//! that reproduce them.

mod canvas;
mod draw;
mod folder;
mod page;
mod shot;
mod window;

use std::{path::Path, sync::Arc};

use epigraph::{Device, Place, Registry};
use epigraph_core::GraphFile;
use epigraph_pictures::{Difference, png, tone};
use epigraph_scenes::{CameraPath, Tracer};

use self::{
    draw::Panel,
    folder::Folder,
    page::{Page, Section},
    shot::{Camera, Shot},
    window::Window,
};
use crate::{
    args::{ChangeArgs, GalleryArgs},
    bench::{SCENES, needs_fetch},
    error::CliError,
    open,
    output::print,
    reference, sheet,
    values::Light,
};

/// File name of the page.
const PAGE: &str = "gallery.md";

/// Makes the gallery. Files are written only after all pictures are rendered.
pub fn gallery(args: &GalleryArgs, registry: &Arc<Registry>) -> Result<(), CliError> {
    let folder = Folder::new(&args.out)?;
    let gallery = Gallery::new(args, registry)?;
    let mut files = Vec::new();
    let mut sections: Vec<Section> = Vec::new();
    let by_default = args.scene.is_empty();
    let named = args.scene.iter().map(String::as_str);
    let scenes: Vec<&str> = if by_default { SCENES.into() } else { named.collect() };
    for scene in scenes {
        let place = match open::place(scene, &args.camera) {
            // A default scene whose mesh is not fetched is skipped; one that the user names must load.
            Err(error) if by_default && needs_fetch(scene) => {
                eprintln!("note: skipping scene {scene}: {error}");
                continue;
            }
            place => place?,
        };
        let section = gallery.scene(scene, &place, &mut files)?;
        if let Some(same) = sections.iter().find(|other| other.name == section.name) {
            let text =
                format!("--scene {scene}: its pictures would have the same names as those of {}", same.scene);
            return Err(CliError::Input(text));
        }
        sections.push(section);
    }
    let page = Page { args, side: gallery.device.side, samples: gallery.samples, sections: &sections };
    files.push((PAGE.to_owned(), page.markdown().into_bytes()));
    folder.write(&files)?;
    let bytes: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    print(&format!(
        "pictures  {}\nsize      {:.1} MB\npage      {}\n",
        files.len() - 1,
        bytes as f64 / 1e6,
        args.out.join(PAGE).display()
    ))
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

    /// Makes the section of one scene and adds its pictures to `files`.
    fn scene(
        &self,
        name: &str,
        place: &Place,
        files: &mut Vec<(String, Vec<u8>)>,
    ) -> Result<Section, CliError> {
        let tracer = open::tracer(place);
        let camera = Camera {
            label: name,
            registry: self.registry,
            device: &self.device,
            place,
            args: self.args,
            samples: self.samples,
        };
        let epi = camera.dissect(&self.epi)?;
        let cache = camera.shoot(&self.cache)?;
        let converged = self.converged(&tracer.at(self.args.frames - 1), &place.path)?;

        let window = match self.args.crop {
            Some(crop) => Window::at(crop, epi.layers.size),
            None => Window::choose(&epi),
        };
        let section = Section::new(
            name,
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
        let pictures = [
            (section.picture(), whole(&epi.shot)),
            (section.cache_picture(&self.args.beside), whole(&cache)),
            (section.stages(), sheet::sheet(&stages)),
            (section.close_ups(), sheet::sheet(&close_ups)),
        ];
        for (name, (size, colors)) in pictures {
            let png = png(size, &colors);
            files.push((name.clone(), png.map_err(|error| CliError::write(Path::new(&name), error))?));
        }
        Ok(section)
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
