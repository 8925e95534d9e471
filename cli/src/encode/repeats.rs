//! `epigraph encode --codec repeats`: a mesh as shapes and instances.

use std::{ops::ControlFlow, time::Instant};

use epigraph_scenes::{Material, Scene};
use epigraph_streams::repeats::{
    Found, GlbMaterial, RepeatsError, Settings, Surface, Tolerance, find_watched,
};
use serde_json::{Value, json};

use super::has_ending;
use crate::{args::EncodeArgs, error::CliError, interrupt, output::Outputs, progress, table::Table};

/// Reads a mesh, finds the parts that repeat and writes the file.
pub fn encode(args: &EncodeArgs) -> Result<(), CliError> {
    let mut outputs = Outputs::default();
    let out = outputs.add("--out", &args.out)?;
    let json = outputs.json(args.json.as_deref())?;
    let scene = progress::spinner(format!("reading {}", args.input), || Scene::load(&args.input))?;
    let mut outputs = outputs.ready()?;
    interrupt::check()?;
    let start = Instant::now();
    let settings = settings(args);
    let found = search(args, &scene, &settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let bytes = if has_ending(&args.out, "glb") {
        let used = own_faces(&scene).map(|face| scene.mesh.material[face] as usize + 1).max().unwrap_or(0);
        let named = if args.no_colors { 0 } else { used };
        let materials: Vec<GlbMaterial> = scene.materials[..named].iter().map(material).collect();
        found.repeats.to_glb(&materials).map_err(|error| CliError::write(&args.out, error))?
    } else {
        found.repeats.to_file()
    };
    outputs.put(out, &bytes)?;
    let triangles = own_faces(&scene).count();
    let report = Report { args, found: &found, settings: &settings, triangles, bytes: bytes.len(), seconds };
    outputs.finish(json, &report.json(), &report.text())
}

/// The triangles that are not of an added light.
fn own_faces(scene: &Scene) -> impl Iterator<Item = usize> {
    (0..scene.mesh.triangles.len()).filter(|face| !scene.added.contains(face))
}

fn settings(args: &EncodeArgs) -> Settings {
    let default = Settings::default();
    Settings { tolerance: args.tolerance.map_or(default.tolerance, |within| within.0), ..default }
}

/// Searches with a progress bar, until the user interrupts.
fn search(args: &EncodeArgs, scene: &Scene, settings: &Settings) -> Result<Found, CliError> {
    let mesh = &scene.mesh;
    // The scene has normals at corners of triangles. Corners that are alike become one vertex of a shape again.
    let positions: Vec<_> = own_faces(scene).flat_map(|face| mesh.corners(face)).collect();
    let triangles: Vec<[u32; 3]> =
        (0..positions.len() as u32 / 3).map(|face| [0, 1, 2].map(|corner| 3 * face + corner)).collect();
    let has_normals = !args.no_normals && !mesh.corner_normals.is_empty();
    let normals: Option<Vec<_>> =
        has_normals.then(|| own_faces(scene).flat_map(|face| mesh.corner_normals[face]).collect());
    let materials: Vec<u32> = own_faces(scene).map(|face| mesh.material[face]).collect();
    let surface = Surface {
        positions: &positions,
        triangles: &triangles,
        normals: normals.as_deref(),
        materials: (!args.no_colors).then_some(materials.as_slice()),
        origin: scene.origin,
        ..Surface::default()
    };
    // The number of parts is known when the first one is done.
    let bar = progress::bar(1000, "comparing parts", "thousandths");
    let watch = |share: f64| {
        bar.set_position((1000.0 * share) as u64);
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let found = find_watched(&surface, settings, &watch);
    bar.finish_and_clear();
    found.map_err(|error| match error {
        RepeatsError::Stopped => CliError::Interrupted,
        error => CliError::Input(format!("{}: {error}", args.input)),
    })
}

/// The factors of a material of a scene.
fn material(material: &Material) -> GlbMaterial {
    GlbMaterial {
        name: material.name.clone(),
        color: material.color.extend(1.0).to_array(),
        metallic: material.metallic,
        roughness: material.roughness,
        emission: material.emission.to_array(),
    }
}

/// What was found.
struct Report<'a> {
    args: &'a EncodeArgs,
    found: &'a Found,
    settings: &'a Settings,
    triangles: usize,
    /// Of the file.
    bytes: usize,
    seconds: f64,
}

impl Report<'_> {
    fn text(&self) -> String {
        let Found { repeats, report, .. } = self.found;
        let mut table = Table::new(&["stored", ">number", ">bytes"]);
        let bytes = repeats.bytes();
        let vertices = repeats.shapes().iter().map(|shape| shape.vertex_count()).sum::<usize>();
        let triangles = repeats.shapes().iter().map(|shape| shape.triangles().len()).sum::<usize>();
        for (what, number, bytes) in [
            ("positions", vertices, bytes.vertices),
            ("normals", vertices, bytes.attributes),
            ("triangles", triangles, bytes.triangles),
            ("instances", report.parts, bytes.instances),
            ("records", report.shapes, bytes.records),
        ] {
            if bytes > 0 {
                table.row([what.into(), number.to_string(), bytes.to_string()]);
            }
        }
        let mut notes = String::new();
        if report.degenerate > 0 {
            notes += &format!("left out: {} triangles without three different corners\n", report.degenerate);
        }
        if report.given_up > 0 {
            notes += &format!(
                "{} parts took too much work to be compared with all others; they are stored by themselves\n",
                report.given_up
            );
        }
        let tolerance = match self.settings.tolerance {
            Tolerance::Relative(share) => format!("{}% of its part's radius", 100.0 * share),
            Tolerance::Distance(distance) => distance.to_string(),
        };
        let in_file = if has_ending(&self.args.out, "glb") {
            // The table has what a .vts file has.
            String::new()
        } else {
            format!("\n{table}")
        };
        let placed = repeats.vertex_count();
        format!(
            "{}: {} triangles, {placed} vertices in {} parts\n\
             {} shapes, {} copies: {:.2} parts for each shape\n\
             {notes}largest deviation {:.2e}; allowed are {tolerance} and rounding, {:.2e} at most\n{in_file}\
             {}: {} bytes, {:.3} per vertex of the input\nfound in {:.2} s\n",
            self.args.input,
            self.triangles,
            report.parts,
            report.shapes,
            report.copies(),
            report.ratio(),
            report.deviation,
            report.bound,
            self.args.out.display(),
            self.bytes,
            self.bytes as f64 / placed as f64,
            self.seconds,
        )
    }

    fn json(&self) -> Value {
        let Found { repeats, report, .. } = self.found;
        let bytes = repeats.bytes();
        json!({
            "input": self.args.input, "codec": "repeats", "triangles": self.triangles, "parts": report.parts,
            "shapes": report.shapes, "copies": report.copies(), "ratio": report.ratio(),
            "given_up": report.given_up, "degenerate": report.degenerate, "deviation": report.deviation,
            "bound": report.bound, "position_bytes": bytes.vertices, "instance_bytes": bytes.instances,
            "attribute_bytes": bytes.attributes, "triangle_bytes": bytes.triangles, "record_bytes": bytes.records,
            "bytes": self.bytes, "seconds": self.seconds,
        })
    }
}
