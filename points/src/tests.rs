use std::{fs, io::Write, path::PathBuf};

use epigraph_streams::{Codec, Node, Settings, encode};
use flate2::{Compression, write::GzEncoder};
use glam::{DVec3, Vec3};

use super::*;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Input {
        read(self.write(name, bytes).to_str().unwrap()).unwrap()
    }

    /// The message without the folder.
    fn error(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let error = read(self.write(name, bytes).to_str().unwrap()).unwrap_err().to_string();
        error.replace(&format!("{}/", self.0.path().display()), "")
    }
}

const HEADER: &str = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float nx\nproperty float ny\n\
    property float nz\nproperty list uchar short other\nend_header\n";

fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!("ply\nformat {format} 1.0\ncomment a scan\n{HEADER}").into_bytes();
    if format == "ascii" {
        bytes.extend(b"1 2 3.5 10 20 30 0 0 1 2 7 8\n-1 nan 3 1 2 3 1 0 0 0\n");
        return bytes;
    }
    let swap = |mut number: Vec<u8>| {
        if format == "binary_big_endian" {
            number.reverse();
        }
        number
    };
    for (at, color, normal, list) in [
        ([1.0, 2.0, 3.5], [10, 20, 30], [0.0, 0.0, 1.0], &[7_i16, 8][..]),
        ([-1.0, f32::NAN, 3.0], [1, 2, 3], [1.0, 0.0, 0.0], &[]),
    ] {
        at.into_iter().for_each(|at: f32| bytes.extend(swap(at.to_le_bytes().into())));
        bytes.extend(color);
        normal.into_iter().for_each(|at: f32| bytes.extend(swap(at.to_le_bytes().into())));
        bytes.push(list.len() as u8);
        list.iter().for_each(|number| bytes.extend(swap(number.to_le_bytes().into())));
    }
    bytes
}

#[test]
fn ply_of_all_formats() {
    let folder = Folder::new();
    let expected = Input {
        points: Points {
            colors: Some(vec![[10, 20, 30, 255]]),
            normals: Some(vec![Vec3::Z]),
            ..Points::from(vec![Vec3::new(1.0, 2.0, 3.5)])
        },
        left_out: LeftOut { not_numbers: 1, withheld: 0 },
    };
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        assert_eq!(folder.read("a.ply", ply(format)), expected, "{format}");
        let mut packed = GzEncoder::new(Vec::new(), Compression::default());
        packed.write_all(&ply(format)).unwrap();
        assert_eq!(folder.read("a.ply.gz", packed.finish().unwrap()), expected, "{format}");
    }
}

#[test]
fn ply_with_lines_of_all_systems() {
    let folder = Folder::new();
    let control = folder.read("a.ply", ply("ascii"));
    let text = String::from_utf8(ply("ascii")).unwrap();
    for (text, what) in [
        (text.replace('\n', "\r\n"), "Windows"),
        (text.replace('\n', "\r"), "old Macs"),
        (text.replace("end_header\n", "end_header\n\n"), "a blank line after the header"),
        (text.replace('\n', "\r\n").replace("end_header\r\n", "end_header\r\n\r\n"), "both"),
        (text.replace("property float x", "\n  property\tfloat   x "), "blanks"),
        (text.trim_end().to_owned(), "no line feed at the end"),
    ] {
        assert_eq!(folder.read("a.ply", text), control, "{what}");
    }
    // The first byte of the points looks like the end of a line.
    let end = b"end_header\n";
    for format in ["binary_little_endian", "binary_big_endian"] {
        let file = ply(format);
        let length = file.windows(end.len()).position(|words| words == end).unwrap() + end.len();
        let mut points = file[length..].to_vec();
        points[0] = b'\n';
        let of_header = |header: String| folder.read("a.ply", [header.as_bytes(), &points].concat());
        let header = String::from_utf8(file[..length].to_vec()).unwrap();
        let control = of_header(header.clone());
        for ends in ["\r\n", "\r"] {
            assert_eq!(of_header(header.replace('\n', ends)), control, "{format} {ends:?}");
        }
    }
    let long = "1 2 3 ".repeat(1 << 18);
    let message = folder.error("a.ply", text.replace("1 2 3.5", &long));
    assert_eq!(message, "cannot read a.ply: vertex 0 of 2: its line has more than 1048576 bytes");
    let file = [&text.as_bytes()[..text.len() - 2], b"\xff\n"].concat();
    assert_eq!(folder.error("a.ply", file), "cannot read a.ply: vertex 1 of 2: it is no text");
}

