use super::*;

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

fn read_materials(text: &str) -> Vec<Material> {
    mtl::read(text, &mut Report::default())
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
        ("v 1 1 0", "v 1 2e9 0", "line 5: the vertex `1 2e9 0` is farther out than 1e9 m"),
    ] {
        let error = read(&OBJ.replacen(from, to, 1), library).err().unwrap();
        assert!(error.starts_with(expected), "{error}");
    }
    for (text, expected) in [
        ("mtllib a.mtl\n", "it has neither vertices nor faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "no faces: `epigraph encode` makes a point set"),
        ("v 0 0 0\nv 1,5 0 0\nv 0 1 0\nf 1 2 3\n", "such as those of the vertex in line 2, `1,5 0 0`"),
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
            "v inf 0 0\nv 1,5 0 0\nv 1 0\nf 1 2 5\nf 1 2 6 3\nf 7 2 1\nf 1 2 4",
            [1, 1, 1],
            "left out: a face with a corner that is not a number, 3 times (floor)",
        ),
        ("f 1 2 4", "v nan 0 0\nf 1 2 4", [1, 1, 1], ""),
        (
            "o floor",
            "o floor\ns 1",
            [1, 1, 1],
            "approximated: a smoothing group without normals, shaded flat (floor)",
        ),
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
        (HABITS.replace("mtllib a.mtl\n", "") + "mtllib a.mtl\n", "materials last"),
    ] {
        let model = read(&text, library).unwrap();
        assert_eq!(notes(&model), [""; 0], "{what}");
        assert_eq!(model.parts, control.parts, "{what}");
        assert_eq!(model.materials, control.materials, "{what}");
    }
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
        ("Ns many", [0.7; 3], "repaired: a material's value that is not a number (a)"),
    ] {
        let mut report = Report::default();
        let materials = mtl::read(&format!("newmtl a\n{line}\n"), &mut report);
        assert_eq!(materials[0].color, Vec3::from(color), "{line}");
        let notes: Vec<String> = report.notes().iter().map(ToString::to_string).collect();
        assert_eq!(notes.join("; "), expected, "{line}");
    }
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
fn no_truncation_panics() {
    for length in 0..OBJ.len() {
        // A text format may end after any line, so a shorter file can be a whole one.
        let _ = read(&OBJ[..length], library);
    }
}
