//! `epigraph decode`: the points of a file of streams as PLY, or the mesh of repeats as glTF.

use std::time::Instant;

use epigraph_points::ply;
use epigraph_streams::{Model, Node, repeats::Repeats};

use crate::{
    args::DecodeArgs,
    encode::{has_ending, require_ending},
    error::CliError,
    interrupt,
    output::{Outputs, print},
    progress,
};

/// Reads the file and writes its points, or the mesh that it holds.
pub fn decode(args: &DecodeArgs) -> Result<(), CliError> {
    if has_ending(&args.out, "glb") { mesh(args) } else { points(args) }
}

/// Writes repeats as glTF.
fn mesh(args: &DecodeArgs) -> Result<(), CliError> {
    if args.level.is_some() {
        return Err(CliError::Input("--level is for points; a mesh has none".into()));
    }
    let mut outputs = Outputs::default();
    let out = outputs.add("--out", &args.out)?;
    let repeats =
        progress::spinner(format!("reading {}", args.input.display()), || Repeats::read(&args.input))?;
    let mut outputs = outputs.ready()?;
    interrupt::check()?;
    let bytes = repeats.to_glb(&[]).map_err(|error| CliError::write(&args.out, error))?;
    outputs.put(out, &bytes)?;
    outputs.commit()?;
    let (shapes, parts) = (repeats.shapes().len(), repeats.instances().len());
    print(&format!("{}: {parts} parts of {shapes} shapes\n", args.out.display()))
}

/// Decodes a level of a tree and writes the points.
fn points(args: &DecodeArgs) -> Result<(), CliError> {
    require_ending(&args.out, "ply")?;
    let mut outputs = Outputs::default();
    let out = outputs.add("--out", &args.out)?;
    let model = progress::spinner(format!("reading {}", args.input.display()), || Model::read(&args.input))?;
    let levels = model.levels();
    let level = args.level.unwrap_or(levels);
    if level > levels {
        let text = format!(
            "--level {level}: {} has {levels} levels; 1 is the coarsest, {levels} has all points",
            args.input.display()
        );
        return Err(CliError::Input(text));
    }
    let mut outputs = outputs.ready()?;
    interrupt::check()?;
    let start = Instant::now();
    let nodes: Vec<&Node> = model.level(level).collect();
    let mut bytes = Vec::new();
    progress::spinner("decoding".into(), || ply::write(&mut bytes, model.origin(), &nodes))
        .map_err(|error| CliError::write(&args.out, error))?;
    let seconds = start.elapsed().as_secs_f64();
    interrupt::check()?;
    outputs.put(out, &bytes)?;
    outputs.commit()?;
    let count: usize = nodes.iter().map(|node| node.cell_count()).sum();
    print(&format!(
        "{}: {count} points of level {level} of {levels}, from {} nodes, in {seconds:.2} s\n",
        args.out.display(),
        nodes.len()
    ))
}
