//! The built-in scenes. Some are made by code; the others are scene files, most of which use meshes from
//! `scenes/fetch`.

mod chains;
mod cornell;
mod room;
mod still_life;

use std::path::PathBuf;

use crate::builder::MeshError;
use crate::load::SceneFile;
use crate::{LoadOptions, Scene, SceneError};

/// A built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneInfo {
    /// Its name.
    pub name: &'static str,
    /// A one-line description.
    pub doc: &'static str,
    /// True if its mesh has to be fetched first, with `scenes/fetch NAME`.
    pub needs_fetch: bool,
}

enum Source {
    /// Made by this function.
    Code(fn() -> Result<Scene, MeshError>),
    /// Described by this embedded scene file.
    File(&'static str),
    /// Described by this embedded scene file, which needs meshes from `scenes/fetch`.
    Fetched(&'static str),
}

struct Builtin {
    name: &'static str,
    doc: &'static str,
    source: Source,
}

const BUILTINS: &[Builtin] = &[
    Builtin {
        name: "cornell",
        doc: "the measured Cornell box: 36 triangles, one area light",
        source: Source::Code(cornell::scene),
    },
    Builtin {
        name: "cornell-moving",
        doc: "the Cornell box in motion: a box slides, a cube turns, the lamp swings: 60 triangles",
        source: Source::File(include_str!("../../cornell-moving.ron")),
    },
    Builtin {
        name: "chains",
        doc: "three chains on a frame that shadow each other: 73,728 triangles, two point lights",
        source: Source::Code(chains::scene),
    },
    Builtin {
        name: "room",
        doc: "a furnished room for global illumination: 101k triangles, three area lights",
        source: Source::Code(room::scene),
    },
    Builtin {
        name: "still-life",
        doc: "gold, steel and glass on a wooden table, before tiles and behind a screen of holes: textures",
        source: Source::Code(still_life::scene),
    },
    Builtin {
        name: "dragon",
        doc: "the Stanford dragon, 871,414 triangles, in the shadow of a grid",
        source: Source::Fetched(include_str!("../../dragon.ron")),
    },
    Builtin {
        name: "dragon-small",
        doc: "the same with 202,520 triangles",
        source: Source::Fetched(include_str!("../../dragon-small.ron")),
    },
    Builtin {
        name: "bust",
        doc: "a bust of 109,259 triangles on a pedestal",
        source: Source::Fetched(include_str!("../../bust.ron")),
    },
    Builtin {
        name: "kitchen",
        doc: "a kitchen of 56,939 triangles and 33 materials for global illumination",
        source: Source::Fetched(include_str!("../../kitchen.ron")),
    },
    Builtin {
        name: "fox",
        doc: "the Fox of the Khronos glTF samples, 576 triangles with a texture, at a mirror",
        source: Source::Fetched(include_str!("../../fox.ron")),
    },
];

/// All built-in scenes, in the order in which to list them.
pub fn scene_names() -> Vec<SceneInfo> {
    BUILTINS
        .iter()
        .map(|b| SceneInfo { name: b.name, doc: b.doc, needs_fetch: matches!(b.source, Source::Fetched(_)) })
        .collect()
}

/// The built-in scene `name`, or `None` if there is no such scene.
pub(crate) fn load(name: &str, options: &LoadOptions) -> Option<Result<Scene, SceneError>> {
    let (text, fetch) = match BUILTINS.iter().find(|b| b.name == name)?.source {
        Source::Code(_) => {
            let under = |scene: Scene| Scene { sky: options.sky.clone().or(scene.sky), ..scene };
            return by_code(name).map(|scene| scene.map(under));
        }
        Source::File(text) => (text, None),
        Source::Fetched(text) => (text, Some(name)),
    };
    let path = PathBuf::from(format!("scenes/{name}.ron"));
    let file = SceneFile::parse(text).map_err(|message| SceneError::Invalid { path: path.clone(), message });
    Some(file.and_then(|file| file.into_scene(name, &path, &scene_folders(), fetch, options)))
}

/// The built-in scene `name` if it is made by code.
pub(crate) fn by_code(name: &str) -> Option<Result<Scene, SceneError>> {
    let make = BUILTINS.iter().find_map(|b| match b.source {
        Source::Code(make) if b.name == name => Some(make),
        _ => None,
    })?;
    Some(make().map_err(|source| SceneError::Mesh { name: name.to_owned(), source }))
}

/// The folders that may contain the folder `data` of fetched meshes: the value of the environment variable
/// `EPIGRAPH_SCENES`, `scenes` in the current folder, and the source tree from which the program was built.
fn scene_folders() -> Vec<PathBuf> {
    let named = std::env::var_os("EPIGRAPH_SCENES").map(PathBuf::from);
    named.into_iter().chain([PathBuf::from("scenes"), PathBuf::from(env!("CARGO_MANIFEST_DIR"))]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EdgeKind, Light, Mesh};

    fn count(mesh: &Mesh, kind: EdgeKind) -> usize {
        mesh.edges.iter().filter(|e| e.kind == kind).count()
    }

    #[test]
    fn chains_has_as_many_triangles_and_edges_as_in_the_papers_and_no_borders() {
        let scene = Scene::load("chains").unwrap();
        assert_eq!((scene.mesh.triangles.len(), scene.mesh.edges.len()), (73_728, 110_592));
        assert_eq!(count(&scene.mesh, EdgeKind::Border), 0);
        assert_eq!(scene.lights.len(), 2);
    }

    #[test]
    fn scene_files_of_the_crate_are_valid() {
        let fetched: Vec<_> = scene_names().into_iter().filter(|info| info.needs_fetch).collect();
        assert_eq!(fetched.len(), 5);
        for builtin in BUILTINS {
            if let Source::File(text) | Source::Fetched(text) = builtin.source {
                let file = SceneFile::parse(text).unwrap_or_else(|error| panic!("{}: {error}", builtin.name));
                assert!(!file.lights.is_empty() && file.camera.is_some());
            }
        }
    }

    #[test]
    fn cornell_moving_has_four_bodies_that_stay_in_the_box() {
        let scene = Scene::load("cornell-moving").unwrap();
        assert_eq!((scene.mesh.triangles.len(), scene.bodies.len(), scene.lights.len()), (60, 4, 1));
        // The limits of positions: off all walls but the floor, on which some bodies stand.
        let walls = [glam::Vec3::new(0.01, 0.0, 0.01), glam::Vec3::new(0.54, 0.548, 0.55)];
        for frame in 0..240 {
            let posed = scene.posed(&scene.poses_at(frame));
            for p in posed.bodies.iter().flat_map(|body| &posed.mesh.positions[body.vertices.clone()]) {
                assert!(p.cmpge(walls[0] - 1e-5).all() && p.cmple(walls[1]).all(), "{p} in frame {frame}");
            }
        }
    }

    #[test]
    fn room_has_about_as_many_triangles_as_in_the_papers_and_only_closed_objects() {
        let scene = Scene::load("room").unwrap();
        let mesh = &scene.mesh;
        assert!((99_990..=102_010).contains(&mesh.triangles.len()), "{} triangles", mesh.triangles.len());
        assert_eq!(scene.lights.len(), 3);
        assert_eq!(
            count(mesh, EdgeKind::Border),
            3 * 4,
            "the quads of the lights are the only open surfaces"
        );
        // The triangles of every object face outwards: the signed volume that they enclose is positive.
        let mut volume = vec![0.0_f64; *mesh.object.last().unwrap() as usize + 1];
        for face in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(face).map(|p| p.as_dvec3());
            volume[mesh.object[face] as usize] += a.dot(b.cross(c)) / 6.0;
        }
        let faces_of = |object: usize| mesh.object.iter().filter(|&&o| o as usize == object).count();
        for (object, volume) in volume.into_iter().enumerate() {
            assert!(volume > 0.0 || faces_of(object) == 2, "object {object}: {volume}");
        }
    }

    #[test]
    fn cornell_is_the_published_box() {
        let scene = Scene::load("cornell").unwrap();
        assert_eq!(scene.mesh.triangles.len(), 36);
        // 18 edges for each of two closed boxes, 17 for the walls (5 of them are diagonals), 5 for the light.
        assert_eq!(scene.mesh.edges.len(), 2 * 18 + 17 + 5);
        assert_eq!(count(&scene.mesh, EdgeKind::Border), 4 + 4);
        assert!(matches!(scene.lights[..], [Light::Quad { u, v, .. }] if u.cross(v).y < 0.0));
        // The camera sees the red wall at the left, and every wall faces it.
        let camera = scene.camera;
        for (face, &material) in scene.mesh.material.iter().enumerate() {
            let centre = scene.mesh.corners(face).iter().sum::<glam::Vec3>() / 3.0;
            let seen = camera.rotation.inverse() * (centre - camera.eye);
            match scene.materials[material as usize].name.as_str() {
                "red" => assert!(seen.x < -0.2),
                "green" => assert!(seen.x > 0.2),
                _ => {}
            }
            if face < 10 {
                assert!(scene.mesh.face_normals[face].dot(camera.eye - centre) > 0.0, "face {face}");
            }
        }
    }

    /// Numbers that change with every vertex and material: the surface's area, its centre, and the mean of x y, y z and
    /// z x, all weighted by the material.
    fn measures(scene: &Scene) -> [f64; 7] {
        let mut sums = [0.0; 7];
        for face in 0..scene.mesh.triangles.len() {
            let [a, b, c] = scene.mesh.corners(face).map(|p| p.as_dvec3());
            let material = &scene.materials[scene.mesh.material[face] as usize];
            let color = (material.color + material.emission).as_dvec3();
            let weight = (b - a).cross(c - a).length() * color.dot(glam::DVec3::new(1.0, 2.0, 3.0));
            let m = (a + b + c) / 3.0;
            for (sum, value) in sums.iter_mut().zip([1.0, m.x, m.y, m.z, m.x * m.y, m.y * m.z, m.z * m.x]) {
                *sum += weight * value;
            }
        }
        sums
    }

    #[test]
    fn scenes_stay_as_the_documented_figures_found_them() {
        for (name, expected) in [
            ("cornell", [14.212650, 3.950938, 3.786549, 4.694709, 1.077676, 1.270507, 1.376887]),
            ("chains", [185.796815, -0.882503, 15.192778, -0.195766, -1.206018, -0.164146, -0.628461]),
            (
                "room",
                [1149.187580, -563.615630, 1593.939873, -426.085815, -861.533296, -411.247191, 265.369777],
            ),
            ("cornell-moving", [14.681783, 4.106428, 3.932184, 4.841877, 1.124662, 1.315919, 1.426450]),
        ] {
            let found = measures(&Scene::load(name).unwrap());
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found - expected).abs() <= 1e-5 * found.abs(), "{name}: {found} for {expected}");
            }
        }
    }
}
