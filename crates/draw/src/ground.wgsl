// Half-spaces as ground with a grid, an instance each; and the sky behind everything.

struct GroundVertex {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) @interpolate(flat) normal: vec3<f32>,
    @location(2) @interpolate(flat) color: vec3<f32>,
}

// Two axes of the plane. For ground they are x and z.
fn tangents(n: vec3<f32>) -> mat2x3<f32> {
    let helper = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 0.0, 1.0), abs(n.x) > 0.9);
    let u = normalize(helper - n * dot(n, helper));
    return mat2x3<f32>(u, cross(u, n));
}

// Four vertices: a square below the eye, so large that it fades out before it ends. Its normal is the collider's y axis.
@vertex
fn ground(@builtin(vertex_index) index: u32, instance: Instance) -> GroundVertex {
    var out: GroundVertex;
    out.clip = nowhere();
    let placed = place(instance);
    let normal = rotate(placed.rotation, vec3<f32>(0.0, 1.0, 0.0));
    let height = dot(frame.eye - placed.position, normal);
    if placed.kind == BODY_NONE || height <= 0.0 {
        return out;
    }
    let axes = tangents(normal);
    let reach = 200.0 * (frame.distance + height);
    let side = vec2<f32>(select(-1.0, 1.0, (index & 1u) != 0u), select(-1.0, 1.0, (index & 2u) != 0u));
    out.position = frame.eye - height * normal + reach * (axes * side);
    out.clip = frame.view_projection * vec4<f32>(out.position, 1.0);
    out.normal = normal;
    out.color = color_of(instance);
    return out;
}

// 1 on lines at multiples of `spacing`, filtered over a pixel of width `pixel`.
fn lines(place: vec2<f32>, pixel: vec2<f32>, spacing: f32) -> f32 {
    let width = pixel / spacing;
    let from_line = abs(fract(place / spacing - 0.5) - 0.5) / width;
    let line = (1.0 - smoothstep(vec2<f32>(0.3), vec2<f32>(1.2), from_line)) * (1.0 - smoothstep(vec2<f32>(0.08), vec2<f32>(0.4), width));
    return max(line.x, line.y);
}

@fragment
fn ground_color(in: GroundVertex) -> @location(0) vec4<f32> {
    let axes = tangents(in.normal);
    let place = vec2<f32>(dot(in.position, axes[0]), dot(in.position, axes[1]));
    let pixel = max(fwidth(place), vec2<f32>(1e-12));
    // Lines at powers of ten of a metre, no nearer to each other than 14 pixels; the finest fade in.
    let scale = log2(14.0 * frame.pixel * length(in.position - frame.eye)) / log2(10.0);
    let finest = exp2(log2(10.0) * (floor(scale) + 1.0));
    let fine = lines(place, pixel, finest) * (1.0 - fract(scale));
    let line = max(0.14 * fine, 0.26 * lines(place, pixel, 10.0 * finest));
    let color = shade(in.color, in.normal, in.position, 0.0) * (1.0 - line);
    // Far away it becomes the sky.
    let direction = normalize(in.position - frame.eye);
    let far = length(in.position - frame.look_at) / frame.distance;
    return vec4<f32>(finish(mix(color, sky(direction), smoothstep(1.0, 14.0, far))), 1.0);
}

struct SkyVertex {
    @builtin(position) clip: vec4<f32>,
    @location(0) ndc: vec2<f32>,
}

// A triangle over the whole picture, behind everything.
@vertex
fn background(@builtin(vertex_index) index: u32) -> SkyVertex {
    let ndc = vec2<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    return SkyVertex(vec4<f32>(ndc, 0.0, 1.0), ndc);
}

@fragment
fn background_color(in: SkyVertex) -> @location(0) vec4<f32> {
    let half = 0.5 * frame.pixel * frame.size;
    // Rows of the projection are the picture's axes, scaled.
    let m = frame.view_projection;
    let right = normalize(vec3<f32>(m[0].x, m[1].x, m[2].x));
    let up = normalize(vec3<f32>(m[0].y, m[1].y, m[2].y));
    let direction = normalize(frame.forward + right * (in.ndc.x * half.x) + up * (in.ndc.y * half.y));
    return vec4<f32>(finish(sky(direction)), 1.0);
}
