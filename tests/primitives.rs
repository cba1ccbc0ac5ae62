//! Scan, sort and dispatch arguments on the GPU: exactly what the CPU mirror, and Rust's own stable sort, give, in
//! every order of invocations. Oracles: the mirror, the standard library.

mod common;

use common::{download, gpu, run, upload};
use tumble_core::Error;
use tumble_cpu::primitives::{exclusive_scan, radix_sort};
use tumble_gpu::pipelines::build_pass;
use tumble_gpu::primitives::{Args, Count, Job, Ranking, Scan, ScanOptions, Sort, SortOptions};
use tumble_gpu::{Bind, BindCache, Buffers, Pipelines, Recorder, Shader, recorder};

const SIZES: &[u32] = &[0, 1, 2, 255, 256, 257, 1023, 1024, 1025, 3000, 65_537, 300_000];
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

/// Sorts on the GPU with spare room behind the elements, and checks both oracles and that the room stays as it was.
fn check_sort(pipelines: &mut Pipelines, keys: &[u32], bits: &[u32], count: Count, size: u32, what: &str) {
    let words = bits.len();
    let used = size as usize;
    let values: Vec<u32> = (0..used as u32 + 3).map(|i| i ^ 0x5555).collect();
    let options = SortOptions { capacity: size + 2, count, bits: bits.to_vec() };
    let sort = Sort::with_ranking(gpu(), pipelines, options, Ranking::Subgroup).unwrap();
    let (gpu_keys, gpu_values) = (upload(keys), upload(&values));
    let gpu_counts = upload(&counts_with(count, size));
    let counts = matches!(count, Count::Word(_)).then_some(&gpu_counts);
    run(|recorder| sort.record(recorder, &gpu_keys, &gpu_values, counts).unwrap());

    let (mut expected_keys, mut expected_values) = std_sort(&keys[..used * words], bits, &values[..used]);
    let (mut mirror_keys, mut mirror_values) = (keys[..used * words].to_vec(), values[..used].to_vec());
    radix_sort(&mut mirror_keys, words, bits, &mut mirror_values);
    assert!(mirror_keys == expected_keys && mirror_values == expected_values, "the mirror, {what}");
    expected_keys.extend_from_slice(&keys[used * words..]);
    expected_values.extend_from_slice(&values[used..]);
    assert!(download(&gpu_keys, keys.len()) == expected_keys, "keys, {what}");
    assert!(download(&gpu_values, values.len()) == expected_values, "values, {what}");
}

#[test]
fn sort_gives_the_mirrors_order() {
    for permute in PERMUTATIONS {
        let mut pipelines = Pipelines::permuted(permute);
        for &size in SIZES {
            // Whole words, and some bits of them: an odd number of digits, a digit of less than 4 bits, an empty word.
            for bits in [vec![32], vec![17], vec![9, 14], vec![6, 0, 12]] {
                let length = (size as usize + 3) * bits.len();
                for (pattern, keys) in patterns(length, 2).into_iter().enumerate() {
                    // The long arrays cost most; a pattern each is enough in the other orders.
                    if size > 10_000 && permute > 0 && pattern != 3 {
                        continue;
                    }
                    for count in [Count::Host(size), Count::Word(1)] {
                        let what =
                            format!("{size} keys of {bits:?} bits, pattern {pattern}, {count:?}, order {permute}");
                        check_sort(&mut pipelines, &keys, &bits, count, size, &what);
                    }
                }
            }
        }
    }
}

#[test]
fn sort_of_no_bits_leaves_all_as_it_is() {
    let keys = patterns(600 * 4, 3)[3].clone();
    let mut pipelines = Pipelines::new();
    check_sort(&mut pipelines, &keys[..3 * 503], &[0, 0, 0], Count::Host(500), 500, "no bits");
    check_sort(&mut pipelines, &keys[..4 * 503], &[3, 1, 2, 5], Count::Word(2), 500, "four words");
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
