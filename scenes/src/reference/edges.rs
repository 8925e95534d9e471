//! The edges of a converged image, found by rays alone, so that no pipeline is measured against itself.

use glam::Vec3;
use rayon::prelude::*;

use crate::{CREASE_ANGLE, Camera, Mesh, Tracer, trace::Seen};

/// Rays from one side of a pixel to the opposite one are this many steps apart, both sides included.
const STEPS: usize = 4;

/// Sample points of an area light.
const CENTER: [f32; 2] = [0.5; 2];
const EXTREMES: [[f32; 2]; 5] = [CENTER, [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];

/// Which pixels of an image of `size` pixels (rows from the top) an edge cuts. Rays go through a lattice of 5 x 5
/// points of each pixel, the outermost on its sides; the pixel is cut where an edge separates two neighbours of the
/// lattice:
///
/// - an outline: one ray meets a surface and the other none, or they meet different objects or materials, or either
///   point lies farther off the plane of the other's triangle than a pixel is wide there, a step in depth that the
///   slope of neither surface explains;
/// - a crease: their triangles' normals (on the viewer's side) differ by more than [`CREASE_ANGLE`];
/// - the hard boundary of a shadow: the centre of a light is seen from one and hidden from the other, though both
///   triangles face it; and of an area light, one point of the pixel and half a pixel around it sees the centre and all
///   corners, and another none of them: the penumbra is at most about two pixels wide, as of those that stages take for
///   barriers (`algorithms.md` section 11.2). Where a surface turns away from a light there is no such boundary: it
///   grows dark by degrees.
///
/// Only what is seen directly counts: no edges within mirrors.
pub fn edges(tracer: &Tracer, camera: &Camera, size: [u32; 2]) -> Vec<bool> {
    let [width, height] = size.map(|side| side as usize);
    // Width of a pixel at unit distance along the axis.
    let pixel = 2.0 * camera.half_height(size) / size[1] as f32;
    let forward = camera.rotation * Vec3::NEG_Z;
    let mut cut = vec![false; width * height];
    cut.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, cut)| {
        let lattice = Lattice::new(tracer, camera, size, y);
        let outline = |a: &Option<Seen>, b: &Option<Seen>| match (a, b) {
            (Some(a), Some(b)) => {
                let depth = [a, b].map(|seen| forward.dot(seen.position - camera.eye));
                separated(&tracer.scene().mesh, a, b, pixel * depth[0].min(depth[1]))
            }
            _ => a.is_some() != b.is_some(),
        };
        for (x, cut) in cut.iter_mut().enumerate() {
            // A pixel without an outline shows one surface.
            *cut = lattice.neighbours(x).any(|[a, b]| outline(&lattice.seen[a], &lattice.seen[b]))
                || (0..tracer.light_count()).any(|light| {
                    lattice.center_is_half_hidden(x, light)
                        && penumbra_is_narrow(tracer, camera, size, [x, y], light)
                });
        }
    });
    cut
}

/// Returns true if an outline or a crease lies between two points; a pixel is `width` metres wide there.
fn separated(mesh: &Mesh, a: &Seen, b: &Seen, width: f32) -> bool {
    let [i, j] = [a.face, b.face].map(|face| face as usize);
    if i == j {
        return false;
    }
    let step = b.position - a.position;
    let off_plane = a.facing.dot(step).abs().max(b.facing.dot(step).abs());
    mesh.object[i] != mesh.object[j]
        || mesh.material[i] != mesh.material[j]
        || a.facing.dot(b.facing) < CREASE_ANGLE.to_radians().cos()
        || off_plane > width
}

/// The hits of the rays of one row of pixels.
struct Lattice {
    /// Points in a row.
    stride: usize,
    /// `STEPS + 1` rows from the top.
    seen: Vec<Option<Seen>>,
    /// For each light and point: `Some(true)` if the point sees the light's centre, `None` unless both face each other.
    lit: Vec<Vec<Option<bool>>>,
}

