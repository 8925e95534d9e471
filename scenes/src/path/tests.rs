use super::*;

fn scene(eye: Vec3, target: Vec3) -> Scene {
    Scene::empty("test", Camera::look_at(eye, target, 0.8, 0.1, 10.0), [Vec3::NEG_ONE, Vec3::ONE])
}

fn outside() -> Scene {
    scene(Vec3::new(0.0, 0.5, 4.0), Vec3::ZERO)
}

fn path(text: &str) -> CameraPath {
    CameraPath::parse(text, &outside()).unwrap()
}

fn message(text: &str) -> String {
    CameraPath::parse(text, &outside()).unwrap_err().to_string()
}

fn forward(camera: &Camera) -> Vec3 {
    camera.rotation * Vec3::NEG_Z
}

#[test]
fn still_does_not_move() {
    let path = path("still");
    assert!(!path.moves());
    assert_eq!(path.camera(0), outside().camera);
    assert_eq!(path.camera(1000), outside().camera);
}

#[test]
fn cameras_of_a_file_without_any_are_an_error() {
    assert_eq!(
        message("file:top"),
        "camera path `file:top`: the scene's file has no cameras; `still` is the scene's own view"
    );
}

#[test]
fn every_moving_path_begins_near_the_scenes_view_and_moves() {
    for text in ["orbit", "fly", "shake"] {
        let (path, base) = (path(text), outside().camera);
        assert!(path.moves());
        assert!(path.camera(0).eye.distance(base.eye) < 0.1, "{text}");
        assert_ne!(path.camera(7), path.camera(8), "{text}");
        assert_eq!(path.camera(8), path.camera(8), "{text}");
    }
}

#[test]
fn orbit_swings_about_its_target_by_one_degree_per_frame() {
    let path = path("orbit");
    let angle = |frame| {
        let eye = path.camera(frame).eye;
        eye.x.atan2(eye.z).to_degrees()
    };
    for (frame, degrees) in [(0, 0.0), (1, 1.0), (14, 14.0), (15, 13.0), (42, -14.0), (43, -13.0), (56, 0.0)]
    {
        assert!((angle(frame) - degrees).abs() < 1e-3, "frame {frame}: {}", angle(frame));
    }
    for frame in 0..100 {
        let camera = path.camera(frame);
        assert!((angle(frame + 1) - angle(frame)).abs() - 1.0 < 1e-3);
        // The target stays in the middle and at its distance.
        let aim = camera.eye + forward(&camera) * 4.0f32.hypot(0.5);
        assert!(aim.length() < 1e-4, "frame {frame}: {aim}");
    }
}

#[test]
fn orbit_takes_speed_and_arc() {
    let far = path("orbit:2.5:360");
    assert!(far.camera(72).eye.distance(Vec3::new(0.0, 0.5, -4.0)) < 1e-4);
    assert!(far.camera(144).eye.distance(outside().camera.eye) < 1e-4);
    // Two degrees of a way of one degree and a half to and fro.
    assert_eq!([path("orbit:0.5:0.75").frames(), path("orbit:0.5:1").frames()], [Some(3), Some(4)]);
    let narrow = path("orbit:1:10");
    let widest = (0..100).map(|f| narrow.camera(f).eye.x).fold(0.0, f32::max);
    assert!((widest - 4.0 * 5f32.to_radians().sin()).abs() < 1e-4);
    assert!(!path("orbit:0").moves());
    assert!(path("orbit:-1").camera(3).eye.x < 0.0);
}

#[test]
fn an_orbit_that_begins_inside_stays_inside() {
    let scene = scene(Vec3::new(0.7, 0.0, 0.9), Vec3::new(0.6, 0.0, -0.9));
    let path = CameraPath::parse("orbit:1:360", &scene).unwrap();
    for frame in 0..360 {
        let eye = path.camera(frame).eye;
        assert!(eye.abs().max_element() <= 1.0, "frame {frame}: {eye}");
    }
    assert!(path.moves());
    assert_ne!(path.camera(0), path.camera(3));
}

