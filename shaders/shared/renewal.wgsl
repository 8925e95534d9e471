// Which points new samples renew. Mirrors `stages/src/shared/renewal.rs`. Import cloud, color, estimate, frame, octahedral and
// requests too.

// Whether a sample is one of those that are spread over the pixel of a point.
fn is_spread(sample: Sample) -> bool {
    return (sample.aim & SPREAD) != 0u && sample.reuse != NO_POINT;
}

// Whether a sample was taken on the surface of the point that it was requested to renew, which has these fields in the cloud. The
// slot of a late one may hold another point by now.
fn is_on_surface_of(sample: Sample, meta_bits: u32, point: vec4<f32>) -> bool {
    let pixel = 2.0 * frame.previous.tan_x / f32(frame.size.x);
    return sample.hit == HIT_SURFACE && point.w != 0.0
        && (meta_bits & LIVE) != 0u && (meta_bits >> BODY_SHIFT) == sample.body
        && on_surface(point.xyz, sample.position, sample.normal, frame.previous.eye, pixel)
        && (sample.view != VIEW_LATE || in_line(point.xyz, sample.position, frame.previous.eye, pixel));
}

// Whether a sample may take the place of the live point that it was requested to renew. One of those that are spread over a
// pixel lies beyond an edge as often as not, and then says nothing of the point.
fn may_replace(sample: Sample, meta_bits: u32, point: vec4<f32>) -> bool {
    return !is_spread(sample) || (sample.hit == HIT_BACKGROUND && point.w == 0.0)
        || is_on_surface_of(sample, meta_bits, point);
}
