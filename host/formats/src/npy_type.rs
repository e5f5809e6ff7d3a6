//! The types of an array's elements: plain numbers, or records of named fields.

use crate::npy_literal::Literal;
use half::f16;

/// A number as its bytes stand in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NumberType {
    kind: Kind,
    bytes: usize,
    big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Float,
    Signed,
    Unsigned,
}

impl NumberType {
    /// Float32, little-endian.
    pub const SINGLE: Self = Self {
        kind: Kind::Float,
        bytes: 4,
        big_endian: false,
    };

    /// How many bytes it takes.
    pub fn bytes(self) -> usize {
        self.bytes
    }

    /// Up to which number whole numbers are told apart.
    pub fn last_whole(self) -> u32 {
        match (self.kind, self.bytes) {
            (Kind::Float, 2) => (1 << 11) - 1,
            (Kind::Float, 4) => (1 << 24) - 1,
            _ => u32::MAX,
        }
    }

    /// The number at the beginning of these bytes, of which there are enough.
    pub fn number(self, at: &[u8]) -> f64 {
        let mut eight = [0u8; 8];
        let bytes = &at[..self.bytes];
        for (k, byte) in bytes.iter().enumerate() {
            eight[if self.big_endian {
                self.bytes - 1 - k
            } else {
                k
            }] = *byte;
        }
        let bits = u64::from_le_bytes(eight);
        let unused = 64 - 8 * self.bytes;
        match (self.kind, self.bytes) {
            (Kind::Float, 2) => f16::from_bits(bits as u16).to_f64(),
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => f64::from_bits(bits),
            // Shifted up and down again, the sign fills what is above.
            (Kind::Signed, _) => (((bits << unused) as i64) >> unused) as f64,
            (Kind::Unsigned, _) => bits as f64,
        }
    }
}

/// A field of an element, at its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    /// Empty in an array of plain numbers.
    pub name: String,
    /// Bytes from the beginning of the element.
    pub offset: usize,
    /// Absent for texts, dates, padding and the like.
    pub number: Option<NumberType>,
    /// Its type as the file names it.
    pub text: String,
}

/// An element: its fields and all its bytes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ElementType {
    pub fields: Vec<Field>,
    pub bytes: usize,
    /// Whether the fields have names.
    pub is_record: bool,
}

impl ElementType {
    /// Of a header's `descr`; `None` where it is none that can be skipped or read.
    pub fn of(descr: &Literal) -> Option<Self> {
        let mut element = Self {
            fields: Vec::new(),
            bytes: 0,
            is_record: matches!(descr, Literal::Sequence(_)),
        };
        match descr {
            Literal::Text(text) => element.push(String::new(), text)?,
            Literal::Sequence(fields) => {
                for field in fields {
                    element.push_field(field)?;
                }
            }
            _ => return None,
        }
        Some(element)
    }

    fn push_field(&mut self, field: &Literal) -> Option<()> {
        let Literal::Sequence(parts) = field else {
            return None;
        };
        let (name, kind, shape) = match &parts[..] {
            [name, Literal::Text(kind)] => (name, kind, &[][..]),
            [name, Literal::Text(kind), Literal::Sequence(shape)] => (name, kind, &shape[..]),
            _ => return None,
        };
        let name = match name {
            Literal::Text(name) => name,
            // A title and the name.
            Literal::Sequence(both) => match &both[..] {
                [_, Literal::Text(name)] => name,
                _ => return None,
            },
            _ => return None,
        };
        let mut times = 1usize;
        for side in shape {
            let Literal::Number(side) = side else {
                return None;
            };
            times = times.checked_mul(usize::try_from(*side).ok()?)?;
        }
        match times {
            1 => self.push(name.clone(), kind),
            3 => {
                // Three values under one name are the channels.
                let channel = |c: &str| {
                    if name.eq_ignore_ascii_case("rgb") {
                        c.to_owned()
                    } else {
                        format!("{name}_{c}")
                    }
                };
                ["r", "g", "b"]
                    .into_iter()
                    .try_for_each(|c| self.push(channel(c), kind))
            }
            _ => {
                let (_, bytes) = type_of(kind)?;
                self.skip(name.clone(), kind, bytes.checked_mul(times)?)
            }
        }
    }

    fn push(&mut self, name: String, kind: &str) -> Option<()> {
        let (number, bytes) = type_of(kind)?;
        self.skip(name, kind, bytes)?;
        if let Some(field) = self.fields.last_mut() {
            field.number = number;
        }
        Some(())
    }