#[test]
fn an_orbit_inside_keeps_a_margin_from_every_side() {
    for (eye, target, bounds, arc) in [
        // 0.5 + 0.5 sin(a) up to 0.96: a = 66.9 degrees.
        ([0.5, 0.0, 0.0], [0.5, 0.0, -1.0], [[-1.0; 3], [1.0; 3]], 132),
        ([-0.5, 0.0, 0.0], [-0.5, 0.0, -1.0], [[-1.0; 3], [1.0; 3]], 132),
        // The same in a box beside the origin.
        ([9.5, 4.0, 0.0], [9.5, 4.0, -1.0], [[8.0, 3.0, -1.0], [10.0, 5.0, 1.0]], 132),
        // -0.05 + 0.95 cos(a) down to -0.96: a = 163.3 degrees.
        ([0.0, 0.0, 0.9], [0.0, 0.0, 0.0], [[-1.0; 3], [1.0; 3]], 326),
        ([0.0, 0.0, -0.9], [0.0, 0.0, 0.0], [[-1.0; 3], [1.0; 3]], 326),
        // An eye in the margin counts as outside: it may go all the way round.
        ([0.5, 0.97, 0.0], [0.5, 0.97, -1.0], [[-1.0; 3], [1.0; 3]], 360),
        ([0.5, -0.97, 0.0], [0.5, -0.97, -1.0], [[-1.0; 3], [1.0; 3]], 360),
        ([0.5, 0.95, 0.0], [0.5, 0.95, -1.0], [[-1.0; 3], [1.0; 3]], 132),
        ([0.5, -0.95, 0.0], [0.5, -0.95, -1.0], [[-1.0; 3], [1.0; 3]], 132),
        ([0.0, 0.0, 4.0], [0.0, 0.0, 0.0], [[-1.0; 3], [1.0; 3]], 360),
    ] {
        let scene = Scene { bounds: bounds.map(Vec3::from), ..scene(eye.into(), target.into()) };
        let path = CameraPath::parse("orbit:1:360", &scene).unwrap();
        // To and fro on an arc, but once round the circle.
        let frames = if arc < 360 { 2 * arc } else { 360 };
        assert_eq!(path.frames(), Some(frames), "from {eye:?}");
        // With room for more than was asked for.
        assert_eq!(CameraPath::parse("orbit:1:100", &scene).unwrap().frames(), Some(200), "from {eye:?}");
    }
}

#[test]
fn an_orbit_without_room_rests() {
    // A degree to the right is 0.017 m, more than is free beside the eye.
    let base = scene(Vec3::new(0.955, 0.0, 0.0), Vec3::new(0.955, 0.0, -1.0));
    let path = CameraPath::parse("orbit", &base).unwrap();
    assert_eq!(path.frames(), Some(1));
    assert!(!path.moves());
    for frame in [0, 1, 500] {
        assert!(path.camera(frame).eye.distance(base.camera.eye) < 1e-6, "frame {frame}");
    }
}

#[test]
fn shake_is_small_and_smooth() {
    let (path, base) = (path("shake"), outside().camera);
    for frame in 0..300 {
        let (a, b) = (path.camera(frame), path.camera(frame + 1));
        assert!(a.eye.distance(base.eye) < 0.05);
        assert!(forward(&a).distance(forward(&base)) < 0.03);
        assert!(forward(&a).distance(forward(&b)) < 0.01);
    }
}

#[test]
fn default_flight_looks_at_its_target_and_returns() {
    let path = path("fly");
    for frame in (0..150).step_by(30) {
        let camera = path.camera(frame);
        assert!(forward(&camera).dot(-camera.eye.normalize()) > 0.999, "frame {frame}");
    }
    assert!(path.camera(150).eye.distance(path.camera(0).eye) < 1e-4);
    assert!((0..150).any(|frame| path.camera(frame).eye.distance(path.camera(0).eye) > 0.5));
}

/// A file of this test's own, removed at the end.
struct TempFile(PathBuf);

