//! The ground that passes stand on: adapters, buffers that grow, bindings by name, read-backs, timers, and what happens
//! when a device fails. Oracle: the words that were written.

mod common;
#[path = "common/words.rs"]
mod words;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use common::gpu;
use tumble_core::Error;
use tumble_gpu::primitives::{Count, Scan, ScanOptions};
use tumble_gpu::readback::read_now;
use tumble_gpu::{Bind, BindCache, Buffers, Gpu, Pipelines, Readback, Recorder, Timer};
use wgpu::{BufferUsages, DeviceType};
use words::{download, run, upload};

#[test]
fn software_is_no_hardware() {
    if gpu().info.device_type == DeviceType::Cpu {
        assert!(Gpu::hardware().unwrap().is_none());
    }
}

/// The callback of a mapping runs in whichever thread polls first, and may be on its way when the reader's own poll
/// returns.
#[test]
fn a_read_back_arrives_while_others_poll() {
    let reading = AtomicBool::new(true);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while reading.load(Ordering::Relaxed) {
                    gpu().device.poll(wgpu::PollType::Poll).unwrap();
                }
            });
        }
        let source = upload(&[0]);
        for round in 0..500u32 {
            gpu().queue.write_buffer(&source, 0, &round.to_le_bytes());
            let read = read_now(gpu(), &source, 0, 4);
            if read.as_ref().ok() != Some(&round.to_le_bytes().to_vec()) {
                reading.store(false, Ordering::Relaxed);
                panic!("round {round}: {read:?}");
            }
        }
        reading.store(false, Ordering::Relaxed);
    });
}

#[test]
fn buffers_grow_and_keep_what_they_hold() {
    let mut buffers = Buffers::new();
    buffers.create(gpu(), "data", 4, 0, BufferUsages::STORAGE).unwrap();
    assert_eq!((buffers.capacity("data"), buffers.bytes()), (1, 4), "never empty");
    gpu().queue.write_buffer(buffers.buffer("data").unwrap(), 0, &7u32.to_le_bytes());
    let (generation, own) = (buffers.generation(), buffers.generation_of("data"));
    buffers.grow(gpu(), "data", 3, true).unwrap();
    assert_eq!(download(buffers.buffer("data").unwrap(), 3), [7, 0, 0]);
    assert!(buffers.generation() != generation && buffers.generation_of("data") != own);
    let generation = buffers.generation();
    buffers.grow(gpu(), "data", 2, true).unwrap();
    assert_eq!(buffers.generation(), generation, "there was room");
    buffers.grow(gpu(), "data", 4, false).unwrap();
    assert_eq!(download(buffers.buffer("data").unwrap(), 4), [0; 4]);

    let most = gpu().device.limits().max_storage_buffer_binding_size / 4;
    let error = buffers.grow(gpu(), "data", most + 1, false).unwrap_err();
    assert_eq!(error, Error::Capacity { buffer: "data", needed: most + 1, capacity: most });
    let error = buffers.create(gpu(), "large", 4, most + 1, BufferUsages::STORAGE).unwrap_err();
    assert!(matches!(error, Error::Limits { .. }), "{error}");
    assert_eq!(download(buffers.buffer("data").unwrap(), 4), [0; 4], "still there");
    assert!(matches!(buffers.grow(gpu(), "none", 1, false), Err(Error::Gpu { .. })));
}

/// A cached bind group must not outlive the buffer that its name stood for.
#[test]
fn growth_is_seen_by_the_next_dispatch() {
    let mut pipelines = Pipelines::new();
    let pass = pipelines.pass(gpu(), "primitives/args", "arguments").unwrap();
    let (mut buffers, mut cache) = (Buffers::new(), BindCache::new());
    buffers.create(gpu(), "args", 16, 1, BufferUsages::STORAGE).unwrap();
    buffers.create(gpu(), "counts", 4, 1, BufferUsages::STORAGE).unwrap();
    buffers.create(gpu(), "jobs", 272, 1, BufferUsages::UNIFORM).unwrap();
    let jobs = [1u32, 0, 0, 0, 0, u32::MAX, 256, 0];
    gpu().queue.write_buffer(buffers.buffer("jobs").unwrap(), 0, bytemuck::cast_slice(&jobs));
    gpu().queue.write_buffer(buffers.buffer("counts").unwrap(), 0, &1000u32.to_le_bytes());
    for capacity in [1, 2] {
        buffers.grow(gpu(), "args", capacity, false).unwrap();
        let mut recorder = Recorder::new(gpu(), &buffers, &mut cache, None);
        recorder.dispatch(&pass, &[], 1).unwrap();
        recorder.submit().unwrap();
        assert_eq!(download(buffers.buffer("args").unwrap(), 4), [4, 1, 1, 0], "capacity {capacity}");
    }
    assert_eq!(cache.created(), 2);
}

