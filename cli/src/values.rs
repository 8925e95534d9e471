//! Parsers of flag values.

use std::{fmt, path::PathBuf, str::FromStr};

use clap::{
    ValueEnum,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use epigraph::{Backend, Pace};
use epigraph_core::{MAX_SIDE, Source};
use epigraph_streams::{Codec, repeats::Tolerance};

/// Width and height in pixels, written `WxH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size(pub [u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected WIDTHxHEIGHT in pixels, such as 512x512, each 1 to {MAX_SIDE}");
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
        let side =
            |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side)).ok_or_else(wrong);
        Ok(Self([side(width)?, side(height)?]))
    }
}

/// A pixel, written `X,Y`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place(pub [u32; 2]);

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once(',').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
        parts
            .map(Self)
            .ok_or_else(|| "expected a pixel's column and row from the top left, such as 230,110".into())
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self([x, y]) = self;
        write!(f, "{x},{y}")
    }
}

/// A part of a picture, written `X,Y,WxH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// The pixel at its top left.
    pub at: [u32; 2],
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.rsplit_once(',').and_then(|(at, size)| {
            let (Place(at), Size(size)) = (at.parse().ok()?, size.parse().ok()?);
            Some(Self { at, size })
        });
        parts.ok_or_else(|| {
            "expected column and row of the top left, then the size, such as 120,80,48x32".into()
        })
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at: [x, y], size: [width, height] } = self;
        write!(f, "{x},{y},{width}x{height}")
    }
}

/// A port and the file for its contents, written `node.port=FILE`.
#[derive(Clone, Debug, PartialEq)]
pub struct Save {
    /// The port.
    pub source: Source,
    /// Ends in `.png`, `.exr` or `.csv`.
    pub file: PathBuf,
}

impl FromStr for Save {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').filter(|(_, file)| !file.is_empty());
        let save =
            parts.and_then(|(port, file)| Some(Self { source: port.parse().ok()?, file: file.into() }));
        save.ok_or_else(|| "expected node.port=FILE, such as project.depth=depth.exr".into())
    }
}

/// A parser for a list of choices, such as [`Backend::ALL`], that shows each name with its meaning in the help.
fn choice<T: Clone + Send + Sync + 'static>(
    all: &'static [(T, &'static str, &'static str)],
) -> impl TypedValueParser<Value = T> {
    let names = all.iter().map(|(_, name, doc)| PossibleValue::new(*name).help(*doc));
    PossibleValuesParser::new(names).map(|name: String| {
        let found = all.iter().find(|(_, known, _)| *known == name);
        found.expect("the parser accepts only known names").0.clone()
    })
}

/// The values of `--backend`.
pub fn backend() -> impl TypedValueParser<Value = Backend> {
    choice(&Backend::ALL)
}

/// The values of `--pace`.
pub fn pace() -> impl TypedValueParser<Value = Pace> {
    choice(&Pace::ALL)
}

/// How `encode` stores what it reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Points, as a tree.
    Points(Codec),
    /// A mesh, as shapes and instances.
    Repeats,
}

impl Encoding {
    const ALL: [(Self, &str, &str); 5] = {
        let [a, b, c, d] = Codec::ALL;
        [
            (Self::Points(a.0), a.1, a.2),
            (Self::Points(b.0), b.1, b.2),
            (Self::Points(c.0), c.1, c.2),
            (Self::Points(d.0), d.1, d.2),
            (
                Self::Repeats,
                "repeats",
                "the parts of a mesh: those that are alike once, and where each of them is",
            ),
        ]
    };
}

/// The values of `--codec`.
pub fn codec() -> impl TypedValueParser<Value = Encoding> {
    choice(&Encoding::ALL)
}

/// How far a vertex may be from where it was, written as a length or with `%` as a share of its part's radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Within(pub Tolerance);

impl FromStr for Within {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number =
            |text: &str| text.parse::<f64>().ok().filter(|number| *number >= 0.0 && number.is_finite());
        let tolerance = match text.strip_suffix('%') {
            Some(share) => {
                number(share).filter(|share| *share <= 100.0).map(|share| Tolerance::Relative(share / 100.0))
            }
            None => number(text).map(Tolerance::Distance),
        };
        let wrong = "expected a length, such as 0.002, or a share of a part's radius, such as 0.1%";
        tolerance.map(Self).ok_or_else(|| wrong.into())
    }
}

/// The values of `--translations`.
pub fn translations() -> impl TypedValueParser<Value = usize> {
    choice(&[(88, "88", "the paper's"), (96, "96", "3 words of tags"), (128, "128", "4 words of tags")])
}

