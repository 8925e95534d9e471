//! Helpers of the stages' tests: one stage on both sides, on data that a test gives.

use std::{
    fmt::Debug,
    sync::{Arc, OnceLock},
};

use bytemuck::Pod;
use epigraph_core::{AdapterChoice, Gpu, Harness, Host, Outputs, Settings, Side, Stage};

/// Settings for a frame of this size, with transients poisoned: a stage that reads what it has not written shows.
pub fn settings(size: [u32; 2], samples: u32) -> Settings {
    Settings { poison: true, ..Settings::new(size, samples) }
}

/// The tests' GPU.
///
/// # Panics
/// Where there is none, naming the packages that bring one: GPU tests never skip.
pub fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    let open = || Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}")));
    GPU.get_or_init(open).clone()
}

/// Runs a frame of the twin.
pub fn run_cpu<S: Stage>(harness: &mut Harness<S>) -> Outputs {
    run(harness, Side::Cpu)
}

/// Runs a frame of the twin, and one of the shader.
pub fn run_both<S: Stage>(harness: &mut Harness<S>) -> Both {
    Both { cpu: run(harness, Side::Cpu), gpu: run(harness, Side::Gpu) }
}

fn run<S: Stage>(harness: &mut Harness<S>, side: Side) -> Outputs {
    let gpu = (side == Side::Gpu).then(gpu);
    harness
        .run(side, &crate::registry(), &Host::default(), gpu)
        .unwrap_or_else(|error| panic!("{side}: {error}"))
}

/// What the twin and the shader wrote from the same inputs.
pub struct Both {
    /// The twin's outputs.
    pub cpu: Outputs,
    /// The shader's outputs.
    pub gpu: Outputs,
}

impl Both {
    /// Asserts that an output has the same elements on both sides.
    #[track_caller]
    pub fn assert_equal<T: Pod + PartialEq + Debug>(&self, name: &str) {
        self.assert_equal_but::<T>(name, 0);
    }

    /// Asserts that at most `allowed` elements of an output differ. The caller says why any may.
    #[track_caller]
    pub fn assert_equal_but<T: Pod + PartialEq + Debug>(&self, name: &str, allowed: usize) {
        let (cpu, gpu) = (self.cpu.get::<T>(name), self.gpu.get::<T>(name));
        assert_eq!(cpu.len(), gpu.len(), "`{name}`");
        let mut differing = (0..cpu.len()).filter(|&index| cpu[index] != gpu[index]);
        if let Some(first) = differing.next() {
            let count = 1 + differing.count();
            let (cpu, gpu) = (&cpu[first], &gpu[first]);
            assert!(
                count <= allowed,
                "`{name}`: {count} elements differ, {allowed} may; element {first} is {cpu:?} on the CPU, {gpu:?} on the GPU"
            );
        }
    }

    /// Asserts that no number of an output differs by more than `tolerance`. The caller says why any may.
    #[track_caller]
    pub fn assert_close(&self, name: &str, tolerance: f32) {
        let (cpu, gpu) = (self.cpu.get::<f32>(name), self.gpu.get::<f32>(name));
        assert_eq!(cpu.len(), gpu.len(), "`{name}`");
        for (index, (cpu, gpu)) in cpu.into_iter().zip(gpu).enumerate() {
            // The negation catches NaN on either side.
            let close = cpu == gpu || (cpu - gpu).abs() <= tolerance;
            assert!(
                close,
                "`{name}`: number {index} is {cpu} on the CPU, {gpu} on the GPU, tolerance {tolerance}"
            );
        }
    }
}

/// Random numbers for test data (SplitMix64).
pub struct Random(pub u64);

impl Random {
    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x >> 32) as u32
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: u32) -> u32 {
        self.bits() % end
    }

    /// A number from `low` to `high`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.bits() >> 8) as f32 / (1 << 24) as f32
    }
}
