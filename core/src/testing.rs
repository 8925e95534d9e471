//! For the tests of a stage: random inputs, and a comparison of its shader with its CPU twin.
//!
//! A [`Harness`] holds one stage and the inputs that a test gives it. [`run_both`] runs a frame on the CPU and one on
//! the GPU from the same inputs; [`Both`] compares what the two wrote, port by port. Everything here panics on errors,
//! so that a test needs no error handling.
//!
//! ```
//! use epigraph_core::{
//!     CpuContext, Extent, Harness, In, Io, Out, Registry, Shader, Stage,
//!     testing::{Random, run_both, settings},
//! };
//!
//! struct Double {
//!     number: In<f32>,
//!     double: Out<f32>,
//! }
//!
//! impl Stage for Double {
//!     const KIND: &'static str = "double";
//!     const DOC: &'static str = "Doubles numbers.";
//!     type Params = ();
//!
//!     fn declare(_: &(), io: &mut Io) -> Self {
//!         let number = io.read("number", "Any numbers.", Extent::Any);
//!         let double = io.write("double", "Twice each number.", Extent::Like("number".into()));
//!         // Stages in a package keep the shader in a file: `shader!("double")`.
//!         io.shader(Shader::new("double.wgsl", "
//!             @group(0) @binding(0) var<storage, read> number: array<f32>;
//!             @group(0) @binding(1) var<storage, read_write> double: array<f32>;
//!             @compute @workgroup_size(64)
//!             fn main(@builtin(global_invocation_id) id: vec3<u32>) {
//!                 if id.x < arrayLength(&number) {
//!                     double[id.x] = 2.0 * number[id.x];
//!                 }
//!             }
//!         "));
//!         io.dispatch("main", double);
//!         Self { number, double }
//!     }
//!
//!     fn cpu(&self, _: &(), cx: &CpuContext) -> Result<(), String> {
//!         let (number, mut double) = (cx.read(self.number), cx.write(self.double));
//!         double.iter_mut().zip(&*number).for_each(|(double, number)| *double = 2.0 * number);
//!         Ok(())
//!     }
//! }
//!
//! let mut random = Random(1);
//! let numbers: Vec<f32> = (0..1000).map(|_| random.between(-10.0, 10.0)).collect();
//! let mut harness = Harness::<Double>::new((), &settings([1, 1], 1));
//! harness.set("number", &numbers);
//! // The registry provides the modules that shaders import; its stages do not matter here.
//! let both = run_both(&mut harness, &Registry::default());
//! both.assert_equal::<f32>("double");
//! assert_eq!(both.cpu.get::<f32>("double")[0], 2.0 * numbers[0]);
//! ```

mod by_hand;

use std::{
    fmt::Debug,
    sync::{Arc, OnceLock},
};

pub use by_hand::ByHand;
use bytemuck::Pod;

use crate::{
    capture::Snapshot,
    executor::{AdapterChoice, Gpu},
    facts::Facts,
    graph::Settings,
    harness::{Harness, Outputs},
    registry::Registry,
    side::Side,
    stage::{Host, Stage},
};

/// Settings for a frame of `size` (width and height in pixels) with `samples` samples, without facts. Memory that a stage
/// has not yet written is poisoned: a stage that reads it produces NaN or wild numbers, on every run.
pub fn settings(size: [u32; 2], samples: u32) -> Settings {
    Settings { poison: true, ..Settings::new(size, samples, Facts::none()) }
}

/// The GPU that all tests of a program share, opened at the first call. A software driver is enough.
///
/// # Panics
/// If there is none, naming the packages to install: tests of shaders never skip.
pub fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    let open = || Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}")));
    GPU.get_or_init(open).clone()
}

/// Runs a frame of the CPU twin, and another one with the vectors of every processor ([`Settings::vectors`]), which must write the
/// same bits.
///
/// # Panics
/// If an input is missing, the twin reports an error or panics, or a bit differs.
#[track_caller]
pub fn run_cpu<S: Stage>(harness: &mut Harness<S>, registry: &Registry) -> Outputs {
    run(harness, registry, Side::Cpu)
}

