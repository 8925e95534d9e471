//! A page that a person reads: pictures side by side, plots, figures. One file, which needs no other and no network.

use epigraph_pictures::{Picture, png, tone};
use serde_json::{Value, json};

use super::{
    cell::{Cell, Found, Reached, Record},
    crops::url,
    experiment::Experiment,
    figure::{Cost, Metric},
    results::{Results, groups, mean, short},
};

/// The page with places for its contents, each `{{NAME}}`.
const PAGE: &str = include_str!("page.html");

/// The most pictures, so that browsers can open the page.
const MOST_PICTURES: usize = 300;

/// A picture on the page.
pub struct Shown {
    /// The scene, the camera and the size.
    pub view: String,
    /// What made it.
    pub label: String,
    /// Its errors in words.
    pub figures: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The PNG file.
    pub png: Vec<u8>,
    /// Its error map, likewise. The reference has none.
    pub map: Option<Vec<u8>>,
}

impl Shown {
    /// The picture of a cell.
    pub fn of(record: &Record, metrics: &[Metric], png: Vec<u8>, map: Vec<u8>) -> Self {
        let cell = &record.cell;
        let figure =
            |metric: &Metric| Some(format!("{} {:.4}", metric.column(), record.figure(metric.column())?));
        let figures: Vec<String> = metrics.iter().take(4).filter_map(figure).collect();
        Self {
            view: cell.view(),
            label: format!("{}, {}", cell.variation(), cell.budget),
            figures: figures.join(", "),
            size: cell.size,
            png,
            map: Some(map),
        }
    }

    /// The converged picture of a cell's view.
    ///
    /// # Errors
    /// The encoder's error.
    pub fn reference(record: &Record, spp: u32, picture: &Picture) -> Result<Self, String> {
        let colors: Vec<[u8; 3]> = picture.colors.iter().copied().map(tone::to_srgb8).collect();
        Ok(Self {
            view: record.cell.view(),
            label: "reference".into(),
            figures: format!("{spp} samples per pixel"),
            size: record.cell.size,
            png: png(picture.size, &colors)?,
            map: None,
        })
    }
}

/// The page. `plots` are SVG files; of `pictures` at most the first [`MOST_PICTURES`] are shown.
pub fn page(results: &Results, plots: &[&str], pictures: &[Shown], about: &str) -> String {
    let Results { experiment, records, found, .. } = results;
    let few = &pictures[..pictures.len().min(MOST_PICTURES)];
    let data: Vec<Value> = few
        .iter()
        .map(|shown| {
            let (src, map) = (url(&shown.png), shown.map.as_deref().map(url));
            let Shown { view, label, figures, size, .. } = shown;
            json!({ "view": view, "label": label, "figures": figures, "size": size, "src": src, "map": map })
        })
        .collect();
    // Within a script, only `</script>` would end it.
    let data = Value::from(data).to_string().replace('<', "\\u003c");
    let frame = experiment.frames.compare.last().map_or(String::new(), u32::to_string);
    let mut shown = format!(
        "Frame {frame} of the first seed, as displayed; the figures are means over the compared frames."
    );
    if few.len() < pictures.len() {
        shown += &format!(" The first {} of {} pictures.", few.len(), pictures.len());
    }
    let plots = plots.iter().map(|svg| format!("<div class=\"plot\">{svg}</div>\n"));
    let title = if experiment.doc.is_empty() { "Trade-off" } else { &experiment.doc };
    let sort = "Click a heading to sort.";
    let mut tables = String::new();
    if !found.is_empty() {
        tables += &section("Searches", &format!("{SEARCHES_NOTE} {sort}"), &searches(experiment, found));
    }
    if !records.is_empty() {
        tables += &section("Figures", &format!("Means over the seeds. {sort}"), &cells(experiment, records));
    }
    let parts = [
        ("title", escaped(title)),
        ("about", escaped(about)),
        ("shown", escaped(&shown)),
        ("plots", plots.collect()),
        ("tables", tables),
        ("data", data),
    ];
    filled(&parts)
}

/// The page with these contents. What is put in is not looked through again.
fn filled(parts: &[(&str, String)]) -> String {
    let (mut page, mut rest) = (String::new(), PAGE);
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").expect("the page closes what it opens");
        let part = parts.iter().find(|(known, _)| *known == name).expect("the page names known parts");
        page += before;
        page += &part.1;
        rest = after;
    }
    page + rest
}

/// A table under a heading.
fn section(heading: &str, note: &str, table: &str) -> String {
    format!("<h2>{heading}</h2>\n<p class=\"quiet\">{note}</p>\n<div class=\"scroll\">{table}</div>\n")
}

