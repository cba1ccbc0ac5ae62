// Cuboids and balls, an instance a collider. Cuboids: the up to three faces that the eye sees, 12 vertices. Balls: a quad
// that covers the ball, on which each pixel finds the ball's surface.

struct CuboidVertex {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) @interpolate(flat) normal: vec3<f32>,
    @location(2) color: vec3<f32>,
    // On the face, m from its middle, and its half extents.
    @location(3) on_face: vec2<f32>,
    @location(4) @interpolate(flat) half_face: vec2<f32>,
}

// The components x y z of a vector that has n along this axis, and u and v along the next ones.
fn along(axis: u32, n: f32, u: f32, v: f32) -> vec3<f32> {
    if axis == 0u {
        return vec3<f32>(n, u, v);
    }
    if axis == 1u {
        return vec3<f32>(v, n, u);
    }
    return vec3<f32>(u, v, n);
}

// Whether a side of the box has `a` before and `b` behind it, in the box's frame.
fn separates(half: vec3<f32>, a: vec3<f32>, b: vec3<f32>) -> bool {
    return any((abs(a) > half) & (abs(b) > half) & (a * b < vec3<f32>(0.0)));
}

// A vertex of a face that `eye`, in the box's frame, sees: the local position, and the face's outward normal. A normal of
// zero if it sees neither face of this axis.
struct Corner {
    local: vec3<f32>,
    normal: vec3<f32>,
    on_face: vec2<f32>,
    half_face: vec2<f32>,
}

fn corner(index: u32, half: vec3<f32>, eye: vec3<f32>) -> Corner {
    let axis = index / 4u;
    let along_axis = dot(eye, along(axis, 1.0, 0.0, 0.0));
    let h = vec3<f32>(
        dot(half, along(axis, 1.0, 0.0, 0.0)),
        dot(half, along(axis, 0.0, 1.0, 0.0)),
        dot(half, along(axis, 0.0, 0.0, 1.0)),
    );
    let side = select(-1.0, 1.0, along_axis > 0.0);
    let u = h.y * select(-1.0, 1.0, (index & 1u) != 0u);
    let v = h.z * select(-1.0, 1.0, (index & 2u) != 0u);
    let is_seen = abs(along_axis) > h.x;
    let normal = along(axis, select(0.0, side, is_seen), 0.0, 0.0);
    return Corner(along(axis, side * h.x, u, v), normal, vec2<f32>(u, v), h.yz);
}

fn cuboid_vertex(index: u32, instance: Instance, is_glass: bool) -> CuboidVertex {
    var out: CuboidVertex;
    out.clip = nowhere();
    let placed = place(instance);
    if placed.kind == BODY_NONE {
        return out;
    }
    let eye = rotate_back(placed.rotation, frame.eye - placed.position);
    let look_at = rotate_back(placed.rotation, frame.look_at - placed.position);
    let may_hide = placed.kind == BODY_FIXED && (frame.flags & SEE_THROUGH) != 0u;
    if (may_hide && separates(instance.size, eye, look_at)) != is_glass {
        return out;
    }
    let at = corner(index, instance.size, eye);
    if all(at.normal == vec3<f32>(0.0)) {
        return out;
    }
    out.position = placed.position + rotate(placed.rotation, at.local);
    out.normal = rotate(placed.rotation, at.normal);
    out.clip = frame.view_projection * vec4<f32>(out.position, 1.0);
    out.color = color_of(instance);
    out.on_face = at.on_face;
    out.half_face = at.half_face;
    return out;
}

@vertex
fn cuboid(@builtin(vertex_index) index: u32, instance: Instance) -> CuboidVertex {
    return cuboid_vertex(index, instance, false);
}

@vertex
fn glass(@builtin(vertex_index) index: u32, instance: Instance) -> CuboidVertex {
    return cuboid_vertex(index, instance, true);
}

// 1 on a thin line along the face's border, fading out where the face is but a few pixels wide.
fn edge(in: CuboidVertex) -> f32 {
    let pixel = max(fwidth(in.on_face), vec2<f32>(1e-12));
    let inside = (in.half_face - abs(in.on_face)) / pixel;
    let wide = min(in.half_face.x / pixel.x, in.half_face.y / pixel.y);
    return (1.0 - smoothstep(0.4, 1.6, min(inside.x, inside.y))) * smoothstep(2.0, 12.0, wide);
}

@fragment
fn cuboid_color(in: CuboidVertex) -> @location(0) vec4<f32> {
    let line = edge(in);
    let color = shade(in.color, in.normal, in.position, 0.05);
    return vec4<f32>(finish(color * (1.0 - 0.5 * line)), 1.0);
}

@fragment
fn glass_color(in: CuboidVertex) -> @location(0) vec4<f32> {
    let line = edge(in);
    return vec4<f32>(finish(mix(vec3<f32>(0.75, 0.82, 0.9), vec3<f32>(0.25), line)), mix(0.07, 0.4, line));
}

