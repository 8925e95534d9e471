//! cargo run --release -p epigraph-examples --bin own_source
//!
//! The render cache with samples from another renderer, here a sphere on a chequered floor. Writes own_source.png.

use std::{error::Error, path::Path, sync::Arc};

use epigraph::{Pace, Query, Ray, Run, Sample, SampleSource};
use epigraph_pictures::{Look, PortFile};
use epigraph_scenes::{Camera, Scene};
use glam::Vec3;

const CENTER: Vec3 = Vec3::new(0.28, 0.2, 0.2);
const RADIUS: f32 = 0.2;
const TO_SUN: Vec3 = Vec3::new(0.48, 0.8, -0.36);
struct Sphere;

/// The distance to the sphere along a ray, in lengths of its direction.
fn sphere(origin: Vec3, direction: Vec3) -> Option<f32> {
    let (a, b) = (direction.length_squared(), direction.dot(origin - CENTER));
    let root = (b * b - a * (origin.distance_squared(CENTER) - RADIUS * RADIUS)).sqrt();
    Some((-b - root) / a).filter(|distance| *distance > 0.0)
}

/// Where a ray meets the scene, and the radiance that it sees there.
fn trace(Ray { origin, direction, .. }: Ray) -> Option<(Vec3, Vec3)> {
    let floor = || Some(-origin.y / direction.y).filter(|distance| *distance > 0.0);
    let hit = sphere(origin, direction);
    let at = origin + hit.or_else(floor)? * direction;
    let dark = ((at.x * 5.0).floor() + (at.z * 5.0).floor()) % 2.0 == 0.0;
    let (normal, color) = match hit {
        Some(_) => ((at - CENTER) / RADIUS, Vec3::new(0.8, 0.3, 0.1)),
        None => (Vec3::Y, Vec3::splat(if dark { 0.2 } else { 0.7 })),
    };
    let lit = sphere(at + 1e-4 * normal, TO_SUN).is_none();
    Some((at, color * if lit { 0.2 + normal.dot(TO_SUN).max(0.0) } else { 0.2 }))
}

impl SampleSource for Sphere {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        for (sample, request) in samples.iter_mut().zip(query.requests()) {
            *sample = match trace(query.ray(request)) {
                Some((position, radiance)) => Sample::surface(request, position, radiance),
                None => Sample::background(request, query.ray(request), Vec3::new(0.3, 0.5, 0.9)),
            };
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let camera = Camera::look_at(Vec3::new(0.28, 0.27, -0.8), CENTER, 0.7, 0.1, 10.0);
    let scene = Scene::empty("sphere", camera, [CENTER - RADIUS, CENTER + RADIUS]);
    let mut run = Run::open("render-cache")?.in_scene(Arc::new(scene)).source(Sphere).start()?;
    run.frames(40)?;
    Ok(PortFile::picture(Path::new("own_source.png"))?.write(&[run.snapshot("image")?], &Look::default())?)
}
