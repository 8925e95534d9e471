//! The benchmark's figures as JSON.

use serde_json::{Map, Value, json};

use super::{
    Row, Split, Sweep,
    column::COLUMNS,
    papers::{self, PAPERS, Paper},
    report::{Report, ratio},
    times::Times,
};

/// All figures of the report.
pub fn figures(report: &Report) -> Value {
    let args = report.args;
    let rows = |rows: &[Row]| rows.iter().map(|row| of_row(report, row)).collect::<Vec<_>>();
    let scaling: Map<String, Value> = [Sweep::Pixels, Sweep::Points, Sweep::Edges]
        .into_iter()
        .filter(|sweep| report.sweeps.contains(sweep))
        .map(|sweep| {
            let rows = report.sweep(sweep).into_iter();
            let row = |(quantity, row)| {
                let mut value = of_row(report, row);
                value["quantity"] = json!(quantity);
                value
            };
            (sweep.to_string(), rows.map(row).collect::<Vec<_>>().into())
        })
        .collect();
    let skipped: Vec<Value> = report
        .results
        .skipped
        .iter()
        .map(|skipped| json!({ "what": skipped.what, "why": skipped.why }))
        .collect();
    json!({
        "machine": report.machine.json(),
        "size": args.size.0,
        "camera": args.camera,
        "seed": args.seed,
        "columns": COLUMNS.iter().map(|column| (column.name.into(), column.doc.into())).collect::<Map<_, _>>(),
        "rows": rows(&report.results.rows),
        "papers": PAPERS.iter().flat_map(of_paper).collect::<Vec<_>>(),
        "papers_source": papers::SOURCE,
        "papers_machine": papers::MACHINE,
        "scaling": scaling,
        "skipped": skipped,
    })
}

/// A measured row, with all keys of the papers' rows and more.
fn of_row(report: &Report, row: &Row) -> Value {
    let measured = &row.measured;
    let mut value = of_times(&measured.times);
    let parts: Vec<Value> = measured
        .parts
        .iter()
        .map(|part| {
            let backend = part.side.map(|side| side.to_string());
            json!({ "node": part.name, "kind": part.kind, "backend": backend, "ms": rounded(part.ms) })
        })
        .collect();
    let extra = json!({
        "scene": row.scene,
        "backend": row.backend.to_string(),
        "software": report.machine.software && row.backend != Split::Cpu,
        "graph": row.graph,
        "size": measured.size,
        "edges": measured.edges,
        "points": measured.points,
        "samples_per_frame": measured.samples,
        "frame_p95_ms": rounded(measured.p95),
        "trace_ms": rounded(measured.trace),
        "frames": measured.frames,
        "warm_up_frames": measured.warm_up,
        "cloud_filled": measured.filled,
        "nodes": parts,
        "papers_gpu_ratio": ratio(|paper| &paper.gpu, row).map(rounded),
        "papers_cpu_ratio": ratio(|paper| &paper.cpu, row).map(rounded),
    });
    merge(&mut value, extra);
    value
}

/// The papers' two rows for a scene.
fn of_paper(paper: &Paper) -> [Value; 2] {
    [("gpu", &paper.gpu), ("cpu", &paper.cpu)].map(|(backend, times)| {
        let mut value = of_times(times);
        let extra = json!({
            "scene": paper.scene,
            "papers_scene": paper.theirs,
            "backend": backend,
            "edges": paper.edges,
            "points": papers::POINTS,
        });
        merge(&mut value, extra);
        value
    })
}

fn of_times(times: &Times) -> Value {
    let mut value: Map<String, Value> = COLUMNS
        .iter()
        .zip(times.columns)
        .map(|(column, ms)| (column.name.into(), json!(ms.map(rounded))))
        .collect();
    value.insert("rest".into(), json!(rounded(times.rest)));
    value.insert("gpu_ms".into(), json!(times.gpu.map(rounded)));
    value.insert("frame_ms".into(), json!(rounded(times.frame)));
    value.insert("fps".into(), json!(rounded(times.fps())));
    value.into()
}

/// Adds the members of one object to another.
fn merge(into: &mut Value, from: Value) {
    if let (Value::Object(into), Value::Object(from)) = (into, from) {
        into.extend(from);
    }
}

/// Rounded to four decimals, the resolution of the clocks.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_rows_have_the_same_keys_as_ours() {
        let [gpu, cpu] = of_paper(papers::of("cornell").unwrap());
        assert_eq!((&gpu["frame_ms"], &gpu["P2"], &gpu["edges"]), (&42.82.into(), &12.31.into(), &75.into()));
        assert_eq!(
            (&cpu["frame_ms"], &cpu["I1"], &cpu["gpu_ms"]),
            (&69.14.into(), &Value::Null, &Value::Null)
        );
        assert!((gpu["fps"].as_f64().unwrap() - 23.35).abs() < 0.01);
    }
}
