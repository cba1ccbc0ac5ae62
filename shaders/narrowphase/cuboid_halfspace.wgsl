// Cuboid against half-space. One thread a pair; reads and writes: shared/narrowphase.wgsl. Twin of
// crates/cpu/src/narrowphase/cuboid_halfspace.rs.

//#import shared/clip.wgsl
//#import shared/narrowphase.wgsl

@compute @workgroup_size(256)
fn collide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let mine = is_mine(i, PAIR_CUBOID_HALFSPACE);
    var manifold: Manifold;
    if mine {
        let couple = couple_of(i);
        manifold = recycled(i, couple);
        if manifold.count == 0u {
            manifold = manifold_of(couple, swapped(i));
            manifold.between = couple.b.center;
        }
    }
    finish(i, local_index(lid), mine, manifold);
}

// Up to four of the eight corners. `is_swapped`: the half-space comes first.
fn manifold_of(pair: Couple, is_swapped: bool) -> Manifold {
    // From here on a is the half-space.
    var couple = pair;
    if !is_swapped {
        couple = swap(pair);
    }
    let plane = couple.a;
    let cuboid = couple.b;
    let normal = rotate(plane.rotation, vec3<f32>(0.0, 1.0, 0.0));
    // Most cuboids that the broad phase offers to a slanted half-space are nowhere near it.
    let down = dot(abs(rotate_back(cuboid.rotation, normal)), cuboid.size);
    if dot(normal, cuboid.position - plane.position) - down > farthest(couple) {
        return Manifold();
    }
    // Points that may come to touch while the manifold is recycled.
    let spare = recycle_distance(couple);
    var corners: Candidates;
    for (var corner = 0u; corner < 8u; corner++) {
        let side = vec3<f32>((vec3<u32>(corner) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u)) * 2.0 - vec3<f32>(1.0);
        let at = cuboid.position + rotate(cuboid.rotation, side * cuboid.size);
        let separation = dot(normal, at - plane.position);
        let point = at - normal * (0.5 * separation);
        if separation <= reach(couple, point, normal) + spare {
            push(&corners, point, separation, corner);
        }
    }
    let manifold = reduce(&corners, normal, 0.25 * couple.distance);
    if is_swapped {
        return manifold;
    }
    return flip(manifold);
}
