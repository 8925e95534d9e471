//! Wavefront OBJ with its MTL: positions, normals, faces of any number of corners, `usemtl`. Texture coordinates and
//! maps are skipped; a polygon is fanned into triangles.

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::model::Model;
use crate::limits::{MAX_COORDINATE, MAX_RADIANCE, is_near, is_radiance};
use crate::{Material, MeshError, Shape};

/// Reads an OBJ file; `library` returns the text of a material file that it references.
///
/// Every run of faces between `o`, `g` and `usemtl` lines becomes a part. An undefined material is replaced by the
/// default one, as in other readers.
pub(super) fn read(text: &str, library: impl Fn(&str) -> Result<String, String>) -> Result<Model, String> {
    let mut reader = Reader::default();
    for (number, line) in text.lines().enumerate() {
        reader.line(line, &library).map_err(|message| format!("line {}: {message}", number + 1))?;
    }
    reader.finish_part();
    Ok(reader.model)
}

#[derive(Default)]
struct Reader {
    model: Model,
    by_name: HashMap<String, usize>,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    material: Option<usize>,
    /// The number of triangles of all faces.
    triangles: usize,
    /// The material files that were read.
    libraries: HashSet<String>,
    /// The faces since the last change of object or material, as indices into `positions` and `normals`.
    faces: Vec<[Corner; 3]>,
}

#[derive(Clone, Copy)]
struct Corner {
    position: usize,
    normal: Option<usize>,
}