struct BallVertex {
    @builtin(position) clip: vec4<f32>,
    @location(0) color: vec3<f32>,
    // On the quad, m from the ball's middle.
    @location(1) offset: vec2<f32>,
    @location(2) position: vec3<f32>,
    @location(3) @interpolate(flat) middle: vec3<f32>,
    @location(4) @interpolate(flat) radius: f32,
    @location(5) @interpolate(flat) rotation: vec4<f32>,
}

@vertex
fn ball(@builtin(vertex_index) index: u32, instance: Instance) -> BallVertex {
    var out: BallVertex;
    out.clip = nowhere();
    let placed = place(instance);
    let radius = instance.size.x;
    let from_eye = placed.position - frame.eye;
    let distance = length(from_eye);
    if placed.kind == BODY_NONE || distance <= 1.0001 * radius {
        return out;
    }
    let direction = from_eye / distance;
    let helper = select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(1.0, 0.0, 0.0), abs(direction.y) > 0.9);
    let u = normalize(cross(direction, helper));
    let v = cross(u, direction);
    // The ball's outline, seen on the plane through its middle; and a pixel more for the soft edge.
    let ratio = radius / distance;
    let reach = radius / sqrt(1.0 - ratio * ratio) + 1.5 * frame.pixel * distance;
    out.offset = reach * vec2<f32>(select(-1.0, 1.0, (index & 1u) != 0u), select(-1.0, 1.0, (index & 2u) != 0u));
    out.position = placed.position + u * out.offset.x + v * out.offset.y;
    out.clip = frame.view_projection * vec4<f32>(out.position, 1.0);
    out.color = color_of(instance);
    out.middle = placed.position;
    out.radius = radius;
    out.rotation = placed.rotation;
    return out;
}

struct BallPixel {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn ball_color(in: BallVertex) -> BallPixel {
    // How far the ray passes by the middle. Not a difference of squares: far away nothing would be left of it.
    let distance = length(in.middle - frame.eye);
    let slope = length(in.offset) / distance;
    let cosine = inverseSqrt(1.0 + slope * slope);
    let miss = distance * slope * cosine;
    let covered = saturate(0.5 + (in.radius - miss) / max(fwidth(miss), 1e-12));
    if covered <= select(0.5, 0.0, (frame.flags & SAMPLES) != 0u) {
        discard;
    }
    let ray = normalize(in.position - frame.eye);
    let half_chord = sqrt(max(in.radius * in.radius - miss * miss, 0.0));
    let hit = frame.eye + ray * (distance * cosine - half_chord);
    let normal = normalize(hit - in.middle);
    // A dark ring tells how the ball turns.
    let height = rotate_back(in.rotation, normal).y;
    let ring = 1.0 - smoothstep(0.10, 0.10 + 2.5 * frame.pixel * distance / in.radius, abs(height));
    let depth = max(dot(hit - frame.eye, frame.forward), 1e-12);
    let color = shade(in.color * (1.0 - 0.45 * ring), normal, hit, 0.25);
    return BallPixel(vec4<f32>(finish(color), covered), saturate(frame.near / depth));
}

// Whether a wall lets the light through, because all that the picture shows would lie in its shadow.
fn is_window(instance: Instance, placed: Placed, look_at: vec3<f32>, light: vec3<f32>) -> bool {
    return placed.kind == BODY_FIXED && (frame.flags & SEE_THROUGH) != 0u
        && separates(instance.size, look_at, look_at + 1e4 * frame.distance * light);
}

@vertex
fn cuboid_shadow(@builtin(vertex_index) index: u32, instance: Instance) -> @builtin(position) vec4<f32> {
    let placed = place(instance);
    let light = rotate_back(placed.rotation, frame.light);
    let look_at = rotate_back(placed.rotation, frame.look_at - placed.position);
    if placed.kind == BODY_NONE || is_window(instance, placed, look_at, light) {
        return nowhere();
    }
    // The light is far away, in its direction.
    let at = corner(index, instance.size, light * 1e6 * length(instance.size));
    return frame.shadow_projection * vec4<f32>(placed.position + rotate(placed.rotation, at.local), 1.0);
}

// A disc of 16 corners through the middle throws the ball's shadow.
@vertex
fn ball_shadow(@builtin(vertex_index) index: u32, instance: Instance) -> @builtin(position) vec4<f32> {
    let placed = place(instance);
    if placed.kind == BODY_NONE {
        return nowhere();
    }
    let u = normalize(cross(frame.light, vec3<f32>(0.0, 0.0, 1.0)));
    let v = cross(frame.light, u);
    let turn = f32(index) * (6.2831853 / 16.0);
    let place = placed.position + instance.size.x * (u * cos(turn) + v * sin(turn));
    return frame.shadow_projection * vec4<f32>(place, 1.0);
}
