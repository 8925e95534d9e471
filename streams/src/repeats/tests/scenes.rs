//! The built-in scenes, all parts in one mesh without names.

use std::collections::{BTreeMap, BTreeSet};

use epigraph_scenes::Scene;
use glam::DVec3;

use super::*;

/// The triangles of a scene, each with vertices of its own, as tools leave them that know only corners.
fn baked(scene: &Scene) -> Solid {
    let mesh = &scene.mesh;
    let corners = (0..mesh.triangles.len()).flat_map(|face| mesh.corners(face));
    Solid {
        positions: corners.collect(),
        triangles: (0..mesh.triangles.len() as u32)
            .map(|face| [3 * face, 3 * face + 1, 3 * face + 2])
            .collect(),
        normals: Some(mesh.corner_normals.concat()),
        materials: Some(mesh.material.to_vec()),
        ..Solid::default()
    }
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
                let [va, vb] = [a, b].map(|at| volume([at[0], at[n / 3], at[n / 2], at[i]]));
                others.into_iter().all(near) && (va - vb).abs() < 1e-5 * size.powi(3)
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

/// The shape of each triangle of an object.
fn shapes_of(scene: &Scene, found: &Found, object: usize) -> Vec<u32> {
    let faces = (0..scene.mesh.triangles.len()).filter(|&face| scene.mesh.object[face] as usize == object);
    let instance = |face: usize| found.triangles[face].unwrap().instance as usize;
    faces.map(|face| found.repeats.instances()[instance(face)].shape).collect()
}

/// Objects that are built alike, and how many of them were found to be.
fn found_alike(scene: &Scene, found: &Found) -> (usize, usize) {
    let sets = built_alike(scene);
    let alike = |set: &Vec<usize>| {
        // How many agree with each: the largest number of the set is what was found.
        let shapes: Vec<Vec<u32>> = set.iter().map(|&object| shapes_of(scene, found, object)).collect();
        shapes.iter().map(|own| shapes.iter().filter(|other| *other == own).count()).max().unwrap()
    };
    (sets.iter().map(Vec::len).sum(), sets.iter().map(alike).sum())
}

#[test]
fn every_link_of_the_chains_is_one_shape() {
    let scene = Scene::load("chains").unwrap();
    let found = search(&baked(&scene));
    // 22 links, two posts, the beam and the floor.
    assert_eq!(numbers(&found), (26, 4, 0));
    let mut count = BTreeMap::<u32, usize>::new();
    found.repeats.instances().iter().for_each(|instance| *count.entry(instance.shape).or_default() += 1);
    assert_eq!(count.into_values().collect::<BTreeSet<_>>(), BTreeSet::from([1, 2, 22]));
    assert_eq!(found_alike(&scene, &found), (24, 24));
    // The three chains are of three materials.
    let links = found.repeats.instances().iter().filter(|instance| instance.shape == 3);
    assert_eq!(links.map(|instance| instance.material).collect::<BTreeSet<_>>().len(), 3);
    // Half of what is allowed to the floor, for its grid.
    assert!(found.report.deviation < 1.1e-5, "{:?}", found.report);
}

#[test]
fn what_repeats_in_the_room_is_found() {
    let scene = Scene::load("room").unwrap();
    let found = search(&baked(&scene));
    let (alike, of_them) = found_alike(&scene, &found);
    assert!(alike >= 60 && of_them * 100 >= alike * 95, "{of_them} of {alike}");
    assert_eq!(found.report.given_up, 0);
    assert!(found.report.deviation < 3e-5, "{:?}", found.report);
}
