//! The CPU's narrow phase against parry 0.31: how far apart two shapes are, which way and where. The GPU is compared with
//! the CPU elsewhere (`parity_narrowphase`).

#[path = "common/parry_shapes.rs"]
mod parry_shapes;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use bytemuck::Zeroable;
use parry_shapes::shape_of;
use parry3d::math::Pose as ParryPose;
use parry3d::query::{ClosestPoints, Contact, closest_points, contact, distance};
use parry3d::shape::Shape;
use random::Random;
use tumble_core::Params;
use tumble_core::glam::{DVec3, Quat, Vec3};
use tumble_core::layout::*;
use tumble_core::measures::{DPose, cuboid_cuboid_separation};
use tumble_cpu::contact::kind_of;
use tumble_cpu::narrowphase;

const PAIRS: usize = 10_000;

/// Speculative distance, m: so small that preferences among axes and points, which are shares of it, hardly show.
const DISTANCE: f32 = 1e-4;

/// Two bodies with a collider each, off their centres of mass.
struct Two {
    states: [BodyState; 2],
    colliders: [Collider; 2],
    step: StepParams,
}

/// One point of a manifold in the world.
struct Point {
    separation: f64,
    /// On the first shape, midway, on the second.
    on: [DVec3; 3],
}

impl Two {
    /// Shapes of 0.1 to 0.6 m whose middles are up to 1.2 m apart along each axis, flying towards each other so fast
    /// that most are near enough for a contact.
    fn new(shapes: [u32; 2], random: &mut Random) -> Self {
        let step = Params { speculative_distance: DISTANCE, ..Params::default() }.step_params(1, Vec3::ZERO);
        let mut colliders = [0, 1].map(|i| random.collider(shapes[i as usize], i));
        let mut states = [0, 1].map(|_| BodyState {
            position: random.vector(0.6).to_array(),
            rotation: random.rotation().to_array(),
            flags: body_flags::DYNAMIC,
            ..BodyState::zeroed()
        });
        for collider in &mut colliders {
            collider.rotation = random.rotation().to_array();
        }
        let way = Vec3::from_array(states[1].position) - Vec3::from_array(states[0].position);
        let towards = if shapes[1] == shape_kind::HALFSPACE { way } else { way.normalize() };
        states[1].linear_velocity = (-60.0 * towards).to_array();
        Self { states, colliders, step }
    }

    /// The same with the other one first.
    fn swapped(&self) -> Self {
        let [a, b] = self.colliders;
        let colliders = [Collider { body: 0, ..b }, Collider { body: 1, ..a }];
        Self { states: [self.states[1], self.states[0]], colliders, step: self.step }
    }

    fn manifold(&self) -> Manifold {
        let kind = kind_of(self.colliders[0].shape, self.colliders[1].shape) | pair_kind::FRESH;
        let pair = Pair { a: 0, b: 1, slot: 0, kind };
        narrowphase::collide(&pair, &self.colliders, &self.states, &FoundManifold::zeroed(), &self.step)
    }

    fn points(&self, manifold: &Manifold) -> Vec<Point> {
        let origin = Vec3::from_array(self.states[0].position).as_dvec3();
        let normal = Vec3::from_array(manifold.normal).as_dvec3();
        let points = manifold.points[..manifold.count as usize].iter();
        points
            .map(|point| {
                let middle = origin + Vec3::from_array(point.anchor).as_dvec3();
                let separation = f64::from(point.separation);
                let half = normal * (0.5 * separation);
                Point { separation, on: [middle - half, middle, middle + half] }
            })
            .collect()
    }

    /// Where the collider is, in f64, and as parry takes it.
    fn pose(&self, i: usize) -> (DPose, ParryPose) {
        let (state, collider) = (&self.states[i], &self.colliders[i]);
        let rotation = Quat::from_array(state.rotation).as_dquat().normalize();
        let own = Quat::from_array(collider.rotation).as_dquat().normalize();
        let offset = rotation * Vec3::from_array(collider.position).as_dvec3();
        let pose = DPose::new(Vec3::from_array(state.position).as_dvec3() + offset, rotation * own);
        (pose, ParryPose::from_parts(pose.translation.as_vec3(), pose.rotation.as_quat()))
    }

    fn shape(&self, i: usize) -> Box<dyn Shape> {
        shape_of(&self.colliders[i]).unwrap()
    }

    fn half(&self, i: usize) -> DVec3 {
        Vec3::from_array(self.colliders[i].size).as_dvec3()
    }

    fn parry_distance(&self) -> f64 {
        distance(&self.pose(0).1, &*self.shape(0), &self.pose(1).1, &*self.shape(1)).unwrap().distance.into()
    }

