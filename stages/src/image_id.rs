//! Tells points where they are seen.

use epigraph_core::{Access, CpuContext, Extent, In, Io, Out, Stage, shader};

use crate::shared::cloud::NOT_DRAWN;

/// Writes into every point the pixel that shows it, or [`NOT_DRAWN`] if none does: a point may lie outside the image, be
/// hidden, culled, or share its pixel with a nearer one (`algorithms.md` section 1.5).
pub struct ImageId {
    cloud_image_id: Out<u32>,
    id: In<u32>,
}

impl Stage for ImageId {
    const KIND: &'static str = "image_id";
    const DOC: &'static str =
        "Tells each point which pixel shows it, so that points that none shows can age faster.";
    type Params = ();

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        let mut cloud = io.bundle(Access::Update, "cloud", "The points.", Extent::Any);
        let cloud_image_id = cloud.write("image_id");
        let id = io.read("id", "The point that each pixel shows, 0xFFFFFFFF for none.", Extent::Frame(1));

        io.shader(shader!("image_id"));
        io.dispatch("clear", cloud_image_id);
        io.dispatch("mark", id);
        Self { cloud_image_id, id }
    }

    fn cpu(&self, _: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let (mut image_id, id) = (cx.write(self.cloud_image_id), cx.read(self.id));
        image_id.fill(NOT_DRAWN);
        for (pixel, &id) in id.iter().enumerate() {
            // A pixel without a point has an id beyond every slot.
            if let Some(image_id) = image_id.get_mut(id as usize) {
                *image_id = pixel as u32;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::testing::{Random, run_both, run_cpu, settings};

    #[test]
    fn points_know_their_pixels() {
        let mut harness = Harness::<ImageId>::new((), &settings([3, 2], 1));
        harness.set("cloud.image_id", &[4u32, 77, 0, 9]);
        let none = u32::MAX;
        harness.set("id", &[none, 2, none, none, 0, none]);
        assert_eq!(run_cpu(&mut harness).get::<u32>("cloud.image_id"), [4, NOT_DRAWN, 1, NOT_DRAWN]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(3);
        // An odd size, and each point at one pixel at most: a shuffled cloud.
        let size = [37, 29];
        let mut points: Vec<u32> = (0..1300).collect();
        for i in (1..points.len()).rev() {
            points.swap(i, random.below(i as u32 + 1) as usize);
        }
        let id: Vec<u32> = points[..37 * 29]
            .iter()
            .map(|&point| if random.below(4) == 0 { u32::MAX } else { point })
            .collect();
        let mut harness = Harness::<ImageId>::new((), &settings(size, 1));
        harness.set("cloud.image_id", &vec![123u32; 1300]);
        harness.set("id", &id);
        run_both(&mut harness).assert_equal::<u32>("cloud.image_id");
    }
}
