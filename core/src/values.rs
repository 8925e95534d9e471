//! The numbers in the elements of a port, and whether they are what its rules allow.

use crate::{
    port::{Element, Format, Member, Scalar},
    rule::{Limit, Rule},
};

/// Whether a rule is about a lane of a member of an element; `field` is the port's field.
fn is_about(rule: &Rule, field: &str, member: &Member, lane: u32) -> bool {
    let named = rule.of.is_empty() || rule.of == field || rule.of == member.name;
    let fits = match rule.limit {
        Limit::Any => true,
        Limit::Floats(..) => member.scalar != Scalar::I32,
        _ => member.scalar != Scalar::F32,
    };
    named && fits && (rule.lanes[0]..rule.lanes[1]).contains(&lane)
}

/// How the bits of a number are read and compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reading {
    Float,
    Unsigned,
    Signed,
}

impl Reading {
    /// The number as one that is ordered like it: floats from negative NaN over zero to positive NaN.
    pub fn key(self, bits: u32) -> i64 {
        match self {
            Self::Float => {
                let bits = bits as i32;
                i64::from(bits ^ ((bits >> 31) & i32::MAX))
            }
            Self::Unsigned => i64::from(bits),
            Self::Signed => i64::from(bits as i32),
        }
    }
}

/// One limit on one number of an element.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Number {
    /// Its place in the element: in words of 32 bits; for texels the channel.
    pub word: usize,
    /// Its name in the element, such as `position.x`; empty for the only one.
    pub name: String,
    pub reading: Reading,
    /// The first bit and the number of bits that are compared.
    pub bits: [u32; 2],
    /// The least and greatest [`Reading::key`].
    pub keys: [i64; 2],
    pub none: Option<u32>,
    /// What is allowed, in words.
    pub allowed: String,
}

/// What is wrong with a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrong {
    /// It is NaN.
    Nan,
    /// It is infinite.
    Infinite,
    /// It is less than zero, where all numbers that are allowed are not.
    Negative,
    /// It is greater or less than what is allowed.
    OutOfRange,
    /// A check of the stage's own failed.
    Check,
}

impl Number {
    /// Whether a word is allowed.
    pub fn holds(&self, word: u32) -> bool {
        let key = self.reading.key(self.part(word));
        self.none == Some(word) || (self.keys[0]..=self.keys[1]).contains(&key)
    }

    /// The bits that are compared.
    fn part(&self, word: u32) -> u32 {
        let [from, count] = self.bits;
        if count == 32 { word } else { word >> from & ((1 << count) - 1) }
    }

    /// The value of a word in text.
    pub fn text(&self, word: u32) -> String {
        match self.reading {
            Reading::Float => format!("{:?}", f32::from_bits(word)),
            Reading::Signed => (word as i32).to_string(),
            Reading::Unsigned if self.bits[1] == 32 => word.to_string(),
            Reading::Unsigned => format!("{} in {word:#X}", self.part(word)),
        }
    }

    /// What is wrong with a word that is not allowed.
    pub fn wrong(&self, word: u32) -> Wrong {
        let float = f32::from_bits(word);
        let negative = match self.reading {
            Reading::Float if float.is_nan() => return Wrong::Nan,
            Reading::Float if float.is_infinite() => return Wrong::Infinite,
            Reading::Float => float < 0.0,
            Reading::Signed => (word as i32) < 0,
            Reading::Unsigned => false,
        };
        // The key of negative zero is below that of zero.
        if negative && self.keys[0] >= -1 { Wrong::Negative } else { Wrong::OutOfRange }
    }
}

/// The counts that rules refer to.
pub(crate) struct Counts<'a> {
    /// The number of elements of the nearest port with a meaning; `None` if there is none.
    pub of: &'a dyn Fn(&str) -> Option<usize>,
    /// Pixels of the frame.
    pub pixels: usize,
}

