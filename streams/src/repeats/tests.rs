//! Searches as a whole.

mod stored;

use std::{collections::BTreeMap, ops::ControlFlow, sync::Mutex};

use glam::{DMat3, DQuat, DVec3, Vec3};

use super::{
    testing::{Solid, cuboid, drum, grid, prism, rotation, signed, sphere, torus},
    *,
};
use crate::{testing::Random, unpack_normal};

fn search(solid: &Solid) -> Found {
    let found = find(&solid.surface(), &Settings::default()).unwrap();
    verify(&solid.surface(), &found, &Settings::default());
    found
}

/// Every triangle and every vertex of a surface is in the result once, where it was, and looks as it did.
fn verify(surface: &Surface, found: &Found, settings: &Settings) {
    let Found { repeats, report, .. } = found;
    assert!(report.deviation <= report.bound, "{report:?}");
    assert!(repeats.deviation() >= report.deviation as f32);
    let decoded: Vec<Vec<Vec3>> = repeats
        .instances()
        .iter()
        .map(|instance| repeats.shapes()[instance.shape as usize].positions().map(instance.place()).collect())
        .collect();
    let near = |at: Vec3, vertex: u32| {
        let distance = at.as_dvec3().distance(surface.positions[vertex as usize].as_dvec3());
        distance <= report.deviation
    };
    let mut taken: Vec<Vec<bool>> = repeats
        .instances()
        .iter()
        .map(|instance| vec![false; repeats.shapes()[instance.shape as usize].triangles().len()])
        .collect();
    let mut used = vec![false; surface.positions.len()];
    for (triangle, place) in found.triangles.iter().enumerate() {
        let corners = surface.triangles[triangle];
        let Some(Place { instance, index }) = *place else {
            let [a, b, c] = corners.map(|vertex| surface.positions[vertex as usize]);
            assert!(a == b || b == c || c == a, "triangle {triangle} is not stored");
            continue;
        };
        let taken = &mut taken[instance as usize][index as usize];
        assert!(!std::mem::replace(taken, true), "triangle {triangle} is not the only one at its place");
        let instance_of = &repeats.instances()[instance as usize];
        let shape = &repeats.shapes()[instance_of.shape as usize];
        let stored = shape.triangles()[index as usize];
        let alike = |turn: usize| {
            (0..3).all(|corner| {
                let (here, there) = (stored[corner] as usize, corners[(corner + turn) % 3]);
                let same_color =
                    surface.colors.is_none_or(|all| all[there as usize] == shape.colors().unwrap()[here]);
                let same_normal = surface.normals.is_none_or(|all| {
                    let own = instance_of.rotation * unpack_normal(shape.normals().unwrap()[here]);
                    own.distance(all[there as usize].normalize_or_zero()) < settings.normals as f32 + 1e-6
                });
                near(decoded[instance as usize][here], there) && same_color && same_normal
            })
        };
        assert!((0..3).any(alike), "triangle {triangle}: {place:?}");
        assert_eq!(instance_of.material, surface.materials.map(|all| all[triangle]));
        corners.iter().for_each(|&vertex| used[vertex as usize] = true);
    }
    assert!(
        taken.into_iter().flatten().all(|taken| taken),
        "an instance has triangles that the surface has not"
    );
    for (vertex, place) in found.vertices.iter().enumerate() {
        assert_eq!(place.is_some(), used[vertex]);
        let at = place.map(|place| decoded[place.instance as usize][place.index as usize]);
        assert!(at.is_none_or(|at| near(at, vertex as u32)), "vertex {vertex}: {place:?}");
    }
    assert_eq!(report.unused, used.iter().filter(|used| !**used).count());
    assert_eq!(repeats.positions(), decoded.concat());
    assert_eq!(repeats.vertex_count(), repeats.positions().len());
    let bytes = repeats.to_bytes();
    assert_eq!(bytes.len(), repeats.bytes().total());
    assert_eq!(&Repeats::from_bytes(&bytes).unwrap(), repeats);
}

