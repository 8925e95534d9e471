use super::*;

use crate::Shape;

fn nothing(name: &str, _: u64) -> Result<Vec<u8>, String> {
    Err(format!("no {name}"))
}

fn read(bytes: &[u8]) -> Result<Model, String> {
    super::read(bytes, nothing)
}

const ASCII: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty double y\n\
    property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";

fn binary() -> Vec<u8> {
    let mut bytes =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 1\n\
        property list uchar uint vertex_index\nend_header\n"
            .to_vec();
    for vertex in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0_f32]] {
        for value in vertex.into_iter().chain([0.0, 0.0, 2.0]) {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes.push(3);
    bytes.extend([0, 1, 2_u32].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

#[test]
fn ascii_polygons_become_triangles() {
    let shape = &read(ASCII.as_bytes()).unwrap().parts[0].0;
    assert_eq!(shape.positions[2], Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(shape.triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn binary_with_normals() {
    let shape = &read(&binary()).unwrap().parts[0].0;
    assert_eq!(shape.triangles, [[0, 1, 2]]);
    assert_eq!(shape.normals, [[Vec3::Z; 3]]);
}

#[test]
fn normals_that_are_not_numbers_are_noted() {
    let normals = properties("float", &["nx", "ny", "nz"]);
    for (first, normal, expected) in [
        ("0 0 2", Vec3::Z, ""),
        ("0 nan 2", Vec3::ZERO, "repaired: a normal that is not a number, replaced by the face's"),
    ] {
        let text = with(&normals, [first, "0 2 0", "3 0 0", "0 1 0"], "", [""; 2]);
        let model = read(text.replace("comment TextureFile wood.png\n", "").as_bytes()).unwrap();
        assert_eq!(model.parts[0].0.normals[0], [normal, Vec3::Y, Vec3::X]);
        assert_eq!(notes(&model), expected);
    }
}

#[test]
fn coordinates_and_corners_of_any_type() {
    let list_types = [
        "char", "int8", "uchar", "uint8", "short", "int16", "ushort", "uint16", "int", "int32", "uint",
        "uint32", "int64", "uint64",
    ];
    for kind in list_types.into_iter().chain(["float", "float32", "double", "float64"]) {
        let list = if list_types.contains(&kind) { kind } else { "int" };
        let properties: String =
            ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property {kind} {name}\n")).concat();
        let file = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\n{properties}element face 1\n\
            property list uchar {list} vertex_indices\nend_header\n\
            2 3 5 2 3 6\n7 11 13 1 4 8\n17 19 23 6 2 3\n3 2 0 1\n"
        );
        let shape = &read(file.as_bytes()).unwrap().parts[0].0;
        let positions = [[2.0, 3.0, 5.0], [7.0, 11.0, 13.0], [17.0, 19.0, 23.0]];
        assert_eq!(shape.positions, positions.map(Vec3::from_array), "{kind}");
        assert_eq!(shape.triangles, [[2, 0, 1]], "{kind}");
        // The lengths of the normals are 7, 9 and 7.
        let expected = [
            [6.0 / 7.0, 2.0 / 7.0, 3.0 / 7.0],
            [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0],
            [1.0 / 9.0, 4.0 / 9.0, 8.0 / 9.0],
        ];
        for (normal, expected) in shape.normals[0].iter().zip(expected) {
            assert!(normal.distance(Vec3::from_array(expected)) < 1e-6, "{kind}: {normal}");
        }
    }
}

#[test]
fn every_truncation_is_an_error() {
    // The last digit and the line feed at the end may be missing.
    for length in 0..ASCII.len() - 2 {
        let error =
            read(&ASCII.as_bytes()[..length]).err().unwrap_or_else(|| panic!("{length} bytes were enough"));
        assert!(length < 3 || error.starts_with("cut off: "), "{length}: {error}");
    }
    let binary = binary();
    for length in 0..binary.len() {
        assert!(read(&binary[..length]).is_err(), "{length} bytes were enough");
    }
    let error = read(&binary[..binary.len() - 40]).err().unwrap();
    assert_eq!(error, "cut off: it ends within vertex 1 of 3; copy or download it again");
    let error = read(&binary[..binary.len() - 1]).err().unwrap();
    assert_eq!(error, "cut off: it ends within face 0 of 1; copy or download it again");
}

fn error(text: &str) -> String {
    read(text.as_bytes()).err().unwrap()
}

#[test]
fn wrong_counts_and_indices_are_errors() {
    assert!(error(&ASCII.replace("vertex 4", "vertex 4000000000000")).contains("4000000000000"));
    for corner in ["-3", "4", "1.5", "x", "4294967296", "9999999999"] {
        let expected =
            format!("face 0 refers to vertex {}, but there are only 4 vertices", corner.replace('x', "NaN"));
        assert_eq!(error(&ASCII.replace("4 0 1 2 3", &format!("4 0 1 2 {corner}"))), expected);
    }
    for (length, expected) in [
        ("-4", "face 0 has a list whose length is no number"),
        ("4294967296", "face 0 has a list whose length is no number"),
        ("4294967295", "cut off: it ends within face 0 of 1; copy or download it again"),
    ] {
        assert_eq!(error(&ASCII.replace("4 0 1 2 3", &format!("{length} 0 1 2 3"))), expected);
    }
    let alone =
        ASCII.split("element face").next().unwrap().replace("vertex 4", "vertex 5000001") + "end_header\n";
    let expected = "the header declares too much: that makes 0 triangles and 5000001 vertices";
    assert!(error(&alone).starts_with(expected), "{}", error(&alone));
}

#[test]
fn errors_of_the_header_say_what_is_missing() {
    for (from, to, expected) in [
        ("ply\n", "plx\n", "it does not begin with the word `ply`"),
        ("property float x\n", "", "the element `vertex` has no property `x`"),
        ("property float x\n", "property real x\n", "line 4: `real` is no type of number"),
        ("element vertex 4\n", "", "line 3: a property precedes the first element"),
        ("element vertex 4", "element vertex four", "line 3: `four` is no number of elements"),
        ("format ascii", "format json", "line 2: `format json 1.0` is no line of a header"),
        ("format ascii 1.0\n", "", "lacks the line `format`"),
        ("element vertex 4", "element point 4", "no element `vertex`"),
        (
            "element face 1",
            "element face 0",
            "it has points, but no faces: `epigraph encode` makes a point set",
        ),
    ] {
        let error = error(&ASCII.replacen(from, to, 1));
        assert!(error.contains(expected), "{to}: {error}");
    }
    assert!(error("plx").contains("it does not begin with the word `ply`"));
    assert_eq!(error("pl"), "cut off: it ends within its header");
    // Of a long line, the beginning.
    for (length, shown) in [(59, 59), (60, 60), (61, 60)] {
        let text = ASCII.replacen("format ascii 1.0", &"x".repeat(length), 1);
        assert_eq!(error(&text), format!("line 2: `{}` is no line of a header", "x".repeat(shown)));
    }
}

/// What loading says of a file.
fn notes(model: &Model) -> String {
    model.report.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

#[test]
fn the_many_ways_of_writing_the_same() {
    let control = read(ASCII.as_bytes()).unwrap();
    for (text, what) in [
        (ASCII.replace('\n', "\r\n"), "Windows"),
        (ASCII.replace('\n', "\r"), "old Macs"),
        (ASCII.replace("end_header\n", "end_header\n\n"), "a blank line after the header"),
        (ASCII.replace("1 1 0 9\n", "\n 1\t 1 0   9 \n\n"), "blanks"),
        (ASCII.replace("1 1 0 9", "1 1\n0 9"), "a line in two"),
        (ASCII.replace("element vertex", "comment x\nobj_info y\n\nelement  vertex"), "comments"),
        (ASCII.replace("float", "float32").replace("uchar int", "uint8 int64"), "other names of types"),
        (ASCII.trim_end().to_owned(), "no line feed at the end"),
        (in_one_line(ASCII), "one line"),
        (ASCII.replace("9\n1 ", "9 1 ").replace("9\n0 ", "9 0 "), "two vertices in a line"),
    ] {
        let model = read(text.as_bytes()).unwrap();
        assert_eq!(model.parts, control.parts, "{what}");
        assert_eq!(notes(&model), notes(&control), "{what}");
    }
}

/// The same file with all numbers in one line.
fn in_one_line(text: &str) -> String {
    let (header, numbers) = text.split_once("end_header\n").unwrap();
    format!("{header}end_header\n{}", numbers.replace('\n', " "))
}

#[test]
fn lines_count_where_the_words_would_come_out_even_without_them() {
    // Without lines the fifth vertex would be a face of seven corners.
    let text = ASCII.replace("9\n", "9 0\n").replace("0 1 0 9 0\n4 0 1 2 3", "0 7 0 1 2\n3 0 1 2");
    let model = read(text.as_bytes()).unwrap();
    assert_eq!(model.parts[0].0.triangles, [[0, 1, 2]]);
    assert!(notes(&model).contains("words at the end of lines"), "{}", notes(&model));
}

#[test]
fn numbers_in_one_line_must_come_out_even() {
    let cut_off = |text: &str| {
        assert_eq!(error(text), "cut off: it ends within vertex 1 of 4; copy or download it again");
    };
    let text = in_one_line(ASCII);
    cut_off(text.trim_end().strip_suffix(" 3").unwrap());
    cut_off(&(text + "7"));
}

#[test]
fn ends_of_lines_of_a_binary_header() {
    let control = read(&binary()).unwrap();
    let file = binary();
    let length = file.windows(11).position(|words| words == b"end_header\n").unwrap() + 11;
    for end in ["\n", "\r\n", "\r"] {
        let header = String::from_utf8(file[..length].to_vec()).unwrap().replace('\n', end);
        let mut whole = [header.as_bytes(), &file[length..]].concat();
        assert_eq!(read(&whole).unwrap().parts, control.parts, "{end:?}");
        // Data that looks like the end of a line.
        whole[header.len()] = b'\n';
        let x = read(&whole).unwrap().parts[0].0.positions[0].x;
        assert!(x == f32::from_le_bytes([b'\n', 0, 0, 0]), "{end:?}: {x}");
    }
}

#[test]
fn both_orders_of_bytes() {
    let numbers: [f64; 9] = [0.5, 0.0, 0.0, 1.25, 0.0, 0.0, 0.0, 1e6, 3.0];
    let header = |order: &str| {
        format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
             property double z\nelement face 1\nproperty list ushort uint vertex_index\nend_header\n"
        )
    };
    let file =
        |header: String, double: fn(f64) -> [u8; 8], short: fn(u16) -> [u8; 2], long: fn(u32) -> [u8; 4]| {
            let mut file = header.into_bytes();
            file.extend(numbers.iter().flat_map(|&number| double(number)));
            file.extend(short(3));
            file.extend([2, 0, 1].into_iter().flat_map(long));
            read(&file).unwrap().parts
        };
    let little = file(header("little"), f64::to_le_bytes, u16::to_le_bytes, u32::to_le_bytes);
    let big = file(header("big"), f64::to_be_bytes, u16::to_be_bytes, u32::to_be_bytes);
    assert_eq!(little, big);
    let shape = &little[0].0;
    let corners = shape.triangles[0].map(|vertex| shape.positions[vertex as usize]);
    assert_eq!(corners, [Vec3::new(0.0, 1e6, 3.0), Vec3::new(0.5, 0.0, 0.0), Vec3::new(1.25, 0.0, 0.0)]);
}

#[test]
fn what_is_not_used_is_noted() {
    for (from, to, triangles, expected) in [
        ("uchar red", "uchar quality", 2, "left out: data of vertices that is not shown (quality)"),
        (
            "end_header\n",
            "element edge 2\nproperty int vertex1\nproperty list uchar float x\nelement none 3\nend_header\n",
            2,
            "left out: an element that is not known, 5 times (edge, none)",
        ),
        (
            "0 0 0 9\n",
            "0 0 0 9 7 7\n",
            2,
            "left out: words at the end of lines, which the header does not declare",
        ),
        ("face 1\n", "face 3\nproperty float area\n", 2, "left out: data of faces that is not shown (area)"),
    ] {
        let mut text = ASCII.replacen(from, to, 1).replace("uchar red", "uchar quality");
        if to.contains("edge") {
            text += "1 2 7.5 8.5\n5 0\n";
        }
        if to.contains("area") {
            text = text.replace("4 0 1 2 3", "0.5 4 0 1 2 3\n0.5 2 0 1\n0.5 0");
        }
        let model = read(text.as_bytes()).unwrap();
        assert!(notes(&model).contains(expected), "{to}: {}", notes(&model));
        assert_eq!(model.parts[0].0.triangles.len(), triangles, "{to}");
    }
    let longer = read(format!("{ASCII}\n 3 0 1 2\n").as_bytes()).unwrap();
    assert!(notes(&longer).contains("left out: what follows the last element"), "{}", notes(&longer));
    let few = ASCII.replace("face 1", "face 3") + "2 0 1\n0\n";
    assert!(notes(&read(few.as_bytes()).unwrap()).contains("a face with fewer than three corners, 2 times"));
}

#[test]
fn vertices_that_are_not_numbers_harm_only_their_faces() {
    let text = ASCII
        .replace("vertex 4", "vertex 6")
        .replace("face 1", "face 3")
        .replace("0 1 0 9\n", "0 1 0 9\nnan 0 0 9\n-1.#IND 0 0 9\n")
        + "3 0 1 4\n3 0 1 2\n";
    let model = read(text.as_bytes()).unwrap();
    assert_eq!(model.parts[0].0.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert!(
        notes(&model).contains("left out: a face with a corner that is not a number"),
        "{}",
        notes(&model)
    );
    let unused = text.replace("face 3", "face 1");
    assert!(!notes(&read(unused.as_bytes()).unwrap()).contains("not a number"));
    let all = ASCII.replace("0 0 0 9", "nan 0 0 9");
    assert!(error(&all).contains("no face is usable") && error(&all).contains("vertex 0, (NaN, 0, 0)"));
}

/// Two triangles of four vertices, with these properties and values of each vertex, and of each face.
fn with(vertex: &str, values: [&str; 4], face: &str, of_faces: [&str; 2]) -> String {
    let [a, b, c, d] = values;
    let [first, second] = of_faces;
    format!(
        "ply\nformat ascii 1.0\ncomment TextureFile wood.png\nelement vertex 4\nproperty float x\nproperty float y\n\
         property float z\n{vertex}element face 2\nproperty list uchar int vertex_indices\n{face}end_header\n0 0 0 {a}\n\
         1 0 0 {b}\n1 1 0 {c}\n0 1 0 {d}\n3 0 1 2 {first}\n3 0 2 3 {second}\n"
    )
}

fn properties(kind: &str, names: &[&str]) -> String {
    names.iter().map(|name| format!("property {kind} {name}\n")).collect()
}

#[test]
fn colours_of_all_types_and_names() {
    let rgb = ["red", "green", "blue"];
    for (kind, names, values) in [
        ("uchar", rgb, ["255 0 0", "188 188 188", "0 0 255", "255 255 255"]),
        ("int", rgb, ["255 0 0", "188 188 188", "0 0 255", "255 255 255"]),
        ("ushort", ["r", "g", "b"], ["65535 0 0", "48316 48316 48316", "0 0 65535", "65535 65535 65535"]),
        (
            "float",
            ["diffuse_red", "diffuse_green", "diffuse_blue"],
            ["1 0 0", ".737255 .737255 .737255", "0 0 1", "1 1 1"],
        ),
        ("float", rgb, ["255 0 0", "188 188 188", "0 0 255", "255 255 255"]),
    ] {
        let model = read(with(&properties(kind, &names), values, "", [""; 2]).as_bytes()).unwrap();
        let shape = &model.parts[0].0;
        let expected = [[1.0, 0.0, 0.0, 1.0], [0.502_886, 0.502_886, 0.502_886, 1.0], [0.0, 0.0, 1.0, 1.0]];
        let near = shape.colors[0].iter().zip(expected).all(|(a, b)| a.distance(b.into()) < 1e-4);
        assert!(near && shape.colors.len() == 2, "{kind}: {:?}", shape.colors);
        let material = &model.materials[model.parts[0].1.unwrap()];
        assert_eq!((material.color, material.alpha), (Vec3::ONE, Alpha::Opaque));
    }
    // Two of three are none.
    let model = read(with(&properties("uchar", &rgb[..2]), ["1 2"; 4], "", [""; 2]).as_bytes()).unwrap();
    assert!(model.parts[0].0.colors.is_empty() && model.parts[0].1.is_none());
}

#[test]
fn colours_that_are_not_numbers_are_white() {
    let rgb = properties("float", &["red", "green", "blue"]);
    let model = read(with(&rgb, ["0 nan 0", "1 0 0", "1 0 0", "1 0 0"], "", [""; 2]).as_bytes()).unwrap();
    assert_eq!(
        model.parts[0].0.colors[0],
        [Vec4::ONE, Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(1.0, 0.0, 0.0, 1.0)]
    );
    let expected = "repaired: a colour that is not made of numbers, taken as white";
    assert!(notes(&model).split("; ").any(|note| note == expected), "{}", notes(&model));
}

#[test]
fn colours_let_light_through() {
    let rgba = properties("uchar", &["red", "green", "blue", "alpha"]);
    let of = |values| read(with(&rgba, values, "", [""; 2]).as_bytes()).unwrap();
    let model = of(["255 0 0 255", "255 0 0 51", "255 0 0 255", "255 0 0 255"]);
    assert_eq!(model.parts[0].0.colors[0][1], Vec4::new(1.0, 0.0, 0.0, 0.2));
    assert_eq!(model.materials[0].alpha, Alpha::Blend);
    let model = of(["255 0 0 0"; 4]);
    assert_eq!(model.materials[0].alpha, Alpha::Opaque);
    assert!(notes(&model).contains("repaired: opacities that are all 0, taken as 1"), "{}", notes(&model));
}

#[test]
fn colours_of_faces() {
    let face = properties("uchar", &["red", "green", "blue"]);
    let model = read(with("", [""; 4], &face, ["255 0 0", "0 255 0"]).as_bytes()).unwrap();
    let expected = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]].map(|color| [Vec4::from(color); 3]);
    assert_eq!(model.parts[0].0.colors, expected);
}

#[test]
fn textures_of_vertices_and_faces() {
    let picture = |color: [u8; 3]| {
        let picture = image::RgbImage::from_pixel(2, 2, image::Rgb(color));
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let files = |name: &str, _: u64| match name {
        "wood.png" => Ok(picture([9, 8, 7])),
        "stone 1.png" => Ok(picture([1, 2, 3])),
        _ => Err("none".to_owned()),
    };
    let uvs = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.5]].map(Vec2::from);
    for names in [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]] {
        let text = with(&properties("float", &names), ["0 0", "1 0", "1 .5", "0 1"], "", [""; 2]);
        let model = super::read(text.as_bytes(), files).unwrap();
        assert_eq!((model.parts[0].0.uvs[0][0], notes(&model)), (uvs, String::new()));
        let material = &model.materials[model.parts[0].1.unwrap()];
        assert_eq!((material.color, material.maps.color), (Vec3::ONE, Some(Map::new(0))));
        assert_eq!(model.textures[0].texels[0], [9, 8, 7, 255]);
        // Without the picture the surface is plain.
        let model = read(text.as_bytes()).unwrap();
        assert_eq!(
            (model.parts[0].1, notes(&model)),
            (None, "left out: a texture that is missing (wood.png)".to_owned())
        );
    }
    let face = "property list uchar float texcoord\nproperty int texnumber\n";
    let lists = ["6 0 0 1 0 1 .5 1", "6 0 0 0 0 0 0 0"];
    let text = with("", [""; 4], face, lists)
        .replace("element vertex", "comment TextureFile stone 1.png\nelement vertex");
    let model = super::read(text.as_bytes(), files).unwrap();
    // The parts by texture: the second face first.
    let [wood, stone] = &model.parts[..] else { panic!("two textures") };
    assert_eq!((stone.0.uvs[0][0], notes(&model)), (uvs, String::new()));
    let texel = |part: &(Shape, Option<usize>)| {
        let map = model.materials[part.1.unwrap()].maps.color.unwrap();
        model.textures[map.texture].texels[0][0]
    };
    assert_eq!((texel(wood), texel(stone)), (9, 1));
    assert_eq!((wood.0.triangles.len(), stone.0.triangles.len()), (1, 1));
    // A list that does not fit.
    let short = text.replace("6 0 0 1 0 1 .5 1", "4 0 0 1 0 1");
    let model = super::read(short.as_bytes(), files).unwrap();
    let message = notes(&model);
    assert!(message.contains("texture coordinates of a face that do not fit its corners"), "{message}");
    assert_eq!(model.parts[1].0.uvs[0][0], [[0.0, 1.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from));
    // A number beyond the last texture means the last one, and none the first.
    let one = "comment TextureFile wood.png\n";
    for (textures, face, lists, expected) in [
        (one.to_owned(), face, ["6 0 0 0 0 0 0 7"; 2], 9),
        (one.to_owned() + "comment TextureFile stone 1.png\n", face, ["6 0 0 0 0 0 0 7"; 2], 1),
        (
            one.to_owned() + "comment TextureFile stone 1.png\n",
            "property list uchar float texcoord\n",
            ["6 0 0 0 0 0 0"; 2],
            9,
        ),
    ] {
        let model =
            super::read(with("", [""; 4], face, lists).replace(one, &textures).as_bytes(), files).unwrap();
        let [(shape, material)] = &model.parts[..] else { panic!("{lists:?}") };
        let map = model.materials[material.unwrap()].maps.color.unwrap();
        assert_eq!(
            (shape.triangles.len(), model.textures[map.texture].texels[0][0]),
            (2, expected),
            "{lists:?}"
        );
    }
    let coordinates = with(&properties("float", &["s", "t"]), ["0 0"; 4], "", [""; 2]).replace(one, "");
    let message = notes(&read(coordinates.as_bytes()).unwrap());
    assert_eq!(message, "left out: texture coordinates without a texture");
    let bare = notes(&super::read(with("", [""; 4], "", [""; 2]).as_bytes(), files).unwrap());
    assert_eq!(bare, "left out: a texture without texture coordinates (wood.png)");
}

#[test]
fn strips_of_triangles() {
    let text = ASCII
        .replace("face 1\nproperty list uchar", "tristrips 1\nproperty list int")
        .replace("4 0 1 2 3", "12 0 1 2 3 0 1 -1 3 2 1 1 0");
    let model = read(text.as_bytes()).unwrap();
    let expected = [[0, 1, 2], [2, 1, 3], [2, 3, 0], [0, 3, 1], [3, 2, 1]];
    assert_eq!(model.parts[0].0.triangles, expected);
    assert_eq!(notes(&model), notes(&read(ASCII.as_bytes()).unwrap()));
    assert!(error(&text.replace("-1 3 2", "-1 4 2")).contains("tristrips 0 refers to vertex 4"));
}

#[test]
fn coordinates_of_a_survey_keep_their_digits() {
    let text = ASCII
        .replace("float x", "double x")
        .replace("\n1 1 0", "\n500001.25 1 0")
        .replace("\n1 0 0", "\n500001.25 0 0");
    let text = text.replace("\n0 0 0", "\n500000.125 0 0").replace("\n0 1 0", "\n500000.125 1 0");
    let model = read(text.as_bytes()).unwrap();
    assert_eq!(model.origin, DVec3::new(500_001.0, 1.0, 0.0));
    assert_eq!(model.parts[0].0.positions[0], Vec3::new(-0.875, -1.0, 0.0));
}

#[test]
fn no_damaged_byte_panics() {
    for file in [ASCII.as_bytes().to_vec(), binary()] {
        for at in 0..file.len() {
            for damage in [0, b'9', b'-', 0xff] {
                let mut damaged = file.clone();
                damaged[at] = damage;
                let _ = read(&damaged).map(|model| model.into_scene("damaged").is_ok());
            }
        }
    }
}

#[test]
fn a_header_is_given_in_lines_of_words_with_single_blanks() {
    let expected = "ply\nformat ascii 1.0\nelement vertex 3\nproperty list uchar int a\nend_header\n";
    let lines =
        ["ply", "format  ascii\t1.0", "", " element vertex   3 ", "property list uchar int a", "end_header"];
    for end in ["\n", "\r", "\r\n"] {
        let header = lines.join(end) + end;
        let start = header.clone() + "1 2 3";
        assert_eq!(ply_header(start.as_bytes()), Some((expected.to_owned(), header.len())), "{end:?}");
        // A header whose last line does not end is cut off.
        assert_eq!(ply_header(header.trim_end().as_bytes()), None);
    }
}

#[test]
fn a_header_has_at_most_a_megabyte() {
    let header = |length: usize| {
        let (begin, end) = ("ply\nformat ascii 1.0\n", "end_header\n");
        let comment = format!("comment {}\n", "x".repeat(991));
        let mut text = begin.to_owned();
        while text.len() + comment.len() + end.len() < length {
            text += &comment;
        }
        let rest = length - text.len() - end.len();
        text + &"\n".repeat(rest) + end
    };
    for (length, fits) in [(1 << 10, true), (1 << 20, true), ((1 << 20) + 1, false)] {
        let header = header(length);
        assert_eq!(header.len(), length);
        assert_eq!(ply_header(header.as_bytes()).map(|(_, end)| end), fits.then_some(length));
        assert_eq!(Header::parse(header.as_bytes()).map(|header| header.length).ok(), fits.then_some(length));
    }
}
