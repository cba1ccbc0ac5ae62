// Ball against ball. One thread a pair; reads and writes: shared/narrowphase.wgsl. Twin of
// crates/cpu/src/narrowphase/ball_ball.rs.

//#import shared/narrowphase.wgsl

@compute @workgroup_size(256)
fn collide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let mine = is_mine(i, PAIR_BALL_BALL);
    var manifold: Manifold;
    if mine {
        let couple = couple_of(i);
        manifold = manifold_of(couple);
        manifold.between = couple.b.center;
    }
    finish(i, local_index(lid), mine, manifold);
}

// One point midway between the surfaces. Balls at one place are pushed apart along y.
fn manifold_of(couple: Couple) -> Manifold {
    let a = couple.a;
    let b = couple.b;
    let between = b.position - a.position;
    let distance = length(between);
    var normal = vec3<f32>(0.0, 1.0, 0.0);
    if distance > 1e-9 {
        normal = between / distance;
    }
    let separation = distance - a.size.x - b.size.x;
    return single(couple, normal, a.position + normal * (a.size.x + 0.5 * separation), separation);
}
