//! Times of the render cache's stages on the CPU: 512x512 pixels, about 300,000 points, cornell, orbit, 5% of the
//! pixels sampled per frame. The time of a frame excludes tracing, which is measured separately.
//!
//! `cargo bench -p epigraph-tests` runs it.

use std::{sync::Arc, time::Duration};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use epigraph_core::{Settings, Side, Step};
use epigraph_scenes::{CameraPath, Hit, Job, Scene, TraceSettings, Tracer};
use epigraph_tests::{Run, Stage, graph, sampled};

const SIZE: [u32; 2] = [512, 512];

fn stages(criterion: &mut Criterion) {
    let settings = Settings { side: Side::Cpu, ..sampled(SIZE, 0.05) };
    let mut run = Run::new(&graph("render-cache.ron"), Stage { scene: "cornell", camera: "orbit", settings });
    run.executor.profile = true;
    let steps: Vec<(usize, String)> = run
        .executor
        .plan()
        .steps
        .iter()
        .enumerate()
        .filter(|(_, step)| matches!(step, Step::Run(_)))
        .map(|(index, step)| (index, run.executor.plan().step_name(step)))
        .collect();
    run.frames(30);
    let mut group = criterion.benchmark_group("render cache, cpu, 512x512");
    group.sample_size(30).measurement_time(Duration::from_secs(3));
    let mut measure = |name: &str, counts: &dyn Fn(&str) -> bool| {
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|frames| {
                let mut ms = 0.0;
                for _ in 0..frames {
                    run.frame(false);
                    let times = run.executor.times();
                    let counted = steps.iter().filter(|(_, step)| counts(step));
                    ms += counted.map(|(index, _)| f64::from(times[*index])).sum::<f64>();
                }
                // Skipped stages take no measurable time, but the harness needs a positive one.
                Duration::from_secs_f64(ms.max(1e-6) / 1000.0)
            });
        });
    };
    measure("frame without tracing", &|step| step != "trace");
    for (_, name) in &steps {
        measure(name, &|step| step == name);
    }
    group.finish();
}

fn rays(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("tracer");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    for name in ["cornell", "chains", "dragon"] {
        // The dragon must be fetched first (scenes/fetch dragon).
        let Ok(scene) = Scene::load(name) else {
            eprintln!("skipped {name}: run `scenes/fetch {name}` first");
            continue;
        };
        let camera = CameraPath::parse("still", &scene).expect("a path").camera(0);
        let tracer = Tracer::new(Arc::new(scene));
        let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
        let jobs: Vec<Job> = pixels
            .map(|(x, y)| Job {
                origin: camera.eye,
                direction: camera.direction(x as f32 + 0.5, y as f32 + 0.5, SIZE),
                start: camera.near,
                key: u64::from(y * SIZE[0] + x),
            })
            .collect();
        let mut hits = vec![Hit::default(); jobs.len()];
        group.throughput(Throughput::Elements(jobs.len() as u64));
        group.bench_function(format!("{name}: one direct-light sample a pixel"), |bencher| {
            bencher.iter(|| tracer.trace_batch(&jobs, &TraceSettings::default(), 1, &mut hits));
        });
    }
    group.finish();
}

criterion_group!(benches, stages, rays);
criterion_main!(benches);
