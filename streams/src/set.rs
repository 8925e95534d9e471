//! Point sets as scenes show them: models, and where they are.

use std::{fmt, path::Path};

use epigraph_files::{FileError, MOST_DATA};
use glam::{DVec3, Quat, Vec3};
use rayon::prelude::*;

use crate::{
    Codec, EncodeError, Model, Node, Points, Settings, VtsError, encode,
    repeats::{Repeats, Shape},
    unpack_normal,
};

/// Where a model is: its positions are rotated, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The model by its index.
    pub model: usize,
    /// A unit quaternion.
    pub rotation: Quat,
    /// Where the model's origin is, from that of the set.
    pub translation: Vec3,
}

impl Place {
    /// Takes positions from the model to the set.
    pub fn apply(&self, at: Vec3) -> Vec3 {
        self.rotation * at + self.translation
    }
}

/// Models, each at any number of places.
#[derive(Clone, PartialEq)]
pub struct PointSet {
    origin: DVec3,
    models: Vec<Model>,
    /// The first node of each model among those of all.
    firsts: Vec<usize>,
    places: Vec<Place>,
}

impl fmt::Debug for PointSet {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "PointSet of {} models at {} places", self.models.len(), self.places.len())
    }
}

impl From<Model> for PointSet {
    fn from(model: Model) -> Self {
        let place = Place { model: 0, rotation: Quat::IDENTITY, translation: Vec3::ZERO };
        Self::new(model.origin(), vec![model], vec![place])
    }
}

impl PointSet {
    /// Models at places.
    ///
    /// # Panics
    /// If a place names no model.
    pub fn new(origin: DVec3, models: Vec<Model>, places: Vec<Place>) -> Self {
        assert!(places.iter().all(|place| place.model < models.len()), "places of models that are there");
        let ends = models.iter().scan(0, |end, model| {
            let first = *end;
            *end += model.nodes().len();
            Some(first)
        });
        Self { origin, firsts: ends.collect(), models, places }
    }

    /// The vertices of parts that repeat. Each shape is a model, of one level if no two of its vertices share a cell of
    /// the first, and otherwise as the settings say.
    ///
    /// # Errors
    /// Those of [`encode`].
    pub fn of_repeats(repeats: &Repeats, settings: &Settings) -> Result<Self, EncodeError> {
        let models =
            repeats.shapes().par_iter().map(|shape| model(shape, settings)).collect::<Result<_, _>>()?;
        let places = repeats.instances().iter().map(|instance| Place {
            model: instance.shape as usize,
            rotation: instance.rotation,
            translation: instance.translation,
        });
        Ok(Self::new(repeats.origin(), models, places.collect()))
    }

    /// Reads a file `.vts` of at most [`MOST_DATA`] bytes: a tree of points, or repeats.
    ///
    /// # Errors
    /// The file cannot be read, is not valid, or holds repeats whose vertices [`encode`] refuses; the message names it.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let fail = |error: &dyn fmt::Display| FileError::read(path, error);
        let bytes = epigraph_files::bytes(path, MOST_DATA).map_err(|error| fail(&error))?;
        match Model::from_bytes(&bytes) {
            Err(VtsError::IsRepeats) => {
                let repeats = Repeats::from_file(&bytes).map_err(|error| fail(&error))?;
                Self::of_repeats(&repeats, &Settings::default()).map_err(|error| fail(&error))
            }
            read => read.map(Self::from).map_err(|error| fail(&error)),
        }
    }

    /// What to add to all positions.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The models.
    pub fn models(&self) -> &[Model] {
        &self.models
    }

    /// Where they are.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The nodes of all models, one model after the other.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.models.iter().flat_map(|model| model.nodes())
    }

    /// The index of a model's first node among [`PointSet::nodes`].
    pub fn first_node(&self, model: usize) -> usize {
        self.firsts[model]
    }

    /// One of [`PointSet::nodes`], by its index.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn node(&self, index: usize) -> &Node {
        let model = self.firsts.partition_point(|&first| first <= index) - 1;
        &self.models[model].nodes()[index - self.firsts[model]]
    }

    /// The sum of a number over all nodes, at all their places.
    pub fn placed(&self, number: impl Fn(&Node) -> usize) -> usize {
        let of = |model: &Model| model.nodes().iter().map(&number).sum::<usize>();
        let sums: Vec<usize> = self.models.iter().map(of).collect();
        self.places.iter().map(|place| sums[place.model]).sum()
    }

    /// Lowest and highest corner of a box around all points, from the origin.
    pub fn bounds(&self) -> [Vec3; 2] {
        let boxes: Vec<[Vec3; 2]> = self.models.iter().map(bounds).collect();
        let corners = self.places.iter().flat_map(|place| {
            let ends = boxes[place.model];
            (0..8).map(move |index| place.apply(corner(ends, index)))
        });
        corners.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
    }
}

