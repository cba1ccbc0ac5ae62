// A contact that hardly moved is not found anew: its normal, arms and features stay, only the gaps follow the bodies.
// No pass, no binding. Twin of crates/cpu/src/narrowphase/recycle.rs.

//#import shared/couple.wgsl
//#import shared/manifold.wgsl
//#import shared/math.wgsl

// Square of the sine of half the angle that either body may turn: 11.5 degrees.
const TURN: f32 = 0.01;

// The manifold found earlier with this step's gaps; without points if the two have moved against each other since.
fn recycle(couple: Couple, found: FoundManifold) -> Manifold {
    var manifold = found.manifold;
    if manifold.count < 4u {
        return Manifold();
    }
    // Turns since then, in the world's axes.
    let da = multiply(couple.a.body_rotation, conjugate(found.rotation_a));
    let db = multiply(couple.b.body_rotation, conjugate(found.rotation_b));
    if dot(da.xyz, da.xyz) > TURN || dot(db.xyz, db.xyz) > TURN {
        return Manifold();
    }
    let now = couple.b.center;
    let then = manifold.between;
    let drift = length(rotate_back(da, now) - then);
    let twist = 2.0 * length(multiply(conjugate(da), db).xyz);
    let arm = max(max_element(couple.a.size), max_element(couple.b.size));
    if drift + twist * arm > recycle_distance(couple) {
        return Manifold();
    }
    for (var i = 0u; i < min(manifold.count, 4u); i++) {
        let ra = manifold.points[i].anchor;
        let rb = ra - then;
        let moved = (now - then) + (rotate(db, rb) - rb) - (rotate(da, ra) - ra);
        manifold.points[i].separation += dot(manifold.normal, moved);
    }
    manifold.recycled = 1u;
    return manifold;
}
