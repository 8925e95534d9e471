//! Smaller objects, and those that hang on the walls or from the ceiling. Each stands on the plane y = 0, centred on
//! the origin, unless its comment says otherwise.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::paint::Paint;
use super::{GAP, Piece};
use crate::Shape;

/// A number in [0, 1) that looks random but is the same on every machine: the fractional part of `index` times the
/// golden ratio.
fn scatter(index: u32) -> f32 {
    const GOLDEN_RATIO: u32 = 0x9e37_79b9;
    (index.wrapping_mul(GOLDEN_RATIO) >> 8) as f32 / (1 << 24) as f32
}

/// The profile of a hollow object of revolution with radius `outline(t)` at the height `t * height`, t in 0..=1: up its
/// outside, over the rim, and down its inside, which is offset by `wall` and ends at `floor` (a share of the height).
fn hollow(outline: impl Fn(f32) -> f32, height: f32, wall: f32, floor: f32, steps: u32) -> Vec<Vec2> {
    let outer = (0..=steps).map(|i| i as f32 / steps as f32).map(|t| Vec2::new(outline(t), t * height));
    let inner = (0..=steps)
        .map(|i| 1.0 - (1.0 - floor) * i as f32 / steps as f32)
        .map(|t| Vec2::new((outline(t) - wall).max(0.002), t * height));
    std::iter::once(Vec2::ZERO).chain(outer).chain(inner).chain([Vec2::new(0.0, floor * height)]).collect()
}

/// An open vase, `height` metres high.
pub(super) fn vase(paint: Paint, height: f32) -> Vec<Piece> {
    let outline = |t: f32| height * (0.16 + 0.13 * (t * 3.6 + 0.3).sin() + 0.05 * t * t * t);
    vec![(paint, Shape::lathe(&hollow(outline, height, 0.03 * height, 0.04, 12), 36))]
}

/// A cup with a handle.
pub(super) fn cup() -> Vec<Piece> {
    let outline = |t: f32| 0.03 + 0.012 * (t * FRAC_PI_2).sin();
    let body = Shape::lathe(&hollow(outline, 0.085, 0.003, 0.06, 7), 36);
    let arc = |i: u32| {
        let angle = TAU * i as f32 / 22.0;
        Vec3::new(0.064 + 0.015 * angle.cos(), 0.045 + 0.022 * angle.sin(), 0.0)
    };
    vec![(Paint::Ceramic, body), (Paint::Ceramic, Shape::ring(22, 10, 0.004, arc, |_| Vec3::Z))]
}

/// A wide bowl with seven pieces of fruit.
pub(super) fn fruit_bowl() -> Vec<Piece> {
    let outline = |t: f32| 0.06 + 0.1 * (t * FRAC_PI_2).sin();
    let mut pieces = vec![(Paint::White, Shape::lathe(&hollow(outline, 0.07, 0.006, 0.1, 9), 48))];
    let radius = 0.036;
    for k in 0..7 {
        // Six pieces around the last one.
        let paint = [Paint::Apple, Paint::Orange, Paint::Lime][k as usize % 3];
        let angle = TAU * k as f32 / 6.0;
        let ring = if k == 6 { 0.0 } else { 0.077 };
        let at = Vec3::new(ring * angle.sin(), 0.056, ring * angle.cos());
        pieces.push((paint, Shape::sphere(radius, 24, 14).moved(at)));
    }
    pieces
}

const BOOK_PAINTS: [Paint; 5] =
    [Paint::BookRed, Paint::BookBlue, Paint::BookCream, Paint::BookGreen, Paint::BookDark];

/// A pile of three books.
pub(super) fn book_pile() -> Vec<Piece> {
    let mut y = 0.0;
    (0..3)
        .map(|k| {
            let half = Vec3::new(0.11 - 0.012 * k as f32, 0.014, 0.078 - 0.006 * k as f32);
            let turn = Quat::from_rotation_y(0.3 * scatter(k + 5));
            let at = Affine3A::from_rotation_translation(turn, Vec3::new(0.0, y + half.y, 0.0));
            y += 2.0 * half.y + GAP;
            (BOOK_PAINTS[k as usize], Shape::rounded_box(half, 0.004, 3).transformed(at))
        })
        .collect()
}

