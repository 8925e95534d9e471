//! Histograms of the values of an image.

use epigraph_core::Snapshot;

use crate::{Curve, Lane, Look, Mode, Paint, Scale, lanes};

/// Number of bins.
pub const BINS: usize = 128;

/// Shares of the values before the first and beyond the last bin, unless the range includes them.
const BEYOND: [f64; 2] = [0.002, 0.998];

/// Counts of the values of the lanes shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// The axis of values, from the first bin to the last.
    pub axis: Scale,
    /// A row of 128 counts for each lane, in channel order. Values beyond the axis are counted in the bins at its ends.
    pub counts: Vec<Vec<u32>>,
}

impl Histogram {
    /// Counts the values of an image that a look shows; `None` in modes whose values are not quantities, and if there
    /// are no values.
    pub fn new(snapshot: &Snapshot, look: &Look) -> Option<Self> {
        let mode = look.mode_for(snapshot);
        let all = lanes(&snapshot.element);
        let one = all.get(look.lane).or(all.first())?;
        let shown: Vec<&Lane> = match mode {
            Mode::Color => {
                let mut lanes = look.channels.to_vec();
                lanes.dedup();
                lanes.iter().filter_map(|lane| all.get(*lane)).collect()
            }
            _ => vec![one],
        };
        let values = |lane: &Lane| -> Vec<f32> { look.amounts(snapshot, lane) };
        let values: Vec<Vec<f32>> = shown.into_iter().map(values).collect();
        let axis = axis(&values, mode, look, snapshot)?;
        let counts = values.iter().map(|values| count(values, &axis)).collect();
        Some(Self { axis, counts })
    }
}

/// An axis that covers the range and nearly all values.
fn axis(values: &[Vec<f32>], mode: Mode, look: &Look, snapshot: &Snapshot) -> Option<Scale> {
    let scale = match mode {
        Mode::Color => Scale { range: [0.0, 1.0], curve: Curve::Linear, paint: Paint::Grey },
        _ => look.scale(snapshot)?,
    };
    let mut all: Vec<f32> = values.iter().flatten().copied().collect();
    let last = all.len().checked_sub(1)?;
    let ends =
        BEYOND.map(|share| *all.select_nth_unstable_by((share * last as f64) as usize, f32::total_cmp).1);
    let [low, high] = [scale.range[0].min(scale.range[1]), scale.range[0].max(scale.range[1])];
    let (low, high) = (low.min(ends[0]), high.max(ends[1]));
    // Depths run from far to near, as shades do from dark to bright.
    let range = if scale.curve == Curve::Reciprocal { [high, low] } else { [low, high] };
    Some(Scale { range, ..scale })
}

fn count(values: &[f32], axis: &Scale) -> Vec<u32> {
    let mut counts = vec![0; BINS];
    for value in values {
        let bin = (axis.share(*value) * BINS as f32) as usize;
        counts[bin.min(BINS - 1)] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Dims, PortElement, texel};
    use epigraph_stages::meaning::{DEPTH, ID};

    use super::*;

    fn snapshot<T: bytemuck::Pod>(name: &str, element: epigraph_core::Element, data: &[T]) -> Snapshot {
        let dims = Dims { width: data.len() as u32, height: 1 };
        let bytes = bytemuck::cast_slice(data).to_vec();
        Snapshot { name: name.into(), field: String::new(), meaning: None, element, dims, frame: 0, bytes }
    }

    #[test]
    fn numbers_are_counted_where_they_lie() {
        let data = [0u32, 0, 127, 127, 127, 64, u32::MAX];
        let histogram = Histogram::new(&snapshot("a.sum", u32::element(), &data), &Look::default()).unwrap();
        assert_eq!((histogram.axis.range, histogram.counts.len()), ([0.0, 127.0], 1));
        let counts = &histogram.counts[0];
        assert_eq!((counts[0], counts[64], counts[BINS - 1], counts.iter().sum::<u32>()), (2, 1, 3, 6));
    }

    #[test]
    fn a_wider_range_widens_the_axis() {
        let numbers = snapshot("a.rate", f32::element(), &[1.0f32, 2.0, f32::NAN]);
        let look = Look { range: Some([-1.0, 9.0]), ..Look::default() };
        assert_eq!(Histogram::new(&numbers, &look).unwrap().axis.range, [-1.0, 9.0]);
    }

    #[test]
    fn colours_have_a_row_for_each_channel_and_names_none() {
        let colors = snapshot("a.color", texel::Rgba32Float::element(), &[[0.5f32, 0.25, 3.0, 1.0]; 4]);
        let histogram = Histogram::new(&colors, &Look::default()).unwrap();
        assert_eq!((histogram.axis.range, histogram.counts.len()), ([0.0, 3.0], 3));
        let single = Look { channels: [1; 3], ..Look::default() };
        assert_eq!(Histogram::new(&colors, &single).unwrap().counts.len(), 1);
        let ids = Snapshot { meaning: Some(ID), ..snapshot("a.id", u32::element(), &[1u32]) };
        assert_eq!(Histogram::new(&ids, &Look::default()), None);
        assert_eq!(Histogram::new(&snapshot("a.rate", f32::element(), &[f32::NAN]), &Look::default()), None);
    }

    #[test]
    fn depths_run_from_far_to_near() {
        let depths = snapshot("a.depth", f32::element(), &[2.0f32, 4.0, 8.0, 100.0]);
        let depths = Snapshot { meaning: Some(DEPTH), ..depths };
        let histogram = Histogram::new(&depths, &Look { far: 100.0, ..Look::default() }).unwrap();
        assert_eq!(histogram.axis.range, [8.0, 2.0]);
        assert_eq!(histogram.counts[0][0], 1);
        assert_eq!(histogram.counts[0].iter().sum::<u32>(), 3);
    }
}