impl TempFile {
    fn new(name: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("epigraph-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        Self(path)
    }

    fn fly(&self) -> Result<CameraPath, PathError> {
        CameraPath::parse(&format!("fly:{}", self.0.display()), &outside())
    }
}

impl Drop for TempFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

const KEYS: &str = "(keys: [
    (time: 0.0, eye: (0, 0, 3), target: (0, 0, 0)),
    (time: 1.0, eye: (3, 0, 0), target: (0, 0, 0)),
    (time: 3.0, eye: (0, 1, -3), target: (0, 0, 0)),
])";

#[test]
fn the_default_flight_goes_around_in_front_of_its_target() {
    let scene = scene(Vec3::new(3.0, 2.0, 5.0), Vec3::new(1.0, -0.5, 0.3));
    let (camera, distance) = (scene.camera, target_distance(&scene));
    let path = CameraPath::parse("fly", &scene).unwrap();
    let target = camera.eye + distance * forward(&camera);
    // Shares of the distance to the right, up and forward, a second apart.
    let shares =
        [[0.0; 3], [0.1, 0.02, 0.1], [0.08, 0.04, 0.22], [-0.06, 0.02, 0.24], [-0.1, 0.0, 0.1], [0.0; 3]];
    for (frame, [right, up, ahead]) in (0..).step_by(30).zip(shares) {
        let eye = camera.eye + camera.rotation * Vec3::new(right, up, -ahead) * distance;
        let found = path.camera(frame);
        assert!(found.eye.distance(eye) < 1e-5, "frame {frame}: {}, not {eye}", found.eye);
        assert!(forward(&found).distance((target - eye).normalize()) < 1e-5, "frame {frame}");
    }
}

#[test]
fn a_camera_that_turns_evenly_passes_every_direction() {
    // Two turns at one place, with a key every 45 degrees.
    let keys = (0..=16).map(|k| {
        let (sin, cos) = (45.0 * k as f32).to_radians().sin_cos();
        format!("(time: {k}, eye: (0, 0, 0), target: ({sin:?}, 0, {:?}))", -cos)
    });
    let text = format!("(keys: [{}])", keys.collect::<Vec<_>>().join(", "));
    let path = CameraPath::through(&text, Path::new("keys.ron"), &outside()).unwrap();
    for frame in 0..=480 {
        let (sin, cos) = (1.5 * frame as f32).to_radians().sin_cos();
        let found = forward(&path.camera(frame));
        assert!(found.distance(Vec3::new(sin, 0.0, -cos)) < 1e-4, "frame {frame}: {found}");
    }
}

#[test]
fn a_flight_leaves_its_first_key_towards_the_second() {
    // Halfway, the ends' mean plus an eighth of the difference of their velocities, (3, 0, -3) and (0, 1/3, -2).
    let eye = TempFile::new("first.ron", KEYS).fly().unwrap().camera(15).eye;
    assert!(eye.distance(Vec3::new(1.875, -1.0 / 24.0, 1.375)) < 1e-5, "{eye}");
}

#[test]
fn a_loop_may_be_short() {
    let keys = "(looped: true, keys: [(time: 0.0, eye: (0, 0, 3), target: (0, 0, 0)), \
                (time: 0.25, eye: (3, 0, 0), target: (0, 0, 0))])";
    let path = CameraPath::through(keys, Path::new("keys.ron"), &outside()).unwrap();
    assert_eq!(path.frames(), Some(15));
    // After 0, 0.5 and 1 second it is at its first key.
    for frame in [0, 15, 30] {
        assert!(path.camera(frame).eye.distance(3.0 * Vec3::Z) < 1e-5, "frame {frame}");
        assert!(path.camera(frame + 7).eye.distance(3.0 * Vec3::Z) > 2.0, "frame {frame}");
    }
}

