//! Ghosts: what is still shown of a light or a shadow that is no longer there.

use std::{array, fs, sync::Arc};

use epigraph::{Image, Pace, Place, Query, Run, Sample, SampleSource, Samples};
use epigraph_pictures::tone;
use epigraph_scenes::{Hit, Job, Mode, Rng, Scene, TraceSettings, Tracer, reference};
use epigraph_stages::shared::octahedral::encode_oct16;

const LAMP: &str = include_str!("ghosts/lamp.ron");
const SIZE: [u32; 2] = [96, 96];

/// How a picture shows a change.
#[derive(Clone, Copy, Debug)]
struct Ghost {
    /// How much of the change is not yet shown: 0 if the picture is as the light is now, 1 if it is as it was.
    left: f64,
    /// Root mean square error of the pixels that changed, over that of those that did not.
    ratio: f64,
}

fn load(text: &str) -> Arc<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.ron");
    fs::write(&path, text).unwrap();
    Arc::new(Scene::load(path.to_str().unwrap()).unwrap())
}

/// The converged picture of a frame, as displayed.
fn converged(place: &Place, frame: u32) -> Vec<[f64; 3]> {
    let tracer = Arc::new(Tracer::new(place.scene.clone())).at(frame);
    let settings = TraceSettings { spp: 1, mode: Mode::Path, ..TraceSettings::default() };
    let camera = place.path.camera(frame);
    let colors = reference::render(&tracer, &camera, SIZE, 48, &settings, 7, &|| true).unwrap();
    colors.into_iter().map(|color| shown(color.into())).collect()
}

fn shown(color: [f32; 3]) -> [f64; 3] {
    tone::to_srgb8(color).map(|channel| f64::from(channel) / 255.0)
}

