//! Points while they are read.

use epigraph_streams::{MOST_COORDINATE, Points};
use glam::{DVec3, Vec3};

use crate::{Input, LeftOut, MOST_POINTS};

/// Points in the order of a file, and what its kind says of them.
#[derive(Default)]
pub(crate) struct Cloud {
    pub(crate) positions: Vec<DVec3>,
    /// None, or one for each point.
    pub(crate) colors: Vec<[u8; 4]>,
    /// None, or one for each point.
    pub(crate) normals: Vec<Vec3>,
    /// The positions are single-precision numbers, which need no origin.
    pub(crate) single: bool,
    pub(crate) withheld: usize,
}

impl Cloud {
    /// Adds a point.
    ///
    /// # Errors
    /// There are too many.
    pub(crate) fn push(&mut self, position: DVec3) -> Result<(), String> {
        if self.positions.len() == MOST_POINTS {
            return Err(format!("it has more than {MOST_POINTS} points, the most of a point set"));
        }
        self.positions.push(position);
        Ok(())
    }

    /// The points whose coordinates are numbers.
    ///
    /// # Errors
    /// There are none.
    pub(crate) fn finish(mut self) -> Result<Input, String> {
        let is_number = |at: &DVec3| at.is_finite() && at.abs().max_element() <= f64::from(MOST_COORDINATE);
        let count = self.positions.len();
        if !self.positions.iter().all(is_number) {
            let mut at = self.positions.iter().map(is_number);
            self.colors.retain(|_| at.next().unwrap_or(true));
            let mut at = self.positions.iter().map(is_number);
            self.normals.retain(|_| at.next().unwrap_or(true));
            self.positions.retain(is_number);
        }
        let left_out = LeftOut { not_numbers: count - self.positions.len(), withheld: self.withheld };
        if self.positions.is_empty() {
            return Err(match left_out {
                LeftOut { not_numbers: 0, withheld: 0 } => "it has no points".into(),
                LeftOut { not_numbers, withheld } => format!(
                    "it has no points but {not_numbers} whose coordinates are no numbers and {withheld} withheld ones"
                ),
            });
        }
        let points = if self.single {
            self.positions.iter().map(|at| at.as_vec3()).collect::<Vec<_>>().into()
        } else {
            Points::from_double(&self.positions)
        };
        let points = Points {
            colors: Some(self.colors).filter(|colors| !colors.is_empty()),
            normals: Some(self.normals).filter(|normals| !normals.is_empty()),
            ..points
        };
        Ok(Input { points, left_out })
    }
}