/// Light paths per pixel and frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paths(pub f64);

impl FromStr for Paths {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let paths = text.parse().ok().filter(|paths: &f64| *paths > 0.0 && paths.is_finite());
        let wrong = "expected light paths per pixel and frame, a number above 0, such as 0.25";
        paths.map(Self).ok_or_else(|| wrong.into())
    }
}

/// A share, written as a percentage above 0 and up to 100.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Percent(pub f64);

impl FromStr for Percent {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let percent = text.strip_suffix('%').and_then(|text| text.parse().ok());
        let percent = percent.filter(|percent: &f64| *percent > 0.0 && *percent <= 100.0);
        percent.map(|percent| Self(percent / 100.0)).ok_or_else(|| "expected a percentage, such as 5%".into())
    }
}

/// Samples per pixel of a reference whose halves are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Halves(pub u32);

impl Halves {
    /// The most samples per pixel.
    const MOST: u32 = 1_000_000;
}

impl FromStr for Halves {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let spp = text.parse().ok().filter(|spp| (2..=Self::MOST).contains(spp) && spp % 2 == 0);
        spp.map(Self).ok_or_else(|| {
            format!(
                "expected an even number of samples per pixel, 2 to {}, as halves are compared",
                Self::MOST
            )
        })
    }
}

/// The light transport of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Light {
    /// Direct light and one glossy reflection.
    Direct,
    /// Global illumination with many bounces.
    Path,
}

impl Light {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Direct, Self::Path];
}

/// As in graphs.
impl fmt::Display for Light {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Direct => "Direct",
            Self::Path => "Path",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances() {
        assert_eq!("0.002".parse(), Ok(Within(Tolerance::Distance(0.002))));
        assert_eq!("0.5%".parse(), Ok(Within(Tolerance::Relative(0.005))));
        assert_eq!("0".parse(), Ok(Within(Tolerance::Distance(0.0))));
        for wrong in ["", "%", "-1", "-1%", "101%", "nan", "inf", "1 mm"] {
            assert!(wrong.parse::<Within>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!("640x480".parse(), Ok(Size([640, 480])));
        for wrong in ["", "640", "0x0", "0x5", "100000x100000", "-1x5", "5x", "x5", "1.5x2", "5x5x5"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn paths_percentages_and_halves() {
        assert_eq!(("0.25".parse(), "4".parse()), (Ok(Paths(0.25)), Ok(Paths(4.0))));
        for wrong in ["", "0", "-1", "inf", "nan", "5%"] {
            assert!(wrong.parse::<Paths>().unwrap_err().contains("such as 0.25"), "{wrong}");
        }
        assert_eq!(("5%".parse(), "100%".parse()), (Ok(Percent(0.05)), Ok(Percent(1.0))));
        for wrong in ["", "5", "%", "0%", "-1%", "101%", "nan%"] {
            assert!(wrong.parse::<Percent>().unwrap_err().contains("such as 5%"), "{wrong}");
        }
        assert_eq!("256".parse(), Ok(Halves(256)));
        for wrong in ["", "0", "1", "255", "1000001", "1000002", "2.0"] {
            assert!(wrong.parse::<Halves>().unwrap_err().contains("even number"), "{wrong}");
        }
    }

    #[test]
    fn crops_are_displayed_as_parsed() {
        assert_eq!("3,4,8x6".parse(), Ok(Crop { at: [3, 4], size: [8, 6] }));
        assert_eq!("3,4,8x6".parse::<Crop>().map(|crop| crop.to_string()), Ok("3,4,8x6".into()));
        for wrong in ["", "3,4", "8x6", "3,8x6", "3,4,0x6", "-1,4,8x6", "3,4,8"] {
            let text = wrong.parse::<Crop>().expect_err(wrong);
            assert!(text.contains("such as 120,80,48x32"), "{text}");
        }
    }

    #[test]
    fn places_are_displayed_as_parsed() {
        assert_eq!("230,0".parse::<Place>().unwrap().to_string(), "230,0");
        for wrong in ["", "5", "-1,2", "1,2,3", "1x2"] {
            assert!(wrong.parse::<Place>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn saves() {
        let save: Save = "cull.depth=a/b=c.exr".parse().unwrap();
        assert_eq!((save.source.to_string(), save.file), ("cull.depth".into(), "a/b=c.exr".into()));
        for wrong in ["", "a", "a.b", "a=1", ".b=1", "a.=1", "a.b="] {
            assert!(wrong.parse::<Save>().is_err(), "{wrong}");
        }
        assert!("a=1".parse::<Save>().is_err());
    }
}
