//! Settings in two sectors of flash, record after record: the old ones are there until the new ones are
//! whole, whenever the power goes, and a sector is erased only where the other is full.
//!
//! A record: number (counts saves), length of the settings, settings, CRC-32C of all that; little
//! endian. The length is in the record so that newer firmware finds what older firmware wrote. Each has a
//! slot of [`RECORD_MAX`] bytes. A slot that holds anything is used up, whole record or not.

use gonia_protocol::crc32c;
use heapless::Vec;

use crate::hardware::NotSaved;
use crate::settings::STORED_LEN;

/// The longest stored form of settings that this firmware reads, also those of newer firmware.
pub const STORED_MAX: usize = 512;
const HEAD: usize = 8;
/// The longest record, in whole words, which is how flash is written.
pub const RECORD_MAX: usize = HEAD + STORED_MAX + 4;
/// Settings as they were stored.
pub type Stored = Vec<u8, STORED_MAX>;

const _: () = assert!(STORED_LEN <= STORED_MAX && RECORD_MAX.is_multiple_of(4));

/// Two sectors of flash of so many slots. Erased flash reads 0xFF.
pub trait Sectors {
    /// Slots of [`RECORD_MAX`] bytes in a sector, one at least.
    fn slots(&self) -> usize;
    /// Reads from the beginning of a slot.
    fn read(&mut self, sector: usize, slot: usize, out: &mut [u8]) -> Result<(), NotSaved>;
    /// Erases a sector.
    fn erase(&mut self, sector: usize) -> Result<(), NotSaved>;
    /// Writes whole words to the beginning of an erased slot.
    fn write(&mut self, sector: usize, slot: usize, bytes: &[u8]) -> Result<(), NotSaved>;
}

/// A whole record.
#[derive(Clone, Copy, Debug)]
struct Newest {
    sector: usize,
    number: u32,
    /// The first slot of its sector in which, and in those after it, nothing stands.
    free: usize,
}

/// Knows where the newest record is.
#[derive(Debug, Default)]
pub struct Store {
    newest: Option<Newest>,
}

impl Store {
    /// Looks at both sectors, and returns the newest settings: `None` on a new board, and bytes that
    /// are no settings where nothing whole is left, so that the controller says so.
    pub fn open(sectors: &mut impl Sectors) -> (Self, Option<Stored>) {
        let (mut newest, mut stored): (Option<Newest>, _) = (None, None);
        let mut is_torn = false;
        for sector in 0..2 {
            let (mut found, mut free) = (None, 0);
            for slot in 0..sectors.slots() {
                let mut record = [0; RECORD_MAX];
                let read = sectors.read(sector, slot, &mut record);
                if read.is_ok() && record.iter().all(|&byte| byte == 0xFF) {
                    continue;
                }
                free = slot + 1;
                match parse(&record) {
                    // Within a sector, later is newer.
                    Some(record) => found = Some(record),
                    None => is_torn = true,
                }
            }
            let Some((number, settings)) = found else {
                continue;
            };
            if newest.is_none_or(|other| number > other.number) {
                newest = Some(Newest {
                    sector,
                    number,
                    free,
                });
                stored = Some(settings);
            }
        }
        // Torn: worth nothing beside a whole one, worth a word if it is the only one.
        if stored.is_none() && is_torn {
            stored = Some(Stored::new());
        }
        (Self { newest }, stored)
    }

    /// Saves settings behind the newest record, or in the other sector where there is no room, and reads
    /// them back.
    pub fn save(&mut self, sectors: &mut impl Sectors, settings: &[u8]) -> Result<(), NotSaved> {
        let (number, place) = match self.newest {
            Some(newest) => (newest.number, Some((newest.sector, newest.free))),
            None => (0, None),
        };
        let number = number.wrapping_add(1);
        let length = u32::try_from(settings.len()).map_err(|_| NotSaved)?;
        let mut record: Vec<u8, RECORD_MAX> = Vec::new();
        for part in [&number.to_le_bytes()[..], &length.to_le_bytes(), settings] {
            record.extend_from_slice(part).map_err(|_| NotSaved)?;
        }
        let crc = crc32c(&record).to_le_bytes();
        record.extend_from_slice(&crc).map_err(|_| NotSaved)?;
        let words = record.len().next_multiple_of(4);
        record.resize(words, 0).map_err(|_| NotSaved)?;

        let (sector, slot) = match place {
            Some((sector, slot)) if slot < sectors.slots() => (sector, slot),
            _ => {
                let other = place.map_or(0, |(sector, _)| 1 - sector);
                sectors.erase(other)?;
                (other, 0)
            }
        };
        // What fails from here on has used the slot up, if it was the newest record's sector.
        if let Some(newest) = self
            .newest
            .as_mut()
            .filter(|newest| newest.sector == sector)
        {
            newest.free = slot + 1;
        }
        sectors.write(sector, slot, &record)?;
        let mut check = [0; RECORD_MAX];
        sectors.read(sector, slot, &mut check)?;
        if check[..words] != record[..] {
            return Err(NotSaved);
        }
        self.newest = Some(Newest {
            sector,
            number,
            free: slot + 1,
        });
        Ok(())
    }
}

