//! Settings in flash: two sectors take turns, so that the old ones are there until the new ones are
//! whole. A record: number (counts saves), settings, padding, CRC-32C of all that.

use embassy_stm32::flash::{Blocking, Flash};
use gonia_firmware::hardware::NotSaved;
use gonia_firmware::settings::STORED_LEN;
use gonia_protocol::crc32c;

/// Offsets of sectors 6 and 7, 128 kB each.
const SECTORS: [u32; 2] = [0x4_0000, 0x6_0000];
const SECTOR_LEN: u32 = 0x2_0000;
/// Whole words.
const RECORD_LEN: usize = (4 + STORED_LEN + 4).next_multiple_of(4);
const CRC_AT: usize = RECORD_LEN - 4;

/// The two sectors.
pub struct Store {
    flash: Flash<'static, Blocking>,
    newest: Option<(usize, u32)>,
}

impl Store {
    /// Opens the store, and returns the newest settings in it: `None` on a new board, and bytes
    /// that are no settings where both sectors are damaged, so that the controller says so.
    pub fn open(mut flash: Flash<'static, Blocking>) -> (Self, Option<[u8; STORED_LEN]>) {
        let mut newest: Option<(usize, u32)> = None;
        let mut stored = None;
        for (i, sector) in SECTORS.into_iter().enumerate() {
            let mut record = [0; RECORD_LEN];
            let read = flash.blocking_read(sector, &mut record);
            if read.is_ok() && record.iter().all(|&byte| byte == 0xFF) {
                continue;
            }
            match number_of(&record) {
                Some(number) if newest.is_none_or(|(_, other)| number > other) => {
                    newest = Some((i, number));
                    stored = Some(settings_of(&record));
                }
                Some(_) => {}
                // Torn: worth nothing beside a whole one, worth a word if it is the only one.
                None => stored = stored.or(Some([0; STORED_LEN])),
            }
        }
        (Self { flash, newest }, stored)
    }

    /// Saves settings in the sector whose record is older. Takes up to two seconds.
    pub fn save(&mut self, settings: &[u8]) -> Result<(), NotSaved> {
        let (used, number) = self.newest.unwrap_or((1, 0));
        let (next, number) = (1 - used, number.wrapping_add(1));
        let mut record = [0; RECORD_LEN];
        record[..4].copy_from_slice(&number.to_le_bytes());
        let room = record.get_mut(4..4 + settings.len()).ok_or(NotSaved)?;
        room.copy_from_slice(settings);
        let crc = crc32c(&record[..CRC_AT]);
        record[CRC_AT..].copy_from_slice(&crc.to_le_bytes());

        let sector = SECTORS[next];
        self.flash
            .blocking_erase(sector, sector + SECTOR_LEN)
            .map_err(|_| NotSaved)?;
        self.flash
            .blocking_write(sector, &record)
            .map_err(|_| NotSaved)?;
        let mut check = [0; RECORD_LEN];
        self.flash
            .blocking_read(sector, &mut check)
            .map_err(|_| NotSaved)?;
        if check != record {
            return Err(NotSaved);
        }
        self.newest = Some((next, number));
        Ok(())
    }
}

fn number_of(record: &[u8; RECORD_LEN]) -> Option<u32> {
    let (content, crc) = record.split_at(CRC_AT);
    let (number, _) = content.split_first_chunk::<4>()?;
    (crc32c(content).to_le_bytes() == crc).then_some(u32::from_le_bytes(*number))
}

fn settings_of(record: &[u8; RECORD_LEN]) -> [u8; STORED_LEN] {
    let mut settings = [0; STORED_LEN];
    settings.copy_from_slice(&record[4..4 + STORED_LEN]);
    settings
}
