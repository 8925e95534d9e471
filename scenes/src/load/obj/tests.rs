use super::*;

use crate::{Alpha, Map, Texture};

const OBJ: &str = "mtllib a.mtl\no quad\nv 0 0 0\nv 1 0 0 # comment\nv 1 1 0\nv 0 1 0\nvn 0 0 2\n\
    usemtl lamp\nf 1//1 2//1 3//1 -1//1\nusemtl metal\nf 1/1/1 3/9/1 2\nusemtl unknown\nf 1 2 3\n";
const MTL: &str =
    "newmtl lamp\nKd 0 0 0\nKe 5 4 3\nnewmtl metal\nKd 0.1 0.2 0.3\nKs 0.5 0.5 0.5\nNs 225\nillum 3\n";

fn library(name: &str, _: u64) -> Result<Vec<u8>, String> {
    if name == "a.mtl" { Ok(MTL.into()) } else { Err(format!("no {name}")) }
}

fn nothing(name: &str, _: u64) -> Result<Vec<u8>, String> {
    Err(format!("no {name}"))
}

/// What loading says of a file.
fn notes(model: &Model) -> Vec<String> {
    model.report.notes().iter().map(ToString::to_string).collect()
}

/// The materials of a file without pictures, and what is said of them.
fn read_noted(text: &str) -> (Vec<Material>, String) {
    let mut report = Report::default();
    let materials = mtl::read(text, "", &mut report);
    let to_material = |mtl: &Mtl| mtl.to_material(&Textures::default(), &mut report);
    let materials = materials.iter().map(to_material).collect();
    let notes: Vec<String> = report.notes().iter().map(ToString::to_string).collect();
    (materials, notes.join("; "))
}

fn read_materials(text: &str) -> Vec<Material> {
    read_noted(text).0
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
            "v 0 1 2 9 9 9\nv 10 11 12\nv 2e1 21 +22.0 1\nv 30 31 -3.2\nv\t10  11 -30\nvn 3 0 0\nvn 0 0.5 0\n\
            vt 0 0\ns off\n\n{faces}\n"
        );
        let shape = &read(&text, library).unwrap().parts[0].0;
        let positions = [
            [0.0, 1.0, 2.0],
            [10.0, 11.0, 12.0],
            [20.0, 21.0, 22.0],
            [30.0, 31.0, -3.2],
            [10.0, 11.0, -30.0],
        ]
        .map(Vec3::from);
        let places = |list: &[[usize; 3]], of: &dyn Fn(usize) -> Vec3| -> Vec<[Vec3; 3]> {
            list.iter().map(|triangle| triangle.map(of)).collect()
        };
        let found: Vec<[usize; 3]> = shape.triangles.iter().map(|t| t.map(|i| i as usize)).collect();
        assert_eq!(places(&found, &|i| shape.positions[i]), places(triangles, &|i| positions[i]), "{faces}");
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
        (2, 0.5, 144.0, diffuse),
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
        assert_eq!(surface_of(&read_materials(&text)[0]), surface, "{text}");
    }
    // Without an exponent it is rough, but glass is smooth; so is what mirrors as sharply as an exponent can say.
    let of = |lines: &str| read_noted(&format!("newmtl a\n{lines}\n"));
    assert_eq!(surface_of(&of("illum 3\nKs 0.5 0.5 0.5").0[0]), glossy(1.0, 0.5));
    for (exponent, roughness) in [("", 0.0), ("Ns 900", 0.0), ("Ns 864.4", 0.0), ("Ns 862", 0.021)] {
        let glass = of(&format!("illum 7\nNi 1.5\n{exponent}")).0.remove(0);
        assert_eq!(
            (glass.transmission, (1000.0 * glass.roughness).round()),
            (1.0, 1000.0 * roughness),
            "{exponent}"
        );
    }
    // A transparent coat reflects by its index of refraction, an opaque one by its specular.
    for (dissolve, f0) in [("1", 0.04), ("0.5", 1.0 / 9.0), ("1.5", 0.04)] {
        let coat = of(&format!("Ks 0.5 0.5 0.5\nNs 225\nNi 2\nd {dissolve}")).0.remove(0);
        assert!((coat.f0 - f0).abs() < 1e-6, "{dissolve}: {}", coat.f0);
    }
    // What is more than opaque is opaque, and mirrors.
    for lines in ["d 1.5", "Tr 1", "Tr 1.5", "Tr -1", "d 1\nTr 1"] {
        let mirror = of(&format!("illum 3\nKs 0.5 0.5 0.5\nNs 900\n{lines}")).0.remove(0);
        assert_eq!((mirror.metallic, mirror.opacity, mirror.alpha), (1.0, 1.0, Alpha::Opaque), "{lines}");
    }
    // A tint of the mirrored light counts from a fiftieth on, a metal by a tenth.
    let tinted = "approximated: a tinted highlight of a material, shown white (a)";
    for (lines, color, metallic, expected) in [
        ("Kd 0.5 0.5 0.5\nKs 0.5 0.49 0.48125\nNs 225", 0.5, 0.0, ""),
        ("Kd 0.5 0.5 0.5\nKs 0.5 0.49 0.47\nNs 225", 0.5, 0.0, tinted),
        ("Kd 0.5 0.5 0.5\nKs 0.02 0 0\nNs 225", 0.5, 0.0, ""),
        ("Kd 0.05 0.05 0.05\nKs 0.5 0.5 0.5\nNs 225\nillum 3", 0.05, 0.0, ""),
        ("Kd 0.049 0 0\nKs 0.5 0.5 0.5\nNs 225\nillum 3", 0.5, 1.0, ""),
    ] {
        let (materials, notes) = of(lines);
        assert_eq!(
            (materials[0].color.x, materials[0].metallic, &*notes),
            (color, metallic, expected),
            "{lines}"
        );
    }
    // Without `illum` it is a coat; the rest is grey and dark.
    let [plain, coat] = &read_materials("# two\nnewmtl a b\nnewmtl c\nKs 1 1 1\nNs 225\nKd 2 -1 0.5")[..]
    else {
        panic!("two materials")
    };
    let expected = (Vec3::splat(0.7), diffuse, Vec3::ZERO);
    assert_eq!((plain.name.as_str(), (plain.color, surface_of(plain), plain.emission)), ("a b", expected));
    assert_eq!((coat.color, surface_of(coat)), (Vec3::new(1.0, 0.0, 0.5), glossy(0.5, 0.08)));
}

