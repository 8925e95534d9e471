//! The command line, declared for clap.

// Doc comments here are help texts, in which brackets mark optional parts.
#![allow(rustdoc::broken_intra_doc_links)]

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use epigraph::{Backend, Change, Pace, Samples};
use epigraph_streams::MOST_LEVELS;

use crate::{
    bench::{Choice, Sweep},
    values::{self, Crop, Encoding, Halves, Light, Paths, Percent, Place, Save, Size, Within},
};

const EXAMPLES: &str = "\
Examples:
  epigraph                                   the edge-and-point image of the Cornell box, to epigraph.png
  epigraph --scene chains --camera fly --samples 10%
  epigraph graphs/render-cache.ron --set cull.threshold=0.1 --save project.depth=depth.exr
  epigraph --swap spread=mine.wgsl           a shader of yours in the place of a stage
  epigraph check graphs/epi.ron              the plan: execution order and memory use
  epigraph stages fill                       what a stage does: its ports and parameters
  epigraph reference --spp 256 --out reference.exr
  epigraph compare epigraph.png reference.exr --map difference.png
  epigraph bench --quick                     the time of each step, beside the papers' figures
  epigraph gallery --out gallery             a page of pictures: what each step does, scene by scene
  epigraph quality --scene cornell           image quality at 0.05 to 4 light paths per pixel and frame
  epigraph tradeoff mine.ron --out results   an experiment: error against cost, over budgets and parameters
  epigraph encode scan.laz --out scan.vts    a point set with level of detail, in few bytes";

/// How graphs and changes to them are named, at the end of several help texts.
const NAMES: &str = "\n\n\
Graphs and their variants:
  GRAPH is a file, or the name of a graph that comes with the program. Changes may follow, each after a plus; the options
  --set, --swap, --insert and --wire make the same changes, to every GRAPH of the command. A graph file makes them with
  `base`.

  epi+interpolate.sigma=0.5              a parameter; epi+sigma=0.5 does, as only one node has a `sigma`
  epi+swap:interpolate=mine.wgsl         a shader of yours in the place of a node, with the same wires
  epi+swap:fill=spread                   another stage kind; `epigraph stages` lists them
  epi+swap:view=my-view.ron              another file in the place of a part
  epi+insert:tonemap.color=median.wgsl   a new node, called `median`, in the wire to the input tonemap.color
  epi+wire:tonemap.color=spread.color    an input connected to another port, or to `none`

  After a swap, parameters are those of the new stage. Paths start at the current folder.";

const RENDER_HELP: &str = "\
The picture is the graph's output `image`, or its first one.

Examples:
  epigraph render --frames 120 --camera orbit --sheet sheet.png --save interpolate.priority=priority.png
  epigraph render epi --swap interpolate=mine.wgsl --set interpolate.radius=3
  epigraph render epi --insert tonemap.color=median.wgsl --save median.calm=calm.exr";

