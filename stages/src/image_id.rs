//! Records for each point which pixel shows it.

use epigraph_core::{
    Access, CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, constants, params,
};

use crate::{
    column,
    meaning::{ID, POINTS},
    shared::cloud::NOT_DRAWN,
};

#[path = "explain/image_id.rs"]
mod explain;

constants! {
    /// Number of pixels that the papers' texel can distinguish (`algorithms.md` section 4).
    const TEXEL_PIXELS: usize = 0x7F_FFFF;
}

choice! {
    /// The size of pixel indices.
    pub enum Ids {
        /// 32 bits: enough for every image.
        Word,
        /// The papers': 24 bits beside the age in an RGBA8 texel. The highest bit marks a change of colour, and
        /// 0x7FFFFF a point that is not drawn, so a point seen at pixel 8,388,607 or later counts as not drawn.
        Texel,
    }
}

params! {
    /// Parameters of [`ImageId`].
    pub struct ImageIdParams {
        /// The size of pixel indices.
        ids: Ids = Ids::Word;
    }
}

/// Writes for every point the pixel that shows it, or [`NOT_DRAWN`] if none does: a point may be outside the image,
/// hidden, culled, or share its pixel with a nearer one (`algorithms.md` section 1.5).
pub struct ImageId {
    cloud_image_id: Out<u32>,
    id: In<u32>,
}

impl Stage for ImageId {
    const KIND: &'static str = "image_id";
    const DOC: &'static str =
        "Records for each point which pixel shows it, so that points that are not seen can age faster.";
    type Params = ImageIdParams;

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        io.column(column::P2);
        let mut cloud = io.bundle(Access::Update, "cloud", POINTS, Extent::Any);
        let cloud_image_id = cloud.write("image_id");
        let id = io.read("id", ID, Extent::Frame(1));

        io.shader(shader!("image_id"));
        io.constants(CONSTANTS);
        io.dispatch("clear", cloud_image_id);
        io.dispatch("mark", id);
        io.per_change([cloud_image_id.into(), id.into()]);
        Self { cloud_image_id, id }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let (mut image_id, id) = (cx.write(self.cloud_image_id), cx.read(self.id));
        let told = match params.ids {
            Ids::Word => id.len(),
            Ids::Texel => id.len().min(TEXEL_PIXELS),
        };
        image_id.fill(NOT_DRAWN);
        for (pixel, &id) in id[..told].iter().enumerate() {
            // A pixel without a point has an id larger than every slot.
            if let Some(image_id) = image_id.get_mut(id as usize) {
                *image_id = pixel as u32;
            }
        }
        Ok(())
    }

    fn explain(&self, _: &ImageIdParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::testing::{Random, run_alike, run_both, settings};

    #[test]
    fn each_point_gets_the_pixel_that_shows_it() {
        let mut harness = Harness::<ImageId>::new(ImageIdParams::default(), &settings([3, 2], 1));
        harness.set("cloud.image_id", &[4u32, 77, 0, 9]);
        let none = u32::MAX;
        harness.set("id", &[none, 2, none, none, 0, none]);
        assert_eq!(run_alike(&mut harness).get::<u32>("cloud.image_id"), [4, NOT_DRAWN, 1, NOT_DRAWN]);
    }

    #[test]
    fn golden_limits_of_the_papers_texel() {
        // algorithms.md section 4: ids 0 to 0x7FFFFE.
        assert_eq!(TEXEL_PIXELS, 8_388_607);
        let fits = |width: usize, height: usize| width * height <= TEXEL_PIXELS;
        assert!(fits(2896, 2896) && !fits(2897, 2897));
        assert!(fits(3840, 2160) && !fits(4096, 2160));
        // The last pixel with an id, the first without one, and the last of the image.
        let (size, pixels) = ([4096, 2160], [0x7F_FFFE, 0x7F_FFFF, 4096 * 2160 - 1]);
        let mut id = vec![u32::MAX; 4096 * 2160];
        for (slot, pixel) in (0..).zip(pixels) {
            id[pixel as usize] = slot;
        }
        for (ids, seen) in [(Ids::Word, pixels), (Ids::Texel, [pixels[0], NOT_DRAWN, NOT_DRAWN])] {
            let mut harness = Harness::<ImageId>::new(ImageIdParams { ids }, &settings(size, 1));
            harness.set("cloud.image_id", &[0u32; 3]);
            harness.set("id", &id);
            let both = run_both(&mut harness);
            both.assert_equal::<u32>("cloud.image_id");
            assert_eq!(both.cpu.get::<u32>("cloud.image_id"), seen);
        }
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(3);
        // An odd size and a shuffled cloud, in which at most one pixel shows each point.
        let size = [37, 29];
        let mut points: Vec<u32> = (0..1300).collect();
        for i in (1..points.len()).rev() {
            points.swap(i, random.below(i as u32 + 1) as usize);
        }
        let id: Vec<u32> = points[..37 * 29]
            .iter()
            .map(|&point| if random.below(4) == 0 { u32::MAX } else { point })
            .collect();
        let mut harness = Harness::<ImageId>::new(ImageIdParams::default(), &settings(size, 1));
        harness.set("cloud.image_id", &vec![123u32; 1300]);
        harness.set("id", &id);
        run_both(&mut harness).assert_equal::<u32>("cloud.image_id");
    }
}