/// A table. Columns may have descriptions, which browsers show under the mouse. The first five are texts.
fn table<'c>(
    columns: impl Iterator<Item = (&'c str, &'c str)>,
    rows: impl Iterator<Item = Vec<String>>,
) -> String {
    let heads = columns.map(|(name, doc)| match doc {
        "" => format!("<th>{name}</th>"),
        doc => format!("<th title=\"{}\">{name}</th>", escaped(doc)),
    });
    let row = |fields: Vec<String>| {
        let fields = fields.iter().map(|field| format!("<td>{}</td>", escaped(field)));
        format!("<tr>{}</tr>\n", fields.collect::<String>())
    };
    let (heads, rows) = (heads.collect::<String>(), rows.map(row).collect::<String>());
    format!("<table><thead><tr>{heads}</tr></thead><tbody>\n{rows}</tbody></table>")
}

/// The metrics of an experiment and some costs, as columns.
fn columns(experiment: &Experiment) -> Vec<(&'static str, &'static str)> {
    let metrics = experiment.metrics.iter().map(|metric| (metric.column(), metric.doc()));
    let costs = [Cost::PathsPerPixel, Cost::FrameMs, Cost::TraceMs].map(|cost| (cost.column(), cost.doc()));
    costs.into_iter().chain(metrics).collect()
}

/// What a cell or a search runs: the texts of a row, but for the last one.
fn setting(cell: &Cell) -> [String; 4] {
    let size = format!("{}x{}", cell.size[0], cell.size[1]);
    [cell.variation(), cell.scene.clone(), cell.camera.clone(), size]
}

fn four_digits(value: Option<f64>) -> String {
    value.map_or(String::new(), |value| format!("{value:.4}"))
}

/// A row for each set of repetitions.
fn cells(experiment: &Experiment, records: &[Record]) -> String {
    let columns = columns(experiment);
    let texts = ["graph", "scene", "camera", "size", "budget"].map(|name| (name, ""));
    let row = |group: &[Record]| {
        let [mut graph, scene, camera, size] = setting(&group[0].cell);
        if group.iter().all(|record| record.measured().is_none()) {
            graph += " (failed)";
        }
        let figures = columns.iter().map(|(name, _)| four_digits(mean(group, name)));
        [graph, scene, camera, size, group[0].cell.budget.clone()].into_iter().chain(figures).collect()
    };
    table(texts.into_iter().chain(columns.iter().copied()), groups(records).map(row))
}

/// What the columns of the searches' table are.
const SEARCHES_NOTE: &str = "The number of samples per frame, or the value of a parameter, at which a figure is what is \
    searched for, the interval in which it is, and what else was measured there. If one end is empty, the answer is \
    beyond what was tried.";

/// A row for each search.
fn searches(experiment: &Experiment, found: &[Found]) -> String {
    let columns = columns(experiment);
    let head = ["graph", "scene", "camera", "size", "search", "value", "from", "to"].map(|name| (name, ""));
    let row = |answer: &Found| {
        let [mut graph, scene, camera, size] = setting(&answer.cell);
        let none = String::new;
        let interval = match &answer.result {
            Reached::Within { value, interval: [low, high], .. } => {
                [value, low, high].map(|value| short(*value))
            }
            Reached::Below(value) => [none(), none(), short(*value)],
            Reached::Above(value) => [none(), short(*value), none()],
            Reached::Failed(_) => {
                graph += " (failed)";
                [none(), none(), none()]
            }
        };
        let search = format!("{} {} over {}", answer.column, answer.target, answer.over);
        let figures = columns.iter().map(|(name, _)| four_digits(answer.result.figure(name)));
        [graph, scene, camera, size, search].into_iter().chain(interval).chain(figures).collect()
    };
    table(head.into_iter().chain(columns.iter().copied()), found.iter().map(row))
}

/// Text with HTML's special characters escaped.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_in_is_not_looked_through_again() {
        let parts = ["title", "about", "shown", "plots", "tables", "data"];
        let page = filled(&parts.map(|name| (name, format!("[{name} {{{{about}}}}]"))));
        assert!(page.contains("<title>[title {{about}}]</title>") && page.ends_with("</html>\n"));
        assert_eq!(page.matches("{{about}}").count(), 7);
    }

    #[test]
    fn texts_cannot_break_the_page() {
        assert_eq!(escaped("<a href=\"x\"> & co"), "&lt;a href=&quot;x&quot;&gt; &amp; co");
        // It names nothing that is elsewhere.
        assert!(!PAGE.contains("http") && !PAGE.contains("<link") && !PAGE.contains("src="));
    }
}