const CHECK_HELP: &str = "\
Examples:
  epigraph check graphs/*.ron --dot plan.dot && dot -Tsvg plan.dot > plan.svg
  epigraph check epi+swap:interpolate=mine.wgsl         does my shader fit in this place?
  epigraph check mine.ron --full whole.ron              what my graph with a base is, in one file";

/// The last frame that `quality` can compare: all before it run too.
const LAST_FRAME: i64 = 9_999_999;

const BENCH_HELP: &str = "\
Times are medians over many frames of a moving camera, after a warm-up that fills the point cloud. Tracing runs
concurrently with the frame and is listed separately. Columns are those of the papers: P1 update points and request
samples, P2 project, P3 predicted projection, P4 depth cull, E1 silhouettes and shadow edges, E2 rasterise edges, I1
classify, I2 reachability, interpolation and anti-aliasing. The papers' two rows follow ours (2006: their hybrid, and the
original on the CPU).

With --streams, point sets: bytes a point and coverage in the paper's layout beside its own figures, for one pool and more; then
bytes, time to encode and decoding rate of each codec of `encode`. With --quick, two pools only.

On a machine without a GPU the rows `gpu` and `hybrid` run on a software GPU, if one is installed: they show that the
graph works, not how fast a GPU is.

Examples:
  epigraph bench --quick                                  a first impression in half a minute
  epigraph bench --plot bench.svg --json bench.json       everything, in a few minutes
  epigraph bench --scene dragon --backend gpu --size 1920x1080 --sweep none
  epigraph bench --graph render-cache --scene cornell --sweep pixels
  epigraph bench --graph epi --graph epi+swap:interpolate=mine.wgsl --quick    what a stage of your own costs
  epigraph bench --instructions                           what each stage costs, without the machine's noise
  epigraph bench --streams --scene scan.laz               codecs for a point set of yours";

const GALLERY_HELP: &str = "\
For each scene the gallery shows the last frame as an edge-and-point image and by the render cache, both from the same
number of samples; an enlarged detail after every step of the algorithm (points, edges, classes, reachability, priority,
result), as in figure 4 of the papers; and the same detail by both algorithms and in a converged reference. The page,
gallery.md, gives the command line of every picture. All have exposure 0; graphs with exposure Auto are refused. Files
are written only after all pictures are rendered.

Examples:
  epigraph gallery --out gallery                                 all scenes, in a few minutes
  epigraph gallery --out chains --scene chains --crop 230,110    one scene, and the detail to enlarge
  epigraph gallery --out cornell --scene cornell --samples 1%    the same at 1% of the pixels per frame
  epigraph gallery --out mine --graph epi+sigma=0.5              a variant of epi";
const QUALITY_HELP: &str = "\
Each graph starts without history and runs along the camera path, once for each budget; the frames given by --frames are
compared with converged pictures of the same views. A budget is a number of light paths per pixel and frame, by which
renderers with samples of different cost can be compared. It fixes a product:

  paths per pixel and frame = samples per frame x paths per sample / pixels

Paths per sample are each graph's own (`trace.spp`), or those of --per-sample; samples per frame follow. With --density,
samples per frame are the same for all budgets, and paths per sample follow: --density 5% makes 0.05, 0.2 and 0.8 paths
per pixel of 1, 4 and 16 paths per sample. A budget that for one graph is less than a sample, or more than one per pixel, is
left out there, as the lines below the table say; if no graph can have it, it is refused. Graphs choose where to sample, at
most once per pixel, and may not find a use for all samples when there are many: lines below the table say where paths were
left over. With --samples, samples per frame are given, and paths follow; each cell then begins with its paths. Tables are
Markdown; a cell reads

  PSNR / FLIP / flicker / ms of the graph + ms of tracing

PSNR is in dB (higher is better), FLIP is the mean over the pixels (0: no difference); both as by `compare`, on the displayed
sRGB values. Flicker is the root mean square change from the frame before, over the pixels that stay the same in the
references. Times are medians of a frame on this machine. Figures are means over the compared frames. The second table has
PSNR and FLIP of pixels within 2 pixels of an edge of the reference: an outline, a crease or a hard shadow boundary
(`reference --edges` writes them). The first graph is the baseline for the others. References are clamped to [0, 1], as a
graph's `tonemap` does by default, so leave its exposure and curve unchanged; a graph with exposure Auto is refused, as its
pictures would differ by exposure too.

A reference is the mean of two halves with independent noise, whose difference says how far it is from the truth: the lines
below the table state it. PSNR with a star is less than 5 dB below the reference's own, so that more than three tenths of
the squared error are the reference's: the picture is better than the figure. Take more paths (--spp), as a line below the
table says. References have the light of the graphs' samples (`trace.mode`); another --mode is refused.

With --keep, references and finished cells are kept in a folder: after an interruption the same command goes on from there,
and other commands need not trace the references again.

CSV: the columns of `tradeoff`. JSON: size, seed, backend, adapter, spp, mode, set (changes to all graphs), edge_reach
(pixels), rows [{graph, scene, camera, budget (as given), samples_per_frame, paths_per_sample, paths_per_pixel, paths_traced,
psnr, flip, flicker, near_reference (the star), frame_ms, trace_ms, reference {psnr, flip}, static_share, edges {share,
psnr, flip}, frames [{frame, psnr, flip, flicker, edges}]}], left_out [{graph, budget, message}], failed [{graph, scene,
camera, budget, message}].
null means that the pictures are equal, that there are no edges or static pixels, or that there is no such parameter.

Examples:
  epigraph quality --scene cornell --camera orbit --size 256x256 --paths 0.05,0.25,1      a first impression
  epigraph quality --keep q --plot q.svg --json q.json --csv q.csv > q.md                 everything, in several minutes
  epigraph quality epi my.ron --set trace.mode=Path --spp 4096 --keep q                   global illumination
  epigraph quality epi epi+trace.spp=1 epi+trace.spp=16 --scene chains                    many samples or good ones?
  epigraph quality epi my.ron --set trace.mode=Path --paths 0.05,0.2,0.8 --density 5%     noise at equal samples
  epigraph quality --samples 1%,2%,5%,10% --per-sample 64                                 clean samples, by their number
  epigraph quality epi my.ron --frames 9,19,39,79                                         your own graph beside epi
  epigraph quality epi epi+swap:interpolate=mine.wgsl                                     the effect of a stage of your own";

const TRADEOFF_HELP: &str = "\
An experiment is a file such as

  Tradeoff(
      version: 1,
      doc: \"Does half the sub-pixel precision show?\",
      graphs: [\"render-cache\", \"epi\", (graph: \"epi\", name: \"4 bits\", set: { \"project.subpixel_bits\": 4 })],
      scenes: [\"cornell\"],
      cameras: [\"orbit\"],                                   // the default
      sizes: [\"256x256\"],                                   // the default
      frames: 30,                                           // how many run; the default
      compare: [19, 24, 29],                                // which are compared; by default the last one
      budgets: [Samples(\"5%\"), PathsPerPixel(0.4)],         // by default Samples(\"5%\")
      vary: Grid({                                          // or OneAtATime({ ... })
          \"cull.threshold\": [0.02, 0.05],
          \"trace.spp\": Range(from: 4, to: 12, step: 4),
      }),
      search: [Search(metric: Flip, target: 0.04)],         // the samples for an equal error, or with cost: TotalMs time
      seeds: [1, 2, 3],                                     // repetitions; by default [1]
      metrics: [Flip, RelMse],                              // the first one is plotted; by default all
      costs: [PathsPerPixel, TotalMs],                      // over these; the default
      reference: (spp: 256),                                // the default; its light is that of the graphs, trace.mode
      backend: \"auto\",                                      // the default
      quick: (sizes: [\"64x64\"], frames: 10, compare: [9]),  // what differs with --quick
  )

Every graph with every variation, scene, camera, size, budget and seed is a cell. PathsPerPixel(0.4) is as many samples per
frame as have 0.4 light paths per pixel: samples x trace.spp / pixels. A search tries numbers of samples per frame and gives
an interval; it needs three seeds or more. Metrics: Flip, Rmse, RelMse, Psnr, Ssim, EdgeFlip, EdgePsnr, Flicker, Holes.
Costs: PathsPerPixel, PathsTraced, Samples, PeakBytes, BytesMoved, Rays, FrameMs, TraceMs, TotalMs. docs/tradeoff.md
defines them.

DIR gets results.csv, with a line for each cell, searches.csv, results.json with frames and nodes too, plots, page.html with
pictures side by side, and folders. Finished cells and references are kept there: the same command goes on after an interruption,
and measures again only what has changed or failed. With the same program, machine and backend, errors are the same to
the last digit in every run; times are not.

Examples:
  epigraph tradeoff graphs/tradeoffs/budgets.ron --quick --out budgets    a first impression
  epigraph tradeoff mine.ron --list                                       the cells, without running them
  epigraph tradeoff mine.ron --jobs | xargs -d '\\n' -n 1 -P 2 epigraph tradeoff mine.ron --out mine --run
  epigraph tradeoff mine.ron --out mine --collect                         results of the cells that are there
  epigraph tradeoff mine.ron --out mine --collect --figure figure.svg     and a figure for a paper";

const ENCODE_HELP: &str = "\
A .vts file holds a tree: level 1 is the whole set as one node, level 2 has two nodes, and so on. Each node has its points
on a grid of 128x128x128 cells of its own, so each level halves the cells where there are enough points. Points of a node
in the same cell become one, with their mean colour and normal; the last level is the most precise one, and no point of it
is farther than half a cell from where it was, along each axis of the grid.

The table has a line for each level: what is shown if the tree is cut there (leaves above it included). `merged` are
points that share a cell with another one; `per point` are bytes, `position` those without colour and normal, which take
4 bytes each; `pools`, `bricks` and `single` are the shares of the points by how they are stored.
JSON: input, points, left_out {not_numbers, withheld}, colors, normals, origin, codec, pools, translations, threshold,
palette, levels [{level, nodes, points, merged, bytes, position_bytes, in_pools, in_bricks, single}], bytes (of the
file), seconds.

With --codec repeats, and where --out is a .glb, the input is a mesh: its connected parts are compared, and those that are
the same but for a rotation and a translation are stored once, as a shape, with the places of all copies. Each vertex and
each triangle of a copy is compared; a mirrored part is a shape of its own. A vertex is at most --tolerance and the rounding
of single precision, 6/2^23 of the part's largest coordinate, from where it was. Materials belong to parts. A .glb has
EXT_mesh_gpu_instancing: programs that know it draw all copies of a shape by one call.
JSON: input, codec, triangles, parts, shapes, copies, ratio (parts for each shape), given_up (parts that took too much
work), degenerate (triangles left out: without three different corners), deviation (the largest distance of a vertex from
where it was), bound (the largest that was allowed to some part), position_bytes, instance_bytes, attribute_bytes,
triangle_bytes, record_bytes (of a .vts file), bytes (of the file), seconds.

What can be read:
  .ply, .ply.gz   ASCII or binary; x y z; red green blue (alpha); nx ny nz, or the normals of faces
  .las, .laz      with colours; points that are withheld are left out
  .xyz            text, a point a line: x y z, or x y z red green blue (0 to 255)
  .obj            vertices; without faces, with colours after the positions
  .gltf, .glb, scene files (.ron) and scenes by name: vertices with normals and the colours of materials
  .vts            the points of the last level
Doubles, LAS and text keep the precision of survey coordinates. Points whose coordinates are no numbers are left out and
counted. Repeats are read from .ply, .obj, .gltf, .glb, scene files and scenes by name.

Examples:
  epigraph encode scan.laz --out scan.vts
  epigraph encode dragon.ply.gz --out dragon.vts --no-normals --codec streams --translations 88    as in the paper
  epigraph encode scan.ply --out scan.vts --levels 12 --json scan.json    finer leaves, for a scan of many millions
  epigraph encode building.obj --out building.glb                         a mesh, with repeated parts as instances
  epigraph encode chains --out chains.vts --codec repeats --tolerance 0.1%    a thousandth of each part's radius
  epigraph decode scan.vts --out scan.ply                                 the points of the last level";

const DECODE_HELP: &str = "\
Writes binary PLY: positions (double if the file has an origin, as those of surveys have), red, green, blue and alpha,
normals. A point is at the centre of its cell. A file of --codec repeats is written as .glb, without materials.

Examples:
  epigraph decode scan.vts --out scan.ply
  epigraph decode scan.vts --out coarse.ply --level 3    at most four nodes of 128x128x128 cells
  epigraph decode parts.vts --out parts.glb              a mesh that was encoded with --codec repeats";

/// Renders moving pictures from sparse ray-traced samples with a graph of stages that you can read and change.
///
/// Without a command it renders: `epigraph [GRAPH] [OPTIONS]`.
#[derive(Debug, Parser)]
#[command(name = "epigraph", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// The command; `render` if absent.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Arguments of `render`, when no command is given.
    #[command(flatten)]
    pub render: RenderArgs,
}

impl Cli {
    /// The number of threads that the user wants.
    pub fn threads(&self) -> Option<u16> {
        match &self.command {
            None => self.render.threads,
            Some(Command::Render(args)) => args.threads,
            Some(Command::Bench(args)) => args.threads,
            Some(Command::Quality(args)) => args.threads,
            Some(Command::Tradeoff(args)) => args.threads,
            Some(_) => None,
        }
    }
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render frames along a camera path and write the last one (the default command)
    #[command(after_help = [RENDER_HELP, NAMES].concat())]
    Render(RenderArgs),
    /// Check graphs and their shaders, and print the plan, without a GPU
    #[command(after_help = [CHECK_HELP, NAMES].concat())]
    Check(CheckArgs),
    /// List the stage kinds, describe a kind, a graph or a shader file, or begin a new stage
    #[command(
        after_help = "Examples:\n  epigraph stages depth_cull\n  epigraph stages graphs/parts/view.ron\n  \
        epigraph stages --new glow            a stage in one shader file, and a graph with it\n  \
        epigraph stages --new glow --rust     a package with the stage in Rust, its shader and tests"
    )]
    Stages(StagesArgs),
    /// Trace a reference picture with many samples per pixel
    #[command(
        after_help = "Example:\n  epigraph reference --scene cornell --camera orbit --frame 59 --spp 256 --out ref.exr --edges edges.png"
    )]
    Reference(ReferenceArgs),
    /// Measure how much two images differ: RMSE, PSNR, SSIM, FLIP
    #[command(
        after_help = "PNG is read as sRGB, EXR as linear light. RMSE uses the values as stored in the files; for the \
        other metrics, linear values are first clamped to [0, 1] and sRGB-encoded. Compare pictures of one exposure: \
        `tonemap.exposure` a number, 0 beside a reference, not Auto.\n\n\
        Examples:\n  epigraph compare reference.exr epigraph.png --map flip.png\n  \
        epigraph compare reference.exr epigraph.png --mask edges.png"
    )]
    Compare(CompareArgs),
    /// Time the steps of a frame, beside the papers' table, and measure how frame time scales
    #[command(after_help = [BENCH_HELP, NAMES].concat())]
    Bench(BenchArgs),
    /// Make a page of pictures that shows each step, and both algorithms side by side
    #[command(after_help = [GALLERY_HELP, NAMES].concat())]
    Gallery(GalleryArgs),
    /// Measure the image quality of graphs at budgets of light paths: PSNR, FLIP and flicker against converged pictures
    #[command(after_help = [QUALITY_HELP, NAMES].concat())]
    Quality(QualityArgs),
    /// Measure what graphs reach for what they cost: an experiment over budgets, scenes and parameters
    #[command(after_help = TRADEOFF_HELP)]
    Tradeoff(TradeoffArgs),
    /// Encode a point set as a tree with level of detail, in few bytes: a .vts file
    #[command(after_help = ENCODE_HELP)]
    Encode(EncodeArgs),
    /// Write the points of a .vts file as PLY
    #[command(after_help = DECODE_HELP)]
    Decode(DecodeArgs),
}

/// The scene and the camera path.
#[derive(Args, Clone, Debug)]
pub struct SceneArgs {
    #[arg(long, value_name = "SCENE", default_value = "cornell", help = scene_help())]
    pub scene: String,
    /// Camera path: still, file:NAME, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], fly[:FILE.ron] or shake
    #[arg(long, value_name = "PATH", default_value = "orbit")]
    pub camera: String,
    /// Light the scene by an HDR or EXR image of longitudes and latitudes
    #[arg(long, value_name = "FILE")]
    pub sky: Option<PathBuf>,
    /// Hide the backs of single-sided materials of glTF files, as the format says
    #[arg(long)]
    pub single_sided: bool,
    /// Width and height of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", allow_hyphen_values = true)]
    pub size: Size,
}

/// Changes to the graph; to all graphs, if there are several.
#[derive(Args, Clone, Debug, Default)]
pub struct ChangeArgs {
    /// Set a parameter of a node, or PARAM=VALUE if it is the graph's own or only one node has it; may be repeated
    #[arg(long, value_name = "node.param=value", value_parser = Change::set)]
    pub set: Vec<Change>,
    /// Put another stage in the place of a node, with the same wires; may be repeated
    #[arg(long, value_name = "NODE=FILE.wgsl|KIND|PART.ron", value_parser = Change::swap)]
    pub swap: Vec<Change>,
    /// Put a new node into the wire that ends at an input; may be repeated
    #[arg(long, value_name = "NODE.PORT=FILE.wgsl|KIND|PART.ron", value_parser = Change::insert)]
    pub insert: Vec<Change>,
    /// Connect an input to another port, or to `none`; may be repeated
    #[arg(long, value_name = "NODE.PORT=NODE.PORT", value_parser = Change::wire)]
    pub wire: Vec<Change>,
}

impl ChangeArgs {
    /// All changes.
    pub fn all(&self) -> impl Iterator<Item = &Change> {
        self.swap.iter().chain(&self.insert).chain(&self.wire).chain(&self.set)
    }
}

/// How a graph is compiled, apart from the scene.
#[derive(Args, Clone, Debug)]
pub struct GraphArgs {
    /// Maximum number of samples per frame: a count, or a percentage of the image's pixels
    #[arg(long, value_name = "N|P%", default_value = "5%", allow_hyphen_values = true)]
    pub samples: Samples,
    #[command(flatten)]
    pub changes: ChangeArgs,
    /// Run every node, even those that have no effect in this scene
    #[arg(long)]
    pub no_prune: bool,
    /// Give every intermediate result its own memory
    #[arg(long)]
    pub no_pooling: bool,
    /// Use no vector instructions beyond those of every processor; does not affect the picture
    #[arg(long)]
    pub no_vectors: bool,
}

/// Arguments of `render`.
#[derive(Args, Clone, Debug)]
pub struct RenderArgs {
    /// Graph file, or the name of a graph or a variant [default: epi-filtered]
    pub graph: Option<String>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub compile: GraphArgs,
    /// Number of frames to run; the last one is written
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    pub frames: u32,
    /// Default placement for nodes without `on:`
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// When samples arrive
    #[arg(long, default_value = "exact", value_parser = values::pace())]
    pub pace: Pace,
    /// Number of CPU threads [default: one per core]; does not affect the picture
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
    /// Output picture, .png (sRGB) or .exr (linear); a pipe without an ending gets PNG [default: epigraph.png]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Save a port's contents after the last frame: .png to view, .exr for raw values, .csv for lists; may be repeated
    #[arg(long, value_name = "node.port=FILE")]
    pub save: Vec<Save>,
    /// Write a labelled contact sheet (PNG) of every node's images, but for scratch ports: --save writes those
    #[arg(long, value_name = "FILE")]
    pub sheet: Option<PathBuf>,
    /// Write the figures as JSON; - writes them to stdout instead of the table
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Fill intermediate results with NaN and 0xDEADBEEF before use, to find stages that read unwritten memory
    #[arg(long)]
    pub poison: bool,
    /// End at the first NaN, infinity, negative or out-of-range number that a node writes, and name its place
    #[arg(long, conflicts_with = "poison")]
    pub watch: bool,
}

/// Arguments of `check`.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// Graphs to check: files, names of built-in graphs such as epi, or variants
    #[arg(required = true, value_name = "GRAPH")]
    pub graphs: Vec<String>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub compile: GraphArgs,
    /// Default placement for nodes without `on:`; here auto means cpu, as no GPU is opened
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Write the whole graph as one file without a base or parts (one GRAPH only)
    #[arg(long, value_name = "FILE.ron")]
    pub full: Option<PathBuf>,
    /// Write the plan as a Graphviz graph (one GRAPH only)
    #[arg(long, value_name = "FILE")]
    pub dot: Option<PathBuf>,
    /// Write problems and plan as JSON; - writes them to stdout instead of the text
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `stages`.
#[derive(Args, Clone, Debug)]
pub struct StagesArgs {
    /// Stage kind to describe, or a graph (.ron) or shader file (.wgsl): its ports and parameters [default: list all kinds]
    #[arg(value_name = "KIND|FILE")]
    pub kind: Option<String>,
    /// Write a stage to begin with: NAME.wgsl and NAME.ron, a graph with it
    #[arg(long, value_name = "NAME", conflicts_with_all = ["kind", "json"])]
    pub new: Option<PathBuf>,
    /// With --new, write a Rust package instead: stage, CPU twin, shader, tests, graph, program
    #[arg(long, requires = "new")]
    pub rust: bool,
    /// Write the description as JSON; - writes it to stdout instead of the text
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `reference`.
#[derive(Args, Clone, Debug)]
pub struct ReferenceArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Frame of the camera path, from 0; the last one of `render --frames N` is N - 1
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: u32,
    /// Samples per pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_hyphen_values = true)]
    pub spp: u32,
    /// Light transport to trace
    #[arg(long, default_value = "direct")]
    pub mode: Light,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Output picture, .exr (linear) or .png (sRGB)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Write a mask whose white pixels lie within 2 pixels of an edge (outline, crease, shadow boundary)
    #[arg(long, value_name = "FILE.png")]
    pub edges: Option<PathBuf>,
}

/// Arguments of `compare`.
#[derive(Args, Clone, Debug)]
pub struct CompareArgs {
    /// Reference image, .png or .exr
    pub a: PathBuf,
    /// Test image, .png or .exr
    pub b: PathBuf,
    /// Write FLIP's error per pixel as a PNG in the magma colour map (black 0, white 1)
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Also report PSNR and FLIP of the pixels that are white in this mask, such as one from `reference --edges`
    #[arg(long, value_name = "FILE.png")]
    pub mask: Option<PathBuf>,
    /// Write the figures as JSON; - writes them to stdout instead of the text
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `bench`.
#[derive(Args, Clone, Debug)]
pub struct BenchArgs {
    /// Scene to measure; may be repeated [default: cornell, chains and room; bust and dragon if fetched]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Rows to measure; may be repeated [default: all, or all but hybrid with --graph]
    #[arg(long)]
    pub backend: Vec<Choice>,
    /// Graph file, or the name of a graph or a variant, for the rows `cpu` and `gpu`; may be repeated [default: epi]
    #[arg(long)]
    pub graph: Vec<String>,
    /// Camera path: still, file:NAME, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], fly[:FILE.ron] or shake
    #[arg(long, value_name = "PATH", default_value = "orbit")]
    pub camera: String,
    /// Width and height of the image in pixels; the default is the papers' size, or 256x256 with --instructions
    #[arg(
        long,
        value_name = "WxH",
        default_value = "512x512",
        allow_hyphen_values = true,
        default_value_if("instructions", "true", "256x256")
    )]
    pub size: Size,
    #[command(flatten)]
    pub compile: GraphArgs,
    /// Number of frames to measure for each row [default: 60, or fewer if they take over 20 seconds]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), allow_hyphen_values = true)]
    pub frames: Option<u32>,
    /// Measure the frame time over a range of a quantity; may be repeated [default: all; none with --quick]
    #[arg(long)]
    pub sweep: Vec<Sweep>,
    /// Measure few frames after a short warm-up, which does not fill the point cloud: a first impression
    #[arg(long)]
    pub quick: bool,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Number of CPU threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
    /// Measure point sets in place of frames: the codecs of `encode`, the paper's figures, and a flight through each set.
    /// Scenes may be files of points
    #[arg(long, conflicts_with_all = [
        "backend", "graph", "camera", "samples", "set", "swap", "insert", "wire", "no_prune", "no_pooling",
        "no_vectors", "sweep", "seed",
    ])]
    pub streams: bool,
    /// Measure what each scene saves because needless nodes are left out, in place of the papers' table: with a still
    /// camera and with --camera. Graphs are by default render-cache and epi
    #[arg(long, conflicts_with_all = ["streams", "backend", "no_prune", "sweep", "plot"])]
    pub pruning: bool,
    /// Count the instructions that each stage runs, which do not depend on how busy the machine is, in place of the papers'
    /// table; needs valgrind, and takes a minute. Graphs are by default epi and render-cache, the scene cornell
    #[arg(long, conflicts_with_all = [
        "streams", "pruning", "backend", "set", "swap", "insert", "wire", "sweep", "plot",
    ])]
    pub instructions: bool,
    /// Write the figures as JSON; - writes them to stdout instead of the tables
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Plot the tables as an SVG picture
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

/// Arguments of `gallery`.
#[derive(Args, Clone, Debug)]
pub struct GalleryArgs {
    /// Folder for gallery.md and its pictures; created if it does not exist
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The graph to show, which interpolates between edges: a file, or the name of a graph or a variant
    #[arg(long, default_value = "epi")]
    pub graph: String,
    /// The graph to compare it with, likewise
    #[arg(long, value_name = "GRAPH", default_value = "render-cache")]
    pub beside: String,
    /// Scene to show; may be repeated [default: cornell, chains and room; bust and dragon if fetched]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Camera path: still, file:NAME, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], fly[:FILE.ron] or shake
    #[arg(long, value_name = "PATH", default_value = "orbit")]
    pub camera: String,
    /// Width and height of the images in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", allow_hyphen_values = true)]
    pub size: Size,
    /// Maximum number of samples per frame: a count, or a percentage of the image's pixels
    #[arg(long, value_name = "N|P%", default_value = "5%", allow_hyphen_values = true)]
    pub samples: Samples,
    /// Number of frames to run; the last one is shown
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    pub frames: u32,
    /// Default placement for nodes without `on:`
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Samples per pixel of the reference picture
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_hyphen_values = true)]
    pub spp: u32,
    /// Top left pixel of the enlarged detail [default: the most instructive one, chosen for each scene]
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    pub crop: Option<Place>,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
}

/// Arguments of `quality`.
#[derive(Args, Clone, Debug)]
pub struct QualityArgs {
    /// Graph files, or names of graphs or variants [default: render-cache and epi]
    #[arg(value_name = "GRAPH")]
    pub graphs: Vec<String>,
    /// Scene to measure; may be repeated [default: cornell, chains and room]
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Camera path, such as fly or orbit:2; may be repeated [default: still and orbit]
    #[arg(long, value_name = "PATH")]
    pub camera: Vec<String>,
    /// Budgets in light paths per pixel and frame [default: 0.05, 0.1, 0.25, 0.5, 1 and 4, unless --samples is given]
    #[arg(long, value_name = "N,...", value_delimiter = ',', allow_hyphen_values = true)]
    pub paths: Vec<Paths>,
    /// Budgets in samples per frame: counts, or percentages of the image's pixels
    #[arg(long, value_name = "N|P%,...", value_delimiter = ',', allow_hyphen_values = true)]
    pub samples: Vec<Samples>,
    /// Light paths of each sample, in all graphs: their parameter `spp` [default: each graph's own]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    pub per_sample: Option<u32>,
    /// Share of the pixels that get a sample, where budgets are in paths: paths of each sample follow, 4 for a budget of 0.2
    /// at 5%, and at least 1
    #[arg(long, value_name = "P%", conflicts_with_all = ["per_sample", "samples"], allow_hyphen_values = true)]
    pub density: Option<Percent>,
    /// Frames to compare, counted from 0 [default: 39 for a still camera; 19, 24 and 29 for a moving one]
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        value_parser = clap::value_parser!(u32).range(..=LAST_FRAME),
        allow_hyphen_values = true
    )]
    pub frames: Vec<u32>,
    /// Width and height of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "384x384", allow_hyphen_values = true)]
    pub size: Size,
    #[command(flatten)]
    pub changes: ChangeArgs,
    /// Light paths per pixel of the references; an even number, as their halves are compared
    #[arg(long, value_name = "N", default_value = "256", allow_hyphen_values = true)]
    pub spp: Halves,
    /// Light transport of the references [default: that of the graphs' samples, `trace.mode`, which must be the same]
    #[arg(long)]
    pub mode: Option<Light>,
    /// Default placement for nodes without `on:`
    #[arg(long, default_value = "auto", value_parser = values::backend())]
    pub backend: Backend,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Number of CPU threads [default: one per core]; does not affect the errors
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
    /// Keep references and finished cells in a folder, for later commands; it may be the folder of a `tradeoff`
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
    /// Write the figures as JSON; - writes them to stdout instead of the tables
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write the figures as CSV, with a line for each graph, view and budget
    #[arg(long, value_name = "FILE.csv")]
    pub csv: Option<PathBuf>,
    /// Plot PSNR and FLIP over light paths as an SVG picture
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

/// What `tradeoff --figure` shows.
#[derive(Args, Clone, Debug)]
pub struct FigureArgs {
    /// Draw a figure for a paper as SVG: whole pictures, crops, error maps and errors of graphs side by side
    #[arg(long, value_name = "FILE.svg", conflicts_with_all = ["list", "jobs", "run"])]
    pub figure: Option<PathBuf>,
    /// A crop of the figure, in pixels from the top left; up to four times [default: the two places in which the graphs'
    /// errors differ most, found for each view]
    #[arg(long = "crop", value_name = "X,Y,WxH", requires = "figure", allow_hyphen_values = true)]
    pub crops: Vec<Crop>,
    /// A column of the figure: a graph as the results name it, at the first budget or at another one (`epi, 10%`); up to
    /// seven times [default: all graphs at the first budget]
    #[arg(long, value_name = "GRAPH[, BUDGET]", requires = "figure")]
    pub show: Vec<String>,
    /// Width of the figure in millimetres: 178 are both columns of most journals, 85 one of them
    #[arg(long, value_name = "MM", requires = "figure", default_value_t = 178,
        value_parser = clap::value_parser!(u16).range(60..=500), allow_hyphen_values = true)]
    pub width: u16,
}

/// Arguments of `tradeoff`.
#[derive(Args, Clone, Debug)]
pub struct TradeoffArgs {
    /// The experiment's file
    #[arg(value_name = "EXPERIMENT.ron")]
    pub experiment: PathBuf,
    /// Folder for results, finished cells and references; created if it does not exist
    #[arg(long, value_name = "DIR", required_unless_present_any = ["list", "jobs"])]
    pub out: Option<PathBuf>,
    /// Measure the experiment's quick form
    #[arg(long)]
    pub quick: bool,
    /// List the cells, and with --out which are done, without running them
    #[arg(long, group = "part")]
    pub list: bool,
    /// Print a line of JSON for each cell, with --out for each that is not done
    #[arg(long, group = "part")]
    pub jobs: bool,
    /// Measure the cell of one line of --jobs, and keep it in DIR/cells
    #[arg(long, value_name = "JOB", group = "part")]
    pub run: Option<String>,
    /// Write the results of the cells that are in DIR/cells, without running others
    #[arg(long, group = "part")]
    pub collect: bool,
    #[command(flatten)]
    pub figure: FigureArgs,
    /// Number of CPU threads [default: one per core]; does not affect the errors
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    pub threads: Option<u16>,
}

/// Arguments of `encode`.
#[derive(Args, Clone, Debug)]
pub struct EncodeArgs {
    /// Points: a file, or the name of a scene, of which the vertices are taken; or a mesh for the codec repeats
    #[arg(value_name = "FILE|SCENE")]
    pub input: String,
    /// Output file; a .glb has a mesh with its repeated parts as instances
    #[arg(long, value_name = "FILE.vts|FILE.glb")]
    pub out: PathBuf,
    /// How points are stored [default: best, or repeats for a .glb]
    #[arg(long, value_parser = values::codec())]
    pub codec: Option<Encoding>,
    /// Levels of the tree [default: 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_LEVELS)), allow_hyphen_values = true)]
    pub levels: Option<u32>,
    /// Pools of each node, for the codecs streams and best [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(..=64), allow_hyphen_values = true)]
    pub pools: Option<u8>,
    /// The most translations of a pool: 88 as in the paper, or what 3 or 4 words of tags hold [default: 96]
    #[arg(long, value_name = "N", value_parser = values::translations())]
    pub translations: Option<usize>,
    /// A pool takes a vertex if it adds more than this part of the pool's translations, 0 to 1 [default: 0.25]
    #[arg(long, value_name = "PART", allow_hyphen_values = true)]
    pub threshold: Option<f64>,
    /// Number of the most frequent translations among which pools find theirs [default: 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536), allow_hyphen_values = true)]
    pub palette: Option<u32>,
    /// How far a vertex of a repeated part may be from where it was: a length, or a share of the part's radius
    /// [default: 0.001%]
    #[arg(long, value_name = "LENGTH|SHARE%", allow_hyphen_values = true)]
    pub tolerance: Option<Within>,
    /// Once points take longer than this to encode, keep what is done in OUT.part: after an interruption, the same command
    /// goes on from there
    #[arg(long, value_name = "SECONDS", default_value_t = 30, allow_hyphen_values = true)]
    pub keep_after: u32,
    /// Leave colours out, and the materials of a mesh
    #[arg(long)]
    pub no_colors: bool,
    /// Leave normals out
    #[arg(long)]
    pub no_normals: bool,
    /// Write the figures as JSON; - writes them to stdout instead of the table
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of `decode`.
#[derive(Args, Clone, Debug)]
pub struct DecodeArgs {
    /// A file that `encode` wrote
    #[arg(value_name = "FILE.vts")]
    pub input: PathBuf,
    /// Output file
    #[arg(long, value_name = "FILE.ply|FILE.glb")]
    pub out: PathBuf,
    /// Level of the tree, 1 is the coarsest [default: the finest]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_hyphen_values = true)]
    pub level: Option<u32>,
}

fn scene_help() -> String {
    let names: Vec<&str> = epigraph_scenes::scene_names().iter().map(|scene| scene.name).collect();
    format!("Scene: {}, or a .glb, .gltf, .obj, .ply, .vts or .ron file", names.join(", "))
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
    fn render_is_the_default_command() {
        let bare = Cli::try_parse_from(["epigraph", "my.ron", "--frames", "3"]).unwrap();
        assert!(bare.command.is_none());
        assert_eq!((bare.render.graph.as_deref(), bare.render.frames), (Some("my.ron"), 3));
        let named = Cli::try_parse_from(["epigraph", "render", "my.ron", "--frames", "3"]).unwrap();
        assert!(matches!(named.command, Some(Command::Render(args)) if args.frames == 3));
    }

    #[test]
    fn frames_to_compare_are_frames_that_can_run() {
        for frames in ["0", "9999999", "3,9999999"] {
            assert!(Cli::try_parse_from(["epigraph", "quality", "--frames", frames]).is_ok(), "{frames}");
        }
        for frames in ["10000000", "4294967295", "3,4294967295", "-1"] {
            let error = Cli::try_parse_from(["epigraph", "quality", "--frames", frames]).unwrap_err();
            assert!(error.to_string().contains("is not in 0..=9999999"), "{error}");
        }
    }

    #[test]
    fn negative_numbers_are_not_parsed_as_flags() {
        let error = Cli::try_parse_from(["epigraph", "--samples", "-5"]).unwrap_err().to_string();
        assert!(error.contains("'-5' for '--samples <N|P%>'") && error.contains("a count from 1"), "{error}");
    }
}
