//! The broad phase that a scene calls for. Oracle: `docs/broadphase.md`, whose table was measured.

use tumble_core::glam::Vec3;
use tumble_core::scenes::{Crowd, crowd};
use tumble_core::{Broadphase, ColliderBuilder, RigidBodyBuilder, Scene, Spread};

fn auto(scene: &Scene) -> Broadphase {
    Broadphase::Auto.resolve(&Spread::of(scene))
}

#[test]
fn crowds_get_what_suits_them() {
    use Broadphase::{BruteForce, Grid, Lbvh, SweepAndPrune};
    for kind in Crowd::ALL {
        for count in [0, 1, 50, 128] {
            assert_eq!(auto(&crowd(kind, count)), BruteForce, "{kind} of {count}");
        }
        let expected = match kind {
            Crowd::Line => [SweepAndPrune; 3],
            Crowd::OnePoint => [Grid; 3],
            Crowd::Ratio(1000.0) => [SweepAndPrune; 3],
            Crowd::Ratio(_) | Crowd::Liu => [SweepAndPrune, SweepAndPrune, Lbvh],
            Crowd::Clustered | Crowd::Plane | Crowd::Fast => [SweepAndPrune, SweepAndPrune, Grid],
            _ => [SweepAndPrune, Grid, Grid],
        };
        for (count, expected) in [1000, 10_000, 100_000].into_iter().zip(expected) {
            let scene = crowd(kind, count);
            println!("{kind} of {count}: {:?}", Spread::of(&scene));
            assert_eq!(auto(&scene), expected, "{kind} of {count}: {:?}", Spread::of(&scene));
        }
    }
}

#[test]
fn what_is_named_stands_for_itself() {
    for named in
        [Broadphase::BruteForce, Broadphase::Grid, Broadphase::SlicedGrid, Broadphase::Lbvh, Broadphase::SweepAndPrune]
    {
        for kind in Crowd::ALL {
            assert_eq!(named.resolve(&Spread::of(&crowd(kind, 300))), named);
        }
    }
}

/// Oracle: analysis.
#[test]
fn a_spread_is_what_it_says() {
    assert_eq!(Spread::of(&Scene::new()), Spread::default());
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    assert_eq!(Spread::of(&scene), Spread { all: 1, ..Spread::default() });
    // Balls of 1 m, 3 m apart: 10 along x, 4 along z.
    for i in 0..40 {
        let place = Vec3::new(3.0 * (i % 10) as f32, 5.0, 3.0 * (i / 10) as f32);
        scene.insert(RigidBodyBuilder::dynamic().translation(place), ColliderBuilder::ball(0.5));
    }
    let spread = Spread { all: 41, colliders: 40, size_ratio: 1.0, mean_size: 1.0, abreast: 40.0 / 27.0 };
    assert_eq!(Spread::of(&scene), spread);
    assert_eq!(spread.across(Vec3::new(2.0, 80.0, 3.0)), Spread { abreast: 0.5, ..spread });
    assert_eq!(spread.across(-Vec3::INFINITY), Spread { abreast: 40.0, ..spread }, "all in one place");
    // Eight large ones are a few; a ninth is not.
    for i in 0..9 {
        assert_eq!(Spread::of(&scene).size_ratio, 1.0, "{i} large ones");
        assert!(!Spread::of(&scene).is_wide());
        let place = Vec3::new(0.0, 5.0, 1.0);
        scene.insert(RigidBodyBuilder::dynamic().translation(place), ColliderBuilder::cuboid(1.0, 2.5, 0.1));
    }
    assert_eq!(Spread::of(&scene).size_ratio, 5.0);
    assert!(Spread::of(&scene).is_wide());
}

/// Where the sizes begin to need a tree, and where too many lie abreast for a sweep. Oracle: analysis.
#[test]
fn bounds_of_the_rule() {
    // A tenth of the colliders is larger.
    let spread = |count: u32, ratio: f32, extent: f32| {
        let sizes = (0..count).map(|i| if i % 10 == 0 { ratio } else { 1.0 });
        Spread::from_sizes(sizes.collect(), Vec3::splat(extent))
    };
    let auto = |spread: Spread| Broadphase::Auto.resolve(&spread);
    let (at, above) = (spread(1000, 4.0, 1.0), spread(1000, 4.01, 1.0));
    assert!(!at.is_wide() && above.is_wide());
    assert_eq!([auto(at), auto(above)], [Broadphase::Grid, Broadphase::Lbvh]);
    assert_eq!(
        [spread(128, 1.0, 1e4), spread(129, 1.0, 1e4)].map(auto),
        [Broadphase::BruteForce, Broadphase::SweepAndPrune]
    );
    // 200 abreast, and a few more; with a mean size of 2 m, 400.
    let sizes = [spread(2000, 1.0, 10.0), spread(2000, 1.0, 9.9)];
    assert_eq!(sizes.map(|s| s.abreast.round()), [200.0, 202.0]);
    assert_eq!(sizes.map(auto), [Broadphase::SweepAndPrune, Broadphase::Grid]);
    let wide = [spread(2000, 11.0, 10.0), spread(2000, 11.0, 9.9)];
    assert_eq!(wide.map(|s| s.abreast.round()), [400.0, 404.0]);
    assert_eq!(wide.map(auto), [Broadphase::SweepAndPrune, Broadphase::Lbvh]);
}
