//! Repeated parts of the built-in scenes, with all parts in one mesh without names.

use std::collections::{BTreeMap, BTreeSet};

use epigraph_scenes::Scene;
use epigraph_streams::repeats::{Found, Instance, Place, Settings, Surface, find};
use glam::{DVec3, Vec3};

/// Finds the repeats of a scene's triangles, each with vertices of its own, as tools leave them that know only corners.
/// Every corner of every triangle is where it was.
fn search(scene: &Scene) -> Found {
    let mesh = &scene.mesh;
    let positions: Vec<Vec3> = (0..mesh.triangles.len()).flat_map(|face| mesh.corners(face)).collect();
    let triangles: Vec<[u32; 3]> =
        (0..mesh.triangles.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    let normals = mesh.corner_normals.concat();
    let surface = Surface {
        positions: &positions,
        triangles: &triangles,
        normals: Some(&normals),
        materials: Some(&mesh.material),
        ..Surface::default()
    };
    let found = find(&surface, &Settings::default()).unwrap();
    for (face, place) in found.triangles.iter().enumerate() {
        let Place { instance, index } = place.expect("no triangle of the scenes is degenerate");
        let instance = found.repeats.instances()[instance as usize];
        let shape = &found.repeats.shapes()[instance.shape as usize];
        let decoded =
            shape.triangles()[index as usize].map(|vertex| instance.place()(shape.position(vertex as usize)));
        let original = mesh.corners(face);
        let distance = |turn: usize| {
            let distances =
                (0..3).map(|k| decoded[k].as_dvec3().distance(original[(k + turn) % 3].as_dvec3()));
            distances.fold(0.0, f64::max)
        };
        assert!((0..3).map(distance).fold(f64::INFINITY, f64::min) <= found.report.deviation, "face {face}");
        assert_eq!(instance.material, Some(mesh.material[face]));
    }
    assert_eq!(found.report.given_up, 0);
    found
}

/// Objects that the scene builds by the same code, so that their triangles have the same order: sets of two or more.
/// Their corners in this order are congruent: as far from each other, and not mirrored.
fn built_alike(scene: &Scene) -> Vec<Vec<usize>> {
    let mesh = &scene.mesh;
    let mut objects: BTreeMap<u32, Vec<DVec3>> = BTreeMap::new();
    for face in 0..mesh.triangles.len() {
        objects.entry(mesh.object[face]).or_default().extend(mesh.corners(face).map(|at| at.as_dvec3()));
    }
    let objects: Vec<Vec<DVec3>> = objects.into_values().collect();
    let volume = |[a, b, c, d]: [DVec3; 4]| (b - a).dot((c - a).cross(d - a));
    let congruent = |a: &[DVec3], b: &[DVec3]| {
        let n = a.len();
        let size = a.iter().map(|at| at.distance(a[0])).fold(0.0, f64::max);
        n == b.len()
            && (0..n).all(|i| {
                let others = [0, n / 3, n / 2, (i + 7) % n, (i + n / 5) % n];
                let near = |j: usize| (a[i].distance(a[j]) - b[i].distance(b[j])).abs() < 2e-6;
                let [of_a, of_b] = [a, b].map(|at| volume([at[0], at[n / 3], at[n / 2], at[i]]));
                others.into_iter().all(near) && (of_a - of_b).abs() < 1e-5 * size.powi(3)
            })
    };
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for object in 0..objects.len() {
        match sets.iter_mut().find(|set| congruent(&objects[set[0]], &objects[object])) {
            Some(set) => set.push(object),
            None => sets.push(vec![object]),
        }
    }
    sets.retain(|set| set.len() > 1);
    sets
}

/// Objects that are built alike, and how many of them have the shapes of the others.
fn found_alike(scene: &Scene, found: &Found) -> (usize, usize) {
    let mut shapes: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for (face, place) in found.triangles.iter().enumerate() {
        let instance = place.expect("it was checked").instance as usize;
        shapes
            .entry(scene.mesh.object[face] as usize)
            .or_default()
            .push(found.repeats.instances()[instance].shape);
    }
    let sets = built_alike(scene);
    let alike = |set: &Vec<usize>| {
        let agree = |object: &usize| set.iter().filter(|other| shapes[*other] == shapes[object]).count();
        set.iter().map(agree).max()
    };
    (sets.iter().map(Vec::len).sum(), sets.iter().filter_map(alike).sum())
}

#[test]
fn every_link_of_the_chains_is_one_shape() {
    let scene = Scene::load("chains").unwrap();
    let found = search(&scene);
    // 22 links, two posts, the beam and the floor.
    assert_eq!((found.report.parts, found.report.shapes), (26, 4));
    let shapes: Vec<&[Instance]> =
        found.repeats.instances_by_shape().map(|(_, instances)| instances).collect();
    let links = shapes.iter().find(|instances| instances.len() == 22).expect("the links are one shape");
    // Three chains of three materials.
    assert_eq!(links.iter().map(|link| link.material).collect::<BTreeSet<_>>().len(), 3);
    assert_eq!(found_alike(&scene, &found), (24, 24));
    // Half of what is allowed to the floor, for its grid: ten micrometres in a scene of four metres.
    assert!(found.report.deviation < 1.1e-5, "{:?}", found.report);
}

#[test]
fn what_repeats_in_the_room_is_found() {
    let scene = Scene::load("room").unwrap();
    let found = search(&scene);
    // The missing one is a wall that is as large as the one opposite, but has the material of its neighbours: it is one
    // part with them.
    assert_eq!(found_alike(&scene, &found), (91, 90));
    assert!(found.report.deviation < 3e-5, "{:?}", found.report);
}
