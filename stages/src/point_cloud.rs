//! Owns the memory of the point cloud.

use epigraph_core::{Access, CpuContext, Extent, Io, Stage};

use crate::{column, meaning::POINTS};

epigraph_core::params! {
    /// How large the cloud is.
    pub struct PointCloudParams {
        /// Slots for each pixel of the image; the papers keep about 300,000 points for 512 x 512 pixels.
        points_per_pixel: f32 = 1.14, in 0.01..=16.0, unit "points/pixel";
        /// Whether points keep the mean of their samples, for stages that accumulate: 32 more bytes for each.
        accumulate: bool = false;
    }
}

/// A fixed number of slots for points, empty at the start and kept from frame to frame (`algorithms.md` section 1.1).
/// The stages that update it form a chain; this one does nothing in a frame.
pub struct PointCloud;

impl Stage for PointCloud {
    const KIND: &'static str = "point_cloud";
    const DOC: &'static str = "Keeps the cached samples as points in the world, in slots that are reused.";
    type Params = PointCloudParams;

    fn declare(params: &Self::Params, io: &mut Io) -> Self {
        io.column(column::P1);
        let doc = "The points: position, RGB9E5 radiance, pixel where last seen, age and flags; means if they are kept.";
        let mut cloud =
            io.bundle(Access::Write, "cloud", POINTS.doc(doc), Extent::PerPixel(params.points_per_pixel));
        cloud.persistent();
        cloud.write::<[f32; 4]>("position");
        cloud.write::<u32>("radiance");
        cloud.write::<u32>("image_id");
        cloud.write::<u32>("meta");
        if params.accumulate {
            cloud.write::<[f32; 4]>("mean");
            cloud.write::<[f32; 4]>("record");
        }
        io.idle();
        Self
    }

    fn cpu(&self, _: &Self::Params, _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}