#[test]
fn flight_from_a_file_passes_its_keys_and_stays_at_the_last() {
    let file = TempFile::new("keys.ron", KEYS);
    let path = file.fly().unwrap();
    for (frame, eye) in [(0, Vec3::Z * 3.0), (30, Vec3::X * 3.0), (90, Vec3::new(0.0, 1.0, -3.0))] {
        let camera = path.camera(frame);
        assert!(camera.eye.distance(eye) < 1e-4, "frame {frame}: {camera:?}");
        assert!(forward(&camera).distance(-eye.normalize()) < 1e-4, "frame {frame}");
    }
    assert_eq!(path.camera(500), path.camera(90));
    assert_eq!(path.camera(0).fov_y, outside().camera.fov_y);
}

#[test]
fn flight_has_no_jumps_in_velocity() {
    let keys = KEYS.replace("(keys", "(looped: true, keys");
    let path = TempFile::new("loop.ron", &keys).fly().unwrap();
    let steps: Vec<(Vec3, Vec3)> = (0..300)
        .map(|f| {
            let (a, b) = (path.camera(f), path.camera(f + 1));
            (b.eye - a.eye, forward(&b) - forward(&a))
        })
        .collect();
    for (frame, pair) in steps.windows(2).enumerate() {
        assert!(pair[0].0.distance(pair[1].0) < 0.025, "frame {frame}");
        assert!(pair[0].1.distance(pair[1].1) < 0.015, "frame {frame}");
    }
}

#[test]
fn flights_last_from_their_start_to_their_end() {
    let keys = |list: &[(f32, [i32; 3], [i32; 3])], looped: bool| {
        let key = |(time, [x, y, z], [a, b, c]): &(f32, [i32; 3], [i32; 3])| {
            format!("(time: {time:?}, eye: ({x}, {y}, {z}), target: ({a}, {b}, {c}))")
        };
        let keys: Vec<String> = list.iter().map(key).collect();
        let text = format!("(looped: {looped}, keys: [{}])", keys.join(", "));
        CameraPath::through(&text, Path::new("keys.ron"), &outside()).unwrap()
    };
    let (a, b, c) = ([0, 0, 3], [3, 0, 0], [0, 0, -3]);
    let origin = [0; 3];
    let three = [(1.0, a, origin), (2.0, b, origin), (4.0, c, origin)];
    // A loop takes one more mean interval from its last key to its first, unless both are the same view.
    for (path, frames) in [
        (keys(&three, false), 4 * 30 + 1),
        (keys(&three, true), 3 * 30 + 45),
        (keys(&[(1.0, a, origin), (2.0, b, origin), (4.0, a, origin)], true), 3 * 30),
        (keys(&[(1.0, a, origin), (2.0, b, origin), (4.0, a, b)], true), 3 * 30 + 45),
        (keys(&[(1.0, a, origin), (2.0, b, origin), (4.0, [0, 0, 5], origin)], true), 3 * 30 + 45),
        (keys(&three[..1], true), 1),
        (keys(&[(0.0, a, origin)], false), 1),
        // More frames than have a number.
        (keys(&[(0.0, a, origin), (1e9, b, origin)], false), u32::MAX),
        (keys(&[(0.0, a, origin), (1e9, b, origin)], true), u32::MAX),
    ] {
        assert_eq!(path.frames(), Some(frames));
        assert_eq!(path.moves(), frames > 1);
    }
    // Before its first key, a loop is at its end.
    let path = keys(&three, true);
    assert!(path.camera(30).eye.distance(Vec3::Z * 3.0) < 1e-5);
    assert!(path.camera(135 + 60).eye.distance(Vec3::X * 3.0) < 1e-4);
    assert!(path.camera(15).eye.distance(path.camera(135 + 15).eye) < 1e-4);
    // Around a square of keys, every side is the same curve: halfway, the ends' mean plus an eighth of the difference
    // of their velocities.
    let square = [(1.0, a, origin), (2.0, b, origin), (3.0, c, origin), (4.0, [-3, 0, 0], origin)];
    let path = keys(&square, true);
    for (frame, [x, z]) in [(45, [1.0, 1.0]), (75, [1.0, -1.0]), (105, [-1.0, -1.0]), (135, [-1.0, 1.0])] {
        let eye = path.camera(frame).eye;
        assert!(eye.distance(1.875 * Vec3::new(x, 0.0, z)) < 1e-4, "frame {frame}: {eye}");
    }
}

