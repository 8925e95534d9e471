//! Noisy samples: what accumulating and filtering make of them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use epigraph::{Image, Pace, Place, Query, Run, Sample, SampleSource, Samples, Setup};
use epigraph_core::testing::Random;
use epigraph_scenes::{Camera, Map, Maps, Material, Scene, SceneBuilder, Shape, Texture};
use epigraph_stages::shared::albedo::{PLAIN, decode_albedo, encode_albedo};
use epigraph_tests::graph;
use glam::{Vec2, Vec3};

/// A wall at z = -1, lit by paths of which one in [`ONE_IN`] carries light. Their mean is [`LIGHT`], and another one from
/// frame [`SWITCHED`] on.
struct Paths {
    then: f32,
}

const LIGHT: f32 = 0.5;
const SWITCHED: u32 = 40;

const ONE_IN: u32 = 6;
const PATHS: u32 = 4;

impl SampleSource for Paths {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        for (sample, request) in samples.iter_mut().zip(query.requests()) {
            let ray = query.ray(request);
            let wall = ray.origin - (1.0 + ray.origin.z) / ray.direction.z * ray.direction;
            let mut random = Random(u64::from(query.frame.index) << 32 | u64::from(request.pixel));
            let light = if query.frame.index < SWITCHED { LIGHT } else { self.then };
            let mut path = || if random.below(ONE_IN) == 0 { light * ONE_IN as f32 } else { 0.0 };
            let paths: Vec<f32> = (0..PATHS).map(|_| path()).collect();
            let mean = paths.iter().sum::<f32>() / PATHS as f32;
            let squares: f32 = paths.iter().map(|path| (path - mean).powi(2)).sum();
            let variance = squares / (PATHS * (PATHS - 1)) as f32;
            *sample = Sample { variance, ..Sample::surface(request, wall, Vec3::splat(mean)) };
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

/// The same paths, some frames later: as from threads in the background.
struct Late {
    paths: Paths,
    frames: usize,
    /// The samples of every so many frames are lost, as those of threads that do not keep up.
    loses_one_in: u32,
    under_way: Mutex<VecDeque<(u32, Vec<Sample>)>>,
}

impl SampleSource for Late {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        let mut own = vec![Sample::default(); samples.len()];
        self.paths.answer(query, &mut own);
        let mut under_way = self.under_way.lock().unwrap();
        under_way.push_back((query.frame.index, own));
        if under_way.len() > self.frames {
            let (frame, before) = under_way.pop_front().unwrap();
            if frame % self.loses_one_in == 0 {
                return;
            }
            for (sample, before) in samples.iter_mut().zip(before) {
                *sample = before;
                query.carry(frame, sample);
            }
        }
    }

    fn pace(&self) -> Pace {
        Pace::Async
    }
}

const SIZE: [u32; 2] = [32, 24];

/// A run of `epi-filtered` in front of the wall, of which `then` is the light after the switch.
fn start(size: [u32; 2], share: f64, then: f32) -> Run {
    start_with(Paths { then }, size, share)
}

fn start_with(source: impl SampleSource + 'static, size: [u32; 2], share: f64) -> Run {
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO, 1.0, 0.1, 100.0);
    let nothing = Scene::empty("nothing", camera, [Vec3::NEG_ONE, Vec3::ONE]);
    start_at(&Place::new(Arc::new(nothing), "still").unwrap(), source, size, share)
}

fn start_at(place: &Place, source: impl SampleSource + 'static, size: [u32; 2], share: f64) -> Run {
    Run::open("epi-filtered")
        .unwrap()
        .at(place)
        .source(source)
        .size(size)
        .samples(Samples::Share(share))
        .device(&epigraph::Device::CPU)
        .keep(&["interpolate.color", "antialias.color", "refine.refined", "cloud/integrate.shift"])
        .start()
        .unwrap()
}

/// Mean and root mean square error of a port's colours, of which each should be [`LIGHT`].
fn error(run: &mut Run, port: &str) -> [f64; 2] {
    let color: Image<[f32; 4]> = run.read(port).unwrap();
    let differences = color.pixels.iter().map(|color| f64::from(color[0] - LIGHT));
    let count = color.pixels.len() as f64;
    [differences.clone().sum::<f64>() / count, (differences.map(|d| d * d).sum::<f64>() / count).sqrt()]
}

/// The error falls as one over the square root of the number of samples, and no light is lost: paths that carry much more
/// than others are rare, but count.
#[test]
fn a_resting_camera_converges_to_the_mean_of_all_paths() {
    let mut run = start(SIZE, 0.5, LIGHT);
    let mut before = f64::INFINITY;
    for frames in [31, 125, 500, 2000] {
        run.frames(frames - run.index()).unwrap();
        let [mean, rms] = error(&mut run, "interpolate.color");
        // A sample's variance is 0.25 * (6 - 1) / 4; a picture has as many as half of its pixels in a frame.
        let of_mean = (0.3125 / f64::from(frames * SIZE[0] * SIZE[1] / 2)).sqrt();
        println!("{frames} frames: mean {mean:.5} (expected within {of_mean:.5}), rms {rms:.5}");
        assert!(mean.abs() < 4.5 * of_mean, "{frames}: {mean}");
        assert!(rms < 0.7 * before, "{frames}: {rms} after {before}");
        before = rms;
    }
    // Pixels blend some six points.
    assert!(before < 0.01, "{before}");
}

