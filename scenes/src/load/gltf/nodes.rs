//! The tree of nodes: which are in the scene, and where.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::Value;

use super::json::{Node, Root};

/// A node with this extension may be hidden, with all below it.
const VISIBILITY: &str = "KHR_node_visibility";

/// Where all nodes are, and the order of those that are shown.
pub(super) struct Tree {
    /// From each node's space to that of the file.
    pub worlds: Vec<DAffine3>,
    /// The nodes of the default scene, or the first scene, or all of them, each before its children.
    pub shown: Vec<usize>,
}

impl Tree {
    pub fn of(root: &Root) -> Result<Self, String> {
        let count = root.nodes.len();
        let mut parents = vec![None; count];
        for (parent, node) in root.nodes.iter().enumerate() {
            for &child in &node.children {
                let entry = parents.get_mut(child);
                let entry = entry
                    .ok_or_else(|| format!("node {parent} has a child {child}, which does not exist"))?;
                if entry.replace(parent).is_some() {
                    return Err(format!("node {child} has two parents"));
                }
            }
        }
        let tops: Vec<usize> = (0..count).filter(|&node| parents[node].is_none()).collect();
        let mut worlds = vec![DAffine3::IDENTITY; count];
        let mut placed = 0;
        for node in descend(root, &tops, |_| true) {
            let parent = parents[node].map_or(DAffine3::IDENTITY, |parent: usize| worlds[parent]);
            worlds[node] = parent * local(&root.nodes[node]);
            placed += 1;
        }
        if placed < count {
            return Err("a node is its own ancestor".to_owned());
        }
        let roots = match root.scenes.get(root.scene.unwrap_or(0)) {
            Some(scene) => &scene.nodes,
            None => &tops,
        };
        if let Some(node) = roots.iter().find(|&&node| node >= count) {
            return Err(format!("a scene has a node {node}, which does not exist"));
        }
        let mut seen = vec![false; count];
        let mut shown = descend(root, roots, |node| is_visible(&root.nodes[node]));
        // A scene may list a node and one above it.
        shown.retain(|&node| !std::mem::replace(&mut seen[node], true));
        Ok(Self { worlds, shown })
    }
}

/// The `roots` and all nodes below them that `enter` lets in, each before its children.
fn descend(root: &Root, roots: &[usize], enter: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut open: Vec<usize> = roots.iter().rev().copied().collect();
    let mut found = Vec::new();
    while let Some(node) = open.pop() {
        if enter(node) {
            found.push(node);
            open.extend(root.nodes[node].children.iter().rev());
        }
    }
    found
}

fn is_visible(node: &Node) -> bool {
    node.extensions.get(VISIBILITY).and_then(|value| value.get("visible")) != Some(&Value::Bool(false))
}

/// The transform of a node in its parent's space.
fn local(node: &Node) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&matrix));
    }
    let rotation = node.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    // Exporters round; a rotation of no length is none.
    let rotation = if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        rotation,
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    )
}

#[cfg(test)]
mod tests {
    use gltf::json::deserialize::from_str;

    use super::*;

    /// The tree of a file with these nodes and other members.
    fn tree(nodes: &str, rest: &str) -> Result<Tree, String> {
        let json = format!(r#"{{"asset": {{"version": "2.0"}}, "nodes": [{nodes}]{rest}}}"#);
        Tree::of(&from_str(&json).unwrap())
    }

    #[test]
    fn a_node_is_shown_once_and_only_if_there_is_one() {
        let nodes = r#"{"children": [1]}, {"children": [2]}, {}"#;
        for (scene, expected) in
            [("[0]", vec![0, 1, 2]), ("[1, 0]", vec![1, 2, 0]), ("[0, 2, 1]", vec![0, 1, 2])]
        {
            let rest = format!(r#", "scenes": [{{"nodes": {scene}}}]"#);
            assert_eq!(tree(nodes, &rest).unwrap().shown, expected, "{scene}");
        }
        for (nodes, rest, expected) in [
            (nodes, r#", "scenes": [{"nodes": [0, 3]}]"#, "a scene has a node 3, which does not exist"),
            (r#"{"children": [1]}"#, "", "node 0 has a child 1, which does not exist"),
            (r#"{"children": [1]}, {"children": [0]}"#, "", "a node is its own ancestor"),
        ] {
            assert_eq!(tree(nodes, rest).err().unwrap(), expected);
        }
    }

    #[test]
    fn rotations_of_any_length_are_taken_and_those_of_none_left() {
        let turned = |rotation: &str| {
            let tree = tree(&format!(r#"{{"rotation": {rotation}}}"#), "").unwrap();
            tree.worlds[0].transform_vector3(DVec3::X)
        };
        for rotation in ["[0, 0, 1, 1]", "[0, 0, 0.001, 0.001]", "[0, 0, 7, 7]"] {
            assert!(turned(rotation).distance(DVec3::Y) < 1e-12, "{rotation}");
        }
        assert_eq!(turned("[0, 0, 0, 0]"), DVec3::X);
    }
}
