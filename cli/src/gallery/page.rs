//! The gallery's page.

use std::{fmt::Write as _, path::Path};

use epigraph_core::Side;
use epigraph_stages::shared::edge_pixel::{CLASS, COMPLEX, SIMPLE};

use super::{CACHE, EPI, shot::Layers, window::Window};
use crate::{args::GalleryArgs, values::Size};

/// What the page says of a scene.
pub struct Section {
    /// The beginning of the names of its files.
    pub name: String,
    /// The scene as it was asked for.
    pub scene: String,
    /// What is enlarged.
    window: Window,
    /// Shares of all pixels: with a point; empty, simple, complex.
    points: f64,
    classes: [f64; 3],
    /// Mean FLIP of the render cache and of the edge-and-point image.
    flip: [f64; 2],
}

impl Section {
    /// Of the scene's last frame.
    pub fn new(scene: &str, window: Window, layers: &Layers, flip: [f64; 2]) -> Self {
        let pixels = layers.points.len().max(1) as f64;
        let share =
            |class: u32| layers.cls.iter().filter(|&cls| cls & CLASS == class).count() as f64 / pixels;
        let (simple, complex) = (share(SIMPLE), share(COMPLEX));
        Self {
            name: file_name(scene),
            scene: scene.to_owned(),
            window,
            points: layers.points.iter().flatten().count() as f64 / pixels,
            classes: [1.0 - simple - complex, simple, complex],
            flip,
        }
    }

    /// The file of the edge-and-point image.
    pub fn picture(&self) -> String {
        format!("{}.png", self.name)
    }

    /// The file of the render cache's picture.
    pub fn cache_picture(&self) -> String {
        format!("{}-render-cache.png", self.name)
    }

    /// The file with the steps.
    pub fn stages(&self) -> String {
        format!("{}-stages.png", self.name)
    }

    /// The file with the same pixels of both, and of the reference.
    pub fn close_ups(&self) -> String {
        format!("{}-close-up.png", self.name)
    }
}

/// The scene's name, or that of its file, as the beginning of file names: without what file names and links cannot hold.
fn file_name(scene: &str) -> String {
    let stem = Path::new(scene).file_stem().unwrap_or_default().to_string_lossy();
    let safe = |letter: char| if letter.is_alphanumeric() || letter == '_' { letter } else { '-' };
    stem.chars().map(safe).collect()
}

/// Everything that the page says.
pub struct Page<'a> {
    /// The command line.
    pub args: &'a GalleryArgs,
    /// Where the nodes ran.
    pub side: Side,
    /// Samples that a frame could ask for.
    pub samples: u32,
    /// The scenes.
    pub sections: &'a [Section],
}

