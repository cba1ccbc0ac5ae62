// Quaternions (x y z w, unit), symmetric matrices, and whether a float is one. No pass, no binding.

// Rotates v by q.
fn rotate(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

// The rotation that does the opposite of q.
fn conjugate(q: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(-q.xyz, q.w);
}

// Rotates v by the inverse of q.
fn rotate_back(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    return rotate(conjugate(q), v);
}

// The rotation that does b, then a. Grouped like glam's sums, which are made in vector registers.
fn multiply(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(
        (a.w * b.x + a.x * b.w) + (a.y * b.z - a.z * b.y),
        (a.w * b.y - a.x * b.z) + (a.y * b.w + a.z * b.x),
        (a.w * b.z + a.x * b.y) + (a.z * b.w - a.y * b.x),
        (a.w * b.w - a.x * b.x) + (-(a.y * b.y) - a.z * b.z),
    );
}

// q made unit, in glam's order.
fn unit(q: vec4<f32>) -> vec4<f32> {
    return q / sqrt((q.x * q.x + q.z * q.z) + (q.y * q.y + q.w * q.w));
}

// The turn of a unit quaternion as its axis times its angle, of no more than pi, rad. The tangent of a sixteenth of it is
// found by halves, and the angle from that by the arc tangent's series: WGSL promises its own to 4,096 last bits only.
fn scaled_axis(q: vec4<f32>) -> vec3<f32> {
    let axis = select(q.xyz, -q.xyz, q.w < 0.0);
    let sine = dot(axis, axis);
    // Each scale times the length of `axis` is a tangent: of a quarter, an eighth, a sixteenth of the angle.
    let quarter = 1.0 / (1.0 + abs(q.w));
    let eighth = quarter / (1.0 + sqrt(1.0 + sine * quarter * quarter));
    let sixteenth = eighth / (1.0 + sqrt(1.0 + sine * eighth * eighth));
    let s = sine * sixteenth * sixteenth;
    let series = 1.0 - s * (1.0 / 3.0 - s * (1.0 / 5.0 - s * (1.0 / 7.0 - s * (1.0 / 9.0 - s * (1.0 / 11.0)))));
    return axis * (16.0 * sixteenth * series);
}

// The matrix of a rotation: its columns are where the axes go.
fn mat3_from_quat(q: vec4<f32>) -> mat3x3<f32> {
    let x2 = q.x + q.x;
    let y2 = q.y + q.y;
    let z2 = q.z + q.z;
    let xx = q.x * x2;
    let xy = q.x * y2;
    let xz = q.x * z2;
    let yy = q.y * y2;
    let yz = q.y * z2;
    let zz = q.z * z2;
    let wx = q.w * x2;
    let wy = q.w * y2;
    let wz = q.w * z2;
    return mat3x3<f32>(
        vec3<f32>(1.0 - (yy + zz), xy + wz, xz - wy),
        vec3<f32>(xy - wz, 1.0 - (xx + zz), yz + wx),
        vec3<f32>(xz + wy, yz - wx, 1.0 - (xx + yy)),
    );
}

// The inverse of the inertia of a body that is held about the locked axes of the world, from its principal moments: that
// of the rows and columns that are left, the others zero.
fn held_inverse_inertia(rotation: vec4<f32>, inertia: vec3<f32>, locked: vec3<bool>) -> mat3x3<f32> {
    // Over the largest moment, so that no product leaves the range of floats.
    let largest = max(inertia.x, max(inertia.y, inertia.z));
    let r = mat3_from_quat(rotation);
    let x = r[0] * (inertia.x / largest);
    let y = r[1] * (inertia.y / largest);
    let z = r[2] * (inertia.z / largest);
    let free = select(vec3<f32>(1.0), vec3<f32>(), locked);
    // A locked axis has a moment of its own, and no product with the others.
    let d = select(x * r[0] + y * r[1] + z * r[2], vec3<f32>(1.0), locked);
    let o = (x.xxy * r[0].yzz + y.xxy * r[1].yzz + z.xxy * r[2].yzz) * free.xxy * free.yzz;
    let xx = d.y * d.z - o.z * o.z;
    let yy = d.x * d.z - o.y * o.y;
    let zz = d.x * d.y - o.x * o.x;
    let xy = o.y * o.z - o.x * d.z;
    let xz = o.x * o.z - o.y * d.y;
    let yz = o.x * o.y - o.z * d.x;
    let scale = 1.0 / ((d.x * xx + o.x * xy + o.y * xz) * largest);
    return mat3x3<f32>(
        vec3<f32>(xx * free.x, xy, xz) * scale,
        vec3<f32>(xy, yy * free.y, yz) * scale,
        vec3<f32>(xz, yz, zz * free.z) * scale,
    );
}

// The symmetric matrix with this diagonal (xx yy zz) and these entries off it (xy xz yz), times v.
fn symmetric_times(diagonal: vec3<f32>, off: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        diagonal.x * v.x + off.x * v.y + off.y * v.z,
        off.x * v.x + diagonal.y * v.y + off.z * v.z,
        off.y * v.x + off.z * v.y + diagonal.z * v.z,
    );
}

// False for infinities and NaN, told by the exponent's bits: a compiler may assume that floats are finite, and drop
// a comparison of floats.
fn is_finite_bits(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn is_finite3(v: vec3<f32>) -> bool {
    return is_finite_bits(v.x) && is_finite_bits(v.y) && is_finite_bits(v.z);
}

fn is_finite4(v: vec4<f32>) -> bool {
    return is_finite3(v.xyz) && is_finite_bits(v.w);
}

// Two unit vectors that make a frame with `n`, as columns. They jump where |n.x| passes 0.577, far from the axes along
// which contacts mostly lie, so that a resting contact keeps its frame.
fn tangents(n: vec3<f32>) -> mat2x3<f32> {
    var t = vec3<f32>(n.y, -n.x, 0.0);
    if abs(n.x) < 0.5773503 {
        t = vec3<f32>(0.0, n.z, -n.y);
    }
    t = t * (1.0 / sqrt(dot(t, t)));
    return mat2x3<f32>(t, cross(n, t));
}

fn min_element(v: vec3<f32>) -> f32 {
    return min(v.x, min(v.y, v.z));
}

fn max_element(v: vec3<f32>) -> f32 {
    return max(v.x, max(v.y, v.z));
}
