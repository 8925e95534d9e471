//! Bytes and glTF files.

use gltf::accessor::{DataType, Dimensions};
use serde_json::Value;

use super::*;
use crate::{Model, VtsError, encode};

/// A surface with all attributes: four copies of two shapes in three materials, and one of a third.
fn colorful() -> Solid {
    let mut random = Random(20);
    let mut dress = |mut solid: Solid| {
        let count = solid.positions.len();
        solid.normals = Some(solid.positions.iter().map(|at| at.normalize()).collect());
        solid.colors = Some((0..count as u8).map(|i| [i, 255 - i, 3 * i, 255]).collect());
        solid
    };
    let models = [sphere(6, 2), drum(5, 0.4, 1.0), cuboid(Vec3::new(1.0, 2.0, 3.0))].map(&mut dress);
    let parts: Vec<Solid> = [(0, 0), (1, 2), (0, 1), (2, 1), (0, 1), (1, 2)]
        .map(|(model, material)| {
            let part = models[model].turned(rotation(&mut random), 20.0 * signed(&mut random));
            Solid { materials: Some(vec![material; part.triangles.len()]), ..part.shuffled(&mut random) }
        })
        .into();
    Solid::all(&parts)
}

fn materials() -> Vec<GlbMaterial> {
    let material = |name: &str, emission| GlbMaterial {
        name: name.into(),
        color: [0.25, 0.5, 0.75, 1.0],
        metallic: 0.5,
        roughness: 0.25,
        emission,
    };
    vec![material("a", [0.0; 3]), material("\"b\"", [0.5, 0.0, 0.0]), material("", [2.0, 8.0, 4.0])]
}

/// A block whose checksum is right again after a change.
fn mended(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = crc32fast::hash(&bytes[4..]);
    bytes[..4].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

#[test]
fn a_block_has_the_bytes_of_its_description() {
    // Two triangles with a common edge, twice: four vertices of which the farthest from the centre is 2 away.
    let fold = Solid {
        positions: [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, -1.0, 0.5]]
            .map(Vec3::from)
            .into(),
        triangles: vec![[0, 1, 2], [1, 0, 3]],
        ..Solid::default()
    };
    let settings = Settings { tolerance: Tolerance::Distance(0.02), ..Settings::default() };
    let solid = Solid::all(&[fold.clone(), fold.moved(Vec3::Y * 8.0)]);
    let found = find(&solid.surface(), &settings).unwrap();
    // The step is 0.02 / sqrt 3: 346 steps for 4, 173 for 2 and 43 for 0.5.
    assert_eq!(found.repeats.shapes()[0].bits(), 9 + 8 + 6);
    let bytes = found.repeats.bytes();
    let expected = Bytes {
        records: 20 + 32,
        instances: 2 * 28,
        vertices: (4_usize * 23).div_ceil(8),
        attributes: 0,
        triangles: 2,
    };
    assert_eq!(bytes, expected);
    assert_eq!((bytes.points(), bytes.total()), (52 + 56 + 12, 52 + 56 + 12 + 2));
}

#[test]
fn damaged_blocks_say_so() {
    let found = search(&colorful());
    let bytes = found.repeats.to_bytes();
    let error = |bytes: &[u8]| Repeats::from_bytes(bytes).unwrap_err();
    for length in 0..bytes.len() {
        assert!(matches!(error(&bytes[..length]), BlockError::Short { .. } | BlockError::Checksum));
        // The checksum of what is left, so that the lengths are all that is wrong.
        if length >= 4 {
            let cut = mended(bytes[..length].to_vec());
            assert!(matches!(error(&cut), BlockError::Short { .. }), "{length}");
        }
    }
    for byte in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[byte] ^= 1 << (byte % 8);
        assert_eq!(error(&damaged), BlockError::Checksum);
    }
    assert_eq!(error(&mended([&bytes[..], &[0; 3]].concat())), BlockError::Long(3));
    assert_eq!(
        error(&bytes[..7]).to_string(),
        "the repeats end at byte 7, before the end of the header: they are cut off"
    );
}