#[test]
fn mistakes_of_binding_are_errors() {
    let mut pipelines = Pipelines::new();
    let pass = pipelines.pass(gpu(), "primitives/args", "arguments").unwrap();
    let small = upload(&[0]);
    run(|recorder| {
        let missing = recorder.dispatch(&pass, &[], 1).unwrap_err();
        assert!(missing.to_string().contains("`jobs`"), "{missing}");
        let stray = recorder.dispatch(&pass, &[Bind::new("job", &small)], 1).unwrap_err();
        assert!(stray.to_string().contains("`job`"), "{stray}");
        let binds = [Bind::new("jobs", &small), Bind::new("counts", &small), Bind::new("args", &small)];
        let unfit = recorder.dispatch(&pass, &binds, 1).unwrap_err();
        assert!(matches!(unfit, Error::Gpu { .. }), "{unfit}");
    });
    assert!(matches!(pipelines.pass(gpu(), "primitives/args", "none"), Err(Error::Gpu { .. })));
    assert!(matches!(pipelines.pass(gpu(), "primitives/none", "none"), Err(Error::Gpu { .. })));
    gpu().check().unwrap();
}

#[test]
fn read_backs_arrive_in_order_and_the_ring_has_an_end() {
    let source = upload(&[0]);
    let mut readback = Readback::new(gpu(), "ring", 4, 3).unwrap();
    assert!(readback.wait_take(gpu()).unwrap().is_none());
    let (buffers, mut cache) = (Buffers::new(), BindCache::new());
    for round in 0..2u32 {
        for k in 0..4u32 {
            gpu().queue.write_buffer(&source, 0, &(10 * round + k).to_le_bytes());
            let mut recorder = Recorder::new(gpu(), &buffers, &mut cache, None);
            assert_eq!(readback.copy(recorder.encoder(), &source, 0), k < 3);
            let index = recorder.submit().unwrap();
            readback.submitted(&index);
        }
        assert!(readback.is_full());
        for k in 0..3u32 {
            assert_eq!(readback.wait_take(gpu()).unwrap().unwrap(), (10 * round + k).to_le_bytes());
        }
        assert!(readback.try_take(gpu()).unwrap().is_none() && readback.in_flight() == 0);
    }
    // A copy that was recorded and never submitted is an error, and its slot comes back.
    readback.copy(Recorder::new(gpu(), &buffers, &mut cache, None).encoder(), &source, 0);
    assert!(matches!(readback.wait_take(gpu()), Err(Error::Gpu { .. })));
    assert!(!readback.is_full() && readback.in_flight() == 0);
}

#[test]
fn stages_are_timed_where_the_device_has_timestamps() {
    let Some(mut timer) = Timer::new(gpu()).unwrap() else {
        assert!(!gpu().has_timestamps());
        return;
    };
    let mut pipelines = Pipelines::new();
    let options = ScanOptions { capacity: 1 << 20, count: Count::Host(1 << 20), total: None };
    let scan = Scan::new(gpu(), &mut pipelines, options).unwrap();
    let data = upload(&vec![1; 1 << 20]);
    let (buffers, mut cache) = (Buffers::new(), BindCache::new());
    let mut recorder = Recorder::new(gpu(), &buffers, &mut cache, Some(&mut timer));
    for stage in ["first", "second", "first"] {
        recorder.stage(stage);
        scan.record(&mut recorder, &data, None).unwrap();
    }
    recorder.submit().unwrap();
    let runs = timer.take(gpu(), true).unwrap().unwrap();
    assert_eq!(runs.iter().map(|run| run.stage).collect::<Vec<_>>(), ["first", "second", "first"]);
    assert!(runs.iter().all(|run| run.milliseconds > 0.0 && run.milliseconds < 10_000.0), "{runs:?}");
    assert_eq!(runs[0].begin, 0.0);
    assert!(runs.windows(2).all(|two| two[0].begin + two[0].milliseconds <= two[1].begin + 1e-6), "{runs:?}");
    assert!(timer.take(gpu(), false).unwrap().is_none());
}

/// Our own device: what no scope catches, and its loss, come out of `check` and of what is asked next; no panic.
#[test]
fn a_lost_device_is_an_error() {
    let gpu = Gpu::noop();
    let _ = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 4,
        usage: BufferUsages::MAP_READ | BufferUsages::MAP_WRITE | BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    assert!(matches!(gpu.check(), Err(Error::Gpu { .. })));
    gpu.check().unwrap();
    gpu.device.destroy();
    let _ = gpu.device.poll(wgpu::PollType::Poll);
    assert!(matches!(gpu.check(), Err(Error::DeviceLost { .. })));
    let refused = gpu.create_buffer("late", 4, BufferUsages::STORAGE);
    assert!(matches!(refused, Err(Error::DeviceLost { .. })), "{refused:?}");
}

/// A user's device keeps its handlers: they hear what no scope of ours catches, and nothing else.
#[test]
fn a_users_device_keeps_its_handlers() {
    let (device, queue) = wgpu::Device::noop(&Default::default());
    let heard = Arc::new(AtomicU32::new(0));
    let counter = Arc::clone(&heard);
    device.on_uncaptured_error(Arc::new(move |_| {
        counter.fetch_add(1, Ordering::Relaxed);
    }));
    let gpu = Gpu::from_device(device, queue);
    let wrong = BufferUsages::MAP_READ | BufferUsages::MAP_WRITE | BufferUsages::STORAGE;
    assert!(matches!(gpu.create_buffer("wrong", 4, wrong), Err(Error::Gpu { .. })));
    assert_eq!(heard.load(Ordering::Relaxed), 0);
    let descriptor = wgpu::BufferDescriptor { label: None, size: 4, usage: wrong, mapped_at_creation: false };
    let _ = gpu.device.create_buffer(&descriptor);
    assert_eq!(heard.load(Ordering::Relaxed), 1);
    gpu.check().unwrap();
}
