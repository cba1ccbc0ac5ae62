// Ball against cuboid. One thread a pair; reads and writes: shared/narrowphase.wgsl. Twin of
// crates/cpu/src/narrowphase/ball_cuboid.rs.

//#import shared/narrowphase.wgsl

@compute @workgroup_size(256)
fn collide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let mine = is_mine(i, PAIR_BALL_CUBOID);
    var manifold: Manifold;
    if mine {
        let couple = couple_of(i);
        manifold = manifold_of(couple, swapped(i));
        manifold.between = couple.b.center;
    }
    finish(i, local_index(lid), mine, manifold);
}

// One point. Outside, the cuboid's nearest point decides the normal; inside, its nearest face. `is_swapped`: the cuboid
// comes first.
fn manifold_of(pair: Couple, is_swapped: bool) -> Manifold {
    // From here on a is the cuboid.
    var couple = pair;
    if !is_swapped {
        couple = swap(pair);
    }
    let cuboid = couple.a;
    let ball = couple.b;
    let local = rotate_back(cuboid.rotation, ball.position - cuboid.position);
    let nearest = min(max(local, -cuboid.size), cuboid.size);
    let out = local - nearest;
    let distance = length(out);
    var face = nearest_face(local, cuboid.size);
    if distance > 1e-7 {
        face = Face(out / distance, distance);
    }
    let normal = rotate(cuboid.rotation, face.normal);
    let separation = face.depth - ball.size.x;
    let point = ball.position - normal * (ball.size.x + 0.5 * separation);
    let manifold = single(couple, normal, point, separation);
    if is_swapped {
        return manifold;
    }
    return flip(manifold);
}

struct Face {
    normal: vec3<f32>, // outward
    depth: f32, // negative inside
}

// The face nearest to a point inside.
fn nearest_face(local: vec3<f32>, size: vec3<f32>) -> Face {
    let gap = size - abs(local);
    let side = select(vec3<f32>(1.0), vec3<f32>(-1.0), local < vec3<f32>(0.0));
    if gap.x <= gap.y && gap.x <= gap.z {
        return Face(vec3<f32>(side.x, 0.0, 0.0), -gap.x);
    }
    if gap.y <= gap.z {
        return Face(vec3<f32>(0.0, side.y, 0.0), -gap.y);
    }
    return Face(vec3<f32>(0.0, 0.0, side.z), -gap.z);
}