    /// With the half-space first always: parry 0.31 forgets to invert the relative pose when it comes second.
    fn parry_contact(&self) -> Contact {
        let ask = |i: usize, j: usize| {
            let found = contact(&self.pose(i).1, &*self.shape(i), &self.pose(j).1, &*self.shape(j), 100.0);
            found.unwrap().expect("a contact however far")
        };
        if self.colliders[1].shape == shape_kind::HALFSPACE { ask(1, 0).flipped() } else { ask(0, 1) }
    }

    /// How far apart two cuboids are by their axes in f64, b moved by `way` first.
    fn axes(&self, way: DVec3) -> f64 {
        let (a, mut b) = (self.pose(0).0, self.pose(1).0);
        b.translation += way;
        cuboid_cuboid_separation(self.half(0), a, self.half(1), b)
    }

    /// Nearest that any contact of the two must be kept: the least reach of a manifold of this normal.
    fn reach(&self, normal: DVec3) -> f64 {
        let way = Vec3::from_array(self.states[1].linear_velocity) - Vec3::from_array(self.states[0].linear_velocity);
        let closing = (-normal.dot(way.as_dvec3())).max(0.0) * f64::from(self.step.dt);
        f64::from(self.step.speculative_distance) + closing
    }
}

/// Of each quantity the value that came nearest to what it may be, and that.
struct Worst {
    what: &'static str,
    of: Vec<(&'static str, f64, f64)>,
}

impl Worst {
    fn see(&mut self, name: &'static str, value: f64, most: f64) {
        assert!(value <= most, "{}: {name}: {value:e}, allowed {most:e}", self.what);
        match self.of.iter_mut().find(|(known, ..)| *known == name) {
            Some(entry) if value / most <= entry.1 / entry.2 => {}
            Some(entry) => *entry = (name, value, most),
            None => self.of.push((name, value, most)),
        }
    }
}

impl Drop for Worst {
    fn drop(&mut self) {
        for (name, value, most) in &self.of {
            println!("{:>18}: {name:<24} {value:9.2e} of {most:7.0e}", self.what);
        }
    }
}

// All in f32, on either side, of numbers up to 2 m: beside each tolerance is the largest difference measured.
const SEPARATION: f64 = 5e-6; // 1.2e-6 m
const NORMAL: f64 = 5e-5; // 9.2e-6; the normal of a ball that is hardly outside is the most uncertain
const POINT: f64 = 1e-5; // 2.5e-6 m

/// Pairs with a ball have one point, which parry finds by the same exact formulas.
fn balls(what: &'static str, shapes: [u32; 2], seed: u64) {
    let mut worst = Worst { what, of: Vec::new() };
    let mut random = Random::new(seed);
    let (mut compared, mut overlapping) = (0, 0);
    while compared < PAIRS {
        let straight = Two::new(shapes, &mut random);
        for two in [straight.swapped(), straight] {
            let expected = two.parry_contact();
            let (manifold, dist) = (two.manifold(), f64::from(expected.dist));
            let normal = expected.normal1.as_dvec3();
            let Some(point) = two.points(&manifold).pop() else {
                assert!(dist > two.reach(normal) - 1e-5, "{what}: no point at a gap of {dist}");
                continue;
            };
            assert_eq!(manifold.count, 1);
            assert!(dist < two.reach(normal) + 1e-5, "{what}: a point at a gap of {dist}");
            compared += 1;
            overlapping += usize::from(dist < 0.0);
            worst.see("separation", (point.separation - dist).abs(), SEPARATION);
            worst.see("distance", (point.separation.max(0.0) - two.parry_distance()).abs(), SEPARATION);
            // A ball whose middle is equally far from two faces, or hardly inside, may leave by either.
            if two.is_ambiguous() {
                continue;
            }
            worst.see("normal", Vec3::from_array(manifold.normal).as_dvec3().distance(normal), NORMAL);
            worst.see("point on the first", point.on[0].distance(expected.point1.as_dvec3()), POINT);
            worst.see("point on the second", point.on[2].distance(expected.point2.as_dvec3()), POINT);
            let closest =
                closest_points(&two.pose(0).1, &*two.shape(0), &two.pose(1).1, &*two.shape(1), 100.0).unwrap();
            if let ClosestPoints::WithinMargin(first, second) = closest {
                let middle = 0.5 * (first + second).as_dvec3();
                worst.see("middle of the closest", point.on[1].distance(middle), POINT);
            }
        }
    }
    assert!(overlapping > PAIRS / 5 && overlapping < PAIRS * 9 / 10, "{what}: {overlapping} overlap");
}

impl Two {
    /// Whether a ball and a cuboid have no one nearest face or point.
    fn is_ambiguous(&self) -> bool {
        let Some(cuboid) = self.colliders.iter().position(|c| c.shape == shape_kind::CUBOID) else { return false };
        if self.colliders[1 - cuboid].shape != shape_kind::BALL {
            return false;
        }
        let (pose, ball) = (self.pose(cuboid).0, self.pose(1 - cuboid).0.translation);
        let outside = (pose.rotation.inverse() * (ball - pose.translation)).abs() - self.half(cuboid);
        let mut sorted = outside.to_array();
        sorted.sort_by(f64::total_cmp);
        outside.max_element().abs() < 1e-4 || (outside.max_element() < 0.0 && sorted[2] - sorted[1] < 1e-5)
    }
}

/// Oracle: parry.
#[test]
fn ball_and_ball() {
    balls("ball-ball", [shape_kind::BALL, shape_kind::BALL], 11);
}

/// Oracle: parry.
#[test]
fn ball_and_cuboid() {
    balls("ball-cuboid", [shape_kind::BALL, shape_kind::CUBOID], 12);
}

/// Oracle: parry.
#[test]
fn ball_and_halfspace() {
    balls("ball-halfspace", [shape_kind::BALL, shape_kind::HALFSPACE], 13);
}

/// Oracle: parry. Of the corners that are near enough, four at most, and the deepest of them.
#[test]
fn cuboid_and_halfspace() {
    let mut worst = Worst { what: "cuboid-halfspace", of: Vec::new() };
    let mut random = Random::new(15);
    let (mut compared, mut overlapping, mut all_corners) = (0, 0, 0);
    while compared < PAIRS {
        let straight = Two::new([shape_kind::CUBOID, shape_kind::HALFSPACE], &mut random);
        for two in [straight.swapped(), straight] {
            let expected = two.parry_contact();
            let (manifold, dist) = (two.manifold(), f64::from(expected.dist));
            let (points, normal) = (two.points(&manifold), expected.normal1.as_dvec3());
            let cuboid = usize::from(two.colliders[0].shape == shape_kind::HALFSPACE);
            let (pose, half, plane) = (two.pose(cuboid).0, two.half(cuboid), two.pose(1 - cuboid).0);
            let outward = plane.rotation * DVec3::Y;
            // Points that may come to touch while the manifold is recycled are kept too.
            let reach = two.reach(normal) + f64::from(narrowphase::recycle::SHARE) * half.min_element();
            let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|k| {
                let sign = DVec3::from_array([0, 1, 2].map(|axis| if k >> axis & 1 == 0 { -1.0 } else { 1.0 }));
                pose.translation + pose.rotation * (sign * half)
            });
            let heights = corners.map(|corner| outward.dot(corner - plane.translation));
            let near = heights.iter().filter(|&&height| height <= reach).count();
            let tie = heights.iter().any(|height| (height - reach).abs() < 1e-5);
            if !tie {
                let (least, most) = if near > 4 { (2, 4) } else { (near, near) };
                assert!((least..=most).contains(&points.len()), "{} of {near} corners", points.len());
            }
            if points.is_empty() {
                continue;
            }
            compared += 1;
            overlapping += usize::from(dist < 0.0);
            all_corners += usize::from(near > 4);
            worst.see("normal", Vec3::from_array(manifold.normal).as_dvec3().distance(normal), NORMAL);
            for point in &points {
                let (on_cuboid, on_plane) = (point.on[2 * cuboid], point.on[2 - 2 * cuboid]);
                let corner = corners.iter().map(|corner| corner.distance(on_cuboid)).fold(f64::INFINITY, f64::min);
                worst.see("point on the cuboid", corner, POINT);
                worst.see("point on the plane", outward.dot(on_plane - plane.translation).abs(), POINT);
            }
            let deepest = points.iter().min_by(|a, b| a.separation.total_cmp(&b.separation)).unwrap();
            if near <= 4 {
                worst.see("separation", (deepest.separation - dist).abs(), SEPARATION);
                worst.see("distance", (deepest.separation.max(0.0) - two.parry_distance()).abs(), SEPARATION);
            }
            worst.see("deepest of many", (deepest.separation - dist).abs(), nearly_deepest(dist));
        }
    }
    assert!(overlapping > PAIRS / 5 && overlapping < PAIRS * 9 / 10, "{overlapping} overlap");
    assert!(all_corners > PAIRS / 5, "{all_corners} had a choice of corners");
}

