//! The furniture. Each piece stands on the plane y = 0, centred on the origin, and faces +z.

use glam::{Affine3A, Vec2, Vec3};

use super::objects;
use super::paint::Paint;
use super::{GAP, Piece};
use crate::Shape;

pub(super) const COFFEE_TABLE_HEIGHT: f32 = 0.42;
pub(super) const DESK_HEIGHT: f32 = 0.74;

/// A box with rounded edges between two opposite corners.
fn block(low: [f32; 3], high: [f32; 3], radius: f32, segments: u32) -> Shape {
    let [low, high] = [low, high].map(Vec3::from);
    Shape::rounded_box(0.5 * (high - low), radius, segments).moved(low.midpoint(high))
}

/// A loose cushion, upright and facing z: a superellipsoid with a square outline, thin at its rim and `bulge` thicker
/// in the middle.
fn pillow(half: [f32; 3], bulge: f32) -> Shape {
    let mut shape = Shape::sphere(1.0, 44, 22);
    for p in &mut shape.positions {
        let outline = |v: f32| v.signum() * v.abs().powf(0.45);
        let [x, y] = [outline(p.x), outline(p.y)];
        let middle = (1.0 - 0.5 * (x * x + y * y)).max(0.0).sqrt();
        *p = Vec3::new(half[0] * x, half[1] * y, p.z * (half[2] + bulge * middle));
    }
    shape.smooth(60.0);
    shape
}

pub(super) fn sofa() -> Vec<Piece> {
    seat(0.95, Paint::Sofa, 2)
}

pub(super) fn armchair() -> Vec<Piece> {
    seat(0.42, Paint::Armchair, 1)
}

/// An upholstered seat for `places` people; `half` is half its width between the arms.
fn seat(half: f32, paint: Paint, places: u32) -> Vec<Piece> {
    const ARM: f32 = 0.16;
    const BACK: f32 = -0.45;
    const FRONT: f32 = 0.42;
    const LEG: f32 = 0.1;
    let outer = half + ARM + GAP;
    let mut pieces = vec![
        (paint, block([-half, LEG + GAP, BACK + 0.22], [half, 0.27, FRONT - 0.02], 0.03, 5)),
        (paint, block([-half, LEG + GAP, BACK], [half, 0.8, BACK + 0.22 - GAP], 0.07, 7)),
        (paint, block([-outer, LEG + GAP, BACK], [-half - GAP, 0.58, FRONT], 0.07, 7)),
        (paint, block([half + GAP, LEG + GAP, BACK], [outer, 0.58, FRONT], 0.07, 7)),
    ];
    let width = 2.0 * half / places as f32;
    for place in 0..places {
        let left = -half + width * place as f32;
        pieces.push((
            paint,
            block([left + GAP, 0.27 + GAP, BACK + 0.23], [left + width - GAP, 0.44, FRONT + 0.02], 0.05, 9),
        ));
        let back = block([left + 0.01, 0.0, -0.07], [left + width - 0.01, 0.4, 0.07], 0.065, 9);
        let lean =
            Affine3A::from_translation(Vec3::new(0.0, 0.462, BACK + 0.36)) * Affine3A::from_rotation_x(-0.15);
        pieces.push((paint, back.transformed(lean)));
        // A loose pillow leans against the outer end of the back cushion.
        let side = if place == 0 { 1.0 } else { -1.0 };
        let x = if places == 1 { 0.0 } else { left + 0.5 * width - 0.22 * side };
        let tilt = Affine3A::from_translation(Vec3::new(x, 0.632, BACK + 0.545))
            * Affine3A::from_rotation_x(-0.36)
            * Affine3A::from_rotation_z(0.1 * side);
        pieces.push((Paint::Pillow, pillow([0.2, 0.19, 0.02], 0.06).transformed(tilt)));
    }
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let leg = Shape::lathe(&profile(&[[0.0, 0.0], [0.016, 0.0], [0.026, LEG], [0.0, LEG]]), 24);
        pieces.push((Paint::Walnut, leg.moved(Vec3::new(x * (outer - 0.08), 0.0, z * 0.36 - 0.015))));
    }
    pieces
}

fn profile(points: &[[f32; 2]]) -> Vec<Vec2> {
    points.iter().map(|&p| p.into()).collect()
}

/// A round table on three turned legs.
pub(super) fn coffee_table() -> Vec<Piece> {
    let (top, under) = (COFFEE_TABLE_HEIGHT, COFFEE_TABLE_HEIGHT - 0.035);
    let plate = profile(&[
        [0.0, under],
        [0.40, under],
        [0.435, under + 0.006],
        [0.448, under + 0.016],
        [0.45, under + 0.024],
        [0.447, top - 0.004],
        [0.441, top],
        [0.2, top],
        [0.0, top],
    ]);
    let mut pieces = vec![(Paint::Oak, Shape::lathe(&plate, 96))];
    for k in 0..3 {
        let height = under - GAP;
        let leg: Vec<Vec2> = std::iter::once(Vec2::ZERO)
            .chain((0..=12).map(|i| {
                let t = i as f32 / 12.0;
                let turned = 0.004 * (t * 14.0).sin() * (1.0 - t) * t * 4.0;
                Vec2::new(0.014 + 0.012 * t + turned, t * height)
            }))
            .chain([Vec2::new(0.0, height)])
            .collect();
        let angle = k as f32 * 120_f32.to_radians();
        pieces.push((
            Paint::Walnut,
            Shape::lathe(&leg, 24).moved(0.29 * Vec3::new(angle.sin(), 0.0, angle.cos())),
        ));
    }
    pieces
}