impl Lattice {
    fn new(tracer: &Tracer, camera: &Camera, size: [u32; 2], y: usize) -> Self {
        let stride = size[0] as usize * STEPS + 1;
        let at = |step: usize| step as f32 / STEPS as f32;
        let seen: Vec<Option<Seen>> = (0..(STEPS + 1) * stride)
            .map(|point| {
                let direction = camera.direction(at(point % stride), y as f32 + at(point / stride), size);
                tracer.first_surface(camera.eye, direction, camera.near)
            })
            .collect();
        let lit = |light| seen.iter().map(|seen| tracer.sees_light(seen.as_ref()?, light, CENTER)).collect();
        let lit = (0..tracer.light_count()).map(lit).collect();
        Self { stride, seen, lit }
    }

    /// Pairs of neighbouring points of pixel `x`.
    fn neighbours(&self, x: usize) -> impl Iterator<Item = [usize; 2]> {
        let (stride, first) = (self.stride, x * STEPS);
        let lines = (0..=STEPS).flat_map(|line| (0..STEPS).map(move |step| (line, step)));
        lines.flat_map(move |(line, step)| {
            let across = line * stride + first + step;
            let down = step * stride + first + line;
            [[across, across + 1], [down, down + stride]]
        })
    }

    /// Returns true if a light's centre is visible from one point of pixel `x` and hidden from its neighbour.
    fn center_is_half_hidden(&self, x: usize, light: usize) -> bool {
        let lit = &self.lit[light];
        self.neighbours(x).any(|[a, b]| matches!((lit[a], lit[b]), (Some(a), Some(b)) if a != b))
    }
}

/// Returns true if, within half a pixel around a pixel, one point sees the whole light and another none of it.
fn penumbra_is_narrow(
    tracer: &Tracer,
    camera: &Camera,
    size: [u32; 2],
    [x, y]: [usize; 2],
    light: usize,
) -> bool {
    let at = |pixel: usize, step: usize| pixel as f32 + 2.0 * step as f32 / STEPS as f32 - 0.5;
    let points = (0..=STEPS).flat_map(|row| (0..=STEPS).map(move |step| [step, row]));
    let views: Vec<Vec<bool>> = points
        .filter_map(|[step, row]| {
            let direction = camera.direction(at(x, step), at(y, row), size);
            let seen = tracer.first_surface(camera.eye, direction, camera.near)?;
            Some(EXTREMES.iter().filter_map(|&point| tracer.sees_light(&seen, light, point)).collect())
        })
        .collect();
    let all = |wanted| views.iter().any(|view| !view.is_empty() && view.iter().all(|&seen| seen == wanted));
    all(true) && all(false)
}