/// Parts, shapes, and those given up.
fn numbers(found: &Found) -> (usize, usize, usize) {
    (found.report.parts, found.report.shapes, found.report.given_up)
}

/// Whether two small parts are the same but for a rotation and a translation, found by trying all of them.
fn is_copy(a: &Solid, b: &Solid) -> bool {
    const NEAR: f64 = 1e-4;
    let (n, m) = (a.positions.len(), a.triangles.len());
    if (n, m) != (b.positions.len(), b.triangles.len()) {
        return false;
    }
    let [a_at, b_at] = [a, b].map(|solid| solid.positions.iter().map(|at| at.as_dvec3()).collect::<Vec<_>>());
    let frame = |[o, x, y]: [DVec3; 3]| {
        let x = (x - o).normalize();
        let y = (y - o).reject_from_normalized(x).normalize();
        DMat3::from_cols(x, y, x.cross(y))
    };
    // The first triangle; all triangles of the tests have an area.
    let base = a.triangles[0].map(|vertex| vertex as usize);
    let from = base.map(|vertex| a_at[vertex]);
    let first = |solid: &Solid, corners: [u32; 3]| {
        let lowest = (0..3).min_by_key(|&k| corners[k]).unwrap();
        assert!(!solid.triangles.is_empty());
        [corners[lowest], corners[(lowest + 1) % 3], corners[(lowest + 2) % 3]]
    };
    let mut wanted: Vec<[u32; 3]> = b.triangles.iter().map(|&corners| first(b, corners)).collect();
    wanted.sort_unstable();
    let sides = |[o, x, y]: [DVec3; 3]| [o.distance(x), x.distance(y), y.distance(o)];
    let here = sides(from);
    for &corners in &b.triangles {
        for turn in 0..3 {
            let to = [0, 1, 2].map(|k| b_at[corners[(k + turn) % 3] as usize]);
            if sides(to).iter().zip(here).any(|(x, y)| (x - y).abs() > NEAR) {
                continue;
            }
            let rotation = frame(to) * frame(from).transpose();
            let place = |at: DVec3| rotation * (at - from[0]) + to[0];
            // Long parts of small triangles would need more care; those of the tests are about as long as wide.
            let map: Option<Vec<u32>> = a_at
                .iter()
                .map(|&at| (0..n as u32).find(|&vertex| b_at[vertex as usize].distance(place(at)) < NEAR))
                .collect();
            let Some(map) = map else { continue };
            let mut found: Vec<[u32; 3]> = a
                .triangles
                .iter()
                .map(|corners| first(b, corners.map(|vertex| map[vertex as usize])))
                .collect();
            found.sort_unstable();
            if found == wanted {
                return true;
            }
        }
    }
    false
}

/// A small part of about the size 1: symmetric ones, flat ones, open and closed ones, and some without any symmetry.
fn small_part(random: &mut Random) -> Solid {
    let size = |random: &mut Random| 0.4 + 0.6 * random.unit();
    match random.below(9) {
        0 => cuboid(Vec3::splat(0.7)),
        1 => cuboid(Vec3::new(size(random), size(random), size(random))),
        2 => drum(3 + random.below(6), size(random), size(random)),
        3 => {
            let corner = |i: u32, random: &mut Random| {
                let angle = (i as f32 + 0.6 * random.unit()) * std::f32::consts::TAU / 5.0;
                (0.4 + 0.6 * random.unit()) * Vec3::new(angle.sin(), 0.0, angle.cos())
            };
            let outline: Vec<Vec3> = (0..5).map(|i| corner(i, random)).collect();
            prism(&outline, size(random))
        }
        4 => {
            let positions = (0..4).map(|_| signed(random).as_vec3()).collect();
            Solid {
                positions,
                triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
                ..Solid::default()
            }
        }
        5 => sphere(4 + random.below(3), 1 + random.below(2)),
        6 => {
            let mut blob = sphere(5, 2);
            blob.positions.iter_mut().for_each(|at| *at *= 0.7 + 0.3 * random.unit());
            blob
        }
        7 => {
            let height: Vec<f32> = (0..12).map(|_| 0.3 * random.unit()).collect();
            let flat = random.below(2) == 0;
            grid(4, 3, [false; 2], |i, j| {
                let height = if flat { 0.0 } else { height[(4 * j + i) as usize] };
                Vec3::new(0.5 * i as f32, height, 0.4 * j as f32 + 0.1 * (i * j) as f32)
            })
        }
        _ => {
            let positions = (0..3).map(|_| signed(random).as_vec3()).collect();
            Solid { positions, triangles: vec![[0, 1, 2]], ..Solid::default() }
        }
    }
}

