//! Stages that do nothing, with ports of all kinds: for graphs that are only checked and planned.

use epigraph_core::{
    Access, CpuContext, Extent, Fact, Facts, Io, Quantity, Registry, Shader, Stage, choice, params, scratch,
    texel,
};

/// A fact and a quantity of the application.
pub const MOVES: Fact = Fact { name: "moves" };
pub const SHEETS: Quantity = Quantity { name: "sheets", one: "sheet of paper" };

/// A quantity that follows from the other.
const PAGES: Quantity = Quantity { name: "pages", one: "page" };

epigraph_core::meanings! {
    /// Distance, metres.
    DEPTH = "depth";
}

choice! {
    /// A direction.
    pub enum Way {
        /// Upwards.
        Up,
        /// Downwards.
        Down,
    }
}

params! {
    /// Parameters of all kinds.
    pub struct MixParams {
        /// How much of it.
        weight: f32 = 0.5, in 0.0..=2.0, unit "kg";
        /// Where it goes.
        way: Way = Way::Up;
        /// Which one.
        level: u32 = 0, in 0..=99;
        /// How far.
        shift: i32 = -1, in -4..=4;
        /// Whether it is heard.
        loud: bool = true;
    }
}

macro_rules! stage {
    ($name:ident, $kind:literal, $params:ty, |$p:pat_param, $io:ident| $declare:expr
        $(, needless: $needless:literal)?) => {
        struct $name;
        impl Stage for $name {
            const KIND: &'static str = $kind;
            const DOC: &'static str = "A stage of the tests.";
            type Params = $params;
            fn declare($p: &$params, $io: &mut Io) -> Self {
                $declare;
                Self
            }
            fn cpu(&self, _: &$params, _: &CpuContext) -> Result<(), String> {
                Ok(())
            }
            $(fn needless(_: &$params, facts: &Facts) -> Option<&'static str> {
                (facts.holds(MOVES) == Some(false)).then_some($needless)
            })?
        }
    };
}

/// Lets a stage run on a GPU too. Its shader is never read.
fn has_shader(io: &mut Io) {
    io.shader(Shader::new("never-read.wgsl", ""));
}