#[test]
fn ply_colours_of_any_type_and_double_positions() {
    let folder = Folder::new();
    for (kind, values) in [
        ("uchar", "255 128 0 64"),
        ("ushort", "65535 32896 0 16448"),
        ("float", "1 0.502 0 0.25"),
        ("int", "255 128 0 64"),
    ] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n\
             property {kind} red\nproperty {kind} diffuse_green\nproperty {kind} blue\nproperty {kind} alpha\nend_header\n\
             4500000.125 0.5 1 {values}\n"
        );
        let points = folder.read("a.ply", text).points;
        assert_eq!((points.origin, points.positions[0]), (DVec3::new(4_500_000.125, 0.5, 1.0), Vec3::ZERO));
        assert_eq!(points.colors, Some(vec![[255, 128, 0, 64]]), "{kind}");
    }
}

/// A square of two triangles, one twice as large as in the same plane as the other, and a vertex without a face.
#[test]
fn vertices_with_faces_get_their_normals() {
    let folder = Folder::new();
    let text = |faces: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
             element face 2\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0\n2 0 0\n0 2 0\n0 0 1\n9 9 9\n{faces}"
        )
    };
    let normals = folder.read("a.ply", text("3 0 1 2\n3 0 3 1\n")).points.normals.unwrap();
    // Areas 2 along z and 1 along y.
    let both = Vec3::new(0.0, 2.0, 4.0);
    assert_eq!(normals, [both, both, Vec3::new(0.0, 0.0, 4.0), Vec3::new(0.0, 2.0, 0.0), Vec3::ZERO]);
    assert_eq!(
        folder.error("a.ply", text("3 0 1 2\n3 0 3 5\n")),
        "cannot read a.ply: face 1 of 2: it refers to vertex 5, but there are only 5 before it"
    );
}

#[test]
fn xyz_and_the_vertices_of_obj() {
    let folder = Folder::new();
    let xyz = folder.read("a.XYZ", "\u{FEFF}# x y z\n1 2 3\n\n4;5,6\t\n// end\n").points;
    assert_eq!((xyz.origin, xyz.colors), (DVec3::new(2.5, 3.5, 4.5), None));
    assert_eq!(xyz.positions, [Vec3::splat(-1.5), Vec3::splat(1.5)]);
    let colored = folder.read("a.xyz", "1 2 3 0 128 255\n1 2 3 1 2 3").points;
    assert_eq!(colored.colors, Some(vec![[0, 128, 255, 255], [1, 2, 3, 255]]));
    let obj = folder.read("a.obj", "o scan\nv 1 2 3 0 0.5 1 # first\n vn 0 0 1\nv 3 2 1 1 1 1\n").points;
    assert_eq!(obj.colors, Some(vec![[0, 128, 255, 255], [255; 4]]));
    assert_eq!(obj.positions, [Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0)]);

    for (text, expected) in [
        ("1 2\n", "line 1: it has 2 numbers, but points are x y z or x y z red green blue"),
        ("1 2 3\n\n1 2 x\n", "line 3: `x` is no number"),
        ("1 2 3 4 5 256\n", "line 1: the colour [4.0, 5.0, 256.0] is not of whole numbers from 0 to 255"),
        ("1 2 3\n1 2 3 4 5 6\n", "line 2: some points have a colour, and others have none"),
        ("1 2 3 4 5 6\n1 2 3\n", "line 2: some points have a colour, and others have none"),
        ("# nothing\n", "it has no points"),
        ("nan 0 0\ninf 0 0\n", "it has no points but 2 whose coordinates are no numbers and 0 withheld ones"),
    ] {
        assert_eq!(folder.error("a.xyz", text), format!("cannot read a.xyz: {expected}"));
    }
    assert_eq!(folder.error("a.xyz", b"1 2 \xFF"), "cannot read a.xyz: line 1: it is no text");
    assert_eq!(
        folder.error("a.xyz", vec![b'1'; 1 << 17]),
        "cannot read a.xyz: line 1: it has more than 65536 bytes"
    );
    assert_eq!(
        folder.error("a.obj", "v 1 2\n"),
        "cannot read a.obj: line 1: a vertex has 2 numbers, not 3, 4 or 6"
    );
}

