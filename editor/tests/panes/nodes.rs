use egui_kittest::kittest::Queryable;

use crate::support::Opened;

#[test]
fn nodes_that_are_left_out_say_what_they_would_write() {
    let mut opened = Opened::with("epi.ron", true, [64, 48]);
    opened.frames(1);
    let graph = opened.app().session.state.graph.clone().unwrap();
    let left_out: Vec<_> = graph.left_out.iter().map(|node| (node.name.as_str(), node.bytes)).collect();
    // Nothing moves in the Cornell box. A motion takes 48 bytes, a light 48 and a box 64, the latter two twice.
    assert_eq!(left_out, [("cloud/motion", Some(48 + 2 * 48 + 2 * 64)), ("cloud/carry", Some(0))]);
    opened.click("Nodes");
    let sum = "Left out as not needed: 2 nodes, which would write 272 B in a frame";
    assert!(opened.harness.query_by_label(sum).is_some());
    assert!(opened.harness.query_by_label("272 B").is_some(), "beside the node");
    opened.shot("left-out");
    // The block of the part that they are in says so too.
    opened.click("Canvas");
    opened.harness.get_by_label_contains("node cloud").hover();
    opened.until("the hint", |_| true);
    opened.harness.run_steps(60);
    assert!(opened.harness.query_by_label("That saves writing 272 B in a frame").is_some());
    opened.shot("left-out-hint");
}