/// A row of books from x = `from` to at most `to`, their spines towards +z. `seed` selects their sizes and colours.
pub(super) fn book_row(from: f32, to: f32, seed: u32) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut x = from;
    for k in seed.. {
        let width = 0.022 + 0.028 * scatter(3 * k + 1);
        if x + width > to {
            break;
        }
        let half = Vec3::new(0.5 * width, 0.11 + 0.03 * scatter(3 * k), 0.085 + 0.015 * scatter(3 * k + 2));
        let at = Vec3::new(x + half.x, half.y, 0.12 - half.z);
        pieces.push((BOOK_PAINTS[(7 * k % 5) as usize], Shape::rounded_box(half, 0.004, 2).moved(at)));
        x += width + GAP;
    }
    pieces
}

/// An open laptop, its screen at the back.
pub(super) fn laptop() -> Vec<Piece> {
    let base = Shape::rounded_box(Vec3::new(0.16, 0.008, 0.11), 0.006, 4).moved(Vec3::new(0.0, 0.008, 0.0));
    let lid = Shape::rounded_box(Vec3::new(0.16, 0.105, 0.004), 0.0035, 4);
    let lean = Affine3A::from_translation(Vec3::new(0.0, 0.124, -0.143)) * Affine3A::from_rotation_x(-0.28);
    let screen =
        Shape::rounded_box(Vec3::new(0.15, 0.095, 0.001), 0.0008, 2).moved(Vec3::new(0.0, 0.0, 0.006));
    vec![
        (Paint::Steel, base),
        (Paint::Steel, lid.transformed(lean)),
        (Paint::Black, screen.transformed(lean)),
    ]
}

/// The position of the desk lamp's light, before the lamp is rotated, metres.
pub(super) const DESK_LAMP_LIGHT: [f32; 3] = [0.0, 0.375, 0.2];

/// A desk lamp whose arm reaches towards +z, without its light.
pub(super) fn desk_lamp() -> Vec<Piece> {
    let foot: Vec<Vec2> =
        [[0.0, 0.0], [0.085, 0.0], [0.088, 0.006], [0.08, 0.014], [0.02, 0.022], [0.0, 0.022]]
            .map(Vec2::from)
            .into();
    let [_, light_y, light_z] = DESK_LAMP_LIGHT;
    let shade = |t: f32| 0.075 - 0.045 * t * t;
    let shade: Vec<Vec2> = shell(shade, 0.1, 0.002, 9);
    let arm = rod(Vec3::new(0.0, 0.023, 0.0), Vec3::new(0.0, 0.44, -0.03), 0.006);
    let boom = rod(Vec3::new(0.0, 0.453, -0.03), Vec3::new(0.0, light_y + 0.115, light_z), 0.006);
    vec![
        (Paint::Black, Shape::lathe(&foot, 48)),
        (Paint::Steel, arm),
        (Paint::Steel, boom),
        (Paint::Black, Shape::lathe(&shade, 40).moved(Vec3::new(0.0, light_y - 0.02, light_z))),
    ]
}

/// The profile of a lampshade that is open at the bottom and `wall` thick. Its outer radius is `outline(t)`, from the
/// rim (t = 0) to the top (t = 1).
fn shell(outline: impl Fn(f32) -> f32, height: f32, wall: f32, steps: u32) -> Vec<Vec2> {
    let up = (0..=steps).map(|i| i as f32 / steps as f32);
    let inner = up.clone().map(|t| Vec2::new(outline(t) - wall, t * (height - wall)));
    let outer = up.map(|t| Vec2::new(outline(t), t * height));
    // From the top down the inside to the rim, and up the outside.
    let top_inside = Vec2::new(0.0, height - wall);
    let top = Vec2::new(0.0, height);
    std::iter::once(top_inside)
        .chain(inner.collect::<Vec<_>>().into_iter().rev())
        .chain(outer)
        .chain([top])
        .collect()
}

/// A round rod between two points.
fn rod(from: Vec3, to: Vec3, radius: f32) -> Shape {
    let turn = Quat::from_rotation_arc(Vec3::Y, (to - from).normalize());
    Shape::cylinder(radius, 0.0, from.distance(to), 24)
        .transformed(Affine3A::from_rotation_translation(turn, from))
}

