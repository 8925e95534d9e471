//! A figure for a paper: for each view the whole picture, crops of all graphs beside those of the reference, and their
//! error maps with the errors below them. All lengths are points, 1/72 inch.

use epigraph_pictures::{
    Difference, Picture, Ramp,
    svg::{Anchor, Font, Svg},
};

use super::{
    Work,
    cell::{Cell, Record},
    crops::{Bitmap, worst},
    figure::Metric,
    plot::wrapped,
    results::mean,
    study::Study,
    wanted,
};
use crate::{args::FigureArgs, error::CliError, values::Crop};

/// The most columns without that of the reference, and the most crops.
const MOST_COLUMNS: usize = 7;
const MOST_CROPS: usize = 4;
/// How many crops are found where none are given, and the share of the shorter side of a picture that they have.
const FOUND_CROPS: usize = 2;
const FOUND_SHARE: u32 = 6;
/// Errors that are written below each picture.
const METRICS: usize = 2;

const POINTS_PER_MM: f64 = 72.0 / 25.4;
/// Distance of pictures from each other, and of rows.
const GAP: f64 = 3.0;
const ROW_GAP: f64 = 9.0;
/// Height of a line of text, and its share above the baseline.
const LINE: f64 = 9.0;
const ASCENT: f64 = 7.0;
/// Texts, and those that stand out.
const TEXT: Font = Font { size: 7.5, color: "#000", bold: false };
const STRONG: Font = Font { bold: true, ..TEXT };
/// The widths of letters, as shares of the font's size: those of wide fonts, as the reader's is not known.
const LETTER: f64 = 0.6;
const BOLD_LETTER: f64 = 0.7;
/// The colours of the crops.
const COLORS: [&str; MOST_CROPS] = ["#e8452c", "#2f7fd6", "#35a04a", "#e69a00"];
/// The fewest pixels of an embedded crop, and of a whole picture: some 300 per inch.
const CROP_PIXELS: usize = 300;
const WHOLE_PIXELS: usize = 600;

/// A graph with its variation at a budget.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    variation: String,
    budget: String,
    /// What is written above it: the graph, its parameters, the budget.
    head: Vec<String>,
}

/// What a figure shows, known before anything is measured.
pub struct Figure {
    columns: Vec<Column>,
    /// Those that are given; if there are none, they are found.
    crops: Vec<Crop>,
    width: f64,
}

/// The pictures of one view.
struct Row<'a> {
    cell: &'a Cell,
    reference: Picture,
    /// One for each column that is measured.
    entries: Vec<Option<Entry<'a>>>,
}

/// A picture of a row.
struct Entry<'a> {
    picture: Picture,
    /// FLIP's errors of the pixels.
    errors: Vec<f32>,
    /// All seeds.
    records: Vec<&'a Record>,
}

/// The lengths of a row.
struct Lengths {
    /// Width of the crops, and the heights of all of them, one below the other.
    crop: f64,
    heights: Vec<f64>,
    /// Height of an error map.
    map: f64,
    /// Width and height of the whole picture.
    whole: [f64; 2],
}

impl Column {
    fn of(cell: &Cell) -> Self {
        let params = cell.params.iter().map(|(param, value)| {
            let name = param.rsplit_once('.').map_or(param.as_str(), |(_, name)| name);
            format!("{name} {value}")
        });
        let budget = if cell.budget.contains(' ') {
            cell.budget.clone()
        } else {
            // A count, or a share of the pixels.
            format!("{} samples", cell.budget)
        };
        let head = [cell.graph.clone()].into_iter().chain(params).chain([budget]).collect();
        Self { variation: cell.variation(), budget: cell.budget.clone(), head }
    }

    fn is_of(&self, cell: &Cell) -> bool {
        self.variation == cell.variation() && self.budget == cell.budget
    }
}

