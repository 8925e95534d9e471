//! The graph that views compare with. It runs beside the current graph while any view needs it.

use std::{
    mem,
    path::{Path, PathBuf},
    sync::Arc,
};

use epigraph::{changed, split};
use epigraph_core::{GraphFile, Problems, Registry};

use crate::{
    document::Document,
    engine::{Other, Shaders},
    files::{self, Choice},
};

/// The chosen graph, and the ports of it that panes watch.
#[derive(Default)]
pub struct Beside {
    /// Its file; `None` for the current graph as saved.
    pub path: Option<String>,
    /// Changes to it, as they follow a graph's name: `+sigma=0.5`.
    pub changes: String,
    /// Ports that panes watch; they repeat their requests in each frame of the window.
    wanted: Option<Vec<String>>,
    /// The opened file, while any pane needs the graph.
    open: Option<(String, Result<Document, String>)>,
    /// The opened file with the changes.
    variant: Option<Variant>,
    /// Number of variants made so far.
    made: u64,
    choices: Vec<Choice>,
    /// The last state sent to the engine: the variant's number, the ports.
    sent: Option<(u64, Vec<String>)>,
}

/// A graph with changes.
struct Variant {
    /// The file, its revision, and the changes.
    of: (String, u64, String),
    /// The graph, or the reason why the changes cannot be made.
    file: Result<Arc<GraphFile>, String>,
    /// Its shader files, and their texts if they can be read.
    shaders: Vec<(PathBuf, Option<Arc<str>>)>,
    number: u64,
}

impl Beside {
    /// Requests a port, `node.port`, in addition to the outputs. Call it in each frame of the window.
    pub fn want(&mut self, port: &str) {
        let wanted = self.wanted.get_or_insert_default();
        if !wanted.iter().any(|known| known == port) {
            wanted.push(port.to_owned());
        }
    }

    /// The graphs to choose from.
    pub fn choices(&self) -> &[Choice] {
        &self.choices
    }

    /// The reason why the graph cannot be read.
    pub fn trouble(&self) -> Option<String> {
        match &self.open.as_ref()?.1 {
            Ok(open) => match open.problems().first() {
                Some(problem) => Some(problem.to_string()),
                None => self.variant.as_ref()?.file.as_ref().err().cloned(),
            },
            Err(error) => Some(error.clone()),
        }
    }

    /// The change to send to the engine, if any. Call it once in each frame of the window.
    pub fn news(&mut self, document: &Document, registry: &Registry) -> Option<Option<Other>> {
        let end = |sent: &mut Option<_>| sent.take().map(|_| None);
        let Some(mut wanted) = mem::take(&mut self.wanted) else {
            (self.open, self.variant) = (None, None);
            return end(&mut self.sent);
        };
        let path = self.path.as_deref().unwrap_or(document.path());
        if self.open.as_ref().is_none_or(|(open, _)| open != path) {
            self.choices = files::graphs(Path::new(document.path()));
            let open = Document::open(Path::new(path)).map(|mut open| {
                open.use_sources(document.sources().clone());
                open
            });
            let open = open.map_err(|problems| problems.to_string());
            self.open = Some((path.to_owned(), open));
        }
        let Some((path, Ok(open))) = &self.open else { return end(&mut self.sent) };
        let Some(file) = open.file() else { return end(&mut self.sent) };
        let of = (path.clone(), open.revision(), self.changes.trim().to_owned());
        let made = &mut self.made;
        let variant = match self.variant.take_if(|variant| variant.of == of) {
            Some(variant) => variant,
            None => {
                *made += 1;
                Variant::new(of, file, registry, *made)
            }
        };
        let variant = self.variant.insert(variant);
        let Ok(file) = &variant.file else { return end(&mut self.sent) };
        wanted.sort();
        let now = (variant.number, wanted);
        if self.sent.as_ref() == Some(&now) {
            return None;
        }
        let mut shaders: Shaders = open.shaders().map(|(path, text)| (path.into(), text.clone())).collect();
        let own = variant.shaders.iter().filter_map(|(path, text)| Some((path.clone(), text.clone()?)));
        shaders.extend(own);
        let other = Other { file: file.clone(), shaders: Arc::new(shaders), watched: now.1.clone() };
        self.sent = Some(now);
        Some(Some(other))
    }

    /// Reloads its files if they have changed.
    pub fn refresh(&mut self) {
        match &mut self.open {
            Some((_, Ok(open))) => _ = open.refresh(),
            open => *open = None,
        }
        self.variant.take_if(|variant| variant.is_stale());
    }
}

impl Variant {
    fn new(of: (String, u64, String), file: &Arc<GraphFile>, registry: &Registry, number: u64) -> Self {
        if of.2.is_empty() {
            return Self { of, file: Ok(file.clone()), shaders: Vec::new(), number };
        }
        let file = with_changes(file, &of.2, registry).map_err(|problems| problems.to_string());
        let named = file.iter().flat_map(|file| file.shaders());
        let shaders = named.map(|(_, path)| (path.clone(), read(&path))).collect();
        Self { of, file, shaders, number }
    }

    /// Whether the changes are to be made anew: a shader has changed, or a file was missing.
    fn is_stale(&self) -> bool {
        self.file.is_err() || self.shaders.iter().any(|(path, text)| read(path) != *text)
    }
}

