//! Answers requests as if everything were three metres away. With it in the place of the tracer, frames run on the GPU
//! alone.

#import frame
#import index
#import requests
#import view

/// = per request, means requests
@group(0) @binding(1) var<storage, read> requests: array<Request>;
/// = output, per request, means samples
@group(0) @binding(2) var<storage, read_write> samples: array<Sample>;

@compute @workgroup_size(64)
fn answer(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&requests) {
        return;
    }
    let request = requests[index];
    var sample = Sample();
    if request.pixel != NO_PIXEL {
        var view = frame.view;
        if request.view == VIEW_PREDICTED {
            view = frame.predicted;
        }
        let pixel = vec2(request.pixel % frame.size.x, request.pixel / frame.size.x);
        let aim = vec2(request.aim & 0xFFFFu, request.aim >> 16u);
        let direction = direction_through(view, vec2<f32>(pixel) + vec2<f32>(aim) / 65536.0, frame.size);
        sample.position = view.eye + 3.0 * direction;
        sample.hit = HIT_SURFACE;
        sample.radiance = 0.5 + 0.5 * direction;
        sample.pixel = request.pixel;
        sample.aim = request.aim;
        sample.reuse = request.reuse;
        sample.view = request.view;
        sample.variance = UNKNOWN;
    }
    samples[index] = sample;
}