/// A part like another: itself, its mirror image, one that is 0.1% larger, or one with a vertex 15 mm away.
fn variant(solid: &Solid, random: &mut Random) -> Solid {
    let mut variant = solid.clone();
    match random.below(4) {
        0 => {}
        1 => return solid.mirrored(),
        2 => variant.positions.iter_mut().for_each(|at| *at *= 1.001),
        _ => {
            let vertex = random.below(variant.positions.len() as u32) as usize;
            variant.positions[vertex] += 0.015 * signed(random).normalize().as_vec3();
        }
    }
    variant
}

/// None merged wrongly, none overlooked, none farther away than reported.
#[test]
fn ten_thousand_sets_of_parts_are_told_apart() {
    let (mut copies, mut mirrored) = (0, 0);
    for round in 0..10_000 {
        let mut random = Random(round);
        let bases = [small_part(&mut random), small_part(&mut random)];
        let models: Vec<Solid> =
            (0..5).map(|i| variant(&bases[i % 2], &mut random)).chain([bases[0].mirrored()]).collect();
        // The first model that each is a copy of.
        let class: Vec<usize> = models
            .iter()
            .map(|model| models.iter().position(|earlier| is_copy(earlier, model)).unwrap())
            .collect();
        mirrored += usize::from(is_copy(&bases[0], &bases[0].mirrored()));

        let distance = [2.0, 30.0, 300.0][round as usize % 3];
        let (mut parts, mut classes) = (Vec::<Solid>::new(), Vec::new());
        for _ in 0..4 + random.below(6) {
            // Now and then the same part at the same place again.
            if !parts.is_empty() && random.below(8) == 0 {
                let again = random.below(parts.len() as u32) as usize;
                parts.push(parts[again].clone());
                classes.push(classes[again]);
                continue;
            }
            let model = random.below(models.len() as u32) as usize;
            let part = models[model].turned(rotation(&mut random), distance * signed(&mut random));
            let part = if random.below(3) == 0 { part.soup() } else { part };
            parts.push(part.shuffled(&mut random));
            classes.push(class[model]);
        }
        let solid = Solid::all(&parts);
        let found = search(&solid);
        assert_eq!(numbers(&found).0, parts.len(), "round {round}");
        assert_eq!(found.report.given_up, 0, "round {round}");

        let mut triangle = 0;
        let (mut shape_of_class, mut class_of_shape) = (BTreeMap::new(), BTreeMap::new());
        for (part, &class) in parts.iter().zip(&classes) {
            let places = &found.triangles[triangle..triangle + part.triangles.len()];
            let instance = places[0].unwrap().instance;
            assert!(places.iter().all(|place| place.unwrap().instance == instance), "round {round}");
            let shape = found.repeats.instances()[instance as usize].shape;
            assert_eq!(
                *shape_of_class.entry(class).or_insert(shape),
                shape,
                "round {round}: a copy was overlooked"
            );
            assert_eq!(*class_of_shape.entry(shape).or_insert(class), class, "round {round}: merged wrongly");
            triangle += part.triangles.len();
        }
        copies += found.report.copies();
    }
    // The sets contain what they are for.
    assert!(copies > 20_000 && (300..9700).contains(&mirrored), "{copies} {mirrored}");
}