/// Samples that come some frames after their requests join the points that they were to renew, too. While they are under way,
/// no others are requested in their place, so none is wasted; and if they are lost, others follow.
#[test]
fn late_samples_count_as_much_as_others() {
    for (frames_late, loses_one_in) in [(1, u32::MAX), (3, u32::MAX), (3, 4)] {
        let paths = Paths { then: LIGHT };
        let late = Late { paths, frames: frames_late, loses_one_in, under_way: Mutex::default() };
        let mut runs = [start(SIZE, 0.1, LIGHT), start_with(late, SIZE, 0.1)];
        for frames in [50, 200, 800] {
            let [exact, late] = runs.each_mut().map(|run| {
                run.frames(frames - run.index()).unwrap();
                error(run, "interpolate.color")[1]
            });
            println!("{frames} frames, {frames_late} late: rms {exact:.5}, late {late:.5}");
            let more = if loses_one_in == 4 { (4f64 / 3.0).sqrt() } else { 1.0 };
            assert!(late < 1.15 * more * exact, "{frames}: {late} against {exact}");
        }
    }
}

/// Samples that come in the frame after their request leave nothing under way.
#[test]
fn pictures_of_samples_in_step_are_the_same_without_marks_of_what_is_under_way() {
    for (scene, camera) in [("cornell", "still"), ("cornell-moving", "still"), ("cornell-moving", "orbit")] {
        let pictures = [false, true].map(|bypass| {
            let mut file = graph("epi-filtered.ron");
            file.set_bypass("pending", bypass).unwrap();
            let setup = Setup::new(file).scene(scene).camera(camera).size([96, 72]);
            let setup = setup.device(&epigraph::Device::CPU).keep(&["antialias.color"]);
            let mut run = setup.samples(Samples::Share(0.1)).start().unwrap();
            run.frames(40).unwrap();
            run.read::<[f32; 4]>("antialias.color").unwrap().pixels
        });
        assert!(pictures[0] == pictures[1], "{scene}, {camera}");
    }
}

#[test]
fn the_filter_evens_out_what_is_left() {
    let mut run = start(SIZE, 0.1, LIGHT);
    run.frames(20).unwrap();
    let [plain, filtered] = ["interpolate.color", "antialias.color"].map(|port| error(&mut run, port)[1]);
    println!("{plain:.4} without, {filtered:.4} with the filter");
    assert!(filtered < 0.3 * plain, "{filtered} against {plain}");
}

/// Each sample is too noisy to tell that the light went out, and nothing else does. All of a tile together tell it.
#[test]
fn a_light_that_goes_out_is_gone_after_ten_frames() {
    for (then, least) in [(0.0, 0.0), (0.25 * LIGHT, 0.15 * LIGHT)] {
        let mut run = start([128, 96], 0.05, then);
        run.frames(SWITCHED).unwrap();
        let before: Image<[f32; 4]> = run.read("refine.refined").unwrap();
        run.frames(10).unwrap();
        let after: Image<[f32; 4]> = run.read("refine.refined").unwrap();
        let mean = |image: &Image<[f32; 4]>| {
            image.pixels.iter().map(|color| color[0]).sum::<f32>() / image.pixels.len() as f32
        };
        let brightest = after.pixels.iter().map(|color| color[0]).fold(0.0, f32::max);
        println!("{} before, {} after, at most {brightest}", mean(&before), mean(&after));
        assert!((mean(&before) - LIGHT).abs() < 0.1 * LIGHT, "{}", mean(&before));
        assert!((least..=then + 0.02 * LIGHT).contains(&mean(&after)), "{}", mean(&after));
    }
}

/// Noise alone hardly ever looks like a change of light.
#[test]
fn tiles_hardly_ever_take_noise_for_a_change() {
    for share in [0.05, 1.0] {
        let mut run = start([128, 96], share, LIGHT);
        let (mut alarms, mut tiles) = (0, 0);
        for _ in 0..150 {
            run.frames(1).unwrap();
            let shift: Image<f32> = run.read("cloud/integrate.shift").unwrap();
            alarms += shift.pixels.iter().filter(|&&shift| shift > 0.0).count();
            tiles += shift.pixels.len();
        }
        println!("{alarms} of {tiles} at {share}");
        assert!(alarms * 1000 <= tiles, "{alarms} of {tiles} at {share}");
    }
}