stage!(Source, "source", (), |_, io| {
    has_shader(io);
    io.write::<f32>("out", DEPTH.doc("Numbers."), Extent::Frame(1));
    io.write::<f32>("far", DEPTH, Extent::Frame(1));
    io.write::<u32>("sums", scratch("Sums by row."), Extent::Fixed([8, 1]));
});
stage!(Small, "small", (), |_, io| io.write::<f32>("out", "Numbers.", Extent::Frame(3)));
stage!(Picture, "picture", (), |_, io| {
    has_shader(io);
    io.write::<texel::R32Float>("out", "A texture.", Extent::Frame(1));
});
stage!(Mix, "mix", MixParams, |_, io| {
    has_shader(io);
    io.read::<f32>("a", "Numbers.", Extent::Any);
    io.optional::<f32>("b", "Other numbers.", Extent::Any);
    io.write::<f32>("out", "The sum.", Extent::Like("a".into()));
});
stage!(Filter, "filter", (), |_, io| {
    has_shader(io);
    io.read::<f32>("a", DEPTH.doc("Numbers."), Extent::Frame(1));
    io.write::<f32>("out", "Smoother numbers.", Extent::Frame(1));
});
stage!(Mark, "mark", (), |_, io| {
    io.read::<f32>("a", "Numbers.", Extent::Any);
    io.write::<u32>("bits", "One for each number.", Extent::BitsOf("a".into()));
});
stage!(Pick, "pick", (), |_, io| {
    io.read::<f32>("a", "Numbers.", Extent::Any);
    io.read::<u32>("bits", "One for each number.", Extent::BitsOf("a".into()));
    io.write::<f32>("out", "The marked ones.", Extent::Like("a".into()));
});
stage!(Print, "print", (), |_, io| {
    io.write::<f32>("out", "One for each sheet.", SHEETS.list());
    io.write::<u32>("pages", "One for each page.", PAGES.list());
    io.write::<u32>("corners", "One for each corner.", Extent::Corners);
    io.write::<u32>("wanted", "One for each sample.", Extent::Requests);
});
stage!(Change, "change", (), |_, io| {
    has_shader(io);
    io.update::<f32>("out", "Changed in place.", Extent::Any);
});
stage!(Memory, "memory", (), |_, io| {
    io.idle();
    io.persistent::<f32>("out", "Kept.", Extent::PerPixel(0.3));
});
stage!(Delay, "delay", (), |_, io| {
    has_shader(io);
    io.history::<f32>("a", "The last frame's.", Extent::Any);
    io.write::<f32>("out", "Numbers.", Extent::Frame(1));
});
stage!(Moving, "moving", (), |_, io| {
    has_shader(io);
    io.read::<f32>("a", "Numbers.", Extent::Any);
    io.write::<f32>("out", "Numbers.", Extent::Frame(1));
}, needless: "nothing moves");
stage!(Helper, "helper", (), |_, io| {
    if io.optional::<f32>("b", "A hint.", Extent::Any).is_some() {
        io.write::<u32>("work", scratch("Only with a hint."), Extent::Frame(4));
    }
    io.write::<f32>("out", "Numbers.", Extent::Frame(1));
}, needless: "there is nothing to help with");
stage!(Cloud, "cloud", (), |_, io| {
    let mut cloud = io.bundle(Access::Write, "points", "A structure of arrays.", Extent::PerPixel(1.5));
    cloud.write::<[f32; 4]>("position");
    cloud.write::<u32>("age");
    cloud.persistent();
});
stage!(Aging, "aging", (), |_, io| {
    has_shader(io);
    io.bundle(Access::Update, "points", "Ages change.", Extent::Any).write::<u32>("age");
    io.optional::<f32>("a", "How fast.", Extent::Any);
});
stage!(Splat, "splat", (), |_, io| {
    has_shader(io);
    io.bundle(Access::Read, "points", "Where they are.", Extent::Any).read::<[f32; 4]>("position");
    io.write::<f32>("out", "A picture.", Extent::Frame(1));
});
stage!(Look, "look", (), |_, io| {
    has_shader(io);
    io.per_view();
    io.column("P1");
    io.read::<f32>("a", "Numbers.", Extent::Any);
    io.write::<f32>("out", "What they look like.", Extent::Like("a".into()));
});

/// The kinds of the stages, with the names of their inputs and of their outputs.
pub const KINDS: [(&str, &[&str], &[&str]); 18] = [
    ("source", &[], &["out", "far"]),
    ("small", &[], &["out"]),
    ("picture", &[], &["out"]),
    ("mix", &["a", "b"], &["out"]),
    ("mix", &["a"], &["out"]),
    ("filter", &["a"], &["out"]),
    ("mark", &["a"], &["bits"]),
    ("pick", &["a", "bits"], &["out"]),
    ("print", &[], &["out", "pages", "corners", "wanted"]),
    ("change", &["out"], &["out"]),
    ("memory", &[], &["out"]),
    ("delay", &["a"], &["out"]),
    ("moving", &["a"], &["out"]),
    ("helper", &["b"], &["out", "work"]),
    ("cloud", &[], &["points"]),
    ("aging", &["points", "a"], &["points"]),
    ("splat", &["points"], &["out"]),
    ("look", &["a"], &["out"]),
];

/// All of them.
pub fn registry() -> Registry {
    Registry::default()
        .with_count(PAGES, |facts| facts.count(SHEETS)?.checked_mul(2))
        .with::<Source>()
        .with::<Small>()
        .with::<Picture>()
        .with::<Mix>()
        .with::<Filter>()
        .with::<Mark>()
        .with::<Pick>()
        .with::<Print>()
        .with::<Change>()
        .with::<Memory>()
        .with::<Delay>()
        .with::<Moving>()
        .with::<Helper>()
        .with::<Cloud>()
        .with::<Aging>()
        .with::<Splat>()
        .with::<Look>()
}
