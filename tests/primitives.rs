//! Scan, compaction, sort and dispatch arguments on the GPU: exactly what the CPU mirror, and Rust's own stable sort,
//! give, in every order of invocations; and the parallel sort on the CPU. Oracles: the mirror, the standard library.

mod common;
#[path = "common/words.rs"]
mod words;

use common::gpu;
use tumble_core::Error;
use tumble_cpu::primitives::{compact, exclusive_scan, radix_sort, radix_sort_by};
use tumble_gpu::pipelines::build_pass;
use tumble_gpu::primitives::{
    Args, Compact, CompactOptions, Count, Job, Ranking, Scan, ScanOptions, Sort, SortOptions,
};
use tumble_gpu::{Bind, BindCache, Buffers, Gpu, Pipelines, Recorder, Shader, recorder};
use words::{download, run, upload};

const SIZES: &[u32] = &[0, 1, 2, 255, 256, 257, 2047, 2048, 2049, 3000, 65_535, 65_536, 65_537, 300_000];
const PERMUTATIONS: [u32; 3] = [0, 1, 2];
/// Words of the buffer of counts, and what they hold where nothing else was written.
const COUNTS: usize = 8;
const UNTOUCHED: u32 = 0xdead_beef;

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

/// Arrays that have gone wrong before: all equal, sorted, reversed, random.
fn patterns(length: usize, seed: u64) -> [Vec<u32>; 4] {
    let mut random = Random(seed);
    let ascending = |i: usize| (i as u32).wrapping_mul(7);
    [
        vec![0x0102_0304; length],
        (0..length).map(ascending).collect(),
        (0..length).rev().map(ascending).collect(),
        (0..length).map(|_| random.next()).collect(),
    ]
}

fn counts_with(count: Count, size: u32) -> Vec<u32> {
    let mut counts = vec![UNTOUCHED; COUNTS];
    if let Count::Word(word) = count {
        counts[word as usize] = size;
    }
    counts
}

#[test]
fn scan_gives_the_mirrors_sums() {
    for permute in PERMUTATIONS {
        let mut pipelines = Pipelines::permuted(permute);
        for &size in SIZES {
            for (pattern, data) in patterns(size as usize + 9, 1).into_iter().enumerate() {
                for count in [Count::Host(size), Count::Word(3)] {
                    let options = ScanOptions { capacity: size + 5, count, total: Some(6) };
                    let scan = Scan::new(gpu(), &mut pipelines, options).unwrap();
                    let (gpu_data, gpu_counts) = (upload(&data), upload(&counts_with(count, size)));
                    run(|recorder| scan.record(recorder, &gpu_data, Some(&gpu_counts)).unwrap());

                    let mut expected = data.clone();
                    let mut expected_counts = counts_with(count, size);
                    expected_counts[6] = exclusive_scan(&mut expected[..size as usize]);
                    let what = format!("size {size}, pattern {pattern}, {count:?}, permuted {permute}");
                    assert!(download(&gpu_data, data.len()) == expected, "{what}");
                    assert_eq!(download(&gpu_counts, COUNTS), expected_counts, "{what}");
                }
            }
        }
    }
}

/// More blocks than one workgroup scans in a turn.
#[test]
fn scan_goes_past_two_levels() {
    const SIZE: u32 = 5_000_000;
    let data = patterns(SIZE as usize, 5)[3].clone();
    let mut expected = data.clone();
    let total = exclusive_scan(&mut expected);
    let mut pipelines = Pipelines::permuted(2);
    for count in [Count::Host(SIZE), Count::Word(0)] {
        let scan = Scan::new(gpu(), &mut pipelines, ScanOptions { capacity: SIZE, count, total: Some(1) }).unwrap();
        let (gpu_data, counts) = (upload(&data), upload(&[SIZE, UNTOUCHED]));
        run(|recorder| scan.record(recorder, &gpu_data, Some(&counts)).unwrap());
        assert_eq!(download(&counts, 2), [SIZE, total], "{count:?}");
        assert!(download(&gpu_data, data.len()) == expected, "{count:?}");
    }
}

