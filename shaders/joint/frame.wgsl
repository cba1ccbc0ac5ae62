// Where a joint's bodies are against each other: its axes and coordinates. Twin of crates/cpu/src/joint/frame.rs, which
// says what the coordinates are. No pass, no binding.

//#import shared/joint.wgsl
//#import shared/math.wgsl

// The rows along (0) or about (1) that something may act on, a bit a row; what has none is left out everywhere.
fn rows_in_use(axes: u32, which: u32) -> u32 {
    return ((axes >> (JOINT_LOCKED + 3u * which)) | (axes >> (JOINT_DRIVEN + 3u * which))) & 7u;
}

// The blocks that have rows: bit 0 along, bit 1 about. (Loops go through such bits and not from 0 to 2, since compilers would
// write each turn of those out.)
fn blocks_in_use(axes: u32) -> u32 {
    return u32(rows_in_use(axes, 0u) != 0u) | (u32(rows_in_use(axes, 1u) != 0u) << 1u);
}

// Shorter distances of the anchors have no direction, m.
const SHORTEST: f32 = 1e-9;

// Axes as columns, and the coordinates along or about them.
struct JointAxes {
    axes: mat3x3<f32>,
    coordinates: vec3<f32>,
}

// A joint between two poses.
struct JointFrame {
    arm_a: vec3<f32>,
    arm_b: vec3<f32>,
    along: JointAxes,
    about: JointAxes,
}

fn unit_axis(axis: u32) -> vec3<f32> {
    return vec3<f32>(f32(axis == 0u), f32(axis == 1u), f32(axis == 2u));
}

// The joint's frame; `between` leads from the first body's centre of mass to the second one's.
fn joint_frame(joint: Joint, rotation_a: vec4<f32>, rotation_b: vec4<f32>, between: vec3<f32>) -> JointFrame {
    let qa = multiply(rotation_a, joint.rotation_a);
    let qb = multiply(rotation_b, joint.rotation_b);
    let to_a = rotate(rotation_a, joint.anchor_a);
    let arm_b = rotate(rotation_b, joint.anchor_b);
    let offset = between + (arm_b - to_a);
    var found: JointFrame;
    found.arm_a = to_a + offset;
    found.arm_b = arm_b;
    if rows_in_use(joint.axes, 0u) != 0u {
        found.along = axes_along(joint.axes, joint.flags, qa, offset);
    }
    if rows_in_use(joint.axes, 1u) != 0u {
        found.about = axes_about(joint.axes, qa, qb);
    }
    return found;
}

fn axes_along(axes: u32, flags: u32, qa: vec4<f32>, offset: vec3<f32>) -> JointAxes {
    if (flags & JOINT_COUPLED) != 0u {
        let distance = sqrt(dot(offset, offset));
        var axis = rotate(qa, vec3<f32>(1.0, 0.0, 0.0));
        if distance > SHORTEST {
            axis = offset / distance;
        }
        return JointAxes(mat3x3<f32>(axis, vec3<f32>(), vec3<f32>()), vec3<f32>(distance, 0.0, 0.0));
    }
    if ((axes >> JOINT_LOCKED) & 7u) == 7u {
        return JointAxes(
            mat3x3<f32>(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0)),
            offset,
        );
    }
    let turned = mat3_from_quat(qa);
    return JointAxes(turned, transpose(turned) * offset);
}

fn axes_about(axes: u32, qa: vec4<f32>, qb: vec4<f32>) -> JointAxes {
    var between = multiply(conjugate(qa), qb);
    if between.w < 0.0 {
        between = -between;
    }
    let locked = (axes >> (JOINT_LOCKED + 3u)) & 7u;
    let count = countOneBits(locked);
    if count == 2u {
        return hinge(firstTrailingBit(7u & ~locked), qa, between);
    }
    if count == 1u {
        return universal(firstTrailingBit(locked), qa, qb, between);
    }
    return rotation_vector(qa, between);
}

fn hinge(axis: u32, qa: vec4<f32>, between: vec4<f32>) -> JointAxes {
    let unit = unit_axis(axis);
    var turned = cross(unit, rotate(between, unit));
    turned[axis] = 2.0 * arc_tangent(dot(between.xyz, unit), between.w);
    return JointAxes(mat3_from_quat(qa), turned);
}

fn universal(locked: u32, qa: vec4<f32>, qb: vec4<f32>, between: vec4<f32>) -> JointAxes {
    let j = (locked + 1u) % 3u;
    let k = (locked + 2u) % 3u;
    let unit_j = unit_axis(j);
    let unit_k = unit_axis(k);
    let unit_locked = unit_axis(locked);
    let second = rotate(between, unit_k);
    let first = rotate_back(between, unit_j);
    var turned: vec3<f32>;
    turned[j] = arc_tangent(dot(second, unit_locked), dot(second, unit_k));
    turned[k] = arc_tangent(dot(first, unit_locked), dot(first, unit_j));
    turned[locked] = -dot(second, unit_j);
    let axis_j = rotate(qa, unit_j);
    let axis_k = rotate(qb, unit_k);
    let across = cross(axis_j, axis_k);
    let length = sqrt(dot(across, across));
    var axis_locked = rotate(qa, unit_locked);
    if length > 1e-3 {
        axis_locked = across / length;
    }
    var axes: mat3x3<f32>;
    axes[j] = axis_j;
    axes[k] = axis_k;
    axes[locked] = axis_locked;
    return JointAxes(axes, turned);
}

fn rotation_vector(qa: vec4<f32>, between: vec4<f32>) -> JointAxes {
    let sine = sqrt(dot(between.xyz, between.xyz));
    let half = arc_tangent(sine, between.w);
    var ratio = 2.0 + sine * sine / 3.0;
    if sine >= 1e-2 {
        ratio = 2.0 * half / sine;
    }
    let turned = between.xyz * ratio;
    let square = dot(turned, turned);
    var share = 1.0 / 12.0 + square / 720.0;
    if sine >= 1e-2 {
        share = (1.0 - half * between.w / sine) / square;
    }
    var axes: mat3x3<f32>;
    for (var column = 0u; column < 3u; column++) {
        let unit = unit_axis(column);
        let once = cross(turned, unit);
        axes[column] = rotate(qa, unit + 0.5 * once + share * cross(turned, once));
    }
    return JointAxes(axes, turned);
}

// The angle of the point (x, y), in (-pi, pi]. Polynomial of Cephes' `atanf` (Moshier, 1984).
fn arc_tangent(y: f32, x: f32) -> f32 {
    let low = min(abs(x), abs(y));
    let high = max(abs(x), abs(y));
    if high == 0.0 {
        return 0.0;
    }
    let ratio = low / high;
    let far = ratio > 0.41421357;
    let t = select(ratio, (ratio - 1.0) / (ratio + 1.0), far);
    let z = t * t;
    let series = ((0.080537446 * z - 0.13877686) * z + 0.1997771) * z - 0.3333295;
    var angle = series * z * t + t;
    angle = select(angle, angle + 0.7853982, far);
    angle = select(angle, 1.5707964 - angle, abs(y) > abs(x));
    angle = select(angle, 3.1415927 - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}