/// Whatever the bytes, there is a result: no panic, and no memory that they do not justify.
#[test]
fn made_up_blocks_are_refused_or_read() {
    let repeats = search(&colorful()).repeats;
    let bytes = repeats.to_bytes();
    let mut random = Random(21);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..40_000 {
        let mut made_up = bytes.clone();
        for _ in 0..1 + random.below(3) {
            let word = 4 * random.below(bytes.len() as u32 / 4) as usize;
            let new = match random.below(4) {
                0 => u32::MAX,
                1 => random.below(8),
                2 => f32::NAN.to_bits(),
                _ => random.next() << 8 ^ random.next(),
            };
            made_up[word..word + 4].copy_from_slice(&new.to_le_bytes());
        }
        match Repeats::from_bytes(&mended(made_up)) {
            Ok(other) => {
                read += 1;
                assert_eq!(other.shapes().len(), repeats.shapes().len());
                assert!(other.positions().len() < 30 * bytes.len());
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().is_empty());
            }
        }
    }
    assert!(read > 1000 && refused > 1000, "{read} {refused}");
}

#[test]
fn values_that_cannot_be_are_named() {
    let bytes = search(&colorful()).repeats.to_bytes();
    let with = |offset: usize, value: u32| {
        let mut bytes = bytes.clone();
        bytes[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        Repeats::from_bytes(&mended(bytes)).unwrap_err().to_string()
    };
    assert_eq!(with(4, 8), "the header of the repeats: its flags are 0x8, but there are only 1, 2 and 4");
    assert_eq!(with(8, 0), "the header of the repeats: it has no shapes");
    assert_eq!(with(12, 7), "the header of the repeats: it has 7 instances, its shapes 6");
    assert_eq!(with(16, (-1_f32).to_bits()), "the header of the repeats: -1 is no distance");
    let shape = "shape 0 of the repeats: ";
    // The sphere has 26 triangles at most.
    assert!(with(20, 2).starts_with(&format!("{shape}24 triangles cannot have 2 vertices")));
    assert!(with(20, 73).starts_with(&format!("{shape}24 triangles cannot have 73 vertices")));
    assert_eq!(with(44, 0), format!("{shape}its grid is not one of single precision"));
    assert_eq!(with(48, 25), format!("{shape}its grid is not one of single precision"));
    assert!(
        with(20 + 3 * 32, 0).starts_with("instance 0 of the repeats: it is not rotated by a unit quaternion")
    );
    assert!(with(20 + 3 * 32 + 16, f32::INFINITY.to_bits()).starts_with("instance 0 of the repeats"));
    assert!(with(24, 1 << 30).contains("cut off"));
}

#[test]
fn files_hold_repeats_or_points() {
    let repeats = search(&colorful()).repeats;
    let bytes = repeats.to_file();
    assert_eq!(Repeats::from_file(&bytes), Ok(repeats.clone()));
    let error = Model::from_bytes(&bytes).unwrap_err().to_string();
    assert_eq!(error, "it holds repeats, the parts of a mesh and where they are, and no tree of points");
    let points = encode(&repeats.positions().into(), &crate::Settings::default()).unwrap();
    let error = Repeats::from_file(&points.to_bytes()).unwrap_err().to_string();
    assert_eq!(error, "it holds a tree of points, and no repeats");
    assert_eq!(Repeats::from_file(b"ply"), Err(VtsError::Magic));
    for length in (0..bytes.len()).step_by(7) {
        assert!(Repeats::from_file(&bytes[..length]).is_err());
    }
    let mut damaged = bytes.clone();
    *damaged.last_mut().unwrap() ^= 1;
    assert_eq!(Repeats::from_file(&damaged), Err(VtsError::Repeats(BlockError::Checksum)));

    let folder = tempfile::tempdir().unwrap();
    let target = epigraph_files::Target::new(&folder.path().join("parts.vts")).unwrap();
    repeats.write(&target).unwrap();
    assert_eq!(Repeats::read(target.path()).unwrap(), repeats);
    std::fs::write(target.path(), &bytes[..99]).unwrap();
    let error = Repeats::read(target.path()).unwrap_err().to_string();
    assert!(error.ends_with("parts.vts: the checksum of the repeats is wrong: they are damaged"), "{error}");
}

/// The numbers of an accessor of floats.
fn floats(file: &gltf::Gltf, accessor: usize) -> Vec<Vec<f32>> {
    let accessor = file.accessors().nth(accessor).unwrap();
    assert_eq!(accessor.data_type(), DataType::F32);
    let wide = accessor.dimensions().multiplicity();
    let begin = accessor.view().unwrap().offset() + accessor.offset();
    let bytes = &file.blob.as_ref().unwrap()[begin..][..4 * wide * accessor.count()];
    let (words, _) = bytes.as_chunks();
    words.chunks(wide).map(|row| row.iter().map(|word| f32::from_le_bytes(*word)).collect()).collect()
}

fn vectors(file: &gltf::Gltf, accessor: usize) -> Vec<Vec3> {
    floats(file, accessor).iter().map(|row| Vec3::from_slice(row)).collect()
}

/// The description of a file, and the file as the crate `gltf` reads it: what the specification demands is checked, but
/// for the list of required extensions, in which the crate does not know this one.
fn parsed(bytes: &[u8]) -> (Value, gltf::Gltf) {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let description: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let mut file = gltf::Gltf::from_slice_without_validation(bytes).unwrap();
    let mut known = file.document.into_json();
    assert_eq!(known.extensions_required, ["EXT_mesh_gpu_instancing"]);
    known.extensions_required.clear();
    file.document = gltf::Document::from_json(known).unwrap();
    (description, file)
}

#[test]
fn a_gltf_file_has_the_vertices_of_the_surface() {
    let solid = colorful();
    let found = search(&solid);
    let bytes = found.repeats.to_glb(&materials()).unwrap();
    let (description, file) = parsed(&bytes);
    assert_eq!(bytes.len() % 4, 0);
    assert_eq!(
        description["extensionsUsed"],
        serde_json::json!(["EXT_mesh_gpu_instancing", "KHR_materials_emissive_strength"])
    );

    let (mut places, mut corners) = (Vec::new(), Vec::new());
    for (index, node) in file.nodes().enumerate() {
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let positions = vectors(&file, primitive.get(&gltf::Semantic::Positions).unwrap().index());
        let normals = vectors(&file, primitive.get(&gltf::Semantic::Normals).unwrap().index());
        assert!(normals.iter().all(|normal| normal.is_normalized()) && normals.len() == positions.len());
        let bounds = primitive.bounding_box();
        assert!(
            positions.iter().all(|at| at.cmpge(bounds.min.into()).all() && at.cmple(bounds.max.into()).all())
        );
        let colors = primitive.get(&gltf::Semantic::Colors(0)).unwrap();
        assert_eq!((colors.data_type(), colors.dimensions()), (DataType::U16, Dimensions::Vec4));
        assert!(colors.normalized() && colors.count() == positions.len());
        let indices = primitive.indices().unwrap();
        assert_eq!(indices.data_type(), DataType::U16);
        let view = indices.view().unwrap();
        let (indices, _) = file.blob.as_ref().unwrap()[view.offset()..][..view.length()].as_chunks();

        let instancing = &description["nodes"][index]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        let transformations: Vec<(glam::Quat, Vec3)> = if instancing.is_null() {
            let (translation, rotation, scale) = node.transform().decomposed();
            assert_eq!(scale, [1.0; 3]);
            vec![(glam::Quat::from_array(rotation), translation.into())]
        } else {
            let of = |name: &str| floats(&file, instancing[name].as_u64().unwrap() as usize);
            let rotations = of("ROTATION").into_iter().map(|row| glam::Quat::from_slice(&row));
            let places: Vec<_> =
                rotations.zip(of("TRANSLATION").iter().map(|row| Vec3::from_slice(row))).collect();
            assert!(places.len() > 1);
            places
        };
        for (rotation, translation) in transformations {
            let place = |index: usize| rotation * positions[index] + translation;
            places.extend((0..positions.len()).map(place));
            corners.extend(indices.iter().map(|index| place(u16::from_le_bytes(*index).into())));
        }
    }
    // All vertices and all corners of triangles are those of the surface, with some rounding by another formula.
    let reach = found.report.deviation as f32 + 1e-5;
    assert_eq!((places.len(), corners.len()), (solid.positions.len(), 3 * solid.triangles.len()));
    let near = |at: &Vec3, all: &[Vec3]| all.iter().any(|other| other.distance(*at) <= reach);
    assert!(places.iter().all(|at| near(at, &solid.positions)));
    assert!(solid.positions.iter().all(|at| near(at, &places) && near(at, &corners)));

    // Shape 0 in materials 0 and 1, where it is twice; shape 1 twice in 2; shape 2 once.
    let names: Vec<_> = file
        .nodes()
        .map(|node| node.mesh().unwrap().primitives().next().unwrap().material())
        .map(|m| m.name().unwrap().to_owned())
        .collect();
    assert_eq!(names, ["a", "\"b\"", "", "\"b\""]);
    let glowing = file.materials().nth(2).unwrap();
    let strength =
        glowing.extension_value("KHR_materials_emissive_strength").unwrap()["emissiveStrength"].as_f64();
    assert_eq!((glowing.emissive_factor(), strength), ([0.25, 1.0, 0.5], Some(8.0)));
    let smooth = file.materials().next().unwrap().pbr_metallic_roughness();
    assert_eq!(
        (smooth.base_color_factor(), smooth.metallic_factor(), smooth.roughness_factor()),
        ([0.25, 0.5, 0.75, 1.0], 0.5, 0.25)
    );
}

#[test]
fn gltf_files_without_copies_need_no_extension() {
    let mut cube = cuboid(Vec3::ONE);
    cube.normals = Some((0..8).map(|i| if i == 3 { Vec3::ZERO } else { Vec3::Y }).collect());
    let bytes = search(&cube).repeats.to_glb(&[]).unwrap();
    // The crate checks the whole file.
    let file = gltf::Gltf::from_slice(&bytes).unwrap();
    assert_eq!((file.extensions_used().count(), file.materials().count()), (0, 0));
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    // One of the vertices has no normal.
    assert!(primitive.get(&gltf::Semantic::Normals).is_none());
    assert!(primitive.get(&gltf::Semantic::Colors(0)).is_none());
}

#[test]
fn large_shapes_have_long_indices_in_gltf_files() {
    let solid = grid(257, 255, [false; 2], |i, j| Vec3::new(i as f32, (i * j % 7) as f32, j as f32));
    let found = search(&solid);
    let file = gltf::Gltf::from_slice(&found.repeats.to_glb(&[]).unwrap()).unwrap();
    let indices = |file: &gltf::Gltf| {
        file.meshes().next().unwrap().primitives().next().unwrap().indices().unwrap().data_type()
    };
    assert_eq!((found.repeats.shapes()[0].vertex_count(), indices(&file)), (65_535, DataType::U16));
    let solid = grid(256, 256, [false; 2], |i, j| Vec3::new(i as f32, (i * j % 7) as f32, j as f32));
    let file = gltf::Gltf::from_slice(&search(&solid).repeats.to_glb(&[]).unwrap()).unwrap();
    assert_eq!(indices(&file), DataType::U32);
}

#[test]
fn gltf_files_are_written_or_say_why_not() {
    let found = search(&colorful());
    let error = found.repeats.to_glb(&materials()[..2]).unwrap_err();
    assert_eq!(error.to_string(), "an instance has material 2, but there are only 2 materials");
    let folder = tempfile::tempdir().unwrap();
    let target = epigraph_files::Target::new(&folder.path().join("parts.glb")).unwrap();
    found.repeats.write_glb(&materials(), &target).unwrap();
    assert_eq!(std::fs::read(target.path()).unwrap(), found.repeats.to_glb(&materials()).unwrap());
    assert!(
        found.repeats.write_glb(&materials()[..2], &target).unwrap_err().to_string().contains("parts.glb")
    );
}
