//! The canvas in one frame of the window: the model, the engine's information about it, and all positions.

use std::{collections::HashMap, sync::Arc};

use egui::{Pos2, Rect, Vec2, vec2};
use epigraph_core::GraphFile;

use super::{
    arrange::{Link, arrange},
    facts::{Crossing, Facts},
    model::{Model, PinRef},
    route,
    shape::Shape,
};
use crate::engine::GraphInfo;

/// Distance of a transfer from its pin on the wire.
const TRANSFER: f32 = 54.0;

/// Approximate size of a transfer.
const CHIP: Vec2 = vec2(84.0, 22.0);

/// The canvas in one frame of the window, in points of the canvas.
pub struct Sight {
    /// Blocks and wires.
    pub model: Arc<Model>,
    /// The engine's information about each block.
    pub facts: Vec<Facts>,
    /// The shape of each block.
    pub shapes: Vec<Shape>,
    /// The rectangle of each block.
    pub rects: Vec<Rect>,
    /// The path of each wire.
    pub routes: Vec<Vec<Pos2>>,
    /// Transfers between the sides.
    pub crossings: Vec<Crossing>,
    /// The centre of each transfer.
    pub chips: Vec<Pos2>,
}

/// The running graph, if any, and milliseconds of its steps.
pub type Run<'a> = Option<(&'a GraphInfo, &'a [f32])>;

impl Sight {
    /// Blocks with their shapes, not yet placed.
    pub fn new(
        model: Arc<Model>,
        file: &GraphFile,
        run: Run,
        thumbnails: bool,
        measure: &dyn Fn(&str, f32) -> f32,
    ) -> Self {
        let facts: Vec<Facts> = match run {
            Some((graph, times)) => {
                model.blocks.iter().map(|block| Facts::new(block, &model, file, graph, times)).collect()
            }
            None => vec![Facts::default(); model.blocks.len()],
        };
        let shapes = model.blocks.iter().zip(&facts);
        let shapes = shapes.map(|(block, facts)| Shape::new(block, facts, thumbnails, measure)).collect();
        let crossings = run.map_or(Vec::new(), |(graph, times)| Crossing::all(&model, file, graph, times));
        Self { model, facts, shapes, rects: Vec::new(), routes: Vec::new(), crossings, chips: Vec::new() }
    }

    /// Automatic positions for all blocks in a pane of this size, regardless of the user's.
    pub fn arranged(&self, room: Vec2) -> HashMap<String, Pos2> {
        let sizes: Vec<Vec2> = self.shapes.iter().map(|shape| shape.size).collect();
        let height = |pin: PinRef| (pin.block, self.shapes[pin.block].pin(pin).y);
        let crosses = |index: usize| self.crossings.iter().any(|crossing| crossing.wire == index);
        let link = |(index, wire): (usize, &super::model::Wire)| Link {
            from: height(wire.from),
            to: height(wire.to),
            back: wire.history,
            room: if crosses(index) { TRANSFER } else { 0.0 },
        };
        let links: Vec<Link> = self.model.wires.iter().enumerate().map(link).collect();
        let addresses = self.model.blocks.iter().map(|block| block.address.clone());
        addresses.zip(arrange(&sizes, &links, room)).collect()
    }

    /// Places the blocks and routes the wires around them.
    pub fn place(&mut self, place: impl Fn(&str) -> Pos2) {
        let blocks = self.model.blocks.iter().zip(&self.shapes);
        self.rects =
            blocks.map(|(block, shape)| Rect::from_min_size(place(&block.address), shape.size)).collect();
        let mut pins: HashMap<PinRef, usize> = HashMap::new();
        let wires: Vec<(Pos2, Pos2, usize)> = self
            .model
            .wires
            .iter()
            .map(|wire| {
                let next = pins.len();
                let pin = *pins.entry(wire.from).or_insert(next);
                (self.pin(wire.from), self.pin(wire.to), pin)
            })
            .collect();
        self.routes = route::routes(&self.rects, &wires);
        let chip = |crossing: &Crossing| route::along(&self.routes[crossing.wire], TRANSFER);
        self.chips = self.crossings.iter().map(chip).collect();
    }

    /// The position of a pin.
    pub fn pin(&self, at: PinRef) -> Pos2 {
        self.rects[at.block].min + self.shapes[at.block].pin(at)
    }

    /// All pins.
    pub fn pins(&self) -> impl Iterator<Item = PinRef> + '_ {
        self.model.blocks.iter().enumerate().flat_map(|(block, of)| {
            let side =
                move |output: bool| (0..of.pins(output).len()).map(move |pin| PinRef { block, output, pin });
            side(false).chain(side(true))
        })
    }

    /// The area of the canvas that blocks, wires and the items on them cover.
    pub fn bounds(&self) -> Rect {
        let chips = self.chips.iter().map(|chip| Rect::from_center_size(*chip, CHIP));
        let points = self.routes.iter().flatten().map(|point| Rect::from_pos(*point));
        self.rects.iter().copied().chain(chips).chain(points).fold(Rect::NOTHING, Rect::union)
    }

    /// Milliseconds of the most expensive block.
    pub fn hottest(&self) -> f32 {
        self.facts.iter().filter_map(|facts| facts.ms).fold(0.0, f32::max)
    }
}
