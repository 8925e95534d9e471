//! `epigraph encode`: points as a file of streams, or a mesh as the parts that repeat.

mod part;
mod repeats;

use std::{ops::ControlFlow, path::Path, time::Instant};

use epigraph_files::is_stream;
use epigraph_points::{Input, LeftOut, read};
use epigraph_streams::{
    Codec, EncodeError, Layout, MOST_LEVELS, Model, Node, Points, Pool, Settings, Step, encode_from,
};
use serde_json::{Value, json};

use crate::{
    args::EncodeArgs, error::CliError, interrupt, output::Outputs, progress, table::Table, values::Encoding,
};
use part::Part;

/// Reads points or a mesh, encodes and writes.
pub fn encode(args: &EncodeArgs) -> Result<(), CliError> {
    let glb = has_ending(&args.out, "glb");
    let default = if glb { Encoding::Repeats } else { Encoding::Points(Settings::default().codec) };
    match args.codec.unwrap_or(default) {
        Encoding::Repeats => {
            if !glb {
                require_ending(&args.out, "vts")?;
            }
            let given = [
                ("--levels", args.levels.is_some()),
                ("--pools", args.pools.is_some()),
                ("--translations", args.translations.is_some()),
                ("--threshold", args.threshold.is_some()),
                ("--palette", args.palette.is_some()),
            ];
            if let Some((option, _)) = given.into_iter().find(|(_, given)| *given) {
                return Err(CliError::Input(format!(
                    "{option} is for points; the codec repeats takes --tolerance"
                )));
            }
            repeats::encode(args)
        }
        Encoding::Points(codec) => {
            if glb {
                let text = format!(
                    "a .glb holds a mesh: --codec repeats; --codec {} needs a .vts file",
                    codec.name()
                );
                return Err(CliError::write(&args.out, text));
            }
            if args.tolerance.is_some() {
                let text = "--tolerance is for --codec repeats; more --levels make points more precise";
                return Err(CliError::Input(text.into()));
            }
            points(args, codec)
        }
    }
}

/// Reads points, encodes them and writes the file.
fn points(args: &EncodeArgs, codec: Codec) -> Result<(), CliError> {
    require_ending(&args.out, "vts")?;
    let mut outputs = Outputs::default();
    let out = outputs.add("--out", &args.out)?;
    let json = outputs.json(args.json.as_deref())?;
    let Input { mut points, left_out } =
        progress::spinner(format!("reading {}", args.input), || read(&args.input))?;
    let mut outputs = outputs.ready()?;
    interrupt::check()?;
    if args.no_colors {
        points.colors = None;
    }
    if args.no_normals {
        points.normals = None;
    }
    let settings = settings(args, codec);
    let start = Instant::now();
    let part = Part::new(args, &settings)?;
    let model = encoded(&points, &settings, "", &part)?;
    let seconds = start.elapsed().as_secs_f64();
    drop(points);
    let bytes = model.to_bytes();
    outputs.put(out, &bytes)?;
    let report = Report { args, settings: &settings, left_out, model: &model, bytes: bytes.len(), seconds };
    outputs.finish(json, &report.json(), &report.text())?;
    Ok(part.remove()?)
}

/// The settings of a command line.
fn settings(args: &EncodeArgs, codec: Codec) -> Settings {
    let default = Settings::default();
    Settings {
        codec,
        levels: args.levels.unwrap_or(default.levels),
        pools: args.pools.map_or(default.pools, usize::from),
        translations: args.translations.unwrap_or(default.translations),
        palette: args.palette.map_or(default.palette, |palette| palette as usize),
        threshold: args.threshold.unwrap_or(default.threshold),
    }
}

/// Encodes with a progress bar, until the user interrupts. `label` precedes the bar's words.
pub fn watched(points: &Points, settings: &Settings, label: &str) -> Result<Model, CliError> {
    encoded(points, settings, label, &Part::default())
}

fn encoded(points: &Points, settings: &Settings, label: &str, part: &Part) -> Result<Model, CliError> {
    let count = points.positions.len() as f64;
    let bar = progress::bar(count as u64, "", "points");
    let watch = |step: Step, part: f64| {
        let what = match step {
            Step::Divide => "dividing",
            Step::Store => "encoding",
        };
        bar.set_message(format!("{label}{what}"));
        bar.set_position((count * part) as u64);
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let model = encode_from(points, settings, &watch, &part.kept, &|record| part.keep(record));
    bar.finish_and_clear();
    if model.as_ref().is_err_and(|error| *error == EncodeError::Stopped) {
        part.say_how_to_go_on();
    }
    model.map_err(|error| match error {
        EncodeError::Stopped => CliError::Interrupted,
        error => CliError::Input(error.to_string()),
    })
}

/// Whether a file's name ends so.
pub fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case(ending))
}

/// Refuses a file of another ending, unless it is a pipe or a device.
pub fn require_ending(path: &Path, ending: &str) -> Result<(), CliError> {
    if has_ending(path, ending) || is_stream(path) {
        return Ok(());
    }
    Err(CliError::write(path, format!("its name must end in .{ending}")))
}

/// What was encoded.
struct Report<'a> {
    args: &'a EncodeArgs,
    settings: &'a Settings,
    left_out: LeftOut,
    model: &'a Model,
    /// Of the file.
    bytes: usize,
    seconds: f64,
}

