//! The broad phase that a scene calls for. Oracle: `docs/broadphase.md`, whose table was measured.

use tumble_core::glam::Vec3;
use tumble_core::scenes::{self, Crowd, crowd};
use tumble_core::{Broadphase, ColliderBuilder, RigidBodyBuilder, Scene, Spread};

fn auto(scene: &Scene) -> Broadphase {
    Broadphase::Auto.resolve(&Spread::of(scene))
}

#[test]
fn crowds_get_what_suits_them() {
    for kind in Crowd::ALL {
        let wide = matches!(kind, Crowd::Ratio(_) | Crowd::Liu);
        let many = if wide { Broadphase::Lbvh } else { Broadphase::Grid };
        for count in [2000, 20_000] {
            assert_eq!(auto(&crowd(kind, count)), many, "{kind} of {count}: {:?}", Spread::of(&crowd(kind, count)));
        }
        for count in [0, 1, 50] {
            assert_eq!(auto(&crowd(kind, count)), Broadphase::BruteForce, "{kind} of {count}");
        }
    }
    for scene in scenes::ALL.iter().filter(|scene| scene.name != "column") {
        assert_eq!(auto(&(scene.build)(scene.default_bodies)), Broadphase::Grid, "{}", scene.name);
    }
    assert_eq!(auto(&scenes::column(20)), Broadphase::BruteForce);
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
    let spread = Spread { all: 41, colliders: 40, size_ratio: 1.0, elongation: 3.0, sparsity: 27.0 * 9.0 / 40.0 };
    assert_eq!(Spread::of(&scene), spread);
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

/// Where the sizes begin to need a tree.
#[test]
fn wide_begins_above_four() {
    let spread = |ratio: f32| {
        Spread::from_sizes((0..1000).map(|i| if i < 100 { ratio } else { 1.0 }).collect(), Vec3::splat(30.0))
    };
    assert!(!spread(4.0).is_wide() && spread(4.01).is_wide());
    assert_eq!(Broadphase::Auto.resolve(&spread(4.0)), Broadphase::Grid);
    assert_eq!(Broadphase::Auto.resolve(&spread(4.01)), Broadphase::Lbvh);
}