impl Ghost {
    fn of(picture: &[[f64; 3]], before: &[[f64; 3]], now: &[[f64; 3]]) -> Self {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let minus = |a: &[f64; 3], b: &[f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let (mut along, mut square) = (0.0, 0.0);
        // Squares and numbers of pixels that changed, and of those that did not.
        let mut errors = [[0.0; 2]; 2];
        for ((picture, before), now) in picture.iter().zip(before).zip(now) {
            let (error, change) = (minus(picture, now), minus(before, now));
            let is_changed = change.iter().any(|channel| channel.abs() > 0.08);
            if is_changed {
                along += dot(error, change);
                square += dot(change, change);
            } else if change.iter().any(|channel| channel.abs() > 0.03) {
                continue;
            }
            let [squares, count] = &mut errors[usize::from(!is_changed)];
            *squares += dot(error, error);
            *count += 1.0;
        }
        let [changed, rest] = errors.map(|[squares, count]| (squares / count).sqrt());
        Self { left: along / square, ratio: changed / rest }
    }

    fn mean(of: &[Self]) -> Self {
        let mean = |part: fn(&Self) -> f64| of.iter().map(part).sum::<f64>() / of.len() as f64;
        Self { left: mean(|ghost| ghost.left), ratio: mean(|ghost| ghost.ratio) }
    }
}

/// The tracer, with another scene from a frame on, of which graphs know nothing but the samples.
struct Switched {
    then: Arc<Tracer>,
    at: u32,
}

impl SampleSource for Switched {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        let tracer = if query.frame.index < self.at { query.tracer } else { &self.then };
        let jobs: Vec<Job> = query
            .requests()
            .map(|request| {
                let ray = query.ray(request);
                let key = Rng::key(query.frame.index, request.pixel);
                Job { origin: ray.origin, direction: ray.direction, start: ray.near, key }
            })
            .collect();
        let mut hits = vec![Hit::default(); jobs.len()];
        tracer.trace_batch(&jobs, query.settings, query.frame.seed.into(), &mut hits);
        for ((sample, request), hit) in samples.iter_mut().zip(query.requests()).zip(&hits) {
            *sample = if hit.hit {
                let (variance, sharpness, normal) = (hit.variance, hit.sharpness, encode_oct16(hit.normal));
                Sample { variance, sharpness, normal, ..Sample::surface(request, hit.position, hit.radiance) }
            } else {
                Sample::background(request, query.ray(request), hit.radiance)
            };
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

fn start(graph: &str, place: &Place, source: Option<Switched>, seed: u32) -> Run {
    let setup = Run::open(graph).unwrap().at(place).size(SIZE).samples(Samples::Share(0.05)).seed(seed);
    let setup = setup.set("trace", "mode", "Path").unwrap().device(&epigraph::Device::CPU);
    let setup = setup.keep(&["antialias.color"]);
    let setup = match source {
        Some(source) => setup.source(source),
        None => setup,
    };
    setup.start().unwrap()
}

fn picture(run: &mut Run, frame: u32) -> Vec<[f64; 3]> {
    run.frames(frame + 1 - run.index()).unwrap();
    let colors: Image<[f32; 4]> = run.read("antialias.color").unwrap();
    colors.pixels.iter().map(|&[r, g, b, _]| shown([r, g, b])).collect()
}

/// What `epi` and `epi-filtered` show in a frame of the change since ten frames before: means over three runs.
fn ghosts_of(scene: Arc<Scene>, frame: u32) -> [Ghost; 2] {
    let place = Place::new(scene, "still").unwrap();
    let [before, now] = [frame - 10, frame].map(|frame| converged(&place, frame));
    ["epi", "epi-filtered"].map(|graph| {
        let of = |seed| Ghost::of(&picture(&mut start(graph, &place, None, seed), frame), &before, &now);
        let ghost = Ghost::mean(&[1, 2, 3].map(of));
        println!("{graph}: {ghost:?}");
        ghost
    })
}

/// Points whose light changes are renewed first, and their means count for less.
#[test]
fn a_lamp_that_moves_leaves_no_ghosts() {
    let [plain, filtered] = ghosts_of(load(LAMP), 40);
    assert!(filtered.left < 0.06 && filtered.ratio < 2.0, "{filtered:?}");
    assert!(filtered.left < 0.5 * plain.left, "{filtered:?} {plain:?}");
}

/// A tenth of the change within ten frames is not yet shown, with the filter and without, where boxes and their shadows move.
#[test]
fn bodies_that_move_leave_faint_ghosts() {
    let [plain, filtered] = ghosts_of(Arc::new(Scene::load("cornell-moving").unwrap()), 24);
    assert!(plain.left < 0.11 && plain.ratio < 2.0, "{plain:?}");
    assert!(filtered.left < 0.14 && filtered.ratio < 2.3, "{filtered:?}");
}

/// Nothing tells that a lamp went out but its samples, while another one shines on.
#[test]
fn a_lamp_that_is_switched_off_is_gone_soon() {
    const AT: u32 = 30;
    const FRAMES: [u32; 4] = [0, 10, 15, 20];
    let on = LAMP.replace(", motion: \"slide\"", "");
    let off = load(&on.replace("radiance: (15, 11, 4)", "radiance: (0, 0, 0)"));
    let place = Place::new(load(&on), "still").unwrap();
    let before = converged(&place, 0);
    let now = converged(&Place::new(off.clone(), "still").unwrap(), 0);
    let [plain, filtered] = ["epi", "epi-filtered"].map(|graph| {
        let runs = [1, 2, 3].map(|seed| {
            let then = Arc::new(Tracer::new(off.clone()));
            let mut run = start(graph, &place, Some(Switched { then, at: AT }), seed);
            // The first picture is of samples of the frame before.
            FRAMES.map(|frames| Ghost::of(&picture(&mut run, AT + frames), &before, &now))
        });
        let ghosts: [Ghost; 4] = array::from_fn(|at| Ghost::mean(&runs.map(|ghosts| ghosts[at])));
        println!("{graph}, after {FRAMES:?} frames: {ghosts:?}");
        ghosts
    });
    assert!(plain[0].left > 0.95 && filtered[0].left > 0.95, "{plain:?} {filtered:?}");
    assert!(plain[1].left < 0.22 && plain[3].left < 0.06, "{plain:?}");
    assert!(filtered[1].left < 0.2 && filtered[2].left < 0.05 && filtered[3].left < 0.02, "{filtered:?}");
    assert!(filtered[3].ratio < 0.6, "{filtered:?}");
}