/// Around an edge of many triangles, which is which follows from where they lie.
#[test]
fn sheets_around_one_edge_are_told_apart() {
    let mut random = Random(12);
    for round in 0..500 {
        // Sheets of two triangles. Their first ones, with either winding, differ only in their direction from the edge.
        let count = 3 + random.below(4);
        let mut fan = Solid { positions: vec![Vec3::ZERO, Vec3::Z], ..Solid::default() };
        for sheet in 0..count {
            let angle = (sheet as f32 + 0.5 * random.unit()) * std::f32::consts::TAU / count as f32;
            let out = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let near = fan.positions.len() as u32;
            fan.positions.extend([out + 0.5 * Vec3::Z, (1.5 + random.unit()) * out + Vec3::Z]);
            let first = if random.below(2) == 0 { [0, 1, near] } else { [1, 0, near] };
            fan.triangles.extend([first, [1, near + 1, near]]);
        }
        let mirrored_is_copy = is_copy(&fan, &fan.mirrored());
        let parts = [&fan, &fan, &fan.mirrored()]
            .map(|fan| fan.turned(rotation(&mut random), 10.0 * signed(&mut random)).shuffled(&mut random));
        let found = search(&Solid::all(&parts));
        assert_eq!(numbers(&found), (3, 2 - usize::from(mirrored_is_copy), 0), "round {round}");
    }
}

#[test]
fn near_copies_are_shapes_of_their_own() {
    // A plate with a hole, as a ring of quads: the hole is 15 mm off in one of them.
    let plate = |hole: f32| {
        grid(24, 4, [true; 2], |i, j| {
            let angle = std::f32::consts::TAU * i as f32 / 24.0;
            let (radius, y) = [(0.6, 0.0), (0.05, 0.0), (0.05, 0.02), (0.6, 0.02)][j as usize];
            Vec3::new(radius * angle.sin() + if radius < 0.1 { hole } else { 0.0 }, y, radius * angle.cos())
        })
    };
    let mut random = Random(5);
    let mut place = |solid: Solid| solid.turned(rotation(&mut random), 200.0 * signed(&mut random));
    let mut larger = plate(0.0);
    larger.positions.iter_mut().for_each(|at| *at *= 1.001);
    let parts = [plate(0.0), plate(0.015), plate(0.0), larger, plate(0.015)].map(&mut place);
    let found = search(&Solid::all(&parts));
    assert_eq!(numbers(&found), (5, 3, 0));
    let shapes: Vec<u32> = found.repeats.instances().iter().map(|instance| instance.shape).collect();
    assert_eq!(shapes, [0, 0, 1, 1, 2]);
    // With a centimetre's tolerance the larger one is a copy too; the hole still is not.
    let settings = Settings { tolerance: Tolerance::Distance(0.01), ..Settings::default() };
    let solid = Solid::all(&parts);
    let found = find(&solid.surface(), &settings).unwrap();
    verify(&solid.surface(), &found, &settings);
    assert_eq!(numbers(&found), (5, 2, 0));
    assert!(found.report.deviation > 3e-4 && found.report.deviation < 0.01 + 1e-3);
}

#[test]
fn large_symmetric_parts_are_found_within_the_bound_of_work() {
    let sheet = grid(101, 99, [false; 2], |i, j| Vec3::new(i as f32, 0.0, j as f32) * 0.01);
    let mut dented = drum(500, 1.0, 0.5);
    dented.positions[77].y += 0.03;
    let mut random = Random(6);
    for solid in [sphere(100, 100), torus(100, 40), sheet, dented, drum(500, 1.0, 2.0)] {
        let mut place = |solid: &Solid| {
            solid.turned(rotation(&mut random), 100.0 * signed(&mut random)).shuffled(&mut random)
        };
        let parts = [place(&solid), place(&solid), place(&solid.mirrored())];
        let found = search(&Solid::all(&parts));
        // The diagonals of the quads lie the other way in a mirror.
        assert_eq!(numbers(&found), (3, 2, 0), "{} vertices", solid.positions.len());
    }
}

