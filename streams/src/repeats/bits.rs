//! Numbers of any number of bits, the lowest bits first.

/// Appends numbers to bytes.
pub(super) struct BitWriter<'a> {
    bytes: &'a mut Vec<u8>,
    /// Bits that do not fill a byte yet, and how many they are.
    word: u64,
    count: u32,
}

impl<'a> BitWriter<'a> {
    pub(super) fn new(bytes: &'a mut Vec<u8>) -> Self {
        Self { bytes, word: 0, count: 0 }
    }

    /// Appends a number that has at most 32 bits.
    pub(super) fn write(&mut self, number: u32, bits: u32) {
        self.word |= u64::from(number) << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.bytes.push(self.word as u8);
            self.word >>= 8;
            self.count -= 8;
        }
    }

    /// Fills the last byte with zeros.
    pub(super) fn finish(self) {
        if self.count > 0 {
            self.bytes.push(self.word as u8);
        }
    }
}

/// Reads numbers from bytes.
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    word: u64,
    count: u32,
}

impl<'a> BitReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, word: 0, count: 0 }
    }

    /// The next number, of at most 32 bits; zeros follow the last byte.
    pub(super) fn read(&mut self, bits: u32) -> u32 {
        while self.count < bits {
            let (byte, rest) = self.bytes.split_first().map_or((0, &[][..]), |(&byte, rest)| (byte, rest));
            self.word |= u64::from(byte) << self.count;
            self.bytes = rest;
            self.count += 8;
        }
        let number = self.word & ((1 << bits) - 1);
        self.word >>= bits;
        self.count -= bits;
        number as u32
    }
}

/// The bytes that `count` numbers of `bits` bits take.
pub(super) fn bytes_of(count: usize, bits: u32) -> usize {
    (count * bits as usize).div_ceil(8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn numbers_are_read_as_they_were_written() {
        let mut random = Random(1);
        let mut number = || {
            let bits = random.below(33);
            let number = u64::from(random.next() << 8 ^ random.next()) & ((1 << bits) - 1);
            (number as u32, bits)
        };
        let numbers: Vec<(u32, u32)> = (0..5000).map(|_| number()).collect();
        let mut bytes = Vec::new();
        let mut writer = BitWriter::new(&mut bytes);
        numbers.iter().for_each(|&(number, bits)| writer.write(number, bits));
        writer.finish();
        let all: u32 = numbers.iter().map(|(_, bits)| bits).sum();
        assert_eq!(bytes.len(), bytes_of(all as usize, 1));
        let mut reader = BitReader::new(&bytes);
        assert!(numbers.iter().all(|&(number, bits)| reader.read(bits) == number));
        assert_eq!(reader.read(9), 0);
    }

    #[test]
    fn the_lowest_bits_come_first() {
        let mut bytes = Vec::new();
        let mut writer = BitWriter::new(&mut bytes);
        [(0b101, 3), (0, 0), (0b110, 3), (0b1111, 4)]
            .into_iter()
            .for_each(|(number, bits)| writer.write(number, bits));
        writer.finish();
        assert_eq!(bytes, [0b1111_0101, 0b11]);
    }
}