/// Runs a frame of the CPU twin and a frame of the shader, from the same inputs. Each side keeps persistent ports of
/// its own, so repeated calls compare frame after frame. The shader's modules come from `registry`.
///
/// # Panics
/// As [`run_cpu`]; also if there is no GPU, or if the shader does not compile or does not fit the declaration.
#[track_caller]
pub fn run_both<S: Stage>(harness: &mut Harness<S>, registry: &Registry) -> Both {
    Both { cpu: run(harness, registry, Side::Cpu), gpu: run(harness, registry, Side::Gpu) }
}

/// Runs both sides like [`run_both`], asserts that all outputs but scratch ports agree, and returns what the twin wrote: a
/// test with values worked out by hand then holds for the shader too. Integers must be equal. Numbers may differ by
/// `tolerance`, relative to the larger one; NaN equals NaN.
///
/// # Panics
/// As [`run_both`]; also with the first elements that differ.
#[track_caller]
pub fn run_alike<S: Stage>(harness: &mut Harness<S>, registry: &Registry, tolerance: f32) -> Outputs {
    let Both { cpu, gpu } = run_both(harness, registry);
    let scratch = |name: &str| {
        let port = name.split('.').next().unwrap_or(name);
        harness.ports().iter().any(|declared| declared.name == port && declared.scratch)
    };
    for (name, snapshot) in cpu.0.iter().filter(|(name, _)| !scratch(name)) {
        let differences = differences(snapshot, &gpu.0[name], tolerance);
        assert!(differences.is_empty(), "`{name}`: {}", differences[0]);
    }
    cpu
}

/// The elements in which two copies of a port differ, in words. Integers differ unless they are equal; numbers, if they
/// are more than `tolerance` apart, relative to the larger one. NaN equals NaN.
///
/// # Panics
/// If one copy has more elements than the other.
#[track_caller]
pub fn differences(cpu: &Snapshot, gpu: &Snapshot, tolerance: f32) -> Vec<String> {
    assert_eq!(cpu.dims, gpu.dims, "`{}`", cpu.name);
    let size = cpu.element.bytes() as usize;
    let floats = cpu.element.floats();
    let number = |bytes: &[u8], at: usize| f32::from_le_bytes(std::array::from_fn(|byte| bytes[at + byte]));
    let same = |cpu: &[u8], gpu: &[u8]| {
        (0..size).all(|at| {
            let start = at / 4 * 4;
            if !floats.contains(&start) {
                return cpu[at] == gpu[at];
            }
            let (cpu, gpu) = (number(cpu, start), number(gpu, start));
            cpu == gpu
                || cpu.is_nan() && gpu.is_nan()
                || (cpu - gpu).abs() <= tolerance * cpu.abs().max(gpu.abs())
        })
    };
    let words = |bytes: &[u8]| -> Vec<String> {
        let word = |at: usize| {
            let bits = number(bytes, at).to_bits();
            if floats.contains(&at) { f32::from_bits(bits).to_string() } else { format!("{bits:#x}") }
        };
        (0..size / 4).map(|word_index| word(4 * word_index)).collect()
    };
    let pairs = cpu.bytes.chunks_exact(size).zip(gpu.bytes.chunks_exact(size)).enumerate();
    let differing = pairs.filter(|(_, (cpu, gpu))| cpu != gpu && !same(cpu, gpu));
    differing
        .map(|(index, (cpu, gpu))| {
            format!("element {index} is {:?} on the CPU, {:?} on the GPU", words(cpu), words(gpu))
        })
        .collect()
}

