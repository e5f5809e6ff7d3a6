//! Lossless JPEG (ITU-T T.81, process 14), by which converters compress the counts of a sensor.

/// Samples of an image: columns × components of each row, one row after the other.
pub(super) struct Samples {
    /// Rows.
    pub rows: usize,
    /// Values a row.
    pub values_a_row: usize,
    /// Row by row.
    pub counts: Vec<u16>,
}

/// A Huffman table: for each length of a code its first code, how many there are, and where their values
/// begin.
#[derive(Clone, Default)]
struct Table {
    first: [u32; 17],
    count: [u32; 17],
    begin: [usize; 17],
    values: Vec<u8>,
}

/// What the headers say.
#[derive(Default)]
struct Headers {
    bits: u32,
    rows: usize,
    columns: usize,
    components: usize,
    tables: [Option<Table>; 4],
    restart: usize,
}

/// Decodes an image of at most `most` values; `None` where it is none, is damaged, larger, or of another
/// process.
pub(super) fn decode(bytes: &[u8], most: usize) -> Option<Samples> {
    let mut headers = Headers::default();
    if bytes.get(..2)? != [0xff, 0xd8] {
        return None;
    }
    let mut at = 2;
    loop {
        if *bytes.get(at)? != 0xff {
            return None;
        }
        let marker = *bytes.get(at + 1)?;
        if marker == 0xff {
            at += 1;
            continue;
        }
        let length = usize::from(u16::from_be_bytes([
            *bytes.get(at + 2)?,
            *bytes.get(at + 3)?,
        ]));
        let segment = bytes.get(at + 4..at + 2 + length)?;
        at += 2 + length;
        match marker {
            0xc3 => headers.frame(segment, most)?,
            0xc4 => headers.huffman(segment)?,
            0xdd => {
                headers.restart =
                    usize::from(u16::from_be_bytes([*segment.first()?, *segment.get(1)?]))
            }
            0xda => return headers.scan(segment, &bytes[at..]),
            // Another process: lossy, or arithmetic codes.
            0xc0..=0xcf => return None,
            _ => {}
        }
    }
}

impl Headers {
    fn frame(&mut self, segment: &[u8], most: usize) -> Option<()> {
        let [bits, r1, r0, c1, c0, components, ..] = *segment else {
            return None;
        };
        self.bits = u32::from(bits);
        self.rows = usize::from(u16::from_be_bytes([r1, r0]));
        self.columns = usize::from(u16::from_be_bytes([c1, c0]));
        self.components = usize::from(components);
        let sampled = (0..self.components).all(|k| segment.get(7 + 3 * k) == Some(&0x11));
        let values = self.rows * self.columns * self.components;
        let is_usable = (2..=16).contains(&self.bits) && (1..=4).contains(&self.components);
        (is_usable && sampled && values > 0 && values <= most).then_some(())
    }

    fn huffman(&mut self, mut segment: &[u8]) -> Option<()> {
        while let Some((head, rest)) = segment.split_first() {
            let (lengths, rest) = rest.split_at_checked(16)?;
            let total = lengths.iter().map(|n| usize::from(*n)).sum();
            let (values, rest) = rest.split_at_checked(total)?;
            let mut table = Table {
                values: values.to_vec(),
                ..Table::default()
            };
            let (mut code, mut begin) = (0u32, 0);
            for length in 1..=16 {
                let count = u32::from(lengths[length - 1]);
                (table.first[length], table.count[length]) = (code, count);
                table.begin[length] = begin;
                begin += count as usize;
                code = (code + count) << 1;
            }
            *self.tables.get_mut(usize::from(*head))? = Some(table);
            segment = rest;
        }
        Some(())
    }