    fn skip(&mut self, name: String, kind: &str, bytes: usize) -> Option<()> {
        self.fields.push(Field {
            name,
            offset: self.bytes,
            number: None,
            text: kind.to_owned(),
        });
        self.bytes = self.bytes.checked_add(bytes)?;
        Some(())
    }
}

/// The number that a type such as `<f4` is, if any, and its bytes.
fn type_of(text: &str) -> Option<(Option<NumberType>, usize)> {
    let big_endian = text.starts_with('>');
    let text = text.trim_start_matches(['<', '>', '|', '=']);
    let kind = text.chars().next()?;
    // The unit of a date follows in brackets.
    let size = text[kind.len_utf8()..].split('[').next()?;
    let size: usize = if size.is_empty() {
        1
    } else {
        size.parse().ok()?
    };
    let number = |kind| NumberType {
        kind,
        bytes: size,
        big_endian,
    };
    Some(match (kind, size) {
        ('f', 2 | 4 | 8) => (Some(number(Kind::Float)), size),
        ('i', 1 | 2 | 4 | 8) => (Some(number(Kind::Signed)), size),
        ('u', 1 | 2 | 4 | 8) => (Some(number(Kind::Unsigned)), size),
        ('U', _) => (None, size.checked_mul(4)?),
        ('f' | 'c' | 'b' | 'S' | 'a' | 'V' | 'M' | 'm', _) => (None, size),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(kind: &str, bytes: &[u8]) -> f64 {
        let (number, size) = type_of(kind).unwrap();
        assert_eq!(size, bytes.len());
        number.unwrap().number(bytes)
    }

    #[test]
    fn numbers_of_every_type_and_order_are_read() {
        assert_eq!(number("<f4", &1.5f32.to_le_bytes()), 1.5);
        assert_eq!(number(">f4", &1.5f32.to_be_bytes()), 1.5);
        assert_eq!(number("<f8", &0.1f64.to_le_bytes()), 0.1);
        assert_eq!(number(">f8", &0.1f64.to_be_bytes()), 0.1);
        assert_eq!(number("<f2", &f16::from_f32(-2.5).to_le_bytes()), -2.5);
        assert_eq!(number(">f2", &f16::from_f32(-2.5).to_be_bytes()), -2.5);
        assert_eq!(number("|i1", &[0xff]), -1.0);
        assert_eq!(number("<i2", &(-300i16).to_le_bytes()), -300.0);
        assert_eq!(number(">i4", &(-70_000i32).to_be_bytes()), -70_000.0);
        assert_eq!(number("<i8", &(-1i64).to_le_bytes()), -1.0);
        assert_eq!(number("<u4", &u32::MAX.to_le_bytes()), 4_294_967_295.0);
        assert_eq!(number("|u1", &[200]), 200.0);
    }

    #[test]
    fn fields_stand_at_their_offsets_and_channels_have_their_names() {
        let descr = Literal::parse(
            "[('x','|S3'),(('t','theta_i'),'<f8'),('','|V4'),('rgb','<f4',(3,)),('brdf','<f4',(3,)),('m','<f4',(2,2)),('n','<U2'),('end','|u1')]",
        );
        let element = ElementType::of(&descr.unwrap()).unwrap();
        let at: Vec<(&str, usize)> = element
            .fields
            .iter()
            .map(|f| (&f.name[..], f.offset))
            .collect();
        assert_eq!(
            at,
            [
                ("x", 0),
                ("theta_i", 3),
                ("", 11),
                ("r", 15),
                ("g", 19),
                ("b", 23),
                ("brdf_r", 27),
                ("brdf_g", 31),
                ("brdf_b", 35),
                ("m", 39),
                ("n", 55),
                ("end", 63)
            ]
        );
        assert_eq!(element.bytes, 64);
        assert!(element.fields[0].number.is_none() && element.fields[9].number.is_none());
    }

    #[test]
    fn what_cannot_be_skipped_is_refused() {
        for descr in [
            "'|O'",
            "[('a','|O')]",
            "[('a',[('b','<f4')])]",
            "5",
            "'<f'x",
            "''",
            "'<é'",
            "[('a','<S99999999999999999999')]",
        ] {
            let element = Literal::parse(descr).and_then(|descr| ElementType::of(&descr));
            assert_eq!(element, None, "{descr}");
        }
        let times = "[('a','<f8',(9999999999,9999999999,9999999999))]";
        assert_eq!(ElementType::of(&Literal::parse(times).unwrap()), None);
    }
}
