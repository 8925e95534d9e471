//! The command line as clap reads it.

// Doc comments here are help texts, in which brackets hold what may be left out.
#![allow(rustdoc::broken_intra_doc_links)]

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use epigraph::{Backend, Pace, Samples};

use crate::{
    bench::{Choice, Sweep},
    values::{self, Light, Place, Save, Setting, Size},
};

const EXAMPLES: &str = "\
Examples:
  epigraph                                   the edge-and-point image of the Cornell box, to epigraph.png
  epigraph --scene chains --camera fly --samples 10%
  epigraph graphs/render-cache.ron --set cull.threshold=0.1 --save project.depth=depth.exr
  epigraph check graphs/epi.ron              what would run, in which order, with how much memory
  epigraph stages fill                       what a stage does: its ports and parameters
  epigraph reference --spp 256 --out reference.exr
  epigraph compare epigraph.png reference.exr --map difference.png
  epigraph bench --quick                     what each step costs here, beside the papers' figures
  epigraph gallery --out gallery             a page of pictures: what each step does, scene by scene
  epigraph quality --scene cornell           how good the pictures are at 1, 2, 5 and 10% of the pixels a frame";

const BENCH_HELP: &str = "\
Times are medians over many frames of a moving camera, after a warm-up that fills the point cloud; tracing runs beside
the frame and is told apart. Columns are those of the papers: P1 update points and request samples, P2 project, P3
predicted projection, P4 depth cull, E1 silhouettes and shadow edges, E2 rasterise edges, I1 classify, I2 reachability,
interpolation and anti-aliasing. Below our rows stand the papers' two (2006: their hybrid, and the original on the CPU).

On a machine without a GPU the rows `gpu` and `hybrid` run on a software GPU, if there is one: they show that it works,
not how fast a GPU is.

Examples:
  epigraph bench --quick                                  half a minute, a first impression
  epigraph bench --plot bench.svg --json bench.json       everything, some minutes
  epigraph bench --scene dragon --backend gpu --size 1920x1080 --sweep none
  epigraph bench --graph render-cache --scene cornell --sweep pixels";

const GALLERY_HELP: &str = "\
For each scene: the last frame as an edge-and-point image and by the render cache, both from the same number of samples; an
enlarged part of it in every step of the algorithm (points, edges, classes, reachability, priority, result), as in figure 4
of the papers; and the same part by both and converged. The page, gallery.md, names the command line of every picture.
Nothing is written before all is done.

Examples:
  epigraph gallery --out gallery                                 all scenes, some minutes
  epigraph gallery --out chains --scene chains --crop 230,110    one scene, and the part to enlarge
  epigraph gallery --out cornell --scene cornell --samples 1%    what is left of it at one per cent";
const QUALITY_HELP: &str = "\
Each graph starts from nothing and runs along the camera's path; the frames of --frames are compared with converged
pictures of the same views. A cell of the table holds

  PSNR / PSNR near edges, FLIP / FLIP near edges

PSNR in dB (more is better), FLIP as the mean over the pixels (0 is no difference), both as `compare` has them: of
what is shown, in sRGB. References are clamped, as a graph's `tonemap` does by default: exposure and curve have to stay.
Near are pixels within 2 pixels of an edge of the reference (`reference --edges` writes them): outlines, creases and
hard shadow boundaries. The first graph is what the others are held against.

With few light paths a sample (`trace.spp`, 4 by default) their noise hides how well edges are kept; 64 tell more.
JSON: size, seed, backend, adapter, spp, mode, set, edge_reach (pixels), rows [{graph, scene, camera, samples (as given),
samples_per_frame, psnr, flip, edges {share, psnr, flip}, frames [{frame, psnr, flip, edges}]}]; the figures of a row are
means over its frames; share is that of the pixels near edges; null: pictures are equal, or there is no edge.

Examples:
  epigraph quality --set trace.spp=64 --plot quality.svg --json quality.json     everything: minutes
  epigraph quality --scene cornell --camera orbit --samples 5% --size 256x256    a first impression
  epigraph quality epi my.ron --frames 9,19,39,79                                a graph of one's own beside epi
  epigraph quality epi --set interpolate.sigma=0.6 --scene chains                what a parameter does";

