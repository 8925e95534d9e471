//! A flight through a point set: what the cut takes from frame to frame, and how far it is from all points.

use std::sync::Arc;

use epigraph::{Place, Run, Setup, Snapshot, Source};
use epigraph_core::GraphFile;
use epigraph_pictures::{
    Difference, Look, Picture, show,
    svg::{Anchor, Font, Svg},
};
use epigraph_scenes::{
    Scene,
    streams::{Model, PointSet},
};
use epigraph_stages::shared::streams::{NEW_BYTES, NODES, POINTS};
use serde_json::{Value, json};

use crate::{
    args::{BenchArgs, ChangeArgs},
    error::CliError,
    interrupt, open, progress,
};

/// The camera's path.
const CAMERA: &str = "fly";
const FRAMES: u32 = 60;
/// With `--quick`.
const QUICK: (u32, [u32; 2]) = (8, [128, 128]);
/// Smaller cells than any model has: all of its points.
const ALL_POINTS: [(&str, &str, &str); 1] = [("cut", "cell", "0.05")];
/// Frames whose times count, after as many that warm up.
const TIMED: usize = 6;

/// A frame of the flight.
pub struct Frame {
    /// Bytes of blocks that came.
    bytes: u32,
    nodes: u32,
    points: u32,
    /// Time of all stages.
    ms: f32,
    /// FLIP against all points in full detail.
    flip: f64,
    /// FLIP against the frame before, and what it would be with all points.
    change: [f64; 2],
}

/// A flight through a model.
pub struct Flight {
    pub name: String,
    size: [u32; 2],
    /// Bytes of the blocks of all nodes.
    all_bytes: usize,
    pub frames: Vec<Frame>,
}

