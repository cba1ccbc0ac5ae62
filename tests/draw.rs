//! Pictures of `tumble-draw`. Oracles: analysis (where perspective puts a ball, a box, a shadow), ray casts, and for the
//! poses of a world on the GPU the same poses uploaded from the host.

mod common;
#[path = "common/picture.rs"]
mod picture;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/random.rs"]
mod random;

use common::gpu;
use glam::{Quat, Vec2, Vec3};
use picture::{PLAIN, Picture, SIZE, brightness, camera, color, dynamic, hue, light};
use tumble::prelude::*;
use tumble_core::{measures, scenes};
use tumble_draw::{Camera, Line, Marker, Offscreen, PoseUpload, Renderer, Style};

/// Pixels to the unit of slope.
fn focal(camera: &Camera) -> f32 {
    0.5 * SIZE.1 as f32 / (0.5 * camera.fov_y).tan()
}

/// A ball is seen as the ellipse in which its cone of sight cuts the picture.
#[test]
fn a_ball_has_the_outline_that_perspective_gives_it() {
    let camera = camera(Vec3::new(1.0, 2.0, 9.0), Vec3::new(1.0, 2.0, 0.0));
    let nothing = Picture::first(&Scene::new(), &camera, &PLAIN);
    let (focal, middle) = (focal(&camera), Vec2::new(SIZE.0 as f32, SIZE.1 as f32) * 0.5);
    for (place, radius) in [(Vec3::new(1.0, 2.0, 0.0), 2.0), (Vec3::new(3.6, 3.4, 2.0), 0.9), (Vec3::ZERO, 0.1)] {
        let mut scene = Scene::new();
        scene.insert(dynamic(place), ColliderBuilder::ball(radius));
        let red = Style { colors: &[[255, 0, 0, 255]], ..PLAIN };
        let picture = Picture::first(&scene, &camera, &red);
        let pixels = picture.changed(&nothing, 4);
        let from_eye = place - camera.eye;
        let half_angle = (radius / from_eye.length()).asin();
        let (tilt, away) = ((-from_eye.z / from_eye.length()).acos(), Vec2::new(from_eye.x, -from_eye.y));
        let room = tilt.cos().powi(2) - half_angle.sin().powi(2);
        let long = focal * half_angle.sin() * half_angle.cos() / room;
        let short = focal * half_angle.sin() / room.sqrt();
        let center = 0.5 * focal * ((tilt + half_angle).tan() + (tilt - half_angle).tan());
        let center = middle + away.normalize_or_zero() * center;
        // How much of a pixel on the outline is covered, by how much green of the sky is left.
        let covered = |pixel: &Vec2| match pixel.distance(center) < short - 2.0 {
            true => 1.0,
            false => 1.0 - light(picture.at(*pixel)[1]) / light(nothing.at(*pixel)[1]),
        };
        let area = pixels.iter().map(covered).sum::<f32>();
        let (expected, around) = (std::f32::consts::PI * long * short, std::f32::consts::PI * (long + short));
        // A share of a pixel becomes a number of samples, rounded up: seen 0.06 to 0.13 pixels all around.
        assert!((area - expected).abs() < 0.2 * around, "{area} pixels, {expected} expected");
        let found = pixels.iter().map(|pixel| *pixel * covered(pixel)).sum::<Vec2>() / area;
        assert!(found.distance(center) < 0.15, "{found}, {center} expected");
        // The pixel that is farthest from it lies on the long axis.
        let half = pixels.iter().filter(|pixel| covered(pixel) > 0.4);
        let reach = half.map(|pixel| pixel.distance(center)).fold(0.0, f32::max);
        assert!((reach - long).abs() < 1.0, "{reach}, {long} expected");
    }
}