impl Figure {
    /// What the options choose.
    ///
    /// # Errors
    /// Columns that the experiment does not have, and crops that do not lie in its pictures.
    pub fn plan(args: &FigureArgs, study: &Study) -> Result<Self, CliError> {
        let mut all: Vec<Column> = Vec::new();
        for cell in &study.cells {
            if !all.iter().any(|column| column.is_of(cell)) {
                all.push(Column::of(cell));
            }
        }
        let Some(first) = all.first().map(|column| column.budget.clone()) else {
            return Err(CliError::Input("--figure shows cells, but the experiment has only searches".into()));
        };
        let named = |name: &String| {
            let is_named = |column: &&Column| {
                column.variation == *name || format!("{}, {}", column.variation, column.budget) == *name
            };
            all.iter().find(is_named).cloned().ok_or_else(|| {
                let known: Vec<String> =
                    all.iter().map(|column| format!("`{}, {}`", column.variation, column.budget)).collect();
                CliError::Input(format!("--show {name}: the experiment has {}", known.join(", ")))
            })
        };
        let columns: Vec<Column> = if args.show.is_empty() {
            all.iter().filter(|column| column.budget == first).cloned().collect()
        } else {
            args.show.iter().map(named).collect::<Result<_, _>>()?
        };
        let too_many = |count: usize, what: &str, most: usize, option: &str| {
            CliError::Input(format!("a figure of {count} {what}; it has room for {most}: {option}"))
        };
        if columns.len() > MOST_COLUMNS {
            let option = format!("choose some with --show {:?} --show ...", columns[0].variation);
            return Err(too_many(columns.len(), "columns", MOST_COLUMNS, &option));
        }
        if args.crops.len() > MOST_CROPS {
            return Err(too_many(args.crops.len(), "crops", MOST_CROPS, "name fewer --crop"));
        }
        for crop in &args.crops {
            for size in &study.experiment.sizes {
                let fits = |side: usize| crop.at[side].saturating_add(crop.size[side]) <= size.value[side];
                if !(fits(0) && fits(1)) {
                    let [width, height] = size.value;
                    let text = format!("--crop {crop} does not lie in a picture of {width}x{height} pixels");
                    return Err(CliError::Input(text));
                }
            }
        }
        Ok(Self { columns, crops: args.crops.clone(), width: f64::from(args.width) * POINTS_PER_MM })
    }

    fn svg(&self, rows: &[Row], metrics: &[Metric], spp: u32, about: &str) -> Result<String, String> {
        let mut svg = Svg::default();
        let crops: Vec<Vec<Crop>> = rows.iter().map(|row| self.crops(row)).collect();
        // All rows share the columns, so the narrowest one decides.
        let crop = rows.iter().zip(&crops).map(|(row, crops)| self.crop_width(row, crops));
        let crop = crop.fold(f64::INFINITY, f64::min);
        let mut top = self.heads(&mut svg, crop);
        for (row, crops) in rows.iter().zip(&crops) {
            top =
                self.row(&mut svg, row, crops, &Lengths::new(row, crops, crop), top, metrics, spp)? + ROW_GAP;
        }
        Ok(svg.finish_print([self.width, top - ROW_GAP], about))
    }

    /// The crops of a row: those that are given, or the places in which the errors of the columns differ most; of a
    /// single column, in which they are largest.
    fn crops(&self, row: &Row) -> Vec<Crop> {
        if !self.crops.is_empty() {
            return self.crops.clone();
        }
        let entries: Vec<&Entry> = row.entries.iter().flatten().collect();
        let spread = |pixel: usize| {
            let errors = entries.iter().map(|entry| f64::from(entry.errors[pixel]));
            let [low, high] =
                errors.fold([f64::INFINITY, 0.0_f64], |[low, high], error| [low.min(error), high.max(error)]);
            if entries.len() == 1 { high } else { high - low }
        };
        let spread: Vec<f64> = (0..row.reference.colors.len()).map(spread).collect();
        let side = (row.cell.size[0].min(row.cell.size[1]) / FOUND_SHARE).max(1) as usize;
        worst(&spread, row.reference.size, [side; 2], FOUND_CROPS)
    }

    /// The width at which a row is as wide as the figure, with the whole picture as high as the crops and the map.
    fn crop_width(&self, row: &Row, crops: &[Crop]) -> f64 {
        let whole = aspect(row.cell.size);
        let (gaps, heights) =
            (crops.len() as f64 * GAP, crops.iter().map(|crop| aspect(crop.size)).sum::<f64>());
        let columns = self.columns.len() as f64 + 1.0;
        (self.width - columns * GAP - gaps / whole) / (heights / whole + 1.0 + columns)
    }

    /// The left end of a column; that of the reference is the last one.
    fn left(&self, column: usize, crop: f64) -> f64 {
        self.width - (self.columns.len() + 1 - column) as f64 * (crop + GAP) + GAP
    }

    /// The headings. Returns where they end.
    fn heads(&self, svg: &mut Svg, crop: f64) -> f64 {
        let letters = (crop / (TEXT.size * LETTER)) as usize;
        let lines = |head: &[String]| -> Vec<(String, Font)> {
            let font = |nth: usize| if nth == 0 { STRONG } else { TEXT };
            let of = |(nth, text): (usize, &String)| {
                wrapped(text, letters).into_iter().map(move |line| (line, font(nth))).collect::<Vec<_>>()
            };
            head.iter().enumerate().flat_map(of).collect()
        };
        let mut heads: Vec<Vec<(String, Font)>> =
            self.columns.iter().map(|column| lines(&column.head)).collect();
        heads.push(vec![("reference".to_owned(), STRONG)]);
        let most = heads.iter().map(Vec::len).max().unwrap_or(0);
        for (column, lines) in heads.iter().enumerate() {
            let middle = self.left(column, crop) + crop / 2.0;
            for (nth, (line, font)) in lines.iter().enumerate() {
                let y = (most - lines.len() + nth) as f64 * LINE + ASCENT;
                fitted(svg, [middle, y], line, crop, *font);
            }
        }
        most as f64 * LINE + GAP - 1.0
    }