/// The limits on the numbers of an element of the field `field` of a port with these rules. None for elements that can
/// hold nothing wrong.
pub(crate) fn numbers(field: &str, element: &Element, rules: &[Rule], counts: &Counts) -> Vec<Number> {
    let texel;
    let (members, names): (&[Member], _) = match element {
        Element::Texel(Format::Rgba8Unorm) | Element::AnyFloatTexel => return Vec::new(),
        Element::Texel(format) => {
            let (scalar, lanes) = (format.scalar(), format.channels());
            texel = [Member { name: "".into(), scalar, lanes, offset: 0 }];
            (&texel, ["r", "g", "b", "a"])
        }
        Element::Item { members, .. } => (members, ["x", "y", "z", "w"]),
    };
    let mut numbers = Vec::new();
    for member in members {
        for lane in 0..member.lanes {
            let name = match (&*member.name, member.lanes) {
                (member, 1) => member.to_owned(),
                ("", _) => names[lane as usize].to_owned(),
                (member, _) => format!("{member}.{}", names[lane as usize]),
            };
            let word = (member.offset / 4 + lane) as usize;
            let mut about = rules.iter().filter(|rule| is_about(rule, field, member, lane)).peekable();
            let finite = Rule::floats(f32::MIN, f32::MAX);
            let unruled = about.peek().is_none() && member.scalar == Scalar::F32;
            for rule in about.chain(unruled.then_some(&finite)) {
                numbers.extend(number(rule, member.scalar, counts).map(|number| Number {
                    word,
                    name: name.clone(),
                    ..number
                }));
            }
        }
    }
    numbers
}

/// A rule for numbers of one scalar type, at no place yet. `None` if it allows everything.
fn number(rule: &Rule, scalar: Scalar, counts: &Counts) -> Option<Number> {
    let whole = if scalar == Scalar::I32 { Reading::Signed } else { Reading::Unsigned };
    let below = |count: usize, what: String| Some((whole, [0, 32], [0, count as i64 - 1], what));
    let (reading, bits, keys, mut allowed) = match rule.limit {
        Limit::Any => return None,
        Limit::Floats(low, high) => {
            // Negative zero is as good as zero.
            let low_bits = if low == 0.0 { (-0.0f32).to_bits() } else { low.to_bits() };
            let keys = [low_bits, high.to_bits()].map(|bits| Reading::Float.key(bits));
            let allowed = match (low, high) {
                (f32::MIN, f32::MAX) => "finite numbers".into(),
                (low, f32::MAX) => format!("finite numbers from {low}"),
                (low, high) => format!("{low} to {high}"),
            };
            (Reading::Float, [0, 32], keys, allowed)
        }
        Limit::Wholes(low, high) => {
            let (least, most) = match whole {
                Reading::Signed => (i64::from(i32::MIN), i64::from(i32::MAX)),
                _ => (0, i64::from(u32::MAX)),
            };
            (whole, [0, 32], [low.clamp(least, most), high.clamp(least, most)], format!("{low} to {high}"))
        }
        Limit::Bits(from, count, most) => {
            let allowed = format!("0 to {most} in bits {from} to {}", from + count - 1);
            (Reading::Unsigned, [from, count], [0, i64::from(most)], allowed)
        }
        Limit::IndexOf(meaning) => {
            let count = (counts.of)(meaning)?;
            below(count, format!("the indices of {count} {meaning}"))?
        }
        Limit::CountOf(meaning) => {
            let count = (counts.of)(meaning)?;
            below(count + 1, format!("at most the number of {meaning}, {count}"))?
        }
        Limit::PixelIndex => below(counts.pixels, format!("the indices of {} pixels", counts.pixels))?,
    };
    if let Some(bits) = rule.none {
        let none = match reading {
            Reading::Float => format!("{:?}", f32::from_bits(bits)),
            Reading::Signed => (bits as i32).to_string(),
            Reading::Unsigned => format!("{bits:#X}"),
        };
        allowed += &format!(", and {none}");
    }
    Some(Number { word: 0, name: String::new(), reading, bits, keys, none: rule.none, allowed })
}

/// The number of words of an element: of its size, of texels its channels.
pub(crate) fn words(element: &Element) -> usize {
    match element {
        Element::Texel(format) => format.channels() as usize,
        _ => element.bytes() as usize / 4,
    }
}

/// A word of an element, of a texel a channel as shaders read it.
pub(crate) fn word(element: &Element, bytes: &[u8], word: usize) -> u32 {
    match element {
        Element::Texel(Format::Rgba16Float) => {
            let half = half::f16::from_le_bytes([bytes[2 * word], bytes[2 * word + 1]]);
            half.to_f32().to_bits()
        }
        Element::Texel(Format::Rgba8Unorm) => (f32::from(bytes[word]) / 255.0).to_bits(),
        _ => bytemuck::pod_read_unaligned(&bytes[4 * word..4 * word + 4]),
    }
}

