//! The user's camera path, which is recorded while flying or opened from a file, and can be saved and played.

use std::path::{Path, PathBuf};

use epigraph_scenes::{Camera, FRAMES_PER_SECOND, keyframes};

use crate::engine::Way;

/// Records the camera's positions, at most once for each frame of path time.
#[derive(Debug)]
pub struct Recorder {
    /// When it began, seconds of the window's time.
    start: f64,
    /// Seconds since then, and the camera.
    keys: Vec<(f32, Camera)>,
}

impl Recorder {
    /// Begins at `now`, seconds of the window's time.
    pub fn new(now: f64, camera: Camera) -> Self {
        Self { start: now, keys: vec![(0.0, camera)] }
    }

    /// Records the camera at `now`.
    pub fn note(&mut self, now: f64, camera: Camera) {
        // Slightly less than a frame, as the window's frames are not evenly spaced.
        let interval = 0.9 / FRAMES_PER_SECOND;
        let time = (now - self.start) as f32;
        if self.keys.last().is_none_or(|(last, _)| time - last >= interval) {
            self.keys.push((time, camera));
        }
    }

    /// Seconds so far.
    pub fn seconds(&self) -> f32 {
        self.keys.last().map_or(0.0, |(time, _)| *time)
    }

    /// The path.
    pub fn finish(self) -> Route {
        let frames = (self.seconds() * FRAMES_PER_SECOND).round() as u32 + 1;
        Route { way: Way::Keys(keyframes(&self.keys).into()), file: None, frames: Some(frames) }
    }
}

/// The current camera path.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The path.
    pub way: Way,
    /// The file that holds it, if any.
    pub file: Option<PathBuf>,
    /// Number of its frames, if known.
    pub frames: Option<u32>,
}

impl Route {
    /// A path with a name, such as `orbit`.
    pub fn named(name: &str) -> Self {
        Self { way: Way::Named(name.into()), file: None, frames: None }
    }

    /// A path in a file of keyframes.
    pub fn of_file(path: &Path) -> Self {
        Self { way: Way::Named(format!("fly:{}", path.display())), file: Some(path.to_owned()), frames: None }
    }

    /// The label shown to users.
    pub fn label(&self) -> String {
        match (&self.file, &self.way) {
            (Some(file), _) => file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            (None, Way::Named(name)) => name.clone(),
            (None, Way::Keys(_)) => "recorded path".into(),
        }
    }

    /// The argument for the command line's `--camera`; `None` for a recorded path that is not saved yet.
    pub fn argument(&self) -> Option<String> {
        match (&self.file, &self.way) {
            (Some(file), _) => Some(format!("fly:{}", file.display())),
            (None, Way::Named(name)) => Some(name.clone()),
            (None, Way::Keys(_)) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_scenes::Scene;

    use super::*;

    #[test]
    fn a_recording_has_a_camera_for_each_frame_of_the_path() {
        let scene = Scene::load("cornell").unwrap();
        let at = |x: f32| {
            let mut camera = scene.camera;
            camera.eye.x += x;
            camera
        };
        let mut recorder = Recorder::new(100.0, at(0.0));
        // Two frames of the window per frame of the path.
        for step in 1..=20u8 {
            recorder.note(100.0 + f64::from(step) / 60.0, at(f32::from(step)));
        }
        assert!((recorder.seconds() - 1.0 / 3.0).abs() < 1e-5);
        let route = recorder.finish();
        assert_eq!(route.argument(), None);
        let path = route.way.path(&scene).unwrap();
        assert_eq!(path.frames(), Some(11));
        for frame in 0..=10u8 {
            let moved = path.camera(frame.into()).eye.x - scene.camera.eye.x;
            assert!((moved - 2.0 * f32::from(frame)).abs() < 1e-2, "frame {frame}: {moved}");
        }
    }
}
