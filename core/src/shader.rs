//! Shaders as the framework sees them: a WGSL file with `#import`s, and the passes that run its entry points.

use std::{
    borrow::Cow,
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{constant::Constant, port::FieldRef};

/// A stage's shader file.
#[derive(Clone, Debug, PartialEq)]
pub struct Shader {
    /// File name for messages, such as `depth_cull.wgsl`.
    pub name: Cow<'static, str>,
    /// The text.
    pub source: Cow<'static, str>,
    /// The file that the text is from, for editors. It need not exist where the program runs.
    pub file: Option<PathBuf>,
    /// Names for `#ifdef`.
    pub defines: Vec<Cow<'static, str>>,
    /// Constants that it gets from Rust.
    pub constants: Vec<Constant>,
}

impl Shader {
    /// A shader without file, `#ifdef` names and constants.
    pub fn new(name: impl Into<Cow<'static, str>>, source: impl Into<Cow<'static, str>>) -> Self {
        let (name, source) = (name.into(), source.into());
        Self { name, source, file: None, defines: Vec::new(), constants: Vec::new() }
    }

    /// The same shader, from this file.
    pub fn from_file(self, file: impl Into<PathBuf>) -> Self {
        Self { file: Some(file.into()), ..self }
    }
}

/// A WGSL file that shaders may `#import`.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderModule {
    /// Its file's name.
    pub name: Cow<'static, str>,
    /// The text.
    pub source: Cow<'static, str>,
    /// The file that the text is from, for editors. It need not exist where the program runs.
    pub file: Option<PathBuf>,
    /// Constants that it gets from Rust. Shaders that import it get them too.
    pub constants: Vec<Constant>,
}

impl ShaderModule {
    /// A module without file and constants.
    pub fn new(name: impl Into<Cow<'static, str>>, source: impl Into<Cow<'static, str>>) -> Self {
        Self { name: name.into(), source: source.into(), file: None, constants: Vec::new() }
    }

    /// The same module, from this file.
    pub fn from_file(self, file: impl Into<PathBuf>) -> Self {
        Self { file: Some(file.into()), ..self }
    }

    /// Its name in `#import`: the file's name without folder and `.wgsl`.
    pub fn import(&self) -> &str {
        let file = self.name.rsplit_once('/').map_or(&*self.name, |(_, file)| file);
        file.strip_suffix(".wgsl").unwrap_or(file)
    }
}

/// WGSL modules that shaders may `#import` by name.
#[derive(Clone, Debug, Default)]
pub struct ShaderLibrary {
    /// All modules.
    pub modules: Vec<ShaderModule>,
    /// Texts that an editor has of shader files, those of modules and others.
    pub edited: EditedTexts,
}

impl ShaderLibrary {
    /// The module with this name in `#import`.
    pub fn module(&self, name: &str) -> Option<&ShaderModule> {
        self.modules.iter().find(|module| module.import() == name)
    }
}

/// Texts that replace shader files and their embedded copies. Empty by default.
#[derive(Clone, Default)]
pub struct EditedTexts(Option<Arc<TextOf>>);

/// Returns the replacement text of a file, if any.
type TextOf = dyn Fn(&Path) -> Option<Arc<str>> + Send + Sync;

impl EditedTexts {
    /// The texts that a function returns by file path.
    pub fn new(text: impl Fn(&Path) -> Option<Arc<str>> + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(text)))
    }

    /// The replacement text of a file, if any.
    pub fn get(&self, file: &Path) -> Option<Arc<str>> {
        self.0.as_ref()?(file)
    }

    /// The replacement text of a file, otherwise the embedded one.
    pub(crate) fn or_embedded<'t>(&self, file: Option<&Path>, embedded: &'t str) -> Cow<'t, str> {
        match file.and_then(|file| self.get(file)) {
            Some(text) if *text != *embedded => Cow::Owned(text.to_string()),
            _ => Cow::Borrowed(embedded),
        }
    }
}

impl fmt::Debug for EditedTexts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "EditedTexts(..)" } else { "EditedTexts" })
    }
}

/// Which wgpu features a pass needs beyond the portable set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Needs {
    /// 64-bit integers with atomic minimum in storage buffers.
    pub atomic64: bool,
}