#[track_caller]
fn run<S: Stage>(harness: &mut Harness<S>, registry: &Registry, side: Side) -> Outputs {
    let gpu = (side == Side::Gpu).then(gpu);
    let frame = |harness: &mut Harness<S>| match harness.run(side, registry, &Host::default(), gpu.clone()) {
        Ok(outputs) => outputs,
        Err(error) => panic!("{side}: {error}"),
    };
    if side == Side::Gpu {
        return frame(harness);
    }
    harness.use_vectors(false);
    let baseline = frame(harness);
    harness.use_vectors(true);
    let outputs = frame(harness);
    for (name, snapshot) in &outputs.0 {
        assert!(
            snapshot.bytes == baseline.0[name].bytes,
            "`{name}` differs from what the twin writes without wider vectors"
        );
    }
    outputs
}

/// What the CPU twin and the shader wrote from the same inputs. Outputs are named `port`, or `port.field` where a port
/// has several fields; an updated port is an output too.
pub struct Both {
    /// Written by the CPU twin.
    pub cpu: Outputs,
    /// Written by the shader.
    pub gpu: Outputs,
}

impl Both {
    /// Asserts that all elements of an output are equal.
    ///
    /// # Panics
    /// With the number of unequal elements and the first of them; if there is no such output, or its elements are not
    /// of type `T`.
    #[track_caller]
    pub fn assert_equal<T: Pod + PartialEq + Debug>(&self, name: &str) {
        self.assert_equal_but::<T>(name, 0);
    }

    /// Asserts that all but at most `allowed` elements of an output are equal. A test should say why any may differ.
    ///
    /// # Panics
    /// As [`Both::assert_equal`].
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

    /// Asserts that no number of an output differs by more than `tolerance`. The output consists of f32, alone or in
    /// vectors: `[f32; 4]` counts as four numbers. The tolerance is absolute, in the port's unit; infinity equals
    /// itself, NaN nothing. A test should say why any number may differ.
    ///
    /// # Panics
    /// With the first number that differs by more; if there is no such output.
    #[track_caller]
    pub fn assert_close(&self, name: &str, tolerance: f32) {
        let (cpu, gpu) = (self.cpu.get::<f32>(name), self.gpu.get::<f32>(name));
        assert_eq!(cpu.len(), gpu.len(), "`{name}`");
        // The negation catches NaN on either side.
        let far =
            |index: &usize| !(cpu[*index] == gpu[*index] || (cpu[*index] - gpu[*index]).abs() <= tolerance);
        let mut differing = (0..cpu.len()).filter(far);
        if let Some(first) = differing.next() {
            let lanes = self.cpu.lanes(name);
            let (element, lane, count) = (first / lanes, first % lanes, 1 + differing.count());
            let (cpu, gpu, all) = (cpu[first], gpu[first], cpu.len());
            panic!(
                "`{name}`: {count} of {all} numbers differ by more than {tolerance}; the first, number {lane} of element \
                 {element}, is {cpu} on the CPU, {gpu} on the GPU"
            );
        }
    }
}

/// Random numbers for test data (SplitMix64): the same for the same seed.
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

#[cfg(test)]
mod tests {
    use fearless_simd::Level;

    use super::*;
    use crate::{CpuContext, Extent, Io, Out};

    /// Writes whether it may use all that the processor has.
    struct Fickle(Out<u32>);

    impl Stage for Fickle {
        const KIND: &'static str = "fickle";
        const DOC: &'static str = "Tells what it may use.";
        type Params = ();

        fn declare((): &(), io: &mut Io) -> Self {
            Self(io.write("number", "1 if it may use all.", Extent::Fixed([1, 1])))
        }

        fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
            let is_all = format!("{:?}", cx.level()) == format!("{:?}", Level::new());
            cx.write(self.0)[0] = u32::from(is_all);
            Ok(())
        }
    }

    #[test]
    #[should_panic(expected = "differs from what the twin writes without wider vectors")]
    fn a_twin_that_writes_other_bits_with_vectors_is_noticed() {
        let [all, baseline] = [Level::new(), Level::baseline()].map(|level| format!("{level:?}"));
        // A processor without more than the baseline runs the same code twice.
        assert!(
            all != baseline,
            "differs from what the twin writes without wider vectors: not on this processor"
        );
        run_cpu(&mut Harness::<Fickle>::new((), &settings([1, 1], 0)), &Registry::default());
    }
}
