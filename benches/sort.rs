//! Pairs sorted a second: `cargo bench --bench sort`.
//!
//! On the CPU 32-bit keys with 32-bit values, beside rdst in one run, with one thread and with all. On the GPU
//! the same by either ranking, and the bytes that the algorithm moves over the time as a share of the rate at which the
//! device copies. The sorts take turns, so that a noisy machine harms all alike. `--quick` runs one small iteration of
//! everything, as a test; `--no-gpu` leaves out the GPU; `--out DIR` writes `sort.csv`.

use rdst::{RadixKey, RadixSort};
use std::time::Instant;
use tumble_cpu::primitives::radix_sort_by;
use tumble_gpu::primitives::{Count, Ranking, Sort, SortOptions};
use tumble_gpu::{BindCache, Buffers, Gpu, Pipelines, Recorder};
use wgpu::BufferUsages;

/// A key above a value, in one word.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Pair(u64);

impl RadixKey for Pair {
    const LEVELS: usize = 4;

    fn get_level(&self, level: usize) -> u8 {
        (self.0 >> (32 + 8 * level)) as u8
    }
}

/// SplitMix64: the same numbers everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as u32
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Seconds that `f` takes.
fn timed(f: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    f();
    begin.elapsed().as_secs_f64()
}

struct Row {
    sort: &'static str,
    threads: usize,
    count: usize,
    /// Millions of pairs a second.
    rate: f64,
    /// To rdst's time in the same run on the CPU, to the portable ranking's on the GPU.
    ratio: f64,
    /// On the GPU: bytes moved, GB/s, and share of the copy rate.
    moved: Option<(u64, f64, f64)>,
}

impl Row {
    fn print(self) -> Self {
        let threads = if self.threads == 0 { String::new() } else { format!(", {} threads", self.threads) };
        print!(
            "  {:>9} {:<22} {:9.2} M pairs/s {:6.2} x",
            self.count,
            format!("{}{threads}", self.sort),
            self.rate,
            self.ratio
        );
        match self.moved {
            Some((bytes, rate, share)) => {
                println!("  {:8.2} MB {rate:8.2} GB/s = {:4.1} % of a copy", bytes as f64 * 1e-6, share * 100.0);
            }
            None => println!(),
        }
        self
    }
}

fn cpu(count: usize, threads: usize, rounds: usize) -> Vec<Row> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let mut random = Random(count as u64);
    let unsorted: Vec<Pair> = (0..count as u64).map(|i| Pair((u64::from(random.next()) << 32) | i)).collect();
    // Short sorts are repeated, on copies, until the clock can tell.
    let copies = (20_000 / count.max(1)).max(1);
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let mut scratch = Vec::new();
    let mut expected = unsorted.clone();
    expected.sort();
    pool.install(|| {
        for _ in 0..rounds {
            let mut all = vec![unsorted.clone(); copies];
            ours.push(timed(|| all.iter_mut().for_each(|a| radix_sort_by(a, &mut scratch, 32..64, |pair| pair.0))));
            assert!(all[0] == expected, "sorted wrongly");
            let mut all = vec![unsorted.clone(); copies];
            theirs.push(timed(|| all.iter_mut().for_each(|a| by_rdst(a, threads))));
        }
    });
    let (ours, theirs) = (median(ours), median(theirs));
    let rate = |time: f64| (count * copies) as f64 / time * 1e-6;
    let row = |sort, time| Row { sort, threads, count, rate: rate(time), ratio: time / theirs, moved: None }.print();
    vec![row("rdst 0.20", theirs), row("tumble cpu", ours)]
}

fn by_rdst(pairs: &mut [Pair], threads: usize) {
    if threads == 1 {
        pairs.radix_sort_builder().with_parallel(false).sort();
    } else {
        pairs.radix_sort_unstable();
    }
}

fn buffer(gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    gpu.create_buffer("bench", bytes, usage).expect("room for a buffer")
}

/// Seconds until everything that `record` records has run.
fn run(gpu: &Gpu, cache: &mut BindCache, record: impl FnOnce(&mut Recorder)) -> f64 {
    let buffers = Buffers::new();
    timed(|| {
        let mut recorder = Recorder::new(gpu, &buffers, cache, None);
        record(&mut recorder);
        recorder.submit().expect("it runs");
        gpu.wait().expect("it ends");
    })
}

/// Bytes a second, read and written, that the device copies.
fn copy_rate(gpu: &Gpu, bytes: u64, rounds: usize) -> f64 {
    const COPIES: u64 = 8;
    let (from, to) = (buffer(gpu, bytes), buffer(gpu, bytes));
    let mut cache = BindCache::new();
    let mut copy = || {
        run(gpu, &mut cache, |recorder| {
            for _ in 0..COPIES {
                recorder.encoder().copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
            }
        })
    };
    copy();
    (2 * bytes * COPIES) as f64 / median((0..rounds).map(|_| copy()).collect())
}

