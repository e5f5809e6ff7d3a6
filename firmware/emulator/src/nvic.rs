//! Priorities of the core's interrupts.
//!
//! The emulator lets nobody but the program read its NVIC, but saves it with the core's state: postcard's form
//! of a list of exceptions, five bytes each (enabled, pending, active, asserted, priority), of the active ones,
//! of the mask of priority bits, and of the group. That form is rigless 0.4's own, so it is looked for, and where
//! it is not found exactly once nothing is returned.

/// Exceptions before the first interrupt.
const SYSTEM: usize = 16;
/// Bytes of an exception.
const RECORD: usize = 5;
/// Four priority bits are there.
const MASK: u8 = 0xF0;

/// What the NVIC holds of an interrupt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupt {
    /// It may come.
    pub is_enabled: bool,
    /// 0 comes first, 15 last.
    pub priority: u8,
    /// SCB_AIRCR.PRIGROUP: above 3, priority bits are taken from preemption.
    pub group: u8,
}

impl Interrupt {
    /// As one word, for the way to the script.
    pub fn to_word(self) -> u32 {
        u32::from(self.group) << 16 | u32::from(self.is_enabled) << 8 | u32::from(self.priority)
    }

    /// Back from it; `None` for the word that says that nothing was found.
    pub fn from_word(word: u32) -> Option<Self> {
        (word != u32::MAX).then_some(Self {
            is_enabled: word >> 8 & 1 == 1,
            priority: word as u8,
            group: (word >> 16) as u8,
        })
    }
}

/// An interrupt in the state of a core with so many interrupt lines.
pub fn find(state: &[u8], lines: usize, number: usize) -> Option<Interrupt> {
    let count = SYSTEM + lines;
    let mut found = (0..state.len()).filter_map(|at| parse(state.get(at..)?, count, number));
    let interrupt = found.next()?;
    found.next().is_none().then_some(interrupt)
}

fn parse(bytes: &[u8], count: usize, number: usize) -> Option<Interrupt> {
    let (length, rest) = varint(bytes)?;
    if length != count {
        return None;
    }
    let (records, rest) = rest.split_at_checked(count * RECORD)?;
    let mut records = records.chunks_exact(RECORD);
    let is_record = |r: &[u8]| r[..4].iter().all(|&flag| flag <= 1) && r[4] & !MASK == 0;
    if !records.clone().all(is_record) {
        return None;
    }
    let (active, mut rest) = varint(rest)?;
    for _ in 0..active {
        (_, rest) = varint(rest)?;
    }
    let &[MASK, group, ..] = rest else {
        return None;
    };
    let record = records.nth(SYSTEM + number)?;
    Some(Interrupt {
        is_enabled: record[0] == 1,
        priority: record[4] >> 4,
        group,
    })
}

/// Seven bits a byte, lowest first.
fn varint(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let mut value = 0;
    for (i, &byte) in bytes.iter().enumerate().take(3) {
        value |= usize::from(byte & 0x7F) << (7 * i);
        if byte & 0x80 == 0 {
            return Some((value, bytes.get(i + 1..)?));
        }
    }
    None
}
