//! The materials of the room's objects.

use glam::Vec3;

use crate::Material;

/// A material of the room. Its discriminant is its index in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Paint {
    Wall,
    AccentWall,
    Ceiling,
    Floor,
    White,
    Rug,
    Sofa,
    Pillow,
    Armchair,
    Oak,
    Walnut,
    Curtain,
    Ceramic,
    Terracotta,
    Soil,
    Leaf,
    Black,
    Steel,
    Copper,
    Mirror,
    Apple,
    Orange,
    Lime,
    PictureBlue,
    PictureRed,
    PictureYellow,
    BookRed,
    BookBlue,
    BookGreen,
    BookCream,
    BookDark,
}

impl Paint {
    /// All materials, in the order of their indices.
    pub const ALL: [Self; 31] = [
        Self::Wall,
        Self::AccentWall,
        Self::Ceiling,
        Self::Floor,
        Self::White,
        Self::Rug,
        Self::Sofa,
        Self::Pillow,
        Self::Armchair,
        Self::Oak,
        Self::Walnut,
        Self::Curtain,
        Self::Ceramic,
        Self::Terracotta,
        Self::Soil,
        Self::Leaf,
        Self::Black,
        Self::Steel,
        Self::Copper,
        Self::Mirror,
        Self::Apple,
        Self::Orange,
        Self::Lime,
        Self::PictureBlue,
        Self::PictureRed,
        Self::PictureYellow,
        Self::BookRed,
        Self::BookBlue,
        Self::BookGreen,
        Self::BookCream,
        Self::BookDark,
    ];

    pub fn material(self) -> Material {
        // Roughness and reflectance at normal incidence of the GGX lobe.
        let diffuse = (1.0, 0.0);
        let varnish = (0.35, 0.04);
        let glaze = (0.15, 0.05);
        let name = format!("{self:?}").to_lowercase();
        let (color, (roughness, f0)) = match self {
            Self::Wall => ([0.74, 0.72, 0.67], diffuse),
            Self::AccentWall => ([0.25, 0.38, 0.40], diffuse),
            Self::Ceiling => ([0.82, 0.82, 0.80], diffuse),
            Self::Floor => ([0.42, 0.27, 0.16], (0.3, 0.04)),
            Self::White => ([0.80, 0.80, 0.78], varnish),
            Self::Rug => ([0.60, 0.50, 0.40], diffuse),
            Self::Sofa => ([0.18, 0.27, 0.38], diffuse),
            Self::Pillow => ([0.75, 0.47, 0.15], diffuse),
            Self::Armchair => ([0.56, 0.22, 0.16], diffuse),
            Self::Oak => ([0.52, 0.35, 0.20], varnish),
            Self::Walnut => ([0.24, 0.13, 0.075], varnish),
            Self::Curtain => ([0.68, 0.62, 0.52], diffuse),
            Self::Ceramic => ([0.72, 0.74, 0.76], glaze),
            Self::Terracotta => ([0.58, 0.27, 0.16], diffuse),
            Self::Soil => ([0.09, 0.06, 0.04], diffuse),
            Self::Leaf => ([0.12, 0.32, 0.09], (0.4, 0.04)),
            Self::Black => ([0.03, 0.03, 0.035], glaze),
            Self::Steel => ([0.22, 0.22, 0.23], (0.2, 0.5)),
            Self::Copper => ([0.50, 0.22, 0.12], (0.2, 0.4)),
            Self::Mirror => return Material::mirror(name, Vec3::new(0.92, 0.93, 0.92)),
            Self::Apple => ([0.62, 0.08, 0.06], glaze),
            Self::Orange => ([0.85, 0.37, 0.05], varnish),
            Self::Lime => ([0.38, 0.58, 0.08], glaze),
            Self::PictureBlue => ([0.10, 0.28, 0.50], diffuse),
            Self::PictureRed => ([0.60, 0.15, 0.12], diffuse),
            Self::PictureYellow => ([0.78, 0.58, 0.16], diffuse),
            Self::BookRed => ([0.50, 0.09, 0.08], varnish),
            Self::BookBlue => ([0.09, 0.17, 0.38], varnish),
            Self::BookGreen => ([0.10, 0.28, 0.17], varnish),
            Self::BookCream => ([0.72, 0.65, 0.50], varnish),
            Self::BookDark => ([0.11, 0.09, 0.10], varnish),
        };
        Material::glossy(name, color.into(), roughness, f0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discriminants_are_indices() {
        assert!(Paint::ALL.iter().enumerate().all(|(index, paint)| *paint as usize == index));
    }
}