#[test]
fn a_box_seen_along_an_axis_is_a_rectangle() {
    let camera = camera(Vec3::new(0.3, -0.2, 9.0), Vec3::new(0.3, -0.2, 0.0));
    let nothing = Picture::first(&Scene::new(), &camera, &PLAIN);
    let mut scene = Scene::new();
    // A quarter turn about z: x and y change places. The second collider is hidden within the first.
    let turned = dynamic(Vec3::new(0.5, 0.0, 1.0)).rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    let body = scene.insert(turned, ColliderBuilder::cuboid(0.5, 1.0, 2.0).translation(Vec3::new(0.2, 0.1, 0.0))).body;
    scene.attach(body, ColliderBuilder::cuboid(0.1, 0.1, 0.1)).unwrap();
    let seen = Picture::first(&scene, &camera, &PLAIN).changed(&nothing, 2);
    // The face at z = 3; the turn takes (0.2, 0.1) to (-0.1, 0.2).
    let corner = |x: f32, y: f32| camera.project(Vec3::new(0.5 - 0.1 + x, 0.2 + y, 3.0), SIZE.0, SIZE.1).unwrap();
    let (low, high) = (corner(-1.0, 0.5), corner(1.0, -0.5));
    assert!(high.x - low.x > 80.0 && high.y - low.y > 40.0);
    let holds = |pixel: &Vec2, grown: f32| pixel.cmpge(low - grown).all() && pixel.cmple(high + grown).all();
    // Half a pixel: one of its four samples may lie beside its middle.
    assert!(seen.iter().all(|pixel| holds(pixel, 0.5)));
    let inner = seen.iter().filter(|pixel| holds(pixel, -0.5)).count();
    let area = |grown: f32| {
        let count = |from: f32, to: f32| (to + grown - 0.5).floor() - (from - grown - 0.5).ceil() + 1.0;
        (count(low.x, high.x) * count(low.y, high.y)) as usize
    };
    assert_eq!(inner, area(-0.5));
    assert!(seen.len() <= area(0.5));
}