/// Renders moving pictures from sparse ray-traced samples with a graph of stages that you can read and change.
///
/// Without a command it renders: `epigraph [GRAPH] [OPTIONS]`.
#[derive(Debug, Parser)]
#[command(name = "epigraph", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// The command; none means `render`.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// What to render where no command is given.
    #[command(flatten)]
    pub render: RenderArgs,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render frames along a camera path and write the last one (the default command)
    #[command(after_help = "The picture is the graph's output `image`, or its first one.\n\n\
        Example:\n  epigraph render --frames 120 --camera orbit --sheet sheet.png --save interpolate.priority=priority.png")]
    Render(RenderArgs),
    /// Check graphs and their shaders, and print the plan; needs no GPU
    #[command(
        after_help = "Example:\n  epigraph check graphs/*.ron --dot plan.dot && dot -Tsvg plan.dot > plan.svg"
    )]
    Check(CheckArgs),
    /// List the kinds of stage, or one kind's ports and parameters
    #[command(after_help = "Example:\n  epigraph stages depth_cull")]
    Stages(StagesArgs),
    /// Trace a picture with many samples for each pixel, to compare with
    #[command(
        after_help = "Example:\n  epigraph reference --scene cornell --camera orbit --frame 59 --spp 256 --out ref.exr --edges edges.png"
    )]
    Reference(ReferenceArgs),
    /// Measure how much two images differ: RMSE, PSNR, SSIM, FLIP
    #[command(
        after_help = "PNG counts as sRGB, EXR as linear light. RMSE is on the values as they stand in the files; for \
        the others, linear values are clamped to [0, 1] and sRGB-encoded first.\n\n\
        Examples:\n  epigraph compare reference.exr epigraph.png --map flip.png\n  \
        epigraph compare reference.exr epigraph.png --mask edges.png"
    )]
    Compare(CompareArgs),
    /// Time the steps of a frame, beside the papers' own table, and how the frame grows
    #[command(after_help = BENCH_HELP)]
    Bench(BenchArgs),
    /// Make a page of pictures: what each step does, and both algorithms side by side
    #[command(after_help = GALLERY_HELP)]
    Gallery(GalleryArgs),
    /// Measure how good graphs' pictures are: PSNR and FLIP against converged ones, and near their edges
    #[command(after_help = QUALITY_HELP)]
    Quality(QualityArgs),
}

/// The scene and the camera's way through it.
#[derive(Args, Clone, Debug)]
pub struct SceneArgs {
    #[arg(long, value_name = "SCENE", default_value = "cornell", help = scene_help())]
    pub scene: String,
    /// Camera path: still, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], fly[:FILE.ron] or shake
    #[arg(long, value_name = "PATH", default_value = "orbit")]
    pub camera: String,
    /// Width and height of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", allow_hyphen_values = true)]
    pub size: Size,
}

/// What a graph is compiled for beside its scene.
#[derive(Args, Clone, Debug)]
pub struct GraphArgs {
    /// Samples a frame may ask for: a count, or a share of the image's pixels
    #[arg(long, value_name = "N|P%", default_value = "5%", allow_hyphen_values = true)]
    pub samples: Samples,
    /// Set a parameter of a node; may stand several times
    #[arg(long, value_name = "node.param=value")]
    pub set: Vec<Setting>,
    /// Run every node, also those that the scene makes needless
    #[arg(long)]
    pub no_prune: bool,
    /// Give every intermediate result memory of its own
    #[arg(long)]
    pub no_pooling: bool,
}