/// All numbers of an element in text.
pub(crate) fn text(element: &Element, words: &[u32]) -> String {
    let number = |scalar: Scalar, word: usize| match (scalar, words[word]) {
        (Scalar::F32, bits) => format!("{:?}", f32::from_bits(bits)),
        (Scalar::U32, bits) => bits.to_string(),
        (Scalar::I32, bits) => (bits as i32).to_string(),
    };
    let texts: Vec<String> = match element {
        Element::Item { members, .. } => {
            let of_member = |member: &Member| {
                let (scalar, first) = (member.scalar, member.offset / 4);
                (first..first + member.lanes)
                    .map(move |word| number(scalar, word as usize))
                    .collect::<Vec<_>>()
            };
            members.iter().flat_map(of_member).collect()
        }
        texel => {
            let scalar = texel.scalars()[0];
            (0..words.len()).map(|word| number(scalar, word)).collect()
        }
    };
    texts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{PortElement, texel};

    fn numbers_of(element: Element, rules: &[Rule]) -> Vec<Number> {
        let of = |meaning: &str| (meaning == "points").then_some(10);
        numbers("", &element, rules, &Counts { of: &of, pixels: 12 })
    }

    #[test]
    fn floats_are_finite_unless_a_rule_says_more_or_less() {
        let only = |rules: &[Rule]| numbers_of(f32::element(), rules);
        let plain = &only(&[])[0];
        for good in [0.0, -0.0, -3.0, f32::MAX, f32::MIN, 1e-40] {
            assert!(plain.holds(good.to_bits()), "{good}");
        }
        let bad = [(f32::NAN, Wrong::Nan), (-f32::NAN, Wrong::Nan), (f32::INFINITY, Wrong::Infinite)];
        for (bad, wrong) in bad.into_iter().chain([(f32::NEG_INFINITY, Wrong::Infinite)]) {
            assert!(!plain.holds(bad.to_bits()) && plain.wrong(bad.to_bits()) == wrong, "{bad}");
        }
        let share = &only(&[Rule::floats(0.0, 1.0)])[0];
        for (value, holds) in [(0.0, true), (-0.0, true), (1.0, true), (-1e-40, false), (1.0000001, false)] {
            assert_eq!(share.holds(f32::to_bits(value)), holds, "{value}");
        }
        assert_eq!(share.wrong((-1e-40f32).to_bits()), Wrong::Negative);
        assert_eq!(share.wrong(2f32.to_bits()), Wrong::OutOfRange);
        let signed = &only(&[Rule::floats(-1.0, 1.0)])[0];
        assert_eq!(signed.wrong((-2f32).to_bits()), Wrong::OutOfRange);
        // Zero is not negative, even where it is too small.
        assert_eq!(only(&[Rule::floats(0.5, 1.0)])[0].wrong(0f32.to_bits()), Wrong::OutOfRange);
        let open = &only(&[Rule::floats(0.0, f32::MAX).or(f32::INFINITY.to_bits())])[0];
        assert!(open.holds(f32::INFINITY.to_bits()) && !open.holds(f32::NAN.to_bits()));
        assert_eq!(open.allowed, "finite numbers from 0, and inf");
        assert_eq!(only(&[Rule::any()]), []);
    }

    #[test]
    fn whole_numbers_may_be_anything_unless_a_rule_says_less() {
        assert_eq!(numbers_of(u32::element(), &[]), []);
        let only = |element, rule| numbers_of(element, &[rule]).remove(0);
        let id = only(u32::element(), Rule::index_of("points").or(u32::MAX));
        assert_eq!([0, 9, 10, u32::MAX].map(|bits| id.holds(bits)), [true, true, false, true]);
        // All bits count, the first, too.
        assert!(!id.holds(1 << 31 | 5));
        assert_eq!(id.text(10), "10");
        assert_eq!(id.allowed, "the indices of 10 points, and 0xFFFFFFFF");
        let count = only(u32::element(), Rule::count_of("points"));
        assert_eq!([10, 11].map(|value| count.holds(value)), [true, false]);
        let pixel = only(u32::element(), Rule::pixel_index());
        assert_eq!([11, 12].map(|value| pixel.holds(value)), [true, false]);
        let kind = only(u32::element(), Rule::bits(2, 2, 1));
        assert_eq!([0, 0b0100, 0b1000, 0b10011].map(|word| kind.holds(word)), [true, true, false, true]);
        assert_eq!(kind.text(0b1000), "2 in 0x8");
        let signed = only(i32::element(), Rule::wholes(0, 5));
        assert!(!signed.holds(-1i32 as u32) && signed.wrong(-1i32 as u32) == Wrong::Negative);
        assert_eq!(only(i32::element(), Rule::wholes(1, 5)).wrong(0), Wrong::OutOfRange);
        assert_eq!(numbers_of(u32::element(), &[Rule::index_of("nowhere")]), []);
        let bits = only(u32::element(), Rule::floats(0.0, f32::MAX));
        assert!(bits.holds(1f32.to_bits()) && bits.wrong(f32::NAN.to_bits()) == Wrong::Nan);
    }

    /// A struct of a position and a kind.
    fn mixed() -> Element {
        let member =
            |name: &'static str, scalar, lanes, offset| Member { name: name.into(), scalar, lanes, offset };
        let members = vec![member("position", Scalar::F32, 3, 0), member("kind", Scalar::U32, 1, 12)];
        Element::Item { name: "Mixed".into(), stride: 16, members: members.into() }
    }

    #[test]
    fn rules_are_about_members_fields_and_lanes() {
        let names = |element: Element, field: &str, rules: &[Rule]| -> Vec<(String, usize)> {
            let counts = Counts { of: &|_| None, pixels: 1 };
            let numbers = numbers(field, &element, rules, &counts);
            numbers.into_iter().map(|number| (number.name, number.word)).collect()
        };
        let of =
            |named: &[(&str, usize)]| named.iter().map(|(name, word)| ((*name).to_owned(), *word)).collect();
        let mixed = mixed();
        let all: Vec<_> = of(&[("position.x", 0), ("position.y", 1), ("position.z", 2), ("kind", 3)]);
        assert_eq!(names(mixed.clone(), "", &[]), all[..3]);
        assert_eq!(names(mixed.clone(), "", &[Rule::wholes(0, 2).of("kind")]), all);
        assert_eq!(names(mixed, "", &[Rule::any().of("position")]), []);
        let color: Vec<_> = of(&[("r", 0), ("g", 1), ("b", 2), ("a", 3)]);
        assert_eq!(names(texel::Rgba16Float::element(), "", &[]), color);
        assert_eq!(names(texel::Rgba32Float::element(), "", &[Rule::any().lanes(3, 4)]), color[..3]);
        assert_eq!(names(texel::Rgba8Unorm::element(), "", &[]), []);
        assert_eq!(names(u32::element(), "meta", &[Rule::wholes(0, 2).of("meta")]), of(&[("", 0)]));
        assert_eq!(names(u32::element(), "other", &[Rule::wholes(0, 2).of("meta")]), []);
    }

    #[test]
    fn an_elements_text_has_the_numbers_of_all_members_in_order() {
        let words = [1.5_f32.to_bits(), f32::NAN.to_bits(), (-2.0_f32).to_bits(), u32::MAX];
        assert_eq!(text(&mixed(), &words), "1.5, NaN, -2.0, 4294967295");
        assert_eq!(text(&f32::element(), &words[..1]), "1.5");
        assert_eq!(text(&i32::element(), &words[3..]), "-1");
        // A hole between members has no number.
        let member =
            |name: &'static str, scalar, offset| Member { name: name.into(), scalar, lanes: 1, offset };
        let members = vec![member("first", Scalar::U32, 0), member("last", Scalar::I32, 12)];
        let holed = Element::Item { name: "Holed".into(), stride: 16, members: members.into() };
        assert_eq!(text(&holed, &[7, 8, 9, -3i32 as u32]), "7, -3");
    }

    #[test]
    fn bytes_of_texels_are_read_as_shares_of_255() {
        let element = texel::Rgba8Unorm::element();
        let words: Vec<u32> = (0..words(&element)).map(|at| word(&element, &[0, 51, 102, 255], at)).collect();
        assert_eq!(text(&element, &words), "0.0, 0.2, 0.4, 1.0");
    }

    #[test]
    fn halves_are_read_as_floats() {
        let halves = [1.5f32, f32::NAN, -2.0, f32::INFINITY].map(half::f16::from_f32);
        let bytes: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        let element = texel::Rgba16Float::element();
        let words: Vec<u32> = (0..words(&element)).map(|at| word(&element, &bytes, at)).collect();
        assert_eq!(text(&element, &words), "1.5, NaN, -2.0, inf");
    }
}
