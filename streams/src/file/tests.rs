use super::*;
use crate::{
    Codec, Settings, encode,
    testing::{Random, colored, scan},
};

/// Pools of the paper's and singles, with colours and normals.
fn model() -> Model {
    let settings = Settings { codec: Codec::Streams, levels: 3, ..Settings::default() };
    encode(&colored(scan(3000, 1)), &settings).unwrap()
}

/// A file of one node with this block and this number of points, without colours and normals, its checksums right.
fn file(points: u32, first_child: u32, block: &[u32]) -> Vec<u8> {
    let block: Vec<u8> = block.iter().flat_map(|word| word.to_le_bytes()).collect();
    let frame = Frame { origin: Vec3::ZERO, axes: [Vec3::X, Vec3::Y, Vec3::Z], cell: 1.0 };
    let record = Record {
        frame,
        points,
        first_child: Some(first_child as usize),
        offset: (HEADER + RECORD) as u64,
        length: block.len() as u32,
        checksum: crc32fast::hash(&block),
    };
    let mut table = Vec::new();
    record.write(&mut table);
    with_head(0, DVec3::ZERO, 1, &[table, block].concat())
}

/// A file with a table of so many records, its checksum right.
fn with_head(flags: u32, origin: DVec3, count: usize, rest: &[u8]) -> Vec<u8> {
    let (table, blocks) = rest.split_at(count * RECORD);
    [&head(flags, origin, table), blocks].concat()
}

fn error(bytes: &[u8]) -> String {
    Model::from_bytes(bytes).unwrap_err().to_string()
}

#[test]
fn a_model_is_read_as_it_was_written() {
    let model = model();
    let bytes = model.to_bytes();
    assert!(model.nodes().iter().any(|node| !node.pools().is_empty()));
    assert_eq!(Model::from_bytes(&bytes).unwrap(), model);
    let reader = Reader::new(&bytes).unwrap();
    assert_eq!(reader.node_count(), model.nodes().len());
    assert_eq!(reader.node(3).unwrap(), model.nodes()[3]);
}

#[test]
fn a_small_file_by_hand() {
    // Two vertices, two translations, three points; one point more.
    let block = [1, 1, 2, 2, 0, 0xFF, 5, 9 << 7, 3, 1, 7 << 14];
    let model = Model::from_bytes(&file(4, 0, &block)).unwrap();
    let cells: Vec<_> = model.nodes()[0].cells().into_iter().map(Cell::at).collect();
    assert_eq!(cells, [[5, 0, 0], [4, 0, 0], [0, 9, 0], [0, 0, 7]]);
    assert_eq!(model.nodes()[0].positions()[3], Vec3::new(0.5, 0.5, 7.5));
    assert_eq!(model.to_bytes(), file(4, 0, &block));
    // The corner (4, 8, 0) of a brick with three points.
    let block = [1, 0, 1, 0, 4 | 8 << 7, 0b10_0001, 1 << 31];
    let model = Model::from_bytes(&file(3, 0, &block)).unwrap();
    let cells: Vec<_> = model.nodes()[0].cells().into_iter().map(Cell::at).collect();
    assert_eq!(cells, [[4, 8, 0], [5, 9, 0], [7, 11, 3]]);
    assert_eq!(model.to_bytes(), file(3, 0, &block));
    // Colours and normals of two points, and an origin.
    let block = [0, 2, 5, 9, 0xFF_00_00_80, 0xFF_80_00_00, 0, 0x7FFF];
    let origin = DVec3::new(4_500_050.0, -0.125, 1e7);
    let bytes = with_head(3, origin, 1, &file(2, 0, &block)[HEADER..]);
    let model = Model::from_bytes(&bytes).unwrap();
    let node = &model.nodes()[0];
    assert_eq!((node.colors(), node.normals()), (Some(&block[4..6]), Some(&block[6..8])));
    assert_eq!((model.origin(), model.to_bytes()), (origin, bytes));
}

#[test]
fn a_file_names_itself_in_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vts");
    assert!(Model::read(&path).unwrap_err().to_string().starts_with("cannot read "));
    let target = Target::new(&path).unwrap();
    target.write(b"ply\n").unwrap();
    let error = Model::read(&path).unwrap_err().to_string();
    assert!(
        error.ends_with(
            "a.vts: it is no file of vertex transformation streams: it does not begin with EPIGRVTS"
        )
    );
    model().write(&target).unwrap();
    assert_eq!(Model::read(&path).unwrap(), model());
}

#[test]
fn a_file_cut_off_anywhere_is_an_error() {
    let bytes = model().to_bytes();
    let table = HEADER + model().nodes().len() * RECORD;
    let cuts = (0..table).chain((table..bytes.len()).step_by(13));
    for cut in cuts {
        let error = Model::from_bytes(&bytes[..cut]).unwrap_err();
        assert!(matches!(error, VtsError::Short { .. }) || cut < 8, "{cut}: {error}");
    }
    let short = error(&bytes[..table - 1]);
    assert_eq!(
        short,
        format!("it ends at byte {}, before the end of the table of nodes: it is cut off", table - 1)
    );
}

#[test]
fn each_changed_bit_is_noticed() {
    let bytes = model().to_bytes();
    let mut random = Random(5);
    for _ in 0..2000 {
        let mut changed = bytes.clone();
        let at = random.below(bytes.len() as u32) as usize;
        changed[at] ^= 1 << random.below(8);
        assert!(Model::from_bytes(&changed).is_err(), "byte {at}");
    }
}

