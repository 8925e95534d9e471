//! The command line that renders the picture in view without the window.

use std::{borrow::Cow, fmt, path::Path};

use epigraph_scenes::{Camera, CameraPath};

use crate::engine::Backend;

/// Everything that the picture depends on.
#[derive(Clone, Debug)]
pub struct CommandLine {
    /// The graph's file.
    pub graph: String,
    /// The scene's name or file.
    pub scene: String,
    /// The argument of `--camera`.
    pub camera: String,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Maximum number of samples per frame.
    pub samples: u32,
    /// The run's seed.
    pub seed: u32,
    /// Default placement for nodes without `on:`.
    pub backend: Backend,
    /// Number of frames; the last one is the picture.
    pub frames: u32,
    /// The port, as `node.port`; empty for the graph's image.
    pub port: String,
}

impl CommandLine {
    /// The argument of `--camera` for a still camera.
    pub fn still(camera: &Camera, home: Option<Camera>) -> String {
        if home == Some(*camera) { "still".into() } else { CameraPath::view(camera) }
    }
}

impl fmt::Display for CommandLine {
    /// For a POSIX shell.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "epigraph render {} --scene {}", quoted(&self.graph), quoted(&self.scene))?;
        write!(f, " --camera {} --size {width}x{height}", quoted(&self.camera))?;
        write!(f, " --samples {} --seed {} --backend {}", self.samples, self.seed, self.backend)?;
        write!(f, " --frames {}", self.frames)?;
        if self.port.is_empty() {
            let stem = Path::new(&self.graph).file_stem().unwrap_or_default().to_string_lossy();
            return write!(f, " --out {}", quoted(&format!("{stem}.png")));
        }
        let file = format!("{}.png", self.port.replace(['/', '.'], "-"));
        write!(f, " --save {}", quoted(&format!("{}={file}", self.port)))
    }
}

/// A word quoted for the shell.
fn quoted(word: &str) -> Cow<'_, str> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-:,+=@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''")).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_with_blanks_and_quotes_are_quoted() {
        let mut line = CommandLine {
            graph: "my graphs/it's.ron".into(),
            scene: "cornell".into(),
            camera: "view:0,1,-2.5:0,0,0,1".into(),
            size: [64, 48],
            samples: 100,
            seed: 1,
            backend: Backend::Cpu,
            frames: 9,
            port: String::new(),
        };
        assert_eq!(
            line.to_string(),
            r"epigraph render 'my graphs/it'\''s.ron' --scene cornell --camera view:0,1,-2.5:0,0,0,1 --size 64x48 --samples 100 --seed 1 --backend cpu --frames 9 --out 'it'\''s.png'"
        );
        line.port = "view/project.depth".into();
        assert!(line.to_string().ends_with(" --frames 9 --save view/project.depth=view-project-depth.png"));
    }
}