#[test]
fn errors_name_the_line() {
    for (from, to, expected) in [
        ("f 1 2 3", "f 1 2 5", "line 13: vertex 5 does not exist: only 4 are defined"),
        ("f 1 2 3", "f 0 2 3", "line 13: vertex 0"),
        ("f 1 2 3", "f 1 2 -5", "line 13: vertex -5"),
        ("f 1 2 3", "f 1 2 x", "line 13: `x` is not a vertex number"),
        ("f 1 2 3", "f 1 2 9999999999", "line 13: vertex 9999999999"),
        // The last number that a vertex may have, which may still follow, and the one after it.
        ("f 1 2 3", "f 1 2 4294967294", "line 13: vertex 4294967294 does not exist: only 4 are defined"),
        (
            "f 1 2 3",
            "f 1 2 4294967295",
            "line 13: vertex 4294967295 does not exist: only 4 are defined so far",
        ),
        ("v 1 1 0", "v 1 2e9 0", "line 5: the vertex `1 2e9 0` is farther out than 1e9 m"),
    ] {
        let error = read(&OBJ.replacen(from, to, 1), library).err().unwrap();
        assert!(error.starts_with(expected), "{error}");
    }
    for (text, expected) in [
        ("v x 0 0\nv 0 y 0\nv 0 1 0\nf 1 2 3\n", "such as those of the vertex in line 1, `x 0 0`"),
        ("mtllib a.mtl\n", "it has neither vertices nor faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "no faces: `epigraph encode` makes a point set"),
        ("v 0 0 0\nv 1;5 0 0\nv 0 1 0\nf 1 2 3\n", "such as those of the vertex in line 2, `1;5 0 0`"),
    ] {
        let error = read(text, nothing).err().unwrap();
        assert!(error.contains(expected), "{error}");
    }
}

/// A quad in two materials, a floor in a third.
const HABITS: &str = "mtllib a.mtl\no quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl lamp\n\
    f 1//1 2//1 3//1\nusemtl metal\nf 1//1 3//1 4//1\no floor\nf 1 2 4\n";

#[test]
fn what_is_wrong_and_inessential_is_noted() {
    for (from, to, triangles, expected) in [
        ("f 1 2 4", "f 1 2 4", [1, 1, 1], ""),
        (
            "a.mtl",
            "b.mtl",
            [1, 1, 1],
            "left out: a material library that is missing or cannot be read (b.mtl)",
        ),
        (
            "usemtl lamp",
            "usemtl lam",
            [1, 1, 1],
            "left out: a material that is not defined, shown as plain grey (lam)",
        ),
        (
            "vn 0 0 1",
            "vn 0 -nan(ind) 1",
            [1, 1, 1],
            "repaired: a normal that is not a number, replaced by the face's (quad)",
        ),
        (
            "f 1//1 2//1 3//1",
            "f 1//2 2//0 3//x",
            [1, 1, 1],
            "repaired: a normal that does not exist, replaced by the face's, 3 times (quad)",
        ),
        (
            "f 1 2 4",
            "f 1 2\nf 1\nf\nf 1 2 4",
            [1, 1, 1],
            "left out: a face with fewer than three corners, 3 times (floor)",
        ),
        (
            "f 1 2 4",
            "f 1 2 4\nl 1 2 3\np 1",
            [1, 1, 1],
            "left out: a line (floor); left out: a point (floor)",
        ),
        (
            "f 1 2 4",
            "f 1 2 4\nvp 0 1\ncstype bspline\ndeg 3\ncurv 0 1 1 2 \\\n3 4\nparm u 0 0 0 1 1 1\nend",
            [1, 1, 1],
            "left out: a free-form curve or surface (floor)",
        ),
        (
            "f 1 2 4",
            "f 1 2 4\nusemap x\nhello world\nmaplib a",
            [1, 1, 1],
            "left out: a statement that is not known, 3 times (usemap, hello, maplib)",
        ),
        (
            "f 1 2 4",
            "v inf 0 0\nv 1:5 0 0\nv 1 0\nf 1 2 5\nf 1 2 6 3\nf 7 2 1\nf 1 2 4",
            [1, 1, 1],
            "left out: a face with a corner that is not a number, 3 times (floor)",
        ),
        ("f 1 2 4", "v nan 0 0\nf 1 2 4", [1, 1, 1], ""),
        ("o floor", "o floor\ns 1", [1, 1, 1], ""),
        ("f 1 2 4", "f 1 3 2 4", [1, 1, 2], "approximated: a polygon whose sides cross (floor)"),
    ] {
        let text = HABITS.replacen(from, to, 1);
        let model = read(&text, library).unwrap();
        assert_eq!(notes(&model).join("; "), expected, "{to}");
        let found: Vec<usize> = model.parts.iter().map(|(shape, _)| shape.triangles.len()).collect();
        assert_eq!(found, triangles, "{to}");
    }
}

#[test]
fn long_texts_are_cut_in_notes() {
    let keyword = "x".repeat(59);
    for (more, shown) in [("", ""), ("y", "y"), ("yz", "y")] {
        let model = read(&format!("{keyword}{more} 1\n{HABITS}"), library).unwrap();
        let expected = format!("left out: a statement that is not known ({keyword}{shown})");
        assert_eq!(notes(&model), [expected]);
    }
}

#[test]
fn the_many_ways_of_writing_the_same() {
    let control = read(HABITS, library).unwrap();
    let lines: Vec<&str> = HABITS.lines().collect();
    // Faces before their vertices, by numbers from the beginning.
    let is_vertex = |line: &&&str| line.starts_with('v');
    let faces_first: Vec<&str> =
        lines.iter().filter(|line| !is_vertex(line)).chain(lines.iter().filter(is_vertex)).copied().collect();
    for (text, what) in [
        (HABITS.replace('\n', "\r\n"), "Windows"),
        (HABITS.replace('\n', "\r"), "old Macs"),
        (HABITS.replace(" 2//1", " \\\n2//1").replace("v 1 1 0", "v \\\n1 \\\n  1 0"), "continued"),
        (HABITS.replace(" 2//1", " \\\r\n2//1").replace("1 2 4\n", "1 2 4 \\\r\n"), "continued on Windows"),
        (HABITS.replace("0 0\n", "0 0# a comment\n").replace("1 2 4", "1 2 4 # f 1 2 3"), "comments"),
        (format!("# made in C:\\scenes\\\n#\n\n{HABITS}\n\n"), "a comment that ends in a backslash"),
        (HABITS.replace(' ', "\t  ").replace("f\t", "  fo \t"), "blanks"),
        (HABITS.replace("usemtl lamp", "usemtl lamp # bright"), "a comment after a name"),
        (HABITS.replace("a.mtl", "a.mtl # mine"), "a comment after a file's name"),
        (HABITS.replace("mtllib a.mtl", "mtllib a.mtl\nmtllib a.mtl"), "a library twice"),
        (faces_first.join("\n"), "faces first"),
        (format!("{HABITS}\u{1a}\0\0\0"), "marks at the end"),
        (HABITS.replace("mtllib a.mtl\n", "") + "mtllib a.mtl\n", "materials last"),
    ] {
        let model = read(&text, library).unwrap();
        assert_eq!(notes(&model), [""; 0], "{what}");
        assert_eq!(model.parts, control.parts, "{what}");
        assert_eq!(model.materials, control.materials, "{what}");
    }
}

#[test]
fn numbers_and_names_of_other_countries() {
    let files = |name: &str, _: u64| match name {
        // `T\u{fc}r` and `T\u{f6}r` in Latin-1.
        "a.mtl" => Ok(b"newmtl T\xfcr\nKd 0,5 0,25 0\nnewmtl T\xf6r\nKd 0 1 0\n".to_vec()),
        _ => Err("none".to_owned()),
    };
    let text =
        b"mtllib a.mtl\nv 0 0 0\nv 1,5 0 0\nv 0 2,25 0\nusemtl T\xfcr\nf 1 2 3\nusemtl T\xf6r\nf 1 2 3\n";
    let model = read(&lossy(text), files).unwrap();
    let colors: Vec<Vec3> = model.parts.iter().map(|part| model.materials[part.1.unwrap()].color).collect();
    assert_eq!(colors, [Vec3::new(0.5, 0.25, 0.0), Vec3::Y]);
    assert_eq!(model.parts[0].0.positions, [Vec3::ZERO, 1.5 * Vec3::X, 2.25 * Vec3::Y]);
    assert_eq!(notes(&model), ["repaired: numbers with a decimal comma"]);
}

#[test]
fn several_libraries_and_names_with_signs_and_blanks() {
    let files = |name: &str, _: u64| match name {
        "my materials.mtl" => Ok(b"newmtl Material #1\nKd 1 0 0\nnewmtl Material #2\nKd 0 1 0\n".to_vec()),
        "a.mtl" => Ok(b"newmtl plain # a comment\nKd 0 0 1\n".to_vec()),
        _ => Err("none".to_owned()),
    };
    let text = |libraries: &str| {
        format!(
            "mtllib {libraries}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl Material #2\nf 1 2 3\nusemtl Material #1\nf 1 2 3\n\
             usemtl plain\nf 1 2 3\nusemtl Material #3\nf 1 2 3\n"
        )
    };
    let colors = |model: &Model| -> Vec<Option<Vec3>> {
        model.parts.iter().map(|(_, material)| material.map(|index| model.materials[index].color)).collect()
    };
    let undefined = "left out: a material that is not defined, shown as plain grey (Material #3)";
    let both = read(&text("my materials.mtl\nmtllib a.mtl"), files).unwrap();
    assert_eq!(colors(&both), [Some(Vec3::Y), Some(Vec3::X), Some(Vec3::Z), None]);
    assert_eq!(notes(&both), [undefined]);
    let words = read(&text("b.mtl a.mtl"), files).unwrap();
    assert_eq!(colors(&words), [None, None, Some(Vec3::Z), None]);
    assert_eq!(notes(&words), ["left out: a material library that is missing or cannot be read (b.mtl)"]);
    // A name of several words that is missing is one name.
    let missing = read(&text("no materials.mtl"), files).unwrap();
    assert_eq!(
        notes(&missing),
        ["left out: a material library that is missing or cannot be read (no materials.mtl)"]
    );
}

#[test]
fn the_last_definition_before_its_use_counts() {
    let files =
        |name: &str, _: u64| Ok(format!("newmtl a\nKd {} 0 0\n", name.trim_end_matches(".mtl")).into_bytes());
    let text =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib 0.25.mtl\nusemtl a\nf 1 2 3\nmtllib 0.5.mtl\nusemtl a\nf 1 2 3\n";
    let model = read(text, files).unwrap();
    let red: Vec<f32> = model.parts.iter().map(|part| model.materials[part.1.unwrap()].color.x).collect();
    assert_eq!(red, [0.25, 0.5]);
}

#[test]
fn values_of_materials_in_many_forms() {
    for (line, color, expected) in [
        ("Kd 0.5", [0.5; 3], ""),
        ("Kd 0.5 0.25", [0.5, 0.25, 0.5], ""),
        ("  Kd\t0.1 0.2 0.8  # blue", [0.1, 0.2, 0.8], ""),
        ("Kd 0.1 0.2 \\\n 0.8", [0.1, 0.2, 0.8], ""),
        ("Kd 1 x 0", [0.7; 3], "repaired: a colour that is not made of numbers (a)"),
        ("Kd", [0.7; 3], "repaired: a colour that is not made of numbers (a)"),
        ("Kd nan 1 0", [0.7; 3], "repaired: a colour that is not made of numbers (a)"),
        ("Kd spectral red.rfl", [0.7; 3], "left out: a colour as `spectral` (a)"),
        ("Kd xyz 0.3 0.3 0.3", [0.7; 3], "left out: a colour as `xyz` (a)"),
        (
            "Kd 2 1 -1",
            [1.0, 1.0, 0.0],
            "repaired: a colour beyond 0 to 1, taken as the nearest one within (a)",
        ),
        (
            "Kd 1.5 0.5 0.5",
            [1.0, 0.5, 0.5],
            "repaired: a colour beyond 0 to 1, taken as the nearest one within (a)",
        ),
        (
            "Kd 0.5 -0.5 0.5",
            [0.5, 0.0, 0.5],
            "repaired: a colour beyond 0 to 1, taken as the nearest one within (a)",
        ),
        ("Ns many", [0.7; 3], "repaired: a material's value that is not a number (a)"),
        ("Ka 1 1 1\nmap_Ka a.png\nsharpness 60\nPs 0\nPc 0.0\nPcr 0.3\naniso 0\nanisor 0", [0.7; 3], ""),
        (
            "Pc 0.5\nPs 0.1\naniso 1",
            [0.7; 3],
            "left out: the clear coat of a material (a); left out: the sheen of a \
            material (a); left out: the anisotropy of a material (a)",
        ),
        (
            "map_Ks a.png\ndisp b.png",
            [0.7; 3],
            "left out: a statement of a material that is not known, 2 times (map_Ks, disp)",
        ),
        (
            "Ks 0.9 0.1 0.1\nNs 300",
            [0.7; 3],
            "approximated: a tinted highlight of a material, shown white (a)",
        ),
        ("Ke 0 1e30 0", [0.7; 3], "repaired: an emission too large for a scene (a)"),
        ("d 0", [0.7; 3], "left out: a surface that `d 0` makes invisible (a)"),
        ("Tr 1", [0.7; 3], "repaired: `Tr 1` without `d`, taken as opaque (a)"),
    ] {
        let (materials, notes) = read_noted(&format!("newmtl a\n{line}\n"));
        assert_eq!((materials[0].color, notes.as_str()), (Vec3::from(color), expected), "{line}");
    }
    assert_eq!(read_materials("newmtl a\nKe 2 1e30 -1")[0].emission, Vec3::new(2.0, 1e18, 0.0));
}

#[test]
fn shares_beyond_0_to_1_are_taken_as_the_nearest_one_within() {
    let of = |line: &str| read_materials(&format!("newmtl a\n{line}\n")).remove(0);
    for (line, opacity) in [
        ("d -0.5", 0.0),
        ("d 0", 0.0),
        ("d 0.25", 0.25),
        ("d 1", 1.0),
        ("d 1.5", 1.0),
        ("Tr -0.5", 1.0),
        ("Tr 0", 1.0),
        ("Tr 0.25", 0.75),
        ("Tr 0.999", 0.001),
        ("Tr 1", 1.0),
        ("Tr 1.5", 1.0),
        ("d 0.25\nTr 0.5", 0.25),
    ] {
        let found = of(line);
        assert!((found.opacity - opacity).abs() < 1e-6, "{line}: {}", found.opacity);
        assert_eq!(found.alpha == Alpha::Blend, opacity < 1.0, "{line}");
    }
    for (written, expected) in [("-0.5", 0.0), ("0", 0.0), ("0.25", 0.25), ("1", 1.0), ("1.5", 1.0)] {
        let (metal, rough) = (of(&format!("Pm {written}\nPr 1")), of(&format!("Pr {written}\nPm 0")));
        assert_eq!((metal.metallic, rough.roughness), (expected, expected), "{written}");
    }
}

#[test]
fn what_lets_light_through() {
    let of = |lines: &str| read_materials(&format!("newmtl a\nKd 0.8 0.1 0.1\n{lines}\n")).remove(0);
    for (lines, alpha, opacity, transmission, ior) in [
        ("d 0", Alpha::Blend, 0.0, 0.0, None),
        ("d 0.25", Alpha::Blend, 0.25, 0.0, None),
        ("d -halo 0.25", Alpha::Blend, 0.25, 0.0, None),
        ("Tr 0.75", Alpha::Blend, 0.25, 0.0, None),
        // The one that is not ambiguous counts.
        ("d 0.25\nTr 0.25", Alpha::Blend, 0.25, 0.0, None),
        ("d 1\nTr 1", Alpha::Opaque, 1.0, 0.0, None),
        ("Tr 0", Alpha::Opaque, 1.0, 0.0, None),
        ("Tr 1", Alpha::Opaque, 1.0, 0.0, None),
        ("d 0.1\nTr 0.9\nillum 4", Alpha::Blend, 0.1, 0.0, None),
        ("d 0.5\nillum 6\nNi 1.45", Alpha::Blend, 0.5, 0.0, None),
        ("illum 7\nNi 1.5\nNs 900\nKs 1 1 1", Alpha::Opaque, 1.0, 1.0, Some(1.5)),
        ("illum 6\nNi 1.33\nTf 1 1 1", Alpha::Opaque, 1.0, 1.0, Some(1.33)),
        ("illum 6\nNi 1.33\nTf 0 0 0", Alpha::Opaque, 1.0, 0.0, None),
        ("illum 7\nNi 1", Alpha::Opaque, 1.0, 0.0, None),
        ("illum 2\nNi 1.5\nTf 1 1 1", Alpha::Opaque, 1.0, 0.0, None),
    ] {
        let found = of(lines);
        let medium = found.medium.map(|medium| medium.ior);
        assert_eq!(
            (found.alpha, found.opacity, found.transmission, medium),
            (alpha, opacity, transmission, ior),
            "{lines}"
        );
    }
    let green = of("illum 7\nNi 1.5\nTf 0.5 1 0.5");
    assert_eq!((green.color, green.roughness), (Vec3::new(0.5, 1.0, 0.5), 0.0));
    assert!((of("illum 7\nNi 1.5\nNs 225").roughness - 0.5).abs() < 1e-6);
}

#[test]
fn metals_and_physical_materials() {
    let of = |lines: &str| read_materials(&format!("newmtl a\n{lines}\n")).remove(0);
    for (lines, color, metallic, roughness, f0) in [
        ("Kd 0.5 0.4 0.3\nPr 0.25\nPm 1", [0.5, 0.4, 0.3], 1.0, 0.25, 0.04),
        ("Kd 0.5 0.4 0.3\nPm 0.5\nNs 225", [0.5, 0.4, 0.3], 0.5, 0.5, 0.04),
        ("Kd 0.5 0.4 0.3\nPr 2\nPm -1", [0.5, 0.4, 0.3], 0.0, 1.0, 0.04),
        ("Kd 0.5 0.4 0.3\nPr -1\nPm 2", [0.5, 0.4, 0.3], 1.0, 0.0, 0.04),
        ("Kd 0.5 0.4 0.3\nPr 0.5\nNi 2", [0.5, 0.4, 0.3], 0.0, 0.5, 1.0 / 9.0),
        // Gold as it was written before that: nothing but a tinted reflection.
        ("Kd 0 0 0\nKs 1 0.8 0.3\nNs 1000\nillum 3", [1.0, 0.8, 0.3], 1.0, 0.0, 0.04),
        ("Kd 0.01 0.01 0\nKs 1 0.8 0.3\nNs 225\nillum 3", [1.0, 0.8, 0.3], 1.0, 0.5, 0.04),
        ("Kd 0.5 0.4 0.3\nKs 0.5 0.5 0.5\nNs 225\nillum 3", [0.5, 0.4, 0.3], 0.0, 0.5, 0.5),
    ] {
        let found = of(lines);
        assert_eq!(
            (found.color, found.metallic, found.roughness),
            (Vec3::from(color), metallic, roughness),
            "{lines}"
        );
        assert!((found.f0 - f0).abs() < 1e-6, "{lines}: {}", found.f0);
    }
}

fn png(texels: &[[u8; 4]]) -> Vec<u8> {
    let picture = image::RgbaImage::from_raw(texels.len() as u32, 1, texels.concat()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A triangle with texture coordinates in the material of these lines, and some pictures.
fn textured(lines: &str) -> Model {
    let files = |name: &str, _: u64| match name {
        "a.mtl" => Ok(format!("newmtl a\n{lines}\n").into_bytes()),
        "red green.png" | "tex/rough.png" => Ok(png(&[[255, 0, 0, 255], [0, 255, 0, 255]])),
        "leaf.png" => Ok(png(&[[255; 4], [0, 255, 0, 0]])),
        "normal.png" => Ok(png(&[[128, 128, 255, 255], [140, 120, 250, 255]])),
        "broken.png" => Ok(b"GIF89a".to_vec()),
        _ => Err("none".to_owned()),
    };
    let text = "mtllib a.mtl\no leaf\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.25\nvt 1 0 0\nvt 0\nusemtl a\nf 1/1 2/2 3/3\n";
    read(text, files).unwrap()
}

#[test]
fn maps_and_their_options() {
    let plain = textured("map_Kd red green.png");
    assert_eq!(notes(&plain), [""; 0]);
    let uvs = plain.parts[0].0.uvs[0][0];
    assert_eq!(uvs, [[0.25, 0.75], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from));
    assert_eq!((plain.materials[0].color, plain.textures[0].size), (Vec3::ONE, [2, 1]));
    assert_eq!(plain.textures[0].name, "red green.png");
    let map = plain.materials[0].maps.color.unwrap();
    assert_eq!(map, Map::new(0));
    let moved = textured("map_Kd -blendu on -s 2 3 1 -o 0.5 0.25 -clamp on -mm 0 1 -texres 64 red green.png");
    let map = moved.materials[0].maps.color.unwrap();
    // (u, v) upwards becomes (2 u + 0.5, 3 v + 0.25).
    let at = |u: f32, v: f32| map.transform.transform_point2(Vec2::new(u, 1.0 - v));
    assert_eq!((at(0.0, 0.0), at(0.25, 0.5)), (Vec2::new(0.5, 0.75), Vec2::new(1.0, 1.0 - 1.75)));
    // What a pair lacks is 1 for the scale and 0 for the offset.
    let half = textured("map_Kd -s 2 -o 0.5 red green.png").materials[0].maps.color.unwrap();
    assert_eq!(half.transform.transform_point2(Vec2::new(0.25, 0.5)), Vec2::new(1.0, 0.5));
    assert_eq!(map.wrap, [crate::Wrap::Clamp; 2]);
    assert_eq!(
        notes(&moved),
        ["approximated: `-clamp on`: beyond a map is the colour of its edge, not of the material (a)"]
    );

    for (lines, expected) in [
        ("map_Kd none.png", "left out: a texture that is missing (none.png)"),
        (
            "map_Kd broken.png",
            "left out: a texture, as it is a file of kind Gif, which is not read: convert it to PNG (broken.png)",
        ),
        ("map_Kd -t 1 1 1 red green.png", "left out: the option `-t` of a map (a)"),
        ("map_Kd -mm 0.2 1 red green.png", "left out: the option `-mm` of a map (a)"),
        ("bump leaf.png", "left out: a map of heights (a)"),
        (
            "Kd 0 0 0\nmap_Kd red green.png",
            "repaired: a black colour that hides its texture, taken as white (a)",
        ),
        ("map_Kd red green.png # mine", ""),
        ("map_Kd -bm 2", "left out: a map without the name of a file (a)"),
        ("map_Kd -2.png", "left out: a texture that is missing (-2.png)"),
        ("map_Kd -2  b.png", "left out: a texture that is missing (-2  b.png)"),
        ("map_Kd -cc on -2 b.png", "left out: a texture that is missing (-2 b.png)"),
    ] {
        assert_eq!(notes(&textured(lines)).join("; "), expected, "{lines}");
    }
}

#[test]
fn each_option_of_a_map_takes_its_words_and_no_more() {
    let vain = |option: &str| format!("left out: the option `{option}` of a map (a)");
    for (options, expected) in [
        ("-blendu on", String::new()),
        ("-blendv off", String::new()),
        ("-CC on", String::new()),
        ("-texres 64", String::new()),
        ("-type sphere", String::new()),
        ("-clamp off", String::new()),
        ("-imfchan r", String::new()),
        ("-bm 3", String::new()),
        ("-o 1", String::new()),
        ("-o 1 2", String::new()),
        ("-o 1 2 3", String::new()),
        ("-s 1 2 3", String::new()),
        // These are left out, unless what they ask for is what is done anyway.
        ("-boost 0", String::new()),
        ("-boost 1", vain("-boost")),
        ("-t 0", String::new()),
        ("-t 0 0 0", String::new()),
        ("-t 1 0 0", vain("-t")),
        ("-t 0 1 0", vain("-t")),
        ("-t 0 0 1", vain("-t")),
        ("-mm 0 1", String::new()),
        ("-MM 0.1 1", vain("-mm")),
        ("-mm 0 0.9", vain("-mm")),
    ] {
        let found = textured(&format!("map_Kd {options} red green.png"));
        assert_eq!((notes(&found).join("; "), found.textures.len()), (expected.clone(), 1), "{options}");
        // A name may begin with a number, which belongs to no option once this has as many as it takes.
        let numbers = options.split(' ').skip(1).filter(|word| word.parse::<f32>().is_ok()).count();
        let most = match options.split(' ').next().unwrap_or_default() {
            "-o" | "-s" | "-t" => 3,
            "-mm" | "-MM" => 2,
            _ => numbers,
        };
        if numbers == most {
            let missing = "left out: a texture that is missing (5 none.png)";
            let expected = [expected.as_str(), missing].into_iter().filter(|note| !note.is_empty());
            let found = textured(&format!("map_Kd {options} 5 none.png"));
            assert_eq!(notes(&found), expected.collect::<Vec<_>>(), "{options}");
        }
    }
    let normal = |line: &str| textured(line).materials[0].maps.normal.unwrap().1;
    for (options, scale) in [("", 1.0), ("-bm 0.25 ", 0.25), ("-bm nan ", 1.0), ("-bm much ", 1.0)] {
        assert_eq!(normal(&format!("norm {options}normal.png")), scale, "{options}");
    }
    // A number of a picture without opacity, or of one that has it but is not what the map is for.
    let roughness = |line: &str| textured(line).materials[0].maps.roughness.unwrap().channel;
    for (options, channel) in [("", 0), ("-imfchan g ", 1), ("-imfchan M ", 3), ("-imfchan l ", 0)] {
        assert_eq!(roughness(&format!("map_Pr {options}leaf.png")), channel, "{options}");
    }
}

#[test]
fn maps_of_all_factors() {
    let maps = |lines: &str| {
        let model = textured(lines);
        (model.materials[0].clone(), model.materials[0].maps)
    };
    let (material, all) =
        maps("Pr 0.5\nmap_Pr -imfchan g tex/rough.png\nmap_Pm tex\\rough.png\nmap_Ke red green.png");
    assert_eq!((material.roughness, material.metallic, material.emission), (0.5, 0.0, Vec3::ONE));
    assert_eq!(all.roughness.unwrap().channel, 1);
    assert!(all.emission.is_some() && all.metallic.is_none(), "a name with a backslash is up to the caller");
    // A map of metal is one of all metal.
    let (metal, all) = maps("map_Pm tex/rough.png");
    assert_eq!((metal.metallic, all.metallic.map(|map| map.channel)), (1.0, Some(0)));
    assert!(all.normal.is_none() && maps("bump leaf.png").1.normal.is_none());
    let (white, all) = maps("Kd 0 0 0\nmap_Kd red green.png");
    assert_eq!((white.color, all.color.is_some()), (Vec3::ONE, true));
    // The channel of opacity if the picture has one.
    for (lines, alpha, channel) in [
        ("map_d leaf.png", Alpha::Blend, Some(3)),
        ("map_d red green.png", Alpha::Blend, Some(0)),
        ("map_d -imfchan l leaf.png", Alpha::Blend, Some(0)),
        ("map_d -imfchan r leaf.png", Alpha::Blend, Some(0)),
        ("map_d -imfchan B leaf.png", Alpha::Blend, Some(2)),
        ("map_d -imfchan z leaf.png", Alpha::Blend, Some(3)),
        ("map_d none.png", Alpha::Opaque, None),
    ] {
        let (material, all) = maps(lines);
        assert_eq!((material.alpha, all.opacity.map(|map| map.channel)), (alpha, channel), "{lines}");
    }
    for lines in ["norm normal.png", "map_Bump -bm 0.5 normal.png", "bump normal.png"] {
        let (_, scale) = maps(lines).1.normal.unwrap();
        assert_eq!(scale, if lines.contains("-bm") { 0.5 } else { 1.0 }, "{lines}");
    }
}

#[test]
fn textures_need_coordinates() {
    let files = |name: &str, _: u64| match name {
        "sub/a.mtl" => {
            Ok(b"newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\nnewmtl unused\nmap_Kd c.png\nKd 1 x 1"
                .to_vec())
        }
        "sub/a.png" | "b.png" => Ok(png(&[[9, 9, 9, 255]])),
        _ => Err("none".to_owned()),
    };
    let text = "mtllib sub/a.mtl\no one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt nan 1\nusemtl a\nf 1/1 2/2 3/7\no two\n\
        usemtl b\nf 1 2 3\n";
    let model = read(text, files).unwrap();
    assert_eq!(
        model.textures.iter().map(|texture| texture.name.as_str()).collect::<Vec<_>>(),
        ["sub/a.png", "sub/b.png"]
    );
    assert_eq!(model.parts[0].0.uvs[0], [[Vec2::Y; 3]]);
    assert!(model.parts[1].0.uvs[0].is_empty());
    let expected = [
        "repaired: a colour that is not made of numbers (unused)",
        "repaired: texture coordinates that are not numbers, taken as 0 (one)",
        "repaired: texture coordinates that do not exist, taken as 0 (one)",
        "approximated: a texture on faces without texture coordinates, which show its corner (two)",
    ];
    assert_eq!(notes(&model), expected);
}

#[test]
fn colours_of_vertices() {
    let text = |colors: [&str; 3]| {
        let [a, b, c] = colors;
        format!("v 0 0 0 {a}\nv 1 0 0 {b}\nv 0 1 0 {c}\nv 0 0 1\nf 1 2 3\no other\nf 1 2 4\n")
    };
    let read_colors = |colors| {
        let model = read(&text(colors), nothing).unwrap();
        let of_parts: Vec<Vec<[Vec4; 3]>> =
            model.parts.iter().map(|(shape, _)| shape.colors.clone()).collect();
        (of_parts, model)
    };
    let near = |found: Vec4, expected: [f32; 3]| {
        found.truncate().distance(Vec3::from(expected)) < 1e-4 && found.w == 1.0
    };
    for colors in [
        ["1 0 0", "0.5 0.5 0.5", "0 0 1"],
        ["255 0 0", "127.5 127.5 127.5", "0 0 255"],
        ["1 0 0 1", "0.5 0.5 0.5 1", "0 0 1 1"],
    ] {
        let (found, model) = read_colors(colors);
        let [red, grey, blue] = found[0][0];
        assert!(
            near(red, [1.0, 0.0, 0.0]) && near(grey, [0.21404; 3]) && near(blue, [0.0, 0.0, 1.0]),
            "{found:?}"
        );
        // The last vertex has no colour.
        assert_eq!(found[1][0][2], Vec4::ONE);
        assert_eq!(model.materials[0].color, Vec3::ONE);
        assert_eq!(model.parts.iter().map(|part| part.1).collect::<Vec<_>>(), [Some(0); 2]);
        assert_eq!(notes(&model), [""; 0]);
    }
    let (found, model) = read_colors(["1", "", "0.5"]);
    assert_eq!((found, model.parts[0].1), (vec![vec![]; 2], None), "a single number is a weight");
    let (found, model) = read_colors(["1 x 0", "0 1 0", ""]);
    assert_eq!(found[0][0], [Vec4::ONE, Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::ONE]);
    assert_eq!(notes(&model), ["repaired: a colour of a vertex that is not made of numbers, taken as white"]);
    let packed = text([""; 3]).replace("f 1 2 3", "#MRGB ffff0000ff808080\n#MRGB ff0000ff\nf 1 2 3");
    let [red, grey, blue] = read(&packed, nothing).unwrap().parts[0].0.colors[0];
    assert!(near(red, [1.0, 0.0, 0.0]) && near(grey, [0.21586; 3]) && near(blue, [0.0, 0.0, 1.0]));
}

#[test]
fn parts_far_from_each_other_are_reported() {
    let text = |x: &str| {
        format!(
            "o stray\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no house\nv {x}0 0 0\nv {x}1 0 0\nv {x}0 1 0\nf 4 5 6\n"
        )
    };
    let expected = "approximated: a part that is small and far from the others, so that single precision deforms it (house)";
    for (x, expected) in [("", vec![]), ("400", vec![]), ("4000000", vec![expected])] {
        assert_eq!(notes(&read(&text(x), nothing).unwrap()), expected, "{x}");
    }
}

#[test]
fn smoothing_groups_share_normals_where_there_are_none() {
    // Two upright squares at a right angle, the second twice as wide, and a floor.
    let text = |groups: [&str; 3]| {
        let [a, b, c] = groups;
        format!(
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -2\nv 1 1 -2\nv 0 0 -2\nvn 0 0 1\ns {a}\nf 1 2 3 4\n\
             s {b}\nf 2 5 6 3\no floor\ns {c}\nf 1 7 5 2\n"
        )
    };
    let normals = |groups| {
        let model = read(&text(groups), nothing).unwrap();
        assert_eq!(notes(&model), [""; 0]);
        model.parts.iter().map(|part| part.0.normals.clone()).collect::<Vec<_>>()
    };
    let near = |a: Vec3, b: Vec3| a.distance(b.normalize()) < 1e-6;
    // The first triangles: corners 1, 2, 3 and 2, 5, 6.
    let smooth = normals(["1", "1", "off"]);
    let [front, _, side, _] = smooth[0][..] else { panic!("four triangles") };
    assert!(near(front[0], Vec3::Z) && near(front[1], Vec3::new(2.0, 0.0, 1.0)) && near(side[1], Vec3::X));
    assert_eq!((front[1], smooth[1].len()), (side[0], 0), "the floor is flat");
    // Three groups, of which the first and the last are one.
    let apart = normals(["1", "2", "on"]);
    let (front, side, floor) = (apart[0][0], apart[0][2], apart[1][0]);
    assert!(near(side[0], Vec3::X) && near(front[2], Vec3::Z));
    assert!(near(front[0], Vec3::new(0.0, -2.0, 1.0)) && front[0] == floor[0]);
    // Flat faces beside smooth ones of one object, and normals of the file beside those of a group.
    let mixed = normals(["0", "3", "0"]);
    assert_eq!((mixed[0][0], mixed[0][2][0]), ([Vec3::ZERO; 3], Vec3::X));
    let own = text(["1", "1", "off"]).replace("f 1 2 3 4", "f 1//1 2//1 3//1 4");
    let own = read(&own, nothing).unwrap().parts[0].0.normals[1];
    assert_eq!(own, [Vec3::Z; 3]);
    // One that the file lacks is that of the face.
    let lacking = text(["1", "1", "off"]).replace("f 1 2 3 4", "f 1//1 2//7 3//1 4//1");
    let lacking =
        lacking.replace("f 2 5 6 3", "f 2//1 5//1 6//1 3//1").replace("f 1 7 5 2", "f 1//1 7//1 5//1 2//1");
    let model = read(&lacking, nothing).unwrap();
    assert_eq!(model.parts[0].0.normals[0], [Vec3::Z, Vec3::ZERO, Vec3::Z]);
    assert_eq!(notes(&model), ["repaired: a normal that does not exist, replaced by the face's"]);
    assert!(normals(["off", "", "none"]).iter().all(Vec::is_empty));
}

#[test]
fn coordinates_of_a_survey_keep_their_digits() {
    let near = "v 0.125 0 0.5\nv 1.375 0.25 0\nv 0 1 0.0625\nv nan 0 0\nv 0 0 0\nf 1 2 3\n";
    let far = "v 500000.125 12 4649776.5\nv 500001.375 12.25 4649776\nv 500000 13 4649776.0625\nv nan 0 0\nv 0 0 0\n\
        f 1 2 3\n";
    let [near, far] = [near, far].map(|text| read(text, nothing).unwrap());
    assert_eq!((near.origin, far.origin), (DVec3::ZERO, DVec3::new(500_001.0, 13.0, 4_649_776.0)));
    let shift = Vec3::new(1.0, 1.0, 0.0);
    let moved: Vec<Vec3> = far.parts[0].0.positions.iter().map(|at| *at + shift).collect();
    assert_eq!(moved, near.parts[0].0.positions);
}

#[test]
fn a_file_has_as_many_vertices_as_a_scene_may_have() {
    let most = crate::limits::MAX_TRIANGLES;
    let mut reader = Reader::default();
    reader.polygons.at = vec![DVec3::ZERO; most - 1];
    assert_eq!(reader.vertex("0 0 0", 1), Ok(()));
    assert_eq!(reader.vertex("0 0 0", 1), Err(MeshError::TooLarge { triangles: 0, vertices: most + 1 }));
}

#[test]
fn no_truncation_panics() {
    for length in 0..OBJ.len() {
        // A text format may end after any line, so a shorter file can be a whole one.
        let _ = read(&OBJ[..length], library);
    }
}

#[test]
fn pictures_of_normals_are_told_from_those_of_heights() {
    // One texel decides alone, and two by their mean.
    let is_normal = |blues: &[u8]| {
        let texels: Vec<[u8; 4]> = blues.iter().map(|blue| [128, 128, *blue, 255]).collect();
        mtl::has_normals(&Texture { name: String::new(), size: [blues.len() as u32, 1], texels })
    };
    assert_eq!([&[255][..], &[179, 179], &[178, 179], &[]].map(is_normal), [true, true, false, false]);
    // A single colour: how far its channels may be from those of a normal that points up.
    for (texel, is_normal) in [
        ([128, 128, 255], true),
        ([165, 90, 179], true),
        ([90, 165, 255], true),
        ([166, 128, 255], false),
        ([89, 128, 255], false),
        ([128, 166, 255], false),
        ([128, 89, 255], false),
        ([128, 128, 178], false),
        ([200, 200, 200], false),
    ] {
        let [red, green, blue] = texel;
        let texels = vec![[red, green, blue, 255]; 3];
        let texture = Texture { name: String::new(), size: [3, 1], texels };
        assert_eq!(mtl::has_normals(&texture), is_normal, "{texel:?}");
    }
}

#[test]
fn faces_that_are_dropped_leave_the_others_as_they_are() {
    let read_normals = |faces: &str| {
        let text = format!(
            "mtllib a.mtl\nusemtl metal\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\n{faces}"
        );
        read(&text, library).unwrap().parts[0].0.normals.clone()
    };
    let files = |name: &str, _: u64| match name {
        "a.mtl" => Ok(b"newmtl a\nmap_Kd a.png".to_vec()),
        "a.png" => Ok(png(&[[9, 9, 9, 255]])),
        _ => Err("none".to_owned()),
    };
    for dropped in ["", "f 3/3 2/3\n"] {
        let text = format!(
            "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0.5 1\n{dropped}f 1/1 2/2 3/3\n"
        );
        let uvs = read(&text, files).unwrap().parts[0].0.uvs[0].clone();
        assert_eq!(uvs, [[[0.0, 1.0], [1.0, 1.0], [0.5, 0.0]].map(Vec2::from)], "{dropped}");
    }
    let expected = [[Vec3::X, Vec3::Y, Vec3::Z]];
    assert_eq!(read_normals("f 1//1 2//2 3//3\n"), expected);
    assert_eq!(read_normals("f 3//3 2//3\nf 1//1 2//2 3//3\n"), expected);
    // The group of a face that is dropped is not that of the face before.
    let [first, second] =
        ["", "s 2\nf 1 2\n"].map(|dropped| read_normals(&format!("s 1\nf 1 2 3\n{dropped}s 1\nf 2 3 4\n")));
    assert_eq!(first, second);
    assert!(first[0][1].distance(Vec3::new(1.0, 1.0, 2.0).normalize()) < 1e-6, "{first:?}");
}

#[test]
fn colours_that_vertices_do_not_need_are_left() {
    let text = |codes: &str| format!("v 0 0 0\nv 1 0 0\n#MRGB {codes}\nv 0 1 0\nf 1 2 3\n");
    let colors = |codes: &str| read(&text(codes), nothing).unwrap().parts[0].0.colors[0];
    let [red, green] = [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0)];
    assert_eq!(colors("ffff0000ff00ff00"), [red, green, Vec4::ONE]);
    assert_eq!(colors("ffff0000ff00ff00ff00ff00"), [red, green, Vec4::ONE], "the third is for no vertex");
    // Vertices before the first colour have none.
    let late = "v 0 0 0\nv 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n";
    assert_eq!(read(late, nothing).unwrap().parts[0].0.colors[0], [Vec4::ONE, Vec4::ONE, red]);
    assert_eq!(colors("ffff0000ffzzzzzz"), [red, Vec4::ONE, Vec4::ONE], "no number is white");
}

#[test]
fn decimal_commas_are_looked_for_in_the_first_hundred_vertices() {
    for (at, expected) in [(99, vec!["repaired: numbers with a decimal comma"]), (100, vec![])] {
        let vertex = |index: usize| if index == at { "v 0,5 0 0\n" } else { "v 0 0 0\n" };
        let vertices: String = (0..102).map(vertex).collect();
        let model = read(&format!("{vertices}v 1 0 0\nv 0 1 0\nf 1 103 104\n"), nothing).unwrap();
        assert_eq!(notes(&model), expected, "{at}");
    }
    // A face without any vertices.
    assert_eq!(
        read("f 1 1 1\n", nothing).err().unwrap(),
        "line 1: vertex 1 does not exist: only 0 are defined"
    );
}