impl Flight {
    /// Flies through a model.
    pub fn new(name: &str, model: Model, args: &BenchArgs) -> Result<Self, CliError> {
        let (frames, size) = if args.quick { QUICK } else { (args.frames.unwrap_or(FRAMES), args.size.0) };
        let points = PointSet::from(model);
        let all_bytes = 4 * points.nodes().map(epigraph_stages::shared::streams::block_words).sum::<usize>();
        let scene = Arc::new(Scene::of_points(name, Arc::new(points)));
        let mut cut = start(&scene, CAMERA, size, &[])?;
        let mut all = start(&scene, CAMERA, size, &ALL_POINTS)?;
        let bar = progress::bar(frames.into(), &format!("{name}: flight"), "frames");
        let mut found = Vec::new();
        let mut before: Option<[Picture; 2]> = None;
        for _ in 0..frames {
            interrupt::check()?;
            cut.frame()?;
            all.frame()?;
            let numbers: Vec<u32> = cut.snapshot("cut.numbers")?.get();
            let now = [picture(cut.snapshot("image")?), picture(all.snapshot("image")?)];
            let change = before
                .as_ref()
                .map_or([0.0; 2], |before| [0, 1].map(|i| Difference::new(&before[i], &now[i]).flip()));
            found.push(Frame {
                bytes: numbers[NEW_BYTES as usize],
                nodes: numbers[NODES as usize],
                points: numbers[POINTS as usize],
                ms: cut.executor.times().iter().sum(),
                flip: Difference::new(&now[1], &now[0]).flip(),
                change,
            });
            before = Some(now);
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(Self { name: name.into(), size, all_bytes, frames: found })
    }

    /// A line of text.
    pub fn text(&self) -> String {
        let later = &self.frames[1..];
        let most = |of: &dyn Fn(&Frame) -> f64| later.iter().map(of).fold(0.0, f64::max);
        let mean = |of: &dyn Fn(&Frame) -> f64| later.iter().map(of).sum::<f64>() / later.len().max(1) as f64;
        format!(
            "{}: {} frames at {}x{}; first {} bytes, then {:.0} a frame and {:.0} at most, of {} for all levels; {:.0} \
             points and {:.1} ms a frame; FLIP against all points {:.4} at most; from frame to frame {:.4} at most, with \
             all points {:.4}",
            self.name,
            self.frames.len(),
            self.size[0],
            self.size[1],
            self.frames[0].bytes,
            mean(&|frame| frame.bytes.into()),
            most(&|frame| frame.bytes.into()),
            self.all_bytes,
            mean(&|frame| frame.points.into()),
            mean(&|frame| frame.ms.into()),
            self.frames.iter().map(|frame| frame.flip).fold(0.0, f64::max),
            most(&|frame| frame.change[0]),
            most(&|frame| frame.change[1]),
        )
    }

    pub fn json(&self) -> Value {
        let frames = self.frames.iter().map(|frame| {
            json!({
                "new_bytes": frame.bytes, "nodes": frame.nodes, "points": frame.points, "ms": frame.ms,
                "flip": frame.flip, "change": frame.change[0], "change_of_all": frame.change[1],
            })
        });
        json!({
            "camera": CAMERA, "size": self.size, "all_bytes": self.all_bytes,
            "frames": frames.collect::<Vec<_>>(),
        })
    }
}

/// Frames a second that show all points of a model, on the CPU: the median.
pub fn frames_per_second(name: &str, model: Model, args: &BenchArgs) -> Result<f64, CliError> {
    let size = if args.quick { QUICK.1 } else { args.size.0 };
    let scene = Arc::new(Scene::of_points(name, Arc::new(model.into())));
    let mut run = start(&scene, "orbit", size, &ALL_POINTS)?;
    let mut times = Vec::new();
    for _ in 0..2 * TIMED {
        interrupt::check()?;
        run.advance(false)?;
        times.push(run.executor.times().iter().sum::<f32>());
    }
    let times = &mut times[TIMED..];
    times.sort_by(f32::total_cmp);
    Ok(1000.0 / f64::from(times[TIMED / 2]))
}

/// The graph `streams` with room for all points.
fn start(
    scene: &Arc<Scene>,
    camera: &str,
    size: [u32; 2],
    more: &[(&str, &str, &str)],
) -> Result<Run, CliError> {
    let points = scene.points.iter().flat_map(|set| set.models()).flat_map(Model::leaves);
    let most: usize = points.map(|leaf| leaf.cell_count()).sum();
    let per_pixel = (most as f64 / (f64::from(size[0]) * f64::from(size[1])) + 0.1).max(4.0);
    let registry = Arc::new(epigraph_stages::registry());
    let mut file: GraphFile = open::graph("streams", &ChangeArgs::default(), &registry)?;
    let per_pixel = format!("{per_pixel:.2}");
    let room = [("cut", "points_per_pixel", &*per_pixel), ("decode", "points_per_pixel", &*per_pixel)];
    for (node, param, value) in room.iter().chain(more) {
        file.set_param(node, param, value)?;
    }
    let place = Place::new(scene.clone(), camera)?;
    let mut compiled = Setup::new(file).at(&place).size(size).compile()?;
    compiled.keep(&[Source { node: "cut".into(), port: "numbers".into() }])?;
    Ok(compiled.start()?)
}

fn picture(image: &Snapshot) -> Picture {
    Picture::of_port(image, &show(image, &Look::default()))
}

const WIDTH: f64 = 960.0;
const LEFT: f64 = 90.0;
const HEIGHT: f64 = 120.0;
const TITLE: Font = Font { size: 20.0, color: "#1b1f24", bold: true };
const LABEL: Font = Font { size: 12.5, color: "#30363d", bold: false };
const QUIET: Font = Font { size: 11.5, color: "#6e7781", bold: false };
const LINE: &str = "#2563a8";
const OTHER: &str = "#c0392b";

/// A line of a plot.
struct Line {
    of: fn(&Frame) -> f64,
    color: &'static str,
    /// For the legend; empty for the only one.
    name: &'static str,
}

/// The flights as plots over the frames.
pub fn plot<'a>(flights: impl Iterator<Item = &'a Flight>) -> String {
    let mut svg = Svg::default();
    let mut y = 20.0;
    for flight in flights {
        y += 26.0;
        svg.text([LEFT, y], &format!("Flight through {}", flight.name), Anchor::Start, TITLE);
        let line = |of, color, name| Line { of, color, name };
        let panels = [
            ("bytes that came", vec![line(|frame| frame.bytes.into(), LINE, "")]),
            ("points of the cut", vec![line(|frame| frame.points.into(), LINE, "")]),
            ("milliseconds", vec![line(|frame| frame.ms.into(), LINE, "")]),
            (
                "FLIP",
                vec![
                    line(|frame| frame.flip, OTHER, "against all points"),
                    line(|frame| frame.change[0], LINE, "from frame to frame"),
                ],
            ),
        ];
        for (title, lines) in panels {
            y += 26.0;
            svg.text([LEFT, y], title, Anchor::Start, LABEL);
            let mut x = LEFT + 160.0;
            for Line { color, name, .. } in lines.iter().filter(|line| !line.name.is_empty()) {
                svg.line([x, y - 4.0], [x + 20.0, y - 4.0], color, 2.0);
                svg.text([x + 26.0, y], name, Anchor::Start, QUIET);
                x += 170.0;
            }
            y += 8.0;
            let of = |line: &Line| flight.frames.iter().map(line.of).collect::<Vec<_>>();
            let most = lines.iter().flat_map(of).fold(0.0, f64::max).max(1e-9);
            for share in [0.0, 0.5, 1.0] {
                let at = y + HEIGHT * (1.0 - share);
                svg.line([LEFT, at], [WIDTH - 30.0, at], "#e3e6ea", 1.0);
                svg.text([LEFT - 8.0, at + 4.0], &crate::axis::number(share * most), Anchor::End, QUIET);
            }
            let step = (WIDTH - 30.0 - LEFT) / flight.frames.len().max(2).saturating_sub(1) as f64;
            for line in &lines {
                let points = of(line).into_iter().enumerate();
                let points: Vec<[f64; 2]> = points
                    .map(|(i, value)| [LEFT + step * i as f64, y + HEIGHT * (1.0 - value / most)])
                    .collect();
                svg.polyline(&points, line.color, 1.5);
            }
            y += HEIGHT;
        }
        y += 18.0;
        svg.text([LEFT, y], "frame 0", Anchor::Start, QUIET);
        let last = format!("frame {}", flight.frames.len() - 1);
        svg.text([WIDTH - 30.0, y], &last, Anchor::End, QUIET);
        y += 14.0;
    }
    svg.finish([WIDTH, y + 10.0])
}
