//! The canvas's edits of the document. Each is one step of undo, including the positions of boxes.

use egui::{Pos2, Vec2, vec2};
use epigraph_core::Source;

use super::{
    CanvasPane, Renaming,
    model::{Block, PinRef, Role},
    search::Search,
    sight::Sight,
};
use crate::{
    document::{
        Places, Tag,
        nodes::{self, End},
        places,
    },
    session::Session,
};

/// Offset of a copy from its original.
const ASIDE: Vec2 = vec2(36.0, 36.0);

/// Stores the positions of all blocks, so that none moves when another is moved or added.
fn settle(sight: &Sight, places: &mut Places) {
    for (block, rect) in sight.model.blocks.iter().zip(&sight.rects) {
        places.entry(block.address.clone()).or_insert(rect.min.into());
    }
}

impl CanvasPane {
    /// Addresses of the selected nodes, without the blocks of inputs and outputs.
    fn chosen(&self, sight: &Sight) -> Vec<String> {
        let blocks = sight.model.blocks.iter().filter(|block| block.is_node());
        blocks
            .map(|block| &block.address)
            .filter(|address| self.selection.contains(*address))
            .cloned()
            .collect()
    }

    /// Selects blocks. The other panes show the last one.
    pub(super) fn select(&mut self, session: &mut Session, addresses: Vec<String>) {
        let last = addresses.last().filter(|address| !nodes::split(address).1.starts_with('.'));
        if last.is_some() || addresses.is_empty() {
            session.selected = last.cloned();
            self.seen.clone_from(&session.selected);
        }
        self.wire = None;
        self.selection = addresses.into_iter().collect();
    }

    /// Removes the selected wire, or the selected nodes with their wires.
    pub(super) fn delete(&mut self, session: &mut Session, sight: &Sight) {
        if let Some((address, port)) = self.wire.take() {
            self.disconnect(session, sight, &address, &port);
            return;
        }
        let chosen = self.chosen(sight);
        if chosen.is_empty() {
            return;
        }
        if session.edit_placed(|file, _| nodes::remove(file, &chosen)) {
            self.select(session, Vec::new());
        }
    }

    /// Copies the selected nodes and selects the copies.
    pub(super) fn duplicate(&mut self, session: &mut Session, sight: &Sight) {
        let chosen = self.chosen(sight);
        let mut copies = Vec::new();
        session.edit_placed(|file, places| {
            copies = nodes::duplicate(file, &chosen)?;
            settle(sight, places);
            for (original, copy) in chosen.iter().zip(&copies) {
                if let Some(place) = places.get(original).copied() {
                    places.insert(copy.clone(), (Pos2::from(place) + ASIDE).into());
                }
            }
            Ok(())
        });
        if !copies.is_empty() {
            self.select(session, copies);
        }
    }

    /// Bypasses the selected stages; if all of them are bypassed already, lets them run again.
    pub(super) fn bypass(&mut self, session: &mut Session, sight: &Sight) {
        let stages = sight.model.blocks.iter().filter(|block| block.role == Role::Stage);
        let stages: Vec<&Block> = stages.filter(|block| self.selection.contains(&block.address)).collect();
        let bypass = !stages.iter().all(|block| block.bypass);
        let addresses: Vec<String> = stages.iter().map(|block| block.address.clone()).collect();
        if !addresses.is_empty() {
            session.edit(Tag::Once, |file| nodes::bypass(file, &addresses, bypass));
        } else if !self.selection.is_empty() {
            session.tell("a part cannot be bypassed; open it and bypass its nodes");
        }
    }

    /// Opens the text field for a new name.
    pub(super) fn start_renaming(&mut self, block: &Block) {
        if block.is_node() {
            self.renaming =
                Some(Renaming { address: block.address.clone(), text: block.name.clone(), opened: false });
        }
    }

    /// Renames a node, with all references to it.
    pub(super) fn rename(&mut self, session: &mut Session, sight: &Sight, address: &str, name: &str) {
        let unchanged = session.document.whole().is_none_or(|file| nodes::place(file, address).1 == name);
        if unchanged {
            return;
        }
        let mut renamed = String::new();
        let done = session.edit_placed(|file, places| {
            renamed = nodes::rename(file, address, name)?;
            settle(sight, places);
            places::rename(places, address, &renamed);
            Ok(())
        });
        if done {
            self.select(session, vec![renamed]);
        }
    }

