//! A shader names the variants of a choice, so that their order in Rust means nothing to it.

use std::sync::{Arc, OnceLock};

use epigraph_core::{AdapterChoice, Facts, Gpu, Harness, Host, Registry, Settings, Side, Stage};

const SOURCE: &str = "
struct Params {
    pattern: u32,
}
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> image: array<u32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(WIDTH, HEIGHT)) {
        return;
    }
    var value = 0u;
    if params.pattern == PATTERN_COLUMNS {
        value = id.x;
    } else if params.pattern == PATTERN_ROWS {
        value = id.y;
    } else if params.pattern == PATTERN_CHECKED_BOARD {
        value = (id.x + id.y) % 2u;
    }
    image[id.y * WIDTH + id.x] = value;
}";

/// A stage with this shader, and the variants of its choice in this order.
macro_rules! pattern {
    ($name:ident, $($variant:ident),*) => {
        mod $name {
            use epigraph_core::{CpuContext, Extent, Io, Out, Shader, Stage, choice, constants, params};

            choice! {
                /// What to paint.
                pub enum Pattern { $($variant),* }
            }

            params! {
                /// Parameters of [`Paint`].
                pub struct PaintParams {
                    /// What to paint.
                    pattern: Pattern = Pattern::Rows;
                }
            }

            constants! {
                pub const WIDTH: u32 = 5;
                pub const HEIGHT: u32 = 3;
            }

            pub struct Paint(Out<u32>);

            impl Stage for Paint {
                const KIND: &'static str = "paint";
                const DOC: &'static str = "Paints a pattern.";
                type Params = PaintParams;

                fn declare(_: &PaintParams, io: &mut Io) -> Self {
                    io.shader(Shader::new("paint.wgsl", super::SOURCE));
                    io.constants(CONSTANTS);
                    let image = io.write("image", "the pattern", Extent::Fixed([WIDTH, HEIGHT]));
                    io.dispatch("main", image);
                    Self(image)
                }

                fn cpu(&self, params: &PaintParams, cx: &CpuContext) -> Result<(), String> {
                    for (pixel, value) in (0..).zip(&mut *cx.write(self.0)) {
                        let [x, y] = [pixel % WIDTH, pixel / WIDTH];
                        *value = match params.pattern {
                            Pattern::Columns => x,
                            Pattern::Rows => y,
                            Pattern::CheckedBoard => (x + y) % 2,
                        };
                    }
                    Ok(())
                }
            }

            /// What each pattern looks like on that side.
            pub fn pictures(side: super::Side) -> [Vec<u32>; 3] {
                [Pattern::Columns, Pattern::Rows, Pattern::CheckedBoard]
                    .map(|pattern| super::picture::<Paint>(PaintParams { pattern }, side))
            }
        }
    };
}

pattern!(one, Columns, Rows, CheckedBoard);
pattern!(other, CheckedBoard, Columns, Rows);

fn picture<S: Stage>(params: S::Params, side: Side) -> Vec<u32> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    let open = || Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}")));
    let gpu = (side == Side::Gpu).then(|| GPU.get_or_init(open).clone());
    let mut harness = Harness::<S>::new(params, &Settings::new([1, 1], 0, Facts::none()));
    let outputs = harness.run(side, &Registry::default(), &Host::default(), gpu);
    outputs.unwrap_or_else(|error| panic!("{side}: {error}")).get("image")
}

#[test]
fn the_order_of_variants_does_not_matter() {
    let expected = [
        vec![0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4],
        vec![0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2],
        vec![0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0],
    ];
    for side in [Side::Cpu, Side::Gpu] {
        assert_eq!(one::pictures(side), expected, "{side}");
        assert_eq!(other::pictures(side), expected, "{side}");
    }
}