/// With right checksums, as a hostile writer makes them.
#[test]
fn random_files_with_right_checksums_are_errors_or_valid_models() {
    let bytes = model().to_bytes();
    let count = model().nodes().len();
    let mut random = Random(6);
    let mut valid = 0;
    for _ in 0..3000 {
        let mut changed = bytes.clone();
        for _ in 0..1 + random.below(4) {
            let word = HEADER / 4 + random.below((changed.len() - HEADER) as u32 / 4) as usize;
            let value = match random.below(4) {
                0 => random.next() << 8 | random.below(256),
                1 => u32::MAX,
                2 => random.below(200),
                _ => 1 << random.below(32),
            };
            changed[word * 4..][..4].copy_from_slice(&value.to_le_bytes());
        }
        for node in 0..count {
            let begin = HEADER + node * RECORD;
            let record = Record::read(&changed[begin..][..RECORD]);
            let block =
                changed.get(record.offset as usize..).and_then(|rest| rest.get(..record.length as usize));
            if let Some(checksum) = block.map(crc32fast::hash) {
                changed[begin + RECORD - 4..][..4].copy_from_slice(&checksum.to_le_bytes());
            }
        }
        let flags = if random.below(8) == 0 { random.below(5) } else { 3 };
        let changed = with_head(flags, DVec3::ONE, count, &changed[HEADER..]);
        if let Ok(model) = Model::from_bytes(&changed) {
            valid += 1;
            for node in model.nodes() {
                assert_eq!(node.positions().len(), node.cell_count());
                assert!(node.repeated().is_none());
            }
        }
    }
    // Most words are points or tags, whose change may well be another point.
    assert!((100..2900).contains(&valid), "{valid}");
}

#[test]
fn what_does_not_fit_is_named() {
    let version = |version: u8| error(&[&b"EPIGRVTS"[..], &[version], &[0; 39]].concat());
    assert_eq!(version(1), "it has version 1 of the format; this program reads version 2");
    assert_eq!(error(b"EPIGRVTS\x02"), "it ends at byte 9, before the end of the header: it is cut off");
    // 4 billion nodes in 48 bytes.
    let many = [&b"EPIGRVTS\x02\0\0\0\0\0\0\0\xFF\xFF\xFF\xFF"[..], &[0; 28]].concat();
    assert_eq!(error(&many), "it ends at byte 48, before the end of the table of nodes: it is cut off");
    assert_eq!(
        error(&with_head(0, DVec3::ZERO, 0, &[])),
        "node 0: the table has 0 nodes, of which 1 belong to the tree"
    );
    assert_eq!(
        error(&with_head(5, DVec3::ZERO, 0, &[])),
        "its flags are 0x5; this version of the format has only 1 for colours and 2 for normals, or 4 for repeats"
    );
    assert_eq!(error(&with_head(0, DVec3::NAN, 0, &[])), "its origin is not made of finite numbers");
    assert_eq!(error(&file(1, 1, &[0, 1, 1])), "node 0 cannot have node 1 as its first child");
    let block = |words: &[u32]| error(&file(9, 0, words));
    assert_eq!(
        block(&[1]),
        "node 0, byte 0 of its block: the block ends within the numbers of pools and of cells by themselves"
    );
    assert_eq!(block(&[1, 0, 2]), "node 0, byte 8 of its block: the block ends within a pool's numbers");
    assert_eq!(
        block(&[1, 0, 1, u32::MAX]),
        "node 0, byte 16 of its block: the block ends within translations"
    );
    assert_eq!(block(&[1, 0, u32::MAX, 1, 0]), "node 0, byte 20 of its block: the block ends within cells");
    assert_eq!(block(&[1, 0, u32::MAX, 0, 0]), "node 0, byte 16 of its block: the block ends within cells");
    assert_eq!(block(&[0, u32::MAX, 0]), "node 0, byte 8 of its block: the block ends within cells");
    assert_eq!(block(&[1, 0, 1, 1, 0, 0]), "node 0, byte 24 of its block: the block ends within tags");
    assert_eq!(
        block(&[1, 0, 1, 1, 0x80, 0, 1]),
        "node 0, byte 8 of its block: a translation leaves the grid"
    );
    assert_eq!(
        block(&[1, 0, 1, 1, 0, 0, 2]),
        "node 0, byte 8 of its block: vertex 0 has a tag for translation 1, but the pool has only 1"
    );
    assert_eq!(block(&[0, 1, 1 << 21]), "node 0, byte 8 of its block: a cell is outside of the grid");
    assert_eq!(block(&[0, 3, 3, 4, 3]), "node 0: it contains cell [3, 0, 0] twice");
    assert_eq!(block(&[1, 1, 1, 1, 0, 3, 1, 3]), "node 0: it contains cell [3, 0, 0] twice");
    assert_eq!(
        block(&[0, 1, 3, 4]),
        "node 0, byte 12 of its block: 4 bytes follow the last of the node's numbers"
    );
    let with_colors = |block: &[u32]| error(&with_head(1, DVec3::ZERO, 1, &file(9, 0, block)[HEADER..]));
    assert_eq!(with_colors(&[0, 2, 3, 4, 0]), "node 0, byte 16 of its block: the block ends within colours");
    assert_eq!(error(&file(1, 0, &[0, 2, 3, 4])), "node 0: 1 points cannot fill 2 cells");
    assert_eq!(error(&file(1, 0, &[0, 0])), "node 0: 1 points cannot fill 0 cells");
    // 2.2 million times the same point, from 340 kB.
    let many = [vec![1, 0, 17_000, 128], vec![0; 128 + 17_000], vec![u32::MAX; 4 * 17_000]].concat();
    assert_eq!(error(&file(u32::MAX, 0, &many)), "node 0: 4294967295 points cannot fill 2176000 cells");
    let mut bytes = file(9, 0, &[0, 1, 3]);
    bytes.truncate(bytes.len() - 1);
    assert_eq!(error(&bytes), "it ends at byte 135, before the end of node 0: it is cut off");
}
