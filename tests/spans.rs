//! Spans of the feature `tracing`, on both sides. Oracle: a subscriber of the test's own that keeps what it is told; names
//! and nesting are those of the documentation.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, ThreadId};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};
use tumble_core::{Params, scenes};
use worlds::{Side, report, steps};

thread_local! {
    /// Spans that this thread is in.
    static INSIDE: RefCell<Vec<u64>> = const { RefCell::new(Vec::new()) };
}

/// Keeps every span: its name, the span that its thread was in, and how often it was entered less left.
#[derive(Default)]
struct Keeper {
    next: AtomicU64,
    spans: Mutex<HashMap<u64, Kept>>,
}

#[derive(Clone)]
struct Kept {
    name: &'static str,
    parent: Option<u64>,
    thread: ThreadId,
    entered: i32,
    times: u32,
}

impl Subscriber for &'static Keeper {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "tumble"
    }

    fn new_span(&self, attributes: &Attributes<'_>) -> Id {
        let id = self.next.fetch_add(1, Ordering::Relaxed) + 1;
        let parent = INSIDE.with_borrow(|inside| inside.last().copied());
        assert!(attributes.is_contextual());
        let name = attributes.metadata().name();
        let kept = Kept { name, parent, thread: thread::current().id(), entered: 0, times: 0 };
        self.spans.lock().unwrap().insert(id, kept);
        Id::from_u64(id)
    }

    fn enter(&self, id: &Id) {
        INSIDE.with_borrow_mut(|inside| inside.push(id.into_u64()));
        let mut spans = self.spans.lock().unwrap();
        let span = spans.get_mut(&id.into_u64()).unwrap();
        span.entered += 1;
        span.times += 1;
    }

    fn exit(&self, id: &Id) {
        assert_eq!(
            INSIDE.with_borrow_mut(Vec::pop),
            Some(id.into_u64()),
            "spans end on the thread and in the order they began"
        );
        self.spans.lock().unwrap().get_mut(&id.into_u64()).unwrap().entered -= 1;
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, _: &Event<'_>) {}
}

/// One test, since a subscriber is that of the whole program: threads of pools have to see it.
#[test]
fn a_span_a_step_and_one_a_stage() {
    let keeper: &'static Keeper = Box::leak(Box::default());
    tracing::subscriber::set_global_default(keeper).unwrap();
    for side in [Side::Cpu, Side::Gpu] {
        let mut world = side.world(&scenes::pile(40), &Params::default());
        keeper.spans.lock().unwrap().clear();
        steps(&mut world, 1);
        report(&mut world);
        let spans = keeper.spans.lock().unwrap().clone();
        assert!(spans.values().all(|span| span.entered == 0));
        let mut ids: Vec<_> = spans.keys().copied().collect();
        ids.sort_unstable();
        let names: Vec<_> = ids.iter().map(|id| spans[id].name).collect();
        let step = &spans[&ids[0]];
        assert_eq!((step.name, step.parent, step.thread), ("step", None, thread::current().id()));
        let within = |id: &u64| spans[id].parent == Some(ids[0]);
        match side {
            Side::Cpu => {
                let stages =
                    ["edit", "bounds", "broadphase", "contact", "narrowphase", "batch", "prepare", "solver", "motion"];
                assert_eq!(names[1..], stages);
                assert!(ids[1..].iter().all(within));
                // The step is entered where its stages run, too.
                assert_eq!(step.times, 2);
            }
            Side::Gpu => {
                assert_eq!(names[1..], ["upload", "record", "submit", "wait"]);
                assert!(ids[1..4].iter().all(within));
                assert_eq!(spans[&ids[4]].parent, None, "`sync` waits, after the step");
            }
        }
    }
}
