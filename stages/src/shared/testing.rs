//! The core's helpers for tests ([`epigraph_core::testing`]), with the modules of this package's shaders.

pub use epigraph_core::testing::{Both, Random, settings};

use epigraph_core::{Harness, Outputs, Stage, testing};

/// Runs a frame of the twin.
#[track_caller]
pub fn run_cpu<S: Stage>(harness: &mut Harness<S>) -> Outputs {
    testing::run_cpu(harness, &crate::registry())
}

/// Runs a frame of the twin and of the shader, which must agree, and returns what the twin wrote. Drivers may round sums,
/// quotients and roots in their own ways: by a few steps of 6e-8.
#[track_caller]
pub fn run_alike<S: Stage>(harness: &mut Harness<S>) -> Outputs {
    testing::run_alike(harness, &crate::registry(), 1e-6)
}

/// Runs a frame of the twin, and one of the shader.
#[track_caller]
pub fn run_both<S: Stage>(harness: &mut Harness<S>) -> Both {
    testing::run_both(harness, &crate::registry())
}

#[cfg(test)]
mod tests {
    use epigraph_core::{CpuContext, Extent, In, Io, Out, Shader};

    use super::*;

    /// Numbers a list, one workgroup for each element.
    struct Number {
        list: In<u32>,
        index: Out<u32>,
    }

    impl Stage for Number {
        const KIND: &'static str = "number";
        const DOC: &'static str = "Numbers a list.";
        type Params = ();

        fn declare((): &(), io: &mut Io) -> Self {
            let list = io.read("list", "Any list.", Extent::Any);
            let index = io.write("index", "The index of each element.", Extent::Like("list".into()));
            let text = "
                #import index
                @group(0) @binding(0) var<storage, read> list: array<u32>;
                @group(0) @binding(1) var<storage, read_write> index: array<u32>;
                @compute @workgroup_size(1)
                fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
                    let i = linear_index(id, groups, 1u);
                    if i < arrayLength(&index) {
                        index[i] = i + list[i];
                    }
                }
            ";
            io.shader(Shader::new("number.wgsl", text));
            io.dispatch("main", index);
            Self { list, index }
        }

        fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
            let (list, mut index) = (cx.read(self.list), cx.write(self.index));
            for (i, index) in index.iter_mut().enumerate() {
                *index = i as u32 + list[i];
            }
            Ok(())
        }
    }

    #[test]
    fn lists_of_more_workgroups_than_an_axis_holds_are_numbered_through() {
        for length in [1, 65_535, 65_536, 150_000] {
            let mut harness = Harness::<Number>::new((), &settings([1, 1], 1));
            harness.set("list", &vec![0u32; length]);
            assert_eq!(run_alike(&mut harness).get::<u32>("index")[length - 1], length as u32 - 1);
        }
    }
}
