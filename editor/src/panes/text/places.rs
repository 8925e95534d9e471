//! Positions in texts: of problems, of nodes, and of search results.

use std::ops::Range;

use epigraph_core::{GraphFile, Place, Problem, Span};

/// The index of the character at a line and column, both counted from 1.
pub fn character(text: &str, (line, column): (usize, usize)) -> usize {
    let before: usize =
        text.split_inclusive('\n').take(line.saturating_sub(1)).map(|line| line.chars().count()).sum();
    before + column.saturating_sub(1)
}

/// The byte offset of the character at an index.
pub fn byte(text: &str, character: usize) -> usize {
    text.char_indices().nth(character).map_or(text.len(), |(at, _)| at)
}

/// The problems of a file, with the byte ranges that they concern.
pub fn wrong<'p>(path: &str, text: &str, problems: &'p [Problem]) -> Vec<(Range<usize>, &'p Problem)> {
    let placed = problems.iter().filter_map(|problem| Some((problem.place.as_ref()?, problem)));
    let here = placed.filter(|(place, _)| place.file == path && place.line > 0);
    here.map(|(place, problem)| (range(text, place), problem)).collect()
}

fn range(text: &str, place: &Place) -> Range<usize> {
    let line: usize = text.split_inclusive('\n').take(place.line - 1).map(str::len).sum();
    let rest = text[line..].lines().next().unwrap_or("");
    let (start, end) =
        (byte(rest, place.column.saturating_sub(1)), byte(rest, place.column - 1 + place.length));
    // For a problem at the end of a line, underline the last character.
    let start = if start == end { rest.char_indices().next_back().map_or(0, |(at, _)| at) } else { start };
    line + start..line + end
}

/// The occurrences of `wanted` in a text, ignoring the case of ASCII letters; none if `wanted` is empty.
pub fn found(text: &str, wanted: &str) -> Vec<Range<usize>> {
    if wanted.is_empty() {
        return Vec::new();
    }
    // ASCII lower case keeps all byte offsets.
    let (lower, wanted) = (text.to_ascii_lowercase(), wanted.to_ascii_lowercase());
    lower.match_indices(&wanted).map(|(at, found)| at..at + found.len()).collect()
}

/// The byte range of a node in the file at `path`; `None` if the node is in another file. In a graph with a base, the
/// range that changes the node.
pub fn of_node(file: &GraphFile, address: &str, path: &str) -> Option<Range<usize>> {
    let here = |name: &str| {
        let span = file.node_span(name).filter(|_| file.path == path);
        span.map(|Span { start, end }| start..end)
    };
    let part = |name: &str, rest: &str| {
        let (_, part) = file.parts.iter().find(|(part, _)| part == name)?;
        of_node(part, rest, path)
    };
    if let Some((node, _, rest)) = file.enter(address) {
        let name = &node.name.value;
        return rest.map_or_else(|| here(name), |rest| part(name, rest));
    }
    let changes = file.base.as_ref()?;
    let replaced = changes.parts.iter().find_map(|(name, part)| {
        of_node(part, address.strip_prefix(name.as_str())?.strip_prefix('/')?, path)
    });
    here(address).or(replaced).or_else(|| of_node(changes.graph.as_deref()?, address, path))
}

/// The address of the node at a byte offset of the file at `path`. If the graph uses that part several times, the node
/// in the first of them.
pub fn node_at(file: &GraphFile, path: &str, at: usize) -> Option<String> {
    let changes = file.base.as_ref();
    if file.path == path {
        let holds = |name: &&str| {
            let span = file.node_span(name);
            span.is_some_and(|span| (span.start..span.end).contains(&at))
        };
        let replaced = changes.into_iter().flat_map(|changes| &changes.replace);
        let names = file.nodes.iter().chain(replaced).map(|node| node.name.value.as_str());
        let set = changes.into_iter().flat_map(|changes| &changes.set).map(|(node, _)| node.value.as_str());
        return names.chain(set).find(holds).map(str::to_owned);
    }
    let inner = |(name, part): &(String, GraphFile)| Some(format!("{name}/{}", node_at(part, path, at)?));
    let changed = || changes.and_then(|changes| changes.parts.iter().find_map(inner));
    let base = || node_at(changes?.graph.as_deref()?, path, at);
    file.parts.iter().find_map(inner).or_else(changed).or_else(base)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problems_have_byte_ranges() {
        let text = "Graph(\n    version: 1,\n    nodes: { \"é\": (kind: 3) },\n    outputs: {},\n)\n";
        let problems = GraphFile::parse("a.ron", text).unwrap_err().0;
        let found = wrong("a.ron", text, &problems);
        assert_eq!(found.iter().map(|(range, _)| &text[range.clone()]).collect::<Vec<_>>(), ["3"]);
        assert!(wrong("b.ron", text, &problems).is_empty());
        assert_eq!(character(text, (3, 15)), text[..text.find('é').unwrap()].chars().count());
        assert_eq!(byte(text, character(text, (3, 15))), text.find('é').unwrap());
    }

    #[test]
    fn searching_ignores_case() {
        assert_eq!(found("Aé aÉ aa", "a"), [0..1, 4..5, 8..9, 9..10]);
        assert!(found("text", "").is_empty());
    }

    #[test]
    fn nodes_have_byte_ranges_also_in_parts() {
        let inner = "Graph(version: 1, nodes: {\n \"in\": (kind: \"fill\"),\n}, outputs: { \"color\": \"in.color\" })";
        let outer = "Graph(version: 1, nodes: {\n  \"a\": (kind: \"graph\", params: (file: \"p.ron\")),\n  // why\n  \"b\": (\n    kind: \"tonemap\",\n  ),\n}, outputs: { \"image\": \"b.image\" })";
        let file = GraphFile::parse("g.ron", outer).unwrap();
        let file = file.with_parts(&|_: &std::path::Path| Ok(inner.to_owned())).unwrap();
        let b = of_node(&file, "b", "g.ron").unwrap();
        assert!(
            outer[b.clone()].starts_with("\"b\": (") && outer[b.clone()].ends_with("\n  )"),
            "{}",
            &outer[b]
        );
        let part = &file.parts[0].1;
        let inside = of_node(&file, "a/in", &part.path).unwrap();
        assert_eq!(&inner[inside.clone()], "\"in\": (kind: \"fill\")");
        assert_eq!(of_node(&file, "a/in", "g.ron"), None);
        assert_eq!(node_at(&file, &part.path, inside.start + 3).as_deref(), Some("a/in"));
        assert_eq!(node_at(&file, "g.ron", outer.find("tonemap").unwrap()).as_deref(), Some("b"));
        assert_eq!(node_at(&file, "g.ron", outer.find("why").unwrap()), None);
    }
}
