//! Converged reference images, and their edges.

mod edges;

use glam::Vec3;
use rayon::prelude::*;

pub use self::edges::{edges, within};
use crate::{Camera, Rng, TraceSettings, Tracer};

/// Renders an image of `size` pixels, rows from the top, each the mean of `spp` samples spread evenly over the
/// pixel's area (box filter); each sample carries `settings.spp` light paths. The same bits on any number of threads.
///
/// `pixel_done` is called once for each finished pixel, from any thread. Where it returns false, the pixels that are not yet
/// begun are left out and there is no image.
pub fn render(
    tracer: &Tracer,
    camera: &Camera,
    size: [u32; 2],
    spp: u32,
    settings: &TraceSettings,
    seed: u64,
    pixel_done: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Vec3>> {
    let [width, height] = size.map(|n| n as usize);
    let mut image = vec![Vec3::ZERO; width * height];
    let rows = image.par_chunks_mut(width.max(1)).enumerate();
    let whole = rows.try_for_each(|(y, row)| {
        row.iter_mut().enumerate().try_for_each(|(x, pixel)| {
            *pixel = render_pixel(tracer, camera, size, [x, y], spp.max(1), settings, seed);
            pixel_done().then_some(())
        })
    });
    whole.map(|()| image)
}

fn render_pixel(
    tracer: &Tracer,
    camera: &Camera,
    size: [u32; 2],
    [x, y]: [usize; 2],
    spp: u32,
    settings: &TraceSettings,
    seed: u64,
) -> Vec3 {
    let key = Rng::key(0, (y * size[0] as usize + x) as u32);
    let half = camera.half_height(size);
    let sum: Vec3 = (0..spp)
        .map(|nth| {
            let mut rng = Rng::nth(seed, key, nth);
            let [dx, dy] = rng.subpixel();
            let direction = camera.direction_within(half, x as f32 + dx, y as f32 + dy, size);
            tracer.trace_from(camera.eye, direction, camera.near, settings, &mut rng).radiance
        })
        .sum();
    sum / spp as f32
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{CREASE_ANGLE, Material, SceneBuilder, Shape};

    #[test]
    fn the_near_plane_is_a_plane() {
        for (depth, is_seen) in [(0.5, false), (0.99, false), (1.01, true), (3.0, true)] {
            let mut builder = SceneBuilder::new();
            for (depth, color) in [(4.0, Vec3::X), (depth, Vec3::Y)] {
                let lamp = builder.material(Material::lamp("", color));
                let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
                builder.add(&Shape::quad(corners.map(|[x, y]| Vec3::new(x, y, -depth))), lamp).unwrap();
            }
            // At the corners of the image, rays of one metre end at a depth of 0.6 m.
            let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.5, 1.0, 9.0);
            let scene = builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
            let tracer = Tracer::new(Arc::new(scene));
            let image = render(&tracer, &camera, [8, 8], 1, &TraceSettings::default(), 0, &|| true).unwrap();
            let expected = if is_seen { Vec3::Y } else { Vec3::X };
            assert!(image.iter().all(|pixel| *pixel == expected), "{depth}: {image:?}");
        }
    }
}
