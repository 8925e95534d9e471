//! Lists of elements as tables: a column for each scalar, known words decoded, rows in any order.

use std::sync::Arc;

use epigraph_core::Snapshot;
use epigraph_stages::{
    meaning::POINTS,
    shared::cloud::{AGE, AGE_ONE, CHANGED, FRESH, LIVE, decode_radiance},
};
use rayon::prelude::*;

use crate::{
    Lane, Number, lanes,
    look::{NONE, POISON},
};

/// Significant digits of floats.
const DIGITS: usize = 6;

/// How a column reads its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reading {
    /// Unchanged.
    Plain,
    /// A point's age, 0 to 256.
    Age,
    /// A point's flags.
    State,
    /// A channel of packed radiance.
    Radiance(usize),
}

/// A column.
#[derive(Clone, Debug)]
pub struct Column {
    /// Its heading.
    pub name: String,
    field: usize,
    lane: Lane,
    reading: Reading,
}

/// A port's fields side by side, a row for each element.
#[derive(Clone, Debug)]
pub struct Table {
    fields: Vec<Arc<Snapshot>>,
    /// The columns from left to right.
    pub columns: Vec<Column>,
    /// Number of rows.
    pub rows: usize,
}

impl Table {
    /// Of all fields of a port.
    pub fn new(fields: Vec<Arc<Snapshot>>) -> Self {
        let columns =
            fields.iter().enumerate().flat_map(|(field, snapshot)| columns(field, snapshot)).collect();
        let rows = fields.iter().map(|field| field.dims.count()).min().unwrap_or(0);
        Self { fields, columns, rows }
    }

    /// The fields.
    pub fn fields(&self) -> &[Arc<Snapshot>] {
        &self.fields
    }

    /// The text of a cell; empty outside the table.
    pub fn text(&self, row: usize, column: usize) -> String {
        let Some((column, number)) = self.number(row, column) else { return String::new() };
        match (column.reading, number) {
            (Reading::State, number) => state(number.bits()).to_owned(),
            (Reading::Age | Reading::Radiance(_), number) => number.rounded(DIGITS),
            (_, Number::Unsigned(NONE)) => "none".to_owned(),
            (_, Number::Unsigned(POISON)) => "poison".to_owned(),
            (_, number) => number.rounded(DIGITS),
        }
    }

    /// The rows sorted by a column; rows with equal values keep their order. Slow for long tables.
    pub fn order(&self, column: usize, descending: bool) -> Vec<u32> {
        let key = |row: u32| {
            let key = self.number(row as usize, column).map_or(0, |(_, number)| rank(number));
            if descending { !key } else { key }
        };
        let mut keyed: Vec<(u32, u32)> =
            (0..self.rows as u32).into_par_iter().map(|row| (key(row), row)).collect();
        keyed.par_sort_unstable();
        keyed.into_iter().map(|(_, row)| row).collect()
    }

    /// The number in a cell as its column reads it; states stay undecoded.
    fn number(&self, row: usize, column: usize) -> Option<(&Column, Number)> {
        let column = self.columns.get(column)?;
        let number = column.lane.number(self.fields.get(column.field)?, row)?;
        let number = match column.reading {
            Reading::Plain => number,
            Reading::State => Number::Unsigned(number.bits() & (LIVE | FRESH | CHANGED)),
            Reading::Age => Number::Float((number.bits() & AGE) as f32 / AGE_ONE as f32),
            Reading::Radiance(channel) => Number::Float(decode_radiance(number.bits())[channel]),
        };
        Some((column, number))
    }
}

fn columns(field: usize, snapshot: &Snapshot) -> Vec<Column> {
    let lanes = lanes(&snapshot.element);
    let column = |name: &str, lane: &Lane, reading| Column {
        name: name.to_owned(),
        field,
        lane: lane.clone(),
        reading,
    };
    let is_cloud = snapshot.meaning == Some(POINTS);
    match (snapshot.field.as_str(), lanes.as_slice()) {
        // The words of the cloud, see its documentation.
        ("meta", [only]) if is_cloud && only.is_unsigned() => {
            vec![column("state", only, Reading::State), column("age", only, Reading::Age)]
        }
        ("radiance", [only]) if is_cloud && only.is_unsigned() => ["r", "g", "b"]
            .iter()
            .enumerate()
            .map(|(channel, letter)| column(&format!("radiance.{letter}"), only, Reading::Radiance(channel)))
            .collect(),
        (name, lanes) => lanes
            .iter()
            .map(|lane| {
                let parts = [name, lane.name.as_str()].into_iter().filter(|part| !part.is_empty());
                let heading = parts.collect::<Vec<_>>().join(".");
                column(if heading.is_empty() { "value" } else { &heading }, lane, Reading::Plain)
            })
            .collect(),
    }
}

