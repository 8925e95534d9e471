use std::fs;

use egui::OutputCommand;
use epigraph_editor::document::Tag;
use epigraph_pictures::{Look, Picture, show};

use crate::support::{Opened, command, words};

/// Runs a command line, with its output in the folder of the graph. Returns the picture.
pub fn rendered(opened: &Opened, words: &[String]) -> Vec<[u8; 3]> {
    let (program, arguments) = words.split_first().unwrap();
    assert_eq!(program, "epigraph");
    let mut arguments = arguments.to_vec();
    // The last word is the file, after the port if a port is saved.
    let last = arguments.last_mut().unwrap();
    let name = last.rsplit('=').next().unwrap().to_owned();
    let file = opened.folder().join(&name);
    *last = last.replace(&name, &file.display().to_string());
    let output = command().args(&arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    image::open(file).unwrap().to_rgb8().pixels().map(|pixel| pixel.0).collect()
}

/// Copies the command line. Returns the text on the clipboard, if any.
fn copied(opened: &mut Opened) -> Option<String> {
    opened.choose_first(&["Output", "Copy as a command line"]);
    let mut text = None;
    // The entry acts in one of the next frames.
    for _ in 0..3 {
        opened.harness.step();
        let commands = &opened.harness.output().platform_output.commands;
        text = text.or(commands.iter().find_map(|command| match command {
            OutputCommand::CopyText(text) => Some(text.clone()),
            _ => None,
        }));
    }
    text
}

#[test]
fn the_copied_command_line_renders_the_picture_in_view() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(2);
    opened.harness.state_mut().session.move_camera(|rig| rig.orbit(0.15, 0.05));
    opened.click("Reset");
    opened.until("the reset", |app| app.session.state.frames == 0);
    opened.frames(8);
    let line = copied(&mut opened).unwrap();
    assert!(line.contains("--camera view:") && line.contains("--frames 8"), "{line}");
    assert!(rendered(&opened, &words(&line)) == opened.shown(), "{line}");

    // An intermediate port, from the scene's own view.
    opened.choose(&["Camera", "Home"]);
    opened.click("Reset");
    opened.until("the reset", |app| app.session.state.frames == 0);
    opened.click("view/project");
    opened.click("View id");
    opened.frames(5);
    let line = copied(&mut opened).unwrap();
    assert!(line.contains("--camera still") && line.contains("--save view/project.id="), "{line}");
    assert!(rendered(&opened, &words(&line)) == opened.shown(), "{line}");
}

#[test]
fn a_command_line_is_copied_only_if_the_text_is_saved() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(1);
    // Unsaved box positions do not matter.
    let document = &mut opened.harness.state_mut().session.document;
    document.place(Tag::Once, |places| _ = places.insert("fill".into(), [10.0, 20.0]));
    assert!(document.is_dirty());
    assert!(copied(&mut opened).is_some());
    let path = opened.app().session.document.path().to_owned();
    let text = format!("{}// more\n", opened.text());
    opened.harness.state_mut().session.document.type_text(&path, &text);
    opened.frames(1);
    assert_eq!(copied(&mut opened), None);
    assert!(opened.app().session.notice().unwrap().contains("save the graph first"));
}

#[test]
fn an_image_is_saved_as_shown_or_with_its_raw_values() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(4);
    let png = opened.folder().join("shown.png");
    opened.choose(&["Output", "Save image …"]);
    opened.name(&png);
    opened.until("the file", |_| png.is_file());
    let saved: Vec<[u8; 3]> = image::open(&png).unwrap().to_rgb8().pixels().map(|pixel| pixel.0).collect();
    assert!(saved == opened.shown());

    // A port that is not in view is taken from the same frame.
    let exr = opened.folder().join("depths.exr");
    opened.choose(&["Output", "Save image …"]);
    opened.pick("Port", "view/cull.filtered");
    opened.until("the port", |app| app.session.snapshot("view/cull.filtered").is_some());
    let depths: Vec<f32> = opened.app().session.snapshot("view/cull.filtered").unwrap().get();
    opened.name(&exr);
    opened.until("the file", |_| exr.is_file());
    let values = Picture::read(&exr).unwrap();
    assert_eq!(values.size, [64, 48]);
    let read: Vec<f32> = values.colors.iter().map(|color| color[0]).collect();
    assert!(read == depths && depths.iter().any(|value| *value > 0.0));

    // An existing file is replaced only after confirmation.
    let before = fs::read(&png).unwrap();
    fs::write(&png, "mine").unwrap();
    opened.choose(&["Output", "Save image …"]);
    opened.name(&png);
    assert_eq!(fs::read(&png).unwrap(), b"mine");
    opened.click("Replace");
    opened.until("the file", |_| fs::read(&png).unwrap() != b"mine");
    assert!(fs::read(&png).unwrap() == before, "it is the picture in view again");
}

#[test]
fn the_frames_of_a_path_become_an_animation_or_files() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(1);
    opened.choose(&["Camera", "Play orbit"]);
    opened
        .until("a frame", |app| app.session.state.playing.as_ref().is_some_and(|playing| playing.frame > 0));
    opened.click("Cancel");
    opened.until("the end", |app| !app.session.is_playing());

    let animation = opened.folder().join("orbit.png");
    let recorded = |app: &epigraph_editor::app::App| app.session.state.recorded.clone();
    opened.choose(&["Output", "Record the path's frames …"]);
    opened.fill("Frames", "5");
    opened.name(&animation);
    opened.until("the animation", |app| recorded(app).is_some());
    // All but the first frame, which is empty.
    assert!(recorded(opened.app()).unwrap().unwrap().contains("4 frames"));
    let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(&animation).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let control = reader.info().animation_control().copied().unwrap();
    assert_eq!((control.num_frames, control.num_plays), (4, 0));
    let mut frames = Vec::new();
    for _ in 0..4 {
        let mut frame = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut frame).unwrap();
        frames.push(frame);
    }
    assert!(frames[2] != frames[3]);
    let last = show(opened.app().session.snapshot("").unwrap(), &Look::default()).colors;
    assert!(frames[3] == last.as_flattened());

    opened.choose(&["Output", "Record the path's frames …"]);
    opened.click("A PNG for each frame: NAME-0000.png, NAME-0001.png, ...");
    opened.fill("Frames", "5");
    opened.name(&opened.folder().join("still.png"));
    let files = |opened: &Opened| {
        (0..9).map(|k| opened.folder().join(format!("still-{k:04}.png"))).filter(|p| p.is_file()).count()
    };
    opened.until("the files", |app| recorded(app).is_some_and(|done| done.unwrap().contains("still-0000")));
    assert_eq!(files(&opened), 5);
    let fourth = image::open(opened.folder().join("still-0003.png")).unwrap().to_rgb8().into_raw();
    assert!(fourth == frames[2]);
    let left: Vec<_> =
        fs::read_dir(opened.folder()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().ends_with(".tmp")), "{left:?}");
}