#[test]
fn a_recorded_view_from_the_origin_comes_back() {
    let camera = Camera::look_at(Vec3::ZERO, Vec3::new(1.0, 2.0, -3.0), 0.8, 0.1, 10.0);
    let again = CameraPath::through(&keyframes(&[(0.0, camera)]), Path::new("keys.ron"), &outside()).unwrap();
    assert!(again.camera(0).eye == Vec3::ZERO && forward(&again.camera(0)).distance(forward(&camera)) < 1e-6);
    // Its target is a metre away.
    let camera = Camera { rotation: Quat::IDENTITY, ..camera };
    let key = "(time: 2.5, eye: (0.0, 0.0, 0.0), target: (0.0, 0.0, -1.0)),\n";
    assert!(keyframes(&[(2.5, camera)]).contains(key), "{}", keyframes(&[(2.5, camera)]));
}

#[test]
fn shake_grows_with_the_distance_and_has_a_limit() {
    let swayed = |distance: f32, frame: u32| {
        let scene = scene(Vec3::Z * distance, Vec3::ZERO);
        CameraPath::parse("shake", &scene).unwrap().camera(frame).eye - scene.camera.eye
    };
    for frame in 0..3000 {
        let (near, far) = (swayed(4.0, frame), swayed(8.0, frame));
        assert!(far.distance(2.0 * near) < 1e-5, "frame {frame}: {near}, {far}");
        assert!(near.abs().max_element() <= 4.0 * SHAKE_SWAY + 1e-6, "frame {frame}: {near}");
    }
}

#[test]
fn errors_say_what_to_write_instead() {
    assert_eq!(
        message("orbitt"),
        "unknown camera path `orbitt`, did you mean `orbit`?; known paths: still, file:NAME, view:X,Y,Z:QX,QY,QZ,QW, orbit[:DEGREES[:ARC]], \
         fly[:FILE.ron], shake"
    );
    assert!(!message("spiral").contains("did you mean"));
    // Two letters may be wrong, and no more.
    assert!(message("orbxx").contains("did you mean `orbit`") && !message("orxxx").contains("did you mean"));
    assert_eq!(message("still:1"), "camera path `still:1`: unexpected argument after `still`");
    assert_eq!(message("shake:2"), "camera path `shake:2`: unexpected argument after `shake`");
    assert_eq!(message("fly:"), "camera path `fly:`: expected a file of keyframes, or `fly` alone, found ``");
    assert_eq!(
        message("orbit:fast"),
        "camera path `orbit:fast`: expected degrees per frame between -360 and 360, found `fast`"
    );
    for bad in [
        "orbit:",
        "orbit:nan",
        "orbit:1:0",
        "orbit:1:400",
        "orbit:1:2:3",
        "orbit:361",
        "orbit:-360.5",
        "still:1",
        "shake:2",
        "",
    ] {
        assert!(CameraPath::parse(bad, &outside()).is_err(), "{bad}");
    }
    assert!(["orbit:360", "orbit:-360:360"].iter().all(|good| CameraPath::parse(good, &outside()).is_ok()));
    assert!(message("fly:/nowhere/keys.ron").starts_with("/nowhere/keys.ron: "));
}