fn las(compressed: bool, full: u16) -> Vec<u8> {
    let mut builder = ::las::Builder::from((1, 4));
    builder.point_format = ::las::point::Format::new(2).unwrap();
    builder.point_format.is_compressed = compressed;
    let transform = |offset| ::las::Transform { scale: 0.001, offset };
    builder.transforms = ::las::Vector { x: transform(4.5e6), y: transform(5.6e6), z: transform(0.0) };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(if compressed { "a.laz" } else { "a.las" });
    let mut writer = ::las::Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
    for index in 0..40_000 {
        let (x, y) = (f64::from(index % 200), f64::from(index / 200));
        writer
            .write_point(::las::Point {
                x: 4.5e6 + 0.125 * x,
                y: 5.6e6 + y,
                z: 0.001 * x,
                color: Some(::las::Color { red: full, green: 0, blue: full / 2 }),
                is_withheld: index % 1000 == 0,
                ..Default::default()
            })
            .unwrap();
    }
    writer.close().unwrap();
    fs::read(path).unwrap()
}

#[test]
fn las_and_laz_hold_the_same_points() {
    let folder = Folder::new();
    let input = folder.read("a.las", las(false, 65_535));
    assert_eq!(folder.read("a.laz", las(true, 65_535)), input);
    assert_eq!(input.left_out, LeftOut { not_numbers: 0, withheld: 40 });
    let Points { origin, positions, colors, normals } = &input.points;
    assert_eq!((positions.len(), normals), (39_960, &None));
    assert_eq!(colors.as_ref().unwrap()[7], [255, 0, 127, 255]);
    // The third point of the file: the first is withheld.
    let third = *origin + positions[1].as_dvec3();
    assert!(third.abs_diff_eq(DVec3::new(4.5e6 + 0.25, 5.6e6, 0.002), 1e-5), "{third}");
    // Bytes in the place of words.
    assert_eq!(folder.read("b.las", las(false, 200)).points.colors.unwrap()[7], [200, 0, 100, 255]);

    let whole = las(false, 1);
    assert_eq!(
        folder.error("c.las", &whole[..whole.len() - 9]),
        "cannot read c.las: after point 32768 of 40000: failed to fill whole buffer"
    );
    assert!(folder.error("c.las", "LASF").starts_with("cannot read c.las: its header is wrong: "));
}

#[test]
fn scenes_are_vertices_with_the_colours_of_their_materials() {
    let chains = read("chains").unwrap().points;
    assert_eq!(chains.colors.as_ref().map(Vec::len), Some(chains.positions.len()));
    let normals = chains.normals.as_ref().unwrap();
    assert!(normals.iter().all(|normal| normal.length() > 0.0) && normals.len() == chains.positions.len());
    let folder = Folder::new();
    let red = "mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    folder.write("a.mtl", "newmtl red\nKd 0.5 0 0\n");
    let points = folder.read("a.obj", red).points;
    assert_eq!((points.positions[1], points.colors.unwrap()[1]), (Vec3::X, [188, 0, 0, 255]));
    // The light that the scene gets is not among them.
    assert_eq!((points.positions.len(), points.normals.unwrap()), (3, vec![Vec3::Z; 3]));
    // Colours of vertices, and coordinates far out.
    let far = "v 700000 0 0 1 0 0\nv 700001 0 0 0 1 0\nv 700000 1 0 0 0 1\nf 1 2 3\n";
    let points = folder.read("a.obj", far).points;
    assert_eq!(points.origin + points.positions[1].as_dvec3(), DVec3::new(700_001.0, 0.0, 0.0));
    assert!(points.origin.x > 6e5);
    assert_eq!(points.colors.unwrap()[..3], [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]]);
    let error = read("chain").unwrap_err().to_string();
    assert!(error.contains("did you mean `chains`") && error.contains(".laz"), "{error}");
    assert!(read("none.las").unwrap_err().to_string().starts_with("cannot read none.las: "));
}

