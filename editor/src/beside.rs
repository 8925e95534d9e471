//! The graph that views compare with. It runs beside the current graph while any view needs it.

use std::{mem, path::Path, sync::Arc};

use crate::{
    document::Document,
    engine::Other,
    files::{self, Choice},
};

/// The chosen graph, and the ports of it that panes watch.
#[derive(Default)]
pub struct Beside {
    /// Its file; `None` for the current graph as saved.
    pub path: Option<String>,
    /// Ports that panes watch; they repeat their requests in each frame of the window.
    wanted: Option<Vec<String>>,
    /// The opened file, while any pane needs the graph.
    open: Option<(String, Result<Document, String>)>,
    choices: Vec<Choice>,
    /// The last state sent to the engine: the file, its revision, the ports.
    sent: Option<(String, u64, Vec<String>)>,
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
            Ok(open) => open.problems().first().map(ToString::to_string),
            Err(error) => Some(error.clone()),
        }
    }

    /// The change to send to the engine, if any. Call it once in each frame of the window.
    pub fn news(&mut self, document: &Document) -> Option<Option<Other>> {
        let end = |sent: &mut Option<_>| sent.take().map(|_| None);
        let Some(mut wanted) = mem::take(&mut self.wanted) else {
            self.open = None;
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
        let Some((_, Ok(open))) = &self.open else { return end(&mut self.sent) };
        let Some(file) = open.file() else { return end(&mut self.sent) };
        wanted.sort();
        let now = (path.to_owned(), open.revision(), wanted);
        if self.sent.as_ref() == Some(&now) {
            return None;
        }
        let shaders = open.shaders().map(|(path, text)| (path.into(), text.clone())).collect();
        let other = Other { file: file.clone(), shaders: Arc::new(shaders), watched: now.2.clone() };
        self.sent = Some(now);
        Some(Some(other))
    }

    /// Reloads its files if they have changed.
    pub fn refresh(&mut self) {
        match &mut self.open {
            Some((_, Ok(open))) => _ = open.refresh(),
            open => *open = None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const EMPTY: &str = "Graph(version: 1, nodes: {}, outputs: {})";

    fn news(beside: &mut Beside, document: &Document, ports: &[&str]) -> Option<Option<Other>> {
        ports.iter().for_each(|port| beside.want(port));
        beside.news(document)
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
        assert!(beside.news(&document).is_none(), "no pane needs it");

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

        // No pane needs it any more.
        assert!(beside.news(&document).unwrap().is_none());
        assert!(beside.news(&document).is_none());
    }
}
