use std::time::Instant;
use tumble::prelude::*;
use tumble_core::scenes;
fn go(name: &str, scene: Scene, sleep: Option<Sleep>, steps: usize) {
    let mut w = tumble_cpu::World::new(scene, Params { sleep, ..Params::default() }).unwrap();
    let t = Instant::now();
    let mut last = 0;
    for i in 0..steps {
        w.step().unwrap();
        let r = w.sync().unwrap();
        if (i + 1) % 120 == 0 || (r.asleep == 0) != (last == 0) {
            println!("{name} {i}: asleep {} islands {}+{} pairs {} manif {} lost {}", r.asleep, r.islands, r.islands_asleep, r.pairs, r.manifolds, r.lost);
        }
        last = r.asleep;
    }
    println!("{name}: {:?}", t.elapsed());
}
#[test]
fn explore() {
    for d in [1e-3, 2e-3, 4e-3, 8e-3] {
        let s = Some(Sleep { distance: d, time: 2.0 });
        println!("--- distance {d}");
        go("column", scenes::column(10), s, 600);
        go("pyramids", scenes::many_pyramids(4, 10), s, 600);
        go("pile", scenes::pile(1000), s, 1200);
        go("balls", scenes::balls(300), s, 1200);
    }
}