/// The number of threads of a compute pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Threads {
    /// One for each element of a port: x, y for images and other two-dimensional extents; for lists a linear index
    /// split over x and y (`shared/index.wgsl` combines them), because a dispatch has at most 65,535 workgroups per
    /// axis.
    Over(FieldRef),
    /// One for each `n` elements of a list, rounded up: for block sums and scans.
    Blocks(FieldRef, u32),
    /// This many workgroups along x.
    Groups(u32),
    /// As many workgroups along x, y and z as the first three u32 of a buffer port, which an earlier pass or node has
    /// written. The pass itself may read that port only if it is an input. If a count is zero, or greater than the
    /// device's limit (65,535 on most), no thread runs.
    Indirect(FieldRef),
}

/// What the vertices of a [`Pass::Draw`] form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// Each vertex is a point, one pixel large.
    Points,
    /// Every two vertices are the ends of a line, one pixel wide.
    Lines,
    /// Every three vertices are the corners of a triangle; both faces are drawn.
    Triangles,
}

impl Shape {
    /// Vertices of one point, line or triangle.
    pub fn vertices(self) -> u32 {
        match self {
            Self::Points => 1,
            Self::Lines => 2,
            Self::Triangles => 3,
        }
    }
}

/// Targets of a draw, at most (WebGPU's default limit).
pub(crate) const MAX_TARGETS: usize = 8;

/// One step on the GPU.
#[derive(Clone, Debug, PartialEq)]
pub enum Pass {
    /// A compute entry point.
    Compute {
        /// Entry point.
        entry: Cow<'static, str>,
        /// The number of threads.
        threads: Threads,
    },
    /// Rasterization into texture ports.
    ///
    /// There are no vertex buffers. The vertex entry point gets `@builtin(vertex_index)`, numbered through all
    /// elements: vertex i belongs to element i / `vertices`. `@location(n)` of the fragment entry point is written to
    /// the nth target, without blending.
    Draw {
        /// Vertex entry point.
        vertex: Cow<'static, str>,
        /// Fragment entry point.
        fragment: Cow<'static, str>,
        /// What the vertices form.
        shape: Shape,
        /// The number of vertices of each element, a multiple of [`Shape::vertices`].
        vertices: u32,
        /// The port whose number of elements is the number of elements to draw. An empty list counts as one element of
        /// zeros, since buffers are never empty.
        count: FieldRef,
        /// The texture outputs to draw to, one to eight of the same size.
        targets: Vec<FieldRef>,
        /// Whether a fragment is drawn only if its depth is less than 1 and than that of all fragments drawn there
        /// before. The executor owns the depth texture and clears it to 1 before the pass.
        depth: bool,
        /// What all channels of the targets are cleared to before the pass; for targets of u32 a whole number.
        clear: f64,
    },
}

impl Pass {
    /// The textures that it draws to; none for compute passes.
    pub fn targets(&self) -> &[FieldRef] {
        match self {
            Self::Compute { .. } => &[],
            Self::Draw { targets, .. } => targets,
        }
    }

    /// The buffer that its numbers of workgroups are in, if it is dispatched indirectly.
    pub fn group_counts(&self) -> Option<&FieldRef> {
        match self {
            Self::Compute { threads: Threads::Indirect(at), .. } => Some(at),
            _ => None,
        }
    }

    /// Its entry points in the order in which they run.
    pub fn entries(&self) -> impl Iterator<Item = &str> {
        let (first, second) = match self {
            Self::Compute { entry, .. } => (entry, None),
            Self::Draw { vertex, fragment, .. } => (vertex, Some(fragment)),
        };
        [Some(first), second].into_iter().flatten().map(AsRef::as_ref)
    }
}

/// Embeds a shader of the calling package: `shader!("median")` is `shaders/median.wgsl` beside its `Cargo.toml`. A
/// missing file is a compile error.
#[macro_export]
macro_rules! shader {
    ($name:literal) => {
        $crate::Shader::new(
            concat!($name, ".wgsl"),
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name, ".wgsl")),
        )
        .from_file(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name, ".wgsl"))
    };
}
