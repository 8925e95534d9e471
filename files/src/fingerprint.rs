//! Names for contents.

use std::fmt;

/// A number that stands for contents: equal ones have the same, and different ones have different numbers, but for a
/// chance of one in 10^38. It does not withstand who wants two contents with one number. It is the same on all machines.
///
/// Text is written to it (`write!`), bytes are taken by [`Fingerprint::take`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(u128);

/// The offset and the prime of the hash FNV-1a (Fowler, Noll and Vo) with 128 bits.
const BASIS: u128 = 0x6C62_272E_07BB_0142_62B8_2175_6295_C58D;
const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013B;

impl Default for Fingerprint {
    fn default() -> Self {
        Self(BASIS)
    }
}

impl Fingerprint {
    /// Takes further bytes. Where one part ends and the next one begins makes no difference.
    pub fn take(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u128::from(byte)).wrapping_mul(PRIME);
        }
    }
}

impl fmt::Write for Fingerprint {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.take(text.as_bytes());
        Ok(())
    }
}

/// 32 hexadecimal digits.
impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    #[test]
    fn known_contents_have_known_numbers() {
        let of = |text: &str| {
            let mut print = Fingerprint::default();
            print.write_str(text).unwrap();
            print.to_string()
        };
        // From the published test vectors of FNV-1a.
        assert_eq!(of("a"), "d228cb696f1a8caf78912b704e4a8964");
        assert_eq!(of("foobar"), "343e1662793c64bf6f0d3597ba446f18");
        assert_eq!(of(""), format!("{BASIS:032x}"));
    }
}
