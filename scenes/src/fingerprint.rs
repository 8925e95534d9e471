//! What a scene contains, as a number.

use std::fmt::Write;

use epigraph_files::Fingerprint;

use crate::Scene;

impl Scene {
    /// A number for everything that traced pictures of the scene depend on: two loads of one scene have the same, and a
    /// scene whose files have changed has another. Its own name does not count. Of points without surfaces, which no ray
    /// meets, only the number of their models and places counts.
    pub fn fingerprint(&self) -> Fingerprint {
        // All fields, so that a new one is not forgotten.
        let Self {
            name: _,
            origin,
            mesh,
            materials,
            textures,
            lights,
            added,
            background,
            sky,
            camera,
            cameras,
            bounds,
            bodies,
            poses,
            points,
            report: _,
        } = self;
        let mut print = Fingerprint::default();
        let surfaces = (origin, mesh, materials, lights, background);
        let around = (added, camera, cameras, bounds, bodies, poses, points);
        // Debug texts have every number of these in full; a fingerprint takes all text.
        write!(print, "{surfaces:?} {around:?}").expect("a fingerprint takes all text");
        for texture in textures.iter() {
            write!(print, "{:?}", texture.size).expect("a fingerprint takes all text");
            print.take(texture.texels.as_flattened());
        }
        if let Some(sky) = sky {
            sky.fingerprint(&mut print);
        }
        print
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::Sky;

    #[test]
    fn loads_of_one_scene_are_alike_and_other_scenes_differ() {
        let of = |name: &str| Scene::load(name).unwrap().fingerprint();
        let names = ["cornell", "chains", "still-life", "cornell-moving"];
        let prints = names.map(of);
        assert_eq!(prints, names.map(of));
        assert!((0..4).all(|a| (0..a).all(|b| prints[a] != prints[b])), "{prints:?}");
    }

    #[test]
    fn a_change_of_one_number_shows() {
        let scene = Scene::load("still-life").unwrap();
        let mut moved = scene.clone();
        moved.mesh.positions[3].x += 1e-6;
        let mut painted = scene.clone();
        let mut textures = (*painted.textures).clone();
        let mut texture = (*textures[0]).clone();
        texture.texels[5][1] ^= 1;
        textures[0] = texture.into();
        painted.textures = textures.into();
        let mut renamed = scene.clone();
        renamed.name = "another".into();
        assert_ne!(scene.fingerprint(), moved.fingerprint());
        assert_ne!(scene.fingerprint(), painted.fingerprint());
        // The same texels in other rows.
        let mut reshaped = scene.clone();
        let mut textures = (*reshaped.textures).clone();
        let mut texture = (*textures[0]).clone();
        texture.size = [2 * texture.size[0], texture.size[1] / 2];
        textures[0] = texture.into();
        reshaped.textures = textures.into();
        assert_ne!(scene.fingerprint(), reshaped.fingerprint());
        let under = |size: [u32; 2], first: f32| {
            let mut texels = vec![Vec3::ONE; 8];
            texels[0].y = first;
            let sky = Sky::new("", size, texels).unwrap();
            Scene { sky: Some(sky.into()), ..scene.clone() }.fingerprint()
        };
        let skies = [under([4, 2], 1.0), under([4, 2], 1.001), under([2, 4], 1.0), scene.fingerprint()];
        assert!((0..4).all(|a| (0..a).all(|b| skies[a] != skies[b])), "{skies:?}");
        assert_eq!(scene.fingerprint(), renamed.fingerprint());
    }
}
