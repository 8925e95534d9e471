use std::{
    thread,
    time::{Duration, Instant},
};

use epigraph_core::{Dims, PortElement};

use super::*;

/// An image in which every pixel is `value`.
fn image(frame: u64, value: f32) -> Arc<Snapshot> {
    let dims = Dims { width: 64, height: 48 };
    let bytes = value.to_le_bytes().repeat(dims.count());
    Arc::new(Snapshot {
        name: "a.rate".into(),
        field: String::new(),
        meaning: None,
        element: f32::element(),
        dims,
        frame,
        bytes,
    })
}

fn wish(range: [f32; 2]) -> Wish {
    Wish { look: Look { range: Some(range), ..Look::default() }, histogram: false, gain: None }
}

/// Updates the pictures, as in frames of the window, until the order is carried out; calls `seen` after each update.
fn wait(pictures: &mut Pictures, order: &Order, mut seen: impl FnMut(&Pictures)) {
    let (context, start) = (Context::default(), Instant::now());
    loop {
        pictures.update(&context, order.clone());
        seen(pictures);
        if !pictures.is_behind() {
            return;
        }
        assert!(start.elapsed() < Duration::from_secs(60));
        thread::yield_now();
    }
}

fn first_color(pictures: &Pictures) -> [u8; 3] {
    pictures.image.as_ref().unwrap().shown.colors[0]
}

#[test]
fn pictures_are_not_computed_on_the_windows_thread() {
    let mut pictures = Pictures::default();
    let order = Order { image: image(0, 0.25), other: None, wish: wish([0.0, 1.0]) };
    pictures.update(&Context::default(), order.clone());
    assert!(pictures.image.is_none() && pictures.is_behind());
    wait(&mut pictures, &order, |_| {});
    assert_eq!(first_color(&pictures), [64; 3]);
    // With another look, the old picture stays until the new one is finished.
    let brighter = Order { wish: wish([0.0, 0.5]), ..order };
    pictures.update(&Context::default(), brighter.clone());
    assert!(pictures.is_behind());
    assert_eq!(first_color(&pictures), [64; 3]);
    wait(&mut pictures, &brighter, |pictures| assert!(pictures.image.is_some()));
    assert_eq!(first_color(&pictures), [128; 3]);
}

#[test]
fn compared_images_are_always_of_the_same_frame() {
    let mut pictures = Pictures::default();
    let context = Context::default();
    let same = |pictures: &Pictures| {
        let frame = |layer: &Option<Layer>| layer.as_ref().map(|layer| layer.snapshot.frame);
        assert_eq!(frame(&pictures.image), frame(&pictures.other));
    };
    let wish = Wish { histogram: true, gain: Some(4.0), ..wish([0.0, 1.0]) };
    let order = |frame| Order { image: image(frame, 0.25), other: Some(image(frame, 0.5)), wish };
    // The engine does not wait for pictures.
    for frame in 0..50 {
        pictures.update(&context, order(frame));
        same(&pictures);
        thread::yield_now();
    }
    let last = order(50);
    wait(&mut pictures, &last, same);
    assert_eq!(pictures.image.as_ref().unwrap().snapshot.frame, 50);
    assert!(pictures.difference.is_some());
    assert!(pictures.histogram.as_ref().is_some_and(Option::is_some));
}

#[test]
fn unchanged_images_are_not_painted_again() {
    let mut pictures = Pictures::default();
    let order = Order { image: image(0, 0.25), other: Some(image(0, 0.5)), wish: wish([0.0, 1.0]) };
    wait(&mut pictures, &order, |_| {});
    let painted = |layer: &Option<Layer>| layer.as_ref().unwrap().painted.clone();
    let held = painted(&pictures.other);
    let next = Order { image: image(1, 0.75), ..order };
    wait(&mut pictures, &next, |_| {});
    assert!(Arc::ptr_eq(&painted(&pictures.other), &held));
    assert_eq!(first_color(&pictures), [191; 3]);
    // Without another image to compare with, the layer is removed.
    wait(&mut pictures, &Order { other: None, ..next }, |_| {});
    assert!(pictures.other.is_none() && pictures.difference.is_none());
}