/// A desk with a drawer box, its long side parallel to x.
pub(super) fn desk() -> Vec<Piece> {
    let under = DESK_HEIGHT - 0.03;
    let mut pieces = vec![
        (Paint::Oak, block([-0.75, under, -0.33], [0.75, DESK_HEIGHT, 0.33], 0.008, 4)),
        (Paint::White, block([-0.68, 0.12, -0.28], [-0.3, under - GAP, 0.28], 0.006, 3)),
    ];
    for (x, z) in [(0.68, -0.27), (0.68, 0.27)] {
        pieces
            .push((Paint::Walnut, Shape::cylinder(0.022, 0.0, under - GAP, 32).moved(Vec3::new(x, 0.0, z))));
    }
    for (x, z) in [(-0.64, -0.24), (-0.34, -0.24), (-0.64, 0.24), (-0.34, 0.24)] {
        pieces.push((Paint::Walnut, Shape::cylinder(0.018, 0.0, 0.12 - GAP, 24).moved(Vec3::new(x, 0.0, z))));
    }
    for row in 0..3 {
        let low = 0.14 + 0.19 * row as f32;
        pieces.push((Paint::White, block([-0.665, low, 0.281], [-0.315, low + 0.175, 0.295], 0.004, 3)));
        let knob = Shape::sphere(0.013, 24, 16).moved(Vec3::new(-0.49, low + 0.09, 0.296 + 0.014));
        pieces.push((Paint::Steel, knob));
    }
    pieces
}

/// A wooden chair with a slatted back.
pub(super) fn chair() -> Vec<Piece> {
    const SEAT: f32 = 0.45;
    let mut pieces = vec![
        (Paint::Oak, block([-0.22, SEAT - 0.03, -0.21], [0.22, SEAT, 0.22], 0.014, 6)),
        (Paint::Pillow, block([-0.2, SEAT + GAP, -0.16], [0.2, SEAT + 0.05, 0.2], 0.024, 8)),
        (Paint::Oak, block([-0.22, 0.9, -0.215], [0.22, 0.97, -0.185], 0.012, 6)),
    ];
    for (x, z) in [(-0.18, -0.17), (0.18, -0.17), (-0.18, 0.18), (0.18, 0.18)] {
        let height = SEAT - 0.03 - GAP;
        let leg = Shape::lathe(
            &profile(&[[0.0, 0.0], [0.012, 0.0], [0.02, 0.6 * height], [0.02, height], [0.0, height]]),
            24,
        );
        pieces.push((Paint::Oak, leg.moved(Vec3::new(x, 0.0, z))));
    }
    for k in 0..5 {
        let x = -0.17 + 0.085 * k as f32;
        let slat = Shape::cylinder(0.009, SEAT + GAP, 0.9 - GAP, 20);
        pieces.push((Paint::Oak, slat.moved(Vec3::new(x, 0.0, -0.2))));
    }
    pieces
}

/// A bookcase with five shelves, which hold books and a few other objects.
pub(super) fn shelf() -> Vec<Piece> {
    const HALF: f32 = 0.6;
    const DEPTH: f32 = 0.3;
    const HEIGHT: f32 = 2.0;
    const BOARD: f32 = 0.024;
    const ROWS: u32 = 5;
    let z = [-0.5 * DEPTH, 0.5 * DEPTH];
    let mut pieces = vec![
        (Paint::Walnut, block([-HALF, 0.0, z[0]], [-HALF + BOARD, HEIGHT, z[1]], 0.004, 3)),
        (Paint::Walnut, block([HALF - BOARD, 0.0, z[0]], [HALF, HEIGHT, z[1]], 0.004, 3)),
        (
            Paint::Walnut,
            block(
                [-HALF + BOARD + GAP, 0.02, z[0] + 0.002],
                [HALF - BOARD - GAP, HEIGHT - 0.01, z[0] + 0.01],
                0.002,
                2,
            ),
        ),
    ];
    let inner = HALF - BOARD - GAP;
    for row in 0..=ROWS {
        let y = 0.06 + (HEIGHT - 0.06 - BOARD) * row as f32 / ROWS as f32;
        let board = block([-inner, y, z[0] + 0.011], [inner, y + BOARD, z[1] - 0.002], 0.004, 3);
        pieces.push((Paint::Walnut, board));
        if row == ROWS {
            break;
        }
        let floor = y + BOARD + GAP;
        let (from, to) = [(-0.55, 0.5), (-0.3, 0.55), (-0.55, 0.12), (-0.2, 0.4), (-0.55, 0.3)][row as usize];
        pieces.extend(
            objects::book_row(from, to, row * 37)
                .into_iter()
                .map(|(paint, shape)| (paint, shape.moved(Vec3::new(0.0, floor, 0.0)))),
        );
        let beside = |pieces: Vec<Piece>, x: f32| -> Vec<Piece> {
            pieces.into_iter().map(|(paint, shape)| (paint, shape.moved(Vec3::new(x, floor, 0.02)))).collect()
        };
        pieces.extend(match row {
            1 => beside(objects::vase(Paint::Terracotta, 0.24), -0.44),
            2 => beside(vec![(Paint::Mirror, Shape::sphere(0.11, 48, 26).moved(0.11 * Vec3::Y))], 0.34),
            3 => beside(objects::vase(Paint::Ceramic, 0.2), -0.4),
            4 => beside(objects::cup(), 0.45),
            _ => vec![],
        });
    }
    pieces.extend(
        objects::vase(Paint::Ceramic, 0.3)
            .into_iter()
            .map(|(p, s)| (p, s.moved(Vec3::new(-0.3, HEIGHT + GAP, 0.0)))),
    );
    pieces
}