/// A pendant lamp with its rim at y = 0, `drop` below the ceiling, without its light.
pub(super) fn pendant(drop: f32) -> Vec<Piece> {
    let outline = |t: f32| 0.24 * (1.0 - 0.82 * t * t);
    let cord = Shape::cylinder(0.004, 0.2 + GAP, drop - 0.03 - GAP, 20);
    let cap = Shape::lathe(
        &[[0.0, drop - 0.03], [0.05, drop - 0.025], [0.06, drop - GAP], [0.0, drop - GAP]].map(Vec2::from),
        40,
    );
    vec![
        (Paint::Copper, Shape::lathe(&shell(outline, 0.2, 0.003, 14), 54)),
        (Paint::Black, cord),
        (Paint::White, cap),
    ]
}

/// The frame and bars of a window in the plane x = 0, for viewers at +x: its lower edge is at y = 0, its centre at z =
/// 0.
pub(super) fn window_frame(width: f32, height: f32) -> Vec<Piece> {
    const BAR: f32 = 0.03;
    const DEPTH: f32 = 0.025;
    let bar = |y: [f32; 2], z: [f32; 2]| {
        let half = Vec3::new(DEPTH, 0.5 * (y[1] - y[0]), 0.5 * (z[1] - z[0]));
        let at = Vec3::new(DEPTH, 0.5 * (y[0] + y[1]), 0.5 * (z[0] + z[1]));
        (Paint::White, Shape::rounded_box(half, 0.006, 3).moved(at))
    };
    let side = 0.5 * width;
    let middle = 0.6 * height;
    let mut pieces = vec![
        bar([-BAR, height + BAR], [-side - BAR, -side + BAR]),
        bar([-BAR, height + BAR], [side - BAR, side + BAR]),
    ];
    let inner = side - BAR - GAP;
    for y in [0.0, middle, height] {
        pieces.push(bar([y - BAR, y + BAR], [-inner, inner]));
    }
    for y in [[BAR + GAP, middle - BAR - GAP], [middle + BAR + GAP, height - BAR - GAP]] {
        pieces.push(bar(y, [-0.6 * BAR, 0.6 * BAR]));
    }
    // The sill, in front of the lower bar.
    let sill = Shape::rounded_box(Vec3::new(0.09, 0.014, side), 0.008, 4);
    pieces.push((Paint::White, sill.moved(Vec3::new(0.09, -BAR - 0.014 - GAP, 0.0))));
    pieces
}

/// A curtain in the plane x = 0, centred on z = 0: a wavy cloth as a closed mesh, so that both of its sides can be
/// seen.
pub(super) fn curtain() -> Vec<Piece> {
    const WIDTH: f32 = 0.34;
    const HEIGHT: f32 = 2.5;
    const FOLDS: f32 = 6.0;
    const COLUMNS: u32 = 72;
    const ROWS: u32 = 11;
    let half = 0.0015;
    // The columns go around the cloth: along its rear side, and back along its front side.
    let around = 2 * (COLUMNS + 1);
    let mut shape = Shape::surface(around, ROWS + 2, |i, j| {
        let i = i % around;
        let (column, face) = if i <= COLUMNS { (i, -half) } else { (around - 1 - i, half) };
        let t = column as f32 / COLUMNS as f32;
        let v = (j.clamp(1, ROWS + 1) - 1) as f32 / ROWS as f32;
        let depth = 0.018 + 0.014 * (1.0 - v);
        let wave = depth * (TAU * FOLDS * t + 0.5 * (3.0 * v).sin()).sin();
        // The first and the last row close the cloth: there, both sides meet in its middle plane.
        let face = if j == 0 || j == ROWS + 2 { 0.0 } else { face };
        Vec3::new(wave + face, v * HEIGHT, -0.5 * WIDTH + t * WIDTH)
    });
    shape.smooth(40.0);
    vec![(Paint::Curtain, shape)]
}

/// A round mirror on the wall z = 0, centred on the origin.
pub(super) fn round_mirror() -> Vec<Piece> {
    let stand = Affine3A::from_rotation_x(FRAC_PI_2);
    let glass = Shape::cylinder(0.36, 0.0, 0.012, 96).transformed(stand);
    let circle = |i: u32| {
        let angle = TAU * i as f32 / 72.0;
        Vec3::new(0.384 * angle.cos(), 0.384 * angle.sin(), 0.022)
    };
    vec![(Paint::Mirror, glass), (Paint::Copper, Shape::ring(72, 12, 0.021, circle, |_| Vec3::Z))]
}