fn state(meta: u32) -> &'static str {
    match meta {
        _ if meta & LIVE == 0 => "free",
        _ if meta & FRESH != 0 => "fresh",
        _ if meta & CHANGED != 0 => "changed",
        _ => "live",
    }
}

/// The sort key of a number among numbers of its kind: NaN comes last.
fn rank(number: Number) -> u32 {
    match number {
        Number::Unsigned(value) => value,
        Number::Signed(value) => value as u32 ^ 1 << 31,
        Number::Float(value) if value.is_nan() => u32::MAX,
        // Negative floats fall as their bits rise.
        Number::Float(value) if value.to_bits() >> 31 != 0 => !value.to_bits(),
        Number::Float(value) => value.to_bits() | 1 << 31,
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Dims, Element, PortElement};
    use epigraph_stages::shared::cloud::encode_radiance;

    use super::*;

    fn field<T: bytemuck::Pod>(name: &str, element: Element, data: &[T]) -> Arc<Snapshot> {
        let dims = Dims { width: data.len() as u32, height: 1 };
        let bytes = bytemuck::cast_slice(data).to_vec();
        let (name, field, meaning) = ("a.cloud".into(), name.into(), Some(POINTS));
        Arc::new(Snapshot { name, field, meaning, element, dims, frame: 0, bytes })
    }

    fn cloud() -> Table {
        Table::new(vec![
            field("position", <[f32; 2]>::element(), &[[1.5f32, -2.0], [-3.0, f32::NAN], [0.25, 9.0]]),
            field("radiance", u32::element(), &[[0.5; 3], [0.0, 2.0, 1.0], [0.0; 3]].map(encode_radiance)),
            field("image_id", u32::element(), &[7u32, NONE, 3]),
            field("meta", u32::element(), &[LIVE | 384, LIVE | FRESH, 0]),
        ])
    }

    #[test]
    fn known_words_are_decoded() {
        let table = cloud();
        let names: Vec<_> = table.columns.iter().map(|column| column.name.as_str()).collect();
        let radiance = ["radiance.r", "radiance.g", "radiance.b"];
        assert_eq!(names[..2], ["position.x", "position.y"]);
        assert_eq!((&names[2..5], &names[5..]), (&radiance[..], &["image_id", "state", "age"][..]));
        let row = |row| (0..8).map(|column| table.text(row, column)).collect::<Vec<_>>();
        assert_eq!(row(0), ["1.5", "-2", "0.5", "0.5", "0.5", "7", "live", "1.5"]);
        assert_eq!(row(1), ["-3", "NaN", "0", "2", "1", "none", "fresh", "0"]);
        assert_eq!((table.rows, row(3).concat()), (3, String::new()));
        let plain = Table::new(vec![field("", u32::element(), &[1u32])]);
        assert_eq!(plain.columns[0].name, "value");
    }

    #[test]
    fn rows_are_sorted_by_any_column_both_ways() {
        let table = cloud();
        assert_eq!(table.order(0, false), [1, 2, 0]);
        assert_eq!(table.order(1, false), [0, 2, 1]);
        assert_eq!(table.order(5, false), [2, 0, 1]);
        assert_eq!(table.order(7, true), [0, 1, 2]);
        let signed = Table::new(vec![field("", i32::element(), &[3i32, -5, 0, -5])]);
        assert_eq!(signed.order(0, false), [1, 3, 2, 0]);
    }

    #[test]
    fn a_million_rows_are_put_in_order() {
        let data: Vec<u32> = (0..1u32 << 20).map(|i| i.wrapping_mul(2_654_435_761)).collect();
        let table = Table::new(vec![field("", u32::element(), &data)]);
        let order = table.order(0, true);
        assert!(order.windows(2).all(|pair| data[pair[0] as usize] > data[pair[1] as usize]));
    }
}