#[test]
fn parts_that_take_too_much_work_are_counted() {
    // Rings that look alike from each of their 200 segments. One has a corner that is moved by more than the bound, but
    // by so little that no side of a triangle tells it: each walk is gone to its end.
    let ring = torus(200, 8);
    let mut other = ring.clone();
    other.positions[900] *= 1.0 + 5e-5;
    let solid = Solid::all(&[ring.clone(), other.moved(Vec3::X * 3.0), ring.moved(Vec3::X * 6.0)]);
    let given_up = |solid: &Solid, work| {
        let settings = Settings { work, ..Settings::default() };
        let found = find(&solid.surface(), &settings).unwrap();
        verify(&solid.surface(), &found, &settings);
        numbers(&found)
    };
    assert_eq!(given_up(&solid, 1 << 20), (3, 2, 0));
    assert_eq!(given_up(&solid, 16), (3, 2, 1));
    // The last one is like two shapes; the work is not enough to look at both.
    let mut third = ring.clone();
    third.positions[700] *= 1.0 + 7e-5;
    let solid = Solid::all(&[ring.clone(), other.moved(Vec3::X * 3.0), third.moved(Vec3::X * 6.0)]);
    assert_eq!(given_up(&solid, 1), (3, 3, 2));
}

/// Sides of triangles do not tell the dent, so that walks over a ring without it and one with it go to their end. Still
/// the copies of both are found.
#[test]
fn copies_are_found_among_others_that_differ_in_a_detail() {
    let mut random = Random(11);
    let parts: Vec<Solid> = (0..16)
        .map(|part| {
            let mut ring = torus(120, 8);
            if part % 2 == 1 {
                // Each elsewhere, but at equal distances from the axis.
                ring.positions[120 + 7 * part] *= 1.0 + 6e-5;
            }
            ring.turned(rotation(&mut random), 10.0 * signed(&mut random)).shuffled(&mut random)
        })
        .collect();
    let found = search(&Solid::all(&parts));
    let shapes: Vec<u32> = found.repeats.instances().iter().map(|instance| instance.shape).collect();
    assert_eq!(shapes, [[0; 8], [1; 8]].concat());
    // The first one with a dent, compared with those without, is given up and becomes the second shape.
    assert!(found.report.given_up <= 1, "{:?}", found.report);
}

/// The numbers of a building whose baked parts a tool with hashes found hardly any repeats in.
#[test]
fn twelve_thousand_parts_are_a_hundred_and_sixty_nine_shapes() {
    let mut random = Random(7);
    let shapes: Vec<Solid> = (0..169)
        .map(|_| {
            let mut shape = sphere(5 + random.below(8), 3 + random.below(4));
            let stretch = Vec3::new(0.3 + random.unit(), 0.1 + random.unit(), 0.3 + random.unit());
            shape.positions.iter_mut().for_each(|at| *at *= stretch * (0.8 + 0.2 * random.unit()));
            shape
        })
        .collect();
    let parts: Vec<Solid> = (0..12_178)
        .map(|part| {
            let shape = if part < 169 { part } else { random.below(169) as usize };
            let at = DVec3::new(400.0, 50.0, 300.0) + 200.0 * signed(&mut random);
            shapes[shape].turned(rotation(&mut random), at).shuffled(&mut random)
        })
        .collect();
    let found = search(&Solid::all(&parts));
    assert_eq!(numbers(&found), (12_178, 169, 0));
    assert_eq!((found.report.copies(), found.report.ratio()), (12_009, 12_178.0 / 169.0));
}

