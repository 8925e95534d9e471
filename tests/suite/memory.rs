//! Storages share the memory of a side if it fits them and they do not live at the same time.

use std::collections::BTreeMap;

use epigraph_core::{Life, Plan, Settings, Side, SlotId, Step, StorageId, Value};
use epigraph_tests::{GRAPHS, Run, Stage, graph, sampled};

/// The first and the last step that uses each storage on a side.
fn spans(plan: &Plan, side: Side) -> BTreeMap<StorageId, [usize; 2]> {
    let mut spans = BTreeMap::new();
    for (at, step) in plan.steps.iter().enumerate() {
        let used: Vec<StorageId> = match step {
            Step::Run(node) if plan.nodes[*node].side == side => {
                plan.nodes[*node].values().map(|value| value.storage).collect()
            }
            Step::Upload(Value { storage, .. }) | Step::Download(Value { storage, .. }, _) => vec![*storage],
            Step::Tap { tap, field } => {
                let field = &plan.taps[*tap].fields[*field];
                if field.side == side { vec![field.storage] } else { Vec::new() }
            }
            Step::Run(_) => Vec::new(),
        };
        for storage in used {
            spans.entry(storage).or_insert([at, at])[1] = at;
        }
    }
    spans
}

#[test]
fn nothing_that_shares_memory_lives_at_the_same_time() {
    for name in GRAPHS {
        for side in [Side::Cpu, Side::Gpu] {
            let settings = Settings { side, ..sampled([64, 48], 0.05) };
            let run = Run::new(&graph(name), Stage { scene: "cornell", camera: "orbit", settings });
            let plan = run.executor.plan();
            for side in Side::ALL {
                let spans = spans(plan, side);
                let mut users: BTreeMap<SlotId, Vec<(&str, [usize; 2])>> = BTreeMap::new();
                for (id, storage) in plan.storages.iter_enumerated() {
                    let Some(pair) = storage.slots[side] else { continue };
                    for slot in pair.both() {
                        let memory = &plan.slots[side][slot];
                        let same = memory.element == storage.element && memory.dims == storage.dims;
                        let fits = same || side == Side::Cpu && memory.bytes() >= storage.bytes();
                        assert!(fits, "{name}: {} on {side}", storage.name);
                    }
                    let kept = storage.life != Life::Transient;
                    // What a node only owns is used by none.
                    let span = spans.get(&id).filter(|_| !kept).copied().unwrap_or([0, usize::MAX]);
                    for (other, [first, last]) in users.entry(pair.both()[0]).or_default().iter() {
                        let apart = span[1] < *first || *last < span[0];
                        assert!(apart, "{name}: {} and {other} share memory on {side}", storage.name);
                    }
                    users.entry(pair.both()[0]).or_default().push((&storage.name, span));
                }
            }
        }
    }
}

#[test]
fn the_cpu_holds_little_more_than_what_lives_at_once() {
    for name in GRAPHS {
        let settings = sampled([512, 384], 0.05);
        let run = Run::new(&graph(name), Stage { scene: "cornell", camera: "orbit", settings });
        let plan = run.executor.plan();
        let spans = spans(plan, Side::Cpu);
        let held = |step: usize| -> u64 {
            let live = |id: &StorageId, life: Life| {
                life != Life::Transient
                    || spans.get(id).is_some_and(|[first, last]| (*first..=*last).contains(&step))
            };
            let storages = plan.storages.iter_enumerated().filter(|(_, storage)| storage.slots.cpu.is_some());
            let live = storages.filter(|(id, storage)| live(id, storage.life));
            live.map(|(_, storage)| storage.bytes() * if storage.life == Life::History { 2 } else { 1 }).sum()
        };
        let least = (0..plan.steps.len()).map(held).max().unwrap_or(0);
        let bytes = plan.bytes(Side::Cpu);
        println!("{name}: {bytes} bytes, {least} at once");
        // Slots of other sizes and times do not always fit without a remainder.
        assert!(
            least <= bytes && bytes as f64 <= 1.15 * least as f64,
            "{name}: {bytes} bytes, {least} at once"
        );
    }
}