impl Reader {
    fn line(&mut self, line: &str, library: impl Fn(&str) -> Result<String, String>) -> Result<(), String> {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "v" => {
                let position = vector(rest)?;
                if !is_near(position) {
                    let limit = format!("farther out than {MAX_COORDINATE:e} m: make the model smaller");
                    return Err(format!("the vertex `{}` is {limit}", rest.trim()));
                }
                self.positions.push(position);
                MeshError::of_size(self.triangles, self.positions.len())
                    .map_err(|error| error.to_string())?;
            }
            "vn" => self.normals.push(vector(rest)?),
            "f" => self.face(rest)?,
            "o" | "g" => self.finish_part(),
            "usemtl" => {
                self.finish_part();
                self.material = self.by_name.get(rest.trim()).copied();
            }
            // Once each, however often it is named.
            "mtllib" if self.libraries.insert(rest.trim().to_owned()) => {
                for material in read_materials(&library(rest.trim())?)? {
                    self.by_name.insert(material.name.clone(), self.model.materials.len());
                    self.model.materials.push(material);
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, words: &str) -> Result<(), String> {
        let corners: Vec<Corner> =
            words.split_whitespace().map(|w| self.corner(w)).collect::<Result<_, _>>()?;
        if corners.len() < 3 {
            return Err(format!("a face needs three corners, but this one has {}", corners.len()));
        }
        self.triangles += corners.len() - 2;
        MeshError::of_size(self.triangles, self.positions.len()).map_err(|error| error.to_string())?;
        self.faces.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
        Ok(())
    }

    /// `position`, `position/texture`, `position//normal` or all three; from 1, or negative from the latest.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let mut fields = word.split('/');
        let position = resolve(fields.next().unwrap_or_default(), self.positions.len(), "vertex")?;
        let normal = match fields.nth(1) {
            None | Some("") => None,
            Some(field) => Some(resolve(field, self.normals.len(), "normal")?),
        };
        Ok(Corner { position, normal })
    }

    fn finish_part(&mut self) {
        if self.faces.is_empty() {
            return;
        }
        let mut shape = Shape::default();
        let mut index = HashMap::new();
        let has_normals = self.faces.iter().flatten().any(|corner| corner.normal.is_some());
        for face in self.faces.drain(..) {
            shape.triangles.push(face.map(|corner| {
                *index.entry(corner.position).or_insert_with(|| {
                    shape.positions.push(self.positions[corner.position]);
                    shape.positions.len() as u32 - 1
                })
            }));
            if has_normals {
                let normal = |corner: Corner| corner.normal.map_or(Vec3::ZERO, |n| self.normals[n]);
                shape.normals.push(face.map(|corner| normal(corner).normalize_or_zero()));
            }
        }
        self.model.parts.push((shape, self.material));
    }
}

fn resolve(field: &str, count: usize, what: &str) -> Result<usize, String> {
    let number: i64 = field.parse().map_err(|_| format!("`{field}` is not a {what} number"))?;
    let index = if number < 0 { count as i64 + number } else { number - 1 };
    usize::try_from(index)
        .ok()
        .filter(|&i| i < count)
        .ok_or_else(|| format!("{what} {number} does not exist: only {count} are defined so far"))
}

fn number(word: &str) -> Result<f32, String> {
    word.parse().map_err(|_| format!("`{word}` is not a number"))
}

/// The first three numbers of a line.
fn vector(words: &str) -> Result<Vec3, String> {
    let mut values = words.split_whitespace().map(number);
    let mut next =
        || values.next().unwrap_or_else(|| Err(format!("expected three numbers, found `{words}`")));
    let vector = Vec3::new(next()?, next()?, next()?);
    if vector.is_finite() { Ok(vector) } else { Err(format!("`{words}` is not finite")) }
}

/// A material of an MTL file.
struct Mtl {
    name: String,
    diffuse: Vec3,
    specular: Vec3,
    emission: Vec3,
    exponent: f32,
    illum: u32,
}

fn read_materials(text: &str) -> Result<Vec<Material>, String> {
    let mut list: Vec<Mtl> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let at_line = |message: String| format!("material library, line {}: {message}", index + 1);
        if keyword == "newmtl" {
            list.push(Mtl {
                name: rest.to_owned(),
                diffuse: Vec3::splat(0.7),
                specular: Vec3::ZERO,
                emission: Vec3::ZERO,
                exponent: 0.0,
                illum: 2,
            });
        }
        let Some(material) = list.last_mut() else { continue };
        match keyword {
            "Kd" => material.diffuse = vector(rest).map_err(at_line)?,
            "Ks" => material.specular = vector(rest).map_err(at_line)?,
            "Ke" => {
                material.emission = vector(rest).map_err(at_line)?;
                if !is_radiance(material.emission) {
                    return Err(at_line(format!("an emission may be at most {MAX_RADIANCE:e}")));
                }
            }
            "Ns" => material.exponent = number(rest).map_err(at_line)?,
            "illum" => {
                material.illum =
                    rest.parse().map_err(|_| at_line(format!("`{rest}` is not an illumination model")))?
            }
            _ => {}
        }
    }
    Ok(list.into_iter().map(Mtl::into_material).collect())
}

