// Markers and lines: a quad each that faces the picture, around a stretch between two points (one point for a marker).

struct Stroke {
    @location(0) from_point: vec3<f32>,
    // m; zero for a line.
    @location(1) radius: f32,
    @location(2) to_point: vec3<f32>,
    // sRGB.
    @location(3) color: vec4<f32>,
}

struct StrokeVertex {
    @builtin(position) clip: vec4<f32>,
    // Pixels from the stretch's beginning, along it and across.
    @location(0) @interpolate(linear) place: vec2<f32>,
    // Length of the stretch and half its width, pixels.
    @location(1) @interpolate(flat) form: vec2<f32>,
    @location(2) @interpolate(flat) color: vec4<f32>,
}

// What lies behind the camera is cut off.
fn before(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    if a.w >= frame.near || b.w <= frame.near {
        return a;
    }
    return mix(a, b, (frame.near - a.w) / (b.w - a.w));
}

@vertex
fn stroke(@builtin(vertex_index) index: u32, in: Stroke) -> StrokeVertex {
    let from_clip = frame.view_projection * vec4<f32>(in.from_point, 1.0);
    let to_clip = frame.view_projection * vec4<f32>(in.to_point, 1.0);
    let a = before(from_clip, to_clip);
    let b = before(to_clip, from_clip);
    var out: StrokeVertex;
    out.clip = nowhere();
    if a.w < frame.near || b.w < frame.near {
        return out;
    }
    let half = 0.5 * frame.size;
    let stretch = (b.xy / b.w - a.xy / a.w) * half;
    let long = length(stretch);
    let along = select(vec2<f32>(1.0, 0.0), stretch / max(long, 1e-6), long > 1e-4);
    let width = max(in.radius / (frame.pixel * a.w), 1.0);
    let reach = width + 1.0;
    let is_end = (index & 1u) != 0u;
    let side = select(-1.0, 1.0, (index & 2u) != 0u);
    let end = select(a, b, is_end);
    let outward = along * select(-reach, reach, is_end) + vec2<f32>(-along.y, along.x) * side * reach;
    // A little nearer than it is, so that it wins over the surface on which it lies.
    out.clip = vec4<f32>(end.xy + outward / half * end.w, min(end.z * 1.002, end.w), end.w);
    out.place = vec2<f32>(select(-reach, long + reach, is_end), side * reach);
    out.form = vec2<f32>(long, width);
    out.color = vec4<f32>(linear_from_srgb(in.color.rgb), in.color.a);
    return out;
}

fn stroke_alpha(in: StrokeVertex) -> f32 {
    let past = vec2<f32>(max(max(-in.place.x, in.place.x - in.form.x), 0.0), in.place.y);
    return in.color.a * saturate(in.form.y + 0.5 - length(past));
}

@fragment
fn stroke_color(in: StrokeVertex) -> @location(0) vec4<f32> {
    return vec4<f32>(finish(in.color.rgb), stroke_alpha(in));
}

// For what a body hides.
@fragment
fn stroke_faint(in: StrokeVertex) -> @location(0) vec4<f32> {
    return vec4<f32>(finish(in.color.rgb), 0.25 * stroke_alpha(in));
}