impl Page<'_> {
    /// The page as Markdown.
    pub fn markdown(&self) -> String {
        let mut page = self.head();
        for section in self.sections {
            self.section(&mut page, section);
        }
        page
    }

    fn head(&self) -> String {
        let Size([width, height]) = self.args.size;
        let GalleryArgs { frames, samples: asked, camera, spp, .. } = self.args;
        let samples = self.samples;
        format!(
            "# Gallery

Every picture below is frame {frames} of a moving camera (`{camera}`) at {width}x{height}, from {samples} ray-traced \
samples a frame ({asked}). `epigraph gallery` made this page, its pictures and its figures:

```sh
{all}
```

where `epigraph` is `cargo run --release --` in the repository. **The steps** enlarge {side}x{side} pixels of the \
edge-and-point image, in the order of the algorithm:

- *points*: samples of earlier frames, moved to where the camera sees them now. Dark blue pixels have none.
- *edges*: silhouettes and creases (blue) and shadow boundaries (orange), found from the mesh alone. They are kept as \
crossings with the sides of pixels, to an eighth of a pixel. Two crossings are joined by a line; where there are more or \
fewer, ticks mark them.
- *classes*: no edge crosses an empty pixel (grey), one cuts a simple pixel in two (green), more cross a complex one (red).
- *reachability*: in every pixel a small map of the 5x5 pixels around it (itself white): from the green ones a path \
leads here that crosses no edge. Only those are mixed into its colour; complex pixels alone ignore the edges.
- *priority*: where the next samples are worth most, from black over red to pale yellow.
- *result*: each simple pixel has the colours of both its sides, by area.

**FLIP** is the mean difference that a person sees against {spp} samples for each pixel: 0 is none, 1 the most.
",
            all = self.gallery_command(None),
            side = super::window::SIDE,
        )
    }

    fn section(&self, page: &mut String, section: &Section) {
        let Section { name, scene, window, flip: [cache, epi], .. } = section;
        let known = epigraph_scenes::scene_names().into_iter().find(|known| known.name == scene);
        let doc = known.map(|known| format!("*{scene}* is {}.\n\n", known.doc)).unwrap_or_default();
        let percent = |share: f64| format!("{:.1}%", 100.0 * share);
        let [empty, simple, complex] = section.classes.map(percent);
        let points = percent(section.points);
        let ([x, y], [width, height]) = (window.at, window.size);
        let commands = self.commands(section);
        let (picture, cache_picture) = (section.picture(), section.cache_picture());
        let (stages, close_ups) = (section.stages(), section.close_ups());
        // Writing to a string does not fail.
        let _ = write!(
            page,
            "
## {name}

{doc}| edge-and-point image, FLIP {epi:.3} | render cache, FLIP {cache:.3} |
|---|---|
| ![{scene} as an edge-and-point image]({picture}) | ![{scene} by the render cache]({cache_picture}) |

*The same frame from equally many samples. The render cache mixes the samples around each pixel; the edge-and-point image \
does so too, but not across an edge.*

![The steps of the edge-and-point image, enlarged]({stages})

*The steps, in the {width}x{height} pixels from ({x}, {y}) on. Of the whole image, {points} of the pixels show a point; \
{empty} are empty, {simple} simple and {complex} complex.*

![The same pixels by the render cache, as an edge-and-point image, and converged]({close_ups})

*The same pixels by the render cache, as an edge-and-point image, and with {spp} samples for each pixel.*

```sh
{commands}
```
",
            spp = self.args.spp
        );
    }

    /// The command lines that make the pictures of a section.
    fn commands(&self, section: &Section) -> String {
        let GalleryArgs { frames, seed, spp, .. } = self.args;
        let (scene, view) = (quoted(&section.scene), self.view());
        let run = format!(
            "--samples {} --frames {frames} --seed {seed} --backend {}",
            self.args.samples, self.side
        );
        let (epi, cache) = (section.picture(), section.cache_picture());
        let [x, y] = section.window.at;
        [
            format!("epigraph {EPI} --scene {scene} {view} {run} --out {epi}"),
            format!("epigraph {CACHE} --scene {scene} {view} {run} --out {cache}"),
            format!(
                "epigraph reference --scene {scene} {view} --frame {} --spp {spp} --seed {seed} --out reference.png",
                frames - 1
            ),
            format!("epigraph compare reference.png {epi}"),
            format!("epigraph compare reference.png {cache}"),
            format!("{} --crop {x},{y}", self.gallery_command(Some(section))),
        ]
        .join("\n")
    }

    fn view(&self) -> String {
        let Size([width, height]) = self.args.size;
        format!("--camera {} --size {width}x{height}", quoted(&self.args.camera))
    }

    /// The command line of the gallery, of one scene or as it was given.
    fn gallery_command(&self, section: Option<&Section>) -> String {
        let GalleryArgs { frames, seed, spp, samples, .. } = self.args;
        let all = self.args.scene.iter().map(String::as_str);
        let scenes: Vec<&str> = section.map_or(all.collect(), |section| vec![&section.scene]);
        let scenes: String = scenes.iter().map(|scene| format!(" --scene {}", quoted(scene))).collect();
        // One scene's page must not take the place of the whole one.
        let out = section.map_or(self.args.out.display().to_string(), |section| section.name.clone());
        let out = quoted(&out);
        let crop = match (section, self.args.crop) {
            (None, Some(crop)) => format!(" --crop {crop}"),
            _ => String::new(),
        };
        format!(
            "epigraph gallery --out {out}{scenes} {} --samples {samples} --frames {frames} --spp {spp} --seed {seed} \
             --backend {}{crop}",
            self.view(),
            self.side
        )
    }
}

/// A word for the shell.
fn quoted(word: &str) -> String {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./:%+=@,".contains(letter);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_names() {
        assert_eq!(quoted("orbit:1:40"), "orbit:1:40");
        assert_eq!(quoted("it's a path.glb"), r"'it'\''s a path.glb'");
        assert_eq!(quoted(""), "''");
        assert_eq!(file_name("chains"), "chains");
        assert_eq!(file_name("/tmp/my (old) scene.v2.glb"), "my--old--scene-v2");
    }
}
