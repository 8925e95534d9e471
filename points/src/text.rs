//! Points in text: XYZ, and the vertices of OBJ.

use std::io::{BufRead, Read};

use glam::DVec3;

use crate::cloud::Cloud;

/// The longest line, in bytes: a file without line ends is no text.
const LONGEST_LINE: usize = 1 << 16;

/// Reads lines of three numbers, x, y and z, or of six, of which the last are red, green and blue, 0 to 255. Numbers are
/// separated by spaces, commas or semicolons. Empty lines and those that begin with `#` or `//` are skipped.
pub(crate) fn read_xyz(text: impl BufRead) -> Result<Cloud, String> {
    let mut cloud = Cloud::default();
    for_each_line(text, |line| {
        let words = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty());
        if line.is_empty() || line.starts_with('#') || line.starts_with("//") {
            return Ok(());
        }
        let numbers = words.map(number).collect::<Result<Vec<_>, _>>()?;
        let (position, color) = match numbers[..] {
            [x, y, z] => (DVec3::new(x, y, z), None),
            [x, y, z, red, green, blue] => (DVec3::new(x, y, z), Some([red, green, blue])),
            _ => {
                return Err(format!(
                    "it has {} numbers, but points are x y z or x y z red green blue",
                    numbers.len()
                ));
            }
        };
        let byte = |value: f64| Some(value as u8).filter(|&byte| f64::from(byte) == value);
        let color = color.map(|color| {
            let [Some(red), Some(green), Some(blue)] = color.map(byte) else {
                return Err(format!("the colour {color:?} is not of whole numbers from 0 to 255"));
            };
            Ok([red, green, blue, 255])
        });
        add(&mut cloud, position, color.transpose()?)
    })?;
    Ok(cloud)
}

/// Whether the text of an OBJ file has faces.
pub(crate) fn has_faces(bytes: &[u8]) -> bool {
    bytes.split(|&byte| byte == b'\n').any(|line| line.trim_ascii_start().starts_with(b"f "))
}

/// Reads the lines `v x y z` or `v x y z red green blue`, with colours from 0 to 1, of an OBJ file without faces.
pub(crate) fn read_obj(text: impl BufRead) -> Result<Cloud, String> {
    let mut cloud = Cloud::default();
    for_each_line(text, |line| {
        let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
        if words.next() != Some("v") {
            return Ok(());
        }
        let numbers = words.map(number).collect::<Result<Vec<_>, _>>()?;
        let byte = |value: f64| (255.0 * value).round() as u8;
        // A weight may follow the position.
        match numbers[..] {
            [x, y, z] | [x, y, z, _] => add(&mut cloud, DVec3::new(x, y, z), None),
            [x, y, z, red, green, blue] => {
                let color = [byte(red), byte(green), byte(blue), 255];
                add(&mut cloud, DVec3::new(x, y, z), Some(color))
            }
            _ => Err(format!("a vertex has {} numbers, not 3, 4 or 6", numbers.len())),
        }
    })?;
    Ok(cloud)
}

fn add(cloud: &mut Cloud, position: DVec3, color: Option<[u8; 4]>) -> Result<(), String> {
    let is_first = cloud.positions.is_empty();
    if !is_first && color.is_none() != cloud.colors.is_empty() {
        return Err("some points have a colour, and others have none".into());
    }
    cloud.push(position)?;
    cloud.colors.extend(color);
    Ok(())
}

fn number(word: &str) -> Result<f64, String> {
    word.parse().map_err(|_| format!("`{}` is no number", word.chars().take(40).collect::<String>()))
}

/// Calls a function with each line, without the blanks around it; the number of the line precedes its errors.
fn for_each_line(
    mut text: impl BufRead,
    mut read: impl FnMut(&str) -> Result<(), String>,
) -> Result<(), String> {
    let mut bytes = Vec::new();
    for number in 1.. {
        bytes.clear();
        let fail = |cause: String| format!("line {number}: {cause}");
        let taken = text.by_ref().take(LONGEST_LINE as u64).read_until(b'\n', &mut bytes);
        if taken.map_err(|error| fail(error.to_string()))? == 0 {
            break;
        }
        if bytes.len() == LONGEST_LINE {
            return Err(fail(format!("it has more than {LONGEST_LINE} bytes")));
        }
        let line =
            str::from_utf8(epigraph_files::without_mark(&bytes)).map_err(|_| fail("it is no text".into()))?;
        read(line.trim()).map_err(fail)?;
    }
    Ok(())
}
