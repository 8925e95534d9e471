//! The command line, which opens the window.

use std::process::ExitCode;

use clap::Parser;
use eframe::NativeOptions;
use egui::ViewportBuilder;
use epigraph::Registry;

use crate::{app::App, engine::Options, opening::Opening, store::Store};

/// Opens a render graph on a scene. See every image, change any parameter or wire, and save without reformatting the
/// file.
#[derive(Parser)]
#[command(name = "epigraph-editor", version)]
struct Args {
    /// A graph file, or the name of one in the folder `graphs` here or above.
    /// Default: the graph of the last session, or epi.
    graph: Option<String>,
    /// A scene's name or file. Default: the scene of the last session, or cornell.
    #[arg(long)]
    scene: Option<String>,
    /// Do not restore the last session, and do not save this one.
    #[arg(long)]
    fresh: bool,
}

/// Runs the editor with this process's arguments and these kinds of stage, until its window is closed.
pub fn main(registry: Registry) -> ExitCode {
    match run(&Args::parse(), registry) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args, registry: Registry) -> Result<(), String> {
    let opening = Opening::new(
        Store::of_user().filter(|_| !args.fresh),
        args.graph.as_deref(),
        args.scene.as_deref(),
        Options::default(),
    )?;
    let native = NativeOptions {
        viewport: ViewportBuilder::default().with_inner_size([1280.0, 720.0]).with_app_id("epigraph-editor"),
        ..NativeOptions::default()
    };
    let open =
        |creation: &eframe::CreationContext| Ok(Box::new(App::open(creation, opening, registry)) as Box<_>);
    eframe::run_native("Epigraph", native, Box::new(open)).map_err(|error| error.to_string())
}