#[test]
fn normals_colours_and_materials_are_kept_and_compared() {
    let mut part = sphere(7, 3);
    part.positions.iter_mut().for_each(|at| at.x *= 1.5);
    let count = part.positions.len();
    part.normals = Some(part.positions.iter().map(|at| 3.0 * *at).collect());
    part.colors = Some((0..count).map(|i| [i as u8, 7, 255, 255 - i as u8]).collect());
    part.materials = Some(vec![4; part.triangles.len()]);
    let mut random = Random(8);
    let mut place =
        |solid: &Solid| solid.turned(rotation(&mut random), 10.0 * signed(&mut random)).shuffled(&mut random);
    let other_material = Solid { materials: Some(vec![2; part.triangles.len()]), ..part.clone() };
    let mut other_color = part.clone();
    other_color.colors.as_mut().unwrap()[3][1] = 8;
    let mut other_normal = part.clone();
    let tilted = other_normal.normals.as_mut().unwrap();
    tilted[5] = (tilted[5].normalize() + 0.05 * tilted[5].normalize().any_orthonormal_vector()).normalize();

    let parts = [&part, &part.soup(), &other_material, &other_color, &other_normal].map(&mut place);
    let found = search(&Solid::all(&parts));
    // A material belongs to an instance.
    let shapes: Vec<_> = found.repeats.instances().iter().map(|i| (i.shape, i.material.unwrap())).collect();
    assert_eq!(shapes, [(0, 4), (0, 4), (0, 2), (1, 4), (2, 4)]);
    // Corners of the soup are as many vertices as the part has.
    assert_eq!(found.repeats.shapes()[0].vertex_count(), count);
    assert_eq!(found.repeats.bytes().attributes, 3 * count * 8);
    // Without attributes they are all the same.
    let plain = Solid { normals: None, colors: None, materials: None, ..Solid::all(&parts) };
    assert_eq!(numbers(&search(&plain)), (5, 1, 0));
}

#[test]
fn vertices_and_triangles_that_are_not_stored_are_counted() {
    let mut solid = cuboid(Vec3::ONE);
    solid.positions.extend([Vec3::splat(9.0), solid.positions[0]]);
    solid.triangles.extend([[0, 1, 9], [2, 2, 3]]);
    let found = search(&solid);
    assert_eq!((found.report.degenerate, found.report.unused), (2, 2));
    assert_eq!((found.vertices[8], found.triangles[12]), (None, None));
}

#[test]
fn the_number_of_cores_does_not_matter() {
    let mut random = Random(9);
    let models: Vec<Solid> = (0..12).map(|_| small_part(&mut random)).collect();
    let parts: Vec<Solid> = (0..400)
        .map(|i| {
            models[i % 12].turned(rotation(&mut random), 100.0 * signed(&mut random)).shuffled(&mut random)
        })
        .collect();
    let solid = Solid::all(&parts);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| find(&solid.surface(), &Settings::default())).unwrap()
    };
    assert!(with(1) == with(5));
}

#[test]
fn the_largest_and_the_smallest_parts_are_found() {
    let mut random = Random(10);
    for scale in [1e29, 1e-30, 1e-36] {
        let part = small_part(&mut random);
        let mut copy = part.turned(rotation(&mut random), 3.0 * signed(&mut random));
        let mut solid = part.clone();
        [&mut solid, &mut copy]
            .into_iter()
            .flat_map(|solid| &mut solid.positions)
            .for_each(|at| *at *= scale);
        let found = search(&Solid::all(&[solid, copy]));
        assert_eq!(numbers(&found), (2, 1, 0), "{scale}");
    }
}

#[test]
fn coarser_bounds_take_fewer_bytes() {
    let solid = Solid::all(&[sphere(40, 40), sphere(40, 40).moved(Vec3::X * 3.0)]);
    let bits = [0.0, 1e-6, 1e-5, 1e-3, 1e-2, 1.0].map(|share| {
        let settings = Settings { tolerance: Tolerance::Relative(share), ..Settings::default() };
        let found = find(&solid.surface(), &settings).unwrap();
        verify(&solid.surface(), &found, &settings);
        assert_eq!(numbers(&found), (2, 1, 0));
        found.repeats.shapes()[0].bits()
    });
    // The three coordinates lose 20 bits where the bound is a thousand times larger. The coarsest grid has two cells in
    // each direction.
    assert!(
        bits.is_sorted_by(|a, b| a > b) && bits[0] <= 72 && bits[1] <= bits[3] + 30 && bits[5] <= 6,
        "{bits:?}"
    );
}