#[test]
fn ply_files_that_are_wrong() {
    let folder = Folder::new();
    let with = |from: &str, to: &str| String::from_utf8(ply("ascii")).unwrap().replace(from, to);
    for (text, expected) in [
        (with("vertex 2", "vertex 3"), "vertex 2 of 3: the file ends before it"),
        (with("element vertex", "element point"), "no element `vertex` in the header"),
        (with("float z", "float w"), "element `vertex` has no property `z`"),
        (
            with("vertex 2", "vertex 4000000000"),
            "it has 4000000000 points; the most of a point set are 100000000",
        ),
    ] {
        assert_eq!(folder.error("a.ply", text), format!("cannot read a.ply: {expected}"));
    }
    for (from, to, expected) in [
        ("-1 nan 3", "-1 x3 3", "`x3`: invalid float literal"),
        ("1 2 3 1 0", "1 300 3 1 0", "`300`: number too large to fit in target type"),
        ("1 2 3 1 0 0 0", "1 2 3 1 0 0", "its line ends early"),
        ("1 0 0 0", "1 0 0 9 1", "its line ends early"),
    ] {
        assert_eq!(
            folder.error("a.ply", with(from, to)),
            format!("cannot read a.ply: vertex 1 of 2: {expected}")
        );
    }
    assert!(folder.error("a.ply", "plx\n").contains("Expected magic number 'ply'"));
    for format in ["binary_little_endian", "binary_big_endian"] {
        let whole = ply(format);
        for length in 0..whole.len() {
            let message = folder.error("a.ply", &whole[..length]);
            assert!(message.starts_with("cannot read a.ply: "), "{message}");
        }
    }
}

/// What is written is read as the same points.
#[test]
fn decoded_points_are_written_as_ply() {
    let folder = Folder::new();
    let las = folder.read("a.las", las(false, 65_535)).points;
    let plain = Points { colors: None, ..Points::from(las.positions.clone()) };
    let normals = Some(las.positions.clone());
    for points in [las.clone(), plain, Points { normals, ..las }] {
        let settings = Settings { codec: Codec::Brick, levels: 3, ..Settings::default() };
        let model = encode(&points, &settings).unwrap();
        let leaves: Vec<&Node> = model.leaves().collect();
        let mut bytes = Vec::new();
        ply::write(&mut bytes, model.origin(), &leaves).unwrap();
        let read = folder.read("b.ply", bytes).points;
        let places = |points: &Points, at: &[Vec3]| -> Vec<DVec3> {
            at.iter().map(|at| points.origin + at.as_dvec3()).collect()
        };
        let decoded: Vec<Vec3> = leaves.iter().flat_map(|node| node.positions()).collect();
        for (a, b) in places(&read, &read.positions).iter().zip(places(&points, &decoded)) {
            assert!(a.abs_diff_eq(b, 1e-5), "{a} {b}");
        }
        assert_eq!(read.positions.len(), decoded.len());
        let again = folder.read("a.vts", model.to_bytes()).points;
        assert_eq!((again.origin, again.positions), (points.origin, decoded));
        assert_eq!((&again.colors, &again.normals), (&read.colors, &read.normals));
        assert_eq!(read.colors.is_some(), points.colors.is_some());
        assert_eq!(read.normals.is_some(), points.normals.is_some());
        if let Some(colors) = read.colors {
            assert!(colors.iter().all(|color| *color == [255, 0, 127, 255]));
        }
    }
}
