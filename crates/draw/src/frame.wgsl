// What every shader here shares: the frame, places of bodies, light. No entry point.

struct Frame {
    view_projection: mat4x4<f32>,
    // World to the shadow map: x and y from -1 to 1, depth 1 nearest to the light.
    shadow_projection: mat4x4<f32>,
    eye: vec3<f32>,
    near: f32,
    look_at: vec3<f32>,
    // Width of a pixel at distance 1.
    pixel: f32,
    // Into the picture.
    forward: vec3<f32>,
    flags: u32,
    // Towards the key light.
    light: vec3<f32>,
    // Width of a texel of the shadow map in the world.
    texel: f32,
    // Pixels.
    size: vec2<f32>,
    // From the eye to what it looks at.
    distance: f32,
    pad: f32,
}

// Bits of Frame.flags: the picture's format does not encode sRGB itself, bodies cast shadows, walls before the camera are
// glass, a pixel has several samples.
const ENCODE: u32 = 1u;
const SHADOWS: u32 = 2u;
const SEE_THROUGH: u32 = 4u;
const SAMPLES: u32 = 8u;

// As in shaders/shared/body.wgsl.
const BODY_NONE: u32 = 0u;
const BODY_FIXED: u32 = 1u;
const BODY_KIND: u32 = 3u;

// crates/core/src/layout/body.rs
struct PoseRecord {
    translation: vec3<f32>,
    tag: u32,
    rotation: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> poses: array<PoseRecord>;
@group(0) @binding(2) var<storage, read> colors: array<u32>;
@group(0) @binding(3) var shadow_map: texture_depth_2d;
@group(0) @binding(4) var shadow_sampler: sampler_comparison;

// A collider, as one instance.
struct Instance {
    // In the body's own frame.
    @location(0) translation: vec3<f32>,
    @location(1) body: u32,
    @location(2) rotation: vec4<f32>,
    // Half extents, or a radius in the first.
    @location(3) size: vec3<f32>,
    @location(4) generation: u32,
    // sRGB.
    @location(5) color: vec4<f32>,
}

// A collider in the world.
struct Placed {
    position: vec3<f32>,
    kind: u32,
    rotation: vec4<f32>,
}

fn rotate(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

fn rotate_back(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    return rotate(vec4<f32>(-q.xyz, q.w), v);
}

fn multiply(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// Where the collider is. Its kind is BODY_NONE if the world holds no such body (yet, or any more).
fn place(instance: Instance) -> Placed {
    if instance.body >= arrayLength(&poses) {
        return Placed(vec3<f32>(0.0), BODY_NONE, vec4<f32>(0.0, 0.0, 0.0, 1.0));
    }
    let pose = poses[instance.body];
    let is_same = pose.tag >> 8u == instance.generation;
    return Placed(
        pose.translation + rotate(pose.rotation, instance.translation),
        select(BODY_NONE, pose.tag & BODY_KIND, is_same),
        multiply(pose.rotation, instance.rotation),
    );
}

// Nowhere in the picture.
fn nowhere() -> vec4<f32> {
    return vec4<f32>(0.0, 0.0, -1.0, 1.0);
}

fn linear_from_srgb(c: vec3<f32>) -> vec3<f32> {
    return select(pow((c + 0.055) / 1.055, vec3<f32>(2.4)), c / 12.92, c <= vec3<f32>(0.04045));
}

fn srgb_from_linear(c: vec3<f32>) -> vec3<f32> {
    let bounded = clamp(c, vec3<f32>(0.0), vec3<f32>(1.0));
    return select(1.055 * pow(bounded, vec3<f32>(1.0 / 2.4)) - 0.055, bounded * 12.92, bounded <= vec3<f32>(0.0031308));
}

// The instance's colour, with what the picture's style lays over it; linear.
fn color_of(instance: Instance) -> vec3<f32> {
    var color = instance.color.rgb;
    if instance.body < arrayLength(&colors) {
        let over = unpack4x8unorm(colors[instance.body]);
        color = mix(color, over.rgb, over.a);
    }
    return linear_from_srgb(color);
}

// The background in this direction, linear.
fn sky(direction: vec3<f32>) -> vec3<f32> {
    let horizon = vec3<f32>(0.78, 0.83, 0.88);
    let above = mix(horizon, vec3<f32>(0.30, 0.44, 0.64), smoothstep(0.0, 0.9, direction.y));
    return mix(above, vec3<f32>(0.42, 0.44, 0.47), smoothstep(0.0, 0.9, -direction.y));
}

// How much of the key light arrives, 0 to 1.
fn lit(position: vec3<f32>, normal: vec3<f32>) -> f32 {
    if (frame.flags & SHADOWS) == 0u {
        return 1.0;
    }
    // Off the surface, so that it does not shade itself.
    let place = position + frame.texel * (2.0 * normal + frame.light);
    let clip = (frame.shadow_projection * vec4<f32>(place, 1.0)).xyz;
    let far = max(abs(clip.x), abs(clip.y));
    if far >= 1.0 || clip.z <= 0.0 || clip.z >= 1.0 {
        return 1.0;
    }
    let uv = vec2<f32>(0.5 + 0.5 * clip.x, 0.5 - 0.5 * clip.y);
    let step = 1.5 / vec2<f32>(textureDimensions(shadow_map));
    var sum = textureSampleCompareLevel(shadow_map, shadow_sampler, uv, clip.z);
    sum += textureSampleCompareLevel(shadow_map, shadow_sampler, uv + step * vec2<f32>(0.4, 0.9), clip.z);
    sum += textureSampleCompareLevel(shadow_map, shadow_sampler, uv + step * vec2<f32>(-0.9, 0.4), clip.z);
    sum += textureSampleCompareLevel(shadow_map, shadow_sampler, uv + step * vec2<f32>(-0.4, -0.9), clip.z);
    sum += textureSampleCompareLevel(shadow_map, shadow_sampler, uv + step * vec2<f32>(0.9, -0.4), clip.z);
    // The map's end is no edge of a shadow.
    return mix(sum / 5.0, 1.0, smoothstep(0.8, 1.0, far));
}

// Light that leaves a surface of this colour towards the eye, linear.
fn shade(color: vec3<f32>, normal: vec3<f32>, position: vec3<f32>, gloss: f32) -> vec3<f32> {
    let to_eye = normalize(frame.eye - position);
    let cosine = max(dot(normal, frame.light), 0.0);
    var key = 0.0;
    if cosine > 0.0 {
        key = cosine * lit(position, normal);
    }
    let around = mix(vec3<f32>(0.20, 0.185, 0.17), vec3<f32>(0.40, 0.44, 0.50), 0.5 + 0.5 * normal.y);
    let half_way = normalize(frame.light + to_eye);
    let shine = gloss * key * pow(max(dot(normal, half_way), 0.0), 40.0);
    return color * (around + key * vec3<f32>(0.86, 0.82, 0.75)) + vec3<f32>(shine);
}

// As the picture stores it: bright parts bend towards white instead of being cut.
fn finish(color: vec3<f32>) -> vec3<f32> {
    let over = max(color - vec3<f32>(0.7), vec3<f32>(0.0));
    let soft = min(color, vec3<f32>(0.7)) + 0.3 * (vec3<f32>(1.0) - exp(-over / 0.3));
    if (frame.flags & ENCODE) != 0u {
        return srgb_from_linear(soft);
    }
    return soft;
}
