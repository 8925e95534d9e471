//! `epigraph decode`: the points of a file of streams as PLY.

use std::time::Instant;

use epigraph_points::ply;
use epigraph_streams::{Model, Node};

use crate::{
    args::DecodeArgs,
    encode::require_ending,
    error::CliError,
    interrupt,
    output::{Outputs, print},
    progress,
};

/// Reads the file, decodes a level of it and writes the points.
pub fn decode(args: &DecodeArgs) -> Result<(), CliError> {
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