/// Compacts on the GPU, with flags and room behind the elements, and checks that the room stays as it was.
fn check_compact(
    pipelines: &mut Pipelines,
    flags: &[u32],
    values: Option<&[u32]>,
    count: Count,
    size: u32,
    what: &str,
) {
    let options = CompactOptions { capacity: size + 2, count, kept: 6 };
    let compaction = Compact::new(gpu(), pipelines, options).unwrap();
    let [gpu_flags, kept, counts] = [flags, &vec![UNTOUCHED; flags.len()], &counts_with(count, size)].map(upload);
    let gpu_values = values.map(upload);
    run(|recorder| compaction.record(recorder, &gpu_flags, gpu_values.as_ref(), &kept, &counts).unwrap());

    let mut expected = compact(&flags[..size as usize], values);
    let mut expected_counts = counts_with(count, size);
    expected_counts[6] = expected.len() as u32;
    assert_eq!(download(&counts, COUNTS), expected_counts, "counts, {what}");
    expected.resize(flags.len(), UNTOUCHED);
    assert!(download(&kept, flags.len()) == expected, "kept, {what}");
}

#[test]
fn compaction_keeps_what_the_mirror_keeps() {
    for permute in PERMUTATIONS {
        let mut pipelines = Pipelines::permuted(permute);
        for &size in SIZES {
            let length = size as usize + 5;
            let [all, _, values, random] = patterns(length, 6);
            let some = |share: u32| random.iter().map(|word| word * u32::from(word % 8 < share)).collect();
            for (pattern, flags) in [all, vec![0; length], some(1), some(4), some(7)].iter().enumerate() {
                for count in [Count::Host(size), Count::Word(1)] {
                    let what = format!("size {size}, pattern {pattern}, {count:?}, order {permute}");
                    let values = (pattern % 2 == 1 || matches!(count, Count::Word(_))).then_some(&values[..]);
                    check_compact(&mut pipelines, flags, values, count, size, &what);
                }
            }
        }
    }
}

/// More blocks than one workgroup scans alone.
#[test]
fn compaction_goes_past_two_levels() {
    const SIZE: u32 = 17_000_000;
    let random = patterns(SIZE as usize + 5, 7)[3].clone();
    let flags: Vec<u32> = random.iter().map(|word| word & 4).collect();
    check_compact(&mut Pipelines::new(), &flags, None, Count::Word(0), SIZE, "17 M");
}

#[test]
fn scan_takes_no_more_than_its_capacity() {
    let mut pipelines = Pipelines::new();
    for capacity in [1000, 20_000] {
        let options = ScanOptions { capacity, count: Count::Word(0), total: Some(1) };
        let scan = Scan::new(gpu(), &mut pipelines, options).unwrap();
        let (data, counts) = (upload(&vec![1; 30_000]), upload(&[u32::MAX, 0]));
        run(|recorder| scan.record(recorder, &data, Some(&counts)).unwrap());
        assert_eq!(download(&counts, 2), [u32::MAX, capacity]);
        let ones_stay = |i: u32| if i < capacity { i } else { 1 };
        assert_eq!(download(&data, 30_000), (0..30_000).map(ones_stay).collect::<Vec<_>>());
    }
}

fn sort_options(count: u32) -> SortOptions {
    SortOptions { capacity: count, count: Count::Host(count), bits: vec![32] }
}

#[test]
fn what_a_scan_or_sort_cannot_do_is_refused() {
    let mut pipelines = Pipelines::new();
    let new = |count| ScanOptions { capacity: 10, count, total: None };
    let error = Scan::new(gpu(), &mut pipelines, new(Count::Host(11))).unwrap_err();
    assert_eq!(error, Error::Capacity { buffer: "scan", needed: 11, capacity: 10 });
    let mut scan = Scan::new(gpu(), &mut pipelines, new(Count::Host(1))).unwrap();
    assert!(scan.set_count(gpu(), 11).is_err());
    scan.set_count(gpu(), 10).unwrap();
    let data = upload(&[2; 12]);
    run(|recorder| scan.record(recorder, &data, None).unwrap());
    assert_eq!(download(&data, 12), [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 2, 2]);
    let mut scan = Scan::new(gpu(), &mut pipelines, new(Count::Word(1))).unwrap();
    assert!(matches!(scan.set_count(gpu(), 1), Err(Error::Invalid { field: "count", .. })));
    run(|recorder| {
        let refused = scan.record(recorder, &data, None);
        assert!(matches!(refused, Err(Error::Invalid { field: "counts", .. })), "{refused:?}");
    });
    for bits in [vec![], vec![33], vec![1; 5]] {
        let options = SortOptions { capacity: 10, count: Count::Host(1), bits };
        assert!(matches!(Sort::new(gpu(), &mut pipelines, options), Err(Error::Invalid { field: "bits", .. })));
    }
    let options = CompactOptions { capacity: 10, count: Count::Word(1), kept: 1 };
    assert!(matches!(Compact::new(gpu(), &mut pipelines, options), Err(Error::Invalid { field: "kept", .. })));
    let options = CompactOptions { capacity: 10, count: Count::Host(11), kept: 1 };
    assert!(matches!(Compact::new(gpu(), &mut pipelines, options), Err(Error::Capacity { needed: 11, .. })));
    let (device, queue) = wgpu::Device::noop(&wgpu::DeviceDescriptor::default());
    let (plain, options) = (Gpu::from_device(device, queue), SortOptions { bits: vec![8], ..sort_options(10) });
    let refused = Sort::with_ranking(&plain, &mut Pipelines::new(), options.clone(), Ranking::Subgroup);
    assert!(matches!(refused, Err(Error::Invalid { field: "ranking", .. })), "{refused:?}");
    Sort::new(&plain, &mut Pipelines::new(), options).unwrap();
    let huge = ScanOptions { capacity: u32::MAX, count: Count::Word(0), total: None };
    assert!(matches!(Scan::new(gpu(), &mut pipelines, huge), Err(Error::Capacity { .. })));
}

