//! Stages of work, each cut into blocks, for all threads of a pool inside one parallel section.
//!
//! A section of rayon for each of many short passes costs more than the passes: threads are woken, handed halves, and
//! waited for. Here they come once. Each claims blocks of the open stage, a share of its own first, so that it finds in
//! its cache what it had in the last stage like this, then what others left; the next stage opens when all blocks are
//! done. Nobody waits for a thread that has not come: what it might take, others take. The shape is that of Box2D 3
//! (Catto, "Solver2D", 2024).

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// Looks at the counter before a thread that waits lets others have its core.
const SPINS: u32 = 200;

/// How many threads may take part in what the caller runs: one outside a pool.
pub(crate) fn threads() -> usize {
    rayon::current_thread_index().map_or(1, |_| rayon::current_num_threads())
}

/// Into how many blocks to cut `items` of which no block should have less than `least`: a few a thread, so that one
/// that comes late or is sent away leaves its share to others.
pub(crate) fn blocks(items: usize, least: usize) -> u32 {
    (items / least).clamp(1, 4 * threads()) as u32
}

/// Block `block` of `count` of a range.
pub(crate) fn block_of(range: &std::ops::Range<usize>, block: u32, count: u32) -> std::ops::Range<usize> {
    let at = |block: u32| range.start + range.len() * block as usize / count as usize;
    at(block)..at(block + 1)
}

/// Calls `work(stage, block)` once for every block of every stage, of which stage s has `blocks[s]`, from the threads of
/// the pool that the caller is in. All blocks of a stage are done, and what they wrote is seen, before any of the next
/// begins; within a stage the order and the threads are left to chance, so blocks must not touch what others write.
pub(crate) fn run_stages(blocks: &[u32], work: impl Fn(usize, u32) + Sync) {
    let most = blocks.iter().copied().max().unwrap_or(0);
    let threads = threads().min(most as usize);
    if threads <= 1 {
        blocks.iter().enumerate().for_each(|(stage, &count)| (0..count).for_each(|block| work(stage, block)));
        return;
    }
    let claims = (0..most).map(|_| AtomicU32::new(0)).collect();
    let crew = Crew { blocks, work, threads, claims, done: AtomicU64::new(0), gone: AtomicBool::new(false) };
    rayon::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|_| crew.work_off());
        }
        crew.work_off();
    });
}

struct Crew<'a, W> {
    blocks: &'a [u32],
    work: W,
    threads: usize,
    /// One more than the last stage in which the block of this number was taken.
    claims: Vec<AtomicU32>,
    /// Blocks done, of all stages.
    done: AtomicU64,
    /// A thread panicked: what it had claimed will never be done.
    gone: AtomicBool,
}

impl<W: Fn(usize, u32) + Sync> Crew<'_, W> {
    fn work_off(&self) {
        let alarm = Alarm(&self.gone);
        // Blocks up to the end of the stage.
        let mut end = 0;
        for (stage, &count) in self.blocks.iter().enumerate() {
            end += u64::from(count);
            if self.done.load(Ordering::Acquire) >= end {
                // This thread came late.
                continue;
            }
            let taken = self.take_blocks(stage, count);
            if taken > 0 {
                self.done.fetch_add(taken, Ordering::Release);
            }
            if !self.wait_for(end) {
                break;
            }
        }
        std::mem::forget(alarm);
    }

    /// Does what blocks it gets of a stage that is open; how many.
    fn take_blocks(&self, stage: usize, count: u32) -> u64 {
        let own = rayon::current_thread_index().unwrap_or(0) % self.threads;
        let first = (own * count as usize / self.threads) as u32;
        let mut taken = 0;
        for block in (first..count).chain(0..first) {
            let claim = &self.claims[block as usize];
            let last = claim.load(Ordering::Relaxed);
            let ours = last <= stage as u32
                && claim.compare_exchange(last, stage as u32 + 1, Ordering::Relaxed, Ordering::Relaxed).is_ok();
            if ours {
                (self.work)(stage, block);
                taken += 1;
            }
        }
        taken
    }

    /// Waits until so many blocks are done; false when that will never be.
    fn wait_for(&self, end: u64) -> bool {
        let mut looks = 0;
        while self.done.load(Ordering::Acquire) < end {
            if self.gone.load(Ordering::Relaxed) {
                return false;
            }
            looks += 1;
            if looks < SPINS { std::hint::spin_loop() } else { std::thread::yield_now() }
        }
        true
    }
}

/// Tells the others when this thread unwinds, so that they do not wait for it; the panic goes on behind the section.
struct Alarm<'a>(&'a AtomicBool);

impl Drop for Alarm<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::{block_of, run_stages};
    use crate::shared::Shared;

    const BLOCKS: u32 = 61;
    const STAGES: usize = 600;

    /// What a block makes of its cell and those beside it, as they were after the stage before.
    fn next(before: &[u64], block: usize) -> u64 {
        let last = before.len() - 1;
        let around = [before[block.saturating_sub(1)], before[block], before[(block + 1).min(last)]];
        around.iter().fold(7, |sum: u64, cell| sum.rotate_left(9).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ cell)
    }

    fn run(threads: usize) -> Vec<u64> {
        let mut cells = [vec![1; BLOCKS as usize], vec![2; BLOCKS as usize]];
        // Stages of one block between the others, as batches are.
        let blocks: Vec<u32> = (0..STAGES).map(|stage| if stage % 5 == 3 { 1 } else { BLOCKS }).collect();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let [a, b] = &mut cells;
            let (a, b) = (Shared::new(a), Shared::new(b));
            run_stages(&blocks, |stage, block| {
                let (from, to) = if stage % 2 == 0 { (&a, &b) } else { (&b, &a) };
                // SAFETY: a stage writes one buffer and reads the other.
                let before: Vec<u64> = (0..BLOCKS as usize).map(|i| unsafe { from.get(i) }).collect();
                for i in block_of(&(0..BLOCKS as usize), block, blocks[stage]) {
                    // SAFETY: blocks of a stage have cells of their own.
                    unsafe { to.set(i, next(&before, i)) };
                }
            });
        });
        cells.concat()
    }

    /// Oracle: one thread, which works off block after block.
    #[test]
    fn stages_wait_for_each_other() {
        let alone = run(1);
        for threads in [2, 3, 7] {
            for _ in 0..20 {
                assert_eq!(run(threads), alone, "{threads} threads");
            }
        }
    }

    /// Nobody waits for a block that will never be done.
    #[test]
    fn a_panic_goes_on_behind_the_section() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let run = || pool.install(|| run_stages(&[8; 50], |stage, block| assert!((stage, block) != (20, 5))));
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).is_err());
    }
}
