use epigraph_core::{Dims, PortElement, texel};
use epigraph_stages::meaning::{CLASS, CROSSINGS, DEPTH, FACE, ID, NORMAL, PRIORITY, REACH};

use super::*;
use crate::describe;

/// An image in one row; without a meaning.
fn snapshot<T: Copy>(element: Element, data: &[T], bytes: fn(T) -> Vec<u8>) -> Snapshot {
    let name = "a.b".into();
    let dims = Dims { width: data.len() as u32, height: 1 };
    let bytes = data.iter().flat_map(|value| bytes(*value)).collect();
    Snapshot { name, field: String::new(), meaning: None, element, dims, frame: 0, bytes }
}

fn floats(data: &[f32]) -> Snapshot {
    snapshot(f32::element(), data, |value| value.to_le_bytes().to_vec())
}

fn integers(data: &[u32]) -> Snapshot {
    snapshot(u32::element(), data, |value| value.to_le_bytes().to_vec())
}

fn of(meaning: Meaning, snapshot: Snapshot) -> Snapshot {
    Snapshot { meaning: Some(meaning), ..snapshot }
}

fn shown(snapshot: &Snapshot) -> Vec<[u8; 3]> {
    show(snapshot, &Look { far: 100.0, ..Look::default() }).colors
}

#[test]
fn colours_are_encoded_and_what_is_no_number_is_loud() {
    let data = [[0.18f32, 9.0, -1.0, 1.0], [f32::NAN, 0.0, 0.0, 1.0], [0.0, f32::INFINITY, 0.0, 1.0]];
    let bytes = |value: [f32; 4]| value.iter().flat_map(|lane| lane.to_le_bytes()).collect();
    let colors = snapshot(texel::Rgba32Float::element(), &data, bytes);
    assert_eq!(shown(&colors), [[118, 255, 0], NAN, INFINITE]);
    assert_eq!(show(&colors, &Look::default()).odd, 2);
    assert_eq!(describe(&colors, [0, 0]).unwrap(), "r 0.18  g 9  b -1  a 1");
    assert_eq!(describe(&colors, [3, 0]), None);
    let bytes = snapshot(texel::Rgba8Unorm::element(), &[[7u8, 8, 9, 255]], |texel| texel.to_vec());
    assert_eq!(shown(&bytes), [[7, 8, 9]]);
}

#[test]
fn depth_is_bright_where_near_also_as_bits() {
    let depths = [1.0f32, 2.0, 4.0, f32::INFINITY, 100.0];
    let as_bits = of(DEPTH, integers(&depths.map(f32::to_bits)));
    let as_floats = of(DEPTH, floats(&depths));
    assert_eq!(shown(&as_bits), shown(&as_floats));
    assert_eq!((shown(&as_bits)[0], &shown(&as_bits)[3..]), ([255; 3], &[EMPTY; 2][..]));
    // Other modes know as well what is a distance, and what is none.
    let grey = Look { mode: Some(Mode::Grey), far: 100.0, ..Look::default() };
    assert_eq!(show(&as_bits, &grey).colors, show(&as_floats, &grey).colors);
    assert_eq!(show(&as_bits, &grey).colors[2..], [[255; 3], EMPTY, EMPTY]);
    // Without a far plane, its distance is one like any other.
    assert!(show(&as_bits, &Look::default()).colors[4] != EMPTY);
    assert!(shown(&as_bits)[1] > shown(&as_bits)[2]);
    assert_eq!(describe(&as_bits, [2, 0]).unwrap(), "4 m");
    assert_eq!(describe(&as_floats, [2, 0]).unwrap(), "4 m");
    assert_eq!(shown(&of(DEPTH, integers(&[POISON, NONE]))), [POISONED, EMPTY]);
}

#[test]
fn integers_are_amounts_or_names() {
    assert_eq!(shown(&integers(&[0, 100, 200])), [[0; 3], [128; 3], [255; 3]]);
    assert_eq!(shown(&of(PRIORITY, integers(&[0, 51, 102]))), [[0; 3], [51; 3], [102; 3]]);
    let ids = shown(&of(ID, integers(&[5, 5, 6, NONE, POISON])));
    assert!(ids[0] == ids[1] && ids[0] != ids[2]);
    assert_eq!(ids[3..], [EMPTY, POISONED]);
    assert_eq!(describe(&of(ID, integers(&[NONE])), [0, 0]).unwrap(), "none");
}