/// Keys and values sorted by the standard library: by the lowest bits of each word, first word first.
fn std_sort(keys: &[u32], bits: &[u32], values: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let words = bits.len();
    let mask = |bits: u32| ((1u64 << bits) - 1) as u32;
    let key = |i: &usize| -> Vec<u32> { (0..words).map(|w| keys[i * words + w] & mask(bits[w])).collect() };
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by_cached_key(key);
    let sorted_keys = order.iter().flat_map(|&i| keys[i * words..][..words].iter().copied()).collect();
    (sorted_keys, order.iter().map(|&i| values[i]).collect())
}

/// The rankings that the device has.
fn rankings() -> Vec<Ranking> {
    let all = [Ranking::Portable, Ranking::Subgroup];
    all.into_iter().filter(|ranking| *ranking == Ranking::Portable || gpu().has_subgroups()).collect()
}

/// Keys of this many bits a word and how many there are, where their number comes from, and who ranks them.
#[derive(Debug)]
struct Case<'a> {
    bits: &'a [u32],
    count: Count,
    size: u32,
    ranking: Ranking,
}

/// Sorts on the GPU with spare room behind the elements, and checks both oracles and that the room stays as it was.
fn check_sort(pipelines: &mut Pipelines, keys: &[u32], case: &Case, what: &str) {
    let &Case { bits, count, size, ranking } = case;
    let words = bits.len();
    let used = size as usize;
    let values: Vec<u32> = (0..used as u32 + 3).map(|i| i ^ 0x5555).collect();
    let options = SortOptions { capacity: size + 2, count, bits: bits.to_vec() };
    let sort = Sort::with_ranking(gpu(), pipelines, options, ranking).unwrap();
    let (gpu_keys, gpu_values) = (upload(keys), upload(&values));
    let gpu_counts = upload(&counts_with(count, size));
    let counts = matches!(count, Count::Word(_)).then_some(&gpu_counts);
    run(|recorder| sort.record(recorder, &gpu_keys, &gpu_values, counts).unwrap());

    let (mut expected_keys, mut expected_values) = std_sort(&keys[..used * words], bits, &values[..used]);
    let (mut mirror_keys, mut mirror_values) = (keys[..used * words].to_vec(), values[..used].to_vec());
    radix_sort(&mut mirror_keys, words, bits, &mut mirror_values);
    assert!(mirror_keys == expected_keys && mirror_values == expected_values, "the mirror, {case:?}, {what}");
    expected_keys.extend_from_slice(&keys[used * words..]);
    expected_values.extend_from_slice(&values[used..]);
    assert!(download(&gpu_keys, keys.len()) == expected_keys, "keys, {case:?}, {what}");
    assert!(download(&gpu_values, values.len()) == expected_values, "values, {case:?}, {what}");
}

#[test]
fn sort_gives_the_mirrors_order() {
    // Also one block of the shader, and one element more and less.
    const SIZES: &[u32] = &[0, 1, 2, 255, 256, 257, 3071, 3072, 3073, 65_535, 65_536, 65_537];
    for (permute, ranking) in PERMUTATIONS.into_iter().flat_map(|p| rankings().into_iter().map(move |r| (p, r))) {
        let mut pipelines = Pipelines::permuted(permute);
        for &size in SIZES {
            // Whole words, and some bits of them: an odd number of digits, digits of 1 to 8 bits, an empty word.
            for bits in [&[32][..], &[17], &[9, 14], &[1, 0, 12]] {
                let length = (size as usize + 3) * bits.len();
                for (pattern, keys) in patterns(length, 2).iter().enumerate() {
                    // The long arrays cost most: all patterns of one kind of key, one pattern of the others.
                    let is_long = size > 10_000;
                    if is_long && pattern != 3 && (permute > 0 || bits != [17]) {
                        continue;
                    }
                    for count in [Count::Host(size), Count::Word(1)] {
                        if is_long && (count == Count::Host(size)) != (size == 65_536) {
                            continue;
                        }
                        let case = Case { bits, count, size, ranking };
                        check_sort(&mut pipelines, keys, &case, &format!("pattern {pattern}, order {permute}"));
                    }
                }
            }
        }
    }
}

