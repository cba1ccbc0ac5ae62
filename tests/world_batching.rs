//! Ways of batching in a world: they may change between steps, on both sides alike. Oracle: which contacts are with the
//! floor, and what each way promises of their batches.

mod common;

use tumble::{Batching, Contact, Params, RigidBodyType, World, cpu, gpu};
use tumble_core::layout::LAST_BATCH;
use tumble_core::scenes;

/// Batches of contacts with what does not move, and of the others.
fn batches(world: &mut World) -> [Vec<u32>; 2] {
    let contacts = world.contacts().unwrap();
    let scene = world.scene();
    let moves = |body| scene.body(body).unwrap().body_type == RigidBodyType::Dynamic;
    let (between, fixed): (Vec<Contact>, Vec<Contact>) =
        contacts.all.iter().partition(|contact| moves(contact.body_a) && moves(contact.body_b));
    [fixed, between].map(|contacts| contacts.iter().map(|contact| contact.batch).collect())
}

#[test]
fn ways_may_change_between_steps() {
    let params = Params { static_contacts_last: true, ..Params::default() };
    let scene = scenes::pyramid(12);
    let cpu = cpu::World::new(scene.clone(), params).unwrap();
    let gpu = gpu::World::with_gpu(common::gpu().clone(), scene, params).unwrap();
    let worlds = [World::Cpu(Box::new(cpu)), World::Gpu(Box::new(gpu))];
    let mut seen = Vec::new();
    for mut world in worlds {
        let mut seen_here = Vec::new();
        for (batching, last) in [
            (Batching::Persistent, true),
            (Batching::Persistent, false),
            (Batching::WriteAndVerify, false),
            (Batching::Persistent, true),
            (Batching::LowestFree, true),
            (Batching::LowestFree, false),
            (Batching::WriteAndVerify, true),
        ] {
            let what = format!("{batching}, static last: {last}");
            world.set_params(Params { batching, static_contacts_last: last, ..Params::default() }).unwrap();
            for _ in 0..3 {
                world.step().unwrap();
            }
            let report = world.sync().unwrap();
            let [fixed, between] = batches(&mut world);
            assert!(fixed.len() == 12 && between.len() == 132, "{what}: {report}");
            // A box of the wall meets six others at most, and the floor once.
            assert!(between.iter().all(|&batch| batch < 12), "{what}: {between:?}");
            let from_above = fixed.iter().filter(|&&batch| batch > LAST_BATCH - 7).count();
            assert_eq!(from_above, if last { 12 } else { 0 }, "{what}: {fixed:?}");
            // Few new contacts come, so that rounds tell whether any batch was kept.
            assert_eq!(report.batch_rounds == 0, batching == Batching::Persistent, "{what}: {report}");
            seen_here.push((report.batches, report.batch_rounds, fixed, between));
        }
        seen.push(seen_here);
    }
    assert_eq!(seen[0], seen[1]);
}

/// More rounds than fit one kind of dispatch, and claims cleared between: the same on both sides.
#[test]
fn hubs_are_batched_alike_in_every_way() {
    let scene = scenes::hub(150);
    for batching in [Batching::WriteAndVerify, Batching::LowestFree, Batching::Persistent] {
        for static_contacts_last in [false, true] {
            let params = Params { batching, static_contacts_last, ..Params::default() };
            let cpu = cpu::World::new(scene.clone(), params).unwrap();
            let gpu = gpu::World::with_gpu(common::gpu().clone(), scene.clone(), params).unwrap();
            let worlds = [World::Cpu(Box::new(cpu)), World::Gpu(Box::new(gpu))];
            let [on_cpu, on_gpu] = worlds.map(|mut world| {
                world.step().unwrap();
                let report = world.sync().unwrap();
                assert!(report.last_batch > 80, "{report}");
                (report.batches, report.batch_rounds, report.last_batch, batches(&mut world))
            });
            assert_eq!(on_cpu, on_gpu, "{batching}, static last: {static_contacts_last}");
        }
    }
}