#[test]
fn wrong_keyframes_are_errors() {
    let bad = [
        ("(keys: [])", "at least one"),
        ("(keys: [(time: 0.0, eye: (0,0,0)]", "ron: 1:33: "),
        ("(keys: [(time: 0.0, eye: (0,0,0), target: (0,0,0))])", "same point"),
        ("(keys: [(time: NaN, eye: (0,0,0), target: (0,0,1))])", "keyframe 0: numbers must be finite"),
        ("(keys: [(time: 0.0, eye: (0,inf,0), target: (0,0,1))])", "keyframe 0: numbers must be finite"),
        ("(keys: [(time: 0.0, eye: (0,0,0), target: (0,-inf,1))])", "keyframe 0: numbers must be finite"),
        ("(keys: [(time: 2e9, eye: (0,0,0), target: (0,0,1))])", "times at most 1e9"),
        ("(keys: [(time: 0.0, eye: (0,2e9,0), target: (0,0,1))])", "coordinates at most 1e9"),
        (
            "(keys: [(time: 1.0, eye: (0,0,0), target: (0,0,1)), (time: 1.0, eye: (0,1,0), target: (0,0,1))])",
            "keyframe 1: its time is not after",
        ),
        ("(kyes: [])", "kyes"),
    ];
    for (i, (text, part)) in bad.into_iter().enumerate() {
        let message = TempFile::new(&format!("bad{i}.ron"), text).fly().unwrap_err().to_string();
        assert!(message.contains(part), "{text}: {message}");
    }
    let backwards = KEYS.replace("time: 3.0", "time: 0.5");
    let message = TempFile::new("backwards.ron", &backwards).fly().unwrap_err().to_string();
    assert!(message.contains("keyframe 2: its time is not after"), "{message}");
}

#[test]
fn a_view_is_written_and_read_to_the_bit() {
    let camera = Camera::look_at(Vec3::new(0.1, -1e-9, 3e7), Vec3::new(0.3, 0.2, -0.1), 0.8, 0.1, 10.0);
    let path = path(&CameraPath::view(&camera));
    assert_eq!(path.camera(5), camera);
    assert!(!path.moves());
    for wrong in [
        "view",
        "view:1,2,3",
        "view:1,2,3:0,0,0",
        "view:1,2,3:0,0,0,2",
        "view:1,2,x:0,0,0,1",
        "view:inf,2,3:0,0,0,1",
    ] {
        assert!(message(wrong).contains("quaternion of length 1"), "{wrong}: {}", message(wrong));
    }
}

#[test]
fn recorded_cameras_come_back_from_their_keyframes() {
    let flown = path("orbit:3");
    let keys: Vec<(f32, Camera)> = (0..40u8).map(|k| (f32::from(k) / 30.0, flown.camera(k.into()))).collect();
    let text = keyframes(&keys);
    let again = CameraPath::through(&text, Path::new("keys.ron"), &outside()).unwrap();
    assert_eq!(again.frames(), Some(40));
    for (frame, (_, camera)) in (0..).zip(&keys) {
        assert!(again.camera(frame).eye.distance(camera.eye) < 1e-6, "frame {frame}");
        assert!(again.camera(frame).rotation.angle_between(camera.rotation) < 2e-3, "frame {frame}");
        assert!(forward(&again.camera(frame)).distance(forward(camera)) < 1e-5, "frame {frame}");
    }
    let file = TempFile::new("recorded.ron", &text);
    let read = file.fly().unwrap();
    assert!((0..60).all(|frame| read.camera(frame) == again.camera(frame)));
}

#[test]
fn paths_know_when_they_repeat() {
    assert_eq!(path("orbit").frames(), Some(56));
    assert_eq!(path("orbit:2:360").frames(), Some(180));
    assert_eq!(path("orbit:0").frames(), Some(1));
    assert_eq!(path("fly").frames(), Some(150));
    assert_eq!(path("still").frames(), Some(1));
    assert_eq!(path("shake").frames(), None);
}

