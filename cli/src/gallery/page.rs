//! The gallery's page.

use std::{fmt::Write as _, path::Path};

use epigraph_core::Side;
use epigraph_stages::shared::edge_pixel::{CLASS, COMPLEX, SIMPLE};

use super::{shot::Layers, window::Window};
use crate::{args::GalleryArgs, open, values::Size};

/// The names of a scene's pictures.
#[derive(Clone)]
pub struct Names {
    /// Their common prefix.
    pub prefix: String,
    /// The edge-and-point image.
    pub picture: String,
    /// The picture of the graph beside.
    pub beside: String,
    /// The steps.
    pub stages: String,
    /// The same pixels of both pictures and of the reference.
    pub close_ups: String,
}

impl Names {
    /// For a scene and the graph beside, both as given on the command line.
    pub fn new(scene: &str, beside: &str) -> Self {
        let prefix = file_name(scene);
        Self {
            picture: format!("{prefix}.png"),
            beside: format!("{prefix}-{}.png", file_name(&open::label(beside))),
            stages: format!("{prefix}-stages.png"),
            close_ups: format!("{prefix}-close-up.png"),
            prefix,
        }
    }

    /// All of them.
    pub fn all(&self) -> [&str; 4] {
        [&self.picture, &self.beside, &self.stages, &self.close_ups]
    }
}

/// The page's section about a scene.
pub struct Section {
    /// The names of its pictures.
    names: Names,
    /// The scene as given on the command line.
    scene: String,
    /// The enlarged part of the image.
    window: Window,
    /// Shares of pixels that show a point, and of empty, simple and complex pixels.
    points: f64,
    classes: [f64; 3],
    /// Mean FLIP of the render cache and of the edge-and-point image.
    flip: [f64; 2],
}

impl Section {
    /// The section with the figures of the scene's last frame.
    pub fn new(scene: &str, names: Names, window: Window, layers: &Layers, flip: [f64; 2]) -> Self {
        let pixels = layers.points.len().max(1) as f64;
        let share =
            |class: u32| layers.cls.iter().filter(|&cls| cls & CLASS == class).count() as f64 / pixels;
        let (simple, complex) = (share(SIMPLE), share(COMPLEX));
        Self {
            names,
            scene: scene.to_owned(),
            window,
            points: layers.points.iter().flatten().count() as f64 / pixels,
            classes: [1.0 - simple - complex, simple, complex],
            flip,
        }
    }
}

/// The name of the scene or of its file as a prefix of file names, without characters that are invalid in file names or
/// links.
fn file_name(scene: &str) -> String {
    let stem = Path::new(scene).file_stem().unwrap_or_default().to_string_lossy();
    let safe = |letter: char| if letter.is_alphanumeric() || letter == '_' { letter } else { '-' };
    stem.chars().map(safe).collect()
}

/// What a graph makes, in words.
pub fn words(graph: &str) -> String {
    match open::label(graph).as_str() {
        "epi" => "edge-and-point image".into(),
        "render-cache" => "render cache".into(),
        name => name.into(),
    }
}

/// The gallery page.
pub struct Page<'a> {
    /// The command line.
    pub args: &'a GalleryArgs,
    /// The default side of nodes.
    pub side: Side,
    /// Maximum number of samples per frame.
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
samples per frame ({asked}). `epigraph gallery` made this page with its pictures and figures:

```sh
{all}
```

where `epigraph` is `cargo run --release --` in the repository. **The steps** enlarge {side}x{side} pixels of the \
edge-and-point image, in the order of the algorithm:

- *points*: samples of earlier frames, moved to where the camera sees them now. Dark blue pixels have none.
- *edges*: silhouettes and creases (blue) and shadow boundaries (orange), computed from the mesh alone. They are stored as \
crossings with the sides of pixels, to an eighth of a pixel. Two crossings are joined by a line; other numbers of crossings \
are drawn as ticks.
- *classes*: an empty pixel (grey) has no edge, a simple one (green) is cut in two by an edge, a complex one (red) has more.
- *reachability*: each pixel shows a small map of the 5x5 pixels around it (itself white). From the green ones a path \
leads here that crosses no edge. Only those contribute to its colour; only complex pixels ignore the edges.
- *priority*: where new samples help most, from black (least) through red to pale yellow (most).
- *result*: each simple pixel blends the colours of its two sides by area.

