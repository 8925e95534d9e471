//! The shaders of Epigraph's stages as text: `NAME.wgsl` is the shader of the stage `NAME`, `shared/NAME.wgsl` a module
//! that shaders `#import` by its name.
//!
//! ```
//! assert!(epigraph_shaders::text("age.wgsl").contains("#import"));
//! ```

/// This folder, where the package was built. It need not exist where the program runs.
pub const FOLDER: &str = env!("CARGO_MANIFEST_DIR");

/// The path of each shader within this folder, and its text; in alphabetical order of the paths.
pub const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// The text of a shader by its path within this folder. In a `const`, a wrong path is a compile error.
///
/// # Panics
/// If there is no such file.
pub const fn text(path: &str) -> &'static str {
    let mut index = 0;
    while index < FILES.len() {
        if equal(FILES[index].0.as_bytes(), path.as_bytes()) {
            return FILES[index].1;
        }
        index += 1;
    }
    panic!("there is no such file in the folder `shaders`")
}

/// `==`, which is not available in a `const fn`.
const fn equal(a: &[u8], b: &[u8]) -> bool {
    let mut index = 0;
    while index < a.len() && index < b.len() && a[index] == b[index] {
        index += 1;
    }
    index == a.len() && index == b.len()
}
