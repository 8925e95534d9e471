//! Random damage to files, the same in every run with the same seed.

use epigraph_core::testing::Random;

/// Numbers and words at the ends of what there is, and beyond.
pub const EXTREMES: [&str; 30] = [
    "0",
    "1",
    "-1",
    "2",
    "255",
    "256",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "-2147483649",
    "0.5",
    "-0.0",
    "1e-46",
    "1e-10",
    "1e10",
    "1e20",
    "3e38",
    "1e39",
    "-1e39",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "",
    "..",
    "x/../x",
    "99999999999999999999999999",
    "\u{e9}",
];

/// Most bytes of a mutant.
const LONGEST: usize = 1 << 20;

pub fn choose<T: Copy>(random: &mut Random, among: &[T]) -> T {
    among[random.below(among.len() as u32) as usize]
}

/// The byte ranges of words, and of marks of one letter.
pub fn tokens(text: &str) -> Vec<(usize, usize)> {
    let mut tokens: Vec<(usize, usize)> = Vec::new();
    let mut in_word = false;
    for (at, c) in text.char_indices() {
        let is_word = c.is_alphanumeric() || c == '_' || c == '.';
        match tokens.last_mut() {
            Some(last) if is_word && in_word => last.1 = at + c.len_utf8(),
            _ if c.is_whitespace() => {}
            _ => tokens.push((at, at + c.len_utf8())),
        }
        in_word = is_word;
    }
    tokens
}

/// A file with some damage; `other` is another file of its kind, of which parts may come in.
pub fn mutant(file: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..1 + random.below(3) {
        bytes = match std::str::from_utf8(&bytes) {
            Ok(text) if random.below(8) > 0 => damaged_text(text, random),
            _ => damaged_bytes(bytes, other, random),
        };
        bytes.truncate(LONGEST);
    }
    bytes
}

fn damaged_text(text: &str, random: &mut Random) -> Vec<u8> {
    let tokens = tokens(text);
    if tokens.is_empty() {
        return choose(random, &EXTREMES).into();
    }
    let (a, b) = choose(random, &tokens);
    let with = |new: &str| format!("{}{new}{}", &text[..a], &text[b..]).into_bytes();
    let is_number = |&(a, b): &(usize, usize)| text[a..b].starts_with(|c: char| c.is_ascii_digit());
    match random.below(9) {
        0 => with(""),
        1 => with(choose(random, &EXTREMES)),
        2 | 3 => {
            let numbers: Vec<(usize, usize)> = tokens.iter().copied().filter(is_number).collect();
            if numbers.is_empty() {
                return with(choose(random, &EXTREMES));
            }
            let (a, b) = choose(random, &numbers);
            format!("{}{}{}", &text[..a], choose(random, &EXTREMES), &text[b..]).into_bytes()
        }
        4 | 5 => {
            let (c, d) = choose(random, &tokens);
            with(&text[c..d])
        }
        // A piece of the text, often a whole item, once more or many times.
        6 => {
            let end = tokens[random.below(tokens.len() as u32) as usize].1.max(b);
            let times = choose(random, &[1, 2, 200]);
            if (end - a) * times > LONGEST {
                return with("");
            }
            format!("{}{}{}", &text[..a], text[a..end].repeat(1 + times), &text[end..]).into_bytes()
        }
        7 => with(&choose(random, &["(", "[", "{", "\"", "<", "-"]).repeat(choose(random, &[1, 3, 5000]))),
        _ => {
            let end = tokens[random.below(tokens.len() as u32) as usize].1.max(b);
            format!("{}{}", &text[..a], &text[end..]).into_bytes()
        }
    }
}

fn damaged_bytes(mut bytes: Vec<u8>, other: &[u8], random: &mut Random) -> Vec<u8> {
    if bytes.is_empty() {
        return other.to_vec();
    }
    let mut at = |length: usize| random.below(length.max(1) as u32) as usize;
    let (from, to) = (at(bytes.len()), at(bytes.len()));
    let (from, to) = (from.min(to), from.max(to));
    // Headers are where promises are.
    let early = at(bytes.len().min(128));
    match random.below(8) {
        0 => bytes.truncate(from),
        1 => bytes[from] ^= 1 << random.below(8),
        2 => bytes[early] = choose(random, &[0, 1, 0x7f, 0x80, 0xff]),
        3 => {
            let word =
                choose(random, &[[0; 4], [0xff; 4], [0, 0, 0, 0x80], [0xff, 0xff, 0xff, 0x7f], [0, 0, 1, 0]]);
            bytes.iter_mut().skip(early).zip(word).for_each(|(byte, new)| *byte = new);
        }
        4 => drop(bytes.drain(from..to)),
        5 => {
            let part = bytes[from..to].to_vec();
            bytes.splice(to..to, part);
        }
        6 if !other.is_empty() => {
            let start = random.below(other.len() as u32) as usize;
            let part = other[start..(start + to - from).min(other.len())].to_vec();
            bytes.splice(from..to, part);
        }
        _ => bytes.iter_mut().skip(from).take(4).for_each(|byte| *byte = random.bits() as u8),
    }
    bytes
}
