// Ball against half-space. One thread a pair; reads and writes: shared/narrowphase.wgsl. Twin of
// crates/cpu/src/narrowphase/ball_halfspace.rs.

//#import shared/narrowphase.wgsl

@compute @workgroup_size(256)
fn collide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let mine = is_mine(i, PAIR_BALL_HALFSPACE);
    var manifold: Manifold;
    if mine {
        let couple = couple_of(i);
        manifold = manifold_of(couple, swapped(i));
        manifold.between = couple.b.center;
    }
    finish(i, local_index(lid), mine, manifold);
}

// One point below the ball. `is_swapped`: the half-space comes first.
fn manifold_of(pair: Couple, is_swapped: bool) -> Manifold {
    // From here on a is the half-space.
    var couple = pair;
    if !is_swapped {
        couple = swap(pair);
    }
    let plane = couple.a;
    let ball = couple.b;
    let normal = rotate(plane.rotation, vec3<f32>(0.0, 1.0, 0.0));
    let height = dot(normal, ball.position - plane.position);
    let separation = height - ball.size.x;
    let point = ball.position - normal * (ball.size.x + 0.5 * separation);
    let manifold = single(couple, normal, point, separation);
    if is_swapped {
        return manifold;
    }
    return flip(manifold);
}