**FLIP** is the mean perceived difference from a reference with {spp} samples per pixel: 0 is none, 1 the largest.
",
            all = self.gallery_command(None),
            side = super::window::SIDE,
        )
    }

    fn section(&self, page: &mut String, section: &Section) {
        let Section { names, scene, window, flip: [cache, epi], .. } = section;
        let Names { prefix: name, picture, beside: cache_picture, stages, close_ups } = names;
        let known = epigraph_scenes::scene_names().into_iter().find(|known| known.name == scene);
        let doc = known.map(|known| format!("*{scene}* is {}.\n\n", known.doc)).unwrap_or_default();
        let percent = |share: f64| format!("{:.1}%", 100.0 * share);
        let [empty, simple, complex] = section.classes.map(percent);
        let points = percent(section.points);
        let ([x, y], [width, height]) = (window.at, window.size);
        let commands = self.commands(section);
        let GalleryArgs { graph, beside, .. } = self.args;
        let (graph, beside) = (words(graph), words(beside));
        // What is known of the two graphs that come with the program.
        let difference = match (graph.as_str(), beside.as_str()) {
            ("edge-and-point image", "render cache") => {
                " The render cache blends the samples around each pixel; the edge-and-point image does so too, but not \
                 across edges."
            }
            _ => "",
        };
        // Writing to a string does not fail.
        let _ = write!(
            page,
            "
## {name}

{doc}| {graph}, FLIP {epi:.3} | {beside}, FLIP {cache:.3} |
|---|---|
| ![{scene}: {graph}]({picture}) | ![{scene}: {beside}]({cache_picture}) |

*The same frame from the same number of samples.{difference}*

![The steps, enlarged: {graph}]({stages})

*The steps, in the {width}x{height} pixels from ({x}, {y}). Of the whole image, {points} of the pixels show a point; \
{empty} are empty, {simple} simple and {complex} complex.*

![The same pixels: {beside}, {graph}, and converged]({close_ups})

*The same pixels: {beside}, {graph}, and with {spp} samples per pixel.*

```sh
{commands}
```
",
            spp = self.args.spp
        );
    }

    /// The command lines that reproduce the pictures of a section.
    fn commands(&self, section: &Section) -> String {
        let GalleryArgs { frames, seed, spp, .. } = self.args;
        let (scene, view) = (quoted(&section.scene), self.view());
        let run = format!(
            "--samples {} --frames {frames} --seed {seed} --backend {}",
            self.args.samples, self.side
        );
        let GalleryArgs { graph, beside, .. } = self.args;
        let Names { picture: epi, beside: cache, .. } = &section.names;
        let (graph, beside) = (quoted(graph), quoted(beside));
        let [x, y] = section.window.at;
        [
            format!("epigraph {graph} --scene {scene} {view} {run} --out {epi}"),
            format!("epigraph {beside} --scene {scene} {view} {run} --out {cache}"),
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

    /// The command line that makes one section, or the whole gallery.
    fn gallery_command(&self, section: Option<&Section>) -> String {
        let GalleryArgs { frames, seed, spp, samples, .. } = self.args;
        let all = self.args.scene.iter().map(String::as_str);
        let scenes: Vec<&str> = section.map_or(all.collect(), |section| vec![&section.scene]);
        let scenes: String = scenes.iter().map(|scene| format!(" --scene {}", quoted(scene))).collect();
        // A single section must not overwrite the whole gallery.
        let out = section.map_or(self.args.out.display().to_string(), |section| section.names.prefix.clone());
        let out = quoted(&out);
        let crop = match (section, self.args.crop) {
            (None, Some(crop)) => format!(" --crop {crop}"),
            _ => String::new(),
        };
        let of = |option: &str, graph: &str, default: &str| match graph == default {
            true => String::new(),
            false => format!(" --{option} {}", quoted(graph)),
        };
        let graphs = of("graph", &self.args.graph, "epi") + &of("beside", &self.args.beside, "render-cache");
        format!(
            "epigraph gallery --out {out}{graphs}{scenes} {} --samples {samples} --frames {frames} --spp {spp} --seed {seed} \
             --backend {}{crop}",
            self.view(),
            self.side
        )
    }
}

/// Quotes a word for the shell if necessary.
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
    fn quoting_and_file_names() {
        assert_eq!(quoted("orbit:1:40"), "orbit:1:40");
        assert_eq!(quoted("it's a path.glb"), r"'it'\''s a path.glb'");
        assert_eq!(quoted(""), "''");
        assert_eq!(file_name("chains"), "chains");
        assert_eq!(file_name("/tmp/my (old) scene.v2.glb"), "my--old--scene-v2");
    }
}