/// Of more than four points, the first is kept whose depth is that of the deepest within a quarter of the speculative
/// distance and a thousandth (`clip::reduce`): so much may be missing.
fn nearly_deepest(separation: f64) -> f64 {
    SEPARATION + 0.25 * f64::from(DISTANCE) + 1e-3 * separation.abs()
}

/// By how much the axis that was taken may show a smaller gap than the best one: faces go before edges by a share of
/// the speculative distance that is below a half (`cuboid_cuboid::collide`).
const PREFERENCE: f64 = 0.5 * DISTANCE as f64;

/// An axis that shows all of the distance but so much, m, is taken for the direction of the nearest points: parry's own
/// error is some 1e-6.
const TIE: f64 = 1e-5;
/// What is nearest may then lie beyond the face's rim, by up to sqrt(2 TIE distance), some 4 mm, and the clipped face
/// is farther off there: 0.63 mm were measured.
const GAP: f64 = 1.5e-3;

impl Two {
    /// How far a point is from a shape's surface, by parry.
    fn off_surface(&self, i: usize, point: DVec3) -> f64 {
        let found = self.shape(i).project_point(&self.pose(i).1, point.as_vec3(), false);
        found.point.as_dvec3().distance(point)
    }

    /// The gap between two cuboids along a unit vector from a to b.
    fn gap_along(&self, normal: DVec3) -> f64 {
        let reach = |i: usize| (self.pose(i).0.rotation.inverse() * normal).abs().dot(self.half(i));
        normal.dot(self.pose(1).0.translation - self.pose(0).0.translation) - reach(0) - reach(1)
    }
}