/// Figures of a cut through the tree.
struct Level {
    level: u32,
    nodes: usize,
    /// Points that were encoded.
    points: usize,
    /// Cells, by what contains them.
    in_pools: usize,
    in_bricks: usize,
    single: usize,
    /// Bytes of positions, colours and normals.
    bytes: usize,
    /// Bytes of positions.
    positions: usize,
}

impl Level {
    fn new(model: &Model, level: u32) -> Self {
        let nodes: Vec<&Node> = model.level(level).collect();
        let sum = |of: &dyn Fn(&Node) -> usize| nodes.iter().map(|node| of(node)).sum::<usize>();
        let covered = |bricks: bool| {
            let pools = |node: &Node| {
                node.pools().iter().filter(|pool| pool.is_of_bricks() == bricks).map(Pool::points).sum()
            };
            sum(&pools)
        };
        Self {
            level,
            nodes: nodes.len(),
            points: sum(&Node::points),
            in_pools: covered(false),
            in_bricks: covered(true),
            single: sum(&|node| node.singles().len()),
            bytes: sum(&bytes),
            positions: sum(&|node| Layout::PACKED.node(node)),
        }
    }

    fn cells(&self) -> usize {
        self.in_pools + self.in_bricks + self.single
    }

    fn per_cell(&self, count: usize) -> f64 {
        count as f64 / self.cells() as f64
    }
}

/// Bytes of a node's positions, colours and normals.
fn bytes(node: &Node) -> usize {
    let attributes =
        [node.colors(), node.normals()].into_iter().flatten().map(|all| 4 * all.len()).sum::<usize>();
    Layout::PACKED.node(node) + attributes
}

impl Report<'_> {
    fn levels(&self) -> impl Iterator<Item = Level> {
        (1..=self.model.levels()).map(|level| Level::new(self.model, level))
    }

    fn has(&self, values: fn(&Node) -> Option<&[u32]>) -> bool {
        values(&self.model.nodes()[0]).is_some()
    }

    fn text(&self) -> String {
        let mut table = Table::new(&[
            ">level",
            ">nodes",
            ">points",
            ">merged",
            ">bytes",
            ">per point",
            ">position",
            ">pools",
            ">bricks",
            ">single",
        ]);
        for level in self.levels() {
            let share = |count| format!("{:.1}%", 100.0 * level.per_cell(count));
            table.row([
                level.level.to_string(),
                level.nodes.to_string(),
                level.cells().to_string(),
                (level.points - level.cells()).to_string(),
                level.bytes.to_string(),
                format!("{:.2}", level.per_cell(level.bytes)),
                format!("{:.2}", level.per_cell(level.positions)),
                share(level.in_pools),
                share(level.in_bricks),
                share(level.single),
            ]);
        }
        let given = self.model.nodes()[0].points();
        let with = match (self.has(Node::colors), self.has(Node::normals)) {
            (true, true) => ", with colours and normals",
            (true, false) => ", with colours",
            (false, true) => ", with normals",
            (false, false) => "",
        };
        let left_out = left_out(self.left_out).map_or(String::new(), |text| format!("left out: {text}\n"));
        format!(
            "{}: {given} points{with}\n{left_out}\n{table}{}\n{}: {} bytes for all levels, {:.3} per point of the input\n\
             encoded in {:.1} s, {:.0} points per second\n",
            self.args.input,
            self.advice(),
            self.args.out.display(),
            self.bytes,
            self.bytes as f64 / given as f64,
            self.seconds,
            given as f64 / self.seconds
        )
    }

    /// What to do if the last level is much coarser than the points.
    fn advice(&self) -> String {
        let last = Level::new(self.model, self.model.levels());
        let merged = last.points - last.cells();
        if 4 * merged < last.points || self.settings.levels == MOST_LEVELS {
            return String::new();
        }
        let share = 100.0 * merged as f64 / last.points as f64;
        format!(
            "{share:.0}% of the points share a cell of the last level with another one; more --levels tell them apart\n"
        )
    }

    fn json(&self) -> Value {
        let levels: Vec<Value> = self
            .levels()
            .map(|level| {
                json!({
                    "level": level.level, "nodes": level.nodes, "points": level.cells(),
                    "merged": level.points - level.cells(), "bytes": level.bytes,
                    "position_bytes": level.positions, "in_pools": level.in_pools,
                    "in_bricks": level.in_bricks, "single": level.single,
                })
            })
            .collect();
        let (args, settings) = (self.args, self.settings);
        json!({
            "input": args.input, "points": self.model.nodes()[0].points(),
            "left_out": { "not_numbers": self.left_out.not_numbers, "withheld": self.left_out.withheld },
            "colors": self.has(Node::colors), "normals": self.has(Node::normals),
            "origin": self.model.origin().to_array(), "codec": settings.codec.name(), "levels": levels,
            "pools": settings.pools, "translations": settings.translations, "threshold": settings.threshold,
            "palette": settings.palette, "bytes": self.bytes, "seconds": self.seconds,
        })
    }
}

/// What was left out, in words.
fn left_out(left_out: LeftOut) -> Option<String> {
    let LeftOut { not_numbers, withheld } = left_out;
    let reasons = [
        (not_numbers, "whose coordinates are no numbers, or too large"),
        (withheld, "that the file calls withheld"),
    ];
    let reasons: Vec<String> = reasons
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, reason)| format!("{count} points {reason}"))
        .collect();
    (!reasons.is_empty()).then(|| reasons.join(", "))
}
