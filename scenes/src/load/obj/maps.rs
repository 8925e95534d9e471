//! The maps of MTL files.

use std::collections::HashMap;
use std::sync::Arc;

use epigraph_files::MOST_DATA;
use glam::{Affine2, Vec2};

use super::{before_comment, number, shortened};
use crate::load::images;
use crate::{Map, NoteKind, Report, Texture, Wrap};

/// A map as a file has it: a picture, and how it lies on the surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picture {
    /// Its name, from the folder of the material file.
    pub file: String,
    /// The folder of the material file, from that of the mesh; may be empty.
    pub folder: String,
    /// What texture coordinates are multiplied by, and then moved by.
    scale: Vec2,
    offset: Vec2,
    clamps: bool,
    /// The channel that a map of one number reads.
    channel: Option<Channel>,
    /// The factor on the slopes of bumps.
    pub bumps: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Channel {
    Of(usize),
    /// The mean of red, green and blue, which of a grey picture are the same.
    Luminance,
}

impl Picture {
    /// Reads the options of a map and the name that follows them, which may have blanks in it. What they ask for in vain is
    /// noted for the material called `name`.
    pub fn parse(text: &str, folder: &str, name: &str, report: &mut Report) -> Option<Self> {
        let mut picture = Self {
            file: String::new(),
            folder: folder.to_owned(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            clamps: false,
            channel: None,
            bumps: 1.0,
        };
        let mut rest = text.trim();
        while rest.starts_with('-') {
            let whole = rest;
            let option = take_word(&mut rest);
            let lower = option.to_ascii_lowercase();
            match lower.as_str() {
                "-o" => picture.offset = pair(&mut rest, 0.0),
                "-s" => picture.scale = pair(&mut rest, 1.0),
                "-clamp" => {
                    picture.clamps = take_word(&mut rest).eq_ignore_ascii_case("on");
                    if picture.clamps {
                        let what = "`-clamp on`: beyond a map is the colour of its edge, not of the material";
                        report.add(NoteKind::Approximated, what, name);
                    }
                }
                "-bm" => {
                    let bumps = number(take_word(&mut rest)) as f32;
                    picture.bumps = if bumps.is_finite() { bumps } else { 1.0 };
                }
                "-imfchan" => {
                    picture.channel = match take_word(&mut rest).to_ascii_lowercase().as_str() {
                        "r" => Some(Channel::Of(0)),
                        "g" => Some(Channel::Of(1)),
                        "b" => Some(Channel::Of(2)),
                        "m" => Some(Channel::Of(3)),
                        "l" => Some(Channel::Luminance),
                        _ => None,
                    }
                }
                // These say how to filter, which a tracer need not know.
                "-blendu" | "-blendv" | "-cc" | "-texres" | "-type" => {
                    take_word(&mut rest);
                }
                "-boost" => note_unless(take_numbers(&mut rest, 1) == [0.0], &lower, name, report),
                "-t" => {
                    let is_still = take_numbers(&mut rest, 3).iter().all(|number| *number == 0.0);
                    note_unless(is_still, &lower, name, report);
                }
                "-mm" => note_unless(take_numbers(&mut rest, 2) == [0.0, 1.0], &lower, name, report),
                // A name may begin with a minus sign.
                _ => {
                    rest = whole;
                    break;
                }
            }
        }
        rest.trim().clone_into(&mut picture.file);
        if picture.file.is_empty() {
            report.add(NoteKind::LeftOut, "a map without the name of a file", name);
            return None;
        }
        Some(picture)
    }

    /// The map of one of the model's textures.
    pub fn map(&self, texture: usize) -> Map {
        // From v upwards to v downwards, and back.
        let down = 1.0 - self.scale.y - self.offset.y;
        let transform =
            Affine2::from_scale_angle_translation(self.scale, 0.0, Vec2::new(self.offset.x, down));
        let wrap = if self.clamps { Wrap::Clamp } else { Wrap::Repeat };
        Map { transform, wrap: [wrap; 2], ..Map::new(texture) }
    }

    /// The map of one number, which is in the picture's channel of opacity if that is what it is for and it has one.
    pub fn map_of_number(&self, texture: usize, is_opacity: bool, textures: &[Arc<Texture>]) -> Map {
        let channel = match self.channel {
            Some(Channel::Of(channel)) => channel,
            None if is_opacity && !textures[texture].is_opaque() => 3,
            _ => 0,
        };
        self.map(texture).of_channel(channel)
    }
}

fn note_unless(is_default: bool, option: &str, name: &str, report: &mut Report) {
    if !is_default {
        report.add(NoteKind::LeftOut, format!("the option `{option}` of a map"), name);
    }
}

/// The first word, and what follows it.
fn next_word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
    (word, rest.trim_ascii_start())
}

fn take_word<'a>(rest: &mut &'a str) -> &'a str {
    let word;
    (word, *rest) = next_word(rest);
    word
}

/// Takes up to `most` words that are numbers.
fn take_numbers(rest: &mut &str, most: usize) -> Vec<f32> {
    let mut numbers = Vec::new();
    while numbers.len() < most {
        let (word, after) = next_word(rest);
        let number = number(word) as f32;
        if !number.is_finite() {
            break;
        }
        numbers.push(number);
        *rest = after;
    }
    numbers
}

/// One to three numbers, of which the third is of no use for a picture.
fn pair(rest: &mut &str, default: f32) -> Vec2 {
    let numbers = take_numbers(rest, 3);
    let at = |index: usize| numbers.get(index).copied().unwrap_or(default);
    Vec2::new(at(0), at(1))
}

/// The textures of a model's pictures.
#[derive(Default)]
pub(super) struct Textures {
    pub all: Vec<Arc<Texture>>,
    /// The index of each picture that could be read, by its name.
    by_name: HashMap<String, Option<usize>>,
}

impl Textures {
    /// Reads the files of all pictures, each once, and decodes them in parallel. What is missing is noted.
    pub fn load<'a>(
        pictures: impl Iterator<Item = &'a Picture>,
        beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
        report: &mut Report,
    ) -> Self {
        let mut textures = Self::default();
        let mut files = Vec::new();
        for picture in pictures {
            let key = picture.key();
            if textures.by_name.insert(key.clone(), None).is_some() {
                continue;
            }
            let names = [key.as_str(), picture.file.as_str()];
            let mut names = names.into_iter().flat_map(|name| [name, before_comment(name)]);
            let bytes = names.find_map(|name| beside(name, MOST_DATA).ok());
            match bytes {
                Some(bytes) => files.push((key.clone(), bytes)),
                None => report.add(NoteKind::LeftOut, "a texture that is missing", &shortened(&picture.file)),
            }
        }
        for (result, (key, _)) in images::decode(&files).into_iter().zip(&files) {
            match result {
                Ok(texture) => {
                    textures.by_name.insert(key.clone(), Some(textures.all.len()));
                    textures.all.push(texture);
                }
                Err(message) => {
                    report.add(NoteKind::LeftOut, format!("a texture, as {message}"), &shortened(key));
                }
            }
        }
        textures
    }

    /// The index of a picture's texture.
    pub fn index(&self, picture: &Picture) -> Option<usize> {
        *self.by_name.get(&picture.key())?
    }
}

impl Picture {
    /// Its name from the folder of the mesh.
    fn key(&self) -> String {
        format!("{}{}", self.folder, self.file)
    }
}