impl Mtl {
    /// Model 3 and up reflect their surroundings (a metal); below, a specular colour is a coat of a dielectric, whose
    /// reflectance at normal incidence is by custom 0.08 times the "specular" that exporters write.
    ///
    /// The exponent becomes a roughness by the rule with which Blender wrote it, Ns = (30 (1 - roughness))^2; beyond
    /// 0.6 the lobe is too wide and weak to tell from diffuse.
    fn into_material(self) -> Material {
        const ROUGHEST_COAT: f32 = 0.6;
        let roughness = (1.0 - self.exponent.max(0.0).sqrt() / 30.0).clamp(0.02, 1.0);
        let specular = self.specular.max_element().clamp(0.0, 1.0);
        let color = self.diffuse.clamp(Vec3::ZERO, Vec3::ONE);
        let material = match self.illum {
            3.. if specular > 0.0 && roughness <= 0.02 => Material::mirror(self.name, color),
            3.. if specular > 0.0 => Material::glossy(self.name, color, roughness, specular),
            2 if specular > 0.0 && roughness < ROUGHEST_COAT => {
                Material::glossy(self.name, color, roughness, 0.08 * specular)
            }
            _ => Material::diffuse(self.name, color),
        };
        Material { emission: self.emission.max(Vec3::ZERO), ..material }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &str = "mtllib a.mtl\no quad\nv 0 0 0\nv 1 0 0 # comment\nv 1 1 0\nv 0 1 0\nvn 0 0 2\n\
        usemtl lamp\nf 1//1 2//1 3//1 -1//1\nusemtl metal\nf 1/1/1 3/9/1 2\nusemtl unknown\nf 1 2 3\n";
    const MTL: &str =
        "newmtl lamp\nKd 0 0 0\nKe 5 4 3\nnewmtl metal\nKd 0.1 0.2 0.3\nKs 0.5 0.5 0.5\nNs 225\nillum 3\n";

    fn library(name: &str) -> Result<String, String> {
        if name == "a.mtl" { Ok(MTL.to_owned()) } else { Err(format!("no {name}")) }
    }

    #[test]
    fn faces_materials_and_normals() {
        let model = read(OBJ, library).unwrap();
        assert_eq!(model.parts.iter().map(|p| p.1).collect::<Vec<_>>(), [Some(0), Some(1), None]);
        assert_eq!(model.parts[0].0.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(model.parts[0].0.normals, [[Vec3::Z; 3]; 2]);
        assert_eq!(model.parts[1].0.normals, [[Vec3::Z, Vec3::Z, Vec3::ZERO]]);
        assert_eq!(model.materials[0].emission, Vec3::new(5.0, 4.0, 3.0));
        assert_eq!((model.materials[1].roughness, model.materials[1].f0), (0.5, 0.5));
    }

    #[test]
    fn corners_are_written_in_many_ways() {
        for (faces, triangles, normals) in [
            ("f 1 2 3", &[[0, 1, 2]][..], &[][..]),
            ("f 3 1 2", &[[2, 0, 1]], &[]),
            ("f 1/4 2/4 3/4", &[[0, 1, 2]], &[]),
            ("f 1/ 2/ 3/", &[[0, 1, 2]], &[]),
            ("f 1// 2// 3//", &[[0, 1, 2]], &[]),
            ("f 1//2 2//1 3//-1", &[[0, 1, 2]], &[[Vec3::Y, Vec3::X, Vec3::Y]]),
            ("f 1/7/1 2/8/1 3/9/2", &[[0, 1, 2]], &[[Vec3::X, Vec3::X, Vec3::Y]]),
            ("f 1//1 2 3/5", &[[0, 1, 2]], &[[Vec3::X, Vec3::ZERO, Vec3::ZERO]]),
            ("f -5 -4 -1", &[[0, 1, 4]], &[]),
            ("f 1 2 3 4 5", &[[0, 1, 2], [0, 2, 3], [0, 3, 4]], &[]),
            ("  f\t1\t2  3 \r\nf 2 3 4 # f 1 2 5", &[[0, 1, 2], [1, 2, 3]], &[]),
        ] {
            // Vertices may have colours, or a weight.
            let text = format!(
                "v 0 1 2 9 9 9\nv 10 11 12\nv 2e1 21 +22.0 1\nv 30 31 -3.2\nv\t40  41 42\nvn 3 0 0\nvn 0 0.5 0\n\
                vt 0 0\ns off\n\n{faces}\n"
            );
            let shape = &read(&text, library).unwrap().parts[0].0;
            let positions = [
                [0.0, 1.0, 2.0],
                [10.0, 11.0, 12.0],
                [20.0, 21.0, 22.0],
                [30.0, 31.0, -3.2],
                [40.0, 41.0, 42.0],
            ]
            .map(Vec3::from);
            let places = |list: &[[usize; 3]], of: &dyn Fn(usize) -> Vec3| -> Vec<[Vec3; 3]> {
                list.iter().map(|triangle| triangle.map(of)).collect()
            };
            let found: Vec<[usize; 3]> = shape.triangles.iter().map(|t| t.map(|i| i as usize)).collect();
            assert_eq!(
                places(&found, &|i| shape.positions[i]),
                places(triangles, &|i| positions[i]),
                "{faces}"
            );
            assert_eq!(shape.normals, normals, "{faces}");
        }
    }

    #[test]
    fn surfaces_of_materials() {
        // Metallic, roughness and reflectance.
        let surface_of = |material: &Material| (material.metallic, material.roughness, material.f0);
        let (diffuse, mirror) = ((0.0, 1.0, 0.0), (1.0, 0.0, crate::DIELECTRIC_F0));
        let glossy = |roughness, f0| (0.0, roughness, f0);
        // Ns = 900 (1 - roughness)^2.
        for (illum, specular, exponent, surface) in [
            (0, 0.5, 225.0, diffuse),
            (1, 0.5, 225.0, diffuse),
            (2, 0.0, 225.0, diffuse),
            (2, 0.5, 225.0, glossy(0.5, 0.04)),
            (2, 1.0, 225.0, glossy(0.5, 0.08)),
            (2, 9.0, 225.0, glossy(0.5, 0.08)),
            (2, 0.5, 900.0, glossy(0.02, 0.04)),
            (2, 0.5, 143.0, diffuse),
            (2, 0.5, 0.0, diffuse),
            (2, 0.5, -5.0, diffuse),
            (3, 0.0, 900.0, diffuse),
            (3, 0.5, 900.0, mirror),
            (3, 0.5, 1000.0, mirror),
            (3, 0.5, 225.0, glossy(0.5, 0.5)),
            (3, 0.5, 0.0, glossy(1.0, 0.5)),
            (7, 0.25, 225.0, glossy(0.5, 0.25)),
        ] {
            let text = format!("newmtl a\nillum {illum}\n Ks 0 {specular} 0\nNs {exponent}\n");
            assert_eq!(surface_of(&read_materials(&text).unwrap()[0]), surface, "{text}");
        }
        // Without `illum` it is a coat; the rest is grey and dark.
        let [plain, coat] =
            &read_materials("# two\nnewmtl a b\nnewmtl c\nKs 1 1 1\nNs 225\nKd 2 -1 0.5").unwrap()[..]
        else {
            panic!("two materials")
        };
        let expected = (Vec3::splat(0.7), diffuse, Vec3::ZERO);
        assert_eq!(
            (plain.name.as_str(), (plain.color, surface_of(plain), plain.emission)),
            ("a b", expected)
        );
        assert_eq!((coat.color, surface_of(coat)), (Vec3::new(1.0, 0.0, 0.5), glossy(0.5, 0.08)));
    }

    #[test]
    fn errors_name_the_line() {
        for (from, to, expected) in [
            ("v 1 1 0", "v 1 nan 0", "line 5: `1 nan 0` is not finite"),
            ("v 1 1 0", "v 1 1", "line 5: expected three numbers, found `1 1`"),
            ("v 1 1 0", "v 1 1 x", "line 5: `x` is not a number"),
            ("f 1 2 3", "f 1 2 5", "line 13: vertex 5 does not exist: only 4 are defined"),
            ("f 1 2 3", "f 0 2 3", "line 13: vertex 0"),
            ("f 1 2 3", "f 1 2 -5", "line 13: vertex -5"),
            ("f 1 2 3", "f 1 2", "line 13: a face needs three"),
            ("f 1 2 3", "f 1//7 2 3", "line 13: normal 7"),
            ("a.mtl", "b.mtl", "line 1: no b.mtl"),
        ] {
            let error = read(&OBJ.replacen(from, to, 1), library).unwrap_err();
            assert!(error.starts_with(expected), "{error}");
        }
        let broken = |_: &str| Ok("newmtl a\nKd 1 2\n".to_owned());
        assert!(read(OBJ, broken).unwrap_err().contains("material library, line 2"));
    }

    #[test]
    fn no_truncation_panics() {
        for length in 0..OBJ.len() {
            // A text format may end after any line, so a shorter file can be a whole one.
            let _ = read(&OBJ[..length], library);
        }
    }
}
