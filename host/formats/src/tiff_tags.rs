//! The directories of a TIFF and their tags, as far as raw files of cameras need them.

use std::collections::BTreeMap;

/// Directories in a file, at most: a longer chain is a loop.
const MOST_DIRECTORIES: usize = 64;
/// Tag of the directories below one.
const SUB_DIRECTORIES: u16 = 330;

/// A TIFF in memory.
#[derive(Clone, Copy)]
pub(super) struct Tiff<'a> {
    pub bytes: &'a [u8],
    pub is_big_endian: bool,
}

/// The tags of one directory: type, and bytes of the values.
#[derive(Clone, Debug, Default)]
pub(super) struct Directory<'a> {
    tags: BTreeMap<u16, (u16, &'a [u8])>,
    is_big_endian: bool,
    /// Whether values of one of its tags lie beyond the end of the file.
    pub is_cut: bool,
}

impl<'a> Tiff<'a> {
    /// A classic TIFF; `None` of anything else.
    pub fn of(bytes: &'a [u8]) -> Option<Self> {
        let is_big_endian = match bytes.get(..4)? {
            b"II*\0" => false,
            b"MM\0*" => true,
            _ => return None,
        };
        Some(Self {
            bytes,
            is_big_endian,
        })
    }

    /// All directories that hold images: those of the chain, and those below them.
    pub fn images(&self) -> Vec<Directory<'a>> {
        let mut directories = Vec::new();
        let mut waiting: Vec<u64> = self.number(4, 4).into_iter().collect();
        while let Some(at) = waiting.pop() {
            if at == 0 || directories.len() == MOST_DIRECTORIES {
                continue;
            }
            if let Some((directory, next)) = self.directory(at) {
                waiting.extend(directory.numbers(SUB_DIRECTORIES).unwrap_or_default());
                waiting.extend(next);
                directories.push(directory);
            }
        }
        directories
    }

    /// The directory at a place, and the place of the next one.
    pub fn directory(&self, at: u64) -> Option<(Directory<'a>, Option<u64>)> {
        let at = usize::try_from(at).ok()?;
        let count = usize::try_from(self.number(at, 2)?).ok()?;
        let mut directory = Directory {
            tags: BTreeMap::new(),
            is_big_endian: self.is_big_endian,
            is_cut: false,
        };
        for k in 0..count {
            let entry = at.checked_add(2 + 12 * k)?;
            let [tag, kind] = [self.number(entry, 2)?, self.number(entry + 2, 2)?];
            let size =
                size_of_type(kind as u16) * usize::try_from(self.number(entry + 4, 4)?).ok()?;
            let place = if size <= 4 {
                entry + 8
            } else {
                usize::try_from(self.number(entry + 8, 4)?).ok()?
            };
            match self.bytes.get(place..place.saturating_add(size)) {
                Some(values) => {
                    directory.tags.insert(tag as u16, (kind as u16, values));
                }
                None => directory.is_cut = true,
            }
        }
        Some((directory, self.number(at + 2 + 12 * count, 4)))
    }

    fn number(&self, at: usize, size: usize) -> Option<u64> {
        let bytes = self.bytes.get(at..at.checked_add(size)?)?;
        Some(whole(bytes, self.is_big_endian))
    }
}

impl Directory<'_> {
    /// Whether it has a tag.
    pub fn has(&self, tag: u16) -> bool {
        self.tags.contains_key(&tag)
    }

    /// The whole numbers of a tag; `None` where it is not there or has others.
    pub fn numbers(&self, tag: u16) -> Option<Vec<u64>> {
        let (kind, bytes) = self.tags.get(&tag)?;
        // BYTE, SHORT, LONG, UNDEFINED, and the place of a directory.
        if ![1, 3, 4, 7, 13].contains(kind) {
            return None;
        }
        let values = bytes.chunks_exact(size_of_type(*kind));
        Some(values.map(|b| whole(b, self.is_big_endian)).collect())
    }

    /// The first whole number of a tag.
    pub fn number(&self, tag: u16) -> Option<u64> {
        self.numbers(tag)?.first().copied()
    }

    /// The numbers of a tag, whole, rational or floating; `None` where it is not there.
    pub fn reals(&self, tag: u16) -> Option<Vec<f64>> {
        let (kind, bytes) = self.tags.get(&tag)?;
        let whole = |b: &[u8]| whole(b, self.is_big_endian);
        let values = bytes.chunks_exact(size_of_type(*kind));
        let reals = values.map(|b| match kind {
            5 => Some(whole(&b[..4]) as f64 / whole(&b[4..]) as f64),
            8 => Some(f64::from(whole(b) as u16 as i16)),
            9 => Some(f64::from(whole(b) as u32 as i32)),
            10 => {
                let [over, under] = [&b[..4], &b[4..]].map(|b| whole(b) as u32 as i32);
                Some(f64::from(over) / f64::from(under))
            }
            11 => Some(f64::from(f32::from_bits(whole(b) as u32))),
            12 => Some(f64::from_bits(whole(b))),
            1 | 3 | 4 => Some(whole(b) as f64),
            _ => None,
        });
        reals.collect()
    }
}

/// Bytes of a value of a type; 1 where the type is unknown.
fn size_of_type(kind: u16) -> usize {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 => 8,
        _ => 1,
    }
}

fn whole(bytes: &[u8], is_big_endian: bool) -> u64 {
    let shifted = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
    if is_big_endian {
        bytes.iter().fold(0, shifted)
    } else {
        bytes.iter().rev().fold(0, shifted)
    }
}