/// Arguments of `render`.
#[derive(Args, Clone, Debug)]
pub struct RenderArgs {
    /// Graph file, or the name of a graph that comes with the program [default: epi]
    pub graph: Option<String>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub compile: GraphArgs,
    /// How many frames to run; the last one is written
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    pub frames: u32,
    /// Where nodes run that do not say
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Chooses the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// When samples arrive
    #[arg(long, default_value = "exact", value_parser = values::pace())]
    pub pace: Pace,
    /// Threads that compute [default: one for each core]; the picture does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
    /// The picture, .png (sRGB) or .exr (linear) [default: epigraph.png]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Save a port's last contents: .png to look at, .exr raw values, .csv for lists; may stand several times
    #[arg(long, value_name = "node.port=FILE")]
    pub save: Vec<Save>,
    /// A labelled contact sheet of every node's image (PNG)
    #[arg(long, value_name = "FILE")]
    pub sheet: Option<PathBuf>,
    /// Write the figures as JSON; - means stdout, without the table then
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Fill intermediate results with NaN and 0xDEADBEEF before use, to find stages that read what nobody wrote
    #[arg(long)]
    pub poison: bool,
}

/// Arguments of `check`.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// Graph files
    #[arg(required = true)]
    pub graphs: Vec<String>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub compile: GraphArgs,
    /// Where nodes run that do not say; auto means cpu here, since no GPU is looked for
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Write the plan as a Graphviz graph (one GRAPH only)
    #[arg(long, value_name = "FILE")]
    pub dot: Option<PathBuf>,
    /// Write problems and plan as JSON; - means stdout, without the text then
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `stages`.
#[derive(Args, Clone, Debug)]
pub struct StagesArgs {
    /// The kind to tell about; without it, all are listed
    pub kind: Option<String>,
    /// Write the same as JSON; - means stdout, without the text then
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `reference`.
#[derive(Args, Clone, Debug)]
pub struct ReferenceArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Frame of the camera path; `render --frames N` ends with frame N - 1
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: u32,
    /// Samples for each pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_hyphen_values = true)]
    pub spp: u32,
    /// Which light to follow
    #[arg(long, default_value = "direct")]
    pub mode: Light,
    /// Chooses the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// The picture, .exr (linear) or .png (sRGB)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Write the pixels within 2 pixels of an edge (outline, crease, shadow boundary) as white in a PNG
    #[arg(long, value_name = "FILE.png")]
    pub edges: Option<PathBuf>,
}

/// Arguments of `compare`.
#[derive(Args, Clone, Debug)]
pub struct CompareArgs {
    /// The reference, .png or .exr
    pub a: PathBuf,
    /// The image to judge, .png or .exr
    pub b: PathBuf,
    /// Write FLIP's error for each pixel as a PNG in the magma colours (black 0, white 1)
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Compare a second time only the pixels that are white here, as `reference --edges` writes them: PSNR and FLIP
    #[arg(long, value_name = "FILE.png")]
    pub mask: Option<PathBuf>,
    /// Write the figures as JSON; - means stdout, without the text then
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `bench`.
#[derive(Args, Clone, Debug)]
pub struct BenchArgs {
    /// Scene to measure; may stand several times [default: cornell, chains and room; bust and dragon if fetched]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Which rows to measure; may stand several times [default: all; without hybrid where --graph is given]
    #[arg(long)]
    pub backend: Vec<Choice>,
    /// Graph file, or the name of a graph that comes with the program, for the rows `cpu` and `gpu` [default: epi]
    #[arg(long)]
    pub graph: Option<String>,
    /// Camera path: still, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], fly[:FILE.ron] or shake
    #[arg(long, value_name = "PATH", default_value = "orbit")]
    pub camera: String,
    /// Width and height of the image in pixels; the papers' is the default
    #[arg(long, value_name = "WxH", default_value = "512x512", allow_hyphen_values = true)]
    pub size: Size,
    #[command(flatten)]
    pub compile: GraphArgs,
    /// Frames to count for each row [default: 60, or as many as 20 seconds allow]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), allow_hyphen_values = true)]
    pub frames: Option<u32>,
    /// Follow the frame's time over a quantity; may stand several times [default: all; none with --quick]
    #[arg(long)]
    pub sweep: Vec<Sweep>,
    /// Few frames and a short warm-up, so that the cloud is not full yet: a first impression
    #[arg(long)]
    pub quick: bool,
    /// Chooses the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Threads that compute [default: one for each core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
    /// Write the figures as JSON; - means stdout, without the tables then
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw the tables as an SVG picture
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

/// Arguments of `gallery`.
#[derive(Args, Clone, Debug)]
pub struct GalleryArgs {
    /// Folder for gallery.md and its pictures; made if it is not there
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Scene to show; may stand several times [default: cornell, chains and room; bust and dragon if fetched]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Camera path: still, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], fly[:FILE.ron] or shake
    #[arg(long, value_name = "PATH", default_value = "orbit")]
    pub camera: String,
    /// Width and height of the images in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", allow_hyphen_values = true)]
    pub size: Size,
    /// Samples a frame may ask for: a count, or a share of the image's pixels
    #[arg(long, value_name = "N|P%", default_value = "5%", allow_hyphen_values = true)]
    pub samples: Samples,
    /// How many frames to run; the last one is shown
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    pub frames: u32,
    /// Where nodes run that do not say
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Samples for each pixel of the picture to compare with
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_hyphen_values = true)]
    pub spp: u32,
    /// Top left pixel of the part that is enlarged [default: where there is most to see, for each scene]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    pub crop: Option<Place>,
    /// Chooses the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
}