/// Marks the pixels whose centres lie at most `radius` pixels (Euclidean) from the centre of a marked one, in an image
/// whose rows have `width` pixels.
pub fn within(marked: &[bool], width: usize, radius: f32) -> Vec<bool> {
    let reach = radius as isize;
    let disc: Vec<[isize; 2]> = (-reach..=reach)
        .flat_map(|y| (-reach..=reach).map(move |x| [x, y]))
        .filter(|[x, y]| (x * x + y * y) as f32 <= radius * radius)
        .collect();
    let height = marked.len() / width.max(1);
    let mut near = vec![false; marked.len()];
    for index in (0..marked.len()).filter(|&index| marked[index]) {
        for [dx, dy] in &disc {
            let (x, y) = ((index % width).wrapping_add_signed(*dx), (index / width).wrapping_add_signed(*dy));
            // A step beyond the left or upper side wraps to a huge number.
            if x < width && y < height {
                near[y * width + x] = true;
            }
        }
    }
    near
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Material, SceneBuilder, Shape};

    /// A view from 2 m above the floor's origin, straight down: 10 pixels to the metre on the floor, x to the left, z
    /// up.
    const SIZE: [u32; 2] = [20, 20];

    fn camera() -> Camera {
        Camera::look_at(Vec3::Y * 2.0, Vec3::ZERO, 2.0 * 0.5f32.atan(), 0.1, 10.0)
    }

    fn material(builder: &mut SceneBuilder) -> u32 {
        builder.material(Material::diffuse("", Vec3::splat(0.5)))
    }

    /// A horizontal rectangle at height `y`, front up, from corner to corner in x and z.
    fn plate([x0, z0]: [f32; 2], [x1, z1]: [f32; 2], y: f32) -> Shape {
        Shape::quad([(x0, z1), (x1, z1), (x1, z0), (x0, z0)].map(|(x, z)| Vec3::new(x, y, z)))
    }

    fn floor() -> Shape {
        plate([-9.0, -9.0], [9.0, 9.0], 0.0)
    }

    /// Two shapes as one object, as meshes from files often are.
    fn joined(a: &Shape, b: &Shape) -> Shape {
        let base = a.positions.len() as u32;
        let triangles = b.triangles.iter().map(|triangle| triangle.map(|i| i + base));
        Shape {
            positions: [a.positions.clone(), b.positions.clone()].concat(),
            triangles: a.triangles.iter().copied().chain(triangles).collect(),
            ..Shape::default()
        }
    }

    fn tracer(builder: SceneBuilder) -> Tracer {
        let scene = builder.build("test", camera(), Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
        Tracer::new(Arc::new(scene))
    }

    /// The edges of objects of one material each.
    fn edges_of(shapes: &[Shape]) -> Vec<bool> {
        let mut builder = SceneBuilder::new();
        for shape in shapes {
            let material = material(&mut builder);
            builder.add(shape, material).unwrap();
        }
        edges(&tracer(builder), &camera(), SIZE)
    }

    /// The columns that are marked in every row, and nothing else is.
    fn columns(marked: &[bool]) -> Vec<usize> {
        let columns: Vec<usize> = (0..20).filter(|&x| marked[x]).collect();
        for (index, &marked) in marked.iter().enumerate() {
            assert_eq!(marked, columns.contains(&(index % 20)), "column {}, row {}", index % 20, index / 20);
        }
        columns
    }

    #[test]
    fn the_two_triangles_of_a_floor_are_one_surface() {
        assert!(!edges_of(&[floor()]).contains(&true));
    }

    #[test]
    fn a_pixel_is_cut_where_the_outline_passes() {
        // The plate ends at x = 0.13 on the floor: in the pixel from 0.2 to 0.1, the 9th from the left.
        let plate = plate([-9.0, -9.0], [0.13, 9.0], 1e-4);
        assert_eq!(columns(&edges_of(&[floor(), plate])), [8]);
    }

    #[test]
    fn a_depth_step_within_an_object_is_an_edge_if_it_is_wider_than_a_pixel() {
        // A plate at height 1 ends at x = 0.065 and hides the floor up to x = 0.13.
        let high = plate([-9.0, -9.0], [0.065, 9.0], 1.0);
        assert_eq!(columns(&edges_of(&[joined(&floor(), &high)])), [8]);
        // A pixel is 0.1 wide on the floor.
        let flat = plate([-9.0, -9.0], [0.13, 9.0], 0.05);
        assert!(!edges_of(&[joined(&floor(), &flat)]).contains(&true));
        // At the nearer of both depths, it is 0.05 (2 - h) wide: as wide as a step of h = 0.0952 m.
        for (height, expected) in [(0.094, vec![]), (0.097, vec![8]), (0.15, vec![8])] {
            let plate = plate([-9.0, -9.0], [0.13 * (1.0 - 0.5 * height), 9.0], height);
            assert_eq!(columns(&edges_of(&[joined(&floor(), &plate)])), expected, "{height}");
        }
    }

    #[test]
    fn an_edge_anywhere_in_a_pixel_cuts_it() {
        // In each quarter of the pixel from 0.2 to 0.1.
        for at in [0.19, 0.165, 0.14, 0.11] {
            let across = plate([-9.0, -9.0], [at, 9.0], 1e-4);
            assert_eq!(columns(&edges_of(&[floor(), across])), [8], "{at}");
            let down = edges_of(&[floor(), plate([-9.0, -9.0], [9.0, at], 1e-4)]);
            let rows: Vec<bool> = (0..20 * 20).map(|index| index / 20 == 8).collect();
            assert_eq!(down, rows, "{at}");
        }
        // A crumb on the corner of four pixels.
        let crumb = plate([0.19, 0.19], [0.21, 0.21], 1e-4);
        let marked = edges_of(&[floor(), crumb]);
        let expected: Vec<bool> = (0..20 * 20)
            .map(|index: usize| [index % 20, index / 20].iter().all(|at| [7, 8].contains(at)))
            .collect();
        assert_eq!(marked, expected);
    }

    #[test]
    fn images_may_be_as_narrow_or_as_low_as_a_pixel() {
        let edges = |shape: Shape, size: [u32; 2]| {
            let mut builder = SceneBuilder::new();
            for shape in [floor(), shape] {
                let material = material(&mut builder);
                builder.add(&shape, material).unwrap();
            }
            let marked = edges(&tracer(builder), &camera(), size);
            (0..marked.len()).filter(|&index| marked[index]).collect::<Vec<_>>()
        };
        assert_eq!(edges(plate([-9.0, -9.0], [9.0, 0.13], 1e-4), [1, 20]), [8]);
        // One row shows as much as 20, and is 20 times as wide: a column is two metres.
        assert_eq!(edges(plate([-9.0, -9.0], [2.5, 9.0], 1e-4), [6, 1]), [1]);
    }

    #[test]
    fn the_border_to_the_background_is_an_edge() {
        assert_eq!(columns(&edges_of(&[plate([-9.0, -9.0], [0.13, 9.0], 0.0)])), [8]);
    }

    #[test]
    fn a_fold_is_an_edge_above_the_crease_angle() {
        // Two halves of a roof that meet at x = 0.13, each sloping by half the angle between their normals.
        let roof = |degrees: f32| {
            let drop = 9.0 * (0.5 * degrees).to_radians().tan();
            let [ridge, left, right] = [(0.13, 0.0), (-8.87, -drop), (9.13, -drop)];
            let half = |(x0, y0): (f32, f32), (x1, y1): (f32, f32)| {
                Shape::quad([(x0, y0, 9.0), (x1, y1, 9.0), (x1, y1, -9.0), (x0, y0, -9.0)].map(Vec3::from))
            };
            joined(&half(left, ridge), &half(ridge, right))
        };
        assert_eq!(columns(&edges_of(&[roof(CREASE_ANGLE + 2.0)])), [8]);
        assert!(!edges_of(&[roof(CREASE_ANGLE - 2.0)]).contains(&true));
    }

    #[test]
    fn a_smooth_sphere_has_only_its_outline() {
        let (columns, rows) = (96, 48);
        let sphere = Shape::surface(columns, rows, |i, j| {
            let around = std::f32::consts::TAU * i as f32 / columns as f32;
            let up = std::f32::consts::PI * (j as f32 / rows as f32 - 0.5);
            0.5 * Vec3::new(up.cos() * around.sin(), up.sin(), up.cos() * around.cos())
        });
        let marked = edges_of(&[sphere]);
        // The outline of a ball of radius 0.5 at distance 2: tangent 0.5 / sqrt(2^2 - 0.5^2) of the half angle, the
        // image's half side being 0.5.
        let radius = 10.0 * 0.5 / (4.0f32 - 0.25).sqrt() / 0.5;
        for (index, &marked) in marked.iter().enumerate() {
            let [x, y] = [(index % 20) as f32, (index / 20) as f32].map(|at| at + 0.5 - 10.0);
            let off = (x.hypot(y) - radius).abs();
            assert!(if marked { off < 1.0 } else { off > 0.2 }, "pixel {x}, {y}: {marked}, off by {off}");
        }
    }

    /// The floor under a strip at height 0.5 that the camera does not see.
    fn shaded(lights: impl FnOnce(&mut SceneBuilder)) -> Vec<bool> {
        let mut builder = SceneBuilder::new();
        let material = material(&mut builder);
        builder.add(&floor(), material).unwrap();
        builder.add(&plate([-9.0, -9.0], [-1.435, 9.0], 0.5), material).unwrap();
        lights(&mut builder);
        edges(&tracer(builder), &camera(), SIZE)
    }

    #[test]
    fn the_boundary_of_a_shadow_is_an_edge() {
        // From (-3, 1, 0) past the strip's end (-1.435, 0.5) to the floor: x = -3 + 2 * 1.565 = 0.13.
        let light = Vec3::new(-3.0, 1.0, 0.0);
        assert_eq!(columns(&shaded(|builder| builder.point_light(light, Vec3::ONE))), [8]);
    }

    #[test]
    fn an_area_light_has_a_hard_shadow_where_the_penumbra_is_narrow() {
        let light = |side: f32, up: bool| {
            let corner = Vec3::new(-3.0, 1.0, 0.0) - 0.5 * side * (Vec3::X + Vec3::Z);
            let [u, v] = if up { [Vec3::Z, Vec3::X] } else { [Vec3::X, Vec3::Z] };
            shaded(|builder| builder.quad_light(corner, u * side, v * side, Vec3::ONE).unwrap())
        };
        // The strip's end is halfway up to the light: the penumbra is as wide as the light. A pixel is 0.1.
        assert_eq!(columns(&light(0.02, false)), [8]);
        assert!(!light(0.2, false).contains(&true));
        assert!(!light(0.02, true).contains(&true), "it shines up, away from the floor");
    }

    #[test]
    fn a_penumbra_is_seen_up_to_half_a_pixel_around() {
        // The shadow of a strip that ends at `end`, in columns or in rows. The penumbra reaches 0.05 m to either side.
        let marked = |shadow: f32, in_rows: bool| {
            let end = 0.5 * (shadow - 3.0);
            let swap = |[x, z]: [f32; 2]| if in_rows { [z, x] } else { [x, z] };
            let mut builder = SceneBuilder::new();
            let material = material(&mut builder);
            builder.add(&floor(), material).unwrap();
            let [[x0, z0], [x1, z1]] = [[-9.0, -9.0], [end, 9.0]].map(swap);
            builder.add(&plate([x0, z0], [x1, z1], 0.5), material).unwrap();
            let [x, z] = swap([-3.0, 0.0]);
            let corner = Vec3::new(x - 0.05, 1.0, z - 0.05);
            builder.quad_light(corner, 0.1 * Vec3::X, 0.1 * Vec3::Z, Vec3::ONE).unwrap();
            let marked = edges(&tracer(builder), &camera(), SIZE);
            let line = |index: usize| if in_rows { index / 20 } else { index % 20 };
            let lines: Vec<usize> = (0..20).filter(|&at| marked[21 * at]).collect();
            assert!((0..400).all(|index| marked[index] == lines.contains(&line(index))), "{shadow}");
            lines
        };
        // The pixel from 0.2 to 0.1 m, of which the points from 0.25 to 0.05 m are looked at.
        for in_rows in [false, true] {
            for shadow in [0.13, 0.16, 0.19, 0.11] {
                assert_eq!(marked(shadow, in_rows), [8], "{shadow}");
            }
        }
    }

    #[test]
    fn a_light_below_the_floor_draws_no_shadow() {
        let light = Vec3::new(-3.0, -1.0, 0.0);
        assert!(!shaded(|builder| builder.point_light(light, Vec3::ONE)).contains(&true));
    }

    #[test]
    fn within_two_pixels_is_a_disc() {
        let mut marked = vec![false; 7 * 5];
        marked[2 * 7 + 1] = true;
        let near = within(&marked, 7, 2.0);
        let rows: Vec<String> = near
            .chunks(7)
            .map(|row| row.iter().map(|&near| if near { '#' } else { '.' }).collect())
            .collect();
        assert_eq!(rows, [".#.....", "###....", "####...", "###....", ".#....."]);
        assert_eq!(within(&marked, 7, 0.0), marked);
        assert!(within(&[], 0, 2.0).is_empty());
    }

    #[test]
    fn a_disc_ends_at_the_sides_of_the_image() {
        for [width, height] in [[4, 3], [1, 5], [5, 1]] {
            for corner in [0, width - 1, width * (height - 1), width * height - 1] {
                let mut marked = vec![false; width * height];
                marked[corner] = true;
                let near = within(&marked, width, 1.0);
                let [x, y] = [corner % width, corner / width];
                let is_near = |index: usize| (index % width).abs_diff(x) + (index / width).abs_diff(y) <= 1;
                assert!(
                    (0..near.len()).all(|index| near[index] == is_near(index)),
                    "{width} x {height}, {corner}"
                );
            }
        }
    }

    #[test]
    fn a_pixel_is_within_a_radius_up_to_exactly_that_radius() {
        let mut marked = vec![false; 9 * 9];
        marked[4 * 9 + 4] = true;
        let count = |radius: f32| within(&marked, 9, radius).into_iter().filter(|&near| near).count();
        // Numbers of points of the lattice in discs.
        let expected =
            [(-1.0, 0), (0.0, 1), (0.99, 1), (1.0, 5), (1.41, 5), (1.42, 9), (1.99, 9), (2.0, 13), (3.0, 29)];
        assert_eq!(expected.map(|(radius, _)| count(radius)), expected.map(|(_, count)| count));
    }

    #[test]
    fn points_are_separated_by_what_is_more_than_a_pixel_and_the_crease_angle() {
        let mut builder = SceneBuilder::new();
        let material = material(&mut builder);
        builder.add(&floor(), material).unwrap();
        let scene = builder.build("test", camera(), Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
        let seen = |face: u32, position: Vec3, facing: Vec3| Seen { face, position, facing, start: position };
        let is_cut = |step: f32, turn: f32| {
            let a = seen(0, Vec3::ZERO, Vec3::Y);
            let turned = Vec3::new(turn.to_radians().sin(), turn.to_radians().cos(), 0.0);
            let b = seen(1, step * Vec3::Y, turned);
            let found = separated(&scene.mesh, &a, &b, 0.25);
            assert_eq!(separated(&scene.mesh, &b, &a, 0.25), found, "either way");
            found
        };
        for (step, turn, expected) in [
            (0.0, 0.0, false),
            (0.25, 0.0, false),
            (-0.25, 0.0, false),
            (0.2501, 0.0, true),
            (-0.2501, 0.0, true),
            (0.0, CREASE_ANGLE, false),
            (0.0, CREASE_ANGLE - 0.01, false),
            (0.0, CREASE_ANGLE + 0.01, true),
        ] {
            assert_eq!(is_cut(step, turn), expected, "{step} m, {turn} degrees");
        }
        // The farther of both planes counts: here one point is half a metre off the other's, which lies in its own.
        let slope = Vec3::new(0.5, 0.75_f32.sqrt(), 0.0);
        let along = Vec3::new(0.75_f32.sqrt(), -0.5, 0.0);
        let (a, b) = (seen(0, Vec3::ZERO, Vec3::Y), seen(1, along, slope));
        for (width, expected) in [(0.49, true), (0.51, false)] {
            let found = [separated(&scene.mesh, &a, &b, width), separated(&scene.mesh, &b, &a, width)];
            assert_eq!(found, [expected; 2], "{width}");
        }
        // One triangle is no edge, whatever its points are like.
        let [a, b] = [Vec3::ZERO, Vec3::Y].map(|at| seen(0, at, Vec3::Y));
        assert!(!separated(&scene.mesh, &a, &b, 0.25));
    }

    #[test]
    fn a_seam_between_objects_or_between_materials_is_an_edge() {
        // Two halves of one floor, which meet in the 9th pixel. Without the seam they are one surface.
        let halves = |object: u32, other: u32| {
            let mut builder = SceneBuilder::new();
            let [a, _] = [material(&mut builder), material(&mut builder)];
            builder.add(&plate([-9.0, -9.0], [0.13, 9.0], 0.0), a).unwrap();
            builder.add(&plate([0.13, -9.0], [9.0, 9.0], 0.0), a).unwrap();
            let mut scene = builder.build("test", camera(), Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
            // The first two triangles are the left half.
            scene.mesh.object = Arc::new(vec![0, 0, object, object]);
            scene.mesh.material = Arc::new(vec![0, 0, other, other]);
            columns(&edges(&Tracer::new(Arc::new(scene)), &camera(), SIZE))
        };
        assert_eq!([halves(0, 0), halves(1, 0), halves(0, 1)], [vec![], vec![8], vec![8]]);
    }
}