    /// Draws a row. Returns where it ends.
    fn row(
        &self,
        svg: &mut Svg,
        row: &Row,
        crops: &[Crop],
        lengths: &Lengths,
        top: f64,
        metrics: &[Metric],
        spp: u32,
    ) -> Result<f64, String> {
        let reference = Bitmap::of(&row.reference);
        self.whole(svg, row, &reference, crops, lengths, top)?;
        let map_top = top + lengths.heights.iter().map(|height| height + GAP).sum::<f64>();
        let text_top = map_top + lengths.map + ASCENT + 1.0;
        let metrics = &metrics[..metrics.len().min(METRICS)];
        for (column, entry) in row.entries.iter().enumerate() {
            let left = self.left(column, lengths.crop);
            let Some(entry) = entry else {
                fitted(svg, [left + lengths.crop / 2.0, top + LINE], "not measured", lengths.crop, TEXT);
                continue;
            };
            self.crops_of(svg, &Bitmap::of(&entry.picture), crops, lengths, [left, top])?;
            let colors = entry.errors.iter().map(|error| Ramp::Magma.color(*error)).collect();
            let map = Bitmap { size: reference.size, colors };
            svg.image([left, map_top], [lengths.crop, lengths.map], &map.enlarged(CROP_PIXELS).url()?);
            for (nth, metric) in metrics.iter().enumerate() {
                let Some(value) = entry.figure(*metric) else { continue };
                let all = row.entries.iter().flatten().filter_map(|other| other.figure(*metric));
                let best = all.reduce(if metric.more_is_better() { f64::max } else { f64::min });
                // What is written alike is equally good.
                let text = metric.written(value);
                let is_best = self.columns.len() > 1 && best.is_some_and(|best| text == metric.written(best));
                let at = [left + lengths.crop / 2.0, text_top + LINE * nth as f64];
                let font = if is_best { STRONG } else { TEXT };
                fitted(svg, at, &text, lengths.crop, font);
            }
        }
        let left = self.left(self.columns.len(), lengths.crop);
        self.crops_of(svg, &reference, crops, lengths, [left, top])?;
        self.scale(svg, lengths, [left, map_top])?;
        let note = format!("{spp} samples/pixel");
        fitted(svg, [left + lengths.crop / 2.0, text_top], &note, lengths.crop, TEXT);
        Ok(text_top + LINE * metrics.len().max(1) as f64 - ASCENT)
    }

    /// The whole picture with the places of the crops, and the name of the view below it.
    fn whole(
        &self,
        svg: &mut Svg,
        row: &Row,
        reference: &Bitmap,
        crops: &[Crop],
        lengths: &Lengths,
        top: f64,
    ) -> Result<(), String> {
        let [width, height] = lengths.whole;
        let left = self.left(0, lengths.crop) - GAP - width;
        svg.image([left, top], [width, height], &reference.enlarged(WHOLE_PIXELS).url()?);
        let scale = width / f64::from(row.cell.size[0]);
        for (crop, color) in crops.iter().zip(COLORS) {
            let [x, y] = crop.at.map(|side| f64::from(side) * scale);
            let size = crop.size.map(|side| f64::from(side) * scale);
            // On a white one, so that it is seen on all colours.
            svg.outline([left + x, top + y], size, "#fff", 2.4);
            svg.outline([left + x, top + y], size, color, 1.2);
        }
        let Cell { scene, camera, size: [w, h], compare, .. } = row.cell;
        let frame = compare.last().map_or(String::new(), |frame| format!(", frame {frame}"));
        let texts = [(scene.clone(), STRONG), (format!("{camera}, {w}\u{d7}{h}{frame}"), TEXT)];
        for (nth, (text, font)) in texts.iter().enumerate() {
            let at = [left + width / 2.0, top + height + ASCENT + 1.0 + LINE * nth as f64];
            fitted(svg, at, text, width, *font);
        }
        Ok(())
    }