#[test]
fn a_search_tells_how_far_it_is_and_stops_when_asked() {
    let solid = Solid::all(&[0, 1, 2, 3].map(|i| cuboid(Vec3::ONE).moved(Vec3::X * (5 * i) as f32)));
    let seen = Mutex::new(Vec::new());
    let watch = |share: f64| {
        seen.lock().unwrap().push(share);
        ControlFlow::Continue(())
    };
    find_watched(&solid.surface(), &Settings::default(), &watch).unwrap();
    let mut seen = seen.into_inner().unwrap();
    seen.sort_by(f64::total_cmp);
    assert_eq!(seen, [0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 1.0]);
    // At once, and in the middle.
    for from in [0.0, 0.5] {
        let watch = |share| if share >= from { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        assert_eq!(find_watched(&solid.surface(), &Settings::default(), &watch), Err(RepeatsError::Stopped));
    }
}

#[test]
fn what_cannot_be_searched_says_why() {
    let cube = cuboid(Vec3::ONE);
    let error =
        |solid: &Solid, settings: Settings| find(&solid.surface(), &settings).unwrap_err().to_string();
    let wrong = |change: fn(&mut Solid)| {
        let mut solid = cube.clone();
        change(&mut solid);
        error(&solid, Settings::default())
    };
    assert_eq!(
        wrong(|solid| solid.triangles.clear()),
        "the mesh has no triangles with three different corners"
    );
    assert_eq!(wrong(|solid| solid.triangles = vec![[0, 0, 1]]), wrong(|solid| solid.triangles.clear()));
    assert_eq!(
        wrong(|solid| solid.positions[3].y = f32::NAN),
        "vertex 3 is at [1, NaN, -1]; coordinates must be numbers of at most 1e30"
    );
    assert_eq!(
        wrong(|solid| solid.triangles[2][1] = 8),
        "triangle 2 has vertex 8 as a corner, but there are only 8 vertices"
    );
    assert_eq!(
        wrong(|solid| solid.normals = Some(vec![Vec3::X; 7])),
        "there are 7 normals, not one for each of 8 vertices"
    );
    assert_eq!(
        wrong(|solid| solid.materials = Some(vec![1; 8])),
        "there are 8 materials, not one for each of 12 triangles"
    );
    assert_eq!(
        wrong(|solid| solid.normals = Some(vec![Vec3::X * f32::INFINITY; 8])),
        "the normal of vertex 0 is [inf, NaN, NaN]; it must be made of finite numbers"
    );
    let setting = |settings| error(&cube, settings);
    let default = Settings::default();
    for (tolerance, text) in [
        (Tolerance::Relative(-0.1), "tolerance must be 0 to 1e0, not -0.1"),
        (Tolerance::Distance(f64::NAN), "tolerance must be 0 to 1.0000000150474662e30, not NaN"),
    ] {
        assert_eq!(setting(Settings { tolerance, ..default }), text);
    }
    assert_eq!(setting(Settings { normals: 3.0, ..default }), "normals must be 0 to 2, not 3");
    assert_eq!(setting(Settings { work: 0, ..default }), "work must be 1 to 4294967296, not 0");
}

/// Rotations are those of the copies, not only some that fit.
#[test]
fn instances_have_the_transformations_of_their_parts() {
    let part = prism(&[[0.0, 0.0], [0.0, 2.0], [1.0, 0.5]].map(|[x, z]| Vec3::new(x, 0.0, z)), 0.3);
    let turn = DQuat::from_rotation_y(1.0) * DQuat::from_rotation_x(0.4);
    let solid = Solid::all(&[part.clone(), part.turned(turn, DVec3::new(5.0, 6.0, 7.0))]);
    let found = search(&solid);
    let [first, second] = found.repeats.instances() else { panic!("{:?}", found.report) };
    let between = second.rotation.as_dquat() * first.rotation.as_dquat().inverse();
    assert!(between.angle_between(turn) < 1e-5);
    let moved = second.translation.as_dvec3() - turn * first.translation.as_dvec3();
    assert!(moved.abs_diff_eq(DVec3::new(5.0, 6.0, 7.0), 1e-5));
}