#[test]
fn sort_of_a_million() {
    let keys = patterns(1_000_003, 8);
    for ranking in rankings() {
        for (pattern, count) in [(0, Count::Host(1_000_000)), (3, Count::Word(4))] {
            let case = Case { bits: &[30], count, size: 1_000_000, ranking };
            check_sort(&mut Pipelines::permuted(2), &keys[pattern], &case, "");
        }
    }
}

#[test]
fn sort_of_no_bits_leaves_all_as_it_is() {
    let keys = patterns(600 * 4, 3)[3].clone();
    let mut pipelines = Pipelines::new();
    for ranking in rankings() {
        let none = Case { bits: &[0, 0, 0], count: Count::Host(500), size: 500, ranking };
        check_sort(&mut pipelines, &keys[..3 * 503], &none, "no bits");
        let four = Case { bits: &[3, 1, 2, 5], count: Count::Word(2), size: 500, ranking };
        check_sort(&mut pipelines, &keys[..4 * 503], &four, "four words");
    }
}

#[test]
fn sort_says_where_it_leaves_the_result() {
    let keys = patterns(5000, 9)[3].clone();
    let values: Vec<u32> = (0..5000).collect();
    for (bits, is_moved) in [(17, true), (16, false)] {
        let mut pipelines = Pipelines::new();
        let options = SortOptions { bits: vec![bits], ..sort_options(5000) };
        let sort = Sort::new(gpu(), &mut pipelines, options).unwrap();
        let (gpu_keys, gpu_values) = (upload(&keys), upload(&values));
        let (buffers, mut cache) = (Buffers::new(), BindCache::new());
        let mut recorder = Recorder::new(gpu(), &buffers, &mut cache, None);
        let (at, values_at) = sort.record_moving(&mut recorder, &gpu_keys, &gpu_values, None).unwrap();
        recorder.submit().unwrap();
        assert_eq!((*at != gpu_keys, *values_at != gpu_values), (is_moved, is_moved), "{bits} bits");
        let (expected_keys, expected_values) = std_sort(&keys, &[bits], &values);
        assert!(download(at, 5000) == expected_keys && download(values_at, 5000) == expected_values, "{bits} bits");
    }
}

/// Two blocks. 16 bits are two digits of 8; 17 bits are three of 6 at most, and a copy back.
#[test]
fn sort_counts_its_traffic() {
    let mut pipelines = Pipelines::new();
    let mut traffic = |bits| Sort::new(gpu(), &mut pipelines, sort_of(bits)).unwrap().traffic_bytes(6000);
    fn sort_of(bits: u32) -> SortOptions {
        SortOptions { bits: vec![bits], ..sort_options(6000) }
    }
    assert_eq!(traffic(16), 2 * (6000 * (4 + 16) + 5 * 2 * 256 * 4));
    assert_eq!(traffic(17), 3 * (6000 * (4 + 16) + 5 * 2 * 64 * 4) + 6000 * 16);
}

#[test]
fn the_parallel_sort_is_the_stable_sort_for_any_number_of_threads() {
    let mut scratch = Vec::new();
    for threads in [1, 2, 4] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for size in [0, 1, 47, 48, 49, 255, 256, 257, 4096, 65_535, 65_536, 65_537, 1_000_000] {
            for (pattern, keys) in patterns(size, 10).iter().enumerate() {
                for (mask, bits) in [(u32::MAX, 32..64), (0xff_ff80, 39..56), (0x7, 32..35)] {
                    // A Morton code above an index, as one word, in whatever order; and a struct of the two.
                    let all: Vec<u64> = (0..).zip(keys).map(|(i, key)| u64::from(*key) << 32 | i).collect();
                    let mut expected = all.clone();
                    expected.sort_by_key(|word| (word >> 32) as u32 & mask);
                    let mut sorted = all.clone();
                    pool.install(|| radix_sort_by(&mut sorted, &mut scratch, bits.clone(), |word| *word));
                    assert!(sorted == expected, "{size} words, pattern {pattern}, bits {bits:?}, {threads} threads");

                    let mut pairs: Vec<(u64, u32)> = all.iter().map(|word| (*word, *word as u32)).collect();
                    pool.install(|| radix_sort_by(&mut pairs, &mut Vec::new(), bits.clone(), |pair| pair.0));
                    let is_same = pairs.iter().zip(&expected).all(|(pair, word)| *pair == (*word, *word as u32));
                    assert!(is_same, "{size} pairs, pattern {pattern}, bits {bits:?}, {threads} threads");
                }
            }
        }
    }
}