#[test]
fn what_is_nearer_hides_what_is_farther_and_colors_go_by_slot() {
    let mut scene = Scene::new();
    scene.insert(dynamic(Vec3::new(0.0, 0.0, 2.0)), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    scene.insert(dynamic(Vec3::new(0.0, 0.0, -2.0)), ColliderBuilder::ball(1.5));
    let colors = [color(1), color(2)];
    let style = Style { colors: &colors, ..PLAIN };
    for (eye, center) in [(8.0, 1), (-8.0, 2)] {
        let camera = camera(Vec3::new(0.0, 0.0, eye), Vec3::ZERO);
        let picture = Picture::first(&scene, &camera, &style);
        assert_eq!(hue(picture.at(Vec2::new(160.0, 120.0))), center);
        let place = camera.project(Vec3::new(1.2, 0.0, -2.0), SIZE.0, SIZE.1).unwrap();
        assert_eq!(hue(picture.at(place)), 2);
    }
    // Without a colour, or with one that covers nothing, a body has its own.
    let camera = camera(Vec3::new(0.0, 0.0, 8.0), Vec3::ZERO);
    let own = Picture::first(&scene, &camera, &PLAIN);
    assert!(own == Picture::first(&scene, &camera, &Style { colors: &[[9, 9, 9, 0]; 2], ..PLAIN }));
    let first = Picture::first(&scene, &camera, &Style { colors: &colors[..1], ..PLAIN });
    let changed = own.changed(&first, 0);
    // Half of it lies in the pixels of the outline.
    let face = (focal(&camera) / 5.5).powi(2);
    assert!((changed.len() as f32 - face).abs() < 0.06 * face, "{} of {face}", changed.len());
}

/// Oracle: ray casts through the same pixels.
#[test]
fn rays_hit_what_is_drawn() {
    let mut world = World::new(scenes::mixed(150), Params::default(), Backend::Cpu).unwrap();
    for _ in 0..60 {
        world.step().unwrap();
    }
    let poses = world.poses().unwrap();
    // Within the pit: its walls are drawn as what they are.
    let camera = Camera { fov_y: 1.2, ..camera(Vec3::new(1.5, 7.0, 2.0), Vec3::new(0.0, 1.0, -0.5)) };
    let slots = world.scene().bodies().map(|body| body.slot() + 1).max().unwrap();
    let colors: Vec<_> = (0..slots as u32).map(|slot| color(1 + slot % 6)).collect();
    let picture = Picture::taken(world.scene(), &poses, &camera, &Style { colors: &colors, ..PLAIN });
    let (mut tested, mut met) = (0, std::collections::HashSet::new());
    let mut random = random::Random::new(1);
    for _ in 0..600 {
        let (x, y) = (random.below(SIZE.0) as f32 + 0.5, random.below(SIZE.1) as f32 + 0.5);
        let around = [(0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let rays = around.map(|(dx, dy)| {
            let (origin, direction) = camera.ray(x + dx, y + dy, SIZE.0, SIZE.1);
            Ray::new(origin, direction)
        });
        let hits: Vec<_> = world.cast_rays(&rays).unwrap().into_iter().map(|hit| hit.map(|hit| hit.body)).collect();
        // Not where two bodies share a pixel.
        if hits.iter().all(|hit| *hit == hits[0]) {
            let expected = hits[0].map_or(7, |body| 1 + body.slot() as u32 % 6);
            assert_eq!(hue(picture.at(Vec2::new(x, y))), expected, "{:?} at {x} {y}", hits[0]);
            tested += 1;
            met.extend(hits[0]);
        }
    }
    assert!(tested > 350 && met.len() > 40, "{tested} pixels, {} bodies", met.len());
}

/// Straight from the world's buffer, and from the host by way of another one: the same picture, through edits too.
#[test]
fn a_picture_from_the_worlds_buffer_is_that_of_its_poses() {
    let (device, queue) = (&gpu().device, &gpu().queue);
    let mut world = tumble::gpu::World::with_gpu(gpu().clone(), scenes::mixed(100), Params::default()).unwrap();
    let camera = camera(Vec3::new(6.0, 12.0, 14.0), Vec3::new(0.0, 3.0, 0.0));
    let style = Style { shadows: true, see_through: true, ..PLAIN };
    let mut renderer = Renderer::new(device, Offscreen::FORMAT, world.scene()).unwrap();
    let mut upload = PoseUpload::new(device, queue);
    let mut before: Option<Picture> = None;
    let generation = world.pose_buffer().unwrap().1;
    for round in 0..4 {
        for _ in 0..15 {
            world.step().unwrap();
        }
        let straight = Picture::drawn(&mut renderer, &camera, world.pose_buffer().unwrap().0, &style);
        let poses = world.poses().unwrap();
        let uploaded = upload.write(world.scene(), &poses).unwrap();
        let uploaded = Picture::drawn(&mut renderer, &camera, uploaded, &style);
        assert!(straight == uploaded, "round {round}");
        assert!(before.is_none_or(|before| straight.changed(&before, 20).len() > 1000), "round {round}: it moves");
        before = Some(straight);
        if round == 0 {
            let gone: Vec<_> = world.scene().bodies().skip(5).step_by(2).collect();
            for body in gone {
                world.edit().remove(body).unwrap();
            }
            for i in 0..200 {
                let body = dynamic(Vec3::new((i % 20) as f32 - 10.0, 9.0, (i / 20) as f32 - 5.0));
                world.edit().insert(body, ColliderBuilder::ball(0.4)).unwrap();
            }
            renderer.set_scene(world.scene()).unwrap();
        }
    }
    assert_ne!(world.pose_buffer().unwrap().1, generation, "the world grew");
}

/// A renderer that was not told of edits draws the bodies that it knows and that are still there.
#[test]
fn bodies_that_are_gone_are_not_drawn() {
    let mut old = Scene::new();
    let bodies = [-3.0, 0.0, 3.0].map(|x| old.insert(dynamic(Vec3::X * x), ColliderBuilder::ball(1.0)).body);
    let mut left = old.clone();
    left.remove(bodies[1]).unwrap();
    // In the slot of the one that is gone, and behind all others.
    let mut new = left.clone();
    for y in [-2.0, 2.0] {
        new.insert(dynamic(Vec3::Y * y), ColliderBuilder::ball(1.0));
    }
    let camera = camera(Vec3::new(0.0, 0.0, 12.0), Vec3::ZERO);
    let mut renderer = Renderer::new(&gpu().device, Offscreen::FORMAT, &old).unwrap();
    let mut upload = PoseUpload::new(&gpu().device, &gpu().queue);
    let mut drawn_by_old = |scene: &Scene| {
        let poses = upload.write(scene, &measures::initial_poses(scene)).unwrap();
        Picture::drawn(&mut renderer, &camera, poses, &PLAIN)
    };
    let expected = Picture::first(&left, &camera, &PLAIN);
    assert!(drawn_by_old(&old).changed(&expected, 20).len() > 300);
    assert!(drawn_by_old(&new) == expected);
    assert!(drawn_by_old(&left) == expected);
    // Fewer slots than the renderer knows.
    left.remove(bodies[2]).unwrap();
    let mut upload = PoseUpload::new(&gpu().device, &gpu().queue);
    let poses = upload.write(&left, &measures::initial_poses(&left)).unwrap();
    assert!(Picture::drawn(&mut renderer, &camera, poses, &PLAIN) == Picture::first(&left, &camera, &PLAIN));
}

/// Oracle: where a line along the light meets the ground.
#[test]
fn shadows_fall_along_the_light() {
    let light = Vec3::new(0.5, -0.8, -0.52);
    for normal in [Vec3::Y, Vec3::new(-0.3, 1.0, 0.2).normalize()] {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(normal));
        let bodies = [Vec3::new(-2.0, 2.5, 0.0), Vec3::new(1.5, 2.5, 0.5)];
        scene.insert(dynamic(bodies[0]), ColliderBuilder::ball(0.6));
        scene.insert(dynamic(bodies[1]), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        let camera = camera(Vec3::new(0.0, 9.0, 8.0), Vec3::ZERO);
        let [with, without] = [true, false].map(|shadows| Picture::first(&scene, &camera, &Style { shadows, ..PLAIN }));
        let mut shaded = with.changed(&without, 8);
        for body in bodies {
            let place = body - light * (body.dot(normal) / light.dot(normal));
            let pixel = camera.project(place, SIZE.0, SIZE.1).unwrap();
            let (dark, bright) = (brightness(with.at(pixel)), brightness(without.at(pixel)));
            assert!(4 * dark < 3 * bright, "{dark} {bright} at {pixel}");
            // Nothing is shaded but what lies near one of the two.
            shaded.retain(|other| other.distance(pixel) > 0.075 * SIZE.0 as f32);
        }
        assert!(shaded.is_empty(), "{} {:?}", shaded.len(), shaded.first());
    }
}

#[test]
fn large_walls_are_glass_unless_asked_otherwise() {
    let mut scene = Scene::new();
    scene.insert(dynamic(Vec3::ZERO), ColliderBuilder::ball(1.0));
    scene.insert(RigidBodyBuilder::fixed().translation(Vec3::Z * 3.0), ColliderBuilder::cuboid(3.0, 3.0, 0.2));
    scene.insert(RigidBodyBuilder::fixed().translation(Vec3::Y * -3.0), ColliderBuilder::cuboid(9.0, 0.5, 9.0));
    let camera = camera(Vec3::new(0.0, 1.0, 9.0), Vec3::ZERO);
    let style = Style { colors: &[color(1), color(4), color(2)], ..PLAIN };
    let at = |style: &Style, place: Vec3| {
        hue(Picture::first(&scene, &camera, style).at(camera.project(place, SIZE.0, SIZE.1).unwrap()))
    };
    assert_eq!(at(&style, Vec3::ZERO), 4);
    let glass = Style { see_through: true, ..style };
    assert_eq!((at(&glass, Vec3::ZERO), at(&glass, Vec3::new(0.5, -2.5, -3.0))), (1, 2));
}

#[test]
fn markers_and_lines_show_and_are_faint_behind_bodies() {
    let mut scene = Scene::new();
    scene.insert(dynamic(Vec3::ZERO), ColliderBuilder::cuboid(1.0, 1.0, 1.0));
    let camera = camera(Vec3::new(0.0, 0.0, 8.0), Vec3::ZERO);
    let own = Picture::first(&scene, &camera, &PLAIN);
    let (free, hidden) = (Vec3::new(2.0, 0.5, 1.0), Vec3::new(0.3, 0.2, -2.0));
    let marker = |position| Marker { position, color: color(5), radius: 0.2 };
    let markers = [marker(free), marker(hidden)];
    // It begins behind the camera.
    let lines = [Line { from: Vec3::new(-2.0, -0.5, 20.0), to: Vec3::new(-2.0, -0.5, -9.0), color: color(2) }];
    let picture = Picture::first(&scene, &camera, &Style { markers: &markers, lines: &lines, ..PLAIN });
    let at = |place: Vec3| camera.project(place, SIZE.0, SIZE.1).unwrap();
    assert_eq!(hue(picture.at(at(free))), 5);
    assert_eq!(hue(picture.at(at(Vec3::new(-2.0, -0.5, 0.0)))), 2);
    let change = Picture::difference(picture.at(at(hidden)), own.at(at(hidden)));
    assert!((20..120).contains(&change), "{change}");
    let dot: Vec<_> = own.changed(&picture, 4).into_iter().filter(|pixel| pixel.distance(at(free)) < 20.0).collect();
    let area = std::f32::consts::PI * (0.2 * focal(&camera) / 7.0).powi(2);
    assert!((dot.len() as f32 - area).abs() < 0.25 * area, "{} pixels, {area} expected", dot.len());
}