/// Arguments of `quality`.
#[derive(Args, Clone, Debug)]
pub struct QualityArgs {
    /// Graph files, or names of graphs that come with the program [default: render-cache and epi]
    #[arg(value_name = "GRAPH")]
    pub graphs: Vec<String>,
    /// Scene to measure; may stand several times [default: cornell, chains and room]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Camera path, such as fly or orbit:2; may stand several times [default: still and orbit]
    #[arg(long, value_name = "PATH")]
    pub camera: Vec<String>,
    /// Samples a frame may ask for: counts, or shares of the image's pixels
    #[arg(
        long,
        value_name = "N|P%,...",
        value_delimiter = ',',
        default_value = "1%,2%,5%,10%",
        allow_hyphen_values = true
    )]
    pub samples: Vec<Samples>,
    /// Frames to compare, the first being 0 [default: 39 of a still camera; 19, 24 and 29 of a moving one]
    #[arg(long, value_name = "N,...", value_delimiter = ',', allow_hyphen_values = true)]
    pub frames: Vec<u32>,
    /// Width and height of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "384x384", allow_hyphen_values = true)]
    pub size: Size,
    /// Set a parameter of a node, in all graphs; may stand several times
    #[arg(long, value_name = "node.param=value")]
    pub set: Vec<Setting>,
    /// Samples for each pixel of the references
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_hyphen_values = true)]
    pub spp: u32,
    /// Which light the references follow; with path, also --set trace.mode=Path
    #[arg(long, default_value = "direct")]
    pub mode: Light,
    /// Where nodes run that do not say
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Chooses the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Threads that compute [default: one for each core]; the figures do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
    /// Write the figures as JSON; - means stdout, without the table then
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw FLIP over samples a frame as an SVG picture
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

fn scene_help() -> String {
    let names: Vec<&str> = epigraph_scenes::scene_names().iter().map(|scene| scene.name).collect();
    format!("Scene: {}, or a .glb, .gltf, .obj, .ply or .ron file", names.join(", "))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn render_is_the_command_without_a_name() {
        let bare = Cli::try_parse_from(["epigraph", "my.ron", "--frames", "3"]).unwrap();
        assert!(bare.command.is_none());
        assert_eq!((bare.render.graph.as_deref(), bare.render.frames), (Some("my.ron"), 3));
        let named = Cli::try_parse_from(["epigraph", "render", "my.ron", "--frames", "3"]).unwrap();
        assert!(matches!(named.command, Some(Command::Render(args)) if args.frames == 3));
    }

    #[test]
    fn negative_numbers_are_told_apart_from_flags() {
        let error = Cli::try_parse_from(["epigraph", "--samples", "-5"]).unwrap_err().to_string();
        assert!(error.contains("'-5' for '--samples <N|P%>'") && error.contains("a count from 1"), "{error}");
    }
}
