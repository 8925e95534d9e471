//! Shaders that can be edited beside the graph: those of its `wgsl` nodes, those of its stages, and the modules that
//! they import, if their files exist.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use epigraph_core::{GraphFile, Kind, Registry, imports};

use super::Document;

/// The source files of the embedded shaders.
#[derive(Debug, Default)]
pub struct Sources {
    /// Paths of the stages' shaders, by stage kind.
    kinds: BTreeMap<&'static str, String>,
    /// Paths of the modules, by their name for `#import`.
    modules: BTreeMap<String, String>,
}

impl Sources {
    /// The source files of a registry's stages and modules.
    pub fn new(registry: &Registry) -> Self {
        let of_kind = |kind: &dyn Kind| Some((kind.name(), name(&kind.declaration()?.shader?.file?)));
        let modules = registry.library.modules.iter();
        Self {
            kinds: registry.kinds().filter_map(of_kind).collect(),
            modules: modules
                .filter_map(|module| Some((module.import().to_owned(), name(module.file.as_ref()?))))
                .collect(),
        }
    }
}

/// The shader files of a graph.
#[derive(Default)]
pub(super) struct ShaderFiles {
    /// Addresses of nodes with a shader, and the shader's path; `wgsl` nodes first.
    pub of_nodes: Vec<(String, String)>,
    /// Paths of the files that could be read: the nodes' shaders, then the modules.
    pub read: Vec<String>,
}

impl Document {
    /// Adds the shaders of stages, if their files exist. Call this once after opening a document.
    pub fn use_sources(&mut self, sources: Arc<Sources>) {
        self.sources = sources;
        self.read();
    }

    /// The source files of the stages' shaders.
    pub fn sources(&self) -> &Arc<Sources> {
        &self.sources
    }

    /// The shader files that could be read, with their texts: those of `wgsl` nodes, those of other stages, then the
    /// modules that they import.
    pub fn shaders(&self) -> impl Iterator<Item = (&str, &Arc<str>)> {
        let files = self.shaders.read.iter();
        files.filter_map(|path| Some((path.as_str(), self.contents.texts.get(path)?)))
    }

    /// The path of the shader file of the node at this address.
    pub fn shader_of(&self, address: &str) -> Option<&str> {
        self.shaders.of_nodes.iter().find(|(node, _)| node == address).map(|(_, path)| path.as_str())
    }

    /// Addresses of the nodes whose shader is this file.
    pub fn users_of<'d>(&'d self, shader: &'d str) -> impl Iterator<Item = &'d str> {
        let nodes = self.shaders.of_nodes.iter();
        nodes.filter(move |(_, path)| path == shader).map(|(node, _)| node.as_str())
    }

    /// Finds the shader files of a graph.
    pub(super) fn find_shaders(&mut self, file: &GraphFile, whole: &GraphFile) {
        let own = file.shaders().into_iter().map(|(node, path)| (node, name(&path)));
        self.shaders.of_nodes = own.collect();
        add_stages(whole, "", &self.sources.kinds, &mut self.shaders.of_nodes);
        self.add_shaders();
    }

    /// Reads the shaders that the document does not hold yet. Returns true if there were any. If the shader of a `wgsl`
    /// node is missing, compiling reports it.
    pub(super) fn add_shaders(&mut self) -> bool {
        let mut found = false;
        let mut files: Vec<String> = Vec::new();
        for (_, path) in &self.shaders.of_nodes {
            if !files.contains(path) {
                files.push(path.clone());
            }
        }
        self.shaders.read.clear();
        let mut next = 0;
        while let Some(path) = files.get(next).cloned() {
            next += 1;
            if !self.contents.texts.contains_key(&path) {
                let Ok(text) = epigraph_files::text(Path::new(&path)) else { continue };
                let text: Arc<str> = text.into();
                self.contents.texts.insert(path.clone(), text.clone());
                self.saved.texts.insert(path.clone(), text);
                found = true;
            }
            for module in imports(&self.contents.texts[&path]) {
                let file = self.sources.modules.get(module);
                files.extend(file.filter(|file| !files.contains(file)).cloned());
            }
            self.shaders.read.push(path);
        }
        found
    }
}

