//! The two sectors of flash that keep the settings.

use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::pac;
use embassy_stm32::pac::flash::vals::Psize;
use gonia_firmware::hardware::NotSaved;
use gonia_firmware::store::{RECORD_MAX, Sectors};

use crate::alive;

/// Offsets of sectors 1 and 2, 16 kB each: erasing one by words takes half a second at most, where one of
/// 128 kB by bytes takes four.
const SECTORS: [u32; 2] = [0x4000, 0x8000];
const SECTOR_LEN: u32 = 0x4000;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Sectors 1 and 2 of the chip's own flash.
pub struct FlashSectors(pub Flash<'static, Blocking>);

impl FlashSectors {
    fn place(sector: usize, slot: usize) -> Result<u32, NotSaved> {
        let from = SECTORS.get(sector).ok_or(NotSaved)?;
        Ok(from + (slot * RECORD_MAX) as u32)
    }
}

impl Sectors for FlashSectors {
    fn slots(&self) -> usize {
        SECTOR_LEN as usize / RECORD_MAX
    }

    fn read(&mut self, sector: usize, slot: usize, out: &mut [u8]) -> Result<(), NotSaved> {
        let from = Self::place(sector, slot)?;
        self.0.blocking_read(from, out).map_err(|_| NotSaved)
    }

    fn erase(&mut self, sector: usize) -> Result<(), NotSaved> {
        let from = Self::place(sector, 0)?;
        erase_by_words();
        // The processor waits for its instructions while this lasts.
        alive::stretched(|| self.0.blocking_erase(from, from + SECTOR_LEN)).map_err(|_| NotSaved)
    }

    fn write(&mut self, sector: usize, slot: usize, bytes: &[u8]) -> Result<(), NotSaved> {
        let from = Self::place(sector, slot)?;
        self.0.blocking_write(from, bytes).map_err(|_| NotSaved)
    }
}

/// The width that an erase works with is the one that was set last: bytes, after a reset. At 3.3 V words are
/// allowed, and twice as fast.
fn erase_by_words() {
    if pac::FLASH.cr().read().lock() {
        for key in KEYS {
            pac::FLASH.keyr().write_value(key);
        }
    }
    pac::FLASH.cr().modify(|w| w.set_psize(Psize::PSIZE32));
    pac::FLASH.cr().modify(|w| w.set_lock(true));
}