#[test]
fn a_camera_that_looks_away_aims_as_far_as_the_scene_is_large() {
    let distance = |eye: [f32; 3], target: [f32; 3]| target_distance(&scene(eye.into(), target.into()));
    assert!((distance([0.0, 0.0, 4.0], [0.0, 0.0, 8.0]) - 12f32.sqrt()).abs() < 1e-5);
    // Towards the scene: its centre. From within: half of the way to the far side, if that is farther.
    assert!((distance([0.0, 0.0, 4.0], [0.0; 3]) - 4.0).abs() < 1e-5);
    assert!((distance([0.0, 0.0, 0.2], [0.0, 0.0, -1.0]) - 0.6).abs() < 1e-5);
    assert!((distance([0.0, 0.0, 0.9], [0.0, 0.0, -1.0]) - 0.95).abs() < 1e-5);
    for (bounds, eye, forward, expected) in [
        // To the middle of a box beside the origin, and half of the way out of it aslant.
        ([[0.0; 3], [2.0, 4.0, 6.0]], [1.0, 2.0, 10.0], [0.0, 0.0, -1.0], 7.0),
        ([[0.0; 3], [2.0, 4.0, 6.0]], [1.0, 2.0, 3.0], [0.6, 0.0, -0.8], 0.5 / 0.6),
        ([[0.0; 3], [2.0, 4.0, 6.0]], [1.0, 2.0, 3.0], [0.0, -0.8, -0.6], 0.5 * 2.0 / 0.8),
        // In a flat scene and in a point there is no way: then its diagonal, and a millimetre.
        ([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]], [0.0; 3], [0.0, 0.0, -1.0], 8f32.sqrt()),
        ([[1.0; 3]; 2], [1.0; 3], [0.0, 0.0, -1.0], 1e-3),
    ] {
        let (eye, forward) = (Vec3::from(eye), Vec3::from(forward));
        let scene = Scene { bounds: bounds.map(Vec3::from), ..scene(eye, eye + forward) };
        let found = target_distance(&scene);
        assert!((found - expected).abs() < 1e-5, "from {eye} to {forward}: {found}");
    }
}

#[test]
fn shaking_is_the_sum_of_a_slow_and_a_fast_noise() {
    let lattice = |channel: u32, layer: u32, cell: u32| {
        2.0 * Rng::new(0, Rng::key(channel * 16 + layer, cell)).next_f32() - 1.0
    };
    for channel in [0, 3, 5] {
        // At the beginning both layers are at their first lattice value. After ten seconds, the slow one is at its
        // 13th, the fast one at its 37th.
        for (seconds, slow, fast) in [(0.0, 0, 0), (10.0, 13, 37)] {
            let expected = (lattice(channel, 0, slow) + 0.5 * lattice(channel, 1, fast)) / 1.5;
            assert!((noise(channel, seconds) - expected).abs() < 1e-5, "channel {channel} at {seconds} s");
        }
        // In between, by 6 t^5 - 15 t^4 + 10 t^3. After 0.7 s, the layers are at 0.91 and 2.59.
        let between = |layer: u32, cell: u32, t: f32| {
            let share = 6.0 * t.powi(5) - 15.0 * t.powi(4) + 10.0 * t.powi(3);
            (1.0 - share) * lattice(channel, layer, cell) + share * lattice(channel, layer, cell + 1)
        };
        let expected = (between(0, 0, 0.91) + 0.5 * between(1, 2, 0.59)) / 1.5;
        assert!((noise(channel, 0.7) - expected).abs() < 1e-5, "channel {channel}");
    }
}

#[test]
fn shaking_sways_and_turns_about_the_cameras_own_axes() {
    let scene = scene(Vec3::new(3.0, 2.0, 5.0), Vec3::new(1.0, -0.5, 0.3));
    let path = CameraPath::parse("shake", &scene).unwrap();
    let (base, distance) = (scene.camera, target_distance(&scene));
    for frame in [0, 17, 400] {
        let seconds = frame as f32 / 30.0;
        let [x, y, z, pitch, yaw, roll] = [0, 1, 2, 3, 4, 5].map(|channel| noise(channel, seconds));
        let found = path.camera(frame);
        let eye = base.eye + base.rotation * Vec3::new(x, y, z) * (0.006 * distance);
        assert!(found.eye.distance(eye) < 1e-5, "frame {frame}: {}, not {eye}", found.eye);
        let turn = Quat::from_scaled_axis(Vec3::new(pitch, yaw, roll) * 0.6_f32.to_radians());
        for axis in Vec3::AXES {
            let expected = base.rotation * (turn * axis);
            assert!((found.rotation * axis).distance(expected) < 1e-5, "frame {frame}");
        }
    }
}