/// Oracle: f64 separating axes for overlap, parry (its distance and nearest points, found by GJK) for gaps.
#[test]
fn cuboid_and_cuboid() {
    let mut worst = Worst { what: "cuboid-cuboid", of: Vec::new() };
    let mut random = Random::new(14);
    let (mut overlapping, mut apart, mut far_off, mut corners) = (0, 0, 0, 0);
    while overlapping < PAIRS || apart < PAIRS {
        let straight = Two::new([shape_kind::CUBOID; 2], &mut random);
        for two in [straight.swapped(), straight] {
            let depth = -two.axes(DVec3::ZERO);
            let manifold = two.manifold();
            let (points, normal) = (two.points(&manifold), Vec3::from_array(manifold.normal).as_dvec3());
            let deepest = points.iter().min_by(|a, b| a.separation.total_cmp(&b.separation));
            // One of a point's two is on its shape exactly; the other is there too, unless it lies on the rim of the
            // clip rectangle, which is 1 % wider than the face: half extents are up to 0.6 m.
            for point in &points {
                let off = [two.off_surface(0, point.on[0]), two.off_surface(1, point.on[2])];
                worst.see("nearer shape", off[0].min(off[1]), POINT);
                if manifold.count > 1 {
                    worst.see("farther shape", off[0].max(off[1]), 0.01 * 0.6 * 2f64.sqrt());
                }
            }
            if depth > 0.0 {
                overlapping += 1;
                let found = deepest.expect("a contact of two that overlap");
                worst.see("too deep", -found.separation - depth, SEPARATION + PREFERENCE);
                worst.see("too shallow", found.separation + depth, PREFERENCE + nearly_deepest(depth));
                // Moved out along the normal by the depth, the two just touch.
                worst.see("touching after", two.axes(normal * depth).abs(), SEPARATION + PREFERENCE);
                continue;
            }
            let (gap, distance) = (-depth, two.parry_distance());
            let (pose_a, pose_b) = (two.pose(0).1, two.pose(1).1);
            let nearest = closest_points(&pose_a, &*two.shape(0), &pose_b, &*two.shape(1), 100.0).unwrap();
            let ClosestPoints::WithinMargin(on_a, on_b) = nearest else { continue };
            if distance - gap > TIE {
                // Nearest at a corner or an edge whose direction is no axis: no one normal to compare with. The gap
                // along the normal is one that there is.
                corners += 1;
                if let Some(found) = deepest {
                    worst.see("corner, no gap", gap - found.separation, SEPARATION + PREFERENCE);
                }
                continue;
            }
            let way = (on_b - on_a).as_dvec3().normalize();
            let Some(found) = deepest else {
                assert!(distance > two.reach(way) - POINT, "no point at a gap of {distance}");
                continue;
            };
            apart += 1;
            worst.see("distance", (found.separation - distance).abs(), GAP);
            // The normal shows the distance: its cosine with the way between the nearest points is no less than the
            // ratio.
            let shown = two.gap_along(normal);
            worst.see("gap along the normal", (shown - distance).abs(), SEPARATION + PREFERENCE + TIE);
            let off = found.on[1].distance(0.5 * (on_a + on_b).as_dvec3());
            far_off += usize::from(off > 1e-3 || normal.distance(way) > 1e-3);
        }
    }
    // Where an edge is nearly parallel to what it is nearest to, a rounding decides which end that is, and an axis that
    // is as good may be another one.
    println!("{overlapping} overlap, {apart} apart, {corners} by a corner, {far_off} of uncertain place or normal");
    assert!(far_off < apart / 50, "{far_off} of {apart} contacts are not where parry's nearest points are");
}