/// A framed picture on the wall z = 0, centred on the origin; `half` is half its width and height.
pub(super) fn picture(half: [f32; 2], paint: Paint) -> Vec<Piece> {
    const BAR: f32 = 0.012;
    let [x, y] = half;
    let bar = |at: [f32; 2], half: [f32; 2]| {
        (
            Paint::Walnut,
            Shape::rounded_box(Vec3::new(half[0], half[1], 0.012), 0.004, 3)
                .moved(Vec3::new(at[0], at[1], 0.012)),
        )
    };
    let passe_partout = Shape::cuboid(Vec3::new(-x, -y, 0.0), Vec3::new(x, y, 0.006));
    let image =
        Shape::cuboid(Vec3::new(-0.72 * x, -0.72 * y, 0.006 + GAP), Vec3::new(0.72 * x, 0.72 * y, 0.008));
    vec![
        (Paint::White, passe_partout),
        (paint, image),
        bar([0.0, y + BAR + GAP], [x + 2.0 * BAR + GAP, BAR]),
        bar([0.0, -y - BAR - GAP], [x + 2.0 * BAR + GAP, BAR]),
        bar([x + BAR + GAP, 0.0], [BAR, y]),
        bar([-x - BAR - GAP, 0.0], [BAR, y]),
    ]
}

/// A potted plant with long, overhanging leaves.
pub(super) fn plant() -> Vec<Piece> {
    const POT: f32 = 0.36;
    let outline = |t: f32| 0.14 + 0.05 * t + if t > 0.88 { 0.012 } else { 0.0 };
    let mut pieces = vec![(Paint::Terracotta, Shape::lathe(&hollow(outline, POT, 0.014, 0.1, 12), 40))];
    let soil = POT - 0.02;
    pieces.push((Paint::Soil, Shape::cylinder(0.165, soil - 0.02, soil, 48)));
    // Rings of leaves from the centre outwards. The leaves of each ring are flatter than those of the ring inside it.
    for (ring, (count, radius, lift, length)) in
        [(5, 0.025, 80.0_f32, 0.46), (9, 0.06, 68.0, 0.42), (13, 0.1, 52.0, 0.32), (15, 0.14, 36.0, 0.24)]
            .into_iter()
            .enumerate()
    {
        for k in 0..count {
            let index = 17 * ring as u32 + k;
            let angle = TAU * (k as f32 + 0.3 * scatter(index) + 0.5 * ring as f32) / count as f32;
            let length = length * (0.85 + 0.3 * scatter(index + 100));
            let direction = Vec3::new(angle.sin(), 0.0, angle.cos());
            let at = Affine3A::from_translation(radius * direction + (soil + 0.008) * Vec3::Y)
                * Affine3A::from_rotation_y(angle - FRAC_PI_2);
            pieces.push((Paint::Leaf, leaf(length, lift.to_radians()).transformed(at)));
        }
    }
    pieces
}

/// A pointed leaf that grows from the origin towards +x, `lift` radians above the horizontal, and bends down along its
/// length.
fn leaf(length: f32, lift: f32) -> Shape {
    const BEND: f32 = 0.9;
    let mut shape = Shape::sphere(1.0, 10, 12).transformed(Affine3A::from_rotation_z(-FRAC_PI_2));
    for p in &mut shape.positions {
        let t = 0.5 * (p.x + 1.0);
        // A circular arc, along which the slope decreases by BEND from `lift`.
        let slope = lift - BEND * t;
        let along = Vec3::new(lift.sin() - slope.sin(), slope.cos() - lift.cos(), 0.0) / BEND;
        let across = (t * PI).sin().max(0.0).powf(0.8);
        let normal = Vec3::new(-slope.sin(), slope.cos(), 0.0);
        let fold = 0.006 * p.z.abs();
        *p = length * along + normal * (0.0025 * p.y + fold * across) + 0.02 * p.z * Vec3::Z;
    }
    shape.smooth(60.0);
    shape
}