fn read(path: &Path) -> Option<Arc<str>> {
    epigraph_files::text(path).ok().map(Into::into)
}

/// A graph with the changes that follow its name.
fn with_changes(
    file: &Arc<GraphFile>,
    changes: &str,
    registry: &Registry,
) -> Result<Arc<GraphFile>, Problems> {
    let plus = if changes.starts_with('+') { "" } else { "+" };
    let named = format!("graph{plus}{changes}");
    let (_, changes) = split(&named)?;
    let file = changed(GraphFile::clone(file), &changes, registry)?;
    file.whole()?;
    Ok(Arc::new(file))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const EMPTY: &str = "Graph(version: 1, nodes: {}, outputs: {})";

    fn news(beside: &mut Beside, document: &Document, ports: &[&str]) -> Option<Option<Other>> {
        ports.iter().for_each(|port| beside.want(port));
        beside.news(document, &epigraph_stages::registry())
    }

    #[test]
    fn each_change_is_sent_to_the_engine_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let text = |name: &str| path(name).display().to_string();
        fs::write(path("a.ron"), EMPTY).unwrap();
        fs::write(path("b.ron"), EMPTY).unwrap();
        let document = Document::open(&path("a.ron")).unwrap();
        let mut beside = Beside::default();
        let registry = epigraph_stages::registry();
        assert!(beside.news(&document, &registry).is_none(), "no pane needs it");

        // The graph as saved.
        let other = news(&mut beside, &document, &["y.z", "x.y", "y.z"]).unwrap().unwrap();
        assert_eq!(other.file.path, text("a.ron"));
        assert_eq!(other.watched, ["x.y", "y.z"]);
        assert!(news(&mut beside, &document, &["x.y", "y.z"]).is_none());
        assert!(beside.choices().iter().any(|choice| choice.text == text("b.ron")));

        // Another file, which is then changed, broken and fixed.
        beside.path = Some(text("b.ron"));
        assert_eq!(news(&mut beside, &document, &["x.y"]).unwrap().unwrap().file.path, text("b.ron"));
        fs::write(path("b.ron"), format!("// More\n{EMPTY}")).unwrap();
        beside.refresh();
        assert!(news(&mut beside, &document, &["x.y"]).unwrap().unwrap().file.text.starts_with("// More"));
        fs::write(path("b.ron"), "Graph(").unwrap();
        beside.refresh();
        news(&mut beside, &document, &["x.y"]);
        assert!(beside.trouble().unwrap().contains("b.ron"));
        fs::write(path("b.ron"), EMPTY).unwrap();
        beside.refresh();
        assert_eq!(news(&mut beside, &document, &["x.y"]).unwrap().unwrap().file.text, EMPTY);
        assert_eq!(beside.trouble(), None);

        // A missing file ends the previous graph, until the file appears.
        beside.path = Some(text("c.ron"));
        assert!(news(&mut beside, &document, &["x.y"]).unwrap().is_none());
        assert!(beside.trouble().unwrap().contains("c.ron"));
        fs::write(path("c.ron"), EMPTY).unwrap();
        beside.refresh();
        assert!(news(&mut beside, &document, &["x.y"]).unwrap().is_some());

        // A variant of it. Changes that cannot be made give an error; without them, the graph itself runs again.
        fs::write(path("c.ron"), "Graph(version: 1, base: \"epi\")").unwrap();
        beside.refresh();
        news(&mut beside, &document, &["x.y"]);
        beside.changes = "interpolate.sigma=0.5 ".into();
        let other = news(&mut beside, &document, &["x.y"]).unwrap().unwrap();
        assert!(other.file.name().ends_with("c.ron +interpolate.sigma=0.5"), "{}", other.file.name());
        assert_eq!(beside.trouble(), None);
        for (changes, trouble) in
            [("+nobody.sigma=0.5", "unknown node `nobody`"), ("+swap:spread", "expected NODE=")]
        {
            beside.changes = changes.into();
            assert!(news(&mut beside, &document, &["x.y"]).is_none_or(|other| other.is_none()));
            assert!(beside.trouble().unwrap().contains(trouble), "{:?}", beside.trouble());
        }
        // A shader that appears, and then changes.
        let shader = "@group(0) @binding(2) var color: texture_2d<f32>;";
        beside.changes = format!("+swap:spread={}", text("mine.wgsl"));
        news(&mut beside, &document, &["x.y"]);
        assert_eq!(beside.trouble(), None, "compiling reports it");
        let mut texts = Vec::new();
        for text in [format!("// one\n{shader}"), format!("// two\n{shader}")] {
            fs::write(path("mine.wgsl"), text).unwrap();
            beside.refresh();
            let other = news(&mut beside, &document, &["x.y"]).unwrap().unwrap();
            texts.push(other.shaders[&path("mine.wgsl")].to_string());
            assert!(news(&mut beside, &document, &["x.y"]).is_none());
        }
        assert!(texts[0].starts_with("// one") && texts[1].starts_with("// two"), "{texts:?}");
        beside.changes.clear();
        assert!(news(&mut beside, &document, &["x.y"]).unwrap().is_some());
        assert_eq!(beside.trouble(), None);

        // No pane needs it any more.
        assert!(beside.news(&document, &registry).unwrap().is_none());
        assert!(beside.news(&document, &registry).is_none());
    }
}
