//! The crate `epigraph` as programs use it: ports that can be read, errors, and a program's own cameras and samples.

use std::sync::{
    Arc,
    atomic::{AtomicU32, Ordering},
};

use epigraph::{Error, Image, Pace, Place, Query, Run, Sample, SampleSource, Samples, Setup};
use epigraph_scenes::{Camera, Scene};
use glam::Vec3;

const SIZE: [u32; 2] = [40, 24];

fn setup() -> Setup {
    Run::open("render-cache").unwrap().size(SIZE).samples(Samples::Share(0.2)).device(&epigraph::Device::CPU)
}

#[test]
fn ports_are_read_as_elements_of_their_types() {
    let mut run =
        setup().keep(&["fill.color", "cull.id", "cloud/points.cloud", "trace.samples"]).start().unwrap();
    run.frames(3).unwrap();
    assert_eq!(run.index(), 3);
    let color: Image<[f32; 4]> = run.read("fill.color").unwrap();
    assert_eq!((color.size, color.frame, color.pixels.len()), (SIZE, 2, 40 * 24));
    assert_eq!(color[[39, 23]], *color.pixels.last().unwrap());
    let ids: Image<u32> = run.read("cull.id").unwrap();
    assert!(ids.pixels.iter().any(|&id| id != u32::MAX));
    let positions: Image<[f32; 4]> = run.read("cloud/points.cloud.position").unwrap();
    assert_eq!(positions.size[1], 1);
    // Bytes of a picture are read as numbers from 0 to 1.
    let picture: Image<[f32; 4]> = run.read("image").unwrap();
    assert!(picture.pixels.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)));

    let wrong = run.read::<f32>("fill.color").unwrap_err().to_string();
    assert_eq!(wrong, "`fill.color` holds texture<rgba32float>, which cannot be read as 1 f32");
    let wrong = run.read::<[f32; 4]>("trace.samples").unwrap_err().to_string();
    assert!(wrong.contains("`trace.samples` holds array<Sample>"), "{wrong}");
    let unknown = run.read::<u32>("project.id").unwrap_err().to_string();
    assert!(unknown.starts_with("`project.id` is not kept") && unknown.contains("cull.id"), "{unknown}");
}

#[test]
fn invalid_setups_are_refused_with_the_reason() {
    let text = |error: Error| error.to_string();
    let refused = |setup: Setup| text(setup.compile().map(drop).unwrap_err());
    assert!(text(Run::open("epj").map(drop).unwrap_err()).contains("did you mean `epi`"));
    assert!(refused(setup().scene("cornel")).contains("cornell"));
    assert!(refused(setup().camera("orbitt")).contains("orbit"));
    assert!(refused(setup().keep(&["cull.idd"])).contains("idd"));
    assert!(refused(setup().size([0, 5])).contains("size"));
    assert!(text(setup().set("nobody", "x", "1").map(drop).unwrap_err()).contains("nobody"));
    // An unknown port leaves the compiled graph unchanged.
    let mut compiled = setup().compile().unwrap();
    compiled.keep(&["cull.id".parse().unwrap()]).unwrap();
    assert!(compiled.keep(&["cull.nothing".parse().unwrap()]).is_err());
    assert_eq!(compiled.kept().len(), 1);
    compiled.start().unwrap().frame().unwrap();
}

#[test]
fn a_camera_of_ones_own_gives_the_same_picture_as_the_equal_path() {
    let place = Place::load("cornell", "orbit").unwrap();
    let mut led = setup().at(&place).start().unwrap();
    let mut moved = setup().at(&place.along("still").unwrap()).live().start().unwrap();
    for index in 0..6 {
        led.frame().unwrap();
        moved.look(place.path.camera(index));
        moved.frame().unwrap();
        let [led, moved] = [&mut led, &mut moved].map(|run| run.snapshot("image").unwrap().bytes.clone());
        assert!(led == moved, "frame {index}");
    }
}

/// A source of samples: a floor at height 0 under a white sky. The floor's colour changes with the frame.
#[derive(Default)]
struct Floor {
    asked: AtomicU32,
}

impl SampleSource for Floor {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        for (sample, request) in samples.iter_mut().zip(query.requests()) {
            self.asked.fetch_add(1, Ordering::Relaxed);
            let ray = query.ray(request);
            let distance = -ray.origin.y / ray.direction.y;
            *sample = if distance > 0.0 {
                Sample::surface(request, ray.origin + distance * ray.direction, Vec3::new(0.5, 0.25, 0.0))
            } else {
                Sample::background(request, ray, Vec3::ONE)
            };
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

#[test]
fn samples_come_from_a_source_of_ones_own() {
    let camera = Camera::look_at(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 1.0, -1.0), 1.0, 0.1, 100.0);
    let nothing = Scene::empty("nothing", camera, [Vec3::NEG_ONE, Vec3::ONE]);
    let place = Place::new(Arc::new(nothing), "still").unwrap();
    for graph in ["render-cache", "epi"] {
        let mut run = Run::open(graph)
            .unwrap()
            .at(&place)
            .source(Floor::default())
            .size(SIZE)
            .samples(Samples::Share(0.5))
            .device(&epigraph::Device::CPU)
            .keep(&[if graph == "epi" { "antialias.color" } else { "fill.color" }])
            .start()
            .unwrap();
        run.frames(8).unwrap();
        let color: Image<[f32; 4]> =
            run.read(if graph == "epi" { "antialias.color" } else { "fill.color" }).unwrap();
        // The horizon is the middle row. No edge separates sky and floor, so rows near it are not tested.
        assert_eq!(color[[20, 3]][..3], [1.0; 3], "{graph}: the sky");
        let floor = color[[20, 20]];
        assert!((floor[0] - 0.5).abs() < 2e-3 && (floor[1] - 0.25).abs() < 2e-3, "{graph}: {floor:?}");
    }
}