#[test]
fn every_meaning_has_its_mode_whatever_the_port_is_called() {
    let mode = |meaning, element: Element| Mode::of_port(meaning, &element);
    let words = [
        (ID, Mode::Names),
        (FACE, Mode::Names),
        (CLASS, Mode::Classes),
        (CROSSINGS, Mode::Edges),
        (REACH, Mode::Reach),
        (NORMAL, Mode::Normals),
    ];
    for (meaning, expected) in words {
        assert_eq!(mode(Some(meaning), u32::element()), expected, "{meaning}");
        assert_eq!(mode(Some(meaning), texel::R32Uint::element()), expected, "{meaning}");
        // These are made of bits.
        assert_eq!(mode(Some(meaning), f32::element()), Mode::Grey, "{meaning}");
        let renamed = Snapshot { name: "b.depth".into(), ..of(meaning, integers(&[1, 2, 3])) };
        assert_eq!(shown(&renamed), shown(&of(meaning, integers(&[1, 2, 3]))), "{meaning}");
    }
    assert_eq!([f32::element(), u32::element()].map(|element| mode(Some(DEPTH), element)), [Mode::Depth; 2]);
    assert_eq!(mode(Some(PRIORITY), u32::element()), Mode::Grey);
    // Where nothing is declared, the elements decide; names do not.
    assert_eq!(mode(None, <[f32; 4]>::element()), Mode::Color);
    assert_eq!([f32::element(), u32::element()].map(|element| mode(None, element)), [Mode::Grey; 2]);
    assert_eq!(
        show(&Snapshot { name: "a.depth".into(), ..floats(&[1.0]) }, &Look::default()).mode,
        Mode::Grey
    );
}

#[test]
fn a_range_can_be_given_and_follow_the_logarithm() {
    let values = floats(&[1.0, 10.0, 100.0, f32::NAN]);
    let look = Look { range: Some([1.0, 100.0]), log: true, ..Look::default() };
    assert_eq!(show(&values, &look).colors, [[0; 3], [128; 3], [255; 3], NAN]);
    let automatic = show(&values, &Look::default());
    assert_eq!(automatic.scale.unwrap().range, [1.0, 100.0]);
    let look = Look { mode: Some(Mode::FalseColor), ..look };
    assert_eq!(show(&values, &look).colors[2], Ramp::Spectrum.color(1.0));
    // Equal values are white, not a division by nothing.
    assert_eq!(shown(&floats(&[3.0, 3.0])), [[255; 3]; 2]);
}

#[test]
fn channels_can_be_exchanged_and_exposed() {
    let bytes = |value: [f32; 4]| value.iter().flat_map(|lane| lane.to_le_bytes()).collect();
    let colors = snapshot(texel::Rgba32Float::element(), &[[0.18f32, 0.0, 1.0, 0.5]], bytes);
    let with = |channels| show(&colors, &Look { channels, ..Look::default() }).colors[0];
    assert_eq!(with([2, 1, 0]), [255, 0, 118]);
    assert_eq!(with([0, 0, 0]), [118; 3]);
    assert_eq!(with([3, 3, 3]), [188; 3]);
    let exposed = show(&colors, &Look { exposure: -1.0, ..Look::default() }).colors[0];
    assert_eq!(exposed, tone::to_srgb8([0.09, 0.0, 0.5]));
}

#[test]
fn zeros_alone_are_dark_and_two_lanes_have_a_range_each() {
    assert_eq!(shown(&integers(&[0, 0])), [[0; 3]; 2]);
    let bytes = |value: [f32; 2]| value.iter().flat_map(|lane| lane.to_le_bytes()).collect();
    let motion = snapshot(<[f32; 2]>::element(), &[[-1.0f32, 5.0], [1.0, 6.0]], bytes);
    assert_eq!(shown(&motion), [[0; 3], [255, 255, 0]]);
}

#[test]
fn normals_are_colours_and_vectors() {
    // Two signed 16-bit integers: x, -z, and the middle between y and z.
    let codes = [0x7FFF, 0x7FFF_7FFF, 0x4000_0000, NO_NORMAL, POISON];
    let normals = of(NORMAL, integers(&codes));
    assert_eq!(shown(&normals), [[255, 128, 128], [128, 128, 0], [128, 218, 218], EMPTY, POISONED]);
    let words = |pixel| describe(&normals, [pixel, 0]).unwrap();
    assert_eq!([words(0), words(2)], ["x 1.000  y 0.000  z 0.000", "x 0.000  y 0.707  z 0.707"]);
    assert_eq!(words(3), "none");
}

#[test]
fn the_words_of_edges_have_pictures_of_their_own() {
    let empty = edges::class_color(0);
    assert_eq!(
        shown(&of(CLASS, integers(&[1, 2, POISON]))),
        [edges::class_color(1), edges::class_color(2), POISONED]
    );
    assert_eq!(shown(&of(REACH, integers(&[0, 0xFFF, 0xFF_FFFF]))), [[0; 3], [128; 3], [255; 3]]);
    // 2x2 pixels: the upper left one is cut from its left to its right side, where the edge ends.
    let mut mask = of(CROSSINGS, integers(&[1 << 3, 1 << 6, 0, 0, 0, 0, 0, 0, 0]));
    mask.dims = Dims { width: 3, height: 3 };
    assert_eq!(shown(&mask)[..4], [edges::EDGE, empty, EMPTY, EMPTY]);
}