    fn crops_of(
        &self,
        svg: &mut Svg,
        picture: &Bitmap,
        crops: &[Crop],
        lengths: &Lengths,
        [left, mut top]: [f64; 2],
    ) -> Result<(), String> {
        for ((crop, color), height) in crops.iter().zip(COLORS).zip(&lengths.heights) {
            let url = picture.part(crop).enlarged(CROP_PIXELS).url()?;
            svg.image([left, top], [lengths.crop, *height], &url);
            // Inside, so that columns keep their distance.
            svg.outline([left + 0.5, top + 0.5], [lengths.crop - 1.0, height - 1.0], color, 1.0);
            top += height + GAP;
        }
        Ok(())
    }

    /// The colours of the error maps, in the place where the reference would have one.
    fn scale(&self, svg: &mut Svg, lengths: &Lengths, [left, top]: [f64; 2]) -> Result<(), String> {
        let colors = (0..=255_u8).map(|step| Ramp::Magma.color(f32::from(step) / 255.0)).collect();
        let (width, height) = (lengths.crop, 6.0);
        fitted(svg, [left + width / 2.0, top + ASCENT], "FLIP of a pixel", width, TEXT);
        let top = top + LINE + 1.0;
        svg.image([left, top], [width, height], &Bitmap { size: [256, 1], colors }.url()?);
        for (text, x, anchor) in
            [("0", 0.0, Anchor::Start), ("0.5", 0.5, Anchor::Middle), ("1", 1.0, Anchor::End)]
        {
            svg.text([left + x * width, top + height + ASCENT + 1.0], text, anchor, TEXT);
        }
        Ok(())
    }
}

impl Lengths {
    fn new(row: &Row, crops: &[Crop], crop: f64) -> Self {
        let heights: Vec<f64> = crops.iter().map(|of| crop * aspect(of.size)).collect();
        let ratio = aspect(row.cell.size);
        let map = crop * ratio;
        let height = heights.iter().map(|height| height + GAP).sum::<f64>() + map;
        Self { crop, heights, map, whole: [height / ratio, height] }
    }
}

/// A text about a middle, in smaller letters if it were wider than this.
fn fitted(svg: &mut Svg, middle: [f64; 2], text: &str, width: f64, font: Font) {
    let letter = if font.bold { BOLD_LETTER } else { LETTER };
    let wide = font.size * letter * text.chars().count() as f64;
    let size = (font.size * (width / wide).min(1.0) * 100.0).floor() / 100.0;
    svg.text(middle, text, Anchor::Middle, Font { size, ..font });
}

/// Height by width.
fn aspect([width, height]: [u32; 2]) -> f64 {
    f64::from(height) / f64::from(width)
}

impl Entry<'_> {
    /// The mean over the seeds.
    fn figure(&self, metric: Metric) -> Option<f64> {
        mean(self.records.iter().copied(), metric.column())
    }
}

impl Work<'_> {
    /// Draws the figure from what is measured.
    ///
    /// # Errors
    /// Nothing is measured, and files that cannot be read.
    pub fn figure(&self, figure: &Figure, records: &[Record]) -> Result<String, CliError> {
        let experiment = self.study.experiment;
        let mut rows = Vec::new();
        for view in records.chunk_by(|a, b| a.cell.view() == b.cell.view()) {
            rows.extend(self.figure_row(figure, view)?);
        }
        if rows.is_empty() {
            return Err(CliError::Input("--figure: nothing that it shows is measured".into()));
        }
        let about = format!(
            "{} Pictures are those of the first seed, errors means over {} seeds and the compared frames. {}",
            experiment.doc,
            experiment.seeds.len(),
            self.about()
        );
        figure.svg(&rows, &experiment.metrics, experiment.spp, about.trim()).map_err(CliError::Input)
    }

    /// The pictures of one view, if there are any.
    fn figure_row<'a>(&self, figure: &Figure, view: &'a [Record]) -> Result<Option<Row<'a>>, CliError> {
        let cell = &view[0].cell;
        let Some(last) = wanted(self.study, cell).last() else { return Ok(None) };
        let Some(reference) = last.picture(self.store)? else { return Ok(None) };
        let first = self.study.experiment.seeds.first();
        let mut entries = Vec::new();
        for column in &figure.columns {
            let of_column = |record: &&Record| column.is_of(&record.cell) && record.measured().is_some();
            let records: Vec<&Record> = view.iter().filter(of_column).collect();
            let shown = records.iter().find(|record| Some(&record.cell.seed) == first);
            let picture = match shown {
                Some(record) => self.store.picture(&record.cell.key)?,
                None => None,
            };
            entries.push(picture.map(|picture| {
                let errors = Difference::new(&reference, &picture).errors;
                Entry { picture, errors, records }
            }));
        }
        Ok(entries.iter().any(Option::is_some).then_some(Row { cell, reference, entries }))
    }
}