/// The same objects, recorded twice in one submission, and again in the next: a step makes no bind groups after the
/// first.
#[test]
fn recording_again_gives_the_same_and_binds_nothing_anew() {
    let mut pipelines = Pipelines::new();
    let options = SortOptions { capacity: 5000, count: Count::Host(5000), bits: vec![20] };
    let sort = Sort::new(gpu(), &mut pipelines, options).unwrap();
    let keys = patterns(5000, 4)[3].clone();
    let values: Vec<u32> = (0..5000).collect();
    let (gpu_keys, gpu_values) = (upload(&keys), upload(&values));
    let (buffers, mut cache) = (Buffers::new(), BindCache::new());
    let mut created = Vec::new();
    let (expected_keys, expected_values) = std_sort(&keys, &[20], &values);
    // Longer than a bind group that is not used is kept.
    for _ in 0..70 {
        gpu().queue.write_buffer(&gpu_keys, 0, bytemuck::cast_slice(&keys));
        gpu().queue.write_buffer(&gpu_values, 0, bytemuck::cast_slice(&values));
        let mut recorder = Recorder::new(gpu(), &buffers, &mut cache, None);
        sort.record(&mut recorder, &gpu_keys, &gpu_values, None).unwrap();
        sort.record(&mut recorder, &gpu_keys, &gpu_values, None).unwrap();
        recorder.submit().unwrap();
        created.push(cache.created());
        assert!(download(&gpu_keys, 5000) == expected_keys && download(&gpu_values, 5000) == expected_values);
    }
    assert!(created[0] > 0 && created.iter().all(|count| *count == created[0]), "{created:?}");
}

#[test]
fn arguments_on_the_gpu_are_those_of_the_host() {
    let counts = [0, 1, 1024, 1025, 65_535 * 256, 65_535 * 256 + 1, 123_456_789, u32::MAX];
    let gpu_counts = upload(&counts);
    for permute in PERMUTATIONS {
        let mut pipelines = Pipelines::permuted(permute);
        for (each, limit) in [(256, u32::MAX), (1, u32::MAX), (131_072, u32::MAX), (256, 100_000)] {
            let jobs: Vec<_> = (0..counts.len() as u32).map(|word| Job::new(word, limit, each)).collect();
            let args = Args::new(gpu(), &mut pipelines, &jobs).unwrap();
            run(|recorder| args.record(recorder, &gpu_counts).unwrap());
            let written = download(args.buffer(), counts.len() * 4);
            for (count, written) in counts.iter().zip(written.chunks_exact(4)) {
                let groups = (*count).min(limit).div_ceil(each);
                let (x, y) = recorder::split(groups);
                assert_eq!(written, [x, y, 1, 0], "{count} elements, {each} a workgroup");
                let all = u64::from(x) * u64::from(y);
                assert!(all >= groups.into() && all < u64::from(groups) + u64::from(y), "{groups} groups: {x} x {y}");
            }
        }
    }
}

/// More workgroups than one dimension holds, in every order: each index comes once.
#[test]
fn a_dispatch_of_two_dimensions_covers_everything_once() {
    const COUNT: u32 = 65_536 * 256 + 77;
    const MARK: &str = "//#import shared/thread.wgsl
@group(0) @binding(0) var<storage, read_write> marks: array<atomic<u32>>;
@compute @workgroup_size(256)
fn mark(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < 16777293u {
        atomicAdd(&marks[i / 4u], 1u << (8u * (i % 4u)));
    }
}";
    let sources: Vec<_> = tumble_shaders::SOURCES.iter().copied().chain([("mark", MARK)]).collect();
    let composed = tumble_shaders::compose_from(&sources, "mark").unwrap();
    for permute in PERMUTATIONS {
        let pass = build_pass(gpu(), Shader::parse(&composed).unwrap(), "mark", permute).unwrap();
        let words = COUNT.div_ceil(4) as usize;
        let marks = upload(&vec![0; words]);
        run(|recorder| recorder.dispatch(&pass, &[Bind::new("marks", &marks)], COUNT.div_ceil(256)).unwrap());
        let marks = download(&marks, words);
        assert!(marks[..words - 1].iter().all(|mark| *mark == 0x0101_0101), "order {permute}");
        assert_eq!(marks[words - 1], 1, "order {permute}");
    }
}
