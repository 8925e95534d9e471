//! The number of samples per frame.

use std::{fmt, str::FromStr};

use epigraph_core::share_of;

/// The maximum number of samples per frame, written as a count (`13000`) or as a percentage of the pixels (`5%`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Samples {
    /// A number of samples.
    Count(u32),
    /// A share of the image's pixels, above 0 and up to 1.
    Share(f64),
}

impl Samples {
    /// The number of samples for a frame of `size` pixels. A share gives at least 1.
    pub fn of(self, size: [u32; 2]) -> u32 {
        match self {
            Self::Count(count) => count,
            // At most one per pixel, which a u32 can count.
            Self::Share(share) => u32::try_from(share_of(size, share)).unwrap_or(u32::MAX),
        }
    }
}

impl fmt::Display for Samples {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            // Rounded to ten digits, as 0.07 x 100 is not exactly 7.
            Self::Share(share) => {
                let percent: f64 = format!("{:.9e}", share * 100.0).parse().map_err(|_| fmt::Error)?;
                write!(f, "{percent}%")
            }
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
            "expected the number of samples per frame: a count from 1, such as 13000, or a percentage of the pixels above \
             0% and up to 100%, such as 5%"
                .to_owned()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_a_count_or_a_share_of_the_pixels() {
        let of = |text: &str, size| text.parse::<Samples>().unwrap().of(size);
        assert_eq!(of("7", [10, 10]), 7);
        // 5% of 512 x 512 is 13107.2.
        assert_eq!(of("5%", [512, 512]), 13107);
        assert_eq!(of("100%", [3, 5]), 15);
        assert_eq!(of("0.001%", [10, 10]), 1);
        assert_eq!((of("5%", [256, 256]), of("1%", [256, 256])), (3277, 655));
        assert_eq!(of("100%", [16384, 16384]), 16384 * 16384);
        for wrong in ["", "-5", "0", "0%", "-5%", "101%", "NaN%", "inf%", "5 %%", "x", "1.5"] {
            assert!(wrong.parse::<Samples>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn samples_are_displayed_as_parsed() {
        for text in ["7", "5%", "7%", "0.1%", "33.3%", "33.3333333%", "0.0000001%", "100%"] {
            assert_eq!(text.parse::<Samples>().unwrap().to_string(), text);
        }
    }
}
