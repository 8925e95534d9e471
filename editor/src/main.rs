//! `epigraph-editor`: opens a graph on a scene.

use std::process::ExitCode;

use clap::Parser;
use eframe::NativeOptions;
use egui::ViewportBuilder;
use epigraph_editor::{app::App, document::Document, engine::Options, files::find_graph};

/// Opens a render graph on a scene: see every image, change any parameter or wire, and save a file that is still yours.
#[derive(Parser)]
#[command(name = "epigraph-editor", version)]
struct Args {
    /// A graph file, or the name of one in the folder `graphs` here or above.
    #[arg(default_value = "epi")]
    graph: String,
    /// A scene's name or file.
    #[arg(long, default_value = "cornell")]
    scene: String,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), String> {
    let document = Document::open(&find_graph(&args.graph)).map_err(|problems| problems.to_string())?;
    let options = Options { scene: args.scene.clone(), ..Options::default() };
    let native = NativeOptions {
        viewport: ViewportBuilder::default().with_inner_size([1280.0, 720.0]).with_app_id("epigraph-editor"),
        ..NativeOptions::default()
    };
    let open =
        |creation: &eframe::CreationContext| Ok(Box::new(App::new(creation, document, options)) as Box<_>);
    eframe::run_native("Epigraph", native, Box::new(open)).map_err(|error| error.to_string())
}
