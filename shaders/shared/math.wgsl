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

// The rotation that does b, then a. The order of the sums is glam's.
fn multiply(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
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