fn gpu_sorts(gpu: &Gpu, count: u32, rounds: usize, repeats: usize, copy_rate: f64) -> Vec<Row> {
    let mut random = Random(count.into());
    let keys: Vec<u32> = (0..count).map(|_| random.next()).collect();
    let values: Vec<u32> = (0..count).collect();
    let bytes = u64::from(count) * 4;
    let [given, given_values, sorted, sorted_values] = [(); 4].map(|()| buffer(gpu, bytes));
    gpu.queue.write_buffer(&given, 0, bytemuck::cast_slice(&keys));
    gpu.queue.write_buffer(&given_values, 0, bytemuck::cast_slice(&values));
    let mut pipelines = Pipelines::new();
    let mut cache = BindCache::new();
    let rankings: &[_] = match gpu.has_subgroups() {
        true => &[("gpu, portable", Ranking::Portable), ("gpu, sub-groups", Ranking::Subgroup)],
        false => &[("gpu, portable", Ranking::Portable)],
    };
    let mut sorts: Vec<_> = rankings
        .iter()
        .map(|&(name, ranking)| {
            let options = SortOptions { capacity: count, count: Count::Host(count), bits: vec![32] };
            let sort = Sort::with_ranking(gpu, &mut pipelines, options, ranking).expect("a sort");
            (name, sort, Vec::new())
        })
        .collect();
    // What is timed holds `repeats` sorts, each of the given pairs; the time to give them is taken off.
    let give = |recorder: &mut Recorder| {
        recorder.encoder().copy_buffer_to_buffer(&given, 0, &sorted, 0, bytes);
        recorder.encoder().copy_buffer_to_buffer(&given_values, 0, &sorted_values, 0, bytes);
    };
    for round in 0..=rounds {
        for (_, sort, times) in &mut sorts {
            let both = run(gpu, &mut cache, |recorder| {
                for _ in 0..repeats {
                    give(recorder);
                    sort.record(recorder, &sorted, &sorted_values, None).expect("recorded");
                }
            });
            let giving = run(gpu, &mut cache, |recorder| (0..repeats).for_each(|_| give(recorder)));
            // The first round compiles.
            if round > 0 {
                times.push((both - giving) / repeats as f64);
            }
        }
    }
    let times: Vec<_> = sorts.into_iter().map(|(name, sort, times)| (name, sort, median(times))).collect();
    let base = times[0].2;
    let row = |(sort, it, time): (&'static str, Sort, f64)| {
        let moved = it.traffic_bytes(count);
        let rate = moved as f64 / time;
        let moved = Some((moved, rate * 1e-9, rate / copy_rate));
        Row { sort, threads: 0, count: count as usize, rate: f64::from(count) / time * 1e-6, ratio: time / base, moved }
            .print()
    };
    times.into_iter().map(row).collect()
}

fn csv(rows: &[Row]) -> String {
    let mut text = String::from("sort,threads,count,m_pairs_per_s,time_ratio,bytes,gb_per_s,share_of_copy\n");
    for r in rows {
        text += &format!("\"{}\",{},{},{:.4},{:.4},", r.sort, r.threads, r.count, r.rate, r.ratio);
        text += &match r.moved {
            Some((bytes, rate, share)) => format!("{bytes},{rate:.4},{share:.4}\n"),
            None => ",,\n".to_owned(),
        };
    }
    text
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let quick = has("--quick");
    let rounds = if quick { 1 } else { 9 };
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let counts: &[usize] = if quick { &[5000] } else { &[1000, 10_000, 100_000, 1_000_000, 10_000_000] };
    let mut rows = Vec::new();
    println!("cpu, 32-bit keys with 32-bit values, ratio to rdst's time:");
    for &count in counts {
        for threads in if threads > 1 { vec![1, threads] } else { vec![1] } {
            rows.extend(cpu(count, threads, rounds));
        }
    }
    if !has("--no-gpu") {
        let gpu = Gpu::any().expect("an adapter");
        let is_hardware = gpu.info.device_type != wgpu::DeviceType::Cpu;
        let copied = if is_hardware { 1 << 28 } else { 1 << 26 };
        let copy_rate = copy_rate(&gpu, if quick { 1 << 20 } else { copied }, rounds);
        println!(
            "{}: copies at {:.2} GB/s, read and written; ratio to the portable ranking:",
            gpu.info.name,
            copy_rate * 1e-9
        );
        let counts: &[u32] = match (quick, is_hardware) {
            (true, _) => &[5000],
            (false, false) => &[10_000, 100_000, 1_000_000],
            (false, true) => &[10_000, 100_000, 1_000_000, 16_000_000],
        };
        for &count in counts {
            let repeats = if is_hardware { 16 } else { 2 };
            rows.extend(gpu_sorts(&gpu, count, rounds, repeats, copy_rate));
        }
    }
    if let Some(at) = arguments.iter().position(|a| a == "--out") {
        let folder = arguments.get(at + 1).expect("--out wants a folder");
        std::fs::create_dir_all(folder).expect("the folder can be made");
        std::fs::write(format!("{folder}/sort.csv"), csv(&rows)).expect("sort.csv can be written");
    }
}