fn parse(record: &[u8; RECORD_MAX]) -> Option<(u32, Stored)> {
    let word = |at: usize| {
        let (word, _) = record.get(at..)?.split_first_chunk::<4>()?;
        Some(u32::from_le_bytes(*word))
    };
    let length = usize::try_from(word(4)?).ok()?;
    if length > STORED_MAX {
        return None;
    }
    let (content, _) = record.split_at(HEAD + length);
    let is_whole = word(HEAD + length)? == crc32c(content);
    let settings = Stored::from_slice(&content[HEAD..]).ok()?;
    is_whole.then_some((word(0)?, settings))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slots of a sector here.
    const SLOTS: usize = 3;

    /// Flash whose power goes after so many bytes.
    struct Ram {
        sectors: [[[u8; RECORD_MAX]; SLOTS]; 2],
        power: usize,
        erases: usize,
    }

    impl Ram {
        fn new() -> Self {
            Self {
                sectors: [[[0xFF; RECORD_MAX]; SLOTS]; 2],
                power: usize::MAX,
                erases: 0,
            }
        }
    }

    impl Sectors for Ram {
        fn slots(&self) -> usize {
            SLOTS
        }
        fn read(&mut self, sector: usize, slot: usize, out: &mut [u8]) -> Result<(), NotSaved> {
            out.copy_from_slice(&self.sectors[sector][slot][..out.len()]);
            Ok(())
        }
        fn erase(&mut self, sector: usize) -> Result<(), NotSaved> {
            self.erases += 1;
            self.sectors[sector] = [[0xFF; RECORD_MAX]; SLOTS];
            Ok(())
        }
        fn write(&mut self, sector: usize, slot: usize, bytes: &[u8]) -> Result<(), NotSaved> {
            let n = bytes.len().min(self.power);
            let place = &mut self.sectors[sector][slot];
            assert!(place.iter().all(|&byte| byte == 0xFF), "written twice");
            place[..n].copy_from_slice(&bytes[..n]);
            if n < bytes.len() {
                return Err(NotSaved);
            }
            Ok(())
        }
    }

    #[test]
    fn a_sector_is_erased_once_for_all_its_slots() {
        let mut ram = Ram::new();
        let (mut store, _) = Store::open(&mut ram);
        for i in 0..4 * SLOTS as u8 {
            store.save(&mut ram, &[i; 40]).unwrap();
            let (again, stored) = Store::open(&mut ram);
            assert_eq!(stored.as_deref(), Some(&[i; 40][..]));
            // A store that has gone on, and one that was opened anew, agree on what comes next.
            if i % 2 == 0 {
                store = again;
            }
        }
        assert_eq!(ram.erases, 4);
    }

    #[test]
    fn a_slot_that_was_torn_is_not_written_again() {
        let mut ram = Ram::new();
        let (mut store, _) = Store::open(&mut ram);
        store.save(&mut ram, b"old").unwrap();
        ram.power = 0;
        assert_eq!(store.save(&mut ram, b"lost"), Err(NotSaved));
        ram.power = 9;
        assert_eq!(store.save(&mut ram, b"torn"), Err(NotSaved));
        ram.power = usize::MAX;
        store.save(&mut ram, b"new").unwrap();
        assert_eq!(Store::open(&mut ram).1.as_deref(), Some(&b"new"[..]));
    }

    #[test]
    fn a_new_board_has_none_and_the_last_saved_are_found() {
        let mut ram = Ram::new();
        let (mut store, stored) = Store::open(&mut ram);
        assert_eq!(stored, None);
        for settings in [&b"first"[..], b"second", b"third and longer"] {
            store.save(&mut ram, settings).unwrap();
            let (again, stored) = Store::open(&mut ram);
            assert_eq!(stored.as_deref(), Some(settings));
            store = again;
        }
    }

    #[test]
    fn whenever_the_power_goes_the_old_or_the_new_are_there_whole() {
        for power in 0..60 {
            let mut ram = Ram::new();
            let (mut store, _) = Store::open(&mut ram);
            store.save(&mut ram, b"the old settings").unwrap();
            ram.power = power;
            let saved = store.save(&mut ram, b"the new settings");
            let (_, stored) = Store::open(&mut ram);
            let expected: &[u8] = match saved {
                Ok(()) => b"the new settings",
                Err(NotSaved) => b"the old settings",
            };
            assert_eq!(stored.as_deref(), Some(expected), "power for {power} bytes");
        }
    }

    #[test]
    fn where_the_only_record_is_torn_the_controller_hears_of_it() {
        let mut ram = Ram::new();
        ram.power = 12;
        let (mut store, _) = Store::open(&mut ram);
        assert_eq!(store.save(&mut ram, b"settings"), Err(NotSaved));
        assert_eq!(Store::open(&mut ram).1, Some(Stored::new()));
    }
}