/// Adds the nodes whose stage kind has a shader file, also those of parts.
fn add_stages(
    file: &GraphFile,
    prefix: &str,
    kinds: &BTreeMap<&'static str, String>,
    nodes: &mut Vec<(String, String)>,
) {
    for node in &file.nodes {
        if let Some(path) = kinds.get(node.kind.value.as_str()) {
            nodes.push((format!("{prefix}{}", node.name.value), path.clone()));
        }
    }
    for (name, part) in &file.parts {
        add_stages(part, &format!("{prefix}{name}/"), kinds, nodes);
    }
}

/// A shader's path as a key of [`Texts`](super::Texts).
fn name(path: &Path) -> String {
    path.display().to_string()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::document::tests::shipped;

    fn short(document: &Document) -> Vec<&str> {
        document.shaders().map(|(path, _)| crate::files::short(path)).collect()
    }

    /// The render cache in a folder, with shaders from these files.
    fn opened(folder: &Path, sources: Sources) -> Document {
        let graph = shipped(folder).into_iter().find(|path| path.ends_with("render-cache.ron")).unwrap();
        let mut document = Document::open(&graph).unwrap();
        assert_eq!(document.shaders().count(), 0);
        document.use_sources(Arc::new(sources));
        document
    }

    #[test]
    fn a_graph_has_the_shaders_of_its_stages_and_their_imports() {
        let folder = tempfile::tempdir().unwrap();
        let document = opened(folder.path(), Sources::new(&epigraph_stages::registry()));
        let found = short(&document);
        for file in ["depth_cull.wgsl", "fill.wgsl", "tonemap.wgsl", "frame.wgsl", "cloud.wgsl", "pixel.wgsl"]
        {
            assert_eq!(found.iter().filter(|known| **known == file).count(), 1, "{file} in {found:?}");
        }
        let at = |file: &str| found.iter().position(|known| *known == file).unwrap();
        assert!(at("depth_cull.wgsl") < at("cloud.wgsl"), "modules come last: {found:?}");
        assert!(!found.contains(&"spread.wgsl"), "it belongs to another graph: {found:?}");
        let path = document.shader_of("view/cull").unwrap();
        assert_eq!(document.text(path), epigraph_shaders::text("depth_cull.wgsl"));
        assert_eq!(document.users_of(path).collect::<Vec<_>>(), ["view/cull"]);
        // None of them has changed.
        assert!(!document.is_dirty() && document.unsaved().next().is_none() && !document.can_undo());
    }

    #[test]
    fn shaders_of_stages_are_edited_saved_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = |file: &str| folder.path().join(file).display().to_string();
        let (shader, module, absent) = (path("tone.wgsl"), path("module.wgsl"), path("absent.wgsl"));
        fs::write(&shader, "#import module\n").unwrap();
        fs::write(&module, "// m\n").unwrap();
        let sources = Sources {
            kinds: BTreeMap::from([("tonemap", shader.clone()), ("fill", absent.clone())]),
            modules: BTreeMap::from([("module".into(), module.clone()), ("other".into(), path("o.wgsl"))]),
        };
        let mut document = opened(folder.path(), sources);
        assert_eq!(short(&document), ["tone.wgsl", "module.wgsl"]);

        document.type_text(&module, "// mine\n");
        assert_eq!(document.unsaved().collect::<Vec<_>>(), [(module.as_str(), "// mine\n")]);
        document.save().unwrap();
        assert_eq!(fs::read_to_string(&module).unwrap(), "// mine\n");
        document.undo();
        assert_eq!(document.text(&module), "// m\n");

        let revision = document.revision();
        fs::write(&shader, "// another program's\n").unwrap();
        fs::write(&absent, "// here now\n").unwrap();
        assert!(document.refresh() && document.revision() > revision);
        assert_eq!(document.text(&shader), "// another program's\n");
        assert_eq!(short(&document), ["absent.wgsl", "tone.wgsl"]);
        document.type_text(&shader, "#import module\n#import nothing\n");
        assert_eq!(short(&document), ["absent.wgsl", "tone.wgsl", "module.wgsl"]);
    }

    #[test]
    fn without_source_files_no_shaders_can_be_edited() {
        let folder = tempfile::tempdir().unwrap();
        let gone = |name: &str| folder.path().join(name).display().to_string();
        let sources = Sources {
            kinds: BTreeMap::from([("tonemap", gone("tonemap.wgsl"))]),
            modules: BTreeMap::from([("frame".into(), gone("frame.wgsl"))]),
        };
        let mut document = opened(folder.path(), sources);
        assert_eq!(document.shaders().count(), 0);
        assert!(!document.refresh() && !document.is_dirty());
    }
}
