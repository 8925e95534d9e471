use epigraph_core::{Dims, PortElement, texel};

use super::*;
use crate::describe;

fn snapshot<T: Copy>(name: &str, element: Element, data: &[T], bytes: fn(T) -> Vec<u8>) -> Snapshot {
    let dims = Dims { width: data.len() as u32, height: 1 };
    let bytes = data.iter().flat_map(|value| bytes(*value)).collect();
    Snapshot { name: name.into(), field: String::new(), element, dims, frame: 0, bytes }
}

fn floats(name: &str, data: &[f32]) -> Snapshot {
    snapshot(name, f32::element(), data, |value| value.to_le_bytes().to_vec())
}

fn integers(name: &str, data: &[u32]) -> Snapshot {
    snapshot(name, u32::element(), data, |value| value.to_le_bytes().to_vec())
}

fn shown(snapshot: &Snapshot) -> Vec<[u8; 3]> {
    show(snapshot, &Look { far: 100.0, ..Look::default() }).colors
}

#[test]
fn colours_are_encoded_and_what_is_no_number_is_loud() {
    let data = [[0.18f32, 9.0, -1.0, 1.0], [f32::NAN, 0.0, 0.0, 1.0], [0.0, f32::INFINITY, 0.0, 1.0]];
    let bytes = |value: [f32; 4]| value.iter().flat_map(|lane| lane.to_le_bytes()).collect();
    let colors = snapshot("fill.color", texel::Rgba32Float::element(), &data, bytes);
    assert_eq!(shown(&colors), [[118, 255, 0], NAN, INFINITE]);
    assert_eq!(show(&colors, &Look::default()).odd, 2);
    assert_eq!(describe(&colors, [0, 0]).unwrap(), "r 0.18  g 9  b -1  a 1");
    assert_eq!(describe(&colors, [3, 0]), None);
    let bytes =
        snapshot("t.image", texel::Rgba8Unorm::element(), &[[7u8, 8, 9, 255]], |texel| texel.to_vec());
    assert_eq!(shown(&bytes), [[7, 8, 9]]);
}

#[test]
fn depth_is_bright_where_near_also_as_bits() {
    let depths = [1.0f32, 2.0, 4.0, f32::INFINITY, 100.0];
    let as_bits = integers("view.depth", &depths.map(f32::to_bits));
    let as_floats = floats("cull.depth", &depths);
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
    assert_eq!(shown(&integers("view.depth", &[POISON, NONE])), [POISONED, EMPTY]);
}

#[test]
fn integers_are_amounts_or_names() {
    assert_eq!(shown(&integers("a.sum", &[0, 100, 200])), [[0; 3], [128; 3], [255; 3]]);
    assert_eq!(shown(&integers("a.priority", &[0, 51, 102])), [[0; 3], [51; 3], [102; 3]]);
    let ids = shown(&integers("a.id", &[5, 5, 6, NONE, POISON]));
    assert!(ids[0] == ids[1] && ids[0] != ids[2]);
    assert_eq!(ids[3..], [EMPTY, POISONED]);
    assert_eq!(describe(&integers("a.id", &[NONE]), [0, 0]).unwrap(), "none");
}

#[test]
fn a_range_can_be_given_and_follow_the_logarithm() {
    let values = floats("a.rate", &[1.0, 10.0, 100.0, f32::NAN]);
    let look = Look { range: Some([1.0, 100.0]), log: true, ..Look::default() };
    assert_eq!(show(&values, &look).colors, [[0; 3], [128; 3], [255; 3], NAN]);
    let automatic = show(&values, &Look::default());
    assert_eq!(automatic.scale.unwrap().range, [1.0, 100.0]);
    let look = Look { mode: Some(Mode::FalseColor), ..look };
    assert_eq!(show(&values, &look).colors[2], Ramp::Spectrum.color(1.0));
    // Equal values are white, not a division by nothing.
    assert_eq!(shown(&floats("a.rate", &[3.0, 3.0])), [[255; 3]; 2]);
}

#[test]
fn channels_can_be_exchanged_and_exposed() {
    let bytes = |value: [f32; 4]| value.iter().flat_map(|lane| lane.to_le_bytes()).collect();
    let colors = snapshot("fill.color", texel::Rgba32Float::element(), &[[0.18f32, 0.0, 1.0, 0.5]], bytes);
    let with = |channels| show(&colors, &Look { channels, ..Look::default() }).colors[0];
    assert_eq!(with([2, 1, 0]), [255, 0, 118]);
    assert_eq!(with([0, 0, 0]), [118; 3]);
    assert_eq!(with([3, 3, 3]), [188; 3]);
    let exposed = show(&colors, &Look { exposure: -1.0, ..Look::default() }).colors[0];
    assert_eq!(exposed, tone::to_srgb8([0.09, 0.0, 0.5]));
}

#[test]
fn zeros_alone_are_dark_and_two_lanes_have_a_range_each() {
    assert_eq!(shown(&integers("a.changed", &[0, 0])), [[0; 3]; 2]);
    let bytes = |value: [f32; 2]| value.iter().flat_map(|lane| lane.to_le_bytes()).collect();
    let motion = snapshot("a.motion", <[f32; 2]>::element(), &[[-1.0f32, 5.0], [1.0, 6.0]], bytes);
    assert_eq!(shown(&motion), [[0; 3], [255, 255, 0]]);
}

#[test]
fn the_words_of_edges_have_pictures_of_their_own() {
    let empty = edges::class_color(0);
    assert_eq!(
        shown(&integers("a.cls", &[1, 2, POISON])),
        [edges::class_color(1), edges::class_color(2), POISONED]
    );
    assert_eq!(shown(&integers("a.r24", &[0, 0xFFF, 0xFF_FFFF])), [[0; 3], [128; 3], [255; 3]]);
    // 2x2 pixels: the upper left one is cut from its left to its right side, where the edge ends.
    let mut mask = integers("a.mask", &[1 << 3, 1 << 6, 0, 0, 0, 0, 0, 0, 0]);
    mask.dims = Dims { width: 3, height: 3 };
    assert_eq!(shown(&mask)[..4], [edges::EDGE, empty, EMPTY, EMPTY]);
}