    /// Stores the current positions of the selected blocks, moved by `by`.
    pub(super) fn shift(&mut self, session: &mut Session, sight: &Sight, by: Vec2, tag: Tag) {
        session.document.place(tag, |places| {
            settle(sight, places);
            for (block, rect) in sight.model.blocks.iter().zip(&sight.rects) {
                if self.selection.contains(&block.address) {
                    places.insert(block.address.clone(), (rect.min + by).round().into());
                }
            }
        });
    }

    /// Moves all blocks to their positions in the automatic arrangement.
    pub(super) fn arrange(&mut self, session: &mut Session, sight: &Sight) {
        let arranged = sight.arranged(self.view.pane.size());
        session.document.place(Tag::Once, |places| {
            places.extend(arranged.into_iter().map(|(address, place)| (address, place.into())));
        });
        self.wants_fit = true;
    }

    /// Opens the search for a new node at a position on screen.
    pub(super) fn search_at(&mut self, corner: Pos2) {
        self.search = Some(Search::new(self.view.back(corner), corner, None));
    }

    /// Adds a node, connected to the wire that was dropped.
    pub(super) fn add(
        &mut self,
        session: &mut Session,
        sight: &Sight,
        search: &Search,
        kind: &str,
        port: Option<&str>,
    ) {
        let mut added = String::new();
        let done = session.edit_placed(|file, places| {
            added = nodes::add(file, &self.part, kind)?;
            let name = nodes::split(&added).1.to_owned();
            if let (Some((address, output, pin)), Some(port)) = (&search.wire, port)
                && let Some(at) = sight.model.pin(address, *output, &pin.name)
            {
                if *output {
                    let source = sight.model.source(at);
                    nodes::connect(file, &self.part, End::Input(&name, port), Some(&source))?;
                } else {
                    let source = Source { node: name, port: port.to_owned() };
                    let end = end(&sight.model.blocks[at.block], &pin.name);
                    nodes::connect(file, &self.part, end, Some(&source))?;
                }
            }
            settle(sight, places);
            places.insert(added.clone(), search.at.round().into());
            Ok(())
        });
        if done {
            self.select(session, vec![added]);
        }
    }

    /// Connects two pins, or shows why that is impossible.
    pub(super) fn connect(&mut self, session: &mut Session, sight: &Sight, a: PinRef, b: PinRef) {
        if let Some(why) = sight.model.refusal(a, b) {
            session.tell(why);
            return;
        }
        let (from, to) = if a.output { (a, b) } else { (b, a) };
        let source = sight.model.source(from);
        let block = &sight.model.blocks[to.block];
        let port = sight.model.at(to).name.clone();
        session.edit(Tag::Once, |file| {
            nodes::connect(file, &sight.model.part, end(block, &port), Some(&source))
        });
    }

    /// Removes the wire from an input.
    pub(super) fn disconnect(&mut self, session: &mut Session, sight: &Sight, address: &str, port: &str) {
        let Some(block) = sight.model.block(address).map(|index| &sight.model.blocks[index]) else { return };
        session.edit(Tag::Once, |file| nodes::connect(file, &sight.model.part, end(block, port), None));
    }

    /// Moves the end of a wire from one input to another, in one step.
    pub(super) fn reconnect(&mut self, session: &mut Session, sight: &Sight, old: (&str, &str), to: PinRef) {
        let (Some(old_pin), block) = (sight.model.pin(old.0, false, old.1), &sight.model.blocks[to.block])
        else {
            return;
        };
        let Some(wire) = sight.model.wire_to(old_pin) else { return };
        if let Some(why) = sight.model.refusal(wire.from, to) {
            session.tell(why);
            return;
        }
        let source = sight.model.source(wire.from);
        let port = sight.model.at(to).name.clone();
        session.edit(Tag::Once, |file| {
            let part = &sight.model.part;
            nodes::connect(file, part, end(&sight.model.blocks[old_pin.block], old.1), None)?;
            nodes::connect(file, part, end(block, &port), Some(&source))
        });
    }
}

/// The end of a wire at a pin of a block.
fn end<'a>(block: &'a Block, port: &'a str) -> End<'a> {
    match block.role {
        Role::Outputs => End::Output(port),
        _ => End::Input(&block.name, port),
    }
}