    fn scan(&self, segment: &[u8], data: &[u8]) -> Option<Samples> {
        let n = self.components;
        if n == 0 || usize::from(*segment.first()?) != n {
            return None;
        }
        let mut tables = Vec::new();
        for k in 0..n {
            let which = usize::from(*segment.get(2 + 2 * k)? >> 4);
            tables.push(self.tables.get(which)?.as_ref()?);
        }
        let predictor = *segment.get(1 + 2 * n)?;
        let shift = u32::from(*segment.get(3 + 2 * n)? & 15);
        // Rows that begin anew in the middle of a row are in no file of a camera.
        let restart_rows = match self.restart {
            0 => usize::MAX,
            every if every % self.columns == 0 => every / self.columns,
            _ => return None,
        };
        if !(1..=7).contains(&predictor) || shift >= self.bits {
            return None;
        }
        let start = 1 << (self.bits - shift - 1);
        let width = self.columns * n;
        let mut counts = vec![0u16; self.rows * width];
        let mut bits = Bits::of(data);
        for row in 0..self.rows {
            let begins = row % restart_rows == 0;
            if begins && row > 0 {
                bits.restart()?;
            }
            let (above, rest) = counts.split_at_mut(row * width);
            let above = above.get(above.len().saturating_sub(width)..)?;
            for x in 0..width {
                let predicted = match (x < n, begins) {
                    (true, true) => start,
                    (true, false) => i32::from(above[x]),
                    (false, true) => i32::from(rest[x - n]),
                    (false, false) => predict(
                        predictor,
                        [rest[x - n], above[x], above[x - n]].map(i32::from),
                    ),
                };
                let difference = bits.difference(tables[x % n])?;
                rest[x] = (predicted + difference) as u16;
            }
        }
        counts.iter_mut().for_each(|count| *count <<= shift);
        Some(Samples {
            rows: self.rows,
            values_a_row: width,
            counts,
        })
    }
}

/// Table H.1: by left, above, and above left.
fn predict(predictor: u8, [a, b, c]: [i32; 3]) -> i32 {
    match predictor {
        1 => a,
        2 => b,
        3 => c,
        4 => a + b - c,
        5 => a + ((b - c) >> 1),
        6 => b + ((a - c) >> 1),
        _ => (a + b) >> 1,
    }
}

/// Bits of coded data, the most significant first.
struct Bits<'a> {
    data: &'a [u8],
    at: usize,
    held: u32,
    count: u32,
}

impl<'a> Bits<'a> {
    fn of(data: &'a [u8]) -> Self {
        Self {
            data,
            at: 0,
            held: 0,
            count: 0,
        }
    }

    fn bit(&mut self) -> Option<u32> {
        if self.count == 0 {
            let byte = *self.data.get(self.at)?;
            self.at += 1;
            if byte == 0xff {
                // A zero was put behind it; anything else is a marker, which ends the data.
                if *self.data.get(self.at)? != 0 {
                    return None;
                }
                self.at += 1;
            }
            (self.held, self.count) = (u32::from(byte), 8);
        }
        self.count -= 1;
        Some(self.held >> self.count & 1)
    }

    fn restart(&mut self) -> Option<()> {
        self.count = 0;
        let marker = self.data.get(self.at..self.at + 2)?;
        self.at += 2;
        (marker[0] == 0xff && (0xd0..=0xd7).contains(&marker[1])).then_some(())
    }

    fn difference(&mut self, table: &Table) -> Option<i32> {
        let mut code = 0;
        for length in 1..=16 {
            code = code << 1 | self.bit()?;
            let place = code.wrapping_sub(table.first[length]);
            if place < table.count[length] {
                let size = *table.values.get(table.begin[length] + place as usize)?;
                return self.extended(u32::from(size));
            }
        }
        None
    }

