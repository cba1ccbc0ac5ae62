//! The stage `broadphase` of worlds on the GPU, by the device's own clock, and how far the tree's build is from what the
//! device copies. Compiled to nothing without the feature.

use crate::median;
use std::time::Instant;
use tumble_core::layout::{Aabb, TreeNode};
use tumble_core::scenes::{Crowd, crowd};
use tumble_core::{Broadphase, ColliderBuilder, Params, RigidBodyBuilder, Traversal};
use tumble_gpu::primitives::{Count, Sort, SortOptions};
use tumble_gpu::{Gpu, Pipelines, World};

/// A world's broad phase.
struct Row {
    what: &'static str,
    /// Of the stage in a step that keeps what it can, ms.
    steady: f64,
    /// In a step that a body was inserted before.
    edited: f64,
    bytes: f64,
}

/// Bytes a second, read and written, that the device copies: of the largest copy that all devices can.
fn copy_rate(gpu: &Gpu, bytes: u64) -> f64 {
    const COPIES: u64 = 8;
    let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    let [from, to] = ["from", "to"].map(|name| gpu.create_buffer(name, bytes, usage).expect("memory"));
    let times = (0..6).map(|_| {
        let begin = Instant::now();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        (0..COPIES).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
        gpu.queue.submit([encoder.finish()]);
        gpu.wait().expect("it ends");
        begin.elapsed().as_secs_f64()
    });
    let times: Vec<f64> = times.collect();
    (2 * bytes * COPIES) as f64 / median(times.into_iter().skip(1))
}

/// Bytes that a build of a tree and its refit move, when each array is read and written once a pass: codes, sort,
/// hierarchy, leaves and nodes.
fn build_bytes(gpu: &Gpu, count: u32) -> u64 {
    let options = SortOptions { capacity: count, count: Count::Host(count), bits: vec![31] };
    let sort = Sort::new(gpu, &mut Pipelines::new(), options).expect("a sort").traffic_bytes(count);
    let (aabb, nodes) = (size_of::<Aabb>() as u64, 2 * size_of::<TreeNode>() as u64);
    let (codes, hierarchy, refit) = (aabb + 8, 8 + nodes + 4, 4 + aabb + nodes + 4);
    sort + u64::from(count) * (codes + hierarchy + refit)
}

fn row(gpu: &Gpu, count: usize, rounds: usize, what: &'static str, params: Params) -> Row {
    let params = Params { profile: true, ..params };
    let mut world = World::with_gpu(gpu.clone(), crowd(Crowd::Uniform, count), params).expect("a world");
    let mut step = |edit: bool| {
        if edit {
            let far = RigidBodyBuilder::dynamic().translation(tumble_core::glam::Vec3::Y * -4e3);
            let body = world.edit().insert(far, ColliderBuilder::ball(0.5)).expect("room").body;
            world.edit().remove(body).expect("a body");
        }
        world.step().expect("step");
        let report = world.sync().expect("report");
        let stage = report.stages.iter().find(|stage| stage.stage == "broadphase");
        (stage.and_then(|stage| stage.milliseconds).unwrap_or(f64::NAN), report.broadphase_bytes)
    };
    // Compiles, and grows what is too small.
    (0..3).for_each(|_| {
        step(false);
    });
    let (mut steady, mut edited, mut bytes) = (Vec::new(), Vec::new(), 0);
    for _ in 0..rounds {
        edited.push(step(true).0);
        let (time, used) = step(false);
        steady.push(time);
        bytes = used;
    }
    let [steady, edited] = [steady, edited].map(|times| median(times.into_iter()));
    Row { what, steady, edited, bytes: bytes as f64 / count as f64 }
}

/// Prints a table for each count, and returns it as lines of `what,bodies,steady_ms,edited_ms,bytes_a_body`.
pub(crate) fn on_gpu(quick: bool) -> String {
    let gpu = match Gpu::any() {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("no GPU: {error}");
            return String::new();
        }
    };
    let software = gpu.info.device_type == wgpu::DeviceType::Cpu;
    let counts: &[usize] = match (quick, software) {
        (true, _) => &[100],
        (_, true) => &[1000, 10_000],
        _ => &[10_000, 100_000, 1_000_000],
    };
    let rate = copy_rate(&gpu, if software || quick { 1 << 24 } else { 1 << 27 });
    println!("on {}: copies {:.1} GB/s", gpu.info.name, rate * 1e-9);
    let tree = |traversal| Params { broadphase: Broadphase::Lbvh, traversal, ..Params::default() };
    let kind = |broadphase| Params { broadphase, ..Params::default() };
    let mut csv = String::from("\ngpu,what,bodies,steady_ms,edited_ms,bytes_a_body\n");
    for &count in counts {
        let mut all = vec![
            ("grid", kind(Broadphase::Grid)),
            ("sliced grid", kind(Broadphase::SlicedGrid)),
            ("lbvh", tree(Traversal::Escape)),
            ("lbvh, history", tree(Traversal::History)),
            ("lbvh, stack", tree(Traversal::Stack)),
            ("sweep and prune", kind(Broadphase::SweepAndPrune)),
        ];
        if count <= 10_000 {
            all.insert(0, ("brute force", kind(Broadphase::BruteForce)));
        }
        println!("uniform, {count} bodies");
        println!("  {:<22} {:>10} {:>10} {:>9}", "ms", "steady", "edited", "B/body");
        let rounds = if quick { 1 } else { 7 };
        for (what, params) in all {
            let Row { what, steady, edited, bytes } = row(&gpu, count, rounds, what, params);
            println!("  {what:<22} {steady:10.3} {edited:10.3} {bytes:9.0}");
            csv += &format!("{},\"{what}\",{count},{steady:.4},{edited:.4},{bytes:.0}\n", gpu.info.name);
            if what == "lbvh" {
                // An edit makes the step build what it else refits.
                let (build, moved) = ((edited - steady) * 1e-3, build_bytes(&gpu, count as u32));
                let (primitives, share) = (count as f64 / build * 1e-6, moved as f64 / build / rate * 100.0);
                println!(
                    "    build: {primitives:.1} M primitives/s, {:.1} MB, {share:.1} % of a copy",
                    moved as f64 * 1e-6
                );
            }
        }
    }
    csv
}