/// A wall of bars that are narrower than a pixel, without noise: a third of it is white.
struct Bars;

/// Bars in the image, whose width is no multiple of that.
const BARS: f32 = 53.0;

impl SampleSource for Bars {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        for (sample, request) in samples.iter_mut().zip(query.requests()) {
            let ray = query.ray(request);
            let wall = ray.origin - (1.0 + ray.origin.z) / ray.direction.z * ray.direction;
            let [x, _] = request.target(query.frame.size[0]);
            *sample = Sample::surface(request, wall, Vec3::splat(white(x)));
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

/// The wall at a distance in pixels from the image's left edge.
fn white(x: f32) -> f32 {
    let bar = x / SIZE[0] as f32 * BARS;
    if bar.fract() < 1.0 / 3.0 { 1.0 } else { 0.0 }
}

/// No interpolation shows what is finer than a pixel, however many samples come. The mean of each pixel's own samples does.
#[test]
fn details_finer_than_a_pixel_converge_at_rest() {
    let share = |x: u32| {
        let places = (0..3000).map(|place| white(x as f32 + (place as f32 + 0.5) / 3000.0));
        places.sum::<f32>() / 3000.0
    };
    let shares: Vec<f32> = (0..SIZE[0]).map(share).collect();
    let mut run = start_with(Bars, SIZE, 0.5);
    let mut errors = Vec::new();
    for frames in [8, 40, 200, 1000] {
        run.frames(frames - run.index()).unwrap();
        let error = |port: &str| {
            let color: Image<[f32; 4]> = run.read(port).unwrap();
            let squares = color.pixels.iter().enumerate();
            let squares =
                squares.map(|(at, color)| f64::from(color[0] - shares[at % SIZE[0] as usize]).powi(2));
            (squares.sum::<f64>() / color.pixels.len() as f64).sqrt()
        };
        errors.push(["antialias.color", "refine.refined"].map(error));
    }
    println!("{errors:.4?}");
    let [first, .., last] = &errors[..] else { unreachable!() };
    assert_eq!(first[0], first[1], "too few samples tell nothing");
    assert!(errors.windows(2).all(|pair| pair[1][1] < 0.75 * pair[0][1]), "{errors:?}");
    assert!(last[1] < 0.25 * last[0], "{errors:?}");
}

/// The same paths on a wall of stripes, whose samples say which albedo they have, or not.
struct Stripes {
    paths: Paths,
    tells: bool,
}

/// Width of a stripe in pixels. Stripes begin between two pixels.
const STRIPE: u32 = 4;

/// The albedo of the wall in a column of pixels.
fn stripe(x: u32) -> f32 {
    let code = encode_albedo(Vec3::splat(if (x / STRIPE).is_multiple_of(2) { 0.8 } else { 0.5 }));
    decode_albedo(code)[0]
}

impl SampleSource for Stripes {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        self.paths.answer(query, samples);
        for (sample, request) in samples.iter_mut().zip(query.requests()) {
            let share = stripe(request.target(SIZE[0])[0] as u32);
            sample.radiance = sample.radiance.map(|channel| channel * share);
            sample.variance *= share * share;
            sample.albedo = if self.tells { encode_albedo(Vec3::splat(share)) } else { PLAIN };
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

/// The root mean square error of the picture of the stripes.
fn error_of_stripes(tells: bool) -> f64 {
    let mut builder = SceneBuilder::new();
    let texture = Texture { name: String::new(), size: [1, 1], texels: vec![[255; 4]] };
    let maps = Maps { color: Some(Map::new(builder.texture(&Arc::new(texture)))), ..Maps::default() };
    let material = builder.material(Material { maps, ..Material::diffuse("", Vec3::ONE) });
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, y]| Vec3::new(x, y, -1.0));
    let wall = Shape::quad(corners).with_uvs(|_| Vec2::ZERO);
    builder.add(&wall, material).unwrap();
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 100.0);
    let scene = builder.build("stripes", camera, Vec3::ZERO, 0.0, 40.0).unwrap();
    let place = Place::new(Arc::new(scene), "still").unwrap();
    let mut run = start_at(&place, Stripes { paths: Paths { then: LIGHT }, tells }, SIZE, 0.1);
    run.frames(20).unwrap();
    let color: Image<[f32; 4]> = run.read("antialias.color").unwrap();
    let errors = color
        .pixels
        .iter()
        .zip(0..)
        .map(|(color, pixel)| f64::from(color[0] - LIGHT * stripe(pixel % SIZE[0])).powi(2));
    (errors.sum::<f64>() / color.pixels.len() as f64).sqrt()
}

/// Samples that know their albedo leave the texture as sharp as the points show it.
#[test]
fn a_texture_survives_the_filter() {
    let [without, with] = [false, true].map(error_of_stripes);
    println!("{without:.4} without albedos, {with:.4} with them");
    assert!(with < 0.6 * without, "{with} against {without}");
}
