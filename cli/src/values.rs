//! The values of flags.

use std::{fmt, path::PathBuf, str::FromStr};

use clap::ValueEnum;
use epigraph_core::{MAX_SIDE, Source};

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

/// How many samples a frame may ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Samples {
    /// So many.
    Count(u32),
    /// This share of the image's pixels, above 0 and up to 1.
    Share(f64),
}

impl Samples {
    /// The number of samples of a frame of `size`, at least 1; an error where it would be more than one for each pixel.
    pub fn of(self, size: [u32; 2]) -> Result<u32, String> {
        let pixels = size[0] * size[1];
        match self {
            Self::Count(count) if count > pixels => {
                Err(format!("--samples {count} is more than one for each of the {pixels} pixels"))
            }
            Self::Count(count) => Ok(count),
            Self::Share(share) => Ok(((f64::from(pixels) * share).round() as u32).max(1)),
        }
    }
}

impl fmt::Display for Samples {
    /// As it is written on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            // Seven digits: 0.07 x 100 is not 7.
            Self::Share(share) => write!(f, "{}%", (share * 1e7).round() / 1e5),
        }
    }
}

impl FromStr for Samples {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let samples = match text.strip_suffix('%') {
            Some(percent) => {
                let percent = percent.trim().parse::<f64>().ok().filter(|&p| p > 0.0 && p <= 100.0);
                percent.map(|percent| Self::Share(percent / 100.0))
            }
            None => text.parse().ok().filter(|&count| count > 0).map(Self::Count),
        };
        samples.ok_or_else(|| {
            "expected how many samples a frame may ask for: a count from 1, such as 13000, or a share of the pixels \
             above 0% and up to 100%, such as 5%"
                .to_owned()
        })
    }
}

/// A parameter's new value, written `node.param=value`.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// The node.
    pub node: String,
    /// The parameter.
    pub param: String,
    /// RON text.
    pub value: String,
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').and_then(|(name, value)| Some((name.split_once('.')?, value)));
        match parts {
            Some(((node, param), value)) if !node.is_empty() && !param.is_empty() && !value.is_empty() => {
                Ok(Self { node: node.into(), param: param.into(), value: value.into() })
            }
            _ => Err("expected node.param=value, such as cull.threshold=0.1".into()),
        }
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

/// Where nodes run that do not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// A hardware GPU if there is one, else the CPU.
    Auto,
    /// Any GPU adapter, software ones such as Mesa's lavapipe included.
    Gpu,
    /// Native code.
    Cpu,
}

/// When samples arrive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Pace {
    /// All of them in the frame after their request: the same picture in every run.
    Exact,
    /// When they are done; no frame waits for them.
    Async,
}

/// Which light a reference shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Light {
    /// From the lights to the first surface, and one glossy reflection.
    Direct,
    /// All light, over many bounces.
    Path,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!("640x480".parse(), Ok(Size([640, 480])));
        for wrong in ["", "640", "0x0", "0x5", "100000x100000", "-1x5", "5x", "x5", "1.5x2", "5x5x5"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn samples_are_a_count_or_a_share_of_the_pixels() {
        let of = |text: &str, size| text.parse::<Samples>().and_then(|samples| samples.of(size));
        assert_eq!(of("7", [10, 10]), Ok(7));
        // 5% of 512 x 512 is 13107.2.
        assert_eq!(of("5%", [512, 512]), Ok(13107));
        assert_eq!(of("100%", [3, 5]), Ok(15));
        assert_eq!(of("0.001%", [10, 10]), Ok(1));
        assert!(of("101", [10, 10]).is_err());
        for wrong in ["", "-5", "0", "0%", "-5%", "101%", "NaN%", "inf%", "5 %%", "x", "1.5"] {
            assert!(wrong.parse::<Samples>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn samples_and_places_are_shown_as_they_are_written() {
        for text in ["7", "5%", "0.1%", "33.3%", "100%"] {
            assert_eq!(text.parse::<Samples>().unwrap().to_string(), text);
        }
        assert_eq!("230,0".parse::<Place>().unwrap().to_string(), "230,0");
        for wrong in ["", "5", "-1,2", "1,2,3", "1x2"] {
            assert!(wrong.parse::<Place>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn settings_and_saves() {
        let setting: Setting = "glow.shader=\"a=b.wgsl\"".parse().unwrap();
        assert_eq!((setting.node.as_str(), setting.param.as_str()), ("glow", "shader"));
        assert_eq!(setting.value, "\"a=b.wgsl\"");
        let save: Save = "cull.depth=a/b=c.exr".parse().unwrap();
        assert_eq!((save.source.to_string(), save.file), ("cull.depth".into(), "a/b=c.exr".into()));
        for wrong in ["", "a", "a.b", "a=1", ".b=1", "a.=1", "a.b="] {
            assert!(wrong.parse::<Setting>().is_err(), "{wrong}");
            assert!(wrong.parse::<Save>().is_err(), "{wrong}");
        }
    }
}
