//! Cameras and what they frame; no device. Oracle: analysis.

use glam::{Vec2, Vec3, Vec4};
use tumble_core::{ColliderBuilder, RigidBodyBuilder, Scene, measures, scenes};
use tumble_draw::{Bounds, Camera, OrbitCamera};

const SIZE: (u32, u32) = (640, 360);
const ASPECT: f32 = 16.0 / 9.0;

fn corners(bounds: &Bounds) -> impl Iterator<Item = Vec3> {
    let (middle, half) = (bounds.middle(), bounds.half_extents());
    let sign = |corner: u32, axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
    (0..8).map(move |i| middle + half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2)))
}

#[test]
fn framing_sees_the_whole_box_and_little_more() {
    let boxes = [Vec3::ONE, Vec3::new(20.0, 0.5, 1.0), Vec3::new(0.01, 3.0, 0.02), Vec3::splat(4e4)];
    for half in boxes {
        for (yaw, pitch, fov, aspect) in
            [(0.0, 0.0, 0.6, ASPECT), (0.5, 0.36, 0.6, ASPECT), (2.0, -0.7, 1.5, 1.0), (4.0, 1.5, 0.2, 0.4)]
        {
            let bounds = Bounds::new(Vec3::new(3.0, -7.0, 2.0) * half.max_element(), half);
            let camera = Camera::framing(&bounds, yaw, pitch, fov, aspect);
            let (width, height) = (1000, (1000.0 / aspect).round() as u32);
            // 1 on the picture's edge.
            let reach = corners(&bounds).map(|corner| {
                let pixel = camera.project(corner, width, height).unwrap();
                let ndc = pixel / Vec2::new(width as f32, height as f32) * 2.0 - 1.0;
                ndc.abs().max_element()
            });
            let reach = reach.fold(0.0, f32::max);
            // What is near moves less than 4 % for 4 % of distance only if it is far: 0.75 at the widest angle here.
            assert!((0.7..1.0).contains(&reach), "{reach} of {half} at {yaw} {pitch} {fov} {aspect}");
        }
    }
}

#[test]
fn rays_projections_and_the_matrix_agree() {
    let camera = Camera {
        eye: Vec3::new(3.0, 4.0, -5.0),
        look_at: Vec3::new(0.5, 1.0, 0.2),
        up: Vec3::new(0.1, 2.0, 0.0),
        fov_y: 0.9,
        near: 0.01,
    };
    let matrix = camera.view_projection(ASPECT);
    for (x, y) in [(0.5, 0.5), (320.0, 180.0), (639.5, 10.0), (17.25, 359.0)] {
        let (origin, direction) = camera.ray(x, y, SIZE.0, SIZE.1);
        assert_eq!(origin, camera.eye);
        assert!((direction.length() - 1.0).abs() < 1e-6);
        let point = origin + direction * 7.0;
        let pixel = camera.project(point, SIZE.0, SIZE.1).unwrap();
        assert!(pixel.distance(Vec2::new(x, y)) < 2e-3, "{pixel} of {x} {y}");
        let clip: Vec4 = matrix * point.extend(1.0);
        let ndc = clip / clip.w;
        let by_matrix = Vec2::new(ndc.x + 1.0, 1.0 - ndc.y) * 0.5 * Vec2::new(SIZE.0 as f32, SIZE.1 as f32);
        assert!(pixel.distance(by_matrix) < 2e-3, "{pixel} {by_matrix}");
        let depth = (point - camera.eye).dot(camera.axes()[2]);
        assert!((ndc.z - camera.near / depth).abs() < 1e-6);
        assert_eq!(camera.project(origin - direction, SIZE.0, SIZE.1), None);
    }
    // The middle of the picture is what the camera looks at.
    let (_, direction) = camera.ray(320.0, 180.0, SIZE.0, SIZE.1);
    assert!(direction.dot((camera.look_at - camera.eye).normalize()) > 1.0 - 1e-6);
}

#[test]
fn an_orbit_keeps_its_focus_and_distance() {
    let mut orbit = OrbitCamera { focus: Vec3::new(1.0, 2.0, 3.0), distance: 5.0, yaw: 0.0, pitch: 0.0, fov_y: 0.8 };
    assert!(orbit.camera().eye.distance(Vec3::new(1.0, 2.0, 8.0)) < 1e-5);
    orbit.turn(std::f32::consts::FRAC_PI_2, 0.0);
    assert!(orbit.camera().eye.distance(Vec3::new(6.0, 2.0, 3.0)) < 1e-5);
    orbit.turn(0.3, 99.0);
    let camera = orbit.camera();
    assert!((camera.eye.distance(orbit.focus) - 5.0).abs() < 1e-5);
    assert!(camera.eye.y > 6.99 && camera.axes().iter().all(|axis| axis.is_finite()));
    orbit.zoom(0.5);
    assert_eq!(orbit.distance, 2.5);
    // Half a picture to the right: what was in the middle is at the left edge.
    let focus = orbit.focus;
    orbit.pan(0.5, 0.0);
    let pixel = orbit.camera().project(focus, 200, 200).unwrap();
    assert!(pixel.distance(Vec2::new(0.0, 100.0)) < 0.1, "{pixel}");
}

#[test]
fn bounds_leave_out_grounds_and_what_flew_away() {
    let scene = scenes::pile(300);
    let poses = measures::initial_poses(&scene);
    let all = Bounds::of(&scene, &poses);
    // 7 by 7 places of 1.5 m, 7 layers; boxes of 1 m.
    assert!((all.max - all.min - Vec3::new(10.5, 10.5, 10.5)).abs().max_element() < 1.0, "{all:?}");

    let mut with_outliers = scene.clone();
    for place in [Vec3::splat(1e6), Vec3::new(0.0, -5e4, 0.0), Vec3::new(f32::MIN_POSITIVE, 0.0, 300.0)] {
        with_outliers.insert(RigidBodyBuilder::dynamic().translation(place), ColliderBuilder::ball(0.5));
    }
    assert_eq!(Bounds::of(&with_outliers, &measures::initial_poses(&with_outliers)), all);

    // A turned box, to which a ball is attached.
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    let turned = RigidBodyBuilder::dynamic().rotation(glam::Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    let body = scene.insert(turned, ColliderBuilder::cuboid(3.0, 1.0, 2.0)).body;
    scene.attach(body, ColliderBuilder::ball(0.5).translation(Vec3::X * 4.0)).unwrap();
    let bounds = Bounds::of(&scene, &measures::initial_poses(&scene));
    let expected = Bounds { min: Vec3::new(-1.0, -3.0, -2.0), max: Vec3::new(1.0, 4.5, 2.0) };
    assert!((bounds.min - expected.min).abs().max_element() < 1e-5, "{bounds:?}");
    assert!((bounds.max - expected.max).abs().max_element() < 1e-5, "{bounds:?}");

    let empty = Bounds::of(&Scene::new(), &measures::initial_poses(&Scene::new()));
    assert_eq!(empty, Bounds::new(Vec3::ZERO, Vec3::splat(0.5)));
}