fn model(shape: &Shape, settings: &Settings) -> Result<Model, EncodeError> {
    let points = Points {
        colors: shape.colors().map(<[_]>::to_vec),
        normals: shape.normals().map(|normals| normals.iter().map(|normal| unpack_normal(*normal)).collect()),
        ..Points::from(shape.positions().collect::<Vec<_>>())
    };
    let coarse = encode(&points, &Settings { codec: Codec::Packed, levels: 1, ..*settings })?;
    let levels = if coarse.nodes()[0].merged() == 0 { 1 } else { settings.levels };
    encode(&points, &Settings { levels, ..*settings })
}

/// A box around the points of a model.
fn bounds(model: &Model) -> [Vec3; 2] {
    let root = &model.nodes()[0];
    let around = root
        .positions()
        .into_iter()
        .fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)]);
    // The corner of a cell is at most this far from its centre.
    let margin = 0.5 * 3.0_f32.sqrt() * root.frame().cell;
    [around[0] - margin, around[1] + margin]
}

/// One of the eight corners of a box.
fn corner(ends: [Vec3; 2], index: usize) -> Vec3 {
    Vec3::from([0, 1, 2].map(|axis| ends[index >> axis & 1][axis]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repeats::{self, Surface, find};

    #[test]
    fn a_model_is_a_set_at_one_place() {
        let points = Points::from_double(&[DVec3::new(1e6, 0.0, 0.0), DVec3::new(1e6 + 2.0, 1.0, 0.0)]);
        let model = encode(&points, &Settings::default()).unwrap();
        let set = PointSet::from(model.clone());
        let twice = PointSet::new(points.origin, vec![model.clone(), model.clone()], set.places().to_vec());
        let count = model.nodes().len();
        assert_eq!([0, 1].map(|model| twice.first_node(model)), [0, count]);
        assert!(twice.nodes().enumerate().all(|(index, node)| std::ptr::eq(twice.node(index), node)));
        assert_eq!((set.origin(), set.models(), set.places().len()), (points.origin, &[model][..], 1));
        let [low, high] = set.bounds();
        assert!(points.positions.iter().all(|at| at.cmpge(low).all() && at.cmple(high).all()));
        assert!((high - low).max_element() < 2.1, "{low} {high}");
    }

    /// A wedge and two copies: the set's points are the vertices, within half a cell.
    #[test]
    fn repeats_are_one_model_at_several_places() {
        let wedge = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
        let turned = |angle: f32, by: Vec3| wedge.map(|at| Quat::from_rotation_z(angle) * at + by);
        let positions =
            [wedge, turned(1.0, Vec3::new(9.0, 0.0, 3.0)), turned(-2.0, Vec3::new(0.0, -9.0, 0.0))].concat();
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let triangles: Vec<[u32; 3]> =
            (0..3).flat_map(|part| faces.map(|corners| corners.map(|corner| corner + 4 * part))).collect();
        let surface = Surface { positions: &positions, triangles: &triangles, ..Surface::default() };
        let found = find(&surface, &repeats::Settings::default()).unwrap();
        let set = PointSet::of_repeats(&found.repeats, &Settings::default()).unwrap();
        let model = encode(&Points::from(positions.clone()), &Settings::default()).unwrap();
        assert_eq!((set.models().len(), set.places().len(), set.nodes().count()), (1, 3, 1));
        assert_eq!((set.placed(|_| 1), set.placed(Node::cell_count)), (3, 12));
        let node = &set.models()[0].nodes()[0];
        let bound = 0.5 * 3.0_f32.sqrt() * node.frame().cell + 1e-4;
        let decoded = set.places().iter().flat_map(|place| {
            let points = set.models()[place.model].nodes()[0].positions();
            points.into_iter().map(|at| place.apply(at)).collect::<Vec<_>>()
        });
        let decoded: Vec<Vec3> = decoded.collect();
        assert_eq!(decoded.len(), positions.len());
        for at in &positions {
            assert!(decoded.iter().any(|found| found.distance(*at) < bound), "{at}");
        }
        let [low, high] = set.bounds();
        assert!(positions.iter().all(|at| at.cmpge(low).all() && at.cmple(high).all()));

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wedges.vts");
        std::fs::write(&path, found.repeats.to_file()).unwrap();
        assert_eq!(PointSet::read(&path).unwrap(), set);
        std::fs::write(&path, &found.repeats.to_file()[..60]).unwrap();
        assert!(PointSet::read(&path).unwrap_err().to_string().contains("wedges.vts"));
        std::fs::write(&path, model.to_bytes()).unwrap();
        assert_eq!(PointSet::read(&path).unwrap(), PointSet::from(model));
    }
}