    /// Section H.1.2.2: a difference of so many bits.
    fn extended(&mut self, size: u32) -> Option<i32> {
        if size == 16 {
            return Some(1 << 15);
        }
        if size > 16 {
            return None;
        }
        let mut value = 0;
        for _ in 0..size {
            value = value << 1 | self.bit()? as i32;
        }
        let is_negative = size > 0 && value < 1 << (size - 1);
        Some(if is_negative {
            value - (1 << size) + 1
        } else {
            value
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Encodes counts by a table in which every size has a code of five bits.
    pub fn encode(counts: &[u16], rows: usize, components: usize, predictor: u8) -> Vec<u8> {
        let width = counts.len() / rows;
        let mut out = vec![0xff, 0xd8, 0xff, 0xc4, 0, 19 + 17, 0];
        out.extend((1..=16).map(|length| if length == 5 { 17 } else { 0 }));
        out.extend(0..=16);
        out.extend([0xff, 0xc3, 0, 8 + 3 * components as u8, 16]);
        out.extend((rows as u16).to_be_bytes());
        out.extend(((width / components) as u16).to_be_bytes());
        out.push(components as u8);
        (0..components as u8).for_each(|k| out.extend([k, 0x11, 0]));
        out.extend([0xff, 0xda, 0, 6 + 2 * components as u8, components as u8]);
        (0..components as u8).for_each(|k| out.extend([k, 0]));
        out.extend([predictor, 0, 0]);
        let mut bits: Vec<bool> = Vec::new();
        let mut put = |value: u32, size: u32| {
            bits.extend((0..size).rev().map(|k| value >> k & 1 == 1));
        };
        for row in 0..rows {
            for x in 0..width {
                let at = |dx: usize, dy: usize| {
                    i32::from(counts[(row - dy) * width + x - dx * components])
                };
                let predicted = match (x < components, row == 0) {
                    (true, true) => 1 << 15,
                    (true, false) => at(0, 1),
                    (false, true) => at(1, 0),
                    (false, false) => predict(predictor, [at(1, 0), at(0, 1), at(1, 1)]),
                };
                let difference = i32::from((at(0, 0) - predicted) as u16 as i16);
                if difference == -(1 << 15) {
                    put(16, 5);
                    continue;
                }
                let size = 32 - difference.unsigned_abs().leading_zeros();
                put(size, 5);
                let coded = if difference < 0 {
                    difference + (1 << size) - 1
                } else {
                    difference
                };
                put(coded as u32, size);
            }
        }
        bits.resize(bits.len().next_multiple_of(8), true);
        for byte in bits.chunks(8) {
            let byte = byte.iter().fold(0, |byte, bit| byte << 1 | u8::from(*bit));
            out.push(byte);
            if byte == 0xff {
                out.push(0);
            }
        }
        out.extend([0xff, 0xd9]);
        out
    }

    #[test]
    fn counts_come_back_by_every_predictor() {
        let counts: Vec<u16> = (0..6 * 8)
            .map(|k: u32| (k.wrapping_mul(2_654_435_761) >> 7) as u16)
            .chain([0, 65_535, 0, 32_768, 1, 2, 3, 4])
            .collect();
        for components in [1, 2] {
            for predictor in 1..=7 {
                let bytes = encode(&counts, 7, components, predictor);
                let samples = decode(&bytes, 56).unwrap();
                assert_eq!((samples.rows, samples.values_a_row), (7, 8));
                assert_eq!(samples.counts, counts, "{components} {predictor}");
            }
        }
    }

    #[test]
    fn what_is_damaged_or_larger_than_it_may_be_is_none() {
        let bytes = encode(&[7; 12], 3, 2, 1);
        assert!(decode(&bytes, 12).is_some() && decode(&bytes, 11).is_none());
        for keep in 0..bytes.len() - 2 {
            assert!(decode(&bytes[..keep], 12).is_none(), "{keep}");
        }
        let lossy: Vec<u8> = bytes
            .iter()
            .map(|b| if *b == 0xc3 { 0xc0 } else { *b })
            .collect();
        assert!(decode(&lossy, 12).is_none());
    }

    /// Figures by hand, of section H.1.2: 16 bits, one component, 1 × 3 values 32769, 32766, 32766.
    #[test]
    fn a_row_worked_out_by_hand_is_read() {
        let head = [
            0xff, 0xd8, 0xff, 0xc3, 0, 11, 16, 0, 1, 0, 3, 1, 0, 0x11, 0, 0xff, 0xc4, 0, 22, 0, 1,
            2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 0xff, 0xda, 0, 8, 1, 0, 0, 1, 0,
            0,
        ];
        // Codes: size 0 is 0, size 1 is 10, size 2 is 11. +1 is 10 1, -3 is 11 00, 0 is 0; then ones.
        let bytes = [&head[..], &[0b1011_1000, 0xff, 0xd9]].concat();
        assert_eq!(decode(&bytes, 3).unwrap().counts, [32_769, 32_766, 32_766]);
    }
}
