//! ControllerSettings in two sectors of flash that take turns: the old ones are there until the new ones are
//! whole, whenever the power goes.
//!
//! A record: number (counts saves), length of the settings, settings, CRC-32C of all that; little
//! endian. The length is in the record so that newer firmware finds what older firmware wrote.

use gonia_protocol::crc32c;
use heapless::Vec;

use crate::hardware::NotSaved;
use crate::settings::STORED_LEN;

/// The longest stored form of settings that this firmware reads, also those of newer firmware.
pub const STORED_MAX: usize = 512;
const HEAD: usize = 8;
/// The longest record, in whole words, which is how flash is written.
pub const RECORD_MAX: usize = HEAD + STORED_MAX + 4;
/// ControllerSettings as they were stored.
pub type Stored = Vec<u8, STORED_MAX>;

const _: () = assert!(STORED_LEN <= STORED_MAX && RECORD_MAX.is_multiple_of(4));

/// Two sectors of flash, each at least [`RECORD_MAX`] long. Erased flash reads 0xFF.
pub trait Sectors {
    /// Reads from the beginning of a sector.
    fn read(&mut self, sector: usize, out: &mut [u8]) -> Result<(), NotSaved>;
    /// Erases a sector.
    fn erase(&mut self, sector: usize) -> Result<(), NotSaved>;
    /// Writes whole words to the beginning of an erased sector.
    fn write(&mut self, sector: usize, bytes: &[u8]) -> Result<(), NotSaved>;
}

/// Knows which sector is the newer one.
#[derive(Debug, Default)]
pub struct Store {
    newest: Option<(usize, u32)>,
}

impl Store {
    /// Looks at both sectors, and returns the newest settings: `None` on a new board, and bytes that
    /// are no settings where nothing whole is left, so that the controller says so.
    pub fn open(sectors: &mut impl Sectors) -> (Self, Option<Stored>) {
        let (mut newest, mut stored): (Option<(usize, u32)>, _) = (None, None);
        let mut is_torn = false;
        for sector in 0..2 {
            let mut record = [0; RECORD_MAX];
            let read = sectors.read(sector, &mut record);
            if read.is_ok() && record[..HEAD].iter().all(|&byte| byte == 0xFF) {
                continue;
            }
            match parse(&record) {
                Some((number, settings)) if newest.is_none_or(|(_, other)| number > other) => {
                    newest = Some((sector, number));
                    stored = Some(settings);
                }
                Some(_) => {}
                None => is_torn = true,
            }
        }
        // Torn: worth nothing beside a whole one, worth a word if it is the only one.
        if stored.is_none() && is_torn {
            stored = Some(Stored::new());
        }
        (Self { newest }, stored)
    }

    /// Saves settings in the sector whose record is older, and reads them back.
    pub fn save(&mut self, sectors: &mut impl Sectors, settings: &[u8]) -> Result<(), NotSaved> {
        let (used, number) = self.newest.unwrap_or((1, 0));
        let (sector, number) = (1 - used, number.wrapping_add(1));
        let length = u32::try_from(settings.len()).map_err(|_| NotSaved)?;
        let mut record: Vec<u8, RECORD_MAX> = Vec::new();
        for part in [&number.to_le_bytes()[..], &length.to_le_bytes(), settings] {
            record.extend_from_slice(part).map_err(|_| NotSaved)?;
        }
        let crc = crc32c(&record).to_le_bytes();
        record.extend_from_slice(&crc).map_err(|_| NotSaved)?;
        let words = record.len().next_multiple_of(4);
        record.resize(words, 0).map_err(|_| NotSaved)?;

        sectors.erase(sector)?;
        sectors.write(sector, &record)?;
        let mut check = [0; RECORD_MAX];
        sectors.read(sector, &mut check)?;
        if check[..words] != record[..] {
            return Err(NotSaved);
        }
        self.newest = Some((sector, number));
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

    /// Flash whose power goes after so many bytes.
    struct Ram {
        sectors: [[u8; RECORD_MAX]; 2],
        power: usize,
    }

    impl Ram {
        fn new() -> Self {
            Self {
                sectors: [[0xFF; RECORD_MAX]; 2],
                power: usize::MAX,
            }
        }
    }

    impl Sectors for Ram {
        fn read(&mut self, sector: usize, out: &mut [u8]) -> Result<(), NotSaved> {
            out.copy_from_slice(&self.sectors[sector][..out.len()]);
            Ok(())
        }
        fn erase(&mut self, sector: usize) -> Result<(), NotSaved> {
            self.sectors[sector].fill(0xFF);
            Ok(())
        }
        fn write(&mut self, sector: usize, bytes: &[u8]) -> Result<(), NotSaved> {
            let n = bytes.len().min(self.power);
            self.sectors[sector][..n].copy_from_slice(&bytes[..n]);
            if n < bytes.len() {
                return Err(NotSaved);
            }
            Ok(())
        }
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
