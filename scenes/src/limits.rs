//! The numbers that a scene may have. Within these limits no product that loaders, tracer or shaders form leaves the
//! range of f32.

use glam::Vec3;

/// The largest coordinate, metres. Two sides of a triangle between such coordinates are at most 2 sqrt(3) 1e9 long, so
/// the squared length of their cross product is at most 1.5e38, just within f32.
pub const MAX_COORDINATE: f32 = 1e9;

/// The largest radiance of a colour channel. Times the area of the largest light it is within f32.
pub const MAX_RADIANCE: f32 = 1e18;

/// The largest radiant intensity of a point light, W/sr per colour channel: a tenth of a millimetre away, its irradiance
/// is within f32.
pub const MAX_INTENSITY: f32 = 1e30;

/// The longest time in the keys of a motion or a flight, seconds: some 30 years.
pub const MAX_TIME: f32 = 1e9;

/// The most triangles of a scene, and the most vertices. Loading and tracing takes some 370 bytes a triangle: 2 GB in all.
pub const MAX_TRIANGLES: usize = 5_000_000;

/// Whether all coordinates are numbers of at most [`MAX_COORDINATE`].
pub(crate) fn is_near(point: Vec3) -> bool {
    point.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

/// Whether all channels are numbers of at most [`MAX_RADIANCE`].
pub(crate) fn is_radiance(color: Vec3) -> bool {
    color.abs().cmple(Vec3::splat(MAX_RADIANCE)).all()
}

/// Whether all channels are numbers of at most [`MAX_INTENSITY`].
pub(crate) fn is_intensity(color: Vec3) -> bool {
    color.abs().cmple(Vec3::splat(MAX_INTENSITY)).all()
}

/// Whether a time is a number of at most [`MAX_TIME`].
pub(crate) fn is_time(seconds: f32) -> bool {
    seconds.abs() <= MAX_TIME
}
